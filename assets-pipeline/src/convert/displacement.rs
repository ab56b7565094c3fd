//! A displacement map to relief: slopes of the skin that it raises.
//!
//! ```text
//! heights --mean over squares, if larger than asked--> h in mm
//!         --Sobel derivatives along u and v----------> dh/du, dh/dv
//!         --triangle of each texel: P_u, P_v in mm---> slopes along its tangent frame
//! slopes - their local mean at the size of a normal map + slopes of that normal map
//! ```
//!
//! The displaced normal is n - grad h on the surface (Mikkelsen 2010), so slopes are the negated derivatives along the
//! tangent T = P_u / |P_u| and along B, across it towards -v. With the gradient g of h: g.P_u = h_u and g.P_v = h_v.
//!
//! A scan's normal and displacement maps show the same relief. Where both are given the normal map says what it can hold, and
//! the displacement adds only what is finer than its texels; the sum of both would count relief twice. The outline stays:
//! points are not moved.

use glam::Vec3;
use rayon::prelude::*;
use rubor_rig::head::{Head, MM_PER_METRE};
use rubor_rig::map::Map;
use rubor_rig::mask::{Mask, fill_unmapped, resize_area};

use super::ConvertError;
use super::skin_texels::SkinTexels;

/// Slopes of a map of heights, 0 to 1 of `range_mm`, on the skin of a head; at most `side` texels wide. Texels that show no
/// skin take the slopes around them.
///
/// # Errors
/// Other than 1 channel, a range that is not a finite number or is 0, a head without skin in the unit square.
pub fn slopes(head: &Head, heights: &Map, range_mm: f32, side: u32) -> Result<Map, ConvertError> {
    if heights.channels != 1 {
        return Err(ConvertError::argument("displacement", format!("{} channels", heights.channels), "1"));
    }
    if !range_mm.is_finite() || range_mm == 0.0 {
        let expected = "millimetres from black to white, below 0 where black is outside";
        return Err(ConvertError::argument("range of displacement", range_mm.to_string(), expected));
    }
    let most = heights.width.max(heights.height);
    let smaller = |n: u32| (u64::from(n) * u64::from(side.min(most)) / u64::from(most)).max(1) as u32;
    let (width, height) = (smaller(heights.width), smaller(heights.height));
    let (map, _) = resize_area(heights, &Mask::full(heights.width, heights.height), width, height);
    let skin = SkinTexels::new(head, width, height);
    let mask = skin.mask();
    if mask.count() == 0 {
        let expected = "skin with texture coordinates in the unit square";
        return Err(ConvertError::argument("head", "no texel that shows skin", expected));
    }
    let at = |x: i64, y: i64| {
        let (x, y) = (x.clamp(0, i64::from(width) - 1), y.clamp(0, i64::from(height) - 1));
        range_mm * map.values[(y * i64::from(width) + x) as usize]
    };
    let texel = |i: u32| -> [f32; 2] {
        let (x, y) = (i % width, i / width);
        let Some((triangle, _)) = skin.at(x, y) else { return [0.0; 2] };
        let (x, y) = (i64::from(x), i64::from(y));
        // Sobel: differences over two texels, smoothed across, which halves the steps of 8-bit heights.
        let across = |d: i64| at(x + d, y - 1) + 2.0 * at(x + d, y) + at(x + d, y + 1);
        let down = |d: i64| at(x - 1, y + d) + 2.0 * at(x, y + d) + at(x + 1, y + d);
        // At the border of the map over one texel.
        let span = |i: i64, n: u32| ((i + 1).min(i64::from(n) - 1) - (i - 1).max(0)).max(1) as f32;
        let by_u = (across(1) - across(-1)) / (4.0 * span(x, width)) * width as f32;
        let by_v = (down(1) - down(-1)) / (4.0 * span(y, height)) * height as f32;
        frame(head, triangle).map_or([0.0; 2], |(along_u, v_along, v_across)| {
            let by_tangent = by_u / along_u;
            [-by_tangent, -(by_tangent * v_along - by_v) / v_across]
        })
    };
    let values = (0..width * height).into_par_iter().flat_map_iter(texel).collect();
    let mut slopes = Map { width, height, channels: 2, values };
    fill_unmapped(&mut slopes, &mask);
    Ok(slopes)
}

/// Of a triangle, mm per unit of texture: |P_u|, P_v along the tangent, and P_v across it, towards v.
fn frame(head: &Head, triangle: u32) -> Option<(f32, f32, f32)> {
    let mesh = &head.mesh;
    let corners = mesh.triangles[triangle as usize].map(|v| mesh.vertices[v as usize]);
    let [a, b, c] = corners.map(|v| MM_PER_METRE * mesh.points[v.point as usize]);
    let (first, second) = (corners[1].uv - corners[0].uv, corners[2].uv - corners[0].uv);
    let area = first.perp_dot(second);
    let by_u: Vec3 = ((b - a) * second.y - (c - a) * first.y) / area;
    let by_v: Vec3 = ((c - a) * first.x - (b - a) * second.x) / area;
    let along_u = by_u.length();
    let tangent = by_u / along_u;
    let v_along = by_v.dot(tangent);
    let v_across = (by_v - v_along * tangent).length();
    let is_good = along_u.is_finite() && along_u > 1e-3 && v_across.is_finite() && v_across > 1e-3;
    is_good.then_some((along_u, v_along, v_across))
}

