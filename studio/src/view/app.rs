//! The window: takes what arrives, draws the picture when something has changed, shows the panels.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use eframe::egui::{self, Key, KeyboardShortcut, Modifiers, TextureHandle, TextureOptions, ViewportCommand};
use rubor_rig::json::Step;

use super::background::{Background, Comparison, Done, Task};
use super::document::Kind;
use super::frame::{Picture, Still};
use super::live::{Event, Live, LiveCount, Recorder};
use super::messages::About;
use super::model::Model;
use super::overlay::{Overlay, OverlayMaker};
use super::panels::{self, dialogs::Dialog, timeline::Selection};
use super::pose::Group;
use super::probe;
use super::script::Script;
use super::watch::{Role, Watcher, files_of_head};
use crate::error::Failure;
use crate::inputs;

/// A frame that takes longer is drawn smaller while something moves, milliseconds: ten a second and some time for the
/// window.
const MOVING_MS: f64 = 80.0;
/// The picture is at most this much smaller while something moves.
const MOST_DIVISOR: u32 = 4;
/// Something counts as moving until this long after the last change.
const SETTLES: Duration = Duration::from_millis(150);

/// The tab of the panel on the left.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Tab {
    /// Weights of the face at the time of the clock.
    #[default]
    Perform,
    /// Weights of an expression or a state of the rig.
    Rig,
}

/// What is chosen in the window and belongs to no file.
pub(crate) struct Chosen {
    /// The tab on the left.
    pub(crate) tab: Tab,
    /// Names that are looked for.
    pub(crate) search: String,
    /// Whether a moved slider becomes a key.
    pub(crate) sets_keys: bool,
    /// The expression or state of the rig that is edited.
    pub(crate) owner: Option<(Group, String)>,
    /// Whether it is shown alone.
    pub(crate) shows_alone: bool,
    /// Whether weights of 0 are shown too.
    pub(crate) shows_all: bool,
    /// Name of a new expression.
    pub(crate) new_name: String,
    /// The map over the picture.
    pub(crate) overlay: Overlay,
    /// Whether the picture is drawn smaller while something moves.
    pub(crate) draws_smaller: bool,
    /// Whether the picture is scaled to the window.
    pub(crate) fits: bool,
    /// Degrees a second that head or camera turn.
    pub(crate) turntable: Option<Turntable>,
    /// Name of the light rig.
    pub(crate) lights: String,
    /// Where weights are listened for.
    pub(crate) live_address: String,
    /// The preset that the settings started from.
    pub(crate) preset: Option<rubor_renderer::settings::Preset>,
    /// What is selected in the time line.
    pub(crate) selection: Selection,
    /// Whether the log is shown.
    pub(crate) shows_log: bool,
    /// Whether the error is shown instead of the picture.
    pub(crate) shows_difference: bool,
}

/// What turns by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turntable {
    /// The head.
    Head,
    /// The camera.
    Camera,
    /// The surroundings.
    Surroundings,
}

/// Degrees a second.
const TURN_SPEED: f32 = 30.0;

/// A socket and what is recorded from it.
pub(crate) struct Listening {
    /// The socket.
    pub(crate) live: Live,
    count: LiveCount,
    /// Who sends.
    pub(crate) sender: Option<String>,
    /// The recording that runs.
    pub(crate) recorder: Option<Recorder>,
    /// Messages that were taken.
    pub(crate) taken: u64,
}

/// Speed of the picture over the last second.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pace {
    shown: std::collections::VecDeque<Instant>,
}

impl Pace {
    fn tick(&mut self) {
        let now = Instant::now();
        self.shown.push_back(now);
        while self.shown.front().is_some_and(|t| now - *t > Duration::from_secs(1)) {
            self.shown.pop_front();
        }
    }

    /// Frames of the last second.
    pub(crate) fn per_second(&self) -> usize {
        self.shown.len()
    }
}

