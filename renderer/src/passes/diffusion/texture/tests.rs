use std::f64::consts::{PI, TAU};

use glam::{Mat4, Vec2, Vec3};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{BlendShape, Head, Material, Mesh, Part, Vertex};
use rubor_rig::random::SplitMix64;
use rubor_rig::skin::profile::{Profile, RadialProfile};

use super::reference::{Texels, line};
use super::*;
use crate::channels::Channel;
use crate::passes::shade::directional_albedo::entering;
use crate::settings::{AntialiasMethod, Look, Output, Quality, Settings};
use crate::testing::{assert_layout, assert_workgroups, gpu, half_image, offsets, read_image, recorded};
use crate::tests::{WHITE_TABLE, dome, read_texels, render, renderer};
use crate::{Camera, FrameStats, HeadOnGpu, Light, LightKind, Renderer, Scene};

const MM: f32 = 1e-3;
/// Gloss and roughness of skin without maps.
const GLOSS: [f32; 2] = [0.6, 0.32];

#[test]
fn layouts_match_the_shaders() {
    assert_workgroups(&light_program(), &[("light", [8, 8, 1])]);
    assert_workgroups(&blur_program(), &[("along_u", [8, 8, 1]), ("across_u", [8, 8, 1])]);
    assert_workgroups(&gather_program(), &[("gather", [8, 8, 1])]);
    assert_workgroups(&through::program(), &[("thickness", [8, 8, 1]), ("pass_through", [8, 8, 1])]);
    let map = offsets!(Map; layout_side as "layout_side", side as "side", level as "level", savings as "savings",
        mm_per_texel as "mm_per_texel", reach_mm as "reach_mm", pre_scatter as "pre_scatter",
        is_translucent as "is_translucent");
    assert_layout(&light_program(), "light", "Map", size_of::<Map>(), &map);
    let blur = offsets!(Blur; deviation_mm as "deviation_mm", most_texels as "most_texels",
        source_scale as "source_scale", level as "level");
    assert_layout(&blur_program(), "along_u", "Params", size_of::<Blur>(), &blur);
    let gather = offsets!(Gather; map as "map", head as "head", terms as "terms", weights as "weights");
    assert_layout(&gather_program(), "gather", "Params", size_of::<Gather>(), &gather);
    let params = offsets!(through::Params; map as "map", decay_mm as "decay_mm", first_lamp as "first_lamp",
        terms as "terms", narrow as "narrow", terms_of as "terms_of");
    assert_layout(&through::program(), "pass_through", "Through", size_of::<through::Params>(), &params);
}

#[test]
fn a_plan_has_all_light_and_the_variances_of_its_gaussians() {
    let profile = Profile::deon_six();
    let gaussians = gauss::gaussians(&profile, TERMS).expect("it is a sum of six");
    let (_, of_taps) = plan::taps();
    for mm_per_texel in [0.05, 0.2, 0.35, 1.0, 4.0, 30.0] {
        let plan = plan(&gaussians, mm_per_texel);
        let mut total = plan.own;
        for w in [plan.unblurred].iter().chain(plan.steps.iter().map(|s| &s.weights)) {
            for c in 0..3 {
                total[c] += w[c];
            }
        }
        assert!(total.iter().all(|t| (t - 1.0).abs() < 1e-9), "{mm_per_texel}: {total:?}");
        let (mut reached, mut from) = (0.0, 0);
        let first = gaussians.len() - plan.steps.len();
        for (step, g) in plan.steps.iter().zip(&gaussians[first..]) {
            let width = |level: usize| mm_per_texel * f64::from(1u32 << level);
            reached += step.deviation_mm.powi(2) * of_taps + width(from).powi(2) / 6.0;
            let shown = reached + width(step.level).powi(2) / 6.0;
            // The first blurred one may be narrower than interpolation.
            let least = if step.deviation_mm == 0.0 { 0.45 * mm_per_texel } else { 0.0 };
            let error = shown.sqrt() - g.variance_mm2.sqrt();
            assert!(error.abs() < 1e-9 || (least > 0.0 && error < least), "{mm_per_texel}: {error}");
            assert!(step.level >= from, "{mm_per_texel}");
            from = step.level;
        }
    }
    assert!(plan(&gaussians, 30.0).steps.is_empty(), "texels wider than the profile blur nothing");
}

