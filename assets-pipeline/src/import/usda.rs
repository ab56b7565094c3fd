//! USD layers as text: prims, properties and values, as far as a check needs them.
//!
//! Read: `def`, `over`, `class`, metadata (kept for the layer only), properties with values, time samples and
//! connections. Variants and references are passed over. Binary layers (`.usdc`) are refused in words.

use std::collections::{BTreeMap, HashMap};

use rubor_rig::limits;

/// A fault at a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: found {found}, expected {expected}")]
pub struct UsdaError {
    /// From 1.
    pub line: usize,
    /// The value there.
    pub found: String,
    /// The values that are allowed.
    pub expected: String,
}

/// Something that a property holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Numbers, and `true` and `false` as 1 and 0.
    Number(f64),
    /// Strings, tokens, names.
    Text(String),
    /// `@...@`.
    Asset(String),
    /// `<...>`.
    Path(String),
    /// `[...]` and `(...)`.
    List(Vec<Value>),
    /// `{...}`: time samples and dictionaries, keys as written.
    Table(Vec<(String, Value)>),
}

impl Value {
    /// Elements of a list.
    pub fn list(&self) -> &[Value] {
        if let Self::List(list) = self { list } else { &[] }
    }

    /// A string or a path.
    pub fn text(&self) -> Option<&str> {
        match self {
            Self::Text(text) | Self::Path(text) | Self::Asset(text) => Some(text),
            _ => None,
        }
    }
}

/// A prim and its contents.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Prim {
    /// From the root, such as `/head/Face`.
    pub path: String,
    /// Such as `Mesh`; empty for `over` and untyped prims.
    pub kind: String,
    /// Line of its `def`.
    pub line: usize,
    /// By name; `.timeSamples` and `.connect` belong to the name.
    pub properties: BTreeMap<String, Value>,
    /// What stands in brackets behind its name.
    pub metadata: BTreeMap<String, Value>,
    /// What stands in brackets behind a property, by the name of the property.
    pub details: BTreeMap<String, BTreeMap<String, Value>>,
}

/// A layer, prims in the order of the text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layer {
    /// Metadata of the layer.
    pub metadata: BTreeMap<String, Value>,
    /// All prims at all depths.
    pub prims: Vec<Prim>,
    by_path: HashMap<String, usize>,
}

impl Layer {
    /// The prim of a path.
    pub fn prim(&self, path: &str) -> Option<&Prim> {
        self.by_path.get(path).map(|i| &self.prims[*i])
    }
}

/// Paths of the prims above a path, from the root down.
pub(crate) fn above(path: &str) -> impl Iterator<Item = &str> {
    path.match_indices('/').map(|(i, _)| &path[..i]).filter(|p| !p.is_empty())
}

/// Largest nesting depth of a head's layer.
const MOST_LEVELS: usize = 64;

/// Reads a layer.
///
/// # Errors
/// Binary layers, another version, the first thing that breaks the syntax.
pub fn parse(bytes: &[u8]) -> Result<Layer, UsdaError> {
    let fail = |found: &str, expected: &str| {
        Err(UsdaError { line: 1, found: found.into(), expected: expected.into() })
    };
    if bytes.starts_with(b"PXR-USDC") {
        return fail("a binary USD layer", "a text layer: convert it with `usdcat -o head.usda`");
    }
    if bytes.starts_with(b"PK") {
        return fail("a packed USD (.usdz)", "a text layer: give the package a name that ends in .usdz");
    }
    if let Err((found, expected)) = limits::check_text(bytes).and_then(|()| limits::check_values(bytes, 1)) {
        return Err(UsdaError { line: 1, found, expected });
    }
    let Ok(text) = std::str::from_utf8(bytes) else { return fail("bytes that are not UTF-8", "text") };
    if !text.starts_with("#usda 1.0") {
        return fail(text.lines().next().unwrap_or_default(), "#usda 1.0");
    }
    let mut reader = Reader { text: text.as_bytes(), at: 0, line: 1 };
    let mut layer = Layer::default();
    if reader.peek() == Some(b'(') {
        reader.metadata(&mut layer.metadata, 0)?;
    }
    while reader.peek().is_some() {
        reader.prim("", &mut layer.prims, 0)?;
    }
    for (i, prim) in layer.prims.iter().enumerate() {
        layer.by_path.entry(prim.path.clone()).or_insert(i);
    }
    Ok(layer)
}

struct Reader<'a> {
    text: &'a [u8],
    at: usize,
    line: usize,
}

