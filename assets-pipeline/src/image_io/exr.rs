//! OpenEXR: one layer of one part, by the meaning of its channels, in its display window.

use std::collections::HashSet;
use std::io::Cursor;
use std::path::Path;

use exr::block::UncompressedBlock;
use exr::block::chunk::Chunk;
use exr::block::reader::Reader;
use exr::meta::BlockDescription;
use exr::meta::attribute::{EnvironmentMap, IntegerBounds, SampleType};
use exr::meta::header::Header;
use exr::prelude;
use half::f16;
use rayon::prelude::*;
use rubor_rig::map::Map;

use super::channels::{self, Layer};
use super::{ImageError, LoadedImage, Purpose, ReadOptions, SampleKind};

/// Blocks that are decompressed at once: enough for every core, little beside the image.
const BATCH: usize = 64;
/// CIE chromaticities of Rec. 709: red, green, blue, white.
const REC_709: [[f32; 2]; 4] = [[0.640, 0.330], [0.300, 0.600], [0.150, 0.060], [0.3127, 0.3290]];

/// Tells whether these bytes open an EXR.
pub(super) fn matches(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01])
}

/// An image and what only environments ask for.
pub(super) struct ExrImage {
    pub(super) image: LoadedImage,
    /// The header says that this is a cube map.
    pub(super) is_cube_map: bool,
}

/// A layer and the part that holds it.
pub(super) struct Choice {
    pub(super) part: usize,
    /// Name for messages: part and layer.
    pub(super) title: String,
    pub(super) layer: Layer,
}

pub(super) fn read(file: &Path, bytes: &[u8], options: &ReadOptions) -> Result<ExrImage, ImageError> {
    let decode = |e: prelude::Error| ImageError::Decode { file: file.to_owned(), message: e.to_string() };
    let reader = exr::block::read(Cursor::new(bytes), false).map_err(decode)?;
    let (choice, mut notes) = choose(file, reader.headers(), options)?;
    let header = reader.headers()[choice.part].clone();
    let windows = windows(file, &header, &choice, options, &mut notes)?;
    note_attributes(&header, &choice, &mut notes);

    let mut map = Map {
        width: windows.width,
        height: windows.height,
        channels: choice.layer.values.len() as u32,
        values: vec![0.0; windows.width as usize * windows.height as usize * choice.layer.values.len()],
    };
    // Texels that the data window leaves out carry no value; alpha is how a map says so.
    let has_alpha = choice.layer.alpha.is_some();
    let mut alpha =
        (has_alpha || !windows.is_filled).then(|| Map::filled(windows.width, windows.height, &[0.0]));
    fill(file, reader, &choice, &header, |block| {
        for line in block.lines(&header.channels) {
            let place = line.location.channel;
            let Some((y, columns)) = windows.target(line.location.position, line.location.sample_count)
            else {
                continue;
            };
            let row = y * windows.width as usize;
            let sample = samples(line.value, header.channels.list[place].sample_type);
            if let Some(c) = choice.layer.values.iter().position(|p| *p == place) {
                for (x, from) in columns.clone() {
                    map.values[(row + x) * choice.layer.values.len() + c] = sample(from);
                }
            }
            let Some(alpha) = &mut alpha else { continue };
            if choice.layer.alpha == Some(place) {
                columns.for_each(|(x, from)| alpha.values[row + x] = sample(from));
            } else if !has_alpha && choice.layer.values[0] == place {
                columns.for_each(|(x, _)| alpha.values[row + x] = 1.0);
            }
        }
    })?;
    let is_cube_map = header.own_attributes.environment_map == Some(EnvironmentMap::Cube);
    let image = LoadedImage { file: file.to_owned(), map, alpha, kind: SampleKind::F32, notes };
    Ok(ExrImage { image, is_cube_map })
}

/// Names of the channels of a part.
pub(super) fn names_of(header: &Header) -> Vec<String> {
    header.channels.list.iter().map(|c| c.name.to_string()).collect()
}

