//! Camera, turntable, light and what arrives live: sections of the panel on the right.

use eframe::egui::{ComboBox, DragValue, RichText, TextEdit, Ui};
use rubor_rig::json::Step;
use rubor_rig::lights::LIGHT_RIGS;

use super::super::app::{App, Turntable};
use super::super::document::Kind;
use super::super::messages::About;
use super::super::model::View;
use super::super::probe;
use super::super::syntax::{self, number};
use super::super::theme;
use super::{button, switch};
use crate::inputs;

/// The camera of the view, and what turns.
pub(crate) fn camera(app: &mut App, ui: &mut Ui) {
    let before = app.model.view.clone();
    let view = &mut app.model.view;
    let degrees = |ui: &mut Ui, name: &str, value: &mut f32, most: f32| {
        ui.horizontal(|ui| {
            ui.label(RichText::new(name).color(theme::WEAK));
            ui.add_space((112.0 - ui.min_rect().width()).max(0.0));
            let drag = DragValue::new(value).range(-most..=most).suffix("°").speed(0.5).max_decimals(1);
            let response = ui.add(drag);
            probe::note(ui, &format!("view {name}"), &response);
        });
    };
    degrees(ui, "orbit", &mut view.orbit, 180.0);
    degrees(ui, "elevation", &mut view.elevation, 89.0);
    degrees(ui, "head turn", &mut view.head_turn, 180.0);
    ui.horizontal(|ui| {
        ui.label(RichText::new("distance").color(theme::WEAK));
        ui.add_space((112.0 - ui.min_rect().width()).max(0.0));
        ui.add(
            DragValue::new(&mut view.distance).range(0.1..=10.0).speed(0.005).max_decimals(2).suffix(" x"),
        );
    });
    if *view != before {
        app.model.compose();
    }
    ui.horizontal(|ui| {
        ui.label(RichText::new("turn").color(theme::WEAK));
        for (turntable, name) in
            [(Turntable::Head, "head"), (Turntable::Camera, "camera"), (Turntable::Surroundings, "light")]
        {
            let mut on = app.chosen.turntable == Some(turntable);
            if switch(ui, &mut on, name, "Turns by 30 degrees a second").changed() {
                app.chosen.turntable = on.then_some(turntable);
            }
        }
    });
    ui.horizontal(|ui| {
        if button(ui, "Reset view", "The camera of the sequence again (R, or a double click)").clicked() {
            app.model.view = View { lights: app.model.view.lights.clone(), ..View::default() };
            app.chosen.turntable = None;
            app.model.compose();
        }
        let about = "Writes orbit, elevation, position and target of this view into the sequence";
        ui.add_enabled_ui(app.model.view.has_own_camera(), |ui| {
            if button(ui, "Keep camera", about).clicked() {
                keep_camera(app);
            }
        });
    });
}

/// Writes the camera of the view into the sequence, in place of its tracks.
fn keep_camera(app: &mut App) {
    let shot = app.model.shot();
    let origin = rubor_rig::framing::FaceFrame::of(&app.model.head.head).origin;
    let composed = app.model.composed();
    let (orbit, elevation) = (
        composed.camera.orbit_degrees.at(app.model.time_s),
        composed.camera.elevation_degrees.at(app.model.time_s),
    );
    let moved = app.model.view.distance != 1.0 || app.model.view.pan != [0.0; 2];
    let away = shot.camera.position - shot.camera.target;
    // The orbit turns what lies between target and position: taken back here.
    let turn = glam::Quat::from_euler(glam::EulerRot::YXZ, orbit.to_radians(), -elevation.to_radians(), 0.0);
    let straight = turn.inverse() * away;
    let triple = |v: glam::Vec3| {
        let numbers = v.to_array().map(|n| number(f64::from(n), 4));
        format!("[{}]", numbers.join(", "))
    };
    let target = shot.camera.target - origin;
    let written = app.model.edit(|model| {
        let mut text = model.document.part(Kind::Sequence).text().to_owned();
        let mut set = |field: &str, value: String| -> crate::Outcome {
            let path = [Step::from("camera"), Step::from(field)];
            text = syntax::set(&text, &path, &value).map_err(crate::Failure::input)?;
            Ok(())
        };
        set("orbitDegrees", number(f64::from(orbit), 2))?;
        set("elevationDegrees", number(f64::from(elevation), 2))?;
        if moved {
            set("target", triple(target))?;
            set("position", triple(target + straight))?;
        }
        model.document.replace(Kind::Sequence, text, "camera", None)
    });
    if written {
        let lights = app.model.view.lights.clone();
        let (environment_turn, head_turn) = (app.model.view.environment_turn, app.model.view.head_turn);
        app.model.view = View { lights, environment_turn, head_turn, ..View::default() };
        app.model.compose();
    }
}

