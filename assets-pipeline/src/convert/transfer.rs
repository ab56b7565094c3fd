//! The hemoglobin changes of one head on another (Jimenez 2012 section 7.4.2: appearance transfer).
//!
//! Only relative, low-frequency statistics move: `scale` as it is, `bias` relative to the local mean of the blood.
//! The vessels of the receiving head stay its own. Texture layouts are joined by a warp from the receiver's texture
//! space to the giver's: identical layouts, pairs of points, or the landmarks that both heads have (through the
//! texture, here, or through space, [`super::surface_warp`]).

use glam::{Vec2, Vec3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use rubor_rig::head::{Distribution, Head, Material};
use rubor_rig::map::Map;
use rubor_rig::skin::chromophores::MAX_HEMOGLOBIN;
use serde::{Deserialize, Serialize};

use super::ConvertError;
use super::nearest::nearest_in_triangle;

/// How a bias crosses from one blood level to another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BiasTransfer {
    /// `mu_n,B mu_i,A / mu_n,A`: the same percentage more or less blood. Stays positive.
    #[default]
    Ratio,
    /// `mu_n,B + mu_i,A - mu_n,A`: the same amount more or less.
    Difference,
    /// `mu_i,A`: the giver's blood.
    Absolute,
}

/// A pair of texture coordinates that mean the same place of a face.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Correspondence {
    /// On the head that receives.
    pub receiver: Vec2,
    /// On the head that gives.
    pub giver: Vec2,
}

/// Where a texture coordinate of the receiver lies on the giver.
#[derive(Clone, Debug, PartialEq)]
pub enum Warp {
    /// One layout.
    Identity,
    /// A thin-plate spline through pairs (Bookstein 1989): affine plus `sum_k w_k |x - x_k|^2 log |x - x_k|`.
    Spline {
        /// Points on the receiver.
        points: Vec<Vec2>,
        /// Weight of each point, for u and v.
        weights: Vec<[f64; 2]>,
        /// Constant, u and v terms.
        affine: [[f64; 2]; 3],
    },
    /// A place for each texel of a map, see [`super::surface_warp`].
    Table {
        /// Texels in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Texture coordinates on the giver.
        places: Vec<Vec2>,
    },
}

fn kernel(distance2: f64) -> f64 {
    // r^2 log r = r^2 log(r^2) / 2, 0 at 0.
    if distance2 > 0.0 { 0.5 * distance2 * distance2.ln() } else { 0.0 }
}

impl Warp {
    /// The spline through pairs; exact at each.
    ///
    /// # Errors
    /// Fewer than 3 pairs, pairs on one line or twice at one place, coordinates that are not finite.
    pub fn through(pairs: &[Correspondence]) -> Result<Self, ConvertError> {
        let n = pairs.len();
        let fail = |found: String| {
            Err(ConvertError::argument(
                "correspondences",
                found,
                "at least 3 different points of the receiver that are not on one line",
            ))
        };
        if n < 3 {
            return fail(format!("{n} points"));
        }
        if let Some(i) = pairs.iter().position(|p| !(p.receiver.is_finite() && p.giver.is_finite())) {
            return fail(format!("pair {i} that is not finite"));
        }
        let mut system = DMatrix::<f64>::zeros(n + 3, n + 3);
        let mut right = DMatrix::<f64>::zeros(n + 3, 2);
        for i in 0..n {
            for j in 0..n {
                let d2 = pairs[i].receiver.as_dvec2().distance_squared(pairs[j].receiver.as_dvec2());
                system[(i, j)] = kernel(d2);
            }
            let row = [1.0, f64::from(pairs[i].receiver.x), f64::from(pairs[i].receiver.y)];
            for (k, value) in row.into_iter().enumerate() {
                system[(i, n + k)] = value;
                system[(n + k, i)] = value;
            }
            right[(i, 0)] = f64::from(pairs[i].giver.x);
            right[(i, 1)] = f64::from(pairs[i].giver.y);
        }
        let solved = system.clone().lu().solve(&right);
        let Some(solution) = solved.filter(|s| s.iter().all(|v| v.is_finite())) else {
            return fail("points on one line or twice at one place".into());
        };
        // A nearly singular system answers with garbage instead of refusing.
        let residual: DVector<f64> = (&system * &solution - &right).column(0).into_owned();
        if residual.amax() > 1e-6 {
            return fail("points nearly on one line or at one place".into());
        }
        let row = |i: usize| [solution[(i, 0)], solution[(i, 1)]];
        Ok(Self::Spline {
            points: pairs.iter().map(|p| p.receiver).collect(),
            weights: (0..n).map(row).collect(),
            affine: [row(n), row(n + 1), row(n + 2)],
        })
    }

