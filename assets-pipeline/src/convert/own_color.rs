//! Skin that its author textured becomes skin of rubor and keeps its colour.
//!
//! ```text
//! parts of material skin with an authored texture --sheets--> one for each material
//!   sheets --atlas-----> texture coordinates of all skin in one unit square: one sheet fills it, 2 to 4 a quarter each,
//!                        5 to 9 a ninth each
//!   base colour ------> albedo map, texel by texel --chromophores--> melanin, hemoglobin
//!   normal map -------> slopes
//!   roughness --------> specular map: alpha = roughness^2
//! ```
//!
//! The neutral skin then shows the author's colour, and blood, wrinkles and scattering are added to it. What has no place in
//! skin (metal, emission, occlusion, a coat) is named in a note.
//!
//! Parts that cannot be skin keep the material of their author, with a note: those without light (`is_unlit`), those whose
//! texture repeats across them, and those beyond the ninth material. A part with an alpha mask keeps its holes.

use std::collections::HashMap;

use glam::{Affine2, IVec2, Vec2, Vec3};
use rayon::prelude::*;
use rubor_rig::authored::{
    AlphaMode, AuthoredImage, AuthoredMaterial, AuthoredTexture, TextureTransform, Wrap,
};
use rubor_rig::color::srgb_decode;
use rubor_rig::head::{BASE_COLOR_F0, Head, Material, Provenance, ProvenanceKind, SKIN_F0};
use rubor_rig::map::Map;
use rubor_rig::mask::{Mask, resize_area};
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};

use super::ConvertError;
use super::chromophores::{self, no_larger};
use super::normals::{GreenAxis, slopes_from_normals};
use super::skin_texels::SkinTexels;
use crate::notes::{Note, Notes};

/// Largest side of a map of all sheets.
const MAX_SIDE: u32 = 4096;
/// Largest side of melanin and hemoglobin.
const CHROMOPHORE_SIDE: u32 = 2048;
/// Materials that skin can have.
const MAX_SHEETS: usize = 9;
/// How far texture coordinates may leave their sheet, in sheets: what exporters round.
const SLACK: f32 = 0.01;
/// Side of a sheet of values that do not change over it.
const EVEN_SIDE: u32 = 64;
/// Texels of the look-up along each axis.
const LOOKUP_SIZE: u32 = 128;
/// Largest slope of relief, 76 degrees: steeper texels of normal maps are noise, and the range that slopes are stored over has to
/// hold them.
const STEEPEST: f32 = 4.0;
/// Least alpha of GGX: of the lowest roughness for which three.js draws the highlight of a lamp, 0.045.
const LEAST_ROUGHNESS: f32 = 0.002;
/// Share of texels outside of the gamut from which on a note says so.
const SAID_SHARE: f64 = 0.02;

/// How skin takes over the colour of its author.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// How the chromophores are read.
    pub chromophores: chromophores::Options,
    /// Indices of parts that become skin in any case: the user says that they are.
    pub insisted: Vec<usize>,
}

/// One material of skin and its place in the atlas.
struct Sheet {
    material: u32,
    parts: Vec<usize>,
    triangles: usize,
}

impl Sheet {
    fn material<'a>(&self, head: &'a Head) -> &'a AuthoredMaterial {
        &head.authored.materials[self.material as usize]
    }
}

