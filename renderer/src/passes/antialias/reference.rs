//! The pass on the CPU, from the equations: edges as plain booleans, one pixel at a time.
//!
//! The image is continued by its border pixels, so there are no new edges outside of it and lines continue.

use super::lookups::{AreaTable, DIAGONAL_SLOT};
use super::settings::{
    Alpha, BlendSpace, EdgeSource, Encoding, Mode, Patterns, Settings, Subsample, search_limits,
};
use super::tables::Tables;
use rayon::prelude::*;

/// An image of RGBA pixels with straight (unassociated) alpha, row 0 first.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Width in pixels, at least 1.
    pub width: usize,
    /// Height in pixels, at least 1.
    pub height: usize,
    /// `width * height` colours, encoded as [`Settings::encoding`] says.
    pub pixels: Vec<[f32; 4]>,
}

impl Picture {
    /// Calls `color` for each pixel.
    pub fn from_fn(width: usize, height: usize, mut color: impl FnMut(usize, usize) -> [f32; 4]) -> Self {
        let pixels = (0..width * height).map(|i| color(i % width, i / width)).collect();
        Self { width, height, pixels }
    }

    /// The pixel at (x, y), or the nearest border pixel.
    pub fn at(&self, x: isize, y: isize) -> [f32; 4] {
        let x = x.clamp(0, self.width as isize - 1) as usize;
        let y = y.clamp(0, self.height as isize - 1) as usize;
        self.pixels[y * self.width + x]
    }
}

/// Edges of pixels: on their upper and on their left border.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Edges {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Whether an edge divides a pixel from the one above.
    pub top: Vec<bool>,
    /// Whether an edge divides a pixel from the one to its left.
    pub left: Vec<bool>,
}

/// Blending weights of the edges of a pixel, in 1/255: the pixel's own part and the opposite pixel's part at the
/// top edge, then the same at the left edge.
pub type Weights = [u8; 4];

/// sRGB transfer function (IEC 61966-2-1), light to stored value; continued over one, zero under zero.
pub fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear.max(0.0) } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The inverse of [`srgb_from_linear`].
pub fn linear_from_srgb(stored: f32) -> f32 {
    if stored <= 0.040_45 { stored.max(0.0) / 12.92 } else { ((stored + 0.055) / 1.055).powf(2.4) }
}

/// Steps of colour in which edge detection counts. Integers make the comparison of contrasts exact, with the
/// same result on every processor; values that come from 8 or 16 bits are hit without rounding.
pub(super) const STEPS: f32 = 65535.0;
/// Colours over this many times white all count as this bright, far over the range of displays.
pub(super) const BRIGHTEST: f32 = 1000.0;

/// The values of a colour that edge detection compares, in [`STEPS`]. Alpha counts too: a black shape on nothing has an
/// edge.
fn feature(color: [f32; 4], settings: &Settings) -> [i32; 4] {
    let encoded = match settings.encoding {
        Encoding::Srgb => color,
        Encoding::Linear => {
            [srgb_from_linear(color[0]), srgb_from_linear(color[1]), srgb_from_linear(color[2]), color[3]]
        }
    };
    let [r, g, b, alpha] = encoded;
    let cover = if settings.alpha == Alpha::Straight { alpha } else { 1.0 };
    let seen = match settings.edges {
        EdgeSource::Color => [r * cover, g * cover, b * cover, alpha],
        // Equation 9.2.
        EdgeSource::Luma | EdgeSource::Depth => {
            [(0.2126 * r + 0.7152 * g + 0.0722 * b) * cover, 0.0, 0.0, alpha]
        }
    };
    seen.map(|value| (value.clamp(0.0, BRIGHTEST) * STEPS).round_ties_even() as i32)
}

/// A difference in [`STEPS`] that reaches `threshold`.
pub(super) fn threshold_steps(threshold: f32) -> i32 {
    (f64::from(threshold) * f64::from(STEPS)).ceil() as i32
}

