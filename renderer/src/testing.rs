//! What the tests of several passes share.

use std::sync::OnceLock;

use crate::gpu::Gpu;

/// The device of the tests; without one they are skipped loudly, or fail where `RUBOR_REQUIRE_GPU` is set.
pub(crate) fn gpu() -> Option<&'static Gpu> {
    static DEVICE: OnceLock<Option<Gpu>> = OnceLock::new();
    let device = DEVICE.get_or_init(|| match Gpu::new(std::env::var("RUBOR_ADAPTER").ok().as_deref()) {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            assert!(std::env::var_os("RUBOR_REQUIRE_GPU").is_none(), "RUBOR_REQUIRE_GPU is set: {error}");
            None
        }
    });
    if device.is_none() {
        eprintln!("SKIPPED: no graphics adapter");
    }
    device.as_ref()
}

/// Compares a Rust struct with the struct of the same role in a shader: size, names in order, offsets.
pub(crate) fn assert_layout(wgsl: &str, structure: &str, size: usize, fields: &[(&str, usize)]) {
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

/// What shaders of the project may use: halves that are packed in words, and numbers of triangles (of which there is a
/// version without).
const CAPABILITIES: naga::valid::Capabilities =
    naga::valid::Capabilities::PRIMITIVE_INDEX.union(naga::valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32);

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
