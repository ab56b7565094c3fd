//! The panel on the left: weights of the face, or of the rig.

use std::collections::BTreeMap;

use eframe::egui::{CollapsingHeader, Color32, Frame, Margin, Panel, RichText, ScrollArea, TextEdit, Ui};
use rubor_rig::names::{Key as NameKey, Side, action_units, canonical};

use super::super::app::{App, Tab};
use super::super::model::Model;
use super::super::pose::Group;
use super::super::probe;
use super::super::theme;
use super::weight::{Bar, bar};
use super::{button, rig, switch};

/// Shows it.
pub(crate) fn show_left(app: &mut App, ui: &mut Ui) {
    let frame = Frame::new().fill(theme::PANEL).inner_margin(Margin::symmetric(8, 6));
    Panel::left("weights").frame(frame).default_size(300.0).size_range(220.0..=520.0).show(ui, |ui| {
        ui.horizontal(|ui| {
            for (tab, name) in [(Tab::Perform, "Perform"), (Tab::Rig, "Rig")] {
                let response = ui.selectable_label(app.chosen.tab == tab, RichText::new(name).strong());
                probe::note(ui, &format!("tab {name}"), &response);
                if response.clicked() {
                    app.chosen.tab = tab;
                }
            }
            let width = ui.available_width();
            let search =
                TextEdit::singleline(&mut app.chosen.search).hint_text("search").desired_width(width);
            let response = ui.add(search);
            probe::note(ui, "field search", &response);
        });
        let solo = match app.chosen.tab {
            Tab::Rig if app.chosen.shows_alone => app.chosen.owner.clone(),
            _ => None,
        };
        if app.model.solo != solo {
            app.model.solo = solo;
            app.model.compose();
        }
        match app.chosen.tab {
            Tab::Perform => perform(app, ui),
            Tab::Rig => rig::show(app, ui),
        }
    });
}

fn perform(app: &mut App, ui: &mut Ui) {
    ui.horizontal(|ui| {
        if button(ui, "Key", "Sets keys of all held weights at this time (K)").clicked() {
            app.model.edit(Model::key_held);
        }
        let about = "A slider that was moved becomes a key at once";
        switch(ui, &mut app.chosen.sets_keys, "Auto key", about);
        let held = app.model.pose.len();
        ui.add_enabled_ui(held > 0, |ui| {
            if button(ui, "Release", "Lets all weights go back to their tracks").clicked() {
                app.model.release_all();
            }
        });
        if held > 0 {
            ui.label(RichText::new(format!("{held} held")).color(theme::ACCENT));
        }
    });
    ui.horizontal(|ui| {
        let about = "Left and right move together";
        switch(ui, &mut app.model.links_pairs, "Link pairs", about);
        if button(ui, "Mirror", "Exchanges the weights of left and right").clicked() {
            app.model.mirror();
        }
    });
    ui.add_space(2.0);
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        for group in Group::ALL {
            let (names, weights) = (app.model.names(group), app.model.weights(group));
            let rows = rows(&names, &app.chosen.search);
            if rows.is_empty() && !app.chosen.search.is_empty() {
                continue;
            }
            let title = format!("{} ({})", group.heading(), names.len());
            let header =
                CollapsingHeader::new(RichText::new(title).strong()).default_open(true).id_salt(group);
            header.show(ui, |ui| {
                if names.is_empty() {
                    ui.label(RichText::new("none on this head or in this rig").color(theme::WEAK));
                }
                if group == Group::Shapes && app.chosen.search.is_empty() {
                    by_region(app, ui, &names, &weights, rows);
                } else {
                    rows.into_iter().for_each(|row| show_row(app, ui, group, &names, &weights, row));
                }
            });
        }
    });
}

/// A name, or both halves of one: left and right in the picture, so the character's right first.
enum Row {
    One(usize),
    Pair { right: usize, left: usize },
}

/// The rows of names in which a text is found.
fn rows(names: &[String], search: &str) -> Vec<Row> {
    let wanted = search.trim().to_lowercase();
    let keys: Vec<NameKey> = names.iter().map(|n| NameKey::new(n)).collect();
    let mut rows = Vec::new();
    for (i, key) in keys.iter().enumerate() {
        if !names[i].to_lowercase().contains(&wanted) {
            continue;
        }
        let whole = key.base == "jaw" || key.base == "mouth";
        let other = |side| keys.iter().position(|k| k.base == key.base && k.side == Some(side));
        match key.side.filter(|_| !whole) {
            Some(Side::Left) => match other(Side::Right) {
                Some(right) => rows.push(Row::Pair { right, left: i }),
                None => rows.push(Row::One(i)),
            },
            // Shown with its left half.
            Some(Side::Right)
                if other(Side::Left).is_some_and(|l| names[l].to_lowercase().contains(&wanted)) => {}
            _ => rows.push(Row::One(i)),
        }
    }
    rows
}

