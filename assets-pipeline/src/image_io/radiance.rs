//! Radiance pictures (`.hdr`): the header here, the scan lines by the `image` crate.
//!
//! Ward, "Real Pixels" (Graphics Gems II, 1991) and the Radiance reference manual, "picture file format". The crate
//! reads the header too, but knows only the signature `#?RADIANCE`, one order of scan lines, and leaves EXPOSURE and
//! COLORCORR to the caller.

use std::path::Path;

use image::ImageDecoder;
use image::codecs::hdr::HdrDecoder;
use rubor_rig::map::Map;

use super::orientation::remapped;
use super::{ImageError, Limits, LoadedImage, SampleKind};

/// No writer comes near; a file of one endless line is refused here.
const LARGEST_HEADER: usize = 1 << 20;
/// CIE chromaticities of the primaries and white of Rec. 709, as a PRIMARIES line orders them.
const REC_709: [f32; 8] = [0.640, 0.330, 0.300, 0.600, 0.150, 0.060, 0.3127, 0.3290];

/// Tells whether these bytes open a Radiance picture.
pub(super) fn matches(bytes: &[u8]) -> bool {
    bytes.starts_with(b"#?")
}

/// Contents of a header.
struct Header {
    /// Divisor of the stored values, per channel: EXPOSURE times COLORCORR.
    divisor: [f32; 3],
    /// Axis, direction and length of the scan lines' order, then of the pixels in a line: `-Y 32 +X 64`.
    axes: [(Axis, bool, u64); 2],
    /// Where the scan lines begin.
    end: usize,
    notes: Vec<String>,
}

#[derive(Clone, Copy, PartialEq)]
enum Axis {
    X,
    Y,
}

pub(super) fn read(file: &Path, bytes: &[u8], limits: &Limits) -> Result<LoadedImage, ImageError> {
    let header = header(file, bytes)?;
    let [(first, first_grows, rows), (_, second_grows, columns)] = header.axes;
    // Three floats twice: once as bytes, once in the map.
    let (columns, rows) = limits.check(file, "size", (columns, rows), 24)?;

    // The decoder gets a header in the one form that it knows; the order of the lines is dealt with below.
    let plain = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {rows} +X {columns}\n");
    let lines = std::io::Read::chain(plain.as_bytes(), &bytes[header.end..]);
    let decode = |e: image::ImageError| ImageError::Decode { file: file.to_owned(), message: e.to_string() };
    let decoder = HdrDecoder::new(lines).map_err(decode)?;
    let mut floats = vec![0.0f32; columns as usize * rows as usize * 3];
    decoder.read_image(bytemuck::cast_slice_mut(&mut floats)).map_err(decode)?;

    if header.divisor != [1.0; 3] {
        for texel in floats.chunks_exact_mut(3) {
            for (v, divisor) in texel.iter_mut().zip(header.divisor) {
                *v /= divisor;
            }
        }
    }
    let stored = Map { width: columns, height: rows, channels: 3, values: floats };
    // A growing Y climbs, a growing X runs to the right; row 0 is the top, column 0 the left.
    let place = |i: u32, n: u32, forward: bool| if forward { i } else { n - 1 - i };
    let map = match (first, first_grows, second_grows) {
        (Axis::Y, false, true) => stored,
        (Axis::Y, up, right) => {
            remapped(&stored, columns, rows, |x, y| (place(x, columns, right), place(y, rows, !up)))
        }
        (Axis::X, right, up) => {
            remapped(&stored, rows, columns, |x, y| (place(y, columns, !up), place(x, rows, right)))
        }
    };
    Ok(LoadedImage { file: file.to_owned(), map, alpha: None, kind: SampleKind::F32, notes: header.notes })
}

