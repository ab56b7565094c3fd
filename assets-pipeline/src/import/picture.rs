//! Encoded pictures of materials to texels: PNG, JPEG, WebP, TIFF, HDR by `image`; KTX2 with Basis Universal by `basisu`.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::{Component, Path, PathBuf};

use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
use image::{ImageReader, Limits};
use rubor_rig::authored::AuthoredImage;
use rubor_rig::limits;

/// Texels of a picture: 8192 x 8192. A head with ten such pictures is 2.7 GB in memory.
const MOST_TEXELS: u64 = 1 << 26;
const KTX2: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// The picture; the error says why there is none.
pub(crate) fn decode(bytes: &[u8], name: &str) -> Result<AuthoredImage, String> {
    let (width, height, rgba) = if bytes.starts_with(KTX2) { ktx2(bytes)? } else { common(bytes)? };
    Ok(AuthoredImage { name: name.to_owned(), width, height, rgba })
}

fn check_size(width: u32, height: u32) -> Result<(), String> {
    match u64::from(width) * u64::from(height) {
        0 => Err(format!("{width} x {height} texels")),
        1..=MOST_TEXELS => Ok(()),
        _ => Err(format!("{width} x {height} texels, more than 8192 x 8192: make it smaller")),
    }
}

/// Width and height as the header of a picture states them.
///
/// # Errors
/// No picture of a known kind, or one that is too large.
pub(crate) fn size(bytes: &[u8]) -> Result<(u32, u32), String> {
    let (width, height) = if bytes.starts_with(KTX2) {
        ktx2_size(bytes)?
    } else {
        reader(bytes)?.into_dimensions().map_err(|e| e.to_string())?
    };
    check_size(width, height)?;
    Ok((width, height))
}

fn ktx2_word(bytes: &[u8], at: usize) -> Result<u32, String> {
    let word = bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    word.ok_or_else(|| "KTX2: the header is cut off".to_owned())
}

fn ktx2_size(bytes: &[u8]) -> Result<(u32, u32), String> {
    Ok((ktx2_word(bytes, 20)?, ktx2_word(bytes, 24)?))
}

fn reader(bytes: &[u8]) -> Result<ImageReader<Cursor<&[u8]>>, String> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    // Eight bytes a texel at most, twice while one depth becomes another.
    let mut limits = Limits::default();
    limits.max_alloc = Some(16 * MOST_TEXELS);
    reader.limits(limits);
    Ok(reader)
}

fn common(bytes: &[u8]) -> Result<(u32, u32, Vec<u8>), String> {
    // What a header says is checked before memory is taken for it.
    size(bytes)?;
    let picture = reader(bytes)?.decode().map_err(|e| e.to_string())?.into_rgba8();
    Ok((picture.width(), picture.height(), picture.into_raw()))
}

/// The largest level of a KTX2 file with ETC1S or UASTC blocks.
fn ktx2(bytes: &[u8]) -> Result<(u32, u32, Vec<u8>), String> {
    let (width, height) = size(bytes)?;
    if ktx2_word(bytes, 36)? != 1 {
        return Err("KTX2: a cube, where a flat picture is expected".into());
    }
    // Of the first level, before `basisu` takes memory for it: blocks of 16 bytes for 4 x 4 texels.
    let stated = bytes.get(96..104).map(|b| u64::from_le_bytes(b.try_into().unwrap_or_default()));
    let most = 16 * u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
    if stated.ok_or_else(|| "KTX2: the header is cut off".to_owned())? > most {
        return Err(format!("KTX2: a level of {} bytes for {width} x {height} texels", stated.unwrap_or(0)));
    }
    let picture = Transcoder::new(bytes).map_err(|_| {
        "KTX2: broken, or neither ETC1S nor UASTC (`ktx create --encode uastc` makes it)".to_owned()
    })?;
    if !matches!(picture.source_format(), SourceFormat::Etc1s | SourceFormat::UastcLdr) {
        return Err(format!("KTX2: {:?}, where ETC1S or UASTC is expected", picture.source_format()));
    }
    let rgba = picture
        .transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE)
        .map_err(|e| format!("KTX2: its data are broken or cut off ({e:?})"))?;
    if rgba.len() as u64 != 4 * u64::from(width) * u64::from(height) {
        return Err("KTX2: its first level has another size than its header".into());
    }
    Ok((width, height, rgba))
}