/// The window.
pub(crate) struct App {
    /// The session.
    pub(crate) model: Model,
    /// The picture.
    pub(crate) picture: Picture,
    /// What is chosen.
    pub(crate) chosen: Chosen,
    /// The question that is asked.
    pub(crate) dialog: Option<Dialog>,
    /// The socket.
    pub(crate) listening: Option<Listening>,
    /// The last comparison with the reference and its picture.
    pub(crate) comparison: Option<(Comparison, TextureHandle)>,
    /// Speed.
    pub(crate) pace: Pace,
    /// Work of other threads.
    pub(crate) background: Background,
    /// Whether it plays: when and where it started.
    pub(crate) playing: Option<(Instant, f64)>,
    watcher: Watcher,
    watched: Vec<(Role, PathBuf)>,
    overlay_maker: Option<(Arc<inputs::LoadedHead>, OverlayMaker)>,
    /// The map over the picture.
    pub(crate) overlay_texture: Option<TextureHandle>,
    /// What the picture shows: state, size divisor, overlay.
    shown: Option<(u64, u32, Overlay)>,
    /// Milliseconds of a frame of full size.
    full_ms: Option<f64>,
    changed_at: Instant,
    last_version: u64,
    turned_at: Instant,
    asked_still: Option<u64>,
    reads_head: bool,
    pub(super) script: Option<Script>,
    pub(super) outcome: Arc<Mutex<Option<Failure>>>,
    is_closing: bool,
    /// Whether the device is lost.
    is_lost: bool,
}

/// What a window starts with.
pub(crate) struct Start {
    /// The session.
    pub(crate) model: Model,
    /// The preset that its settings started from.
    pub(crate) preset: Option<rubor_renderer::settings::Preset>,
    /// Where weights are listened for.
    pub(crate) live: Option<std::net::SocketAddr>,
    /// The adapter by its number or a part of its name.
    pub(crate) adapter: Option<String>,
    /// Actions that are done in place of a person's.
    pub(crate) script: Option<Script>,
}

impl App {
    /// Puts a session into a window.
    ///
    /// # Errors
    /// The device refuses a shader; the address cannot be listened to.
    pub(crate) fn new(
        context: &eframe::CreationContext<'_>,
        start: Start,
        outcome: Arc<Mutex<Option<Failure>>>,
    ) -> Result<Self, Failure> {
        let ctx = &context.egui_ctx;
        super::theme::set(ctx);
        let Some(state) = context.wgpu_render_state.clone() else {
            return Err(Failure::job("the window has no device to draw with"));
        };
        let picture = Picture::new(state, waker(ctx))?;
        let is_software = picture.gpu().is_software();
        let mut app = Self {
            picture,
            chosen: Chosen {
                tab: Tab::default(),
                search: String::new(),
                sets_keys: false,
                owner: None,
                shows_alone: true,
                shows_all: false,
                new_name: String::new(),
                overlay: Overlay::None,
                draws_smaller: is_software,
                fits: true,
                turntable: None,
                lights: String::new(),
                live_address: super::live::DEFAULT_ADDRESS.to_owned(),
                preset: start.preset,
                selection: Selection::default(),
                shows_log: false,
                shows_difference: false,
            },
            dialog: None,
            listening: None,
            comparison: None,
            pace: Pace::default(),
            background: Background::new(start.adapter, waker(ctx)),
            playing: None,
            watcher: Watcher::new(waker(ctx)),
            watched: Vec::new(),
            overlay_maker: None,
            overlay_texture: None,
            shown: None,
            full_ms: None,
            changed_at: Instant::now(),
            last_version: 0,
            turned_at: Instant::now(),
            asked_still: None,
            reads_head: false,
            script: start.script,
            outcome,
            is_closing: false,
            is_lost: false,
            model: start.model,
        };
        if app.script.is_some() {
            probe::start(ctx);
            // Clicks of a script may take as long as a slow frame.
            ctx.options_mut(|options| options.input_options.max_click_duration = 60.0);
        }
        if let Some(address) = start.live {
            app.chosen.live_address = address.to_string();
            app.listen(ctx, address)?;
        }
        app.watch();
        Ok(app)
    }

    // ---- What arrives

    /// Listens to an address.
    ///
    /// # Errors
    /// It is in use.
    pub(crate) fn listen(
        &mut self,
        ctx: &egui::Context,
        address: std::net::SocketAddr,
    ) -> Result<(), Failure> {
        self.listening = None;
        let (live, count) = Live::listen(address, waker(ctx))?;
        self.model.messages.info(format!("listening to {}", live.address));
        if !live.address.ip().is_loopback() {
            self.model.messages.info("any machine that reaches this one can send weights");
        }
        self.chosen.live_address = live.address.to_string();
        self.model.messages.clear(About::Live);
        self.listening = Some(Listening { live, count, sender: None, recorder: None, taken: 0 });
        Ok(())
    }

