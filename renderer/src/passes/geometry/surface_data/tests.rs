use glam::{DVec3, Mat4, Quat, Vec3};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::Material;
use rubor_rig::hemoglobin::blend;

use super::*;
use crate::scene::{Camera, HeadInstance, HeadOnGpu, Scene};
use crate::settings::ColorMethod;
use crate::testing::assert_layout;
use crate::tests::{WHITE_TABLE, dome, read, read_vectors, render, renderer, seen_surface, settings};

#[test]
fn params_are_laid_out_alike_on_both_sides() {
    assert_layout(
        &program(),
        "surface_data",
        "Params",
        size_of::<Params>(),
        &crate::testing::offsets!(Params; head as "head", has_maps as "has_maps", hemoglobin_scale as "hemoglobin_scale"),
    );
}

#[test]
fn normals_chromophores_and_parts_are_those_of_the_point_that_a_pixel_sees() {
    let Some(mut renderer) = renderer() else { return };
    let mut head = dome();
    // Maps that are not constant, so that a wrong place of the texture shows; linear in u and v, so that any filter that
    // stays within a chart gives the value at the middle of the pixel.
    let ramp = |scale: f32| {
        let mut map = rubor_rig::map::Map::filled(256, 256, &[0.0]);
        for (i, value) in map.values.iter_mut().enumerate() {
            let [x, y] = [i % 256, i / 256].map(|n| (n as f32 + 0.5) / 256.0);
            *value = scale * (0.4 + 0.3 * x + 0.2 * y);
        }
        map
    };
    (head.maps.melanin, head.maps.hemoglobin) = (Some(ramp(0.1)), Some(ramp(0.05)));
    // The lower half is something else than skin.
    let half = head.mesh.triangles.len() as u32 / 2;
    head.mesh.parts[0].triangles = 0..half;
    let mut other = head.mesh.parts[0].clone();
    (other.name, other.material, other.triangles) = ("gums".into(), Material::Gums, half..2 * half);
    head.mesh.parts.push(other);
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    let mut state = FaceState::neutral(&head);
    state.shapes = vec![0.4, 0.1];
    state.distributions = vec![0.6];
    state.hemoglobin_scale = 1.2;
    state.head_rotation = Quat::from_rotation_y(0.2);
    let camera =
        Camera { position: Vec3::new(0.03, 0.02, 0.5), target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 25.0 };
    let scene = Scene {
        heads: &[HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }],
        camera,
        lights: &[],
        environment: None,
        environment_rotation: 0.0,
        environment_intensity: 0.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    let size = 41;
    let mut settings = settings([size; 2]);
    settings.quality.color = ColorMethod::Hemoglobin;
    render(&mut renderer, &scene, &settings).expect("it draws");
    let points = read_vectors(&renderer, Channel::Positions);
    let normals: Vec<[f32; 7]> = read(&renderer, Channel::TangentFrames).texels().collect();
    let ids: Vec<[f32; 1]> = read(&renderer, Channel::Ids).texels().collect();
    let normal: Vec<[f32; 3]> = read(&renderer, Channel::Normal).texels().collect();
    let [melanin, hemoglobin, parts] = [Channel::Melanin, Channel::Hemoglobin, Channel::Parts]
        .map(|channel| read(&renderer, channel).texels().map(|[v]| v).collect::<Vec<f32>>());
    let maps = &head.maps;
    let neutral = maps.hemoglobin.as_ref().expect("a map");
    let mean = maps.hemoglobin_mean.as_ref().expect("a map");
    let blood = blend(neutral, mean, &maps.distributions, &state.distributions, state.hemoglobin_scale);
    let (mut skin, mut gums, mut empty, mut compared) = (0, 0, 0, 0);
    for i in 0..(size * size) as usize {
        let id = ids[i][0].to_bits();
        let Some(hit) = seen_surface(&head, &points, id, &camera, size, i as u32, [0.0; 2]) else {
            assert_eq!((normal[i], melanin[i], hemoglobin[i], parts[i].to_bits()), ([0.0; 3], 0.0, 0.0, 0));
            empty += 1;
            continue;
        };
        let expected: DVec3 = (0..3)
            .map(|k| {
                let n = normals[hit.vertices[k] as usize];
                hit.barycentric[k] * DVec3::new(f64::from(n[0]), f64::from(n[1]), f64::from(n[2]))
            })
            .sum::<DVec3>()
            .normalize();
        let found = Vec3::from(normal[i]).as_dvec3();
        // A half keeps 11 bits; barycentric coordinates of f32 rays at triangles of a few pixels add as much.
        assert!(found.distance(expected) < 2e-3, "pixel {i}: {found}, expected {expected}");
        let triangle = (id & 0x07ff_ffff) - 1;
        let material = if triangle < half { Material::Skin } else { Material::Gums };
        assert_eq!(parts[i].to_bits(), material.number() + 1, "pixel {i}");
        if material == Material::Gums {
            assert_eq!((melanin[i], hemoglobin[i]), (0.0, 0.0), "pixel {i}");
            gums += 1;
            continue;
        }
        skin += 1;
        let uv: [f64; 2] = std::array::from_fn(|axis| {
            (0..3)
                .map(|k| {
                    hit.barycentric[k] * f64::from(head.mesh.vertices[hit.vertices[k] as usize].uv[axis])
                })
                .sum()
        });
        // At a slant a pixel covers much of the texture, and beside its edge a filter reaches around it.
        if expected.z < 0.6 || uv.iter().any(|v| !(0.06..0.94).contains(v)) {
            continue;
        }
        compared += 1;
        let sampled = |map: &rubor_rig::map::Map| map.sample(uv[0] as f32, uv[1] as f32, 0);
        let melanin_map = maps.melanin.as_ref().expect("a map");
        for (found, expected) in [(melanin[i], sampled(melanin_map)), (hemoglobin[i], sampled(&blood))] {
            // 8 bits of the cube root are up to 1.5 % of these values; the blended blood is low resolution.
            assert!((found - expected).abs() < 0.03 * expected, "pixel {i}: {found}, expected {expected}");
        }
    }
    assert!(compared > 100, "{compared} pixels of skin compared");
    assert!(skin > 200 && gums > 200 && empty > 100, "{skin} of skin, {gums} of gums, {empty} of nothing");
}
