//! Structure-aware changes: of values in JSON and of the bytes that data URIs in it carry, of words and lines in texts, of
//! chunks in GLB and PNG with their lengths and checksums made right again, of bytes anywhere. Words of a dictionary and
//! pieces of a second file come in where they fit.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Map, Value};

/// SplitMix64 (G. Steele, D. Lea, C. Flood 2014).
pub struct Random(u64);

impl Random {
    /// The same numbers for the same seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `n`; 0 for 0.
    pub fn below(&mut self, n: usize) -> usize {
        if n == 0 { 0 } else { (self.bits() % n as u64) as usize }
    }

    fn pick<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len())]
    }
}

/// What a change may put into a file besides what it has.
#[derive(Default)]
pub struct Stock<'a> {
    /// Words of the format.
    pub words: &'a [Vec<u8>],
    /// Another file of the same target.
    pub other: &'a [u8],
}

/// Words of a dictionary of libFuzzer: a text in quotes a line, `\xNN` and `\\` in it.
pub fn dictionary(text: &str) -> Vec<Vec<u8>> {
    let word = |line: &str| {
        let inner = line.trim().strip_prefix('"')?.strip_suffix('"')?.as_bytes();
        let (mut word, mut at) = (Vec::new(), 0);
        while let Some(byte) = inner.get(at) {
            let hex = inner.get(at + 2..at + 4).and_then(|h| std::str::from_utf8(h).ok());
            let hex = hex.and_then(|h| u8::from_str_radix(h, 16).ok());
            match (byte, inner.get(at + 1), hex) {
                (b'\\', Some(b'x'), Some(value)) => {
                    word.push(value);
                    at += 4;
                }
                (b'\\', Some(escaped), _) => {
                    word.push(*escaped);
                    at += 2;
                }
                _ => {
                    word.push(*byte);
                    at += 1;
                }
            }
        }
        Some(word)
    };
    text.lines().filter_map(word).collect()
}

/// Numbers at which readers break.
const NUMBERS: [&str; 24] = [
    "0",
    "1",
    "-1",
    "2",
    "3",
    "255",
    "256",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "1e9",
    "1e39",
    "1e-45",
    "1e308",
    "-0",
    "0.5",
    "nan",
    "inf",
    "-inf",
    "1000000",
];

/// Changes bytes: flips, overwrites, repeats, removes, cuts.
pub fn bytes(data: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..=random.below(4) {
        if data.is_empty() {
            data.push(random.bits() as u8);
            continue;
        }
        let at = random.below(data.len());
        let end = (at + 1 + random.below(16)).min(data.len());
        match random.below(8) {
            0 => data[at] ^= 1 << random.below(8),
            1 => data[at] = *random.pick(&[0, 1, 0x7f, 0x80, 0xff, b'\n', b'-', b'"']),
            2 => data[at..end].fill(*random.pick(&[0, 0xff, b'9'])),
            3 => {
                let copy = data[at..end].to_vec();
                let to = random.below(data.len());
                data.splice(to..to, copy);
            }
            4 => {
                data.drain(at..end);
            }
            5 if at + 4 <= data.len() => {
                let word =
                    *random.pick(&[0_u32, 1, 0x7fff_ffff, 0x8000_0000, u32::MAX, 0x7f80_0000, 0x7fc0_0000]);
                let word = if random.below(2) == 0 { word.to_le_bytes() } else { word.to_be_bytes() };
                data[at..at + 4].copy_from_slice(&word);
            }
            6 if random.below(4) == 0 => data.truncate(at),
            _ => data[at] = random.bits() as u8,
        }
    }
}

