//! Meshes and targets of a scene to a head.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;

use glam::{DAffine3, DVec3, Vec2, Vec3};
use rubor_assets::import::materials::guess_material;
use rubor_assets::poly::triangulate;
use rubor_rig::expression::Inbetween;
use rubor_rig::head::{BlendShape, Head, Material, OcclusionChange, Part, Vertex};

use super::Options;
use super::geometry::{Instance, Polygons, history, instances, points, polygons, world_matrix};
use super::looks::Looks;
use super::weight::{Effect, effect, tell};
use crate::appearance::Appearance;
use crate::ascii::scene::{BlendShapeData, Data, Item, NodeId, Scene};
use crate::error::Fault;
use crate::notes::Notes;
use crate::plain_name;

/// Most points of a head, all instances counted.
const MOST_POINTS: usize = 50_000_000;

/// A weight of a blend shape node, and the shape that it drives.
pub(super) struct Weight<'s> {
    pub(super) node: NodeId,
    pub(super) shape: String,
    pub(super) effect: Effect<'s>,
}

/// A head and where its numbers come from.
pub(super) struct Built<'s> {
    pub(super) head: Head,
    pub(super) inbetweens: Vec<Inbetween>,
    pub(super) weights: Vec<Weight<'s>>,
    pub(super) instances: Vec<Instance>,
    /// The rig file that this crate wrote.
    pub(super) rig: Option<serde_json::Value>,
    /// Transform that carries what this crate wrote: it is the motion of the head, not its place.
    pub(super) carrier: Option<NodeId>,
}

