//! The tracks of a sequence as rows of the time line, and edits of their keys.
//!
//! ```text
//! Sequence --rows--> Row (path, keys) --set_key, move_key, delete_key, set_ease--> text of the sequence
//! ```

use rubor_rig::json::Step;
use rubor_rig::timeline::{Ease, Key, Sequence, Track, TrackValue};

use super::document::{Document, Kind};
use super::syntax::{self, number, quoted};
use crate::error::{Failure, Outcome};

/// Keys of a track and its place in the text of the sequence.
pub type Keyed = (Vec<Step>, Vec<Key<f32>>);

/// A track.
#[derive(Clone, Debug, PartialEq)]
pub struct Row<'a> {
    /// Its place in the text.
    pub path: Vec<Step>,
    /// Its name.
    pub label: String,
    /// What it belongs to.
    pub group: &'static str,
    /// Its values.
    pub values: Values<'a>,
    /// Least and largest value that a slider shows; further ones may be allowed.
    pub range: [f32; 2],
}

/// The values of a track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Values<'a> {
    /// Numbers, which have a curve.
    Numbers(&'a Track<f32>),
    /// Places, directions and colours, of which only the times are edited here.
    Triples(&'a Track<[f32; 3]>),
}

impl Row<'_> {
    /// Times of the keys, seconds; none for a constant.
    pub fn times(&self) -> Vec<f64> {
        match self.values {
            Values::Numbers(Track::Keys(keys)) => keys.iter().map(|k| k.t).collect(),
            Values::Triples(Track::Keys(keys)) => keys.iter().map(|k| k.t).collect(),
            _ => Vec::new(),
        }
    }
}

/// The path of a track of an expression, a state or a shape.
pub fn path_of(group: &str, name: &str) -> Vec<Step> {
    vec![Step::from(group), Step::Key(name.to_owned())]
}

/// All tracks: those that the sequence has, and single ones of head, eyes, camera and surroundings that are not constant 0.
pub fn rows<'a>(sequence: &'a Sequence) -> Vec<Row<'a>> {
    let mut rows: Vec<Row<'a>> = Vec::new();
    for (group, field, tracks, most) in [
        ("Expressions", "expressions", &sequence.expressions, 1.0),
        ("States", "states", &sequence.states, 1.0),
        ("Shapes", "shapes", &sequence.shapes, 1.0),
    ] {
        for (name, track) in tracks {
            let values = Values::Numbers(track);
            rows.push(Row {
                path: path_of(field, name),
                label: name.clone(),
                group,
                values,
                range: [0.0, most],
            });
        }
    }
    let mut single = |path: [&str; 2],
                      label: &str,
                      group: &'static str,
                      track: &'a Track<f32>,
                      range: [f32; 2]| {
        if *track != Track::Constant(0.0) {
            let path = path.map(Step::from).to_vec();
            rows.push(Row { path, label: label.to_owned(), group, values: Values::Numbers(track), range });
        }
    };
    let head = &sequence.head;
    single(["head", "yawDegrees"], "yaw", "Head", &head.yaw_degrees, [-60.0, 60.0]);
    single(["head", "pitchDegrees"], "pitch", "Head", &head.pitch_degrees, [-40.0, 40.0]);
    single(["head", "rollDegrees"], "roll", "Head", &head.roll_degrees, [-40.0, 40.0]);
    if let Some(eyes) = &sequence.eyes {
        single(["eyes", "yawDegrees"], "yaw", "Eyes", &eyes.yaw_degrees, [-30.0, 30.0]);
        single(["eyes", "pitchDegrees"], "pitch", "Eyes", &eyes.pitch_degrees, [-30.0, 30.0]);
        single(["eyes", "pupilMm"], "pupils, mm", "Eyes", &eyes.pupil_mm, [1.5, 9.0]);
    }
    let camera = &sequence.camera;
    single(["camera", "orbitDegrees"], "orbit", "Camera", &camera.orbit_degrees, [-180.0, 180.0]);
    single(["camera", "elevationDegrees"], "elevation", "Camera", &camera.elevation_degrees, [-89.0, 89.0]);
    if let Some(fov) = &camera.fov_degrees {
        single(["camera", "fovDegrees"], "field of view", "Camera", fov, [5.0, 90.0]);
    }
    if let Some(environment) = &sequence.environment {
        let (turn, intensity) = (&environment.rotation_degrees, &environment.intensity);
        single(["environment", "rotationDegrees"], "turn", "Surroundings", turn, [-180.0, 180.0]);
        single(["environment", "intensity"], "intensity", "Surroundings", intensity, [0.0, 4.0]);
    }
    let mut triple =
        |path: [&str; 2], label: &str, group: &'static str, track: Option<&'a Track<[f32; 3]>>| {
            if let Some(track @ Track::Keys(_)) = track {
                let path = path.map(Step::from).to_vec();
                let values = Values::Triples(track);
                rows.push(Row { path, label: label.to_owned(), group, values, range: [0.0, 1.0] });
            }
        };
    triple(["head", "translation"], "translation", "Head", Some(&head.translation));
    triple(["camera", "position"], "position", "Camera", camera.position.as_ref());
    triple(["camera", "target"], "target", "Camera", camera.target.as_ref());
    rows
}