#[test]
fn lines_are_those_of_the_reference_at_odd_sizes_with_holes() {
    let Some(gpu) = gpu() else { return };
    let mut random = SplitMix64(7);
    let size = [54u32, 102];
    let count = (size[0] * size[1]) as usize;
    let half = |v: f64| f64::from(half::f16::from_f64(v).to_f32());
    let light: Vec<[f64; 4]> = (0..count)
        .map(|_| {
            let is_known = random.uniform() > 0.2;
            let v = [0, 1, 2].map(|_| half(2.0 * random.uniform()));
            if is_known { [v[0], v[1], v[2], 1.0] } else { [0.0; 4] }
        })
        .collect();
    let stretch: Vec<[f64; 4]> = (0..count).map(|_| [0, 1, 2, 3].map(|_| half(random.uniform()))).collect();
    let single = |t: &[[f64; 4]]| -> Vec<[f32; 4]> { t.iter().map(|t| t.map(|v| v as f32)).collect() };
    let source = half_image(gpu, size, &single(&light));
    let stretch_image = half_image(gpu, size, &single(&stretch));
    let linear = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        ..Default::default()
    });
    let deviation_mm = 2.5f32;
    for (entry, halvings) in [("along_u", 0u32), ("across_u", 0), ("along_u", 1), ("across_u", 1)] {
        let params = Blur { deviation_mm, most_texels: 5.0, source_scale: 1.0, level: halvings };
        let kernel = Kernel::new(gpu, "blur", &blur_program(), entry);
        let spec = ImageSpec::light(size.map(|n| n >> halvings));
        let found = recorded(gpu, |r| {
            let blurred = r.image("blurred", spec);
            let params = r.uniform("blur", &params);
            let resources = blur_resources(&linear, &stretch_image, &params, [&source, &blurred]);
            r.dispatch(&kernel, &resources, pixel_groups(spec.size));
            blurred
        });
        let found = read_image::<[half::f16; 4]>(gpu, &found);
        let texels = Texels { size: size.map(|n| n as usize), values: light.clone() };
        let expected = line(&texels, halvings, |x, y| {
            let n = (1usize << halvings) >> 1;
            let s = stretch[((y << halvings) + n) * size[0] as usize + (x << halvings) + n];
            let d = if entry == "along_u" { [s[0], 0.0] } else { [s[1], s[2]] };
            let d = d.map(|d| d * s[3] * f64::from(deviation_mm));
            let long = 3.0 * d[0].hypot(d[1]);
            d.map(|d| d * (5.0 / long.max(1e-6)).min(1.0))
        });
        for (i, (found, expected)) in found.iter().zip(&expected.values).enumerate() {
            for c in 0..4 {
                let error = (f64::from(found[c].to_f32()) - expected[c]).abs();
                // A half keeps 11 bits; devices interpolate with 8 bits between texels.
                assert!(error < 0.012, "{entry} {halvings}, {i}: {found:?}, expected {expected:?}");
            }
        }
    }
}

/// A grid of skin by rules for its places (mm) and texture coordinates; `columns` x `rows` quads. Where `is_round` the
/// last column of points is the first.
fn grid(
    [columns, rows]: [u32; 2],
    is_round: bool,
    at: impl Fn(f64, f64) -> [f64; 3],
    uv: impl Fn(f64, f64) -> [f64; 2],
) -> Head {
    let mut mesh = Mesh::default();
    let point_columns = if is_round { columns } else { columns + 1 };
    let share = |i: u32, n: u32| f64::from(i) / f64::from(n);
    for y in 0..=rows {
        for x in 0..point_columns {
            let p = at(share(x, columns), share(y, rows));
            mesh.points.push(MM * Vec3::from_array(p.map(|p| p as f32)));
        }
    }
    for y in 0..=rows {
        for x in 0..=columns {
            let [u, v] = uv(share(x, columns), share(y, rows));
            let point = y * point_columns + x % point_columns;
            mesh.vertices.push(Vertex { point, uv: Vec2::new(u as f32, v as f32) });
        }
    }
    for y in 0..rows {
        for x in 0..columns {
            let v = |x: u32, y: u32| y * (columns + 1) + x;
            mesh.triangles.push([v(x, y), v(x + 1, y), v(x + 1, y + 1)]);
            mesh.triangles.push([v(x, y), v(x + 1, y + 1), v(x, y + 1)]);
        }
    }
    let end = mesh.triangles.len() as u32;
    mesh.parts.push(Part { name: "skin".into(), material: Material::Skin, triangles: 0..end });
    Head { name: "test".into(), mesh, ..Head::default() }
}