    /// The files that belong to the session.
    fn watch(&mut self) {
        let mut files = Vec::new();
        for (kind, role) in [(Kind::Rig, Role::Rig), (Kind::Sequence, Role::Sequence)] {
            files.extend(self.model.document.part(kind).path.clone().map(|path| (role, path)));
        }
        let sequence = self.model.document.sequence();
        if let Some(path) = &self.model.document.part(Kind::Sequence).path {
            let folder = path.parent().map(std::path::Path::to_owned).unwrap_or_default();
            let capture =
                sequence.capture.iter().flat_map(|c| [Some(&c.file), c.retarget.as_ref()]).flatten();
            files.extend(capture.map(|file| (Role::Sequence, folder.join(file))));
        }
        if let Some(environment) = &self.model.composed().environment
            && !crate::environment::is_built_in(&environment.name)
        {
            files.push((Role::Environment, PathBuf::from(&environment.name)));
        }
        if let Some(head) = &self.model.head_path {
            files.extend(files_of_head(head).into_iter().map(|path| (Role::Head, path)));
        }
        if files != self.watched {
            self.watcher.set(files.clone());
            self.watched = files;
        }
    }

    fn take_changes(&mut self) {
        let changes = self.watcher.changes();
        if changes.is_empty() {
            return;
        }
        let mut roles: Vec<Role> = changes.iter().map(|c| c.role).collect();
        roles.sort();
        roles.dedup();
        for gone in changes.iter().filter(|c| c.is_gone) {
            let path = gone.path.display();
            self.model.messages.info(format!("{path} is gone; what was read from it stays"));
        }
        for role in roles {
            match role {
                Role::Rig => self.model.reload(Kind::Rig),
                Role::Sequence => self.model.reload(Kind::Sequence),
                Role::Head => {
                    if !self.reads_head {
                        self.reads_head = true;
                        self.background.add(Task::Read(self.model.head_path.clone()));
                    }
                }
                Role::Environment => {
                    self.picture.forget_surroundings();
                    self.model.touch();
                }
            }
        }
        self.watch();
    }

    fn take_live(&mut self) {
        let Some(mut listening) = self.listening.take() else { return };
        for (at, event) in listening.live.events(&listening.count) {
            match event {
                Event::Connected(who) => {
                    self.model.messages.info(format!("live: {who} is connected"));
                    listening.sender = Some(who);
                }
                Event::Weights(weights) => {
                    listening.taken += 1;
                    for unknown in self.model.take_live(&weights) {
                        self.model.messages.once(unknown);
                    }
                    if let Some(recorder) = &mut listening.recorder {
                        recorder.take(at, &self.model.live);
                    }
                }
                Event::Gone(who) => {
                    self.model.messages.info(format!("live: {who} is gone; the last weights stay"));
                    listening.sender = None;
                }
                Event::Wrong(why) => self.model.messages.once(format!("live: {why}")),
            }
        }
        self.listening = Some(listening);
    }

    /// Starts to record what arrives, or ends it and writes it as tracks.
    pub(crate) fn record(&mut self) {
        let Some(listening) = &mut self.listening else { return };
        match listening.recorder.take() {
            None => {
                let mut recorder = Recorder::new(Instant::now(), self.model.time_s);
                recorder.take(Instant::now(), &self.model.live);
                listening.recorder = Some(recorder);
                self.model.messages.info("recording");
            }
            Some(recorder) => {
                let (tracks, end_s) = recorder.tracks();
                if tracks.is_empty() {
                    self.model.messages.info("nothing was recorded: no weight changed");
                    return;
                }
                let keys: usize = tracks.iter().map(|(_, keys)| keys.len()).sum();
                let done = self.model.edit(|model| {
                    if end_s > model.duration_s() {
                        let end = super::syntax::number(end_s, 4);
                        model.document.set(
                            Kind::Sequence,
                            &[Step::from("duration")],
                            &end,
                            "recording",
                            Some("r"),
                        )?;
                    }
                    model.document.set_tracks(&tracks, "recording", Some("r"))?;
                    model.document.seal();
                    Ok(())
                });
                if done {
                    self.model.live = Default::default();
                    self.model.compose();
                    self.model.messages.info(format!("recorded {} tracks with {keys} keys", tracks.len()));
                }
            }
        }
    }

