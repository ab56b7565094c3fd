//! The picture in the middle: orbit by dragging, shift by the middle button, distance by the wheel.

use eframe::egui::{
    self, Align2, CentralPanel, Color32, FontId, Frame, PointerButton, Pos2, Rect, Sense, TextureId, Ui, vec2,
};

use super::super::app::App;
use super::super::overlay::{Legend, Overlay, diverging, heat};
use super::super::probe;
use super::super::syntax::number;
use super::super::theme;
use super::faults;

/// Degrees for a point of dragging.
const ORBIT: f32 = 0.4;
/// Factor of the distance for a point of the wheel.
const WHEEL: f32 = 0.0015;

/// Shows it.
pub(crate) fn show(app: &mut App, ui: &mut Ui) {
    let frame = Frame::new().fill(theme::BACKDROP);
    CentralPanel::default_margins().frame(frame).show(ui, |ui| {
        let all = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(all, Sense::click_and_drag());
        let [width, height] = app.model.settings.output.size.map(|n| n as f32);
        let per_point = ui.ctx().pixels_per_point();
        let natural = vec2(width, height) / per_point;
        let room = (all.size() - vec2(12.0, 12.0)).max(vec2(16.0, 16.0));
        let scale = (room.x / natural.x).min(room.y / natural.y);
        let size = if app.chosen.fits { natural * scale } else { natural };
        // On whole pixels, so that a pixel of the picture is one of the window at its natural size.
        let min = all.center() - 0.5 * size;
        let min = ((min.to_vec2() * per_point).round() / per_point).to_pos2();
        let rect = Rect::from_min_size(min, size);
        let painter = ui.painter_at(all);
        let whole = Rect::from_min_max(Pos2::ZERO, egui::pos2(1.0, 1.0));
        let draw = |id: TextureId| painter.image(id, rect, whole, Color32::WHITE);
        if let Some((id, _)) = app.picture.shown() {
            draw(id);
        } else {
            let text = "drawing...";
            painter.text(all.center(), Align2::CENTER_CENTER, text, FontId::proportional(14.0), theme::WEAK);
        }
        if app.chosen.overlay != Overlay::None
            && let Some(texture) = &app.overlay_texture
        {
            draw(texture.id());
            legend(app, &painter, all);
        }
        if app.chosen.shows_difference
            && let Some((_, texture)) = &app.comparison
        {
            draw(texture.id());
        }
        probe::note_rect(ui.ctx(), "picture", rect);
        move_camera(app, ui, &response, rect);
        faults::show(app, ui, all.min + vec2(10.0, 10.0), all.width() - 20.0);
    });
}

fn move_camera(app: &mut App, ui: &Ui, response: &egui::Response, rect: Rect) {
    let before = app.model.view.clone();
    let view = &mut app.model.view;
    let delta = response.drag_delta();
    let shifts = ui.input(|i| i.modifiers.shift) || response.dragged_by(PointerButton::Middle);
    if response.dragged() && shifts {
        view.pan[0] -= delta.x / rect.height();
        view.pan[1] += delta.y / rect.height();
    } else if response.dragged_by(PointerButton::Primary) {
        view.orbit = (view.orbit - ORBIT * delta.x + 180.0).rem_euclid(360.0) - 180.0;
        view.elevation = (view.elevation + ORBIT * delta.y).clamp(-89.0, 89.0);
    } else if response.dragged_by(PointerButton::Secondary) {
        view.environment_turn = (view.environment_turn + ORBIT * delta.x + 180.0).rem_euclid(360.0) - 180.0;
    }
    if response.hovered() {
        let wheel = ui.input(|i| i.smooth_scroll_delta().y);
        if wheel != 0.0 {
            view.distance = (view.distance * (-WHEEL * wheel).exp()).clamp(0.1, 10.0);
        }
    }
    if response.double_clicked() {
        let lights = view.lights.clone();
        *view = super::super::model::View { lights, ..Default::default() };
    }
    if app.model.view != before {
        app.model.compose();
    }
}

/// What the colours of an overlay mean, in the lower left corner.
fn legend(app: &App, painter: &egui::Painter, all: Rect) {
    let head = &app.model.head.head;
    let font = FontId::proportional(11.5);
    let corner = all.left_bottom() + vec2(12.0, -12.0);
    let background = |rect: Rect| painter.rect_filled(rect.expand(6.0), 4, Color32::from_black_alpha(170));
    match app.chosen.overlay.legend(head) {
        Legend::Words(words) => {
            let galley = painter.layout_no_wrap(words.to_owned(), font, theme::TEXT);
            let rect = Align2::LEFT_BOTTOM.anchor_size(corner, galley.size());
            background(rect);
            painter.galley(rect.min, galley, theme::TEXT);
        }
        Legend::Scale { low, high, unit, diverges } => {
            let bar = Rect::from_min_size(corner - vec2(0.0, 26.0), vec2(220.0, 10.0));
            background(Rect::from_min_max(bar.min, egui::pos2(bar.right(), corner.y)));
            let n = 44;
            for i in 0..n {
                let t = (i as f32 + 0.5) / n as f32;
                let [r, g, b] = if diverges { diverging(2.0 * t - 1.0) } else { heat(t) };
                let x = |i: i32| bar.left() + bar.width() * i as f32 / n as f32;
                let cell = Rect::from_x_y_ranges(x(i)..=x(i + 1), bar.y_range());
                painter.rect_filled(cell, 0, Color32::from_rgb(r, g, b));
            }
            let at = egui::pos2(bar.left(), corner.y);
            let text =
                |at: Pos2, align, text: String| painter.text(at, align, text, font.clone(), theme::TEXT);
            text(at, Align2::LEFT_BOTTOM, number(f64::from(low), 2));
            text(egui::pos2(bar.center().x, corner.y), Align2::CENTER_BOTTOM, unit.to_owned());
            text(egui::pos2(bar.right(), corner.y), Align2::RIGHT_BOTTOM, number(f64::from(high), 2));
        }
        Legend::Names(names) => {
            let line = 15.0;
            let height = line * names.len() as f32;
            let top = corner.y - height;
            background(Rect::from_min_size(egui::pos2(corner.x, top), vec2(170.0, height)));
            for (i, (name, [r, g, b])) in names.iter().enumerate() {
                let at = egui::pos2(corner.x, top + line * i as f32);
                let dot = Rect::from_min_size(at + vec2(0.0, 3.0), vec2(9.0, 9.0));
                painter.rect_filled(dot, 2, Color32::from_rgb(*r, *g, *b));
                painter.text(at + vec2(15.0, 0.0), Align2::LEFT_TOP, name, font.clone(), theme::TEXT);
            }
        }
    }
}
