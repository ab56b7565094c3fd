//! Which level of a head a frame draws ([`rubor_rig::level`]).

use super::view::nearest_pixel_metres;
use super::{HeadInstance, Scene};
use crate::device::Gpu;
use crate::settings::DetailMethod;

/// Error of a level in pixels on the nearest part of a head that a picture may have.
pub(crate) const ERROR_PIXELS: f32 = 0.125;

/// The heads of a scene as a frame of a size draws them: each at its coarsest level whose error stays below [`ERROR_PIXELS`].
///
/// It follows from the frame alone. A camera that trembles about such a distance draws both levels in turn, which differ by
/// less than those pixels.
pub(crate) fn levelled<'a>(
    gpu: &Gpu,
    scene: &Scene<'a>,
    detail: DetailMethod,
    size: [u32; 2],
) -> Vec<HeadInstance<'a>> {
    let error_metres = |placed: &HeadInstance<'_>| match detail {
        DetailMethod::Full => 0.0,
        DetailMethod::Auto => ERROR_PIXELS * nearest_pixel_metres(scene, size, placed),
    };
    let of = |placed: &HeadInstance<'a>| HeadInstance {
        head: placed.head.at(gpu, error_metres(placed)),
        ..*placed
    };
    scene.heads.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{Mat4, Vec3};
    use rubor_rig::face_state::FaceState;
    use rubor_rig::head::Head;
    use rubor_rig::level::Level;
    use rubor_rig::map::Map;

    use super::*;
    use crate::channels::Channel;
    use crate::tests::{WHITE_TABLE, dome, lamp, read, render, renderer, settings};
    use crate::{Camera, HeadOnGpu, Ladder};

    const ERROR_METRES: f32 = 1e-4;

    /// A level with all triangles, in reverse order within their parts.
    fn whole(head: &Head) -> Vec<Level> {
        let mesh = &head.mesh;
        let reversed = |p: &rubor_rig::head::Part| p.triangles.clone().rev();
        let order: Vec<u32> = mesh.parts.iter().flat_map(reversed).collect();
        let mut hosts = vec![0; order.len()];
        order.iter().enumerate().for_each(|(new, old)| hosts[*old as usize] = new as u32);
        let level = Level {
            error_metres: ERROR_METRES,
            triangles: order.iter().map(|t| mesh.triangles[*t as usize]).collect(),
            parts: mesh.parts.iter().map(|p| p.triangles.clone()).collect(),
            hosts,
        };
        vec![level]
    }

    /// The first triangle of each part alone.
    fn crumb(head: &Head) -> Vec<Level> {
        let firsts: Vec<_> =
            head.mesh.parts.iter().map(|p| head.mesh.triangles[p.triangles.start as usize]).collect();
        let parts = (0..firsts.len() as u32).map(|i| i..i + 1);
        let part_of =
            |t: usize| head.mesh.parts.iter().position(|p| p.triangles.contains(&(t as u32))).unwrap_or(0);
        let hosts = (0..head.mesh.triangles.len()).map(|t| part_of(t) as u32).collect();
        vec![Level { error_metres: ERROR_METRES, triangles: firsts, parts: parts.collect(), hosts }]
    }

    fn camera(metres: f32) -> Camera {
        // The dome fills the same part of the picture from everywhere.
        let fov_degrees = 2.0 * (0.1f32 / metres).atan().to_degrees();
        Camera { position: metres * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees }
    }

    #[test]
    fn a_level_of_all_triangles_is_the_head() {
        let Some(mut renderer) = renderer() else { return };
        let mut head = dome();
        head.maps.hair = Some(Map::filled(8, 8, &[0.9]));
        let mut state = FaceState::neutral(&head);
        state.shapes.iter_mut().for_each(|w| *w = 0.5);
        let mut picture = |make: Option<fn(&Head) -> Vec<Level>>, detail| {
            let mut on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
            if let Some(make) = make {
                on_gpu = on_gpu.with_ladder(Ladder::new(Arc::new(head.clone()), make, ERROR_METRES));
            }
            let heads = [HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }];
            let mut scene = scene(&heads, 2.0);
            let lights = [lamp()];
            scene.lights = &lights;
            let mut settings = settings([96; 2]);
            settings.quality.detail = detail;
            settings.output.channels = vec![Channel::Radiance];
            let (_, stats) = render(&mut renderer, &scene, &settings).expect("it draws");
            (read(&renderer, Channel::Radiance).texels::<4>().collect::<Vec<_>>(), stats)
        };
        let (right, all) = picture(None, DetailMethod::Auto);
        let (same, of_level) = picture(Some(whole), DetailMethod::Auto);
        // Its normals at rest are stored as half floats beside those of its triangles: a highlight may move by 0.0005 radians.
        let apart: Vec<f32> = right.iter().zip(&same).map(|(a, b)| (a[1] - b[1]).abs()).collect();
        let mean = apart.iter().sum::<f32>() / apart.len() as f32;
        let most = apart.iter().copied().fold(0.0, f32::max);
        assert!(mean < 2e-4 && most < 1e-2, "{mean}, {most}");
        assert_eq!(all.triangles, of_level.triangles);
        let (_, least) = picture(Some(crumb), DetailMethod::Auto);
        assert!(least.triangles < all.triangles / 10, "{}", least.triangles);
        let (_, of_full) = picture(Some(crumb), DetailMethod::Full);
        assert_eq!(of_full.triangles, all.triangles);
    }

    fn scene<'a>(heads: &'a [HeadInstance<'a>], metres: f32) -> Scene<'a> {
        Scene {
            heads,
            camera: camera(metres),
            lights: &[],
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 0.0,
            background_linear: Vec3::ZERO,
            optics: Default::default(),
        }
    }

    #[test]
    fn a_level_is_drawn_from_the_distance_on_where_it_is_off_by_an_eighth_of_a_pixel() {
        let Some(mut renderer) = renderer() else { return };
        let head = dome();
        let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
        let on_gpu = on_gpu.with_ladder(Ladder::new(Arc::new(head.clone()), crumb, ERROR_METRES));
        let state = FaceState::neutral(&head);
        let heads = [HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }];
        let mut last = u64::MAX;
        for step in 0..30 {
            let mut scene = scene(&heads, 0.3 * 1.15f32.powi(step));
            scene.camera.fov_degrees = 30.0;
            let lights = [lamp()];
            scene.lights = &lights;
            let pixel = nearest_pixel_metres(&scene, [64; 2], &heads[0]);
            let mut settings = settings([64; 2]);
            settings.output.channels.clear();
            let (_, stats) = render(&mut renderer, &scene, &settings).expect("it draws");
            let is_level = stats.triangles < head.mesh.triangles.len() as u64 / 10;
            assert_eq!(is_level, ERROR_METRES <= ERROR_PIXELS * pixel, "a pixel of {pixel} m");
            assert!(stats.triangles <= last, "farther away, fewer triangles");
            last = stats.triangles;
        }
        assert!(last < 100);
    }
}
