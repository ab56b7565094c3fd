//! Heads from a folder of OBJ files: one neutral mesh and one mesh per shape, all with the same points.
//!
//! ```text
//! neutral.obj --polygons--> PolyMesh --.
//! NAME.obj ... --positions - neutral--> shapes --Catmull-Clark--> Head in metres
//! ```
//!
//! Faces of a shape are compared with the neutral's: points in another order are matched by faces that correspond in
//! order or by texture coordinates; a shape of another mesh is refused.
//!
//! The names of the files are the names of the shapes. ICT-FaceKit is the set that this was made for; its materials and
//! its `vertex_indices.json` (68 landmarks of the iBUG scheme) are known by name.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use glam::{FloatExt, Vec2, Vec3};
use rayon::prelude::*;
use rubor_rig::head::{Head, Material, Provenance, ProvenanceKind};
use rubor_rig::landmarks::paired;
use rubor_rig::limits;

use super::eye_projection::EyeProjection;
use super::materials::guess_material;
use super::mtl::Library;
use super::obj::{self, GroupBy, ObjFile};
use super::obj_match::{Match, compare};
use super::tiles;
use crate::check::list;
use crate::convert::occlusion;
use crate::error::ImportError;
use crate::notes::{Note, Notes};
use crate::parts;
use crate::poly::{PolyMesh, Shape, build_head};

/// Offsets up to this part of the head's height are dropped: 0.007 mm on an adult head, below what a map texel spans.
const OFFSET_THRESHOLD: f32 = 3e-5;

/// File names (lower case, without extension) that mean the neutral mesh.
const NEUTRAL_NAMES: [&str; 6] = ["neutral", "generic_neutral_mesh", "basehead", "base_head", "base", "rest"];

/// Options of reading.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Folder of OBJ files.
    pub folder: PathBuf,
    /// Neutral file; found by name if none.
    pub neutral: Option<PathBuf>,
    /// Length of the files' unit.
    pub units: Units,
    /// Catmull-Clark steps, 0 to 2.
    pub subdivide: u32,
    /// Rays per point for ambient occlusion; 0 leaves it out.
    pub occlusion_rays: u32,
    /// SPDX licence expression for the provenance.
    pub licence: String,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            folder: PathBuf::new(),
            neutral: None,
            units: Units::Centimetres,
            subdivide: 0,
            occlusion_rays: 128,
            licence: "NOASSERTION".into(),
        }
    }
}

/// Units of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Units {
    /// mm
    Millimetres,
    /// cm
    Centimetres,
    /// dm
    Decimetres,
    /// m
    Metres,
    /// in
    Inches,
}

impl Units {
    /// Metres in one unit.
    pub fn metres(self) -> f32 {
        match self {
            Self::Millimetres => 0.001,
            Self::Centimetres => 0.01,
            Self::Decimetres => 0.1,
            Self::Metres => 1.0,
            Self::Inches => 0.0254,
        }
    }
}

impl std::fmt::Display for Units {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Millimetres => "millimetres",
            Self::Centimetres => "centimetres",
            Self::Decimetres => "decimetres",
            Self::Metres => "metres",
            Self::Inches => "inches",
        })
    }
}

impl std::str::FromStr for Units {
    type Err = String;

    /// `mm`, `cm`, `dm`, `m` or `in`.
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "mm" => Ok(Self::Millimetres),
            "cm" => Ok(Self::Centimetres),
            "dm" => Ok(Self::Decimetres),
            "m" => Ok(Self::Metres),
            "in" => Ok(Self::Inches),
            _ => Err(format!("found {text:?}, expected mm, cm, dm, m or in")),
        }
    }
}

/// A head and what there is to say about its files.
#[derive(Clone, Debug)]
pub struct ImportedSet {
    /// The head, validated.
    pub head: Head,
    /// Notes on everything that was left out, guessed or repaired.
    pub notes: Vec<Note>,
}

/// Reads the set without its notes; see [`read`].
///
/// # Errors
/// As [`read`].
pub fn import(options: &Options) -> Result<Head, ImportError> {
    read(options).map(|set| set.head)
}

