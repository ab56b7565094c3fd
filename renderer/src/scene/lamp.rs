//! Lamps as shaders read them, and their views of the heads.

use glam::camera::rh::{proj, view};
use glam::{Mat4, Vec2, Vec3, Vec4};

use super::clusters::Sphere;
use super::placement::bounding_sphere;
use super::{Environment, Light, LightKind, MAX_LIGHTS, Scene};
use crate::device::Image;

/// Cosine between the camera's view and the direction to a lamp above which the lamp is behind the heads.
const BEHIND_COSINE: f32 = 0.4;

/// A light as the shader reads it; the fields are described there.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuLight {
    pub(crate) clip_from_world: Mat4,
    pub(crate) color: [f32; 4],
    pub(crate) position: [f32; 4],
    pub(crate) spot: [f32; 4],
    pub(crate) shape: [f32; 4],
    pub(crate) shadow: [f32; 4],
}

impl GpuLight {
    /// A light with its shadow map, if it has one.
    pub(crate) fn new(light: &Light, shadow: Option<(u32, LightView)>) -> Self {
        let mut result: Self = bytemuck::Zeroable::zeroed();
        result.color = light.color_linear.extend(light.radius).to_array();
        result.spot[3] = -2.0;
        match light.kind {
            LightKind::Directional { direction } => {
                result.position = (-direction.normalize_or(Vec3::NEG_Z)).extend(0.0).to_array();
            }
            LightKind::Point { position } => result.position = position.extend(1.0).to_array(),
            LightKind::Spot { position, direction, outer_degrees, inner_degrees } => {
                result.position = position.extend(1.0).to_array();
                let outer = outer_degrees.to_radians().cos();
                result.spot = direction.normalize_or(Vec3::NEG_Z).extend(outer).to_array();
                // smoothstep needs two different edges.
                result.shape[0] = inner_degrees.to_radians().cos().max(outer + 1e-4);
            }
        }
        result.shape[1] = -1.0;
        if let Some((layer, view)) = shadow {
            result.clip_from_world = view.clip_from_world;
            result.shape[1] = layer as f32;
            result.shape[2] = view.near;
            result.shape[3] = view.far;
            result.shadow[0] = view.across;
        }
        result
    }
}

/// The light of a frame: lamps with their shadow maps, and the environment.
pub(crate) struct Illumination<'a> {
    pub(crate) lights: [GpuLight; MAX_LIGHTS],
    /// A layer for each lamp that casts shadows; at least one.
    pub(crate) shadows: Image,
    pub(crate) environment: Option<&'a Environment>,
    pub(crate) environment_intensity: f32,
    /// Radians about +Y.
    pub(crate) environment_rotation: f32,
    /// Whether the heads have the light that they send to themselves.
    pub(crate) bounces: bool,
}

impl Illumination<'_> {
    /// Coefficients of the environment's irradiance / pi; zeros without one.
    pub(crate) fn harmonics(&self) -> [[f32; 4]; 9] {
        self.environment.map_or([[0.0; 4]; 9], |e| e.harmonics_at(self.environment_rotation))
    }

    /// Levels of the filtered environment.
    pub(crate) fn environment_levels(&self) -> f32 {
        self.environment.map_or(1.0, |e| e.levels as f32)
    }
}

/// A light's view of the heads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightView {
    pub(crate) clip_from_world: Mat4,
    /// Metres from the light (or from the plane before the sphere) to the near and far end of the depth range.
    pub(crate) near: f32,
    pub(crate) far: f32,
    /// Metres across the map, at 1 m for lights with a place.
    pub(crate) across: f32,
}

/// Room around what receives shadows, metres: half the widest search for blockers, and the distance that light travels
/// in skin.
const MARGIN_METRES: f32 = 0.012;
/// Steps of window size per doubling.
const WINDOW_STEPS: f32 = 4.0;
/// Smallest window, as a share of the whole map's width.
const LEAST_WINDOW: f32 = 1.0 / 32.0;
/// Windows move by this share of their width: whole texels of any map of a power of two from 64.
const WINDOW_MOVES: f32 = 1.0 / 64.0;

impl LightView {
    /// Fits a view to a sphere (metres).
    pub(crate) fn fit(kind: &LightKind, center: Vec3, radius: f32) -> Self {
        let (direction, distance) = match *kind {
            LightKind::Directional { direction } => (direction.normalize_or(Vec3::NEG_Z), None),
            LightKind::Spot { position, .. } | LightKind::Point { position } => {
                let way = center - position;
                (way.normalize_or(Vec3::NEG_Z), Some((position, way.length().max(1.05 * radius))))
            }
        };
        let up = if direction.y.abs() > 0.9 { Vec3::X } else { Vec3::Y };
        match distance {
            None => {
                let (near, far) = (0.0, 2.0 * radius);
                let eye = center - direction * radius;
                let projection = proj::directx::orthographic(-radius, radius, -radius, radius, near, far);
                let view = view::look_to_mat4(eye, direction, up);
                Self { clip_from_world: projection * view, near, far, across: 2.0 * radius }
            }
            Some((eye, distance)) => {
                let (near, far) = (distance - radius, distance + radius);
                let tangent = (radius / distance).asin().tan();
                let projection = proj::directx::perspective(2.0 * tangent.atan(), 1.0, near, far);
                let view = view::look_to_mat4(eye, direction, up);
                Self { clip_from_world: projection * view, near, far, across: 2.0 * tangent }
            }
        }
    }

