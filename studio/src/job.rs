//! A job: everything that decides the pixels of a run, as one value that can be written and read back.
//!
//! `job.json` in the folder of a run is this value. It names heads by their files and holds everything else, so that
//! `rubor render --job job.json` draws the same frames again wherever the heads are the same. Comments are allowed.
//! Paths are written absolute; relative ones that people write are relative to the job file.

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::ValueEnum;
use rubor_renderer::settings::{Preset, Settings};
use rubor_rig::expression::Rig;
use rubor_rig::json;
use rubor_rig::limits;
use rubor_rig::timeline::{Environment, Light, Sequence};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

use crate::auto::Auto;
use crate::environment;
use crate::error::{Failure, Outcome};
use crate::inputs::{self, LoadedHead};
use crate::layers;
use crate::output;
use crate::review::inset;

/// Contents and settings of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[schemars(title = "rubor job")]
pub struct Job {
    /// Address of the JSON schema, for editors.
    #[serde(rename = "$schema", default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// Version of rubor that wrote it; another version may draw other pixels.
    #[serde(default = "version")]
    pub rubor: String,
    /// Heads that stand side by side, each with the same performance; if empty, the built-in head.
    #[serde(default)]
    pub heads: Vec<InputFile>,
    /// Expressions and states.
    pub rig: Rig,
    /// The performance, its camera and its lights. The recording that it was made from is already in its tracks.
    pub sequence: Sequence,
    /// Lights and surroundings in place of those of the sequence.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lights: Option<Lighting>,
    /// Fingerprint of the environment's image file, if it is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub environment: Option<InputFile>,
    /// How frames are made. A missing size is that of the sequence; other missing settings have their defaults.
    #[serde(default)]
    pub settings: Settings,
    /// Settings that are chosen frame by frame, in place of those above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub auto: Option<Auto>,
    /// A map of the first head's current state in a corner of each frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inset: Option<inset::Map>,
    /// Files of each frame.
    #[serde(default, skip_serializing_if = "Format::is_default")]
    pub format: Format,
    /// Only these frames; without it, all of the sequence.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<FrameList>,
}

/// Files of each frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// The displayed picture
    #[default]
    Png,
    /// The displayed picture, and an OpenEXR file of light, depth, normals, motion, chromophores, masks and ids as layers
    Exr,
}

/// A file that a job depends on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct InputFile {
    /// Absolute, or relative to the job file; none is the head that is built into rubor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Fingerprint of its content: a job whose files have changed is refused. Without it any content is accepted.
    #[serde(default, skip_serializing_if = "Fingerprint::is_unknown")]
    pub fingerprint: Fingerprint,
}

/// A number that changes with any byte of a file (of a `.gltf`, not of the files that it names): 16 hexadecimal digits.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Fingerprint(String);

/// Lights and surroundings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Lighting {
    /// Name of the light rig, or the file that it was taken from; for information only.
    #[serde(default)]
    pub name: String,
    /// Lamps.
    #[serde(default)]
    pub lights: Vec<Light>,
    /// Light from all around.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub environment: Option<Environment>,
}

/// Numbers of frames from 1, ascending, each once; written as `1,12-20`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameList(Vec<u32>);

fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}

impl Fingerprint {
    /// FNV-1a: the same on every machine and in every version.
    pub fn of(bytes: &[u8]) -> Self {
        let mix = |h: u64, b: &u8| (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3);
        Self(format!("{:016x}", bytes.iter().fold(0xcbf2_9ce4_8422_2325, mix)))
    }

    fn is_unknown(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether two fingerprints agree; an empty one agrees with all.
    fn allows(&self, found: &Self) -> bool {
        self.is_unknown() || self == found
    }
}

impl Format {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Job {
    /// A performance on heads, with default settings of the size that the sequence asks for.
    ///
    /// # Errors
    /// The environment is a file that cannot be read.
    pub fn new(heads: &[LoadedHead], rig: Rig, sequence: Sequence) -> Outcome<Self> {
        let mut settings = Settings::default();
        settings.output.size = sequence.size.unwrap_or(settings.output.size);
        let mut job = Self {
            schema: None,
            rubor: version(),
            heads: heads.iter().map(|h| h.source.clone()).collect(),
            rig,
            sequence,
            lights: None,
            environment: None,
            settings,
            auto: None,
            inset: None,
            format: Format::Png,
            frames: None,
        };
        job.note_environment()?;
        Ok(job)
    }