/// Makes textured parts of material skin skin that keeps its colour, and says what it did. Heads that have chromophores, and
/// heads whose skin has no texture, stay as they are.
///
/// # Errors
/// A gain or a threshold that is not positive.
pub fn adopt(head: &mut Head, options: &Options) -> Result<Vec<Note>, ConvertError> {
    let mut notes = Notes::default();
    if head.maps.melanin.is_some() || head.maps.albedo.is_some() {
        return Ok(Vec::new());
    }
    let mut sheets = sheets(head, options, &mut notes);
    if !sheets.iter().any(|s| s.material(head).base_color_texture.is_some()) {
        // Nothing to keep: as a head without materials.
        for sheet in &sheets {
            let material = sheet.material(head);
            if material.base_color[..3] != [1.0; 3] {
                let message =
                    "skin without a texture does not keep its plain colour: it gets that of the maps";
                notes.add(message, material.name.as_str());
            }
        }
        return Ok(notes.into_vec());
    }
    if sheets.len() > MAX_SHEETS {
        sheets.sort_by_key(|s| std::cmp::Reverse(s.triangles));
        for sheet in sheets.split_off(MAX_SHEETS) {
            let message = format!(
                "skin of more than {MAX_SHEETS} materials: the smallest keep the look of their author"
            );
            notes.add(message, sheet.material(head).name.as_str());
            sheet.parts.iter().for_each(|p| head.mesh.parts[*p].material = Material::Other);
        }
    }
    say_what_is_left_out(head, &sheets, &mut notes);
    let across = (sheets.len() as f32).sqrt().ceil() as u32;
    let layout: Vec<IVec2> =
        (0..sheets.len() as i32).map(|i| IVec2::new(i % across as i32, i / across as i32)).collect();
    let atlas = Atlas { across, layout };

    // All pictures are read before texture coordinates move.
    let albedo = atlas.albedo(head, &sheets);
    let slopes = atlas.slopes(head, &sheets, &mut notes)?;
    let specular = atlas.specular(head, &sheets);
    atlas.move_vertices(head, &sheets);
    let albedo = with_vertex_colors(head, albedo, &sheets);
    keep_holes(head, &sheets, &atlas);

    let read = no_larger(albedo.clone(), CHROMOPHORE_SIDE);
    let mask = SkinTexels::new(head, read.width, read.height).mask();
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(LOOKUP_SIZE, LOOKUP_SIZE);
    let found = chromophores::convert(&read, &mask, &lookup, &options.chromophores)?;
    say_what_was_read(&found, &mut notes);
    head.maps.albedo = Some(albedo);
    head.maps.melanin = Some(found.melanin);
    head.maps.hemoglobin = Some(found.hemoglobin);
    head.maps.slopes = slopes;
    head.maps.specular = Some(specular);
    let names: Vec<&str> = sheets.iter().map(|s| s.material(head).name.as_str()).collect();
    let source = format!("materials of the source file: {}", names.join(", "));
    let mut stamp = |of: &str, kind| {
        let of = format!("maps.{of}");
        head.provenance.retain(|p| p.of != of);
        head.provenance.push(Provenance { of, kind, source: source.clone(), licence: "NOASSERTION".into() });
    };
    stamp("albedo", ProvenanceKind::Painted);
    stamp("specular", ProvenanceKind::Painted);
    stamp("melanin", ProvenanceKind::Predicted);
    stamp("hemoglobin", ProvenanceKind::Predicted);
    if head.maps.slopes.is_some() {
        stamp("slopes", ProvenanceKind::Painted);
    }
    Ok(notes.into_vec())
}

/// Materials of the skin; parts that cannot be skin become others.
fn sheets(head: &mut Head, options: &Options, notes: &mut Notes) -> Vec<Sheet> {
    let mut sheets: Vec<Sheet> = Vec::new();
    for index in 0..head.mesh.parts.len() {
        let part = &head.mesh.parts[index];
        let Some(material) = head.authored.of_parts.get(index).copied().flatten() else { continue };
        if part.material != Material::Skin || part.triangles.is_empty() {
            continue;
        }
        let authored = &head.authored.materials[material as usize];
        let is_textured = authored.base_color_texture.is_some();
        let refused = if is_textured && authored.is_unlit && !options.insisted.contains(&index) {
            Some(
                "skin that is drawn without light keeps the look of its author (`rubor import --parts NAME=skin` lights it)",
            )
        } else if is_textured && shifts(head, part.triangles.clone(), authored).is_none() {
            Some("skin whose texture repeats across it keeps the look of its author")
        } else {
            None
        };
        if let Some(message) = refused {
            notes.add(message, part.name.as_str());
            head.mesh.parts[index].material = Material::Other;
            continue;
        }
        let triangles = part.triangles.len();
        match sheets.iter_mut().find(|s| s.material == material) {
            Some(sheet) => {
                sheet.parts.push(index);
                sheet.triangles += triangles;
            }
            None => sheets.push(Sheet { material, parts: vec![index], triangles }),
        }
    }
    sheets
}