    /// Metres across the map at its far end.
    fn widest(&self) -> f32 {
        let is_perspective = self.clip_from_world.row(3).truncate() != Vec3::ZERO;
        if is_perspective { self.across * self.far } else { self.across }
    }

    /// The part of the view that holds spheres, as a square; all of it if the square would not be smaller.
    pub(crate) fn narrowed(self, kind: &LightKind, receivers: &[Sphere]) -> Self {
        let is_perspective = kind.position().is_some();
        let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        for s in receivers {
            let clip = self.clip_from_world * s.center.extend(1.0);
            let radius = s.radius + MARGIN_METRES;
            let (near, far) = match is_perspective {
                true => ((clip.w - radius).max(self.near), clip.w + radius),
                false => (1.0, 1.0),
            };
            let center = Vec2::new(clip.x, clip.y);
            let reach = Vec2::splat(2.0 * radius / self.across);
            // The nearer end of the sphere is farther from the middle of the picture.
            let out = |v: Vec2, sign: f32| {
                let at = |x: f32| x / if x * sign > 0.0 { near } else { far };
                Vec2::new(at(v.x), at(v.y))
            };
            low = low.min(out(center - reach, -1.0));
            high = high.max(out(center + reach, 1.0));
        }
        let (low, high) = (low.max(Vec2::NEG_ONE), high.min(Vec2::ONE));
        let half = 0.5 * (high - low).max_element() * (1.0 + 2.0 * WINDOW_MOVES);
        let half = ((half.max(LEAST_WINDOW).log2() * WINDOW_STEPS).ceil() / WINDOW_STEPS).exp2();
        if !(low.cmplt(high).all() && half < 1.0) {
            return self;
        }
        let step = 2.0 * half * WINDOW_MOVES;
        let center = (0.5 * (low + high) / step).round() * step;
        let window = Mat4::from_cols(
            Vec4::X / half,
            Vec4::Y / half,
            Vec4::Z,
            Vec4::new(-center.x / half, -center.y / half, 0.0, 1.0),
        );
        Self { clip_from_world: window * self.clip_from_world, across: half * self.across, ..self }
    }
}

/// Lamps that are not off.
fn shining(lamps: &[Light]) -> Vec<Light> {
    lamps.iter().filter(|l| l.color_linear.max_element() > 0.0).copied().collect()
}

/// The lamps of a scene that shine and, where the environment's light may pass through thin parts and no lamp with shadows
/// shines from behind the heads, a lamp without light there, whose shadow map gives their thickness.
pub(crate) fn lamps(scene: &Scene<'_>, transmits: bool) -> Vec<Light> {
    let mut lamps = shining(scene.lights);
    let (center, _) = bounding_sphere(scene);
    let view = (center - scene.camera.position).normalize_or(Vec3::NEG_Z);
    let is_behind = |l: &Light| {
        let direction = match l.kind {
            LightKind::Directional { direction } => direction,
            LightKind::Spot { position, .. } | LightKind::Point { position } => center - position,
        };
        l.casts_shadow && direction.normalize_or_zero().dot(view) < -BEHIND_COSINE
    };
    if transmits && scene.environment.is_some() && lamps.len() < MAX_LIGHTS && !lamps.iter().any(is_behind) {
        let kind = LightKind::Directional { direction: -view };
        lamps.push(Light { kind, color_linear: Vec3::ZERO, radius: 0.0, casts_shadow: true });
    }
    lamps
}

/// Texels of a shadow map for a pixel of the picture beyond which nobody sees what more would show (`docs/raster.md`).
const TEXELS_PER_PIXEL: f32 = 10.0;

/// Side of the maps of lamps in texels: `most`, halved while they are finer than a picture shows whose pixels are as wide as this on the
/// nearest part of a head, metres; 0 where the camera may be in a head.
pub(crate) fn map_side(views: &[LightView], pixel_metres: f32, most: u32) -> u32 {
    let needed = views.iter().map(|v| TEXELS_PER_PIXEL * v.widest() / pixel_metres).fold(0.0, f32::max);
    let mut side = most;
    while !views.is_empty() && side > LEAST_SIDE && side as f32 >= 2.0 * needed {
        side = side.div_ceil(2);
    }
    side
}

/// Maps are not made smaller than this for being far away, texels.
const LEAST_SIDE: u32 = 64;

