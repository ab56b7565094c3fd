//! A parsed document with its buffers in memory.
//!
//! The `gltf` crate reads meshes, nodes and skins; its checks run first, because its accessors panic on bad data. What
//! it refuses though a face can be read without is taken out before: animations (read from the JSON, see `channels`),
//! cameras, attributes of unknown names.

use std::borrow::Cow;
use std::cell::Cell;
use std::fs;
use std::path::{Component, Path, PathBuf};

use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf_json::validation::{Checked, Error, Validate};
use rubor_rig::limits::{self, Excess, Limits};
use serde_json::Value;

use super::compressed;
use crate::error::ImportError;
use crate::facial_appearance::NAME;
use crate::notes::Notes;

/// Data URIs with or without padding.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// Extensions that do not change the data read here, or change only how a number is stored.
const UNDERSTOOD: [&str; 7] = [
    NAME,
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_texture_basisu",
    "KHR_lights_punctual",
    "KHR_animation_pointer",
    "EXT_texture_webp",
];
/// The same for all extensions of these families: materials, VRM's avatars, metadata.
const UNDERSTOOD_FAMILIES: [&str; 4] = ["KHR_materials_", "VRM", "KHR_xmp", "ADOBE_materials_"];

/// Document, buffers, and the path for messages.
pub(super) struct Document {
    pub(super) gltf: gltf::Document,
    /// The document as it is in the file: names of targets and animations are read from here.
    pub(super) raw: Value,
    pub(super) buffers: Vec<Vec<u8>>,
    pub(super) path: PathBuf,
    budget: Budget,
}

/// What may still be read. A buffer may be named by many accessors, a mesh by many nodes, an image by many maps, and an
/// accessor without data claims any count: sums count, not files.
struct Budget {
    numbers: Cell<u64>,
    vertices: Cell<u64>,
    keys: Cell<u64>,
    map_values: Cell<u64>,
    picture_texels: Cell<u64>,
}

/// What is counted against [`Limits`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Share {
    /// Numbers of accessors.
    Numbers,
    /// Vertices of all meshes that nodes show.
    Vertices,
    /// Keys of the animation, as the reader samples them.
    Keys,
    /// Values of maps of a head's own.
    MapValues,
    /// Texels of pictures of materials.
    PictureTexels,
}

impl Budget {
    fn new(limits: Limits) -> Self {
        Self {
            numbers: Cell::new(limits.numbers()),
            vertices: Cell::new(limits.vertices()),
            keys: Cell::new(limits.keys()),
            map_values: Cell::new(limits.map_values()),
            picture_texels: Cell::new(limits.picture_texels()),
        }
    }

    fn take(&self, share: Share, count: u64) -> Result<(), Excess> {
        let limits = Limits::of_process();
        let (left, what, most) = match share {
            Share::Numbers => (&self.numbers, "numbers in accessors", limits.numbers()),
            Share::Vertices => (&self.vertices, "vertices", limits.vertices()),
            Share::Keys => (&self.keys, "keys", limits.keys()),
            Share::MapValues => (&self.map_values, "values in maps", limits.map_values()),
            Share::PictureTexels => (&self.picture_texels, "texels in pictures", limits.picture_texels()),
        };
        match left.get().checked_sub(count) {
            Some(rest) => left.set(rest),
            None => limits::within(what, (most - left.get()).saturating_add(count), most)?,
        }
        Ok(())
    }
}

