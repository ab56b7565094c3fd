//! The recorder of a frame, which every pass receives.

use bytemuck::Pod;

use super::gpu::Gpu;
use super::images::{Image, ImageSpec, Images};
use super::kernel::{Kernel, RasterKernel, Resource};
use super::timer::PassTimer;

/// The commands of a frame so far, its images and its times.
pub(crate) struct Recorder<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) encoder: &'a mut wgpu::CommandEncoder,
    pub(crate) timer: &'a mut PassTimer,
    pub(crate) images: &'a mut Images,
}

/// The attachments that triangles are drawn to.
pub(crate) struct Attachments<'a> {
    pub(crate) colors: Vec<Option<wgpu::RenderPassColorAttachment<'a>>>,
    pub(crate) depth: Option<wgpu::RenderPassDepthStencilAttachment<'a>>,
}

/// A colour attachment with the load operation `load`; the result is stored.
pub(crate) fn color_attachment(
    view: &wgpu::TextureView,
    load: wgpu::LoadOp<wgpu::Color>,
) -> Option<wgpu::RenderPassColorAttachment<'_>> {
    Some(wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
    })
}

/// A depth attachment with the load operation `load`; the result is stored.
pub(crate) fn depth_attachment(
    view: &wgpu::TextureView,
    load: wgpu::LoadOp<f32>,
) -> Option<wgpu::RenderPassDepthStencilAttachment<'_>> {
    Some(wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations { load, store: wgpu::StoreOp::Store }),
        stencil_ops: None,
    })
}

impl Recorder<'_> {
    /// An image of this frame; see [`Images::take`].
    pub(crate) fn image(&mut self, label: &'static str, spec: ImageSpec) -> Image {
        self.images.take(self.gpu, label, spec)
    }

    /// Submits the commands so far; recording continues.
    pub(crate) fn submit(&mut self) -> wgpu::SubmissionIndex {
        let fresh = self.gpu.device.create_command_encoder(&Default::default());
        self.gpu.queue.submit([std::mem::replace(self.encoder, fresh).finish()])
    }

    /// A uniform buffer with contents.
    pub(crate) fn uniform<T: Pod>(&self, label: &str, contents: &T) -> wgpu::Buffer {
        self.gpu.uniform(label, contents)
    }

    /// A compute pass of one dispatch.
    pub(crate) fn dispatch(&mut self, kernel: &Kernel, resources: &[Resource<'_>], workgroups: [u32; 3]) {
        self.dispatch_each(kernel, std::iter::once((resources.to_vec(), workgroups)));
    }

    /// A compute pass with one dispatch per set of resources; no pass if there are none.
    pub(crate) fn dispatch_each<'r>(
        &mut self,
        kernel: &Kernel,
        each: impl IntoIterator<Item = (Vec<Resource<'r>>, [u32; 3])>,
    ) {
        let groups: Vec<_> =
            each.into_iter().map(|(resources, n)| (kernel.bindings.bind(self.gpu, &resources), n)).collect();
        if groups.is_empty() {
            return;
        }
        let mut pass = self.timer.compute(self.gpu, self.encoder, kernel.label);
        pass.set_pipeline(&kernel.pipeline);
        for (groups, [x, y, z]) in &groups {
            for (index, group) in groups.iter().enumerate() {
                pass.set_bind_group(index as u32, group, &[]);
            }
            pass.dispatch_workgroups(*x, *y, *z);
        }
    }

    /// A render pass with one draw per set of resources; it clears even if there are none.
    pub(crate) fn draw_each<'r>(
        &mut self,
        kernel: &RasterKernel,
        attachments: Attachments<'_>,
        each: impl IntoIterator<Item = (Vec<Resource<'r>>, Draw<'r>)>,
    ) {
        let groups: Vec<_> = each
            .into_iter()
            .map(|(resources, draw)| (kernel.bindings.bind(self.gpu, &resources), draw))
            .collect();
        let mut pass =
            self.timer.render(self.gpu, self.encoder, kernel.label, &attachments.colors, attachments.depth);
        pass.set_pipeline(&kernel.pipeline);
        for (groups, draw) in &groups {
            for (index, group) in groups.iter().enumerate() {
                pass.set_bind_group(index as u32, group, &[]);
            }
            match draw {
                Draw::Corners(n) => pass.draw(0..*n, 0..1),
                Draw::Indexed(buffer, n) => {
                    pass.set_index_buffer(buffer.slice(..), wgpu::IndexFormat::Uint32);
                    pass.draw_indexed(0..*n, 0, 0..1);
                }
            }
        }
    }
}

/// The triangles of a draw.
pub(crate) enum Draw<'a> {
    /// Number of corners.
    Corners(u32),
    /// Number of corners, and their index buffer.
    Indexed(&'a wgpu::Buffer, u32),
}
