//! Meshes and targets of a scene to a head.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;

use glam::{DAffine3, DVec3, Vec2, Vec3};
use rubor_assets::import::materials::guess_material;
use rubor_rig::expression::Inbetween;
use rubor_rig::head::{BlendShape, Head, Material, OcclusionChange, Part, Vertex};

use super::Options;
use super::geometry::{Polygons, history, points, polygons, world_matrix};
use crate::appearance::Appearance;
use crate::ascii::scene::{BlendShapeData, Data, Item, NodeId, Scene};
use crate::error::Fault;
use crate::plain_name;

/// A head and where its numbers come from.
pub(super) struct Built {
    pub(super) head: Head,
    pub(super) inbetweens: Vec<Inbetween>,
    /// Blend shape node and index of each weight, with the shape that it drives.
    pub(super) weights: Vec<(NodeId, u32, String)>,
    pub(super) meshes: Vec<NodeId>,
    /// The rig file that this crate wrote.
    pub(super) rig: Option<serde_json::Value>,
    /// Transform that carries what this crate wrote: it is the motion of the head, not its place.
    pub(super) carrier: Option<NodeId>,
}

pub(super) fn build(
    scene: &Scene,
    options: &Options,
    name: &str,
    folder: &Path,
    notes: &mut Vec<String>,
) -> Result<Built, Fault> {
    let meshes = chosen(scene, options)?;
    let carriers: Vec<NodeId> = meshes.iter().filter_map(|m| carrier_of(scene, *m)).collect();
    let carrier = carriers.first().copied().filter(|c| carriers.iter().all(|o| o == c));
    let written = carrier.and_then(|id| scene.transform(id)).and_then(|t| t.facial_appearance.as_deref());
    let appearance = match written.map(Appearance::parse) {
        Some(Ok(appearance)) => Some(appearance),
        Some(Err(reason)) => {
            notes.push(format!("the attribute ruborFacialAppearance was left out: {reason}"));
            None
        }
        None => None,
    };

    let mut assembly = Assembly {
        scene,
        appearance,
        shapes: Vec::new(),
        by_name: HashMap::new(),
        head: Head::default(),
        inbetweens: Vec::new(),
        weights: Vec::new(),
    };
    assembly.head.name = name.to_owned();
    let mut first_fault = None;
    let mut read = Vec::new();
    for mesh in &meshes {
        match assembly.add(*mesh, carrier, notes) {
            Ok(()) => read.push(*mesh),
            Err(fault) => {
                if meshes.len() > 1 {
                    let path = scene.path(*mesh);
                    notes.push(format!("line {}: {path} was left out: found {}", fault.line, fault.found));
                }
                first_fault.get_or_insert(fault);
            }
        }
    }
    if let (true, Some(fault)) = (read.is_empty(), first_fault) {
        return Err(fault);
    }
    Ok(assembly.finish(read, carrier, folder, notes))
}

/// The nearest ancestor that carries our attribute.
fn carrier_of(scene: &Scene, mesh: NodeId) -> Option<NodeId> {
    let mut at = scene.nodes[mesh].parent;
    while let Some(id) = at {
        if scene.transform(id).is_some_and(|t| t.facial_appearance.is_some()) {
            return Some(id);
        }
        at = scene.nodes[id].parent;
    }
    None
}

/// Meshes that the options ask for; otherwise visible ones that are no targets.
fn chosen(scene: &Scene, options: &Options) -> Result<Vec<NodeId>, Fault> {
    let targets: HashSet<NodeId> = (scene.connections.iter())
        .filter(|(_, to)| to.attribute.ends_with(".igt"))
        .map(|(from, _)| from.node)
        .collect();
    let is_mesh = |id: &NodeId| scene.mesh(*id).is_some_and(|m| !m.intermediate);
    let all: Vec<NodeId> = (0..scene.nodes.len()).filter(is_mesh).collect();
    let chosen: Vec<NodeId> = match &options.mesh {
        Some(part) => all.iter().copied().filter(|id| scene.path(*id).contains(part.as_str())).collect(),
        None => all.iter().copied().filter(|id| !targets.contains(id) && is_visible(scene, *id)).collect(),
    };
    if chosen.is_empty() {
        let found = match &options.mesh {
            Some(part) => format!("no mesh whose path contains {part:?}"),
            None => "no visible mesh".to_owned(),
        };
        let paths: Vec<String> = all.iter().take(8).map(|id| scene.path(*id)).collect();
        let expected = match paths.len() {
            0 => "a mesh".to_owned(),
            _ => format!("one of {}", paths.join(", ")),
        };
        return Err(Fault::new(1, found, expected));
    }
    Ok(chosen)
}

