//! Meshopt data of glTF: the codecs and filters of `EXT_meshopt_compression` and `KHR_meshopt_compression`.
//!
//! ```text
//! bytes --codec (attributes, triangles, indices)--> elements --filter (octahedral, quaternion, exponential, colour)--> view
//! ```
//!
//! Written from the text of both extensions (A. Kapoulkine). Attributes have two versions of the codec, indices one.
//! `meshopt-rs` 0.1, the port of the library, reads only the first version and ends the program on broken data.
//! Output grows with what was decoded, so a header that claims much over little data costs nothing.

use std::str::FromStr;

/// What a view holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// What is done to decoded attributes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

impl FromStr for Mode {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        match text {
            "ATTRIBUTES" => Ok(Self::Attributes),
            "TRIANGLES" => Ok(Self::Triangles),
            "INDICES" => Ok(Self::Indices),
            _ => Err(()),
        }
    }
}

impl FromStr for Filter {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        match text {
            "NONE" => Ok(Self::None),
            "OCTAHEDRAL" => Ok(Self::Octahedral),
            "QUATERNION" => Ok(Self::Quaternion),
            "EXPONENTIAL" => Ok(Self::Exponential),
            "COLOR" => Ok(Self::Color),
            _ => Err(()),
        }
    }
}

/// What is wrong with the data: found, expected.
pub(super) type Fault = (String, &'static str);

fn short() -> Fault {
    ("fewer bytes than its elements need".into(), "all of the compressed data")
}

fn header(found: Option<&u8>, expected: &'static str) -> Fault {
    (found.map_or("no header".into(), |b| format!("a header of {b:#04x}")), expected)
}

/// `count` elements of `stride` bytes.
pub(super) fn decode(
    mode: Mode,
    filter: Filter,
    count: usize,
    stride: usize,
    data: &[u8],
) -> Result<Vec<u8>, Fault> {
    let wrong_stride = |expected| Err((format!("elements of {stride} bytes"), expected));
    match mode {
        Mode::Attributes => {
            if stride == 0 || stride > 256 || !stride.is_multiple_of(4) {
                return wrong_stride("4 to 256 bytes in steps of 4");
            }
            let fits = match filter {
                Filter::None | Filter::Exponential => true,
                Filter::Octahedral | Filter::Color => stride == 4 || stride == 8,
                Filter::Quaternion => stride == 8,
            };
            if !fits {
                return wrong_stride("4 or 8 bytes for octahedral and colour filters, 8 for quaternions");
            }
            let mut bytes = attributes(count, stride, data)?;
            apply(filter, stride, &mut bytes);
            Ok(bytes)
        }
        Mode::Triangles | Mode::Indices => {
            if stride != 2 && stride != 4 {
                return wrong_stride("2 or 4 bytes");
            }
            if filter != Filter::None {
                return Err((format!("the filter {filter:?} on indices"), "no filter"));
            }
            let indices =
                if mode == Mode::Triangles { triangles(count, data)? } else { sequence(count, data)? };
            Ok(indices.iter().flat_map(|i| i.to_le_bytes()[..stride].to_vec()).collect())
        }
    }
}

/// Bytes in order, each read once.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], Fault> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or_else(short)?;
        self.0 = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, Fault> {
        Ok(self.take(1)?[0])
    }

    /// Seven bits per byte, low ones first, the eighth says that more follow.
    fn leb128(&mut self) -> Result<u32, Fault> {
        let mut value = 0_u32;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            value |= u32::from(byte & 127) << shift;
            if byte < 128 {
                return Ok(value);
            }
        }
        Err(("a number of more than five bytes".into(), "numbers of 32 bits"))
    }
}

/// Zigzag: the lowest bit is the sign.
fn signed(v: u32) -> u32 {
    (v >> 1) ^ (v & 1).wrapping_neg()
}

/// Bits of a delta by the two bits of its group of 16: first version, second with control 0 and 1.
const GROUP_BITS: [[u32; 4]; 3] = [[0, 2, 4, 8], [0, 1, 2, 4], [1, 2, 4, 8]];
/// Elements whose deltas share a width.
const GROUP: usize = 16;
/// Least bytes of the tail, by version.
const TAIL: [usize; 2] = [32, 24];

