//! A head as `.usda`: UsdSkel blend shapes with in-betweens, a performance, plain materials with pictures beside it; or as
//! `.usdz`, a package of all of these.
//!
//! ```text
//! /rubor_head (SkelRoot)      head motion as xformOps; rig and sequence as text in customData
//!   /Skeleton                 no joints move: it binds the animation
//!     /Performance            SkelAnimation: weights at frames, straight lines between them
//!   /Face (Mesh)              points, normals, primvars:st
//!     /jawOpen (BlendShape)   offsets of the points that move, in-betweens
//!     /skin (GeomSubset)      a part and its material
//!   /Looks                    UsdPreviewSurface
//! ```
//!
//! Points and offsets are written so that they are read as the same f32. Names of shapes are tokens and stay as they
//! are; prims get names that USD accepts. Weights of shapes with in-betweens are those before the shares of in-betweens,
//! which UsdSkel computes itself. Combination shapes are in the weights.
//!
//! What USD has no place for: chromophores, wrinkles, distributions, landmarks. They are in the `.glb`.

mod materials;
mod mesh;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use rubor_rig::expression::{Inbetween, Rig};
use rubor_rig::face_state::FaceState;
use rubor_rig::head::Head;
use rubor_rig::names::Resolver;
use rubor_rig::timeline::Sequence;

use super::curves::kept_frames;
use super::performance::Performance;
use super::{TextureFormat, write_whole};
use crate::error::ExportError;
use crate::usdz;

/// Contents of the file besides the head.
#[derive(Clone, Debug)]
pub struct Options<'a> {
    /// Largest side of the skin's base colour; 0 leaves it out.
    pub color_map_size: u32,
    /// Largest side of the normal map; 0 leaves it out.
    pub normal_map_size: u32,
    /// The pose whose blood and wrinkles are baked into these two; none: the neutral face.
    pub pose: Option<FaceState>,
    /// How pictures are stored; UsdPreviewSurface knows PNG and JPEG.
    pub textures: TextureFormat,
    /// Shapes carry normals too.
    pub shape_normals: bool,
    /// Only these shapes of the head, by rising index; none: all.
    pub shapes: Option<Vec<usize>>,
    /// In-betweens, and what the sequence names.
    pub rig: Option<&'a Rig>,
    /// The performance.
    pub sequence: Option<&'a Sequence>,
    /// Frames that a straight line replaces within this weight are left out.
    pub tolerance: f32,
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self {
            color_map_size: 2048,
            normal_map_size: 1024,
            pose: None,
            textures: TextureFormat::default(),
            shape_normals: true,
            shapes: None,
            rig: None,
            sequence: None,
            tolerance: 1e-5,
        }
    }
}

/// A layer and the files beside it.
#[derive(Clone, Debug, Default)]
pub struct Layer {
    /// The `.usda` file.
    pub text: String,
    /// Name and content of pictures.
    pub files: Vec<(String, Vec<u8>)>,
    /// Notes on everything that could not be kept.
    pub notes: Vec<String>,
    /// Frames with weights.
    pub keys: usize,
    /// Bytes of the package, where it was written as one.
    pub package_size: Option<usize>,
}

/// Writes a package: the layer and its pictures in one `.usdz`, under a temporary name first.
///
/// # Errors
/// As [`to_layer`], a package of 4 GiB or more, and if the file cannot be written.
pub fn write_package(head: &Head, options: &Options<'_>, path: &Path) -> Result<Layer, ExportError> {
    let stem: String = path.file_stem().map(|s| identifier(&s.to_string_lossy())).unwrap_or_default();
    let mut layer = to_layer(head, options, &stem)?;
    let name = format!("{stem}.usda");
    let pictures = layer.files.iter().map(|(name, bytes)| (name.as_str(), &bytes[..]));
    let files: Vec<(&str, &[u8])> =
        std::iter::once((name.as_str(), layer.text.as_bytes())).chain(pictures).collect();
    let package = usdz::write(&files).ok_or_else(|| ExportError::Content {
        at: path.display().to_string(),
        found: "4 GiB or more".into(),
        expected: "what a package can hold: fewer shapes or smaller pictures".into(),
    })?;
    write_whole(path, &package)?;
    layer.package_size = Some(package.len());
    Ok(layer)
}

/// Writes the layer and the pictures beside it, each under a temporary name first, the layer last.
///
/// # Errors
/// As [`to_layer`], and if a file cannot be written.
pub fn write(head: &Head, options: &Options<'_>, path: &Path) -> Result<Layer, ExportError> {
    let stem: String = path.file_stem().map(|s| identifier(&s.to_string_lossy())).unwrap_or_default();
    let layer = to_layer(head, options, &stem)?;
    for (name, bytes) in &layer.files {
        write_whole(&path.with_file_name(name), bytes)?;
    }
    write_whole(path, layer.text.as_bytes())?;
    Ok(layer)
}

/// A shape of the file.
struct Target {
    /// Index into the head's shapes.
    shape: usize,
    /// Name of its prim.
    prim: String,
    /// Weight, shape and prim name of each in-between.
    inbetweens: Vec<(f32, usize, String)>,
}

