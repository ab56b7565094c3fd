//! Files that tests make for themselves.
#![allow(dead_code, unreachable_pub, missing_docs)] // each test uses a part

pub mod bumpy;

use serde_json::{Value, json};

pub fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let group = |c: &[u8]| -> String {
        let n = c.iter().fold(0_u32, |n, b| n << 8 | u32::from(*b)) << (8 * (3 - c.len()));
        (0..=c.len()).map(|k| DIGITS[(n >> (18 - 6 * k) & 63) as usize] as char).collect()
    };
    bytes.chunks(3).map(group).collect()
}

/// A document whose buffer is made piece by piece.
#[derive(Clone, Default)]
pub struct Pieces {
    pub bytes: Vec<u8>,
    pub views: Vec<Value>,
    pub accessors: Vec<Value>,
}

impl Pieces {
    pub fn view(&mut self, bytes: &[u8], stride: Option<usize>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        if let Some(stride) = stride {
            view["byteStride"] = json!(stride);
        }
        self.bytes.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    pub fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    pub fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let view = self.view(&bytes, None);
        let low = values[..width].to_vec();
        self.accessor(json!({"bufferView": view, "componentType": 5126, "count": values.len() / width,
            "type": kind, "min": low, "max": low}))
    }

    pub fn finish(self, mut document: Value) -> Value {
        document["asset"] = json!({"version": "2.0"});
        document["buffers"] = json!([{"byteLength": self.bytes.len(),
            "uri": format!("data:application/octet-stream;base64,{}", base64(&self.bytes))}]);
        document["bufferViews"] = Value::Array(self.views);
        document["accessors"] = Value::Array(self.accessors);
        document
    }
}

/// Rings and corners of [`Face`].
const RINGS: usize = 12;
const AROUND: usize = 16;

/// An ellipsoid with a texture seam, 0.22 m high: two shapes, both vertices of the seam move alike.
pub struct Face {
    pub positions: Vec<[f32; 3]>,
    pub uvs: Vec<[f32; 2]>,
    pub indices: Vec<u32>,
    /// Down below the middle.
    pub jaw: Vec<[f32; 3]>,
    /// Outwards on one side.
    pub smile: Vec<[f32; 3]>,
}

impl Face {
    pub const POINTS: usize = AROUND * (RINGS - 1) + 2;

    pub fn new() -> Self {
        let mut face = Self { positions: vec![], uvs: vec![], indices: vec![], jaw: vec![], smile: vec![] };
        for ring in 0..=RINGS {
            for k in 0..=AROUND {
                let (u, v) = (k as f32 / AROUND as f32, ring as f32 / RINGS as f32);
                // The last column is the first one, bit for bit; so are all corners of a pole.
                let turn = std::f32::consts::TAU * (k % AROUND) as f32 / AROUND as f32;
                let down = std::f32::consts::PI * v;
                let side = if ring == 0 || ring == RINGS { 0.0 } else { down.sin() };
                face.positions.push([
                    0.075 * side * turn.sin(),
                    0.11 * down.cos(),
                    0.095 * side * turn.cos(),
                ]);
                face.uvs.push([u, v]);
                face.jaw.push(if v > 0.6 { [0.0, -0.02, 0.0] } else { [0.0; 3] });
                face.smile.push(if side * turn.sin() > 0.5 { [0.01, 0.01, 0.0] } else { [0.0; 3] });
            }
        }
        let at = |ring: usize, k: usize| (ring * (AROUND + 1) + k) as u32;
        for ring in 0..RINGS {
            for k in 0..AROUND {
                let [a, b, c, d] = [at(ring, k), at(ring + 1, k), at(ring + 1, k + 1), at(ring, k + 1)];
                if ring + 1 < RINGS {
                    face.indices.extend([a, b, c]);
                }
                if ring > 0 {
                    face.indices.extend([a, c, d]);
                }
            }
        }
        face
    }
}

/// Accessors of a face in a document.
pub struct FaceAccessors {
    pub position: usize,
    pub uv: usize,
    pub indices: usize,
    pub jaw: usize,
    pub smile: usize,
}

impl FaceAccessors {
    pub fn new(face: &Face, pieces: &mut Pieces) -> Self {
        let indices: Vec<u8> = face.indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let view = pieces.view(&indices, None);
        let indices = pieces.accessor(
            json!({"bufferView": view, "componentType": 5125, "count": face.indices.len(), "type": "SCALAR"}),
        );
        Self {
            position: pieces.floats(face.positions.as_flattened(), "VEC3"),
            uv: pieces.floats(face.uvs.as_flattened(), "VEC2"),
            indices,
            jaw: pieces.floats(face.jaw.as_flattened(), "VEC3"),
            smile: pieces.floats(face.smile.as_flattened(), "VEC3"),
        }
    }

