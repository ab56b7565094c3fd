use super::*;
use crate::testing::{assert_layout, assert_workgroups, gpu, half_image, offsets, read_image, recorded};

const SIZE: [u32; 2] = [257, 251];

/// Spread light at the size of the picture, as `display` interpolates it, with what stays in place.
fn shown(gpu: &Gpu, look: &Look, texels: &[[f32; 4]]) -> Vec<[f64; 3]> {
    let hdr = half_image(gpu, SIZE, texels);
    let bloom = Bloom::new(gpu, look, SIZE[1]);
    let mut share = 0.0;
    let light = recorded(gpu, |r| {
        let spread = bloom.record(r, look, &hdr);
        share = f64::from(spread.share);
        spread.light
    });
    let [width, height] = light.size().map(|n| n as usize);
    let spread: Vec<[half::f16; 4]> = read_image(gpu, &light);
    let tap = |x: f64, y: f64, c: usize| {
        let (x, y) = (x - 0.5, y - 0.5);
        let at = |x: f64, y: f64| {
            let x = (x.max(0.0) as usize).min(width - 1);
            let y = (y.max(0.0) as usize).min(height - 1);
            f64::from(spread[y * width + x][c].to_f32())
        };
        let (left, top) = (x.floor(), y.floor());
        let (u, v) = (x - left, y - top);
        let row = |y: f64| at(left, y) * (1.0 - u) + at(left + 1.0, y) * u;
        row(top) * (1.0 - v) + row(top + 1.0) * v
    };
    (0..SIZE[0] * SIZE[1])
        .map(|i| {
            let (x, y) = (f64::from(i % SIZE[0]), f64::from(i / SIZE[0]));
            std::array::from_fn(|c| {
                let own = f64::from(half::f16::from_f32(texels[i as usize][c]).to_f32());
                (1.0 - share) * own + tap(0.5 * (x + 0.5), 0.5 * (y + 0.5), c)
            })
        })
        .collect()
}

#[test]
fn the_shader_is_as_the_pass_counts_on() {
    for entry in ["bloom_down", "bloom_up"] {
        assert_workgroups(&program(), &[(entry, [8, 8, 1])]);
    }
    assert_layout(
        &program(),
        "bloom_up",
        "Params",
        size_of::<Params>(),
        &offsets!(Params; weight as "weight", more as "more"),
    );
}

#[test]
fn a_point_keeps_its_energy_and_spreads_as_the_function_says() {
    let Some(gpu) = gpu() else { return };
    let (x, y) = (128u32, 125u32);
    let mut texels = vec![[0.0, 0.0, 0.0, 1.0]; (SIZE[0] * SIZE[1]) as usize];
    let lit = 40_000.0;
    texels[(y * SIZE[0] + x) as usize] = [lit, 0.5 * lit, 0.0, 1.0];
    for (bloom, radius) in [(1.0, 0.3), (1.0, 0.15), (0.1, 0.2)] {
        let look = Look { bloom, bloom_radius: radius, ..Look::default() };
        let found = shown(gpu, &look, &texels);
        let sum = |c: usize| found.iter().map(|f| f[c]).sum::<f64>() / f64::from(lit);
        assert!((sum(0) - 1.0).abs() < 0.01, "energy {} with radius {radius}", sum(0));
        assert!((sum(1) - 0.5).abs() < 0.005 && sum(2) == 0.0, "colours stay: {} {}", sum(1), sum(2));
        if bloom < 1.0 {
            continue;
        }
        let radius_px = f64::from(radius) * f64::from(SIZE[1]);
        let mut worst = 0f64;
        for step in 1..=12 {
            let within = 0.1 * f64::from(step);
            let share: f64 = (0..SIZE[0] * SIZE[1])
                .filter(|i| {
                    let off = [f64::from(i % SIZE[0]) - f64::from(x), f64::from(i / SIZE[0]) - f64::from(y)];
                    off[0].hypot(off[1]) <= within * radius_px
                })
                .map(|i| found[i as usize][0] / f64::from(lit))
                .sum();
            worst = worst.max((share - fit::share_within(within)).abs());
        }
        // What Gaussians whose widths double can do: see `fit`.
        assert!(worst < 0.055, "radius {radius_px} px: the share of light within a radius is off by {worst}");
    }
}

#[test]
fn a_flat_field_stays_flat() {
    let Some(gpu) = gpu() else { return };
    let texels = vec![[0.25, 1.5, 12.0, 1.0]; (SIZE[0] * SIZE[1]) as usize];
    let look = Look { bloom: 0.3, bloom_radius: 0.4, ..Look::default() };
    for found in shown(gpu, &look, &texels) {
        for (f, expected) in found.iter().zip([0.25, 1.5, 12.0]) {
            // Each step rounds to half floats.
            assert!((f / expected - 1.0).abs() < 4e-3, "{found:?}");
        }
    }
}
