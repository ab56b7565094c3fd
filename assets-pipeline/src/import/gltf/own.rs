//! Files that carry `RUBOR_facial_appearance`: everything as it was written.

use std::path::Path;

use glam::{Vec2, Vec3};
use gltf::Semantic;
use rubor_rig::authored::Authored;
use rubor_rig::color::srgb_decode;
use rubor_rig::head::{
    BlendShape, Distribution, Head, Mesh, OcclusionChange, Part, SkinMaps, Vertex, WrinkleZone,
};
use rubor_rig::map::Map;

use super::document::{Document, Share};
use super::materials::Materials;
use super::motion::{Driver, Motion};
use super::{ImportedHead, accessor, foreign, names};
use crate::error::ImportError;
use crate::facial_appearance::{ChannelLayout, FacialAppearance, MapEntries, MapEntry, NAME, VERSION};
use crate::image_io::{Limits, decode_stored};
use crate::notes::Notes;

pub(super) fn read(
    document: &Document,
    extension: &serde_json::Value,
    motion: &Motion,
    notes: &mut Notes,
) -> Result<(ImportedHead, Vec<(String, Driver)>), ImportError> {
    let version = &extension["version"];
    if version.as_u64() != Some(u64::from(VERSION)) {
        return Err(document.fail(NAME, format!("version {version}"), format!("version {VERSION}")));
    }
    let extension: FacialAppearance = serde_json::from_value(extension.clone())
        .map_err(|e| document.fail(NAME, e.to_string(), "the published schema"))?;
    let source = document
        .gltf
        .meshes()
        .nth(extension.mesh as usize)
        .ok_or_else(|| document.fail(NAME, format!("mesh {}", extension.mesh), "an existing mesh"))?;
    let (mesh, shapes) = geometry(document, &source, &extension)?;
    let mut authored = authored(document, &source, &extension, notes)?;
    if extension.authored_normals {
        authored.normals = normals(document, &source)?;
    }
    let mut head = Head {
        name: extension.name,
        mesh,
        shapes,
        maps: maps(document, &extension.maps)?,
        authored,
        landmarks: extension.landmarks.into_iter().map(|(name, p)| (name, Vec3::from_array(p))).collect(),
        provenance: extension.provenance,
    };
    if let Some(index) = extension.occlusion {
        let at = format!("{NAME}, occlusion");
        let values = accessor::floats::<1>(document, &at, &accessor::by_index(document, &at, index)?)?;
        head.mesh.occlusion = values.into_iter().map(|[v]| v).collect();
    }
    for entry in &extension.shape_occlusion {
        let at = format!("{NAME}, occlusion of shape {}", entry.shape);
        let points = accessor::integers(document, &at, &accessor::by_index(document, &at, entry.points)?)?;
        let changes =
            accessor::floats::<2>(document, &at, &accessor::by_index(document, &at, entry.changes)?)?;
        if points.len() != changes.len() {
            let found = format!("{} points and {} changes", points.len(), changes.len());
            return Err(document.fail(&at, found, "as many of each"));
        }
        let Some(index) = head.shape_index(&entry.shape) else {
            return Err(document.fail(&at, "no such shape", "one of the mesh's targetNames"));
        };
        head.shapes[index].occlusion = (points.into_iter().zip(changes))
            .map(|(point, [at_half, at_full])| OcclusionChange { point, at_half, at_full })
            .collect();
    }
    let node = document.gltf.nodes().find(|n| n.mesh().is_some_and(|m| m.index() == source.index()));
    let drivers = head.shapes.iter().enumerate().map(|(t, shape)| {
        let driver = motion.driver(node.as_ref().map(gltf::Node::index), &source, t);
        (shape.name.clone(), driver)
    });
    let drivers = drivers.collect();
    let imported =
        ImportedHead { head, rig: extension.rig, sequence: extension.sequence, ..ImportedHead::default() };
    Ok((imported, drivers))
}

