//! The state of a session without any window: what is edited, what stands in front of it, what is seen.
//!
//! ```text
//! Document + live Pose + Pose + View --compose--> Sequence --Evaluator--> Shot at the time of the clock
//! ```
//!
//! Whatever is wrong is a message and leaves the last good evaluator in place.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;
use rubor_renderer::settings::Settings;
use rubor_rig::error::summed;
use rubor_rig::evaluate::{Evaluator, Shot};
use rubor_rig::json::Step;
use rubor_rig::names::{Resolver, is_known_shape, nearest};
use rubor_rig::timeline::{Sequence, Track};

use super::document::{Document, Kind, Reload};
use super::messages::{About, Messages};
use super::pose::{Group, Pose, pairs, shape_weights};
use super::tracks::{self, path_of};
use crate::error::{Failure, Outcome};
use crate::inputs::{self, LoadedHead};
use crate::job::Lighting;

/// What is opened.
#[derive(Clone, Debug, Default)]
pub struct Files {
    /// The head; none is the built-in one.
    pub head: Option<PathBuf>,
    /// The rig.
    pub rig: Option<PathBuf>,
    /// The sequence.
    pub sequence: Option<PathBuf>,
}

/// How the scene is looked at, without any change of the sequence.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Added to the orbit of the camera, degrees.
    pub orbit: f32,
    /// Added to its elevation, degrees.
    pub elevation: f32,
    /// Factor of its distance.
    pub distance: f32,
    /// Shift of camera and target to the right and up, in heights of the picture at the face.
    pub pan: [f32; 2],
    /// Added to the rotation of the surroundings, degrees.
    pub environment_turn: f32,
    /// Lights in place of those of the sequence.
    pub lights: Option<Lighting>,
    /// Added to the yaw of the head, degrees.
    pub head_turn: f32,
}

impl Default for View {
    fn default() -> Self {
        Self {
            orbit: 0.0,
            elevation: 0.0,
            distance: 1.0,
            pan: [0.0; 2],
            environment_turn: 0.0,
            lights: None,
            head_turn: 0.0,
        }
    }
}

impl View {
    /// Whether the camera is that of the sequence.
    pub fn has_own_camera(&self) -> bool {
        (self.orbit, self.elevation, self.distance, self.pan) != (0.0, 0.0, 1.0, [0.0; 2])
    }
}

/// A session.
pub struct Model {
    /// The head.
    pub head: Arc<LoadedHead>,
    /// Its file.
    pub head_path: Option<PathBuf>,
    /// Rig and sequence.
    pub document: Document,
    /// Weights of sliders that were moved.
    pub pose: Pose,
    /// Weights that arrived.
    pub live: Pose,
    /// Camera, lights and turns.
    pub view: View,
    /// How frames are made.
    pub settings: Settings,
    /// Seconds from the start of the sequence.
    pub time_s: f64,
    /// An expression or state of the rig that is shown alone at full weight while it is edited.
    pub solo: Option<(Group, String)>,
    /// What is wrong and what was done.
    pub messages: Messages,
    /// Whether both halves of a pair move together.
    pub links_pairs: bool,
    shapes: Resolver,
    shape_pairs: Vec<Option<usize>>,
    zone_pairs: Vec<Option<usize>>,
    evaluator: Evaluator,
    composed: Sequence,
    version: u64,
}

impl Model {
    /// Opens the files. `settings` makes settings of the size that the sequence asks for.
    ///
    /// # Errors
    /// A file that is missing or wrong, with its place.
    pub fn open(
        files: &Files,
        settings: impl FnOnce(Option<[u32; 2]>) -> Outcome<Settings>,
    ) -> Outcome<Self> {
        let head_path = files.head.as_deref().map(inputs::absolute).transpose()?;
        let head = inputs::head(head_path.as_deref())?;
        let document = Document::open(&head, files.rig.as_deref(), files.sequence.as_deref())?;
        let settings = settings(document.sequence().size)?;
        let (evaluator, notes) = Evaluator::new(&head.head, document.rig(), document.sequence())?;
        let mut messages = Messages::default();
        messages.notes(&head.notes);
        messages.notes(document.notes());
        summed(&notes).iter().for_each(|note| messages.info(note.to_string()));
        let composed = document.sequence().clone();
        let mut model = Self {
            shapes: Resolver::shapes(&head.head),
            shape_pairs: pairs(head.head.shapes.iter().map(|s| s.name.as_str())),
            zone_pairs: pairs(head.head.maps.zones.iter().map(|z| z.name.as_str())),
            head: Arc::new(head),
            head_path,
            document,
            pose: Pose::default(),
            live: Pose::default(),
            view: View::default(),
            settings,
            time_s: 0.0,
            solo: None,
            messages,
            links_pairs: true,
            evaluator,
            composed,
            version: 0,
        };
        model.compose();
        Ok(model)
    }

