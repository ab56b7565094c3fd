//! The rig: what an expression or a state does at full weight, shown alone while it is edited.

use std::collections::BTreeMap;

use eframe::egui::{CollapsingHeader, ComboBox, RichText, ScrollArea, TextEdit, Ui};
use rubor_rig::names::Resolver;

use super::super::app::App;
use super::super::pose::Group;
use super::super::probe;
use super::super::theme;
use super::weight::{Bar, bar};
use super::{button, switch};

/// Shows it.
pub(crate) fn show(app: &mut App, ui: &mut Ui) {
    let owners: Vec<(Group, String)> = [Group::Expressions, Group::States]
        .iter()
        .flat_map(|g| app.model.names(*g).into_iter().map(|name| (*g, name)))
        .collect();
    if app.chosen.owner.as_ref().is_none_or(|owner| !owners.contains(owner)) {
        app.chosen.owner = owners.first().cloned();
    }
    ui.horizontal(|ui| {
        let text = app.chosen.owner.as_ref().map_or("none", |(_, name)| name.as_str()).to_owned();
        let combo = ComboBox::from_id_salt("owner").selected_text(text).width(130.0).show_ui(ui, |ui| {
            for (group, name) in &owners {
                let is_chosen = app.chosen.owner.as_ref() == Some(&(*group, name.clone()));
                let response = ui.selectable_label(is_chosen, format!("{name}  ({})", group.word()));
                probe::note(ui, &format!("owner {name}"), &response);
                if response.clicked() {
                    app.chosen.owner = Some((*group, name.clone()));
                }
            }
        });
        probe::note(ui, "owner", &combo.response);
        switch(ui, &mut app.chosen.shows_alone, "Alone", "Shows it alone at full weight");
        switch(ui, &mut app.chosen.shows_all, "All", "Shows weights of 0 too, to add them");
    });
    ui.horizontal(|ui| {
        let width = 130.0;
        let field =
            TextEdit::singleline(&mut app.chosen.new_name).hint_text("new expression").desired_width(width);
        let response = ui.add(field);
        probe::note(ui, "field new expression", &response);
        if button(ui, "Add", "Adds an expression of this name to the rig").clicked() {
            let name = app.chosen.new_name.trim().to_owned();
            if app.model.edit(|model| model.add_expression(&name)) {
                app.chosen.owner = Some((Group::Expressions, name));
                app.chosen.new_name.clear();
                app.chosen.shows_all = true;
            }
        }
        switch(ui, &mut app.model.links_pairs, "Link pairs", "Left and right move together");
    });
    let Some((group, owner)) = app.chosen.owner.clone() else {
        ui.label(RichText::new("the rig has no expression yet").color(theme::WEAK));
        return;
    };
    ui.add_space(2.0);
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| weights(app, ui, group, &owner));
}

fn weights(app: &mut App, ui: &mut Ui, group: Group, owner: &str) {
    let rig = app.model.document.rig();
    let (fields, scale) = match group {
        Group::States => {
            let Some(state) = rig.states.get(owner) else { return };
            (vec![("hemoglobin", &state.hemoglobin)], state.hemoglobin_scale)
        }
        _ => {
            let Some(e) = rig.expressions.get(owner) else { return };
            let fields =
                vec![("shapes", &e.shapes), ("wrinkles", &e.wrinkles), ("hemoglobin", &e.hemoglobin)];
            (fields, e.hemoglobin_scale)
        }
    };
    let head = &app.model.head.head;
    let known = |field: &str| -> (Vec<String>, Resolver) {
        match field {
            "shapes" => (app.model.names(Group::Shapes), Resolver::shapes(head)),
            "wrinkles" => (app.model.names(Group::Zones), Resolver::zones(head)),
            _ => (
                head.maps.distributions.iter().map(|d| d.name.clone()).collect(),
                Resolver::distributions(head),
            ),
        }
    };
    // Weights by the names of the head, then those that the head has nothing for.
    let mut lists = Vec::new();
    for (field, weights) in fields {
        let (names, resolver) = known(field);
        let mut rows: Vec<(String, f32, bool)> = Vec::new();
        let mut strange: Vec<(String, f32)> = Vec::new();
        let mut by_index: BTreeMap<u32, f32> = BTreeMap::new();
        for (written, weight) in weights {
            let targets = resolver.resolve(written);
            match &targets[..] {
                [] => strange.push((written.clone(), *weight)),
                all => all.iter().for_each(|t| *by_index.entry(t.index).or_default() += weight * t.factor),
            }
        }
        for (i, name) in names.into_iter().enumerate() {
            let weight = by_index.get(&(i as u32)).copied();
            rows.push((name, weight.unwrap_or_default(), weight.is_some()));
        }
        lists.push((field, rows, strange));
    }
    let search = app.chosen.search.trim().to_lowercase();
    for (field, rows, strange) in lists {
        let title = match field {
            "shapes" => "Shapes",
            "wrinkles" => "Wrinkle zones",
            _ => "Hemoglobin distributions",
        };
        let header = CollapsingHeader::new(RichText::new(title).strong()).default_open(true).id_salt(field);
        header.show(ui, |ui| {
            let low = if field == "hemoglobin" { 0.0 } else { -1.0 };
            for (name, weight, is_there) in rows {
                let is_wanted = is_there && weight != 0.0 || app.chosen.shows_all || !search.is_empty();
                if !is_wanted || !name.to_lowercase().contains(&search) {
                    continue;
                }
                let shown = bar(
                    ui,
                    &Bar {
                        label: &name,
                        name: format!("rig {field} {name}"),
                        value: weight,
                        range: [if weight < 0.0 { low } else { 0.0 }, 1.0],
                        fill: theme::FILL,
                        is_held: false,
                        about: format!(
                            "{owner}: {field} {name}\ndrag, or double click for a number, also a negative one"
                        ),
                    },
                    ui.available_width(),
                );
                if let Some(value) = shown.value {
                    app.model.edit(|model| model.set_rig_weight((group, owner), field, &name, value));
                }
                if shown.is_done {
                    app.model.document.seal();
                }
            }
            for (name, weight) in strange {
                let text = format!("{name} {weight}: the head has none");
                ui.label(RichText::new(text).small().color(theme::WEAK));
            }
        });
    }
    let shown = bar(
        ui,
        &Bar {
            label: "hemoglobinScale",
            name: "rig hemoglobinScale".to_owned(),
            value: scale,
            range: [0.0, 2.0],
            fill: theme::FILL,
            is_held: false,
            about: format!("{owner}: factor of all blood at full weight; 1 changes nothing"),
        },
        ui.available_width(),
    );
    if let Some(value) = shown.value {
        app.model.edit(|model| model.set_hemoglobin_scale((group, owner), value));
    }
    if shown.is_done {
        app.model.document.seal();
    }
}
