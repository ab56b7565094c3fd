//! A frame with the integral over the surface in place of a method that draws in one go.
//!
//! The stages are those of [`super::realtime`]; between them the deformed surface is read back by the host, which
//! chooses samples, and batches are submitted one at a time.

use glam::Vec3;

use super::Frame;
use super::stages::Samples;
use crate::device::readback::Readback;
use crate::device::{Image, Recorder};
use crate::error::RenderError;
use crate::passes::diffusion::surface::{BATCH, Skin, Surface, relative_noise};
use crate::passes::shade::Lighting;
use crate::scene::PosedHead;
use crate::scene::head::GpuVertex;

/// Draws a frame with `batches` batches of samples per head. Returns the picture and the relative standard error of the
/// diffuse light.
///
/// # Errors
/// The device failed, or the antialiasing lacks an input.
pub(crate) async fn draw(
    r: &mut Recorder<'_>,
    frame: &mut Frame<'_>,
    batches: u32,
) -> Result<(Option<Image>, Option<f64>), RenderError> {
    frame.pose(r);
    let light = frame.light(r);
    let copies: Vec<_> = frame.heads.iter().map(|head| Copies::record(r, head)).collect();
    r.submit();
    let size = frame.settings.frame_size();
    let camera = &frame.scene.camera;
    let clip_from_world = camera.clip_from_view(size[0] as f32 / size[1] as f32) * camera.view_from_world();
    let mut skins = Vec::new();
    for (copies, head) in copies.into_iter().zip(&frame.heads) {
        let (triangles, point_of_vertex, points) = copies.read().await?;
        let opaque = &triangles[..head.head.opaque_triangles as usize];
        skins.push(Skin::new(opaque, &point_of_vertex, &points, &clip_from_world));
    }

    let mut noise = None;
    let mut samples = Samples::default();
    for subsample in frame.subsamples() {
        let seen = frame.see(r, subsample);
        let lit = frame.shade(r, &light, &seen, &samples, None);
        let integral = Surface::new(r.gpu, &frame.settings.quality.profile, size);
        let lighting = Lighting {
            light: &light,
            seen: &seen,
            first: None,
            transmittance: None,
            quality: &frame.settings.quality,
            skin_light: None,
        };
        for (head, skin) in frame.heads.iter().zip(&skins) {
            for batch in 0..batches {
                integral.record_batch(r, (&seen, &lit), (head.index, skin), batch, &|r, samples, light| {
                    frame.passes.shade.record_samples(r, &lighting, head, [samples, light], BATCH as u32);
                });
                // One batch at a time in memory.
                r.submit();
                r.gpu.idle().await?;
            }
        }
        let diffuse = integral.record_finish(r, &seen, &lit);
        let sums = integral.read_sums(r);
        r.submit();
        noise = relative_noise(sums).await?;
        frame.show(r, &light, seen, lit, &diffuse, &mut samples);
    }
    Ok((frame.antialias(r, samples)?, noise))
}

/// The surface of a head, being read back.
struct Copies {
    triangles: Readback,
    vertices: Readback,
    positions: Readback,
}

impl Copies {
    fn record(r: &mut Recorder<'_>, head: &PosedHead<'_>) -> Self {
        let mut copy = |buffer: &wgpu::Buffer| Readback::of_buffer(r.gpu, r.encoder, buffer);
        Self {
            triangles: copy(&head.head.triangles),
            vertices: copy(&head.head.vertices),
            positions: copy(head.positions),
        }
    }

    /// Triangles with their materials, the point of each vertex, and the deformed points.
    async fn read(self) -> Result<(Vec<[u32; 4]>, Vec<u32>, Vec<Vec3>), RenderError> {
        let triangles = bytemuck::pod_collect_to_vec(&self.triangles.read().await?);
        let vertices: Vec<GpuVertex> = bytemuck::pod_collect_to_vec(&self.vertices.read().await?);
        let points: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&self.positions.read().await?);
        let point_of_vertex = vertices.iter().map(|v| v.point).collect();
        Ok((triangles, point_of_vertex, points.into_iter().map(|p| Vec3::new(p[0], p[1], p[2])).collect()))
    }
}
