//! Errors of the renderer, in words a person can act on.

/// Why a device or a frame could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// No Vulkan, Metal or DX12 driver answered.
    #[error(
        "no graphics adapter found; without a GPU install a software driver (Debian and Ubuntu: mesa-vulkan-drivers)"
    )]
    NoAdapter,
    /// `--adapter` named none of those that exist.
    #[error("no adapter matches {wanted:?}; there are: {}", found.join(", "))]
    UnknownAdapter {
        /// What was asked for.
        wanted: String,
        /// Names of those that exist, with their index.
        found: Vec<String>,
    },
    /// The adapter exists but would not open.
    #[error("adapter {adapter} refused to open a device: {reason}")]
    Device {
        /// Name of the adapter.
        adapter: String,
        /// What the driver said.
        reason: String,
    },
    /// A size, count or value outside what the device or the method allows.
    #[error("{what} is {found}; {expected}")]
    Limit {
        /// What is limited.
        what: &'static str,
        /// What was asked for.
        found: String,
        /// The range, and where it comes from.
        expected: String,
    },
    /// The head breaks a rule of [`rubor_rig::head::Head`].
    #[error(transparent)]
    Head(#[from] rubor_rig::error::HeadError),
    /// Antialiasing settings out of range.
    #[error(transparent)]
    Antialias(#[from] AntialiasError),
    /// The diffusion profile or a kernel of it is out of range.
    #[error(transparent)]
    Skin(#[from] rubor_rig::error::SkinError),
    /// A setting out of range.
    #[error(transparent)]
    Settings(#[from] crate::settings::SettingsError),
    /// A method that the table does not have, or its number out of range.
    #[error(transparent)]
    Method(#[from] crate::settings::UnknownMethod),
    /// The device stopped answering or ran out of memory.
    #[error("the device failed: {0}")]
    Lost(String),
}

/// What keeps the antialiasing pass from running.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AntialiasError {
    /// A setting is out of range.
    #[error("antialias setting {name} is {found}, expected {expected}")]
    Setting {
        /// Name in files.
        name: &'static str,
        /// Its value.
        found: f32,
        /// Its range.
        expected: String,
    },
    /// The image is empty or larger than the device takes.
    #[error("an image of {width} x {height} pixels cannot be antialiased, expected 1 to {limit} a side")]
    Size {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// Pixels.
        limit: u32,
    },
    /// Something the settings ask for was not handed over.
    #[error("{mode} with these settings takes {expected} {what}, found {found}")]
    Inputs {
        /// Name of the mode.
        mode: &'static str,
        /// What it takes.
        what: &'static str,
        /// How many.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// Files have one sample a pixel and no previous frame.
    #[error("{mode} needs more than an image, expected mlaa or smaa-1x")]
    NotAFilter {
        /// Name of the mode.
        mode: &'static str,
    },
    /// The output format cannot be written by a compute shader.
    #[error("antialiasing cannot write {found:?}, expected Rgba8Unorm, Rgba16Float or Rgba32Float")]
    Format {
        /// What was asked for.
        found: wgpu::TextureFormat,
    },
    /// The device failed.
    #[error("the device failed: {0}")]
    Device(String),
}
