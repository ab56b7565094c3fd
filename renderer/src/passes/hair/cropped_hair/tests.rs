use glam::{Mat4, Quat};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Head, Material, Part, Vertex};
use rubor_rig::map::Map;

use super::*;
use crate::channels::Channel;
use crate::scene::hair_roots::{self, Root};
use crate::scene::posed_head::{HAIR_BYTES, Instance};
use crate::settings::{AntialiasMethod, RasterMethod};
use crate::testing::{assert_layout, assert_raster, assert_workgroups, offsets};
use crate::tests::{WHITE_TABLE, dome, lamp, read, render, renderer, settings};
use crate::{Camera, HeadInstance, HeadOnGpu, Renderer, Scene};

/// The dome with hair on the half of its texture where v is under one half, and its triangles.
fn half_haired() -> (Head, Vec<[u32; 4]>) {
    let mut head = dome();
    let side = 64;
    let mut hair = Map::filled(side, side, &[0.0]);
    hair.values[..(side * side / 2) as usize].fill(0.9);
    head.maps.hair = Some(hair);
    let triangles = head.mesh.triangles.iter().map(|t| [t[0], t[1], t[2], 0]).collect();
    (head, triangles)
}

#[test]
fn shader_is_valid_and_laid_out_as_here() {
    assert_raster(&program(), &["cropped_hair_vertex", "cropped_hair_fragment"]);
    let entry = "light_hairs";
    assert_workgroups(&program(), &[(entry, [64, 1, 1])]);
    let covering = program().flag("tests_depth", true).flag("stored_shadows", true);
    assert_workgroups(&covering, &[("cover_hairs", [64, 1, 1])]);
    assert_layout(
        &program(),
        entry,
        "Params",
        size_of::<Params>(),
        &offsets!(Params; color as "color", count as "count", share as "share"),
    );
    assert_layout(
        &program(),
        entry,
        "Root",
        size_of::<Root>(),
        &offsets!(Root; triangle as "triangle", weights as "weights", flow as "flow", look as "look"),
    );
}

#[test]
fn hairs_stand_where_the_map_has_hair_and_flow_along_the_skin() {
    let (head, triangles) = half_haired();
    let roots = hair_roots::roots(&head, &triangles);
    assert!(roots.len() > 1000, "{}", roots.len());
    let unorm = |v: u32| [v & 0xffff, v >> 16].map(|h| h as f32 / 65535.0);
    for root in &roots {
        let corners = triangles[root.triangle as usize];
        let of = |i: usize| head.mesh.vertices[corners[i] as usize];
        let point = |i: usize| head.mesh.points[of(i).point as usize];
        let [x, y] = unorm(root.weights);
        let v = x * of(0).uv.y + y * of(1).uv.y + (1.0 - x - y) * of(2).uv.y;
        // Bilinear fetches reach one texel beyond.
        assert!(v < 0.5 + 1.0 / 64.0, "a hair at v = {v}");
        let halves = [root.flow as u16, (root.flow >> 16) as u16].map(|b| half::f16::from_bits(b).to_f32());
        let flow = halves[0] * (point(1) - point(0)) + halves[1] * (point(2) - point(0));
        assert!((flow.length() - 1.0).abs() < 0.01, "{flow}");
        assert!(unorm(root.look)[0] > 0.2);
    }
    assert_eq!(roots, hair_roots::roots(&head, &triangles), "the same head has the same hairs");
}

#[test]
fn strands_keep_their_skin_and_bald_heads_have_no_hair() {
    let (mut head, triangles) = half_haired();
    let all = hair_roots::roots(&head, &triangles);
    // A strand somewhere on the haired half.
    let corners = triangles[all[0].triangle as usize];
    let point = head.mesh.vertices[corners[0] as usize].point;
    let first = head.mesh.vertices.len() as u32;
    for k in 0..3 {
        let uv = glam::Vec2::new(2.0, k as f32 / 2.0);
        head.mesh.vertices.push(Vertex { point, uv });
    }
    let end = head.mesh.triangles.len() as u32;
    head.mesh.triangles.push([first, first + 1, first + 2]);
    head.mesh.parts.push(Part { name: "brow".into(), material: Material::Hair, triangles: end..end + 1 });
    let fewer = hair_roots::roots(&head, &triangles);
    assert!(fewer.len() < all.len() && !fewer.is_empty(), "{} and {}", fewer.len(), all.len());
    head.maps.hair = None;
    assert_eq!(hair_roots::roots(&head, &triangles), []);
}

