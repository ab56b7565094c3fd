//! Actions in place of a person's, for tests and for the pictures of the documentation: a JSON object a line.
//!
//! ```text
//! {"drag": "shape jawOpen", "to": 0.6}          moves a slider to a value
//! {"drag": "picture", "by": [80, 20]}           drags something by points of the window
//! {"click": "button Save"}                      clicks; "double": true twice
//! {"press": "Z", "ctrl": true}                  presses a key
//! {"type": "rig.json"}                          types a text
//! {"seek": 2.5}                                 sets the clock, seconds
//! {"write": "rig.json", "text": "..."}          writes a file, as an editor does; {"remove": FILE}
//! {"until": "idle"}                             waits for: idle, error, no error, or a text in the log
//! {"wait": 0.5}                                 waits, seconds
//! {"picture": "a.png"} {"screenshot": "b.png"}  writes the picture, or all of the window
//! {"report": "r.json"}                          writes what the window knows
//! {"measure": 20, "drag": "shape jawOpen"}      moves a slider and counts frames; the report has the result
//! {"repeat": 10, "steps": [...]}                does steps again and again
//! {"lose": "device"}                            destroys the device
//! {"close": true}                               closes the window, as its frame does
//! ```
//!
//! Pointer and keys go through the window's input, so widgets do what they do for a hand.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use eframe::egui::{self, Event, Key, Modifiers, PointerButton, Pos2, ViewportCommand, vec2};
use serde::{Deserialize, Serialize};

use super::app::App;
use super::panels::dialogs::write_picture;
use super::pose::Group;
use super::probe;
use crate::error::{Failure, Outcome};
use crate::output;

/// A step fails when it has waited this long.
const PATIENCE: Duration = Duration::from_secs(600);

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Line {
    drag: Option<String>,
    to: Option<f32>,
    by: Option<[f32; 2]>,
    click: Option<String>,
    double: bool,
    secondary: bool,
    press: Option<String>,
    ctrl: bool,
    shift: bool,
    r#type: Option<String>,
    seek: Option<f64>,
    write: Option<PathBuf>,
    text: Option<String>,
    remove: Option<PathBuf>,
    until: Option<String>,
    wait: Option<f64>,
    picture: Option<PathBuf>,
    screenshot: Option<PathBuf>,
    report: Option<PathBuf>,
    measure: Option<u32>,
    repeat: Option<u32>,
    steps: Vec<Line>,
    lose: Option<String>,
    close: bool,
}

/// Steps that are done one after the other.
pub struct Script {
    lines: VecDeque<Line>,
    /// Where the pointer is, and what it still has to do, a frame each.
    moves: VecDeque<Vec<Event>>,
    since: Instant,
    frames: u32,
    wanted: Option<String>,
    /// Where the wanted widget was in the last frame: it may still be scrolled.
    last: Option<egui::Rect>,
    screenshot: Arc<Mutex<Option<Arc<egui::ColorImage>>>>,
    asked: bool,
    measured: Option<Measured>,
    measuring: Option<(Instant, u64)>,
}

/// Speed of the window while a slider moved.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct Measured {
    frames: u64,
    seconds: f64,
    frames_per_second: f64,
}

