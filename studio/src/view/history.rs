//! Undo and redo: what was replaced in which text, newest last.

use std::collections::VecDeque;

use super::document::Kind;

/// Steps that are kept.
const MOST_STEPS: usize = 1000;
/// Bytes that are kept.
const MOST_BYTES: usize = 64 << 20;

/// A replaced stretch of a text.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Change {
    of: Kind,
    label: String,
    /// Byte at which both texts begin to differ.
    at: usize,
    removed: String,
    inserted: String,
    /// Changes in a row with the same mark are one step.
    mark: Option<String>,
}

/// The steps of an edit session.
#[derive(Clone, Debug, Default)]
pub struct History {
    done: VecDeque<Change>,
    undone: Vec<Change>,
    bytes: usize,
}

impl History {
    /// Notes that a text has changed. Changes in a row with one mark, as those of a slider that is dragged, become one step.
    pub fn push(&mut self, of: Kind, label: &str, mark: Option<&str>, before: &str, after: &str) {
        self.undone.clear();
        let mut first = before.to_owned();
        let continues = |last: &Change| last.of == of && last.mark.is_some() && last.mark.as_deref() == mark;
        if self.done.back().is_some_and(continues)
            && let Some(last) = self.done.pop_back()
        {
            self.bytes -= last.removed.len() + last.inserted.len();
            first = last.backwards(before);
        }
        if first == after {
            return;
        }
        let (at, removed, inserted) = difference(&first, after);
        self.bytes += removed.len() + inserted.len();
        let mark = mark.map(str::to_owned);
        self.done.push_back(Change { of, label: label.to_owned(), at, removed, inserted, mark });
        while self.done.len() > MOST_STEPS || (self.bytes > MOST_BYTES && self.done.len() > 1) {
            if let Some(oldest) = self.done.pop_front() {
                self.bytes -= oldest.removed.len() + oldest.inserted.len();
            }
        }
    }

    /// Ends a row of changes with one mark.
    pub fn seal(&mut self) {
        if let Some(last) = self.done.back_mut() {
            last.mark = None;
        }
    }

    /// Takes the last step back: which text, its contents before, and what the step was. `text` gives the contents now.
    pub fn undo<'a>(&mut self, text: impl Fn(Kind) -> &'a str) -> Option<(Kind, String, String)> {
        let change = self.done.pop_back()?;
        self.bytes -= change.removed.len() + change.inserted.len();
        let result = (change.of, change.backwards(text(change.of)), change.label.clone());
        self.undone.push(change);
        Some(result)
    }

    /// Does the last step that was taken back again.
    pub fn redo<'a>(&mut self, text: impl Fn(Kind) -> &'a str) -> Option<(Kind, String, String)> {
        let change = self.undone.pop()?;
        self.bytes += change.removed.len() + change.inserted.len();
        let result = (change.of, change.forwards(text(change.of)), change.label.clone());
        self.done.push_back(change);
        Some(result)
    }

    /// What would be taken back.
    pub fn undo_label(&self) -> Option<&str> {
        self.done.back().map(|c| c.label.as_str())
    }

    /// What would be done again.
    pub fn redo_label(&self) -> Option<&str> {
        self.undone.last().map(|c| c.label.as_str())
    }

    /// Steps that can be taken back.
    pub fn len(&self) -> usize {
        self.done.len()
    }

    /// Whether nothing can be taken back.
    pub fn is_empty(&self) -> bool {
        self.done.is_empty()
    }
}

impl Change {
    fn backwards(&self, after: &str) -> String {
        splice(after, self.at, self.inserted.len(), &self.removed)
    }

    fn forwards(&self, before: &str) -> String {
        splice(before, self.at, self.removed.len(), &self.inserted)
    }
}

fn splice(text: &str, at: usize, length: usize, with: &str) -> String {
    let (start, end) = (text.get(..at).unwrap_or(text), text.get(at + length..).unwrap_or_default());
    [start, with, end].concat()
}

/// Where two texts begin to differ, and what stands there in each.
fn difference(before: &str, after: &str) -> (usize, String, String) {
    let (a, b) = (before.as_bytes(), after.as_bytes());
    let mut start = a.iter().zip(b).take_while(|(x, y)| x == y).count();
    while !(before.is_char_boundary(start) && after.is_char_boundary(start)) {
        start -= 1;
    }
    let most = a.len().min(b.len()) - start;
    let mut end = a.iter().rev().zip(b.iter().rev()).take(most).take_while(|(x, y)| x == y).count();
    while !(before.is_char_boundary(a.len() - end) && after.is_char_boundary(b.len() - end)) {
        end -= 1;
    }
    (start, before[start..a.len() - end].to_owned(), after[start..b.len() - end].to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_go_back_and_forth_and_a_drag_is_one() {
        let mut history = History::default();
        let texts = ["a 1 ü b", "a 2 ü b", "a 3 ö b", "a 33 ö b", ""];
        history.push(Kind::Rig, "first", None, texts[0], texts[1]);
        history.push(Kind::Rig, "drag", Some("x"), texts[1], texts[2]);
        history.push(Kind::Rig, "drag", Some("x"), texts[2], texts[3]);
        history.seal();
        history.push(Kind::Rig, "drag", Some("x"), texts[3], texts[4]);
        assert_eq!(history.len(), 3);
        let mut now = texts[4].to_owned();
        for expected in [texts[3], texts[1], texts[0]] {
            now = history.undo(|_| &now).unwrap().1;
            assert_eq!(now, expected);
        }
        assert!(history.undo(|_| "").is_none());
        for expected in [texts[1], texts[3], texts[4]] {
            now = history.redo(|_| &now).unwrap().1;
            assert_eq!(now, expected);
        }
        history.push(Kind::Rig, "other", None, texts[4], "z");
        assert!(history.redo_label().is_none(), "a new step ends what could be done again");
    }

    #[test]
    fn a_drag_that_comes_back_leaves_no_step() {
        let mut history = History::default();
        history.push(Kind::Sequence, "drag", Some("x"), "1", "2");
        history.push(Kind::Sequence, "drag", Some("x"), "2", "1");
        assert!(history.is_empty());
    }

    #[test]
    fn memory_is_bounded() {
        let mut history = History::default();
        let large = "x".repeat(1 << 20);
        for i in 0..200 {
            let (a, b) = if i % 2 == 0 { ("", large.as_str()) } else { (large.as_str(), "") };
            history.push(Kind::Rig, "step", None, a, b);
        }
        assert!(history.bytes <= MOST_BYTES && history.len() >= 60, "{} {}", history.bytes, history.len());
    }
}
