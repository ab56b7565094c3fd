//! The live viewer, `rubor view`: a window in which a face is posed, keyed and looked at while its files are edited.
//!
//! ```text
//! files --watch--> Document (text, history) --+
//! socket --live--> Pose --------------------- +--> Model --shot--> Picture --> window
//! sliders ---> Pose, Document, View ----------+                       ^
//! panels (widgets) <--> Model                                       Studio on the window's device
//! ```
//!
//! [`model::Model`] knows no window: tests use it alone. `app` is the loop of the window, `panels` are its parts. Work that
//! would stop the window is in `background`. [`script::Script`] stands in for a person, in tests and for documentation.

mod app;
mod background;
pub mod document;
mod frame;
pub mod history;
pub mod live;
pub mod messages;
pub mod model;
pub mod overlay;
mod panels;
pub mod pose;
mod probe;
pub mod script;
pub mod syntax;
mod theme;
pub mod tracks;
pub mod watch;

use std::net::SocketAddr;
use std::sync::{Arc, Mutex};

use eframe::egui::{ViewportBuilder, vec2};
use eframe::egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use rubor_renderer::Gpu;
use rubor_renderer::settings::Preset;

use crate::error::{Failure, Outcome};
use app::{App, Start};
use model::Model;
use script::Script;

/// What a window starts with.
pub struct Options {
    /// The session.
    pub model: Model,
    /// The preset that its settings started from.
    pub preset: Option<Preset>,
    /// Where weights are listened for.
    pub live: Option<SocketAddr>,
    /// The adapter by its number or a part of its name.
    pub adapter: Option<String>,
    /// Actions in place of a person's.
    pub script: Option<Script>,
    /// Width and height of the window, points.
    pub window: [f32; 2],
}

/// Opens a window and returns when it is closed.
///
/// # Errors
/// There is no display or no device that draws on it; the address is in use; the device was lost (what was not saved is in
/// files that the message names).
pub fn open(options: Options) -> Outcome {
    let Options { model, preset, live, adapter, script, window } = options;
    let wanted = adapter.clone();
    let setup = WgpuSetupCreateNew {
        native_adapter_selector: Some(Arc::new(move |adapters, surface| {
            let shows = |a: &&wgpu::Adapter| surface.is_none_or(|s| a.is_surface_supported(s));
            let able: Vec<wgpu::Adapter> = adapters.iter().filter(shows).cloned().collect();
            Gpu::choose(&able, wanted.as_deref()).map_err(|e| e.to_string())
        })),
        device_descriptor: Arc::new(Gpu::descriptor),
        ..WgpuSetupCreateNew::without_display_handle()
    };
    let native = eframe::NativeOptions {
        viewport: ViewportBuilder::default()
            .with_title("rubor view")
            .with_app_id("rubor")
            .with_inner_size(vec2(window[0], window[1]))
            .with_min_inner_size(vec2(720.0, 480.0)),
        wgpu_options: WgpuConfiguration {
            wgpu_setup: WgpuSetup::CreateNew(setup),
            ..WgpuConfiguration::default()
        },
        ..eframe::NativeOptions::default()
    };
    let outcome: Arc<Mutex<Option<Failure>>> = Arc::default();
    let of_window = outcome.clone();
    let start = Start { model, preset, live, adapter, script };
    let create: eframe::AppCreator<'_> =
        Box::new(move |context| match App::new(context, start, of_window.clone()) {
            Ok(app) => Ok(Box::new(app)),
            Err(failure) => {
                let message = failure.to_string();
                if let Ok(mut slot) = of_window.lock() {
                    *slot = Some(failure);
                }
                Err(message.into())
            }
        });
    // A panic has dropped the app, which has kept the work and says so.
    let run = || eframe::run_native("rubor view", native, create);
    let ran = std::panic::catch_unwind(std::panic::AssertUnwindSafe(run));
    if let Some(failure) = outcome.lock().ok().and_then(|mut slot| slot.take()) {
        return Err(failure);
    }
    let ran = ran.map_err(|_| Failure::job("the window failed"))?;
    ran.map_err(|e| Failure::job(format!("the window cannot be opened: {e}")).hint(HINT))
}

/// What helps where no window opens.
const HINT: &str = "`rubor view` needs a desktop: X11 (DISPLAY) or Wayland (WAYLAND_DISPLAY); without one, `rubor render` draws to files";

/// Says at once that there is no display, before heads are loaded.
///
/// # Errors
/// No display is named by the variables of the process.
pub fn require_display() -> Outcome {
    if cfg!(all(unix, not(target_os = "macos"))) {
        let is_set = |name: &str| std::env::var_os(name).is_some_and(|v| !v.is_empty());
        if !["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"].iter().any(|name| is_set(name)) {
            let message = "found no display: neither DISPLAY nor WAYLAND_DISPLAY is set";
            return Err(Failure::job(message).hint(HINT));
        }
    }
    Ok(())
}