    /// A number that changes with everything that a picture shows.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Says that a picture has to be drawn anew.
    pub fn touch(&mut self) {
        self.version += 1;
    }

    /// The sequence as it is drawn: with what stands in front of its tracks.
    pub fn composed(&self) -> &Sequence {
        &self.composed
    }

    /// Resolves names of shapes of the head.
    pub fn shape_names(&self) -> &Resolver {
        &self.shapes
    }

    /// Length, seconds.
    pub fn duration_s(&self) -> f64 {
        self.document.sequence().duration
    }

    /// Frames per second.
    pub fn fps(&self) -> f64 {
        self.document.sequence().fps
    }

    /// The frame at the time of the clock, from 0.
    pub fn frame(&self) -> u32 {
        let last = self.document.sequence().frame_count() - 1;
        ((self.time_s * self.fps()).round().max(0.0) as u32).min(last)
    }

    /// Sets the clock, within the sequence.
    pub fn seek(&mut self, time_s: f64) {
        let time_s = time_s.clamp(0.0, self.duration_s());
        if time_s != self.time_s {
            self.time_s = time_s;
            self.touch();
        }
    }

    /// Sets the clock to a frame, from 0.
    pub fn seek_frame(&mut self, frame: i64) {
        let last = i64::from(self.document.sequence().frame_count() - 1);
        self.seek(self.document.sequence().frame_time_s(frame.clamp(0, last) as u32));
    }

    /// Puts what stands in front of the sequence into place. A fault leaves the last good state and is a message.
    pub fn compose(&mut self) {
        self.touch();
        let mut sequence = self.document.sequence().clone();
        if let Some(lights) = &self.view.lights {
            sequence.lights.clone_from(&lights.lights);
            sequence.environment.clone_from(&lights.environment);
        }
        if let Some((group, name)) = &self.solo {
            sequence.expressions.clear();
            sequence.states.clear();
            sequence.shapes.clear();
            (sequence.life, sequence.eyes) = (None, None);
            match group {
                Group::States => sequence.states.insert(name.clone(), Track::Constant(1.0)),
                _ => sequence.expressions.insert(name.clone(), Track::Constant(1.0)),
            };
        } else {
            self.live.apply(&mut sequence, &self.shapes);
            self.pose.apply(&mut sequence, &self.shapes);
        }
        if let Some(environment) = &mut sequence.environment {
            shift(&mut environment.rotation_degrees, self.view.environment_turn, None);
        }
        shift(&mut sequence.head.yaw_degrees, self.view.head_turn, None);
        shift(&mut sequence.camera.orbit_degrees, self.view.orbit, None);
        shift(&mut sequence.camera.elevation_degrees, self.view.elevation, Some(89.0));
        match Evaluator::new(&self.head.head, self.document.rig(), &sequence) {
            Ok((evaluator, _)) => {
                self.evaluator = evaluator;
                self.composed = sequence;
                self.messages.clear(About::Scene);
            }
            Err(e) => self.messages.error(About::Scene, e.to_string()),
        }
        self.time_s = self.time_s.clamp(0.0, self.duration_s());
    }

    /// Everything that the picture shows now.
    pub fn shot(&self) -> Shot {
        self.shot_at(self.time_s)
    }