    /// Replaces the lights of the sequence.
    ///
    /// # Errors
    /// The environment is a file that cannot be read.
    pub fn relight(&mut self, lights: Lighting) -> Outcome {
        self.lights = Some(lights);
        self.note_environment()
    }

    /// The settings that frames are drawn with: with the channels that the files of a frame are made of.
    pub fn drawn_settings(&self) -> Settings {
        let mut settings = self.settings.clone();
        if self.format == Format::Exr {
            let wanted = &mut settings.output.channels;
            wanted.extend(layers::CHANNELS.iter().filter(|c| !self.settings.output.channels.contains(c)));
        }
        settings
    }

    /// The sequence as it is drawn: with the lights of the job.
    pub fn lit_sequence(&self) -> Sequence {
        let mut sequence = self.sequence.clone();
        if let Some(lights) = &self.lights {
            sequence.lights.clone_from(&lights.lights);
            sequence.environment.clone_from(&lights.environment);
        }
        sequence
    }

    /// Reads a job file. `preset` sets the quality settings that the file leaves out.
    ///
    /// # Errors
    /// A file that cannot be read or is no job, with its line and column.
    pub fn read(path: &Path, preset: Option<Preset>) -> Outcome<Self> {
        if !path.is_file() {
            let found = if path.is_dir() { "a folder" } else { "no such file" };
            return Err(Failure::input(format!("{}: found {found}, expected a job (.json)", path.display())));
        }
        let text = json::read_text(path)?;
        Self::from_json(&path.display().to_string(), &text, path.parent().unwrap_or(Path::new("")), preset)
    }

    /// Reads a job from the text of a file in `folder`.
    ///
    /// # Errors
    /// As [`Job::read`].
    pub fn from_json(file: &str, text: &str, folder: &Path, preset: Option<Preset>) -> Outcome<Self> {
        let (mut job, source) = json::from_str::<Self>(file, text)?;
        // The job overrides the preset and the size of the sequence, so its own settings are applied once more.
        let (written, _) = json::from_str::<Value>(file, text)?;
        job.settings = Settings::default();
        if let Some(preset) = preset {
            job.settings.quality = preset.quality();
        }
        job.settings.output.size = job.sequence.size.unwrap_or(job.settings.output.size);
        if let Some(changes) = written.get("settings") {
            job.settings.overlay(changes)?;
        }
        job.settings.validate().map_err(|e| {
            let place = source.place_of_key(&[json::Step::from("settings")]);
            Failure::input(format!("{place}{e}"))
        })?;
        if let Some(auto) = &job.auto {
            let place = source.place_of_key(&[json::Step::from("auto")]);
            auto.check().map_err(|e| Failure::input(format!("{place}{e}")))?;
        }
        job.sequence.check()?;
        let from_file = |path: &mut PathBuf| -> Outcome {
            *path = inputs::absolute(&folder.join(&*path))?;
            Ok(())
        };
        let mut files =
            job.heads.iter_mut().chain(&mut job.environment).filter_map(|input| input.file.as_mut());
        files.try_for_each(from_file)?;
        let of_lights = job.lights.as_mut().and_then(|l| l.environment.as_mut());
        for environment in job.sequence.environment.iter_mut().chain(of_lights) {
            if !environment::is_built_in(&environment.name) {
                let mut path = PathBuf::from(&environment.name);
                from_file(&mut path)?;
                environment.name = path.to_string_lossy().into_owned();
            }
        }
        Ok(job)
    }

    /// Its text, as [`Job::from_json`] reads it.
    ///
    /// # Errors
    /// A number that JSON cannot represent.
    pub fn to_json(&self) -> Outcome<String> {
        let text = serde_json::to_string_pretty(self).map_err(Failure::input)?;
        Ok(text + "\n")
    }

    /// Fills in the fingerprints of heads and environment as they are now, so that a change of a file is noticed when the
    /// job is resumed or drawn again. `heads` are those that [`Job::load_heads`] gave, or that it was made of.
    ///
    /// # Errors
    /// The environment is a file that cannot be read.
    pub fn seal(&mut self, heads: &[LoadedHead]) -> Outcome {
        self.heads = heads.iter().map(|h| h.source.clone()).collect();
        self.note_environment()
    }

