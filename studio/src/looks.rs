//! Looks by name: a lens and what happens to its light, which can replace those of any job.
//!
//! A look is a file of two parts: `camera`, the lens for the camera of the sequence, and `look`, settings of the same name. What it
//! does not say stays as it is.
//!
//! ```
//! use rubor::{Job, looks};
//! use rubor_rig::{expression::Rig, timeline::Sequence};
//!
//! let mut job = Job::new(&[], Rig::default_rig()?, Sequence::demo()?)?;
//! let notes = looks::load("portrait")?.apply(&mut job)?;
//! assert!(job.settings.look.bloom > 0.0 && job.sequence.camera.f_stop.is_some() && notes.is_empty());
//! # Ok::<(), rubor::Failure>(())
//! ```

use std::path::Path;

use rubor_rig::json::{self, Source};
use rubor_rig::timeline::{Focus, Track};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::error::{Failure, Outcome};
use crate::job::Job;
use crate::notes::Note;

/// Names and texts of the built-in looks, comments included.
pub const LOOKS: [(&str, &str); 2] = [
    ("portrait", include_str!("looks/portrait.json")),
    ("film-still", include_str!("looks/film-still.json")),
];

/// A look.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Look {
    /// In words.
    #[serde(default)]
    pub description: String,
    /// The lens.
    #[serde(default)]
    pub camera: Lens,
    /// Settings of [`rubor_renderer::settings::Look`].
    #[serde(default)]
    pub look: Map<String, Value>,
    /// The text that it was read from.
    #[serde(skip)]
    source: Source,
}

/// The lens of a look; each as in the camera of a sequence.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields, default)]
pub struct Lens {
    /// Millimetres.
    pub focal_length: Option<f32>,
    /// Millimetres.
    pub sensor_height: Option<f32>,
    /// Focal length over the width of the aperture.
    pub f_stop: Option<f32>,
    /// What is in focus.
    pub focus: Option<Focus>,
}

/// A look by its name, or that of a file.
///
/// # Errors
/// There is no look and no file of that name; the file is no look.
pub fn load(name: &str) -> Outcome<Look> {
    let path = Path::new(name);
    if let Some((name, text)) = LOOKS.iter().find(|l| l.0 == name) {
        return parse(&format!("{name}.json"), text);
    }
    if path.is_file() {
        return parse(&path.display().to_string(), &json::read_text(path)?);
    }
    let names = LOOKS.map(|l| l.0).join(", ");
    Err(Failure::input(format!("look: found {name:?}, expected {names}, or a file of a look")))
}

fn parse(file: &str, text: &str) -> Outcome<Look> {
    let (mut look, source) = json::from_str::<Look>(file, text)?;
    look.source = source;
    Ok(look)
}

impl Look {
    /// Gives a job this look. A camera that says where it stands keeps its field of view, as the face would else change its
    /// size; then there is a note.
    ///
    /// # Errors
    /// A setting or a lens that is out of range.
    pub fn apply(&self, job: &mut Job) -> Outcome<Vec<Note>> {
        let at = |name: &str| self.source.place_of_key(&[json::Step::from(name)]);
        let mut settings = job.settings.clone();
        settings
            .overlay(&json!({ "look": self.look }))
            .and_then(|()| settings.validate())
            .map_err(|e| Failure::input(format!("{}{e}", at("look"))))?;
        let mut sequence = job.sequence.clone();
        let camera = &mut sequence.camera;
        let mut notes = Vec::new();
        if let Some(focal_length) = self.camera.focal_length {
            if camera.position.is_none() {
                camera.fov_degrees = None;
                camera.focal_length = Some(Track::Constant(focal_length));
            } else {
                let message = format!(
                    "the sequence says where its camera stands: it keeps its field of view in place of {focal_length} mm"
                );
                notes.push(Note::new("look", message));
            }
        }
        camera.sensor_height = self.camera.sensor_height.or(camera.sensor_height);
        camera.f_stop = self.camera.f_stop.map(Track::Constant).or(camera.f_stop.take());
        camera.focus = self.camera.focus.clone().or(camera.focus.take());
        sequence.check().map_err(|e| {
            Failure::input(format!("{}found {}, expected {}", at("camera"), e.found, e.expected))
        })?;
        (job.settings, job.sequence) = (settings, sequence);
        Ok(notes)
    }
}

#[cfg(test)]
mod tests {
    use rubor_rig::expression::Rig;
    use rubor_rig::timeline::Sequence;

    use super::*;

    fn job(camera: &str) -> Job {
        let text = format!(r#"{{ "fps": 1, "duration": 1, "camera": {camera} }}"#);
        let sequence = Sequence::from_json("s.json", &text).unwrap();
        Job::new(&[], Rig::default_rig().unwrap(), sequence).unwrap()
    }

    #[test]
    fn every_look_reads_and_changes_a_job_that_reads_back() {
        for (name, _) in LOOKS {
            let mut job = job("{}");
            let before = job.clone();
            assert_eq!(load(name).unwrap().apply(&mut job).unwrap(), []);
            assert_ne!(job.settings.look, before.settings.look, "{name}");
            assert_eq!(job.settings.quality, before.settings.quality);
            let back = Job::from_json("job.json", &job.to_json().unwrap(), Path::new("/x"), None).unwrap();
            assert_eq!(back, job);
        }
    }

    #[test]
    fn a_camera_with_a_place_keeps_its_field_of_view() {
        let portrait = load("portrait").unwrap();
        let mut still = job(r#"{ "position": [0, 0, 1], "fovDegrees": 30 }"#);
        let notes = portrait.apply(&mut still).unwrap();
        assert!(notes[0].message.contains("85 mm"), "{notes:?}");
        assert_eq!(still.sequence.camera.fov_degrees, Some(Track::Constant(30.0)));
        let mut framed = job(r#"{ "fovDegrees": 30 }"#);
        assert_eq!(portrait.apply(&mut framed).unwrap(), []);
        assert_eq!(framed.sequence.camera.focal_length, Some(Track::Constant(85.0)));
        assert_eq!(framed.sequence.camera.fov_degrees, None);
    }

    #[test]
    fn wrong_looks_say_where() {
        let wrong = |text: &str| {
            let look = parse("mine.json", text);
            look.and_then(|look| look.apply(&mut job("{}"))).unwrap_err().to_string()
        };
        assert!(wrong("{\n\"look\": { \"blom\": 1 } }").contains("blom"));
        let range = wrong("{\n\"look\": { \"bloom\": 2 } }");
        assert!(range.starts_with("mine.json:2:") && range.contains("0 to 1"), "{range}");
        assert!(wrong("{ \"camera\": { \"fStop\": 0 } }").contains("0.5 to 128"));
        assert!(wrong("{ \"lens\": {} }").contains("lens"));
        assert!(load("portait").unwrap_err().to_string().contains("portrait, film-still"));
    }
}
