use super::*;
use crate::device::{Image, ImageSpec};
use crate::testing::{assert_layout, assert_workgroups, gpu, half_image, offsets, read_image, recorded};

/// A film whose pixels have a size.
fn film(frame: u32, height: u32, pixel_um: f32) -> Optics {
    Optics { frame, sensor_height_mm: pixel_um * height as f32 / 1000.0, ..Optics::default() }
}

fn grained(gpu: &Gpu, look: &Look, optics: &Optics, size: [u32; 2], texels: &[[f32; 4]]) -> Vec<[u8; 4]> {
    let displayed = half_image(gpu, size, texels);
    let image = Image::new(gpu, "image", ImageSpec::storage(size, wgpu::TextureFormat::Rgba8Unorm));
    let pass = Grain::new(gpu);
    recorded(gpu, |r| pass.record_into(r, look, optics, displayed.view(), image.view(), size));
    read_image(gpu, &image)
}

fn look(grain: f32, grain_size: f32, dither: DitherMethod) -> Look {
    Look { grain, grain_size, dither, ..Look::default() }
}

#[test]
fn the_shader_is_as_the_pass_counts_on() {
    assert_workgroups(&program(), &[("grain", [8, 8, 1])]);
    assert_layout(
        &program(),
        "grain",
        "Params",
        size_of::<Params>(),
        &offsets!(Params; strength as "strength", spacing as "spacing", frame as "frame", dither as "dither"),
    );
    let (common, own) = (f64::from(COMMON), f64::from(OWN));
    let variance = common * common + own * own + 2.0 * common * own / 3f64.sqrt();
    assert!((variance - 1.0).abs() < 1e-3, "{variance}");
}

#[test]
fn values_are_those_of_the_definition() {
    let Some(gpu) = gpu() else { return };
    let size = [27, 51];
    let texels: Vec<[f32; 4]> =
        (0..27 * 51).map(|i| [i as f32 / 1377.0, 0.5, 1.0 - i as f32 / 1377.0, 1.0]).collect();
    for (grain, grain_size) in [(15.0, 5.0), (30.0, 60.0)] {
        for dither in DitherMethod::all() {
            let look = look(grain, grain_size, dither);
            let optics = film(7, size[1], 22.0);
            let params = Params::new(&look, &optics, size[1]);
            let found = grained(gpu, &look, &optics, size, &texels);
            for (i, f) in found.iter().enumerate() {
                let at = [i as u32 % size[0], i as u32 / size[0]];
                let value = [0, 1, 2].map(|c| f64::from(half::f16::from_f32(texels[i][c]).to_f32()));
                let grain = (f64::from(params.strength), f64::from(params.spacing));
                let expected = reference::grained(value, at, 7, grain, dither == DitherMethod::Triangular);
                for c in 0..3 {
                    let off = (f64::from(f[c]) - 255.0 * expected[c]).abs();
                    assert!(off < 0.51, "pixel {at:?}: {f:?}, expected {:?}", expected.map(|v| 255.0 * v));
                }
            }
        }
    }
}

#[test]
fn grain_is_as_strong_as_the_film_says_and_its_mean_is_zero() {
    let Some(gpu) = gpu() else { return };
    let size = [256, 256];
    let count = f64::from(size[0] * size[1]);
    for (grain_size, value) in [(5.0, 0.5f32), (5.0, 0.2), (44.0, 0.5), (44.0, 0.85)] {
        let look = look(20.0, grain_size, DitherMethod::Triangular);
        let optics = film(3, size[1], 22.0);
        let expected = f64::from(Params::new(&look, &optics, size[1]).strength * value * (1.0 - value));
        let texels = vec![[value, value, value, 1.0]; count as usize];
        let found = grained(gpu, &look, &optics, size, &texels);
        let exact = 255.0 * f64::from(half::f16::from_f32(value).to_f32());
        for c in 0..3 {
            let mean = found.iter().map(|f| f64::from(f[c])).sum::<f64>() / count;
            let square = found.iter().map(|f| (f64::from(f[c]) - mean).powi(2)).sum::<f64>() / count;
            // Dither and rounding add a quarter of the square of a step (1/6 + 1/12).
            let deviation = (square - 0.25).max(0.0).sqrt() / 255.0;
            assert!((deviation / expected - 1.0).abs() < 0.05, "{deviation}, expected {expected}");
            // Four standard errors; coarse grain has fewer independent places.
            let places = count / (1.0 + (f64::from(grain_size) / 22.0).powi(2) * 4.0);
            let bound = 4.0 * 255.0 * expected / places.sqrt() + 0.02;
            assert!((mean - exact).abs() < bound, "mean {mean}, expected {exact} within {bound}");
        }
    }
}

#[test]
fn brighter_stays_brighter_and_black_and_white_stay() {
    let Some(gpu) = gpu() else { return };
    let size = [64, 8];
    // The same noise for each grey: one picture for each value.
    for look in [look(100.0, 5.0, DitherMethod::None), look(40.0, 60.0, DitherMethod::Triangular)] {
        let mut before: Option<Vec<[u8; 4]>> = None;
        for step in 0..=64 {
            let value = step as f32 / 64.0;
            let texels = vec![[value, value, value, 1.0]; 512];
            let found = grained(gpu, &look, &film(1, 8, 10.0), size, &texels);
            if step == 0 || step == 64 {
                assert!(found.iter().all(|f| f[..3] == [if step == 0 { 0 } else { 255 }; 3]));
            }
            if let Some(before) = &before {
                let in_order = before.iter().zip(&found).all(|(b, f)| (0..3).all(|c| b[c] <= f[c]));
                assert!(in_order, "grey {value}");
            }
            before = Some(found);
        }
    }
}

#[test]
fn noise_follows_the_number_of_the_frame_alone() {
    let Some(gpu) = gpu() else { return };
    let size = [40, 40];
    let texels = vec![[0.5, 0.5, 0.5, 1.0]; 1600];
    let of = |frame| {
        grained(gpu, &look(20.0, 5.0, DitherMethod::Triangular), &film(frame, 40, 22.0), size, &texels)
    };
    let (first, second) = (of(1), of(2));
    assert_eq!(first, of(1));
    let differing = first.iter().zip(&second).filter(|(a, b)| a != b).count();
    assert!(differing > 1400, "{differing} of 1600 pixels differ");
    // Unrelated from frame to frame.
    let related: f64 = first
        .iter()
        .zip(&second)
        .map(|(a, b)| (f64::from(a[0]) - 127.5) * (f64::from(b[0]) - 127.5))
        .sum::<f64>()
        / 1600.0;
    let own: f64 = first.iter().map(|a| (f64::from(a[0]) - 127.5).powi(2)).sum::<f64>() / 1600.0;
    assert!(related.abs() < 0.1 * own, "{related} of {own}");
}

#[test]
fn dither_keeps_what_lies_between_two_steps() {
    let Some(gpu) = gpu() else { return };
    let size = [128, 128];
    for value in [100.0f32 / 255.0, 100.25 / 255.0, 100.5 / 255.0, 0.3 / 255.0] {
        let texels = vec![[value, value, value, 1.0]; 128 * 128];
        let found =
            grained(gpu, &look(0.0, 5.0, DitherMethod::Triangular), &film(5, 128, 22.0), size, &texels);
        let mean = found.iter().map(|f| f64::from(f[1])).sum::<f64>() / (128.0 * 128.0);
        let exact = 255.0 * f64::from(half::f16::from_f32(value).to_f32());
        assert!((mean - exact).abs() < 0.03, "{mean}, expected {exact}");
    }
}
