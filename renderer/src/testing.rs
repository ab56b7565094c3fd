//! Helpers that the tests of several passes share.

use std::sync::OnceLock;

use crate::device::wgsl::Program;
use crate::device::{Gpu, Image, ImageSpec, Images, PassTimer, Recorder, native, texture};

/// The device of the tests; without one they are skipped loudly, or fail where `RUBOR_REQUIRE_GPU` is set.
pub(crate) fn gpu() -> Option<&'static Gpu> {
    static DEVICE: OnceLock<Option<Gpu>> = OnceLock::new();
    let device = DEVICE.get_or_init(|| match native::open(std::env::var("RUBOR_ADAPTER").ok().as_deref()) {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            assert!(std::env::var_os("RUBOR_REQUIRE_GPU").is_none(), "RUBOR_REQUIRE_GPU is set: {error}");
            None
        }
    });
    if device.is_none() {
        skipped("no graphics adapter");
    }
    device.as_ref()
}

/// Reports that a test cannot run. The test harness hides what passing tests print, but not what they write.
pub(crate) fn skipped(why: &str) {
    let _ = std::io::Write::write_fmt(&mut std::io::stderr(), format_args!("SKIPPED: {why}\n"));
}

/// The device for the tests of whole frames, which keep one of their own.
pub(crate) fn own_gpu() -> Option<Gpu> {
    gpu()?;
    native::open(std::env::var("RUBOR_ADAPTER").ok().as_deref()).ok()
}

/// Records and submits.
pub(crate) fn recorded<T>(gpu: &Gpu, work: impl FnOnce(&mut Recorder<'_>) -> T) -> T {
    let (mut timer, mut images) = (PassTimer::default(), Images::default());
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let mut r = Recorder { gpu, encoder: &mut encoder, timer: &mut timer, images: &mut images };
    let result = work(&mut r);
    gpu.queue.submit([encoder.finish()]);
    gpu.check().expect("the device takes the commands");
    result
}

/// Contents of a storage buffer.
pub(crate) fn read_storage<T: bytemuck::Pod>(gpu: &Gpu, buffer: &wgpu::Buffer) -> Vec<T> {
    bytemuck::pod_collect_to_vec(&native::wait(gpu, gpu.read_buffer(buffer)).expect("the buffer comes back"))
}

/// The texels of an image.
pub(crate) fn read_image<T: bytemuck::Pod>(gpu: &Gpu, image: &Image) -> Vec<T> {
    let bytes = native::wait(gpu, gpu.read_texture(image.texture())).expect("the image comes back");
    bytemuck::pod_collect_to_vec(&bytes)
}

/// An image of half floats with contents.
pub(crate) fn half_image(gpu: &Gpu, size: [u32; 2], texels: &[[f32; 4]]) -> Image {
    let image = Image::new(gpu, "test image", ImageSpec::light(size).also(wgpu::TextureUsages::COPY_DST));
    texture::write_half(gpu, image.texture(), texels);
    image
}

/// Links the entry points of a program both ways, validates them and compares the workgroup sizes of compute entries.
pub(crate) fn assert_workgroups(program: &Program, entries: &[(&str, [u32; 3])]) {
    for (entry, size) in entries {
        for stored_uniforms in [false, true] {
            let linked = program.link(&[entry], stored_uniforms);
            assert_eq!(validated_workgroups(&linked.wgsl), [((*entry).to_owned(), *size)]);
        }
    }
}

/// Links and validates entry points that rasterise.
pub(crate) fn assert_raster(program: &Program, entries: &[&str]) {
    for stored_uniforms in [false, true] {
        assert_eq!(validated_workgroups(&program.link(entries, stored_uniforms).wgsl), []);
    }
}

/// Compares a Rust struct with the struct of the same role in a shader: size, names in order, offsets.
pub(crate) fn assert_layout(
    program: &Program,
    entry: &str,
    structure: &str,
    size: usize,
    fields: &[(&str, usize)],
) {
    assert_layout_of(&program.link(&[entry], false).wgsl, structure, size, fields);
}

fn assert_layout_of(wgsl: &str, structure: &str, size: usize, fields: &[(&str, usize)]) {
    let module = naga::front::wgsl::parse_str(wgsl).unwrap_or_else(|e| panic!("{}", e.emit_to_string(wgsl)));
    let (_, found) = module
        .types
        .iter()
        .find(|(_, t)| t.name.as_deref() == Some(structure))
        .unwrap_or_else(|| panic!("no struct {structure}"));
    let naga::TypeInner::Struct { members, span } = &found.inner else { panic!("{structure} is no struct") };
    assert_eq!(*span as usize, size, "size of {structure}");
    let members: Vec<_> = members
        .iter()
        .map(|m| (m.name.as_deref().unwrap_or_default(), m.offset as usize))
        .filter(|(name, _)| !name.starts_with("padding"))
        .collect();
    assert_eq!(members, fields, "fields of {structure}");
}

/// Features that shaders of the project may use: half floats packed in words, and, with a version without, the
/// primitive index and 64-bit atomics.
const CAPABILITIES: naga::valid::Capabilities = naga::valid::Capabilities::PRIMITIVE_INDEX
    .union(naga::valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32)
    .union(naga::valid::Capabilities::SHADER_INT64)
    .union(naga::valid::Capabilities::SHADER_INT64_ATOMIC_MIN_MAX);

/// Parses and validates a shader and returns the workgroup size of each of its compute entry points.
pub(crate) fn validated_workgroups(wgsl: &str) -> Vec<(String, [u32; 3])> {
    let module = naga::front::wgsl::parse_str(wgsl).unwrap_or_else(|e| panic!("{}", e.emit_to_string(wgsl)));
    naga::valid::Validator::new(naga::valid::ValidationFlags::all(), CAPABILITIES)
        .validate(&module)
        .unwrap_or_else(|e| panic!("{}", e.emit_to_string(wgsl)));
    let compute = |e: &&naga::EntryPoint| e.stage == naga::ShaderStage::Compute;
    module.entry_points.iter().filter(compute).map(|e| (e.name.clone(), e.workgroup_size)).collect()
}

/// `("field", offset)` pairs of a struct.
macro_rules! offsets {
    ($structure:ty; $($field:ident as $name:literal),* $(,)?) => {
        [$(($name, std::mem::offset_of!($structure, $field))),*]
    };
}
pub(crate) use offsets;
