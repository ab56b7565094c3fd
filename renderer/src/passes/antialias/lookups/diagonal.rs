//! Coverage under re-vectorised diagonal stairs of edges (section 10.4.2, figure 10.8).

use super::Crossing;

/// Subsample offsets (x, y) in pixels, y up, one block of the area texture each.
pub const DIAGONAL_OFFSETS: [(f64, f64); 5] =
    [(0.0, 0.0), (0.25, -0.25), (-0.25, 0.25), (0.125, -0.125), (-0.125, 0.125)];

/// Areas are counted on a grid of this many points a side, the pixel's border included.
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
/// Along a row the side of the line changes once, so a row needs the place of the change, not every point.
///
/// A line of no length leaves the pixel covered. (It comes up for stairs of one step only, where shifted
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