    fn take_done(&mut self, ctx: &egui::Context) {
        for done in self.background.done() {
            match done {
                Done::Read(head) => {
                    self.reads_head = false;
                    let before = self.model.head.clone();
                    if self.model.take_head(head)
                        && let Err(e) = self.picture.take_head(&self.model.head)
                    {
                        self.model.adopt(before);
                        self.model.messages.error(About::Head, e.to_string());
                    }
                    self.overlay_maker = None;
                    self.watch();
                }
                Done::Drawn(frame, version) => {
                    self.asked_still = None;
                    match frame {
                        Ok(frame) => {
                            self.picture.show(&frame);
                            self.shown = Some((version, 1, Overlay::None));
                            self.model.messages.clear(About::Device);
                        }
                        Err(e) => self.model.messages.error(About::Device, e.to_string()),
                    }
                }
                Done::Compared(Ok(comparison)) => {
                    let image = color_image(&comparison.difference);
                    let texture = ctx.load_texture("difference", image, TextureOptions::LINEAR);
                    self.model.messages.clear(About::Reference);
                    self.comparison = Some((comparison, texture));
                }
                Done::Compared(Err(e)) => self.model.messages.error(About::Reference, e.to_string()),
            }
        }
    }

    // ---- Time

    /// Starts or stops to play.
    pub(crate) fn play(&mut self) {
        self.playing = match self.playing {
            Some(_) => None,
            None => Some((Instant::now(), self.model.time_s)),
        };
    }

    /// Sets the clock by hand.
    pub(crate) fn seek_frame(&mut self, frame: i64) {
        self.model.seek_frame(frame);
        self.playing = self.playing.map(|_| (Instant::now(), self.model.time_s));
    }

    fn advance(&mut self, ctx: &egui::Context) {
        if let Some((start, from_s)) = self.playing {
            let duration = self.model.duration_s();
            let time_s = (from_s + start.elapsed().as_secs_f64()).rem_euclid(duration);
            self.model.seek_frame((time_s * self.model.fps()).floor() as i64);
            ctx.request_repaint_after(Duration::from_millis(8));
        }
        let now = Instant::now();
        let passed = (now - self.turned_at).as_secs_f32().min(0.5);
        self.turned_at = now;
        if let Some(turntable) = self.chosen.turntable {
            let view = &mut self.model.view;
            let angle = match turntable {
                Turntable::Head => &mut view.head_turn,
                Turntable::Camera => &mut view.orbit,
                Turntable::Surroundings => &mut view.environment_turn,
            };
            *angle = (*angle + TURN_SPEED * passed + 180.0).rem_euclid(360.0) - 180.0;
            self.model.compose();
            ctx.request_repaint_after(Duration::from_millis(8));
        }
    }

    /// Whether something moves right now.
    pub(crate) fn is_moving(&self) -> bool {
        self.playing.is_some() || self.chosen.turntable.is_some() || self.changed_at.elapsed() < SETTLES
    }

    // ---- The picture

    /// Whether nothing is drawn, read or waited for.
    pub(crate) fn is_idle(&self) -> bool {
        let wanted = (self.model.version(), 1, self.chosen.overlay);
        let is_shown = match self.shown {
            Some((version, ..)) if !Picture::draws_at_once(&self.model.settings) => version == wanted.0,
            shown => shown == Some(wanted),
        };
        is_shown && !self.picture.is_busy() && !self.background.is_busy() && !self.is_moving()
    }

