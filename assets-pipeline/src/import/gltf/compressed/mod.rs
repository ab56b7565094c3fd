//! Compressed geometry as plain buffers, before anything else reads the document.
//!
//! ```text
//! views with EXT_ or KHR_meshopt_compression --meshopt--> views of a new buffer
//! primitives with KHR_draco_mesh_compression --draco----> accessors and views of a new buffer
//! ```
//!
//! What cannot be decoded costs the head, unless the file has the same data without compression.

mod draco;
mod meshopt;

use std::path::Path;

use serde_json::{Map, Value, json};

use crate::error::ImportError;
use crate::notes::Notes;

/// Extensions of views; both have the same fields.
const MESHOPT: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];
/// Extensions that are read here.
pub(super) const READ: [&str; 3] = [MESHOPT[0], MESHOPT[1], "KHR_draco_mesh_compression"];
/// Bytes that all views and primitives may be together when they are decompressed: 128 shapes of a million points.
const MOST_BYTES: usize = 1 << 29;

/// Whether a buffer is only there for readers without the extension.
pub(super) fn is_fallback(buffer: &Value) -> bool {
    MESHOPT.iter().any(|name| buffer["extensions"][*name]["fallback"] == true)
}

/// The document while its data are made plain.
struct Expander<'a> {
    path: &'a Path,
    json: &'a mut Value,
    buffers: &'a mut Vec<Vec<u8>>,
    /// Becomes the last buffer.
    data: Vec<u8>,
}

/// Replaces compressed views and primitives by plain ones.
///
/// # Errors
/// Data that cannot be decoded and of which there is no plain copy.
pub(super) fn expand(
    json: &mut Value,
    buffers: &mut Vec<Vec<u8>>,
    path: &Path,
    notes: &mut Notes,
) -> Result<(), ImportError> {
    let mut expander = Expander { path, json, buffers, data: Vec::new() };
    expander.views(notes)?;
    expander.primitives(notes)?;
    let data = expander.data;
    if !data.is_empty()
        && let Some(list) = json["buffers"].as_array_mut()
    {
        list.push(json!({ "byteLength": data.len() }));
        buffers.push(data);
    }
    Ok(())
}

fn index(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|i| usize::try_from(i).ok())
}

