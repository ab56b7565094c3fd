//! Shaders against Rust, kernels against the CPU, and invariants of every frame.

use glam::{DVec3, Mat4, Quat, Vec2, Vec3};
use rubor_rig::deform;
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{
    BlendShape, Distribution, Head, Material, Mesh, OcclusionChange, Part, SkinMaps, Vertex, WrinkleZone,
};
use rubor_rig::map::Map;

use crate::channels::{CHANNELS, Channel, ChannelData};
use crate::device::native;
use crate::passes::geometry::{morph, shadow, surface_data, tangent_frames, velocity, visibility};
use crate::passes::hair::overlay;
use crate::passes::{appearance, compose, resolve, see_through, shade};
use crate::scene::authored::{GpuAuthoredVertex, GpuMaterial, GpuTexture};
use crate::scene::head::GpuVertex;
use crate::scene::lamp::GpuLight;
use crate::scene::view::View;
use crate::settings::{
    AntialiasMethod, Look, Output, Quality, ScatterMethod, Settings, SpecularMethod, ToneMap, TransmitMethod,
};
use crate::testing::{assert_layout, assert_raster, assert_workgroups, gpu, offsets, own_gpu};
use crate::{
    Camera, ColorTable, EnvironmentMap, FrameStats, Gpu, HeadInstance, HeadOnGpu, Image, Light, LightKind,
    RenderError, Renderer, Scene,
};

#[test]
fn shaders_are_valid_and_have_the_workgroups_that_dispatches_count_on() {
    let square = |entry| [(entry, [8, 8, 1])];
    let line = |entry| [(entry, [64, 1, 1])];
    assert_workgroups(&morph::program(), &line("morph"));
    assert_workgroups(&tangent_frames::program(), &line("tangent_frames"));
    assert_workgroups(&appearance::program(), &square("appearance"));
    assert_workgroups(&shade::program(), &square("shade"));
    assert_workgroups(&shade::tiles_program(), &[("list_tiles", [64, 1, 1])]);
    for only_skin in [false, true] {
        assert_workgroups(&shade::listed_program(only_skin), &square("shade"));
    }
    for with_normals in [false, true] {
        assert_workgroups(&shade::samples_program(with_normals), &line("light_samples"));
    }
    for entry in ["shade_authored", "shade_layer"] {
        assert_workgroups(&shade::authored_program(), &square(entry));
    }
    assert_workgroups(&shade::through_program(), &square("through"));
    assert_workgroups(&see_through::behind_program(), &square("behind"));
    assert_raster(&see_through::layer_program(), &["layer_vertex", "layer_fragment"]);
    for hair in [false, true] {
        assert_workgroups(&compose::program(hair), &square("compose"));
    }
    for tone_map in ToneMap::all() {
        assert_workgroups(&resolve::program(tone_map), &square("resolve_samples"));
    }
    assert_workgroups(&velocity::program(), &square("screen_velocity"));
    assert_workgroups(&surface_data::program(), &square("surface_data"));
    for numbered in [true, false] {
        assert_raster(&visibility::program(numbered), &visibility::entries(numbered));
    }
    assert_raster(&shadow::program(), &["shadow_vertex"]);
    for program in [visibility::cut_program(), shadow::cut_program()] {
        assert_raster(&program, &["cut_vertex", "cut_fragment"]);
    }
    assert_raster(&overlay::program(), &["overlay_vertex", "overlay_fragment"]);
}