/// Texture coordinate of a vertex on the base colour of a material.
fn base_uv(head: &Head, material: &AuthoredMaterial, vertex: u32) -> Vec2 {
    let Some(texture) = &material.base_color_texture else { return head.mesh.vertices[vertex as usize].uv };
    let uv = match texture.uv_set {
        0 => head.mesh.vertices[vertex as usize].uv,
        _ => head.authored.second_uv(vertex),
    };
    texture.transform.matrix().transform_point2(uv)
}

/// The repetition of the texture that each vertex of some triangles lies in; none where a triangle spans several.
fn shifts(
    head: &Head,
    triangles: std::ops::Range<u32>,
    material: &AuthoredMaterial,
) -> Option<HashMap<u32, Vec2>> {
    let wrap = material.base_color_texture.map_or([Wrap::Repeat; 2], |t| t.wrap);
    let mut shifts = HashMap::new();
    for triangle in &head.mesh.triangles[triangles.start as usize..triangles.end as usize] {
        let corners = triangle.map(|v| base_uv(head, material, v));
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        // Beyond the edge a texture that does not repeat shows its border, and one that is mirrored another picture.
        let shift = Vec2::new(
            if wrap[0] == Wrap::Repeat { middle.x.floor() } else { 0.0 },
            if wrap[1] == Wrap::Repeat { middle.y.floor() } else { 0.0 },
        );
        for (vertex, uv) in triangle.iter().zip(corners) {
            let inside = uv - shift;
            let is_outside = |x: f32, wrap: Wrap| wrap != Wrap::Clamp && !(-SLACK..=1.0 + SLACK).contains(&x);
            let known = *shifts.entry(*vertex).or_insert(shift);
            if known != shift || is_outside(inside.x, wrap[0]) || is_outside(inside.y, wrap[1]) {
                return None;
            }
        }
    }
    Some(shifts)
}

fn say_what_is_left_out(head: &Head, sheets: &[Sheet], notes: &mut Notes) {
    for sheet in sheets {
        let material = sheet.material(head);
        let name = material.name.as_str();
        if material.metallic > 0.0 {
            notes.add("skin is no metal: the metallic share of its material is left out", name);
        }
        if material.emission_linear != [0.0; 3] {
            notes.add("skin sends out no light: the emission of its material is left out", name);
        }
        if material.occlusion_texture.is_some() {
            notes.add(
                "occlusion maps of skin are left out: rubor computes the occlusion of the geometry",
                name,
            );
        }
        if material.clearcoat > 0.0 {
            notes.add("skin has no coat: the clear coat of its material is left out", name);
        }
        if material.dielectric_f0() > 1.01 * BASE_COLOR_F0 {
            notes.add("skin reflects no more than an index of refraction of 1.5 says", name);
        }
        if material.specular_color != [1.0; 3] || material.specular_color_texture.is_some() {
            notes.add("reflections of skin are white: the specular colour of its material is left out", name);
        }
        if material.transmission > 0.0 {
            notes.add("skin is no glass: the transmission of its material is left out", name);
        }
        if material.alpha == AlphaMode::Blend {
            notes.add("skin that is blended is cut where alpha is one half", name);
        }
    }
}

fn say_what_was_read(found: &chromophores::ChromophoreMaps, notes: &mut Notes) {
    notes.say(format!("the skin keeps its own colour; exposure of its blood: gain {}", found.exposure));
    let summary = &found.summary;
    let share = summary.out_of_gamut_texels as f64 / summary.mapped_texels.max(1) as f64;
    if summary.is_painted {
        notes.say(
            "the skin is painted in colours that skin does not have: all of it has the blood of one colour (`--gain` says its exposure)",
        );
    } else if share > SAID_SHARE {
        notes.say(format!(
            "{:.0} % of the skin has colours that skin does not have (brows, lips, make-up, shade): they stay, and their blood is that of the skin around",
            100.0 * share
        ));
    }
}

/// The sheets side by side.
struct Atlas {
    /// Sheets per row.
    across: u32,
    /// Column and row of each sheet.
    layout: Vec<IVec2>,
}

