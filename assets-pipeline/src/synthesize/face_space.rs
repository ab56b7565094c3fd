//! Canonical face space: the place of a texel said in a way that holds on every head.
//!
//! ```text
//! rest position (m) --warp by landmarks--> canonical position (mm) --plan--> (s, y) on the face (mm)
//! ```
//!
//! The canonical face is an adult of average proportions. Its origin lies on the middle plane at the height of the
//! root of the nose, 87 mm behind it, roughly on the axis of the skull; axes as in the head's space. The warp is an
//! affine map plus multiquadric radial functions (Hardy 1971) that takes the landmarks of a head to those of the
//! canonical face, so a field placed at the canonical wing of the nose lands on the wing of any nose. It is smooth
//! everywhere, so fields that are continuous in canonical space are continuous on the surface, across UV borders too.

use glam::{DVec3, Vec2, Vec3};
use nalgebra::{DMatrix, DVector};
use rubor_rig::head::{Head, MM_PER_METRE};

/// Radius of the cylinder that the plan of the face is unrolled from, mm: about the mean radius of cheeks and brows,
/// so that plan distances are near distances on the skin.
pub(crate) const PLAN_RADIUS_MM: f32 = 80.0;

/// Canonical landmarks on the middle line, mm.
const MIDDLE: [(&str, [f32; 3]); 10] = [
    ("vertex", [0.0, 108.0, 0.0]),
    ("trichion", [0.0, 76.0, 64.0]),
    ("glabella", [0.0, 22.0, 87.5]),
    ("sellion", [0.0, 0.0, 87.0]),
    ("pronasale", [0.0, -33.0, 110.8]),
    ("subnasale", [0.0, -49.0, 95.7]),
    ("labrale-superius", [0.0, -61.8, 98.4]),
    ("stomion", [0.0, -70.6, 92.7]),
    ("labrale-inferius", [0.0, -80.8, 95.5]),
    ("menton", [0.0, -117.0, 80.0]),
];

/// Canonical paired landmarks, left side (+X), mm. The centre of the eye is not among them: it lies inside the head
/// and its depth says nothing about the skin.
const PAIRED: [(&str, [f32; 3]); 13] = [
    ("endocanthion", [18.4, -4.5, 72.0]),
    ("exocanthion", [44.6, -2.7, 66.0]),
    ("lid-upper", [33.2, 2.1, 74.5]),
    ("lid-lower", [33.2, -6.2, 73.2]),
    ("brow-inner", [11.7, 22.0, 87.3]),
    ("brow-middle", [31.0, 25.4, 82.0]),
    ("brow-outer", [58.2, 15.0, 59.1]),
    ("alare", [15.0, -45.5, 88.0]),
    ("cheilion", [25.3, -72.2, 81.9]),
    ("zygion", [70.0, -14.0, 30.0]),
    ("cheek", [44.0, -30.0, 73.0]),
    ("gonion", [62.0, -77.0, 6.0]),
    ("ear", [91.0, -12.0, -33.0]),
];

/// Smoothing length of the radial functions, mm: they are cones rounded at this scale.
const ROUNDING_MM: f64 = 10.0;
/// Fewer landmarks than this do not fix an affine map; the bounds of the head are used instead.
const MIN_LANDMARKS: usize = 6;

/// Diagonal of the radial system for a landmark, mm: how loosely it is followed. Those that people place within a
/// millimetre are met; those on smooth flesh, or whose place is a matter of taste (a brow can be plucked), only pull.
fn looseness(name: &str) -> f64 {
    if name.starts_with("brow") {
        40.0
    } else if ["vertex", "trichion", "menton"].contains(&name)
        || ["zygion", "cheek", "gonion", "ear"].iter().any(|n| name.starts_with(n))
    {
        15.0
    } else {
        // A whisper of smoothing, so that two landmarks a hair apart do not fold the warp.
        0.5
    }
}

/// Canonical position of a landmark of the left side or of the middle, mm.
///
/// # Panics
/// For a name that is not in the tables above (a slip in this module's own code).
#[cfg(test)]
pub(crate) fn canonical(name: &str) -> Vec3 {
    let found = MIDDLE.iter().chain(&PAIRED).find(|(n, _)| *n == name);
    Vec3::from_array(found.expect("a landmark of the canonical face").1)
}

/// All landmarks of the canonical face, both sides, mm.
pub(crate) fn canonical_landmarks() -> impl Iterator<Item = Vec3> {
    let middle = MIDDLE.iter().map(|(_, place)| Vec3::from_array(*place));
    let left = PAIRED.iter().map(|(_, place)| Vec3::from_array(*place));
    middle.chain(left.flat_map(|p| [p, p * Vec3::new(-1.0, 1.0, 1.0)]))
}