/// A square of skin of 90 mm that faces +Z, and teeth above its left half.
fn shaded_plane() -> Head {
    let mut head = grid([12, 12], false, |x, y| [90.0 * x - 45.0, 90.0 * y - 45.0, 0.0], |x, y| [x, 1.0 - y]);
    let first = head.mesh.points.len() as u32;
    let vertex = head.mesh.vertices.len() as u32;
    for (i, p) in [[-90.0, -90.0], [0.0, -90.0], [0.0, 90.0], [-90.0, 90.0]].into_iter().enumerate() {
        head.mesh.points.push(MM * Vec3::new(p[0], p[1], 60.0));
        head.mesh.vertices.push(Vertex { point: first + i as u32, uv: Vec2::ZERO });
    }
    let start = head.mesh.triangles.len() as u32;
    head.mesh.triangles.push([vertex, vertex + 1, vertex + 2]);
    head.mesh.triangles.push([vertex, vertex + 2, vertex + 3]);
    head.mesh.parts.push(Part {
        name: "shade".into(),
        material: Material::Teeth,
        triangles: start..start + 2,
    });
    head
}

fn sun(direction: Vec3, strength: f32) -> Light {
    Light {
        kind: LightKind::Directional { direction },
        color_linear: Vec3::splat(strength),
        radius: 0.0,
        casts_shadow: true,
    }
}

fn camera(position_mm: [f32; 3], fov_degrees: f32) -> Camera {
    Camera { position: MM * Vec3::from_array(position_mm), target: Vec3::ZERO, up: Vec3::Y, fov_degrees }
}

/// A frame of a test.
struct Drawn {
    diffuse: Vec<[f32; 4]>,
    /// a = strength of scattering.
    albedo: Vec<[f32; 4]>,
    stats: FrameStats,
}

/// Draws heads side by side, 300 mm apart.
fn draw_with(
    renderer: &mut Renderer,
    heads: &[(&HeadOnGpu, &FaceState)],
    camera: Camera,
    lights: &[Light],
    pixels: u32,
    quality: Quality,
) -> Result<Drawn, RenderError> {
    let placed: Vec<_> = (heads.iter().enumerate())
        .map(|(i, (head, state))| HeadInstance {
            head,
            state,
            world_from_head: Mat4::from_translation(Vec3::X * 0.3 * i as f32),
        })
        .collect();
    let scene = Scene {
        heads: &placed,
        camera,
        lights,
        environment: None,
        environment_rotation: 0.0,
        environment_intensity: 1.0,
        background_linear: Vec3::ZERO,
        optics: Default::default(),
    };
    let settings = Settings {
        output: Output {
            size: [pixels; 2],
            channels: vec![Channel::Diffuse, Channel::Albedo],
            ..Output::default()
        },
        quality,
        look: Look { exposure: 1.0, ..Look::default() },
    };
    let (_, stats) = render(renderer, &scene, &settings)?;
    Ok(Drawn {
        diffuse: read_texels(renderer, Channel::Diffuse),
        albedo: read_texels(renderer, Channel::Albedo),
        stats,
    })
}

fn quality(scatter: ScatterMethod) -> Quality {
    Quality {
        scatter,
        transmit: TransmitMethod::None,
        antialias: AntialiasMethod::None,
        shadow_size: 1024,
        ..Quality::default()
    }
}

fn draw(
    renderer: &mut Renderer,
    head: &Head,
    shapes: &[f32],
    camera: Camera,
    lights: &[Light],
    (pixels, quality): (u32, Quality),
) -> Drawn {
    let on_gpu = HeadOnGpu::new(renderer.gpu(), head, &WHITE_TABLE).expect("it uploads");
    let mut state = FaceState::neutral(head);
    state.shapes = shapes.to_vec();
    let drawn = draw_with(renderer, &[(&on_gpu, &state)], camera, lights, pixels, quality);
    drawn.expect("it draws")
}

