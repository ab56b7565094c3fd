//! Words on pictures: labels of contact sheets and videos, in a face of strokes that is rubor's own.
//!
//! Each letter is a few lines on a grid of 4 by 6, with two rows below for descenders, so it can be drawn at any height
//! without a font file. Coverage of a pixel is one less the distance of its middle from the line beyond half the width of
//! the line. All letters are equally wide, so that numbers stand still.
//!
//! Knows ASCII. Another character is a box.

use image::RgbImage;

/// Grid units from one letter to the next.
const ADVANCE: f32 = 5.6;
/// Grid units of a capital.
const CAPITAL: f32 = 6.0;
/// Width of lines as part of the height of capitals, and the least, pixels.
const STROKE: (f32, f32) = (0.13, 1.25);
/// Stands for what the face does not have.
const BOX: &str = "0040460600";

/// Lines of a letter: pairs of digits are columns and rows of corners; a space lifts the pen.
fn strokes(letter: char) -> &'static str {
    match letter {
        ' ' => "",
        'A' => "062046 1434",
        'B' => "06003041423303 3344453606",
        'C' => "4130100105163645",
        'D' => "00063645413000",
        'E' => "40000646 0333",
        'F' => "400006 0333",
        'G' => "41301001051636454323",
        'H' => "0006 4046 0343",
        'I' => "1030 2026 1636",
        'J' => "4045361605",
        'K' => "0006 4004 1346",
        'L' => "000646",
        'M' => "0600234046",
        'N' => "06004640",
        'O' => "100105163645413010",
        'P' => "06003041423303",
        'Q' => "100105163645413010 2446",
        'R' => "06003041423303 2346",
        'S' => "413010010213334445361605",
        'T' => "0040 2026",
        'U' => "000516364540",
        'V' => "002640",
        'W' => "0016223640",
        'X' => "0046 4006",
        'Y' => "002340 2326",
        'Z' => "00400646",
        'a' => "12324346 441405163645",
        'b' => "0006 0312324345361605",
        'c' => "4332120305163645",
        'd' => "4046 4332120305163645",
        'e' => "04444332120305163645",
        'f' => "40302126 0242",
        'g' => "4332120305163645 4247381807",
        'h' => "0006 0312324346",
        'i' => "122226 1636 2020",
        'j' => "2232372818 3030",
        'k' => "0006 421446 0414",
        'l' => "102026 1636",
        'm' => "0206 03122326 23324346",
        'n' => "0206 0312324346",
        'o' => "120305163645433212",
        'p' => "0208 0312324345361605",
        'q' => "4248 4332120305163645",
        'r' => "0206 03123243",
        's' => "43321203143445361605",
        't' => "1015263645 0232",
        'u' => "0205163645 4246",
        'v' => "022642",
        'w' => "0216233642",
        'x' => "0246 4206",
        'y' => "0205163645 4247381807",
        'z' => "02420646",
        '0' => "100105163645413010 1531",
        '1' => "112026 1636",
        '2' => "01103041420646",
        '3' => "01103041423313 334445361605",
        '4' => "36300444",
        '5' => "400002324345361605",
        '6' => "413010010516364544331304",
        '7' => "004016",
        '8' => "100102133342413010 1304051636454433",
        '9' => "051636454130100102133342",
        '.' => "2626",
        ',' => "2617",
        ':' => "2323 2626",
        ';' => "2323 2617",
        '-' => "1333",
        '+' => "0444 2226",
        '=' => "0242 0444",
        '_' => "0747",
        '/' => "0640",
        '\\' => "0046",
        '|' => "2027",
        '(' => "30212536",
        ')' => "10212516",
        '[' => "30202636",
        ']' => "10202616",
        '{' => "30212213242536",
        '}' => "10212233242516",
        '<' => "310335",
        '>' => "114315",
        '!' => "2024 2626",
        '?' => "01103041422324 2626",
        '\'' => "2021",
        '"' => "1011 3031",
        '`' => "1021",
        '~' => "0413243342",
        '#' => "1016 3036 0242 0444",
        '$' => "413010010213334445361605 2026",
        '%' => "0640 1111 3535",
        '&' => "4612112031320405162644",
        '@' => "34321214344441301001051646",
        '*' => "2125 0244 0442",
        '^' => "022042",
        _ => BOX,
    }
}

/// Width of a text whose capitals have a height, pixels.
pub fn width(text: &str, height: f32) -> f32 {
    let unit = height / CAPITAL;
    (text.chars().count() as f32 * ADVANCE - (ADVANCE - 4.0)).max(0.0) * unit
}

/// Draws a text; `left` and `top` are those of its capitals, whose height is in pixels. What is outside of the picture is
/// cut.
pub fn draw(picture: &mut RgbImage, [left, top]: [f32; 2], height: f32, color: [u8; 3], text: &str) {
    let line = (STROKE.0 * height).max(STROKE.1);
    lines(picture, [left, top], height, line, color, 1.0, text);
}