/// Lights for the shader, and the views of those that cast shadows, in the order of their layers.
pub(crate) fn place_lights(
    scene: &Scene<'_>,
    lamps: &[Light],
    receivers: &[Sphere],
) -> ([GpuLight; MAX_LIGHTS], Vec<LightView>) {
    let (center, radius) = bounding_sphere(scene);
    let mut gpu_lights: [GpuLight; MAX_LIGHTS] = bytemuck::Zeroable::zeroed();
    let mut views = Vec::new();
    for (slot, light) in gpu_lights.iter_mut().zip(lamps) {
        let shadow = light.casts_shadow.then(|| {
            let view = LightView::fit(&light.kind, center, radius).narrowed(&light.kind, receivers);
            views.push(view);
            (views.len() as u32 - 1, view)
        });
        *slot = GpuLight::new(light, shadow);
    }
    (gpu_lights, views)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sphere_fits_the_map() {
        let center = Vec3::new(0.1, 1.5, -0.2);
        let kinds = [
            LightKind::Directional { direction: Vec3::new(0.3, -1.0, -0.2) },
            LightKind::Point { position: Vec3::new(0.5, 2.0, 1.0) },
        ];
        for kind in kinds {
            let view = LightView::fit(&kind, center, 0.15);
            for offset in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z] {
                let p = view.clip_from_world.project_point3(center + 0.149 * offset);
                assert!(p.x.abs() <= 1.0 && p.y.abs() <= 1.0 && (0.0..=1.0).contains(&p.z), "{kind:?} {p}");
            }
        }
    }

    #[test]
    fn lamps_that_are_off_cost_nothing() {
        let kind = LightKind::Point { position: Vec3::Z };
        let lamp =
            |power: f32| Light { kind, color_linear: Vec3::splat(power), radius: 0.0, casts_shadow: true };
        assert_eq!(shining(&[lamp(0.0), lamp(2.0), lamp(0.0)]), [lamp(2.0)]);
    }

    #[test]
    fn maps_are_as_fine_as_the_picture_can_show() {
        let kind = LightKind::Directional { direction: Vec3::NEG_Z };
        let views = [LightView::fit(&kind, Vec3::ZERO, 0.16)];
        let side = |pixel_mm: f32, most: u32| map_side(&views, 1e-3 * pixel_mm, most);
        // 0.32 m are 1143 pixels, which need 11 430 texels.
        assert_eq!(side(0.28, 2048), 2048);
        // 65 pixels, 653 texels: half of 1024 would be too few.
        assert_eq!(side(4.9, 2048), 1024);
        assert_eq!(side(4.9, 77), 77);
        assert_eq!(side(1e4, 2048), 64);
        assert_eq!(side(0.0, 2048), 2048, "in the head");
        assert_eq!(map_side(&[], 1.0, 2048), 2048, "no lamp");
        // A lamp with a place sees more the farther it looks: 0.36 m at 2.15 m.
        let lamp = LightView::fit(&LightKind::Point { position: 2.0 * Vec3::Z }, Vec3::ZERO, 0.16);
        assert!((lamp.widest() - 0.32 * 2.16 / 2.0).abs() < 0.01, "{}", lamp.widest());
    }

    #[test]
    fn a_window_holds_what_it_is_made_for_and_little_else() {
        let center = Vec3::new(0.1, 1.5, -0.2);
        let kinds = [
            LightKind::Directional { direction: Vec3::new(0.3, -1.0, -0.2) },
            LightKind::Point { position: Vec3::new(0.5, 2.0, 1.0) },
        ];
        for kind in kinds {
            let whole = LightView::fit(&kind, center, 0.15);
            let receivers =
                [0.0, 0.02].map(|x| Sphere { center: center + Vec3::new(x, 0.05, 0.03), radius: 0.01 });
            let view = whole.narrowed(&kind, &receivers);
            assert!(view.across < 0.4 * whole.across, "{} of {}", view.across, whole.across);
            for s in receivers {
                for offset in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z] {
                    let p = view.clip_from_world.project_point3(s.center + s.radius * offset);
                    assert!(p.x.abs() <= 1.0 && p.y.abs() <= 1.0, "{kind:?} {p}");
                    // Depth is that of the whole map.
                    let q = whole.clip_from_world.project_point3(s.center + s.radius * offset);
                    assert!((p.z - q.z).abs() < 1e-5);
                }
            }
            let everything = [Sphere { center, radius: 0.15 }];
            assert_eq!(whole.narrowed(&kind, &everything).across, whole.across);
            assert_eq!(whole.narrowed(&kind, &[]).across, whole.across);
        }
    }

    #[test]
    fn a_light_inside_the_head_does_not_divide_by_zero() {
        let kind = LightKind::Point { position: Vec3::ZERO };
        assert!(LightView::fit(&kind, Vec3::ZERO, 0.15).clip_from_world.is_finite());
    }
}