/// Reads the set.
///
/// # Errors
/// Unreadable folder or files, no neutral mesh, a shape with another number of points or other faces, broken lines.
pub fn read(options: &Options) -> Result<ImportedSet, ImportError> {
    let folder = &options.folder;
    if options.subdivide > 2 {
        let found = options.subdivide.to_string();
        return Err(ImportError::content(folder, "option subdivide", found, "0, 1 or 2"));
    }
    let files = obj_files(folder)?;
    let neutral = find_neutral(options, &files)?;
    let mut notes = Notes::default();
    let said = |notes: &mut Notes, file: &Path, of_file: &[Note]| {
        for note in of_file {
            let places = list(&note.places);
            let place =
                if places.is_empty() { file_name(file) } else { format!("{} ({places})", file_name(file)) };
            notes.add(&note.message, place);
        }
    };
    let ObjFile { mut mesh, libraries, notes: of_neutral } = obj::read(&neutral, GroupBy::Material)?;
    said(&mut notes, &neutral, &of_neutral);
    let scale = options.units.metres();
    mesh.points.iter_mut().for_each(|p| *p *= scale);

    let shape_files: Vec<&PathBuf> = files.iter().filter(|f| **f != neutral).collect();
    let numbers = 3 * mesh.points.len() as u64 * shape_files.len() as u64;
    limits::within("numbers of shapes", numbers, limits::Limits::of_process().numbers())
        .map_err(|(found, expected)| ImportError::content(folder, "folder", found, expected))?;
    let read_shape = |path: &&PathBuf| -> Result<(Shape, Match, Vec<Note>), ImportError> {
        let ObjFile { mesh: shape, notes, .. } = obj::read_points(path, GroupBy::Material)?;
        if shape.points.len() != mesh.points.len() {
            let found = shape.points.len().to_string();
            let expected = format!("{} as in {}", mesh.points.len(), neutral.display());
            return Err(ImportError::content(path, "positions", found, expected));
        }
        let found = compare(&mesh, &shape);
        let place = |p: usize| match &found {
            Match::ByFaces(shape_of) | Match::ByUvs(shape_of) => {
                shape_of[p].map(|p| shape.points[p as usize])
            }
            _ => Some(shape.points[p]),
        };
        let offset = |(p, rest): (usize, &Vec3)| place(p).map_or(Vec3::ZERO, |place| place * scale - *rest);
        let offsets = mesh.points.iter().enumerate().map(offset).collect();
        if let Match::Different(face) = found {
            let corners: Vec<u32> = shape.face(face).iter().map(|c| c.point + 1).collect();
            let found = format!("points {corners:?}, which are no face of {}", neutral.display());
            let expected = "the faces of the neutral mesh: export both with the same order of vertices";
            return Err(ImportError::content(path, format!("face {}", face + 1), found, expected));
        }
        Ok((Shape { name: file_stem(path), offsets }, found, notes))
    };
    let read = shape_files.par_iter().map(read_shape).collect::<Result<Vec<_>, ImportError>>()?;
    let mut shapes = Vec::with_capacity(read.len());
    for ((shape, matched, of_file), path) in read.into_iter().zip(shape_files) {
        match matched {
            Match::ByFaces(_) => {
                notes.add("points in another order than the neutral's are matched by faces", file_name(path));
            }
            Match::ByUvs(_) => {
                let message = "points in another order than the neutral's are matched by texture coordinates";
                notes.add(message, file_name(path));
            }
            Match::OrderWithOtherUvs => {
                let message = "shapes with other texture coordinates are matched by the order of points and their faces";
                notes.add(message, file_name(path));
            }
            Match::NoFaces => {
                notes.add("shapes without faces are matched by the order of points alone", file_name(path));
            }
            Match::Order | Match::Different(_) => {}
        }
        // Groups and texture coordinates are those of the neutral file.
        let about_points =
            |n: &&Note| !["texture coordinates", "parts"].iter().any(|w| n.message.contains(w));
        let of_file: Vec<Note> = of_file.iter().filter(about_points).cloned().collect();
        said(&mut notes, path, &of_file);
        shapes.push(shape);
    }

    split_lining(&mut mesh);
    let mut materials: Vec<(String, Material)> =
        mesh.groups.iter().map(|g| (g.clone(), material_of(g))).collect();
    let eyes = project_eyes(&mut mesh, &mut materials);
    tiles::pack(&mut mesh, &materials);
    for _ in 0..options.subdivide {
        (mesh, shapes) = mesh.subdivide(&shapes);
    }
    let groups: Vec<(&str, &str, Material)> =
        materials.iter().map(|(g, m)| (g.as_str(), g.as_str(), *m)).collect();
    let height = mesh.points.iter().map(|p| p.y).fold(f32::MIN, f32::max)
        - mesh.points.iter().map(|p| p.y).fold(f32::MAX, f32::min);
    let (mut head, _) = build_head(&mesh, &shapes, &groups, OFFSET_THRESHOLD * height);
    head.name = folder.file_name().map_or_else(|| file_stem(&neutral), |n| n.to_string_lossy().into_owned());
    head.landmarks = landmarks(folder, &mesh, &eyes)?;
    for note in parts::fit_coordinates(&mut head, false) {
        note.places.iter().for_each(|place| notes.add(&note.message, place.as_str()));
    }
    Library::read(folder, &libraries, &mut notes).give(&mut head, &mut notes);
    let source = format!("{} and {} shapes, OBJ", file_name(&neutral), shapes.len());
    for of in ["geometry", "shapes"] {
        head.provenance.push(Provenance {
            of: of.into(),
            kind: ProvenanceKind::Measured,
            source: source.clone(),
            licence: options.licence.clone(),
        });
    }
    if options.occlusion_rays > 0 {
        occlusion::bake(&mut head, options.occlusion_rays);
        // Differences of the same rays: half of them have as little noise.
        occlusion::bake_shapes(&mut head, options.occlusion_rays.div_ceil(2), &occlusion::SHAPES);
    }
    head.validate()?;
    Ok(ImportedSet { head, notes: notes.into_vec() })
}