    /// The picture in full size without an overlay.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) fn full_picture(&mut self) -> crate::Outcome<image::RgbImage> {
        if Picture::draws_at_once(&self.model.settings) {
            self.picture.draw(&self.model, 1, &[])?;
            self.shown = Some((self.model.version(), 1, Overlay::None));
        }
        self.picture.image()
    }

    /// How much smaller the picture is drawn now.
    pub(crate) fn divisor(&self) -> u32 {
        let full_ms = self.full_ms.unwrap_or(0.0);
        if !self.chosen.draws_smaller || !self.is_moving() || full_ms <= MOVING_MS {
            return 1;
        }
        ((full_ms / MOVING_MS).sqrt().ceil() as u32).clamp(1, MOST_DIVISOR)
    }

    /// Takes what the device has finished.
    fn poll(&mut self) -> crate::Outcome {
        let is_full =
            self.shown.is_some_and(|(_, divisor, overlay)| divisor == 1 && overlay == Overlay::None);
        if self.picture.poll()? && is_full {
            self.full_ms = Some(self.picture.frame_ms());
            if self.picture.drawn() == 1 {
                // The first frame compiles shaders; the second tells how long one takes.
                self.shown = None;
            }
        }
        Ok(())
    }

    fn draw(&mut self, ctx: &egui::Context) {
        if self.last_version != self.model.version() {
            self.last_version = self.model.version();
            self.changed_at = Instant::now();
        }
        let wanted = (self.model.version(), self.divisor(), self.chosen.overlay);
        if self.shown == Some(wanted) || self.is_lost {
            return;
        }
        if wanted.1 > 1 {
            // Drawn in full once things have settled.
            ctx.request_repaint_after(SETTLES + Duration::from_millis(10));
        }
        if !Picture::draws_at_once(&self.model.settings) {
            let is_shown = self.shown.is_some_and(|(version, ..)| version == wanted.0);
            if self.asked_still.is_none() && !is_shown {
                self.asked_still = Some(wanted.0);
                self.background.add(Task::Draw(Still::of(&self.model), wanted.0));
            }
            return;
        }
        if self.picture.is_busy() {
            if !self.picture.gpu().is_software() || !self.is_moving() {
                // The device tells when it is done.
                return;
            }
            // A processor draws window and picture in turn: without a new picture, painting the window would hold it up.
            self.picture.wait();
            if let Err(e) = self.poll() {
                return self.device_failed(ctx, &e);
            }
        }
        let channels = wanted.2.channels();
        match self.picture.draw(&self.model, wanted.1, channels) {
            Ok(()) => {
                self.model.messages.clear(About::Device);
                self.shown = Some(wanted);
                self.pace.tick();
                self.model.messages.notes(&self.picture.take_notes());
                if wanted.2 != Overlay::None {
                    self.draw_overlay(ctx, wanted.2);
                }
            }
            Err(e) => {
                self.shown = Some(wanted);
                self.device_failed(ctx, &e);
            }
        }
    }

    fn draw_overlay(&mut self, ctx: &egui::Context, overlay: Overlay) {
        let channels: Result<Vec<_>, Failure> =
            overlay.channels().iter().map(|channel| self.picture.read(*channel)).collect();
        let channels = match channels {
            Ok(channels) => channels,
            Err(e) => return self.device_failed(ctx, &e),
        };
        let Some(ids) = channels.first().filter(|ids| ids.size[0] > 0) else { return };
        let head = self.model.head.clone();
        if self.overlay_maker.as_ref().is_none_or(|(known, _)| !Arc::ptr_eq(known, &head)) {
            self.overlay_maker = Some((head.clone(), OverlayMaker::new(&head.head)));
        }
        let Some((_, maker)) = &mut self.overlay_maker else { return };
        let rgba = maker.paint(overlay, (&head.head, &self.model.shot()), ids, channels.get(1));
        let size = ids.size.map(|n| n as usize);
        let image = egui::ColorImage::from_rgba_unmultiplied(size, &rgba);
        match &mut self.overlay_texture {
            Some(texture) => texture.set(image, TextureOptions::LINEAR),
            None => self.overlay_texture = Some(ctx.load_texture("overlay", image, TextureOptions::LINEAR)),
        }
    }

    fn device_failed(&mut self, ctx: &egui::Context, e: &Failure) {
        self.model.messages.error(About::Device, e.to_string());
        // Errors of input, as surroundings that do not load, leave the device as it is.
        if e.fault() == crate::Fault::Input || !self.picture.is_lost() || self.is_lost {
            return;
        }
        self.is_lost = true;
        // A window on a lost device shows nothing any more.
        let failure = self.rescue(&e.to_string());
        self.end(ctx, Some(failure));
    }

    /// Writes what is not saved beside its files. What happened and where the work is, in words.
    fn rescue(&mut self, what: &str) -> Failure {
        let mut message = what.to_owned();
        match self.model.document.rescue() {
            Ok(files) if files.is_empty() => message += "; nothing was unsaved",
            Ok(files) => {
                let names: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
                message += &format!("; what was not saved is in {}", names.join(" and "));
            }
            Err(rescue) => message += &format!("; what was not saved cannot be written: {rescue}"),
        }
        Failure::job(message)
    }

    // ---- The end

    /// Closes the window without a question.
    pub(crate) fn end(&mut self, ctx: &egui::Context, failure: Option<Failure>) {
        if let (Some(failure), Ok(mut slot)) = (failure, self.outcome.lock()) {
            slot.get_or_insert(failure);
        }
        self.is_closing = true;
        ctx.send_viewport_cmd(ViewportCommand::Close);
    }

    fn ask_before_closing(&mut self, ctx: &egui::Context) {
        if !ctx.input(|i| i.viewport().close_requested()) || self.is_closing {
            return;
        }
        if self.model.document.is_changed() {
            ctx.send_viewport_cmd(ViewportCommand::CancelClose);
            self.dialog = Some(Dialog::Close);
        }
    }

    /// Saves; what has no file asks for a name.
    pub(crate) fn save(&mut self) {
        let unnamed = self.model.save();
        self.saved();
        if let Some(kind) = unnamed.first() {
            self.dialog = Some(Dialog::save_as(*kind));
        }
    }

    /// What this window wrote is no news.
    pub(crate) fn saved(&mut self) {
        for kind in Kind::ALL {
            if let Some(path) = &self.model.document.part(kind).path {
                self.watcher.know(path);
            }
        }
        self.watch();
    }

    fn shortcuts(&mut self, ctx: &egui::Context) {
        if self.dialog.is_some() {
            return;
        }
        let command = |key| KeyboardShortcut::new(Modifiers::COMMAND, key);
        let with_shift = |key| KeyboardShortcut::new(Modifiers::COMMAND | Modifiers::SHIFT, key);
        let pressed = |shortcut: KeyboardShortcut| ctx.input_mut(|i| i.consume_shortcut(&shortcut));
        if pressed(command(Key::S)) {
            self.save();
        }
        if ctx.text_edit_focused() {
            return;
        }
        if pressed(with_shift(Key::Z)) || pressed(command(Key::Y)) {
            self.model.redo();
        } else if pressed(command(Key::Z)) {
            self.model.undo();
        }
        let key = |key| ctx.input_mut(|i| i.consume_key(Modifiers::NONE, key));
        let frame = i64::from(self.model.frame());
        // A widget that has the focus takes space and arrows for itself.
        let is_free = ctx.memory(|m| m.focused().is_none());
        if is_free && key(Key::Space) {
            self.play();
        } else if is_free && key(Key::ArrowLeft) {
            self.seek_frame(frame - 1);
        } else if is_free && key(Key::ArrowRight) {
            self.seek_frame(frame + 1);
        } else if key(Key::Home) {
            self.seek_frame(0);
        } else if key(Key::End) {
            self.seek_frame(i64::MAX / 2);
        } else if key(Key::K) {
            self.model.edit(Model::key_held);
        } else if key(Key::Delete) {
            panels::timeline::delete_selected(self);
        } else if key(Key::R) {
            self.model.view =
                super::model::View { lights: self.model.view.lights.clone(), ..Default::default() };
            self.model.compose();
        }
    }
}

