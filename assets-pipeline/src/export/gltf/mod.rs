//! A head as one `.glb` that any glTF 2.0 viewer opens, with what other viewers cannot show in
//! [`crate::facial_appearance`].
//!
//! ```text
//! Head --geometry---> one mesh, one primitive a part: POSITION NORMAL TANGENT TEXCOORD_0, sparse morph targets
//!      --materials--> for other viewers: baked base colour, normal map, eyes, teeth, lashes
//!      --maps-------> RUBOR_facial_appearance: points, occlusion, landmarks, maps, provenance, rig, sequence
//! Rig  --skin_color-> COLOR_0 of the skin and of its morph targets: the colour that belongs to each shape
//! Sequence --curves-> one animation: weights, rotation and translation of the node
//! ```
//!
//! Geometry is stored bit for bit; maps are quantised as [`MapEncodings`] says; curves stay within
//! [`Options::tolerance`].

mod animation;
mod buffer;
mod geometry;
mod maps;
mod materials;
mod meshopt;
pub mod sizes;
mod skin;

use std::path::Path;

use rubor_rig::expression::Rig;
use rubor_rig::face_state::FaceState;
use rubor_rig::head::Head;
use rubor_rig::names::action_units;
use rubor_rig::timeline::Sequence;
use serde_json::{Map, Value, json};

use self::buffer::Buffer;
use self::geometry::TargetOptions;
pub use self::maps::MapEncodings;
pub use super::image_codec::MapEncoding;
use super::performance::{Performance, PerformanceCurves};
use super::skin_color::shape_colors;
use super::{TextureFormat, write_whole};
use crate::error::ExportError;
use crate::facial_appearance::{
    ACCESSOR_NAMES, FacialAppearance, IMAGE_NAMES, NAME, ShapeOcclusionEntry, VERSION,
};

/// Contents of the file besides the head.
#[derive(Clone, Debug)]
pub struct Options<'a> {
    /// Largest side of the skin's base colour, which is baked from the chromophores; 0 leaves it out.
    pub color_map_size: u32,
    /// Largest side of the normal map for other viewers, made from the slopes; 0 leaves it out.
    pub normal_map_size: u32,
    /// The pose whose blood and wrinkles are baked into these two, and whose weights the mesh rests in; none: neutral.
    pub pose: Option<FaceState>,
    /// How pictures for other viewers are stored.
    pub textures: TextureFormat,
    /// Morph targets carry normals too: other viewers light deformed faces better, the file grows by about half.
    pub morph_normals: bool,
    /// Morph targets carry colours: viewers that do not know the extension show some of the change of colour.
    pub shape_colors: bool,
    /// How maps are stored.
    pub maps: MapEncodings,
    /// Only these shapes of the head, by rising index; none: all.
    pub shapes: Option<Vec<usize>>,
    /// The rig, carried along; a performance and colours of shapes need it.
    pub rig: Option<&'a Rig>,
    /// The performance, as an animation and carried along as it is written.
    pub sequence: Option<&'a Sequence>,
    /// How far weights of the animation may be from the performance; a rotation a quarter of that in each component, a
    /// translation that part of the head's height. 0 leaves out no authored key.
    pub tolerance: f32,
    /// Geometry and animation in `EXT_meshopt_compression` and `KHR_mesh_quantization`: a third of the size, positions within
    /// 4 micrometres. Viewers must know both extensions (three.js, Babylon.js and Filament do; Blender does not).
    pub compress: bool,
    /// Straight lines and more keys instead of cubics: Blender drops the slopes of cubic keys.
    pub only_lines: bool,
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self {
            color_map_size: 2048,
            normal_map_size: 1024,
            pose: None,
            textures: TextureFormat::default(),
            morph_normals: true,
            shape_colors: false,
            maps: MapEncodings::default(),
            shapes: None,
            rig: None,
            sequence: None,
            tolerance: 1e-5,
            compress: false,
            only_lines: false,
        }
    }
}

/// A file in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The `.glb`.
    pub bytes: Vec<u8>,
    /// Notes on everything without effect, or that could not be kept as it was.
    pub notes: Vec<String>,
    /// Keys of the animation.
    pub keys: usize,
}

/// Writes the file: to a temporary name, then renamed.
///
/// # Errors
/// As [`export()`], and a file that cannot be written.
pub fn write(head: &Head, options: &Options<'_>, path: &Path) -> Result<Exported, ExportError> {
    let exported = export(head, options)?;
    write_whole(path, &exported.bytes)?;
    Ok(exported)
}