fn file_stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// OBJ files of the folder, sorted by name.
fn obj_files(folder: &Path) -> Result<Vec<PathBuf>, ImportError> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(ImportError::read(folder))? {
        let path = entry.map_err(ImportError::read(folder))?.path();
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj")) {
            files.push(path);
        }
    }
    files.sort();
    if files.is_empty() {
        return Err(ImportError::content(
            folder,
            "folder",
            "no *.obj files",
            "a neutral mesh and one per shape",
        ));
    }
    Ok(files)
}

fn find_neutral(options: &Options, files: &[PathBuf]) -> Result<PathBuf, ImportError> {
    if let Some(neutral) = &options.neutral {
        // Given relative to the folder or as it stands.
        let inside = options.folder.join(neutral);
        return Ok(if inside.exists() { inside } else { neutral.clone() });
    }
    let named = |name: &&str| files.iter().find(|f| file_stem(f).to_lowercase() == **name);
    NEUTRAL_NAMES.iter().find_map(named).cloned().ok_or_else(|| {
        let found = format!("{} OBJ files, none of them", files.len());
        ImportError::content(
            &options.folder,
            "folder",
            found,
            format!("one named {}", NEUTRAL_NAMES.join(", ")),
        )
    })
}

/// Suffix that [`split_lining`] gives.
const LINING: &str = " lining";

fn material_of(group: &str) -> Material {
    if group.ends_with(LINING) { Material::Mucosa } else { guess_material(group) }
}

/// Point ranges of the mouth and eye sockets of ICT-FaceKit (its README), and the number of its points.
const ICT_POINTS: usize = 26719;
const ICT_LINING: std::ops::Range<u32> = 11248..14062;

/// ICT-FaceKit has the lining of mouth and eye sockets in the material of the face: gives it groups of its own.
fn split_lining(mesh: &mut PolyMesh) {
    if mesh.points.len() != ICT_POINTS {
        return;
    }
    for f in 0..mesh.face_count() {
        if mesh.face(f).iter().all(|c| ICT_LINING.contains(&c.point)) {
            let name = format!("{}{LINING}", mesh.groups[mesh.face_groups[f] as usize]);
            if material_of(name.trim_end_matches(LINING)) == Material::Skin {
                mesh.face_groups[f] = mesh.group(&name);
            }
        }
    }
}

/// An eyeball of the set.
struct Eye {
    center: Vec3,
    left: bool,
}