    /// Writes the job file.
    ///
    /// # Errors
    /// The system refuses.
    pub fn write(&self, path: &Path) -> Outcome {
        output::write(path, self.to_json()?.as_bytes())
    }

    /// Loads the heads.
    ///
    /// # Errors
    /// More heads than a frame has; a file that is missing, is no head, or has changed since the job was written; an environment that
    /// has.
    pub fn load_heads(&self) -> Outcome<Vec<LoadedHead>> {
        let built_in = [InputFile { file: None, fingerprint: Fingerprint::default() }];
        let sources = if self.heads.is_empty() { &built_in } else { &self.heads[..] };
        inputs::check_number_of_heads(sources.len())?;
        let mut heads = Vec::new();
        for source in sources {
            let loaded = inputs::head(source.file.as_deref())?;
            source.check(&loaded.source.fingerprint)?;
            heads.push(loaded);
        }
        if let Some(InputFile { file: Some(path), .. }) = &self.environment {
            let bytes = limits::read(path).map_err(|e| Failure::read(path, e))?;
            self.environment.iter().try_for_each(|input| input.check(&Fingerprint::of(&bytes)))?;
        }
        Ok(heads)
    }

    /// Whether another job draws the same pixels, in the frames that both draw.
    ///
    /// # Errors
    /// A number that JSON cannot represent.
    pub fn draws_like(&self, other: &Self) -> Outcome<bool> {
        Ok(self.of_pixels()? == other.of_pixels()?)
    }

    /// A number that changes with the pixels of the job: that of its text, whichever frames it draws.
    ///
    /// # Errors
    /// A number that JSON cannot represent.
    pub fn identity(&self) -> Outcome<Fingerprint> {
        Ok(Fingerprint::of(self.of_pixels()?.as_bytes()))
    }

    /// The text of all that decides pixels, whichever frames are drawn.
    fn of_pixels(&self) -> Outcome<String> {
        Self { frames: None, schema: None, ..self.clone() }.to_json()
    }

    /// JSON schema of the file.
    pub fn json_schema_value() -> Value {
        schemars::schema_for!(Self).to_value()
    }

    /// Stores the fingerprint of the environment's image.
    fn note_environment(&mut self) -> Outcome {
        self.environment = None;
        let sequence = self.lit_sequence();
        let Some(name) = sequence.environment.map(|e| e.name).filter(|n| !environment::is_built_in(n)) else {
            return Ok(());
        };
        let path = inputs::absolute(Path::new(&name))?;
        // A missing file is refused when it is loaded, with the names of those built in.
        if path.is_file() {
            let bytes = limits::read(&path).map_err(|e| Failure::read(&path, e))?;
            self.environment = Some(InputFile { file: Some(path), fingerprint: Fingerprint::of(&bytes) });
        }
        Ok(())
    }
}

impl InputFile {
    fn check(&self, found: &Fingerprint) -> Outcome {
        if self.fingerprint.allows(found) {
            return Ok(());
        }
        let name = self.file.as_ref().map_or("the built-in head".into(), |f| f.display().to_string());
        Err(Failure::input(format!(
            "{name}: found the fingerprint {}, expected {} as in the job: it has changed since",
            found.0, self.fingerprint.0
        ))
        .hint("take `fingerprint` out of the job file to draw it as it is now"))
    }
}

impl FrameList {
    /// Frames by their numbers from 1; none if there are none.
    pub fn new(numbers: impl IntoIterator<Item = u32>) -> Option<Self> {
        let sorted: BTreeSet<u32> = numbers.into_iter().filter(|n| *n > 0).collect();
        (!sorted.is_empty()).then(|| Self(sorted.into_iter().collect()))
    }

    /// The numbers, from 1, ascending.
    pub fn numbers(&self) -> &[u32] {
        &self.0
    }