fn header(file: &Path, bytes: &[u8]) -> Result<Header, ImageError> {
    let fail = |line: usize, found: &str, expected: &str| ImageError::Content {
        file: file.to_owned(),
        at: format!("line {line}"),
        found: format!("{:?}", found.chars().take(80).collect::<String>()),
        expected: expected.to_owned(),
    };
    let mut header =
        Header { divisor: [1.0; 3], axes: [(Axis::Y, false, 0), (Axis::X, true, 0)], end: 0, notes: vec![] };
    let mut in_header = true;
    for line in 1.. {
        let rest = &bytes[header.end..bytes.len().min(LARGEST_HEADER)];
        let Some(length) = rest.iter().position(|b| *b == b'\n') else {
            return Err(fail(
                line,
                "no end of the header",
                "header lines, an empty line, then -Y HEIGHT +X WIDTH",
            ));
        };
        let text = String::from_utf8_lossy(&rest[..length]);
        let text = text.trim_end_matches('\r');
        header.end += length + 1;
        if !in_header {
            header.axes = axes(text).ok_or_else(|| {
                fail(line, text, "the size as -Y HEIGHT +X WIDTH or another of the eight orders")
            })?;
            break;
        }
        if text.is_empty() {
            in_header = false;
            continue;
        }
        let Some((key, value)) = text.split_once('=') else { continue };
        let numbers = |count: usize| -> Result<Vec<f32>, ImageError> {
            let numbers: Vec<f32> = value.split_whitespace().filter_map(|w| w.parse().ok()).collect();
            let usable = numbers.len() == count && numbers.iter().all(|n| n.is_finite());
            let expected = format!("{count} finite numbers after {}=", key.trim());
            if usable { Ok(numbers) } else { Err(fail(line, text, &expected)) }
        };
        match key.trim() {
            "FORMAT" if value.trim() == "32-bit_rle_rgbe" => {}
            "FORMAT" => return Err(fail(line, text, "FORMAT=32-bit_rle_rgbe (XYZE is not read)")),
            // Each occurrence is one more step of an editing history (manual of the format): they multiply.
            "EXPOSURE" => {
                let exposure = numbers(1)?[0];
                header.divisor = header.divisor.map(|d| d * exposure);
            }
            "COLORCORR" => {
                let correction = numbers(3)?;
                for (d, c) in header.divisor.iter_mut().zip(correction) {
                    *d *= c;
                }
            }
            "GAMMA" if numbers(1)?[0] != 1.0 => {
                return Err(fail(line, text, "GAMMA=1: gamma-corrected values are no radiance"));
            }
            "PIXASPECT" if numbers(1)?[0] != 1.0 => {
                header.notes.push(format!("{text}: pixels are taken as squares"));
            }
            "PRIMARIES" if numbers(8)?.iter().zip(REC_709).any(|(a, b)| (a - b).abs() > 0.01) => {
                header.notes.push(format!("{text}: the colours are taken as those of Rec. 709"));
            }
            _ => {}
        }
    }
    if header.divisor.iter().any(|d| !(d.is_finite() && *d > 0.0)) {
        let found = format!("EXPOSURE and COLORCORR multiply to {:?}", header.divisor);
        return Err(fail(1, &found, "positive numbers"));
    }
    if header.divisor != [1.0; 3] {
        let [r, g, b] = header.divisor;
        header.notes.push(format!(
            "EXPOSURE and COLORCORR of the header: radiance is the stored value divided by ({r}, {g}, {b})"
        ));
    }
    Ok(header)
}

