//! The head: geometry, blend shapes and maps as plain arrays.
//!
//! Space of a head: metres, right-handed, +Y up, +Z out of the face, +X the character's left (glTF's axes).
//! Scattering lengths are in millimetres; [`MM_PER_METRE`] is the one place where the two meet.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::authored::Authored;
use crate::error::HeadError;
use crate::map::Map;

/// Millimetres in a metre: the one conversion between head space and scattering lengths.
pub const MM_PER_METRE: f32 = 1000.0;

/// Reflectance of skin seen head on, with the index 1.4: that of a specular intensity of 1 ([`SkinMaps::specular`]).
pub const SKIN_F0: f32 = 0.028;
/// The same of glTF's materials, with the index 1.5, and so of skin that has a colour by itself.
pub const BASE_COLOR_F0: f32 = 0.04;

/// A face with everything that does not change while it acts.
#[derive(Clone, Debug, Default)]
pub struct Head {
    /// Shown in reports; not unique.
    pub name: String,
    /// Rest geometry.
    pub mesh: Mesh,
    /// Blend shapes, in the order of the morph targets of the head's file.
    pub shapes: Vec<BlendShape>,
    /// Chromophore, normal, specular and wrinkle maps. A head without measured maps may have none.
    pub maps: SkinMaps,
    /// Materials that the author gave to parts that rubor has none of its own for.
    pub authored: Authored,
    /// Anatomical points of the rest surface by name (see [`crate::landmarks`]), metres.
    pub landmarks: BTreeMap<String, Vec3>,
    /// Sources of geometry and maps.
    pub provenance: Vec<Provenance>,
}

/// Rest geometry of a head.
///
/// A *point* is a place of the surface with one smooth normal; a *vertex* is a point with a texture coordinate.
/// Shapes move points, so two vertices of one point can never come apart: a texture seam cannot crack.
/// An edge that is meant to be sharp has two points at one place.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Rest positions, metres.
    pub points: Vec<Vec3>,
    /// Ambient visibility of each point in the rest pose, 0 (buried) to 1 (open); empty means 1 everywhere.
    pub occlusion: Vec<f32>,
    /// Corners of triangles.
    pub vertices: Vec<Vertex>,
    /// Counter-clockwise seen from outside; indices into `vertices`.
    pub triangles: Vec<[u32; 3]>,
    /// Contiguous, non-overlapping ranges of `triangles` that together cover all of them.
    pub parts: Vec<Part>,
}

/// A corner of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Index into [`Mesh::points`].
    pub point: u32,
    /// Texture coordinate with the glTF convention: (0, 0) is the upper left corner of the image.
    /// Eyes use the azimuthal projection of [`Material::Eye`] instead.
    pub uv: Vec2,
}

/// Triangles of one material.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Name in the source file, for messages.
    pub name: String,
    /// Material that it is shaded with.
    pub material: Material,
    /// Range of [`Mesh::triangles`].
    pub triangles: Range<u32>,
}

/// What a part is made of, and so how it is shaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Material {
    /// Skin with chromophore maps and subsurface scattering.
    Skin,
    /// Lining of mouth and eye sockets: wet, red, without maps.
    Mucosa,
    /// Eyeball. `uv` = (0.5, 0.5) + (cos phi, sin phi) theta / (2 pi), where theta is the rest angle from the pupil
    /// axis at the centre of the eye and phi the rest angle around it (phi = 0 towards +X, pi/2 towards -Y,
    /// as v grows downwards). Iris and pupil are circles about (0.5, 0.5). Importers stretch theta so that the limbus,
    /// the rim of the iris, has the texture radius 0.0819 on every eye: asin(5.9 / 12) / (2 pi), an anatomical one.
    Eye,
    /// Teeth.
    Teeth,
    /// Gums and tongue.
    Gums,
    /// Lashes: hair cards. `uv.x` runs along the lid, `uv.y` from root (0) to tip (1).
    Lash,
    /// Hair strands and cards that are not lashes.
    Hair,
    /// Thin transparent shells over the eye (tear line, lacrimal fluid): a blended overlay.
    Wet,
    /// Helper shells that darken or blend the eye in other renderers; never drawn here.
    Hidden,
    /// Anything else: drawn in the material of its author ([`Head::authored`]), diffuse grey where it has none.
    Other,
}