    /// Everything that the picture shows at a time.
    pub fn shot_at(&self, time_s: f64) -> Shot {
        let mut shot = self.evaluator.at(time_s);
        if self.solo.is_none() {
            for (zone, weight) in self.head.head.maps.zones.iter().zip(&mut shot.face.zones) {
                if let Some(held) = self.pose.zones.get(&zone.name) {
                    *weight = *held;
                }
            }
        }
        let camera = &mut shot.camera;
        let away = camera.position - camera.target;
        let right = camera.up.cross(away).normalize_or_zero();
        let up = away.cross(right).normalize_or_zero();
        let height = 2.0 * away.length() * (0.5 * camera.fov_y).tan();
        let pan: Vec3 = height * (self.view.pan[0] * right + self.view.pan[1] * up);
        camera.target += pan;
        camera.position = camera.target + away * self.view.distance;
        shot
    }

    // ---- Weights

    /// Names of a group, in order.
    pub fn names(&self, group: Group) -> Vec<String> {
        match group {
            Group::Expressions => self.document.rig().expressions.keys().cloned().collect(),
            Group::States => self.document.rig().states.keys().cloned().collect(),
            Group::Shapes => self.head.head.shapes.iter().map(|s| s.name.clone()).collect(),
            Group::Zones => self.head.head.maps.zones.iter().map(|z| z.name.clone()).collect(),
        }
    }

    /// Weights of a group as the sliders show them now, in the order of [`Model::names`]. Those of shapes are what single
    /// tracks give, those of zones what the face has.
    pub fn weights(&self, group: Group) -> Vec<f32> {
        let at = |tracks: &std::collections::BTreeMap<String, Track<f32>>, name: &String| {
            tracks.get(name).map_or(0.0, |track| track.at(self.time_s))
        };
        match group {
            Group::Expressions => {
                self.names(group).iter().map(|n| at(&self.composed.expressions, n)).collect()
            }
            Group::States => self.names(group).iter().map(|n| at(&self.composed.states, n)).collect(),
            Group::Shapes => shape_weights(&self.composed, &self.head.head, &self.shapes, self.time_s),
            Group::Zones => self.shot().face.zones,
        }
    }

    /// The other half of a name, if both move together.
    pub fn linked(&self, group: Group, name: &str) -> Option<String> {
        if self.links_pairs { self.other_half(group, name) } else { None }
    }

    /// The other half of a name.
    pub fn other_half(&self, group: Group, name: &str) -> Option<String> {
        let pairs = match group {
            Group::Shapes => &self.shape_pairs,
            Group::Zones => &self.zone_pairs,
            _ => return None,
        };
        let names = self.names(group);
        let index = names.iter().position(|n| n == name)?;
        names.get((*pairs.get(index)?)?).cloned()
    }

    /// Holds a weight, and that of the other half if both move together.
    pub fn hold(&mut self, group: Group, name: &str, weight: f32) {
        let other = self.linked(group, name);
        let held = self.pose.of_mut(group);
        held.insert(name.to_owned(), weight);
        if let Some(other) = other {
            held.insert(other, weight);
        }
        self.compose();
    }

    /// Lets a weight go back to its track.
    pub fn release(&mut self, group: Group, name: &str) {
        let other = self.linked(group, name);
        let held = self.pose.of_mut(group);
        held.remove(name);
        if let Some(other) = other {
            held.remove(&other);
        }
        self.compose();
    }

    /// Lets all weights go back to their tracks.
    pub fn release_all(&mut self) {
        self.pose = Pose::default();
        self.compose();
    }

    /// Exchanges the weights of left and right.
    pub fn mirror(&mut self) {
        for group in [Group::Shapes, Group::Zones] {
            let (names, weights) = (self.names(group), self.weights(group));
            let pairs =
                if group == Group::Shapes { self.shape_pairs.clone() } else { self.zone_pairs.clone() };
            for (i, other) in pairs.iter().enumerate().filter_map(|(i, p)| Some((i, (*p)?))) {
                if weights[i] != weights[other] {
                    self.pose.of_mut(group).insert(names[i].clone(), weights[other]);
                }
            }
        }
        self.compose();
    }

    /// Writes the held weights as keys at the time of the clock, as one step, and lets them go. Zones stay held: no sequence
    /// has tracks of them.
    ///
    /// # Errors
    /// A weight that a track cannot have.
    pub fn key_held(&mut self) -> Outcome {
        let names: Vec<(Group, String)> = [Group::Expressions, Group::States, Group::Shapes]
            .iter()
            .flat_map(|g| self.pose.of(*g).keys().map(|name| (*g, name.clone())))
            .collect();
        let keyed = self.key(&names);
        if keyed.is_ok() && !self.pose.zones.is_empty() {
            self.messages.info("zones stay held: expressions of the rig move them, tracks do not");
        }
        keyed
    }