fn attributes(count: usize, stride: usize, data: &[u8]) -> Result<Vec<u8>, Fault> {
    let version = match data.first() {
        Some(0xa0) => 0,
        Some(0xa1) => 1,
        other => return Err(header(other, "0xa0 or 0xa1 for attributes")),
    };
    // The element that the first one is a delta to stands at the end; before it the tail is filled up.
    let tail = stride + version * (stride / 4);
    let body = data.len().checked_sub(tail.max(TAIL[version])).filter(|b| *b >= 1).ok_or_else(short)?;
    let (last, channels) = data[data.len() - tail..].split_at(stride);
    let mut last = last.to_vec();
    if channels.iter().any(|c| c & 3 == 3) {
        return Err(("a channel of mode 3".into(), "modes 0 to 2"));
    }
    let mut bytes = Bytes(&data[1..body]);
    let most = ((8192 / stride) & !(GROUP - 1)).min(256);
    let mut out = Vec::new();
    let mut deltas = vec![0_u8; 4 * 256];
    while out.len() < count * stride {
        let start = out.len();
        let elements = most.min(count - start / stride);
        let control = bytes.take(version * (stride / 4))?;
        out.resize(start + elements * stride, 0);
        for quad in 0..stride / 4 {
            for k in 0..4 {
                let mode = control.get(quad).map_or(0, |c| c >> (2 * k) & 3);
                let into = &mut deltas[k * 256..(k + 1) * 256];
                match mode {
                    3 => into[..elements].copy_from_slice(bytes.take(elements)?),
                    2 => into.fill(0),
                    mode => {
                        groups(&mut bytes, GROUP_BITS[version * (1 + usize::from(mode))], elements, into)?;
                    }
                }
            }
            let channel = channels.get(quad).copied().unwrap_or(0);
            for e in 0..elements {
                let delta = [0, 1, 2, 3].map(|k| deltas[k * 256 + e]);
                let before = &mut last[4 * quad..4 * quad + 4];
                let value = add(channel, [before[0], before[1], before[2], before[3]], delta);
                before.copy_from_slice(&value);
                out[start + e * stride + 4 * quad..][..4].copy_from_slice(&value);
            }
        }
    }
    if !bytes.0.is_empty() {
        return Err((format!("{} bytes after the last element", bytes.0.len()), "none"));
    }
    Ok(out)
}

/// Deltas of one byte of all elements of a block, in groups of 16.
fn groups(bytes: &mut Bytes<'_>, bits: [u32; 4], elements: usize, into: &mut [u8]) -> Result<(), Fault> {
    let count = elements.div_ceil(GROUP);
    let widths = bytes.take(count.div_ceil(4))?;
    for (g, into) in into.chunks_exact_mut(GROUP).take(count).enumerate() {
        let bits = bits[usize::from(widths[g / 4] >> (2 * (g % 4)) & 3)];
        match bits {
            0 => into.fill(0),
            8 => into.copy_from_slice(bytes.take(GROUP)?),
            _ => {
                let packed = bytes.take(2 * bits as usize)?;
                let per_byte = (8 / bits) as usize;
                let all = (1_u8 << bits) - 1;
                for (i, value) in into.iter_mut().enumerate() {
                    // Single bits from the lowest on, wider ones from the highest on.
                    let place = (i % per_byte) as u32;
                    let shift = if bits == 1 { place } else { 8 - bits * (place + 1) };
                    let small = packed[i / per_byte] >> shift & all;
                    *value = if small == all { bytes.byte()? } else { small };
                }
            }
        }
    }
    Ok(())
}

/// The next four bytes of an element.
fn add(channel: u8, before: [u8; 4], delta: [u8; 4]) -> [u8; 4] {
    match channel & 3 {
        0 => std::array::from_fn(|k| before[k].wrapping_add(signed(u32::from(delta[k])) as u8)),
        1 => {
            let pair = |v: [u8; 4], k: usize| u16::from_le_bytes([v[k], v[k + 1]]);
            let sum = |k| pair(before, k).wrapping_add(signed(u32::from(pair(delta, k))) as u16);
            let [low, high] = [0, 2].map(|k| sum(k).to_le_bytes());
            [low[0], low[1], high[0], high[1]]
        }
        _ => {
            let turned = u32::from_le_bytes(delta).rotate_right(u32::from(channel >> 4));
            (u32::from_le_bytes(before) ^ turned).to_le_bytes()
        }
    }
}

