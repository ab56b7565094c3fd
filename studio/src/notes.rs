//! Notes: warnings about entries without effect, guesses and repairs.
//!
//! ```
//! use rubor::notes::{Note, summed};
//! let lacks = |name: &str| Note::new("head \"Ada\"", format!("the head has no shape {name:?}: it has no effect"));
//! let lines = summed(&[lacks("jawOpen"), lacks("tongueOut")]);
//! assert_eq!(lines, [r#"head "Ada": the head has no shape "jawOpen" and "tongueOut": it has no effect"#]);
//! ```

use std::collections::{HashMap, HashSet};
use std::fmt;

/// One note.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// The file or head that it is about; may be empty.
    pub about: String,
    /// Place in the file, ready to stand before the message; may be empty.
    pub place: String,
    /// The finding and its consequence.
    pub message: String,
}

/// Number of names that a summed note shows.
const SHOWN_NAMES: usize = 3;

impl Note {
    /// A remark about a file or a head as a whole.
    pub fn new(about: impl Into<String>, message: impl Into<String>) -> Self {
        Self { about: about.into(), place: String::new(), message: message.into() }
    }

    /// A remark of the rig about this head.
    pub fn of_rig(about: impl Into<String>, note: &rubor_rig::error::Note) -> Self {
        let hint = note.nearest.as_ref().map(|n| format!("; did you mean {n:?}?")).unwrap_or_default();
        Self {
            about: about.into(),
            place: note.place.to_string(),
            message: format!("{}{hint}", note.message),
        }
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.about.is_empty() {
            write!(f, "{}: ", self.about)?;
        }
        write!(f, "{}{}", self.place, self.message)
    }
}

/// One line per kind: notes on the same file or head whose messages differ only in the first quoted name.
pub fn summed(notes: &[Note]) -> Vec<String> {
    type Kind<'a> = (&'a str, &'a str, &'a str, bool, &'a str);
    let mut kinds: Vec<(&Note, Vec<&str>)> = Vec::new();
    let mut number_of: HashMap<Kind<'_>, usize> = HashMap::new();
    let mut known: HashSet<(usize, &str)> = HashSet::new();
    for note in notes {
        let (before, name, after) = split_name(&note.message);
        let place = if name.is_empty() { note.place.as_str() } else { "" };
        let kind = (note.about.as_str(), before, after, name.is_empty(), place);
        let number = *number_of.entry(kind).or_insert_with(|| {
            kinds.push((note, Vec::new()));
            kinds.len() - 1
        });
        if known.insert((number, name)) {
            kinds[number].1.push(name);
        }
    }
    let line = |(first, names): (&Note, Vec<&str>)| {
        let (before, _, after) = split_name(&first.message);
        let message = format!("{before}{}{after}", listed(&names));
        Note { message, ..first.clone() }.to_string()
    };
    kinds.into_iter().map(line).collect()
}

/// `"a"`, `"a" and "b"`, `"a", "b", "c" and 25 more (28 in all)`.
fn listed(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [rest @ .., last] if names.len() <= SHOWN_NAMES => format!("{} and {last}", rest.join(", ")),
        _ => {
            let more = names.len() - SHOWN_NAMES;
            format!("{} and {more} more ({} in all)", names[..SHOWN_NAMES].join(", "), names.len())
        }
    }
}

/// The text before the first quoted name, the name with its quotes, and the text after it.
fn split_name(message: &str) -> (&str, &str, &str) {
    let Some(start) = message.find('"') else { return (message, "", "") };
    let mut is_escaped = false;
    for (i, c) in message[start + 1..].char_indices() {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            '"' => {
                let end = start + i + 2;
                return (&message[..start], &message[start..end], &message[end..]);
            }
            _ => {}
        }
    }
    (message, "", "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_of_one_kind_become_one_line_and_others_stay() {
        let mut notes: Vec<Note> = (0..28)
            .map(|i| Note {
                about: "head \"x\"".into(),
                place: format!("s.json:{i}:3: "),
                message: format!("the head has no shape \"shape{i}\": it has no effect"),
            })
            .collect();
        notes.insert(4, Note::new("head \"x\"", "the head has no wrinkle zones"));
        notes.push(Note::new("head \"y\"", "the head has no shape \"shape1\": it has no effect"));
        notes.push(notes[0].clone());
        assert_eq!(
            summed(&notes),
            [
                "head \"x\": s.json:0:3: the head has no shape \"shape0\", \"shape1\", \"shape2\" and 25 more (28 in all): \
                 it has no effect",
                "head \"x\": the head has no wrinkle zones",
                "head \"y\": the head has no shape \"shape1\": it has no effect",
            ]
        );
    }

    #[test]
    fn quotes_within_names_do_not_end_them() {
        assert_eq!(split_name(r#"no shape "a \" b": x"#), ("no shape ", r#""a \" b""#, ": x"));
        assert_eq!(split_name("an inch is 1\" long"), ("an inch is 1\" long", "", ""));
    }
}
