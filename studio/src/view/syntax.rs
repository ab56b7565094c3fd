//! Edits of JSON text that keep comments, order and layout: a change of one number is a change of one line.
//!
//! ```text
//! text + path + value --syntax tree of the text--> text
//! ```
//!
//! Values are given as JSON text and are put in as they are, so that a key of a track stays on one line.

use jsonc_parser::cst::{CstArray, CstInputValue, CstNode, CstObject, CstRootNode};
use rubor_rig::json::{SYNTAX, Step};

/// An edit that has no place in the text.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{at}: found {found}, expected {expected}")]
pub struct EditError {
    /// The path, as `expressions.joy[2].t`.
    pub at: String,
    /// What is there.
    pub found: String,
    /// What was expected there.
    pub expected: &'static str,
}

/// Names and numbers of a path: `expressions.joy[2].t`.
pub fn written(path: &[Step]) -> String {
    let mut text = String::new();
    for step in path {
        match step {
            Step::Key(key) if text.is_empty() => text.push_str(key),
            Step::Key(key) => text.push_str(&format!(".{key}")),
            Step::Index(i) => text.push_str(&format!("[{i}]")),
        }
    }
    text
}

/// A text in double quotes.
pub fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

/// A number with at most `decimals` decimals and no needless zeros.
pub fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Replaces the value at a path, or adds it. Objects on the way are made where they are missing; elements of arrays are not.
///
/// # Errors
/// A text that is no JSON; a value on the path that is neither an object nor an array.
pub fn set(text: &str, path: &[Step], value: &str) -> Result<String, EditError> {
    let (mark, root) = parse(text)?;
    let raw = CstInputValue::Number(value.to_owned());
    let (last, around) = path.split_last().ok_or_else(|| wrong(path, "nothing", "a path"))?;
    match (walk(&root, around, true)?, last) {
        (CstNode::Container(node), Step::Key(key)) => {
            let object = node.as_object().ok_or_else(|| wrong(around, "no object", "an object"))?;
            match object.get(key) {
                Some(property) => property.set_value(raw),
                None => add_property(&object, key, value),
            }
        }
        (CstNode::Container(node), Step::Index(i)) => {
            let array = node.as_array().ok_or_else(|| wrong(around, "no array", "an array"))?;
            let old = array.elements().into_iter().nth(*i);
            replace(old.ok_or_else(|| wrong(path, "nothing", "an element"))?, raw);
        }
        _ => return Err(wrong(around, "a single value", "an object or an array")),
    }
    Ok(format!("{mark}{root}"))
}

/// Puts an element into an array, before the one that has this index.
///
/// # Errors
/// A text that is no JSON; no array at the path.
pub fn insert(text: &str, path: &[Step], index: usize, value: &str) -> Result<String, EditError> {
    let (mark, root) = parse(text)?;
    let inserted = array_at(&root, path)?.insert(index, CstInputValue::Number(value.to_owned()));
    // Between elements on one line the library leaves the space that was there beside its own.
    let after: Vec<CstNode> = inserted.next_siblings().take(3).collect();
    if let [comma, space, second] = &after[..]
        && comma.is_comma()
        && space.is_whitespace()
        && second.is_whitespace()
    {
        second.clone().remove();
    }
    Ok(format!("{mark}{root}"))
}

/// Takes a member of an object or an element of an array out.
///
/// # Errors
/// A text that is no JSON; nothing at the path.
pub fn remove(text: &str, path: &[Step]) -> Result<String, EditError> {
    let (mark, root) = parse(text)?;
    let (last, around) = path.split_last().ok_or_else(|| wrong(path, "nothing", "a path"))?;
    let node = walk(&root, around, false)?;
    let missing = || wrong(path, "nothing", "a value");
    match last {
        Step::Key(key) => {
            let object = node.as_object().ok_or_else(missing)?;
            object.get(key).ok_or_else(missing)?.remove();
        }
        Step::Index(i) => {
            let array = node.as_array().ok_or_else(missing)?;
            array.elements().into_iter().nth(*i).ok_or_else(missing)?.remove();
        }
    }
    Ok(format!("{mark}{root}"))
}

/// The text of the value at a path; none if there is nothing.
pub fn text_at(text: &str, path: &[Step]) -> Option<String> {
    let (_, root) = parse(text).ok()?;
    Some(walk(&root, path, false).ok()?.to_string())
}

fn wrong(path: &[Step], found: &str, expected: &'static str) -> EditError {
    EditError { at: written(path), found: found.to_owned(), expected }
}

/// The byte order mark, which stays, and the tree of the rest.
fn parse(text: &str) -> Result<(&str, CstRootNode), EditError> {
    let (mark, text) = text.split_at(if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 });
    CstRootNode::parse(text, &SYNTAX).map(|root| (mark, root)).map_err(|e| EditError {
        at: "text".into(),
        found: e.to_string(),
        expected: "JSON",
    })
}

