//! Files of other programs: every mesh of the scene, its morph targets as shapes.

use std::collections::HashMap;
use std::ops::Range;

use glam::{Mat3, Mat4, Vec2, Vec3};
use gltf::mesh::Mode;
use gltf::{Mesh, Node, Primitive, Semantic};
use rubor_rig::deform::normal_bends;
use rubor_rig::head::{BlendShape, Head, Material, Part, Vertex};

use super::Extent;
use super::accessor;
use super::document::{Document, Share};
use super::head_joints::HeadJoints;
use super::materials::Materials;
use super::motion::{Driver, Motion};
use super::placement::Placement;
use super::shapes::Shapes;
use super::weld::{Corner, weld};
use crate::error::ImportError;
use crate::import::materials::recognise;
use crate::notes::Notes;

/// A mesh that a node shows.
pub(super) struct Instance {
    pub(super) node: Option<usize>,
    pub(super) mesh: usize,
    /// Shape of each morph target.
    pub(super) slots: Vec<u32>,
}

/// A head, and what the file says of it besides.
pub(super) struct Foreign {
    pub(super) head: Head,
    /// Names of shapes and what moves them, in order.
    pub(super) shapes: Vec<(String, Driver)>,
    pub(super) instances: Vec<Instance>,
    pub(super) extent: Extent,
}

struct Builder<'a> {
    document: &'a Document,
    motion: &'a Motion,
    notes: &'a mut Notes,
    materials: Materials<'a>,
    head: Head,
    shapes: Shapes,
    /// Of each vertex of the head; points come when all are known.
    corners: Vec<Corner>,
    /// World transform of every node of the scene.
    world: HashMap<usize, Mat4>,
    /// Of each part: no name tells what it is.
    unnamed: Vec<bool>,
    /// Of each part: it has no material.
    bare: Vec<bool>,
    instances: Vec<Instance>,
    extent: Extent,
    joints: HeadJoints,
}

/// Slope between the normal of a vertex and that of its triangles from which files have normals of their own: 2 degrees, more
/// than programs that weigh triangles otherwise differ by on smooth surfaces.
const LEAST_LEAN: f32 = 0.035;

/// A tree of nodes is not deeper than this.
const MOST_LEVELS: usize = 512;

/// The head, and what moves each of its shapes.
pub(super) fn read(document: &Document, motion: &Motion, notes: &mut Notes) -> Result<Foreign, ImportError> {
    let shapes = Shapes::new(document, notes);
    let (head, corners, world) = (Head::default(), Vec::new(), HashMap::new());
    let materials = Materials::new(document);
    let (unnamed, bare, instances) = (Vec::new(), Vec::new(), Vec::new());
    let (extent, joints) = (Extent::default(), HeadJoints::of(document));
    let mut builder = Builder {
        document,
        motion,
        notes,
        materials,
        head,
        shapes,
        corners,
        world,
        unnamed,
        bare,
        instances,
        extent,
        joints,
    };
    let scene = document.gltf.default_scene().or_else(|| document.gltf.scenes().next());
    match scene {
        Some(scene) => {
            builder.head.name = scene.name().unwrap_or_default().to_owned();
            for node in scene.nodes() {
                builder.node(&node, Mat4::IDENTITY, 0)?;
            }
            builder.meshes(scene.nodes())?;
            let left_out = document.gltf.nodes().filter(|n| n.mesh().is_some());
            for node in left_out.filter(|n| !builder.world.contains_key(&n.index())) {
                builder.notes.add("meshes outside the scene are left out", format!("node {}", node.index()));
            }
        }
        None => {
            for mesh in document.gltf.meshes() {
                let node =
                    document.gltf.nodes().find(|n| n.mesh().is_some_and(|m| m.index() == mesh.index()));
                let node = node.map(|n| n.index());
                builder.mesh(&mesh, node, &Placement::Rigid(Mat4::IDENTITY))?;
            }
        }
    }
    let Foreign { mut head, shapes, instances, mut extent } = builder.finish();
    if !extent.head_share.iter().any(|share| *share > 0.0) {
        extent.head_share.clear();
    }
    if head.mesh.triangles.is_empty() {
        return Err(document.fail("scene", "no triangles", "a mesh"));
    }
    if head.name.is_empty() {
        head.name = document.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    }
    Ok(Foreign { head, shapes, instances, extent })
}