#[test]
fn structs_are_laid_out_alike_on_both_sides() {
    assert_layout(
        &shade::program(),
        "shade",
        "View",
        size_of::<View>(),
        &offsets!(View; clip_from_world as "clip_from_world",
            previous_clip_from_world as "previous_clip_from_world", origin as "origin", right as "right",
            up as "up", forward as "forward", size as "size", head_count as "head_count",
            has_environment as "has_environment", jitter as "jitter", near as "near",
            light_count as "light_count", shading_jitter as "shading_jitter", depth_origin_mm as "depth_origin_mm",
            environment_turn as "environment_turn", windows as "windows"),
    );
    assert_layout(
        &shade::program(),
        "shade",
        "Vertex",
        size_of::<GpuVertex>(),
        &offsets!(GpuVertex; point as "point", u as "u", v as "v", bend as "bend"),
    );
    assert_layout(
        &shade::authored_program(),
        "shade_authored",
        "AuthoredTexture",
        size_of::<GpuTexture>(),
        &offsets!(GpuTexture; to_u as "to_u", to_v as "to_v", place as "place"),
    );
    assert_layout(
        &shade::authored_program(),
        "shade_authored",
        "AuthoredMaterial",
        size_of::<GpuMaterial>(),
        &offsets!(GpuMaterial; base_color as "base_color", emission as "emission", factors as "factors",
            coats as "coats", tint as "tint", cutoffs as "cutoffs", flags as "flags", textures as "textures"),
    );
    assert_layout(
        &shade::authored_program(),
        "shade_authored",
        "AuthoredVertex",
        size_of::<GpuAuthoredVertex>(),
        &offsets!(GpuAuthoredVertex; u as "u", v as "v", red_green as "red_green", blue_alpha as "blue_alpha"),
    );
    assert_layout(
        &morph::program(),
        "morph",
        "Params",
        size_of::<morph::Params>(),
        &offsets!(morph::Params; world_from_head as "world_from_head", point_count as "point_count"),
    );
    assert_layout(
        &appearance::program(),
        "appearance",
        "Params",
        size_of::<appearance::Params>(),
        &offsets!(appearance::Params; distribution_count as "distribution_count", zone_count as "zone_count",
            wrinkle_layers as "wrinkle_layers", distribution_weights as "distribution_weights", zone_weights as "zone_weights",
            zone_maps as "zone_maps"),
    );
    assert_layout(
        &shade::program(),
        "shade",
        "Light",
        size_of::<GpuLight>(),
        &offsets!(GpuLight; clip_from_world as "clip_from_world", color as "color",
            position as "position", spot as "spot", shape as "shape", shadow as "shadow"),
    );
    assert_layout(
        &shade::program(),
        "shade",
        "Params",
        size_of::<shade::Params>(),
        &offsets!(shade::Params; slope_scale as "slope_scale", wrinkle_strength as "wrinkle_strength",
            hemoglobin_scale as "hemoglobin_scale", head as "head",
            environment_intensity as "environment_intensity", environment_levels as "environment_levels",
            has_maps as "has_maps", wrinkle_map_count as "wrinkle_map_count", hair_color as "hair_color",
            is_second_sample as "is_second_sample", transmit_per_mm as "transmit_per_mm",
            skin_flags as "skin_flags", pupil_mm as "pupil_mm", lobes as "lobes", mm_per_texture as "mm_per_texture", ring_taps_mm as "ring_taps_mm",
            ring_ends_mm as "ring_ends_mm", slab as "slab", middle as "middle", harmonics as "harmonics", lights as "lights"),
    );
    assert_layout(
        &overlay::program(),
        "overlay_vertex",
        "Params",
        size_of::<overlay::Params>(),
        &offsets!(overlay::Params; ambient as "ambient", first as "first", share as "share", hair as "hair"),
    );
    assert_layout(
        &resolve::program(ToneMap::Filmic),
        "resolve_samples",
        "Params",
        size_of::<resolve::Params>(),
        &offsets!(resolve::Params; exposure as "exposure", samples as "samples"),
    );
}

/// A dome of skin 16 cm across that faces +Z, with a texture seam along x = 0, two shapes and maps of every kind.
pub(crate) fn dome() -> Head {
    const N: usize = 24;
    let at = |i: usize| i as f32 / (N - 1) as f32 * 2.0 - 1.0;
    let mut mesh = Mesh::default();
    let mut vertex_of = vec![[0u32; 2]; N * N];
    for y in 0..N {
        for x in 0..N {
            let p = Vec2::new(at(x), at(y));
            let height = (1.2 - p.length_squared()).max(0.0).sqrt();
            mesh.points.push(0.08 * p.extend(height));
            // Left and right half lie in different places of the texture; column 12 belongs to both.
            for (side, slot) in vertex_of[y * N + x].iter_mut().enumerate() {
                let u = 0.25 * (p.x + 1.0) + 0.5 * side as f32 - if side == 1 { 0.25 } else { 0.0 };
                *slot = mesh.vertices.len() as u32;
                mesh.vertices.push(Vertex { point: (y * N + x) as u32, uv: Vec2::new(u, 0.5 - 0.5 * p.y) });
            }
        }
    }
    for y in 0..N - 1 {
        for x in 0..N - 1 {
            let side = usize::from(x >= N / 2);
            let v = |x: usize, y: usize| vertex_of[y * N + x][side];
            let corners = [v(x, y), v(x + 1, y), v(x + 1, y + 1), v(x, y + 1)];
            mesh.triangles.push([corners[0], corners[1], corners[2]]);
            mesh.triangles.push([corners[0], corners[2], corners[3]]);
        }
    }
    let end = mesh.triangles.len() as u32;
    mesh.parts.push(Part { name: "skin".into(), material: Material::Skin, triangles: 0..end });
    let shape = |name: &str, every: usize, offset: fn(Vec3) -> Vec3| {
        let points: Vec<u32> = (0..mesh.points.len()).step_by(every).map(|p| p as u32).collect();
        let offsets = points.iter().map(|p| offset(mesh.points[*p as usize])).collect();
        BlendShape { name: name.into(), points, offsets, ..BlendShape::default() }
    };
    let shapes = vec![
        shape("swell", 1, |p| 0.02 * p.normalize()),
        shape("ripple", 3, |p| Vec3::new(0.0, 0.004, 0.006 * (90.0 * p.x).sin())),
    ];
    let flat = |value| Map::filled(8, 8, &[value]);
    let maps = SkinMaps {
        melanin: Some(flat(0.03)),
        hemoglobin: Some(flat(0.02)),
        hemoglobin_mean: Some(flat(0.02)),
        distributions: vec![Distribution { name: "blush".into(), scale: flat(1.2), bias: flat(0.05) }],
        slopes: Some(Map::filled(8, 8, &[0.0, 0.0])),
        wrinkle_slopes: vec![Map::filled(8, 8, &[0.5, 0.0])],
        zones: vec![WrinkleZone { name: "all".into(), wrinkle_map: 0, mask: flat(1.0) }],
        specular: Some(Map::filled(8, 8, &[0.5, 0.3])),
        scattering: Some(flat(1.0)),
        ..SkinMaps::default()
    };
    Head { name: "dome".into(), mesh, shapes, maps, ..Head::default() }
}