/// The value at a path. `makes`: missing objects are added.
fn walk(root: &CstRootNode, path: &[Step], makes: bool) -> Result<CstNode, EditError> {
    let mut node: CstNode = root.value().ok_or_else(|| wrong(&[], "nothing", "an object"))?;
    for (i, step) in path.iter().enumerate() {
        let missing = || wrong(&path[..=i], "nothing", "a value");
        node = match step {
            Step::Key(key) => {
                let object = node.as_object().ok_or_else(|| wrong(&path[..i], "no object", "an object"))?;
                if makes && object.get(key).is_none() {
                    let made = object.append(key, CstInputValue::Object(Vec::new()));
                    made.object_value_or_set().ensure_multiline();
                }
                object.get(key).and_then(|p| p.value()).ok_or_else(missing)?
            }
            Step::Index(n) => {
                let array = node.as_array().ok_or_else(|| wrong(&path[..i], "no array", "an array"))?;
                array.elements().into_iter().nth(*n).ok_or_else(missing)?
            }
        };
    }
    Ok(node)
}

fn array_at(root: &CstRootNode, path: &[Step]) -> Result<CstArray, EditError> {
    walk(root, path, false)?.as_array().ok_or_else(|| wrong(path, "no array", "an array"))
}

/// Adds a member at the end. An object on one line stays on one line.
fn add_property(object: &CstObject, key: &str, value: &str) {
    let text = object.to_string();
    match text.trim_end().strip_suffix('}').filter(|_| !text.contains('\n')) {
        Some(inside) => {
            let inside = inside.trim_end().trim_end_matches(',');
            let comma = if object.properties().is_empty() { "" } else { "," };
            let longer = format!("{inside}{comma} {}: {value} }}", quoted(key));
            object.clone().replace_with(CstInputValue::Number(longer));
        }
        _ => {
            object.append(key, CstInputValue::Number(value.to_owned()));
        }
    }
}

fn replace(node: CstNode, raw: CstInputValue) {
    use jsonc_parser::cst::{CstContainerNode, CstLeafNode};
    match node {
        CstNode::Container(CstContainerNode::Object(n)) => drop(n.replace_with(raw)),
        CstNode::Container(CstContainerNode::Array(n)) => drop(n.replace_with(raw)),
        CstNode::Leaf(CstLeafNode::NumberLit(n)) => drop(n.replace_with(raw)),
        CstNode::Leaf(CstLeafNode::StringLit(n)) => drop(n.replace_with(raw)),
        CstNode::Leaf(CstLeafNode::BooleanLit(n)) => drop(n.replace_with(raw)),
        CstNode::Leaf(CstLeafNode::NullKeyword(n)) => drop(n.replace_with(raw)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(keys: &[&str]) -> Vec<Step> {
        keys.iter().map(|k| k.parse::<usize>().map_or_else(|_| Step::from(*k), Step::from)).collect()
    }

    #[test]
    fn one_number_changes_one_line_and_comments_stay() {
        let text = "// Top\n{\n  \"a\": { \"x\": 1, /* in */ \"y\": 2 }, // after\n  \"k\": [\n    { \"t\": 0, \"v\": 0 },\n    { \"t\": 2, \"v\": 1 }, // late\n  ],\n}\n";
        let changed = set(text, &path(&["a", "x"]), "0.5").unwrap();
        assert_eq!(changed, text.replace("\"x\": 1", "\"x\": 0.5"));
        let changed = set(text, &path(&["k", "1", "v"]), "0.25").unwrap();
        assert_eq!(changed, text.replace("\"v\": 1", "\"v\": 0.25"));
        let longer = insert(text, &path(&["k"]), 1, "{ \"t\": 1, \"v\": 0.7 }").unwrap();
        let line = "    { \"t\": 0, \"v\": 0 },\n";
        assert_eq!(longer, text.replace(line, &format!("{line}    {{ \"t\": 1, \"v\": 0.7 }},\n")));
        assert_eq!(remove(&longer, &path(&["k", "1"])).unwrap(), text);
        let added = set(text, &path(&["a", "z"]), "3").unwrap();
        assert_eq!(added, text.replace("\"y\": 2 }", "\"y\": 2, \"z\": 3 }"));
    }

    #[test]
    fn missing_objects_are_made_and_what_has_no_place_is_said() {
        let made =
            set("{\n  \"fps\": 24\n}\n", &path(&["shapes", "jawOpen"]), "[{ \"t\": 0, \"v\": 1 }]").unwrap();
        let value: serde_json::Value = serde_json::from_str(&made).unwrap();
        assert_eq!(value["shapes"]["jawOpen"][0]["v"], 1);
        assert!(made.starts_with("{\n  \"fps\": 24,\n"), "{made}");
        assert_eq!(set("\u{feff}{ \"a\": 1 }", &path(&["a"]), "2").unwrap(), "\u{feff}{ \"a\": 2 }");
        let error = set("{ \"fps\": 24 }", &path(&["fps", "x"]), "1").unwrap_err();
        assert!(error.to_string().contains("fps"), "{error}");
        assert!(remove("{ }", &path(&["a"])).is_err());
        assert!(set("{", &path(&["a"]), "1").is_err());
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(number(0.30000001, 3), "0.3");
        assert_eq!(number(2.0, 3), "2");
        assert_eq!(number(-0.0001, 3), "0");
        assert_eq!(number(120.0, 0), "120");
        assert_eq!(written(&path(&["expressions", "joy", "2", "t"])), "expressions.joy[2].t");
    }
}
