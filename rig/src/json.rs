//! Reading JSON as people write it, with the place of every fault.
//!
//! ```text
//! text --parse--> tree with ranges --serde--> Rig, Sequence  (+ Source: text and file name)
//!                        \--> an error inside a value: the range of that value
//! Source + path of a value --parse again--> line, column     (only when a message is needed)
//! ```
//!
//! Allowed beyond JSON: `//` and `/* */` comments, trailing commas. Not allowed, unlike in some readers: the same key
//! twice, as the first would be silently lost.
//!
//! Ranges are checked where values are bound, not by a derive (`garde`), which has no place in the text.

use std::collections::HashMap;
use std::fmt::Display;
use std::sync::{Arc, OnceLock};

use jsonc_parser::ast::{ObjectPropName, Value};
use jsonc_parser::common::Ranged;
use jsonc_parser::errors::ParseErrorKind;
use jsonc_parser::{CollectOptions, ParseOptions, parse_to_ast};
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::de::{self, DeserializeOwned, DeserializeSeed, IntoDeserializer, Visitor};
use serde::forward_to_deserialize_any;

use crate::error::{Place, RigError};
use crate::limits;
use crate::names::nearest;

/// Where a value was read from, kept with the value so that later messages can name the place.
/// All sources are equal to each other: two equal rigs from different files are equal.
#[derive(Clone, Debug, Default)]
pub struct Source {
    file: Arc<str>,
    text: Arc<str>,
    /// Made for the first message: a file may earn a hundred thousand.
    places: Arc<OnceLock<Places>>,
}

impl PartialEq for Source {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// One step from a JSON value to a value inside it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Step {
    /// The member of an object.
    Key(String),
    /// The element of an array, from 0.
    Index(usize),
}

impl From<&str> for Step {
    fn from(key: &str) -> Self {
        Self::Key(key.to_owned())
    }
}

impl From<&String> for Step {
    fn from(key: &String) -> Self {
        Self::Key(key.clone())
    }
}

impl From<usize> for Step {
    fn from(index: usize) -> Self {
        Self::Index(index)
    }
}

/// Steps from the whole document to one value: `steps!["expressions", name, "shapes"]`.
macro_rules! steps {
    ($($step:expr),* $(,)?) => { [$($crate::json::Step::from($step)),*] };
}
pub(crate) use steps;

impl Source {
    /// Text of a file under the name that messages give it.
    pub fn new(file: &str, text: &str) -> Self {
        Self { file: file.into(), text: text.into(), places: Arc::default() }
    }

    /// Name of the file as messages give it; empty for values that were made by a program.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Place of a value, or of the last value on the path that exists.
    pub fn place_of_value(&self, path: &[Step]) -> Place {
        self.place(path, false)
    }

    /// Place of the key that leads to a value.
    pub fn place_of_key(&self, path: &[Step]) -> Place {
        self.place(path, true)
    }

    fn place(&self, path: &[Step], at_key: bool) -> Place {
        let places = self.places.get_or_init(|| Places::new(&self.text));
        let Some(offset) = places.offset(path, at_key) else {
            return Place { file: self.file.to_string(), line: 0, column: 0 };
        };
        let (line, column) = places.lines.of(&self.text, offset);
        Place { file: self.file.to_string(), line, column }
    }
}

/// Offsets of all values of a text.
#[derive(Debug, Default)]
struct Places {
    /// Key and value of each, by the value around it; empty where the text does not parse.
    starts: Vec<[usize; 2]>,
    by_step: HashMap<(usize, Step), usize>,
    lines: Lines,
}