    /// Writes weights as keys at the time of the clock, as one step, and lets them go back to their tracks.
    ///
    /// # Errors
    /// A weight that a track cannot have; a shape that a track moves only in part.
    pub fn key(&mut self, names: &[(Group, String)]) -> Outcome {
        let mut keys = Vec::new();
        for (group, name) in names {
            let Some(field) = group.field() else { continue };
            let index = self.names(*group).iter().position(|n| n == name);
            let Some(weight) = index.and_then(|i| self.weights(*group).get(i).copied()) else { continue };
            if *group != Group::Shapes {
                keys.push((path_of(field, name), weight));
                continue;
            }
            let track = self.track_of_shape(name)?;
            let path = path_of(field, &track);
            if !keys.iter().any(|(p, _)| *p == path) {
                keys.push((path, weight));
            }
        }
        if keys.is_empty() {
            return Err(Failure::input("nothing is held: move a slider first, then set its key"));
        }
        self.document.set_keys(&keys, self.time_s)?;
        for (group, name) in names.iter().filter(|(g, _)| g.field().is_some()) {
            self.pose.of_mut(*group).remove(name);
        }
        self.compose();
        Ok(())
    }

    /// The track that a key of a shape goes to. A track of both halves stays one while both have one weight, else it is
    /// written as two.
    fn track_of_shape(&mut self, shape: &str) -> Outcome<String> {
        let names = self.names(Group::Shapes);
        let weights = self.weights(Group::Shapes);
        let Some(index) = names.iter().position(|n| n == shape) else { return Ok(shape.to_owned()) };
        let written: Vec<String> = self.document.sequence().shapes.keys().cloned().collect();
        for track in written {
            let targets = self.shapes.resolve(&track);
            if !targets.iter().any(|t| t.index as usize == index) {
                continue;
            }
            if targets.iter().any(|t| t.factor != 1.0) {
                let message =
                    format!("{shape}: the track {track:?} moves it in part; set keys of that track");
                return Err(Failure::input(message));
            }
            let weight = |t: &rubor_rig::names::Target| weights.get(t.index as usize).copied();
            if targets.iter().all(|t| weight(t) == weights.get(index).copied()) {
                return Ok(track);
            }
            let halves: Vec<String> =
                targets.iter().filter_map(|t| names.get(t.index as usize).cloned()).collect();
            self.document.split_track(&track, &halves)?;
            self.messages.info(format!("the track {track:?} became {}", halves.join(" and ")));
        }
        Ok(shape.to_owned())
    }

    // ---- The rig

    /// Sets a weight of an expression or a state in the rig: `field` is `shapes`, `wrinkles` or `hemoglobin`. The other half
    /// of a pair moves along if both do.
    ///
    /// # Errors
    /// A weight that the rig cannot have.
    pub fn set_rig_weight(
        &mut self,
        (group, owner): (Group, &str),
        field: &str,
        name: &str,
        weight: f32,
    ) -> Outcome {
        let of = match field {
            "shapes" => Some(Group::Shapes),
            "wrinkles" => Some(Group::Zones),
            _ => None,
        };
        let other = of.and_then(|of| self.linked(of, name));
        let base = [Step::from(group.field().unwrap_or("expressions")), Step::Key(owner.to_owned())];
        let label = format!("{owner}: {field} {name}");
        let mark = format!("{owner}.{field}.{name}");
        for name in std::iter::once(name.to_owned()).chain(other) {
            let written = self.rig_name((group, owner), field, &name);
            let path = [&base[..], &[Step::from(field), Step::Key(written)]].concat();
            let text = super::syntax::number(f64::from(weight), 3);
            self.document.set(Kind::Rig, &path, &text, &label, Some(&mark))?;
        }
        self.compose();
        Ok(())
    }

