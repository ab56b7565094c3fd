//! Heads from USD text layers (`.usda`) and packages (`.usdz`) of one.
//!
//! ```text
//! layer --usda--> prims --> every visible Mesh with its transform --> PolyMesh
//!                       --> BlendShapes (UsdSkel), in-betweens    --> shapes, entries of a rig
//!                       --> UsdPreviewSurface, UsdUVTexture       --> materials of the author
//! ```
//!
//! What is not read, and said: composition (references, payloads, sublayers, variants, instances), joints and animation,
//! subdivision (the cage is read), binary layers (`.usdc`), other shaders than UsdPreviewSurface.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;

use glam::{DMat4, DQuat, DVec3, EulerRot, Vec2, Vec3};
use rubor_rig::expression::{Inbetween, Rig};
use rubor_rig::head::Material;
use rubor_rig::limits::{self, Limits};

use super::gltf::{Extent, ImportedHead};
use super::materials::recognise;
use super::mtl::keep_look;
use super::usd_materials::Looks;
use super::usda::{self, Layer, Prim, Value};
use crate::error::ImportError;
use crate::notes::Notes;
use crate::poly::{Corner, MOST_CORNERS, PolyMesh, Shape, build_head};
use crate::usdz;

/// Reads a layer, or a package whose first file is one.
///
/// # Errors
/// Unreadable or broken files, binary layers, no mesh, indices out of range, a head that breaks its rules.
pub fn read(path: &Path) -> Result<ImportedHead, ImportError> {
    let bytes = limits::read(path).map_err(ImportError::read(path))?;
    from_bytes(&bytes, path)
}

/// Reads from memory; `path` is for messages and finds the pictures beside a layer.
///
/// # Errors
/// As [`read`].
pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<ImportedHead, ImportError> {
    let package;
    let (text, files) = if bytes.starts_with(b"PK") {
        package = usdz::read(bytes).map_err(|found| {
            ImportError::content(path, "package", found, "files that are stored as they are")
        })?;
        let Some(first) = package.first() else {
            return Err(ImportError::content(path, "package", "no files", "a layer"));
        };
        (&*first.bytes, Some(&package[..]))
    } else {
        (bytes, None)
    };
    let layer = usda::parse(text)
        .map_err(|e| ImportError::content(path, format!("line {}", e.line), e.found, e.expected))?;
    let mut notes = Notes::default();
    let mut reader = Reader {
        path,
        layer: &layer,
        by_path: layer.prims.iter().map(|p| (p.path.as_str(), p)).collect(),
        subsets: HashMap::new(),
        shape_of_name: HashMap::new(),
        notes: &mut notes,
        mesh: PolyMesh::default(),
        shapes: Vec::new(),
        materials: Vec::new(),
        names: Vec::new(),
        inbetweens: Vec::new(),
        known_inbetweens: HashSet::new(),
    };
    for subset in layer.prims.iter().filter(|p| p.kind == "GeomSubset") {
        for above in usda::above(&subset.path) {
            reader.subsets.entry(above).or_default().push(subset);
        }
    }
    reader.composition();
    for prim in layer.prims.iter().filter(|p| p.kind == "Mesh") {
        reader.mesh(prim)?;
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut looks = Looks::new(&layer, folder, files);
    let imported = reader.finish(&mut looks)?;
    imported.head.validate()?;
    Ok(ImportedHead { notes: notes.into_vec(), ..imported })
}

struct Reader<'a> {
    path: &'a Path,
    layer: &'a Layer,
    by_path: HashMap<&'a str, &'a Prim>,
    /// Subsets below each prim, in the order of the layer.
    subsets: HashMap<&'a str, Vec<&'a Prim>>,
    shape_of_name: HashMap<String, usize>,
    notes: &'a mut Notes,
    /// All meshes, in metres, y up. A group for each part.
    mesh: PolyMesh,
    shapes: Vec<Shape>,
    /// Path of the material of each group, and the mesh it belongs to.
    materials: Vec<(Option<String>, String)>,
    /// Name of each part.
    names: Vec<String>,
    inbetweens: Vec<Inbetween>,
    known_inbetweens: HashSet<(String, String)>,
}