pub(crate) const WHITE_TABLE: ColorTable<'static> =
    ColorTable { width: 2, height: 2, texels: &[[0.8; 3]; 4] };

pub(crate) fn renderer() -> Option<Renderer> {
    Some(Renderer::new(own_gpu()?).expect("the passes compile"))
}

/// Draws and waits.
pub(crate) fn render(
    renderer: &mut Renderer,
    scene: &Scene<'_>,
    settings: &Settings,
) -> Result<(Image, FrameStats), RenderError> {
    let gpu = renderer.gpu().clone();
    native::wait(&gpu, renderer.render(scene, settings))
}

/// A channel of the last frame.
pub(crate) fn read(renderer: &Renderer, channel: Channel) -> ChannelData {
    let data = native::wait(renderer.gpu(), renderer.read(channel)).expect("the channel comes back");
    assert!(!data.values.is_empty(), "the frame has {}", channel.name());
    data
}

/// A channel of three components as vectors.
pub(crate) fn read_vectors(renderer: &Renderer, channel: Channel) -> Vec<Vec3> {
    read(renderer, channel).texels::<3>().map(Vec3::from_array).collect()
}

/// A channel of four components.
pub(crate) fn read_texels(renderer: &Renderer, channel: Channel) -> Vec<[f32; 4]> {
    read(renderer, channel).texels().collect()
}

/// Every channel over pixels is kept.
pub(crate) fn settings(size: [u32; 2]) -> Settings {
    Settings {
        output: Output {
            size,
            channels: CHANNELS.iter().map(|row| row.channel).collect(),
            ..Output::default()
        },
        quality: Quality { antialias: AntialiasMethod::None, shadow_size: 256, ..Quality::default() },
        look: Look { exposure: 1.0, ..Look::default() },
    }
}

const CAMERA: Camera =
    Camera { position: Vec3::new(0.0, 0.0, 0.5), target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 25.0 };

pub(crate) fn lamp() -> Light {
    Light {
        kind: LightKind::Spot {
            position: Vec3::new(0.4, 0.5, 0.7),
            direction: Vec3::new(-0.4, -0.5, -0.7),
            outer_degrees: 30.0,
            inner_degrees: 20.0,
        },
        color_linear: Vec3::splat(2.0),
        radius: 0.03,
        casts_shadow: true,
    }
}

pub(crate) fn draw(
    renderer: &mut Renderer,
    head: &HeadOnGpu,
    state: &FaceState,
    lights: &[Light],
    settings: &Settings,
) -> Result<Image, RenderError> {
    let heads = [HeadInstance { head, state, world_from_head: Mat4::IDENTITY }];
    let environment = EnvironmentMap::from_fn(16, 8, |_| Vec3::ONE).upload(renderer.gpu());
    let scene = Scene {
        heads: &heads,
        camera: CAMERA,
        lights,
        environment: Some(&environment),
        environment_rotation: 0.0,
        environment_intensity: 0.5,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    Ok(render(renderer, &scene, settings)?.0)
}

#[test]
fn the_morph_kernel_places_points_where_the_cpu_does() {
    let Some(mut renderer) = renderer() else { return };
    let head = dome();
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    let mut state = FaceState::neutral(&head);
    state.shapes = vec![0.7, -0.4];
    state.head_rotation = Quat::from_rotation_y(0.3);
    state.head_translation = Vec3::new(0.01, 0.0, -0.02);
    draw(&mut renderer, &on_gpu, &state, &[lamp()], &settings([27, 51])).expect("it draws");
    let found = read_vectors(&renderer, Channel::Positions);
    let place = Mat4::from_rotation_translation(state.head_rotation, state.head_translation);
    let expected = deform::deform_points(&head.mesh, &head.shapes, &state.shapes);
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!(a.distance(place.transform_point3(b)) < 1e-5 * head.height(), "{a} {b}");
    }
}