/// Edge detection, section 9.3 and equation 10.1.
///
/// # Panics
/// The settings need depth and there is none.
pub fn detect_edges(picture: &Picture, depth: Option<&[f32]>, settings: &Settings) -> Edges {
    let (width, height) = (picture.width, picture.height);
    let features: Vec<[i32; 4]> = picture.pixels.par_iter().map(|&color| feature(color, settings)).collect();
    let index = |x: isize, y: isize| {
        y.clamp(0, height as isize - 1) as usize * width + x.clamp(0, width as isize - 1) as usize
    };
    let contrast = |a: usize, b: usize| {
        features[a].iter().zip(&features[b]).map(|(a, b)| (a - b).abs()).max().unwrap_or(0)
    };
    let depth_jump = |a: usize, b: usize, threshold: f32| {
        let depth = depth.expect("these settings need depth");
        (depth[a] - depth[b]).abs() >= threshold
    };
    let edges_at = |i: usize| -> (bool, bool) {
        let (x, y) = ((i % width) as isize, (i / width) as isize);
        let (left, top) = (index(x - 1, y), index(x, y - 1));
        if settings.edges == EdgeSource::Depth {
            return (
                depth_jump(i, left, settings.depth_threshold),
                depth_jump(i, top, settings.depth_threshold),
            );
        }
        let threshold = |neighbor: usize| match settings.predication {
            None => threshold_steps(settings.threshold),
            Some(p) => {
                let relief = if depth_jump(i, neighbor, p.depth_threshold) { p.strength } else { 0.0 };
                threshold_steps(p.scale * settings.threshold * (1.0 - relief))
            }
        };
        let (at_left, at_top) = (contrast(i, left), contrast(i, top));
        let found = (at_left >= threshold(left), at_top >= threshold(top));
        if settings.mode == Mode::Mlaa || found == (false, false) {
            return found;
        }
        // An edge under half the strongest contrast around is masked by it (equation 10.1). Both directions
        // share the maximum, as in the published implementation.
        let strongest = [
            at_left,
            at_top,
            contrast(i, index(x + 1, y)),
            contrast(i, index(x, y + 1)),
            contrast(left, index(x - 2, y)),
            contrast(top, index(x, y - 2)),
        ]
        .into_iter()
        .max()
        .unwrap_or(0);
        (found.0 && strongest <= 2 * at_left, found.1 && strongest <= 2 * at_top)
    };
    let (left, top) = (0..width * height).into_par_iter().map(edges_at).unzip();
    Edges { width, height, top, left }
}

/// Edges seen from a line that runs along x; transposed, columns become rows.
struct Lines<'a> {
    edges: &'a Edges,
    turned: bool,
}

impl Lines<'_> {
    fn get(&self, bits: [&[bool]; 2], x: isize, y: isize) -> bool {
        let Edges { width, height, .. } = *self.edges;
        let ((x, y), bits) = if self.turned { ((y, x), bits[1]) } else { ((x, y), bits[0]) };
        bits[y.clamp(0, height as isize - 1) as usize * width + x.clamp(0, width as isize - 1) as usize]
    }

    fn length(&self) -> isize {
        (if self.turned { self.edges.height } else { self.edges.width }) as isize
    }

    /// Edge along the line, above pixel (x, y).
    fn line(&self, x: isize, y: isize) -> bool {
        let rows = if self.turned { self.edges.width } else { self.edges.height } as isize;
        y < rows && self.get([&self.edges.top, &self.edges.left], x, y)
    }

    /// Edge across the line, left of pixel (x, y).
    fn crossing(&self, x: isize, y: isize) -> bool {
        x > 0 && x < self.length() && self.get([&self.edges.left, &self.edges.top], x, y)
    }

    fn crossing_code(&self, x: isize, y: isize) -> u32 {
        u32::from(self.crossing(x, y - 1)) | u32::from(self.crossing(x, y)) << 1
    }

    /// Whether a crossing edge ends a line between (x - 1, y) and (x, y).
    fn is_crossed(&self, x: isize, y: isize, stop: Stop) -> bool {
        match (stop, self.crossing_code(x, y)) {
            (Stop::Never, _) | (_, 0) => false,
            // Where contours cross, this one continues, except where two pixels of a thin shape touch.
            (Stop::AtTurns, 3) => !self.crossing(x, y - 2) && !self.crossing(x, y + 1),
            _ => true,
        }
    }

    /// Pixels from x to the end of the line in direction `step`, at most `limit`.
    fn distance(&self, x: isize, y: isize, step: isize, limit: u32, stop: Stop) -> u32 {
        let mut at = x;
        for distance in 0..limit {
            // The border between `at` and the next pixel belongs to the right one of the two.
            let border = if step < 0 { at } else { at + 1 };
            if self.is_crossed(border, y, stop) || !self.line(at + step, y) {
                return distance;
            }
            at += step;
        }
        limit
    }

    fn has(&self, x: isize, y: isize) -> bool {
        let (width, height) = (self.edges.width as isize, self.edges.height as isize);
        let (length, count) = if self.turned { (height, width) } else { (width, height) };
        (0..length).contains(&x) && (0..count).contains(&y)
    }
}