impl Document {
    pub(super) fn load(bytes: &[u8], path: &Path, notes: &mut Notes) -> Result<Self, ImportError> {
        let (text, mut blob) = chunks(bytes, path)?;
        // The tree, its copy for the `gltf` crate, and what that makes of it.
        limits::check_values(&text, 3)
            .map_err(|(found, expected)| ImportError::content(path, "document", found, expected))?;
        let mut bytes_left = Limits::of_process().file_bytes();
        let invalid = |e: serde_json::Error| {
            ImportError::content(path, "document", e.to_string(), "a valid glTF 2.0 document")
        };
        let raw: Value = serde_json::from_slice(&text).map_err(invalid)?;
        let mut buffers = Vec::new();
        for (i, buffer) in raw["buffers"].as_array().into_iter().flatten().enumerate() {
            let at = format!("buffer {i}");
            let is_fallback = compressed::is_fallback(buffer);
            let data = match buffer["uri"].as_str() {
                Some(uri) if is_fallback => resolve(path, &at, uri, bytes_left).unwrap_or_default(),
                Some(uri) => resolve(path, &at, uri, bytes_left)?,
                None if is_fallback => Vec::new(),
                None => blob
                    .take()
                    .ok_or_else(|| ImportError::content(path, &at, "no binary chunk", "a binary chunk"))?,
            };
            bytes_left = bytes_left.saturating_sub(data.len() as u64);
            let stated = buffer["byteLength"].as_u64().unwrap_or(0);
            if (data.len() as u64) < stated && !is_fallback {
                let found = format!("{} bytes", data.len());
                return Err(ImportError::content(path, at, found, format!("{stated} bytes")));
            }
            buffers.push(data);
        }
        let mut plain = readable(&raw, notes);
        check_required(&raw, path)?;
        compressed::expand(&mut plain, &mut buffers, path, notes)?;
        let mut json: gltf_json::Root = serde_json::from_value(plain).map_err(invalid)?;
        json.extensions_required.clear();
        for name in json.extensions_used.iter().filter(|n| !is_understood(n)) {
            notes.add("extensions that the file uses are not read", name);
        }
        check_positions(&json, path)?;
        check_indices(&json, path, notes)?;
        let gltf = gltf::Document::from_json_without_validation(json);
        let budget = Budget::new(Limits::of_process());
        Ok(Self { gltf, raw, buffers, path: path.to_owned(), budget })
    }

    /// Takes from what a head may hold.
    pub(super) fn take(&self, at: &str, share: Share, count: usize) -> Result<(), ImportError> {
        self.try_take(share, count as u64).map_err(|(found, expected)| self.fail(at, found, expected))
    }

    /// As [`Document::take`], where a fault does not cost the head.
    pub(super) fn try_take(&self, share: Share, count: u64) -> Result<(), Excess> {
        self.budget.take(share, count)
    }

    pub(super) fn fail(
        &self,
        at: &str,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> ImportError {
        ImportError::content(&self.path, at, found, expected)
    }

    /// Bytes of a view.
    pub(super) fn view(&self, at: &str, view: &gltf::buffer::View<'_>) -> Result<&[u8], ImportError> {
        let buffer = self.buffers.get(view.buffer().index()).map_or(&[][..], Vec::as_slice);
        view.offset().checked_add(view.length()).and_then(|end| buffer.get(view.offset()..end)).ok_or_else(
            || {
                let found = format!("view {} of {} bytes at {}", view.index(), view.length(), view.offset());
                self.fail(at, found, format!("a place inside its buffer of {} bytes", buffer.len()))
            },
        )
    }

    /// Encoded bytes of an image.
    pub(super) fn image(&self, index: u32) -> Result<Cow<'_, [u8]>, ImportError> {
        let at = format!("image {index}");
        // The typed reader of the `gltf` crate panics on an image with a view and no type.
        let images = &self.gltf.as_json().images;
        let Some(image) = images.get(index as usize) else {
            return Err(self.fail(&at, "no such image", format!("one of {}", images.len())));
        };
        match (&image.buffer_view, &image.uri) {
            (Some(view), _) => match self.gltf.views().nth(view.value()) {
                Some(view) => self.view(&at, &view).map(Cow::Borrowed),
                None => Err(self.fail(&at, format!("view {}", view.value()), "an existing view")),
            },
            (None, Some(uri)) => {
                resolve(&self.path, &at, uri, Limits::of_process().file_bytes()).map(Cow::Owned)
            }
            (None, None) => Err(self.fail(&at, "neither view nor URI", "one of them")),
        }
    }
}

