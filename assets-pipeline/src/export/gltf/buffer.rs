//! The binary chunk of a GLB and the JSON of its views and accessors.

use glam::Vec3;
use serde_json::{Value, json};

use crate::error::ExportError;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const BYTE: u32 = 5120;
const UNSIGNED_SHORT: u32 = 5123;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Purpose of a view, where glTF requires one.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    None,
    Vertices,
    Indices,
}

/// Grows the buffer and the lists of views, accessors and images.
#[derive(Default)]
pub(super) struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    images: Vec<Value>,
}

impl Buffer {
    fn view(&mut self, bytes: &[u8], target: Target) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        match target {
            Target::None => {}
            Target::Vertices => view["target"] = json!(ARRAY_BUFFER),
            Target::Indices => view["target"] = json!(ELEMENT_ARRAY_BUFFER),
        }
        self.bytes.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Floats of `N` components; `bounds` adds min and max, which positions and animation times must have.
    pub(super) fn floats<const N: usize>(
        &mut self,
        values: &[[f32; N]],
        target: Target,
        bounds: bool,
    ) -> usize {
        let view = self.view(bytemuck::cast_slice(values.as_flattened()), target);
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let mut accessor =
            json!({"bufferView": view, "componentType": FLOAT, "count": values.len(), "type": kind});
        if bounds {
            set_bounds(&mut accessor, values.iter().copied());
        }
        self.accessor(accessor)
    }

    /// Unsigned integers, 16 bits wide where `limit` (one more than the largest) allows.
    /// 65535 itself is kept free: it is the primitive restart value.
    pub(super) fn indices(&mut self, values: &[u32], limit: usize, target: Target) -> usize {
        let (view, component) = self.index_view(values, limit, target);
        self.accessor(
            json!({"bufferView": view, "componentType": component, "count": values.len(), "type": "SCALAR"}),
        )
    }

    /// Values from 0 to 1 as normalized 16-bit integers.
    pub(super) fn normalized(&mut self, values: &[f32]) -> usize {
        let texels: Vec<u16> = values.iter().map(|v| (v.clamp(0.0, 1.0) * 65535.0).round() as u16).collect();
        let view = self.view(bytemuck::cast_slice(&texels), Target::None);
        self.accessor(json!({
            "bufferView": view, "componentType": UNSIGNED_SHORT, "normalized": true,
            "count": values.len(), "type": "SCALAR",
        }))
    }

    /// Pairs from -1 to 1 as normalized 8-bit integers.
    pub(super) fn normalized_bytes(&mut self, values: &[[f32; 2]]) -> usize {
        let steps: Vec<[i8; 2]> =
            values.iter().map(|v| v.map(|v| (v.clamp(-1.0, 1.0) * 127.0).round() as i8)).collect();
        let view = self.view(bytemuck::cast_slice(&steps), Target::None);
        self.accessor(json!({
            "bufferView": view, "componentType": BYTE, "normalized": true, "count": values.len(), "type": "VEC2",
        }))
    }

    fn index_view(&mut self, values: &[u32], limit: usize, target: Target) -> (usize, u32) {
        if limit <= 65535 {
            let short: Vec<u16> = values.iter().map(|v| *v as u16).collect();
            (self.view(bytemuck::cast_slice(&short), target), UNSIGNED_SHORT)
        } else {
            (self.view(bytemuck::cast_slice(values), target), UNSIGNED_INT)
        }
    }

    /// Displacements of some of `count` vertices: sparse where that is smaller. `None` when nothing moves.
    pub(super) fn displacements(&mut self, count: usize, moved: &[(u32, Vec3)]) -> Option<usize> {
        if moved.is_empty() {
            return None;
        }
        let index_size = if count <= 65535 { 2 } else { 4 };
        let all = moved.len() == count;
        if all || moved.len() * (12 + index_size) >= count * 12 {
            let mut values = vec![[0.0; 3]; count];
            moved.iter().for_each(|(i, d)| values[*i as usize] = d.to_array());
            return Some(self.floats(&values, Target::Vertices, true));
        }
        let indices: Vec<u32> = moved.iter().map(|(i, _)| *i).collect();
        let values: Vec<[f32; 3]> = moved.iter().map(|(_, d)| d.to_array()).collect();
        let (index_view, component) = self.index_view(&indices, count, Target::None);
        let value_view = self.view(bytemuck::cast_slice(values.as_flattened()), Target::None);
        let mut accessor = json!({
            "componentType": FLOAT, "count": count, "type": "VEC3",
            "sparse": {
                "count": moved.len(),
                "indices": {"bufferView": index_view, "componentType": component},
                "values": {"bufferView": value_view},
            },
        });
        // Vertices that do not move count as zeros.
        set_bounds(&mut accessor, values.into_iter().chain([[0.0; 3]]));
        Some(self.accessor(accessor))
    }

    /// Displacements that are zero everywhere: one stored zero, as readers exist that refuse accessors without data
    /// (the `gltf` crate among them), although glTF allows them.
    pub(super) fn zeros(&mut self, count: usize) -> usize {
        let index_view = self.view(&0_u32.to_le_bytes(), Target::None);
        let value_view = self.view(&[0; 12], Target::None);
        self.accessor(json!({
            "componentType": FLOAT, "count": count, "type": "VEC3", "min": [0.0, 0.0, 0.0], "max": [0.0, 0.0, 0.0],
            "sparse": {
                "count": 1,
                "indices": {"bufferView": index_view, "componentType": UNSIGNED_INT},
                "values": {"bufferView": value_view},
            },
        }))
    }

    /// An encoded image.
    pub(super) fn image(&mut self, name: &str, bytes: &[u8], mime_type: &str) -> usize {
        let view = self.view(bytes, Target::None);
        self.images.push(json!({"name": name, "bufferView": view, "mimeType": mime_type}));
        self.images.len() - 1
    }

    /// Puts the lists into the document and returns the whole GLB.
    pub(super) fn finish(mut self, mut document: Value) -> Result<Vec<u8>, ExportError> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        document["buffers"] = json!([{"byteLength": self.bytes.len()}]);
        document["bufferViews"] = Value::Array(self.views);
        document["accessors"] = Value::Array(self.accessors);
        if !self.images.is_empty() {
            document["images"] = Value::Array(self.images);
        }
        let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
        let json = document.to_string().into_bytes().into();
        let glb = gltf::binary::Glb { header, json, bin: Some(self.bytes.into()) };
        glb.to_vec().map_err(|e| ExportError::Encode { what: "GLB".into(), reason: e.to_string() })
    }
}

fn set_bounds<const N: usize>(accessor: &mut Value, values: impl Iterator<Item = [f32; N]>) {
    let mut low = [f32::INFINITY; N];
    let mut high = [f32::NEG_INFINITY; N];
    for v in values {
        for k in 0..N {
            low[k] = low[k].min(v[k]);
            high[k] = high[k].max(v[k]);
        }
    }
    accessor["min"] = json!(low.as_slice());
    accessor["max"] = json!(high.as_slice());
}