/// Reads `-Y 32 +X 64`.
fn axes(line: &str) -> Option<[(Axis, bool, u64); 2]> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [first, rows, second, columns] = words[..] else { return None };
    let axis = |word: &str| match word {
        "+X" => Some((Axis::X, true)),
        "-X" => Some((Axis::X, false)),
        "+Y" => Some((Axis::Y, true)),
        "-Y" => Some((Axis::Y, false)),
        _ => None,
    };
    let (first, second) = (axis(first)?, axis(second)?);
    let distinct = first.0 != second.0;
    let lengths = (rows.parse().ok()?, columns.parse().ok()?);
    distinct.then_some([(first.0, first.1, lengths.0), (second.0, second.1, lengths.1)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(head: &str, size: &str, pixels: &[[u8; 4]]) -> Vec<u8> {
        let mut bytes = format!("{head}\n{size}\n").into_bytes();
        bytes.extend(pixels.as_flattened());
        bytes
    }

    fn read_bytes(bytes: &[u8]) -> Result<LoadedImage, ImageError> {
        read("a.hdr".as_ref(), bytes, &Limits::default())
    }

    /// 2 x 3 pixels whose red is their number.
    const PIXELS: [[u8; 4]; 6] =
        [[1, 9, 9, 136], [2, 9, 9, 136], [3, 9, 9, 136], [4, 9, 9, 136], [5, 9, 9, 136], [6, 9, 9, 136]];

    fn reds(image: &LoadedImage) -> Vec<f32> {
        image.map.values.iter().step_by(3).copied().collect()
    }

    #[test]
    fn every_signature_and_header_line_has_its_effect() {
        for head in [
            "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n",
            "#?RGBE\nFORMAT=32-bit_rle_rgbe\n",
            "#?RGBE\r\nFORMAT=32-bit_rle_rgbe\r\n\r",
            "#?AUTOPANO11\n# a comment\nGAMMA=1\nFORMAT=32-bit_rle_rgbe\nSOFTWARE=x = y\npfilt -x 4\n",
        ] {
            let image = read_bytes(&picture(head, "-Y 3 +X 2", &PIXELS)).unwrap();
            assert_eq!(reds(&image), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "{head:?}");
            assert!(image.notes.is_empty(), "{:?}", image.notes);
        }
        let head = "#?RADIANCE\nEXPOSURE=2\nEXPOSURE= 4\nCOLORCORR=1 0.5 3\nFORMAT=32-bit_rle_rgbe\n";
        let image = read_bytes(&picture(head, "-Y 3 +X 2", &PIXELS)).unwrap();
        assert_eq!(image.map.texel(1, 2), [6.0 / 8.0, 9.0 / 4.0, 9.0 / 24.0]);
        assert!(image.notes[0].contains("EXPOSURE"));
        let head = "#?RADIANCE\nPRIMARIES=.7347 .2653 .2738 .7174 .1666 .0089 .3457 .3585\nPIXASPECT=2\n";
        assert_eq!(read_bytes(&picture(head, "-Y 3 +X 2", &PIXELS)).unwrap().notes.len(), 2);
    }

    #[test]
    fn all_eight_orders_of_scan_lines_stand_upright() {
        let upright = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        for (size, order) in [
            ("-Y 3 +X 2", [1, 2, 3, 4, 5, 6]),
            ("-Y 3 -X 2", [2, 1, 4, 3, 6, 5]),
            ("+Y 3 +X 2", [5, 6, 3, 4, 1, 2]),
            ("+Y 3 -X 2", [6, 5, 4, 3, 2, 1]),
            ("+X 2 -Y 3", [1, 3, 5, 2, 4, 6]),
            ("+X 2 +Y 3", [5, 3, 1, 6, 4, 2]),
            ("-X 2 -Y 3", [2, 4, 6, 1, 3, 5]),
            ("-X 2 +Y 3", [6, 4, 2, 5, 3, 1]),
        ] {
            let pixels = order.map(|i: usize| PIXELS[i - 1]);
            let image = read_bytes(&picture("#?RGBE\n", size, &pixels)).unwrap();
            assert_eq!((image.map.width, image.map.height), (2, 3), "{size}");
            assert_eq!(reds(&image), upright, "{size}");
        }
    }

    #[test]
    fn wrong_headers_are_refused_by_line() {
        for (head, size, words) in [
            ("#?RGBE\nFORMAT=32-bit_rle_xyze\n", "-Y 3 +X 2", "line 2"),
            ("#?RGBE\nGAMMA=2.2\n", "-Y 3 +X 2", "GAMMA=1"),
            ("#?RGBE\nEXPOSURE=0\n", "-Y 3 +X 2", "positive"),
            ("#?RGBE\nEXPOSURE=bright\n", "-Y 3 +X 2", "line 2"),
            ("#?RGBE\nCOLORCORR=1 2\n", "-Y 3 +X 2", "3 finite numbers"),
            ("#?RGBE\n", "-Y 3 -Y 2", "eight orders"),
            ("#?RGBE\n", "-Y 0 +X 2", "at least 1"),
            ("#?RGBE\n", "-Y 3 +X 0", "at least 1"),
            ("#?RGBE\n", "-Y 4000000000 +X 4000000000", "limit on sides"),
            ("#?RGBE\n", "-Y 60000 +X 60000", "limit on pixels"),
            ("#?RGBE\n", "-Y 4 +X 2", "not a readable image"),
            ("#?RGBE", "", "line 3"),
        ] {
            let message = read_bytes(&picture(head, size, &PIXELS)).unwrap_err().to_string();
            assert!(message.contains(words) && message.starts_with("a.hdr"), "{size} {message}");
        }
        assert!(read_bytes(b"#?RGBE").unwrap_err().to_string().contains("line 1"));
    }
}