impl Builder<'_> {
    /// Transforms of a node and all below it.
    fn node(&mut self, node: &Node<'_>, parent: Mat4, level: usize) -> Result<(), ImportError> {
        let at = format!("node {}", node.index());
        if self.world.contains_key(&node.index()) {
            return Err(self.document.fail(&at, "more than one way to it", "a tree of nodes"));
        }
        if level >= MOST_LEVELS {
            let expected = format!("at most {MOST_LEVELS} levels of nodes");
            return Err(self.document.fail(&at, "a deeper tree", expected));
        }
        let world_from_node = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        if !world_from_node.is_finite() {
            return Err(self.document.fail(&at, "a transform that is not finite", "finite numbers"));
        }
        self.world.insert(node.index(), world_from_node);
        node.children().try_for_each(|child| self.node(&child, world_from_node, level + 1))
    }

    /// Meshes of nodes, depth first; joints may stand anywhere, so all transforms are known before.
    fn meshes<'n>(&mut self, nodes: impl Iterator<Item = Node<'n>>) -> Result<(), ImportError> {
        for node in nodes {
            if let Some(mesh) = node.mesh() {
                let placement = Placement::of(self.document, &node, &self.world)?;
                self.mesh(&mesh, Some(node.index()), &placement)?;
            }
            self.meshes(node.children())?;
        }
        Ok(())
    }

    fn mesh(
        &mut self,
        mesh: &Mesh<'_>,
        node: Option<usize>,
        placement: &Placement,
    ) -> Result<(), ImportError> {
        let document = self.document;
        let slots = self.shapes.of_instance(document, mesh, node, self.motion, self.notes);
        self.instances.push(Instance { node, mesh: mesh.index(), slots: slots.clone() });
        for (i, primitive) in mesh.primitives().enumerate() {
            let at = |what: &str| format!("mesh {}, primitive {i}, {what}", mesh.index());
            let positions = primitive
                .get(&Semantic::Positions)
                .ok_or_else(|| document.fail(&at("POSITION"), "nothing", "an accessor"))?;
            let positions = accessor::floats::<3>(document, &at("POSITION"), &positions)?;
            let count = positions.len();
            document.take(&at("POSITION"), Share::Vertices, count)?;
            let check = |what: &str, found: usize| {
                if found == count {
                    return Ok(());
                }
                Err(document.fail(&at(what), format!("{found} elements"), format!("{count}, one per vertex")))
            };
            let normals = match primitive.get(&Semantic::Normals) {
                Some(a) => accessor::floats::<3>(document, &at("NORMAL"), &a)?,
                None => vec![[0.0; 3]; count],
            };
            check("NORMAL", normals.len())?;
            let mut uvs = match primitive.get(&Semantic::TexCoords(0)) {
                Some(a) => accessor::floats::<2>(document, &at("TEXCOORD_0"), &a)?,
                None => {
                    self.notes.add("parts without texture coordinates have them all at 0", at("TEXCOORD_0"));
                    vec![[0.0; 2]; count]
                }
            };
            check("TEXCOORD_0", uvs.len())?;
            let second_uvs = match primitive.get(&Semantic::TexCoords(1)) {
                Some(a) => accessor::floats::<2>(document, &at("TEXCOORD_1"), &a)?,
                None => vec![[0.0; 2]; count],
            };
            check("TEXCOORD_1", second_uvs.len())?;
            if let Some(a) = primitive.get(&Semantic::TexCoords(0))
                && a.data_type() != gltf::accessor::DataType::F32
            {
                self.spread(&primitive, &mut uvs, a.normalized(), &at("TEXCOORD_0"));
            }
            let colors = colors(document, &at("COLOR_0"), &primitive, count)?;
            check("COLOR_0", colors.len())?;
            let mut targets: Vec<(u32, Vec<[f32; 3]>)> = Vec::new();
            for (t, target) in primitive.morph_targets().enumerate() {
                // An accessor without data moves no points.
                let Some(a) = target.positions().filter(|a| a.view().is_some() || a.sparse().is_some())
                else {
                    continue;
                };
                let what = format!("target {t}");
                let offsets = accessor::floats::<3>(document, &at(&what), &a)?;
                check(&what, offsets.len())?;
                targets.push((slots[t], offsets));
            }
            // As the points of a welded vertex are compared.
            targets.sort_by_key(|(slot, _)| *slot);
            let indices = match primitive.indices() {
                Some(a) => accessor::integers(document, &at("indices"), &a)?,
                None => (0..count as u32).collect(),
            };
            if let Some(v) = indices.iter().find(|v| **v as usize >= count) {
                let expected = format!("one below {count}");
                return Err(document.fail(&at("indices"), format!("vertex {v}"), expected));
            }
            let Some(mut triangles) = triangles(&indices, primitive.mode()) else {
                self.notes.add("points and lines are no surface and are left out", at("mode"));
                continue;
            };
            if primitive.mode() == Mode::Triangles && indices.len() % 3 != 0 {
                let rest = format!("{} indices", indices.len());
                self.notes.add("indices after the last whole triangle are left out", at(&rest));
            }
            let worlds = placement.of_vertices(document, &at(""), &primitive, count)?;
            if worlds.at(0).determinant() < 0.0 {
                triangles.iter_mut().for_each(|t| t.swap(1, 2));
            }
            let first = self.corners.len() as u32;
            for v in 0..count {
                let world = worlds.at(v);
                let position = world.transform_point3(Vec3::from_array(positions[v]));
                // Normals stay at right angles to a surface that is scaled unevenly.
                let normal = Mat3::from_mat4(world).inverse().transpose() * Vec3::from_array(normals[v]);
                let mut moved: Vec<(u32, Vec3)> = Vec::new();
                for (slot, offsets) in &targets {
                    if offsets[v] != [0.0; 3] {
                        moved.push((*slot, world.transform_vector3(Vec3::from_array(offsets[v]))));
                    }
                }
                if !position.is_finite() || moved.iter().any(|(_, o)| !o.is_finite()) {
                    return Err(document.fail(
                        &at("POSITION"),
                        format!("vertex {v} out of range"),
                        "finite places",
                    ));
                }
                self.corners.push(Corner { position, normal: normal.normalize_or_zero(), moved });
                self.head.mesh.vertices.push(Vertex { point: 0, uv: Vec2::from_array(uvs[v]) });
                let authored = &mut self.materials.authored;
                authored.second_uvs.push(Vec2::from_array(second_uvs[v]));
                authored.colors_linear.push(colors[v]);
            }
            let shares = self.joints.shares(document, &at(""), node, &primitive, count)?;
            self.extent.head_share.extend(shares);
            self.extent.meshes.push(path(mesh, node, document));
            let start = self.head.mesh.triangles.len() as u32;
            self.head.mesh.triangles.extend(triangles.iter().map(|t| t.map(|v| first + v)));
            let end = self.head.mesh.triangles.len() as u32;
            self.part(mesh, node, &primitive, start..end);
        }
        Ok(())
    }

    /// Texture coordinates of whole numbers may need a transform to be 0 to 1. Where all textures of the material have
    /// the same one it moves from the textures to the vertices, so that every map of the part has the same coordinates.
    fn spread(&mut self, primitive: &Primitive<'_>, uvs: &mut [[f32; 2]], is_normalized: bool, at: &str) {
        let material = self.materials.read(primitive.material().index(), self.notes);
        match self.materials.take_transform(material) {
            Some(transform) => {
                let matrix = transform.matrix();
                for uv in uvs {
                    *uv = matrix.transform_point2(Vec2::from_array(*uv)).to_array();
                }
            }
            None if is_normalized => {}
            None => {
                let message = "texture coordinates are whole numbers and the textures do not say one scale for them: maps of rubor's own repeat there";
                self.notes.add(message, at);
            }
        }
    }

    /// A part: what names say it is, and the material of its author.
    fn part(
        &mut self,
        mesh: &Mesh<'_>,
        node: Option<usize>,
        primitive: &Primitive<'_>,
        triangles: Range<u32>,
    ) {
        let material = primitive.material();
        let node = node.and_then(|n| self.document.gltf.nodes().nth(n));
        let node = node.as_ref().and_then(Node::name);
        // The name of a mesh of several materials speaks of no one of them.
        let is_whole = mesh.primitives().len() == 1 || material.index().is_none();
        let names = [material.name(), mesh.name().filter(|_| is_whole), node.filter(|_| is_whole)];
        let recognised = names.iter().flatten().find_map(|name| recognise(name));
        let name = material.name().or(mesh.name()).or(node).unwrap_or("mesh").to_owned();
        let authored = self.materials.read(material.index(), self.notes);
        let look = &self.materials.authored.materials[authored as usize];
        let is_textured = look.base_color_texture.is_some();
        let kind = match recognised {
            // Shells before eyes are named as eyes are.
            Some(Material::Eye) if look.is_clear() => {
                self.notes.add("clear shells of eyes keep the look of their author", name.as_str());
                Material::Other
            }
            // Eyes, teeth, hair and so on of rubor take texture coordinates of its own; skin keeps its colour
            // (`convert::own_color`).
            Some(kind)
                if is_textured && !matches!(kind, Material::Skin | Material::Hidden | Material::Other) =>
            {
                let message = "textured eyes, teeth, hair and lashes keep the look of their author";
                self.notes.add(message, name.as_str());
                Material::Other
            }
            Some(kind) => kind,
            None => Material::Other,
        };
        self.head.mesh.parts.push(Part { name, material: kind, triangles });
        self.materials.authored.of_parts.push(Some(authored));
        self.unnamed.push(recognised.is_none());
        self.bare.push(material.index().is_none());
    }

    /// Parts that no name tells: theirs is the look of their author, and they are skin only where the file has no look at all.
    fn name_rest(&mut self) {
        let parts = &mut self.head.mesh.parts;
        let has_skin = parts.iter().any(|p| p.material == Material::Skin);
        if !has_skin && self.bare.iter().all(|b| *b) && self.unnamed.iter().any(|u| *u) {
            for (part, _) in parts.iter_mut().zip(&self.unnamed).filter(|(_, unnamed)| **unnamed) {
                part.material = Material::Skin;
                let message =
                    "parts without a material, and with no name that tells what they are, are taken for skin";
                self.notes.add(message, part.name.as_str());
            }
            return;
        }
        for (part, _) in parts.iter().zip(&self.unnamed).filter(|(_, unnamed)| **unnamed) {
            let message = "parts that no name tells keep the look of their author (`rubor import --parts NAME=skin` makes one skin)";
            self.notes.add(message, part.name.as_str());
        }
        if !has_skin {
            self.notes.say(
                "no part is skin: blood, wrinkles and scattering show nowhere (`rubor import --parts NAME=skin` makes one skin)",
            );
        }
    }

    /// Points from vertices, offsets of shapes by point.
    fn finish(mut self) -> Foreign {
        self.name_rest();
        let (mut head, shapes) = (self.head, self.shapes.finish());
        head.authored = self.materials.authored;
        head.authored.drop_defaults();
        let (point_of, first_of) = weld(&self.corners);
        head.mesh.vertices.iter_mut().zip(point_of).for_each(|(vertex, point)| vertex.point = point);
        head.shapes = shapes
            .iter()
            .map(|(name, _)| BlendShape { name: name.clone(), ..BlendShape::default() })
            .collect();
        for (point, vertex) in first_of.into_iter().enumerate() {
            let corner = &self.corners[vertex];
            head.mesh.points.push(corner.position);
            for (slot, offset) in &corner.moved {
                let shape = &mut head.shapes[*slot as usize];
                shape.points.push(point as u32);
                shape.offsets.push(*offset);
            }
        }
        head.authored.normals = self.corners.iter().map(|c| c.normal).collect();
        // Most files have those of their geometry.
        let lean = |[x, y]: &[f32; 2]| x.hypot(*y);
        if normal_bends(&head).iter().all(|bend| lean(bend) < LEAST_LEAN) {
            head.authored.normals.clear();
        }
        Foreign { head, shapes, instances: self.instances, extent: self.extent }
    }
}

