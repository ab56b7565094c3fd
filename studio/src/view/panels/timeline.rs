//! The time line: clock, tracks with their keys, and the curve of the selected track.
//!
//! A click or drag in the ruler sets the clock. Keys are moved by dragging, added by a double click in a row or in the curve,
//! deleted by Delete; the right button on a key chooses its easing.

use eframe::egui::{
    self, Align2, Color32, FontId, Frame, Id, Margin, Panel, Pos2, Rect, RichText, ScrollArea, Sense, Shape,
    Stroke, Ui, pos2, vec2,
};
use rubor_rig::json::Step;
use rubor_rig::timeline::{Ease, Track};

use super::super::app::App;
use super::super::probe;
use super::super::syntax::{number, written};
use super::super::theme;
use super::super::tracks::{self, Values};
use super::{button, switch};

/// What is selected.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Selection {
    /// A track.
    pub(crate) track: Option<Vec<Step>>,
    /// One of its keys.
    pub(crate) key: Option<usize>,
}

/// A track as it is shown, apart from the session.
struct Shown {
    path: Vec<Step>,
    label: String,
    group: &'static str,
    times: Vec<f64>,
    numbers: Option<Track<f32>>,
    range: [f32; 2],
}

/// Width of the names, points.
const NAMES: f32 = 150.0;
/// Room after the end of the sequence, for its number.
const END: f32 = 26.0;
/// Height of the ruler.
const RULER: f32 = 22.0;
/// Reach of a key.
const KEY: f32 = 5.0;

/// Shows it.
pub(crate) fn show(app: &mut App, ui: &mut Ui) {
    let frame = Frame::new().fill(theme::PANEL).inner_margin(Margin::symmetric(8, 5));
    Panel::bottom("time line")
        .frame(frame)
        .resizable(true)
        .default_size(220.0)
        .size_range(120.0..=600.0)
        .show(ui, |ui| {
            transport(app, ui);
            ui.add_space(2.0);
            let shown: Vec<Shown> = app
                .model
                .rows()
                .into_iter()
                .map(|row| Shown {
                    times: row.times(),
                    numbers: match row.values {
                        Values::Numbers(track) => Some(track.clone()),
                        Values::Triples(_) => None,
                    },
                    path: row.path,
                    label: row.label,
                    group: row.group,
                    range: row.range,
                })
                .collect();
            let selected = app.chosen.selection.track.clone();
            let curve = shown.iter().find(|s| Some(&s.path) == selected.as_ref() && s.numbers.is_some());
            let all = ui.available_rect_before_wrap();
            let curve_height = if curve.is_some() { (0.5 * all.height()).clamp(60.0, 240.0) } else { 0.0 };
            let ruler_rect = Rect::from_min_size(all.min, vec2(all.width(), RULER));
            ruler(app, ui, ruler_rect);
            let list = Rect::from_min_max(
                pos2(all.left(), ruler_rect.bottom()),
                all.right_bottom() - vec2(0.0, curve_height),
            );
            ui.scope_builder(egui::UiBuilder::new().max_rect(list), |ui| {
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    ui.spacing_mut().item_spacing.y = 1.0;
                    if shown.is_empty() {
                        ui.label(
                            RichText::new("no tracks yet: move a slider and press K").color(theme::WEAK),
                        );
                    }
                    for row in &shown {
                        track(app, ui, row);
                    }
                });
            });
            if let Some(row) = curve {
                let rect = Rect::from_min_max(pos2(all.left(), list.bottom()), all.max);
                curve_editor(app, ui, rect, row);
            }
            ui.advance_cursor_after_rect(all);
        });
}