fn is_visible(scene: &Scene, mesh: NodeId) -> bool {
    let mut at = scene.nodes[mesh].parent;
    let mut visible = scene.mesh(mesh).is_some_and(|m| !m.hidden);
    while let Some(id) = at {
        visible &= scene.transform(id).is_none_or(|t| t.visible);
        at = scene.nodes[id].parent;
    }
    visible
}

struct Assembly<'s> {
    scene: &'s Scene,
    appearance: Option<Appearance>,
    /// Offsets by point.
    shapes: Vec<(String, BTreeMap<u32, Vec3>)>,
    by_name: HashMap<String, usize>,
    head: Head,
    inbetweens: Vec<Inbetween>,
    weights: Vec<(NodeId, u32, String)>,
}

impl Assembly<'_> {
    fn add(&mut self, mesh: NodeId, carrier: Option<NodeId>, notes: &mut Vec<String>) -> Result<(), Fault> {
        let scene = self.scene;
        let history = history(scene, mesh);
        let Some(base) = history.base else {
            let found = format!("{} with a history that runs in a circle", scene.path(mesh));
            return Err(Fault::new(scene.nodes[mesh].line, found, "a mesh with a beginning"));
        };
        let polygons = polygons(scene, base)?;
        if polygons.faces.is_empty() {
            let found = format!("{} without faces", scene.path(base));
            return Err(Fault::new(scene.nodes[base].line, found, "a mesh with faces"));
        }
        for id in &history.ignored {
            let node = &scene.nodes[*id];
            notes.push(format!(
                "line {}: {} of {} is ignored: {} is no blendShape",
                node.line,
                node.name,
                scene.path(mesh),
                node.kind
            ));
        }
        if scene.mesh(base).is_some_and(|m| m.holes > 0) {
            notes.push(format!("{}: holes in faces are filled", scene.path(base)));
        }
        // The carrier is the head's motion; what stands above and below it is its place.
        let identity = |id: NodeId| (Some(id) == carrier).then_some(DAffine3::IDENTITY);
        let place = world_matrix(scene, mesh, &identity);
        let first_point = self.head.mesh.points.len() as u32;
        self.head.mesh.points.extend(polygons.points.iter().map(|p| placed(&place, *p)));
        self.faces(mesh, &polygons, first_point);
        for (node, geometry) in history.blend_shapes.iter().rev() {
            if let Data::BlendShape(data) = &scene.nodes[*node].data {
                self.targets(*node, data, *geometry, &polygons, &place, first_point, notes)?;
            }
        }
        Ok(())
    }

    /// Triangles by object group; vertices in the order of their texture coordinates.
    fn faces(&mut self, mesh: NodeId, polygons: &Polygons, first_point: u32) {
        let groups = self.groups(mesh, polygons.faces.len());
        let mut pairs: Vec<(u32, u32)> = polygons.faces.iter().flatten().map(|[p, uv]| (*uv, *p)).collect();
        pairs.sort_unstable();
        pairs.dedup();
        let first_vertex = self.head.mesh.vertices.len() as u32;
        let uv_of = |uv: u32| polygons.uvs.get(uv as usize).map_or(Vec2::ZERO, |uv| Vec2::from(*uv));
        self.head
            .mesh
            .vertices
            .extend(pairs.iter().map(|(uv, point)| Vertex { point: first_point + point, uv: uv_of(*uv) }));
        let vertex = |[point, uv]: [u32; 2]| {
            // Every pair was put in above.
            first_vertex + pairs.binary_search(&(uv, point)).unwrap_or_default() as u32
        };
        let at = |corner: [u32; 2]| Vec3::from(polygons.points[corner[0] as usize]);
        for (name, material, faces) in groups {
            let start = self.head.mesh.triangles.len() as u32;
            for face in faces.into_iter().map(|f| &polygons.faces[f as usize]).filter(|f| f.len() >= 3) {
                let shorter = face.len() == 4
                    && at(face[1]).distance_squared(at(face[3])) < at(face[0]).distance_squared(at(face[2]));
                let first = usize::from(shorter);
                let corner = |k: usize| vertex(face[(k + first) % face.len()]);
                let fan = (2..face.len()).map(|k| [corner(0), corner(k - 1), corner(k)]);
                self.head.mesh.triangles.extend(fan);
            }
            let end = self.head.mesh.triangles.len() as u32;
            self.head.mesh.parts.push(Part { name, material, triangles: start..end });
        }
    }

    /// Name, material and faces of each object group; what is in none is a part of its own.
    fn groups(&self, mesh: NodeId, face_count: usize) -> Vec<(String, Material, Vec<u32>)> {
        let scene = self.scene;
        let own = scene.nodes[mesh].parent.map_or(&scene.nodes[mesh].name, |p| &scene.nodes[p].name);
        let mut taken = vec![false; face_count];
        let mut groups = Vec::new();
        let data = scene.mesh(mesh);
        for (index, (group, ranges)) in data.iter().flat_map(|m| &m.face_groups).enumerate() {
            let attribute = format!("iog[0].og[{group}]");
            let set = (scene.outputs(mesh))
                .find(|(from, to)| from.attribute == attribute && to.attribute.starts_with("dsm"))
                .map(|(_, to)| scene.nodes[to.node].name.clone());
            let Some(set) = set else { continue };
            let mut faces = Vec::new();
            for [from, to] in ranges {
                for face in *from..=(*to).min((face_count as u32).saturating_sub(1)) {
                    if !std::mem::replace(&mut taken[face as usize], true) {
                        faces.push(face);
                    }
                }
            }
            let entry = self.appearance.as_ref().and_then(|a| a.parts.get(index));
            let part = match entry {
                Some(e) if set == shading_group(index, &e.name) => (e.name.clone(), e.material),
                _ => (set.clone(), guess_material(&format!("{set} {own}"))),
            };
            groups.push((part.0, part.1, faces));
        }
        let rest: Vec<u32> = (0..face_count as u32).filter(|f| !taken[*f as usize]).collect();
        if !rest.is_empty() {
            groups.push((own.clone(), guess_material(own), rest));
        }
        groups
    }

    fn targets(
        &mut self,
        node: NodeId,
        data: &BlendShapeData,
        geometry: u32,
        polygons: &Polygons,
        place: &DAffine3,
        first_point: u32,
        notes: &mut Vec<String>,
    ) -> Result<(), Fault> {
        let scene = self.scene;
        let items = self.items(node, data, geometry);
        let mut named: BTreeMap<u32, String> = BTreeMap::new();
        // Full targets first: in-betweens are named after them.
        let (full, between): (Vec<_>, Vec<_>) = items.into_iter().partition(|(_, item)| *item == 6000);
        for (target, item) in full.into_iter().chain(between) {
            let offsets = self.offsets(node, data, (geometry, target, item), polygons, notes)?;
            let alias = data.aliases.get(&target).cloned().unwrap_or_else(|| format!("weight_{target}"));
            let name = if item == 6000 {
                let name = self.shape_name(node, target, &alias, first_point);
                self.weights.push((node, target, name.clone()));
                named.insert(target, name.clone());
                name
            } else {
                let weight = (f64::from(item) - 5000.0) / 1000.0;
                let shape = named.get(&target).cloned().unwrap_or_else(|| alias.clone());
                let between = weight > 0.0 && weight < 1.0;
                if !between || !named.contains_key(&target) {
                    notes.push(format!(
                        "{}: the target of {shape} at weight {weight} was left out; in-betweens stand between 0 and 1",
                        scene.nodes[node].name
                    ));
                    continue;
                }
                let written = data.item_names.get(&(target, item)).map(|n| plain_name(n));
                let name = written.unwrap_or_else(|| format!("{shape}_at_{}", item - 5000));
                if !self.inbetweens.iter().any(|i| i.target == name) {
                    self.inbetweens.push(Inbetween { shape, target: name.clone(), weight: weight as f32 });
                }
                name
            };
            let index = *self.by_name.entry(name.clone()).or_insert_with(|| {
                self.shapes.push((name, BTreeMap::new()));
                self.shapes.len() - 1
            });
            let identity = *place == DAffine3::IDENTITY;
            for (point, offset) in offsets {
                let offset = Vec3::from(offset);
                let turned =
                    if identity { offset } else { place.transform_vector3(offset.as_dvec3()).as_vec3() };
                self.shapes[index].1.insert(first_point + point, turned);
            }
        }
        Ok(())
    }

    /// Targets and items that are stored or connected.
    fn items(&self, node: NodeId, data: &BlendShapeData, geometry: u32) -> Vec<(u32, u32)> {
        let mut items: Vec<(u32, u32)> =
            data.items.keys().filter(|(g, ..)| *g == geometry).map(|(_, t, i)| (*t, *i)).collect();
        let prefix = format!("it[{geometry}].itg[");
        for (_, to) in self.scene.connections.iter().filter(|(_, to)| to.node == node) {
            let parsed = to.attribute.strip_prefix(&prefix).and_then(|rest| {
                let (target, rest) = rest.split_once("].iti[")?;
                let item = rest.strip_suffix("].igt")?;
                Some((target.parse().ok()?, item.parse().ok()?))
            });
            items.extend(parsed);
        }
        items.sort_unstable();
        items.dedup();
        items
    }

    /// Offsets of an item: from its live mesh where one is connected, else the stored ones.
    fn offsets(
        &self,
        node: NodeId,
        data: &BlendShapeData,
        key: (u32, u32, u32),
        polygons: &Polygons,
        notes: &mut Vec<String>,
    ) -> Result<Vec<(u32, [f32; 3])>, Fault> {
        let scene = self.scene;
        let (geometry, target, item) = key;
        let count = polygons.points.len();
        let live = scene.source(node, &format!("it[{geometry}].itg[{target}].iti[{item}].igt"));
        if let Some(plug) = live {
            let moved = history(scene, plug.node).base.and_then(|base| points(scene, base));
            match moved {
                Some(moved) if moved.len() == count => {
                    let difference = |(i, (p, rest)): (usize, (&[f32; 3], &[f32; 3]))| {
                        (i as u32, [0, 1, 2].map(|c| p[c] - rest[c]))
                    };
                    let all = moved.iter().zip(&polygons.points).enumerate().map(difference);
                    return Ok(all.filter(|(_, d)| *d != [0.0; 3]).collect());
                }
                moved => {
                    let found =
                        moved.map_or("no points of its own".into(), |m| format!("{} points", m.len()));
                    notes.push(format!(
                        "the live target {} has {found} where the mesh has {count}; the stored offsets are used",
                        scene.path(plug.node)
                    ));
                }
            }
        }
        let Some(stored) = data.items.get(&key) else { return Ok(Vec::new()) };
        stored_offsets(stored, count)
    }

    /// A name that no other target on the same points has.
    fn shape_name(&self, node: NodeId, target: u32, alias: &str, first_point: u32) -> String {
        let original = self.appearance.as_ref().and_then(|a| a.shapes.get(target as usize));
        let name = match original {
            Some(original) if plain_name(original) == alias => original.clone(),
            _ => alias.to_owned(),
        };
        let taken = self.by_name.get(&name).is_some_and(|i| {
            self.shapes[*i].1.range(first_point..).next().is_some()
                || self.weights.iter().any(|(n, t, s)| *n == node && *t != target && *s == name)
        });
        if taken { format!("{}_{alias}", self.scene.nodes[node].name) } else { name }
    }

    fn finish(
        self,
        meshes: Vec<NodeId>,
        carrier: Option<NodeId>,
        folder: &Path,
        notes: &mut Vec<String>,
    ) -> Built {
        let mut head = self.head;
        let shape = |(name, offsets): (String, BTreeMap<u32, Vec3>)| {
            let (points, offsets) = offsets.into_iter().unzip();
            BlendShape { name, points, offsets, ..BlendShape::default() }
        };
        head.shapes = self.shapes.into_iter().map(shape).collect();
        let mut rig = None;
        if let Some(appearance) = self.appearance {
            rig = appearance.rig.clone();
            head.maps = appearance.load_maps(folder, notes);
            head.name = appearance.name;
            head.landmarks = appearance.landmarks;
            head.provenance = appearance.provenance;
            if appearance.occlusion.len() == head.mesh.points.len() {
                head.mesh.occlusion = appearance.occlusion;
                for shape in &mut head.shapes {
                    let changes = appearance.shape_occlusion.get(&shape.name).into_iter().flatten();
                    shape.occlusion = changes
                        .map(|&(point, at_half, at_full)| OcclusionChange { point, at_half, at_full })
                        .collect();
                }
            }
        }
        Built { head, inbetweens: self.inbetweens, weights: self.weights, meshes, rig, carrier }
    }
}

