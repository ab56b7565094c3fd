//! Turning and mirroring of decoded values.

use image::metadata::Orientation;
use rubor_rig::map::Map;

/// The map as its author sees it. The cases are those of the Exif tag Orientation (Exif 2.32, table 6).
pub(super) fn applied(map: Map, orientation: Orientation) -> Map {
    let (w, h) = (map.width, map.height);
    match orientation {
        Orientation::NoTransforms => map,
        Orientation::FlipHorizontal => remapped(&map, w, h, |x, y| (w - 1 - x, y)),
        Orientation::Rotate180 => remapped(&map, w, h, |x, y| (w - 1 - x, h - 1 - y)),
        Orientation::FlipVertical => remapped(&map, w, h, |x, y| (x, h - 1 - y)),
        Orientation::Rotate90FlipH => remapped(&map, h, w, |x, y| (y, x)),
        Orientation::Rotate90 => remapped(&map, h, w, |x, y| (y, h - 1 - x)),
        Orientation::Rotate270FlipH => remapped(&map, h, w, |x, y| (w - 1 - y, h - 1 - x)),
        Orientation::Rotate270 => remapped(&map, h, w, |x, y| (w - 1 - y, x)),
    }
}

/// A map of another size whose texel (x, y) is the texel `source(x, y)` of this one.
pub(super) fn remapped(map: &Map, width: u32, height: u32, source: impl Fn(u32, u32) -> (u32, u32)) -> Map {
    let mut values = Vec::with_capacity(map.values.len());
    for y in 0..height {
        for x in 0..width {
            let (sx, sy) = source(x, y);
            values.extend_from_slice(map.texel(sx, sy));
        }
    }
    Map { width, height, channels: map.channels, values }
}

/// The note on a picture that was rotated.
pub(super) fn note(orientation: Orientation) -> Option<String> {
    (orientation != Orientation::NoTransforms).then(|| {
        let code = orientation.to_exif();
        format!("the Exif orientation {code} was applied; the result stands upright and carries no tag")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_eight_orientations_agree_with_those_of_the_image_crate() {
        let picture = image::GrayImage::from_fn(5, 3, |x, y| image::Luma([(10 * y + x) as u8]));
        let map = Map {
            width: 5,
            height: 3,
            channels: 1,
            values: picture.as_raw().iter().map(|c| f32::from(*c)).collect(),
        };
        for code in 1..=8 {
            let orientation = Orientation::from_exif(code).unwrap();
            let mut expected = image::DynamicImage::from(picture.clone());
            expected.apply_orientation(orientation);
            let turned = applied(map.clone(), orientation);
            assert_eq!((turned.width, turned.height), (expected.width(), expected.height()), "{code}");
            let codes: Vec<u8> = turned.values.iter().map(|v| *v as u8).collect();
            assert_eq!(codes, expected.as_bytes(), "{code}");
        }
    }
}