impl Atlas {
    /// A map from one map per sheet, all of this size; `empty` fills the rest.
    fn assemble(&self, tiles: &[Map], empty: &[f32]) -> Map {
        let [only] = tiles else {
            let (width, height) = (tiles[0].width, tiles[0].height);
            let channels = empty.len();
            let mut all = Map::filled(self.across * width, self.across * height, empty);
            for (tile, place) in tiles.iter().zip(&self.layout) {
                for (y, row) in tile.values.chunks_exact(width as usize * channels).enumerate() {
                    let line = place.y as usize * height as usize + y;
                    let start = (line * all.width as usize + place.x as usize * width as usize) * channels;
                    all.values[start..start + row.len()].copy_from_slice(row);
                }
            }
            return all;
        };
        only.clone()
    }

    /// The size of a sheet that holds pictures of these sizes.
    fn tile_size(&self, sizes: impl IntoIterator<Item = (u32, u32)>) -> (u32, u32) {
        let most = MAX_SIDE / self.across;
        let (w, h) = sizes.into_iter().fold((1, 1), |(w, h), size| (w.max(size.0), h.max(size.1)));
        (w.min(most), h.min(most))
    }

    /// Linear base colours.
    fn albedo(&self, head: &Head, sheets: &[Sheet]) -> Map {
        let image = |s: &Sheet| s.material(head).base_color_texture.map(|t| image_of(head, &t));
        let (w, h) = self.tile_size(sheets.iter().filter_map(image).map(|i| (i.width, i.height)));
        let tiles: Vec<Map> = sheets
            .iter()
            .map(|sheet| {
                let factor = sheet.material(head).base_color;
                let factor = [factor[0], factor[1], factor[2]];
                let Some(image) = image(sheet) else { return Map::filled(w, h, &factor) };
                let mut tile = resized(color_map(image), w, h);
                if factor != [1.0; 3] {
                    tile.values.chunks_exact_mut(3).for_each(|c| (0..3).for_each(|i| c[i] *= factor[i]));
                }
                tile
            })
            .collect();
        self.assemble(&tiles, &[0.0; 3])
    }

    /// Slopes of the normal maps; none where no sheet has one.
    fn slopes(&self, head: &Head, sheets: &[Sheet], notes: &mut Notes) -> Result<Option<Map>, ConvertError> {
        let mut texture = |sheet: &Sheet| {
            let material = sheet.material(head);
            let (base, normal) = (material.base_color_texture.as_ref(), material.normal_texture.as_ref()?);
            if material.normal_scale == 0.0 {
                return None;
            }
            if base.is_none_or(|base| !is_placed_alike(base, normal)) {
                let message = "normal maps of skin that lie otherwise than its colour are left out";
                notes.add(message, material.name.as_str());
                return None;
            }
            Some((*normal, material.normal_scale))
        };
        let textures: Vec<_> = sheets.iter().map(&mut texture).collect();
        if textures.iter().all(Option::is_none) {
            return Ok(None);
        }
        let images = textures.iter().flatten().map(|(t, _)| image_of(head, t));
        let (w, h) = self.tile_size(images.map(|i| (i.width, i.height)));
        let mut tiles = Vec::new();
        for texture in &textures {
            let Some((texture, scale)) = texture else {
                tiles.push(Map::filled(w, h, &[0.0; 2]));
                continue;
            };
            let mut slopes = slopes_from_normals(&value_map(image_of(head, texture)), GreenAxis::OpenGl)?.map;
            slopes.values.iter_mut().for_each(|s| *s = (scale * *s).clamp(-STEEPEST, STEEPEST));
            tiles.push(resized(slopes, w, h));
        }
        Ok(Some(self.assemble(&tiles, &[0.0; 2])))
    }