/// Names of node and mesh, to choose parts by.
fn path(mesh: &Mesh<'_>, node: Option<usize>, document: &Document) -> String {
    let node = node.and_then(|n| document.gltf.nodes().nth(n));
    let name = |name: Option<&str>| name.unwrap_or_default().to_owned();
    format!("{}|{}", name(node.as_ref().and_then(Node::name)), name(mesh.name()))
}

/// Factors of the base colour of each vertex.
pub(super) fn colors(
    document: &Document,
    at: &str,
    primitive: &Primitive<'_>,
    count: usize,
) -> Result<Vec<[f32; 4]>, ImportError> {
    match primitive.get(&Semantic::Colors(0)) {
        Some(a) if a.dimensions().multiplicity() == 3 => {
            let colors = accessor::floats::<3>(document, at, &a)?;
            Ok(colors.into_iter().map(|[r, g, b]| [r, g, b, 1.0].map(|c: f32| c.max(0.0))).collect())
        }
        Some(a) => {
            let colors = accessor::floats::<4>(document, at, &a)?;
            Ok(colors.into_iter().map(|color| color.map(|c| c.max(0.0))).collect())
        }
        None => Ok(vec![[1.0; 4]; count]),
    }
}

/// Triangles of an index list; `None` for points and lines.
fn triangles(indices: &[u32], mode: Mode) -> Option<Vec<[u32; 3]>> {
    match mode {
        Mode::Triangles => Some(indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()),
        // Every second triangle of a strip is turned.
        Mode::TriangleStrip => Some(
            (indices.windows(3).enumerate())
                .map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] })
                .collect(),
        ),
        Mode::TriangleFan => Some(indices.get(1..)?.windows(2).map(|t| [indices[0], t[0], t[1]]).collect()),
        _ => None,
    }
}