impl Material {
    /// Every material, in the order of the numbers that the renderer gives them.
    pub const ALL: [Material; 10] = [
        Material::Skin,
        Material::Mucosa,
        Material::Eye,
        Material::Teeth,
        Material::Gums,
        Material::Lash,
        Material::Hair,
        Material::Wet,
        Material::Hidden,
        Material::Other,
    ];

    /// Its index in [`Material::ALL`], which shaders use.
    pub fn number(self) -> u32 {
        Self::ALL.iter().position(|m| *m == self).unwrap_or(0) as u32
    }

    /// True for parts that go through the visibility buffer; lashes, hair and wet shells are blended over it.
    pub fn is_opaque(self) -> bool {
        !matches!(self, Material::Lash | Material::Hair | Material::Wet | Material::Hidden)
    }
}

/// Texture radius of the limbus, the rim of the iris, on every eye ([`Material::Eye`]): that of an anatomical one, an iris
/// of 5.9 mm radius on a ball of 12 mm, asin(5.9 / 12) / (2 pi).
pub const LIMBUS_UV: f32 = 0.0819;
/// Radius of the ball of that eye, mm.
pub const EYE_RADIUS_MM: f32 = 12.0;

/// A named displacement of some points. The offset at weight w is w times the offset here.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BlendShape {
    /// Canonical name (see [`crate::names`]) where one is known.
    pub name: String,
    /// Points that move, strictly increasing indices into [`Mesh::points`].
    pub points: Vec<u32>,
    /// Displacement at weight 1 of each of them, metres.
    pub offsets: Vec<Vec3>,
    /// Changes of [`Mesh::occlusion`], also of points that do not move; points strictly increasing. Empty where the
    /// shape changes nothing or the changes were not measured.
    pub occlusion: Vec<OcclusionChange>,
}

/// Change of the ambient visibility of a point by a blend shape: opening the jaw by half does more than half.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OcclusionChange {
    /// Index into [`Mesh::points`].
    pub point: u32,
    /// At weight 0.5, -1 to 1.
    pub at_half: f32,
    /// At weight 1, -1 to 1.
    pub at_full: f32,
}

impl OcclusionChange {
    /// Change at a weight, which is clamped to 0 to 1: the parabola through rest and both values.
    pub fn at(&self, weight: f32) -> f32 {
        let w = weight.clamp(0.0, 1.0);
        4.0 * w * (1.0 - w) * self.at_half + w * (2.0 * w - 1.0) * self.at_full
    }
}

/// The maps of a head, all in its texture space. Each is optional; a missing map has no effect.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SkinMaps {
    /// Colour that the skin has by itself in the neutral state, make-up, brows and stubble included: linear Rec. 709
    /// albedo 0 to 1, 3 channels. With it melanin and hemoglobin say no more than how blood moves that colour
    /// ([`crate::skin::chromophores::SkinLookup::change`]); without it the colour is the look-up's.
    pub albedo: Option<Map>,
    /// Melanin volume fraction of the epidermis, 0 to 0.5 (Jimenez 2012 table 7.1), 1 channel.
    pub melanin: Option<Map>,
    /// Hemoglobin volume fraction of the dermis in the neutral state, 0 to 0.32, 1 channel: `H_n`.
    pub hemoglobin: Option<Map>,
    /// Local mean of the neutral hemoglobin, `mu_n` of Jimenez 2012 eq. 7.3, with the disk that the distributions were
    /// measured with; 1 channel, low resolution. Needed where there are distributions.
    pub hemoglobin_mean: Option<Map>,
    /// Hemoglobin distributions of expressions and conditions; the neutral one is implied.
    pub distributions: Vec<Distribution>,
    /// Surface slopes (n_x/n_z, n_y/n_z) of pores and fine lines, tangent space, y towards -v (up), 2 channels.
    pub slopes: Option<Map>,
    /// Wrinkle slopes, same convention as `slopes`; each zone names the one it fades in.
    pub wrinkle_slopes: Vec<Map>,
    /// Areas whose wrinkles appear together.
    pub zones: Vec<WrinkleZone>,
    /// Specular: channel 0 reflectance head on over [`SKIN_F0`], 0 to 1, or to `BASE_COLOR_F0 / SKIN_F0` of skin with a colour by
    /// itself; channel 1 Beckmann roughness m, of the latter alpha of GGX, which is the same width of slopes, 0 to 1.
    pub specular: Option<Map>,
    /// Subsurface scattering strength 0 to 1, 1 channel (0 at brows, stubble and nails).
    pub scattering: Option<Map>,
    /// Share of the skin under short hair that is drawn with it (brows, stubble, cropped scalp), 0 to 1, 1 channel.
    pub hair: Option<Map>,
    /// Albedo of that hair, linear Rec. 709.
    pub hair_color_linear: [f32; 3],
    /// Most single hairs of the scalp that are drawn, standing for all that would grow; none draws all.
    pub hair_count: Option<u32>,
}

