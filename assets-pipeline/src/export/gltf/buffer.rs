//! The binary chunk of a GLB and the JSON of its views and accessors.
//!
//! Plain: floats as they are. Compressed: numbers as whole multiples of a power of two, directions as octahedra, all of it
//! coded as [`super::meshopt`] says; a view then has its data in buffer 0 and its size in the fallback buffer 1, which no
//! file holds.

use glam::Vec3;
use serde_json::{Value, json};

use super::meshopt::{self, Coded};
use crate::error::ExportError;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const BYTE: u32 = 5120;
const SHORT: u32 = 5122;
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

/// How exact numbers of a compressed file are. Plain files are exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Precision {
    /// Every bit.
    Exact,
    /// Nearest multiple of two to this power.
    PowerOfTwo(i32),
}

/// Positions: 3.8 micrometres.
pub(super) const POSITION: Precision = Precision::PowerOfTwo(-18);
/// Displacements of shapes: 7.6 micrometres; a pixel of a portrait at 2160 rows is about 120.
pub(super) const DISPLACEMENT: Precision = Precision::PowerOfTwo(-17);
/// Changes of normals, at most an eighteenth of a degree off.
pub(super) const NORMAL_CHANGE: Precision = Precision::PowerOfTwo(-9);
/// Changes of colours: at most a quarter of a step of 8 bits off, as a dozen of them are added.
pub(super) const COLOR_CHANGE: Precision = Precision::PowerOfTwo(-9);
/// Colours.
pub(super) const COLOR: Precision = Precision::PowerOfTwo(-10);
/// Texture coordinates: a sixteenth of a texel of 2048.
pub(super) const TEXTURE_COORDINATE: Precision = Precision::PowerOfTwo(-15);
/// Weights of the animation, 3.8e-6 off, less than the tolerance of its curves.
pub(super) const WEIGHT: Precision = Precision::PowerOfTwo(-17);

/// Unit vectors of a compressed file: bits of an octahedron's axes.
const NORMAL_BITS: u32 = 12;
const TANGENT_BITS: u32 = 10;

/// Grows the buffer and the lists of views, accessors and images.
#[derive(Default)]
pub(super) struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    images: Vec<Value>,
    is_compressed: bool,
    /// Bytes of what is compressed once it is decoded.
    fallback_bytes: usize,
    /// The first fault of the coder.
    fault: Option<ExportError>,
}

impl Buffer {
    /// Whose numbers are quantised and coded.
    pub(super) fn compressed() -> Self {
        Self { is_compressed: true, ..Self::default() }
    }