/// Gives the points of eye parts, by side, the texture coordinates of [`Material::Eye`]. An iris that is a closed ball
/// inside another one (as in ICT-FaceKit, where the outer one is meant to be transparent in front) is hidden: the outer
/// one is drawn with iris and pupil.
fn project_eyes(mesh: &mut PolyMesh, parts: &mut [(String, Material)]) -> Vec<Eye> {
    let mut eyes = Vec::new();
    for left in [true, false] {
        let is_eye = |f: &usize| parts[mesh.face_groups[*f] as usize].1 == Material::Eye;
        let side = |f: &usize| (mesh.points[mesh.face(*f)[0].point as usize].x > 0.0) == left;
        let faces: Vec<usize> = (0..mesh.face_count()).filter(is_eye).filter(side).collect();
        let is_iris = |f: &&usize| parts[mesh.face_groups[**f] as usize].0.to_lowercase().contains("iris");
        let points_of = |faces: &mut dyn Iterator<Item = &usize>| -> Vec<Vec3> {
            let points: BTreeSet<u32> = faces.flat_map(|f| mesh.face(*f)).map(|c| c.point).collect();
            points.iter().map(|p| mesh.points[*p as usize]).collect()
        };
        let outer = points_of(&mut faces.iter().filter(|f| !is_iris(f)));
        let iris = points_of(&mut faces.iter().filter(is_iris));
        let surface = if outer.is_empty() { &iris } else { &outer };
        if surface.is_empty() {
            continue;
        }
        let projection = EyeProjection::fit(surface);
        let behind = |p: &Vec3| (*p - projection.center).dot(projection.axis) < 0.0;
        let inner_ball = !outer.is_empty() && iris.iter().any(behind);
        let hidden: BTreeSet<u32> = if inner_ball {
            faces.iter().filter(is_iris).map(|f| mesh.face_groups[*f]).collect()
        } else {
            BTreeSet::new()
        };
        hidden.iter().for_each(|g| parts[*g as usize].1 = Material::Hidden);
        let mut uv_of: BTreeMap<u32, u32> = BTreeMap::new();
        for f in faces.into_iter().filter(|f| !hidden.contains(&mesh.face_groups[*f])) {
            for k in mesh.face_starts[f]..mesh.face_starts[f + 1] {
                let point = mesh.corners[k as usize].point;
                let uv = *uv_of.entry(point).or_insert_with(|| {
                    mesh.uvs.push(projection.uv(mesh.points[point as usize]));
                    mesh.uvs.len() as u32 - 1
                });
                mesh.corners[k as usize].uv = uv;
            }
        }
        eyes.push(Eye { center: projection.center, left });
    }
    eyes
}

/// Landmarks by the iBUG scheme of 68 points (0-based): name, point on the character's right, point on the left.
/// The scheme counts from the character's right to the left.
const IBUG_PAIRED: [(&str, usize, usize); 10] = [
    ("brow-outer", 17, 26),
    ("brow-middle", 19, 24),
    ("brow-inner", 21, 22),
    ("exocanthion", 36, 45),
    ("endocanthion", 39, 42),
    ("alare", 31, 35),
    ("cheilion", 48, 54),
    ("zygion", 1, 15),
    ("gonion", 4, 12),
    ("lid-upper", 37, 44),
];
const IBUG_MIDDLE: [(&str, usize); 7] = [
    ("sellion", 27),
    ("pronasale", 30),
    ("subnasale", 33),
    ("labrale-superius", 51),
    ("stomion", 62),
    ("labrale-inferius", 57),
    ("menton", 8),
];

fn landmarks(folder: &Path, mesh: &PolyMesh, eyes: &[Eye]) -> Result<BTreeMap<String, Vec3>, ImportError> {
    let mut landmarks: BTreeMap<String, Vec3> =
        eyes.iter().map(|eye| (paired("eye", eye.left), eye.center)).collect();
    let path = folder.join("vertex_indices.json");
    if path.exists() {
        let points = ibug_points(&path, mesh)?;
        for (name, right, left) in IBUG_PAIRED {
            landmarks.insert(paired(name, true), points[left]);
            landmarks.insert(paired(name, false), points[right]);
        }
        // The scheme has two points a lid, on either side of its middle.
        for (name, right, left) in [("lid-upper", [37, 38], [43, 44]), ("lid-lower", [40, 41], [46, 47])] {
            landmarks.insert(paired(name, true), points[left[0]].midpoint(points[left[1]]));
            landmarks.insert(paired(name, false), points[right[0]].midpoint(points[right[1]]));
        }
        for (name, point) in IBUG_MIDDLE {
            landmarks.insert(name.into(), points[point]);
        }
        landmarks.insert("stomion".into(), points[62].midpoint(points[66]));
        landmarks.insert("glabella".into(), points[21].midpoint(points[22]));
    }
    add_estimates(mesh, &mut landmarks);
    Ok(landmarks)
}