    /// These and those of another list.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        let all: BTreeSet<u32> = self.0.iter().chain(&other.0).copied().collect();
        Self(all.into_iter().collect())
    }
}

/// Most frames of a list and of a run: more than a day at 100 frames a second.
pub const MOST_FRAMES: u32 = 10_000_000;

impl FromStr for FrameList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("found {text:?}, expected frame numbers from 1 such as 1,12-20");
        let mut numbers = BTreeSet::new();
        for part in text.split(',') {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let first: u32 = first.trim().parse().map_err(|_| wrong())?;
            let last: u32 = last.trim().parse().map_err(|_| wrong())?;
            if first == 0 || last < first {
                return Err(wrong());
            }
            if numbers.len() as u64 + u64::from(last - first) >= u64::from(MOST_FRAMES) {
                return Err(format!("found more than {MOST_FRAMES} frames, expected fewer in one list"));
            }
            numbers.extend(first..=last);
        }
        Ok(Self(numbers.into_iter().collect()))
    }
}

impl fmt::Display for FrameList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let runs = self.0.chunk_by(|a, b| a + 1 == *b).map(|run| match run {
            [first, .., last] => format!("{first}-{last}"),
            _ => run.iter().map(u32::to_string).collect(),
        });
        f.write_str(&runs.collect::<Vec<_>>().join(","))
    }
}

impl Serialize for FrameList {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for FrameList {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

impl JsonSchema for FrameList {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "FrameList".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "description": "Numbers of frames from 1, such as 1,12-20.",
            "pattern": "^[0-9]+(-[0-9]+)?(,[0-9]+(-[0-9]+)?)*$",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::auto::Calibration;

    fn job() -> Job {
        let sequence = r#"{ "fps": 23.976, "duration": 0.7, "size": [96, 64],
            "shapes": { "jawOpen": [{ "t": 0.1, "v": 0.3 }, { "t": 0.3333333333333333, "v": 0.1 }] },
            "environment": { "name": "sky", "rotationDegrees": 12.3 } }"#;
        let sequence = Sequence::from_json("s.json", sequence).unwrap();
        Job::new(&[], Rig::default_rig().unwrap(), sequence).unwrap()
    }

    #[test]
    fn a_job_reads_back_to_the_last_bit() {
        let mut job = job();
        assert_eq!(job.settings.output.size, [96, 64], "the size of the sequence");
        job.relight(inputs::lights("window").unwrap()).unwrap();
        job.settings.look.exposure = 1.23;
        job.frames = Some("1,3-5".parse().unwrap());
        job.inset = Some(inset::Map::Wrinkles);
        let text = job.to_json().unwrap();
        let back = Job::from_json("job.json", &text, Path::new("/x"), None).unwrap();
        assert_eq!(back, job);
        assert_eq!(back.to_json().unwrap(), text);
    }

    #[test]
    fn a_job_that_chooses_its_settings_reads_back_and_wrong_wishes_are_told() {
        let mut job = job();
        for bound in ["flip=0.02", "ms=1.5"] {
            let (bound, held) = (bound.parse().unwrap(), vec!["scatter".to_owned()]);
            job.auto = Some(Auto { bound, held, calibration: Calibration::shipped().unwrap() });
            let text = job.to_json().unwrap();
            let back = Job::from_json("job.json", &text, Path::new("/x"), None).unwrap();
            assert_eq!(back, job);
        }
        let wrong = |place: &str, value: Value, phrase: &str| {
            let mut written: Value = serde_json::from_str(&job.to_json().unwrap()).unwrap();
            *written.pointer_mut(place).unwrap() = value;
            let error = Job::from_json("job.json", &written.to_string(), Path::new("/x"), None).unwrap_err();
            assert!(error.to_string().contains(phrase), "{error}");
        };
        wrong("/auto/bound", serde_json::json!({ "flip": -1 }), "found -1");
        wrong(
            "/auto/bound",
            serde_json::json!({ "flip": 0.1, "milliseconds": 1 }),
            "a string, or an object with one name",
        );
        wrong("/auto/bound", serde_json::json!({ "flop": 0.1 }), "\"flip\"");
        wrong("/auto/bound", serde_json::json!("flip"), "expected");
        wrong("/auto/held/0", serde_json::json!("scater"), "scater");
    }

