//! The device: opens an adapter or takes over an open device; makes buffers and textures.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use bytemuck::Pod;
use wgpu::util::DeviceExt;

use crate::error::RenderError;

/// An open device with its queue. Clones are the same device.
#[derive(Clone)]
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Name, driver, backend.
    pub info: wgpu::AdapterInfo,
    /// True when passes can be timed.
    pub has_timestamps: bool,
    /// Whether uniform buffers are bound as storage buffers: Mesa's software driver recompiles a shader for each new
    /// value of a uniform that a loop or a branch depends on, and never frees the code.
    pub(crate) stores_uniforms: bool,
    failure: Arc<Mutex<Option<String>>>,
    is_lost: Arc<AtomicBool>,
    /// The submission that produces the next result.
    wanted: Arc<Mutex<Option<wgpu::SubmissionIndex>>>,
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

async fn adapters() -> Vec<wgpu::Adapter> {
    let mut found = instance().enumerate_adapters(wgpu::Backends::all()).await;
    found.sort_by_key(rank);
    found
}

/// Real GPUs first; the order among equals is the driver's.
fn rank(adapter: &wgpu::Adapter) -> u8 {
    match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
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
pub(crate) async fn list_adapters() -> Vec<AdapterDescription> {
    adapters().await.iter().enumerate().map(|(i, a)| describe(i, a)).collect()
}

/// The adapter whose place in the list or part of whose name (any letter case) is `wanted`, or the first.
fn choose(adapters: &[wgpu::Adapter], wanted: Option<&str>) -> Result<usize, RenderError> {
    let Some(wanted) = wanted else { return Ok(0) };
    let by_name = || {
        let lower = wanted.to_lowercase();
        adapters.iter().position(|a| a.get_info().name.to_lowercase().contains(&lower))
    };
    let by_place = wanted.parse::<usize>().ok().filter(|i| *i < adapters.len());
    by_place.or_else(by_name).ok_or_else(|| RenderError::UnknownAdapter {
        wanted: wanted.to_owned(),
        found: adapters.iter().enumerate().map(|(i, a)| format!("{i}: {}", a.get_info().name)).collect(),
    })
}

/// Optional features, used where the adapter has them.
const WELCOME_FEATURES: wgpu::Features = wgpu::Features::TIMESTAMP_QUERY
    .union(wgpu::Features::PRIMITIVE_INDEX)
    .union(wgpu::Features::SHADER_INT64)
    .union(wgpu::Features::FLOAT32_FILTERABLE)
    .union(wgpu::Features::SHADER_INT64_ATOMIC_MIN_MAX);

impl Gpu {
    /// Of the adapters that another program found, the best one, or that whose place among them, best first, or part of whose
    /// name (any letter case) is `wanted`.
    ///
    /// # Errors
    /// No adapter exists, or none has that name.
    pub fn choose(adapters: &[wgpu::Adapter], wanted: Option<&str>) -> Result<wgpu::Adapter, RenderError> {
        let mut sorted = adapters.to_vec();
        sorted.sort_by_key(rank);
        if sorted.is_empty() {
            return Err(RenderError::NoAdapter);
        }
        Ok(sorted.swap_remove(choose(&sorted, wanted)?))
    }

    /// Whether the device is a processor and not a graphics card.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Opens the best adapter, or the one whose index or part of whose name (any letter case) is `wanted`.
    ///
    /// # Errors
    /// No adapter exists, none has that name, or the driver refuses.
    pub async fn new(wanted: Option<&str>) -> Result<Self, RenderError> {
        let all = adapters().await;
        if all.is_empty() {
            return Err(RenderError::NoAdapter);
        }
        Self::open(&all[choose(&all, wanted)?]).await
    }

    async fn open(adapter: &wgpu::Adapter) -> Result<Self, RenderError> {
        let info = adapter.get_info();
        let (device, queue) = adapter
            .request_device(&Self::descriptor(adapter))
            .await
            .map_err(|e| RenderError::Device { adapter: info.name.clone(), reason: e.to_string() })?;
        Ok(Self::from_device(device, queue, info))
    }

    /// What a device has to be asked for, so that it draws as one that [`Gpu::new`] opens: for programs that open devices
    /// themselves and hand them over by [`Gpu::from_device`].
    pub fn descriptor(adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
        let most = adapter.limits();
        // WebGPU's defaults, but images and buffers as large as the adapter can hold.
        let required_limits = wgpu::Limits {
            max_texture_dimension_2d: most.max_texture_dimension_2d,
            max_buffer_size: most.max_buffer_size,
            max_storage_buffer_binding_size: most.max_storage_buffer_binding_size,
            max_storage_buffers_per_shader_stage: if adapter.get_info().device_type == wgpu::DeviceType::Cpu {
                // The limit includes uniforms on this device.
                most.max_storage_buffers_per_shader_stage
            } else {
                wgpu::Limits::default().max_storage_buffers_per_shader_stage
            },
            ..wgpu::Limits::default()
        };
        wgpu::DeviceDescriptor {
            label: Some("rubor"),
            required_features: adapter.features() & WELCOME_FEATURES,
            required_limits,
            ..Default::default()
        }
    }

    /// Takes a device that another program opened, within WebGPU's default limits. Passes are timed if it has timestamp
    /// queries.
    pub fn from_device(device: wgpu::Device, queue: wgpu::Queue, info: wgpu::AdapterInfo) -> Self {
        let failure = Arc::new(Mutex::new(None));
        let seen = failure.clone();
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            if let Ok(mut slot) = seen.lock() {
                slot.get_or_insert_with(|| e.to_string());
            }
        }));
        let seen = failure.clone();
        let is_lost = Arc::new(AtomicBool::new(false));
        let lost = is_lost.clone();
        device.set_device_lost_callback(move |reason, message| {
            lost.store(true, Ordering::Relaxed);
            if let Ok(mut slot) = seen.lock() {
                slot.get_or_insert_with(|| format!("the device is lost ({reason:?}) {message}"));
            }
        });
        let has_timestamps = device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        // Each shader has at most eight other buffers.
        let stores_uniforms = info.device_type == wgpu::DeviceType::Cpu
            && device.limits().max_storage_buffers_per_shader_stage >= 12;
        Self {
            device,
            queue,
            info,
            has_timestamps,
            stores_uniforms,
            failure,
            is_lost,
            wanted: Arc::default(),
        }
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

    /// Whether the device is gone for good.
    pub fn is_lost(&self) -> bool {
        self.is_lost.load(Ordering::Relaxed)
    }

    /// Sets the submission that produces the next result, so that a wait for the result does not wait for later
    /// submissions.
    pub(crate) fn wants(&self, submission: wgpu::SubmissionIndex) {
        if let Ok(mut slot) = self.wanted.lock() {
            *slot = Some(submission);
        }
    }

    /// Takes the submission set by [`Gpu::wants`].
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn take_wanted(&self) -> Option<wgpu::SubmissionIndex> {
        self.wanted.lock().ok().and_then(|mut slot| slot.take())
    }

    /// Whether shaders may gather four texels of floats at once.
    pub(crate) fn gathers(&self) -> bool {
        self.device.features().contains(wgpu::Features::FLOAT32_FILTERABLE)
    }

    /// A shader module from WGSL.
    pub(crate) fn shader(&self, label: &str, wgsl: &str) -> wgpu::ShaderModule {
        self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Wgsl(wgsl.into()),
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
            usage: match self.stores_uniforms {
                true => wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                false => wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            },
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
}
