//! Rig and sequence under edit, as the texts that are saved.
//!
//! ```text
//! file --read--> text --edit (syntax)--> text --check--> Rig, Sequence
//!                  |                       |
//!                  +--history--------------+--save--> file
//! ```
//!
//! The last text that is right stays: an edit or a file that is wrong is refused with its place.

use std::path::{Path, PathBuf};

use rubor_rig::expression::{DEFAULT_RIG_JSON, Rig};
use rubor_rig::json::{self, Step};
use rubor_rig::timeline::{DEMO_SEQUENCE_JSON, Sequence};

use super::history::History;
use super::syntax;
use crate::error::{Failure, Outcome};
use crate::inputs::{self, LoadedHead};
use crate::notes::Note;
use crate::output;

/// The texts of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    /// Expressions and states.
    Rig,
    /// Tracks, camera and lights.
    Sequence,
}

impl Kind {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Rig, Self::Sequence];

    /// Its word in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rig => "rig",
            Self::Sequence => "sequence",
        }
    }
}

/// A text with its file.
#[derive(Clone, Debug)]
pub struct Part {
    /// Where it is saved; none before the first save of a text that came from no file.
    pub path: Option<PathBuf>,
    /// The text now.
    text: String,
    /// The text as the file has it.
    saved: String,
    /// The text that the file was changed to by others while this one had changes of its own.
    conflict: Option<String>,
}

impl Part {
    fn new(path: Option<PathBuf>, text: String) -> Self {
        Self { path, saved: text.clone(), text, conflict: None }
    }

    /// The text now.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Whether it differs from what is saved.
    pub fn is_changed(&self) -> bool {
        self.text != self.saved
    }

    /// Whether the file was changed by others while this text has changes of its own.
    pub fn has_conflict(&self) -> bool {
        self.conflict.is_some()
    }

    /// Name of the file, or words for what comes from none.
    pub fn label(&self, kind: Kind) -> String {
        match &self.path {
            Some(path) => path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned(),
            None => format!("{} without a file", kind.name()),
        }
    }
}

/// The outcome of a file that has changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reload {
    /// It holds what is known already.
    Same,
    /// Its text was taken.
    Taken,
    /// The text here has changes of its own: a person has to choose.
    Conflict,
}

/// Rig and sequence with their history.
#[derive(Clone, Debug)]
pub struct Document {
    rig_part: Part,
    sequence_part: Part,
    history: History,
    rig: Rig,
    sequence: Sequence,
    notes: Vec<Note>,
}

impl Document {
    /// Opens the files; without a rig's, the rig of the head or the default one, and without a sequence's, the demo.
    ///
    /// # Errors
    /// A file that is missing or wrong, with its place.
    pub fn open(head: &LoadedHead, rig: Option<&Path>, sequence: Option<&Path>) -> Outcome<Self> {
        let rig_part = match (rig, &head.rig) {
            (Some(path), _) => Part::new(Some(inputs::absolute(path)?), read(path)?),
            (None, Some(own)) => {
                let text = serde_json::to_string_pretty(own).map_err(Failure::input)?;
                Part::new(None, text + "\n")
            }
            (None, None) => Part::new(None, DEFAULT_RIG_JSON.to_owned()),
        };
        let sequence_part = match sequence {
            Some(path) => Part::new(Some(inputs::absolute(path)?), read(path)?),
            None => Part::new(None, DEMO_SEQUENCE_JSON.to_owned()),
        };
        let rig = parse_rig(&rig_part, &rig_part.text)?;
        let (sequence, notes) = parse_sequence(&sequence_part, &sequence_part.text)?;
        Ok(Self { rig_part, sequence_part, history: History::default(), rig, sequence, notes })
    }

    /// The rig that the text says.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The sequence that the text says, with its recording.
    pub fn sequence(&self) -> &Sequence {
        &self.sequence
    }

    /// Notes on the recording of the sequence.
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// A text with its file.
    pub fn part(&self, kind: Kind) -> &Part {
        match kind {
            Kind::Rig => &self.rig_part,
            Kind::Sequence => &self.sequence_part,
        }
    }

    fn part_mut(&mut self, kind: Kind) -> &mut Part {
        match kind {
            Kind::Rig => &mut self.rig_part,
            Kind::Sequence => &mut self.sequence_part,
        }
    }

    /// The steps.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// Ends a row of edits that are one step.
    pub fn seal(&mut self) {
        self.history.seal();
    }

    /// Whether anything differs from what is saved.
    pub fn is_changed(&self) -> bool {
        Kind::ALL.iter().any(|kind| self.part(*kind).is_changed())
    }

    /// Replaces a value, or adds it. `mark` joins edits in a row into one step.
    ///
    /// # Errors
    /// The result would be wrong; nothing has changed then.
    pub fn set(
        &mut self,
        kind: Kind,
        path: &[Step],
        value: &str,
        label: &str,
        mark: Option<&str>,
    ) -> Outcome {
        let text = syntax::set(self.part(kind).text(), path, value).map_err(Failure::input)?;
        self.replace(kind, text, label, mark)
    }

    /// Replaces a text by an edited one.
    ///
    /// # Errors
    /// It is wrong; nothing has changed then.
    pub fn replace(&mut self, kind: Kind, text: String, label: &str, mark: Option<&str>) -> Outcome {
        self.check(kind, &text)?;
        let before = std::mem::replace(&mut self.part_mut(kind).text, text);
        let after = match kind {
            Kind::Rig => &self.rig_part.text,
            Kind::Sequence => &self.sequence_part.text,
        };
        self.history.push(kind, label, mark, &before, after);
        Ok(())
    }