impl Drop for App {
    /// The painter of the window panics where its device fails in the middle of a frame: the work is kept all the same.
    fn drop(&mut self) {
        if std::thread::panicking() && !self.is_lost {
            let failure = self.rescue("the window failed");
            if let Ok(mut slot) = self.outcome.lock() {
                slot.get_or_insert(failure);
            }
        }
    }
}

impl eframe::App for App {
    fn raw_input_hook(&mut self, ctx: &egui::Context, input: &mut egui::RawInput) {
        if let Some(mut script) = self.script.take() {
            let events = script.step(self, ctx);
            input.events.extend(events);
            // A virtual display has nobody who gives windows the focus.
            input.focused = true;
            if !script.is_done() {
                ctx.request_repaint();
                self.script = Some(script);
            }
        }
    }

    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        let ctx = ui.ctx().clone();
        // What is painted onto a lost device ends the program.
        if let Err(e) = self.poll() {
            self.device_failed(&ctx, &e);
        }
        if self.is_lost {
            return;
        }
        self.take_changes();
        self.take_live();
        self.take_done(&ctx);
        self.ask_before_closing(&ctx);
        self.shortcuts(&ctx);
        self.advance(&ctx);
        probe::begin_frame(&ctx, self.script.as_ref().and_then(Script::wanted));
        panels::top::show(self, ui);
        panels::status::show(self, ui);
        panels::timeline::show(self, ui);
        panels::perform::show_left(self, ui);
        panels::settings::show(self, ui);
        self.draw(&ctx);
        panels::picture::show(self, ui);
        panels::dialogs::show(self, &ctx);
    }
}

/// Wakes the window from another thread.
pub(crate) fn waker(ctx: &egui::Context) -> impl Fn() + Send + Sync + 'static + use<> {
    let ctx = ctx.clone();
    move || ctx.request_repaint()
}

/// A picture as the window takes it.
pub(crate) fn color_image(picture: &image::RgbImage) -> egui::ColorImage {
    egui::ColorImage::from_rgb([picture.width() as usize, picture.height() as usize], picture.as_raw())
}
