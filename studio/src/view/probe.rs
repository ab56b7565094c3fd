//! Where widgets are, by name, for scripts: a script moves the pointer to them as a hand would.

use std::collections::HashMap;

use eframe::egui::{self, Align, Id, Rect, Response, Ui};

/// A widget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    /// Its place in the window, points.
    pub(crate) rect: Rect,
    /// Values at its left and right end, of one that has such.
    pub(crate) range: Option<[f32; 2]>,
}

/// All widgets of a frame that have a name.
#[derive(Clone, Debug, Default)]
struct Probe {
    is_on: bool,
    /// A widget that is to be scrolled to.
    wanted: Option<String>,
    found: HashMap<String, Found>,
}

fn with<T>(ctx: &egui::Context, what: impl FnOnce(&mut Probe) -> T) -> T {
    ctx.data_mut(|data| what(data.get_temp_mut_or_default::<Probe>(Id::unique("rubor probe"))))
}

/// Begins to note widgets.
pub(crate) fn start(ctx: &egui::Context) {
    with(ctx, |probe| probe.is_on = true);
}

/// Forgets the widgets of the last frame and wants one to be scrolled to.
pub(crate) fn begin_frame(ctx: &egui::Context, wanted: Option<&str>) {
    with(ctx, |probe| {
        probe.found.clear();
        probe.wanted = wanted.map(str::to_owned);
    });
}

/// The widget of a name, if the last frame had it in view.
pub(crate) fn find(ctx: &egui::Context, name: &str) -> Option<Found> {
    with(ctx, |probe| probe.found.get(name).copied())
}

/// Names that are most like one.
pub(crate) fn nearest(ctx: &egui::Context, name: &str) -> Option<String> {
    with(ctx, |probe| rubor_rig::names::nearest(name, probe.found.keys().map(String::as_str)))
}

/// Notes a widget.
pub(crate) fn note(ui: &Ui, name: &str, response: &Response) {
    note_range(ui, name, response, None);
}

/// Notes a widget with the values at its ends.
pub(crate) fn note_range(ui: &Ui, name: &str, response: &Response, range: Option<[f32; 2]>) {
    let wanted = with(ui.ctx(), |probe| {
        if !probe.is_on {
            return false;
        }
        if ui.clip_rect().contains(response.rect.center()) {
            probe.found.insert(name.to_owned(), Found { rect: response.rect, range });
        }
        probe.wanted.as_deref() == Some(name)
    });
    if wanted && !ui.clip_rect().contains_rect(response.rect) {
        response.scroll_to_me(Some(Align::Center));
    }
}

/// Notes a place that is painted and not a widget of its own.
pub(crate) fn note_rect(ctx: &egui::Context, name: &str, rect: Rect) {
    with(ctx, |probe| {
        if probe.is_on {
            probe.found.insert(name.to_owned(), Found { rect, range: None });
        }
    });
}