/// The track of numbers at a path.
pub fn numbers<'a>(sequence: &'a Sequence, path: &[Step]) -> Option<&'a Track<f32>> {
    match rows(sequence).into_iter().find(|row| row.path == path)?.values {
        Values::Numbers(track) => Some(track),
        Values::Triples(_) => None,
    }
}

/// Keys as text, one a line, as deep as a track of an expression is.
pub fn keys_text(keys: &[Key<f32>]) -> String {
    let lines: Vec<String> =
        keys.iter().map(|k| format!("      {},\n", key_text(k.t, k.v, k.ease))).collect();
    format!("[\n{}    ]", lines.concat())
}

/// Seconds are written to a tenth of a millisecond, values to a ten thousandth.
fn key_text(t: f64, v: f32, ease: Ease) -> String {
    let ease = match ease {
        Ease::Linear => String::new(),
        ease => format!(", \"ease\": {}", quoted(&ease_name(ease))),
    };
    format!("{{ \"t\": {}, \"v\": {}{ease} }}", number(t, 4), number(f64::from(v), 4))
}

/// Name of an easing in files.
pub fn ease_name(ease: Ease) -> String {
    serde_json::to_value(ease).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
}

/// The key at a time, within half a frame.
pub fn key_near<T: TrackValue>(track: &Track<T>, time_s: f64, fps: f64) -> Option<usize> {
    let Track::Keys(keys) = track else { return None };
    let near = |k: &Key<T>| (k.t - time_s).abs();
    let nearest = (0..keys.len()).min_by(|a, b| near(&keys[*a]).total_cmp(&near(&keys[*b])))?;
    (near(&keys[nearest]) < 0.5 / fps).then_some(nearest)
}

impl Document {
    /// Sets a key at a time: a key that is there gets the value, else one is added with the easing of the key before it. The
    /// first key of a constant replaces it, as in other programs. A track of a recording is written out first.
    ///
    /// # Errors
    /// A value that the track cannot have; nothing has changed then.
    pub fn set_key(&mut self, path: &[Step], time_s: f64, value: f32, mark: Option<&str>) -> Outcome {
        let label = format!("key of {}", syntax::written(path));
        let text = self.text_with_key(self.part(Kind::Sequence).text(), path, time_s, value)?;
        self.replace(Kind::Sequence, text, &label, mark)
    }

    fn text_with_key(&self, text: &str, path: &[Step], time_s: f64, value: f32) -> Outcome<String> {
        let sequence = self.sequence();
        let track = numbers(sequence, path);
        let new = key_text(time_s.max(0.0), value, Ease::Linear);
        let Some(track @ Track::Keys(keys)) = track else {
            return syntax::set(text, path, &format!("[{new}]")).map_err(Failure::input);
        };
        let text = self.with_written_track(text, path, keys)?;
        let at = |i: usize| [path, &[Step::Index(i)]].concat();
        match key_near(track, time_s, sequence.fps) {
            Some(i) => {
                let field = [&at(i)[..], &[Step::from("v")]].concat();
                syntax::set(&text, &field, &number(f64::from(value), 4))
            }
            None => {
                let next = keys.partition_point(|k| k.t < time_s);
                let ease = next.checked_sub(1).map_or(Ease::Linear, |i| keys[i].ease);
                syntax::insert(&text, path, next, &key_text(time_s, value, ease))
            }
        }
        .map_err(Failure::input)
    }

    /// The text with a track that only the recording has.
    fn with_written_track(&self, text: &str, path: &[Step], keys: &[Key<f32>]) -> Outcome<String> {
        match syntax::text_at(text, path) {
            Some(_) => Ok(text.to_owned()),
            None => syntax::set(text, path, &keys_text(keys)).map_err(Failure::input),
        }
    }

