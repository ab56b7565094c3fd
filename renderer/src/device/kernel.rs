//! Pipelines whose resources are bound by the names that their shaders give them.

use super::gpu::Gpu;
use super::images::Image;
use super::wgsl::{Binding, Program};

/// A resource with the name of the shader variable that it is bound to.
pub(crate) type Resource<'a> = (&'static str, wgpu::BindingResource<'a>);

/// What can be bound.
pub(crate) trait Bind {
    fn bound(&self) -> wgpu::BindingResource<'_>;
}

impl Bind for wgpu::Buffer {
    fn bound(&self) -> wgpu::BindingResource<'_> {
        self.as_entire_binding()
    }
}

impl Bind for wgpu::TextureView {
    fn bound(&self) -> wgpu::BindingResource<'_> {
        wgpu::BindingResource::TextureView(self)
    }
}

impl Bind for wgpu::Sampler {
    fn bound(&self) -> wgpu::BindingResource<'_> {
        wgpu::BindingResource::Sampler(self)
    }
}

impl Bind for Image {
    fn bound(&self) -> wgpu::BindingResource<'_> {
        wgpu::BindingResource::TextureView(self.view())
    }
}

/// The variables of a shader and the layouts of their groups.
pub(crate) struct Bindings {
    label: &'static str,
    names: Vec<Binding>,
    layouts: Vec<wgpu::BindGroupLayout>,
}

/// A compute pipeline.
pub(crate) struct Kernel {
    pub(crate) label: &'static str,
    pub(crate) pipeline: wgpu::ComputePipeline,
    pub(crate) bindings: Bindings,
}

/// A pipeline that rasterises triangle lists without vertex buffers.
pub(crate) struct RasterKernel {
    pub(crate) label: &'static str,
    pub(crate) pipeline: wgpu::RenderPipeline,
    pub(crate) bindings: Bindings,
}

/// Description of a pipeline that rasterises.
pub(crate) struct Raster<'a> {
    pub(crate) label: &'static str,
    pub(crate) program: Program,
    /// Entry points; without a fragment only depth is written.
    pub(crate) vertex: &'a str,
    pub(crate) fragment: Option<&'a str>,
    pub(crate) targets: &'a [Option<wgpu::ColorTargetState>],
    /// Comparison of a fragment's depth with the stored depth; none without a depth attachment.
    pub(crate) nearer: Option<wgpu::CompareFunction>,
    pub(crate) writes_depth: bool,
}

impl Bindings {
    fn new(label: &'static str, names: Vec<Binding>, layout: impl Fn(u32) -> wgpu::BindGroupLayout) -> Self {
        let groups = names.iter().map(|b| b.group + 1).max().unwrap_or(0);
        Self { label, names, layouts: (0..groups).map(layout).collect() }
    }

    /// One bind group per group of the shader. Resources that the shader does not use are left out.
    ///
    /// # Panics
    /// A variable of the shader has no resource. Tests run every pass, so this cannot reach a user.
    pub(crate) fn bind(&self, gpu: &Gpu, resources: &[Resource<'_>]) -> Vec<wgpu::BindGroup> {
        let group = |(group, layout): (usize, &wgpu::BindGroupLayout)| {
            let entries: Vec<_> = self
                .names
                .iter()
                .filter(|b| b.group as usize == group)
                .map(|b| {
                    let found = resources.iter().find(|(name, _)| *name == b.name);
                    let (_, resource) =
                        found.unwrap_or_else(|| panic!("{}: nothing is bound to {}", self.label, b.name));
                    wgpu::BindGroupEntry { binding: b.binding, resource: resource.clone() }
                })
                .collect();
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(self.label),
                layout,
                entries: &entries,
            })
        };
        self.layouts.iter().enumerate().map(group).collect()
    }
}

impl Kernel {
    /// A kernel of one entry point.
    pub(crate) fn new(gpu: &Gpu, label: &'static str, program: &Program, entry: &str) -> Self {
        Self::with_options(gpu, label, program, entry, Default::default())
    }

    /// As [`Kernel::new`], for a shader that writes its workgroup memory before it reads it.
    pub(crate) fn without_clear(gpu: &Gpu, label: &'static str, program: &Program, entry: &str) -> Self {
        let options = wgpu::PipelineCompilationOptions {
            zero_initialize_workgroup_memory: false,
            ..Default::default()
        };
        Self::with_options(gpu, label, program, entry, options)
    }

    fn with_options(
        gpu: &Gpu,
        label: &'static str,
        program: &Program,
        entry: &str,
        compilation_options: wgpu::PipelineCompilationOptions<'_>,
    ) -> Self {
        let linked = program.clone().flag("gathers", gpu.gathers()).link(&[entry], gpu.stores_uniforms);
        let module = gpu.shader(label, &linked.wgsl);
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(label),
            layout: None,
            module: &module,
            entry_point: Some(entry),
            compilation_options,
            cache: None,
        });
        let bindings = Bindings::new(label, linked.bindings, |group| pipeline.get_bind_group_layout(group));
        Self { label, pipeline, bindings }
    }
}

impl RasterKernel {
    /// A pipeline with a vertex and, optionally, a fragment entry point.
    pub(crate) fn new(gpu: &Gpu, raster: &Raster<'_>) -> Self {
        let entries: Vec<&str> = std::iter::once(raster.vertex).chain(raster.fragment).collect();
        let program = raster.program.clone().flag("gathers", gpu.gathers());
        let linked = program.link(&entries, gpu.stores_uniforms);
        let module = gpu.shader(raster.label, &linked.wgsl);
        let fragment = raster.fragment.map(|entry| wgpu::FragmentState {
            module: &module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            targets: raster.targets,
        });
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(raster.label),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some(raster.vertex),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: raster.nearer.map(|nearer| wgpu::DepthStencilState {
                format: wgpu::TextureFormat::Depth32Float,
                depth_write_enabled: Some(raster.writes_depth),
                depth_compare: Some(nearer),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment,
            multiview_mask: None,
            cache: None,
        });
        let bindings =
            Bindings::new(raster.label, linked.bindings, |group| pipeline.get_bind_group_layout(group));
        Self { label: raster.label, pipeline, bindings }
    }
}
