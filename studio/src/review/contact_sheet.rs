//! A sequence at a glance: some of its frames, evenly spaced, on one page.

use image::RgbImage;
use image::imageops::{FilterType, resize};

use super::text;

/// Frames on a page.
const MOST: usize = 48;
/// Frames per row.
const COLUMNS: u32 = 8;
/// Width of a small frame, pixels.
const WIDTH: u32 = 200;
const GAP: u32 = 4;
/// Height of the line under a frame, and of its capitals, pixels.
const LABEL: u32 = 18;
const LETTERS: f32 = 8.0;
const MARGIN: f32 = 3.0;
const BACKGROUND: image::Rgb<u8> = image::Rgb([24, 24, 26]);

/// Indices of the frames, of `count`, that the page shows, ascending.
pub fn choose(count: u32) -> Vec<u32> {
    let n = (count as usize).min(MOST);
    (0..n).map(|i| (i * count as usize / n.max(1)) as u32).collect()
}

/// A frame at the size of the page.
pub fn reduce(frame: &RgbImage) -> RgbImage {
    let height = (WIDTH * frame.height() / frame.width().max(1)).max(1);
    resize(frame, WIDTH, height, FilterType::Triangle)
}

/// The page of reduced frames of one size, each with a label under it.
pub fn page(frames: &[(RgbImage, Vec<String>)]) -> RgbImage {
    let labelled: Vec<RgbImage> = frames.iter().map(|(frame, words)| with_label(frame, words)).collect();
    page_of(&labelled, COLUMNS)
}

/// A frame with words under it.
fn with_label(frame: &RgbImage, words: &[String]) -> RgbImage {
    let mut picture = RgbImage::from_pixel(frame.width(), frame.height() + LABEL, BACKGROUND);
    image::imageops::replace(&mut picture, frame, 0, 0);
    let top = frame.height() as f32 + 0.5 * (LABEL as f32 - LETTERS);
    text::draw(&mut picture, [MARGIN, top], LETTERS, [200; 3], &label(words, frame.width()));
    picture
}

/// As many of the words as a width has room for, and how many more there are.
fn label(words: &[String], width: u32) -> String {
    let join = |n: usize| {
        let more = words.len() - n;
        let rest = if more > 0 && n > 0 { format!("  +{more}") } else { String::new() };
        format!("{}{rest}", words[..n].join("  "))
    };
    let fits = |text: &String| text::width(text, LETTERS) <= width as f32 - 2.0 * MARGIN;
    (0..=words.len()).rev().map(join).find(fits).unwrap_or_default()
}

/// Pictures of one size in rows of up to `columns`.
pub fn page_of(frames: &[RgbImage], columns: u32) -> RgbImage {
    let (w, h) = frames.first().map_or((1, 1), RgbImage::dimensions);
    let columns = columns.min(frames.len() as u32).max(1);
    let rows = (frames.len() as u32).div_ceil(columns).max(1);
    let mut page = RgbImage::from_pixel(columns * (w + GAP) + GAP, rows * (h + GAP) + GAP, BACKGROUND);
    for (i, frame) in frames.iter().enumerate() {
        let (x, y) = (i as u32 % columns, i as u32 / columns);
        let place = |n: u32, step: u32| i64::from(GAP + n * (step + GAP));
        image::imageops::replace(&mut page, frame, place(x, w), place(y, h));
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_sequences_show_every_frame_and_long_ones_the_same_number() {
        assert_eq!(choose(3), [0, 1, 2]);
        let many = choose(1000);
        assert_eq!(many.len(), MOST);
        assert_eq!(many[0], 0);
        assert!(many.windows(2).all(|w| w[0] < w[1]));
    }

    #[test]
    fn a_page_holds_its_frames() {
        let page = page_of(&vec![RgbImage::from_pixel(20, 10, image::Rgb([255, 0, 0])); 9], COLUMNS);
        assert_eq!(page.dimensions(), (8 * 24 + 4, 2 * 14 + 4));
        assert_eq!(page.get_pixel(4, 18).0, [255, 0, 0]);
        assert_eq!(page.get_pixel(28, 18).0, [24, 24, 26]);
    }

    #[test]
    fn a_label_stands_under_its_frame_and_says_what_it_has_no_room_for() {
        let frame = RgbImage::from_pixel(100, 10, image::Rgb([255, 0, 0]));
        let words = ["0001  0.00 s", "joy 1.00", "blush 0.50"].map(str::to_owned);
        let one = page(&[(frame, words[..1].to_vec())]);
        assert_eq!(one.dimensions(), (100 + 8, 10 + 18 + 8));
        let is_letter = |p: &image::Rgb<u8>| p.0.iter().all(|v| *v > 150);
        assert!(one.pixels().any(is_letter));
        assert!(one.enumerate_pixels().all(|(_, y, p)| !is_letter(p) || (14..32).contains(&y)));
        assert_eq!(label(&words, 1000), "0001  0.00 s  joy 1.00  blush 0.50");
        assert_eq!(label(&words, 200), "0001  0.00 s  joy 1.00  +1");
        assert_eq!(label(&words, 130), "0001  0.00 s  +2");
        assert_eq!(label(&words, 20), "");
    }
}