fn transport(app: &mut App, ui: &mut Ui) {
    ui.horizontal(|ui| {
        let frame = i64::from(app.model.frame());
        if button(ui, "|<", "First frame (Home)").clicked() {
            app.seek_frame(0);
        }
        if button(ui, "<", "Frame before (left)").clicked() {
            app.seek_frame(frame - 1);
        }
        if button(ui, if app.playing.is_some() { "Pause" } else { "Play" }, "Plays in time (space)").clicked()
        {
            app.play();
        }
        if button(ui, ">", "Next frame (right)").clicked() {
            app.seek_frame(frame + 1);
        }
        if button(ui, ">|", "Last frame (End)").clicked() {
            app.seek_frame(i64::MAX / 2);
        }
        let sequence = app.model.document.sequence();
        let text = format!(
            "{:.3} s of {} s   frame {} of {}   {} fps",
            app.model.time_s,
            number(sequence.duration, 3),
            frame + 1,
            sequence.frame_count(),
            number(sequence.fps, 3)
        );
        ui.label(RichText::new(text).monospace());
        ui.separator();
        let Selection { track, key } = app.chosen.selection.clone();
        if let Some(path) = track {
            ui.label(RichText::new(written(&path)).color(theme::ACCENT));
            if button(ui, "Add key", "Adds a key of this track at the time of the clock").clicked() {
                add_key(app, &path, app.model.time_s, None);
            }
            ui.add_enabled_ui(key.is_some(), |ui| {
                if button(ui, "Delete key", "Deletes the selected key (Delete)").clicked() {
                    delete_selected(app);
                }
            });
            if let Some(index) = key {
                eases(app, ui, &path, index);
            }
        } else {
            ui.label(RichText::new("select a track for its curve").color(theme::WEAK));
        }
    });
}

/// The easing of a key as switches.
fn eases(app: &mut App, ui: &mut Ui, path: &[Step], index: usize) {
    let Some(Track::Keys(keys)) = tracks::numbers(app.model.document.sequence(), path) else { return };
    let Some(now) = keys.get(index).map(|k| k.ease) else { return };
    for ease in Ease::ALL {
        let mut on = ease == now;
        if switch(ui, &mut on, &tracks::ease_name(ease), "How the curve goes on from this key").changed()
            && on
        {
            app.model.edit(|model| model.document.set_ease(path, index, ease));
        }
    }
}

/// Horizontal place of a time.
fn x_of(app: &App, rect: Rect, time_s: f64) -> f32 {
    let left = rect.left() + NAMES;
    left + (time_s / app.model.duration_s()) as f32 * (rect.right() - END - left)
}

fn time_of(app: &App, rect: Rect, x: f32) -> f64 {
    let left = rect.left() + NAMES;
    f64::from((x - left) / (rect.right() - END - left)) * app.model.duration_s()
}

fn ruler(app: &mut App, ui: &mut Ui, rect: Rect) {
    let sensed = Rect::from_min_max(pos2(rect.left() + NAMES, rect.top()), rect.max);
    let response = ui.interact(sensed, Id::unique("ruler"), Sense::click_and_drag());
    probe::note(ui, "ruler", &response);
    if (response.dragged() || response.clicked())
        && let Some(at) = response.interact_pointer_pos()
    {
        let time_s = time_of(app, rect, at.x);
        app.seek_frame((time_s * app.model.fps()).round() as i64);
    }
    let painter = ui.painter_at(rect);
    painter.rect_filled(sensed, 2, theme::FIELD);
    // A line every second, or so many that numbers have room.
    let per_second = (x_of(app, rect, 1.0) - x_of(app, rect, 0.0)).max(1e-3);
    let every = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0, 300.0, 1800.0];
    let every = every.iter().copied().find(|s| *s as f32 * per_second > 42.0).unwrap_or(7200.0);
    let count = (app.model.duration_s() / every).floor() as u32;
    for i in 0..=count {
        let time_s = f64::from(i) * every;
        let x = x_of(app, rect, time_s);
        painter.line_segment(
            [pos2(x, rect.bottom() - 6.0), pos2(x, rect.bottom())],
            Stroke::new(1.0, theme::WEAK),
        );
        let font = FontId::proportional(10.5);
        painter.text(pos2(x + 3.0, rect.top() + 3.0), Align2::LEFT_TOP, number(time_s, 1), font, theme::WEAK);
    }
    let x = x_of(app, rect, app.model.time_s);
    painter.line_segment([pos2(x, rect.top()), pos2(x, rect.bottom())], Stroke::new(1.5, theme::ACCENT));
    let tip = vec![pos2(x - 5.0, rect.top()), pos2(x + 5.0, rect.top()), pos2(x, rect.top() + 7.0)];
    painter.add(Shape::convex_polygon(tip, theme::ACCENT, Stroke::NONE));
}

