//! Structure-aware changes: of values in JSON, of fields and lines in texts, of chunks in GLB and PNG with their lengths
//! and checksums made right again, of bytes anywhere.

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
fn value(v: &mut Value, random: &mut Random) {
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
                        map.insert(format!("{key}x"), taken);
                    }
                    _ => {
                        if let Some(inner) = map.get_mut(&key) {
                            value(inner, random);
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
                _ => value(&mut list[at], random),
            },
            _ => {}
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

/// Changes values of JSON, and now and then its bytes.
pub fn json(data: &mut Vec<u8>, random: &mut Random) {
    match serde_json::from_slice::<Value>(data) {
        Ok(mut tree) if random.below(8) > 0 => {
            for _ in 0..=random.below(3) {
                value(&mut tree, random);
            }
            *data = tree.to_string().into_bytes();
        }
        _ => bytes(data, random),
    }
}

/// Changes the JSON or the binary chunk of a GLB; lengths are made right again.
pub fn glb(data: &mut Vec<u8>, random: &mut Random) {
    let length =
        |at: usize| data.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let json_end = length(12).and_then(|n| 20_usize.checked_add(n)).filter(|end| *end <= data.len());
    let Some(end) = json_end.filter(|_| data.starts_with(b"glTF") && random.below(16) > 0) else {
        return bytes(data, random);
    };
    let mut text = data[20..end].to_vec();
    let mut binary = data.get(end + 8..).unwrap_or_default().to_vec();
    if random.below(4) == 0 {
        bytes(&mut binary, random);
    } else {
        json(&mut text, random);
    }
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    data.clear();
    data.extend(b"glTF");
    let total = 28 + text.len() + binary.len();
    data.extend([2_u32, total as u32, text.len() as u32].iter().flat_map(|v| v.to_le_bytes()));
    data.extend(b"JSON");
    data.extend(&text);
    data.extend((binary.len() as u32).to_le_bytes());
    data.extend(b"BIN\0");
    data.extend(&binary);
}

/// Changes lines and words of a text: numbers, order, copies.
pub fn lines(data: &mut Vec<u8>, random: &mut Random) {
    if random.below(6) == 0 {
        return bytes(data, random);
    }
    let mut lines: Vec<Vec<u8>> = data.split(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
    for _ in 0..=random.below(3) {
        let at = random.below(lines.len());
        match random.below(8) {
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
            _ => words(&mut lines[at], random),
        }
    }
    *data = lines.join(&b'\n');
}

fn words(line: &mut Vec<u8>, random: &mut Random) {
    let is_word = |b: &u8| b.is_ascii_alphanumeric() || b"._-+".contains(b);
    let starts: Vec<usize> =
        (0..line.len()).filter(|i| is_word(&line[*i]) && (*i == 0 || !is_word(&line[*i - 1]))).collect();
    if starts.is_empty() {
        return bytes(line, random);
    }
    let start = *random.pick(&starts);
    let end = start + line[start..].iter().take_while(|b| is_word(b)).count();
    let word = match random.below(6) {
        0 => Vec::new(),
        1 => line[start..end].repeat(2),
        2 => {
            let other = *random.pick(&starts);
            line[other..].iter().take_while(|b| is_word(b)).copied().collect()
        }
        3 => [&line[start..end], b" ", &line[start..end]].concat(),
        _ => random.pick(&NUMBERS).as_bytes().to_vec(),
    };
    line.splice(start..end, word);
}

/// Changes a picture; checksums of a PNG are made right again.
pub fn image(data: &mut Vec<u8>, random: &mut Random) {
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