/// Changes one value of a tree, or its shape.
fn value(v: &mut Value, stock: &Stock<'_>, random: &mut Random) {
    let inner = match v {
        Value::Object(map) => map.len(),
        Value::Array(list) => list.len(),
        _ => 0,
    };
    if inner > 0 && random.below(8) > 0 {
        let at = random.below(inner);
        match v {
            Value::Object(map) => {
                let key = map.keys().nth(at).cloned().unwrap_or_default();
                match random.below(16) {
                    0 => {
                        map.remove(&key);
                    }
                    1 => {
                        let other = map.keys().nth(random.below(inner)).cloned().unwrap_or_default();
                        let copy = map[&other].clone();
                        map.insert(key, copy);
                    }
                    2 => {
                        let taken = map.remove(&key).unwrap_or_default();
                        map.insert(stock.text(random).unwrap_or_else(|| format!("{key}x")), taken);
                    }
                    _ => {
                        if let Some(inner) = map.get_mut(&key) {
                            value(inner, stock, random);
                        }
                    }
                }
            }
            Value::Array(list) => match random.below(16) {
                0 => {
                    list.remove(at);
                }
                1 => {
                    let copy = list[at].clone();
                    list.extend(vec![copy; 1 + random.below(4)]);
                }
                2 => {
                    let other = random.below(inner);
                    list.swap(at, other);
                }
                _ => value(&mut list[at], stock, random),
            },
            _ => {}
        }
        return;
    }
    if let Value::String(text) = v
        && random.below(4) > 0
    {
        if let Some(changed) = data_uri(text, random).or_else(|| stock.text(random)) {
            *text = changed;
        }
        return;
    }
    *v = match (random.below(12), &*v) {
        (0, _) => Value::Null,
        (1, _) => Value::Array(vec![v.clone(); 1 + random.below(3)]),
        (2, _) => Value::Object(Map::from_iter([("a".to_owned(), v.clone())])),
        (3, _) => Value::Bool(random.below(2) == 0),
        (4, _) => Value::String((*random.pick(&["", "..", "jawOpen", "VEC3", "\u{0}", "a/b", "1-9"])).into()),
        (5 | 6, Value::Number(n)) => {
            let n = n.as_f64().unwrap_or(0.0);
            Value::from(*random.pick(&[n + 1.0, n - 1.0, -n, 2.0 * n, n / 2.0]))
        }
        (_, Value::Number(n)) if random.below(2) == 0 => {
            let n = n.as_i64().unwrap_or(0);
            Value::from(n.wrapping_add(*random.pick(&[1, -1, 2, 4, 1 << 31])))
        }
        _ => {
            let number = *random.pick(&NUMBERS);
            serde_json::from_str(number).unwrap_or_else(|_| Value::from(7))
        }
    };
}

impl Stock<'_> {
    /// A word of the dictionary that is a text.
    fn text(&self, random: &mut Random) -> Option<String> {
        let words: Vec<&str> = self.words.iter().filter_map(|w| std::str::from_utf8(w).ok()).collect();
        (!words.is_empty()).then(|| random.pick(&words).trim().to_owned())
    }
}

/// A data URI with other bytes of the same length in most cases, so that what points into them still fits.
fn data_uri(text: &str, random: &mut Random) -> Option<String> {
    let (head, encoded) = text.split_once(";base64,").filter(|(head, _)| head.starts_with("data:"))?;
    let mut inner = BASE64_STANDARD.decode(encoded).ok()?;
    let length = inner.len();
    bytes(&mut inner, random);
    if random.below(8) > 0 {
        inner.resize(length, 0);
    }
    Some(format!("{head};base64,{}", BASE64_STANDARD.encode(inner)))
}

/// Puts a value of a second tree in the place of one under the same keys, or beside them.
fn cross(tree: &mut Value, other: &Value, random: &mut Random) {
    if let (Value::Object(map), Value::Object(others)) = (&mut *tree, other)
        && !others.is_empty()
    {
        let (key, from) = others.iter().nth(random.below(others.len())).expect("below the length");
        match map.get_mut(key) {
            Some(inner) if random.below(3) > 0 => cross(inner, from, random),
            _ => {
                map.insert(key.clone(), from.clone());
            }
        }
        return;
    }
    if let (Value::Array(list), Value::Array(others)) = (&mut *tree, other)
        && !(list.is_empty() || others.is_empty())
    {
        let at = random.below(list.len());
        cross(&mut list[at], random.pick(others), random);
        return;
    }
    *tree = other.clone();
}

/// Changes values of JSON, and now and then its bytes.
pub fn json(data: &mut Vec<u8>, stock: &Stock<'_>, random: &mut Random) {
    match serde_json::from_slice::<Value>(data) {
        Ok(mut tree) if random.below(8) > 0 => {
            if random.below(16) == 0
                && let Ok(other) = serde_json::from_slice::<Value>(json_of(stock.other))
            {
                cross(&mut tree, &other, random);
            }
            for _ in 0..=random.below(3) {
                value(&mut tree, stock, random);
            }
            *data = tree.to_string().into_bytes();
        }
        _ => bytes(data, random),
    }
}

/// The JSON of a GLB, or the file itself.
fn json_of(data: &[u8]) -> &[u8] {
    glb_chunks(data).map_or(data, |(text, _)| text)
}