    /// Moves a key in time, between its neighbours, and to a value.
    ///
    /// # Errors
    /// A value that the track cannot have; no such key; nothing has changed then.
    pub fn move_key(
        &mut self,
        path: &[Step],
        index: usize,
        time_s: f64,
        value: Option<f32>,
        mark: Option<&str>,
    ) -> Outcome {
        // Keys have to differ in time; the least distance is what a text keeps.
        const LEAST_S: f64 = 1e-3;
        let sequence = self.sequence();
        let row = rows(sequence).into_iter().find(|row| row.path == path);
        let times = row.as_ref().map(Row::times).unwrap_or_default();
        if index >= times.len() {
            return Err(Failure::input(format!("{}: there is no key {}", syntax::written(path), index + 1)));
        }
        let least = index.checked_sub(1).map_or(0.0, |i| times[i] + LEAST_S);
        let most = times.get(index + 1).map_or(f64::INFINITY, |t| t - LEAST_S);
        let time_s = time_s.max(least).min(most);
        let mut text = self.part(Kind::Sequence).text().to_owned();
        if let Some(Row { values: Values::Numbers(Track::Keys(keys)), .. }) = &row {
            text = self.with_written_track(&text, path, keys)?;
        }
        let field = |name: &str| [path, &[Step::Index(index), Step::from(name)]].concat();
        text = syntax::set(&text, &field("t"), &number(time_s, 4)).map_err(Failure::input)?;
        if let Some(value) = value {
            text = syntax::set(&text, &field("v"), &number(f64::from(value), 4)).map_err(Failure::input)?;
        }
        let label = format!("key of {}", syntax::written(path));
        self.replace(Kind::Sequence, text, &label, mark)
    }

    /// Takes a key out. A track without keys is taken out as a whole.
    ///
    /// # Errors
    /// No such key.
    pub fn delete_key(&mut self, path: &[Step], index: usize) -> Outcome {
        let sequence = self.sequence();
        let row = rows(sequence).into_iter().find(|row| row.path == path);
        let mut text = self.part(Kind::Sequence).text().to_owned();
        if let Some(Row { values: Values::Numbers(Track::Keys(keys)), .. }) = &row {
            text = self.with_written_track(&text, path, keys)?;
        }
        let is_last = row.as_ref().is_some_and(|row| row.times().len() == 1);
        let at = if is_last { path.to_vec() } else { [path, &[Step::Index(index)]].concat() };
        let text = syntax::remove(&text, &at).map_err(Failure::input)?;
        self.replace(Kind::Sequence, text, &format!("deleted key of {}", syntax::written(path)), None)
    }

    /// Sets how the curve goes from a key to the next.
    ///
    /// # Errors
    /// No such key.
    pub fn set_ease(&mut self, path: &[Step], index: usize, ease: Ease) -> Outcome {
        let mut text = self.part(Kind::Sequence).text().to_owned();
        if let Some(Track::Keys(keys)) = numbers(self.sequence(), path) {
            text = self.with_written_track(&text, path, keys)?;
        }
        let at = [path, &[Step::Index(index), Step::from("ease")]].concat();
        let text = syntax::set(&text, &at, &quoted(&ease_name(ease))).map_err(Failure::input)?;
        self.replace(Kind::Sequence, text, &format!("easing of {}", syntax::written(path)), None)
    }

    /// Sets keys of several tracks at one time, as one step.
    ///
    /// # Errors
    /// A value that a track cannot have; nothing has changed then.
    pub fn set_keys(&mut self, keys: &[(Vec<Step>, f32)], time_s: f64) -> Outcome {
        let mut text = self.part(Kind::Sequence).text().to_owned();
        for (path, value) in keys {
            text = self.text_with_key(&text, path, time_s, *value)?;
        }
        let label = match keys {
            [(path, _)] => format!("key of {}", syntax::written(path)),
            _ => format!("keys of {} tracks", keys.len()),
        };
        self.replace(Kind::Sequence, text, &label, None)
    }

    /// Writes whole tracks, in place of those of the same names, as one step; `mark` joins it with the one before.
    ///
    /// # Errors
    /// Keys that a track cannot have; nothing has changed then.
    pub fn set_tracks(&mut self, tracks: &[Keyed], label: &str, mark: Option<&str>) -> Outcome {
        let mut text = self.part(Kind::Sequence).text().to_owned();
        for (path, keys) in tracks {
            text = syntax::set(&text, path, &keys_text(keys)).map_err(Failure::input)?;
        }
        self.replace(Kind::Sequence, text, label, mark)
    }

    /// Writes a track of one shape for each half of a track that moves several, so that they can differ.
    ///
    /// # Errors
    /// There is no such track.
    pub fn split_track(&mut self, name: &str, into: &[String]) -> Outcome {
        let path = path_of("shapes", name);
        let mut text = self.part(Kind::Sequence).text().to_owned();
        if let Some(Track::Keys(keys)) = numbers(self.sequence(), &path) {
            text = self.with_written_track(&text, &path, keys)?;
        }
        let track = syntax::text_at(&text, &path)
            .ok_or_else(|| Failure::input(format!("shapes.{name}: there is no such track")))?;
        for half in into {
            text = syntax::set(&text, &path_of("shapes", half), &track).map_err(Failure::input)?;
        }
        text = syntax::remove(&text, &path).map_err(Failure::input)?;
        self.replace(Kind::Sequence, text, &format!("{name} became {}", into.join(", ")), None)
    }
}