/// A target hemoglobin distribution as local statistics (Jimenez 2012 eq. 7.5), low resolution.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution {
    /// Such as `joy`, `anger`, `exercise`, `alcohol`.
    pub name: String,
    /// `sigma_i / sigma_n`, 1 channel, dimensionless.
    pub scale: Map,
    /// `mu_i`: local mean of the target, volume fraction, 1 channel.
    pub bias: Map,
}

/// A wrinkle zone (Jimenez 2012 section 8.2).
#[derive(Clone, Debug, PartialEq)]
pub struct WrinkleZone {
    /// Such as `forehead-left`.
    pub name: String,
    /// Index into [`SkinMaps::wrinkle_slopes`].
    pub wrinkle_map: u32,
    /// Weight of the zone, 0 to 1, 1 channel, low resolution.
    pub mask: Map,
}

/// The source of something and how reliable it is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Provenance {
    /// What it describes: `geometry`, `shapes`, `maps.melanin`, ...
    pub of: String,
    /// `measured`, `painted`, `synthesised` or `predicted`.
    pub kind: ProvenanceKind,
    /// Source in words: package and version, seed, author.
    pub source: String,
    /// SPDX licence expression.
    pub licence: String,
}

/// How something was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ProvenanceKind {
    /// Measured from a person or a scan.
    Measured,
    /// Made by an artist.
    Painted,
    /// Made by a program from rules.
    Synthesised,
    /// Computed from other data by a model.
    Predicted,
}

