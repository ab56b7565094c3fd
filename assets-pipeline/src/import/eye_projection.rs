//! The azimuthal texture projection of [`rubor_rig::head::Material::Eye`], and spheres fitted to eyeballs.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use nalgebra::{DMatrix, DVector};

/// Angles are stretched so that the limbus is there on every eye, whatever the size of its ball.
pub(crate) use rubor_rig::head::LIMBUS_UV;

/// Radius of the iris where it meets the white, metres (visible iris diameter 11.8 mm).
pub(crate) const LIMBUS_RADIUS: f32 = 0.0059;

/// Where an eye is and looks at rest.
pub(crate) struct EyeProjection {
    pub(crate) center: Vec3,
    pub(crate) axis: Vec3,
    limbus: f32,
}

impl EyeProjection {
    /// From the points of the outer surface. The ball is fitted to what lies away from the front, the axis to what
    /// stands out from the ball there, the cornea; an eye without one looks along +Z.
    pub(crate) fn fit(points: &[Vec3]) -> Self {
        let (center, _) = fit_sphere(points);
        let behind: Vec<Vec3> =
            points.iter().copied().filter(|p| (*p - center).angle_between(Vec3::Z) > 0.9).collect();
        let (center, radius) = fit_sphere(if behind.len() >= 12 { &behind } else { points });
        let bulge = points.iter().map(|p| *p - center).filter(|d| d.z > 0.5 * radius);
        let axis = bulge
            .map(|d| d.normalize_or_zero() * (d.length() - 1.02 * radius).max(0.0).powi(2))
            .sum::<Vec3>();
        let axis = axis.try_normalize().unwrap_or(Vec3::Z);
        Self { center, axis, limbus: limbus_angle(radius) }
    }

    /// Texture coordinate of a rest position.
    pub(crate) fn uv(&self, p: Vec3) -> Vec2 {
        let d = p - self.center;
        let right = (Vec3::X - self.axis * self.axis.x).normalize_or(Vec3::X);
        let down = -self.axis.cross(right);
        let theta = d.angle_between(self.axis);
        let phi = d.dot(down).atan2(d.dot(right));
        Vec2::splat(0.5) + uv_radius(theta, self.limbus) * Vec2::new(phi.cos(), phi.sin())
    }
}

/// Angle of the limbus from the pupil axis on a ball of a radius in metres.
pub(crate) fn limbus_angle(radius: f32) -> f32 {
    (LIMBUS_RADIUS / radius.max(1e-6)).clamp(0.05, 0.9).asin()
}

/// Distance from (0.5, 0.5): proportional to the angle up to the limbus and from there to 0.5 at the back.
pub(crate) fn uv_radius(theta: f32, limbus: f32) -> f32 {
    if theta <= limbus {
        LIMBUS_UV * theta / limbus
    } else {
        LIMBUS_UV + (0.5 - LIMBUS_UV) * (theta - limbus) / (PI - limbus)
    }
}

/// Least squares sphere: |p|^2 = 2 c.p + (r^2 - |c|^2), linear in c and the bracket.
pub(crate) fn fit_sphere(points: &[Vec3]) -> (Vec3, f32) {
    let mean = points.iter().sum::<Vec3>() / points.len().max(1) as f32;
    let local: Vec<Vec3> = points.iter().map(|p| *p - mean).collect();
    let a = DMatrix::from_fn(local.len(), 4, |i, j| if j < 3 { 2.0 * f64::from(local[i][j]) } else { 1.0 });
    let b = DVector::from_fn(local.len(), |i, _| f64::from(local[i].length_squared()));
    match a.svd(true, true).solve(&b, 1e-12) {
        Ok(x) => {
            let c = Vec3::new(x[0] as f32, x[1] as f32, x[2] as f32);
            (mean + c, (x[3] as f32 + c.length_squared()).max(0.0).sqrt())
        }
        Err(_) => (mean, 0.0),
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use super::*;

    #[test]
    fn the_limbus_is_a_circle_of_fixed_radius_and_axes_are_upright() {
        let (center, radius) = (Vec3::new(0.03, 0.01, 0.05), 0.013);
        let ring = |theta: f32, radius: f32| {
            (0..24).map(move |i| {
                let phi = TAU * i as f32 / 24.0;
                center + radius * Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
            })
        };
        let ball = [0.5, 0.9, 1.2, 1.6, 2.0, 2.4].into_iter().flat_map(|theta| ring(theta, radius));
        let cornea = [0.05, 0.2].into_iter().flat_map(|theta| ring(theta, radius + 0.001));
        let eye = EyeProjection::fit(&ball.chain(cornea).collect::<Vec<Vec3>>());
        assert!(eye.center.distance(center) < 1e-5 && eye.axis.angle_between(Vec3::Z) < 1e-3);
        for p in ring((LIMBUS_RADIUS / radius).asin(), radius) {
            let r = eye.uv(p).distance(Vec2::splat(0.5));
            assert!((r - LIMBUS_UV).abs() < 1e-4, "{r}");
        }
        let up = eye.uv(center + radius * Vec3::new(0.0, 0.3, 0.95));
        assert!(up.y < 0.5 && (up.x - 0.5).abs() < 1e-3, "{up}");
        let left = eye.uv(center + radius * Vec3::new(0.3, 0.0, 0.95));
        assert!(left.x > 0.5 && (left.y - 0.5).abs() < 1e-3, "{left}");
    }
}