/// What ends a line of edges, besides its last edge.
#[derive(Clone, Copy)]
enum Stop {
    /// Nothing else: chapter 9.
    Never,
    /// Crossing edges on any side, as in the published shader.
    AtCrossings,
    /// Crossing edges, but not those of another contour that crosses this one.
    AtTurns,
}

impl Stop {
    fn of(settings: &Settings) -> Self {
        match (settings.mode, settings.patterns) {
            (Mode::Mlaa, _) => Self::Never,
            (_, Patterns::Published) => Self::AtCrossings,
            (_, Patterns::Revised) => Self::AtTurns,
        }
    }
}

/// Distances from (x, y) to the ends of the line of edges through its upper border.
#[cfg(test)]
pub(super) fn row_distances(edges: &Edges, x: isize, y: isize, settings: &Settings) -> (u32, u32) {
    let lines = Lines { edges, turned: false };
    let (left, right) = search_limits(settings);
    (lines.distance(x, y, -1, left, Stop::of(settings)), lines.distance(x, y, 1, right, Stop::of(settings)))
}

/// Weight of two packed 16-bit fractions.
fn unpack(area: u32) -> [f64; 2] {
    [f64::from(area & 0xffff) / 65535.0, f64::from(area >> 16) / 65535.0]
}

/// Weights of the line of edges through the upper border of (x, y), sections 9.4 and 10.4.2.
fn line_weights(
    lines: &Lines,
    x: isize,
    y: isize,
    block: usize,
    areas: &AreaTable,
    settings: &Settings,
) -> [f64; 2] {
    let (limit_left, limit_right) = search_limits(settings);
    let left = lines.distance(x, y, -1, limit_left, Stop::of(settings));
    let right = lines.distance(x, y, 1, limit_right, Stop::of(settings));
    let (first, after) = (x - left as isize, x + right as isize + 1);
    let pattern = lines.crossing_code(first, y) | lines.crossing_code(after, y) << 2;
    let entry = ((block as u32 * 16 + pattern) * areas.stride + left) * areas.stride + right;
    let mut area = unpack(areas.areas[entry as usize]);
    if settings.corner_rounding < 100 {
        // Equations 10.2 and 10.3: a crossing two pixels long is a corner. In the middle of a line both ends
        // count half.
        let reduction = 1.0 - f64::from(settings.corner_rounding) / 100.0;
        let (near, far) = (left <= right, right <= left);
        let share = if near && far { 0.5 } else { 1.0 };
        for (side, row) in [(0, y + 1), (1, y - 2)] {
            let corners = usize::from(near && lines.crossing(first, row))
                + usize::from(far && lines.crossing(after, row));
            area[side] *= (1.0 - reduction * share * corners as f64).max(0.0);
        }
    }
    area
}

/// An edge of a stair, with its place relative to the edge that the search started at.
#[derive(Clone, Copy)]
struct Edge {
    x: isize,
    y: isize,
    is_level: bool,
}

