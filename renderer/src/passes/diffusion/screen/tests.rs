use std::sync::Arc;

use glam::Mat4;
use half::f16;
use rubor_rig::random::SplitMix64;
use rubor_rig::skin::diffusion::BetterDipole;
use rubor_rig::skin::kernel::SeparableKernel;
use rubor_rig::skin::medium::{SKIN1, rgb_media};
use rubor_rig::skin::profile::{Profile, RadialProfile};

use super::reference::{DEPTH_ORIGIN_MM, Frame};
use super::*;
use crate::device::{Gpu, Image, ImageSpec, Recorder, depth_attachment};
use crate::error::RenderError;
use crate::passes::diffusion::{self, surface};
use crate::passes::geometry::raster::Rasteriser;
use crate::passes::shade::{Lit, samples_program};
use crate::scene::view::{Seen, View};
use crate::settings::ScatterMethod;
use crate::testing::{assert_layout, assert_workgroups, gpu, half_image, offsets, read_image, recorded};

/// Distance of the near plane of test views, metres.
const NEAR: f32 = 0.01;

/// Every method that draws in one frame.
const METHODS: [ScatterMethod; 6] = [
    ScatterMethod::Separable(17),
    ScatterMethod::ScreenGauss(4),
    ScatterMethod::ScreenGauss(6),
    ScatterMethod::ScreenJitter,
    ScatterMethod::BurleyDisk(16),
    ScatterMethod::ReferenceScreen,
];

fn half(v: f64) -> f64 {
    f16::from_f64(v).to_f64()
}

impl Frame {
    fn new(size: [usize; 2], focal_px: f64, at: impl Fn(usize, usize) -> ([f64; 3], f64, f64)) -> Self {
        let mut frame = Self {
            width: size[0],
            height: size[1],
            focal_px: f64::from(focal_px as f32),
            color: Vec::new(),
            strength: Vec::new(),
            depth_mm: Vec::new(),
            view: None,
        };
        for y in 0..size[1] {
            for x in 0..size[0] {
                let (color, strength, depth_mm) = at(x, y);
                let strength = half(strength);
                frame.color.push(color.map(half));
                frame.strength.push(strength);
                let depth = 1000.0 * NEAR / depth_mm as f32;
                let is_skin = strength > 0.0 && depth > 0.0;
                frame.depth_mm.push(if is_skin { f64::from(1000.0 * NEAR / depth) } else { f64::INFINITY });
            }
        }
        frame
    }

    fn view(&self) -> View {
        let mut view: View = bytemuck::Zeroable::zeroed();
        view.clip_from_world = Mat4::IDENTITY;
        view.origin = [0.0, 0.0, 0.0, self.focal_px as f32];
        view.size = [self.width as u32, self.height as u32];
        view.near = NEAR;
        view.depth_origin_mm = DEPTH_ORIGIN_MM as f32;
        view
    }
}

/// A depth image can only be written by drawing.
fn draw_depth(gpu: &Gpu, frame: &Frame) -> Image {
    let shader = gpu.shader(
        "test depth",
        "@group(0) @binding(0) var<storage, read> depths: array<f32>;
         @group(0) @binding(1) var<storage, read> width: array<u32>;
         @vertex fn corner(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
             return vec4f(vec2f(f32(i & 1u), f32(i >> 1u)) * 4.0 - 1.0, 0.0, 1.0);
         }
         @fragment fn depth(@builtin(position) p: vec4f) -> @builtin(frag_depth) f32 {
             return depths[u32(p.y) * width[0] + u32(p.x)];
         }",
    );
    let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("test depth"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &shader,
            entry_point: Some("corner"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: wgpu::TextureFormat::Depth32Float,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Always),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &shader,
            entry_point: Some("depth"),
            compilation_options: Default::default(),
            targets: &[],
        }),
        multiview_mask: None,
        cache: None,
    });
    let size = [frame.width as u32, frame.height as u32];
    let image = Image::new(gpu, "test depth", ImageSpec::attachment(size, wgpu::TextureFormat::Depth32Float));
    let depths: Vec<f32> = frame.depth_mm.iter().map(|d| (1000.0 * f64::from(NEAR) / d) as f32).collect();
    let [depths, width] = [gpu.storage("depths", &depths), gpu.storage("width", &[size[0]])];
    let entries = [(0, &depths), (1, &width)]
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() });
    let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("test depth"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    });
    recorded(gpu, |r| {
        let attachment = depth_attachment(image.view(), wgpu::LoadOp::Clear(0.0));
        let mut pass = r.timer.render(gpu, r.encoder, "test depth", &[], attachment);
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..3, 0..1);
    });
    image
}

