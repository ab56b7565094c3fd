use rubor_rig::random;

use super::reference::{Pixel, blurred};
use super::*;
use crate::testing::{assert_layout, assert_workgroups, gpu, half_image, offsets, read_image, recorded};

const CAMERA: Camera = Camera { position: Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 20.0 };
const FOCUS: f32 = 1.0;

/// A lens with a radius at infinity, pixels of a picture of a height.
fn lens(far_radius: f32, height: u32) -> Optics {
    let wide = Optics { f_stop: Some(1.0), focus_metres: FOCUS, ..Optics::default() };
    let f_stop = wide.far_radius_px(&CAMERA, height) / far_radius;
    Optics { f_stop: Some(f_stop), ..wide }
}

/// Distance at which a lens has a signed radius, metres.
fn distance(radius: f32, far_radius: f32) -> f32 {
    FOCUS / (1.0 - radius / far_radius)
}

fn float_image(gpu: &Gpu, size: [u32; 2], values: &[f32]) -> Image {
    let spec = ImageSpec::storage(size, wgpu::TextureFormat::R32Float).also(wgpu::TextureUsages::COPY_DST);
    let image = Image::new(gpu, "depth", spec);
    gpu.queue.write_texture(
        image.texture().as_image_copy(),
        bytemuck::cast_slice(values),
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * size[0]), rows_per_image: None },
        wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
    );
    image
}

/// Radiance of pixels with signed radii behind the lens; nothing is seen where there is no radius.
fn seen(
    gpu: &Gpu,
    size: [u32; 2],
    far_radius: f32,
    radii: &[Option<f32>],
    light: &[[f32; 4]],
    backdrop: Vec3,
) -> Vec<[f64; 3]> {
    let reversed: Vec<f32> =
        radii.iter().map(|r| r.map_or(0.0, |r| NEAR_METRES / distance(r, far_radius))).collect();
    let (hdr, depth) = (half_image(gpu, size, light), float_image(gpu, size, &reversed));
    let optics = lens(far_radius, size[1]);
    let pass = DepthOfField::new(gpu, 48, false);
    let result = recorded(gpu, |r| {
        pass.record(r, (&CAMERA, &optics), 1, hdr.clone(), &depth, &Behind::Plain(backdrop))
    });
    read_image::<[half::f16; 4]>(gpu, &result)
        .iter()
        .map(|t| std::array::from_fn(|c| f64::from(t[c].to_f32())))
        .collect()
}

#[test]
fn shaders_and_the_spiral_are_as_the_pass_counts_on() {
    for has_backdrop in [false, true] {
        let program = program(has_backdrop);
        assert_workgroups(
            &program,
            &[
                ("tile_of_radii", [16, 16, 1]),
                ("reach", [8, 8, 1]),
                ("levels", [16, 16, 1]),
                ("gather", [8, 8, 1]),
            ],
        );
    }
    assert_layout(
        &program(false),
        "gather",
        "Params",
        size_of::<Params>(),
        &offsets!(Params; far_radius as "far_radius", focus as "focus", samples as "samples", taps as "taps",
            backdrop as "backdrop"),
    );
    for taps in [8, 48, 256] {
        let area: f32 = spiral(taps).iter().map(|t| t[2]).sum();
        assert!((area / std::f32::consts::PI - 1.0).abs() < 0.01, "{taps} taps stand for {area}");
    }
    assert_eq!(atlas_size([1920, 1080]), [960, 810]);
}

#[test]
fn a_flat_field_stays_flat_whatever_its_depth() {
    let Some(gpu) = gpu() else { return };
    let size = [83, 61];
    let noise = |i: u64| random::unit(random::mixed(i + 3)) as f32;
    // Planes at random depths, and a slope.
    let radii: Vec<Option<f32>> = (0..83 * 61u64)
        .map(|i| match (i % 83) / 28 {
            0 => Some(-8.0 + 16.0 * noise((i % 83) / 7 + 100 * (i / 83 / 9))),
            1 => Some((i % 83) as f32 * 0.1 - 4.0),
            _ => Some(6.0),
        })
        .collect();
    let light = vec![[0.2, 1.0, 7.0, 1.0]; 83 * 61];
    for (i, found) in seen(gpu, size, 12.0, &radii, &light, Vec3::ZERO).iter().enumerate() {
        for (f, expected) in found.iter().zip([0.2, 1.0, 7.0]) {
            assert!((f / expected - 1.0).abs() < 0.01, "pixel {i}: {found:?}");
        }
    }
}