/// Pictures that materials of a file name, each read once.
#[derive(Debug, Default)]
pub struct Gallery {
    /// In order of first use.
    pub images: Vec<AuthoredImage>,
    /// Of all pictures, against [`Limits::picture_texels`].
    texels: u64,
    known: HashMap<PathBuf, Result<u32, String>>,
}

impl Gallery {
    /// The picture of a file that a document in `folder` names: in the folder or below, else the file of that name in the
    /// folder itself, as paths of other machines lead nowhere.
    ///
    /// # Errors
    /// Why there is no such picture, with the name as written.
    pub fn file(&mut self, folder: &Path, written: &str) -> Result<u32, String> {
        let path = beside(folder, written).ok_or_else(|| format!("{written:?}: no such file"))?;
        if let Some(known) = self.known.get(&path) {
            return known.clone();
        }
        let read = match limits::read(&path) {
            Ok(bytes) => self.add(&bytes, &path.file_name().unwrap_or_default().to_string_lossy()),
            Err(e) => Err(e.to_string()),
        };
        let read = read.map_err(|why| format!("{written:?}: {why}"));
        self.known.insert(path, read.clone());
        read
    }

    /// A picture in memory.
    pub(crate) fn add(&mut self, bytes: &[u8], name: &str) -> Result<u32, String> {
        let (width, height) = size(bytes)?;
        let texels = self.texels + u64::from(width) * u64::from(height);
        limits::within("texels in pictures", texels, limits::Limits::of_process().picture_texels())
            .map_err(|(found, expected)| format!("found {found}, expected {expected}"))?;
        let image = decode(bytes, name)?;
        Ok(self.push(image))
    }

    fn push(&mut self, image: AuthoredImage) -> u32 {
        self.texels += u64::from(image.width) * u64::from(image.height);
        self.images.push(image);
        self.images.len() as u32 - 1
    }

    /// Whether the texels are directions of a normal map: mostly blue, around the middle in red and green.
    pub fn is_normal_map(&self, image: u32) -> bool {
        let texels = self.images[image as usize].rgba.chunks_exact(4);
        let count = texels.len().max(1) as f64;
        let mean: Vec<f64> =
            (0..3).map(|c| texels.clone().map(|t| f64::from(t[c])).sum::<f64>() / count).collect();
        (96.0..160.0).contains(&mean[0]) && (96.0..160.0).contains(&mean[1]) && mean[2] > 190.0
    }

    /// A picture of several: its channels from those of others, or constants. All are brought to the largest size.
    pub fn combine(&mut self, name: &str, channels: [Channel; 4]) -> u32 {
        let sources = channels.iter().filter_map(|c| if let Channel::Of(i, _) = c { Some(*i) } else { None });
        let size = |i: u32| (self.images[i as usize].width, self.images[i as usize].height);
        let (width, height) =
            sources.clone().map(size).max_by_key(|(w, h)| u64::from(*w) * u64::from(*h)).unwrap_or((1, 1));
        let texels = width as usize * height as usize;
        let mut rgba = vec![255; 4 * texels];
        for (c, channel) in channels.into_iter().enumerate() {
            match channel {
                Channel::Value(value) => rgba[c..].iter_mut().step_by(4).for_each(|v| *v = value),
                Channel::Of(i, from) => {
                    let source = &self.images[i as usize];
                    for y in 0..height {
                        let row = u64::from(y) * u64::from(source.height) / u64::from(height);
                        for x in 0..width {
                            let column = u64::from(x) * u64::from(source.width) / u64::from(width);
                            let at = 4 * (row as usize * source.width as usize + column as usize);
                            rgba[4 * (y as usize * width as usize + x as usize) + c] = source.rgba[at + from];
                        }
                    }
                }
            }
        }
        self.push(AuthoredImage { name: name.to_owned(), width, height, rgba })
    }
}

