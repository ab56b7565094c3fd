//! A head as one `.glb` that any glTF 2.0 viewer opens, with what other viewers cannot show in
//! [`crate::facial_appearance`].
//!
//! ```text
//! Head --> one mesh, one primitive a part: POSITION NORMAL TANGENT TEXCOORD_0, sparse morph targets
//!      --> materials for other viewers: baked base colour, normal map, eyes, teeth, lashes
//!      --> RUBOR_facial_appearance: points, occlusion, landmarks, maps, provenance, rig
//! frames --> one animation: weights, rotation and translation of the node
//! ```
//!
//! Geometry is stored bit for bit; maps are quantised as [`MapEncodings`] says.

mod buffer;
mod maps;
mod materials;

use std::collections::HashMap;
use std::path::Path;

use glam::{Quat, Vec3};
use rubor_rig::deform::{deform_points, point_normals, vertex_tangents};
use rubor_rig::head::{BlendShape, Head};
use serde_json::{Value, json};

use self::buffer::{Buffer, Target};
pub use self::maps::MapEncodings;
pub use super::image_codec::MapEncoding;
use crate::error::ExportError;
use crate::facial_appearance::{FacialAppearance, NAME, PartEntry, VERSION};

/// What goes into the file beside the head.
#[derive(Clone, Debug)]
pub struct Options {
    /// Base colour of the skin (sRGB), baked by the caller from the neutral chromophores; stored as JPEG.
    pub base_color: Option<image::RgbImage>,
    /// Side of the normal map for other viewers, made from the slopes; 0 leaves it out.
    pub normal_map_size: u32,
    /// Morph targets carry normals too: other viewers light deformed faces better, the file grows by about half.
    pub morph_normals: bool,
    /// How maps are stored.
    pub maps: MapEncodings,
    /// The rig file, carried along.
    pub rig: Option<Value>,
    /// Frames of an animation; none if empty. Times in seconds, strictly increasing.
    pub frames: Vec<Frame>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            base_color: None,
            normal_map_size: 1024,
            morph_normals: true,
            maps: MapEncodings::default(),
            rig: None,
            frames: Vec::new(),
        }
    }
}

/// One moment of an animation.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Seconds.
    pub time_s: f32,
    /// Weight of each shape of the head.
    pub weights: Vec<f32>,
    /// Rotation of the head about the origin.
    pub rotation: Quat,
    /// Translation after the rotation, metres.
    pub translation: Vec3,
}

/// Writes the file: to a temporary name, then renamed.
///
/// # Errors
/// An invalid head, frames that do not fit it, images that cannot be encoded, a file that cannot be written.
pub fn write(head: &Head, options: &Options, path: &Path) -> Result<(), ExportError> {
    super::write_whole(path, &to_bytes(head, options)?)
}

/// The bytes of the `.glb`.
///
/// # Errors
/// As [`write()`], without the file.
pub fn to_bytes(head: &Head, options: &Options) -> Result<Vec<u8>, ExportError> {
    head.validate()?;
    if head.mesh.triangles.is_empty() {
        return Err(ExportError::Content {
            at: format!("head {:?}", head.name),
            found: "no triangles".into(),
            expected: "a mesh".into(),
        });
    }
    check_frames(head, &options.frames)?;
    let mut buffer = Buffer::default();
    let (primitives, parts) = primitives(head, options.morph_normals, &mut buffer);
    let materials = materials::write(head, options, &mut buffer)?;
    let maps = maps::write(&head.maps, &options.maps, &mut buffer)?;
    let occlusion = (!head.mesh.occlusion.is_empty()).then(|| buffer.normalized(&head.mesh.occlusion) as u32);

    let extension = FacialAppearance {
        version: VERSION,
        name: head.name.clone(),
        mesh: 0,
        point_count: head.mesh.points.len() as u32,
        parts,
        occlusion,
        landmarks: head.landmarks.iter().map(|(name, p)| (name.clone(), p.to_array())).collect(),
        maps,
        provenance: head.provenance.clone(),
        rig: options.rig.clone(),
    };
    let names: Vec<&str> = head.shapes.iter().map(|s| s.name.as_str()).collect();
    let mut mesh = json!({"name": head.name, "primitives": primitives});
    if !names.is_empty() {
        mesh["extras"] = json!({"targetNames": names});
        mesh["weights"] = json!(vec![0.0; names.len()]);
    }
    let mut document = json!({
        "asset": {"version": "2.0", "generator": concat!("rubor ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": head.name, "mesh": 0}],
        "meshes": [mesh],
        "extensionsUsed": [NAME],
        "extensions": {NAME: extension},
    });
    materials.put_into(&mut document);
    if !options.frames.is_empty() {
        document["animations"] = json!([animation(head, &options.frames, &mut buffer)]);
    }
    Ok(buffer.finish(document))
}