/// Weights of the stair through the upper border of (x, y) that rises to the right, or falls, if a straight line can
/// have produced it ([`Patterns::Revised`]).
fn stair_weights(
    lines: &Lines,
    (x, y): (isize, isize),
    rises: bool,
    block: usize,
    areas: &AreaTable,
    steps: u32,
) -> Option<[f64; 2]> {
    let exists = |edge: Edge| {
        let Edge { x, y, is_level } = edge;
        lines.has(x, y) && if is_level { lines.line(x, y) } else { lines.crossing(x, y) }
    };
    let up = if rises { -1 } else { 1 };
    // The vertices of the stair lie between pixels: vertex (x, y) is the upper left corner of pixel (x, y).
    let level = |(x, y): (isize, isize), to: isize| Edge { x: x.min(x + to), y, is_level: true };
    let upright = |(x, y): (isize, isize), to: isize| Edge { x, y: y.min(y + to * up), is_level: false };
    // Edges beyond the first in direction `to`, and whether the last one goes straight on.
    let follow = |to: isize| {
        let mut vertex = if to > 0 { (x + 1, y) } else { (x, y) };
        let mut is_level = true;
        for count in 0..2 * steps {
            let (turn, straight) = match is_level {
                true => (upright(vertex, to), level(vertex, to)),
                false => (level(vertex, to), upright(vertex, to)),
            };
            if !exists(turn) {
                return (count, exists(straight));
            }
            vertex = if is_level { (vertex.0, vertex.1 + to * up) } else { (vertex.0 + to, vertex.1) };
            is_level = !is_level;
        }
        (2 * steps, false)
    };
    let ((before, starts), (after, ends)) = (follow(-1), follow(1));
    // Both ends level or both upright: the line drifts from one side of the stair to the other.
    if !(starts && ends && before % 2 == after % 2 && before + after >= 4) {
        return None;
    }
    let slot = 2 * steps + 1;
    let entry = (block as u32 * slot + before) * slot + after;
    let [below, above] = unpack(areas.areas[(areas.diagonal_base + entry) as usize]);
    Some(if rises { [below, above] } else { [above, below] })
}

/// Weights of the edge through the upper border of (x, y): of the stairs that it belongs to, or of its line.
/// `blocks` are those of lines, of rising and of falling stairs.
fn revised_weights(
    lines: &Lines,
    x: isize,
    y: isize,
    blocks: [usize; 3],
    areas: &AreaTable,
    settings: &Settings,
) -> [f64; 2] {
    let steps = settings.diagonal_steps;
    let stair = |rises, block| stair_weights(lines, (x, y), rises, block, areas, steps);
    let [rising, falling] = match steps {
        0 => [None; 2],
        _ => [stair(true, blocks[1]), stair(false, blocks[2])],
    };
    match (rising, falling) {
        (Some(a), Some(b)) => [a[0] + b[0], a[1] + b[1]],
        (a, b) => a.or(b).unwrap_or_else(|| line_weights(lines, x, y, blocks[0], areas, settings)),
    }
}

/// Weights of the two diagonals through the upper border of a pixel, zeros where there is none.
#[derive(Clone, Copy, Default)]
struct Diagonals {
    rising: [f64; 2],
    falling: [f64; 2],
}

/// Diagonals through the upper border of (x, y).
fn diagonal_weights(
    edges: &Edges,
    x: isize,
    y: isize,
    blocks: [usize; 2],
    areas: &AreaTable,
    steps: u32,
) -> Diagonals {
    let upright = Lines { edges, turned: false };
    let top = |x: isize, y: isize| upright.line(x, y);
    let left = |x: isize, y: isize| upright.crossing(x, y);
    let lookup = |block: usize, near: u32, far: u32, distances: (u32, u32)| {
        let slot = DIAGONAL_SLOT as u32;
        let pattern = block as u32 * 16 + near + 4 * far;
        unpack(
            areas.areas[(areas.diagonal_base + (pattern * slot + distances.0) * slot + distances.1) as usize],
        )
    };
    // Steps along which the stair goes on, whether its end was found, and the first bit of the last place looked at.
    let walk = |stair: &dyn Fn(isize) -> (bool, bool)| {
        for step in 1..=steps as isize {
            let (riser, tread) = stair(step);
            if !(riser && tread) {
                return (step as u32 - 1, true, tread);
            }
        }
        (steps - 1, false, true)
    };
    let (mut rising, mut falling) = ([0.0; 2], [0.0; 2]);

    // Rising to the right: steps of a left and a top edge of the same pixel.
    let mut near = (0, true, false);
    if left(x, y) {
        near = walk(&|i| (left(x - i, y + i), top(x - i, y + i)));
        near.0 += u32::from(near.2);
    }
    let far = walk(&|i| (left(x + i, y - i), top(x + i, y - i)));
    if near.0 + far.0 > 2 {
        let (a, b) = (near.0 as isize, far.0 as isize);
        let near_code = u32::from(left(x - a, y + a)) + 2 * u32::from(top(x - a - 1, y + a));
        let far_code = u32::from(left(x + b + 1, y - b - 1)) + 2 * u32::from(top(x + b + 1, y - b));
        let found = |code: u32, found: bool| if found { code } else { 0 };
        rising = lookup(blocks[0], found(near_code, near.1), found(far_code, far.1), (near.0, far.0));
    }

    // Falling to the right: steps of a right and a top edge of the same pixel.
    let near = walk(&|i| (left(x - i + 1, y - i), top(x - i, y - i)));
    let mut far = (0, true, false);
    if left(x + 1, y) {
        far = walk(&|i| (left(x + i + 1, y + i), top(x + i, y + i)));
        far.0 += u32::from(far.2);
    }
    if near.0 + far.0 > 2 {
        let (a, b) = (near.0 as isize, far.0 as isize);
        let near_code = u32::from(left(x - a, y - a - 1)) + 2 * u32::from(top(x - a - 1, y - a));
        let far_code = u32::from(left(x + b + 1, y + b)) + 2 * u32::from(top(x + b + 1, y + b));
        let found = |code: u32, found: bool| if found { code } else { 0 };
        let [a, b] = lookup(blocks[1], found(near_code, near.1), found(far_code, far.1), (near.0, far.0));
        falling = [b, a];
    }
    Diagonals { rising, falling }
}

