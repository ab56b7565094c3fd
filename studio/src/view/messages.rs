//! What is wrong now, by what it is about, and what was done, newest last.

use std::collections::{BTreeMap, VecDeque};

use super::document::Kind;
use crate::notes::Note;

/// What an error is about. A new one replaces the last one about the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum About {
    /// The device.
    Device,
    /// The file of a text.
    File(Kind),
    /// The file of the head.
    Head,
    /// Rig, sequence and head together.
    Scene,
    /// The last edit.
    Edit,
    /// The last save.
    Save,
    /// The socket.
    Live,
    /// The comparison with the reference.
    Reference,
    /// The last picture that was written.
    Screenshot,
}

/// Lines of the log that are kept.
const MOST_LINES: usize = 200;

/// Errors and a log.
#[derive(Clone, Debug, Default)]
pub struct Messages {
    errors: BTreeMap<About, String>,
    log: VecDeque<String>,
}

impl Messages {
    /// Something is wrong.
    pub fn error(&mut self, about: About, message: impl Into<String>) {
        let message = message.into();
        if self.errors.get(&about) != Some(&message) {
            self.line(format!("error: {message}"));
        }
        self.errors.insert(about, message);
    }

    /// It is right again.
    pub fn clear(&mut self, about: About) {
        self.errors.remove(&about);
    }

    /// Something was done.
    pub fn info(&mut self, message: impl Into<String>) {
        self.line(message.into());
    }

    /// Something that may be said again and again is said once.
    pub fn once(&mut self, message: String) {
        if !self.log.contains(&message) {
            self.line(message);
        }
    }

    /// Remarks of readers.
    pub fn notes(&mut self, notes: &[Note]) {
        notes.iter().for_each(|note| self.line(note.to_string()));
    }

    fn line(&mut self, line: String) {
        if self.log.back() != Some(&line) {
            self.log.push_back(line);
        }
        while self.log.len() > MOST_LINES {
            self.log.pop_front();
        }
    }

    /// What is wrong now.
    pub fn errors(&self) -> impl Iterator<Item = (About, &str)> {
        self.errors.iter().map(|(about, message)| (*about, message.as_str()))
    }

    /// The log, oldest first.
    pub fn log(&self) -> impl DoubleEndedIterator<Item = &str> {
        self.log.iter().map(String::as_str)
    }

    /// The last line of the log.
    pub fn last(&self) -> Option<&str> {
        self.log.back().map(String::as_str)
    }
}