/// The newest entries of a list of fixed length.
struct Recent<const N: usize> {
    entries: [u32; N],
    next: usize,
}

impl<const N: usize> Recent<N> {
    fn new() -> Self {
        Self { entries: [0; N], next: 0 }
    }

    fn push(&mut self, value: u32) {
        self.entries[self.next] = value;
        self.next = (self.next + 1) % N;
    }

    /// The entry `back` places before the newest.
    fn get(&self, back: usize) -> u32 {
        self.entries[(self.next + 2 * N - 1 - back) % N]
    }
}

/// Codes of triangles that share no known edge; the stream ends in them.
const CODES: usize = 16;

fn triangles(count: usize, data: &[u8]) -> Result<Vec<u32>, Fault> {
    if data.first() != Some(&0xe1) {
        return Err(header(data.first(), "0xe1 for triangles"));
    }
    if !count.is_multiple_of(3) {
        return Err((format!("{count} indices"), "three per triangle"));
    }
    let body = data[1..].len().checked_sub(CODES).ok_or_else(short)? + 1;
    let codes_of_new = &data[body..];
    let mut bytes = Bytes(&data[1..body]);
    let codes = bytes.take(count / 3)?;
    let mut edges = Recent::<32>::new();
    let mut vertices = Recent::<16>::new();
    let (mut next, mut last) = (0_u32, 0_u32);
    let new = |next: &mut u32| {
        let v = *next;
        *next = next.wrapping_add(1);
        v
    };
    let mut out = Vec::with_capacity(3 * codes.len());
    for code in codes {
        let (edge, rest) = (usize::from(code >> 4), code & 15);
        let triangle = if edge < 15 {
            let (a, b) = (edges.get(2 * edge), edges.get(2 * edge + 1));
            let c = match rest {
                0 => new(&mut next),
                1..=12 => vertices.get(usize::from(rest)),
                13 => last.wrapping_sub(1),
                14 => last.wrapping_add(1),
                _ => last.wrapping_add(signed(bytes.leb128()?)),
            };
            if rest >= 13 {
                last = c;
            }
            if !(1..=12).contains(&rest) {
                vertices.push(c);
            }
            [b, c, c, a].into_iter().for_each(|v| edges.push(v));
            [a, b, c]
        } else {
            let is_listed = rest < 14;
            let pair = if is_listed { codes_of_new[usize::from(rest)] } else { bytes.byte()? };
            if !is_listed && pair == 0 {
                next = 0;
            }
            let mut far = |last: &mut u32| -> Result<u32, Fault> {
                *last = last.wrapping_add(signed(bytes.leb128()?));
                Ok(*last)
            };
            let a = if rest == 15 { far(&mut last)? } else { new(&mut next) };
            let mut other = |code: u8| match code {
                0 => Ok((new(&mut next), true)),
                15 if !is_listed => Ok((far(&mut last)?, true)),
                code => Ok((vertices.get(usize::from(code) - 1), false)),
            };
            let (b, push_b) = other(pair >> 4)?;
            let (c, push_c) = other(pair & 15)?;
            for (v, is_pushed) in [(a, true), (b, push_b), (c, push_c)] {
                if is_pushed {
                    vertices.push(v);
                }
            }
            [a, b, b, c, c, a].into_iter().for_each(|v| edges.push(v));
            [a, b, c]
        };
        out.extend(triangle);
    }
    if !bytes.0.is_empty() {
        return Err((format!("{} bytes after the last triangle", bytes.0.len()), "none"));
    }
    Ok(out)
}

/// Bytes after the last index of a sequence.
const SEQUENCE_TAIL: usize = 4;