    /// Place on the giver of a texture coordinate of the receiver.
    pub fn apply(&self, uv: Vec2) -> Vec2 {
        match self {
            Self::Identity => uv,
            Self::Spline { points, weights, affine } => {
                let (u, v) = (f64::from(uv.x), f64::from(uv.y));
                let mut out = [0, 1].map(|c| affine[0][c] + affine[1][c] * u + affine[2][c] * v);
                for (p, w) in points.iter().zip(weights) {
                    let k = kernel(uv.as_dvec2().distance_squared(p.as_dvec2()));
                    out = [out[0] + w[0] * k, out[1] + w[1] * k];
                }
                Vec2::new(out[0] as f32, out[1] as f32)
            }
            Self::Table { width, height, places } => {
                let place = |t: f32, n: u32| ((t * n as f32).max(0.0) as u32).min(n - 1);
                places[(place(uv.y, *height) * width + place(uv.x, *width)) as usize]
            }
        }
    }
}

/// Pairs from the landmarks that both heads have: the texture coordinates of the nearest points of their skin.
pub fn landmark_correspondences(receiver: &Head, giver: &Head) -> Vec<Correspondence> {
    let pair = |(name, at): (&String, &Vec3)| {
        let other = giver.landmarks.get(name)?;
        Some(Correspondence {
            receiver: skin_coordinate(receiver, *at)?,
            giver: skin_coordinate(giver, *other)?,
        })
    };
    let mut pairs: Vec<Correspondence> = receiver.landmarks.iter().filter_map(pair).collect();
    // Two landmarks of one place would make the spline singular.
    let mut i = 0;
    while i < pairs.len() {
        let here = pairs[i].receiver;
        if pairs[..i].iter().any(|p| p.receiver.distance(here) < 1e-4) {
            pairs.remove(i);
        } else {
            i += 1;
        }
    }
    pairs
}

/// Texture coordinate of the skin nearest to a point.
fn skin_coordinate(head: &Head, at: Vec3) -> Option<Vec2> {
    let mesh = &head.mesh;
    let mut best: Option<(f32, Vec2)> = None;
    for part in mesh.parts.iter().filter(|p| p.material == Material::Skin) {
        for triangle in &mesh.triangles[part.triangles.start as usize..part.triangles.end as usize] {
            let corners = triangle.map(|v| mesh.vertices[v as usize]);
            let [a, b, c] = corners.map(|v| mesh.points[v.point as usize]);
            let weights = nearest_in_triangle(at, a, b, c);
            let d = (a * weights.x + b * weights.y + c * weights.z).distance_squared(at);
            if best.is_none_or(|(nearest, _)| d < nearest) {
                let uv = corners[0].uv * weights.x + corners[1].uv * weights.y + corners[2].uv * weights.z;
                best = Some((d, uv));
            }
        }
    }
    best.map(|(_, uv)| uv)
}