#[test]
fn a_bright_point_keeps_its_energy() {
    let Some(gpu) = gpu() else { return };
    let size = [127, 113];
    for radius in [-14.0f32, -6.0, -2.0, 0.3, 1.0, 3.0, 5.5, 9.0, 20.0] {
        let radii = vec![Some(radius); 127 * 113];
        let mut light = vec![[0.0, 0.0, 0.0, 1.0]; 127 * 113];
        light[56 * 127 + 63] = [8000.0, 800.0, 80.0, 1.0];
        let found = seen(gpu, size, 40.0, &radii, &light, Vec3::ZERO);
        for (c, lit) in [8000.0, 800.0, 80.0].into_iter().enumerate() {
            let sum: f64 = found.iter().map(|f| f[c]).sum();
            assert!((sum / lit - 1.0).abs() < 0.01, "radius {radius}: {sum} of {lit}");
        }
        // A tap on the edge stands for a texel of its level: its edge is half a texel soft, and it is interpolated over one.
        let area = (f64::from(radius.abs()) + 0.5).powi(2) * 1.5 * std::f64::consts::PI / 48.0;
        let texel = (0.5 * area.max(1.0).log2() + 0.5).floor().exp2();
        let is_outside = |i: usize| {
            let off = ((i % 127) as f64 - 63.0).hypot((i / 127) as f64 - 56.0);
            off > f64::from(radius.abs()) + 1.5 * texel + 1.0
        };
        let outside: f64 = found.iter().enumerate().filter(|(i, _)| is_outside(*i)).map(|(_, f)| f[0]).sum();
        assert!(outside < 0.005 * 8000.0, "radius {radius}: {outside} of 8000");
    }
}

#[test]
fn blur_is_that_of_every_pixel_of_every_disk() {
    let Some(gpu) = gpu() else { return };
    let size = [96usize, 80];
    let smooth =
        |x: f64, y: f64, k: f64| 0.6 + 0.25 * (0.21 * x + k).sin() + 0.25 * (0.17 * y - 2.0 * k).cos();
    let far_radius = 24.0f32;
    type DepthAt = Box<dyn Fn(usize, usize) -> Option<f32>>;
    let scenes: [(&str, DepthAt); 4] = [
        ("slope", Box::new(|x, _| Some(x as f32 * 0.08 - 3.0))),
        ("blurred edge before a sharp wall", Box::new(|x, _| Some(if x < 48 { -5.0 } else { 0.0 }))),
        ("sharp edge before a blurred wall", Box::new(|x, _| Some(if x < 48 { 0.0 } else { 6.0 }))),
        ("before the backdrop", Box::new(|x, y| (x + y / 2 < 70).then_some(4.0))),
    ];
    for (name, radius) in scenes {
        let mut radii = Vec::new();
        let (mut light, mut pixels) = (Vec::new(), Vec::new());
        for i in 0..size[0] * size[1] {
            let (x, y) = (i % size[0], i / size[0]);
            let r = radius(x, y);
            let shade = if r == Some(-5.0) || r == Some(6.0) { 2.0 } else { 0.0 };
            let color = match r {
                Some(_) => [0.0, 1.0, 2.0].map(|k| smooth(x as f64, y as f64, k + shade) as f32),
                None => [0.0; 3],
            };
            radii.push(r);
            light.push([color[0], color[1], color[2], 1.0]);
            let fill = 4.0;
            pixels.push(Pixel {
                light: color.map(f64::from),
                radius: f64::from(r.unwrap_or(fill)),
                is_surface: r.is_some(),
            });
        }
        let found = seen(gpu, size.map(|n| n as u32), far_radius, &radii, &light, Vec3::ZERO);
        let (mut squares, mut worst) = (0.0, 0f64);
        for (i, f) in found.iter().enumerate() {
            let expected = blurred(&pixels, size, [i % size[0], i / size[0]], 10.0);
            let off = (0..3).map(|c| (f[c] - expected[c]).abs()).fold(0.0, f64::max);
            squares += off * off;
            worst = worst.max(off);
        }
        let rms = (squares / found.len() as f64).sqrt();
        // 48 taps for up to 314 pixels; radiance is about 0.6.
        assert!(rms < 0.03 && worst < 0.25, "{name}: off by {rms} (rms), {worst} at most");
    }
}