    /// Specular intensity, and alpha of GGX.
    fn specular(&self, head: &Head, sheets: &[Sheet]) -> Map {
        let texture = |sheet: &Sheet, which: fn(&AuthoredMaterial) -> Option<AuthoredTexture>| {
            let material = sheet.material(head);
            let (base, found) = (material.base_color_texture?, which(material)?);
            is_placed_alike(&base, &found).then_some(found)
        };
        let gloss = |sheet: &Sheet| texture(sheet, |m| m.metallic_roughness_texture);
        let strength = |sheet: &Sheet| texture(sheet, |m| m.specular_texture);
        let value = |sheet: &Sheet, strength: f32, green: f32| {
            let material = sheet.material(head);
            let f0 = (material.dielectric_f0() * material.specular * strength).min(BASE_COLOR_F0);
            [f0 / SKIN_F0, (material.roughness * green).powi(2).clamp(LEAST_ROUGHNESS, 1.0)]
        };
        let pictures =
            sheets.iter().flat_map(|s| [gloss(s), strength(s)]).flatten().map(|t| image_of(head, &t));
        let sizes: Vec<_> = pictures.map(|i| (i.width, i.height)).collect();
        let first = value(&sheets[0], 1.0, 1.0);
        if sizes.is_empty() && sheets.iter().all(|s| value(s, 1.0, 1.0) == first) {
            return Map::filled(1, 1, &first);
        }
        let (w, h) = self.tile_size(sizes.into_iter().chain([(EVEN_SIDE, EVEN_SIDE)]));
        let tile = |sheet: &Sheet| {
            let channel = |texture: Option<AuthoredTexture>, channel: usize| {
                texture.map(|t| resized(channel_map(image_of(head, &t), channel), w, h).values)
            };
            let (alpha, green) = (channel(strength(sheet), 3), channel(gloss(sheet), 1));
            let at = |values: &Option<Vec<f32>>, i: usize| values.as_ref().map_or(1.0, |v| v[i]);
            let values =
                (0..(w * h) as usize).flat_map(|i| value(sheet, at(&alpha, i), at(&green, i))).collect();
            Map { width: w, height: h, channels: 2, values }
        };
        self.assemble(&sheets.iter().map(tile).collect::<Vec<_>>(), &first)
    }

    /// Texture coordinates of skin from those of its base colour. Vertices that other parts use as well are doubled.
    fn move_vertices(&self, head: &mut Head, sheets: &[Sheet]) {
        let mut owner: Vec<Option<usize>> = vec![None; head.mesh.vertices.len()];
        let mut is_shared = vec![false; head.mesh.vertices.len()];
        let sheet_of: HashMap<usize, usize> = sheets
            .iter()
            .enumerate()
            .flat_map(|(s, sheet)| sheet.parts.iter().map(move |p| (*p, s)))
            .collect();
        for (index, part) in head.mesh.parts.iter().enumerate() {
            // Parts that are no skin own their vertices as a sheet of their own does.
            let id = sheet_of.get(&index).copied().unwrap_or(usize::MAX);
            for t in &head.mesh.triangles[part.triangles.start as usize..part.triangles.end as usize] {
                for v in t.map(|v| v as usize) {
                    is_shared[v] |= owner[v].is_some_and(|o| o != id);
                    owner[v].get_or_insert(id);
                }
            }
        }
        for (s, sheet) in sheets.iter().enumerate() {
            let material = sheet.material(head).clone();
            let mut moved: HashMap<u32, u32> = HashMap::new();
            let mut places: Vec<(u32, Vec2)> = Vec::new();
            for part in &sheet.parts {
                let triangles = head.mesh.parts[*part].triangles.clone();
                let shifts = match material.base_color_texture {
                    Some(_) => shifts(head, triangles.clone(), &material).unwrap_or_default(),
                    None => HashMap::new(),
                };
                for t in triangles {
                    for corner in 0..3 {
                        let v = head.mesh.triangles[t as usize][corner];
                        if let Some(new) = moved.get(&v) {
                            head.mesh.triangles[t as usize][corner] = *new;
                            continue;
                        }
                        let uv = match material.base_color_texture {
                            Some(_) => {
                                base_uv(head, &material, v) - shifts.get(&v).copied().unwrap_or_default()
                            }
                            // One colour: the middle of its sheet.
                            None => Vec2::splat(0.5),
                        };
                        let place = self.place(s).transform_point2(uv.clamp(Vec2::ZERO, Vec2::ONE));
                        let new = if is_shared[v as usize] { double(head, v) } else { v };
                        moved.insert(v, new);
                        head.mesh.triangles[t as usize][corner] = new;
                        places.push((new, place));
                    }
                }
            }
            places.into_iter().for_each(|(v, place)| head.mesh.vertices[v as usize].uv = place);
        }
    }