/// A giver's distribution for a receiver, at the size of the receiver's mean.
///
/// `giver_mean` and `receiver_mean` are the local means of the neutral maps (`bias_0`). Places that the warp sends
/// outside the giver's texture take its border.
///
/// # Errors
/// Maps with other than 1 channel.
pub fn transfer(
    distribution: &Distribution,
    giver_mean: &Map,
    receiver_mean: &Map,
    warp: &Warp,
    bias: BiasTransfer,
) -> Result<Distribution, ConvertError> {
    for (name, map) in [
        ("scale", &distribution.scale),
        ("bias", &distribution.bias),
        ("giver's mean", giver_mean),
        ("receiver's mean", receiver_mean),
    ] {
        if map.channels != 1 {
            return Err(ConvertError::argument(name, format!("{} channels", map.channels), "1"));
        }
    }
    let (width, height) = (receiver_mean.width, receiver_mean.height);
    let texel = |i: usize| {
        let uv = Vec2::new(
            ((i % width as usize) as f32 + 0.5) / width as f32,
            ((i / width as usize) as f32 + 0.5) / height as f32,
        );
        let at = warp.apply(uv);
        let own = receiver_mean.values[i];
        let (theirs, target) = (giver_mean.sample(at.x, at.y, 0), distribution.bias.sample(at.x, at.y, 0));
        let moved = match bias {
            // Bloodless skin has no ratio: its change counts as a difference.
            BiasTransfer::Ratio if theirs > 1e-6 => own * target / theirs,
            BiasTransfer::Ratio | BiasTransfer::Difference => own + target - theirs,
            BiasTransfer::Absolute => target,
        };
        (distribution.scale.sample(at.x, at.y, 0), moved.clamp(0.0, MAX_HEMOGLOBIN as f32))
    };
    let (scale, moved) = (0..receiver_mean.values.len()).into_par_iter().map(texel).unzip();
    let map = |values: Vec<f32>| Map { width, height, channels: 1, values };
    Ok(Distribution { name: distribution.name.clone(), scale: map(scale), bias: map(moved) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(warp: impl Fn(Vec2) -> Vec2) -> Vec<Correspondence> {
        [(0.1, 0.1), (0.9, 0.15), (0.5, 0.5), (0.2, 0.8), (0.85, 0.9), (0.4, 0.3)]
            .map(|(u, v)| Correspondence { receiver: Vec2::new(u, v), giver: warp(Vec2::new(u, v)) })
            .to_vec()
    }

    #[test]
    fn the_spline_meets_its_pairs_and_keeps_affine_maps() {
        let bend = |p: Vec2| Vec2::new(p.x + 0.1 * p.y * p.y, 0.9 * p.y + 0.05 * (6.0 * p.x).sin());
        let warp = Warp::through(&pairs(bend)).unwrap();
        for p in pairs(bend) {
            assert!(warp.apply(p.receiver).distance(p.giver) < 1e-6);
        }
        let affine = |p: Vec2| Vec2::new(0.1 + 0.7 * p.x - 0.2 * p.y, 0.3 + 0.1 * p.x + 0.5 * p.y);
        let warp = Warp::through(&pairs(affine)).unwrap();
        for p in [Vec2::new(0.33, 0.77), Vec2::new(0.0, 1.0)] {
            assert!(warp.apply(p).distance(affine(p)) < 1e-6);
        }
    }

    #[test]
    fn degenerate_pairs_are_refused() {
        let line: Vec<_> = (0..4)
            .map(|i| Correspondence { receiver: Vec2::splat(0.2 * i as f32), giver: Vec2::splat(0.1) })
            .collect();
        assert!(Warp::through(&line[..2]).unwrap_err().to_string().contains("2 points"));
        assert!(Warp::through(&line).is_err());
        assert!(Warp::through(&[line[1]; 5]).is_err());
    }

    #[test]
    fn a_head_gives_its_own_distribution_to_itself() {
        let d = Distribution {
            name: "joy".into(),
            scale: Map {
                width: 4,
                height: 4,
                channels: 1,
                values: (0..16).map(|i| 1.0 + i as f32 / 16.0).collect(),
            },
            bias: Map {
                width: 4,
                height: 4,
                channels: 1,
                values: (0..16).map(|i| 0.05 + i as f32 / 400.0).collect(),
            },
        };
        let mean = Map {
            width: 4,
            height: 4,
            channels: 1,
            values: (0..16).map(|i| 0.04 + i as f32 / 900.0).collect(),
        };
        for mode in [BiasTransfer::Ratio, BiasTransfer::Difference, BiasTransfer::Absolute] {
            let found = transfer(&d, &mean, &mean, &Warp::Identity, mode).unwrap();
            for (a, b) in found.bias.values.iter().zip(&d.bias.values) {
                assert!((a - b).abs() < 1e-6);
            }
            assert_eq!(found.scale, d.scale);
        }
    }

    #[test]
    fn a_change_follows_the_receivers_own_level() {
        let d = Distribution {
            name: "anger".into(),
            scale: Map::filled(2, 2, &[1.3]),
            bias: Map::filled(2, 2, &[0.06]),
        };
        let (giver, receiver) = (Map::filled(3, 3, &[0.04]), Map::filled(5, 4, &[0.02]));
        let bias = |mode| transfer(&d, &giver, &receiver, &Warp::Identity, mode).unwrap().bias;
        for (mode, expected) in
            [(BiasTransfer::Ratio, 0.03), (BiasTransfer::Difference, 0.04), (BiasTransfer::Absolute, 0.06)]
        {
            let found = bias(mode);
            assert_eq!((found.width, found.height), (5, 4));
            assert!(found.values.iter().all(|b| (b - expected).abs() < 1e-6), "{mode:?}");
        }
    }

    #[test]
    fn landmarks_join_heads_of_different_layouts() {
        use rubor_rig::head::{Mesh, Part, Vertex};
        let head = |scale: f32, layout: fn(Vec2) -> Vec2| {
            let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
            let points: Vec<Vec3> = corners.iter().map(|c| Vec3::new(c.0, c.1, 0.0) * scale).collect();
            let vertices = corners
                .iter()
                .enumerate()
                .map(|(i, c)| Vertex { point: i as u32, uv: layout(Vec2::from(*c)) });
            let mesh = Mesh {
                points,
                vertices: vertices.collect(),
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                parts: vec![Part { name: "skin".into(), material: Material::Skin, triangles: 0..2 }],
                ..Mesh::default()
            };
            let marks = [("a", 0.2, 0.2), ("b", 0.8, 0.3), ("c", 0.5, 0.9), ("d", 0.4, 0.5)];
            let landmarks =
                marks.iter().map(|(n, x, y)| ((*n).to_owned(), Vec3::new(*x, *y, 0.1) * scale)).collect();
            Head { mesh, landmarks, ..Head::default() }
        };
        let receiver = head(1.0, |p| p);
        let giver = head(2.0, |p| Vec2::new(1.0 - p.y, 0.5 * p.x));
        let pairs = landmark_correspondences(&receiver, &giver);
        assert_eq!(pairs.len(), 4);
        let warp = Warp::through(&pairs).unwrap();
        let at = warp.apply(Vec2::new(0.6, 0.4));
        assert!(at.distance(Vec2::new(0.6, 0.3)) < 1e-5, "{at}");
    }
}
