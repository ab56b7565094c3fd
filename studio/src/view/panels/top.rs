//! The bar at the top: files, steps, the map over the picture.

use eframe::egui::{ComboBox, Frame, Margin, Panel, RichText, Ui};

use super::super::app::App;
use super::super::document::Kind;
use super::super::overlay::Overlay;
use super::super::probe;
use super::super::theme;
use super::dialogs::Dialog;
use super::{button, switch};

/// Shows it.
pub(crate) fn show(app: &mut App, ui: &mut Ui) {
    let frame = Frame::new().fill(theme::PANEL).inner_margin(Margin::symmetric(8, 5));
    Panel::top("top").frame(frame).show(ui, |ui| {
        ui.horizontal(|ui| {
            ui.label(RichText::new("rubor").strong().color(theme::ACCENT));
            ui.separator();
            for kind in Kind::ALL {
                let part = app.model.document.part(kind);
                let mark = if part.is_changed() { " *" } else { "" };
                let text = RichText::new(format!("{}{mark}", part.label(kind)));
                let text = if part.is_changed() { text.color(theme::ACCENT) } else { text.color(theme::TEXT) };
                let path = part.path.as_ref().map_or("no file yet".to_owned(), |p| p.display().to_string());
                ui.label(text).on_hover_text(format!("{}: {path}", kind.name()));
            }
            if button(ui, "Save", "Writes what has changed (Ctrl+S)").clicked() {
                app.save();
            }
            let menu = ui.menu_button("Save as", |ui| {
                for kind in Kind::ALL {
                    if button(ui, &format!("{} as...", kind.name()), "Writes it to another file").clicked() {
                        app.dialog = Some(Dialog::save_as(kind));
                    }
                }
            });
            probe::note(ui, "button Save as", &menu.response);
            ui.separator();
            let history = app.model.document.history();
            let label = |l: Option<&str>, what: &str| l.map_or(format!("nothing to {what}"), str::to_owned);
            let (undo, redo) = (history.undo_label().map(str::to_owned), history.redo_label().map(str::to_owned));
            ui.add_enabled_ui(undo.is_some(), |ui| {
                let about = format!("{} (Ctrl+Z)", label(undo.as_deref(), "undo"));
                if button(ui, "Undo", &about).clicked() {
                    app.model.undo();
                }
            });
            ui.add_enabled_ui(redo.is_some(), |ui| {
                let about = format!("{} (Ctrl+Shift+Z)", label(redo.as_deref(), "do again"));
                if button(ui, "Redo", &about).clicked() {
                    app.model.redo();
                }
            });
            ui.separator();
            ui.label("Overlay");
            let combo = ComboBox::from_id_salt("overlay").selected_text(app.chosen.overlay.name()).width(92.0);
            let combo = combo.show_ui(ui, |ui| {
                for overlay in Overlay::ALL {
                    let response = ui.selectable_value(&mut app.chosen.overlay, overlay, overlay.name());
                    probe::note(ui, &format!("overlay {}", overlay.name()), &response);
                }
            });
            probe::note(ui, "overlay", &combo.response);
            ui.separator();
            switch(ui, &mut app.chosen.fits, "Fit", "Scales the picture to the window; off, a pixel is a pixel");
            let about = "Draws the picture smaller while something moves, so that it stays fluent; in full once it is still";
            switch(ui, &mut app.chosen.draws_smaller, "Fluent", about);
            if button(ui, "Picture...", "Writes the picture as it is, in full size").clicked() {
                app.dialog = Some(Dialog::picture());
            }
            if button(ui, "Copy command", "Copies the command line that renders this sequence with these settings").clicked() {
                ui.ctx().copy_text(super::settings::command_line(app));
                app.model.messages.info("the command line is in the clipboard");
            }
        });
    });
}
