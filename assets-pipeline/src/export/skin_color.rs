//! The skin as programs show it that know neither hemoglobin nor wrinkles: pictures of one pose, and the change of
//! colour that belongs to each shape.

use glam::Vec3;
use image::RgbImage;
use nalgebra::DMatrix;
use rayon::prelude::*;
use rubor_rig::bind::BoundRig;
use rubor_rig::color::srgb_encode;
use rubor_rig::expression::Rig;
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Head, Material};
use rubor_rig::hemoglobin::{blend, blend_texel};
use rubor_rig::map::Map;
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinLookup, SkinModel};

use crate::error::ExportError;

/// Side of the skin colour table (see `rubor_rig::skin::chromophores` for its error).
const TABLE_SIDE: u32 = 64;
/// The brightest change of colour that vertex colours keep room for.
const MOST_GAIN: f32 = 1.5;
/// Changes below half a step of an 8-bit colour are left out.
const LEAST_CHANGE: f32 = 0.5 / 255.0;
/// Part of the mean square of the weights that steadies the shares of expressions which use nearly the same shapes.
const RIDGE: f64 = 1e-3;

/// True for a head whose skin has a colour of its own.
pub(super) fn has_skin_color(head: &Head) -> bool {
    head.maps.melanin.is_some()
        && head.maps.hemoglobin.is_some()
        && head.mesh.parts.iter().any(|p| p.material == Material::Skin)
}

fn table() -> SkinLookup {
    SkinModel::new(&ChromophoreModel::default()).bake(TABLE_SIDE, TABLE_SIDE)
}

/// The skin of a face (none: the neutral one) in sRGB, from the chromophore maps; at most `side` texels wide, times a
/// factor. `None` for a head without these maps or without skin.
pub fn bake(head: &Head, face: Option<&FaceState>, side: u32, factor: f32) -> Option<RgbImage> {
    let maps = &head.maps;
    let (melanin, neutral) = (maps.melanin.as_ref()?, maps.hemoglobin.as_ref()?);
    if !has_skin_color(head) || side == 0 {
        return None;
    }
    let blended = face.map(|face| match &maps.hemoglobin_mean {
        Some(mean) => blend(neutral, mean, &maps.distributions, &face.distributions, face.hemoglobin_scale),
        None => blend(neutral, neutral, &[], &[], face.hemoglobin_scale),
    });
    let hemoglobin = blended.as_ref().unwrap_or(neutral);
    let lookup = table();
    let own = maps.albedo.as_ref();
    let side = melanin.width.max(hemoglobin.width).max(own.map_or(0, |m| m.width)).min(side);
    let row = |y: u32| -> Vec<u8> {
        (0..side)
            .flat_map(|x| {
                let (u, v) = ((x as f32 + 0.5) / side as f32, (y as f32 + 0.5) / side as f32);
                let (m, h) = (melanin.sample(u, v, 0), hemoglobin.sample(u, v, 0));
                let skin = match own {
                    Some(own) => lookup.with_blood(
                        [0, 1, 2].map(|c| own.sample(u, v, c)),
                        m,
                        neutral.sample(u, v, 0),
                        h,
                    ),
                    None => lookup.sample(m, h),
                };
                let hair = maps.hair.as_ref().map_or(0.0, |h| h.sample(u, v, 0));
                let rgb: [f32; 3] =
                    std::array::from_fn(|c| skin[c] + hair * (maps.hair_color_linear[c] - skin[c]));
                rgb.map(|c| (srgb_encode((c * factor).min(1.0)) * 255.0).round() as u8)
            })
            .collect()
    };
    let texels: Vec<u8> = (0..side).into_par_iter().flat_map_iter(row).collect();
    RgbImage::from_raw(side, side, texels)
}