fn geometry(
    document: &Document,
    source: &gltf::Mesh<'_>,
    extension: &FacialAppearance,
) -> Result<(Mesh, Vec<BlendShape>), ImportError> {
    let (names, _) = names::of_mesh(document, source);
    let names: Vec<String> = names.into_iter().map(|n| n.text).collect();
    let count = source.primitives().count();
    if extension.parts.len() != count {
        let found = format!("{} parts", extension.parts.len());
        return Err(document.fail(NAME, found, format!("one for each of the {count} primitives")));
    }
    let point_count = extension.point_count as usize;
    let counts = source.primitives().filter_map(|p| p.get(&Semantic::Positions)).map(|a| a.count());
    let vertex_count = counts.fold(0, usize::saturating_add);
    if point_count > vertex_count {
        return Err(document.fail(
            NAME,
            format!("{point_count} points"),
            format!("at most {vertex_count}, one per vertex"),
        ));
    }
    let mut mesh = Mesh { points: vec![Vec3::ZERO; point_count], ..Mesh::default() };
    document.take(NAME, Share::Vertices, vertex_count)?;
    let mut shapes: Vec<Vec<(u32, Vec3)>> = vec![Vec::new(); names.len()];
    for (i, (primitive, part)) in source.primitives().zip(&extension.parts).enumerate() {
        let at = |what: &str| format!("mesh {}, primitive {i}, {what}", source.index());
        let need = |semantic: &Semantic, what: &str| {
            primitive.get(semantic).ok_or_else(|| document.fail(&at(what), "nothing", "an accessor"))
        };
        let positions =
            accessor::floats::<3>(document, &at("POSITION"), &need(&Semantic::Positions, "POSITION")?)?;
        let uvs = accessor::floats::<2>(
            document,
            &at("TEXCOORD_0"),
            &need(&Semantic::TexCoords(0), "TEXCOORD_0")?,
        )?;
        let indices =
            primitive.indices().ok_or_else(|| document.fail(&at("indices"), "nothing", "an accessor"))?;
        let indices = accessor::integers(document, &at("indices"), &indices)?;
        let points = accessor::by_index(document, &at("points"), part.points)?;
        let points = accessor::integers(document, &at("points"), &points)?;
        if points.len() != positions.len() || uvs.len() != positions.len() {
            let found = format!("{} points and {} texture coordinates", points.len(), uvs.len());
            return Err(document.fail(&at("attributes"), found, format!("{} of each", positions.len())));
        }
        if let Some(p) = points.iter().find(|p| **p as usize >= point_count) {
            return Err(document.fail(
                &at("points"),
                format!("point {p}"),
                format!("one below {point_count}"),
            ));
        }
        if indices.len() % 3 != 0 || indices.iter().any(|v| *v as usize >= positions.len()) {
            let found = format!("{} indices up to {:?}", indices.len(), indices.iter().max());
            return Err(document.fail(
                &at("indices"),
                found,
                format!("triangles of vertices below {}", positions.len()),
            ));
        }
        let first = mesh.vertices.len() as u32;
        for (v, p) in points.iter().enumerate() {
            mesh.points[*p as usize] = Vec3::from_array(positions[v]);
            mesh.vertices.push(Vertex { point: *p, uv: Vec2::from_array(uvs[v]) });
        }
        let start = mesh.triangles.len() as u32;
        mesh.triangles.extend(indices.chunks_exact(3).map(|t| [0, 1, 2].map(|k| first + t[k])));
        let end = mesh.triangles.len() as u32;
        mesh.parts.push(Part { name: part.name.clone(), material: part.material, triangles: start..end });

        if primitive.morph_targets().count() != names.len() {
            let found = format!("{} morph targets", primitive.morph_targets().count());
            return Err(document.fail(&at("targets"), found, format!("{} as in targetNames", names.len())));
        }
        for (t, target) in primitive.morph_targets().enumerate() {
            let Some(offsets) = target.positions() else { continue };
            let offsets = accessor::floats::<3>(document, &at(&format!("target {t}")), &offsets)?;
            for (p, offset) in points.iter().zip(offsets) {
                // Values that are not stored are zero; -0 only comes from a stored offset.
                if offset.iter().any(|c| c.to_bits() != 0) {
                    shapes[t].push((*p, Vec3::from_array(offset)));
                }
            }
        }
    }
    let shapes = names.into_iter().zip(shapes).map(|(name, mut moved)| {
        // Vertices of one point have one offset; of others the last one counts.
        moved.reverse();
        moved.sort_by_key(|(p, _)| *p);
        moved.dedup_by_key(|(p, _)| *p);
        let (points, offsets) = moved.into_iter().unzip();
        BlendShape { name, points, offsets, ..BlendShape::default() }
    });
    Ok((mesh, shapes.collect()))
}