    /// A primitive with both shapes.
    pub fn primitive(&self) -> Value {
        json!({
            "attributes": {"POSITION": self.position, "TEXCOORD_0": self.uv}, "indices": self.indices,
            "targets": [{"POSITION": self.jaw}, {"POSITION": self.smile}],
        })
    }
}

/// One mesh with the shapes jawOpen and mouthSmileLeft, after a change.
pub fn face_document(change: impl FnOnce(&mut Value, &mut Pieces, &FaceAccessors)) -> Value {
    let mut pieces = Pieces::default();
    let accessors = FaceAccessors::new(&Face::new(), &mut pieces);
    let mut document = json!({
        "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "name": "Head"}],
        "meshes": [{"name": "Head", "extras": {"targetNames": ["jawOpen", "mouthSmileLeft"]},
            "primitives": [accessors.primitive()]}],
    });
    change(&mut document, &mut pieces, &accessors);
    pieces.finish(document)
}

/// An animation with one channel of weights of node 0.
pub fn animate(document: &mut Value, pieces: &mut Pieces, times: &[f32], weights: &[f32]) {
    let (input, output) = (pieces.floats(times, "SCALAR"), pieces.floats(weights, "SCALAR"));
    document["animations"] = json!([{"name": "take", "samplers": [{"input": input, "output": output}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}]);
}

/// The same document as a GLB with its buffer inside.
pub fn glb(mut document: Value) -> Vec<u8> {
    use base64::Engine;
    let uri = document["buffers"][0]["uri"].as_str().unwrap_or_default();
    let data = uri.split_once(',').map_or("", |(_, data)| data).trim_end_matches('=');
    let bin = base64::engine::general_purpose::STANDARD_NO_PAD.decode(data).expect("our own base64");
    document["buffers"] = json!([{"byteLength": bin.len()}]);
    let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
    let json = document.to_string().into_bytes().into();
    gltf::binary::Glb { header, json, bin: Some(bin.into()) }.to_vec().expect("memory")
}

/// The face as an OBJ file in centimetres: quads, v from below.
pub fn face_obj(moved: &[[f32; 3]]) -> String {
    use std::fmt::Write;
    let face = Face::new();
    let mut text = String::new();
    // Points without the copies of the seam and the poles.
    let number = |ring: usize, k: usize| match ring {
        0 => 1,
        RINGS => Face::POINTS,
        _ => 2 + (ring - 1) * AROUND + k % AROUND,
    };
    let mut written = 0;
    for ring in 0..=RINGS {
        for k in 0..AROUND {
            if number(ring, k) == written + 1 {
                let i = ring * (AROUND + 1) + k;
                let offset = moved.get(i).copied().unwrap_or_default();
                let [x, y, z] = [0, 1, 2].map(|c| 100.0 * (face.positions[i][c] + offset[c]));
                writeln!(text, "v {x:.5} {y:.5} {z:.5}").expect("memory");
                written += 1;
            }
        }
    }
    for [u, v] in &face.uvs {
        writeln!(text, "vt {u:.5} {:.5}", 1.0 - v).expect("memory");
    }
    text.push_str("usemtl skin\n");
    for ring in 0..RINGS {
        for k in 0..AROUND {
            let corners = [(ring, k), (ring + 1, k), (ring + 1, k + 1), (ring, k + 1)];
            let mut words: Vec<String> = Vec::new();
            for (r, c) in corners {
                let point = number(r, c);
                if words.iter().all(|w| !w.starts_with(&format!("{point}/"))) {
                    words.push(format!("{point}/{}", r * (AROUND + 1) + c + 1));
                }
            }
            writeln!(text, "f {}", words.join(" ")).expect("memory");
        }
    }
    text
}

/// A folder that is removed when dropped.
pub struct Folder(pub std::path::PathBuf);

impl Folder {
    pub fn new(name: &str, files: &[(&str, &[u8])]) -> Self {
        let path = std::env::temp_dir().join(format!("rubor-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).expect("a temporary folder");
        for (file, bytes) in files {
            std::fs::write(path.join(file), bytes).expect("a file");
        }
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
