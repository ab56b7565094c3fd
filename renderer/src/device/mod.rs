//! The device, and the recording of a frame.
//!
//! ```text
//! Gpu (own or given) --Recorder: passes, images, times--> commands --submit--> Readback --bytes
//! wgsl: modules --> shaders with named bindings --> kernel: pipelines that bind by name
//! ```
//!
//! Only `native` waits for the device; a browser build leaves it out.

mod gpu;
pub(crate) mod images;
pub(crate) mod kernel;
#[cfg(not(target_arch = "wasm32"))]
pub mod native;
pub(crate) mod readback;
pub(crate) mod recorder;
pub(crate) mod texture;
mod timer;
pub(crate) mod wgsl;

pub use gpu::{AdapterDescription, Gpu};
pub(crate) use images::{Image, ImageSpec, Images};
pub(crate) use kernel::{Bind, Kernel, Raster, RasterKernel};
pub(crate) use recorder::{Attachments, Draw, Recorder, color_attachment, depth_attachment};
pub(crate) use timer::Ticks;
pub use timer::{FrameTimes, PassTimer, PendingTimes};
