//! Heads and sequences to scenes.
//!
//! ```text
//! rubor_head (transform: head motion, order zxy, attribute ruborFacialAppearance)
//!   rubor_head_mesh (mesh) <-- rubor_shapes (blendShape: a target a shape, in-between items) <-- ...Orig (mesh)
//! animCurves --> weights, translation, rotation
//! one shading group a part; skin: file texture, aiStandardSurface with subsurface, aiOslShader for the facial colour
//! ```
//!
//! Positions, offsets, texture coordinates, weights and key times come back bit for bit. Eases that no cubic says
//! (`smoother`, `easeInOut`) and sequences with expressions or states are sampled at every frame.

mod animation;
pub mod material;
mod mesh;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use image::RgbImage;
use rubor_assets::files::replace;
use rubor_rig::expression::{Inbetween, Rig};
use rubor_rig::head::Head;

use self::animation::Animation;
use crate::appearance::Appearance;
use crate::ascii::lexer::quoted;
use crate::error::WriteError;
use crate::plain_name;

pub use rubor_assets::export::Performance;

/// Data to write besides the geometry.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// sRGB colour of the neutral skin in the head's texture space, for the viewport.
    pub base_color: Option<RgbImage>,
    /// Shapes that are in-betweens of others.
    pub inbetweens: Vec<Inbetween>,
    /// Carried along as text: expressions and combination shapes have no nodes here.
    pub rig: Option<Rig>,
}

/// A scene and the files beside it.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The `.ma` file.
    pub text: String,
    /// Name and content of textures and shader.
    pub files: Vec<(String, Vec<u8>)>,
    /// Notes on everything that had to be changed.
    pub notes: Vec<String>,
}

/// Writes a scene and the files beside it, each under a temporary name first, the scene last. Returns notes.
///
/// # Errors
/// As [`to_scene`], and if a file cannot be written.
pub fn write(
    head: &Head,
    performance: Option<Performance<'_>>,
    options: &Options,
    path: &Path,
) -> Result<Vec<String>, WriteError> {
    let stem = path.file_stem().map(|s| plain_name(&s.to_string_lossy())).unwrap_or_default();
    let scene = to_scene(head, performance, options, &stem)?;
    let folder = path.parent().map_or_else(PathBuf::new, Path::to_owned);
    for (name, bytes) in &scene.files {
        commit(&folder.join(name), bytes)?;
    }
    commit(path, scene.text.as_bytes())?;
    Ok(scene.notes)
}

fn commit(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    replace(path, bytes).map_err(|source| WriteError::Write { path: path.to_owned(), source })
}