impl Places {
    fn new(text: &str) -> Self {
        let mut places = Self { lines: Lines::new(text), ..Self::default() };
        let Ok(Some(root)) = parse(text) else { return places };
        places.starts.push([root.range().start; 2]);
        let mut open = vec![(&root, 0)];
        while let Some((value, around)) = open.pop() {
            let mut add = |step: Step, key: usize, inner| {
                let number = places.starts.len();
                places.starts.push([key, Ranged::range(inner).start]);
                // The first of several equal keys, as a reader refuses the others.
                places.by_step.entry((around, step)).or_insert(number);
                open.push((inner, number));
            };
            match value {
                Value::Object(object) => {
                    for p in &object.properties {
                        add(Step::Key(p.name.as_str().to_owned()), p.name.range().start, &p.value);
                    }
                }
                Value::Array(array) => {
                    for (i, element) in array.elements.iter().enumerate() {
                        add(Step::Index(i), element.range().start, element);
                    }
                }
                _ => {}
            }
        }
        places
    }

    /// Where a value, or its key, starts; else the last value on the path that exists.
    fn offset(&self, path: &[Step], at_key: bool) -> Option<usize> {
        let mut value = 0;
        let mut reached = 0;
        for step in path {
            let Some(inner) = self.by_step.get(&(value, step.clone())) else { break };
            value = *inner;
            reached += 1;
        }
        let [key, start] = *self.starts.get(value)?;
        Some(if at_key && reached == path.len() { key } else { start })
    }
}

/// Starts of the lines of a text, and characters before every [`Lines::STEP`] bytes, for columns of long lines.
#[derive(Debug, Default)]
struct Lines {
    starts: Vec<usize>,
    characters: Vec<usize>,
}

impl Lines {
    const STEP: usize = 1024;

    fn new(text: &str) -> Self {
        let ends = text.bytes().enumerate().filter(|(_, b)| *b == b'\n');
        let starts = std::iter::once(0).chain(ends.map(|(i, _)| i + 1)).collect();
        let mut characters = vec![0];
        let mut count = 0;
        for chunk in text.as_bytes().chunks(Self::STEP) {
            count += characters_of(chunk);
            characters.push(count);
        }
        Self { starts, characters }
    }

    /// Line and column of an offset, from 1.
    fn of(&self, text: &str, offset: usize) -> (usize, usize) {
        let line = self.starts.partition_point(|start| *start <= offset).max(1);
        let before = |at: usize| {
            let step = at / Self::STEP;
            self.characters[step] + characters_of(&text.as_bytes()[step * Self::STEP..at])
        };
        (line, before(offset) - before(self.starts[line - 1]) + 1)
    }
}

/// Characters that begin in these bytes of UTF-8.
fn characters_of(bytes: &[u8]) -> usize {
    bytes.iter().filter(|b| **b & 0xc0 != 0x80).count()
}

/// Reads a value.
///
/// # Errors
/// The first syntax error, unknown field or wrong type, with its place.
pub fn from_str<T: DeserializeOwned>(file: &str, text: &str) -> Result<(T, Source), RigError> {
    // Columns are counted without the byte order mark, which editors do not show.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    // The tree, and what is made of it.
    if let Err((found, expected)) = limits::check_values(text.as_bytes(), 2) {
        let place = Place { file: file.to_owned(), line: 0, column: 0 };
        return Err(RigError { place, found, expected, nearest: None });
    }
    let root = match parse(text) {
        Ok(Some(root)) => root,
        Ok(None) => {
            return Err(RigError {
                place: place_of_offset(file, text, text.len()),
                found: "no value".into(),
                expected: "an object".into(),
                nearest: None,
            });
        }
        Err(error) => return Err(syntax_error(file, text, &error)),
    };
    match T::deserialize(Node(&root)) {
        Ok(value) => Ok((value, Source::new(file, text))),
        Err(error) => Err(RigError {
            place: place_of_offset(file, text, error.offset.unwrap_or_default()),
            found: error.found,
            expected: error.expected,
            nearest: error.nearest,
        }),
    }
}

/// Reads the text of a file.
///
/// # Errors
/// A file that cannot be read, or that is not UTF-8.
pub fn read_text(path: &std::path::Path) -> Result<String, RigError> {
    limits::read_to_string(path).map_err(|error| RigError {
        place: Place { file: path.display().to_string(), line: 0, column: 0 },
        found: error.to_string(),
        expected: "a readable text file".into(),
        nearest: None,
    })
}