#[test]
fn sharp_surfaces_have_no_halo_and_lend_nothing() {
    let Some(gpu) = gpu() else { return };
    let size = [96u32, 64];
    let radii: Vec<_> = (0..96 * 64).map(|i| Some(if i % 96 < 40 { 0.0 } else { 9.0 })).collect();
    let halves = |left: f32, right: f32| -> Vec<[f32; 4]> {
        (0..96 * 64).map(|i| if i % 96 < 40 { left } else { right }).map(|v| [v, v, v, 1.0]).collect()
    };
    // A bright sharp surface before dark: the wall stays dark, and the surface stays bright.
    let found = seen(gpu, size, 20.0, &radii, &halves(10.0, 0.1), Vec3::ZERO);
    for (i, f) in found.iter().enumerate() {
        match i % 96 {
            0..=37 => assert!((f[0] / 10.0 - 1.0).abs() < 0.01, "pixel {i}: {f:?}"),
            43.. => assert!(f[0] < 0.2, "the surface leaks into pixel {i}: {f:?}"),
            _ => {}
        }
    }
    // A dark sharp surface before a bright wall: no dark rim on the wall, no glow on the surface.
    let found = seen(gpu, size, 20.0, &radii, &halves(0.1, 10.0), Vec3::ZERO);
    for (i, f) in found.iter().enumerate() {
        match i % 96 {
            0..=37 => assert!(f[0] < 0.2, "the wall glows on pixel {i}: {f:?}"),
            43.. => assert!((f[0] / 10.0 - 1.0).abs() < 0.05, "a rim at pixel {i}: {f:?}"),
            _ => {}
        }
    }
}

#[test]
fn an_outline_before_the_backdrop_is_a_ramp_and_what_is_sharp_keeps_its_bits() {
    let Some(gpu) = gpu() else { return };
    let size = [96u32, 64];
    let backdrop = Vec3::splat(0.25);
    let radii: Vec<_> = (0..96 * 64).map(|i| (i % 96 < 48).then_some(6.0)).collect();
    let light: Vec<_> =
        (0..96 * 64).map(|i| if i % 96 < 48 { 2.0 } else { 0.25 }).map(|v| [v, v, v, 1.0]).collect();
    let found = seen(gpu, size, 20.0, &radii, &light, backdrop);
    let row = &found[32 * 96..33 * 96];
    for pair in row.windows(2) {
        assert!(pair[1][0] <= pair[0][0] + 0.12, "{row:?}");
    }
    assert!((row[20][0] - 2.0).abs() < 0.02 && (row[75][0] - 0.25).abs() < 1e-3);
    assert!(row[46][0] < 1.6 && row[49][0] > 0.6, "both sides of the edge are mixed: {row:?}");

    let sharp: Vec<_> = radii.iter().map(|r| r.map(|_| 0.1)).collect();
    let noise: Vec<[f32; 4]> = (0..96 * 64u64)
        .map(|i| random::unit(random::mixed(i)) as f32)
        .map(|v| [v, 0.5 * v, v * v, 1.0])
        .collect();
    let hdr: Vec<_> =
        noise.iter().map(|t| [0, 1, 2].map(|c| f64::from(half::f16::from_f32(t[c]).to_f32()))).collect();
    assert_eq!(seen(gpu, size, 20.0, &sharp, &noise, backdrop), hdr);
}
