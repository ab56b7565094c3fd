//! Questions: a name for a file, what to do with changes before the window closes.

use std::path::{Path, PathBuf};

use eframe::egui::{self, Id, Key, Modal, RichText, TextEdit, Ui};

use super::super::app::App;
use super::super::document::Kind;
use super::super::messages::About;
use super::super::probe;
use super::super::theme;
use super::button;
use crate::output;

/// A question.
#[derive(Clone, Debug)]
pub(crate) enum Dialog {
    /// Where a text is to be saved.
    SaveAs {
        /// Which.
        kind: Kind,
        /// The path as it is typed.
        path: String,
    },
    /// Where the picture is to be written.
    Picture {
        /// The path as it is typed.
        path: String,
    },
    /// The window closes with changes.
    Close,
}

impl Dialog {
    /// Asks where to save a text.
    pub(crate) fn save_as(kind: Kind) -> Self {
        Self::SaveAs { kind, path: String::new() }
    }

    /// Asks where to write the picture.
    pub(crate) fn picture() -> Self {
        Self::Picture { path: "picture.png".to_owned() }
    }
}

/// Shows the question, if one is asked.
pub(crate) fn show(app: &mut App, ctx: &egui::Context) {
    let Some(mut dialog) = app.dialog.take() else { return };
    let modal = Modal::new(Id::unique("dialog")).show(ctx, |ui| {
        ui.set_width(440.0);
        match &mut dialog {
            Dialog::SaveAs { kind, path } => save_as(app, ui, *kind, path),
            Dialog::Picture { path } => picture(app, ui, path),
            Dialog::Close => close(app, ui),
        }
    });
    let is_done = modal.inner || modal.should_close();
    // A dialog may have asked the next one.
    if !is_done && app.dialog.is_none() {
        app.dialog = Some(dialog);
    }
}

/// Whether the question is answered.
fn save_as(app: &mut App, ui: &mut Ui, kind: Kind, path: &mut String) -> bool {
    if path.is_empty() {
        let known = app.model.document.part(kind).path.clone();
        *path = known.unwrap_or_else(|| PathBuf::from(format!("{}.json", kind.name()))).display().to_string();
    }
    ui.heading(format!("Save the {} as", kind.name()));
    let entered = field(ui, path);
    ui.horizontal(|ui| {
        if ui.input(|i| i.key_pressed(Key::Enter)) && entered
            || button(ui, "Write", "Writes the file").clicked()
        {
            let saved = app.model.save_one(kind, Some(Path::new(path.trim())));
            app.saved();
            return saved;
        }
        button(ui, "Cancel", "Writes nothing").clicked()
    })
    .inner
}

fn picture(app: &mut App, ui: &mut Ui, path: &mut String) -> bool {
    ui.heading("Write the picture as");
    let entered = field(ui, path);
    ui.horizontal(|ui| {
        if ui.input(|i| i.key_pressed(Key::Enter)) && entered
            || button(ui, "Write", "Writes the file").clicked()
        {
            write_picture(app, Path::new(path.trim()));
            return true;
        }
        button(ui, "Cancel", "Writes nothing").clicked()
    })
    .inner
}

/// Draws the picture in full and writes it. Whether it worked.
pub(crate) fn write_picture(app: &mut App, path: &Path) -> bool {
    let written = app.full_picture().and_then(|picture| output::save_picture(path, &picture));
    match written {
        Ok(()) => {
            app.model.messages.clear(About::Screenshot);
            app.model.messages.info(format!("written: {}", path.display()));
            true
        }
        Err(e) => {
            app.model.messages.error(About::Screenshot, e.to_string());
            false
        }
    }
}

fn close(app: &mut App, ui: &mut Ui) -> bool {
    ui.heading("Save before the window closes?");
    for kind in Kind::ALL {
        let part = app.model.document.part(kind);
        if part.is_changed() {
            ui.label(RichText::new(format!("{} has changes", part.label(kind))).color(theme::TEXT));
        }
    }
    ui.add_space(6.0);
    let ctx = ui.ctx().clone();
    ui.horizontal(|ui| {
        if button(ui, "Save and close", "Writes what has changed").clicked() {
            let unnamed = app.model.save();
            app.saved();
            match unnamed.first() {
                Some(kind) => app.dialog = Some(Dialog::save_as(*kind)),
                None if !app.model.document.is_changed() => app.end(&ctx, None),
                None => {}
            }
            return true;
        }
        if button(ui, "Discard", "Closes without saving").clicked() {
            app.end(&ctx, None);
            return true;
        }
        button(ui, "Cancel", "Goes on").clicked()
    })
    .inner
}

/// A field for a path; whether it had the focus when enter was pressed.
fn field(ui: &mut Ui, path: &mut String) -> bool {
    let response = ui.add(TextEdit::singleline(path).desired_width(f32::INFINITY));
    probe::note(ui, "field path", &response);
    if !response.has_focus() && !response.lost_focus() && ui.memory(|m| m.focused().is_none()) {
        response.request_focus();
    }
    response.lost_focus() || response.has_focus()
}