/// Numbers of a list of numbers or vectors.
fn numbers(value: Option<&Value>) -> Vec<f64> {
    let mut out = Vec::new();
    let mut open = vec![value];
    while let Some(next) = open.pop() {
        match next {
            Some(Value::Number(n)) => out.push(*n),
            Some(Value::List(list)) => open.extend(list.iter().rev().map(Some)),
            _ => {}
        }
    }
    out
}

fn vectors(value: Option<&Value>) -> Vec<Vec3> {
    numbers(value).chunks_exact(3).map(|v| DVec3::new(v[0], v[1], v[2]).as_vec3()).collect()
}

/// Texts of a list, or the one text.
fn texts(value: Option<&Value>) -> Vec<&str> {
    match value {
        Some(Value::List(list)) => list.iter().filter_map(Value::text).collect(),
        Some(value) => value.text().into_iter().collect(),
        None => Vec::new(),
    }
}

/// A property, or the first of its time samples.
fn at_rest<'p>(prim: &'p Prim, name: &str) -> Option<&'p Value> {
    let sampled = || match prim.properties.get(&format!("{name}.timeSamples")) {
        Some(Value::Table(samples)) => samples.first().map(|(_, value)| value),
        _ => None,
    };
    prim.properties.get(name).or_else(sampled)
}

fn last_name(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}

