//! The panel on the right: every setting of a frame, live, with the time of each pass and the error beside them.

use eframe::egui::{
    CollapsingHeader, ComboBox, DragValue, Frame, Margin, Panel, ProgressBar, RichText, ScrollArea, Ui,
};
use rubor_renderer::settings::{GROUPS, Group, Leaf, Preset, Settings, leaves};
use serde_json::Value;

use super::super::app::App;
use super::super::background::Task;
use super::super::document::Kind;
use super::super::frame::Still;
use super::super::messages::About;
use super::super::probe;
use super::super::syntax::number;
use super::super::theme;
use super::{button, look, switch};

/// Shows it.
pub(crate) fn show(app: &mut App, ui: &mut Ui) {
    let frame = Frame::new().fill(theme::PANEL).inner_margin(Margin::symmetric(8, 6));
    Panel::right("settings").frame(frame).default_size(310.0).size_range(240.0..=520.0).show(ui, |ui| {
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            section(ui, "Quality", true, |ui| quality(app, ui));
            section(ui, "Look and size", false, |ui| {
                group(app, ui, "look");
                group(app, ui, "output");
            });
            section(ui, "Passes", true, |ui| passes(app, ui));
            section(ui, "Error against the reference", true, |ui| error(app, ui));
            section(ui, "Camera and turntable", true, |ui| look::camera(app, ui));
            section(ui, "Light", true, |ui| look::light(app, ui));
            section(ui, "Live", true, |ui| look::live(app, ui));
        });
    });
}

fn section(ui: &mut Ui, title: &str, is_open: bool, contents: impl FnOnce(&mut Ui)) {
    let header =
        CollapsingHeader::new(RichText::new(title).strong()).default_open(is_open).show(ui, contents);
    probe::note(ui, &format!("section {title}"), &header.header_response);
}

fn quality(app: &mut App, ui: &mut Ui) {
    ui.horizontal(|ui| {
        for preset in Preset::ALL {
            let is_chosen = app.model.settings.quality == preset.quality();
            let response = ui.selectable_label(is_chosen, preset.name());
            probe::note(ui, &format!("preset {}", preset.name()), &response);
            if response.clicked() {
                app.model.settings.quality = preset.quality();
                app.chosen.preset = Some(preset);
                app.model.touch();
            }
        }
    });
    group(app, ui, "quality");
}

/// The settings of a group, each by its type.
fn group(app: &mut App, ui: &mut Ui, name: &str) {
    let values = serde_json::to_value(&app.model.settings).unwrap_or_default();
    for leaf in leaves().iter().filter(|leaf| leaf.path[0] == name) {
        // What a picture keeps beside its colours is for files.
        if leaf.flag() == "channels" {
            continue;
        }
        let value = leaf.value_in(&values);
        let changed = ui
            .horizontal(|ui| {
                let label = ui.label(RichText::new(leaf.flag()).color(theme::WEAK));
                label.on_hover_text(format!("{}\n{}", leaf.about, leaf.expected));
                let column = ui.min_rect().left() + 112.0;
                ui.add_space((column - ui.cursor().left()).max(0.0));
                edit(ui, leaf, value)
            })
            .inner;
        if let Some(new) = changed {
            set(app, leaf, &new);
        }
    }
}

fn set(app: &mut App, leaf: &Leaf, value: &Value) {
    let mut settings: Settings = app.model.settings.clone();
    let changed = settings.overlay(&leaf.change(value)).and_then(|()| settings.validate());
    match changed {
        Ok(()) => {
            app.model.settings = settings;
            app.model.messages.clear(About::Edit);
            app.model.touch();
        }
        Err(e) => app.model.messages.error(About::Edit, e.to_string()),
    }
}

