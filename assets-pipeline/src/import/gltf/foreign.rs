//! Files of other programs: every mesh of the scene, its morph targets by name.

use std::collections::{BTreeMap, HashMap};

use glam::{Mat4, Vec2, Vec3};
use gltf::mesh::Mode;
use gltf::{Mesh, Node, Semantic};
use rubor_rig::head::{BlendShape, Head, Part, Vertex};

use super::accessor;
use super::document::Document;
use super::placement::Placement;
use crate::error::ImportError;
use crate::import::materials::guess_material;

/// A vertex as far as welding is concerned: bits of position, normal and every offset that is not zero.
type WeldKey = Vec<u32>;

#[derive(Default)]
struct Builder {
    head: Head,
    /// Shape names in order of first use, and offsets by point.
    shapes: Vec<(String, BTreeMap<u32, Vec3>)>,
    points: HashMap<WeldKey, u32>,
    /// World transform of every node of the scene.
    world: HashMap<usize, Mat4>,
}

/// A tree of nodes is not deeper than this.
const MOST_LEVELS: usize = 512;

pub(super) fn read(document: &Document) -> Result<Head, ImportError> {
    let mut builder = Builder::default();
    let scene = document.gltf.default_scene().or_else(|| document.gltf.scenes().next());
    match scene {
        Some(scene) => {
            builder.head.name = scene.name().unwrap_or_default().to_owned();
            for node in scene.nodes() {
                builder.node(document, &node, Mat4::IDENTITY, 0)?;
            }
            builder.meshes(document, scene.nodes())?;
        }
        None => {
            for mesh in document.gltf.meshes() {
                builder.mesh(document, &mesh, &Placement::Rigid(Mat4::IDENTITY))?;
            }
        }
    }
    let mut head = builder.head;
    if head.mesh.triangles.is_empty() {
        return Err(document.fail("scene", "no triangles", "a mesh"));
    }
    if head.name.is_empty() {
        head.name = document.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    }
    head.shapes = (builder.shapes.into_iter())
        .map(|(name, moved)| {
            let (points, offsets) = moved.into_iter().unzip();
            BlendShape { name, points, offsets, ..BlendShape::default() }
        })
        .collect();
    Ok(head)
}

/// Names of the morph targets: `extras.targetNames`, else `target 0` and so on.
pub(super) fn target_names(mesh: &Mesh<'_>) -> Vec<String> {
    let count = mesh.primitives().map(|p| p.morph_targets().count()).max().unwrap_or(0);
    let extras: Option<serde_json::Value> =
        mesh.extras().as_ref().and_then(|e| serde_json::from_str(e.get()).ok());
    let name = |i: usize| {
        let given = extras.as_ref().and_then(|e| e["targetNames"][i].as_str());
        given.map_or_else(|| format!("target {i}"), str::to_owned)
    };
    (0..count).map(name).collect()
}

impl Builder {
    /// Transforms of a node and all below it.
    fn node(
        &mut self,
        document: &Document,
        node: &Node<'_>,
        parent: Mat4,
        level: usize,
    ) -> Result<(), ImportError> {
        let at = format!("node {}", node.index());
        if self.world.contains_key(&node.index()) {
            return Err(document.fail(&at, "more than one way to it", "a tree of nodes"));
        }
        if level >= MOST_LEVELS {
            return Err(document.fail(
                &at,
                "a deeper tree",
                format!("at most {MOST_LEVELS} levels of nodes"),
            ));
        }
        let world_from_node = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        if !world_from_node.is_finite() {
            return Err(document.fail(&at, "a transform that is not finite", "finite numbers"));
        }
        self.world.insert(node.index(), world_from_node);
        node.children().try_for_each(|child| self.node(document, &child, world_from_node, level + 1))
    }