/// Lifts sums that are a half but for rounding, so that ties go up as in integers.
const TIE: f64 = 1e-9;

/// Blending weights of every pixel. `blocks` are places in `areas`, in the order of [`Tables::positions`].
pub fn blending_weights(
    edges: &Edges,
    blocks: [usize; 5],
    areas: &AreaTable,
    settings: &Settings,
) -> Vec<Weights> {
    let byte = |weight: f64| (weight.min(1.0) * 255.0 + 0.5 + TIE).floor() as u8;
    let (rows, columns) = (Lines { edges, turned: false }, Lines { edges, turned: true });
    let [left, top, rising, falling, falling_in_columns] = blocks;
    let at_edges = |i: usize| -> [[f64; 2]; 2] {
        let (x, y) = ((i % edges.width) as isize, (i / edges.width) as isize);
        let mut weights = [[0.0; 2]; 2];
        if settings.patterns == Patterns::Revised {
            if edges.top[i] {
                weights[0] = revised_weights(&rows, x, y, [top, rising, falling], areas, settings);
            }
            if edges.left[i] {
                let blocks = [left, rising, falling_in_columns];
                weights[1] = revised_weights(&columns, y, x, blocks, areas, settings);
            }
            return weights;
        }
        let some = |area: [f64; 2]| area[0] + area[1] > 0.0;
        let mut own = Diagonals::default();
        if edges.top[i] {
            if settings.diagonal_steps > 0 {
                own = diagonal_weights(edges, x, y, [rising, falling], areas, settings.diagonal_steps);
            }
            weights[0] = if some(own.rising) || some(own.falling) {
                [own.rising[0] + own.falling[0], own.rising[1] + own.falling[1]]
            } else {
                line_weights(&rows, x, y, top, areas, settings)
            };
        }
        // Diagonals of a top edge stand for the left edge of the same pixel too.
        if edges.left[i] && !some(own.rising) && !some(own.falling) {
            weights[1] = line_weights(&columns, y, x, left, areas, settings);
        }
        weights
    };
    let weights_at = |i: usize| -> Weights {
        let [top, left] = at_edges(i);
        [byte(top[0]), byte(top[1]), byte(left[0]), byte(left[1])]
    };
    (0..edges.width * edges.height).into_par_iter().map(weights_at).collect()
}

/// Sum of colours with shares that add up to one. Straight alpha weighs colours; where all are invisible they
/// count equally.
fn mix(parts: &[(f32, [f32; 4])], settings: &Settings) -> [f32; 4] {
    let decode = settings.encoding == Encoding::Srgb && settings.blend_space == BlendSpace::Linear;
    let alpha: f32 = parts.iter().map(|(share, color)| share * color[3]).sum();
    let mut mixed = [0.0, 0.0, 0.0, alpha];
    for channel in 0..3 {
        let sum: f32 = parts
            .iter()
            .map(|(share, color)| {
                let value = if decode { linear_from_srgb(color[channel]) } else { color[channel] };
                let share = if alpha > 0.0 && settings.alpha == Alpha::Straight {
                    share * color[3] / alpha
                } else {
                    *share
                };
                share * value
            })
            .sum();
        mixed[channel] = if decode { srgb_from_linear(sum) } else { sum };
    }
    mixed
}

