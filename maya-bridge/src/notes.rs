//! Notes on everything that a reader left out, guessed or repaired: one line per kind, with a count and the first
//! names.

use std::collections::{HashMap, HashSet};

/// Names that a line spells out.
const MOST_NAMES: usize = 5;

/// Notes in the order in which their kinds were met.
#[derive(Clone, Debug, Default)]
pub(crate) struct Notes {
    kinds: Vec<Kind>,
    by_text: HashMap<String, usize>,
}

#[derive(Clone, Debug)]
struct Kind {
    text: String,
    /// The first of the names.
    names: Vec<String>,
    all: HashSet<String>,
}

impl Notes {
    /// A note of its own kind; equal ones count once.
    pub(crate) fn say(&mut self, text: impl Into<String>) {
        self.kind(text.into());
    }

    /// A note about something that has a name; notes of the same text are summed.
    pub(crate) fn about(&mut self, text: impl Into<String>, name: impl Into<String>) {
        let kind = self.kind(text.into());
        let name = name.into();
        if kind.all.insert(name.clone()) && kind.names.len() < MOST_NAMES {
            kind.names.push(name);
        }
    }

    fn kind(&mut self, text: String) -> &mut Kind {
        let kinds = &mut self.kinds;
        let index = *self.by_text.entry(text.clone()).or_insert_with(|| {
            kinds.push(Kind { text, names: Vec::new(), all: HashSet::new() });
            kinds.len() - 1
        });
        &mut kinds[index]
    }

    /// One line per kind.
    pub(crate) fn lines(&self) -> Vec<String> {
        let line = |kind: &Kind| {
            let Kind { text, names, all } = kind;
            match all.len() {
                0 => text.clone(),
                1 => format!("{text}: {}", names[0]),
                n if n > names.len() => {
                    format!("{text} ({n}): {} and {} more", names.join(", "), n - names.len())
                }
                n => format!("{text} ({n}): {}", names.join(", ")),
            }
        };
        self.kinds.iter().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_of_one_kind_are_one_line() {
        let mut notes = Notes::default();
        for i in 0..28 {
            notes.about("not followed", format!("n{i}"));
            notes.about("not followed", "n0");
        }
        notes.say("alone");
        notes.say("alone");
        notes.about("named", "a");
        assert_eq!(notes.lines(), ["not followed (28): n0, n1, n2, n3, n4 and 23 more", "alone", "named: a"]);
    }
}