/// The layer as text. `stem` begins the names of the files beside it.
///
/// # Errors
/// A head that breaks a rule, pictures that cannot be encoded, a sequence that does not fit.
pub fn to_layer(head: &Head, options: &Options<'_>, stem: &str) -> Result<Layer, ExportError> {
    head.validate()?;
    if options.textures == TextureFormat::Webp {
        return Err(ExportError::Content {
            at: "textures".into(),
            found: "webp".into(),
            expected: "png or jpeg, which UsdPreviewSurface reads".into(),
        });
    }
    let mut layer = Layer::default();
    let kept: Vec<usize> = options.shapes.clone().unwrap_or_else(|| (0..head.shapes.len()).collect());
    let inbetweens = options.rig.map_or(&[][..], |rig| &rig.inbetweens);
    let performance = match (options.rig, options.sequence) {
        (Some(rig), Some(sequence)) => Some((rig, sequence)),
        _ => None,
    };
    let frames = match performance {
        Some((rig, sequence)) => {
            let whole = Rig { inbetweens: Vec::new(), ..rig.clone() };
            let performance = Performance { rig: &whole, sequence };
            let evaluator = performance.evaluator(head, &mut layer.notes)?;
            let count = evaluator.frame_count();
            (0..count).map(|i| evaluator.face_at(evaluator.frame_time_s(i))).collect()
        }
        None => Vec::new(),
    };
    let targets = targets(head, &kept, inbetweens, &frames, &mut layer.notes);
    let fps = performance.map_or(24.0, |(_, sequence)| sequence.fps);
    let out = &mut layer.text;
    let last = frames.len().saturating_sub(1);
    let _ = write!(
        out,
        "#usda 1.0\n(\n    defaultPrim = \"rubor_head\"\n    doc = \"Written by rubor {}\"\n    endTimeCode = {last}\n    \
         framesPerSecond = {fps}\n    metersPerUnit = 1\n    startTimeCode = 0\n    timeCodesPerSecond = {fps}\n    \
         upAxis = \"Y\"\n)\n\n",
        env!("CARGO_PKG_VERSION")
    );
    out.push_str("def SkelRoot \"rubor_head\" (\n    customData = {\n        dictionary rubor = {\n");
    let _ = writeln!(out, "            string name = {}", quoted(&head.name));
    for (name, text) in [
        ("rig", options.rig.map(serde_json::to_string)),
        ("sequence", options.sequence.map(serde_json::to_string)),
    ] {
        if let Some(text) = text {
            let text = text.map_err(|e| ExportError::Encode { what: name.into(), reason: e.to_string() })?;
            let _ = writeln!(out, "            string {name} = {}", quoted(&text));
        }
    }
    out.push_str("        }\n    }\n    kind = \"component\"\n)\n{\n");
    if let Some((_, sequence)) = performance {
        motion(out, sequence, frames.len(), options.tolerance);
    }
    out.push_str(
        "    def Skeleton \"Skeleton\" (\n        prepend apiSchemas = [\"SkelBindingAPI\"]\n    )\n    {\n        \
         uniform matrix4d[] bindTransforms = [( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )]\n        \
         uniform token[] joints = [\"head\"]\n        \
         uniform matrix4d[] restTransforms = [( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )]\n",
    );
    if !frames.is_empty() && !targets.is_empty() {
        out.push_str("        rel skel:animationSource = </rubor_head/Skeleton/Performance>\n\n");
        layer.keys = weights(out, head, &targets, &frames, options.tolerance);
    }
    out.push_str("    }\n\n");
    mesh::write(out, head, &targets, options.shape_normals);
    materials::write(&mut layer, head, options, stem)?;
    layer.text.push_str("}\n");
    note_lost(head, options, &mut layer.notes);
    Ok(layer)
}

/// Shapes of the file: in-between targets that nothing drives by themselves belong to their shape.
fn targets(
    head: &Head,
    kept: &[usize],
    inbetweens: &[Inbetween],
    frames: &[FaceState],
    notes: &mut Vec<String>,
) -> Vec<Target> {
    let resolver = Resolver::shapes(head);
    let mut taken = BTreeSet::new();
    let mut stops: Vec<(usize, f32, usize)> = Vec::new();
    for inbetween in inbetweens {
        let (shapes, targets) = (resolver.resolve(&inbetween.shape), resolver.resolve(&inbetween.target));
        for (shape, target) in shapes.iter().zip(&targets) {
            let (shape, target) = (shape.index as usize, target.index as usize);
            if kept.contains(&shape) && kept.contains(&target) {
                stops.push((shape, inbetween.weight, target));
                if frames.iter().all(|f| f.shapes[target] == 0.0) {
                    taken.insert(target);
                } else {
                    notes.push(format!(
                        "{:?} is an in-between and moves by itself: it is written as both",
                        head.shapes[target].name
                    ));
                }
            }
        }
    }
    stops.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut names = BTreeSet::new();
    (kept.iter().filter(|s| !taken.contains(s)))
        .map(|shape| Target {
            shape: *shape,
            prim: unique(&head.shapes[*shape].name, &mut names),
            inbetweens: (stops.iter().filter(|(s, ..)| s == shape))
                .map(|(_, weight, target)| (*weight, *target, identifier(&head.shapes[*target].name)))
                .collect(),
        })
        .collect()
}

