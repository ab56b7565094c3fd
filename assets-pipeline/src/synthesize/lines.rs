//! Curves on the plan of the face (wrinkles, hairs), found by place.

use glam::Vec2;

/// A smooth curve through its knots and how far its influence reaches.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    points: Vec<Vec2>,
    /// Arc length from the start to each point, mm.
    lengths: Vec<f32>,
    reach_mm: f32,
}

impl Line {
    /// A Catmull-Rom curve through the knots (at least two), sampled about every `step_mm`.
    pub(crate) fn through(knots: &[Vec2], step_mm: f32, reach_mm: f32) -> Self {
        let mut points = vec![knots[0]];
        let at = |i: isize| knots[i.clamp(0, knots.len() as isize - 1) as usize];
        for i in 0..knots.len() as isize - 1 {
            let (p0, p1, p2, p3) = (at(i - 1), at(i), at(i + 1), at(i + 2));
            let steps = (p1.distance(p2) / step_mm).ceil().max(1.0) as usize;
            for k in 1..=steps {
                let t = k as f32 / steps as f32;
                let (t2, t3) = (t * t, t * t * t);
                points.push(
                    0.5 * (2.0 * p1
                        + (p2 - p0) * t
                        + (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3) * t2
                        + (3.0 * p1 - p0 - 3.0 * p2 + p3) * t3),
                );
            }
        }
        let mut lengths = vec![0.0];
        for w in points.windows(2) {
            lengths.push(lengths[lengths.len() - 1] + w[0].distance(w[1]));
        }
        Self { points, lengths, reach_mm }
    }

    /// Arc length, mm.
    pub(crate) fn length_mm(&self) -> f32 {
        self.lengths[self.lengths.len() - 1]
    }
}

/// The nearest point of a line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nearest {
    /// Index of the line.
    pub line: usize,
    /// Distance in mm, positive on the left of the line's direction.
    pub distance_mm: f32,
    /// Arc length from the start, mm.
    pub along_mm: f32,
}

/// Lines sorted into square cells.
pub(crate) struct Lines {
    lines: Vec<Line>,
    origin: Vec2,
    cell_mm: f32,
    columns: usize,
    rows: usize,
    /// Entries of cell i are `entries[starts[i]..starts[i + 1]]`, ordered by line.
    starts: Vec<u32>,
    entries: Vec<(u32, u32)>,
}

impl Lines {
    pub(crate) fn new(lines: Vec<Line>, cell_mm: f32) -> Self {
        let (mut low, mut high) = (Vec2::splat(f32::MAX), Vec2::splat(f32::MIN));
        for line in &lines {
            for p in &line.points {
                low = low.min(*p - line.reach_mm);
                high = high.max(*p + line.reach_mm);
            }
        }
        if lines.is_empty() {
            (low, high) = (Vec2::ZERO, Vec2::ZERO);
        }
        let extent = ((high - low) / cell_mm).ceil().max(Vec2::ONE);
        let (columns, rows) = (extent.x as usize, extent.y as usize);
        let mut cells = vec![Vec::new(); columns * rows];
        for (i, line) in lines.iter().enumerate() {
            for (k, w) in line.points.windows(2).enumerate() {
                let a = (w[0].min(w[1]) - line.reach_mm - low) / cell_mm;
                let b = (w[0].max(w[1]) + line.reach_mm - low) / cell_mm;
                for y in a.y as usize..=(b.y as usize).min(rows - 1) {
                    for x in a.x as usize..=(b.x as usize).min(columns - 1) {
                        cells[y * columns + x].push((i as u32, k as u32));
                    }
                }
            }
        }
        let mut starts = vec![0];
        let mut entries = Vec::new();
        for cell in cells {
            entries.extend(cell);
            starts.push(entries.len() as u32);
        }
        Self { lines, origin: low, cell_mm, columns, rows, starts, entries }
    }

    pub(crate) fn line(&self, index: usize) -> &Line {
        &self.lines[index]
    }

    /// Entries of the cell of a place.
    fn cell(&self, p: Vec2) -> &[(u32, u32)] {
        let cell = ((p - self.origin) / self.cell_mm).floor();
        if cell.x < 0.0 || cell.y < 0.0 || cell.x >= self.columns as f32 || cell.y >= self.rows as f32 {
            return &[];
        }
        let cell = cell.y as usize * self.columns + cell.x as usize;
        &self.entries[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// True when no line reaches the cell of a place.
    pub(crate) fn is_empty_about(&self, p: Vec2) -> bool {
        self.cell(p).is_empty()
    }

    /// Calls `visit` for each line within its reach of `p`.
    pub(crate) fn near(&self, p: Vec2, mut visit: impl FnMut(Nearest)) {
        for same_line in self.cell(p).chunk_by(|a, b| a.0 == b.0) {
            let index = same_line[0].0 as usize;
            let line = &self.lines[index];
            let mut best = Nearest { line: index, distance_mm: f32::MAX, along_mm: 0.0 };
            for (_, k) in same_line {
                let k = *k as usize;
                let (a, b) = (line.points[k], line.points[k + 1]);
                let edge = b - a;
                let t = ((p - a).dot(edge) / edge.length_squared().max(1e-12)).clamp(0.0, 1.0);
                let away = p - a - t * edge;
                let distance = away.length();
                if distance < best.distance_mm.abs() {
                    best.distance_mm = distance.copysign(edge.perp_dot(away));
                    best.along_mm = line.lengths[k] + t * (line.lengths[k + 1] - line.lengths[k]);
                }
            }
            if best.distance_mm.abs() <= line.reach_mm {
                visit(best);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_of_each_line_is_found() {
        let straight = Line::through(&[Vec2::new(-10.0, 0.0), Vec2::new(10.0, 0.0)], 1.0, 3.0);
        assert!((straight.length_mm() - 20.0).abs() < 1e-4);
        let upright = Line::through(&[Vec2::new(4.0, -5.0), Vec2::new(4.0, 5.0)], 1.0, 3.0);
        let lines = Lines::new(vec![straight, upright], 2.0);
        let mut found = Vec::new();
        lines.near(Vec2::new(2.0, 1.0), |n| found.push(n));
        assert_eq!(found.len(), 2);
        assert!((found[0].distance_mm - 1.0).abs() < 1e-5 && (found[0].along_mm - 12.0).abs() < 1e-4);
        assert!((found[1].distance_mm - 2.0).abs() < 1e-5 && (found[1].along_mm - 6.0).abs() < 1e-4);
        found.clear();
        lines.near(Vec2::new(-5.0, -4.0), |n| found.push(n));
        lines.near(Vec2::new(900.0, 0.0), |n| found.push(n));
        assert!(found.is_empty());
        Lines::new(Vec::new(), 1.0).near(Vec2::ZERO, |_| panic!("there is no line"));
    }
}