#[test]
fn ambient_visibility_follows_the_shapes_as_on_the_cpu() {
    let Some(mut renderer) = renderer() else { return };
    let mut head = dome();
    let count = head.mesh.points.len() as u32;
    let noise = |i: u32| i.wrapping_mul(0x9e37_79b9) as f32 / 2f32.powi(32);
    head.mesh.occlusion = (0..count).map(noise).collect();
    // Also of points that the shape does not move.
    head.shapes[1].occlusion = (0..count)
        .step_by(2)
        .map(|point| OcclusionChange {
            point,
            at_half: 2.0 * noise(point + 1000) - 1.0,
            at_full: 1.0 - 2.0 * noise(point + 2000),
        })
        .collect();
    head.shapes[0].occlusion = vec![OcclusionChange { point: count - 1, at_half: -1.0, at_full: 1.0 }];
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    for weights in [[0.0, 0.0], [0.0, 1.0], [0.5, 0.5], [0.7, 0.3], [-2.0, 3.0]] {
        let mut state = FaceState::neutral(&head);
        state.shapes = weights.to_vec();
        draw(&mut renderer, &on_gpu, &state, &[], &settings([16, 16])).expect("it draws");
        let found = read(&renderer, Channel::Visibility).values;
        let expected = deform::blend_occlusion(&head.mesh, &head.shapes, &weights);
        for (i, (a, b)) in found.iter().zip(&expected).enumerate() {
            // Half a step of 1/511 for each of two values, times weights up to 1 in sum.
            assert!((a - b).abs() < 1.5 / 511.0, "{weights:?}, point {i}: {a} {b}");
        }
        if weights == [0.0, 0.0] {
            assert_eq!(found, head.mesh.occlusion, "at rest nothing changes");
        }
    }
}

#[test]
fn an_even_sky_comes_back_as_albedo_and_reflection_and_never_as_more() {
    let Some(mut renderer) = renderer() else { return };
    // All light that enters leaves again, except the share reflected at the surface: 1 - rho(normal) of the dome's
    // gloss.
    let table = ColorTable { width: 2, height: 2, texels: &[[1.0; 3]; 4] };
    let head = dome();
    let white = HeadOnGpu::new(renderer.gpu(), &head, &table).expect("the dome uploads");
    let pale = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    for specular in SpecularMethod::all() {
        let mut settings = settings([65, 65]);
        settings.quality.specular = specular;
        settings.quality.scatter = ScatterMethod::None;
        // The dome has no back: a sky behind it would come through.
        settings.quality.transmit = TransmitMethod::None;
        let state = FaceState::neutral(&head);
        let mut light = |head: &HeadOnGpu| -> Vec<f32> {
            draw(&mut renderer, head, &state, &[], &settings).expect("it draws");
            // The sky of `draw` has a radiance of 0.5.
            read_texels(&renderer, Channel::Radiance).iter().map(|t| 2.0 * t[0]).collect()
        };
        let most = light(&pale).into_iter().fold(0.0, f32::max);
        assert!((0.8..1.0).contains(&most), "{specular}: {most}");
        let all = light(&white);
        let front = all[32 * 65 + 32] - 1.0;
        assert!((0.005..0.03).contains(&front), "{specular}: {front} is reflected in front");
        // rho + (1 - rho) / (1 - front) is largest where all is diffuse; half floats round by 1/2048.
        let most = all.into_iter().fold(0.0, f32::max);
        assert!(most <= 1.0 / (1.0 - front) + 2e-3, "{specular}: {most}, {front} in front");
    }
}

#[test]
fn the_scale_of_the_texture_is_that_of_the_skin() {
    let Some(gpu) = gpu() else { return };
    let mut head = dome();
    // Half a metre across the texture.
    for v in &head.mesh.vertices {
        head.mesh.points[v.point as usize] = 0.5 * v.uv.extend(0.0);
    }
    let on_gpu = HeadOnGpu::new(gpu, &head, &WHITE_TABLE).expect("the plane uploads");
    assert!((on_gpu.mm_per_texture - 500.0).abs() < 0.5, "{}", on_gpu.mm_per_texture);
}

#[test]
fn normals_and_tangents_are_those_of_the_cpu_on_both_sides_of_a_seam() {
    frames_are_those_of_the_cpu(&dome(), 1e-4);
}

#[test]
fn normals_of_an_author_lean_as_on_the_cpu() {
    let mut head = dome();
    let rest = deform::point_normals(&head.mesh, &head.mesh.points);
    let lean = |i: usize| Vec3::new((i as f32).sin(), (1.7 * i as f32).cos(), 0.4);
    let vertices = head.mesh.vertices.iter().enumerate();
    head.authored.normals = vertices
        .map(
            |(i, v)| {
                if i % 3 == 0 { Vec3::ZERO } else { (rest[v.point as usize] + 0.6 * lean(i)).normalize() }
            },
        )
        .collect();
    // Slopes are half floats.
    frames_are_those_of_the_cpu(&head, 1e-3);
}