/// Root mean square difference over the root mean square, over pixels of skin.
fn relative(found: &Drawn, expected: impl Fn(usize) -> [f64; 3]) -> f64 {
    let (mut error, mut signal) = (0.0, 0.0);
    for (i, f) in found.diffuse.iter().enumerate().filter(|(i, _)| found.albedo[*i][3] > 0.0) {
        let e = expected(i);
        for c in 0..3 {
            error += (f64::from(f[c]) - e[c]).powi(2);
            signal += e[c].powi(2);
        }
    }
    (error / signal).sqrt()
}

fn rgb(t: &[f32; 4]) -> [f64; 3] {
    [t[0], t[1], t[2]].map(f64::from)
}

/// The plane with its left half in shadow, 24 mm of it, against the line spread.
fn error_of_edge(renderer: &mut Renderer, head: &Head, shapes: &[f32], side: u32) -> f64 {
    let method = ScatterMethod::TextureSpace(side);
    let light = sun(Vec3::NEG_Z, 2.0);
    let pixels = 48;
    // The camera stands below the shade.
    let across_mm = 24.0f64;
    let view = camera([0.0, 0.0, 50.0], (2.0 * (0.5 * across_mm / 50.0).atan().to_degrees()) as f32);
    let found = draw(renderer, head, shapes, view, &[light], (pixels, quality(method)));
    let profile = Profile::deon_six();
    let white = entering(GLOSS[0], GLOSS[1], 1.0) * 2.0 / PI;
    relative(&found, |i| {
        let x = (((i as u32 % pixels) as f64 + 0.5) / f64::from(pixels) - 0.5) * across_mm;
        profile.channels.each_ref().map(|c| white * (0.5 + 0.5 * x.signum() * c.line_cdf(x.abs())))
    })
}

#[test]
fn a_plane_with_an_edge_of_shadow_gives_the_line_spread() {
    let Some(mut renderer) = renderer() else { return };
    let head = shaded_plane();
    // Texels of 0.2, 0.4 and 0.8 mm.
    for (side, bound) in [(512, 0.02), (256, 0.03), (128, 0.06)] {
        let error = error_of_edge(&mut renderer, &head, &[], side);
        assert!(error < bound, "{side}: {error}");
    }
}

#[test]
fn the_blur_keeps_its_width_where_the_surface_stretches_and_shears() {
    let Some(mut renderer) = renderer() else { return };
    // A shape that makes the skin larger, smaller or slanted, and not the shade.
    let mut head = shaded_plane();
    let skin: Vec<u32> = (0..13 * 13).collect();
    let moved = |f: fn(Vec3) -> Vec3| BlendShape {
        name: "moved".into(),
        points: skin.clone(),
        offsets: skin.iter().map(|p| f(head.mesh.points[*p as usize])).collect(),
        ..BlendShape::default()
    };
    let shapes: [fn(Vec3) -> Vec3; 3] =
        [|p| p, |p| Vec3::new(-0.4 * p.x, 0.0, 0.0), |p| Vec3::new(0.8 * p.y, 0.0, 0.0)];
    let shapes = shapes.map(moved);
    for (shape, bound) in shapes.into_iter().zip([0.04, 0.04, 0.04]) {
        head.shapes = vec![shape];
        let error = error_of_edge(&mut renderer, &head, &[1.0], 256);
        assert!(error < bound, "{error}");
    }
}

/// A tube of skin of 20 mm radius along y; its seam lies at an angle in turns from +Z.
fn tube(seam: f64) -> Head {
    let at =
        |a: f64, y: f64| [20.0 * (TAU * (a + seam)).sin(), 80.0 * y - 40.0, 20.0 * (TAU * (a + seam)).cos()];
    grid([64, 8], true, at, |a, y| [0.1 + 0.6 * a, 0.9 - 0.5 * y])
}

