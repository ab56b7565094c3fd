//! Draws the state of a face under lights and a camera.
//!
//! ```text
//! Head --HeadOnGpu::new--> HeadOnGpu --+
//! FaceState, Camera, Lights -----------+--> Scene --Renderer::render--> Image, FrameStats
//! EnvironmentMap::upload --> Environment +
//! ```
//!
//! The passes of a frame stand in order in `frame.rs`; each is a folder under `passes`.
//! The crate knows no file format.
//!
//! ```no_run
//! use rubor_renderer::{Gpu, Renderer};
//!
//! let renderer = Renderer::new(Gpu::new(None)?)?;
//! println!("{}", renderer.gpu().info.name);
//! # Ok::<(), rubor_renderer::RenderError>(())
//! ```

pub mod channels;
mod clusters;
mod environment;
mod error;
pub mod footprint;
mod frame;
mod gpu;
mod head;
mod pass_timer;
mod passes;
mod placement;
mod scene;
pub mod settings;
mod targets;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod texture;

pub use environment::{Environment, EnvironmentMap};
pub use error::RenderError;
pub use frame::{FrameStats, Image, Renderer};
pub use gpu::{AdapterDescription, Gpu, list_adapters};
pub use head::{
    ColorTable, HeadOnGpu, MAX_DISTRIBUTIONS, MAX_HEMOGLOBIN, MAX_MELANIN, MAX_WRINKLE_MAPS, MAX_ZONES,
};
pub use pass_timer::{FrameTimes, PassTimer};
pub use passes::antialias;
pub use passes::scatter::surface::BARE_SKIN;
pub use scene::{Camera, HeadInstance, Light, LightKind, MAX_HEADS, MAX_LIGHTS, NEAR_METRES, Scene};