    /// The spelling that the rig has for a name of the head.
    fn rig_name(&self, (group, owner): (Group, &str), field: &str, name: &str) -> String {
        let Some(expression) =
            self.document.rig().expressions.get(owner).filter(|_| group == Group::Expressions)
        else {
            return name.to_owned();
        };
        let zones = Resolver::zones(&self.head.head);
        let (weights, resolver) = match field {
            "shapes" => (&expression.shapes, &self.shapes),
            "wrinkles" => (&expression.wrinkles, &zones),
            _ => return name.to_owned(),
        };
        let own = resolver.names().position(|n| n == name).map(|i| i as u32);
        let is_own = |written: &&String| {
            let targets = resolver.resolve(written);
            matches!(&targets[..], [only] if Some(only.index) == own)
        };
        weights.keys().find(is_own).cloned().unwrap_or_else(|| name.to_owned())
    }

    /// Sets the factor of hemoglobin of an expression or a state.
    ///
    /// # Errors
    /// A factor that the rig cannot have.
    pub fn set_hemoglobin_scale(&mut self, (group, owner): (Group, &str), scale: f32) -> Outcome {
        let path = [
            Step::from(group.field().unwrap_or("expressions")),
            Step::Key(owner.to_owned()),
            Step::from("hemoglobinScale"),
        ];
        let text = super::syntax::number(f64::from(scale), 3);
        let label = format!("{owner}: hemoglobinScale");
        self.document.set(Kind::Rig, &path, &text, &label, Some(&label))?;
        self.compose();
        Ok(())
    }

    /// Adds an empty expression to the rig.
    ///
    /// # Errors
    /// It has one of that name; no name.
    pub fn add_expression(&mut self, name: &str) -> Outcome {
        let name = name.trim();
        if name.is_empty() || self.document.rig().expressions.contains_key(name) {
            let found = if name.is_empty() { "no name".to_owned() } else { format!("{name:?} again") };
            return Err(Failure::input(format!("new expression: found {found}, expected a new name")));
        }
        let path = path_of("expressions", name);
        self.document.set(Kind::Rig, &path, "{ \"shapes\": {} }", &format!("new expression {name}"), None)?;
        self.compose();
        Ok(())
    }

    // ---- Steps and files

    /// Takes the last step back.
    pub fn undo(&mut self) {
        match self.document.undo() {
            Ok(Some(label)) => self.messages.info(format!("undone: {label}")),
            Ok(None) => self.messages.info("nothing to undo"),
            Err(e) => self.messages.error(About::Edit, e.to_string()),
        }
        self.compose();
    }

    /// Does it again.
    pub fn redo(&mut self) {
        match self.document.redo() {
            Ok(Some(label)) => self.messages.info(format!("done again: {label}")),
            Ok(None) => self.messages.info("nothing to do again"),
            Err(e) => self.messages.error(About::Edit, e.to_string()),
        }
        self.compose();
    }

    /// Does an edit; what is wrong with it is a message.
    pub fn edit(&mut self, what: impl FnOnce(&mut Self) -> Outcome) -> bool {
        match what(self) {
            Ok(()) => {
                self.messages.clear(About::Edit);
                self.compose();
                true
            }
            Err(e) => {
                self.messages.error(About::Edit, e.to_string());
                false
            }
        }
    }

    /// Looks at the file of a text again.
    pub fn reload(&mut self, kind: Kind) {
        let about = About::File(kind);
        match self.document.reload(kind) {
            Ok(Reload::Conflict) => {
                let label = self.document.part(kind).label(kind);
                self.messages.error(
                    about,
                    format!("{label} was changed by another program; this text has changes too"),
                );
            }
            Ok(outcome) => {
                self.messages.clear(about);
                if outcome == Reload::Taken {
                    let label = self.document.part(kind).label(kind);
                    self.messages.info(format!("{label}: read again"));
                }
                self.compose();
            }
            Err(e) => self.messages.error(about, e.to_string()),
        }
    }

    /// Writes every text that has a file and changes. Those without a file are returned: they need a name.
    pub fn save(&mut self) -> Vec<Kind> {
        let mut unnamed = Vec::new();
        for kind in Kind::ALL {
            let part = self.document.part(kind);
            if !part.is_changed() {
                continue;
            }
            if part.path.is_none() {
                unnamed.push(kind);
                continue;
            }
            self.save_one(kind, None);
        }
        unnamed
    }