    /// A view of coded data.
    fn coded_view(&mut self, coded: Result<Coded, ExportError>, target: Target) -> usize {
        let coded = coded.unwrap_or_else(|fault| {
            self.fault.get_or_insert(fault);
            Coded::default()
        });
        let decoded = coded.count * coded.stride;
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.fallback_bytes = self.fallback_bytes.next_multiple_of(4);
        let mut view = json!({
            "buffer": 1, "byteOffset": self.fallback_bytes, "byteLength": decoded,
            "extensions": {meshopt::NAME: {
                "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": coded.bytes.len(),
                "byteStride": coded.stride, "count": coded.count, "mode": coded.mode,
            }},
        });
        if let Some(filter) = coded.filter {
            view["extensions"][meshopt::NAME]["filter"] = json!(filter);
        }
        match target {
            Target::None => {}
            Target::Vertices => {
                view["target"] = json!(ARRAY_BUFFER);
                view["byteStride"] = json!(coded.stride);
            }
            Target::Indices => view["target"] = json!(ELEMENT_ARRAY_BUFFER),
        }
        self.fallback_bytes += decoded;
        self.bytes.extend(coded.bytes);
        self.views.push(view);
        self.views.len() - 1
    }

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
        precision: Precision,
    ) -> usize {
        let rounded;
        let (view, values) = if self.is_compressed && !values.is_empty() {
            rounded = values.iter().map(|v| v.map(|c| round(c, precision))).collect::<Vec<_>>();
            (self.coded_view(meshopt::numbers(rounded.as_flattened(), N, precision), target), &rounded[..])
        } else {
            (self.view(bytemuck::cast_slice(values.as_flattened()), target), values)
        };
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let mut accessor =
            json!({"bufferView": view, "componentType": FLOAT, "count": values.len(), "type": kind});
        if bounds {
            set_bounds(&mut accessor, values.iter().copied());
        }
        self.accessor(accessor)
    }

    /// Rows of as many numbers, one after another, as scalars.
    pub(super) fn rows(&mut self, values: &[f32], width: usize, precision: Precision) -> usize {
        if !self.is_compressed || values.is_empty() {
            return self.floats(values.as_chunks::<1>().0, Target::None, false, precision);
        }
        let rounded: Vec<f32> = values.iter().map(|v| round(*v, precision)).collect();
        // What stands below each other is alike; the coder takes at most 256 bytes together.
        let width = if width <= 64 && values.len().is_multiple_of(width.max(1)) { width } else { 1 };
        let view = self.coded_view(meshopt::numbers(&rounded, width, precision), Target::None);
        self.accessor(
            json!({"bufferView": view, "componentType": FLOAT, "count": values.len(), "type": "SCALAR"}),
        )
    }

    /// Unit normals.
    pub(super) fn normals(&mut self, values: &[[f32; 3]]) -> usize {
        if !self.is_compressed {
            return self.floats(values, Target::Vertices, false, Precision::Exact);
        }
        let wide: Vec<[f32; 4]> = values.iter().map(|[x, y, z]| [*x, *y, *z, 0.0]).collect();
        let view = self.coded_view(meshopt::directions(&wide, NORMAL_BITS), Target::Vertices);
        self.accessor(json!({
            "bufferView": view, "componentType": SHORT, "normalized": true, "count": values.len(), "type": "VEC3",
        }))
    }

    /// Unit tangents with the sign of the bitangent.
    pub(super) fn tangents(&mut self, values: &[[f32; 4]]) -> usize {
        if !self.is_compressed {
            return self.floats(values, Target::Vertices, false, Precision::Exact);
        }
        let view = self.coded_view(meshopt::directions(values, TANGENT_BITS), Target::Vertices);
        self.accessor(json!({
            "bufferView": view, "componentType": SHORT, "normalized": true, "count": values.len(), "type": "VEC4",
        }))
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
        if self.is_compressed && !values.is_empty() {
            let stride = if limit <= 65535 { 2 } else { 4 };
            let coded = match target {
                Target::Indices => meshopt::triangles(values, stride),
                Target::None | Target::Vertices => meshopt::sequence(values, stride),
            };
            return (self.coded_view(coded, target), if stride == 2 { UNSIGNED_SHORT } else { UNSIGNED_INT });
        }
        if limit <= 65535 {
            let short: Vec<u16> = values.iter().map(|v| *v as u16).collect();
            (self.view(bytemuck::cast_slice(&short), target), UNSIGNED_SHORT)
        } else {
            (self.view(bytemuck::cast_slice(values), target), UNSIGNED_INT)
        }
    }

    /// Displacements of some of `count` vertices: sparse where that is smaller. `None` when nothing moves.
    pub(super) fn displacements(
        &mut self,
        count: usize,
        moved: &[(u32, Vec3)],
        precision: Precision,
    ) -> Option<usize> {
        let kept: Vec<(u32, [f32; 3])> = if self.is_compressed {
            let rounded = moved.iter().map(|(i, d)| (*i, d.to_array().map(|c| round(c, precision))));
            rounded.filter(|(_, d)| d.iter().any(|c| *c != 0.0)).collect()
        } else {
            moved.iter().map(|(i, d)| (*i, d.to_array())).collect()
        };
        if kept.is_empty() {
            return None;
        }
        let index_size = if count <= 65535 { 2 } else { 4 };
        // A coded zero costs a fifth of a byte, a coded index one.
        let is_dense = match self.is_compressed {
            true => 5 * kept.len() >= count,
            false => kept.len() * (12 + index_size) >= count * 12,
        };
        if is_dense || kept.len() == count {
            let mut values = vec![[0.0; 3]; count];
            kept.iter().for_each(|(i, d)| values[*i as usize] = *d);
            return Some(self.floats(&values, Target::Vertices, true, precision));
        }
        let indices: Vec<u32> = kept.iter().map(|(i, _)| *i).collect();
        let values: Vec<[f32; 3]> = kept.iter().map(|(_, d)| *d).collect();
        let (index_view, component) = self.index_view(&indices, count, Target::None);
        let value_view = if self.is_compressed {
            self.coded_view(meshopt::numbers(values.as_flattened(), 3, precision), Target::None)
        } else {
            self.view(bytemuck::cast_slice(values.as_flattened()), Target::None)
        };
        let mut accessor = sparse(FLOAT, count, kept.len(), (index_view, component), value_view);
        // Vertices that do not move count as zeros.
        set_bounds(&mut accessor, values.into_iter().chain([[0.0; 3]]));
        Some(self.accessor(accessor))
    }

    /// Changes of colour of some of `count` vertices, -1 to 1: sparse where that is smaller, in steps of 1/32767 of a
    /// plain file. `None` when nothing changes.
    pub(super) fn color_changes(&mut self, count: usize, changed: &[(u32, Vec3)]) -> Option<usize> {
        if self.is_compressed {
            return self.displacements(count, changed, COLOR_CHANGE);
        }
        let step = |c: f32| (c.clamp(-1.0, 1.0) * 32767.0).round() as i16;
        let kept: Vec<(u32, [i16; 3])> =
            changed.iter().map(|(i, c)| (*i, c.to_array().map(step))).filter(|(_, c)| *c != [0; 3]).collect();
        if kept.is_empty() {
            return None;
        }
        // Elements of vertices begin at multiples of 4 bytes; those of sparse values need not.
        if kept.len() == count {
            let mut values = vec![[0_i16; 4]; count];
            kept.iter().for_each(|(i, [r, g, b])| values[*i as usize] = [*r, *g, *b, 0]);
            let view = self.view(bytemuck::cast_slice(values.as_flattened()), Target::Vertices);
            self.views[view]["byteStride"] = json!(8);
            let mut accessor = json!({
                "bufferView": view, "componentType": SHORT, "normalized": true, "count": count, "type": "VEC3",
            });
            set_bounds(&mut accessor, values.iter().map(|[r, g, b, _]| [r, g, b].map(|c| f32::from(*c))));
            return Some(self.accessor(accessor));
        }
        let indices: Vec<u32> = kept.iter().map(|(i, _)| *i).collect();
        let values: Vec<[i16; 3]> = kept.iter().map(|(_, c)| *c).collect();
        let (index_view, component) = self.index_view(&indices, count, Target::None);
        let value_view = self.view(bytemuck::cast_slice(values.as_flattened()), Target::None);
        let mut accessor = sparse(SHORT, count, kept.len(), (index_view, component), value_view);
        accessor["normalized"] = json!(true);
        set_bounds(&mut accessor, values.iter().map(|c| c.map(f32::from)).chain([[0.0; 3]]));
        Some(self.accessor(accessor))
    }

    /// Displacements that are zero everywhere: one stored zero, as readers exist that refuse accessors without data
    /// (the `gltf` crate among them), although glTF allows them.
    pub(super) fn zeros(&mut self, count: usize) -> usize {
        let index_view = self.view(&0_u32.to_le_bytes(), Target::None);
        let value_view = self.view(&[0; 12], Target::None);
        let mut accessor = sparse(FLOAT, count, 1, (index_view, UNSIGNED_INT), value_view);
        set_bounds(&mut accessor, [[0.0; 3]].into_iter());
        self.accessor(accessor)
    }

    /// Names an accessor, so that it is found again where programs renumber it.
    pub(super) fn name_accessor(&mut self, index: u32, name: String) {
        self.accessors[index as usize]["name"] = json!(name);
    }

    /// Index and name of what has one.
    pub(super) fn named_accessors(&self) -> impl Iterator<Item = (usize, &str)> {
        self.accessors.iter().enumerate().filter_map(|(i, a)| Some((i, a["name"].as_str()?)))
    }

    /// Names of all images.
    pub(super) fn image_names(&self) -> impl Iterator<Item = &str> {
        self.images.iter().filter_map(|i| i["name"].as_str())
    }

    /// An encoded image, under a name of its own.
    pub(super) fn image(&mut self, name: &str, bytes: &[u8], mime_type: &str) -> usize {
        let view = self.view(bytes, Target::None);
        let is_taken = |name: &str| self.images.iter().any(|i| i["name"] == name);
        let numbered = (2..).map(|n| format!("{name} {n}"));
        let name =
            std::iter::once(name.to_owned()).chain(numbered).find(|n| !is_taken(n)).unwrap_or_default();
        self.images.push(json!({"name": name, "bufferView": view, "mimeType": mime_type}));
        self.images.len() - 1
    }

    /// Puts the lists into the document and returns the whole GLB.
    pub(super) fn finish(mut self, mut document: Value) -> Result<Vec<u8>, ExportError> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        document["buffers"] = json!([{"byteLength": self.bytes.len()}]);
        if self.fallback_bytes > 0 {
            let fallback =
                json!({"byteLength": self.fallback_bytes, "extensions": {meshopt::NAME: {"fallback": true}}});
            if let Some(buffers) = document["buffers"].as_array_mut() {
                buffers.push(fallback);
            }
        }
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

/// Zeros but for some elements.
fn sparse(
    component: u32,
    count: usize,
    stored: usize,
    (index_view, index_component): (usize, u32),
    value_view: usize,
) -> Value {
    json!({
        "componentType": component, "count": count, "type": "VEC3",
        "sparse": {
            "count": stored,
            "indices": {"bufferView": index_view, "componentType": index_component},
            "values": {"bufferView": value_view},
        },
    })
}

/// The nearest number that a precision has.
fn round(value: f32, precision: Precision) -> f32 {
    match precision {
        Precision::Exact => value,
        Precision::PowerOfTwo(exponent) => meshopt::nearest(value, exponent),
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