/// Translation and rotation of the head; roll acts first, then pitch, then yaw.
fn motion(out: &mut String, sequence: &Sequence, frames: usize, tolerance: f32) {
    let head = &sequence.head;
    let alive = |t: f64| sequence.life.as_ref().map(|life| life.at(t)).unwrap_or_default();
    let times = || (0..frames).map(|i| sequence.frame_time_s(i as u32));
    let angles: Vec<Vec<f32>> = times()
        .map(|t| {
            let [yaw, pitch, roll] = alive(t).head_degrees;
            vec![
                head.pitch_degrees.at(t) + pitch,
                head.yaw_degrees.at(t) + yaw,
                head.roll_degrees.at(t) + roll,
            ]
        })
        .collect();
    let places: Vec<Vec<f32>> = times()
        .map(|t| {
            let (keyed, own) = (head.translation.at(t), alive(t).translation);
            (0..3).map(|k| keyed[k] + own[k]).collect()
        })
        .collect();
    let mut order = Vec::new();
    // A weight moves points by centimetres; a degree by millimetres.
    for (name, kind, values, scale) in
        [("translate", "float3", &places, 0.1), ("rotateZXY", "float3", &angles, 10.0)]
    {
        if values.iter().all(|v| v.iter().all(|c| *c == 0.0)) {
            continue;
        }
        order.push(format!("\"xformOp:{name}\""));
        samples(out, 1, &format!("{kind} xformOp:{name}"), values, scale * tolerance, |v| {
            format!("({}, {}, {})", v[0], v[1], v[2])
        });
    }
    if !order.is_empty() {
        let _ = writeln!(out, "    uniform token[] xformOpOrder = [{}]\n", order.join(", "));
    }
}

fn weights(out: &mut String, head: &Head, targets: &[Target], frames: &[FaceState], tolerance: f32) -> usize {
    out.push_str("        def SkelAnimation \"Performance\"\n        {\n");
    let names: Vec<String> = targets.iter().map(|t| quoted(&head.shapes[t.shape].name)).collect();
    let _ = writeln!(out, "            uniform token[] blendShapes = [{}]", names.join(", "));
    let values: Vec<Vec<f32>> =
        frames.iter().map(|f| targets.iter().map(|t| f.shapes[t.shape]).collect()).collect();
    let keys = samples(out, 3, "float[] blendShapeWeights", &values, tolerance, |v| {
        format!("[{}]", v.iter().map(f32::to_string).collect::<Vec<_>>().join(", "))
    });
    out.push_str("        }\n");
    keys
}

/// Values at frames, without those that a straight line gives. Returns how many there are.
fn samples(
    out: &mut String,
    depth: usize,
    attribute: &str,
    values: &[Vec<f32>],
    tolerance: f32,
    text: impl Fn(&[f32]) -> String,
) -> usize {
    let indent = "    ".repeat(depth);
    let kept = kept_frames(values, tolerance);
    let _ = writeln!(out, "{indent}{attribute}.timeSamples = {{");
    for frame in &kept {
        let _ = writeln!(out, "{indent}    {frame}: {},", text(&values[*frame]));
    }
    let _ = writeln!(out, "{indent}}}");
    kept.len()
}

fn note_lost(head: &Head, options: &Options<'_>, notes: &mut Vec<String>) {
    let maps = &head.maps;
    if maps.melanin.is_some() || !maps.zones.is_empty() {
        notes.push(
            "USD has no place for chromophores, wrinkles and blood: they show as baked; the .glb keeps them"
                .into(),
        );
    }
    notes.extend(super::authored_lost(head, "USD"));
    if let Some(rig) = options.rig {
        let resolver = Resolver::shapes(head);
        let combinations = rig.combinations.iter().filter(|c| !resolver.resolve(&c.shape).is_empty()).count();
        if combinations > 0 {
            notes.push(format!(
                "USD has no combination shapes: {combinations} baked into the weights (kept as text in customData)"
            ));
        }
    }
}

/// A name that USD accepts for prims: letters, digits and `_`, not starting with a digit.
fn identifier(name: &str) -> String {
    let mut out: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if out.is_empty() || out.starts_with(|c: char| c.is_ascii_digit()) {
        out.insert(0, '_');
    }
    out
}

/// An identifier that differs from all before it.
fn unique(name: &str, taken: &mut BTreeSet<String>) -> String {
    let base = identifier(name);
    let mut out = base.clone();
    let mut number = 2;
    while !taken.insert(out.clone()) {
        out = format!("{base}_{number}");
        number += 1;
    }
    out
}

/// A string in double quotes on one line.
fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