#[test]
fn a_hair_moves_with_its_root() {
    let Some(mut renderer) = renderer() else { return };
    let mut head = dome();
    head.maps.hair = Some(Map::filled(8, 8, &[0.9]));
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    // 21 mm of the lower edge of the dome, seen from so far that perspective hardly matters: a hair is 1.7 pixels wide.
    let edge = Vec3::new(0.0, -0.08, 0.0358);
    let distance = 0.6;
    let size = 256u32;
    let fov_degrees = 2.0 * (0.0105f32 / distance).atan().to_degrees();
    let pixels_per_metre = size as f32 / 0.021;
    let mut settings = settings([size; 2]);
    settings.quality.antialias = AntialiasMethod::SmaaT2x;
    // The head nods sideways about the axis of the camera; otherwise the edge stands still.
    let turn = 0.002f32;
    for angle in [0.0, turn] {
        let mut state = FaceState::neutral(&head);
        state.head_rotation = Quat::from_rotation_z(angle);
        let heads = [HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }];
        let scene = Scene {
            heads: &heads,
            camera: Camera { position: edge + distance * Vec3::Z, target: edge, up: Vec3::Y, fov_degrees },
            lights: &[lamp()],
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 0.0,
            background_linear: Vec3::ZERO,
            optics: Default::default(),
        };
        render(&mut renderer, &scene, &settings).expect("it draws");
    }
    let velocity: Vec<[f32; 2]> = read(&renderer, Channel::Velocity).texels().collect();
    let root_pixels = 2.0 * (0.5 * turn).sin() * 0.08 * pixels_per_metre;
    let (mut hairs, mut farthest_mm) = (0, 0.0f32);
    // Below the edge there is only hair before a background that stands still.
    for y in size / 2 + 4..size {
        for x in 96..160 {
            let [right, down] = velocity[(y * size + x) as usize];
            if right == 0.0 && down == 0.0 {
                continue;
            }
            hairs += 1;
            farthest_mm = farthest_mm.max((y as f32 - size as f32 / 2.0) / pixels_per_metre * 1e3);
            // Roots lie on the edge or up to 6 mm above; the part of the background that shows between blended hairs
            // stands still.
            assert!(right < 1.01 * root_pixels && right > 0.0, "{right} of {root_pixels} at {x}, {y}");
            assert!(down.abs() < 0.08 * root_pixels, "{down} at {x}, {y}");
        }
    }
    let full = (size / 2 + 4..size)
        .flat_map(|y| (96..160).map(move |x| (x, y)))
        .filter(|(x, y)| velocity[(y * size + x) as usize][0] > 0.9 * root_pixels)
        .count();
    assert!(hairs > 200 && full > hairs / 2, "{hairs} pixels of hair, {full} with all of the motion");
    // A tip three millimetres out would move by 4 % more.
    assert!(farthest_mm > 3.0, "hair up to {farthest_mm} mm");
}

