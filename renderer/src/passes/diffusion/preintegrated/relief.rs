//! Maps of slopes as the channels of light see them: blurred by the profile, in millimetres of skin.
//!
//! ```text
//! slopes, wrinkle slopes --copy_map--> sharp layers
//!                        --blur_across, blur_down, one map at a time--> blurred layers --halve_maps--> all levels
//! ```
//!
//! Theory: Lambert's law is linear in the normal where a bump faces the lamp, so light blurred over bumps is light on blurred
//! bumps (Penner and Borshukov 2011, section 1.5; Ma et al. 2007 measured such normals). Slopes are blurred, because
//! those of relief and of wrinkles add. The kernel is the profile's line spread along u and along v: exact for furrows along
//! either, and up to 0.17 too much blur for diagonal ones (a wave of 3 mm keeps 0.27 of its red in place of 0.44),
//! as the product of two line spreads is wider than the profile. The light that leaves in the texel where it enters is
//! left to the sharp map, which is finer.
//!
//! Layers: the wrinkle maps as they are, then for each of them, and last for the relief of the skin, (red, green)
//! and (blue, mean squares of red and green); or one of (red, mean square).
//!
//! Lengths are those of the median of the skin's texture (`mm_per_texture`): where the texture is stretched, the blur is too.

use rubor_rig::skin::profile::Profile;

use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, ImageSpec, Kernel, Recorder, texture};
use crate::passes::pixel_groups;
use crate::scene::PosedHead;

const BLUR: Module = module!("skin_relief", "blur.wesl");
const HALVE: Module = module!("skin_relief_halve", "halve.wesl");

/// Taps on one side of the middle, at most; what goes farther counts as if it went there.
const RADIUS: usize = 128;
/// Narrowest texels that are worth their memory, mm: the narrowest light of skin goes as far, and the sharp map has the
/// rest.
const FINEST_MM: f32 = 0.25;
/// Texels on a side of the maps, at least and at most.
const SIDE: [u32; 2] = [16, 2048];

/// Layers of a blurred map.
pub(super) fn layers_of(by_channel: bool) -> u32 {
    if by_channel { 2 } else { 1 }
}

/// The shader of the passes that blur.
pub(super) fn program(by_channel: bool) -> Program {
    Program::new(BLUR).flag("by_channel", by_channel)
}

/// The shader of the pass that makes levels.
pub(super) fn halve_program() -> Program {
    Program::new(HALVE)
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Params {
    pub(super) size: [u32; 2],
    pub(super) level: f32,
    pub(super) layer: u32,
    pub(super) radius: u32,
    pub(super) target_layer: u32,
    pub(super) has_variance: u32,
    pub(super) padding: u32,
    pub(super) taps: [[f32; 4]; RADIUS + 1],
}

/// The pipelines.
pub(super) struct Relief {
    by_channel: bool,
    copy: Kernel,
    across: Kernel,
    down: Kernel,
    halve: Kernel,
    repeat: wgpu::Sampler,
}

/// The maps of one head.
pub(super) struct BlurredMaps {
    /// Of the maps that were blurred.
    source: [wgpu::TextureView; 2],
    /// An array: see the module.
    pub(super) texture: wgpu::TextureView,
    pub(super) first_blurred: u32,
    pub(super) relief_layer: u32,
    /// Share of the light that stays in its texel, R, G, B.
    pub(super) sharp: [f32; 4],
    bytes: u64,
}

/// The maps that a head's blurred ones are made of; `None` for a head without maps.
pub(super) fn source_of(head: &PosedHead<'_>) -> Option<[wgpu::TextureView; 2]> {
    head.head.maps.as_ref().map(|m| [m.slopes.clone(), m.wrinkles.clone()])
}

/// Weights of whole texels: R, G, B of the middle and of one side, summing to one with both sides: the profile's line
/// spread over each texel. What goes farther than the last counts as if it went there.
fn taps(profile: &Profile, texel_mm: f64, radius: usize) -> Vec<[f64; 3]> {
    let within = |x: f64| profile.channels.each_ref().map(|c| c.line_cdf(x));
    let mut before = [0.0; 3];
    (0..=radius)
        .map(|i| {
            let to = if i == radius { [1.0; 3] } else { within((i as f64 + 0.5) * texel_mm) };
            let share = if i == 0 { 1.0 } else { 0.5 };
            let tap = std::array::from_fn(|c| share * (to[c] - before[c]));
            before = to;
            tap
        })
        .collect()
}

impl BlurredMaps {
    /// What they were made of.
    pub(super) fn source(&self) -> [wgpu::TextureView; 2] {
        self.source.clone()
    }

    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }
}