    /// From a sheet into the unit square.
    fn place(&self, sheet: usize) -> Affine2 {
        let side = 1.0 / self.across as f32;
        Affine2::from_scale(Vec2::splat(side)) * Affine2::from_translation(self.layout[sheet].as_vec2())
    }
}

/// Another vertex like one.
fn double(head: &mut Head, vertex: u32) -> u32 {
    let new = head.mesh.vertices.len() as u32;
    head.mesh.vertices.push(head.mesh.vertices[vertex as usize]);
    let authored = &mut head.authored;
    let (uv, color) = (authored.second_uv(vertex), authored.color_linear(vertex));
    if !authored.normals.is_empty() {
        let normal = authored.normal(vertex);
        authored.normals.resize(new as usize, Vec3::ZERO);
        authored.normals.push(normal);
    }
    if !authored.second_uvs.is_empty() {
        authored.second_uvs.resize(new as usize, Vec2::ZERO);
        authored.second_uvs.push(uv);
    }
    if !authored.colors_linear.is_empty() {
        authored.colors_linear.resize(new as usize, [1.0; 4]);
        authored.colors_linear.push(color);
    }
    new
}

/// Colours of vertices are factors of the albedo of the texels between them.
fn with_vertex_colors(head: &Head, mut albedo: Map, sheets: &[Sheet]) -> Map {
    let parts = sheets.iter().flat_map(|s| &s.parts).map(|p| head.mesh.parts[*p].triangles.clone());
    let mut corners = parts.flatten().flat_map(|t| head.mesh.triangles[t as usize]);
    if corners.all(|v| head.authored.color_linear(v)[..3] == [1.0; 3]) {
        return albedo;
    }
    let (width, height) = (albedo.width, albedo.height);
    let texels = SkinTexels::new(head, width, height);
    for (i, color) in albedo.values.chunks_exact_mut(3).enumerate() {
        let Some((triangle, weights)) = texels.at(i as u32 % width, i as u32 / width) else { continue };
        let of_corners = head.mesh.triangles[triangle as usize].map(|v| head.authored.color_linear(v));
        for c in 0..3 {
            let factor = (0..3).map(|k| weights[k].max(0.0) * of_corners[k][c]).sum::<f32>();
            color[c] = (color[c] * factor).clamp(0.0, 1.0);
        }
    }
    albedo
}

/// Parts with an alpha mask that cuts some of them keep their material for its alpha, in the place that it now has; others
/// need theirs no more.
fn keep_holes(head: &mut Head, sheets: &[Sheet], atlas: &Atlas) {
    for (s, sheet) in sheets.iter().enumerate() {
        let material = sheet.material(head);
        let kept =
            material.cutoff().filter(|cutoff| has_holes(head, sheet, *cutoff, atlas, s)).map(|cutoff| {
                let mut kept = material.clone();
                kept.alpha = AlphaMode::Mask { cutoff };
                let base = material.base_color_texture;
                let moved = |texture: Option<AuthoredTexture>| {
                    let texture = texture.filter(|t| base.is_some_and(|b| is_placed_alike(&b, t)))?;
                    Some(AuthoredTexture { uv_set: 0, transform: back(atlas, s), ..texture })
                };
                kept.base_color_texture = moved(kept.base_color_texture);
                kept.metallic_roughness_texture = moved(kept.metallic_roughness_texture);
                kept.normal_texture = moved(kept.normal_texture);
                kept.occlusion_texture = moved(kept.occlusion_texture);
                kept.emission_texture = moved(kept.emission_texture);
                kept
            });
        let index = kept.map(|kept| {
            head.authored.materials.push(kept);
            head.authored.materials.len() as u32 - 1
        });
        sheet.parts.iter().for_each(|p| head.authored.of_parts[*p] = index);
    }
}