#[test]
fn the_first_hairs_stand_for_all() {
    let Some(mut renderer) = renderer() else { return };
    let mut head = dome();
    head.maps.hair = Some(Map::filled(8, 8, &[0.9]));
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    head.maps.hair_count = Some(on_gpu.hair_root_count / 3);
    let third = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    assert_eq!(third.hair_counts(), [on_gpu.hair_root_count / 3, on_gpu.hair_root_count]);
    for head in [&on_gpu, &third] {
        let instance = Instance::new(renderer.gpu(), head);
        assert_eq!(head.bytes_in_scene(), head.memory_bytes + instance.bytes());
    }
    let hairs = u64::from(on_gpu.hair_root_count - third.hair_root_count);
    assert!(on_gpu.bytes_in_scene() - third.bytes_in_scene() >= hairs * (16 + HAIR_BYTES));
    let state = FaceState::neutral(&head);
    let lights = [lamp()];
    let mut of = |head, detail| {
        // A pixel is 2 mm, 14 times a hair.
        let scene = Scene {
            heads: &[HeadInstance { head, state: &state, world_from_head: Mat4::IDENTITY }],
            camera: Camera { position: 2.0 * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 5.5 },
            lights: &lights,
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 0.0,
            background_linear: Vec3::ZERO,
            optics: Default::default(),
        };
        let mut settings = settings([96; 2]);
        settings.quality.detail = detail;
        render(&mut renderer, &scene, &settings).expect("it draws");
        read(&renderer, Channel::Radiance).texels::<4>().collect::<Vec<_>>()
    };
    let all = of(&on_gpu, DetailMethod::Full);
    let fewer =
        [of(&on_gpu, DetailMethod::Auto), of(&third, DetailMethod::Full), of(&third, DetailMethod::Auto)];
    assert!(drawn_hairs(on_gpu.hair_root_count, 0.002) < on_gpu.hair_root_count / 3);
    // Single hairs are a matter of chance; the eye and the filter see a few pixels at once.
    let blocks = |picture: &[[f32; 4]]| -> Vec<f64> {
        let at = |x: usize, y: usize| f64::from(picture[y * 96 + x][1]);
        let block =
            |b: usize| (0..64).map(|i| at(8 * (b % 12) + i % 8, 8 * (b / 12) + i / 8)).sum::<f64>() / 64.0;
        (0..144).map(block).collect()
    };
    let mean = |blocks: &[f64]| blocks.iter().sum::<f64>() / blocks.len() as f64;
    let all = blocks(&all);
    for some in fewer.iter().map(|picture| blocks(picture)) {
        let apart = all.iter().zip(&some).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / all.len() as f64;
        assert!((mean(&some) / mean(&all) - 1.0).abs() < 0.02, "{} and {}", mean(&some), mean(&all));
        assert!(apart.sqrt() < 0.1 * mean(&all), "{} of {}", apart.sqrt(), mean(&all));
    }
    // As many hairs as the whole head shows from here: the same picture.
    assert_eq!(fewer[0], fewer[2]);
}

#[test]
fn hairs_come_one_by_one_and_all_are_drawn_near_by() {
    assert_eq!(drawn_hairs(1000, 0.0), 1000);
    assert_eq!(drawn_hairs(1000, 0.0003), 1000);
    let mut last = 1000;
    for i in 0..20_000 {
        let now = drawn_hairs(1000, 0.0004 + 0.0000005 * i as f32);
        assert!(now >= 1 && now <= last && last - now <= 2, "{last} {now}");
        last = now;
    }
    assert!(last < 60, "{last}");
    assert_eq!(drawn_hairs(7, f32::MAX), 1);
}

/// The dome with hairs, from so far that a pixel is so many metres wide, by raster units and by sums.
fn both_ways(
    renderer: &mut Renderer,
    (rest, head): (&Head, &HeadOnGpu),
    pixel_metres: f32,
    fov_degrees: f32,
) -> [Vec<[f32; 4]>; 2] {
    let size = 160;
    let distance = 0.5 * size as f32 * pixel_metres / (0.5 * fov_degrees.to_radians()).tan();
    let state = FaceState { head_rotation: Quat::from_rotation_x(0.5), ..FaceState::neutral(rest) };
    let lights = [lamp()];
    [RasterMethod::Hardware, RasterMethod::Compute].map(|raster| {
        let scene = Scene {
            heads: &[HeadInstance { head, state: &state, world_from_head: Mat4::IDENTITY }],
            camera: Camera { position: distance * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees },
            lights: &lights,
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 0.0,
            background_linear: Vec3::splat(0.02),
            optics: Default::default(),
        };
        let mut settings = settings([size; 2]);
        settings.quality.raster = raster;
        settings.output.channels = vec![Channel::Radiance];
        render(renderer, &scene, &settings).expect("it draws");
        read(renderer, Channel::Radiance).texels::<4>().collect()
    })
}