/// Bytes behind a URI: data, or a file in the folder of the document or below, of at most this length.
fn resolve(path: &Path, at: &str, uri: &str, most: u64) -> Result<Vec<u8>, ImportError> {
    let fail = |found: String, expected: &str| Err(ImportError::content(path, at, found, expected));
    if let Some(data) = uri.strip_prefix("data:") {
        let Some((_, encoded)) = data.split_once(";base64,") else {
            return fail("a data URI that is not base64".into(), "base64 data");
        };
        return BASE64.decode(encoded).or_else(|e| fail(format!("broken base64 ({e})"), "base64 data"));
    }
    let decoded = percent_encoding::percent_decode_str(uri).decode_utf8().ok();
    let relative = decoded.as_deref().filter(|p| {
        !uri.contains(':')
            && !p.contains('\\')
            && Path::new(p).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir))
    });
    let Some(relative) = relative else {
        return fail(format!("URI {uri:?}"), "a file in the folder of the document or below");
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let file = folder.join(relative);
    // A link may lead out of the folder: compare its target.
    let real = fs::canonicalize(&file).map_err(ImportError::read(&file))?;
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let real_folder = fs::canonicalize(folder).map_err(ImportError::read(folder))?;
    if !real.starts_with(real_folder) {
        return fail(format!("URI {uri:?}"), "a file in the folder of the document or below");
    }
    limits::read_at_most(&real, most).map_err(ImportError::read(&file))
}

/// JSON, and the binary chunk if there is one.
type Chunks<'a> = (Cow<'a, [u8]>, Option<Vec<u8>>);

/// The JSON and the binary chunk of a GLB; a file without its header is JSON alone.
fn chunks<'a>(bytes: &'a [u8], path: &Path) -> Result<Chunks<'a>, ImportError> {
    if !bytes.starts_with(b"glTF") {
        return Ok((Cow::Borrowed(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)), None));
    }
    // `gltf::binary` subtracts the length of the header without a check.
    let stated = bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    match stated {
        Some(length) if length as usize <= bytes.len() && length >= 20 => {}
        _ => {
            let expected =
                stated.map_or("a header of 12 bytes".into(), |l| format!("{l} bytes as its header states"));
            return Err(ImportError::content(path, "GLB header", format!("{} bytes", bytes.len()), expected));
        }
    }
    let glb = gltf::binary::Glb::from_slice(bytes)
        .map_err(|e| ImportError::content(path, "GLB", e.to_string(), "a GLB file of version 2"))?;
    if glb.header.version != 2 {
        let found = format!("version {}", glb.header.version);
        return Err(ImportError::content(path, "GLB header", found, "version 2"));
    }
    // Some writers fill up the chunk with zeros in place of spaces.
    let json = match glb.json {
        Cow::Borrowed(json) => Cow::Borrowed(json.trim_ascii_end().strip_suffix(b"\0").map_or(json, |_| {
            let end = json.iter().rposition(|b| *b != 0 && !b.is_ascii_whitespace()).map_or(0, |i| i + 1);
            &json[..end]
        })),
        owned => owned,
    };
    Ok((json, glb.bin.map(Cow::into_owned)))
}

/// The document without what the `gltf` crate refuses and no face needs.
fn readable(raw: &Value, notes: &mut Notes) -> Value {
    let mut json = raw.clone();
    if let Some(root) = json.as_object_mut() {
        root.remove("animations");
        root.remove("cameras");
    }
    for node in json.get_mut("nodes").and_then(Value::as_array_mut).into_iter().flatten() {
        node.as_object_mut().map(|node| node.remove("camera"));
    }
    for (m, mesh) in json.get_mut("meshes").and_then(Value::as_array_mut).into_iter().flatten().enumerate() {
        let primitives = mesh.get_mut("primitives").and_then(Value::as_array_mut);
        for (p, primitive) in primitives.into_iter().flatten().enumerate() {
            let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut) else {
                continue;
            };
            attributes.retain(|name, _| {
                let known = is_attribute(name);
                if !known {
                    let message = "attributes that glTF 2.0 does not know are left out";
                    notes.add(message, format!("{name:?} of mesh {m}, primitive {p}"));
                }
                known
            });
        }
    }
    json
}