/// The layers of all parts, but for those of alpha alone.
pub(super) fn choices(headers: &[Header]) -> Vec<Choice> {
    let mut choices: Vec<Choice> = Vec::new();
    for (part, header) in headers.iter().enumerate() {
        let part_name =
            header.own_attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default();
        let names = names_of(header);
        let layers = channels::layers(&names);
        for layer in layers {
            // Alpha alone is the coverage of another layer.
            if layer.values.is_empty() && layer.unread.is_empty() {
                continue;
            }
            let title = match (part_name.as_str(), layer.name.as_str()) {
                (part, "") => part.to_owned(),
                ("", layer) => layer.to_owned(),
                // A file of one part often carries a name that says nothing, and layers repeat the name of their part.
                (_, layer) if headers.len() == 1 => layer.to_owned(),
                (part, layer) if layer.to_lowercase().starts_with(&part.to_lowercase()) => layer.to_owned(),
                (part, layer) => format!("{part}/{layer}"),
            };
            choices.push(Choice { part, title, layer });
        }
    }
    choices
}

/// The layer that is asked for or that its name speaks for; notes say what else there is.
fn choose(
    file: &Path,
    headers: &[Header],
    options: &ReadOptions,
) -> Result<(Choice, Vec<String>), ImageError> {
    let mut choices = choices(headers);
    let titles = |choices: &[Choice]| {
        let quoted =
            |c: &Choice| if c.title.is_empty() { "(unnamed)".into() } else { format!("{:?}", c.title) };
        choices.iter().map(quoted).collect::<Vec<_>>().join(", ")
    };
    let fail = |at: &str, found: String, expected: String| {
        Err(ImageError::Content { file: file.to_owned(), at: at.into(), found, expected })
    };
    if choices.is_empty() {
        return fail("channels", "alpha only".into(), "at least one other channel".into());
    }

    let found = if let Some(wanted) = &options.layer {
        let same = |a: &str| a.eq_ignore_ascii_case(wanted);
        let whole: Vec<usize> = (0..choices.len())
            .filter(|i| same(&choices[*i].title) || same(&choices[*i].layer.name))
            .collect();
        let ends: Vec<usize> =
            (0..choices.len()).filter(|i| same(&channels::last_word(&choices[*i].title))).collect();
        match (&whole[..], &ends[..]) {
            ([one], _) | ([], [one]) => Some(*one),
            ([], []) => {
                // One channel by its full name: `ViewLayer.Depth.Z`, `melanin`.
                let channel = headers
                    .iter()
                    .enumerate()
                    .find_map(|(part, header)| Some((part, names_of(header).iter().position(|n| same(n))?)));
                let Some((part, place)) = channel else {
                    let expected = format!("a layer of the file: {}", titles(&choices));
                    return fail("layer", format!("{wanted:?}"), expected);
                };
                let layer =
                    Layer { name: wanted.clone(), values: vec![place], alpha: None, unread: Vec::new() };
                choices.push(Choice { part, title: wanted.clone(), layer });
                Some(choices.len() - 1)
            }
            _ => {
                let expected = format!("a name of one layer only, one of {}", titles(&choices));
                return fail("layer", format!("{wanted:?}"), expected);
            }
        }
    } else {
        let rank = |c: &Choice| {
            let last = channels::last_word(&c.title);
            let by_name = match options.purpose {
                Purpose::Values => channels::rank_as_picture(&last),
                Purpose::Normals => channels::rank_as_normals(&last),
            };
            (c.layer.values.is_empty(), c.layer.values.len() != 3, by_name)
        };
        (0..choices.len()).min_by_key(|i| rank(&choices[*i]))
    };
    let Some(found) = found else {
        return fail("channels", "none".into(), "at least one".into());
    };
    let choice = choices.remove(found);
    let names = names_of(&headers[choice.part]);
    let list = |places: &[usize]| places.iter().map(|p| names[*p].as_str()).collect::<Vec<_>>().join(", ");
    if choice.layer.values.is_empty() {
        let expected = "R G B, x y z, Y or one channel; name a channel to read it alone".into();
        return fail("channels", list(&choice.layer.unread), expected);
    }
    let mut notes = Vec::new();
    if !choices.is_empty() && options.layer.is_none() {
        let title = if choice.title.is_empty() { "(unnamed)" } else { choice.title.as_str() };
        notes.push(format!("layer {title} was taken; the file also holds {}", titles(&choices)));
    }
    if !choice.layer.unread.is_empty() {
        notes.push(format!("channels that were not read: {}", list(&choice.layer.unread)));
    }
    Ok((choice, notes))
}