/// A position on the face unrolled about the vertical axis: arc length to the left of the middle, and height, mm.
pub(crate) fn plan(c: Vec3) -> Vec2 {
    Vec2::new(PLAN_RADIUS_MM * c.x.atan2(c.z), c.y)
}

/// Gradient in canonical space of a function of the plan: `(df/ds, df/dy)` carried back.
pub(crate) fn plan_gradient(c: Vec3, d: Vec2) -> Vec3 {
    // s = R atan2(x, z): ds/dx = R z / rho^2, ds/dz = -R x / rho^2. The floor keeps the axis finite; it lies deep
    // inside the head, where there is no skin.
    let rho2 = (c.x * c.x + c.z * c.z).max(100.0);
    Vec3::new(d.x * PLAN_RADIUS_MM * c.z / rho2, d.y, -d.x * PLAN_RADIUS_MM * c.x / rho2)
}

/// The warp of one head into canonical space.
pub(crate) struct FaceSpace {
    /// Landmarks of the head, mm, relative to `origin`.
    centres: Vec<DVec3>,
    origin: DVec3,
    /// One weight a centre.
    weights: Vec<DVec3>,
    /// Images of 1, x, y, z.
    affine: [DVec3; 4],
}

impl FaceSpace {
    /// Fits the warp to the landmarks that a head has; without enough of them, to its bounds.
    pub(crate) fn fit(head: &Head) -> Self {
        let mut pairs: Vec<(DVec3, DVec3, f64)> = Vec::new();
        let mut add = |name: &str, to: Vec3| {
            if let Some(from) = head.landmarks.get(name).filter(|p| p.is_finite()) {
                pairs.push(((*from * MM_PER_METRE).as_dvec3(), to.as_dvec3(), looseness(name)));
            }
        };
        for (name, c) in MIDDLE {
            add(name, Vec3::from_array(c));
        }
        for (name, [x, y, z]) in PAIRED {
            add(&format!("{name}-left"), Vec3::new(x, y, z));
            add(&format!("{name}-right"), Vec3::new(-x, y, z));
        }
        Self::from_pairs(&pairs).unwrap_or_else(|| Self::from_bounds(head))
    }

    /// `None` when the landmarks are too few or lie in a plane.
    /// `pairs` are places on the head (mm), canonical places and how loosely they are followed.
    fn from_pairs(pairs: &[(DVec3, DVec3, f64)]) -> Option<Self> {
        let n = pairs.len();
        if n < MIN_LANDMARKS {
            return None;
        }
        let origin = pairs.iter().map(|p| p.0).sum::<DVec3>() / n as f64;
        let looseness: Vec<f64> = pairs.iter().map(|p| p.2).collect();
        let centres: Vec<DVec3> = pairs.iter().map(|p| p.0 - origin).collect();
        // [K P; P^T 0] [w; a] = [targets; 0], the standard system of radial interpolation with a linear part.
        let mut system = DMatrix::<f64>::zeros(n + 4, n + 4);
        for i in 0..n {
            for j in 0..n {
                system[(i, j)] = -rounded_distance(centres[i] - centres[j]);
            }
            system[(i, i)] += looseness[i];
            for (k, v) in [1.0, centres[i].x, centres[i].y, centres[i].z].into_iter().enumerate() {
                system[(i, n + k)] = v;
                system[(n + k, i)] = v;
            }
        }
        let lu = system.lu();
        let mut axes = Vec::with_capacity(3);
        for axis in 0..3 {
            let mut right = DVector::<f64>::zeros(n + 4);
            for (i, (_, to, _)) in pairs.iter().enumerate() {
                right[i] = to[axis];
            }
            let solution = lu.solve(&right)?;
            if solution.iter().any(|v| !v.is_finite()) {
                return None;
            }
            axes.push(solution);
        }
        let at = |i: usize| DVec3::new(axes[0][i], axes[1][i], axes[2][i]);
        let affine = [at(n), at(n + 1), at(n + 2), at(n + 3)];
        // Coplanar landmarks can pass the solver by rounding; their affine part is then far from a similarity.
        let determinant = affine[1].dot(affine[2].cross(affine[3]));
        if !(0.05..20.0).contains(&determinant) {
            return None;
        }
        Some(Self { centres, origin, weights: (0..n).map(at).collect(), affine })
    }