/// The JSON and the binary chunk of a GLB.
pub fn glb_chunks(data: &[u8]) -> Option<(&[u8], &[u8])> {
    let length = data.get(12..16).filter(|_| data.starts_with(b"glTF"))?;
    let end = u32::from_le_bytes([length[0], length[1], length[2], length[3]]) as usize + 20;
    Some((data.get(20..end)?, data.get(end + 8..).unwrap_or_default()))
}

/// A GLB of both chunks.
pub fn to_glb(mut text: Vec<u8>, mut binary: Vec<u8>) -> Vec<u8> {
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let total = 28 + text.len() + binary.len();
    let mut data = b"glTF".to_vec();
    data.extend([2_u32, total as u32, text.len() as u32].iter().flat_map(|v| v.to_le_bytes()));
    data.extend(b"JSON");
    data.extend(&text);
    data.extend((binary.len() as u32).to_le_bytes());
    data.extend(b"BIN\0");
    data.extend(&binary);
    data
}

/// Changes a glTF, or the JSON or the binary chunk of a GLB, whose lengths are made right again.
pub fn glb(data: &mut Vec<u8>, stock: &Stock<'_>, random: &mut Random) {
    if data.trim_ascii_start().starts_with(b"{") {
        return json(data, stock, random);
    }
    let Some((text, binary)) = glb_chunks(data).filter(|_| random.below(16) > 0) else {
        return bytes(data, random);
    };
    let (mut text, mut binary) = (text.to_vec(), binary.to_vec());
    if random.below(4) == 0 {
        bytes(&mut binary, random);
    } else {
        json(&mut text, stock, random);
    }
    *data = to_glb(text, binary);
}

/// Changes lines and words of a text: numbers, order, copies, lines of another file.
pub fn lines(data: &mut Vec<u8>, stock: &Stock<'_>, random: &mut Random) {
    if random.below(6) == 0 {
        return bytes(data, random);
    }
    let mut lines: Vec<Vec<u8>> = data.split(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
    for _ in 0..=random.below(3) {
        let at = random.below(lines.len());
        match random.below(10) {
            0 => {
                lines.remove(at);
                if lines.is_empty() {
                    lines.push(Vec::new());
                }
            }
            1 => {
                let copy = lines[at].clone();
                let to = random.below(lines.len());
                lines.insert(to, copy);
            }
            2 => {
                let other = random.below(lines.len());
                lines.swap(at, other);
            }
            3 if !stock.other.is_empty() => {
                let others: Vec<&[u8]> = stock.other.split(|b| *b == b'\n').collect();
                let from = random.below(others.len());
                let to = (from + 1 + random.below(4)).min(others.len());
                lines.splice(at..at, others[from..to].iter().map(|l| l.to_vec()));
            }
            _ => words(&mut lines[at], stock, random),
        }
    }
    *data = lines.join(&b'\n');
}

fn words(line: &mut Vec<u8>, stock: &Stock<'_>, random: &mut Random) {
    let is_word = |b: &u8| b.is_ascii_alphanumeric() || b"._-+".contains(b);
    let starts: Vec<usize> =
        (0..line.len()).filter(|i| is_word(&line[*i]) && (*i == 0 || !is_word(&line[*i - 1]))).collect();
    if starts.is_empty() {
        return bytes(line, random);
    }
    let start = *random.pick(&starts);
    let end = start + line[start..].iter().take_while(|b| is_word(b)).count();
    let word = match random.below(8) {
        0 => Vec::new(),
        1 => line[start..end].repeat(2),
        2 => {
            let other = *random.pick(&starts);
            line[other..].iter().take_while(|b| is_word(b)).copied().collect()
        }
        3 => [&line[start..end], b" ", &line[start..end]].concat(),
        4 | 5 if !stock.words.is_empty() => random.pick(stock.words).clone(),
        _ => random.pick(&NUMBERS).as_bytes().to_vec(),
    };
    line.splice(start..end, word);
}

/// Changes a picture; checksums of a PNG are made right again.
pub fn image(data: &mut Vec<u8>, _stock: &Stock<'_>, random: &mut Random) {
    bytes(data, random);
    if !data.starts_with(b"\x89PNG\r\n\x1a\n") || random.below(8) == 0 {
        return;
    }
    let mut at = 8;
    while let Some(head) = data.get(at..at + 8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some(end) =
            at.checked_add(8).and_then(|a| a.checked_add(length)).filter(|end| end + 4 <= data.len())
        else {
            return;
        };
        let mut crc = flate2::Crc::new();
        crc.update(&data[at + 4..end]);
        data[end..end + 4].copy_from_slice(&crc.sum().to_be_bytes());
        at = end + 4;
    }
}