impl Head {
    /// Smallest and largest rest coordinate, metres; `None` for an empty head.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let mut points = self.mesh.points.iter();
        let first = *points.next()?;
        Some(points.fold((first, first), |(low, high), p| (low.min(*p), high.max(*p))))
    }

    /// Extent along Y, metres: the unit of geometric tolerances.
    pub fn height(&self) -> f32 {
        self.bounds().map_or(0.0, |(low, high)| high.y - low.y)
    }

    /// Index of the shape of this exact name.
    pub fn shape_index(&self, name: &str) -> Option<usize> {
        self.shapes.iter().position(|s| s.name == name)
    }

    /// Checks everything that the rest of rubor relies on: indices in range, finite numbers,
    /// parts that cover the triangles, map channels.
    ///
    /// # Errors
    /// The first violation, with its place.
    pub fn validate(&self) -> Result<(), HeadError> {
        let mesh = &self.mesh;
        let fail = |at: String, found: String, expected: &'static str| {
            Err(HeadError { head: self.name.clone(), at, found, expected })
        };
        for (i, p) in mesh.points.iter().enumerate() {
            if !p.is_finite() {
                return fail(format!("point {i}"), format!("{p}"), "finite coordinates");
            }
        }
        if !mesh.occlusion.is_empty() && mesh.occlusion.len() != mesh.points.len() {
            return fail("occlusion".into(), mesh.occlusion.len().to_string(), "one value per point");
        }
        for (i, v) in mesh.vertices.iter().enumerate() {
            if v.point as usize >= mesh.points.len() {
                return fail(format!("vertex {i}"), format!("point {}", v.point), "an existing point");
            }
            if !v.uv.is_finite() {
                return fail(format!("vertex {i}"), format!("uv {}", v.uv), "finite texture coordinates");
            }
        }
        for (i, t) in mesh.triangles.iter().enumerate() {
            if t.iter().any(|v| *v as usize >= mesh.vertices.len()) {
                return fail(format!("triangle {i}"), format!("{t:?}"), "existing vertices");
            }
        }
        let mut next = 0;
        for part in &mesh.parts {
            if part.triangles.start != next || part.triangles.end < next {
                return fail(
                    format!("part {}", part.name),
                    format!("{:?}", part.triangles),
                    "ranges that follow one another",
                );
            }
            next = part.triangles.end;
        }
        if next as usize != mesh.triangles.len() {
            return fail("parts".into(), format!("{next} triangles"), "parts that cover every triangle");
        }
        for shape in &self.shapes {
            let at = || format!("shape {}", shape.name);
            if shape.points.len() != shape.offsets.len() {
                return fail(at(), format!("{} offsets", shape.offsets.len()), "one offset per moved point");
            }
            if shape.points.windows(2).any(|w| w[0] >= w[1]) {
                return fail(at(), "unsorted points".into(), "strictly increasing points");
            }
            if shape.points.last().is_some_and(|p| *p as usize >= mesh.points.len()) {
                return fail(at(), format!("point {:?}", shape.points.last()), "an existing point");
            }
            if shape.offsets.iter().any(|o| !o.is_finite()) {
                return fail(at(), "an offset that is not finite".into(), "finite offsets");
            }
            if shape.occlusion.windows(2).any(|w| w[0].point >= w[1].point) {
                return fail(at(), "unsorted points of occlusion".into(), "strictly increasing points");
            }
            let is_change = |v: f32| (-1.0..=1.0).contains(&v);
            if let Some(c) = (shape.occlusion.iter()).find(|c| {
                c.point as usize >= mesh.points.len() || !is_change(c.at_half) || !is_change(c.at_full)
            }) {
                return fail(at(), format!("{c:?}"), "changes from -1 to 1 at an existing point");
            }
        }
        let authored = self.authored.validate(mesh.parts.len(), mesh.vertices.len());
        authored
            .and_then(|()| self.maps.validate())
            .or_else(|(at, found, expected)| fail(at, found, expected))
    }
}

impl SkinMaps {
    fn validate(&self) -> Result<(), (String, String, &'static str)> {
        let named = [
            ("albedo", &self.albedo, 3),
            ("melanin", &self.melanin, 1),
            ("hemoglobin", &self.hemoglobin, 1),
            ("hemoglobin_mean", &self.hemoglobin_mean, 1),
            ("slopes", &self.slopes, 2),
            ("specular", &self.specular, 2),
            ("scattering", &self.scattering, 1),
            ("hair", &self.hair, 1),
        ];
        for (name, map, channels) in named {
            if let Some(map) = map {
                map.check(name, channels)?;
            }
        }
        if let Some(v) = self.albedo.iter().flat_map(|m| &m.values).find(|v| !(0.0..=1.0).contains(*v)) {
            return Err(("map albedo".into(), v.to_string(), "reflectances from 0 to 1"));
        }
        for (i, map) in self.wrinkle_slopes.iter().enumerate() {
            map.check(&format!("wrinkle_slopes[{i}]"), 2)?;
        }
        if self.hemoglobin_mean.is_none() && !self.distributions.is_empty() {
            return Err(("maps".into(), "distributions".into(), "a hemoglobin_mean map with them"));
        }
        for d in &self.distributions {
            d.scale.check(&format!("distribution {} scale", d.name), 1)?;
            d.bias.check(&format!("distribution {} bias", d.name), 1)?;
        }
        for z in &self.zones {
            z.mask.check(&format!("zone {} mask", z.name), 1)?;
            if z.wrinkle_map as usize >= self.wrinkle_slopes.len() {
                let found = format!("wrinkle map {}", z.wrinkle_map);
                return Err((format!("zone {}", z.name), found, "an existing wrinkle map"));
            }
        }
        Ok(())
    }
}