fn track(app: &mut App, ui: &mut Ui, row: &Shown) {
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), 18.0), Sense::click());
    let name = written(&row.path);
    probe::note(ui, &format!("track {name}"), &response);
    let is_selected = app.chosen.selection.track.as_ref() == Some(&row.path);
    if response.clicked() {
        app.chosen.selection = Selection { track: Some(row.path.clone()), key: None };
    }
    if response.double_clicked()
        && let Some(at) = response.interact_pointer_pos()
        && at.x > rect.left() + NAMES
    {
        add_key(app, &row.path, time_of(app, rect, at.x), None);
    }
    let painter = ui.painter_at(rect);
    if is_selected {
        painter.rect_filled(rect, 2, theme::FIELD);
    }
    let text = format!("{}  {}", row.group, row.label);
    let color = if is_selected { Color32::WHITE } else { theme::TEXT };
    let names = painter.with_clip_rect(Rect::from_min_size(rect.min, vec2(NAMES - 6.0, rect.height())));
    names.text(
        rect.left_center() + vec2(4.0, 0.0),
        Align2::LEFT_CENTER,
        text,
        FontId::proportional(11.5),
        color,
    );
    let line = pos2(rect.left() + NAMES, rect.center().y);
    painter.line_segment([line, pos2(rect.right() - END, line.y)], Stroke::new(1.0, theme::LINE));
    let x = x_of(app, rect, app.model.time_s);
    painter.line_segment(
        [pos2(x, rect.top()), pos2(x, rect.bottom())],
        Stroke::new(1.0, theme::ACCENT.gamma_multiply(0.6)),
    );
    for (i, time_s) in row.times.iter().enumerate() {
        let at = pos2(x_of(app, rect, *time_s), rect.center().y);
        key(app, ui, rect, row, i, at, None);
    }
}

/// A key at a place, in a row or in the curve, where it has a height too.
fn key(app: &mut App, ui: &mut Ui, rect: Rect, row: &Shown, index: usize, at: Pos2, curve: Option<Rect>) {
    let place = if curve.is_some() { "curve" } else { "row" };
    let name = written(&row.path);
    let id = Id::unique(("key", place, &name, index));
    let response = ui.interact(
        Rect::from_center_size(at, vec2(2.0 * KEY + 2.0, 2.0 * KEY + 4.0)),
        id,
        Sense::click_and_drag(),
    );
    let word = if curve.is_some() { "point" } else { "key" };
    probe::note(ui, &format!("{word} {name} {}", index + 1), &response);
    let selection = Selection { track: Some(row.path.clone()), key: Some(index) };
    if response.clicked() || response.drag_started() || response.secondary_clicked() {
        app.chosen.selection = selection.clone();
    }
    if response.dragged()
        && let Some(to) = response.interact_pointer_pos()
    {
        // To whole frames, unless shift is held.
        let mut time_s = time_of(app, rect, to.x);
        if !ui.input(|i| i.modifiers.shift) {
            time_s = (time_s * app.model.fps()).round() / app.model.fps();
        }
        let value = curve.map(|curve| value_of(curve, row.range, to.y));
        let mark = format!("drag {name} {index}");
        app.model.edit(|model| model.document.move_key(&row.path, index, time_s, value, Some(&mark)));
    }
    if response.drag_stopped() {
        app.model.document.seal();
    }
    let is_selected = app.chosen.selection == selection;
    let color = if is_selected { theme::ACCENT } else { Color32::from_rgb(0xc9, 0xcc, 0xd1) };
    let size = if response.hovered() { KEY + 1.0 } else { KEY };
    let corners = [vec2(0.0, -size), vec2(size, 0.0), vec2(0.0, size), vec2(-size, 0.0)].map(|v| at + v);
    ui.painter().add(Shape::convex_polygon(corners.to_vec(), color, Stroke::new(1.0, theme::BACKDROP)));
    let value =
        row.numbers.as_ref().map(|t| number(f64::from(t.at(row.times[index])), 3)).unwrap_or_default();
    response.on_hover_text(format!("{name}\n{} s  {value}", number(row.times[index], 4)));
}

fn y_of(rect: Rect, [low, high]: [f32; 2], value: f32) -> f32 {
    rect.bottom() - 8.0 - (value - low) / (high - low) * (rect.height() - 16.0)
}