    #[test]
    fn what_a_job_leaves_out_comes_from_preset_and_sequence() {
        let mut written: Value = serde_json::from_str(&job().to_json().unwrap()).unwrap();
        written["settings"] = serde_json::json!({ "quality": { "scatter": "none" } });
        let read = |written: &Value, preset| {
            Job::from_json("job.json", &written.to_string(), Path::new("/x"), preset).map(|j| j.settings)
        };
        let settings = read(&written, Some(Preset::Draft)).unwrap();
        assert_eq!(settings.quality.scatter.to_string(), "none", "the job before the preset");
        assert_eq!(settings.quality.antialias, Preset::Draft.quality().antialias);
        assert_eq!(settings.output.size, [96, 64]);
        written["settings"] = serde_json::json!({ "output": { "size": [10, 20] } });
        assert_eq!(read(&written, None).unwrap().output.size, [10, 20]);
        written["settings"] = serde_json::json!({ "output": { "supersampling": 9 } });
        assert!(read(&written, None).unwrap_err().to_string().contains("job.json:1:"));
        written["settings"] = serde_json::json!({ "quality": { "scatter": "separable:8" } });
        let message = read(&written, None).unwrap_err().to_string();
        assert!(message.starts_with("job.json:1:") && message.contains("N odd"), "{message}");
    }

    #[test]
    fn paths_are_relative_to_the_job_file() {
        let mut job = job();
        job.heads = vec![InputFile { file: Some("heads/a.glb".into()), fingerprint: Fingerprint::default() }];
        job.sequence.environment.as_mut().unwrap().name = "lights/a.exr".into();
        let back = Job::from_json("job.json", &job.to_json().unwrap(), Path::new("/jobs/7"), None).unwrap();
        assert_eq!(back.heads[0].file.as_deref(), Some(Path::new("/jobs/7/heads/a.glb")));
        assert_eq!(back.sequence.environment.unwrap().name, "/jobs/7/lights/a.exr");
    }

    #[test]
    fn jobs_are_alike_but_for_their_frames() {
        let (a, mut b) = (job(), job());
        b.frames = Some("2".parse().unwrap());
        assert!(a.draws_like(&b).unwrap());
        b.settings.look.exposure = 1.0;
        assert!(!a.draws_like(&b).unwrap());
    }

    #[test]
    fn frame_lists_are_read_and_written() {
        let list: FrameList = "3, 1-2,2,7".parse().unwrap();
        assert_eq!((list.numbers(), list.to_string().as_str()), (&[1, 2, 3, 7][..], "1-3,7"));
        assert_eq!(list.and(&"4-6".parse().unwrap()).to_string(), "1-7");
        for wrong in ["", "0", "4-3", "a", "1,,2"] {
            assert!(wrong.parse::<FrameList>().unwrap_err().contains(wrong));
        }
    }

    #[test]
    fn a_file_that_has_changed_is_refused() {
        let mut job = job();
        job.heads = vec![InputFile { file: None, fingerprint: Fingerprint::of(b"another") }];
        let message = job.load_heads().unwrap_err().to_string();
        assert!(message.contains("changed") && message.contains("hint"), "{message}");
    }

    #[test]
    fn more_heads_than_a_frame_has_are_refused_before_they_are_read() {
        let mut job = job();
        job.heads =
            vec![InputFile { file: Some("missing.glb".into()), fingerprint: Fingerprint::default() }; 32];
        let message = job.load_heads().unwrap_err().to_string();
        assert!(message.contains("found 32 heads, expected at most 31"), "{message}");
    }

    #[test]
    fn an_environment_beside_its_sequence_is_found_and_watched() {
        let folder = tempfile::tempdir().unwrap();
        let [file, image] = ["s.json", "here.exr"].map(|name| folder.path().join(name));
        std::fs::write(&file, r#"{ "fps": 1, "duration": 1, "environment": { "name": "here.exr" } }"#)
            .unwrap();
        std::fs::write(&image, b"light").unwrap();
        let (sequence, _) = inputs::sequence(Some(&file)).unwrap();
        assert_eq!(sequence.environment.as_ref().unwrap().name, image.to_string_lossy());
        let job = Job::new(&[], Rig::default_rig().unwrap(), sequence).unwrap();
        assert_eq!(job.environment.as_ref().and_then(|e| e.file.as_deref()), Some(&*image));
        job.load_heads().unwrap();
        std::fs::write(&image, b"other").unwrap();
        let message = job.load_heads().unwrap_err().to_string();
        assert!(message.contains("here.exr") && message.contains("changed"), "{message}");
    }

    #[test]
    fn the_schema_names_every_part() {
        let schema = Job::json_schema_value();
        for part in ["heads", "rig", "sequence", "lights", "settings", "inset", "frames"] {
            assert!(schema["properties"][part].is_object(), "{part}");
        }
    }
}