fn is_attribute(name: &str) -> bool {
    let numbered = |prefix: &str| name.strip_prefix(prefix).is_some_and(|n| n.parse::<u32>().is_ok());
    matches!(name, "POSITION" | "NORMAL" | "TANGENT")
        || name.starts_with('_')
        || ["TEXCOORD_", "COLOR_", "JOINTS_", "WEIGHTS_"].into_iter().any(numbered)
}

fn is_understood(extension: &str) -> bool {
    UNDERSTOOD.contains(&extension)
        || compressed::READ.contains(&extension)
        || UNDERSTOOD_FAMILIES.iter().any(|family| extension.starts_with(family))
}

/// What a file requires must be understood.
fn check_required(raw: &Value, path: &Path) -> Result<(), ImportError> {
    for (i, name) in raw["extensionsRequired"].as_array().into_iter().flatten().enumerate() {
        let name = name.as_str().unwrap_or_default();
        if !is_understood(name) {
            let found = format!("the required extension {name:?}");
            let expected = "an extension that rubor understands: export the file without it";
            return Err(ImportError::content(path, format!("extensionsRequired {i}"), found, expected));
        }
    }
    Ok(())
}

/// Lists in which a fault never costs the head: `materials` reads them from the JSON and says what it leaves out, own maps
/// come from images, which are checked where they are read.
const UNREAD: [&str; 4] = ["materials", "textures", "samplers", "images"];

/// The checks of the `gltf` crate, without which it panics. Two faults are none here: accessors without data are zeros in
/// glTF 2.0; bounds of positions are not used.
fn check_indices(json: &gltf_json::Root, path: &Path, notes: &mut Notes) -> Result<(), ImportError> {
    let mut fault: Option<(String, Error)> = None;
    json.validate(json, gltf_json::Path::new, &mut |place, error| {
        let place = place().to_string();
        let zeros =
            error == Error::Missing && place.starts_with("accessors") && place.ends_with("bufferView");
        let bounds = place.ends_with(".min") || place.ends_with(".max");
        if UNREAD.iter().any(|list| place.starts_with(list)) {
            notes.add("faults of materials, textures and images are passed over", place);
        } else if !zeros && !bounds && fault.is_none() {
            fault = Some((place, error));
        }
    });
    match fault {
        None => Ok(()),
        Some((place, error)) => {
            let (found, expected) = match error {
                Error::IndexOutOfBounds => ("an index of something that is not there", "an existing one"),
                Error::Missing => ("nothing", "a value, which glTF 2.0 requires"),
                Error::Oversize => ("a size beyond this machine's", "a smaller one"),
                _ => ("a value that glTF 2.0 does not allow", "a valid one"),
            };
            Err(ImportError::content(path, place, found, expected))
        }
    }
}

/// The validation of the `gltf` crate panics where POSITION names an accessor that does not exist.
fn check_positions(json: &gltf_json::Root, path: &Path) -> Result<(), ImportError> {
    let position = Checked::Valid(gltf_json::mesh::Semantic::Positions);
    for (m, mesh) in json.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            match primitive.attributes.get(&position) {
                Some(accessor) if accessor.value() >= json.accessors.len() => {
                    let at = format!("mesh {m}, primitive {p}, POSITION");
                    let expected = format!("one of {}", json.accessors.len());
                    return Err(ImportError::content(
                        path,
                        at,
                        format!("accessor {}", accessor.value()),
                        expected,
                    ));
                }
                _ => {}
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_follows_its_standard() {
        for (text, bytes) in [("Zm9vYmE=", Some(&b"fooba"[..])), ("Zm9vYg==", Some(b"foob")), ("Zm9v!", None)]
        {
            assert_eq!(BASE64.decode(text).ok().as_deref(), bytes, "{text}");
            assert_eq!(BASE64.decode(text.trim_end_matches('=')).ok().as_deref(), bytes, "{text}");
        }
    }
}