impl Reader<'_> {
    fn fail<T>(&mut self, expected: &'static str) -> Result<T, UsdaError> {
        let found = match self.peek() {
            None => "the end of the file".to_owned(),
            Some(c) => {
                let word = self.word();
                if word.is_empty() { format!("{:?}", char::from(c)) } else { format!("{word:?}") }
            }
        };
        Err(UsdaError { line: self.line, found, expected: expected.into() })
    }

    /// The next byte that is neither space nor comment.
    fn peek(&mut self) -> Option<u8> {
        loop {
            match self.text.get(self.at)? {
                b'\n' => {
                    self.line += 1;
                    self.at += 1;
                }
                b' ' | b'\t' | b'\r' | b';' => self.at += 1,
                b'#' => {
                    while self.text.get(self.at).is_some_and(|c| *c != b'\n') {
                        self.at += 1;
                    }
                }
                c => return Some(*c),
            }
        }
    }

    fn take(&mut self, c: u8) -> bool {
        let found = self.peek() == Some(c);
        self.at += usize::from(found);
        found
    }

    fn expect(&mut self, c: u8, expected: &'static str) -> Result<(), UsdaError> {
        if self.take(c) { Ok(()) } else { self.fail(expected) }
    }

    /// Letters, digits and what names, numbers and types are made of; empty at anything else.
    fn word(&mut self) -> String {
        self.peek();
        let start = self.at;
        while self
            .text
            .get(self.at)
            .is_some_and(|c| c.is_ascii_alphanumeric() || b"_:.+-|".contains(c) || *c >= 128)
        {
            self.at += 1;
        }
        String::from_utf8_lossy(&self.text[start..self.at]).into_owned()
    }

    fn until(&mut self, end: &[u8], expected: &'static str) -> Result<String, UsdaError> {
        let mut out = Vec::new();
        loop {
            let rest = &self.text[self.at..];
            if rest.starts_with(end) {
                self.at += end.len();
                return Ok(String::from_utf8_lossy(&out).into_owned());
            }
            match rest {
                [] => return self.fail(expected),
                [b'\\', c, ..] if end[0] != b'@' && end[0] != b'>' => {
                    out.push(match c {
                        b'n' => b'\n',
                        b't' => b'\t',
                        b'r' => b'\r',
                        c => *c,
                    });
                    self.at += 2;
                }
                [c, ..] => {
                    self.line += usize::from(*c == b'\n');
                    out.push(*c);
                    self.at += 1;
                }
            }
        }
    }

    fn string(&mut self) -> Result<Option<String>, UsdaError> {
        for quote in [&b"\"\"\""[..], b"'''", b"\"", b"'"] {
            self.peek();
            if self.text[self.at..].starts_with(quote) {
                self.at += quote.len();
                return self.until(quote, "the end of a string").map(Some);
            }
        }
        Ok(None)
    }

    fn value(&mut self, level: usize) -> Result<Value, UsdaError> {
        if level > MOST_LEVELS {
            return self.fail("fewer levels of brackets");
        }
        if let Some(text) = self.string()? {
            return Ok(Value::Text(text));
        }
        match self.peek() {
            Some(b'@') => {
                self.at += 1;
                self.until(b"@", "the end of an asset path").map(Value::Asset)
            }
            Some(b'<') => {
                self.at += 1;
                self.until(b">", "the end of a path").map(Value::Path)
            }
            Some(open @ (b'[' | b'(')) => {
                self.at += 1;
                let close = if open == b'[' { b']' } else { b')' };
                let mut list = Vec::new();
                while !self.take(close) {
                    let value = self.value(level + 1)?;
                    self.behind_arc(&value, level)?;
                    list.push(value);
                    if !self.take(b',') {
                        self.expect(close, "a comma or the end of a list")?;
                        break;
                    }
                }
                Ok(Value::List(list))
            }
            Some(b'{') => {
                self.at += 1;
                let mut table = Vec::new();
                while !self.take(b'}') {
                    let mut key = String::new();
                    // Time samples have numbers as keys, dictionaries a type and a name.
                    while !matches!(self.peek(), Some(b':' | b'=') | None) {
                        match self.string()? {
                            Some(text) => key = text,
                            None => {
                                let word = self.word();
                                if word.is_empty() {
                                    // An array type: `string[] name`.
                                    if self.take(b'[') {
                                        self.expect(b']', "an array type")?;
                                        continue;
                                    }
                                    return self.fail("a key");
                                }
                                key = word;
                            }
                        }
                        if key.ends_with(':') {
                            break;
                        }
                    }
                    let key = if let Some(time) = key.strip_suffix(':') {
                        time.to_owned()
                    } else {
                        if !self.take(b':') {
                            self.expect(b'=', "a value of a key")?;
                        }
                        key
                    };
                    table.push((key, self.value(level + 1)?));
                    self.take(b',');
                }
                Ok(Value::Table(table))
            }
            _ => {
                let word = self.word();
                match (&word[..], word.parse::<f64>()) {
                    ("", _) => self.fail("a value"),
                    ("true", _) => Ok(Value::Number(1.0)),
                    ("false", _) => Ok(Value::Number(0.0)),
                    (_, Ok(number)) => Ok(Value::Number(number)),
                    _ => Ok(Value::Text(word)),
                }
            }
        }
    }

    /// Passes over what an arc carries behind its layer or prim: `</prim> (offset = 1; scale = 2)`.
    fn behind_arc(&mut self, value: &Value, level: usize) -> Result<(), UsdaError> {
        if matches!(value, Value::Asset(_)) && self.peek() == Some(b'<') {
            self.value(level + 1)?;
        }
        if matches!(value, Value::Asset(_) | Value::Path(_)) && self.peek() == Some(b'(') {
            self.metadata(&mut BTreeMap::new(), level + 1)?;
        }
        Ok(())
    }

    /// `( name = value ... )`
    fn metadata(&mut self, into: &mut BTreeMap<String, Value>, level: usize) -> Result<(), UsdaError> {
        self.expect(b'(', "metadata")?;
        while !self.take(b')') {
            if let Some(comment) = self.string()? {
                into.insert("doc".into(), Value::Text(comment));
                continue;
            }
            let mut name = self.word();
            if ["prepend", "append", "delete", "add", "reorder"].contains(&&name[..]) {
                name = self.word();
            }
            if name.is_empty() {
                return self.fail("the name of metadata");
            }
            self.expect(b'=', "a value of metadata")?;
            let value = self.value(level)?;
            self.behind_arc(&value, level)?;
            into.insert(name, value);
        }
        Ok(())
    }

    fn prim(&mut self, parent: &str, prims: &mut Vec<Prim>, level: usize) -> Result<(), UsdaError> {
        if level > MOST_LEVELS {
            return self.fail("fewer levels of prims");
        }
        self.peek();
        let line = self.line;
        let specifier = self.word();
        if !["def", "over", "class"].contains(&&specifier[..]) {
            self.at -= specifier.len();
            return self.fail("def, over or class");
        }
        let mut prim = Prim { line, ..Prim::default() };
        if self.peek() != Some(b'"') {
            prim.kind = self.word();
        }
        let Some(name) = self.string()? else { return self.fail("the name of a prim") };
        prim.path = format!("{parent}/{name}");
        if self.peek() == Some(b'(') {
            self.metadata(&mut prim.metadata, 0)?;
        }
        self.expect(b'{', "the start of a prim")?;
        let (path, index) = (prim.path.clone(), prims.len());
        prims.push(prim);
        while !self.take(b'}') {
            self.peek();
            let start = (self.at, self.line);
            let first = self.word();
            match &first[..] {
                "def" | "over" | "class" => {
                    (self.at, self.line) = start;
                    self.prim(&path, prims, level + 1)?;
                }
                "variantSet" => {
                    self.string()?;
                    self.expect(b'=', "variants")?;
                    self.variants()?;
                }
                "reorder" => {
                    self.word();
                    self.expect(b'=', "an order")?;
                    self.value(0)?;
                }
                _ => {
                    let mut details = BTreeMap::new();
                    let (name, value) = self.property(first, &mut details)?;
                    if !details.is_empty() {
                        prims[index].details.insert(name.clone(), details);
                    }
                    if let Some(value) = value {
                        prims[index].properties.insert(name, value);
                    }
                }
            }
        }
        Ok(())
    }

    /// Passes over `{ "name" { ... } ... }`.
    fn variants(&mut self) -> Result<(), UsdaError> {
        self.expect(b'{', "variants")?;
        while !self.take(b'}') {
            if self.string()?.is_none() {
                return self.fail("the name of a variant");
            }
            if self.peek() == Some(b'(') {
                self.metadata(&mut BTreeMap::new(), 0)?;
            }
            self.expect(b'{', "a variant")?;
            let mut open = 1_usize;
            while open > 0 {
                match self.peek() {
                    None => return self.fail("the end of a variant"),
                    Some(b'"' | b'\'') => {
                        self.string()?;
                    }
                    Some(c) => {
                        open = open + usize::from(c == b'{') - usize::from(c == b'}');
                        self.at += 1;
                    }
                }
            }
        }
        Ok(())
    }

    /// Type and qualifiers, name, and the value if there is one.
    fn property(
        &mut self,
        first: String,
        details: &mut BTreeMap<String, Value>,
    ) -> Result<(String, Option<Value>), UsdaError> {
        let mut name = first;
        loop {
            if name.is_empty() {
                return self.fail("a property");
            }
            match self.peek() {
                Some(b'[') => {
                    self.at += 1;
                    self.expect(b']', "an array type")?;
                    name = self.word();
                }
                Some(b'=' | b'(' | b'}') | None => break,
                Some(c) if c.is_ascii_alphabetic() || c == b'_' => {
                    // On the next line stands another property, unless this word was a type or qualifier: those have no
                    // name behind them that a colon or dot divides, and a value or a name follows on the same line.
                    let (at, line) = (self.at, self.line);
                    let before = self.text[..self.at].iter().rev().take_while(|c| c.is_ascii_whitespace());
                    if before.clone().any(|c| *c == b'\n') {
                        (self.at, self.line) = (at, line);
                        break;
                    }
                    name = self.word();
                }
                Some(_) => return self.fail("a property"),
            }
        }
        let value = if self.take(b'=') { Some(self.value(0)?) } else { None };
        if self.peek() == Some(b'(') {
            self.metadata(details, 0)?;
        }
        Ok((name, value))
    }
}
