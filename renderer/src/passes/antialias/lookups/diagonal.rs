//! Coverage under re-vectorised diagonal stairs of edges (section 10.4.2, figure 10.8).

use super::Crossing;

/// Subsample offsets (x, y) in pixels, y up, one block of the area texture each.
pub const DIAGONAL_OFFSETS: [(f64, f64); 5] =
    [(0.0, 0.0), (0.25, -0.25), (-0.25, 0.25), (0.125, -0.125), (-0.125, 0.125)];

/// The offset of the same sample seen in a mirror along the stair.
pub const OPPOSITE_DIAGONAL_OFFSET: [usize; 5] = [0, 2, 1, 4, 3];

/// Areas are counted on a grid with this many points per side, the pixel's border included.
const POINTS: usize = 30;

type Point = (f64, f64);

/// Areas of the two pixels beside one step of a diagonal stair, `[below, above]`, fractions of a pixel.
///
/// Steps go from (0, 0) to (`left + right + 1`) in both directions. A crossing edge fixes where the contour
/// starts or ends: in the corner (1, 0) or (1, 1) of the stair's end pixel. Where both cross, or none, both
/// contours are possible and their mean counts. An open end leaves the stair through (0, 0) or (1, 0).
pub fn diagonal_area(
    near: Crossing,
    far: Crossing,
    left: usize,
    right: usize,
    offset: (f64, f64),
) -> [f64; 2] {
    const UPPER: Point = (1.0, 1.0);
    const LOWER: Point = (1.0, 0.0);
    const OUTER: Point = (0.0, 0.0);
    let (starts, ends) = match (near, far) {
        (0, 0) => ([UPPER, LOWER], [UPPER, LOWER]),
        _ => {
            let start = [[OUTER, LOWER], [LOWER, LOWER], [UPPER, UPPER], [UPPER, LOWER]][near as usize];
            let end = [[OUTER, LOWER], [UPPER, UPPER], [LOWER, LOWER], [UPPER, LOWER]][far as usize];
            (start, end)
        }
    };
    let length = (left + right + 1) as f64;
    let shift = |crossing: Crossing| if crossing > 0 { offset } else { (0.0, 0.0) };
    let (near_shift, far_shift) = (shift(near), shift(far));
    let mut sum = [0.0; 2];
    for (start, end) in starts.into_iter().zip(ends) {
        let from = (start.0 + near_shift.0, start.1 + near_shift.1);
        let to = (end.0 + length + far_shift.0, end.1 + length + far_shift.1);
        let x = left as f64;
        sum[0] += (1.0 - covered(from, to, (x + 1.0, x))) / 2.0;
        sum[1] += covered(from, to, (x + 1.0, x + 1.0)) / 2.0;
    }
    sum
}

/// Fraction of the pixel with its corner at `pixel` which lies strictly right of and below the line.
///
/// Within a row the side of the line changes once, so the place of the change is enough.
///
/// A line of no length leaves the pixel covered. (It occurs only for stairs of one step, where shifted
/// subsamples can also turn the line around; then every point is tested.)
fn covered(from: Point, to: Point, pixel: Point) -> f64 {
    if from == to {
        return 1.0;
    }
    let middle = ((from.0 + to.0) / 2.0, (from.1 + to.1) / 2.0);
    let normal = (to.1 - from.1, from.0 - to.0);
    let spacing = 1.0 / (POINTS - 1) as f64;
    let mut count = 0;
    for row in 0..POINTS {
        let y = pixel.1 + row as f64 / (POINTS - 1) as f64;
        let across = normal.1 * (y - middle.1);
        let inside = |column: i32| {
            let x = pixel.0 + f64::from(column) / (POINTS - 1) as f64;
            normal.0 * (x - middle.0) + across > 0.0
        };
        if normal.0 <= 0.0 {
            count += (0..POINTS as i32).filter(|&column| inside(column)).count() as i32;
            continue;
        }
        let change = (middle.0 - across / normal.0 - pixel.0) / spacing;
        let mut first = (change.ceil() as i32).clamp(0, POINTS as i32);
        while first > 0 && inside(first - 1) {
            first -= 1;
        }
        while first < POINTS as i32 && !inside(first) {
            first += 1;
        }
        count += POINTS as i32 - first;
    }
    f64::from(count) / (POINTS * POINTS) as f64
}

/// Exact areas `[below, above]` of the two pixels beside one step of a stair that a straight line left.
///
/// The stair has `before` edges before the step in question and `after` behind it, with alternating steps and risers.
/// It begins and ends with halves of longer steps, both level or both upright, so that both numbers are even or both
/// odd. The line runs through the middles of the two longer steps, which are the stair's ends: on one side of its
/// centre line at the beginning, on the other at the end. `offset` moves the sample inside the pixel.
pub fn stair_area(before: usize, after: usize, offset: (f64, f64)) -> [f64; 2] {
    debug_assert_eq!(before % 2, after % 2);
    // The step goes from (0, 0) to (1, 0), y up. With u = x + y along the stair and v = y - x + 1/2 across, the middle
    // of every edge is at v = 0, and its ends are half a pixel to the sides.
    let start_v = if before.is_multiple_of(2) { 0.5 } else { -0.5 };
    let slope = -2.0 * start_v / (before + after + 1) as f64;
    let shift = offset.1 - offset.0;
    // How far a point is above the line, in v.
    let height = |(x, y): Point| {
        let (u, v) = (x + y, y - x + 0.5);
        v - shift - start_v - slope * (u + before as f64)
    };
    let above = part_below([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], height);
    let below = 1.0 - part_below([(0.0, -1.0), (1.0, -1.0), (1.0, 0.0), (0.0, 0.0)], height);
    [below, above]
}

/// Area of the part of a polygon where `height`, which is linear, is under zero.
fn part_below(corners: [Point; 4], height: impl Fn(Point) -> f64) -> f64 {
    let mut kept: Vec<Point> = Vec::with_capacity(6);
    for (i, &a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % 4];
        let (at_a, at_b) = (height(a), height(b));
        if at_a < 0.0 {
            kept.push(a);
        }
        if (at_a < 0.0) != (at_b < 0.0) {
            let t = at_a / (at_a - at_b);
            kept.push((a.0 + t * (b.0 - a.0), a.1 + t * (b.1 - a.1)));
        }
    }
    let cross = |i: usize| {
        let (a, b) = (kept[i], kept[(i + 1) % kept.len()]);
        a.0 * b.1 - b.0 * a.1
    };
    0.5 * (0..kept.len()).map(cross).sum::<f64>()
}