/// Normals of all vertices.
fn normals(document: &Document, source: &gltf::Mesh<'_>) -> Result<Vec<Vec3>, ImportError> {
    let mut normals = Vec::new();
    for (i, primitive) in source.primitives().enumerate() {
        let at = format!("mesh {}, primitive {i}, NORMAL", source.index());
        let count = primitive.get(&Semantic::Positions).map_or(0, |a| a.count());
        let accessor =
            primitive.get(&Semantic::Normals).ok_or_else(|| document.fail(&at, "nothing", "an accessor"))?;
        let found = accessor::floats::<3>(document, &at, &accessor)?;
        if found.len() != count {
            return Err(document.fail(
                &at,
                format!("{} elements", found.len()),
                format!("{count}, one per vertex"),
            ));
        }
        normals.extend(found.into_iter().map(|n| Vec3::from_array(n).normalize_or_zero()));
    }
    Ok(normals)
}

/// Materials of the parts that are drawn in them, and what these read of vertices.
fn authored(
    document: &Document,
    source: &gltf::Mesh<'_>,
    extension: &FacialAppearance,
    notes: &mut Notes,
) -> Result<Authored, ImportError> {
    if extension.parts.iter().all(|part| !part.authored) {
        return Ok(Authored::default());
    }
    let mut materials = Materials::new(document);
    let (mut second_uvs, mut colors_linear, mut of_parts) = (Vec::new(), Vec::new(), Vec::new());
    for (i, (primitive, part)) in source.primitives().zip(&extension.parts).enumerate() {
        let at = |what: &str| format!("mesh {}, primitive {i}, {what}", source.index());
        let count = primitive.get(&Semantic::Positions).map_or(0, |a| a.count());
        let (mut uvs, mut colors) = (vec![[0.0; 2]; count], vec![[1.0; 4]; count]);
        if part.authored {
            if let Some(a) = primitive.get(&Semantic::TexCoords(1)) {
                uvs = accessor::floats::<2>(document, &at("TEXCOORD_1"), &a)?;
            }
            colors = foreign::colors(document, &at("COLOR_0"), &primitive, count)?;
        }
        if uvs.len() != count || colors.len() != count {
            let found = format!("{} texture coordinates and {} colours", uvs.len(), colors.len());
            return Err(document.fail(&at("TEXCOORD_1"), found, format!("{count}, one per vertex")));
        }
        second_uvs.extend(uvs.into_iter().map(Vec2::from_array));
        colors_linear.extend(colors);
        of_parts.push(part.authored.then(|| materials.read(primitive.material().index(), notes)));
    }
    let mut authored = Authored { of_parts, second_uvs, colors_linear, ..materials.authored };
    authored.drop_defaults();
    Ok(authored)
}