/// A channel of a combined picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// The same everywhere.
    Value(u8),
    /// Picture and its channel, 0 to 3.
    Of(u32, usize),
}

/// The file that a document in `folder` means.
fn beside(folder: &Path, written: &str) -> Option<PathBuf> {
    let written = written.trim().trim_matches('"').replace('\\', "/");
    let relative = Path::new(&written);
    let is_below = relative.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    if is_below && folder.join(relative).is_file() {
        return Some(folder.join(relative));
    }
    let name = written.rsplit('/').next().filter(|n| !n.is_empty() && *n != "..")?;
    let same = folder.join(name);
    if same.is_file() {
        return Some(same);
    }
    // Names from systems that do not tell case apart.
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(folder).ok()?.filter_map(Result::ok);
    entries.map(|e| e.path()).find(|p| {
        p.is_file() && p.file_name().is_some_and(|n| n.to_string_lossy().eq_ignore_ascii_case(name))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, height: u32, texel: [u8; 4]) -> AuthoredImage {
        let rgba = texel.repeat((width * height) as usize);
        AuthoredImage { name: String::new(), width, height, rgba }
    }

    #[test]
    fn channels_of_pictures_of_two_sizes_meet() {
        let images = vec![picture(1, 1, [10, 20, 30, 40]), picture(2, 3, [128, 128, 250, 255])];
        let mut gallery = Gallery { images, ..Gallery::default() };
        let channels = [Channel::Value(7), Channel::Of(0, 1), Channel::Of(1, 2), Channel::Of(0, 3)];
        let made = gallery.combine("made", channels) as usize;
        assert_eq!((gallery.images[made].width, gallery.images[made].height), (2, 3));
        assert!(gallery.images[made].rgba.chunks_exact(4).all(|t| t == [7, 20, 250, 40]));
        assert_eq!([0, 1].map(|i| gallery.is_normal_map(i)), [false, true]);
    }

    #[test]
    fn files_are_found_beside_and_never_above() {
        let folder = tempfile::tempdir().expect("a folder");
        let inner = folder.path().join("inner");
        std::fs::create_dir_all(inner.join("maps")).expect("folders");
        for file in ["secret.png", "inner/Skin.PNG", "inner/maps/a.png"] {
            std::fs::write(folder.path().join(file), b"").expect("a file");
        }
        for (written, expected) in [
            ("maps/a.png", Some("maps/a.png")),
            ("maps\\a.png", Some("maps/a.png")),
            ("C:\\work\\skin.png", Some("Skin.PNG")),
            ("/home/me/Skin.PNG", Some("Skin.PNG")),
            ("../secret.png", None),
            ("", None),
            ("..", None),
        ] {
            assert_eq!(beside(&inner, written), expected.map(|e| inner.join(e)), "{written}");
        }
    }

    #[test]
    fn claims_of_a_header_cost_no_memory() {
        let mut header = KTX2.to_vec();
        header.resize(104, 0);
        header[20..24].copy_from_slice(&60_000_u32.to_le_bytes());
        header[24..28].copy_from_slice(&60_000_u32.to_le_bytes());
        assert!(decode(&header, "").expect_err("too large").contains("60000 x 60000"));
        header[20..28].copy_from_slice(&[4, 0, 0, 0, 4, 0, 0, 0]);
        header[36] = 1;
        header[96..104].copy_from_slice(&u64::MAX.to_le_bytes());
        assert!(decode(&header, "").expect_err("a lie").contains("for 4 x 4"));
        for length in 0..header.len() {
            decode(&header[..length], "").expect_err("cut off");
        }
    }
}