/// As [`draw`], with a dark rim that is read on any picture.
pub fn draw_on_picture(picture: &mut RgbImage, [left, top]: [f32; 2], height: f32, text: &str) {
    let line = (STROKE.0 * height).max(STROKE.1);
    lines(picture, [left, top], height, line + (0.2 * height).max(2.0), [0; 3], 0.6, text);
    lines(picture, [left, top], height, line, [255; 3], 1.0, text);
}

fn lines(
    picture: &mut RgbImage,
    [left, top]: [f32; 2],
    height: f32,
    line: f32,
    color: [u8; 3],
    strength: f32,
    text: &str,
) {
    let unit = height / CAPITAL;
    let (wide, high) = (picture.width() as i64, picture.height() as i64);
    for (n, letter) in text.chars().enumerate() {
        let x = left + n as f32 * ADVANCE * unit;
        let mut segments: Vec<[[f32; 2]; 2]> = Vec::new();
        for stroke in strokes(letter).split(' ') {
            let corner =
                |pair: &[u8]| [x + f32::from(pair[0] - b'0') * unit, top + f32::from(pair[1] - b'0') * unit];
            let corners: Vec<_> = stroke.as_bytes().chunks_exact(2).map(corner).collect();
            segments.extend(corners.windows(2).map(|pair| [pair[0], pair[1]]));
        }
        if segments.is_empty() {
            continue;
        }
        // The letter is a union, so that crossing lines do not darken each other.
        let reach = 0.5 * line + 1.0;
        let range = |from: f32, to: f32, most: i64| {
            ((from - reach).floor() as i64).clamp(0, most)..((to + reach).ceil() as i64).clamp(0, most)
        };
        for row in range(top, top + 8.0 * unit, high) {
            for column in range(x, x + 4.0 * unit, wide) {
                let at = [column as f32 + 0.5, row as f32 + 0.5];
                let near = segments.iter().map(|s| distance(at, s)).fold(f32::INFINITY, f32::min);
                let cover = strength * (0.5 * line + 0.5 - near).clamp(0.0, 1.0);
                if cover > 0.0 {
                    let pixel = picture.get_pixel_mut(column as u32, row as u32);
                    for (c, value) in pixel.0.iter_mut().enumerate() {
                        *value =
                            (f32::from(*value) * (1.0 - cover) + f32::from(color[c]) * cover).round() as u8;
                    }
                }
            }
        }
    }
}

/// Distance of a point from a line between two points.
fn distance(p: [f32; 2], [a, b]: &[[f32; 2]; 2]) -> f32 {
    let (along, from) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length = along[0] * along[0] + along[1] * along[1];
    let share =
        if length > 0.0 { ((from[0] * along[0] + from[1] * along[1]) / length).clamp(0.0, 1.0) } else { 0.0 };
    (from[0] - share * along[0]).hypot(from[1] - share * along[1])
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn drawn(text: &str, height: f32) -> RgbImage {
        let mut picture = RgbImage::new(width(text, height) as u32 + 8, (1.4 * height) as u32 + 8);
        draw(&mut picture, [4.0, 4.0], height, [255; 3], text);
        picture
    }

    #[test]
    fn every_letter_of_ascii_is_drawn_and_no_two_look_alike() {
        let all: Vec<char> = ('!'..='~').collect();
        let pictures: BTreeSet<Vec<u8>> =
            all.iter().map(|c| drawn(&c.to_string(), 12.0).into_raw()).collect();
        assert_eq!(pictures.len(), all.len());
        // A dot between four pixels covers each of them by little more than half.
        assert!(pictures.iter().all(|bytes| bytes.iter().any(|b| *b > 120)), "each is seen");
        assert!(!all.iter().any(|c| strokes(*c) == BOX));
        assert_eq!(drawn("\u{e9}", 12.0), drawn("\u{416}", 12.0));
        for letter in all {
            let is_on_grid = |pair: &[u8]| pair.len() == 2 && pair[0] <= b'4' && pair[1] <= b'8';
            assert!(strokes(letter).split(' ').all(|s| s.as_bytes().chunks(2).all(is_on_grid)), "{letter}");
        }
    }

    #[test]
    fn words_stay_within_their_width_and_within_the_picture() {
        let picture = drawn("frame 0123", 20.0);
        let edge = |x: u32| (0..picture.height()).all(|y| picture.get_pixel(x, y).0 == [0; 3]);
        assert!(edge(0) && edge(picture.width() - 1));
        let mut small = RgbImage::new(10, 10);
        draw_on_picture(&mut small, [-30.0, -4.0], 40.0, "XXXXXXXX");
        draw_on_picture(&mut small, [1e6, 1e6], 12.0, "X");
        assert!(small.pixels().any(|p| p.0 != [0; 3]));
    }
}
