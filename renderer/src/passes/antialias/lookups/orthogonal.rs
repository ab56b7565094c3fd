//! Coverage under re-vectorised horizontal (and, turned, vertical) lines of edges.

use super::Crossing;

/// Subsample offsets across the line, in pixels, one block of the area texture each. Block 0 is a sample in
/// the pixel's centre; the others serve S2x and T2x (a quarter) and 4x (odd eighths), figure 10.11.
pub const ORTHOGONAL_OFFSETS: [f64; 7] = [0.0, -0.25, 0.25, -0.125, 0.125, -0.375, 0.375];

/// Lines with both ends turned to the same side (U patterns) up to this length in pixels are blended more than
/// their area, which hides the kink that a short one would show.
const SMOOTHED_LENGTH: f64 = 32.0;

/// Treatment of U patterns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Smoothing {
    /// Exact areas, as in chapter 9. The middle of a U is moved against the sample's offset, which flattens it for
    /// the sample that is nearer to the contour: of -1, -1/2, 0, 1/2 and 1 times the offset, -1 had the lowest error
    /// on circles of radius 3 to 34 px (two samples: 0.085, 0.087, 0.090, 0.091 and 0.092 at 16 px).
    None,
    /// Short ones are strengthened, as in the published SMAA texture.
    Smaa,
}

/// Areas beside one pixel edge of a line of edges, `[below, above]`, fractions of a pixel.
///
/// The line runs along x from 0 to `left + right + 1` at height 0 and the edge in question from `left` to
/// `left + 1`; y points up. A crossing edge at an end lifts the contour half a pixel to its side there (both at
/// once say nothing by themselves, but continue a contour which comes from the other end). The contour then
/// falls to the middle of the line (L patterns, and U patterns as two of them) or crosses it to the other end
/// (Z patterns), figures 9.2 and 10.2. `offset` moves the sample inside the pixel, which lifts the ends.
pub fn orthogonal_area(
    near: Crossing,
    far: Crossing,
    left: usize,
    right: usize,
    offset: f64,
    smoothing: Smoothing,
) -> [f64; 2] {
    let length = (left + right + 1) as f64;
    let is_u = near == far && near != 3;
    let middle = (length / 2.0, if is_u && smoothing == Smoothing::None { -offset } else { 0.0 });
    let side = |own: Crossing, other: Crossing| match (own, other) {
        (1, _) | (3, 2) => Some(0.5 + offset),
        (2, _) | (3, 1) => Some(offset - 0.5),
        _ => None,
    };
    let pixel = left as f64;
    let falling = |height: f64| area_beside((0.0, height), middle, pixel);
    let rising = |height: f64| area_beside(middle, (length, height), pixel);
    let both = |a: [f64; 2], b: [f64; 2]| [a[0] + b[0], a[1] + b[1]];
    match (side(near, far), side(far, near)) {
        (None, None) => [0.0, 0.0],
        (Some(start), None) => falling(start),
        (None, Some(end)) => rising(end),
        (Some(start), Some(end)) if near == far => match smoothing {
            Smoothing::None => both(falling(start), rising(end)),
            Smoothing::Smaa => both(smooth(length, falling(start)), smooth(length, rising(end))),
        },
        (Some(start), Some(end)) => {
            let straight = area_beside((0.0, start), (length, end), pixel);
            // Off the centre a straight contour no longer crosses the line in its middle. For plain Z patterns
            // the published texture takes the mean of it and the contour that does.
            if offset != 0.0 && near != 3 && far != 3 {
                let bent = both(falling(start), rising(end));
                [(straight[0] + bent[0]) / 2.0, (straight[1] + bent[1]) / 2.0]
            } else {
                straight
            }
        }
    }
}

/// Strengthens areas of short lines: the square root at length 0, unchanged from [`SMOOTHED_LENGTH`] on.
fn smooth(length: f64, area: [f64; 2]) -> [f64; 2] {
    let keep = (length / SMOOTHED_LENGTH).min(1.0);
    area.map(|a| {
        let strong = (a * 2.0).sqrt() * 0.5;
        strong + (a - strong) * keep
    })
}

/// Integral of the contour from `start` to `end` over the pixel column `[pixel, pixel + 1]`: the parts under
/// and over height zero, both positive.
fn area_beside(start: (f64, f64), end: (f64, f64), pixel: f64) -> [f64; 2] {
    let (from, to) = (pixel.max(start.0), (pixel + 1.0).min(end.0));
    if from >= to {
        return [0.0, 0.0];
    }
    // Products before quotients: the published bytes are truncated, not rounded, and depend on the last bit.
    let (run, rise) = (end.0 - start.0, end.1 - start.1);
    let height = |x: f64| start.1 + rise * (x - start.0) / run;
    let (first, last) = (height(from), height(to));
    let signed = if first * last < 0.0 {
        let zero = -start.1 * run / rise + start.0;
        [first * (zero - from) / 2.0, last * (to - zero) / 2.0]
    } else {
        [(first + last) / 2.0 * (to - from), 0.0]
    };
    let below = signed.iter().map(|a| (-a).max(0.0)).sum();
    let above = signed.iter().map(|a| a.max(0.0)).sum();
    [below, above]
}
