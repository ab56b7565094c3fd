use rubor_rig::random;

use super::*;
use crate::testing::{gpu, half_image, read_image, recorded};

/// The expected output of the pass, from its definition.
fn composed(
    scattered: [f32; 4],
    albedo: [f32; 4],
    direct: [f32; 4],
    is_seen: bool,
    background: Vec3,
) -> [f64; 4] {
    let rounded = |v: f32| f64::from(half::f16::from_f32(v).to_f32());
    if !is_seen {
        return [background.x, background.y, background.z, 0.0].map(f64::from);
    }
    let color = |c: usize| rounded(scattered[c]) * rounded(albedo[c]) + rounded(direct[c]);
    [color(0), color(1), color(2), 1.0]
}

#[test]
fn diffuse_light_times_albedo_plus_direct_light_stands_before_the_background() {
    let Some(gpu) = gpu() else { return };
    let size = [27, 51];
    let noise = |i: usize, k: u64| random::unit(random::mixed(i as u64 + (k << 32) + 1)) as f32;
    let texels = |k: u64, most: f32| -> Vec<[f32; 4]> {
        (0..27 * 51).map(|i| std::array::from_fn(|c| most * noise(i, k + c as u64))).collect()
    };
    let (scattered, albedo, direct) = (texels(1, 4.0), texels(7, 1.0), texels(13, 30.0));
    let images = [&scattered, &albedo, &direct].map(|t| half_image(gpu, size, t));
    // The pass reads only whether something was drawn: half of the image is cleared to a depth, half to nothing.
    for is_seen in [true, false] {
        let depth = Image::new(gpu, "depth", ImageSpec::attachment(size, wgpu::TextureFormat::Depth32Float));
        let background = Vec3::new(0.1, 0.25, 0.5);
        let hdr = recorded(gpu, |r| {
            let load = wgpu::LoadOp::Clear(if is_seen { 0.01 } else { 0.0 });
            let attachment = crate::device::depth_attachment(depth.view(), load);
            drop(r.timer.render(gpu, r.encoder, "clear", &[], attachment));
            let [scattered, albedo, direct] = &images;
            Compose::new(gpu).record(r, background, [scattered, albedo, direct, &depth], None)
        });
        for (i, found) in read_image::<[half::f16; 4]>(gpu, &hdr).iter().enumerate() {
            let expected = composed(scattered[i], albedo[i], direct[i], is_seen, background);
            for c in 0..4 {
                let error = (f64::from(found[c].to_f32()) - expected[c]).abs();
                // A half keeps 11 bits, and a device may round towards zero.
                assert!(error <= expected[c] / 1024.0 + 1e-7, "pixel {i}: {found:?}, expected {expected:?}");
            }
        }
    }
}