impl Reader<'_> {
    fn fail(&self, prim: &Prim, found: String, expected: impl Into<String>) -> ImportError {
        ImportError::content(self.path, format!("line {}, {}", prim.line, prim.path), found, expected)
    }

    /// Says what stands in other layers.
    fn composition(&mut self) {
        if self.layer.metadata.contains_key("subLayers") {
            self.notes.say("sublayers are not read: flatten the stage with `usdcat --flatten`");
        }
        for prim in &self.layer.prims {
            for arc in ["references", "payload", "inherits", "specializes", "variants"] {
                if prim.metadata.contains_key(arc) {
                    let message =
                        format!("{arc} are not followed: flatten the stage with `usdcat --flatten`");
                    self.notes.add(message, prim.path.as_str());
                }
            }
            match prim.kind.as_str() {
                "SkelAnimation" if !prim.properties.is_empty() => {
                    self.notes.add("animation of USD is not read", prim.path.as_str());
                }
                "NurbsPatch" | "BasisCurves" | "Points" | "Sphere" | "Cube" | "Capsule"
                | "PointInstancer" => {
                    self.notes.add("prims that are no meshes are left out", prim.path.as_str());
                }
                _ => {}
            }
        }
    }

    /// Prims from a prim up to the root.
    fn ancestors<'s>(&'s self, path: &'s str) -> impl Iterator<Item = &'s Prim> {
        let ends = path.match_indices('/').map(|(i, _)| i).skip(1).chain([path.len()]);
        let paths: Vec<&str> = ends.map(|end| &path[..end]).collect();
        paths.into_iter().rev().filter_map(|p| self.by_path.get(p).copied())
    }

    /// Metres and y up from the space of a prim.
    fn placement(&mut self, prim: &Prim) -> DMat4 {
        let unit = match self.layer.metadata.get("metersPerUnit") {
            Some(Value::Number(n)) if *n > 0.0 && n.is_finite() => *n,
            // Centimetres where the layer does not say it.
            _ => 0.01,
        };
        let up = match self.layer.metadata.get("upAxis").and_then(Value::text) {
            Some("Z") => DMat4::from_rotation_x(-std::f64::consts::FRAC_PI_2),
            _ => DMat4::IDENTITY,
        };
        let mut place = DMat4::IDENTITY;
        let mut unread = Vec::new();
        for ancestor in self.ancestors(&prim.path) {
            let mut local = DMat4::IDENTITY;
            for op in texts(ancestor.properties.get("xformOpOrder")) {
                match op_matrix(ancestor, op) {
                    Some(matrix) => local *= matrix,
                    None => unread.push(format!("{op} of {}", ancestor.path)),
                }
            }
            place = local * place;
        }
        unread.into_iter().for_each(|op| self.notes.add("transforms that are not read", op));
        DMat4::from_scale(DVec3::splat(unit)) * up * place
    }

    fn mesh(&mut self, prim: &Prim) -> Result<(), ImportError> {
        let says =
            |p: &Prim, name: &str| at_rest(p, name).and_then(Value::text).unwrap_or_default().to_owned();
        let hidden = self.ancestors(&prim.path).any(|p| {
            says(p, "visibility") == "invisible" || ["guide", "proxy"].contains(&&*says(p, "purpose"))
        });
        if hidden {
            self.notes.add("meshes that are invisible, guides or proxies are left out", prim.path.as_str());
            return Ok(());
        }
        let place = self.placement(prim);
        let points = vectors(at_rest(prim, "points"));
        let counts: Vec<usize> =
            numbers(at_rest(prim, "faceVertexCounts")).into_iter().map(|n| n as usize).collect();
        let corners = numbers(at_rest(prim, "faceVertexIndices"));
        if points.is_empty() || counts.is_empty() {
            self.notes.add("meshes without points or faces are left out", prim.path.as_str());
            return Ok(());
        }
        let first = self.mesh.points.len() as u32;
        for p in &points {
            let point = place.transform_point3(p.as_dvec3()).as_vec3();
            if !point.is_finite() {
                return Err(self.fail(prim, format!("a point at {p}"), "finite coordinates"));
            }
            self.mesh.points.push(point);
        }
        let total = counts.iter().try_fold(0_usize, |sum, n| sum.checked_add(*n));
        if total != Some(corners.len()) {
            let found = format!("{} faceVertexIndices", corners.len());
            return Err(self.fail(prim, found, "as many as faceVertexCounts add up to"));
        }
        if let Some(corner) = corners.iter().find(|c| !(0.0..points.len() as f64).contains(*c)) {
            return Err(self.fail(prim, format!("point {corner}"), format!("one below {}", points.len())));
        }
        let uv_of = self.uvs(prim, points.len(), &corners);
        let subsets = self.subsets(prim, counts.len());
        let is_turned = (says(prim, "orientation") == "leftHanded") != (place.determinant() < 0.0);
        let mut next = 0;
        for (face, count) in counts.iter().enumerate() {
            let mut of_face: Vec<Corner> = (next..next + count)
                .map(|c| Corner { point: first + corners[c] as u32, uv: uv_of[c] })
                .collect();
            next += count;
            if *count > MOST_CORNERS {
                let message =
                    format!("faces of more than {MOST_CORNERS} corners are right only where they are convex");
                self.notes.add(message, prim.path.as_str());
            }
            if *count < 3 {
                continue;
            }
            if is_turned {
                of_face.reverse();
            }
            self.mesh.corners.extend(of_face);
            self.mesh.face_starts.push(self.mesh.corners.len() as u32);
            self.mesh.face_groups.push(subsets[face]);
        }
        self.blend_shapes(prim, &place, first, points.len());
        let scheme = says(prim, "subdivisionScheme");
        if scheme != "none" {
            let message = "subdivision surfaces are read as their cage (`rubor import --subdivide` smooths OBJ sets only)";
            self.notes.add(message, prim.path.as_str());
        }
        if prim.properties.contains_key("primvars:skel:jointIndices") {
            self.notes.add("joints are not read: meshes stand in their bind pose", prim.path.as_str());
        }
        Ok(())
    }

    /// Texture coordinate of each corner.
    fn uvs(&mut self, prim: &Prim, points: usize, corners: &[f64]) -> Vec<u32> {
        let named = ["primvars:st", "primvars:UVMap", "primvars:map1", "primvars:st0", "primvars:uv"];
        let name = named.into_iter().find(|n| at_rest(prim, n).is_some());
        let values = numbers(name.and_then(|n| at_rest(prim, n)));
        let first = self.mesh.uvs.len() as u32;
        let uvs = values.chunks_exact(2).map(|v| Vec2::new(v[0] as f32, (1.0 - v[1]) as f32));
        self.mesh.uvs.extend(uvs.map(|uv| if uv.is_finite() { uv } else { Vec2::ZERO }));
        let count = self.mesh.uvs.len() - first as usize;
        let indices = numbers(name.and_then(|n| at_rest(prim, &format!("{n}:indices"))));
        let slots = if indices.is_empty() { count } else { indices.len() };
        let of_slot = |slot: usize| -> Option<u32> {
            let index = if indices.is_empty() { slot } else { *indices.get(slot)? as usize };
            (index < count).then_some(first + index as u32)
        };
        let of_corners: Option<Vec<u32>> = if slots == corners.len() {
            (0..corners.len()).map(of_slot).collect()
        } else if slots == points {
            corners.iter().map(|c| of_slot(*c as usize)).collect()
        } else {
            None
        };
        of_corners.unwrap_or_else(|| {
            let place = prim.path.as_str();
            match name {
                Some(_) => {
                    self.notes.add("texture coordinates that fit neither points nor corners are 0", place)
                }
                None => self.notes.add("parts without texture coordinates have them all at 0", place),
            }
            self.mesh.uvs.push(Vec2::ZERO);
            vec![self.mesh.uvs.len() as u32 - 1; corners.len()]
        })
    }

    /// Group of each face: subsets with a material of their own, and the rest of the mesh.
    fn subsets(&mut self, prim: &Prim, faces: usize) -> Vec<u32> {
        let mut groups = vec![u32::MAX; faces];
        let binding = |p: &Prim| texts(p.properties.get("material:binding")).first().map(|s| (*s).to_owned());
        let subsets = self.subsets.get(prim.path.as_str()).cloned().unwrap_or_default();
        // Materials are inherited from prims above.
        let bound = self.ancestors(&prim.path).find_map(binding);
        for subset in subsets {
            let of_material = subset.properties.contains_key("material:binding")
                || subset.properties.get("familyName").and_then(Value::text) == Some("materialBind");
            if !of_material {
                continue;
            }
            let material = binding(subset).or_else(|| bound.clone());
            let group = self.group(prim, last_name(&subset.path), material);
            for face in numbers(at_rest(subset, "indices")) {
                match groups.get_mut(face as usize) {
                    Some(of_face) if face >= 0.0 => *of_face = group,
                    _ => self.notes.add("subsets name faces that do not exist", subset.path.as_str()),
                }
            }
        }
        if groups.contains(&u32::MAX) {
            let rest = self.group(prim, last_name(&prim.path), bound);
            groups.iter_mut().filter(|g| **g == u32::MAX).for_each(|g| *g = rest);
        }
        groups
    }

    fn group(&mut self, prim: &Prim, name: &str, material: Option<String>) -> u32 {
        let number = self.materials.len() as u32;
        self.mesh.groups.push(format!("{number}"));
        self.materials.push((material, prim.path.clone()));
        self.names.push(name.to_owned());
        number
    }

    fn blend_shapes(&mut self, prim: &Prim, place: &DMat4, first: u32, points: usize) {
        let names = texts(prim.properties.get("skel:blendShapes"));
        let targets = texts(prim.properties.get("skel:blendShapeTargets"));
        if names.len() != targets.len() {
            let place = format!("{}: {} names, {} targets", prim.path, names.len(), targets.len());
            self.notes
                .add("blend shapes and their targets are not as many: the first of both are read", place);
        }
        for (name, target) in names.into_iter().zip(targets) {
            let Some(target) = self.by_path.get(target).copied() else {
                self.notes.add("blend shapes that do not exist are left out", target);
                continue;
            };
            let indices = numbers(at_rest(target, "pointIndices"));
            self.add_shape(name, target, "offsets", &indices, place, first, points);
            let between: Vec<&String> =
                target.properties.keys().filter(|k| k.starts_with("inbetweens:")).collect();
            for key in between {
                let Some(label) = key.strip_prefix("inbetweens:").filter(|l| !l.contains(':')) else {
                    continue;
                };
                let weight = target.details.get(key).and_then(|d| d.get("weight"));
                let Some(Value::Number(weight)) = weight else {
                    self.notes.add("in-betweens without a weight are left out", format!("{label} of {name}"));
                    continue;
                };
                if !(*weight > 0.0 && *weight < 1.0) {
                    self.notes
                        .add("in-betweens outside of 0 to 1 are left out", format!("{label} of {name}"));
                    continue;
                }
                self.add_shape(label, target, key, &indices, place, first, points);
                let entry =
                    Inbetween { shape: name.to_owned(), target: label.to_owned(), weight: *weight as f32 };
                if self.known_inbetweens.insert((entry.shape.clone(), entry.target.clone())) {
                    self.inbetweens.push(entry);
                }
            }
        }
    }

    /// Adds offsets to the shape of a name: several meshes may have one.
    fn add_shape(
        &mut self,
        name: &str,
        target: &Prim,
        property: &str,
        indices: &[f64],
        place: &DMat4,
        first: u32,
        points: usize,
    ) {
        let offsets = vectors(at_rest(target, property));
        // Shapes have an offset for every point of the head until it is built.
        let numbers = 3 * (self.shapes.len() as u64 + 1) * self.mesh.points.len() as u64;
        if limits::within("numbers", numbers, Limits::of_process().numbers()).is_err() {
            let message = format!(
                "blend shapes beyond the limit of {} numbers are left out (`--limit-memory` raises it)",
                Limits::of_process().numbers()
            );
            self.notes.add(message, name);
            return;
        }
        let shapes = &mut self.shapes;
        let shape = *self.shape_of_name.entry(name.to_owned()).or_insert_with(|| {
            shapes.push(Shape { name: name.to_owned(), offsets: Vec::new() });
            shapes.len() - 1
        });
        let mut left_out = 0;
        let all = &mut self.shapes[shape].offsets;
        all.resize(self.mesh.points.len(), Vec3::ZERO);
        for (i, offset) in offsets.iter().enumerate() {
            let point = if indices.is_empty() { i as f64 } else { indices.get(i).copied().unwrap_or(-1.0) };
            let moved = place.transform_vector3(offset.as_dvec3()).as_vec3();
            if (0.0..points as f64).contains(&point) && moved.is_finite() {
                all[first as usize + point as usize] = moved;
            } else {
                left_out += 1;
            }
        }
        if left_out > 0 {
            let place = format!("{left_out} of {}", target.path);
            self.notes.add("offsets of points that do not exist are left out", place);
        }
    }

    fn finish(mut self, looks: &mut Looks<'_>) -> Result<ImportedHead, ImportError> {
        if self.mesh.face_count() == 0 {
            return Err(ImportError::content(self.path, "layer", "no mesh", "a Mesh prim with faces"));
        }
        let count = self.mesh.points.len();
        for (what, number, most) in [
            ("points", count, Limits::of_process().vertices()),
            ("numbers of blend shapes", 3 * count * self.shapes.len(), Limits::of_process().numbers()),
        ] {
            limits::within(what, number as u64, most)
                .map_err(|(found, expected)| ImportError::content(self.path, "layer", found, expected))?;
        }
        self.shapes.iter_mut().for_each(|s| s.offsets.resize(count, Vec3::ZERO));
        // By the subset, the material and the mesh, in this order.
        let kind_of = |(i, (material, mesh)): (usize, &(Option<String>, String))| {
            let words = [self.names[i].as_str(), material.as_deref().map_or("", last_name), last_name(mesh)];
            words.into_iter().find_map(recognise)
        };
        let kinds: Vec<Option<Material>> = self.materials.iter().enumerate().map(kind_of).collect();
        let has_looks = self.materials.iter().any(|(material, _)| material.is_some());
        let is_scan = kinds.iter().all(Option::is_none) && !has_looks;
        let rest = if is_scan { Material::Skin } else { Material::Other };
        let parts: Vec<(&str, &str, Material)> = (self.mesh.groups.iter().zip(&kinds))
            .map(|(group, kind)| (group.as_str(), group.as_str(), kind.unwrap_or(rest)))
            .collect();
        let (mut head, _) = build_head(&self.mesh, &self.shapes, &parts, 0.0);
        let mut extent = Extent::default();
        for part in &mut head.mesh.parts {
            let group: usize = part.name.parse().unwrap_or(0);
            let (material, mesh) = &self.materials[group];
            part.name.clone_from(&self.names[group]);
            extent.meshes.push(mesh.clone());
            let authored = material.as_deref().and_then(|m| looks.material(m, self.notes));
            head.authored.of_parts.push(authored);
            if kinds[group].is_none() {
                let message = match is_scan {
                    true => {
                        "parts without a material, and with no name that tells what they are, are taken for skin"
                    }
                    false => {
                        "parts that no name tells keep the look of their author (`rubor import --parts NAME=skin` makes one skin)"
                    }
                };
                self.notes.add(message, part.name.as_str());
            }
            if let Some(authored) = authored {
                keep_look(&mut part.material, &part.name, &looks.materials[authored as usize], self.notes);
            }
        }
        head.authored.materials = std::mem::take(&mut looks.materials);
        head.authored.images = looks.take_images();
        let root = self.layer.metadata.get("defaultPrim").and_then(Value::text);
        let root = root.and_then(|r| self.by_path.get(format!("/{r}").as_str()).copied());
        let own = root.and_then(|r| r.metadata.get("customData")).map(|data| entry(data, "rubor"));
        let own: BTreeMap<&str, &str> = match own.flatten() {
            Some(Value::Table(list)) => list.iter().filter_map(|(k, v)| Some((word(k), v.text()?))).collect(),
            _ => BTreeMap::new(),
        };
        let stem = || self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        head.name = own.get("name").map_or_else(stem, |n| (*n).to_owned());
        let json = |name: &str| own.get(name).and_then(|text| serde_json::from_str(text).ok());
        let mut rig: Option<serde_json::Value> = json("rig");
        if rig.is_none() && !self.inbetweens.is_empty() {
            let default = Rig::default_rig().ok();
            rig =
                default.and_then(|rig| serde_json::to_value(Rig { inbetweens: self.inbetweens, ..rig }).ok());
        }
        Ok(ImportedHead { head, rig, sequence: json("sequence"), extent, ..ImportedHead::default() })
    }
}

