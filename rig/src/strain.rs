//! Surface strain of blend shapes, and a prediction of blood and wrinkles where there are no measurements.
//!
//! A triangle's deformation gradient F maps its rest plane to the deformed one; C = F^T F has the squared principal
//! stretches. Skin that is compressed drains (Jimenez 2012 section 7.3.1, observation 2) and folds across the direction
//! of compression. The thesis gives no prediction; the linear model here is labelled as predicted and its
//! coefficients are named fields.

use glam::{DMat2, DVec2, DVec3, Vec3};

use crate::head::{BlendShape, Mesh, Provenance, ProvenanceKind};

/// Strain of the surface at one place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceStrain {
    /// Relative change of area: deformed over rest minus 1; -1 is collapsed.
    pub area: f32,
    /// Largest principal strain, stretch minus 1.
    pub largest: f32,
    /// Smallest principal strain, stretch minus 1: negative where skin is compressed.
    pub smallest: f32,
    /// Unit direction of the smallest principal strain in the rest surface; wrinkles run across it. Zero where the
    /// strain has no direction.
    pub compression: Vec3,
}

/// Strain of a triangle from its rest to its deformed corners; `None` for a rest triangle without area.
pub fn triangle_strain(rest: [Vec3; 3], deformed: [Vec3; 3]) -> Option<SurfaceStrain> {
    let edges = |p: [Vec3; 3]| [(p[1] - p[0]).as_dvec3(), (p[2] - p[0]).as_dvec3()];
    let [r1, r2] = edges(rest);
    let tangent = r1.try_normalize()?;
    let normal = r1.cross(r2).try_normalize()?;
    let bitangent = normal.cross(tangent);
    let flat = |e: DVec3| DVec2::new(e.dot(tangent), e.dot(bitangent));
    let inverse = DMat2::from_cols(flat(r1), flat(r2)).inverse();
    let [d1, d2] = edges(deformed);
    // Columns of F: images of the rest frame.
    let (f1, f2) =
        (d1 * inverse.x_axis.x + d2 * inverse.x_axis.y, d1 * inverse.y_axis.x + d2 * inverse.y_axis.y);
    let (c11, c12, c22) = (f1.dot(f1), f1.dot(f2), f2.dot(f2));
    let (half, difference) = (0.5 * (c11 + c22), 0.5 * (c11 - c22));
    let radius = difference.hypot(c12);
    let (low, high) = ((half - radius).max(0.0).sqrt(), (half + radius).sqrt());
    // Eigenvector of the larger eigenvalue lies at half the angle of (difference, c12).
    let angle = 0.5 * c12.atan2(difference);
    let compression = if radius > 1e-12 * half {
        (-angle.sin() * tangent + angle.cos() * bitangent).as_vec3()
    } else {
        Vec3::ZERO
    };
    Some(SurfaceStrain {
        area: (low * high - 1.0) as f32,
        largest: (high - 1.0) as f32,
        smallest: (low - 1.0) as f32,
        compression,
    })
}

/// Strain at each point when points move to `deformed`: the mean of its triangles weighted by rest area.
///
/// Directions are averaged as axes (a direction and its opposite are the same axis). Points without triangles have no
/// strain.
///
/// # Panics
/// The length of `deformed` differs from the number of the mesh's points.
pub fn point_strain(mesh: &Mesh, deformed: &[Vec3]) -> Vec<SurfaceStrain> {
    assert_eq!(mesh.points.len(), deformed.len(), "one deformed position per point");
    let mut sums = vec![SurfaceStrain::default(); mesh.points.len()];
    let mut weights = vec![0.0f32; mesh.points.len()];
    for triangle in &mesh.triangles {
        let corners = triangle.map(|v| mesh.vertices[v as usize].point as usize);
        let rest = corners.map(|p| mesh.points[p]);
        let Some(strain) = triangle_strain(rest, corners.map(|p| deformed[p])) else { continue };
        let area = 0.5 * (rest[1] - rest[0]).cross(rest[2] - rest[0]).length();
        for p in corners {
            let sum = &mut sums[p];
            sum.area += area * strain.area;
            sum.largest += area * strain.largest;
            sum.smallest += area * strain.smallest;
            let sign = if sum.compression.dot(strain.compression) < 0.0 { -1.0 } else { 1.0 };
            sum.compression += area * sign * strain.compression;
            weights[p] += area;
        }
    }
    for (sum, weight) in sums.iter_mut().zip(weights) {
        if weight > 0.0 {
            sum.area /= weight;
            sum.largest /= weight;
            sum.smallest /= weight;
            sum.compression = sum.compression.normalize_or_zero();
        }
    }
    sums
}

/// Strain of a shape at weight 1 at each point of the mesh.
pub fn shape_strain(mesh: &Mesh, shape: &BlendShape) -> Vec<SurfaceStrain> {
    let mut deformed = mesh.points.clone();
    for (p, offset) in shape.points.iter().zip(&shape.offsets) {
        deformed[*p as usize] += *offset;
    }
    point_strain(mesh, &deformed)
}

/// Coefficients of the prediction. Not measured: chosen so that the strains of a full smile (a tenth to a third in
/// area) give the changes of perfusion that figure 7.5 of the thesis shows (some ten percent).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StrainModel {
    /// Relative change of mean hemoglobin by relative change of area, where skin is compressed.
    pub bias_per_compression: f32,
    /// The same where skin is stretched: thinned capillaries hold less blood, so it is negative.
    pub bias_per_stretch: f32,
    /// Relative change of contrast by relative change of area.
    pub scale_per_area: f32,
    /// Compression at which wrinkles begin to show.
    pub wrinkle_onset: f32,
    /// Wrinkle weight by compression beyond the onset.
    pub wrinkle_gain: f32,
}