    /// Reads a text and keeps what it says, if it is right.
    fn check(&mut self, kind: Kind, text: &str) -> Outcome {
        match kind {
            Kind::Rig => self.rig = parse_rig(&self.rig_part, text)?,
            Kind::Sequence => (self.sequence, self.notes) = parse_sequence(&self.sequence_part, text)?,
        }
        Ok(())
    }

    /// Takes the last step back, and says which.
    ///
    /// # Errors
    /// The recording that an earlier text names is gone.
    pub fn undo(&mut self) -> Outcome<Option<String>> {
        let mut history = std::mem::take(&mut self.history);
        let step = history.undo(|kind| self.part(kind).text());
        self.history = history;
        self.take_step(step)
    }

    /// Does the last step that was taken back again, and says which.
    ///
    /// # Errors
    /// As [`Document::undo`].
    pub fn redo(&mut self) -> Outcome<Option<String>> {
        let mut history = std::mem::take(&mut self.history);
        let step = history.redo(|kind| self.part(kind).text());
        self.history = history;
        self.take_step(step)
    }

    fn take_step(&mut self, step: Option<(Kind, String, String)>) -> Outcome<Option<String>> {
        let Some((kind, text, label)) = step else { return Ok(None) };
        let checked = self.check(kind, &text);
        self.part_mut(kind).text = text;
        checked.map(|()| Some(label))
    }

    /// Looks at a file that has changed. Its text is taken as one step, unless this text has changes of its own.
    ///
    /// # Errors
    /// The file cannot be read or is wrong; the text stays as it is.
    pub fn reload(&mut self, kind: Kind) -> Outcome<Reload> {
        let Some(path) = self.part(kind).path.clone() else { return Ok(Reload::Same) };
        let text = read(&path)?;
        let part = self.part_mut(kind);
        if text == part.saved {
            part.conflict = None;
            // The recording that a sequence names may be what has changed.
            let now = part.text.clone();
            self.check(kind, &now)?;
            return Ok(Reload::Same);
        }
        if text == part.text {
            part.saved = text;
            part.conflict = None;
            return Ok(Reload::Same);
        }
        match kind {
            Kind::Rig => drop(parse_rig(part, &text)?),
            Kind::Sequence => drop(parse_sequence(part, &text)?),
        }
        if part.is_changed() {
            part.conflict = Some(text);
            return Ok(Reload::Conflict);
        }
        part.saved = text.clone();
        self.replace(kind, text, "change of the file", None)?;
        Ok(Reload::Taken)
    }

    /// Ends a conflict: with the text of the file as one step, or with the text here, which the next save writes.
    ///
    /// # Errors
    /// The recording that the file's text names is gone.
    pub fn settle(&mut self, kind: Kind, takes_file: bool) -> Outcome {
        let part = self.part_mut(kind);
        let Some(text) = part.conflict.take() else { return Ok(()) };
        part.saved = text.clone();
        if takes_file { self.replace(kind, text, "change of the file", None) } else { Ok(()) }
    }

    /// Writes a text to its file.
    ///
    /// # Errors
    /// It has no file yet; the system refuses.
    pub fn save(&mut self, kind: Kind) -> Outcome {
        let part = self.part_mut(kind);
        let Some(path) = &part.path else {
            return Err(Failure::input(format!("the {} has no file yet: save it under a name", kind.name())));
        };
        output::write(path, part.text.as_bytes())?;
        part.saved = part.text.clone();
        part.conflict = None;
        Ok(())
    }

    /// Writes a text to a new file, which is its file from then on.
    ///
    /// # Errors
    /// The system refuses.
    pub fn save_as(&mut self, kind: Kind, path: &Path) -> Outcome {
        let path = inputs::absolute(path)?;
        let before = self.part_mut(kind).path.replace(path);
        let saved = self.save(kind);
        if saved.is_err() {
            self.part_mut(kind).path = before;
        }
        saved
    }

    /// Writes what is not saved beside its file, or into the working folder, and names the files: for a window that has to
    /// close.
    ///
    /// # Errors
    /// The system refuses.
    pub fn rescue(&self) -> Outcome<Vec<PathBuf>> {
        let mut files = Vec::new();
        for kind in Kind::ALL {
            let part = self.part(kind);
            if !part.is_changed() {
                continue;
            }
            let name = match &part.path {
                Some(path) => format!("{}.unsaved", path.display()),
                None => format!("{}.json.unsaved", kind.name()),
            };
            let path = PathBuf::from(name);
            output::write(&path, part.text.as_bytes())?;
            files.push(path);
        }
        Ok(files)
    }
}

fn read(path: &Path) -> Outcome<String> {
    if !path.is_file() {
        let found = if path.is_dir() { "a folder" } else { "no such file" };
        return Err(Failure::input(format!("{}: found {found}, expected a .json file", path.display())));
    }
    Ok(json::read_text(path)?)
}

fn name(part: &Part, kind: Kind) -> String {
    part.path.as_ref().map_or_else(|| format!("{}.json", kind.name()), |path| path.display().to_string())
}

fn parse_rig(part: &Part, text: &str) -> Outcome<Rig> {
    Ok(Rig::from_json(&name(part, Kind::Rig), text)?)
}

fn parse_sequence(part: &Part, text: &str) -> Outcome<(Sequence, Vec<Note>)> {
    let folder = part.path.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
    inputs::sequence_of_text(&name(part, Kind::Sequence), text, folder)
}
