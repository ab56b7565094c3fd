//! The parts of the window.

pub(crate) mod dialogs;
pub(crate) mod faults;
pub(crate) mod look;
pub(crate) mod perform;
pub(crate) mod picture;
pub(crate) mod rig;
pub(crate) mod settings;
pub(crate) mod status;
pub(crate) mod timeline;
pub(crate) mod top;
pub(crate) mod weight;

use eframe::egui::{Response, Ui};

use super::probe;

/// A button that scripts know by its text.
pub(crate) fn button(ui: &mut Ui, text: &str, about: &str) -> Response {
    let response = ui.button(text).on_hover_text(about);
    probe::note(ui, &format!("button {text}"), &response);
    response
}

/// A switch that scripts know by its text.
pub(crate) fn switch(ui: &mut Ui, on: &mut bool, text: &str, about: &str) -> Response {
    let response = ui.toggle_value(on, text).on_hover_text(about);
    probe::note(ui, &format!("switch {text}"), &response);
    response
}
