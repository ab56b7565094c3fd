//! Draws the state of a face under lights and a camera.
//!
//! ```text
//! Head --HeadOnGpu::new--> HeadOnGpu --+
//! FaceState, Camera, Lights -----------+--> Scene, Settings --Renderer::draw--> Drawn --finish--> Image, FrameStats
//! EnvironmentMap::upload --> Environment +
//! ```
//!
//! Where to look: [`settings`] defines every setting and the one table of methods; `frame/realtime.rs` is the order of a
//! frame; each pass is a folder under `passes`; `device` opens devices, links shaders and records. The crate reads no
//! file format. It does not wait for the device, except in `native`, for programs outside of a browser.
//!
//! ```no_run
//! use rubor_renderer::{Renderer, native};
//!
//! let renderer = Renderer::new(native::open(None)?)?;
//! println!("{}", renderer.gpu().info.name);
//! # Ok::<(), rubor_renderer::RenderError>(())
//! ```

pub mod channels;
mod device;
mod error;
mod frame;
mod passes;
mod renderer;
mod scene;
pub mod settings;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

#[cfg(not(target_arch = "wasm32"))]
pub use device::native;
#[cfg(feature = "faults")]
pub use device::wgsl::faults;
pub use device::{AdapterDescription, FrameTimes, Gpu, PassTimer, PendingTimes};
pub use error::RenderError;
pub use passes::antialias;
pub use passes::diffusion::surface::BARE_SKIN;
pub use renderer::{Arrived, Drawn, FrameStats, Image, Renderer};
pub use scene::{
    Camera, ColorTable, Environment, EnvironmentMap, HeadInstance, HeadOnGpu, Ladder, Light, LightKind,
    MAX_DISTRIBUTIONS, MAX_HEADS, MAX_HEMOGLOBIN, MAX_LIGHTS, MAX_MELANIN, MAX_WRINKLE_MAPS, MAX_ZONES,
    NEAR_METRES, Optics, Scene, footprint, triangles_of_ids,
};