#[test]
fn a_summed_hair_covers_the_pixels_of_its_triangle() {
    let Some(mut renderer) = renderer() else { return };
    let mut head = dome();
    head.maps.hair = Some(Map::filled(8, 8, &[0.9]));
    let all = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    head.maps.hair = None;
    let bald = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    head.maps.hair = Some(Map::filled(8, 8, &[0.9]));
    // So few hairs that hardly any two share a pixel: the first ones, each for itself alone.
    let few = (all.hair_root_count / 150).max(40);
    head.maps.hair_count = Some(few);
    let haired = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    let [without, _] = both_ways(&mut renderer, (&head, &bald), 0.0006, 5.0);
    let [blended, summed] = both_ways(&mut renderer, (&head, &haired), 0.0006, 5.0);
    let apart = |a: &[f32; 4], b: &[f32; 4]| (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
    let of_hair: Vec<usize> =
        (0..blended.len()).filter(|i| apart(&blended[*i], &without[*i]) > 0.005).collect();
    assert!(of_hair.len() > 200, "{} pixels of {few} hairs", of_hair.len());
    let differ = of_hair.iter().filter(|i| apart(&blended[**i], &summed[**i]) > 0.01).count();
    // Corners of the raster units are rounded, and some pixels do hold two hairs.
    assert!(differ <= of_hair.len() / 10, "{differ} of {} pixels differ", of_hair.len());
    let only_summed = (0..summed.len())
        .filter(|i| apart(&summed[*i], &without[*i]) > 0.01 && apart(&blended[*i], &without[*i]) < 1e-4)
        .count();
    assert!(only_summed <= of_hair.len() / 50, "{only_summed} pixels have no hair of the raster units");
}

#[test]
fn sums_of_dense_hair_are_what_its_layers_show() {
    let Some(mut renderer) = renderer() else { return };
    let mut head = dome();
    head.maps.hair = Some(Map::filled(8, 8, &[0.9]));
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    for pixel_metres in [0.0003, 0.0012] {
        let [blended, summed] = both_ways(&mut renderer, (&head, &on_gpu), pixel_metres, 5.0);
        let [again, _] = both_ways(&mut renderer, (&head, &on_gpu), pixel_metres, 5.0);
        assert_eq!(blended, again);
        let blocks = |picture: &[[f32; 4]]| -> Vec<f64> {
            let at = |x: usize, y: usize| f64::from(picture[y * 160 + x][1]);
            let block = |b: usize| {
                (0..64).map(|i| at(8 * (b % 20) + i % 8, 8 * (b / 20) + i / 8)).sum::<f64>() / 64.0
            };
            (0..400).map(block).collect()
        };
        let (a, b) = (blocks(&blended), blocks(&summed));
        let mean = |blocks: &[f64]| blocks.iter().sum::<f64>() / blocks.len() as f64;
        let apart = (a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt();
        assert!((mean(&b) / mean(&a) - 1.0).abs() < 0.01, "{} and {}", mean(&a), mean(&b));
        assert!(apart < 0.03 * mean(&a), "{apart} of {}", mean(&a));
    }
}

#[test]
fn sums_are_for_thin_hairs_of_frames_without_motion() {
    let Some(mut renderer) = renderer() else { return };
    let mut head = dome();
    head.maps.hair = Some(Map::filled(8, 8, &[0.9]));
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    // Opaque hairs, near by: the raster units draw them whatever draws triangles.
    let [blended, summed] = both_ways(&mut renderer, (&head, &on_gpu), 0.00005, 5.0);
    let differ = blended.iter().zip(&summed).filter(|(a, b)| (a[1] - b[1]).abs() > 0.02).count();
    assert!(differ < blended.len() / 200, "{differ} pixels");
}
