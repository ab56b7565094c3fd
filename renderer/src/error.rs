//! Errors of the renderer, with a hint what to do.

/// Why a device or a frame could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// No Vulkan, Metal or DX12 driver was found.
    #[error(
        "no graphics adapter found; without a GPU install a software driver (Debian and Ubuntu: mesa-vulkan-drivers)"
    )]
    NoAdapter,
    /// `--adapter` matches no adapter.
    #[error("no adapter matches {wanted:?}; there are: {}", found.join(", "))]
    UnknownAdapter {
        /// The name that was asked for.
        wanted: String,
        /// Names of the adapters, with their index.
        found: Vec<String>,
    },
    /// The adapter exists but did not open.
    #[error("adapter {adapter} refused to open a device: {reason}")]
    Device {
        /// Name of the adapter.
        adapter: String,
        /// The driver's message.
        reason: String,
    },
    /// A size, count or value outside what the device or the method allows.
    #[error("{what} is {found}; {expected}")]
    Limit {
        /// The quantity that is limited.
        what: &'static str,
        /// The value that was asked for.
        found: String,
        /// The range, and its source.
        expected: String,
    },
    /// The head breaks a rule of [`rubor_rig::head::Head`].
    #[error(transparent)]
    Head(#[from] rubor_rig::error::HeadError),
    /// A scattering method cannot draw a head.
    #[error("{method} cannot draw head {head}: {reason}; these scattering methods can: {others}")]
    Unsuited {
        /// Name of the method.
        method: String,
        /// Number of the head in the scene, from 1.
        head: usize,
        /// The property of the head that is in the way.
        reason: String,
        /// Names of methods that do not need it.
        others: String,
    },
    /// Antialiasing settings out of range.
    #[error(transparent)]
    Antialias(#[from] AntialiasError),
    /// The diffusion profile or a kernel of it is out of range.
    #[error(transparent)]
    Skin(#[from] rubor_rig::error::SkinError),
    /// A setting out of range.
    #[error(transparent)]
    Settings(#[from] crate::settings::SettingsError),
    /// A method that is not in the table, or a number out of range.
    #[error(transparent)]
    Method(#[from] crate::settings::UnknownMethod),
    /// The device stopped answering or ran out of memory.
    #[error("the device failed: {0}")]
    Lost(String),
}

/// Errors of the antialiasing pass.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AntialiasError {
    /// A setting is out of range.
    #[error("antialias setting {name} is {found}, expected {expected}")]
    Setting {
        /// Name of the setting in files.
        name: &'static str,
        /// Its value.
        found: f32,
        /// Its range.
        expected: String,
    },
    /// The image is empty or larger than the device takes.
    #[error("an image of {width} x {height} pixels cannot be antialiased, expected 1 to {limit} a side")]
    Size {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Largest side in pixels.
        limit: u32,
    },
    /// An input that the settings need is missing.
    #[error("{mode} with these settings takes {expected} {what}, found {found}")]
    Inputs {
        /// Name of the mode.
        mode: &'static str,
        /// The kind of input.
        what: &'static str,
        /// Number that is needed.
        expected: usize,
        /// Number that was given.
        found: usize,
    },
    /// Files have one sample per pixel and no previous frame.
    #[error("{mode} needs more than an image, expected mlaa or smaa-1x")]
    NotAFilter {
        /// Name of the mode.
        mode: &'static str,
    },
    /// The output format cannot be written by a compute shader.
    #[error("antialiasing cannot write {found:?}, expected Rgba8Unorm, Rgba16Float or Rgba32Float")]
    Format {
        /// The format that was asked for.
        found: wgpu::TextureFormat,
    },
    /// The device failed.
    #[error("the device failed: {0}")]
    Device(String),
}