/// Positions of the 68 points of `idx_to_landmark_verts`.
fn ibug_points(path: &Path, mesh: &PolyMesh) -> Result<Vec<Vec3>, ImportError> {
    let text = limits::read_to_string(path).map_err(ImportError::read(path))?;
    let json: serde_json::Value = serde_json::from_str(&text)
        .map_err(|e| ImportError::content(path, format!("line {}", e.line()), e.to_string(), "JSON"))?;
    let list = json["idx_to_landmark_verts"].as_array().map_or(&[][..], Vec::as_slice);
    if list.len() != 68 {
        let found = format!("{} indices", list.len());
        return Err(ImportError::content(path, "idx_to_landmark_verts", found, "68"));
    }
    let point = |index: &serde_json::Value| {
        index.as_u64().and_then(|i| mesh.points.get(i as usize)).copied().ok_or_else(|| {
            let expected = format!("a point below {}", mesh.points.len());
            ImportError::content(path, "idx_to_landmark_verts", index.to_string(), expected)
        })
    };
    list.iter().map(point).collect()
}

/// Landmarks that can be found without an index: the top of the head, ears, cheeks, the projection of the glabella.
fn add_estimates(mesh: &PolyMesh, landmarks: &mut BTreeMap<String, Vec3>) {
    let skin: Vec<bool> = mesh.groups.iter().map(|g| material_of(g) == Material::Skin).collect();
    let points: Vec<Vec3> = (0..mesh.face_count())
        .filter(|f| skin[mesh.face_groups[*f] as usize])
        .flat_map(|f| mesh.face(f))
        .map(|c| mesh.points[c.point as usize])
        .collect();
    let best =
        |score: &dyn Fn(&Vec3) -> f32| points.iter().copied().max_by(|a, b| score(a).total_cmp(&score(b)));
    if let Some(top) = best(&|p| p.y) {
        landmarks.insert("vertex".into(), Vec3::new(0.0, top.y, top.z));
    }
    if let Some(between) = landmarks.get("glabella").copied() {
        // The frontmost skin of the middle line at the height of the brows.
        if let Some(p) = best(&|p| p.z - 20.0 * (p - between).truncate().length()) {
            landmarks.insert("glabella".into(), p);
        }
    }
    let (Some(sellion), Some(nose)) =
        (landmarks.get("sellion").copied(), landmarks.get("subnasale").copied())
    else {
        return;
    };
    // The upper third of the face is a little shorter than the middle one (58 against 67 mm in adults).
    if let Some(glabella) = landmarks.get("glabella").copied() {
        let hairline = Vec2::new(0.0, glabella.y + 0.86 * (glabella.y - nose.y));
        if let Some(p) = best(&|p| p.z - 20.0 * (p.truncate() - hairline).length()) {
            landmarks.insert("trichion".into(), p);
        }
    }
    for (left, sign) in [(true, 1.0), (false, -1.0)] {
        // The scheme marks the nostrils: the wing is what stands out furthest beside them.
        let tip = landmarks.get("pronasale").copied().unwrap_or(nose);
        let wing =
            |p: &Vec3| (nose.y - 0.002..tip.y).contains(&p.y) && p.z > nose.z - 0.006 && p.x.abs() < 0.024;
        if let Some(p) = best(&|p| if wing(p) { sign * p.x } else { f32::MIN }) {
            landmarks.insert(paired("alare", left), p);
        }
        // Ears stick out furthest between the levels of eyes and nose.
        let level = |p: &Vec3| p.y < sellion.y + 0.01 && p.y > nose.y;
        if let Some(p) = best(&|p| if level(p) { sign * p.x } else { f32::MIN }) {
            landmarks.insert(paired("ear", left), p);
        }
        // The apple of the cheek: below the outer half of the eye, at the level of the nose's wing.
        let (Some(outer), Some(inner), Some(wing)) = (
            landmarks.get(&paired("exocanthion", left)).copied(),
            landmarks.get(&paired("endocanthion", left)).copied(),
            landmarks.get(&paired("alare", left)).copied(),
        ) else {
            continue;
        };
        let target = Vec2::new(inner.x.lerp(outer.x, 0.75), wing.y + 0.25 * (outer.y - wing.y));
        if let Some(p) = best(&|p| p.z - 20.0 * (p.truncate() - target).length()) {
            landmarks.insert(paired("cheek", left), p);
        }
    }
}