/// Slopes of a normal map with the finer relief of a displacement: what its own texels cannot hold.
///
/// # Errors
/// Other than 2 channels each.
pub fn combined(of_normals: &Map, of_displacement: &Map) -> Result<Map, ConvertError> {
    for (name, map) in [("slopes of normals", of_normals), ("slopes of displacement", of_displacement)] {
        if map.channels != 2 {
            return Err(ConvertError::argument(name, format!("{} channels", map.channels), "2"));
        }
    }
    let (width, height) = (of_displacement.width, of_displacement.height);
    if of_normals.width >= width && of_normals.height >= height {
        return Ok(of_normals.clone());
    }
    let (coarse, _) =
        resize_area(of_displacement, &Mask::full(width, height), of_normals.width, of_normals.height);
    let mut sum = of_displacement.clone();
    sum.values.par_chunks_exact_mut(2).enumerate().for_each(|(i, texel)| {
        let (x, y) = (i as u32 % width, i as u32 / width);
        let (u, v) = ((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
        for c in 0..2 {
            texel[c as usize] += of_normals.sample(u, v, c) - coarse.sample(u, v, c);
        }
    });
    Ok(sum)
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::super::skin_texels::tests::sheet;
    use super::*;

    /// Heights in mm as codes of a range.
    fn heights(side: u32, range_mm: f32, height_mm: impl Fn(f32, f32) -> f32) -> Map {
        let at = |i: u32| (((i % side) as f32 + 0.5) / side as f32, ((i / side) as f32 + 0.5) / side as f32);
        let values = (0..side * side).map(|i| height_mm(at(i).0, at(i).1) / range_mm).collect();
        Map { width: side, height: side, channels: 1, values }
    }

    #[test]
    fn a_ramp_has_the_slope_of_its_millimetres() {
        // A sheet of 1 m whose texture fills the left half: 2000 mm per unit of u, 1000 mm of v.
        let head = sheet(Vec2::ZERO, Vec2::new(0.5, 1.0));
        let ramp = heights(64, 100.0, |u, v| 40.0 * u + 30.0 * v);
        let slopes = slopes(&head, &ramp, 100.0, 64).unwrap();
        // The normal leans away from where it rises: towards -u, and towards -v, which is up.
        let expected = [-40.0 / 2000.0, 30.0 / 1000.0];
        for (x, y) in [(3, 3), (20, 40), (28, 60)] {
            let found = slopes.texel(x, y);
            assert!(
                (found[0] - expected[0]).abs() < 1e-5 && (found[1] - expected[1]).abs() < 1e-5,
                "{found:?}"
            );
        }
        // What shows no skin continues it; another range, another slope; black outside turns it round.
        assert!((slopes.texel(50, 20)[0] - expected[0]).abs() < 1e-4);
        let turned = super::slopes(&head, &ramp, -50.0, 64).unwrap();
        assert!((turned.texel(20, 20)[0] - 0.5 * 0.02).abs() < 1e-5);
    }

    #[test]
    fn a_skewed_texture_gives_the_same_normal() {
        let mut head = sheet(Vec2::ZERO, Vec2::new(0.4, 1.0));
        let upright = heights(128, 10.0, |u, _| 10.0 * u);
        let of_upright = slopes(&head, &upright, 10.0, 128).unwrap();
        // u grows by 0.5 v more: the texture leans, the heights on the surface stay.
        head.mesh.vertices.iter_mut().for_each(|v| v.uv.x += 0.5 * v.uv.y);
        let leaning = heights(128, 10.0, |u, v| 10.0 * (u - 0.5 * v));
        let of_leaning = slopes(&head, &leaning, 10.0, 128).unwrap();
        let (a, b) = (of_upright.texel(20, 64), of_leaning.texel(20 + 32, 64));
        assert!((a[0] - b[0]).abs() < 1e-5 && (a[1] - b[1]).abs() < 1e-5, "{a:?} {b:?}");
        assert!(a[0] < -1e-3 && a[1].abs() < 1e-6);
    }

    #[test]
    fn a_normal_map_keeps_what_it_says_and_gets_what_is_finer() {
        let head = sheet(Vec2::ZERO, Vec2::ONE);
        let wave = |n: f32| move |u: f32, _: f32| 5.0 * (std::f32::consts::TAU * n * u).sin() / n;
        let fine = slopes(&head, &heights(256, 10.0, wave(64.0)), 10.0, 256).unwrap();
        let coarse = slopes(&head, &heights(256, 10.0, wave(2.0)), 10.0, 256).unwrap();
        let both = slopes(&head, &heights(256, 10.0, |u, v| wave(64.0)(u, v) + wave(2.0)(u, v)), 10.0, 256);
        let (small, _) = resize_area(&coarse, &Mask::full(256, 256), 32, 32);
        let sum = combined(&small, &both.unwrap()).unwrap();
        let largest = fine.values.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
        for i in 0..256 * 256 {
            let (x, found) = (i % 256, sum.values[2 * i]);
            let expected = fine.values[2 * i] + coarse.values[2 * i];
            // Once, not twice; at the edges the small map is held.
            assert!(
                !(8..248).contains(&x) || (found - expected).abs() < 0.08 * largest,
                "{x}: {found} {expected}"
            );
        }
        assert_eq!(combined(&coarse, &fine).unwrap(), coarse);
    }

    #[test]
    fn what_is_wrong_is_said() {
        let head = sheet(Vec2::ZERO, Vec2::ONE);
        let flat = |channels: usize| Map::filled(4, 4, &vec![0.5; channels]);
        let fails = |map: &Map, range: f32| slopes(&head, map, range, 64).unwrap_err().to_string();
        assert!(fails(&flat(3), 1.0).contains("3 channels"));
        assert!(fails(&flat(1), 0.0).contains("millimetres from black to white"));
        assert!(fails(&flat(1), f32::NAN).contains("NaN"));
        let elsewhere = sheet(Vec2::splat(2.0), Vec2::splat(3.0));
        assert!(slopes(&elsewhere, &flat(1), 1.0, 64).is_err());
        assert!(combined(&flat(1), &flat(2)).is_err());
    }
}