/// What a file may say beyond JSON: comments, and a comma after the last value.
pub const SYNTAX: ParseOptions = ParseOptions {
    allow_comments: true,
    allow_trailing_commas: true,
    allow_loose_object_property_names: false,
    allow_missing_commas: false,
    allow_single_quoted_strings: false,
    allow_hexadecimal_numbers: false,
    allow_unary_plus_numbers: false,
    allow_bare_decimal_point_numbers: false,
    allow_non_finite_numbers: false,
    allow_extended_string_escapes: false,
};

fn parse(text: &str) -> Result<Option<Value<'_>>, jsonc_parser::errors::ParseError> {
    Ok(parse_to_ast(text, &CollectOptions::default(), &SYNTAX)?.value)
}

fn place_of_offset(file: &str, text: &str, offset: usize) -> Place {
    let before = text.get(..offset).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |i| i + 1);
    Place {
        file: file.to_owned(),
        line: before.matches('\n').count() + 1,
        column: before[line_start..].chars().count() + 1,
    }
}

fn syntax_error(file: &str, text: &str, error: &jsonc_parser::errors::ParseError) -> RigError {
    use ParseErrorKind as Kind;
    let range = error.range();
    let expected = match error.kind() {
        Kind::ExpectedColonAfterObjectKey => "a colon after the name",
        Kind::ExpectedComma => "a comma",
        Kind::ExpectedObjectValue => "a value after the colon",
        Kind::ExpectedStringObjectProperty | Kind::UnexpectedTokenInObject => "a name in double quotes",
        Kind::UnexpectedWord => "a value: a number, a string in double quotes, an object or an array",
        Kind::SingleQuotedStringsNotAllowed => "double quotes",
        Kind::MultipleRootJsonValues => "the end of the file",
        Kind::NonFiniteNumbersNotAllowed => "a finite number",
        Kind::UnterminatedArray => "a closing ]",
        Kind::UnterminatedObject => "a closing }",
        Kind::UnterminatedCommentBlock => "a closing */",
        Kind::NestingDepthExceeded => "less nesting",
        Kind::BareDecimalPointNumbersNotAllowed
        | Kind::ExpectedDigit
        | Kind::ExpectedDigitFollowingNegativeSign
        | Kind::ExpectedPlusMinusOrDigitInNumberLiteral
        | Kind::HexadecimalNumbersNotAllowed
        | Kind::UnaryPlusNumbersNotAllowed => "a decimal number such as -0.5",
        Kind::String(_) => "a string that ends in a double quote and has no unknown escapes",
        Kind::UnexpectedCloseBrace | Kind::UnexpectedCloseBracket => {
            "a value, or the bracket that closes what is open"
        }
        Kind::UnexpectedColon
        | Kind::UnexpectedComma
        | Kind::UnexpectedToken
        | Kind::TrailingCommasNotAllowed
        | Kind::CommentsNotAllowed => "a value",
    };
    RigError {
        place: place_of_offset(file, text, range.start),
        found: match error.kind() {
            // Their place is the opening bracket: the mistake is easier to find from there than from the end of the
            // file.
            Kind::UnterminatedArray | Kind::UnterminatedObject => {
                "an opening bracket without its end".to_owned()
            }
            _ => excerpt(text, range.start),
        },
        expected: expected.to_owned(),
        nearest: None,
    }
}

/// The beginning of the text at an offset, for a message.
fn excerpt(text: &str, offset: usize) -> String {
    const LONGEST: usize = 24;
    let rest = text.get(offset..).unwrap_or_default();
    let line = rest.lines().next().unwrap_or_default().trim();
    if rest.is_empty() {
        "the end of the file".to_owned()
    } else if line.is_empty() {
        "the end of the line".to_owned()
    } else if line.chars().count() > LONGEST {
        format!("`{}...`", line.chars().take(LONGEST).collect::<String>())
    } else {
        format!("`{line}`")
    }
}