impl Expander<'_> {
    fn fail(&self, at: &str, found: impl Into<String>, expected: impl Into<String>) -> ImportError {
        ImportError::content(self.path, at, found, expected)
    }

    /// Bytes of a buffer from an offset on.
    fn bytes(&self, at: &str, of: &Value) -> Result<&[u8], ImportError> {
        let whole = index(&of["buffer"]).and_then(|b| self.buffers.get(b)).map_or(&[][..], Vec::as_slice);
        let offset = index(&of["byteOffset"]).unwrap_or(0);
        let length = index(&of["byteLength"]).unwrap_or(usize::MAX);
        offset.checked_add(length).and_then(|end| whole.get(offset..end)).ok_or_else(|| {
            let found = format!("{} bytes at {offset}", of["byteLength"]);
            self.fail(at, found, format!("a place inside its buffer of {} bytes", whole.len()))
        })
    }

    /// Appends decoded bytes; returns where they are.
    fn keep(&mut self, at: &str, bytes: &[u8]) -> Result<Map<String, Value>, ImportError> {
        if self.data.len() + bytes.len() > MOST_BYTES {
            let found = format!("{} bytes more", bytes.len());
            return Err(self.fail(at, found, format!("at most {MOST_BYTES} decompressed bytes in a file")));
        }
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        let offset = self.data.len();
        self.data.extend_from_slice(bytes);
        let mut view = Map::new();
        view.insert("buffer".into(), self.buffers.len().into());
        view.insert("byteOffset".into(), offset.into());
        view.insert("byteLength".into(), bytes.len().into());
        Ok(view)
    }

    fn views(&mut self, notes: &mut Notes) -> Result<(), ImportError> {
        let count = self.json["bufferViews"].as_array().map_or(0, Vec::len);
        for v in 0..count {
            let view = &self.json["bufferViews"][v];
            let Some(name) = MESHOPT.iter().find(|name| view["extensions"].get(**name).is_some()) else {
                continue;
            };
            let at = format!("bufferView {v}, {name}");
            match self.view(&at, &view["extensions"][*name]) {
                Ok(bytes) => {
                    let mut place = self.keep(&at, &bytes)?;
                    if let Some(view) = self.json["bufferViews"][v].as_object_mut() {
                        view.append(&mut place);
                    }
                }
                Err(error) => {
                    // Without compression it may be there too.
                    let buffer = index(&view["buffer"]).map_or(&Value::Null, |b| &self.json["buffers"][b]);
                    let has_plain = !is_fallback(buffer) || buffer.get("uri").is_some();
                    if !has_plain || self.bytes(&at, view).is_err() {
                        return Err(error);
                    }
                    notes.add("compressed data that cannot be decoded are read from their plain copy", at);
                }
            }
        }
        Ok(())
    }

    fn view(&self, at: &str, extension: &Value) -> Result<Vec<u8>, ImportError> {
        let data = self.bytes(at, extension)?;
        let word = |key: &str, default: &str| extension[key].as_str().unwrap_or(default).to_owned();
        let (mode, filter) = (word("mode", ""), word("filter", "NONE"));
        let Ok(mode) = mode.parse() else {
            return Err(self.fail(at, format!("the mode {mode:?}"), "ATTRIBUTES, TRIANGLES or INDICES"));
        };
        let Ok(filter) = filter.parse() else {
            let expected = "NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL or COLOR";
            return Err(self.fail(at, format!("the filter {filter:?}"), expected));
        };
        let (Some(count), Some(stride)) = (index(&extension["count"]), index(&extension["byteStride"]))
        else {
            return Err(self.fail(at, "no count or no byteStride", "both"));
        };
        if count.checked_mul(stride).is_none_or(|bytes| bytes > MOST_BYTES) {
            let found = format!("{count} elements of {stride} bytes");
            return Err(self.fail(at, found, format!("at most {MOST_BYTES} decompressed bytes in a file")));
        }
        meshopt::decode(mode, filter, count, stride, data)
            .map_err(|(found, expected)| self.fail(at, found, expected))
    }

    fn primitives(&mut self, notes: &mut Notes) -> Result<(), ImportError> {
        let meshes = self.json["meshes"].as_array().map_or(0, Vec::len);
        for m in 0..meshes {
            let count = self.json["meshes"][m]["primitives"].as_array().map_or(0, Vec::len);
            for p in 0..count {
                let primitive = &self.json["meshes"][m]["primitives"][p];
                let Some(extension) = primitive["extensions"].get("KHR_draco_mesh_compression") else {
                    continue;
                };
                let at = format!("mesh {m}, primitive {p}, KHR_draco_mesh_compression");
                let (primitive, extension) = (primitive.clone(), extension.clone());
                match self.primitive(&at, &primitive, &extension) {
                    Ok(plain) => self.json["meshes"][m]["primitives"][p] = plain,
                    Err(error) => {
                        let position = index(&primitive["attributes"]["POSITION"]);
                        let position = position.map_or(&Value::Null, |a| &self.json["accessors"][a]);
                        if position.get("bufferView").is_none() {
                            return Err(error);
                        }
                        let message = "compressed data that cannot be decoded are read from their plain copy";
                        notes.add(message, at);
                    }
                }
            }
        }
        Ok(())
    }

    /// The primitive with accessors of its own in place of compressed ones.
    fn primitive(&mut self, at: &str, primitive: &Value, extension: &Value) -> Result<Value, ImportError> {
        let view = index(&extension["bufferView"]).map_or(&Value::Null, |v| &self.json["bufferViews"][v]);
        if view.is_null() {
            return Err(self.fail(at, "no such bufferView", "one with the compressed data"));
        }
        let data = self.bytes(at, view)?;
        let room = MOST_BYTES.saturating_sub(self.data.len());
        let mesh = draco::Mesh::decode(data, room)
            .map_err(|why| self.fail(at, why, "a triangle mesh that Draco 2.2 and before can hold"))?;
        let mut plain = primitive.clone();
        for (name, id) in extension["attributes"].as_object().into_iter().flatten() {
            let accessor = index(&primitive["attributes"][name]);
            let accessor = accessor.map_or(&Value::Null, |a| &self.json["accessors"][a]);
            let mut accessor = accessor.clone();
            let kind = index(&accessor["componentType"]).and_then(draco::Number::of_gltf);
            let components = match accessor["type"].as_str() {
                Some("SCALAR") => 1,
                Some("VEC2") => 2,
                Some("VEC3") => 3,
                Some("VEC4") => 4,
                _ => 0,
            };
            let (Some(kind), 1..) = (kind, components) else {
                return Err(self.fail(at, format!("{name} without an accessor"), "one that says its type"));
            };
            let bytes = id.as_u64().and_then(|id| mesh.attribute(u32::try_from(id).ok()?, kind, components));
            let Some((bytes, stride)) = bytes else {
                let found = format!("no attribute {id} of {components} numbers for {name}");
                return Err(self.fail(at, found, "the attributes that the extension names"));
            };
            let mut place = self.keep(at, &bytes)?;
            place.insert("byteStride".into(), stride.into());
            accessor["bufferView"] = self.push("bufferViews", Value::Object(place));
            accessor["count"] = mesh.points().into();
            if let Some(accessor) = accessor.as_object_mut() {
                accessor.remove("byteOffset");
                accessor.remove("sparse");
            }
            plain["attributes"][name] = self.push("accessors", accessor);
        }
        let indices = mesh.indices();
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let place = self.keep(at, &bytes)?;
        let view = self.push("bufferViews", Value::Object(place));
        let accessor =
            json!({ "bufferView": view, "componentType": 5125, "type": "SCALAR", "count": indices.len() });
        plain["indices"] = self.push("accessors", accessor);
        // Strips come out as triangles.
        plain["mode"] = 4.into();
        if let Some(extensions) = plain["extensions"].as_object_mut() {
            extensions.remove("KHR_draco_mesh_compression");
        }
        Ok(plain)
    }

    /// Appends to a list of the document; returns the index.
    fn push(&mut self, list: &str, value: Value) -> Value {
        match self.json[list].as_array_mut() {
            Some(list) => {
                list.push(value);
                (list.len() - 1).into()
            }
            None => {
                self.json[list] = Value::Array(vec![value]);
                0.into()
            }
        }
    }
}