fn maps(document: &Document, entries: &MapEntries) -> Result<SkinMaps, ImportError> {
    let optional = |name: &str, entry: &Option<MapEntry>, channels| {
        entry.as_ref().map(|e| map(document, name, e, channels, 0)).transpose()
    };
    let mut maps = SkinMaps {
        albedo: optional("albedo", &entries.albedo, 3)?,
        melanin: optional("melanin", &entries.melanin, 1)?,
        hemoglobin: optional("hemoglobin", &entries.hemoglobin, 1)?,
        hemoglobin_mean: optional("hemoglobin mean", &entries.hemoglobin_mean, 1)?,
        slopes: optional("slopes", &entries.slopes, 2)?,
        specular: optional("specular", &entries.specular, 2)?,
        scattering: optional("scattering", &entries.scattering, 1)?,
        hair: optional("hair", &entries.hair, 1)?,
        hair_color_linear: entries.hair_color_linear,
        hair_count: entries.hair_count,
        ..SkinMaps::default()
    };
    for d in &entries.distributions {
        maps.distributions.push(Distribution {
            name: d.name.clone(),
            scale: map(document, &format!("distribution {} scale", d.name), &d.scale, 1, 0)?,
            bias: map(document, &format!("distribution {} bias", d.name), &d.bias, 1, 0)?,
        });
    }
    for (i, entry) in entries.wrinkle_slopes.iter().enumerate() {
        maps.wrinkle_slopes.push(map(document, &format!("wrinkle slopes {i}"), entry, 2, 0)?);
    }
    for z in &entries.zones {
        let mask = map(document, &format!("zone {}", z.name), &z.mask, 1, z.channel)?;
        maps.zones.push(WrinkleZone { name: z.name.clone(), wrinkle_map: z.wrinkle_map, mask });
    }
    Ok(maps)
}

/// Decodes an image and turns texels into values.
fn map(
    document: &Document,
    name: &str,
    entry: &MapEntry,
    channels: u32,
    channel: u32,
) -> Result<Map, ImportError> {
    let at = format!("{NAME}, map {name}");
    let values = entry.offset.iter().chain(&entry.scale);
    if entry.offset.len() != channels as usize || entry.scale.len() != channels as usize || channel > 3 {
        let found =
            format!("{} offsets, {} scales, channel {channel}", entry.offset.len(), entry.scale.len());
        return Err(document.fail(&at, found, format!("{channels} of each, a channel from 0 to 3")));
    }
    if let Some(v) = values.into_iter().find(|v| !v.is_finite()) {
        return Err(document.fail(&at, v.to_string(), "finite offset and scale"));
    }
    let bytes = document.image(entry.image)?;
    let picture = decode_stored(Path::new(&at), &bytes, &Limits::default())
        .map_err(|e| document.fail(&at, e.to_string(), "a PNG or JPEG image within the limits"))?;
    let (width, height) = (picture.width(), picture.height());
    let (step, starts) = match entry.layout {
        ChannelLayout::First => (1, vec![0]),
        ChannelLayout::Stacked => (1, vec![0, (width * (height / 2)) as usize]),
        ChannelLayout::Interleaved => (4, vec![0, 1]),
        ChannelLayout::Color => (4, vec![0, 1, 2]),
        ChannelLayout::Channel => (4, vec![channel as usize]),
    };
    if starts.len() != channels as usize || (entry.layout == ChannelLayout::Stacked && height % 2 != 0) {
        let found = format!("layout {:?} of an image {width} x {height}", entry.layout);
        return Err(document.fail(&at, found, format!("{channels} channels")));
    }
    document.take(&at, Share::MapValues, width as usize * height as usize * channels as usize)?;
    // Grey images are read as grey (a 16-bit one keeps its bits); colour images as RGBA.
    let texels: Vec<f32> = if step == 1 && picture.color().has_color() {
        picture.to_rgba32f().into_raw().into_iter().step_by(4).collect()
    } else if step == 1 {
        picture.to_luma16().into_raw().into_iter().map(|t| f32::from(t) / 65535.0).collect()
    } else {
        let linear = |code: f32| if entry.layout == ChannelLayout::Color { srgb_decode(code) } else { code };
        let value: Vec<f32> = (0..=255u8).map(|code| linear(f32::from(code) / 255.0)).collect();
        picture.to_rgba8().into_raw().into_iter().map(|t| value[usize::from(t)]).collect()
    };
    let height = if entry.layout == ChannelLayout::Stacked { height / 2 } else { height };
    let count = (width * height) as usize;
    let mut out = Map { width, height, channels, values: Vec::with_capacity(count * channels as usize) };
    for i in 0..count {
        for (c, start) in starts.iter().enumerate() {
            out.values.push(entry.offset[c] + entry.scale[c] * texels[start + i * step]);
        }
    }
    Ok(out)
}