/// A fault that serde found, before the file and the line are known.
#[derive(Debug)]
struct NodeError {
    offset: Option<usize>,
    found: String,
    expected: String,
    nearest: Option<String>,
}

impl NodeError {
    fn new(found: String, expected: String) -> Self {
        Self { offset: None, found, expected, nearest: None }
    }

    /// The innermost value gives the place: an error that already has a place keeps it.
    fn at(mut self, node: &Value<'_>) -> Self {
        if self.offset.is_none() {
            self.offset = Some(node.range().start);
            if self.found.is_empty() {
                self.found = describe(node);
            }
        }
        self
    }

    fn unknown(kind: &str, found: &str, valid: &'static [&'static str]) -> Self {
        let nearest = nearest(found, valid.iter().copied());
        let expected = match valid {
            [] => format!("no {kind} here"),
            [only] => format!("the {kind} {only:?}"),
            _ => format!("one of the {kind}s {}", quoted_list(valid.iter().copied())),
        };
        Self { offset: None, found: format!("the unknown {kind} {found:?}"), expected, nearest }
    }
}

/// `"a", "b", "c"`, of many the first.
pub(crate) fn quoted_list<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    const SHOWN: usize = 64;
    let mut names = names.into_iter();
    let mut shown: Vec<String> = names.by_ref().take(SHOWN).map(|n| format!("{n:?}")).collect();
    match names.count() {
        0 => {}
        more => shown.push(format!("{more} more")),
    }
    shown.join(", ")
}

impl Display for NodeError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "found {}, expected {}", self.found, self.expected)
    }
}

impl std::error::Error for NodeError {}

/// Names of Rust's types in JSON's terms.
fn in_json_words(expected: &dyn de::Expected) -> String {
    match expected.to_string().as_str() {
        "f32" | "f64" => "a number".to_owned(),
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number, 0 or more".to_owned(),
        "a map" => "an object".to_owned(),
        "a sequence" => "an array".to_owned(),
        "a boolean" => "true or false".to_owned(),
        // A name that takes no value got one.
        "unit" => "the name alone, as a string".to_owned(),
        words if words.starts_with("struct ") => "an object".to_owned(),
        words if words.starts_with("variant identifier") || words.starts_with("enum ") => {
            "a string".to_owned()
        }
        words => words.to_owned(),
    }
}

impl de::Error for NodeError {
    fn custom<M: Display>(message: M) -> Self {
        Self::new(String::new(), message.to_string())
    }

    fn invalid_type(_: de::Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::new(String::new(), in_json_words(expected))
    }

    fn invalid_value(_: de::Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::new(String::new(), in_json_words(expected))
    }

    fn invalid_length(length: usize, expected: &dyn de::Expected) -> Self {
        Self::new(format!("{length} elements"), in_json_words(expected))
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        Self::unknown("field", field, expected)
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        Self::unknown("name", variant, expected)
    }

    fn missing_field(field: &'static str) -> Self {
        Self::new(format!("an object without {field:?}"), format!("the field {field:?}"))
    }
}

fn describe(node: &Value<'_>) -> String {
    match node {
        Value::StringLit(s) if s.value.chars().count() > 40 => {
            format!("the string {:?}...", s.value.chars().take(40).collect::<String>())
        }
        Value::StringLit(s) => format!("the string {:?}", s.value),
        Value::NumberLit(n) => format!("the number {}", n.value),
        Value::BooleanLit(b) => b.value.to_string(),
        Value::Object(_) => "an object".to_owned(),
        Value::Array(a) => format!("an array of {}", a.elements.len()),
        Value::NullKeyword(_) => "null".to_owned(),
    }
}

/// serde's view of a tree node.
struct Node<'a>(&'a Value<'a>);

