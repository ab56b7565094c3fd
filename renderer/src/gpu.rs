//! The device: choosing an adapter, building pipelines and buffers, timing passes, reading images back.

use std::sync::{Arc, Mutex};

use bytemuck::Pod;
use wgpu::util::DeviceExt;

use crate::error::RenderError;

/// An open device with its queue.
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Name, driver, backend.
    pub info: wgpu::AdapterInfo,
    /// True when passes can be timed.
    pub has_timestamps: bool,
    failure: Arc<Mutex<Option<String>>>,
}

/// An adapter as `rubor adapters` lists it.
#[derive(Clone, Debug, serde::Serialize)]
pub struct AdapterDescription {
    /// Position in the list; `--adapter 0` takes the first.
    pub index: usize,
    /// Name given by the driver.
    pub name: String,
    /// Vulkan, Metal or Dx12.
    pub backend: String,
    /// Discrete, integrated, virtual or CPU.
    pub kind: String,
    /// Driver and its version.
    pub driver: String,
    /// Longest side of an image, pixels.
    pub max_image_size: u32,
    /// True when `--stats` can time each pass.
    pub has_timestamps: bool,
}

fn instance() -> wgpu::Instance {
    wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env())
}

fn adapters() -> Vec<wgpu::Adapter> {
    let mut found = pollster::block_on(instance().enumerate_adapters(wgpu::Backends::all()));
    // Real GPUs first; the order among equals is the driver's.
    found.sort_by_key(|a| match a.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    found
}

fn describe(index: usize, adapter: &wgpu::Adapter) -> AdapterDescription {
    let info = adapter.get_info();
    AdapterDescription {
        index,
        name: info.name.clone(),
        backend: format!("{:?}", info.backend),
        kind: format!("{:?}", info.device_type),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        max_image_size: adapter.limits().max_texture_dimension_2d,
        has_timestamps: adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY),
    }
}

/// All adapters of this machine, best first.
pub fn list_adapters() -> Vec<AdapterDescription> {
    adapters().iter().enumerate().map(|(i, a)| describe(i, a)).collect()
}

/// What pipelines that rasterise differ in.
pub(crate) struct Raster<'a> {
    pub(crate) label: &'a str,
    pub(crate) wgsl: &'a str,
    /// Entry points; without a fragment only depth is written.
    pub(crate) vertex: &'a str,
    pub(crate) fragment: Option<&'a str>,
    pub(crate) targets: &'a [Option<wgpu::ColorTargetState>],
    /// What depth has to be, compared with the one that is there.
    pub(crate) nearer: wgpu::CompareFunction,
    pub(crate) writes_depth: bool,
}

/// Features that are used where the adapter has them; nothing needs them.
const WELCOME_FEATURES: wgpu::Features =
    wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::PRIMITIVE_INDEX);

impl Gpu {
    /// Opens the best adapter, or the one whose index or part of whose name (any letter case) is `wanted`.
    ///
    /// # Errors
    /// No adapter, none of that name, or the driver refuses.
    pub fn new(wanted: Option<&str>) -> Result<Self, RenderError> {
        let all = adapters();
        if all.is_empty() {
            return Err(RenderError::NoAdapter);
        }
        let chosen = match wanted {
            None => Some(0),
            Some(w) => w.parse::<usize>().ok().filter(|i| *i < all.len()).or_else(|| {
                let w = w.to_lowercase();
                all.iter().position(|a| a.get_info().name.to_lowercase().contains(&w))
            }),
        };
        let Some(adapter) = chosen.map(|i| &all[i]) else {
            return Err(RenderError::UnknownAdapter {
                wanted: wanted.unwrap_or_default().to_owned(),
                found: all.iter().enumerate().map(|(i, a)| format!("{i}: {}", a.get_info().name)).collect(),
            });
        };
        Self::open(adapter)
    }

