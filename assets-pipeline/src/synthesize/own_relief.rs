//! Fine relief that the colour of a head shows already: a photograph of skin has its pores, and a second set over them makes
//! another face of it.

use rubor_rig::map::Map;
use rubor_rig::mask::Mask;

/// Coarser texels hold no pores, mm.
const COARSEST_MM: f32 = 0.7;
/// Contrast (deviation over mean) within a millimetre from which half of the skin counts as skin with pores. Half of the
/// Lee Perry-Smith map has more than 0.016, half of a painted avatar less than 0.001.
const LEAST_CONTRAST: f32 = 0.01;
/// Places that are looked at along a side.
const PLACES: u32 = 256;

/// Whether most of a colour of skin shows pores and furrows, `texel_mm` apart.
pub(super) fn is_seen_in(color: &Map, mask: &Mask, texel_mm: f32) -> bool {
    if texel_mm > COARSEST_MM || color.channels < 3 {
        return false;
    }
    let radius = (0.5 / texel_mm).round().clamp(1.0, 4.0) as u32;
    let step = (color.width.max(color.height) / PLACES).max(1);
    let inner = |side: u32| (radius..side.saturating_sub(radius)).step_by(step as usize);
    let mut found: Vec<f32> = inner(color.height)
        .flat_map(|y| inner(color.width).map(move |x| (x, y)))
        .filter_map(|(x, y)| contrast(color, mask, x, y, radius))
        .collect();
    if found.is_empty() {
        return false;
    }
    let half = found.len() / 2;
    *found.select_nth_unstable_by(half, f32::total_cmp).1 > LEAST_CONTRAST
}

/// Deviation of the luminance over its mean about a texel; none where not all of it is skin.
fn contrast(color: &Map, mask: &Mask, x: u32, y: u32, radius: u32) -> Option<f32> {
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for y in y - radius..=y + radius {
        for x in x - radius..=x + radius {
            let texel = (y * color.width + x) as usize;
            if !mask.mapped[texel] {
                return None;
            }
            let rgb = &color.values[texel * color.channels as usize..][..3];
            let luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
            (count, sum, squares) = (count + 1.0, sum + luminance, squares + luminance * luminance);
        }
    }
    let mean = sum / count;
    Some((squares / count - mean * mean).max(0.0).sqrt() / mean.max(1e-3))
}

#[cfg(test)]
mod tests {
    use rubor_rig::random::SplitMix64;

    use super::*;

    #[test]
    fn pores_are_told_from_paint_and_from_its_edges() {
        let side = 64;
        let of = |value: &mut dyn FnMut(u32, u32) -> f32| {
            let places = (0..side * side).map(|i| (i % side, i / side));
            let values = places.flat_map(|(x, y)| [value(x, y); 3]).collect();
            Map { width: side, height: side, channels: 3, values }
        };
        let mask = Mask { width: side, height: side, mapped: vec![true; (side * side) as usize] };
        let mut random = SplitMix64(1);
        let pores = of(&mut |_, _| 0.5 + 0.02 * (random.below(3) as f32 - 1.0));
        assert!(is_seen_in(&pores, &mask, 0.4));
        assert!(!is_seen_in(&pores, &mask, 1.0), "texels of a millimetre hold no pores");
        // Broad blush, and brows with sharp edges.
        let paint = of(&mut |x, y| 0.5 + 0.002 * x as f32 - if (20..26).contains(&y) { 0.4 } else { 0.0 });
        assert!(!is_seen_in(&paint, &mask, 0.4));
        let none = Mask { mapped: vec![false; (side * side) as usize], ..mask };
        assert!(!is_seen_in(&pores, &none, 0.4));
    }
}
