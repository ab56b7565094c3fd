//! A weight as a bar: its name and number stand on it, so that a face fits into a panel.
//!
//! A drag sets it, a double click takes a number, the right button lets it go; after a click the arrow keys change it by a
//! hundredth.

use eframe::egui::{
    self, Align2, Color32, CursorIcon, EventFilter, FontId, Id, Key, Rect, Sense, StrokeKind, Ui, vec2,
};

use crate::view::probe;
use crate::view::syntax::number;
use crate::view::theme;

/// A bar.
pub(crate) struct Bar<'a> {
    /// Name on the bar.
    pub(crate) label: &'a str,
    /// Name for scripts.
    pub(crate) name: String,
    /// Its value.
    pub(crate) value: f32,
    /// Values at the ends.
    pub(crate) range: [f32; 2],
    /// Colour of the filled part.
    pub(crate) fill: Color32,
    /// Whether the value stands in front of a track.
    pub(crate) is_held: bool,
    /// What it is, for a hovering pointer.
    pub(crate) about: String,
}

/// What was done to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Touched {
    /// It has a new value.
    pub(crate) value: Option<f32>,
    /// A drag or an entry has ended.
    pub(crate) is_done: bool,
    /// It is let go.
    pub(crate) is_released: bool,
}

/// Change by an arrow key, as a share of the range.
const STEP: f32 = 0.01;

/// Shows a bar of a width.
pub(crate) fn bar(ui: &mut Ui, bar: &Bar<'_>, width: f32) -> Touched {
    let (rect, response) = ui.allocate_exact_size(vec2(width, theme::ROW), Sense::click_and_drag());
    probe::note_range(ui, &bar.name, &response, Some(bar.range));
    let [low, high] = bar.range;
    let mut touched = Touched::default();
    let entry = Id::unique("rubor entry");
    let entered: Option<(Id, String)> = ui.data(|d| d.get_temp(entry));
    if let Some((id, mut text)) = entered.filter(|(id, _)| *id == response.id) {
        return typed(ui, rect, id, entry, &mut text);
    }
    if response.double_clicked() {
        let text = number(f64::from(bar.value), 3);
        ui.data_mut(|d| d.insert_temp(entry, (response.id, text)));
    } else if response.secondary_clicked() {
        touched.is_released = true;
    } else if response.clicked() {
        response.request_focus();
    } else if response.dragged_by(egui::PointerButton::Primary)
        && let Some(at) = response.interact_pointer_pos()
    {
        let share = ((at.x - rect.left()) / rect.width()).clamp(0.0, 1.0);
        let value = low + share * (high - low);
        // Whole hundredths of the range: text that people can read.
        let step = (high - low) / 100.0;
        let value = (value / step).round() * step;
        touched.value = Some(value).filter(|v| *v != bar.value);
    }
    touched.is_done |= response.drag_stopped();
    if response.has_focus() {
        let filter = EventFilter { horizontal_arrows: true, ..EventFilter::default() };
        ui.memory_mut(|m| m.set_focus_lock_filter(response.id, filter));
        let steps =
            ui.input(|i| i.num_presses(Key::ArrowRight) as f32 - i.num_presses(Key::ArrowLeft) as f32);
        if steps != 0.0 {
            touched.value = Some((bar.value + steps * STEP * (high - low)).clamp(low, high));
            touched.is_done = true;
        }
    }
    paint(ui, rect, bar, &response);
    response.on_hover_text(&bar.about).on_hover_cursor(CursorIcon::ResizeHorizontal);
    touched
}

fn paint(ui: &Ui, rect: Rect, bar: &Bar<'_>, response: &egui::Response) {
    let painter = ui.painter_at(rect);
    let [low, high] = bar.range;
    let at = |value: f32| rect.left() + rect.width() * ((value - low) / (high - low)).clamp(0.0, 1.0);
    painter.rect_filled(rect, 2, theme::FIELD);
    let (from, to) = (at(0.0f32.clamp(low, high)), at(bar.value));
    let filled = Rect::from_x_y_ranges(from.min(to)..=from.max(to), rect.y_range());
    painter.rect_filled(filled, 2, bar.fill);
    if bar.is_held {
        let mark = Rect::from_min_size(rect.min, vec2(3.0, rect.height()));
        painter.rect_filled(mark, 0, theme::ACCENT);
    }
    if response.hovered() || response.has_focus() {
        let color = if response.has_focus() { theme::ACCENT } else { theme::LINE };
        painter.rect_stroke(rect, 2, egui::Stroke::new(1.0, color), StrokeKind::Inside);
    }
    let font = FontId::proportional(12.0);
    let value = number(f64::from(bar.value), 2);
    let shown = if bar.value == 0.0 { theme::WEAK } else { Color32::WHITE };
    let right =
        painter.text(rect.right_center() - vec2(5.0, 0.0), Align2::RIGHT_CENTER, value, font.clone(), shown);
    let clip = Rect::from_min_max(rect.min, egui::pos2(right.left() - 3.0, rect.bottom()));
    let name = painter.with_clip_rect(clip);
    name.text(rect.left_center() + vec2(7.0, 0.0), Align2::LEFT_CENTER, bar.label, font, theme::TEXT);
}

/// The bar as a field for a number.
fn typed(ui: &mut Ui, rect: Rect, id: Id, entry: Id, text: &mut String) -> Touched {
    let mut touched = Touched::default();
    let field = egui::TextEdit::singleline(text).id(id.with("text")).margin(vec2(6.0, 1.0));
    let response = ui.put(rect, field);
    response.request_focus();
    let (enter, escape) = ui.input(|i| (i.key_pressed(Key::Enter), i.key_pressed(Key::Escape)));
    let elsewhere = response.clicked_elsewhere();
    if enter || elsewhere {
        if let Ok(value) = text.trim().replace(',', ".").parse::<f32>()
            && value.is_finite()
        {
            touched.value = Some(value);
            touched.is_done = true;
        }
        ui.data_mut(|d| d.remove::<(Id, String)>(entry));
    } else if escape {
        ui.data_mut(|d| d.remove::<(Id, String)>(entry));
    } else {
        ui.data_mut(|d| d.insert_temp(entry, (id, text.clone())));
    }
    touched
}