fn frames_are_those_of_the_cpu(head: &Head, bound: f32) {
    let Some(mut renderer) = renderer() else { return };
    let on_gpu = HeadOnGpu::new(renderer.gpu(), head, &WHITE_TABLE).expect("the dome uploads");
    let mut state = FaceState::neutral(head);
    state.shapes = vec![0.5, 1.0];
    draw(&mut renderer, &on_gpu, &state, &[], &settings([16, 16])).expect("it draws");
    let frames: Vec<[f32; 7]> = read(&renderer, Channel::TangentFrames).texels().collect();
    let points = deform::deform_points(&head.mesh, &head.shapes, &state.shapes);
    let normals = deform::point_normals(&head.mesh, &points);
    let tangents = deform::vertex_tangents(&head.mesh, &points, &normals);
    let bends = deform::normal_bends(head);
    let mut used = vec![false; head.mesh.vertices.len()];
    head.mesh.triangles.iter().flatten().for_each(|v| used[*v as usize] = true);
    for (i, vertex) in head.mesh.vertices.iter().enumerate().filter(|(i, _)| used[*i]) {
        let f = frames[i];
        let (normal, tangent) = (Vec3::new(f[0], f[1], f[2]), glam::Vec4::new(f[3], f[4], f[5], f[6]));
        let bend = bends.get(i).copied().unwrap_or_default();
        let (n, t) = deform::bent(normals[vertex.point as usize], tangents[i], bend);
        assert!(normal.abs_diff_eq(n, bound), "normal {i}: {normal} {n}");
        assert!(tangent.abs_diff_eq(t, 10.0 * bound), "tangent {i}: {tangent} {t}");
    }
}

#[test]
fn the_same_frame_twice_is_the_same_bytes() {
    let Some(mut renderer) = renderer() else { return };
    let head = dome();
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    let state = FaceState::neutral(&head);
    let draw = |r: &mut Renderer| draw(r, &on_gpu, &state, &[lamp()], &settings([64, 48])).expect("it draws");
    let first = draw(&mut renderer);
    assert_eq!(first, draw(&mut renderer));
    assert!(first.rgba.iter().any(|b| *b > 60 && *b < 255), "there is a picture");
}

#[test]
fn a_white_furnace_returns_what_comes_in() {
    // Diffuse light of a uniform sky on unoccluded skin: radiance 0.5 times albedo 0.8, for every scattering method.
    let Some(mut renderer) = renderer() else { return };
    let mut head = dome();
    head.maps.specular = Some(Map::filled(1, 1, &[0.0, 0.3]));
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    let state = FaceState::neutral(&head);
    let size = [65, 65];
    draw(&mut renderer, &on_gpu, &state, &[], &settings(size)).expect("it draws");
    let hdr = read_texels(&renderer, Channel::Radiance);
    let center = hdr[32 * 65 + 32];
    for c in 0..3 {
        assert!((center[c] - 0.4).abs() < 2e-3, "{center:?}");
    }
}

#[test]
fn blood_and_wrinkles_change_the_picture_and_zero_weights_do_not() {
    let Some(mut renderer) = renderer() else { return };
    let head = dome();
    // A table in which more blood is redder.
    let texels = [[0.8, 0.7, 0.6], [0.4, 0.35, 0.3], [0.7, 0.2, 0.2], [0.3, 0.1, 0.1]];
    let table = ColorTable { width: 2, height: 2, texels: &texels };
    let with_maps = HeadOnGpu::new(renderer.gpu(), &head, &table).expect("the dome uploads");
    let mut plain = dome();
    plain.maps.distributions.clear();
    plain.maps.zones.clear();
    plain.maps.wrinkle_slopes.clear();
    let without = HeadOnGpu::new(renderer.gpu(), &plain, &table).expect("the dome uploads");
    let s = settings([48, 48]);
    let mut picture = |head_on_gpu: &HeadOnGpu, state: &FaceState| {
        draw(&mut renderer, head_on_gpu, state, &[lamp()], &s).expect("it draws").rgba
    };
    let neutral = picture(&with_maps, &FaceState::neutral(&head));
    assert_eq!(neutral, picture(&without, &FaceState::neutral(&plain)), "zero weights are exactly neutral");
    let middle = 4 * (24 * 48 + 24);
    let mut blush = FaceState::neutral(&head);
    blush.distributions = vec![1.0];
    let flushed = picture(&with_maps, &blush);
    assert!(flushed[middle + 1] + 5 < neutral[middle + 1], "blood takes green away");
    let mut frown = FaceState::neutral(&head);
    frown.zones = vec![1.0];
    assert_ne!(neutral, picture(&with_maps, &frown));
}