impl Script {
    /// Reads a script.
    ///
    /// # Errors
    /// A file that cannot be read; a line that is no step.
    pub fn read(path: &Path) -> Outcome<Self> {
        let text = rubor_rig::json::read_text(path)?;
        let mut lines = VecDeque::new();
        for (i, line) in text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty()) {
            let read: Line = serde_json::from_str(line)
                .map_err(|e| Failure::input(format!("{}:{}: {e}", path.display(), i + 1)))?;
            add(read, &mut lines);
        }
        Ok(Self {
            lines,
            moves: VecDeque::new(),
            since: Instant::now(),
            frames: 0,
            wanted: None,
            last: None,
            screenshot: Arc::default(),
            asked: false,
            measured: None,
            measuring: None,
        })
    }

    /// A widget that is to be scrolled into view.
    pub fn wanted(&self) -> Option<&str> {
        self.wanted.as_deref()
    }

    /// Whether all steps are done.
    pub fn is_done(&self) -> bool {
        self.lines.is_empty() && self.moves.is_empty()
    }

    /// Does what can be done before a frame, and gives the input of that frame.
    pub(super) fn step(&mut self, app: &mut App, ctx: &egui::Context) -> Vec<Event> {
        if let Some(events) = self.moves.pop_front() {
            return events;
        }
        self.frames += 1;
        let Some(line) = self.lines.front().cloned() else { return Vec::new() };
        match self.work(&line, app, ctx) {
            Ok(true) => {
                self.lines.pop_front();
                self.since = Instant::now();
                (self.frames, self.wanted, self.asked) = (0, None, false);
            }
            Ok(false) if self.since.elapsed() > PATIENCE => {
                self.fail(app, ctx, &format!("waited {} s for {line:?}", PATIENCE.as_secs()));
            }
            Ok(false) => {}
            Err(e) => self.fail(app, ctx, &e.to_string()),
        }
        self.moves.pop_front().unwrap_or_default()
    }

    fn fail(&mut self, app: &mut App, ctx: &egui::Context, why: &str) {
        self.lines.clear();
        self.moves.clear();
        let log: Vec<&str> = app.model.messages.log().rev().take(8).collect();
        let failure = Failure::job(format!("script: {why}; the log, newest first: {log:?}"));
        app.end(ctx, Some(failure));
    }

    /// Whether the step is done.
    fn work(&mut self, line: &Line, app: &mut App, ctx: &egui::Context) -> Outcome<bool> {
        if let Some(frames) = line.measure {
            return self.measure(frames, line.drag.as_deref().unwrap_or_default(), app, ctx);
        }
        if let Some(name) = &line.drag {
            let Some(found) = self.find(name, ctx)? else { return Ok(false) };
            let from = found.rect.center();
            let to = match (line.to, found.range, line.by) {
                (Some(value), Some([low, high]), _) => {
                    let share = (value - low) / (high - low);
                    Pos2::new(found.rect.left() + share * found.rect.width(), from.y)
                }
                (_, _, Some([x, y])) => from + vec2(x, y),
                _ => {
                    return Err(Failure::input(format!(
                        "script: {name:?} is dragged `to` a value or `by` points"
                    )));
                }
            };
            self.drag(from, to, line);
            return Ok(true);
        }
        if let Some(name) = &line.click {
            let Some(found) = self.find(name, ctx)? else { return Ok(false) };
            let at = found.rect.center();
            let button = if line.secondary { PointerButton::Secondary } else { PointerButton::Primary };
            self.moves.push_back(vec![Event::PointerMoved(at)]);
            for _ in 0..if line.double { 2 } else { 1 } {
                self.moves.push_back(vec![pressed(at, button, true)]);
                self.moves.push_back(vec![pressed(at, button, false)]);
            }
            self.moves.push_back(Vec::new());
            return Ok(true);
        }
        if let Some(name) = &line.press {
            let key =
                Key::from_name(name).ok_or_else(|| Failure::input(format!("script: no key {name:?}")))?;
            let modifiers =
                Modifiers { ctrl: line.ctrl, command: line.ctrl, shift: line.shift, ..Modifiers::NONE };
            for pressed in [true, false] {
                let event = Event::Key { key, physical_key: None, pressed, repeat: false, modifiers };
                self.moves.push_back(vec![Event::ModifiersChanged(modifiers), event]);
            }
            self.moves.push_back(vec![Event::ModifiersChanged(Modifiers::NONE)]);
            return Ok(true);
        }
        if let Some(text) = &line.r#type {
            self.moves.push_back(vec![Event::Text(text.clone())]);
            self.moves.push_back(Vec::new());
            return Ok(true);
        }
        if let Some(time_s) = line.seek {
            app.model.seek(time_s);
            return Ok(true);
        }
        if let (Some(path), Some(text)) = (&line.write, &line.text) {
            std::fs::write(path, text).map_err(|e| Failure::write(path, e))?;
            return Ok(true);
        }
        if let Some(path) = &line.remove {
            std::fs::remove_file(path).map_err(|e| Failure::write(path, e))?;
            return Ok(true);
        }
        if let Some(what) = &line.until {
            let has_error = app.model.messages.errors().next().is_some();
            return Ok(match what.as_str() {
                "idle" => self.frames > 2 && app.is_idle(),
                "error" => has_error,
                "no error" => !has_error,
                text => app.model.messages.log().any(|l| l.contains(text)),
            });
        }
        if let Some(seconds) = line.wait {
            return Ok(self.since.elapsed().as_secs_f64() > seconds);
        }
        if let Some(path) = &line.picture {
            return match write_picture(app, path) {
                true => Ok(true),
                false => Err(Failure::job("the picture was not written")),
            };
        }
        if let Some(path) = &line.screenshot {
            return self.screenshot(path, ctx);
        }
        if let Some(path) = &line.report {
            output::write_json(path, &self.report(app))?;
            return Ok(true);
        }
        if line.lose.is_some() {
            app.picture.gpu().device.destroy();
            app.model.touch();
            return Ok(true);
        }
        if line.close {
            ctx.send_viewport_cmd(ViewportCommand::Close);
            return Ok(true);
        }
        Err(Failure::input(format!("script: found no action in {line:?}")))
    }

    /// A widget, once it is in view.
    fn find(&mut self, name: &str, ctx: &egui::Context) -> Outcome<Option<probe::Found>> {
        // The window needs some frames to scroll and to open what was clicked.
        const FRAMES: u32 = 240;
        self.wanted = Some(name.to_owned());
        if self.frames < 3 {
            return Ok(None);
        }
        let found = probe::find(ctx, name);
        let stands = found.is_some_and(|found| self.last == Some(found.rect));
        self.last = found.map(|found| found.rect);
        match found {
            Some(found) if stands => Ok(Some(found)),
            Some(_) => Ok(None),
            None if self.frames < FRAMES => Ok(None),
            None => {
                let near =
                    probe::nearest(ctx, name).map(|n| format!("; did you mean {n:?}?")).unwrap_or_default();
                Err(Failure::input(format!("there is no widget {name:?} in view{near}")))
            }
        }
    }

    fn drag(&mut self, from: Pos2, to: Pos2, line: &Line) {
        let button = if line.secondary { PointerButton::Secondary } else { PointerButton::Primary };
        self.moves.push_back(vec![Event::PointerMoved(from)]);
        self.moves.push_back(vec![pressed(from, button, true)]);
        for i in 1..=4 {
            // Some way around at first, so that it counts as a drag even where it ends near its start.
            let on_way =
                from.lerp(to, i as f32 / 4.0) + if i == 1 { vec2(12.0, 0.0) } else { vec2(0.0, 0.0) };
            self.moves.push_back(vec![Event::PointerMoved(on_way)]);
        }
        self.moves.push_back(vec![Event::PointerMoved(to)]);
        self.moves.push_back(vec![pressed(to, button, false)]);
        self.moves.push_back(Vec::new());
    }

    /// Moves a slider by itself until a number of frames were shown.
    fn measure(&mut self, frames: u32, name: &str, app: &mut App, ctx: &egui::Context) -> Outcome<bool> {
        let Some(found) = self.find(name, ctx)? else { return Ok(false) };
        let is_first = self.measuring.is_none();
        let (start, first) = *self.measuring.get_or_insert_with(|| (Instant::now(), app.picture.drawn()));
        let drawn = app.picture.drawn() - first;
        let share = 0.5 + 0.4 * (start.elapsed().as_secs_f32() * 2.0).sin();
        let at = Pos2::new(found.rect.left() + share * found.rect.width(), found.rect.center().y);
        if drawn >= u64::from(frames) {
            let seconds = start.elapsed().as_secs_f64();
            self.measured =
                Some(Measured { frames: drawn, seconds, frames_per_second: drawn as f64 / seconds });
            self.measuring = None;
            self.moves.push_back(vec![pressed(at, PointerButton::Primary, false)]);
            return Ok(true);
        }
        let mut events = vec![Event::PointerMoved(at)];
        if is_first {
            events.push(pressed(at, PointerButton::Primary, true));
        }
        self.moves.push_back(events);
        Ok(false)
    }

    fn screenshot(&mut self, path: &Path, ctx: &egui::Context) -> Outcome<bool> {
        if !self.asked {
            self.asked = true;
            let slot = self.screenshot.clone();
            let callback = egui::ScreenshotCallback::new(move |image| {
                if let Ok(mut slot) = slot.lock() {
                    *slot = Some(image);
                }
            });
            ctx.send_viewport_cmd(ViewportCommand::Screenshot(callback));
            return Ok(false);
        }
        let Some(image) = self.screenshot.lock().ok().and_then(|mut slot| slot.take()) else {
            return Ok(false);
        };
        let [width, height] = image.size.map(|n| n as u32);
        let rgb: Vec<u8> = image.pixels.iter().flat_map(|p| [p.r(), p.g(), p.b()]).collect();
        let picture = image::RgbImage::from_raw(width, height, rgb)
            .ok_or_else(|| Failure::job("the screenshot is incomplete"))?;
        output::save_picture(path, &picture)?;
        Ok(true)
    }

    fn report(&self, app: &App) -> serde_json::Value {
        let model = &app.model;
        let weights = |group: Group| -> serde_json::Map<String, serde_json::Value> {
            let pairs = model.names(group).into_iter().zip(model.weights(group));
            pairs.filter(|(_, w)| *w != 0.0).map(|(n, w)| (n, w.into())).collect()
        };
        serde_json::json!({
            "timeSeconds": model.time_s,
            "frame": model.frame() + 1,
            "expressions": weights(Group::Expressions),
            "states": weights(Group::States),
            "shapes": weights(Group::Shapes),
            "zones": weights(Group::Zones),
            "held": model.pose.len(),
            "live": model.live.len(),
            "isChanged": model.document.is_changed(),
            "steps": model.document.history().len(),
            "errors": model.messages.errors().map(|(_, text)| text).collect::<Vec<_>>(),
            "log": model.messages.log().collect::<Vec<_>>(),
            "adapter": app.picture.adapter(),
            "frameMs": app.picture.frame_ms(),
            "passesMs": app.picture.times().frame_ms,
            "drawn": app.picture.drawn(),
            "headBytes": app.picture.head_bytes(),
            "settings": model.settings,
            "measured": self.measured,
            "comparison": app.comparison.as_ref().map(|(c, _)| serde_json::json!({
                "flipMean": c.flip_mean, "flip99": c.flip_99, "relativeRmse": c.relative_rmse, "size": c.size,
            })),
            "residentBytes": resident_bytes(),
        })
    }
}

/// Adds a line, a repeated one as often as it says.
fn add(line: Line, lines: &mut VecDeque<Line>) {
    match line.repeat {
        None => lines.push_back(line),
        Some(times) => {
            for _ in 0..times {
                line.steps.iter().for_each(|step| add(step.clone(), lines));
            }
        }
    }
}

fn pressed(pos: Pos2, button: PointerButton, pressed: bool) -> Event {
    Event::PointerButton { pos, button, pressed, modifiers: Modifiers::NONE }
}

/// Memory of this process that is in use, where the system tells.
pub fn resident_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    // Pages of 4 KiB on the systems that have this file.
    Some(4096 * text.split_whitespace().nth(1)?.parse::<u64>().ok()?)
}