    fn open(adapter: &wgpu::Adapter) -> Result<Self, RenderError> {
        let info = adapter.get_info();
        let has_timestamps = adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let most = adapter.limits();
        // WebGPU's defaults, but images and buffers as large as the adapter can hold.
        let required_limits = wgpu::Limits {
            max_texture_dimension_2d: most.max_texture_dimension_2d,
            max_buffer_size: most.max_buffer_size,
            max_storage_buffer_binding_size: most.max_storage_buffer_binding_size,
            ..wgpu::Limits::default()
        };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("rubor"),
            required_features: adapter.features() & WELCOME_FEATURES,
            required_limits,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|e| RenderError::Device { adapter: info.name.clone(), reason: e.to_string() })?;
        let failure = Arc::new(Mutex::new(None));
        let seen = failure.clone();
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            if let Ok(mut slot) = seen.lock() {
                slot.get_or_insert_with(|| e.to_string());
            }
        }));
        Ok(Self { device, queue, info, has_timestamps, failure })
    }

    /// The first error that the device reported since the last call.
    ///
    /// # Errors
    /// That error.
    pub fn check(&self) -> Result<(), RenderError> {
        match self.failure.lock().ok().and_then(|mut slot| slot.take()) {
            Some(message) => Err(RenderError::Lost(message)),
            None => Ok(()),
        }
    }

    /// Waits until the device has done a submission, or all of them.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) fn wait(&self, submission: Option<wgpu::SubmissionIndex>) -> Result<(), RenderError> {
        let wait = wgpu::PollType::Wait { submission_index: submission, timeout: None };
        self.device.poll(wait).map_err(|e| RenderError::Lost(e.to_string()))?;
        self.check()
    }

    /// A compute pipeline whose bindings are those that the shader declares.
    pub fn compute_pipeline(&self, label: &str, wgsl: &str, entry: &str) -> wgpu::ComputePipeline {
        let module = self.shader(label, wgsl);
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(label),
            layout: None,
            module: &module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            cache: None,
        })
    }

    /// As [`Gpu::compute_pipeline`], for a shader that writes its workgroup memory before it reads it.
    pub fn compute_pipeline_without_clear(
        &self,
        label: &str,
        wgsl: &str,
        entry: &str,
    ) -> wgpu::ComputePipeline {
        let module = self.shader(label, wgsl);
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(label),
            layout: None,
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions {
                zero_initialize_workgroup_memory: false,
                ..Default::default()
            },
            cache: None,
        })
    }

    /// A pipeline that rasterises triangle lists without vertex buffers, whose bindings are those that the shader
    /// declares.
    pub(crate) fn raster_pipeline(&self, raster: &Raster<'_>) -> wgpu::RenderPipeline {
        let module = self.shader(raster.label, raster.wgsl);
        let fragment = raster.fragment.map(|entry| wgpu::FragmentState {
            module: &module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            targets: raster.targets,
        });
        self.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(raster.label),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some(raster.vertex),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: wgpu::TextureFormat::Depth32Float,
                depth_write_enabled: Some(raster.writes_depth),
                depth_compare: Some(raster.nearer),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment,
            multiview_mask: None,
            cache: None,
        })
    }

    /// A shader module from WGSL.
    pub fn shader(&self, label: &str, wgsl: &str) -> wgpu::ShaderModule {
        self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Wgsl(wgsl.into()),
        })
    }

    /// A bind group for group `group` of a compute pipeline: resources in the order of their binding numbers 0, 1, ...
    pub fn bind(
        &self,
        label: &str,
        pipeline: &wgpu::ComputePipeline,
        group: u32,
        resources: &[wgpu::BindingResource<'_>],
    ) -> wgpu::BindGroup {
        self.bind_layout(label, &pipeline.get_bind_group_layout(group), resources)
    }

    /// A bind group of a layout: resources in the order of their binding numbers 0, 1, ...
    pub fn bind_layout(
        &self,
        label: &str,
        layout: &wgpu::BindGroupLayout,
        resources: &[wgpu::BindingResource<'_>],
    ) -> wgpu::BindGroup {
        let entries: Vec<_> = resources
            .iter()
            .enumerate()
            .map(|(i, r)| wgpu::BindGroupEntry { binding: i as u32, resource: r.clone() })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(label),
            layout,
            entries: &entries,
        })
    }

    /// A storage buffer with contents. An empty slice gives one zeroed element, as empty bindings are not allowed.
    pub fn storage<T: Pod>(&self, label: &str, contents: &[T]) -> wgpu::Buffer {
        let zero = [T::zeroed()];
        let contents = if contents.is_empty() { &zero[..] } else { contents };
        self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents: bytemuck::cast_slice(contents),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
        })
    }

    /// A storage buffer of `bytes` zeros.
    pub fn storage_zeroed(&self, label: &str, bytes: u64) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes.max(16).next_multiple_of(16),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        })
    }

    /// A uniform buffer with contents.
    pub fn uniform<T: Pod>(&self, label: &str, contents: &T) -> wgpu::Buffer {
        self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents: bytemuck::bytes_of(contents),
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        })
    }

    /// A 2D texture of one level that passes write and read.
    pub fn target(
        &self,
        label: &str,
        size: [u32; 2],
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> wgpu::Texture {
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        })
    }

    /// Bytes of a buffer; waits for the device.
    ///
    /// # Errors
    /// The device failed.
    pub fn read_buffer(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, RenderError> {
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size: buffer.size(),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
        self.queue.submit([encoder.finish()]);
        self.read_mapped(&staging)
    }

    /// Texels of level 0 of a 2D texture, rows tightly packed; waits for the device.
    ///
    /// # Errors
    /// The device failed.
    pub fn read_texture(&self, texture: &wgpu::Texture) -> Result<Vec<u8>, RenderError> {
        let texel = texture.format().block_copy_size(None).unwrap_or(4);
        let row = texel * texture.width();
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size: u64::from(padded) * u64::from(texture.height()),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &staging,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(padded),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d { width: texture.width(), height: texture.height(), depth_or_array_layers: 1 },
        );
        self.queue.submit([encoder.finish()]);
        let bytes = self.read_mapped(&staging)?;
        Ok(bytes.chunks(padded as usize).flat_map(|r| &r[..row as usize]).copied().collect())
    }

    fn read_mapped(&self, staging: &wgpu::Buffer) -> Result<Vec<u8>, RenderError> {
        staging.map_async(wgpu::MapMode::Read, .., |_| {});
        self.wait(None)?;
        let bytes = staging.get_mapped_range(..).map_err(|e| RenderError::Lost(e.to_string()))?.to_vec();
        staging.unmap();
        Ok(bytes)
    }
}