pub(super) fn build<'s>(
    scene: &'s Scene,
    options: &Options,
    name: &str,
    folder: &'s Path,
    notes: &mut Notes,
) -> Result<Built<'s>, Fault> {
    let chosen = chosen(scene, options)?;
    let carriers: Vec<NodeId> = chosen.iter().filter_map(|i| carrier_of(scene, i)).collect();
    let carrier = carriers.first().copied().filter(|c| carriers.iter().all(|o| o == c));
    let written = carrier.and_then(|id| scene.transform(id)).and_then(|t| t.facial_appearance.as_deref());
    let appearance = match written.map(Appearance::parse) {
        Some(Ok(appearance)) => Some(appearance),
        Some(Err(reason)) => {
            notes.say(format!("the attribute ruborFacialAppearance was left out: {reason}"));
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
        index_of_weight: HashMap::new(),
        driven: HashMap::new(),
        between: HashMap::new(),
        told: HashSet::new(),
        looks: Looks::new(scene, folder),
    };
    assembly.head.name = name.to_owned();
    let mut first_fault = None;
    let mut read = Vec::new();
    let several = chosen.len() > 1;
    for instance in chosen {
        match assembly.add(&instance, carrier, notes) {
            Ok(()) => read.push(instance),
            Err(fault) => {
                if several {
                    let name = format!("{} (line {}: {})", instance.path(scene), fault.line, fault.found);
                    notes.about("meshes that cannot be read were left out", name);
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
fn carrier_of(scene: &Scene, instance: &Instance) -> Option<NodeId> {
    let carries = |id: &&NodeId| scene.transform(**id).is_some_and(|t| t.facial_appearance.is_some());
    instance.above.iter().find(carries).copied()
}

/// Meshes that the options ask for, in all their places; otherwise visible ones that are no targets.
fn chosen(scene: &Scene, options: &Options) -> Result<Vec<Instance>, Fault> {
    let targets: HashSet<NodeId> = (scene.connections.iter())
        .filter(|(_, to)| to.attribute.ends_with(".igt"))
        .map(|(from, _)| from.node)
        .collect();
    let mut all = Vec::new();
    for id in (0..scene.nodes.len()).filter(|id| scene.mesh(*id).is_some_and(|m| !m.intermediate)) {
        all.extend(instances(scene, id)?);
    }
    let wanted = |instance: &&Instance| match &options.mesh {
        Some(part) => instance.path(scene).contains(part.as_str()),
        None => !targets.contains(&instance.mesh) && is_visible(scene, instance),
    };
    let chosen: Vec<Instance> = all.iter().filter(wanted).cloned().collect();
    if chosen.is_empty() {
        let found = match &options.mesh {
            Some(part) => format!("no mesh whose path contains {part:?}"),
            None => "no visible mesh".to_owned(),
        };
        let paths: Vec<String> = all.iter().take(8).map(|instance| instance.path(scene)).collect();
        let expected = match paths.len() {
            0 => "a mesh".to_owned(),
            _ => format!("one of {}", paths.join(", ")),
        };
        return Err(Fault::new(1, found, expected));
    }
    Ok(chosen)
}

fn is_visible(scene: &Scene, instance: &Instance) -> bool {
    scene.mesh(instance.mesh).is_some_and(|m| !m.hidden)
        && scene.is_drawn(instance.mesh)
        && (instance.above.iter())
            .all(|id| scene.is_drawn(*id) && scene.transform(*id).is_none_or(|t| t.visible))
}

/// Faces of one shading group.
struct Group {
    name: String,
    material: Material,
    faces: Vec<u32>,
    /// The shading group.
    set: Option<NodeId>,
}

struct Assembly<'s> {
    scene: &'s Scene,
    appearance: Option<Appearance>,
    /// Offsets by point.
    shapes: Vec<(String, BTreeMap<u32, Vec3>)>,
    by_name: HashMap<String, usize>,
    head: Head,
    inbetweens: Vec<Inbetween>,
    weights: Vec<Weight<'s>>,
    /// Place in `weights` of a weight of a node.
    index_of_weight: HashMap<(NodeId, u32), usize>,
    /// Shapes that a weight drives, with its place in `weights`.
    driven: HashMap<String, usize>,
    /// Shapes that are in-betweens, with the shape that they are on the way to.
    between: HashMap<String, String>,
    /// Blend shapes whose peculiarities are in the notes.
    told: HashSet<NodeId>,
    looks: Looks<'s>,
}

impl<'s> Assembly<'s> {
    fn add(&mut self, instance: &Instance, carrier: Option<NodeId>, notes: &mut Notes) -> Result<(), Fault> {
        let scene = self.scene;
        let mesh = instance.mesh;
        let history = history(scene, mesh);
        let Some(base) = history.base else {
            let found = format!("{} with a history that runs in a circle", scene.path(mesh));
            return Err(Fault::new(scene.nodes[mesh].line, found, "a mesh with a beginning"));
        };
        let polygons = polygons(scene, &history, notes)?;
        if polygons.faces.is_empty() {
            let found = format!("{} without faces", scene.path(base));
            return Err(Fault::new(scene.nodes[base].line, found, "a mesh with faces"));
        }
        for id in &history.ignored {
            let node = &scene.nodes[*id];
            notes.about(
                format!("{} nodes are not evaluated", node.kind),
                format!("{} of {} (line {})", node.name, scene.path(mesh), node.line),
            );
        }
        if scene.mesh(base).is_some_and(|m| m.holes > 0) {
            notes.about("holes in faces are filled", scene.path(base));
        }
        let total = self.head.mesh.points.len() + polygons.points.len();
        if total > MOST_POINTS {
            let found = format!("{total} points with {}", instance.path(scene));
            return Err(Fault::new(scene.nodes[mesh].line, found, format!("at most {MOST_POINTS}")));
        }
        // The carrier is the head's motion; what stands above and below it is its place.
        let identity = |id: NodeId| (Some(id) == carrier).then_some(DAffine3::IDENTITY);
        let place = world_matrix(scene, instance, &identity);
        let first_point = self.head.mesh.points.len() as u32;
        self.head.mesh.points.extend(polygons.points.iter().map(|p| placed(&place, *p)));
        // A mirror turns triangles inside out.
        let mirrored = place.matrix3.determinant() < 0.0;
        let turned = mirrored != scene.mesh(mesh).is_some_and(|m| m.opposite);
        self.faces(instance, &polygons, first_point, turned, notes);
        for (node, geometry) in history.blend_shapes.iter().rev() {
            if let Data::BlendShape(data) = &scene.nodes[*node].data {
                self.targets(*node, data, *geometry, &polygons, &place, first_point, notes)?;
            }
        }
        Ok(())
    }

    /// Triangles by object group; vertices in the order of their texture coordinates.
    fn faces(
        &mut self,
        instance: &Instance,
        polygons: &Polygons,
        first_point: u32,
        turned: bool,
        notes: &mut Notes,
    ) {
        let groups = self.groups(instance, polygons.faces.len());
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
        for Group { name, material: mut kind, faces, set } in groups {
            let start = self.head.mesh.triangles.len() as u32;
            for face in faces.into_iter().map(|f| &polygons.faces[f as usize]) {
                let border: Vec<Vec3> =
                    face.iter().map(|[point, _]| Vec3::from(polygons.points[*point as usize])).collect();
                for triangle in triangulate(&border) {
                    let [a, b, c] = triangle.map(|corner| vertex(face[corner as usize]));
                    self.head.mesh.triangles.push(if turned { [a, c, b] } else { [a, b, c] });
                }
            }
            let end = self.head.mesh.triangles.len() as u32;
            // Scenes of this crate have maps for what their shaders show.
            let authored = set.filter(|_| self.appearance.is_none());
            let authored = authored.and_then(|set| self.looks.material(set, notes));
            let is_textured = authored.is_some_and(|a| self.looks.is_textured(a));
            if is_textured && !matches!(kind, Material::Hidden | Material::Other) {
                notes.about(
                    "textured skin, eyes, teeth, hair and lashes keep the look of their author (`--parts NAME=skin` makes one skin)",
                    name.as_str(),
                );
                kind = Material::Other;
            }
            self.head.authored.of_parts.push(authored);
            self.head.mesh.parts.push(Part { name, material: kind, triangles: start..end });
        }
    }

    /// Name, material and faces of each object group; faces in no group are a part of their own.
    fn groups(&self, instance: &Instance, face_count: usize) -> Vec<Group> {
        let scene = self.scene;
        let mesh = instance.mesh;
        let own = instance.name(scene);
        let sets: HashMap<&str, NodeId> = (scene.outputs(mesh))
            .filter(|(_, to)| to.attribute.starts_with("dsm"))
            .map(|(from, to)| (from.attribute.as_str(), to.node))
            .collect();
        let mut taken = vec![false; face_count];
        let mut groups = Vec::new();
        let all = scene.mesh(mesh).into_iter().flat_map(|m| &m.face_groups);
        // An instance whose groups are not written has those of the mesh itself.
        let number = instance.number as u32;
        let number = if all.clone().any(|((n, _), _)| *n == number) { number } else { 0 };
        let groups_of_this = all.filter(|((n, _), _)| *n == number);
        for (index, ((_, group), ranges)) in groups_of_this.enumerate() {
            let attribute = format!("iog[{number}].og[{group}]");
            let Some(node) = sets.get(attribute.as_str()).copied() else { continue };
            let set = scene.nodes[node].name.clone();
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
            groups.push(Group { name: part.0, material: part.1, faces, set: Some(node) });
        }
        let rest: Vec<u32> = (0..face_count as u32).filter(|f| !taken[*f as usize]).collect();
        if !rest.is_empty() {
            // A set of the whole instance has no group.
            let set = sets.get(format!("iog[{number}]").as_str()).or_else(|| sets.get("iog")).copied();
            groups.push(Group { name: own.to_owned(), material: guess_material(own), faces: rest, set });
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
        notes: &mut Notes,
    ) -> Result<(), Fault> {
        let scene = self.scene;
        let base_weights = data.base_weights.get(&geometry).and_then(|p| p.dense(polygons.points.len()));
        let items = self.items(node, data, geometry);
        let mut named: BTreeMap<u32, String> = BTreeMap::new();
        // Full targets first: in-betweens are named after them.
        let (full, between): (Vec<_>, Vec<_>) = items.into_iter().partition(|(_, item)| *item == 6000);
        if self.told.insert(node) {
            tell(scene, node, data, !between.is_empty(), notes);
        }
        for (target, item) in full.into_iter().chain(between) {
            let offsets = self.offsets(node, data, (geometry, target, item), polygons, notes)?;
            let painted = data.target_weights.get(&(geometry, target));
            let painted = painted.and_then(|p| p.dense(polygons.points.len()));
            let alias = data.aliases.get(&target).cloned().unwrap_or_else(|| format!("weight_{target}"));
            let name = if item == 6000 {
                let name = self.shape_name(node, data, target, &alias, first_point, notes);
                named.insert(target, name.clone());
                name
            } else {
                let weight = (f64::from(item) - 5000.0) / 1000.0;
                let shape = named.get(&target).cloned().unwrap_or_else(|| alias.clone());
                let hidden = data.hidden_items.get(&(target, item)).copied().unwrap_or(false);
                if hidden {
                    let name = format!("{}.{shape} at {weight}", scene.nodes[node].name);
                    notes.about("in-betweens that the shape editor hides were left out", name);
                    continue;
                }
                let between = weight > 0.0 && weight < 1.0;
                if !between || !named.contains_key(&target) {
                    let name = format!("{}.{shape} at {weight}", scene.nodes[node].name);
                    notes.about("targets at weights that are not between 0 and 1 were left out", name);
                    continue;
                }
                let written = data.item_names.get(&(target, item)).map(|n| plain_name(n));
                let mut name = written.unwrap_or_else(|| format!("{shape}_at_{}", item - 5000));
                let taken = |name: &String| {
                    self.driven.contains_key(name) || self.between.get(name).is_some_and(|s| *s != shape)
                };
                while taken(&name) {
                    name = format!("{shape}_{name}");
                }
                if self.between.insert(name.clone(), shape.clone()).is_none() {
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
                let mut offset = Vec3::from(offset);
                for weights in [&base_weights, &painted].into_iter().flatten() {
                    offset *= weights[point as usize];
                }
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
        for (_, to) in self.scene.inputs(node) {
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
        notes: &mut Notes,
    ) -> Result<Vec<(u32, [f32; 3])>, Fault> {
        let scene = self.scene;
        let (geometry, target, item) = key;
        let count = polygons.points.len();
        let live = scene.source(node, &format!("it[{geometry}].itg[{target}].iti[{item}].igt"));
        if let Some(plug) = live {
            let history = history(scene, plug.node);
            for id in history.ignored.iter().chain(history.blend_shapes.iter().map(|(id, _)| id)) {
                let deformer = &scene.nodes[*id];
                notes.about(
                    "deformers of live targets are not evaluated",
                    format!("{} ({}) of {}", deformer.name, deformer.kind, scene.path(plug.node)),
                );
            }
            let moved = points(scene, &history, notes);
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
                    notes.about(
                        "live targets that do not fit the mesh: their stored offsets are used",
                        format!("{} ({found}, the mesh {count})", scene.path(plug.node)),
                    );
                }
            }
        }
        let Some(stored) = data.items.get(&key) else { return Ok(Vec::new()) };
        stored_offsets(stored, count)
    }

    /// The shape that a weight drives. Weights of several nodes share one only if they have the same name and always
    /// the same value, as those of a face, its brows and its lashes.
    fn shape_name(
        &mut self,
        node: NodeId,
        data: &BlendShapeData,
        target: u32,
        alias: &str,
        first_point: u32,
        notes: &mut Notes,
    ) -> String {
        if let Some(index) = self.index_of_weight.get(&(node, target)) {
            return self.weights[*index].shape.clone();
        }
        let original = self.appearance.as_ref().and_then(|a| a.shapes.get(target as usize));
        let wanted = match original {
            Some(original) if plain_name(original) == alias => original.clone(),
            _ => alias.to_owned(),
        };
        let effect = effect(self.scene, node, data, target);
        let mut name = wanted.clone();
        let mut number = 1;
        loop {
            let same_node = |i: &usize| self.weights[*i].node == node;
            // Two deformers of one mesh are two weights, even with equal names.
            let here = |i: &usize| self.shapes[*i].1.range(first_point..).next().is_some();
            match self.driven.get(&name) {
                None if !self.between.contains_key(&name) => break,
                Some(i)
                    if !same_node(i)
                        && self.weights[*i].effect == effect
                        && !self.by_name.get(&name).is_some_and(here) =>
                {
                    break;
                }
                _ => {}
            }
            let of = &self.scene.nodes[node].name;
            name = if number == 1 { format!("{of}_{wanted}") } else { format!("{of}_{wanted}_{number}") };
            number += 1;
        }
        if name != wanted {
            notes.about("targets of one name that move apart are shapes of their own", name.clone());
        }
        self.driven.entry(name.clone()).or_insert(self.weights.len());
        self.index_of_weight.insert((node, target), self.weights.len());
        self.weights.push(Weight { node, shape: name.clone(), effect });
        name
    }

    fn finish(
        self,
        instances: Vec<Instance>,
        carrier: Option<NodeId>,
        folder: &Path,
        notes: &mut Notes,
    ) -> Built<'s> {
        let mut head = self.head;
        (head.authored.materials, head.authored.images) = self.looks.finish();
        if head.authored.materials.is_empty() {
            head.authored = Default::default();
        }
        let shape = |(name, offsets): (String, BTreeMap<u32, Vec3>)| {
            let (points, offsets) = offsets.into_iter().unzip();
            BlendShape { name, points, offsets, ..BlendShape::default() }
        };
        head.shapes = self.shapes.into_iter().map(shape).collect();
        let mut rig = None;
        if let Some(appearance) = self.appearance {
            rig = appearance.rig.clone();
            let mut lines = Vec::new();
            head.maps = appearance.load_maps(folder, &mut lines);
            lines.into_iter().for_each(|line| notes.say(line));
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
        Built { head, inbetweens: self.inbetweens, weights: self.weights, instances, rig, carrier }
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