/// Shapes under the regions of a face.
fn by_region(app: &mut App, ui: &mut Ui, names: &[String], weights: &[f32], rows: Vec<Row>) {
    let mut regions: BTreeMap<usize, Vec<Row>> = BTreeMap::new();
    for row in rows {
        let (Row::One(i) | Row::Pair { left: i, .. }) = row;
        regions.entry(region(&names[i])).or_default().push(row);
    }
    for (region, rows) in regions {
        ui.label(RichText::new(REGIONS[region].0).small().color(theme::WEAK));
        rows.into_iter().for_each(|row| show_row(app, ui, Group::Shapes, names, weights, row));
    }
}

/// Regions and how names in them begin, in ARKit's spelling.
const REGIONS: [(&str, &[&str]); 6] = [
    ("Brows", &["brow"]),
    ("Eyes", &["eye", "pupil"]),
    ("Cheeks and nose", &["cheek", "nose"]),
    ("Jaw", &["jaw"]),
    ("Mouth and tongue", &["mouth", "tongue", "viseme", "lip"]),
    ("Others", &[]),
];

fn region(name: &str) -> usize {
    let name = canonical(name).unwrap_or(name).to_lowercase();
    let others = REGIONS.len() - 1;
    REGIONS.iter().position(|(_, starts)| starts.iter().any(|s| name.starts_with(s))).unwrap_or(others)
}

fn show_row(app: &mut App, ui: &mut Ui, group: Group, names: &[String], weights: &[f32], row: Row) {
    let width = ui.available_width();
    match row {
        Row::One(i) => show_weight(app, ui, group, &names[i], &names[i], weights[i], width),
        Row::Pair { right, left } => {
            ui.horizontal(|ui| {
                ui.spacing_mut().item_spacing.x = 3.0;
                let half = 0.5 * (width - 3.0);
                let label = short(&names[left]);
                show_weight(app, ui, group, &names[right], &format!("R {label}"), weights[right], half);
                show_weight(app, ui, group, &names[left], &format!("L {label}"), weights[left], half);
            });
        }
    }
}

/// A name without its side.
fn short(name: &str) -> &str {
    let lower = name.to_lowercase();
    let ends = ["left", "_l", "-l", ".l"];
    ends.iter()
        .find(|end| lower.ends_with(*end))
        .map_or(name, |end| name[..name.len() - end.len()].trim_end_matches(['-', '_', '.', ' ']))
}

fn show_weight(app: &mut App, ui: &mut Ui, group: Group, name: &str, label: &str, weight: f32, width: f32) {
    let is_held = app.model.pose.of(group).contains_key(name);
    let is_live = app.model.live.of(group).contains_key(name);
    let most = if matches!(group, Group::Expressions | Group::States) { weight.max(1.0) } else { 1.0 };
    let low = if weight < 0.0 { -1.0 } else { 0.0 };
    let units = action_units(name).join(", ");
    let units = if units.is_empty() { units } else { format!(" ({units})") };
    let shown = bar(
        ui,
        &Bar {
            label,
            name: format!("{} {name}", group.word()),
            value: weight,
            range: [low, most],
            fill: fill(is_held, is_live),
            is_held,
            about: format!("{name}{units}\ndrag, double click for a number, right click to let go"),
        },
        width,
    );
    if let Some(value) = shown.value {
        app.model.hold(group, name, value);
    }
    if shown.is_released {
        app.model.release(group, name);
    }
    if shown.is_done && app.chosen.sets_keys && group != Group::Zones {
        let both = std::iter::once(name.to_owned()).chain(app.model.linked(group, name));
        let both: Vec<(Group, String)> = both.map(|n| (group, n)).collect();
        app.model.edit(|model| model.key(&both));
    }
}

fn fill(is_held: bool, is_live: bool) -> Color32 {
    match (is_held, is_live) {
        (true, _) => theme::ACCENT.gamma_multiply(0.6),
        (false, true) => theme::LIVE,
        _ => theme::FILL,
    }
}