#[test]
fn a_seam_does_not_show() {
    let Some(mut renderer) = renderer() else { return };
    // Light that falls off across the seam.
    let lamp = Light {
        kind: LightKind::Spot {
            position: Vec3::new(0.0, 0.0, 0.12),
            direction: Vec3::new(0.06, 0.0, -1.0),
            outer_degrees: 5.0,
            inner_degrees: 3.0,
        },
        color_linear: Vec3::splat(0.03),
        radius: 0.0,
        casts_shadow: false,
    };
    let mut of = |seam: f64| {
        let quality = quality(ScatterMethod::TextureSpace(256));
        draw(&mut renderer, &tube(seam), &[], camera([0.0, 0.0, 150.0], 12.0), &[lamp], (64, quality))
    };
    // The same texels, one layout with the seam in view and one with it behind.
    let (seam, whole) = (of(0.0), of(0.5));
    let most = whole.diffuse.iter().map(|t| t[0]).fold(0.0, f32::max);
    let worst = seam
        .diffuse
        .iter()
        .zip(&whole.diffuse)
        .map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max));
    let worst = worst.fold(0.0, f32::max) / most;
    assert!(most > 0.1 && worst < 0.01, "{worst} of {most}");
}

#[test]
fn savings_do_not_show() {
    let Some(mut renderer) = renderer() else { return };
    let head = dome();
    let lights = [sun(Vec3::new(-0.7, -0.3, -1.0), 3.0)];
    // A head of under 40 pixels shows the aliasing of the map that is not sized: up to 0.018 at 20 pixels.
    for (view, side, name) in [
        (camera([0.0, 0.0, 400.0], 25.0), 64, "whole"),
        (camera([60.0, 30.0, 200.0], 16.0), 64, "a part"),
        (camera([0.0, 0.0, 2500.0], 12.0), 192, "distant"),
    ] {
        let mut of = |savings: &[MapSaving]| {
            let mut quality = quality(ScatterMethod::TextureSpace(512));
            quality.map_savings = savings.to_vec();
            draw(&mut renderer, &head, &[0.0, 0.0], view, &lights, (side, quality))
        };
        let all = of(&[]);
        for savings in [&[MapSaving::Culled][..], &[MapSaving::Clipped], &[MapSaving::Sized], &MapSaving::ALL]
        {
            let some = of(savings);
            let mut apart: Vec<f32> = (all.diffuse.iter().zip(&some.diffuse).zip(&all.albedo))
                .filter(|(_, albedo)| albedo[3] > 0.0)
                .map(|((a, b), _)| (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max))
                .collect();
            apart.sort_by(f32::total_cmp);
            let at = apart[(apart.len() as f64 * 0.999) as usize % apart.len()];
            assert!(at < 1.0 / 255.0, "{name} {savings:?}: {at}");
        }
    }
}

#[test]
fn a_dome_looks_as_the_integral_over_its_surface() {
    let Some(mut renderer) = renderer() else { return };
    let head = dome();
    // A round patch of light with a narrow border.
    let lamp = Light {
        kind: LightKind::Spot {
            position: Vec3::new(-0.1, 0.15, 0.4),
            direction: Vec3::new(0.1, -0.15, -0.4),
            outer_degrees: 4.0,
            inner_degrees: 3.6,
        },
        color_linear: Vec3::splat(0.5),
        radius: 0.0,
        casts_shadow: true,
    };
    let view = camera([0.0, 0.0, 400.0], 12.0);
    let mut of = |scatter| draw(&mut renderer, &head, &[0.0, 0.0], view, &[lamp], (48, quality(scatter)));
    let reference = of(ScatterMethod::ReferenceSurface(6));
    let mut error = |scatter| relative(&of(scatter), |i| rgb(&reference.diffuse[i]));
    let (found, without) = (error(ScatterMethod::TextureSpace(512)), error(ScatterMethod::None));
    // The noise of the reference is part of it.
    assert!(found < 0.04 && found < 0.4 * without, "{found}, without scattering {without}");
}

#[test]
fn colour_before_scattering_leaves_an_even_colour_alone() {
    let Some(mut renderer) = renderer() else { return };
    let mut of = |pre_scatter| {
        let mut quality = quality(ScatterMethod::TextureSpace(128));
        quality.pre_scatter = pre_scatter;
        let view = camera([0.0, 0.0, 50.0], 25.0);
        draw(&mut renderer, &shaded_plane(), &[], view, &[sun(Vec3::NEG_Z, 2.0)], (24, quality))
    };
    let (after, before, mixed) = (of(0.0), of(1.0), of(0.5));
    for other in [before, mixed] {
        let error = relative(&other, |i| rgb(&after.diffuse[i]));
        assert!(error < 0.01, "{error}");
    }
}

