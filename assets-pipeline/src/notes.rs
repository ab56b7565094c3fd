//! Notes on everything that a reader left out, guessed or repaired: one line per kind, for all places.

use crate::check::{Finding, list};

/// One kind of thing that happened, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// What happened and how it was handled.
    pub message: String,
    /// Names or places; empty where the file as a whole is meant.
    pub places: Vec<String>,
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)?;
        if !self.places.is_empty() {
            write!(f, ": {}", list(&self.places))?;
        }
        Ok(())
    }
}

/// Collects notes in the order of the first of each kind.
#[derive(Clone, Debug, Default)]
pub(crate) struct Notes(Vec<Note>);

impl Notes {
    /// Something at a place. The same message makes the same note.
    pub(crate) fn add(&mut self, message: impl AsRef<str>, place: impl Into<String>) {
        let (message, place) = (message.as_ref(), place.into());
        match self.0.iter_mut().find(|n| n.message == message) {
            Some(note) => note.places.push(place),
            None => self.0.push(Note { message: message.to_owned(), places: vec![place] }),
        }
    }

    /// Something about the whole file.
    pub(crate) fn say(&mut self, message: impl Into<String>) {
        let message = message.into();
        if self.0.iter().all(|n| n.message != message) {
            self.0.push(Note { message, places: Vec::new() });
        }
    }

    /// Adds those of another reader.
    pub(crate) fn append(&mut self, other: Notes) {
        for note in other.0 {
            match self.0.iter_mut().find(|n| n.message == note.message) {
                Some(known) => known.places.extend(note.places),
                None => self.0.push(note),
            }
        }
    }

    pub(crate) fn into_vec(self) -> Vec<Note> {
        self.0
    }
}

impl From<&Note> for Finding {
    fn from(note: &Note) -> Self {
        Finding::warning("", note.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_kind_is_one_line() {
        let mut notes = Notes::default();
        for i in 0..28 {
            notes.add("left out", format!("channel {i}"));
        }
        notes.say("v grows downwards");
        notes.say("v grows downwards");
        let notes = notes.into_vec();
        assert_eq!(notes.len(), 2);
        assert_eq!(
            notes[0].to_string(),
            "left out: channel 0, channel 1, channel 2, channel 3, channel 4, channel 5, channel 6, channel 7 and 20 more"
        );
        assert_eq!(notes[1].to_string(), "v grows downwards");
    }
}