/// A scene as text. `stem` begins the names of the files beside it.
///
/// # Errors
/// A head that breaks a rule, a map that cannot be encoded, a sequence that does not fit the rig or the head.
pub fn to_scene(
    head: &Head,
    performance: Option<Performance<'_>>,
    options: &Options,
    stem: &str,
) -> Result<Scene, WriteError> {
    head.validate()?;
    let encode = |(what, reason)| WriteError::Encode { what, reason };
    let mut scene = Scene::default();
    let (mut appearance, files) = Appearance::of(head, stem).map_err(encode)?;
    if let Some(rig) = &options.rig {
        let json = serde_json::to_value(rig);
        appearance.rig =
            Some(json.map_err(|e| WriteError::Encode { what: "rig".into(), reason: e.to_string() })?);
    }
    scene.files = files;
    scene.notes.extend(rubor_assets::export::authored_lost(head, "Maya"));
    let (animation, inbetweens) = animate(head, performance, &options.inbetweens, &mut scene.notes)?;
    let targets = mesh::Targets::new(head, inbetweens, &mut scene.notes);
    let fps = performance.map_or(24.0, |p| p.sequence.fps);
    let (unit, unit_fps) = animation::time_unit(fps, &mut scene.notes);

    let out = &mut scene.text;
    let name = format!("{stem}.ma");
    line(out, &format!("//Maya ASCII 2022 scene\n//Name: {name}\n//Codeset: UTF-8"));
    line(out, "requires maya \"2022\";\nrequires \"mtoa\" \"5.0.0\";");
    line(out, &format!("currentUnit -l centimeter -a degree -t {unit};"));
    line(out, "fileInfo \"application\" \"maya\";\nfileInfo \"product\" \"rubor\";");
    line(out, "createNode transform -n \"rubor_head\";");
    line(out, "\taddAttr -ci true -sn \"rfa\" -ln \"ruborFacialAppearance\" -dt \"string\";");
    // Yaw times pitch times roll: z acts first, then x, then y.
    line(out, "\tsetAttr \".ro\" 2;");
    if let Some(animation) = &animation {
        animation.write_pose(out);
    }
    let json = serde_json::to_string(&appearance)
        .map_err(|e| WriteError::Encode { what: "appearance".into(), reason: e.to_string() })?;
    line(out, &format!("\tsetAttr \".rfa\" -type \"string\" {};", quoted(&json)));
    mesh::write(out, head);
    let weights = animation.as_ref().map(|a| a.rest_weights(&targets)).unwrap_or_default();
    targets.write(out, head, &weights);
    let colour = material::Colour::new(head, stem, options, &mut scene.files)?;
    material::write(out, head, stem, &colour);
    if let Some(animation) = &animation {
        animation.write(out, &targets, unit_fps, colour.has_shader());
    }
    mesh::connect(out, head);
    Ok(scene)
}

/// Curves, and the in-betweens that stay in-betweens: Maya shares their weights out itself. Those that the performance
/// also moves by themselves become targets of their own, all shares in the weights.
fn animate<'a>(
    head: &Head,
    performance: Option<Performance<'_>>,
    inbetweens: &'a [Inbetween],
    notes: &mut Vec<String>,
) -> Result<(Option<Animation>, &'a [Inbetween]), WriteError> {
    let Some(performance) = performance else { return Ok((None, inbetweens)) };
    let rest = performance.rig.inbetweens.iter().filter(|i| !inbetweens.contains(i)).cloned().collect();
    let rig = Rig { inbetweens: rest, ..performance.rig.clone() };
    let unshared = Performance { rig: &rig, sequence: performance.sequence };
    let baked = animation::needs_bake(head, performance);
    let mut said = Vec::new();
    let animation = Animation::new(head, unshared, baked, &mut said)?;
    let by_itself =
        inbetweens.iter().find(|i| head.shape_index(&i.target).is_some_and(|s| animation.moves(s)));
    if let Some(inbetween) = by_itself {
        notes.push(format!(
            "{:?} is an in-between and moves by itself: in-betweens are targets, their shares in the weights",
            inbetween.target
        ));
        return Ok((Some(Animation::new(head, performance, true, notes)?), &[]));
    }
    notes.append(&mut said);
    Ok((Some(animation), inbetweens))
}

fn line(out: &mut String, text: &str) {
    out.push_str(text);
    out.push('\n');
}

/// A length in centimetres with nine digits: enough to give the same f32 of metres back.
fn centimetres(metres: f32) -> String {
    digits(f64::from(metres) * 100.0)
}

/// The shortest decimal within nine significant digits.
fn digits(value: f64) -> String {
    let rounded: f64 = format!("{value:.8e}").parse().unwrap_or(value);
    let mut text = String::new();
    let exponent = rounded.abs().log10();
    let written = if rounded == 0.0 || (-5.0..15.0).contains(&exponent) {
        write!(text, "{rounded}")
    } else {
        write!(text, "{rounded:e}")
    };
    // Writing to a text cannot fail.
    debug_assert!(written.is_ok());
    text
}

/// Writes values in lines of about a hundred characters.
fn values(out: &mut String, values: impl Iterator<Item = String>) {
    let mut width = 0;
    for value in values {
        if width > 100 {
            out.push_str("\n\t\t");
            width = 0;
        }
        out.push(' ');
        out.push_str(&value);
        width += value.len() + 1;
    }
}