    /// Places a head without landmarks by its bounds: the canonical head is 87 mm from the tip of the nose to its
    /// axis and spans y from -212 mm (shoulders) to 108 mm.
    fn from_bounds(head: &Head) -> Self {
        let (low, high) = head.bounds().unwrap_or((Vec3::ZERO, Vec3::ONE));
        let scale = f64::from(320.0 / (head.height() * MM_PER_METRE).max(1.0));
        let top_front = DVec3::new(f64::from((low.x + high.x) * 0.5), f64::from(high.y), f64::from(high.z))
            * f64::from(MM_PER_METRE);
        Self {
            centres: Vec::new(),
            origin: top_front,
            weights: Vec::new(),
            affine: [DVec3::new(0.0, 108.0, 110.8), DVec3::X * scale, DVec3::Y * scale, DVec3::Z * scale],
        }
    }

    /// Whether landmarks say where the face is, not the bounds of the head.
    pub(crate) fn follows_landmarks(&self) -> bool {
        !self.centres.is_empty()
    }

    /// Canonical position (mm) of a rest position (m).
    pub(crate) fn warp(&self, position: Vec3) -> Vec3 {
        let p = (position * MM_PER_METRE).as_dvec3() - self.origin;
        let mut c = self.affine[0] + self.affine[1] * p.x + self.affine[2] * p.y + self.affine[3] * p.z;
        for (centre, weight) in self.centres.iter().zip(&self.weights) {
            c -= *weight * rounded_distance(p - *centre);
        }
        c.as_vec3()
    }
}

fn rounded_distance(d: DVec3) -> f64 {
    (d.length_squared() + ROUNDING_MM * ROUNDING_MM).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rubor_rig::landmarks::paired;

    fn canonical_head(scale: f32, shift: Vec3) -> Head {
        let mut head = Head::default();
        let place = |c: [f32; 3]| (Vec3::from_array(c) * scale + shift) / MM_PER_METRE;
        for (name, c) in MIDDLE {
            head.landmarks.insert(name.into(), place(c));
        }
        for (name, [x, y, z]) in PAIRED {
            head.landmarks.insert(paired(name, true), place([x, y, z]));
            head.landmarks.insert(paired(name, false), place([-x, y, z]));
        }
        head
    }

    #[test]
    fn landmarks_go_to_their_canonical_places() {
        let mut head = canonical_head(0.9, Vec3::new(3.0, 1500.0, -20.0));
        // A longer nose than the canonical one still ends at the canonical tip, within the smoothing.
        head.landmarks.get_mut("pronasale").unwrap().z += 0.006;
        let space = FaceSpace::fit(&head);
        for (name, c) in MIDDLE {
            let d = space.warp(head.landmarks[name]).distance(Vec3::from_array(c));
            assert!(d < 0.6, "{name} is off by {d} mm");
        }
    }

    #[test]
    fn a_scaled_head_is_warped_affinely_everywhere() {
        let shift = Vec3::new(3.0, 1500.0, -20.0);
        let space = FaceSpace::fit(&canonical_head(0.9, shift));
        for c in [Vec3::new(40.0, 60.0, -90.0), Vec3::new(0.0, -180.0, 30.0)] {
            let d = space.warp((c * 0.9 + shift) / MM_PER_METRE).distance(c);
            assert!(d < 0.05, "{c} is off by {d} mm");
        }
    }

    #[test]
    fn missing_and_flat_landmarks_fall_back() {
        let mut head = canonical_head(1.0, Vec3::ZERO);
        head.landmarks.retain(|name, _| !name.starts_with("ear") && name != "trichion" && name != "vertex");
        let c = canonical("alare");
        assert!(FaceSpace::fit(&head).warp(c / MM_PER_METRE).distance(c) < 0.1);
        for p in head.landmarks.values_mut() {
            p.z = 0.0;
        }
        assert!(FaceSpace::fit(&head).warp(Vec3::ONE).is_finite());
        assert!(FaceSpace::fit(&Head::default()).warp(Vec3::ONE).is_finite());
    }

    #[test]
    fn plan_gradient_matches_differences() {
        let c = Vec3::new(30.0, -20.0, 70.0);
        let f = |c: Vec3| {
            let p = plan(c);
            0.3 * p.x + 0.7 * p.y
        };
        let gradient = plan_gradient(c, Vec2::new(0.3, 0.7));
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            let difference = (f(c + 0.1 * axis) - f(c - 0.1 * axis)) / 0.2;
            assert!((difference - gradient.dot(axis)).abs() < 1e-3);
        }
    }
}
