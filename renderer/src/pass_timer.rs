//! GPU time of passes, by timestamps that the device writes at their beginning and end.

use crate::error::RenderError;
use crate::gpu::Gpu;

/// GPU time of each pass of one frame.
pub struct PassTimer {
    queries: Option<(wgpu::QuerySet, wgpu::Buffer)>,
    names: Vec<&'static str>,
}

/// Milliseconds of one frame on the GPU.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameTimes {
    /// Each pass, in order; a pass that runs several times a frame is there several times.
    pub passes_ms: Vec<(&'static str, f64)>,
    /// From the beginning of the first pass to the end of the last.
    pub frame_ms: f64,
}

/// Times of several frames, kept on the device until all are drawn: reading them back in between would let the GPU
/// rest, and its clock with it.
pub(crate) struct FrameLog {
    ticks: wgpu::Buffer,
    frames: Vec<Vec<&'static str>>,
    capacity: u64,
}

/// Passes that one frame can time.
const TIMED_PASSES: u32 = 64;
/// Bytes of the times of a frame: two ticks of eight bytes a pass.
const FRAME_BYTES: u64 = TIMED_PASSES as u64 * 16;

impl PassTimer {
    /// A timer; it measures nothing on a device without timestamps.
    pub fn new(gpu: &Gpu) -> Self {
        let queries = gpu.has_timestamps.then(|| {
            let set = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("pass times"),
                ty: wgpu::QueryType::Timestamp,
                count: TIMED_PASSES * 2,
            });
            let resolved = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("pass times"),
                size: FRAME_BYTES,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            });
            (set, resolved)
        });
        Self { queries, names: Vec::new() }
    }

    /// Forgets the last frame.
    pub fn restart(&mut self) {
        self.names.clear();
    }

    fn next(&mut self, name: &'static str) -> Option<(&wgpu::QuerySet, u32)> {
        let (set, _) = self.queries.as_ref()?;
        let i = self.names.len() as u32;
        if i >= TIMED_PASSES {
            return None;
        }
        self.names.push(name);
        Some((set, i * 2))
    }

    /// Begins a timed compute pass.
    pub fn compute<'e>(
        &mut self,
        encoder: &'e mut wgpu::CommandEncoder,
        name: &'static str,
    ) -> wgpu::ComputePass<'e> {
        let timestamp_writes = self.next(name).map(|(query_set, i)| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(i),
            end_of_pass_write_index: Some(i + 1),
        });
        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes })
    }

    /// Begins a timed render pass.
    pub fn render<'e>(
        &mut self,
        encoder: &'e mut wgpu::CommandEncoder,
        name: &'static str,
        color: &[Option<wgpu::RenderPassColorAttachment<'_>>],
        depth: Option<wgpu::RenderPassDepthStencilAttachment<'_>>,
    ) -> wgpu::RenderPass<'e> {
        let timestamp_writes = self.next(name).map(|(query_set, i)| wgpu::RenderPassTimestampWrites {
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

    /// Writes the times where [`PassTimer::read`] finds them; the last thing in a frame's encoder.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some((set, resolved)) = &self.queries
            && !self.names.is_empty()
        {
            encoder.resolve_query_set(set, 0..self.names.len() as u32 * 2, resolved, 0);
        }
    }

    /// Copies the resolved times of a frame into a log, unless that is full.
    pub(crate) fn append(&self, encoder: &mut wgpu::CommandEncoder, log: &mut FrameLog) {
        let Some((_, resolved)) = &self.queries else { return };
        let frame = log.frames.len() as u64;
        if frame < log.capacity {
            encoder.copy_buffer_to_buffer(resolved, 0, &log.ticks, frame * FRAME_BYTES, FRAME_BYTES);
            log.frames.push(self.names.clone());
        }
    }

    /// Milliseconds of each pass of the last submitted frame, in order; empty without timestamps.
    ///
    /// # Errors
    /// The device failed.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<(&'static str, f64)>, RenderError> {
        let Some((_, resolved)) = &self.queries else { return Ok(Vec::new()) };
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&gpu.read_buffer(resolved)?);
        Ok(times(gpu, &self.names, &ticks).passes_ms)
    }
}

impl FrameLog {
    /// A log for `frames` frames.
    pub(crate) fn new(gpu: &Gpu, frames: u32) -> Self {
        let capacity = u64::from(frames);
        Self { ticks: gpu.storage_zeroed("frame log", capacity * FRAME_BYTES), frames: Vec::new(), capacity }
    }

    /// Times of the frames; waits for the device. Empty without timestamps.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) fn read(&self, gpu: &Gpu) -> Result<Vec<FrameTimes>, RenderError> {
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&gpu.read_buffer(&self.ticks)?);
        let of_frames = self.frames.iter().zip(ticks.chunks(2 * TIMED_PASSES as usize));
        Ok(of_frames.map(|(names, ticks)| times(gpu, names, ticks)).collect())
    }
}

fn times(gpu: &Gpu, names: &[&'static str], ticks: &[u64]) -> FrameTimes {
    let ms = |ticks: u64| ticks as f64 * f64::from(gpu.queue.get_timestamp_period()) * 1e-6;
    let pairs = ticks.chunks_exact(2).take(names.len());
    let first = pairs.clone().map(|t| t[0]).min().unwrap_or(0);
    let last = pairs.clone().map(|t| t[1]).max().unwrap_or(0);
    let passes = pairs.map(|t| ms(t[1].saturating_sub(t[0])));
    FrameTimes {
        passes_ms: names.iter().copied().zip(passes).collect(),
        frame_ms: ms(last.saturating_sub(first)),
    }
}