/// From the unit square to a sheet.
fn back(atlas: &Atlas, sheet: usize) -> TextureTransform {
    TextureTransform {
        offset: -atlas.layout[sheet].as_vec2(),
        rotation_radians: 0.0,
        scale: Vec2::splat(atlas.across as f32),
    }
}

/// Whether a texel of some skin, which lies in its atlas, has less alpha than the cutoff.
fn has_holes(head: &Head, sheet: &Sheet, cutoff: f32, atlas: &Atlas, index: usize) -> bool {
    let material = sheet.material(head);
    let factor = material.base_color[3];
    let triangles = || sheet.parts.iter().flat_map(|p| head.mesh.parts[*p].triangles.clone());
    let mut vertices = triangles().flat_map(|t| head.mesh.triangles[t as usize]);
    if vertices.any(|v| factor * head.authored.color_linear(v)[3] < cutoff) {
        return true;
    }
    let Some(texture) = material.base_color_texture else { return false };
    let image = image_of(head, &texture);
    if image.rgba.chunks_exact(4).all(|t| factor * f32::from(t[3]) / 255.0 >= cutoff) {
        return false;
    }
    let (width, height) = (image.width, image.height);
    let texels = SkinTexels::new(head, atlas.across * width, atlas.across * height);
    let corner = atlas.layout[index].as_uvec2() * glam::UVec2::new(width, height);
    (0..width * height).any(|i| {
        let (x, y) = (i % width, i / width);
        let alpha = f32::from(image.rgba[4 * i as usize + 3]) / 255.0;
        factor * alpha < cutoff && texels.at(corner.x + x, corner.y + y).is_some()
    })
}

fn image_of<'a>(head: &'a Head, texture: &AuthoredTexture) -> &'a AuthoredImage {
    &head.authored.images[texture.image as usize]
}

/// Both textures show the same place of their picture at every vertex.
fn is_placed_alike(a: &AuthoredTexture, b: &AuthoredTexture) -> bool {
    a.uv_set == b.uv_set && a.transform == b.transform && a.wrap == b.wrap
}

/// Linear colours of a picture.
fn color_map(image: &AuthoredImage) -> Map {
    let decode: Vec<f32> = (0..=255u8).map(|byte| srgb_decode(f32::from(byte) / 255.0)).collect();
    map_of(image, &decode)
}

/// Codes 0 to 1 of one channel of a picture.
fn channel_map(image: &AuthoredImage, channel: usize) -> Map {
    let values = image.rgba.chunks_exact(4).map(|t| f32::from(t[channel]) / 255.0).collect();
    Map { width: image.width, height: image.height, channels: 1, values }
}

/// Codes 0 to 1 of a picture.
fn value_map(image: &AuthoredImage) -> Map {
    let decode: Vec<f32> = (0..=255u8).map(|byte| f32::from(byte) / 255.0).collect();
    map_of(image, &decode)
}

fn map_of(image: &AuthoredImage, decode: &[f32]) -> Map {
    let texel = |t: &[u8]| [t[0], t[1], t[2]].map(|byte| decode[usize::from(byte)]);
    let values = image.rgba.par_chunks_exact(4).with_min_len(4096).flat_map_iter(texel).collect();
    Map { width: image.width, height: image.height, channels: 3, values }
}

/// A map of another size: means where it shrinks, linear between texels where it grows.
fn resized(map: Map, width: u32, height: u32) -> Map {
    if (map.width, map.height) == (width, height) {
        return map;
    }
    let (w, h) = (map.width.min(width), map.height.min(height));
    let small = match (w, h) == (map.width, map.height) {
        true => map,
        false => resize_area(&map, &Mask::full(map.width, map.height), w, h).0,
    };
    if (w, h) == (width, height) {
        return small;
    }
    let values = (0..width * height)
        .into_par_iter()
        .with_min_len(4096)
        .flat_map_iter(|i| {
            let (u, v) = ((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
            let small = &small;
            (0..small.channels).map(move |c| small.sample(u / width as f32, v / height as f32, c))
        })
        .collect();
    Map { width, height, channels: small.channels, values }
}

#[cfg(test)]
mod tests;