impl Relief {
    pub(super) fn new(gpu: &Gpu, by_channel: bool) -> Self {
        let kernel = |entry| Kernel::new(gpu, "scatter relief", &program(by_channel), entry);
        Self {
            by_channel,
            copy: kernel("copy_map"),
            across: kernel("blur_across"),
            down: kernel("blur_down"),
            halve: Kernel::new(gpu, "scatter relief", &halve_program(), "halve_maps"),
            repeat: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("blurred relief"),
                address_mode_u: wgpu::AddressMode::Repeat,
                address_mode_v: wgpu::AddressMode::Repeat,
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                ..Default::default()
            }),
        }
    }

    /// Blurs the maps of a head; `None` for a head without maps.
    pub(super) fn blurred(
        &self,
        r: &mut Recorder<'_>,
        head: &PosedHead<'_>,
        profile: &Profile,
        reach_mm: f64,
    ) -> Option<BlurredMaps> {
        let maps = head.head.maps.as_ref()?;
        let sizes = [&maps.slopes, &maps.wrinkles].map(|v| [v.texture().width(), v.texture().height()]);
        let mm = head.head.mm_per_texture;
        // As fine as wrinkles, which are drawn from here, and as fine as the relief where that is worth it.
        let side = |axis: usize| {
            let worth = (mm / FINEST_MM).max(1.0) as u32;
            let relief = sizes[0][axis].min(worth.next_power_of_two());
            relief.max(sizes[1][axis]).clamp(SIDE[0], SIDE[1])
        };
        let size = [side(0), side(1)];
        let texel_mm = f64::from(mm) / f64::from(size[0]);
        let reach = (reach_mm / texel_mm).ceil() as usize;
        let radius = reach.clamp(1, RADIUS.min(size[0].min(size[1]) as usize - 1));
        let taps = taps(profile, texel_mm, radius);
        let sharp = std::array::from_fn(|c| if c < 3 { (taps[0][c] * taps[0][c]) as f32 } else { 0.0 });

        let per_map = layers_of(self.by_channel);
        let first_blurred = maps.wrinkle_maps.max(1);
        let relief_layer = first_blurred + per_map * maps.wrinkle_maps;
        let array = array(r.gpu, size, relief_layer + per_map);
        let level_of = |level: u32| level_view(&array, level);
        let whole = level_of(0);
        let sources = [&maps.slopes, &maps.wrinkles].map(texture::array_view);
        let mut params = Params {
            size,
            level: 0.0,
            layer: 0,
            radius: radius as u32,
            target_layer: 0,
            has_variance: 0,
            padding: 0,
            taps: [[0.0; 4]; RADIUS + 1],
        };
        for (to, from) in params.taps.iter_mut().zip(&taps) {
            *to = [from[0] as f32, from[1] as f32, from[2] as f32, 0.0];
        }
        let level = |source: usize| (sizes[source][0] as f32 / size[0] as f32).max(1.0).log2();
        let [first, second] =
            ["blurred across", "blurred across, blue"].map(|l| r.image(l, ImageSpec::light(size)));
        let groups = pixel_groups(size);
        // Layer of a source, and where its result goes.
        let wrinkles = (0..maps.wrinkle_maps).map(|i| (1, i, first_blurred + per_map * i));
        for (source, layer, target_layer) in wrinkles.chain([(0, 0, relief_layer)]) {
            let blur = Params { level: level(source), layer, target_layer, ..params };
            let blur = Params { has_variance: u32::from(source == 0), ..blur };
            if source == 1 {
                let copy = r.uniform("copied map", &Params { target_layer: layer, ..blur });
                let resources = [
                    ("params", copy.bound()),
                    ("source", sources[1].bound()),
                    ("repeat", self.repeat.bound()),
                    ("maps_out", whole.bound()),
                ];
                r.dispatch(&self.copy, &resources, groups);
            }
            let blur = r.uniform("blurred map", &blur);
            let resources = [
                ("params", blur.bound()),
                ("source", sources[source].bound()),
                ("repeat", self.repeat.bound()),
                ("first_out", first.bound()),
                ("second_out", second.bound()),
                ("blurred_first", first.bound()),
                ("blurred_second", second.bound()),
                ("maps_out", whole.bound()),
            ];
            r.dispatch(&self.across, &resources, groups);
            r.dispatch(&self.down, &resources, groups);
        }
        for to in 1..array.mip_level_count() {
            let side = size.map(|n| (n >> to).max(1));
            let [x, y, _] = pixel_groups(side);
            let views = [level_of(to - 1), level_of(to)];
            let resources = [("finer", views[0].bound()), ("coarser", views[1].bound())];
            r.dispatch(&self.halve, &resources, [x, y, array.depth_or_array_layers()]);
        }
        let bytes = (0..array.mip_level_count())
            .map(|l| size.iter().map(|n| u64::from((n >> l).max(1))).product::<u64>())
            .sum::<u64>()
            * 8
            * u64::from(array.depth_or_array_layers());
        Some(BlurredMaps {
            source: [maps.slopes.clone(), maps.wrinkles.clone()],
            texture: texture::array_view_of(&array),
            first_blurred,
            relief_layer,
            sharp,
            bytes,
        })
    }
}

fn array(gpu: &Gpu, size: [u32; 2], layers: u32) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("blurred relief"),
        size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: layers },
        mip_level_count: size[0].max(size[1]).ilog2() + 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba16Float,
        usage: wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

fn level_view(array: &wgpu::Texture, level: u32) -> wgpu::TextureView {
    array.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        base_mip_level: level,
        mip_level_count: Some(1),
        ..Default::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taps_hold_the_light_of_their_texels() {
        let profile = Profile::deon_six();
        for (texel_mm, radius) in [(0.1, 60), (0.4, 20), (2.0, 1)] {
            let taps = taps(&profile, texel_mm, radius);
            for (c, channel) in profile.channels.iter().enumerate() {
                let up_to = |n: usize| taps[0][c] + 2.0 * taps[1..=n].iter().map(|t| t[c]).sum::<f64>();
                assert!((up_to(radius) - 1.0).abs() < 1e-9);
                let inside = channel.line_cdf((radius as f64 - 0.5) * texel_mm);
                assert!((up_to(radius - 1) - inside).abs() < 1e-9, "{texel_mm} mm, channel {c}");
            }
        }
    }
}