#[test]
fn wrong_settings_are_answered_in_words() {
    let Some(mut renderer) = renderer() else { return };
    let head = dome();
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    let state = FaceState::neutral(&head);
    let mut message = |change: fn(&mut Settings), state: &FaceState| {
        let mut s = settings([16, 16]);
        change(&mut s);
        draw(&mut renderer, &on_gpu, state, &[], &s).expect_err("it is refused").to_string()
    };
    assert!(message(|s| s.output.size = [0, 16], &state).contains("0x16"));
    assert!(message(|s| s.output.size = [1 << 20, 16], &state).contains("1048576x16"));
    assert!(message(|s| s.output.supersampling = 0, &state).contains("supersampling"));
    assert!(message(|s| s.look.exposure = f32::NAN, &state).contains("exposure"));
    let mut broken = state.clone();
    broken.shapes.pop();
    assert!(message(|_| {}, &broken).contains("shape weights is 1; 2"));
    broken.shapes.push(f32::NAN);
    assert!(message(|_| {}, &broken).contains("finite"));
    assert!(native::open(Some("no such adapter")).err().expect("refused").to_string().contains("there are"));
}

#[test]
fn several_heads_of_one_frame_keep_apart() {
    let Some(mut renderer) = renderer() else { return };
    let head = dome();
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    let state = FaceState::neutral(&head);
    let heads = [-0.12, 0.12].map(|x| HeadInstance {
        head: &on_gpu,
        state: &state,
        world_from_head: Mat4::from_translation(Vec3::new(x, 0.0, 0.0)),
    });
    let scene = Scene {
        heads: &heads,
        camera: Camera { position: Vec3::new(0.0, 0.0, 1.0), ..CAMERA },
        lights: &[Light { kind: LightKind::Directional { direction: Vec3::NEG_Z }, ..lamp() }],
        environment: None,
        environment_rotation: 0.0,
        environment_intensity: 0.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    let image = render(&mut renderer, &scene, &settings([64, 32])).expect("it draws").0;
    let lit = |x: usize, y: usize| image.rgba[4 * (y * 64 + x) + 1] > 40;
    assert!(lit(23, 16) && lit(41, 16), "both are there");
    assert!(!lit(32, 2), "the sky between them is empty");
}

/// Where the ray through a pixel meets the triangle that it sees, in f64.
pub(crate) struct Hit {
    pub(crate) vertices: [u32; 3],
    pub(crate) barycentric: [f64; 3],
    pub(crate) position: DVec3,
}

/// What pixel `i` of a square image sees of a head, `offset_px` right and down of its middle; nothing for the background. All of a test's
/// triangles are opaque, so their order is that of the mesh.
pub(crate) fn seen_surface(
    head: &Head,
    points: &[Vec3],
    id: u32,
    camera: &Camera,
    size: u32,
    i: u32,
    offset_px: [f32; 2],
) -> Option<Hit> {
    let vertices = head.mesh.triangles[(id & 0x07ff_ffff).checked_sub(1)? as usize];
    let corners = vertices.map(|v| points[head.mesh.vertices[v as usize].point as usize].as_dvec3());
    let at =
        |n: u32, axis: usize| (f64::from(n) + 0.5 + f64::from(offset_px[axis])) / f64::from(size) * 2.0 - 1.0;
    let tangent = (0.5 * f64::from(camera.fov_degrees).to_radians()).tan();
    let world_from_view = camera.view_from_world().as_dmat4().inverse();
    let ray = world_from_view.transform_vector3(DVec3::new(
        at(i % size, 0) * tangent,
        -at(i / size, 1) * tangent,
        -1.0,
    ));
    let origin = camera.position.as_dvec3();
    let [a, b, c] = corners.map(|p| p - origin);
    let volumes = [ray.dot(b.cross(c)), ray.dot(c.cross(a)), ray.dot(a.cross(b))];
    let sum: f64 = volumes.iter().sum();
    let barycentric = volumes.map(|v| v / sum);
    let position = (0..3).map(|k| barycentric[k] * corners[k]).sum();
    Some(Hit { vertices, barycentric, position })
}

#[test]
fn velocity_is_the_motion_of_the_point_that_a_pixel_sees() {
    let Some(mut renderer) = renderer() else { return };
    let head = dome();
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    // Also where the picture itself needs no motion.
    for method in [AntialiasMethod::SmaaT2x, AntialiasMethod::None, AntialiasMethod::Smaa1x] {
        velocity_is_the_motion(&mut renderer, &head, &on_gpu, method);
    }
}

fn velocity_is_the_motion(renderer: &mut Renderer, head: &Head, on_gpu: &HeadOnGpu, method: AntialiasMethod) {
    let size = 40;
    let mut settings = settings([size; 2]);
    settings.quality.antialias = method;
    renderer.cut(0);
    let cameras = [CAMERA, Camera { position: Vec3::new(0.02, 0.01, 0.49), ..CAMERA }];
    let mut states = [FaceState::neutral(head), FaceState::neutral(head)];
    states[1].shapes = vec![0.6, 0.2];
    states[1].head_rotation = Quat::from_rotation_y(0.05);
    let mut points = Vec::new();
    for (camera, state) in cameras.into_iter().zip(&states) {
        let scene = Scene {
            heads: &[HeadInstance { head: on_gpu, state, world_from_head: Mat4::IDENTITY }],
            camera,
            lights: &[],
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 0.0,
            background_linear: Vec3::ZERO,
            optics: Default::default(),
        };
        render(renderer, &scene, &settings).expect("it draws");
        points.push(read_vectors(renderer, Channel::Positions));
    }
    let ids: Vec<[f32; 1]> = read(renderer, Channel::Ids).texels().collect();
    let velocity: Vec<[f32; 2]> = read(renderer, Channel::Velocity).texels().collect();
    let place = |camera: &Camera, p: DVec3| {
        let clip_from_world = (camera.clip_from_view(1.0) * camera.view_from_world()).as_dmat4();
        let clip = clip_from_world * p.extend(1.0);
        glam::DVec2::new(clip.x / clip.w * 0.5 + 0.5, 0.5 - clip.y / clip.w * 0.5) * f64::from(size)
    };
    // Sample position of the second frame in the pixel.
    let offset_px = settings.antialias().mode.subsamples(1)[0].position_px;
    let (mut compared, mut fastest) = (0, 0.0f64);
    for (i, found) in velocity.iter().enumerate() {
        let id = ids[i][0].to_bits();
        let Some(hit) = seen_surface(head, &points[1], id, &cameras[1], size, i as u32, offset_px) else {
            assert_eq!(*found, [0.0, 0.0], "the background does not move");
            continue;
        };
        let before: DVec3 = (0..3)
            .map(|k| {
                let point = head.mesh.vertices[hit.vertices[k] as usize].point as usize;
                hit.barycentric[k] * points[0][point].as_dvec3()
            })
            .sum();
        let expected = place(&cameras[1], hit.position) - place(&cameras[0], before);
        let error = glam::DVec2::new(f64::from(found[0]), f64::from(found[1])).distance(expected);
        assert!(error < 4e-3, "pixel {i}: {found:?}, expected {expected}");
        compared += 1;
        fastest = fastest.max(expected.length());
    }
    assert!(compared > 300 && fastest > 1.0, "{compared} pixels, up to {fastest} pixels fast");
}

#[test]
fn a_frame_goes_into_commands_and_a_texture_of_somebody_else() {
    let Some(gpu) = own_gpu() else { return };
    let given = Gpu::from_device(gpu.device.clone(), gpu.queue.clone(), gpu.info.clone());
    let mut renderer = Renderer::new(given).expect("the passes compile");
    let head = dome();
    let on_gpu = HeadOnGpu::new(&gpu, &head, &WHITE_TABLE).expect("the dome uploads");
    let state = FaceState::neutral(&head);
    let heads = [HeadInstance { head: &on_gpu, state: &state, world_from_head: Mat4::IDENTITY }];
    let scene = Scene {
        heads: &heads,
        camera: CAMERA,
        lights: &[lamp()],
        environment: None,
        environment_rotation: 0.0,
        environment_intensity: 0.0,
        background_linear: Vec3::splat(0.1),
        optics: Default::default(),
    };
    let texture =
        |format, usage| gpu.target("given", [51, 27], format, usage | wgpu::TextureUsages::COPY_SRC);
    for antialias in [AntialiasMethod::None, AntialiasMethod::SmaaS2x, AntialiasMethod::Ssaa(2)] {
        let mut settings = settings([51, 27]);
        settings.quality.antialias = antialias;
        let own = render(&mut renderer, &scene, &settings).expect("it draws").0;
        let target = texture(wgpu::TextureFormat::Rgba8Unorm, wgpu::TextureUsages::STORAGE_BINDING);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        renderer.record(&mut encoder, &scene, &settings, &target).expect("it records");
        gpu.queue.submit([encoder.finish()]);
        let given = native::wait(&gpu, gpu.read_texture(&target)).expect("it reads");
        assert_eq!(given, own.rgba, "{antialias}");
    }
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let wrong = texture(wgpu::TextureFormat::Rgba16Float, wgpu::TextureUsages::STORAGE_BINDING);
    let message =
        renderer.record(&mut encoder, &scene, &settings([51, 27]), &wrong).err().expect("it is refused");
    assert!(message.to_string().contains("Rgba8Unorm"), "{message}");
    let mut reference = settings([51, 27]);
    reference.quality.scatter = ScatterMethod::ReferenceSurface(1);
    let message = renderer.draw(&scene, &reference).err().expect("it does not draw in one go").to_string();
    assert!(message.contains("in one go"), "{message}");
}

#[test]
fn a_frame_can_be_drawn_while_the_one_before_is_read() {
    let Some(mut renderer) = renderer() else { return };
    let gpu = renderer.gpu().clone();
    let head = dome();
    let on_gpu = HeadOnGpu::new(&gpu, &head, &WHITE_TABLE).expect("the dome uploads");
    let mut settings = settings([48, 32]);
    settings.quality.antialias = AntialiasMethod::SmaaT2x;
    let states: Vec<FaceState> = (0..5)
        .map(|i| FaceState { shapes: vec![0.2 * i as f32, 0.1], ..FaceState::neutral(&head) })
        .collect();
    let mut film = |overlaps: bool| {
        renderer.cut(0);
        let (mut waiting, mut pictures) = (Vec::new(), Vec::new());
        for state in &states {
            let scene = Scene {
                heads: &[HeadInstance { head: &on_gpu, state, world_from_head: Mat4::IDENTITY }],
                camera: CAMERA,
                lights: &[lamp()],
                environment: None,
                environment_rotation: 0.0,
                environment_intensity: 0.0,
                background_linear: Vec3::ZERO,
                optics: Default::default(),
            };
            waiting.push(renderer.draw(&scene, &settings).expect("it draws"));
            while waiting.len() > 2 * usize::from(overlaps) {
                let (image, _, channels) =
                    native::wait(&gpu, waiting.remove(0).finish_with_channels()).expect("it is read");
                pictures.push((image, channels));
            }
        }
        for drawn in waiting {
            let (image, _, channels) = native::wait(&gpu, drawn.finish_with_channels()).expect("it is read");
            pictures.push((image, channels));
        }
        pictures
    };
    let one_by_one = film(false);
    assert_eq!(one_by_one.len(), 5);
    assert_ne!(one_by_one[1].0, one_by_one[4].0, "the film moves");
    assert!(film(true) == one_by_one, "pictures and channels are those of their own frame");
}

#[test]
fn windows_hold_all_pixels_of_their_heads() {
    let Some(mut renderer) = renderer() else { return };
    let head = dome();
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("the dome uploads");
    let mut strong = FaceState::neutral(&head);
    strong.shapes.fill(1.5);
    strong.head_rotation = Quat::from_rotation_z(0.4);
    let calm = FaceState::neutral(&head);
    let at = |x: f32, y: f32, z: f32| Mat4::from_translation(Vec3::new(x, y, z));
    // In the middle, at the border, out of the picture, beside the camera and before it.
    let places =
        [at(0.0, 0.0, 0.0), at(0.2, 0.1, 0.0), at(-0.45, 0.0, 0.1), at(3.0, 0.0, 0.0), at(0.1, 0.0, 0.85)];
    let heads: Vec<_> = places
        .iter()
        .enumerate()
        .map(|(i, place)| HeadInstance {
            head: &on_gpu,
            state: if i % 2 == 1 { &strong } else { &calm },
            world_from_head: *place,
        })
        .collect();
    let scene = Scene {
        heads: &heads,
        camera: Camera { position: Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 40.0 },
        lights: &[lamp()],
        environment: None,
        environment_rotation: 0.0,
        environment_intensity: 0.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    let size = [96, 64];
    render(&mut renderer, &scene, &settings(size)).expect("it draws");
    let ids = read(&renderer, Channel::Ids);
    let windows = crate::scene::view::windows(&scene, size);
    assert_eq!((windows[0].first, windows[0].size), ([0; 2], size));
    assert_eq!(windows[3].size, [0; 2], "it is out of the picture");
    let mut pixels = [0; 5];
    let albedo = read_texels(&renderer, Channel::Albedo);
    for (i, [id]) in ids.texels::<1>().enumerate().filter(|(_, [id])| *id != 0.0) {
        let head = (id.to_bits() >> 27) as usize;
        let (at, w) = ([i as u32 % size[0], i as u32 / size[0]], windows[head]);
        assert!(
            (0..2).all(|k| at[k] >= w.first[k] && at[k] - w.first[k] < w.size[k]),
            "{at:?} of {head}: {w:?}"
        );
        assert!(albedo[i][3] > 0.0, "{at:?} of {head} is not shaded");
        pixels[head] += 1;
    }
    assert!(pixels[0] > 50 && pixels[1] > 50 && pixels[2] > 20 && pixels[4] > 50, "{pixels:?}");
    let area = |w: &crate::scene::view::Window| w.size[0] * w.size[1];
    assert!(area(&windows[1]) < size[0] * size[1] / 4, "{:?} for {} pixels", windows[1], pixels[1]);
}
