//! The line at the bottom: what was done last, the time of a frame, the device.

use eframe::egui::{Align, Frame, Layout, Margin, Panel, RichText, ScrollArea, Ui, Window};

use super::super::app::App;
use super::super::probe;
use super::super::theme;

/// Shows it.
pub(crate) fn show(app: &mut App, ui: &mut Ui) {
    let frame = Frame::new().fill(theme::PANEL).inner_margin(Margin::symmetric(8, 3));
    Panel::bottom("status").frame(frame).show(ui, |ui| {
        ui.horizontal(|ui| {
            let response = ui.selectable_label(app.chosen.shows_log, "Log");
            probe::note(ui, "button Log", &response);
            if response.clicked() {
                app.chosen.shows_log = !app.chosen.shows_log;
            }
            let last = app.model.messages.last().unwrap_or("ready").replace('\n', " ");
            let is_error = last.starts_with("error");
            let color = if is_error { theme::ERROR } else { theme::WEAK };
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                ui.label(RichText::new(app.picture.adapter()).color(theme::WEAK).small());
                ui.separator();
                let size = app.model.settings.output.size;
                let divisor = app.divisor();
                let [w, h] = size.map(|n| n.div_ceil(divisor));
                let moving = if divisor > 1 { " while moving" } else { "" };
                ui.label(format!("{w} x {h}{moving}"));
                ui.separator();
                let times = app.picture.times();
                let gpu = if times.passes_ms.is_empty() {
                    String::new()
                } else {
                    format!(", passes {:.1} ms", times.frame_ms)
                };
                ui.label(format!("frame {:.0} ms{gpu}", app.picture.frame_ms()));
                if app.is_moving() {
                    ui.label(RichText::new(format!("{} frames/s", app.pace.per_second())).color(theme::WEAK));
                }
                if app.background.is_busy() {
                    ui.spinner();
                    ui.label("working");
                }
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    ui.add(eframe::egui::Label::new(RichText::new(last).color(color)).truncate());
                });
            });
        });
    });
    if app.chosen.shows_log {
        let mut open = true;
        let window = Window::new("Log").open(&mut open).default_size([620.0, 260.0]);
        window.show(ui.ctx(), |ui| {
            ScrollArea::both().auto_shrink(false).stick_to_bottom(true).show(ui, |ui| {
                for line in app.model.messages.log() {
                    let color = if line.starts_with("error") { theme::ERROR } else { theme::TEXT };
                    ui.label(RichText::new(line).monospace().color(color));
                }
            });
        });
        app.chosen.shows_log = open;
    }
}
