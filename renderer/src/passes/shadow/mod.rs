//! Depth of the heads from each light.
//!
//! ```text
//! positions, light --shadow--> depth layer (0 near, 1 far)
//! ```
//!
//! Theory: shadow maps (Williams 1978). A map shows what the camera sees of the heads and no more, so a close-up of a nose
//! has the resolution of the nose; whatever stands before that towards the light is in it. Windows come in steps, so
//! that shadows do not crawl as the camera moves. All triangles are drawn, front and back: a mouth or a nostril must
//! block light from either side. The soft edge is in `shade` (percentage-closer soft shadows).

use glam::camera::rh::{proj, view};
use glam::{Mat4, Vec2, Vec3, Vec4};

use crate::clusters::Sphere;
use crate::gpu::{Gpu, Raster};
use crate::head::HeadOnGpu;
use crate::pass_timer::PassTimer;
use crate::scene::LightKind;

/// WGSL of the pass.
pub(crate) const SHADER: &str = concat!(
    include_str!("../../shared/view.wgsl"),
    include_str!("../../shared/surface.wgsl"),
    include_str!("shadow.wgsl")
);

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

/// Room around what receives shadows, metres: half the widest search for blockers, and what light crosses in skin.
const MARGIN_METRES: f32 = 0.012;
/// Windows in a doubling of their size.
const WINDOW_STEPS: f32 = 4.0;
/// Smallest window as a share of the whole map's width.
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

    /// The part of the view that holds spheres, as a square; all of it where that is no smaller.
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

/// The pipeline of the pass.
pub(crate) struct Shadow {
    pipeline: wgpu::RenderPipeline,
}

impl Shadow {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let pipeline = gpu.raster_pipeline(&Raster {
            label: "shadow",
            wgsl: SHADER,
            vertex: "shadow_vertex",
            fragment: None,
            targets: &[],
            nearer: wgpu::CompareFunction::Less,
            writes_depth: true,
        });
        Self { pipeline }
    }

    /// Draws the opaque triangles of all heads into a layer.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut PassTimer,
        light: &LightView,
        heads: &[(&HeadOnGpu, &wgpu::Buffer)],
        layer: &wgpu::TextureView,
    ) {
        let clip_from_world = gpu.uniform("shadow", &light.clip_from_world);
        let depth = wgpu::RenderPassDepthStencilAttachment {
            view: layer,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Store }),
            stencil_ops: None,
        };
        let mut pass = timer.render(encoder, "shadow", &[], Some(depth));
        pass.set_pipeline(&self.pipeline);
        for (head, positions) in heads {
            let group = gpu.bind_layout(
                "shadow",
                &self.pipeline.get_bind_group_layout(0),
                &[clip_from_world.as_entire_binding(), positions.as_entire_binding()],
            );
            pass.set_bind_group(0, &group, &[]);
            pass.set_index_buffer(head.opaque_points.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..head.opaque_triangles * 3, 0, 0..1);
        }
    }
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