fn sequence(count: usize, data: &[u8]) -> Result<Vec<u32>, Fault> {
    if data.first() != Some(&0xd1) {
        return Err(header(data.first(), "0xd1 for indices"));
    }
    let end = data.len().checked_sub(SEQUENCE_TAIL).filter(|e| *e >= 1).ok_or_else(short)?;
    let mut bytes = Bytes(&data[1..end]);
    let mut last = [0_u32; 2];
    let mut out = Vec::new();
    for _ in 0..count {
        let v = bytes.leb128()?;
        let of = &mut last[(v & 1) as usize];
        *of = of.wrapping_add(signed(v >> 1));
        out.push(*of);
    }
    if !bytes.0.is_empty() {
        return Err((format!("{} bytes after the last index", bytes.0.len()), "none"));
    }
    Ok(out)
}

/// Four numbers of an element of 4 or 8 bytes, signed.
fn read_four(element: &[u8]) -> [i32; 4] {
    match element.len() {
        4 => std::array::from_fn(|k| i32::from(element[k] as i8)),
        _ => std::array::from_fn(|k| i32::from(i16::from_le_bytes([element[2 * k], element[2 * k + 1]]))),
    }
}

fn write_four(element: &mut [u8], values: [i32; 4]) {
    let width = element.len() / 4;
    for (into, value) in element.chunks_exact_mut(width).zip(values) {
        into.copy_from_slice(&value.to_le_bytes()[..width]);
    }
}

fn apply(filter: Filter, stride: usize, bytes: &mut [u8]) {
    match filter {
        Filter::None => {}
        Filter::Octahedral => bytes.chunks_exact_mut(stride).for_each(octahedral),
        Filter::Quaternion => bytes.chunks_exact_mut(stride).for_each(quaternion),
        Filter::Exponential => {
            for number in bytes.chunks_exact_mut(4) {
                let v = i32::from_le_bytes([number[0], number[1], number[2], number[3]]);
                // 24 bits of mantissa, 8 of exponent, both signed.
                let value = f64::from(v << 8 >> 8) * f64::from(v >> 24).exp2();
                number.copy_from_slice(&(value as f32).to_le_bytes());
            }
        }
        Filter::Color => bytes.chunks_exact_mut(stride).for_each(color),
    }
}

/// x and y of the octahedron by its third number, to a unit vector; the fourth stays.
fn octahedral(element: &mut [u8]) {
    let [x, y, one, keep] = read_four(element);
    let most = if element.len() == 4 { 127.0 } else { 32767.0 };
    // Broken data may have zero here.
    let one = if one == 0 { 1.0 } else { one as f32 };
    let (x, y) = (x as f32 / one, y as f32 / one);
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let (x, y) = (x - fold.copysign(x), y - fold.copysign(y));
    let scale = most / (x * x + y * y + z * z).sqrt();
    let [x, y, z] = [x, y, z].map(|v| (v * scale).round() as i32);
    write_four(element, [x, y, z, keep]);
}

/// The three smaller components; the fourth number says which is the largest, and their scale.
fn quaternion(element: &mut [u8]) {
    let [x, y, z, last] = read_four(element);
    let scale = std::f32::consts::FRAC_1_SQRT_2 / (last | 3) as f32;
    let [x, y, z] = [x, y, z].map(|v| v as f32 * scale);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let largest = (last & 3) as usize;
    let mut out = [0; 4];
    for (k, v) in [w, x, y, z].into_iter().enumerate() {
        out[(largest + k) % 4] = (v * 32767.0).round() as i32;
    }
    write_four(element, out);
}

/// YCoCg with the scale in the highest bit of alpha (`KHR_meshopt_compression`).
fn color(element: &mut [u8]) {
    let [y, co, cg, alpha] = read_four(element);
    let bits = 2 * element.len() as u32;
    let most = (1_u32 << bits) - 1;
    let (y, alpha) = (y & most as i32, alpha as u32 & most);
    let high = 31 - (alpha | 1).leading_zeros();
    let scale = (1_u32 << (high + 1)) - 1;
    let opacity = alpha & (scale >> 1);
    let opacity = (opacity << 1 | opacity & 1) as i32;
    let factor = most as f32 / scale as f32;
    let rgba = [y + co - cg, y + cg, y - co - cg, opacity];
    write_four(element, rgba.map(|v| (v as f32 * factor).round().clamp(0.0, most as f32) as i32));
}
