//! What is wrong now, over the picture, with the place in the file; the last good state is what the picture shows.

use eframe::egui::{Align2, Area, Color32, Frame, Id, Margin, Order, Pos2, RichText, Stroke, Ui};

use super::super::app::App;
use super::super::document::Kind;
use super::super::messages::About;
use super::super::theme;
use super::button;

/// Shows the messages from a place on.
pub(crate) fn show(app: &mut App, ui: &Ui, at: Pos2, width: f32) {
    let errors: Vec<(About, String)> =
        app.model.messages.errors().map(|(about, text)| (about, text.to_owned())).collect();
    if errors.is_empty() {
        return;
    }
    let area = Area::new(Id::unique("faults")).order(Order::Middle).fixed_pos(at).pivot(Align2::LEFT_TOP);
    area.show(ui.ctx(), |ui| {
        ui.set_max_width(width);
        let frame = Frame::new()
            .fill(theme::ERROR_FILL)
            .stroke(Stroke::new(1.0, theme::ERROR))
            .corner_radius(4)
            .inner_margin(Margin::symmetric(10, 7));
        frame.show(ui, |ui| {
            for (about, text) in &errors {
                ui.label(RichText::new(text).monospace().color(Color32::from_rgb(0xff, 0xd9, 0xd4)));
                match about {
                    About::File(kind) if app.model.document.part(*kind).has_conflict() => {
                        choice(app, ui, *kind)
                    }
                    About::File(_) | About::Scene | About::Head => {
                        ui.label(
                            RichText::new("The picture shows the last good state.")
                                .small()
                                .color(theme::ERROR),
                        );
                    }
                    About::Edit | About::Save | About::Live | About::Reference | About::Screenshot => {
                        if button(ui, "Dismiss", "Takes this message away").clicked() {
                            app.model.messages.clear(*about);
                        }
                    }
                    About::Device => {}
                }
            }
        });
    });
}

fn choice(app: &mut App, ui: &mut Ui, kind: Kind) {
    ui.horizontal(|ui| {
        let take = button(ui, "Take the file's text", "As one step: undo brings yours back").clicked();
        let keep = button(ui, "Keep mine", "The next save writes over the file").clicked();
        if take || keep {
            match app.model.document.settle(kind, take) {
                Ok(()) => app.model.messages.clear(About::File(kind)),
                Err(e) => app.model.messages.error(About::File(kind), e.to_string()),
            }
            app.model.compose();
        }
    });
}