/// RGBA of each pixel.
fn read(gpu: &Gpu, image: &Image) -> Vec<[f64; 4]> {
    read_image::<[f16; 4]>(gpu, image).into_iter().map(|t| t.map(f16::to_f64)).collect()
}

fn run_with(
    gpu: &Gpu,
    frame: &Frame,
    work: impl FnOnce(&mut Recorder<'_>, &Seen, &Lit) -> Image,
) -> Vec<[f64; 4]> {
    let size = [frame.width as u32, frame.height as u32];
    let lit = frame.color.iter().enumerate().map(|(i, c)| [c[0], c[1], c[2], frame.relative_mm(i)]);
    let irradiance: Vec<[f32; 4]> = lit.map(|t| t.map(|v| v as f32)).collect();
    let albedo: Vec<[f32; 4]> = frame.strength.iter().map(|a| [0.0, 0.0, 0.0, *a as f32]).collect();
    let lit = Lit {
        irradiance: half_image(gpu, size, &irradiance),
        albedo: half_image(gpu, size, &albedo),
        direct: half_image(gpu, size, &albedo),
    };
    let farthest = frame.depth_mm.iter().copied().filter(|d| d.is_finite()).fold(0.0, f64::max);
    let depth = draw_depth(gpu, frame);
    let seen = Seen {
        view: gpu.uniform("view", &frame.view()),
        pixels_per_mm: frame.focal_px / farthest,
        ids: depth.clone(),
        depth,
        windows: Vec::new(),
    };
    let scattered = recorded(gpu, |r| work(r, &seen, &lit));
    read(gpu, &scattered)
}

fn run(gpu: &Gpu, wanted: ScatterMethod, profile: &Profile, frame: &Frame) -> Vec<[f64; 4]> {
    let mut diffusion =
        diffusion::method(gpu, Rasteriser::Hardware, wanted, profile).unwrap().expect("it draws in one go");
    run_with(gpu, frame, |r, seen, lit| diffusion.after_shading(r, &[], seen, lit))
}

fn skin() -> Arc<Profile> {
    Arc::new(Profile::deon_six())
}

/// Two tilted surfaces, holes, noise and very bright pixels at an odd size; 2.2 pixels per millimetre.
fn hostile(seed: u64) -> Frame {
    let mut random = SplitMix64(seed);
    let mut noise: Vec<f64> = (0..27 * 51 * 8).map(|_| random.uniform()).collect();
    let mut next = || noise.pop().unwrap();
    let cells: Vec<_> = (0..27 * 51)
        .map(|i| {
            let (x, y) = ((i % 27) as f64, (i / 27) as f64);
            let bright = if next() > 0.99 { 30.0 } else { 1.0 };
            let color = [next() * bright, next() * bright, next()];
            let strength = if next() > 0.9 { 0.0 } else { 0.2 + 0.8 * next() };
            let depth = if x + 0.4 * y > 25.0 { 420.0 + 0.4 * x } else { 400.0 + 0.1 * x - 0.3 * y };
            (color, strength, depth + 0.2 * next())
        })
        .collect();
    Frame::new([27, 51], 900.0, |x, y| cells[y * 27 + x])
}

/// The upper left pixels of a frame.
fn corner(frame: &Frame, width: usize, height: usize) -> Frame {
    let places: Vec<usize> = (0..width * height).map(|i| i / width * frame.width + i % width).collect();
    Frame {
        width,
        height,
        color: places.iter().map(|i| frame.color[*i]).collect(),
        strength: places.iter().map(|i| frame.strength[*i]).collect(),
        depth_mm: places.iter().map(|i| frame.depth_mm[*i]).collect(),
        ..frame.clone()
    }
}

/// Pixels agree within a relative bound for halves, which keep 11 bits, and one for depths: f32 knows 400 mm to 3e-5 mm,
/// and a tangent plane ten pixels away multiplies that.
fn assert_close(name: &str, found: &[[f64; 4]], expected: &Frame, relative: f64) {
    assert_between(name, found, [expected; 3], relative);
}

/// As [`assert_close`], and the reference may lie anywhere between three frames.
fn assert_between(name: &str, found: &[[f64; 4]], expected: [&Frame; 3], relative: f64) {
    let largest = expected[0].color.iter().flatten().fold(0.0f64, |a, b| a.max(*b));
    for (i, f) in found.iter().enumerate() {
        for c in 0..3 {
            let e = expected.map(|frame| frame.color[i][c]);
            let low = e.into_iter().fold(f64::INFINITY, f64::min);
            let high = e.into_iter().fold(0.0, f64::max);
            let bound = relative * high + 2e-5 * largest;
            let at = (i % expected[0].width, i / expected[0].width);
            let is_close = f[c] >= low - bound && f[c] <= high + bound;
            assert!(is_close, "{name} at {at:?} channel {c}: {} and not {low} to {high}", f[c]);
        }
    }
}

/// Texture units place a sample to 1/256 of a pixel: where taps may be off their place, in pixels.
const TAP_SHIFTS: [f64; 3] = [0.0, -1.0 / 256.0, 1.0 / 256.0];

#[test]
fn shaders_and_structs_are_what_both_sides_count_on() {
    use line::Sum;
    for (vertical, sum) in [(false, Sum::None), (true, Sum::None), (true, Sum::Own), (true, Sum::WithCoarser)]
    {
        for levels in [false, true] {
            let program = line::program(vertical, levels, sum);
            assert_layout(
                &program,
                "scatter",
                "Params",
                size_of::<line::Params>(),
                &offsets!(line::Params; pair_count as "pair_count", follow_per_mm as "follow_per_mm",
                    visible_mm as "visible_mm", level as "level", share as "share",
                    share_coarser as "share_coarser", pairs as "pairs"),
            );
            assert_workgroups(&program, &[("scatter", [128, 1, 1])]);
        }
    }
    assert_workgroups(&gauss::halve_program(), &[("halve", [16, 16, 1])]);
    let methods = [
        (jitter::program(), jitter::ENTRY),
        (disk::program(), disk::ENTRY),
        (exact::program(), exact::ENTRY),
    ];
    for (program, entry) in methods {
        assert_workgroups(&program, &[(entry, [8, 8, 1])]);
        assert_layout(
            &program,
            entry,
            "Params",
            size_of::<gather::Params>(),
            &offsets!(gather::Params; tap_count as "tap_count", follow_per_mm as "follow_per_mm",
                half_width_mm as "half_width_mm", visible_mm as "visible_mm", method as "method"),
        );
        assert_layout(
            &program,
            entry,
            "Tap",
            size_of::<gather::Tap>(),
            &offsets!(gather::Tap; place as "place", weight as "weight"),
        );
    }
    for (directional, slab) in [(false, false), (true, false), (false, true)] {
        assert_workgroups(
            &surface::program(directional, slab),
            &[("gather", [8, 8, 1]), ("finish", [8, 8, 1])],
        );
    }
    assert_workgroups(&surface::normals_program(), &[("pixel_normals", [8, 8, 1])]);
    assert_layout(
        &surface::program(true, false),
        "gather",
        "Params",
        size_of::<surface::Params>(),
        &offsets!(surface::Params; origin as "origin", head as "head", cells as "cells", cell_mm as "cell_mm",
            half_width_mm as "half_width_mm", near_mm as "near_mm", sample_mm2 as "sample_mm2",
            batches as "batches", near_light as "near_light", lamp as "lamp", light_index as "light_index",
            light_count as "light_count", slab as "slab", dipole as "dipole", near_by_cosine as "near_by_cosine"),
    );
    for (program, entry) in
        [(surface::program(false, false), "gather"), (samples_program(false), "light_samples")]
    {
        assert_layout(
            &program,
            entry,
            "SurfaceSample",
            size_of::<surface::SurfaceSample>(),
            &offsets!(surface::SurfaceSample; place as "place", barycentric as "barycentric"),
        );
    }
}

#[test]
fn separable_agrees_with_its_equations() {
    let Some(gpu) = gpu() else { return };
    for (samples, seed) in [(5, 1), (17, 2), (65, 3)] {
        let frame = hostile(seed);
        let kernel = SeparableKernel::of(&skin(), samples).unwrap();
        let side = separable::side(&kernel);
        let width = kernel.half_width_mm();
        let expected =
            TAP_SHIFTS.map(|shift| frame.line(&side, width, 0, shift).line(&side, width, 1, shift));
        let found = run(gpu, ScatterMethod::Separable(samples as u32), &skin(), &frame);
        // Two roundings to half: one between the passes.
        assert_between("separable", &found, expected.each_ref(), 3e-3);
    }
}

#[test]
fn gaussians_agree_with_their_equations() {
    let Some(gpu) = gpu() else { return };
    for terms in [4, 6] {
        let profile = if terms == 4 { Arc::new(Profile::jimenez_four()) } else { skin() };
        let frame = hostile(5);
        let gaussians = gauss::gaussians(&profile, terms).unwrap();
        let plan = gauss::plan(&gaussians, 900.0 / 431.0);
        assert!(plan.len() > 1 && !plan[0].steps.is_empty(), "{plan:?}");
        // Means of depths are rounded to halves, by up to 1/32 mm here: the plane of a texel is uncertain by that much.
        let unsure = [0.0, -1.0 / 32.0, 1.0 / 32.0];
        let expected = [0, 1, 2].map(|i| frame.gaussians(&plan, TAP_SHIFTS[i], unsure[i]));
        let found = run(gpu, ScatterMethod::ScreenGauss(terms as u32), &profile, &frame);
        assert_between("screen-gauss", &found, expected.each_ref(), 6e-3);
    }
}

#[test]
fn accumulated_weights_are_those_of_table_4_2() {
    // So few pixels per millimetre that every Gaussian runs on the view itself.
    let plan = gauss::plan(&gauss::gaussians(&skin(), 6).unwrap(), 0.1);
    let steps = &plan[0].steps;
    assert_eq!((plan.len(), steps.len()), (1, 5));
    let printed =
        [[0.3, 0.424, 0.346], [0.261, 0.2, 0.0], [0.2, 0.007, 0.007], [0.388, 0.004, 0.0], [0.078, 0.0, 0.0]];
    for (step, printed) in steps.iter().zip(printed) {
        for c in 0..3 {
            assert!((step.share[c] - printed[c]).abs() < 2e-3, "{:?} {printed:?}", step.share);
        }
    }
}

#[test]
fn jitter_agrees_with_its_equations() {
    let Some(gpu) = gpu() else { return };
    let frame = hostile(6);
    let taps = jitter::taps(&skin());
    let width = taps.iter().map(|t| f64::from(t.place[0].hypot(t.place[1]))).fold(0.0, f64::max);
    let found = run(gpu, ScatterMethod::ScreenJitter, &skin(), &frame);
    assert_close("screen-jitter", &found, &frame.jitter(&taps, width), 2e-3);
}

#[test]
fn the_exact_kernel_agrees_with_integrals_over_pixels() {
    let Some(gpu) = gpu() else { return };
    let frame = hostile(7);
    let profile = skin();
    let light = |x0: f64, y0: f64, x1: f64, y1: f64| {
        std::array::from_fn(|c| {
            // Signed quadrants: the light of a rectangle anywhere.
            let q =
                |x: f64, y: f64| x.signum() * y.signum() * profile.channels[c].quadrant_cdf(x.abs(), y.abs());
            q(x1, y1) - q(x0, y1) - q(x1, y0) + q(x0, y0)
        })
    };
    // Only a corner, because the reference is slow.
    let corner = corner(&frame, 9, 11);
    let found = run(gpu, ScatterMethod::ReferenceScreen, &profile, &corner);
    // Linear interpolation in the table, 0.006 mm between entries where a Gaussian has 0.08 mm.
    assert_close("reference-screen", &found, &corner.exact(exact::half_width_mm(&profile), &light), 1e-2);
}

#[test]
fn even_light_on_a_plane_stays_even() {
    let Some(gpu) = gpu() else { return };
    for method in METHODS {
        for tilt in [0.0, 0.3, -1.5] {
            let frame = Frame::new([51, 27], 800.0, |x, _| ([0.7, 1.5, 0.1], 1.0, 400.0 + tilt * x as f64));
            for pixel in run(gpu, method, &skin(), &frame) {
                let pixel = [pixel[0], pixel[1], pixel[2]];
                for (found, expected) in pixel.iter().zip([0.7, 1.5, 0.1]) {
                    assert_eq!(*found, half(expected), "{method} {tilt}: {pixel:?}");
                }
            }
        }
    }
}

#[test]
fn energy_on_a_plane_is_kept() {
    let Some(gpu) = gpu() else { return };
    for method in METHODS {
        let frame = Frame::new([96, 96], 800.0, |x, y| {
            let lit = (x as f64 - 47.5).hypot(y as f64 - 47.5) < 12.0;
            ([f64::from(u8::from(lit)); 3], 1.0, 400.0)
        });
        let found = run(gpu, method, &skin(), &frame);
        for c in 0..3 {
            let before: f64 = frame.color.iter().map(|p| p[c]).sum();
            let after: f64 = found.iter().map(|p| p[c]).sum();
            assert!((after / before - 1.0).abs() < 0.01, "{method} channel {c}: {before} to {after}");
        }
        // And it did spread: from the edge of the spot of 6 mm radius, a tenth of its red goes farther than a pixel.
        let outside: f64 =
            found.iter().zip(&frame.color).filter(|(_, e)| e[0] == 0.0).map(|(f, _)| f[0]).sum();
        let total: f64 = frame.color.iter().map(|p| p[0]).sum();
        assert!(outside > 0.1 * total && outside < 0.3 * total, "{method}: {} outside", outside / total);
    }
}

#[test]
fn mirrored_light_scatters_mirrored() {
    let Some(gpu) = gpu() else { return };
    // Halved images mirror where their pixels do: sizes are multiples of 8.
    let frame = |flip: bool| {
        Frame::new([56, 24], 800.0, |x, y| {
            let x = if flip { 55 - x } else { x };
            ([if x < 20 { 1.0 } else { 0.0 }, (y % 5) as f64, 0.3], 1.0, 400.0)
        })
    };
    // Jittered and turned taps are not symmetric.
    for method in
        [ScatterMethod::Separable(17), ScatterMethod::ScreenGauss(6), ScatterMethod::ReferenceScreen]
    {
        let [a, b] = [false, true].map(|flip| run(gpu, method, &skin(), &frame(flip)));
        for y in 0..24 {
            for x in 0..56 {
                let (p, q) = (a[y * 56 + x], b[y * 56 + 55 - x]);
                assert!(
                    (0..3).all(|c| (p[c] - q[c]).abs() <= 2e-3 * p[c].abs() + 1e-6),
                    "{method} {p:?} {q:?}"
                );
            }
        }
    }
}

#[test]
fn no_strength_changes_nothing() {
    let Some(gpu) = gpu() else { return };
    for method in METHODS {
        let frame = Frame { strength: vec![0.0; 27 * 51], ..hostile(8) };
        let found = run(gpu, method, &skin(), &frame);
        for (f, e) in found.iter().zip(&frame.color) {
            assert_eq!([f[0], f[1], f[2]], *e, "{method}");
        }
    }
}

#[test]
fn kernels_under_half_a_pixel_change_nothing() {
    let Some(gpu) = gpu() else { return };
    for method in METHODS {
        // A head 60 m away.
        let mut frame = hostile(9);
        frame.depth_mm.iter_mut().for_each(|d| *d = if d.is_finite() { 60_000.0 } else { *d });
        let found = run(gpu, method, &skin(), &frame);
        for (f, e) in found.iter().zip(&frame.color) {
            assert_eq!([f[0], f[1], f[2]], *e, "{method}");
        }
    }
}

/// The profile of a skin `factor` times as large.
fn scaled(factor: f64) -> Arc<Profile> {
    use rubor_rig::skin::gaussians::{GaussianSum, GaussianTerm};
    let profile = Profile::deon_six();
    let channels = profile.channels.each_ref().map(|channel| {
        let RadialProfile::Gaussians(sum) = channel else { panic!("a sum of Gaussians") };
        let wider = |t: &GaussianTerm| GaussianTerm { variance_mm2: t.variance_mm2 * factor * factor, ..*t };
        RadialProfile::Gaussians(GaussianSum::new(sum.terms().iter().map(wider).collect()).unwrap())
    });
    Arc::new(Profile { name: "scaled".into(), channels })
}

#[test]
fn kernels_scale_with_lens_distance_and_skin() {
    let Some(gpu) = gpu() else { return };
    for method in METHODS {
        // Hole-free, so that only the scale of the kernel matters.
        let lit = |focal: f64, depth: f64| {
            Frame::new([51, 27], focal, move |x, y| {
                ([if x < 20 { 2.0 } else { 0.1 }, (y % 7) as f64, (x % 3) as f64], 1.0, depth)
            })
        };
        let once = run(gpu, method, &skin(), &lit(800.0, 400.0));
        let same = [
            ("twice the focal length, twice as far", run(gpu, method, &skin(), &lit(1600.0, 800.0))),
            (
                "half the focal length, skin twice as large",
                run(gpu, method, &scaled(2.0), &lit(400.0, 400.0)),
            ),
        ];
        for (what, other) in &same {
            for (a, b) in once.iter().zip(other) {
                // Fits and quantiles of the larger skin are computed anew and end at slightly different values.
                assert!(
                    (0..3).all(|c| (a[c] - b[c]).abs() <= 4e-3 * (1.0 + a[c])),
                    "{method}, {what}: {a:?} {b:?}"
                );
            }
        }
        let near = run(gpu, method, &skin(), &lit(800.0, 200.0));
        assert!(
            near.iter().zip(&once).any(|(a, b)| (a[0] - b[0]).abs() > 0.05),
            "{method}: no change with distance"
        );
    }
}

#[test]
fn no_light_crosses_a_gap() {
    let Some(gpu) = gpu() else { return };
    for method in METHODS {
        // A lit finger, 8 mm before a dark cheek; also one that is a single pixel wide.
        let frame = Frame::new([61, 27], 900.0, |x, _| {
            let finger = (10..30).contains(&x) || x == 45;
            let color = if finger { [4.0; 3] } else { [0.0; 3] };
            (color, 1.0, if finger { 392.0 } else { 400.0 })
        });
        for (i, p) in run(gpu, method, &skin(), &frame).iter().enumerate() {
            let expected = frame.color[i][0];
            // A bilinear tap near the plane may hold a little of what is 8 mm away: line.wesl says how near.
            let is_linear = matches!(method, ScatterMethod::Separable(_) | ScatterMethod::ScreenGauss(_));
            let bound = if is_linear { 0.001 * 4.0 } else { 1e-6 };
            assert!((0..3).all(|c| (p[c] - expected).abs() < bound), "{method} at {}: {p:?}", i % 61);
        }
    }
}

#[test]
fn what_is_not_skin_takes_and_gives_nothing() {
    let Some(gpu) = gpu() else { return };
    for method in METHODS {
        let frame = Frame::new([51, 27], 900.0, |x, _| {
            if x < 25 { ([0.25; 3], 1.0, 400.0) } else { ([9.0; 3], 0.0, 400.0) }
        });
        for (i, p) in run(gpu, method, &skin(), &frame).iter().enumerate() {
            let expected = if i % 51 < 25 { 0.25 } else { 9.0 };
            assert!((0..3).all(|c| (p[c] - expected).abs() < 3e-4), "{method} at {}: {p:?}", i % 51);
        }
    }
}

#[test]
fn any_zoom_gives_numbers() {
    let Some(gpu) = gpu() else { return };
    let exponentials = |d: f64| {
        let channel = rubor_rig::skin::diffusion::NormalizedDiffusion::published(0.5, d).unwrap();
        Arc::new(Profile {
            name: "test".into(),
            channels: [0; 3].map(|_| RadialProfile::NormalizedDiffusion(channel)),
        })
    };
    for method in METHODS {
        let dipoles = rgb_media(&SKIN1, 1.4)
            .unwrap()
            .map(|m| RadialProfile::BetterDipole(BetterDipole::new(m).unwrap()));
        let dipole = Arc::new(Profile { name: "dipole".into(), channels: dipoles });
        for profile in [skin(), exponentials(1e-3), exponentials(100.0), dipole] {
            let mut diffusion = diffusion::method(gpu, Rasteriser::Hardware, method, &profile)
                .unwrap()
                .expect("it draws in one go");
            for (focal, depth) in [(1e-3, 1e6), (30.0, 2e4), (5e5, 11.0), (1e9, 10.5)] {
                let mut frame = hostile(10);
                // The exact kernel takes 512 x 512 taps where it fills the picture.
                if method == ScatterMethod::ReferenceScreen && focal > 1e3 {
                    frame = corner(&frame, 3, 2);
                }
                frame.focal_px = f64::from(focal as f32);
                frame.depth_mm.iter_mut().for_each(|d| *d *= depth / 400.0);
                let found = run_with(gpu, &frame, |r, seen, lit| diffusion.after_shading(r, &[], seen, lit));
                for p in found {
                    assert!(p[..3].iter().all(|v| v.is_finite() && *v >= 0.0), "{method} {focal}: {p:?}");
                }
            }
        }
    }
}

#[test]
fn wrong_numbers_and_profiles_are_errors() {
    let Some(gpu) = gpu() else { return };
    for wrong in [ScatterMethod::Separable(16), ScatterMethod::ScreenGauss(5), ScatterMethod::BurleyDisk(1)] {
        assert!(
            matches!(
                diffusion::method(gpu, Rasteriser::Hardware, wrong, &skin()),
                Err(RenderError::Method(_))
            ),
            "{wrong}"
        );
    }
}