    /// Writes a text, under a new name if one is given. Whether it worked.
    pub fn save_one(&mut self, kind: Kind, path: Option<&Path>) -> bool {
        let saved = match path {
            Some(path) => self.document.save_as(kind, path),
            None => self.document.save(kind),
        };
        match saved {
            Ok(()) => {
                self.messages.clear(About::Save);
                self.messages.clear(About::File(kind));
                let path = self.document.part(kind).path.clone().unwrap_or_default();
                self.messages.info(format!("saved {}", path.display()));
                true
            }
            Err(e) => {
                self.messages.error(About::Save, e.to_string());
                false
            }
        }
    }

    /// Takes a head that was read again.
    pub fn take_head(&mut self, read: Outcome<LoadedHead>) -> bool {
        match read {
            Ok(head) => {
                self.messages.notes(&head.notes);
                self.messages.clear(About::Head);
                self.messages.info("the head: read again");
                self.adopt(Arc::new(head));
                true
            }
            Err(e) => {
                self.messages.error(About::Head, e.to_string());
                false
            }
        }
    }

    /// Makes a head that of the session.
    pub fn adopt(&mut self, head: Arc<LoadedHead>) {
        self.shapes = Resolver::shapes(&head.head);
        self.shape_pairs = pairs(head.head.shapes.iter().map(|s| s.name.as_str()));
        self.zone_pairs = pairs(head.head.maps.zones.iter().map(|z| z.name.as_str()));
        let known: Vec<String> = head.head.shapes.iter().map(|s| s.name.clone()).collect();
        self.pose.shapes.retain(|name, _| known.contains(name));
        self.live.shapes.retain(|name, _| known.contains(name));
        self.head = head;
        self.compose();
    }

    // ---- Live

    /// Takes weights that arrived, by any spelling. Names that nothing is known for are returned with the nearest known one.
    pub fn take_live(&mut self, weights: &super::live::Weights) -> Vec<String> {
        let mut unknown = Vec::new();
        let mut sums: std::collections::BTreeMap<String, f32> = Default::default();
        for (name, weight) in &weights.shapes {
            let targets = self.shapes.resolve(name);
            for target in &targets {
                if let Some(own) = self.shapes.names().nth(target.index as usize) {
                    *sums.entry(own.to_owned()).or_default() += weight * target.factor;
                }
            }
            if targets.is_empty() {
                unknown.push(self.unknown("shape", name, is_known_shape(name)));
            }
        }
        self.live.shapes.extend(sums);
        for (group, weights) in [(Group::Expressions, &weights.expressions), (Group::States, &weights.states)]
        {
            let names = self.names(group);
            for (name, weight) in weights {
                match names.iter().find(|n| n.eq_ignore_ascii_case(name)) {
                    Some(own) => drop(self.live.of_mut(group).insert(own.clone(), weight.clamp(0.0, 2.0))),
                    None => {
                        let hint = nearest(name, names.iter().map(String::as_str));
                        let hint = hint.map(|n| format!("; did you mean {n:?}?")).unwrap_or_default();
                        unknown.push(format!("live: the rig has no {} {name:?}{hint}", group.word()));
                    }
                }
            }
        }
        if let Some(degrees) = weights.head_degrees {
            self.live.head_degrees = Some(degrees);
        }
        self.compose();
        unknown
    }

    fn unknown(&self, what: &str, name: &str, is_known: bool) -> String {
        if is_known {
            return format!("live: the head has no {what} {name:?}: it has no effect");
        }
        let names: Vec<&str> = self.shapes.names().collect();
        let known: Vec<&str> = rubor_rig::names::vocabulary().collect();
        let hint = nearest(name, names.into_iter().chain(known));
        let hint = hint.map(|n| format!("; did you mean {n:?}?")).unwrap_or_default();
        format!("live: the unknown {what} {name:?}{hint}")
    }

    /// Rows of the time line.
    pub fn rows(&self) -> Vec<tracks::Row<'_>> {
        tracks::rows(self.document.sequence())
    }
}

/// Adds degrees to a track.
fn shift(track: &mut Track<f32>, by: f32, most: Option<f32>) {
    if by == 0.0 {
        return;
    }
    let hold = |v: f32| most.map_or(v, |most| v.clamp(-most, most));
    match track {
        Track::Constant(value) => *value = hold(*value + by),
        Track::Keys(keys) => keys.iter_mut().for_each(|k| k.v = hold(k.v + by)),
    }
}