fn value_of(rect: Rect, [low, high]: [f32; 2], y: f32) -> f32 {
    let value = low + (rect.bottom() - 8.0 - y) / (rect.height() - 16.0) * (high - low);
    let step = (high - low) / 200.0;
    ((value / step).round() * step).clamp(low, high)
}

fn curve_editor(app: &mut App, ui: &mut Ui, rect: Rect, row: &Shown) {
    let Some(track) = &row.numbers else { return };
    // The range holds every key.
    let values: Vec<f32> = row.times.iter().map(|t| track.at(*t)).collect();
    let [low, high] = row.range;
    let range = [values.iter().copied().fold(low, f32::min), values.iter().copied().fold(high, f32::max)];
    let row = Shown {
        path: row.path.clone(),
        label: row.label.clone(),
        group: row.group,
        times: row.times.clone(),
        numbers: row.numbers.clone(),
        range,
    };
    let plot = Rect::from_min_max(pos2(rect.left() + NAMES, rect.top() + 4.0), rect.max);
    let response = ui.interact(plot, Id::unique("curve"), Sense::click());
    probe::note(ui, "curve", &response);
    if response.double_clicked()
        && let Some(at) = response.interact_pointer_pos()
    {
        add_key(app, &row.path, time_of(app, rect, at.x), Some(value_of(plot, range, at.y)));
    }
    let painter = ui.painter_at(rect);
    painter.rect_filled(plot, 2, theme::BACKDROP);
    for value in [range[0], 0.5 * (range[0] + range[1]), range[1]] {
        let y = y_of(plot, range, value);
        painter.line_segment([pos2(plot.left(), y), pos2(plot.right(), y)], Stroke::new(1.0, theme::LINE));
        let at = pos2(plot.left() - 6.0, y);
        painter.text(
            at,
            Align2::RIGHT_CENTER,
            number(f64::from(value), 2),
            FontId::proportional(10.5),
            theme::WEAK,
        );
    }
    painter.text(
        pos2(rect.left() + 4.0, plot.top() + 6.0),
        Align2::LEFT_TOP,
        &row.label,
        FontId::proportional(12.0),
        theme::ACCENT,
    );
    let (from, to) = (x_of(app, rect, 0.0), x_of(app, rect, app.model.duration_s()));
    let points: Vec<Pos2> = (0..=((to - from) as i32 / 2))
        .map(|i| from + 2.0 * i as f32)
        .map(|x| pos2(x, y_of(plot, range, track.at(time_of(app, rect, x)))))
        .collect();
    painter.add(Shape::line(points, Stroke::new(1.5, theme::ACCENT)));
    let x = x_of(app, rect, app.model.time_s);
    painter.line_segment(
        [pos2(x, plot.top()), pos2(x, plot.bottom())],
        Stroke::new(1.0, theme::ACCENT.gamma_multiply(0.6)),
    );
    for (i, time_s) in row.times.iter().enumerate() {
        let at = pos2(x_of(app, rect, *time_s), y_of(plot, range, values[i]));
        key(app, ui, rect, &row, i, at, Some(plot));
    }
}

/// Adds a key; without a value, with that of the track.
fn add_key(app: &mut App, path: &[Step], time_s: f64, value: Option<f32>) {
    let time_s = (time_s * app.model.fps()).round() / app.model.fps();
    let sequence = app.model.document.sequence();
    let Some(track) = tracks::numbers(sequence, path) else {
        app.model.messages.info("keys of places are added in the text; here they are moved and deleted");
        return;
    };
    let value = value.unwrap_or_else(|| track.at(time_s));
    if app.model.edit(|model| model.document.set_key(path, time_s, value, None)) {
        let sequence = app.model.document.sequence();
        let index = tracks::numbers(sequence, path).and_then(|t| tracks::key_near(t, time_s, sequence.fps));
        app.chosen.selection = Selection { track: Some(path.to_vec()), key: index };
    }
}

/// Deletes the selected key.
pub(crate) fn delete_selected(app: &mut App) {
    let Selection { track: Some(path), key: Some(index) } = app.chosen.selection.clone() else { return };
    if app.model.edit(|model| model.document.delete_key(&path, index)) {
        app.chosen.selection.key = None;
    }
}