/// The last step: each pixel is mixed with its neighbours (equation 9.1).
pub fn blend(picture: &Picture, weights: &[Weights], settings: &Settings) -> Picture {
    let (width, height) = (picture.width, picture.height);
    let weight = |x: usize, y: usize, channel: usize| {
        if x < width && y < height { f32::from(weights[y * width + x][channel]) / 255.0 } else { 0.0 }
    };
    let blended = |i: usize| -> [f32; 4] {
        let (x, y) = (i % width, i / width);
        let (up, down) = (weight(x, y, 0), weight(x, y + 1, 1));
        let (left, right) = (weight(x, y, 2), weight(x + 1, y, 3));
        if up + down + left + right == 0.0 {
            return picture.pixels[i];
        }
        let (x, y) = (x as isize, y as isize);
        let vertical = [(down, picture.at(x, y + 1)), (up, picture.at(x, y - 1))];
        let horizontal = [(right, picture.at(x + 1, y)), (left, picture.at(x - 1, y))];
        // MLAA averages over all lines through the pixel (section 9.5); SMAA takes the stronger direction.
        let (across, along) = (right.max(left), down.max(up));
        let tie = across == along && settings.patterns == Patterns::Revised;
        let taken: Vec<(f32, [f32; 4])> = if settings.mode == Mode::Mlaa || tie {
            vertical.into_iter().chain(horizontal).collect()
        } else if across > along {
            horizontal.to_vec()
        } else {
            vertical.to_vec()
        };
        // The mean of (1 - a) own + a other over the lines, weighted by a.
        let sum: f32 = taken.iter().map(|(a, _)| a).sum();
        let mut parts = vec![(taken.iter().map(|(a, _)| a / sum * (1.0 - a)).sum(), picture.pixels[i])];
        parts.extend(taken.iter().map(|(a, other)| (a / sum * a, *other)));
        mix(&parts, settings)
    };
    let pixels = (0..width * height).into_par_iter().map(blended).collect();
    Picture { width, height, pixels }
}

/// One sample of a frame, filtered for its place in the pixel.
///
/// # Panics
/// The settings need depth and there is none.
pub fn filter_sample(
    picture: &Picture,
    depth: Option<&[f32]>,
    subsample: &Subsample,
    tables: &Tables,
    settings: &Settings,
) -> Picture {
    if settings.mode == Mode::None {
        return picture.clone();
    }
    let edges = detect_edges(picture, depth, settings);
    let weights = blending_weights(&edges, tables.positions(subsample), &tables.areas, settings);
    blend(picture, &weights, settings)
}

/// All samples of a frame, filtered and averaged in light.
///
/// # Panics
/// There are no pictures, or the settings need depth and there is none.
pub fn filter_samples(pictures: &[Picture], frame: u64, tables: &Tables, settings: &Settings) -> Picture {
    let filtered: Vec<Picture> = pictures
        .iter()
        .zip(settings.mode.subsamples(frame))
        .map(|(picture, subsample)| filter_sample(picture, None, subsample, tables, settings))
        .collect();
    average(&filtered, settings)
}

/// Mean of pictures of the same size, in light.
///
/// # Panics
/// There are no pictures.
pub fn average(pictures: &[Picture], settings: &Settings) -> Picture {
    let share = 1.0 / pictures.len() as f32;
    let pixels = (0..pictures[0].pixels.len())
        .map(|i| {
            let parts: Vec<_> = pictures.iter().map(|picture| (share, picture.pixels[i])).collect();
            mix(&parts, settings)
        })
        .collect();
    Picture { pixels, ..pictures[0] }
}

/// Share of the previous frame (equation 10.6) for speeds in units of [`super::SPEED_UNIT_PX`] per frame.
pub fn history_share(speed: f32, previous_speed: f32) -> f32 {
    0.5 * (1.0 - super::REPROJECTION_WEIGHT * (speed - previous_speed).abs().sqrt()).max(0.0)
}
