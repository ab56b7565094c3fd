//! A parsed document with its buffers in memory.

use std::borrow::Cow;
use std::fs;
use std::path::{Component, Path, PathBuf};

use gltf_json::validation::{Checked, Error, Validate};

use crate::error::ImportError;
use crate::facial_appearance::NAME;

/// Extensions that change nothing about what is read here, or only how a number is stored.
const UNDERSTOOD: [&str; 8] = [
    NAME,
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_texture_basisu",
    "KHR_lights_punctual",
    "KHR_animation_pointer",
    "EXT_texture_webp",
    "MSFT_texture_dds",
];
/// The same for all extensions of these families: materials, VRM's avatars, metadata.
const UNDERSTOOD_FAMILIES: [&str; 4] = ["KHR_materials_", "VRM", "KHR_xmp", "ADOBE_materials_"];

/// Document, buffers, and the path for messages.
pub(super) struct Document {
    pub(super) gltf: gltf::Document,
    pub(super) buffers: Vec<Vec<u8>>,
    pub(super) path: PathBuf,
}

impl Document {
    pub(super) fn load(bytes: &[u8], path: &Path) -> Result<Self, ImportError> {
        check_glb_length(bytes, path)?;
        let invalid = |e: gltf::Error| {
            ImportError::content(path, "document", e.to_string(), "a valid glTF 2.0 document")
        };
        let parsed = gltf::Gltf::from_slice_without_validation(bytes).map_err(invalid)?;
        let mut json = parsed.document.into_json();
        check_extensions(&json, path)?;
        json.extensions_required.clear();
        check_positions(&json, path)?;
        check_indices(&json, path)?;
        let validated = gltf::Document::from_json_without_validation(json);
        let mut document = Self { gltf: validated, buffers: Vec::new(), path: path.to_owned() };
        let mut blob = parsed.blob;
        let mut buffers = Vec::new();
        for buffer in document.gltf.buffers() {
            let at = format!("buffer {}", buffer.index());
            let data = match buffer.source() {
                gltf::buffer::Source::Bin => {
                    blob.take().ok_or_else(|| document.fail(&at, "no binary chunk", "a binary chunk"))?
                }
                gltf::buffer::Source::Uri(uri) => document.resolve(&at, uri)?,
            };
            if data.len() < buffer.length() {
                let found = format!("{} bytes", data.len());
                return Err(document.fail(&at, found, format!("{} bytes", buffer.length())));
            }
            buffers.push(data);
        }
        document.buffers = buffers;
        Ok(document)
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
            (None, Some(uri)) => self.resolve(&at, uri).map(Cow::Owned),
            (None, None) => Err(self.fail(&at, "neither view nor URI", "one of them")),
        }
    }

    /// Bytes behind a URI: data, or a file in the document's folder or below.
    fn resolve(&self, at: &str, uri: &str) -> Result<Vec<u8>, ImportError> {
        if let Some(data) = uri.strip_prefix("data:") {
            let Some((_, encoded)) = data.split_once(";base64,") else {
                return Err(self.fail(at, "a data URI that is not base64", "base64 data"));
            };
            return base64(encoded).ok_or_else(|| self.fail(at, "broken base64", "base64 data"));
        }
        let relative = percent_decoded(uri).filter(|p| {
            !uri.contains(':')
                && !p.contains('\\')
                && Path::new(p).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir))
        });
        let Some(relative) = relative else {
            return Err(self.fail(
                at,
                format!("URI {uri:?}"),
                "a file in the folder of the document or below",
            ));
        };
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let file = folder.join(relative);
        // A link may lead out of the folder: compare what it leads to.
        let real = fs::canonicalize(&file).map_err(ImportError::read(&file))?;
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let real_folder = fs::canonicalize(folder).map_err(ImportError::read(folder))?;
        if !real.starts_with(real_folder) {
            return Err(self.fail(
                at,
                format!("URI {uri:?}"),
                "a file in the folder of the document or below",
            ));
        }
        fs::read(&real).map_err(ImportError::read(&file))
    }
}

/// The header of a GLB states its length: a shorter file was cut off.
fn check_glb_length(bytes: &[u8], path: &Path) -> Result<(), ImportError> {
    if !bytes.starts_with(b"glTF") {
        return Ok(());
    }
    let stated = bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    match stated {
        Some(length) if length as usize <= bytes.len() && length >= 20 => Ok(()),
        _ => {
            let expected =
                stated.map_or("a header of 12 bytes".into(), |l| format!("{l} bytes as its header states"));
            Err(ImportError::content(path, "GLB header", format!("{} bytes", bytes.len()), expected))
        }
    }
}

/// What a file requires must be understood; compressed geometry is refused in words.
fn check_extensions(json: &gltf_json::Root, path: &Path) -> Result<(), ImportError> {
    for (i, name) in json.extensions_required.iter().enumerate() {
        let known = UNDERSTOOD.contains(&name.as_str())
            || UNDERSTOOD_FAMILIES.iter().any(|family| name.starts_with(family));
        if known {
            continue;
        }
        let expected = match name.as_str() {
            "KHR_draco_mesh_compression" => {
                "geometry without Draco compression: export it so, or decompress it with `gltf-transform copy`"
            }
            "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
                "buffers without meshopt compression: export them so, or decompress them with `gltf-transform copy`"
            }
            _ => "an extension that rubor understands",
        };
        let found = format!("the required extension {name:?}");
        return Err(ImportError::content(path, format!("extensionsRequired {i}"), found, expected));
    }
    Ok(())
}

/// The checks of the `gltf` crate, without which it panics, but for one: accessors without data are zeros in glTF 2.0,
/// the crate refuses them.
fn check_indices(json: &gltf_json::Root, path: &Path) -> Result<(), ImportError> {
    let mut fault: Option<(String, Error)> = None;
    json.validate(json, gltf_json::Path::new, &mut |place, error| {
        let place = place().to_string();
        let zeros =
            error == Error::Missing && place.starts_with("accessors") && place.ends_with("bufferView");
        if !zeros && fault.is_none() {
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

fn percent_decoded(uri: &str) -> Option<String> {
    let mut out = Vec::with_capacity(uri.len());
    let mut bytes = uri.bytes();
    while let Some(b) = bytes.next() {
        if b == b'%' {
            let digits = [bytes.next()?, bytes.next()?];
            out.push(u8::from_str_radix(std::str::from_utf8(&digits).ok()?, 16).ok()?);
        } else {
            out.push(b);
        }
    }
    String::from_utf8(out).ok()
}

/// RFC 4648, padding optional.
fn base64(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0_u32, 0);
    for b in text.trim_end_matches('=').bytes() {
        let value = match b {
            b'A'..=b'Z' => b - b'A',
            b'a'..=b'z' => b - b'a' + 26,
            b'0'..=b'9' => b - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            out.push((bits >> count) as u8);
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_and_percent_follow_their_standards() {
        assert_eq!(base64("Zm9vYmE=").as_deref(), Some(&b"fooba"[..]));
        assert_eq!(base64("Zm9vYg==").as_deref(), Some(&b"foob"[..]));
        assert_eq!(base64("Zm9v!"), None);
        assert_eq!(percent_decoded("a%20b").as_deref(), Some("a b"));
        assert_eq!(percent_decoded("a%2"), None);
    }
}