    /// Meshes of nodes, depth first; joints may stand anywhere, so all transforms are known before.
    fn meshes<'a>(
        &mut self,
        document: &Document,
        nodes: impl Iterator<Item = Node<'a>>,
    ) -> Result<(), ImportError> {
        for node in nodes {
            if let Some(mesh) = node.mesh() {
                let placement = Placement::of(document, &node, &self.world)?;
                self.mesh(document, &mesh, &placement)?;
            }
            self.meshes(document, node.children())?;
        }
        Ok(())
    }

    fn mesh(
        &mut self,
        document: &Document,
        mesh: &Mesh<'_>,
        placement: &Placement,
    ) -> Result<(), ImportError> {
        let names = target_names(mesh);
        for (i, primitive) in mesh.primitives().enumerate() {
            let at = |what: &str| format!("mesh {}, primitive {i}, {what}", mesh.index());
            let positions = primitive
                .get(&Semantic::Positions)
                .ok_or_else(|| document.fail(&at("POSITION"), "nothing", "an accessor"))?;
            let positions = accessor::floats::<3>(document, &at("POSITION"), &positions)?;
            let count = positions.len();
            let check = |what: &str, found: usize| {
                if found == count {
                    return Ok(());
                }
                Err(document.fail(&at(what), format!("{found} elements"), format!("{count}, one a vertex")))
            };
            let normals = match primitive.get(&Semantic::Normals) {
                Some(a) => accessor::floats::<3>(document, &at("NORMAL"), &a)?,
                None => vec![[0.0; 3]; count],
            };
            check("NORMAL", normals.len())?;
            let uvs = match primitive.get(&Semantic::TexCoords(0)) {
                Some(a) => accessor::floats::<2>(document, &at("TEXCOORD_0"), &a)?,
                None => vec![[0.0; 2]; count],
            };
            check("TEXCOORD_0", uvs.len())?;
            let mut targets = Vec::new();
            for (t, target) in primitive.morph_targets().enumerate() {
                let what = format!("target {t}");
                let offsets = match target.positions() {
                    Some(a) => accessor::floats::<3>(document, &at(&what), &a)?,
                    None => vec![[0.0; 3]; count],
                };
                check(&what, offsets.len())?;
                targets.push(offsets);
            }
            let indices = match primitive.indices() {
                Some(a) => accessor::integers(document, &at("indices"), &a)?,
                None => (0..count as u32).collect(),
            };
            if let Some(v) = indices.iter().find(|v| **v as usize >= count) {
                return Err(document.fail(
                    &at("indices"),
                    format!("vertex {v}"),
                    format!("one below {count}"),
                ));
            }
            let Some(mut triangles) = triangles(&indices, primitive.mode()) else {
                continue; // points and lines are no surface
            };
            let worlds = placement.of_vertices(document, &at(""), &primitive, count)?;
            if worlds.at(0).determinant() < 0.0 {
                triangles.iter_mut().for_each(|t| t.swap(1, 2));
            }
            let first = self.head.mesh.vertices.len() as u32;
            let slots: Vec<usize> = names.iter().map(|n| self.shape_slot(n)).collect();
            for v in 0..count {
                let point = self.weld(worlds.at(v), positions[v], normals[v], &slots, &targets, v);
                self.head.mesh.vertices.push(Vertex { point, uv: Vec2::from_array(uvs[v]) });
            }
            let start = self.head.mesh.triangles.len() as u32;
            self.head.mesh.triangles.extend(triangles.iter().map(|t| t.map(|v| first + v)));
            let end = self.head.mesh.triangles.len() as u32;
            let material = primitive.material();
            let name = material.name().or(mesh.name()).unwrap_or("mesh").to_owned();
            let material = guess_material(&name);
            self.head.mesh.parts.push(Part { name, material, triangles: start..end });
        }
        Ok(())
    }

    fn shape_slot(&mut self, name: &str) -> usize {
        match self.shapes.iter().position(|(n, _)| n == name) {
            Some(i) => i,
            None => {
                self.shapes.push((name.to_owned(), BTreeMap::new()));
                self.shapes.len() - 1
            }
        }
    }

    /// The point of a vertex: an old one if position, normal and all offsets are the same bit for bit, so that texture
    /// seams close and edges that are meant to be sharp stay.
    fn weld(
        &mut self,
        world: Mat4,
        position: [f32; 3],
        normal: [f32; 3],
        slots: &[usize],
        targets: &[Vec<[f32; 3]>],
        v: usize,
    ) -> u32 {
        let position = world.transform_point3(Vec3::from_array(position));
        let normal = world.transform_vector3(Vec3::from_array(normal));
        let mut key: WeldKey =
            position.to_array().iter().chain(&normal.to_array()).map(|c| c.to_bits()).collect();
        let mut moved = Vec::new();
        for (slot, offsets) in slots.iter().zip(targets) {
            if offsets[v] != [0.0; 3] {
                let offset = world.transform_vector3(Vec3::from_array(offsets[v]));
                key.push(*slot as u32);
                key.extend(offset.to_array().map(f32::to_bits));
                moved.push((*slot, offset));
            }
        }
        let next = self.head.mesh.points.len() as u32;
        let point = *self.points.entry(key).or_insert(next);
        if point == next {
            self.head.mesh.points.push(position);
            for (slot, offset) in moved {
                self.shapes[slot].1.insert(point, offset);
            }
        }
        point
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