/// The last word of `string name`.
fn word(key: &str) -> &str {
    key.rsplit(' ').next().unwrap_or(key)
}

fn entry<'v>(table: &'v Value, name: &str) -> Option<&'v Value> {
    match table {
        Value::Table(list) => list.iter().find(|(key, _)| word(key) == name).map(|(_, value)| value),
        _ => None,
    }
}

/// The transform of an operation of a prim; `None` where it is not read.
fn op_matrix(prim: &Prim, op: &str) -> Option<DMat4> {
    let kind = op.strip_prefix("xformOp:")?;
    let kind = kind.split(':').next()?;
    let v = numbers(at_rest(prim, op));
    let three = || Some(DVec3::new(*v.first()?, *v.get(1)?, *v.get(2)?));
    let one = || v.first().copied();
    let euler = |order: EulerRot, [a, b, c]: [usize; 3]| {
        // Operations act from the left on row vectors: rotateXYZ turns about x first.
        let r = three()?.to_array().map(f64::to_radians);
        Some(DMat4::from_quat(DQuat::from_euler(order, r[a], r[b], r[c])))
    };
    let matrix = match kind {
        "translate" => DMat4::from_translation(three()?),
        "scale" => DMat4::from_scale(three()?),
        "rotateX" => DMat4::from_rotation_x(one()?.to_radians()),
        "rotateY" => DMat4::from_rotation_y(one()?.to_radians()),
        "rotateZ" => DMat4::from_rotation_z(one()?.to_radians()),
        "rotateXYZ" => euler(EulerRot::ZYX, [2, 1, 0])?,
        "rotateXZY" => euler(EulerRot::YZX, [1, 2, 0])?,
        "rotateYXZ" => euler(EulerRot::ZXY, [2, 0, 1])?,
        "rotateYZX" => euler(EulerRot::XZY, [0, 2, 1])?,
        "rotateZXY" => euler(EulerRot::YXZ, [1, 0, 2])?,
        "rotateZYX" => euler(EulerRot::XYZ, [0, 1, 2])?,
        // (w, x, y, z)
        "orient" => {
            let q = DQuat::from_xyzw(*v.get(1)?, *v.get(2)?, *v.get(3)?, *v.first()?);
            DMat4::from_quat(q.normalize())
        }
        // Rows of USD, which multiplies row vectors, are columns here.
        "transform" => DMat4::from_cols_slice(v.get(..16)?),
        _ => return None,
    };
    matrix.is_finite().then_some(matrix)
}
