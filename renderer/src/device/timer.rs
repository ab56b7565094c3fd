//! GPU time of passes, by timestamps that the device writes at their beginning and end.

use super::gpu::Gpu;
use super::readback::{Coming, Mapped, Readback};
use crate::error::RenderError;

/// Milliseconds of one frame on the GPU.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameTimes {
    /// Each pass, in order; a pass that runs several times per frame is listed as often.
    pub passes_ms: Vec<(&'static str, f64)>,
    /// From the beginning of the first pass to the end of the last.
    pub frame_ms: f64,
}

/// Times the passes of frames; query sets are added as frames need them, so none is lost.
#[derive(Default)]
pub struct PassTimer {
    /// Sets of timestamps and the buffers that they are resolved into.
    sets: Vec<(wgpu::QuerySet, wgpu::Buffer)>,
    names: Vec<&'static str>,
}

/// The times of a recorded frame.
pub struct PendingTimes(Ticks<Readback>);

/// Times as ticks in a [`Readback`], [`Coming`] or [`Mapped`] buffer.
pub(crate) struct Ticks<B> {
    names: Vec<&'static str>,
    ticks: Option<B>,
    period_ns: f64,
}

/// Number of passes per query set.
const PASSES_PER_SET: usize = 64;
/// Bytes per timed pass: two timestamps.
const PASS_BYTES: u64 = 16;

impl PassTimer {
    /// Forgets the last frame.
    pub fn restart(&mut self) {
        self.names.clear();
    }

    /// The set and the first query of the next pass; `None` on a device without timestamps.
    fn next(&mut self, gpu: &Gpu, name: &'static str) -> Option<(&wgpu::QuerySet, u32)> {
        if !gpu.has_timestamps {
            return None;
        }
        let (set, place) = (self.names.len() / PASSES_PER_SET, self.names.len() % PASSES_PER_SET);
        self.names.push(name);
        if set == self.sets.len() {
            let queries = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("pass times"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * PASSES_PER_SET as u32,
            });
            let resolved = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("pass times"),
                size: PASS_BYTES * PASSES_PER_SET as u64,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            });
            self.sets.push((queries, resolved));
        }
        Some((&self.sets[set].0, 2 * place as u32))
    }

    /// Begins a timed compute pass.
    pub fn compute<'e>(
        &mut self,
        gpu: &Gpu,
        encoder: &'e mut wgpu::CommandEncoder,
        name: &'static str,
    ) -> wgpu::ComputePass<'e> {
        let timestamp_writes = self.next(gpu, name).map(|(query_set, i)| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(i),
            end_of_pass_write_index: Some(i + 1),
        });
        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes })
    }

    /// Begins a timed render pass.
    pub fn render<'e>(
        &mut self,
        gpu: &Gpu,
        encoder: &'e mut wgpu::CommandEncoder,
        name: &'static str,
        color: &[Option<wgpu::RenderPassColorAttachment<'_>>],
        depth: Option<wgpu::RenderPassDepthStencilAttachment<'_>>,
    ) -> wgpu::RenderPass<'e> {
        let timestamp_writes = self.next(gpu, name).map(|(query_set, i)| wgpu::RenderPassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(i),
            end_of_pass_write_index: Some(i + 1),
        });
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(name),
            color_attachments: color,
            depth_stencil_attachment: depth,
            timestamp_writes,
            ..Default::default()
        })
    }

    /// Copies the times of the passes so far to a buffer that the host can read; the last command of a
    /// frame's encoder.
    pub fn finish(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> PendingTimes {
        let total = self.names.len();
        let ticks = (total > 0).then(|| {
            let readback = Readback::new(gpu, "pass times", PASS_BYTES * total as u64);
            for (i, (set, resolved)) in self.sets.iter().enumerate() {
                let first = i * PASSES_PER_SET;
                let count = total.saturating_sub(first).min(PASSES_PER_SET);
                if count > 0 {
                    encoder.resolve_query_set(set, 0..2 * count as u32, resolved, 0);
                    let (at, bytes) = (PASS_BYTES * first as u64, PASS_BYTES * count as u64);
                    encoder.copy_buffer_to_buffer(resolved, 0, readback.buffer(), at, bytes);
                }
            }
            readback
        });
        let period_ns = f64::from(gpu.queue.get_timestamp_period());
        PendingTimes(Ticks { names: self.names.clone(), ticks, period_ns })
    }
}

impl PendingTimes {
    /// Asks for the times; the frame must have been submitted.
    pub(crate) fn ask(self) -> Ticks<Coming> {
        let Ticks { names, ticks, period_ns } = self.0;
        Ticks { names, ticks: ticks.map(Readback::ask), period_ns }
    }

    /// The times, once the device is done with the frame; no passes on a device without timestamps.
    ///
    /// # Errors
    /// The device failed.
    pub async fn read(self) -> Result<FrameTimes, RenderError> {
        self.ask().arrive().await?.times()
    }
}

impl Ticks<Coming> {
    /// Waits for them.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) async fn arrive(self) -> Result<Ticks<Mapped>, RenderError> {
        let ticks = match self.ticks {
            Some(ticks) => Some(ticks.arrive().await?),
            None => None,
        };
        Ok(Ticks { names: self.names, ticks, period_ns: self.period_ns })
    }
}

impl Ticks<Mapped> {
    /// The times; no passes on a device without timestamps.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) fn times(self) -> Result<FrameTimes, RenderError> {
        let Some(ticks) = self.ticks else { return Ok(FrameTimes::default()) };
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&ticks.bytes()?);
        let ms = |ticks: u64| ticks as f64 * self.period_ns * 1e-6;
        let pairs = ticks.chunks_exact(2);
        let first = pairs.clone().map(|t| t[0]).min().unwrap_or(0);
        let last = pairs.clone().map(|t| t[1]).max().unwrap_or(0);
        let passes = pairs.map(|t| ms(t[1].saturating_sub(t[0])));
        Ok(FrameTimes {
            passes_ms: self.names.iter().copied().zip(passes).collect(),
            frame_ms: ms(last.saturating_sub(first)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::native;
    use crate::testing::gpu;

    #[test]
    fn no_pass_is_lost_however_many_there_are() {
        let Some(gpu) = gpu() else { return };
        if !gpu.has_timestamps {
            crate::testing::skipped("this device has no timestamps");
            return;
        }
        let mut timer = PassTimer::default();
        for count in [0, 1, PASSES_PER_SET, 2 * PASSES_PER_SET + 22] {
            timer.restart();
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            for i in 0..count {
                drop(timer.compute(gpu, &mut encoder, if i % 2 == 0 { "even" } else { "odd" }));
            }
            let pending = timer.finish(gpu, &mut encoder);
            gpu.queue.submit([encoder.finish()]);
            let times = native::wait(gpu, pending.read()).expect("times come back");
            assert_eq!(times.passes_ms.len(), count);
            assert_eq!(times.passes_ms.iter().filter(|(name, _)| *name == "odd").count(), count / 2);
            assert!(times.passes_ms.iter().all(|(_, ms)| *ms < 1e4), "{times:?}");
        }
    }
}