/// A widget for a setting; its new value.
fn edit(ui: &mut Ui, leaf: &Leaf, value: &Value) -> Option<Value> {
    if let Some(group) = GROUPS.iter().find(|g| g.name == leaf.flag()) {
        return method(ui, group, value.as_str().unwrap_or_default());
    }
    if leaf.flag() == "size" {
        let mut size: Vec<u32> = serde_json::from_value(value.clone()).unwrap_or_default();
        let before = size.clone();
        for (i, side) in size.iter_mut().enumerate() {
            if i > 0 {
                ui.label("x");
            }
            let response = ui.add(DragValue::new(side).range(16..=8192));
            probe::note(ui, &format!("setting size {i}"), &response);
        }
        return (size != before).then(|| serde_json::json!(size));
    }
    if leaf.is_list {
        return list(ui, leaf, value);
    }
    match leaf.kind.as_str() {
        "integer" => {
            let mut n = value.as_u64().unwrap_or_default();
            let [least, most] = leaf.range.unwrap_or([0.0, 1e6]).map(|n| n as u64);
            let speed = 0.02 * n as f64 + 0.05;
            let response = ui.add(DragValue::new(&mut n).range(least..=most).speed(speed));
            probe::note(ui, &format!("setting {}", leaf.flag()), &response);
            response.changed().then(|| n.into())
        }
        "number" => {
            let mut x = value.as_f64().unwrap_or_default();
            let [least, most] = leaf.range.unwrap_or([f64::MIN, f64::MAX]);
            let response = ui.add(DragValue::new(&mut x).range(least..=most).speed(0.01).max_decimals(3));
            probe::note(ui, &format!("setting {}", leaf.flag()), &response);
            response.changed().then(|| x.into())
        }
        _ => names(ui, leaf, value),
    }
}

/// A method with its number.
fn method(ui: &mut Ui, group: &Group, value: &str) -> Option<Value> {
    let (name, n) = value.split_once(':').map_or((value, None), |(name, n)| (name, n.parse::<u32>().ok()));
    let mut changed = None;
    let combo = ComboBox::from_id_salt(group.name).selected_text(name).width(110.0).show_ui(ui, |ui| {
        for method in group.methods {
            let about = format!("{}\n{}", method.summary, method.source);
            let response = ui.selectable_label(method.name == name, method.name).on_hover_text(about);
            probe::note(ui, &format!("method {}", method.name), &response);
            if response.clicked() && method.name != name {
                changed = Some(Value::String(method.example()));
            }
        }
    });
    probe::note(ui, &format!("setting {}", group.name), &combo.response);
    let row = group.methods.iter().find(|m| m.name == name);
    if let (Some(range), Some(mut n)) = (row.and_then(|m| m.number.as_ref()), n) {
        let before = n;
        let drag = DragValue::new(&mut n).range(range.range.clone()).speed(0.15 * f64::from(range.step));
        let response = ui.add(drag).on_hover_text(range.counts);
        probe::note(ui, &format!("number {}", group.name), &response);
        let least = *range.range.start();
        let n = least + (n - least) / range.step * range.step;
        if n != before {
            changed = Some(Value::String(format!("{name}:{n}")));
        }
    }
    changed
}

/// One of several names.
fn names(ui: &mut Ui, leaf: &Leaf, value: &Value) -> Option<Value> {
    let text = value.as_str().unwrap_or("own");
    let mut changed = None;
    let combo = ComboBox::from_id_salt(leaf.flag()).selected_text(text).width(110.0).show_ui(ui, |ui| {
        let all =
            leaf.expected.split(|c: char| c == ',' || c.is_whitespace()).filter(|n| leaf.parse(n).is_ok());
        for name in all.filter(|n| !n.is_empty()) {
            let response = ui.selectable_label(name == text, name);
            probe::note(ui, &format!("name {name}"), &response);
            if response.clicked() && name != text {
                changed = leaf.parse(name).ok();
            }
        }
    });
    probe::note(ui, &format!("setting {}", leaf.flag()), &combo.response);
    changed
}

/// Any of several names.
fn list(ui: &mut Ui, leaf: &Leaf, value: &Value) -> Option<Value> {
    let chosen: Vec<String> = serde_json::from_value(value.clone()).unwrap_or_default();
    let mut next = chosen.clone();
    for name in leaf.expected.split(", ").filter(|n| !n.is_empty()) {
        let mut on = chosen.iter().any(|c| c == name);
        if switch(ui, &mut on, name, &leaf.about).changed() {
            if on { next.push(name.to_owned()) } else { next.retain(|n| n != name) }
        }
    }
    (next != chosen).then(|| serde_json::json!(next))
}