/// The display window and where the data lie in it.
struct Windows {
    width: u32,
    height: u32,
    /// Column and row of the display window where the data begin; negative where they overscan it.
    offset: [i64; 2],
    /// The data fill the display window.
    is_filled: bool,
}

impl Windows {
    /// Row of the image and its columns with the samples they come from, for a line of the data window.
    fn target(
        &self,
        position: prelude::Vec2<usize>,
        count: usize,
    ) -> Option<(usize, impl Iterator<Item = (usize, usize)> + Clone + use<>)> {
        let y = usize::try_from(position.y() as i64 + self.offset[1]).ok()?;
        if y >= self.height as usize {
            return None;
        }
        let (x, width) = (position.x() as i64 + self.offset[0], i64::from(self.width));
        let (first, last) = (x.clamp(0, width), (x + count as i64).clamp(0, width));
        Some((y, (first..last).map(move |column| (column as usize, (column - x) as usize))))
    }
}

fn windows(
    file: &Path,
    header: &Header,
    choice: &Choice,
    options: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<Windows, ImageError> {
    let fail = |at: &str, found: String, expected: &str| {
        Err(ImageError::Content { file: file.to_owned(), at: at.into(), found, expected: expected.into() })
    };
    if let Some(c) = header.channels.list.iter().find(|c| c.sampling != prelude::Vec2(1, 1)) {
        let found = format!("{} at a lower resolution (luminance and chroma, or proxies)", c.name);
        return fail("channels", found, "all channels at full resolution");
    }
    let data = IntegerBounds::new(header.own_attributes.layer_position, header.layer_size);
    let display = header.shared_attributes.display_window;
    let limits = &options.limits;
    let size = |bounds: IntegerBounds| (bounds.size.width() as u64, bounds.size.height() as u64);
    // Each channel is a float; the block buffers of a batch stand beside the image.
    let per_pixel = 4 * (choice.layer.values.len() as u64 + 1);
    limits.check(file, "data window", size(data), header.channels.bytes_per_pixel as u64)?;
    let (width, height) = limits.check(file, "display window", size(display), per_pixel)?;
    if let BlockDescription::Tiles(tiles) = header.blocks {
        let (w, h) = (tiles.tile_size.width() as u64, tiles.tile_size.height() as u64);
        limits.check(file, "tile", (w, h), header.channels.bytes_per_pixel as u64)?;
    }
    let start = |bounds: IntegerBounds| [i64::from(bounds.position.x()), i64::from(bounds.position.y())];
    let (from, to) = (start(data), start(display));
    let offset = [from[0] - to[0], from[1] - to[1]];
    let (data_width, data_height) = (data.size.width() as i64, data.size.height() as i64);
    let (w, h) = (i64::from(width), i64::from(height));
    let is_apart =
        offset[0] >= w || offset[1] >= h || offset[0] + data_width <= 0 || offset[1] + data_height <= 0;
    let place = format!(
        "{data_width}x{data_height} texels of data at ({}, {}) of {w}x{h} shown",
        offset[0], offset[1]
    );
    if is_apart {
        return fail("data window", place, "data within the display window");
    }
    let is_filled =
        offset[0] <= 0 && offset[1] <= 0 && offset[0] + data_width >= w && offset[1] + data_height >= h;
    if !is_filled {
        notes.push(format!("{place}: texels outside of the data are not mapped (value 0, alpha 0)"));
    } else if (offset, data_width, data_height) != ([0, 0], w, h) {
        notes.push(format!("{place}: data outside of the display window were left out"));
    }
    Ok(Windows { width, height, offset, is_filled })
}

fn note_attributes(header: &Header, choice: &Choice, notes: &mut Vec<String>) {
    let aspect = header.shared_attributes.pixel_aspect;
    if (aspect - 1.0).abs() > 1e-3 {
        notes.push(format!("pixel aspect ratio {aspect}: pixels are taken as squares"));
    }
    if let Some(c) = &header.shared_attributes.chromaticities
        && choice.layer.values.len() == 3
    {
        let found = [c.red, c.green, c.blue, c.white].map(|v| [v.x(), v.y()]);
        let pairs = found.as_flattened().iter().zip(REC_709.as_flattened());
        if pairs.into_iter().any(|(a, b)| (a - b).abs() > 0.01) {
            notes.push("chromaticities are not those of Rec. 709: colours are taken as if they were".into());
        }
    }
}

/// Decompresses the blocks of the chosen part at full resolution and hands each to `put`.
fn fill(
    file: &Path,
    reader: Reader<Cursor<&[u8]>>,
    choice: &Choice,
    header: &Header,
    mut put: impl FnMut(&UncompressedBlock),
) -> Result<(), ImageError> {
    let decode = |e: prelude::Error| ImageError::Decode { file: file.to_owned(), message: e.to_string() };
    let mut expected = 0;
    let mut chunks = reader
        .filter_chunks(false, |_, tile, block| {
            let wanted = block.layer == choice.part && tile.level_index == prelude::Vec2(0, 0);
            expected += usize::from(wanted);
            wanted
        })
        .map_err(decode)?;
    let meta = exr::block::reader::ChunksReader::meta_data(&chunks).clone();
    let mut seen = HashSet::new();
    loop {
        let batch: Vec<Chunk> = chunks.by_ref().take(BATCH).collect::<Result<_, _>>().map_err(decode)?;
        if batch.is_empty() {
            break;
        }
        // Not the crate's own threads: a fault on one of those would end the program.
        let blocks: Vec<UncompressedBlock> = batch
            .into_par_iter()
            .map(|chunk| UncompressedBlock::decompress_chunk(chunk, &meta, false))
            .collect::<Result<_, _>>()
            .map_err(decode)?;
        for block in &blocks {
            let (index, area) = (block.index, block.index.pixel_size.area());
            let is_whole = block.data.len() == area.saturating_mul(header.channels.bytes_per_pixel);
            if index.layer == choice.part && index.level == prelude::Vec2(0, 0) && is_whole {
                seen.insert((index.pixel_position.x(), index.pixel_position.y()));
                put(block);
            }
        }
    }
    if seen.len() != expected {
        return Err(ImageError::Content {
            file: file.to_owned(),
            at: "blocks".into(),
            found: format!("{} of the layer", seen.len()),
            expected: format!("{expected}, each once"),
        });
    }
    Ok(())
}

/// Samples of a line by number, as floats; the crate has put them in the order of bytes of this machine.
fn samples(line: &[u8], kind: SampleType) -> impl Fn(usize) -> f32 + '_ {
    move |i| match kind {
        SampleType::F16 => f16::from_ne_bytes([line[2 * i], line[2 * i + 1]]).to_f32(),
        SampleType::F32 => f32::from_ne_bytes(std::array::from_fn(|k| line[4 * i + k])),
        SampleType::U32 => u32::from_ne_bytes(std::array::from_fn(|k| line[4 * i + k])) as f32,
    }
}