/// The bytes of the `.glb` alone.
///
/// # Errors
/// As [`export()`].
pub fn to_bytes(head: &Head, options: &Options<'_>) -> Result<Vec<u8>, ExportError> {
    export(head, options).map(|exported| exported.bytes)
}

/// The `.glb` and what there is to say about it.
///
/// # Errors
/// An invalid head, a rig or sequence that does not fit it, images that cannot be encoded.
pub fn export(head: &Head, options: &Options<'_>) -> Result<Exported, ExportError> {
    head.validate()?;
    if head.mesh.triangles.is_empty() {
        return Err(ExportError::Content {
            at: format!("head {:?}", head.name),
            found: "no triangles".into(),
            expected: "a mesh".into(),
        });
    }
    let kept = kept_shapes(head, options)?;
    let mut notes = Vec::new();
    let mut buffer = if options.compress { Buffer::compressed() } else { Buffer::default() };
    // Baked colours belong to one pose: changes on top of them would count twice.
    let colors = match options.rig {
        Some(rig) if options.shape_colors && options.pose.is_none() => shape_colors(head, rig)?,
        _ => None,
    };
    let targets = TargetOptions {
        normals: options.morph_normals,
        colors: colors.as_ref(),
        shape_visibility: options.morph_normals || options.shape_colors,
    };
    let (primitives, parts) = geometry::primitives(head, &kept, &targets, &mut buffer);
    let factor = colors.as_ref().map_or(1.0, |c| 1.0 / c.rest);
    // Most of the time goes into the coding of images.
    let (encoded, materials) = rayon::join(
        || maps::encode(&head.maps, &options.maps),
        || materials::write(head, options, factor, &mut buffer),
    );
    let (encoded, mut materials) = (encoded?, materials?);
    let maps = maps::write(&head.maps, &options.maps, materials.albedo.clone(), encoded, &mut buffer)?;
    let occlusion = (!head.mesh.occlusion.is_empty()).then(|| buffer.normalized(&head.mesh.occlusion) as u32);
    let shape_occlusion = (kept.iter().map(|s| &head.shapes[*s]).filter(|s| !s.occlusion.is_empty()))
        .map(|shape| {
            let points: Vec<u32> = shape.occlusion.iter().map(|c| c.point).collect();
            let changes: Vec<[f32; 2]> = shape.occlusion.iter().map(|c| [c.at_half, c.at_full]).collect();
            ShapeOcclusionEntry {
                shape: shape.name.clone(),
                points: buffer.indices(&points, head.mesh.points.len(), buffer::Target::None) as u32,
                changes: buffer.normalized_bytes(&changes) as u32,
            }
        })
        .collect();
    let as_json = |what: &str, value: Result<Value, serde_json::Error>| {
        value.map_err(|e| ExportError::Encode { what: what.into(), reason: e.to_string() })
    };
    let has_skin_color = maps.melanin.is_some() && maps.hemoglobin.is_some();
    let skin_look_up = has_skin_color.then(|| skin::look_up(&mut buffer)).transpose()?;
    let evaluator = match (options.rig, options.sequence) {
        (Some(rig), Some(sequence)) => Some(Performance { rig, sequence }.evaluator(head, &mut notes)?),
        _ => None,
    };
    let skin_animation = evaluator.as_ref().map(|evaluator| skin::animation(evaluator, &mut buffer));
    let extension = FacialAppearance {
        version: VERSION,
        name: head.name.clone(),
        mesh: 0,
        point_count: head.mesh.points.len() as u32,
        parts,
        authored_normals: !head.authored.normals.is_empty(),
        occlusion,
        shape_occlusion,
        landmarks: head.landmarks.iter().map(|(name, p)| (name.clone(), p.to_array())).collect(),
        maps,
        skin_look_up,
        skin_animation,
        provenance: head.provenance.clone(),
        rig: options.rig.map(|rig| as_json("rig", serde_json::to_value(rig))).transpose()?,
        sequence: options.sequence.map(|s| as_json("sequence", serde_json::to_value(s))).transpose()?,
    };
    let copy = copy_for_extras(&extension, &mut buffer)
        .map_err(|e| ExportError::Encode { what: NAME.into(), reason: e.to_string() })?;
    let names: Vec<&str> = kept.iter().map(|s| head.shapes[*s].name.as_str()).collect();
    let mut mesh = json!({"name": head.name, "primitives": primitives, "extras": {NAME: copy}});
    if !names.is_empty() {
        let units: Map<String, Value> = (names.iter())
            .filter(|n| !action_units(n).is_empty())
            .map(|n| ((*n).to_owned(), json!(action_units(n))))
            .collect();
        mesh["extras"]["targetNames"] = json!(names);
        mesh["extras"]["actionUnits"] = json!(units);
        let rest = |s: &usize| options.pose.as_ref().and_then(|p| p.shapes.get(*s)).copied().unwrap_or(0.0);
        mesh["weights"] = json!(kept.iter().map(rest).collect::<Vec<f32>>());
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
    materials.show_all(buffer.image_names().count());
    materials.put_into(&mut document);
    if options.compress {
        for list in ["extensionsUsed", "extensionsRequired"] {
            let names = [meshopt::NAME, meshopt::QUANTIZATION].map(|name| json!(name));
            match document[list].as_array_mut() {
                Some(known) => known.extend(names),
                None => document[list] = json!(names),
            }
        }
    }
    let mut keys = 0;
    if let (Some(rig), Some(evaluator)) = (options.rig, &evaluator) {
        let height = head.height().max(f32::MIN_POSITIVE);
        let curves = PerformanceCurves::new(evaluator, &kept, height, options.tolerance, options.only_lines);
        if let Some(animation) = animation::write(&curves, &mut buffer) {
            document["animations"] = json!([animation]);
            keys =
                [&curves.weights, &curves.rotation, &curves.translation].iter().map(|c| c.keys.len()).sum();
        }
        note_baked(rig, head, &mut notes);
    }
    Ok(Exported { bytes: buffer.finish(document)?, notes, keys })
}

/// The extension for the extras of the mesh, where programs keep it that do not know it: with names of the images and accessors
/// that it counts, as these programs renumber them.
fn copy_for_extras(extension: &FacialAppearance, buffer: &mut Buffer) -> Result<Value, serde_json::Error> {
    for (i, part) in extension.parts.iter().enumerate() {
        buffer.name_accessor(part.points, format!("rubor points of part {i}"));
    }
    if let Some(occlusion) = extension.occlusion {
        buffer.name_accessor(occlusion, "rubor ambient visibility".into());
    }
    for entry in &extension.shape_occlusion {
        buffer.name_accessor(entry.points, format!("rubor points of visibility of {}", entry.shape));
        buffer.name_accessor(entry.changes, format!("rubor changes of visibility of {}", entry.shape));
    }
    let mut copy = serde_json::to_value(extension)?;
    let accessors = buffer.named_accessors().map(|(i, name)| (i.to_string(), json!(name)));
    copy[ACCESSOR_NAMES] = Value::Object(accessors.collect());
    let images = buffer.image_names().enumerate().map(|(i, name)| (i.to_string(), json!(name)));
    copy[IMAGE_NAMES] = Value::Object(images.collect());
    Ok(copy)
}

fn kept_shapes(head: &Head, options: &Options<'_>) -> Result<Vec<usize>, ExportError> {
    let Some(kept) = &options.shapes else { return Ok((0..head.shapes.len()).collect()) };
    if kept.windows(2).any(|w| w[0] >= w[1]) || kept.last().is_some_and(|s| *s >= head.shapes.len()) {
        return Err(ExportError::Content {
            at: "shapes".into(),
            found: format!("{kept:?}"),
            expected: format!("rising indices below {}", head.shapes.len()),
        });
    }
    Ok(kept.clone())
}

/// glTF's morph targets are sums: shapes that drive others are resolved into the weights of the animation.
fn note_baked(rig: &Rig, head: &Head, notes: &mut Vec<String>) {
    let on_head = |name: &String| !rubor_rig::names::Resolver::shapes(head).resolve(name).is_empty();
    let inbetweens = rig.inbetweens.iter().filter(|i| on_head(&i.shape) && on_head(&i.target)).count();
    let combinations = rig.combinations.iter().filter(|c| on_head(&c.shape)).count();
    for (count, what) in [(inbetweens, "in-between"), (combinations, "combination shape")] {
        if count > 0 {
            let s = if count == 1 { "" } else { "s" };
            notes.push(format!(
                "glTF has no {what}s: {count} {what}{s} baked into the weights of the animation (kept as written in {NAME})"
            ));
        }
    }
}