impl Default for StrainModel {
    fn default() -> Self {
        Self {
            bias_per_compression: 0.6,
            bias_per_stretch: -0.3,
            scale_per_area: 0.4,
            wrinkle_onset: 0.05,
            wrinkle_gain: 4.0,
        }
    }
}

/// The model's prediction at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrainPrediction {
    /// `mu_i / mu_n`, 0 to 2.
    pub bias_ratio: f32,
    /// `sigma_i / sigma_n`, 0 to 2.
    pub scale: f32,
    /// Weight of wrinkles across the compression, 0 to 1.
    pub wrinkle: f32,
}

impl StrainModel {
    /// Prediction for a strain: 1, 1 and 0 without any.
    pub fn predict(&self, strain: &SurfaceStrain) -> StrainPrediction {
        let slope = if strain.area < 0.0 { self.bias_per_compression } else { self.bias_per_stretch };
        StrainPrediction {
            bias_ratio: (1.0 + slope * strain.area).clamp(0.0, 2.0),
            scale: (1.0 + self.scale_per_area * strain.area).clamp(0.0, 2.0),
            wrinkle: (self.wrinkle_gain * (-strain.smallest - self.wrinkle_onset)).clamp(0.0, 1.0),
        }
    }

    /// Provenance of data made with the model.
    pub fn provenance(&self, of: &str) -> Provenance {
        Provenance {
            of: of.to_owned(),
            kind: ProvenanceKind::Predicted,
            source: format!("surface strain of blend shapes, linear model {self:?}"),
            licence: "MIT OR Apache-2.0".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::head::Vertex;
    use glam::{Quat, Vec2};

    const REST: [Vec3; 3] = [Vec3::new(0.1, 0.2, 0.0), Vec3::new(1.3, 0.1, 0.0), Vec3::new(0.4, 0.9, 0.0)];

    #[test]
    fn known_deformations_have_known_strains() {
        let turn = Quat::from_rotation_y(0.7) * Quat::from_rotation_x(-0.3);
        let stretch = |p: Vec3| turn * Vec3::new(1.2 * p.x, 0.7 * p.y, p.z) + Vec3::splat(3.0);
        let s = triangle_strain(REST, REST.map(stretch)).unwrap();
        assert!((s.largest - 0.2).abs() < 1e-5 && (s.smallest + 0.3).abs() < 1e-5, "{s:?}");
        assert!((s.area - (1.2 * 0.7 - 1.0)).abs() < 1e-5);
        assert!((s.compression.y.abs() - 1.0).abs() < 1e-4);
        // Simple shear by g: the stretches are those of [[1, g], [0, 1]], area stays.
        let s = triangle_strain(REST, REST.map(|p| p + Vec3::X * 0.5 * p.y)).unwrap();
        let high = 0.25 + (0.0625f32 + 1.0).sqrt();
        assert!((s.largest - (high - 1.0)).abs() < 1e-5 && s.area.abs() < 1e-5, "{s:?}");
        let rigid = triangle_strain(REST, REST.map(|p| turn * p)).unwrap();
        assert!(rigid.largest.abs() < 1e-5 && rigid.smallest.abs() < 1e-5);
    }

    #[test]
    fn degenerate_triangles_are_left_out() {
        assert!(triangle_strain([Vec3::ZERO, Vec3::X, 2.0 * Vec3::X], REST).is_none());
        let collapsed = triangle_strain(REST, [Vec3::ZERO; 3]).unwrap();
        assert_eq!((collapsed.area, collapsed.smallest), (-1.0, -1.0));
        assert!(collapsed.compression.is_finite());
    }

    #[test]
    fn a_compressed_sheet_drains_and_wrinkles_across() {
        let n = 5u32;
        let points: Vec<Vec3> = (0..n * n).map(|i| Vec3::new((i % n) as f32, (i / n) as f32, 0.0)).collect();
        let vertices = (0..n * n).map(|i| Vertex { point: i, uv: Vec2::ZERO }).collect();
        let triangles = (0..(n - 1) * (n - 1))
            .flat_map(|i| {
                let a = i / (n - 1) * n + i % (n - 1);
                [[a, a + 1, a + n], [a + 1, a + n + 1, a + n]]
            })
            .collect();
        let mesh = Mesh { points, vertices, triangles, ..Mesh::default() };
        let offsets = mesh.points.iter().map(|p| Vec3::new(-0.2 * p.x, 0.0, 0.0)).collect();
        let shape = BlendShape {
            name: "squeeze".into(),
            points: (0..n * n).collect(),
            offsets,
            ..BlendShape::default()
        };
        for strain in shape_strain(&mesh, &shape) {
            assert!((strain.area + 0.2).abs() < 1e-5 && (strain.compression.x.abs() - 1.0).abs() < 1e-4);
            let p = StrainModel::default().predict(&strain);
            assert!((p.bias_ratio - 0.88).abs() < 1e-4 && (p.wrinkle - 0.6).abs() < 1e-4, "{p:?}");
        }
        let still = StrainModel::default().predict(&SurfaceStrain::default());
        assert_eq!(still, StrainPrediction { bias_ratio: 1.0, scale: 1.0, wrinkle: 0.0 });
    }
}