/// From 0 mm thickness at x = -50 to 11 mm at x = 50, seen from its flat side.
fn wedge() -> Head {
    let mut head = grid([20, 10], false, |x, y| [100.0 * x - 50.0, 100.0 * y - 50.0, 0.0], |x, y| [x, y]);
    let back =
        grid([20, 10], false, |x, y| [100.0 * x - 50.0, 50.0 - 100.0 * y, -11.0 * x], |x, y| [x, 2.0 + y]);
    let (points, vertices) = (head.mesh.points.len() as u32, head.mesh.vertices.len() as u32);
    head.mesh.points.extend(back.mesh.points);
    head.mesh.vertices.extend(back.mesh.vertices.iter().map(|v| Vertex { point: v.point + points, ..*v }));
    head.mesh.triangles.extend(back.mesh.triangles.iter().map(|t| t.map(|v| v + vertices)));
    head.mesh.parts[0].triangles.end = head.mesh.triangles.len() as u32;
    head
}

#[test]
fn a_wedge_lit_from_behind_follows_the_transmittance_of_its_gaussians() {
    let Some(mut renderer) = renderer() else { return };
    let mut quality = quality(ScatterMethod::TextureSpace(512));
    quality.transmit = TransmitMethod::TranslucentShadowMap;
    let (pixels, strength) = (40, 100.0);
    let view = camera([0.0, 0.0, 300.0], (2.0 * (50.0f32 / 300.0).atan()).to_degrees());
    let lights = [sun(Vec3::Z, strength)];
    let found = draw(&mut renderer, &wedge(), &[], view, &lights, (pixels, quality.clone()));
    let profile = Profile::deon_six();
    let gaussians = gauss::gaussians(&profile, TERMS).expect("it is a sum of six");
    let cosine = 1.0 / 0.11f64.hypot(1.0);
    let mut compared = 0;
    for (i, f) in found.diffuse.iter().enumerate() {
        let x = (((i as u32 % pixels) as f64 + 0.5) / f64::from(pixels) - 0.5) * 100.0;
        let y = (((i as u32 / pixels) as f64 + 0.5) / f64::from(pixels) - 0.5) * 100.0;
        let thickness = (x + 50.0) * 0.11;
        if !(1.0..7.0).contains(&thickness) || y.abs() > 40.0 {
            continue;
        }
        for c in 0..3 {
            // An evenly lit plane at a distance; the lamp's light is that of the tilted back.
            let back = f64::from(strength) * cosine * entering(GLOSS[0], GLOSS[1], cosine as f32) / PI;
            let passed =
                gaussians.iter().map(|g| g.weights[c] * (-0.5 * thickness.powi(2) / g.variance_mm2).exp());
            let expected = back * passed.sum::<f64>();
            let error = (f64::from(f[c]) - expected).abs();
            assert!(error < 0.08 * expected + 0.004 * back, "{thickness} mm, {c}: {} not {expected}", f[c]);
            compared += 1;
        }
    }
    assert!(compared > 1000, "{compared}");
    quality.transmit = TransmitMethod::None;
    let dark = draw(&mut renderer, &wedge(), &[], view, &lights, (8, quality));
    assert!(dark.diffuse.iter().all(|t| t[..3] == [0.0; 3]), "without it no light comes through");
}

