//! A head of a scene with its buffers of the frame, as passes receive it.

use std::sync::Arc;

use glam::Mat4;
use rubor_rig::face_state::FaceState;

use super::footprint::APPEARANCE_SIZE;
use super::head::HeadOnGpu;
use super::placement::world_from_head;
use super::{HeadInstance, Scene};
use crate::device::{Gpu, Image, ImageSpec};
use crate::passes::bounce::Bouncing;

/// Bytes of the tangent frame of a vertex: normal, occlusion, tangent, sign.
const FRAME_BYTES: u64 = 32;
/// Bytes of a lit hair: ends, motion, light.
pub(crate) const HAIR_BYTES: u64 = 64;

/// A head in a state at a place, with the results of the passes before the view.
#[derive(Clone, Copy)]
pub(crate) struct PosedHead<'a> {
    /// Its number in the ids of visible triangles.
    pub(crate) index: u32,
    pub(crate) head: &'a HeadOnGpu,
    pub(crate) state: &'a FaceState,
    pub(crate) world_from_head: Mat4,
    /// Deformed points, world space, metres; w = ambient visibility.
    pub(crate) positions: &'a wgpu::Buffer,
    /// Those of the previous frame; those of this frame if there is none.
    pub(crate) previous_positions: &'a wgpu::Buffer,
    /// Buffer that keeps the positions of this frame for the next one.
    pub(crate) kept_positions: &'a wgpu::Buffer,
    /// Normal and tangent of each vertex, world space.
    pub(crate) tangent_frames: &'a wgpu::Buffer,
    /// Light from other places of the head at each point, radiance of a white surface.
    pub(crate) bounced: &'a wgpu::Buffer,
    /// Buffers between the steps of it.
    pub(crate) bouncing: &'a Bouncing,
    /// Change of bias, change of scale and neutral mean of hemoglobin.
    pub(crate) blood: &'a Image,
    /// Weight of each wrinkle map, four per layer: an array, whatever its number of layers.
    pub(crate) wrinkle_weights: &'a Image,
    /// Lit hairs of the scalp.
    pub(crate) hairs: &'a wgpu::Buffer,
}

/// The buffers of one head of a scene, kept from frame to frame.
pub(crate) struct Instance {
    pub(crate) positions: wgpu::Buffer,
    pub(crate) previous_positions: wgpu::Buffer,
    pub(crate) tangent_frames: wgpu::Buffer,
    bounced: wgpu::Buffer,
    bouncing: Bouncing,
    blood: Image,
    wrinkle_weights: Image,
    hairs: wgpu::Buffer,
    family: Arc<()>,
    /// Whether no frame has used it yet, so that it has no previous positions.
    pub(crate) is_new: bool,
}

/// Four wrinkle maps have their weights in one layer.
pub(crate) fn wrinkle_layers(wrinkle_maps: u32) -> u32 {
    wrinkle_maps.div_ceil(4).max(1)
}

impl Instance {
    pub(crate) fn new(gpu: &Gpu, head: &HeadOnGpu) -> Self {
        let points = u64::from(head.point_count) * 16;
        let side = [APPEARANCE_SIZE; 2];
        let spec = ImageSpec::storage(side, wgpu::TextureFormat::Rgba8Unorm).layers(layers(head));
        let wrinkle_weights = Image::new(gpu, "wrinkle weights", spec);
        Self {
            positions: gpu.storage_zeroed("positions", points),
            previous_positions: gpu.storage_zeroed("previous positions", points),
            tangent_frames: gpu.storage_zeroed("tangent frames", u64::from(head.vertex_count) * FRAME_BYTES),
            bounced: gpu.storage_zeroed("bounced light", points),
            bouncing: Bouncing::new(gpu, head.point_count),
            blood: Image::new(gpu, "blood", ImageSpec::light(side)),
            wrinkle_weights,
            hairs: gpu.storage_zeroed("hairs", hair_bytes(head)),
            family: head.family.clone(),
            is_new: true,
        }
    }

    /// Whether the buffers fit a head.
    pub(crate) fn fits(&self, head: &HeadOnGpu) -> bool {
        self.positions.size() == (u64::from(head.point_count) * 16).max(16)
            && self.tangent_frames.size() == (u64::from(head.vertex_count) * FRAME_BYTES).max(16)
            && self.wrinkle_weights.texture().depth_or_array_layers() == layers(head)
            && self.hairs.size() == hair_bytes(head).max(16)
    }

    /// Whether it is that of a level of the same head.
    pub(crate) fn is_of(&self, head: &HeadOnGpu) -> bool {
        Arc::ptr_eq(&self.family, &head.family)
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        let buffers =
            [&self.positions, &self.previous_positions, &self.tangent_frames, &self.bounced, &self.hairs];
        buffers.iter().map(|b| b.size()).sum::<u64>()
            + self.bouncing.bytes()
            + self.blood.bytes()
            + self.wrinkle_weights.bytes()
    }
}

/// Bytes that [`Instance::new`] takes for a head.
pub(crate) fn instance_bytes(head: &HeadOnGpu) -> u64 {
    let blood = ImageSpec::light([APPEARANCE_SIZE; 2]);
    let weights =
        ImageSpec::storage([APPEARANCE_SIZE; 2], wgpu::TextureFormat::Rgba8Unorm).layers(layers(head));
    let points = (u64::from(head.point_count) * 16).max(16);
    let frames = (u64::from(head.vertex_count) * FRAME_BYTES).max(16);
    3 * points
        + Bouncing::bytes_of(head.point_count)
        + frames
        + hair_bytes(head).max(16)
        + blood.bytes()
        + weights.bytes()
}

fn hair_bytes(head: &HeadOnGpu) -> u64 {
    u64::from(head.hair_root_count) * HAIR_BYTES
}

fn layers(head: &HeadOnGpu) -> u32 {
    wrinkle_layers(head.maps.as_ref().map_or(0, |m| m.wrinkle_maps))
}

/// The heads of a scene with their buffers; `has_past` if the previous positions are known.
pub(crate) fn posed<'a>(
    scene: &'a Scene<'_>,
    instances: &'a [Instance],
    has_past: bool,
) -> Vec<PosedHead<'a>> {
    let posed = |(index, (placed, buffers)): (usize, (&'a HeadInstance<'_>, &'a Instance))| PosedHead {
        index: index as u32,
        head: placed.head,
        state: placed.state,
        world_from_head: world_from_head(placed),
        positions: &buffers.positions,
        previous_positions: if has_past && !buffers.is_new {
            &buffers.previous_positions
        } else {
            &buffers.positions
        },
        kept_positions: &buffers.previous_positions,
        tangent_frames: &buffers.tangent_frames,
        bounced: &buffers.bounced,
        bouncing: &buffers.bouncing,
        blood: &buffers.blood,
        wrinkle_weights: &buffers.wrinkle_weights,
        hairs: &buffers.hairs,
    };
    scene.heads.iter().zip(instances).enumerate().map(posed).collect()
}