/// One primitive a part with vertices of its own (viewers keep morph targets per primitive, so sharing all vertices among
/// parts would multiply them), and which points they are.
fn primitives(head: &Head, morph_normals: bool, buffer: &mut Buffer) -> (Vec<Value>, Vec<PartEntry>) {
    let mesh = &head.mesh;
    let normals = point_normals(mesh, &mesh.points);
    let tangents = vertex_tangents(mesh, &mesh.points, &normals);
    let turned: Vec<Vec<(u32, Vec3)>> =
        head.shapes.iter().filter(|_| morph_normals).map(|s| normal_offsets(head, s, &normals)).collect();
    let mut primitives = Vec::new();
    let mut entries = Vec::new();
    for (material, part) in mesh.parts.iter().enumerate() {
        let mut local: HashMap<u32, u32> = HashMap::new();
        let mut vertices: Vec<u32> = Vec::new();
        let triangles = &mesh.triangles[part.triangles.start as usize..part.triangles.end as usize];
        let indices: Vec<u32> = triangles
            .as_flattened()
            .iter()
            .map(|v| {
                *local.entry(*v).or_insert_with(|| {
                    vertices.push(*v);
                    vertices.len() as u32 - 1
                })
            })
            .collect();
        let points: Vec<u32> = vertices.iter().map(|v| mesh.vertices[*v as usize].point).collect();
        let at = |list: &[Vec3]| -> Vec<[f32; 3]> {
            points.iter().map(|p| list[*p as usize].to_array()).collect()
        };
        let uvs: Vec<[f32; 2]> = vertices.iter().map(|v| mesh.vertices[*v as usize].uv.to_array()).collect();
        let tangents: Vec<[f32; 4]> = vertices.iter().map(|v| tangents[*v as usize].to_array()).collect();
        let mut vertices_of: HashMap<u32, Vec<u32>> = HashMap::new();
        points.iter().enumerate().for_each(|(v, p)| vertices_of.entry(*p).or_default().push(v as u32));
        let to_vertices = |moved: &mut dyn Iterator<Item = (u32, Vec3)>| {
            let mut moved: Vec<(u32, Vec3)> = moved
                .flat_map(|(p, d)| vertices_of.get(&p).into_iter().flatten().map(move |v| (*v, d)))
                .collect();
            moved.sort_unstable_by_key(|(v, _)| *v);
            moved
        };
        let mut primitive = json!({
            "attributes": {
                "POSITION": buffer.floats(&at(&mesh.points), Target::Vertices, true),
                "NORMAL": buffer.floats(&at(&normals), Target::Vertices, false),
                "TANGENT": buffer.floats(&tangents, Target::Vertices, false),
                "TEXCOORD_0": buffer.floats(&uvs, Target::Vertices, false),
            },
            "indices": buffer.indices(&indices, vertices.len(), Target::Indices),
            "material": material,
        });
        // Every target must be there on every primitive; those that do not move it share one empty accessor.
        let mut still = None;
        let mut targets = Vec::new();
        for (i, shape) in head.shapes.iter().enumerate() {
            let offsets = to_vertices(&mut shape.points.iter().copied().zip(shape.offsets.iter().copied()));
            let mut put = |moved: &[(u32, Vec3)]| match buffer.displacements(vertices.len(), moved) {
                Some(accessor) => accessor,
                None => *still.get_or_insert_with(|| buffer.zeros(vertices.len())),
            };
            let mut target = json!({"POSITION": put(&offsets)});
            if let Some(turned) = turned.get(i) {
                target["NORMAL"] = json!(put(&to_vertices(&mut turned.iter().copied())));
            }
            targets.push(target);
        }
        if !targets.is_empty() {
            primitive["targets"] = json!(targets);
        }
        primitives.push(primitive);
        let points = buffer.indices(&points, mesh.points.len(), Target::None) as u32;
        entries.push(PartEntry { name: part.name.clone(), material: part.material, points });
    }
    (primitives, entries)
}