#[test]
fn heads_are_refused_with_the_reason_and_what_works_and_other_input_gives_no_nan() {
    let Some(mut renderer) = renderer() else { return };
    let view = camera([0.0, 0.0, 400.0], 25.0);
    let lights = [sun(Vec3::NEG_Z, 2.0)];
    let method = ScatterMethod::TextureSpace(64);
    let mut head = dome();
    for v in &mut head.mesh.vertices {
        v.uv = Vec2::ZERO;
    }
    let upload = |renderer: &Renderer, head: &Head| {
        HeadOnGpu::new(renderer.gpu(), head, &WHITE_TABLE).expect("it uploads")
    };
    let state = FaceState::neutral(&head);
    let bare = upload(&renderer, &head);
    let refused = draw_with(&mut renderer, &[(&bare, &state)], view, &lights, 16, quality(method));
    let message = refused.err().expect("it has no coordinates").to_string();
    assert!(
        message.starts_with(
            "texture-space:64 cannot draw head 1: 100 % of its skin have no texture coordinates"
        ) && message.contains("separable:5")
            && message.contains("reference-surface"),
        "{message}"
    );
    // Another method draws it.
    draw_with(&mut renderer, &[(&bare, &state)], view, &lights, 16, quality(ScatterMethod::Separable(5)))
        .expect("it draws");

    // A lamp inside, a triangle without area, and a profile wider than the head.
    let mut head = dome();
    head.mesh.triangles.extend([[0, 0, 0], [0, 2, 0]]);
    head.mesh.parts[0].triangles.end += 2;
    let wide = {
        let mut profile = Profile::deon_six();
        for channel in &mut profile.channels {
            let RadialProfile::Gaussians(sum) = channel else { panic!("they are Gaussians") };
            let terms = sum.terms().iter().map(|t| rubor_rig::skin::gaussians::GaussianTerm {
                variance_mm2: 1e4 * t.variance_mm2,
                ..*t
            });
            *sum = rubor_rig::skin::gaussians::GaussianSum::new(terms.collect()).expect("they are finite");
        }
        profile.name = "wide".into();
        profile
    };
    let on_gpu = upload(&renderer, &head);
    let inside = Light {
        kind: LightKind::Point { position: Vec3::new(0.0, 0.0, 0.05) },
        color_linear: Vec3::splat(5.0),
        radius: 0.01,
        casts_shadow: true,
    };
    for transmit in TransmitMethod::all() {
        let mut quality = quality(method);
        quality.transmit = transmit;
        quality.profile = wide.clone().into();
        let drawn =
            draw_with(&mut renderer, &[(&on_gpu, &state), (&on_gpu, &state)], view, &[inside], 24, quality)
                .expect("it draws");
        assert!(drawn.diffuse.iter().flatten().all(|v| v.is_finite()), "{transmit}");
    }
    // Translucent shadow maps need maps of light.
    let mut quality = quality(ScatterMethod::Separable(5));
    quality.transmit = TransmitMethod::TranslucentShadowMap;
    let refused = draw_with(&mut renderer, &[(&on_gpu, &state)], view, &lights, 16, quality);
    let message = refused.err().expect("it has no maps").to_string();
    assert!(
        message.contains("translucent-shadow-map with separable:5") && message.contains("texture-space"),
        "{message}"
    );
}

#[test]
fn memory_is_that_of_the_method_in_use() {
    let Some(mut renderer) = renderer() else { return };
    let head = dome();
    let state = FaceState::neutral(&head);
    let on_gpu = HeadOnGpu::new(renderer.gpu(), &head, &WHITE_TABLE).expect("it uploads");
    let lights = [sun(Vec3::NEG_Z, 2.0)];
    let mut bytes = |scatter| {
        let mut last = 0;
        // Images that nobody uses stay for two frames.
        for _ in 0..4 {
            let view = camera([0.0, 0.0, 400.0], 25.0);
            let quality = Quality { map_savings: Vec::new(), ..quality(scatter) };
            let drawn = draw_with(&mut renderer, &[(&on_gpu, &state)], view, &lights, 16, quality);
            last = drawn.expect("it draws").stats.memory_bytes;
        }
        last
    };
    let before = bytes(ScatterMethod::None);
    let with = bytes(ScatterMethod::TextureSpace(256));
    // Places, light and stretch take 8 bytes per texel each.
    assert!(with > before + 3 * 8 * 256 * 256, "{with} {before}");
    assert_eq!(bytes(ScatterMethod::None), before);
}

#[test]
fn maps_shrink_with_the_distance() {
    let levels = [0.0, 0.1, 2.79, 2.81, 5.8, 11.4, 100.0].map(|pixel| sized_level(0.35, pixel));
    assert_eq!(levels, [0, 0, 0, 1, 2, 3, 3]);
}