/// Milliseconds of the passes of the last frame.
fn passes(app: &App, ui: &mut Ui) {
    let times = app.picture.times();
    if times.passes_ms.is_empty() {
        ui.label(RichText::new("this device has no timestamps, or nothing was drawn yet").color(theme::WEAK));
        return;
    }
    // A pass that runs several times is one line.
    let mut sums: Vec<(&str, f64, u32)> = Vec::new();
    for (name, ms) in &times.passes_ms {
        match sums.iter_mut().find(|(known, ..)| known == name) {
            Some((_, sum, count)) => (*sum, *count) = (*sum + ms, *count + 1),
            None => sums.push((name, *ms, 1)),
        }
    }
    let most = sums.iter().map(|(_, ms, _)| *ms).fold(1e-9, f64::max);
    for (name, ms, count) in sums {
        let times = if count > 1 { format!(" x{count}") } else { String::new() };
        let text = RichText::new(format!("{name}{times}  {ms:.2} ms")).small();
        ui.add(
            ProgressBar::new((ms / most) as f32)
                .desired_height(15.0)
                .fill(theme::FILL)
                .corner_radius(2)
                .text(text),
        );
    }
    ui.label(RichText::new(format!("all: {:.2} ms on the device", times.frame_ms)).color(theme::WEAK));
}

/// How far the settings are from the reference, on demand.
fn error(app: &mut App, ui: &mut Ui) {
    ui.horizontal(|ui| {
        let about = "Draws this moment by the integral over the surface on a device of its own, and compares";
        ui.add_enabled_ui(!app.background.is_busy(), |ui| {
            if button(ui, "Measure", about).clicked() {
                app.background.add(Task::Compare(Still::of(&app.model)));
            }
        });
        if app.comparison.is_some() {
            switch(ui, &mut app.chosen.shows_difference, "Show", "Shows where the difference is seen");
        }
    });
    let Some((comparison, _)) = &app.comparison else {
        ui.label(RichText::new("not measured yet").color(theme::WEAK));
        return;
    };
    let [width, height] = comparison.size;
    let line = |ui: &mut Ui, name: &str, value: String| {
        ui.horizontal(|ui| {
            ui.label(RichText::new(name).color(theme::WEAK));
            ui.label(value);
        });
    };
    line(ui, "FLIP, mean", number(comparison.flip_mean, 4));
    line(ui, "FLIP, 99 %", number(comparison.flip_99, 4));
    line(ui, "relative RMSE", number(comparison.relative_rmse, 4));
    let scatter = comparison.settings.quality.scatter.to_string();
    ui.label(RichText::new(format!("{scatter} at {width} x {height}")).small().color(theme::WEAK));
    if comparison.settings.quality != app.model.settings.quality {
        ui.label(RichText::new("of other settings than those now").small().color(theme::ACCENT));
    }
}

/// The command line that renders the files with these settings.
pub(crate) fn command_line(app: &App) -> String {
    let mut line = "rubor render".to_owned();
    let quote = |text: &str| {
        if text.chars().all(|c| c.is_ascii_alphanumeric() || "-_./:,".contains(c)) {
            text.to_owned()
        } else {
            format!("'{}'", text.replace('\'', "'\\''"))
        }
    };
    let mut add = |flag: &str, value: &str| line += &format!(" --{flag} {}", quote(value));
    if let Some(head) = &app.model.head_path {
        add("head", &head.display().to_string());
    }
    for (kind, flag) in [(Kind::Rig, "rig"), (Kind::Sequence, "sequence")] {
        if let Some(path) = &app.model.document.part(kind).path {
            add(flag, &path.display().to_string());
        }
    }
    if !app.chosen.lights.is_empty() {
        add("lights", &app.chosen.lights);
    }
    let base = app.chosen.preset.unwrap_or(Preset::Review);
    add("preset", base.name());
    let of_base = Settings { quality: base.quality(), ..Settings::default() };
    let (now, then) = (serde_json::to_value(&app.model.settings), serde_json::to_value(of_base));
    let (now, then) = (now.unwrap_or_default(), then.unwrap_or_default());
    for leaf in leaves().iter().filter(|leaf| leaf.value_in(&now) != leaf.value_in(&then)) {
        let text = match leaf.value_in(&now) {
            Value::String(text) => text.clone(),
            Value::Array(all) => {
                let separator = if leaf.is_list { "," } else { "x" };
                let text = |v: &Value| v.as_str().map_or_else(|| v.to_string(), str::to_owned);
                all.iter().map(text).collect::<Vec<_>>().join(separator)
            }
            Value::Number(n) => n.as_f64().map_or_else(|| n.to_string(), |n| (n as f32).to_string()),
            other => other.to_string(),
        };
        add(&leaf.flag(), &text);
    }
    line + " -o out"
}