/// Slopes of the skin with the wrinkles of a face: zones summed and clamped as in Jimenez 2012 section 8.2.
pub fn bake_slopes(head: &Head, face: &FaceState) -> Option<Map> {
    let maps = &head.maps;
    let active: Vec<_> = maps.zones.iter().zip(&face.zones).filter(|(_, w)| **w > 0.0).collect();
    let wrinkles = active.iter().filter_map(|(z, _)| maps.wrinkle_slopes.get(z.wrinkle_map as usize));
    let largest = maps.slopes.iter().chain(wrinkles).max_by_key(|m| m.width)?;
    let (width, height) = (largest.width, largest.height);
    let texel = |i: u32| -> [f32; 2] {
        let (u, v) = ((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
        let (u, v) = (u / width as f32, v / height as f32);
        let mut slopes = [0.0; 2];
        if let Some(map) = &maps.slopes {
            slopes = [map.sample(u, v, 0), map.sample(u, v, 1)];
        }
        for (index, map) in maps.wrinkle_slopes.iter().enumerate() {
            let of_map = active.iter().filter(|(z, _)| z.wrinkle_map as usize == index);
            let weight: f32 = of_map.map(|(z, w)| **w * z.mask.sample(u, v, 0)).sum();
            let weight = weight.clamp(0.0, 1.0);
            if weight > 0.0 {
                slopes[0] += weight * map.sample(u, v, 0);
                slopes[1] += weight * map.sample(u, v, 1);
            }
        }
        slopes
    };
    let values: Vec<f32> = (0..width * height).into_par_iter().flat_map_iter(texel).collect();
    Some(Map { width, height, channels: 2, values })
}

/// Vertex colours of the skin, linear factors of its texture.
pub(super) struct ShapeColors {
    /// Colour of every vertex at rest: below 1 where some expression brightens the skin, as colours end at 1.
    pub(super) rest: f32,
    /// For each shape: vertices whose colour changes, and by how much at weight 1.
    pub(super) changes: Vec<Vec<(u32, Vec3)>>,
}

/// Shares the colour of expressions among the shapes that make them: the smallest changes for which every expression
/// of the rig at full weight shows its own colour, `C = W^T (W W^T + r I)^-1 D`, with the weights `W` of shapes in
/// expressions, the changes `D` of expressions and a small ridge `r` (Tikhonov).
///
/// `None` where nothing changes colour.
pub(super) fn shape_colors(head: &Head, rig: &Rig) -> Result<Option<ShapeColors>, ExportError> {
    let maps = &head.maps;
    let (Some(melanin), Some(mean)) =
        (&maps.melanin, maps.hemoglobin_mean.as_ref().or(maps.hemoglobin.as_ref()))
    else {
        return Ok(None);
    };
    if !has_skin_color(head) || head.shapes.is_empty() {
        return Ok(None);
    }
    let (bound, _) = BoundRig::new(head, rig).map_err(|e| ExportError::Content {
        at: "rig".into(),
        found: e.to_string(),
        expected: "one for this head".into(),
    })?;
    let rest = bound.neutral_weights();
    let faces: Vec<FaceState> = (0..rest.expressions.len())
        .map(|e| {
            let mut weights = rest.clone();
            weights.expressions[e] = 1.0;
            bound.face(&weights)
        })
        .filter(|f| {
            let colored = f.distributions.iter().any(|w| *w != 0.0) || f.hemoglobin_scale != 1.0;
            colored && f.shapes.iter().any(|w| *w != 0.0)
        })
        .collect();
    if faces.is_empty() {
        return Ok(None);
    }
    let lookup = table();
    // Factor of the colour of each expression, less 1.
    let change = |vertex: &rubor_rig::head::Vertex| -> Vec<Vec3> {
        let (u, v) = (vertex.uv.x, vertex.uv.y);
        let melanin = melanin.sample(u, v, 0);
        let neutral = mean.sample(u, v, 0);
        let skin = 1.0 - maps.hair.as_ref().map_or(0.0, |h| h.sample(u, v, 0));
        let before = Vec3::from_array(lookup.sample(melanin, neutral));
        (faces.iter())
            .map(|face| {
                let active = maps.distributions.iter().zip(&face.distributions).filter(|(_, w)| **w != 0.0);
                let parts = active.map(|(d, w)| (*w, d.scale.sample(u, v, 0), d.bias.sample(u, v, 0)));
                let blood = blend_texel(neutral, neutral, parts, face.hemoglobin_scale);
                let after = Vec3::from_array(lookup.sample(melanin, blood));
                skin * (after / before.max(Vec3::splat(1e-4)) - 1.0)
                    .clamp(Vec3::splat(-1.0), Vec3::splat(1.0))
            })
            .collect()
    };
    let mut of_skin = vec![false; head.mesh.vertices.len()];
    for part in head.mesh.parts.iter().filter(|p| p.material == Material::Skin) {
        let triangles = &head.mesh.triangles[part.triangles.start as usize..part.triangles.end as usize];
        triangles.as_flattened().iter().for_each(|v| of_skin[*v as usize] = true);
    }
    let changes: Vec<Vec<Vec3>> = (head.mesh.vertices.par_iter().zip(&of_skin))
        .map(|(vertex, skin)| if *skin { change(vertex) } else { Vec::new() })
        .collect();
    let brightest = changes.iter().flatten().map(|c| 1.0 + c.max_element()).fold(1.0, f32::max);
    let rest_color = 1.0 / brightest.min(MOST_GAIN);

    let (count, shapes) = (faces.len(), head.shapes.len());
    let weights = DMatrix::from_fn(count, shapes, |e, s| f64::from(faces[e].shapes[s]));
    let mut gram = &weights * weights.transpose();
    let ridge = RIDGE * gram.trace() / count as f64;
    (0..count).for_each(|i| gram[(i, i)] += ridge);
    // Positive definite by the ridge, as every expression moves something.
    let Some(factor) = gram.cholesky() else { return Ok(None) };
    let shares = factor.solve(&weights);
    let of_shape = |s: usize| -> Vec<(u32, Vec3)> {
        let shares: Vec<f32> = (0..count).map(|e| shares[(e, s)] as f32 * rest_color).collect();
        if shares.iter().all(|w| w.abs() < 1e-6) {
            return Vec::new();
        }
        (changes.iter().enumerate())
            .map(|(v, changes)| (v as u32, changes.iter().zip(&shares).map(|(c, w)| *c * *w).sum::<Vec3>()))
            .filter(|(_, change)| change.abs().max_element() > LEAST_CHANGE)
            .collect()
    };
    let changes = (0..shapes).into_par_iter().map(of_shape).collect();
    Ok(Some(ShapeColors { rest: rest_color, changes }))
}
