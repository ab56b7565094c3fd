//! An OpenEXR as stored: every part, layer and channel, for tools that change its colours and write it back.

use std::io::Cursor;
use std::path::Path;

use exr::meta::BlockDescription;
use exr::meta::attribute::LevelMode;
use exr::prelude::{FlatImage, ReadChannels, ReadLayers, read};

use super::exr::{Choice, choices, names_of};
use super::{ImageError, Limits, channels, contained, read_file};

/// An OpenEXR with every part, layer and channel.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredExr {
    /// The file; the parts are its layers in the words of the `exr` crate.
    pub image: FlatImage,
    /// The layers that are pictures.
    pub pictures: Vec<PictureLayer>,
    /// What the reader chose or left out, for people.
    pub notes: Vec<String>,
}

/// Where the channels of a picture stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureLayer {
    /// Index of the part.
    pub part: usize,
    /// Indices of red, green and blue in the part; three times the same for grey.
    pub color: [usize; 3],
    /// Index of alpha.
    pub alpha: Option<usize>,
}

/// Reads an OpenEXR with every part, layer and channel and tells which layers are pictures: unnamed channels of a part,
/// and layers called combined, beauty or the like. Where there is none, it is the one that [`super::load_image`] takes.
/// Normals, positions, motion, depth and ids are no pictures, whatever their channels are called.
///
/// # Errors
/// As for [`super::load_image_with`]; another kind of file; a file without a picture.
pub fn load_stored_exr(file: &Path, limits: &Limits) -> Result<StoredExr, ImageError> {
    let bytes = read_file(file, limits)?;
    if !super::exr::matches(&bytes) {
        return Err(ImageError::Content {
            file: file.to_owned(),
            at: "kind".into(),
            found: "another kind of file".into(),
            expected: "an OpenEXR".into(),
        });
    }
    contained(file, || load(file, &bytes, limits))
}

fn load(file: &Path, bytes: &[u8], limits: &Limits) -> Result<StoredExr, ImageError> {
    let decode = |e: exr::error::Error| ImageError::Decode { file: file.to_owned(), message: e.to_string() };
    let reader = exr::block::read(Cursor::new(bytes), false).map_err(decode)?;
    let headers = reader.headers();
    let fail = |at: &str, found: String, expected: String| {
        Err(ImageError::Content { file: file.to_owned(), at: at.into(), found, expected })
    };
    let mut notes = Vec::new();
    let mut total = 0u64;
    for (part, header) in headers.iter().enumerate() {
        let (w, h) = (header.layer_size.width() as u64, header.layer_size.height() as u64);
        // The samples, and a picture of four floats before and after.
        let per_pixel = header.channels.bytes_per_pixel as u64 + 32;
        let at = format!("part {part}");
        limits.check(file, &at, (w, h), per_pixel)?;
        total = total.saturating_add((w * h).saturating_mul(header.channels.bytes_per_pixel as u64));
        if let BlockDescription::Tiles(tiles) = header.blocks {
            let size = (tiles.tile_size.width() as u64, tiles.tile_size.height() as u64);
            limits.check(file, &format!("{at}, tile"), size, header.channels.bytes_per_pixel as u64)?;
            if tiles.level_mode != LevelMode::Singular {
                notes.push("smaller copies of the image (resolution levels) were left out".into());
            }
        }
    }
    if total > limits.bytes {
        let expected = format!("at most {} MiB (the limit on memory)", limits.bytes >> 20);
        return fail("parts", format!("{} MiB in all", total >> 20), expected);
    }

    let found = choices(headers);
    let names: Vec<Vec<String>> = headers.iter().map(names_of).collect();
    let is_picture = |c: &Choice| {
        channels::is_color(&names[c.part], &c.layer) && !channels::is_data(&channels::last_word(&c.title))
    };
    let rank = |c: &Choice| channels::rank_as_picture(&channels::last_word(&c.title));
    let mut taken: Vec<usize> = (0..found.len())
        .filter(|i| is_picture(&found[*i]) && (found[*i].layer.name.is_empty() || rank(&found[*i]) < 2))
        .collect();
    if taken.is_empty() {
        let best = (0..found.len()).filter(|i| is_picture(&found[*i]));
        taken.extend(best.min_by_key(|i| (found[*i].layer.values.len() != 3, rank(&found[*i]))));
    }
    if taken.is_empty() {
        let expected = "a layer of colours: R, G and B, or Y".into();
        return fail("channels", names.concat().join(", "), expected);
    }
    let title = |i: usize| match found[i].title.as_str() {
        "" => "(unnamed)".to_owned(),
        title => format!("{title:?}"),
    };
    let list = |places: &mut dyn Iterator<Item = usize>| places.map(title).collect::<Vec<_>>().join(", ");
    if taken.len() < found.len() {
        let taken_names = list(&mut taken.iter().copied());
        let kept = list(&mut (0..found.len()).filter(|i| !taken.contains(i)));
        notes.push(format!("layer {taken_names} was taken as the picture; kept as they are: {kept}"));
    }
    let pictures = taken.iter().map(|i| {
        let Choice { part, layer, .. } = &found[*i];
        let place = |c: usize| layer.values[if layer.values.len() == 3 { c } else { 0 }];
        PictureLayer { part: *part, color: [0, 1, 2].map(place), alpha: layer.alpha }
    });
    let pictures = pictures.collect();
    // Not the crate's own threads: a fault on one of those would end the program.
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(decode)?;
    Ok(StoredExr { image, pictures, notes })
}