/// Name of the shading group that the writer gives a part.
pub(crate) fn shading_group(index: usize, part: &str) -> String {
    format!("rubor_{index}_{}_SG", plain_name(part))
}

/// A point of a mesh in the world, metres.
fn placed(place: &DAffine3, point: [f32; 3]) -> Vec3 {
    if *place == DAffine3::IDENTITY {
        return Vec3::from(point);
    }
    // Matrices are in centimetres.
    (place.transform_point3(DVec3::from(point.map(f64::from)) * 100.0) * 0.01).as_vec3()
}

fn stored_offsets(item: &Item, count: usize) -> Result<Vec<(u32, [f32; 3])>, Fault> {
    let wrong = |found: String, expected: String| Err(Fault::new(item.line, found, expected));
    let mut ranges = item.points.clone();
    if ranges.is_empty() && item.offsets.len() == count {
        ranges.push([0, u32::MAX]);
    }
    let mut offsets = item.offsets.iter();
    let mut out: Vec<(u32, [f32; 3])> = Vec::with_capacity(item.offsets.len());
    for [from, to] in ranges {
        let to = if to == u32::MAX { (count as u32).saturating_sub(1) } else { to };
        if to as usize >= count {
            return wrong(format!("an offset of point {to}"), format!("a point below {count}"));
        }
        for point in from..=to {
            let Some(offset) = offsets.next() else {
                return wrong(
                    format!("{} offsets", item.offsets.len()),
                    "one for each point of the component list".into(),
                );
            };
            out.push((point, *offset));
        }
    }
    let rest = offsets.count();
    if rest > 0 {
        return wrong(format!("{rest} offsets too many"), "one for each point of the component list".into());
    }
    Ok(out)
}
