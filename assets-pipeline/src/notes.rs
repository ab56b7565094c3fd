//! Notes on everything that a reader left out, guessed or repaired: one line per kind, for all places.

use std::collections::HashMap;

use crate::check::{Finding, list};

/// Places that a note keeps; of more it keeps the number. A file of a gigabyte may have a fault in each line.
const MOST_PLACES: usize = 10_000;
/// Kinds that are kept apart; names of a file are part of some messages.
const MOST_KINDS: usize = 10_000;
/// What is said of the others.
const MORE_KINDS: &str = "there is more to say than is said here";

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
pub(crate) struct Notes {
    list: Vec<Note>,
    by_message: HashMap<String, usize>,
    /// By note: places beyond those that are kept.
    left_out: HashMap<usize, usize>,
}

impl Notes {
    /// Something at a place. The same message makes the same note.
    pub(crate) fn add(&mut self, message: impl AsRef<str>, place: impl Into<String>) {
        let kind = self.kind(message.as_ref());
        let places = &mut self.list[kind].places;
        if places.len() < MOST_PLACES {
            places.push(place.into());
        } else {
            *self.left_out.entry(kind).or_default() += 1;
        }
    }

    /// Something about the whole file.
    pub(crate) fn say(&mut self, message: impl Into<String>) {
        self.kind(&message.into());
    }

    /// Adds those of another reader.
    pub(crate) fn append(&mut self, other: Notes) {
        for (i, note) in other.list.into_iter().enumerate() {
            let kind = self.kind(&note.message);
            note.places.into_iter().for_each(|place| self.add(&note.message, place));
            if let Some(more) = other.left_out.get(&i) {
                *self.left_out.entry(kind).or_default() += more;
            }
        }
    }

    fn kind(&mut self, message: &str) -> usize {
        let message = match self.by_message.get(message) {
            Some(known) => return *known,
            None if self.list.len() >= MOST_KINDS => MORE_KINDS,
            None => message,
        };
        let list = &mut self.list;
        *self.by_message.entry(message.to_owned()).or_insert_with(|| {
            list.push(Note { message: message.to_owned(), places: Vec::new() });
            list.len() - 1
        })
    }

    pub(crate) fn into_vec(mut self) -> Vec<Note> {
        for (kind, more) in self.left_out {
            self.list[kind].places.push(format!("{more} places that are not listed"));
        }
        self.list
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
        let mut many = notes.clone();
        (0..2 * MOST_PLACES).for_each(|i| many.add("left out", i.to_string()));
        (0..2 * MOST_KINDS).for_each(|i| many.say(i.to_string()));
        let mut twice = Notes::default();
        twice.append(many.clone());
        let (many, twice) = (many.into_vec(), twice.into_vec());
        assert_eq!((many.len(), &twice), (MOST_KINDS + 1, &many));
        assert_eq!(many[0].places[MOST_PLACES], format!("{} places that are not listed", MOST_PLACES + 28));
        let notes = notes.into_vec();
        assert_eq!(notes.len(), 2);
        assert_eq!(
            notes[0].to_string(),
            "left out: channel 0, channel 1, channel 2, channel 3, channel 4, channel 5, channel 6, channel 7 and 20 more"
        );
        assert_eq!(notes[1].to_string(), "v grows downwards");
    }
}