/// Light rigs and the turn of the surroundings.
pub(crate) fn light(app: &mut App, ui: &mut Ui) {
    ui.horizontal(|ui| {
        ui.label(RichText::new("rig").color(theme::WEAK));
        ui.add_space((112.0 - ui.min_rect().width()).max(0.0));
        let text = match app.chosen.lights.as_str() {
            "" => "of the sequence",
            name => name,
        };
        let mut wanted = None;
        let combo = ComboBox::from_id_salt("lights").selected_text(text).width(130.0).show_ui(ui, |ui| {
            let names = std::iter::once("").chain(LIGHT_RIGS.iter().map(|(name, _)| *name));
            for name in names {
                let shown = if name.is_empty() { "of the sequence" } else { name };
                let response = ui.selectable_label(app.chosen.lights == name, shown);
                probe::note(ui, &format!("lights {shown}"), &response);
                if response.clicked() {
                    wanted = Some(name.to_owned());
                }
            }
        });
        probe::note(ui, "lights", &combo.response);
        if let Some(name) = wanted {
            relight(app, &name);
        }
    });
    let before = app.model.view.environment_turn;
    ui.horizontal(|ui| {
        ui.label(RichText::new("surroundings").color(theme::WEAK));
        ui.add_space((112.0 - ui.min_rect().width()).max(0.0));
        let turn = &mut app.model.view.environment_turn;
        let response =
            ui.add(DragValue::new(turn).range(-180.0..=180.0).suffix("°").speed(1.0).max_decimals(1));
        probe::note(ui, "view surroundings", &response);
    });
    if before != app.model.view.environment_turn {
        app.model.compose();
    }
    ui.add_enabled_ui(app.model.view.lights.is_some(), |ui| {
        if button(ui, "Keep lights", "Writes these lights into the sequence").clicked() {
            keep_lights(app);
        }
    });
}

fn relight(app: &mut App, name: &str) {
    app.chosen.lights = name.to_owned();
    app.model.view.lights = None;
    if !name.is_empty() {
        match inputs::lights(name) {
            Ok(lights) => app.model.view.lights = Some(lights),
            Err(e) => app.model.messages.error(About::Edit, e.to_string()),
        }
    }
    app.model.compose();
}

fn keep_lights(app: &mut App) {
    let Some(lights) = app.model.view.lights.clone() else { return };
    let text = |value: &Result<serde_json::Value, serde_json::Error>| match value {
        // As deep as a field of a sequence.
        Ok(value) => Ok(serde_json::to_string_pretty(value).unwrap_or_default().replace('\n', "\n  ")),
        Err(e) => Err(crate::Failure::input(e)),
    };
    let written = app.model.edit(|model| {
        let lamps = text(&serde_json::to_value(&lights.lights))?;
        let mut whole = model.document.part(Kind::Sequence).text().to_owned();
        whole = syntax::set(&whole, &[Step::from("lights")], &lamps).map_err(crate::Failure::input)?;
        if let Some(environment) = &lights.environment {
            let environment = text(&serde_json::to_value(environment))?;
            let path = [Step::from("environment")];
            whole = syntax::set(&whole, &path, &environment).map_err(crate::Failure::input)?;
        }
        model.document.replace(Kind::Sequence, whole, "lights", None)
    });
    if written {
        app.chosen.lights.clear();
        app.model.view.lights = None;
        app.model.compose();
    }
}

/// What arrives over the socket.
pub(crate) fn live(app: &mut App, ui: &mut Ui) {
    ui.horizontal(|ui| {
        ui.add(TextEdit::singleline(&mut app.chosen.live_address).desired_width(150.0));
        let is_on = app.listening.is_some();
        let about =
            "Takes weights from Maya (JSON lines), Open Sound Control and Live Link Face at this address";
        if button(ui, if is_on { "Stop" } else { "Listen" }, about).clicked() {
            if is_on {
                app.listening = None;
                app.model.live = Default::default();
                app.model.compose();
            } else {
                let ctx = ui.ctx().clone();
                let address = app.chosen.live_address.trim().parse();
                let listened = match address {
                    Ok(address) => app.listen(&ctx, address).map_err(|e| e.to_string()),
                    Err(_) => Err(format!(
                        "live: found {:?}, expected ADDRESS:PORT, such as 127.0.0.1:47511",
                        app.chosen.live_address
                    )),
                };
                if let Err(e) = listened {
                    app.model.messages.error(About::Live, e);
                }
            }
        }
    });
    let Some(listening) = &app.listening else { return };
    let who = listening.sender.as_deref().unwrap_or("nobody is connected by TCP");
    ui.label(RichText::new(format!("{who}; {} messages", listening.taken)).color(theme::WEAK));
    let seconds = listening.recorder.as_ref().map(|r| r.length_s(std::time::Instant::now()));
    ui.horizontal(|ui| {
        let text = if seconds.is_some() { "End recording" } else { "Record" };
        let about = "Writes what arrives as tracks of the sequence, from the time of the clock on";
        if button(ui, text, about).clicked() {
            app.record();
        }
        if let Some(seconds) = seconds {
            ui.label(RichText::new(format!("{seconds:.1} s")).color(theme::ACCENT));
            ui.ctx().request_repaint_after(std::time::Duration::from_millis(100));
        }
        if button(ui, "Let go", "Forgets the weights that arrived").clicked() {
            app.model.live = Default::default();
            app.model.compose();
        }
    });
}
