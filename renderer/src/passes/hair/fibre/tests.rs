use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::reference::radiance;
use super::*;
use crate::device::Kernel;
use crate::device::wgsl::Program;
use crate::testing::{assert_layout, gpu, offsets, read_storage, recorded};

/// Entry point that evaluates the kernel: light and view inclination, azimuth and spread in; radiance out.
const PROBE: Module = Module {
    path: "package::probe",
    source: r"
import package::fibre::fibre_radiance;
@group(0) var<storage, read> angles: array<vec4f>;
@group(0) var<uniform> color: vec4f;
@group(0) var<storage, read_write> found: array<vec4f>;

@compute @workgroup_size(64)
fn probe(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&angles) {
        return;
    }
    let a = angles[id.x];
    let to_light = vec3f(cos(a.x), sin(a.x), 0.0);
    let to_viewer = vec3f(cos(a.y) * cos(a.z), sin(a.y), cos(a.y) * sin(a.z));
    found[id.x] = vec4f(fibre_radiance(vec3f(0.0, 1.0, 0.0), to_light, to_viewer, color.rgb, a.w), 1.0);
}
",
};

const BROWN: [f64; 3] = [0.0186, 0.0115, 0.0066];

#[test]
fn the_light_of_hair_is_laid_out_alike_on_both_sides() {
    assert_layout(
        &crate::passes::hair::cropped_hair::program(),
        "light_hairs",
        "HairLight",
        size_of::<HairLight>(),
        &offsets!(HairLight; environment_intensity as "environment_intensity",
            environment_levels as "environment_levels", environment_turn as "environment_turn", harmonics as "harmonics", lights as "lights"),
    );
}

#[test]
fn the_kernel_is_the_equations() {
    let Some(gpu) = gpu() else { return };
    let mut angles = Vec::new();
    for light in [-1.5f32, -0.8, -0.1, 0.4, 1.2] {
        for view in [-1.4f32, -0.5, 0.0, 0.3, 1.1] {
            for azimuth in [0.0f32, 0.3, 1.6, 2.9, 3.1] {
                angles.push([light, view, azimuth, 0.05]);
            }
        }
    }
    let color = BROWN.map(|c| c as f32);
    let kernel = Kernel::new(gpu, "probe", &Program::new(PROBE).with(&MODULES), "probe");
    let input = gpu.storage("angles", &angles);
    let uniform = gpu.uniform("color", &[color[0], color[1], color[2], 1.0]);
    let output = gpu.storage_zeroed("found", 16 * angles.len() as u64);
    let resources = [("angles", input.bound()), ("color", uniform.bound()), ("found", output.bound())];
    recorded(gpu, |r| r.dispatch(&kernel, &resources, [angles.len().div_ceil(64) as u32, 1, 1]));
    let found: Vec<[f32; 4]> = read_storage(gpu, &output);
    for (a, f) in angles.iter().zip(&found) {
        let [light, view, azimuth, spread] = a.map(f64::from);
        let expected = radiance(light, view, azimuth, color.map(f64::from), spread);
        for c in 0..3 {
            // Arccosines of singles lose half of their digits near opposite directions.
            let bound = 1e-5 + 2e-3 * expected[c];
            assert!((f64::from(f[c]) - expected[c]).abs() < bound, "{a:?}: {f:?}, {expected:?}");
        }
    }
}

/// Power that leaves a length of fibre for unit irradiance across the light, over the power that it intercepts.
fn albedo(light: f64, color: [f64; 3]) -> [f64; 3] {
    const ROWS: u32 = 96;
    const COLUMNS: u32 = 48;
    let (dv, da) = (PI / f64::from(ROWS), TAU / f64::from(COLUMNS));
    let mut sum = [0.0; 3];
    for i in 0..ROWS {
        let view = (f64::from(i) + 0.5) * dv - FRAC_PI_2;
        for k in 0..COLUMNS {
            let l = radiance(light, view, (f64::from(k) + 0.5) * da - PI, color, 0.0);
            // The fibre's width is seen foreshortened by one cosine, the other is that of the solid angle.
            for c in 0..3 {
                sum[c] += l[c] * view.cos().powi(2) * dv * da;
            }
        }
    }
    sum.map(|s| s / light.cos())
}

#[test]
fn a_fibre_reflects_no_more_than_it_gets_and_dark_hair_little() {
    for light in [-1.45, -0.6, 0.0, 0.4, 1.2] {
        let white = albedo(light, [0.9999; 3]);
        assert!(white[0] > 0.3 && white[0] < 1.0, "white hair at {light}: {white:?}");
        let dark = albedo(light, BROWN);
        assert!(dark[0] < 0.5 * white[0] && dark[2] < dark[0], "dark hair at {light}: {dark:?}");
    }
    // Mirrored light is white and does not depend on pigment: most of the light from dark hair.
    let dark = albedo(0.0, BROWN);
    assert!((0.1..0.25).contains(&dark[0]), "{dark:?}");
}

#[test]
fn light_and_viewer_can_change_places() {
    for (a, b, azimuth) in [(0.3, -0.7, 0.5), (1.2, -0.2, 2.5), (-1.0, 0.9, 3.0)] {
        let there = radiance(a, b, azimuth, BROWN, 0.0)[1] / a.cos();
        let back = radiance(b, a, azimuth, BROWN, 0.0)[1] / b.cos();
        assert!((there - back).abs() < 1e-9 * there, "{there} and {back}");
    }
}

/// Inclination at which one channel is brightest when the light comes in at `light`.
fn brightest(light: f64, azimuth: f64, of: impl Fn([f64; 3]) -> f64) -> f64 {
    let angles = (-140..=140).map(|i| f64::from(i) * 0.01);
    let by_light = |a: &f64, b: &f64| {
        let at = |v: f64| of(radiance(light, v, azimuth, BROWN, 0.0));
        at(*a).total_cmp(&at(*b))
    };
    angles.max_by(by_light).expect("there are angles")
}

#[test]
fn the_highlight_leaves_the_mirror_towards_the_root_and_follows_the_light() {
    // Kajiya and Kay's cone is at minus the inclination of the light; scales lean its light towards the root.
    for light in [-0.4, 0.0, 0.3, 0.6] {
        let peak = brightest(light, 0.6, |l| l[2]);
        assert!(peak < -light - 0.02 && peak > -light - 0.2, "light at {light}, peak at {peak}");
    }
    // Light that returns through pigment is redder and leans towards the tip.
    let tint = |view: f64| {
        let l = radiance(0.0, view, 0.0, [0.3, 0.15, 0.06], 0.0);
        l[0] / l[2]
    };
    assert!(tint(0.14) > 1.05 * tint(-0.14), "{} {}", tint(0.14), tint(-0.14));
}

#[test]
fn a_wide_lamp_blurs_the_highlight_and_keeps_its_light() {
    let sum = |spread: f64| -> f64 {
        (-150..=150).map(|i| radiance(0.0, 0.01 * f64::from(i), 0.5, BROWN, spread)[0]).sum()
    };
    let peak = |spread: f64| radiance(0.0, -0.07, 0.5, BROWN, spread)[0];
    assert!(peak(0.2) < 0.85 * peak(0.0));
    assert!((sum(0.2) / sum(0.0) - 1.0).abs() < 0.05);
}