/// Change of each normal at weight 1, where it exceeds about a sixteenth of a degree.
fn normal_offsets(head: &Head, shape: &BlendShape, rest: &[Vec3]) -> Vec<(u32, Vec3)> {
    let points = deform_points(&head.mesh, std::slice::from_ref(shape), &[1.0]);
    let turned = point_normals(&head.mesh, &points);
    (turned.iter().zip(rest).enumerate())
        .map(|(i, (n, n0))| (i as u32, *n - *n0))
        .filter(|(_, d)| d.length() > 1e-3)
        .collect()
}

fn check_frames(head: &Head, frames: &[Frame]) -> Result<(), ExportError> {
    let fail = |i: usize, found: String, expected: String| {
        Err(ExportError::Content { at: format!("frame {i}"), found, expected })
    };
    for (i, frame) in frames.iter().enumerate() {
        if frame.weights.len() != head.shapes.len() {
            let expected = format!("one for each of the {} shapes", head.shapes.len());
            return fail(i, format!("{} weights", frame.weights.len()), expected);
        }
        let finite = frame.weights.iter().all(|w| w.is_finite())
            && frame.rotation.is_finite()
            && frame.translation.is_finite();
        if !finite {
            return fail(i, "a number that is not finite".into(), "finite weights and motion".into());
        }
        if frame.time_s.is_nan() || frame.time_s < 0.0 || (i > 0 && frame.time_s <= frames[i - 1].time_s) {
            return fail(i, format!("time {} s", frame.time_s), "strictly increasing times from 0".into());
        }
    }
    Ok(())
}

/// Weights, rotation and translation of node 0, linear between frames.
fn animation(head: &Head, frames: &[Frame], buffer: &mut Buffer) -> Value {
    let times: Vec<[f32; 1]> = frames.iter().map(|f| [f.time_s]).collect();
    let rotations: Vec<[f32; 4]> = frames.iter().map(|f| f.rotation.normalize().to_array()).collect();
    let translations: Vec<[f32; 3]> = frames.iter().map(|f| f.translation.to_array()).collect();
    let input = buffer.floats(&times, Target::None, true);
    let mut tracks = vec![
        ("rotation", buffer.floats(&rotations, Target::None, false)),
        ("translation", buffer.floats(&translations, Target::None, false)),
    ];
    if !head.shapes.is_empty() {
        let weights: Vec<[f32; 1]> = frames.iter().flat_map(|f| &f.weights).map(|w| [*w]).collect();
        tracks.push(("weights", buffer.floats(&weights, Target::None, false)));
    }
    let samplers: Vec<Value> =
        tracks.iter().map(|(_, output)| json!({"input": input, "output": output})).collect();
    let channels: Vec<Value> = (tracks.iter().enumerate())
        .map(|(i, (path, _))| json!({"sampler": i, "target": {"node": 0, "path": path}}))
        .collect();
    json!({"name": "performance", "samplers": samplers, "channels": channels})
}
