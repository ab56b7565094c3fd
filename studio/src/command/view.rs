//! `rubor view`: a window on a head, its rig and its sequence.

use std::net::SocketAddr;
use std::path::PathBuf;

use rubor::view::live::DEFAULT_ADDRESS;
use rubor::view::model::{Files, Model};
use rubor::view::script::Script;
use rubor::view::{self, Options};
use rubor::{Outcome, inputs};

use super::settings_flags::{One, SettingsFlags};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Head (.glb, .gltf, .vrm, .obj, .usda, .usdz) [default: the built-in head]
    #[arg(value_name = "HEAD")]
    head: Option<PathBuf>,
    /// Rig (.json) [default: the one in the head, else the six basic expressions for ARKit names]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// Sequence (.json) [default: the demo]
    #[arg(long, value_name = "FILE")]
    sequence: Option<PathBuf>,
    /// Lights that replace those of the sequence: three-point, window, backlit-ear, low-key, soft-box, sky, or a
    /// sequence file
    #[arg(long, value_name = "NAME|FILE")]
    lights: Option<String>,
    /// Listen for weights: JSON lines over TCP as Maya's menu sends them, Open Sound Control and Live Link Face over UDP
    /// [without an address: 127.0.0.1:47511]
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1, default_missing_value = DEFAULT_ADDRESS)]
    live: Option<SocketAddr>,
    /// Graphics adapter: its number or a part of its name (see `rubor adapters`)
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Actions in place of a person's, a JSON object a line
    #[arg(long, value_name = "FILE", hide = true)]
    script: Option<PathBuf>,
    /// Width and height of the window
    #[arg(long, value_name = "WxH", hide = true, default_value = "1440x900", value_parser = parse_window)]
    window: [f32; 2],
    #[command(flatten)]
    settings: SettingsFlags<One>,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    view::require_display()?;
    let script = arguments.script.as_deref().map(Script::read).transpose()?;
    let files = Files {
        head: arguments.head.clone(),
        rig: arguments.rig.clone(),
        sequence: arguments.sequence.clone(),
    };
    let mut model = Model::open(&files, |size| arguments.settings.settings(size))?;
    if let Some(lights) = &arguments.lights {
        model.view.lights = Some(inputs::lights(lights)?);
        model.compose();
    }
    view::open(Options {
        model,
        preset: arguments.settings.preset(),
        live: arguments.live,
        adapter: arguments.adapter.clone(),
        script,
        window: arguments.window,
    })
}

fn parse_window(text: &str) -> Result<[f32; 2], String> {
    let sides = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    sides.ok_or_else(|| format!("found {text:?}, expected WIDTHxHEIGHT"))
}
