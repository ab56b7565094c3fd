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
use crate::passes::diffusion::surface::{BATCH, Part, Skin, Surface, relative_noise};
use crate::passes::shade::Lighting;
use crate::scene::PosedHead;
use crate::scene::head::GpuVertex;
use crate::scene::lamp::{GpuLight, Illumination};

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
    let mut light = frame.light(r);
    frame.bounce(r, &mut light);
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
        let integral = Surface::new(r.gpu, &frame.settings.quality, size)?;
        integral.record_normals(r, &seen, &frame.heads);
        let lights = if integral.is_directional() { one_by_one(&light) } else { Vec::new() };
        let lighting = |light| Lighting {
            light,
            seen: &seen,
            first: None,
            transmittance: None,
            quality: &frame.settings.quality,
            skin_light: None,
        };
        let lit_alone: Vec<_> = lights
            .iter()
            .map(|(l, _)| frame.passes.shade.record(r, &lighting(l), &frame.heads, None))
            .collect();
        let mut parts = vec![(&light, Part { lit: &lit, lamp: None, index: [0, 1] })];
        if integral.is_directional() {
            let count = lights.len() as u32;
            parts = (lights.iter().zip(&lit_alone).zip(0..))
                .map(|(((l, lamp), lit), i)| (l, Part { lit, lamp: lamp.as_ref(), index: [i, count] }))
                .collect();
        }
        for (head, skin) in frame.heads.iter().zip(&skins) {
            for batch in 0..batches {
                for (light, part) in &parts {
                    integral.record_batch(
                        r,
                        (&seen, *part),
                        (head.index, skin),
                        batch,
                        &|r, samples, sample_light| {
                            let buffers = [samples, sample_light];
                            let shade = &frame.passes.shade;
                            shade.record_samples(r, &lighting(light), head, buffers, BATCH as u32);
                        },
                    );
                }
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

/// Each lamp by itself, and the sky by itself.
fn one_by_one<'a>(all: &Illumination<'a>) -> Vec<(Illumination<'a>, Option<GpuLight>)> {
    let dark = |intensity| Illumination {
        lights: all.lights.map(|l| GpuLight { color: [0.0, 0.0, 0.0, l.color[3]], ..l }),
        shadows: all.shadows.clone(),
        environment: all.environment,
        environment_intensity: intensity,
        environment_rotation: all.environment_rotation,
        bounces: false,
    };
    let shining = all.lights.iter().enumerate().filter(|(_, l)| l.color[..3].iter().any(|c| *c > 0.0));
    let mut parts: Vec<_> = shining
        .map(|(i, lamp)| {
            let mut alone = dark(0.0);
            alone.lights[i] = *lamp;
            (alone, Some(*lamp))
        })
        .collect();
    // At least one, as the last light of a batch ends it.
    if parts.is_empty() || (all.environment.is_some() && all.environment_intensity > 0.0) {
        parts.push((dark(all.environment_intensity), None));
    }
    // It counts once.
    parts[0].0.bounces = all.bounces;
    parts
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