impl Node<'_> {
    fn visit<'de, V: Visitor<'de>>(&self, visitor: V) -> Result<V::Value, NodeError> {
        match self.0 {
            Value::StringLit(s) => visitor.visit_str(&s.value),
            Value::BooleanLit(b) => visitor.visit_bool(b.value),
            Value::NullKeyword(_) => visitor.visit_unit(),
            Value::NumberLit(n) => {
                if let Ok(whole) = n.value.parse::<u64>() {
                    visitor.visit_u64(whole)
                } else if let Ok(whole) = n.value.parse::<i64>() {
                    visitor.visit_i64(whole)
                } else {
                    match n.value.parse::<f64>() {
                        Ok(number) if number.is_finite() => visitor.visit_f64(number),
                        _ => Err(NodeError::new(String::new(), "a finite number".to_owned())),
                    }
                }
            }
            Value::Array(array) => {
                let mut elements = Elements(array.elements.iter());
                let value = visitor.visit_seq(&mut elements)?;
                if elements.0.next().is_some() {
                    let taken = array.elements.len() - elements.0.len() - 1;
                    return Err(NodeError::new(String::new(), format!("an array of {taken}")));
                }
                Ok(value)
            }
            Value::Object(object) => visitor.visit_map(Members::of(object)),
        }
    }
}

impl<'de> de::Deserializer<'de> for Node<'_> {
    type Error = NodeError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, NodeError> {
        self.visit(visitor).map_err(|error| error.at(self.0))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, NodeError> {
        match self.0 {
            Value::NullKeyword(_) => visitor.visit_none(),
            node => visitor.visit_some(Node(node)),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, NodeError> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, NodeError> {
        let result = match self.0 {
            Value::StringLit(s) => {
                let name: StrDeserializer<'_, NodeError> = s.value.as_ref().into_deserializer();
                visitor.visit_enum(name)
            }
            // A name with a value: {"name": value}.
            Value::Object(object) if object.properties.len() == 1 => {
                visitor.visit_enum(MapAccessDeserializer::new(Members::of(object)))
            }
            Value::Object(_) => {
                Err(NodeError::new(String::new(), "a string, or an object with one name".to_owned()))
            }
            _ => Err(NodeError::new(String::new(), "a string".to_owned())),
        };
        result.map_err(|error| error.at(self.0))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map struct identifier ignored_any
    }
}

struct Elements<'a>(std::slice::Iter<'a, Value<'a>>);

impl<'de> de::SeqAccess<'de> for &mut Elements<'_> {
    type Error = NodeError;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, NodeError> {
        self.0.next().map(|value| seed.deserialize(Node(value))).transpose()
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.0.len())
    }
}

struct Members<'a> {
    all: &'a [jsonc_parser::ast::ObjectProp<'a>],
    next: usize,
    seen: std::collections::HashSet<&'a str>,
}

impl<'a> Members<'a> {
    fn of(object: &'a jsonc_parser::ast::Object<'a>) -> Self {
        Self { all: &object.properties, next: 0, seen: std::collections::HashSet::new() }
    }
}

impl<'de> de::MapAccess<'de> for Members<'_> {
    type Error = NodeError;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, NodeError> {
        let Some(member) = self.all.get(self.next) else { return Ok(None) };
        let name = match &member.name {
            ObjectPropName::String(s) => s.value.as_ref(),
            ObjectPropName::Word(w) => w.value,
        };
        let offset = member.name.range().start;
        if !self.seen.insert(name) {
            let mut error =
                NodeError::new(format!("{name:?} again"), "each name once in an object".to_owned());
            error.offset = Some(offset);
            return Err(error);
        }
        let key: StrDeserializer<'_, NodeError> = name.into_deserializer();
        seed.deserialize(key).map(Some).map_err(|mut error| {
            error.offset.get_or_insert(offset);
            error
        })
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, NodeError> {
        let member = self.all.get(self.next).ok_or_else(|| {
            NodeError::new("a value without a name".to_owned(), "a name before each value".to_owned())
        })?;
        self.next += 1;
        seed.deserialize(Node(&member.value))
    }
}
