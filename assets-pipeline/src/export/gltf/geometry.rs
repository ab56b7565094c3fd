//! Primitives with their morph targets.

use std::collections::HashMap;

use glam::Vec3;
use rayon::prelude::*;
use rubor_rig::deform::{bent, deform_points, normal_bends, point_normals, vertex_tangents};
use rubor_rig::head::{BlendShape, Head, Material, OcclusionChange};
use serde_json::{Value, json};

use super::buffer::{self, Buffer, Target};
use crate::export::skin_color::ShapeColors;
use crate::facial_appearance::PartEntry;

/// What morph targets carry besides positions.
pub(super) struct TargetOptions<'a> {
    pub(super) normals: bool,
    /// Colours of the skin.
    pub(super) colors: Option<&'a ShapeColors>,
    /// How much of the light reaches what the skin covers.
    pub(super) shape_visibility: bool,
}

/// Ambient visibility of what lies behind lips and lids as a factor of its colour: other viewers have no shadow there, and
/// their occlusion textures leave lamps alone.
struct Visibility<'a> {
    of_points: &'a [f32],
    /// Least factor, judged on pictures of the default head in three.js beside the renderer's, with and without shadows.
    least: f32,
}

impl<'a> Visibility<'a> {
    fn of(head: &'a Head, material: Material) -> Option<Self> {
        let least = match material {
            Material::Mucosa | Material::Gums => 0.2,
            Material::Teeth => 0.45,
            Material::Eye => 0.7,
            _ => return None,
        };
        (!head.mesh.occlusion.is_empty()).then_some(Self { of_points: &head.mesh.occlusion, least })
    }

    fn factor(&self, visibility: f32) -> f32 {
        visibility.clamp(0.0, 1.0).max(self.least)
    }

    fn rest(&self, point: u32) -> f32 {
        self.factor(self.of_points[point as usize])
    }

    /// Change of the factor at weight 1.
    fn change(&self, change: &OcclusionChange) -> f32 {
        self.factor(self.of_points[change.point as usize] + change.at_full) - self.rest(change.point)
    }
}

/// One primitive a part with vertices of its own (viewers keep morph targets per primitive, so sharing all vertices among
/// parts would multiply them), and which points they are.
pub(super) fn primitives(
    head: &Head,
    kept: &[usize],
    options: &TargetOptions<'_>,
    buffer: &mut Buffer,
) -> (Vec<Value>, Vec<PartEntry>) {
    let mesh = &head.mesh;
    let normals = point_normals(mesh, &mesh.points);
    let tangents = vertex_tangents(mesh, &mesh.points, &normals);
    let bends = normal_bends(head);
    let turned: Vec<Vec<(u32, Vec3)>> = (kept.par_iter().filter(|_| options.normals))
        .map(|s| normal_offsets(head, &head.shapes[*s], &normals))
        .collect();
    let mut primitives = Vec::new();
    let mut entries = Vec::new();
    for (material, part) in mesh.parts.iter().enumerate() {
        let mut local: HashMap<u32, u32> = HashMap::new();
        let mut vertices: Vec<u32> = Vec::new();
        let triangles = &mesh.triangles[part.triangles.start as usize..part.triangles.end as usize];
        let indices: Vec<u32> = triangles
            .as_flattened()
            .iter()
            .map(|v| {
                *local.entry(*v).or_insert_with(|| {
                    vertices.push(*v);
                    vertices.len() as u32 - 1
                })
            })
            .collect();
        let points: Vec<u32> = vertices.iter().map(|v| mesh.vertices[*v as usize].point).collect();
        let at = |list: &[Vec3]| -> Vec<[f32; 3]> {
            points.iter().map(|p| list[*p as usize].to_array()).collect()
        };
        let uvs: Vec<[f32; 2]> = vertices.iter().map(|v| mesh.vertices[*v as usize].uv.to_array()).collect();
        let frames = vertices.iter().map(|v| {
            let (normal, v) = (normals[mesh.vertices[*v as usize].point as usize], *v as usize);
            let (normal, tangent) = bent(normal, tangents[v], bends.get(v).copied().unwrap_or_default());
            (normal.to_array(), tangent.to_array())
        });
        let (leaning, tangents): (Vec<[f32; 3]>, Vec<[f32; 4]>) = frames.unzip();
        let mut vertices_of: HashMap<u32, Vec<u32>> = HashMap::new();
        points.iter().enumerate().for_each(|(v, p)| vertices_of.entry(*p).or_default().push(v as u32));
        let to_vertices = |moved: &mut dyn Iterator<Item = (u32, Vec3)>| {
            let mut moved: Vec<(u32, Vec3)> = moved
                .flat_map(|(p, d)| vertices_of.get(&p).into_iter().flatten().map(move |v| (*v, d)))
                .collect();
            moved.sort_unstable_by_key(|(v, _)| *v);
            moved
        };
        let mut primitive = json!({
            "attributes": {
                "POSITION": buffer.floats(&at(&mesh.points), Target::Vertices, true, buffer::POSITION),
                "NORMAL": buffer.normals(&leaning),
                "TANGENT": buffer.tangents(&tangents),
                "TEXCOORD_0": buffer.floats(&uvs, Target::Vertices, false, buffer::TEXTURE_COORDINATE),
            },
            "indices": buffer.indices(&indices, vertices.len(), Target::Indices),
            "material": material,
        });
        let colors = options.colors.filter(|_| part.material == Material::Skin);
        let visibility = Visibility::of(head, part.material);
        if let Some(colors) = colors {
            let rest = vec![[colors.rest; 3]; vertices.len()];
            primitive["attributes"]["COLOR_0"] =
                json!(buffer.floats(&rest, Target::Vertices, false, buffer::COLOR));
        } else if let Some(visibility) = &visibility {
            let rest: Vec<[f32; 3]> = points.iter().map(|p| [visibility.rest(*p); 3]).collect();
            primitive["attributes"]["COLOR_0"] =
                json!(buffer.floats(&rest, Target::Vertices, false, buffer::COLOR));
        }
        let is_authored = head.needed_material(material).is_some();
        if is_authored {
            let second: Vec<_> =
                vertices.iter().map(|v| head.authored.second_uv(*v)).map(|uv| uv.to_array()).collect();
            if !head.authored.second_uvs.is_empty() {
                primitive["attributes"]["TEXCOORD_1"] =
                    json!(buffer.floats(&second, Target::Vertices, false, buffer::TEXTURE_COORDINATE));
            }
            let colors: Vec<_> = vertices.iter().map(|v| head.authored.color_linear(*v)).collect();
            if !head.authored.colors_linear.is_empty() {
                primitive["attributes"]["COLOR_0"] =
                    json!(buffer.floats(&colors, Target::Vertices, false, buffer::COLOR));
            }
        }
        // Every target must be there on every primitive; those that do not move it share one empty accessor.
        let mut still = None;
        let mut targets = Vec::new();
        for (i, s) in kept.iter().enumerate() {
            let shape = &head.shapes[*s];
            let offsets = to_vertices(&mut shape.points.iter().copied().zip(shape.offsets.iter().copied()));
            let mut or_still = |accessor: Option<usize>, buffer: &mut Buffer| match accessor {
                Some(accessor) => accessor,
                None => *still.get_or_insert_with(|| buffer.zeros(vertices.len())),
            };
            let put = |moved: &[(u32, Vec3)], precision, buffer: &mut Buffer| {
                buffer.displacements(vertices.len(), moved, precision)
            };
            let moved = put(&offsets, buffer::DISPLACEMENT, buffer);
            let mut target = json!({"POSITION": or_still(moved, buffer)});
            if let Some(turned) = turned.get(i) {
                let turned = to_vertices(&mut turned.iter().copied());
                let turned = put(&turned, buffer::NORMAL_CHANGE, buffer);
                target["NORMAL"] = json!(or_still(turned, buffer));
            }
            if let Some(colors) = colors {
                let changed = colors.changes[*s].iter();
                let mut changed: Vec<(u32, Vec3)> =
                    changed.filter_map(|(v, c)| Some((*local.get(v)?, *c))).collect();
                changed.sort_unstable_by_key(|(v, _)| *v);
                let changed = buffer.color_changes(vertices.len(), &changed);
                target["COLOR_0"] = json!(or_still(changed, buffer));
            } else if let Some(visibility) = visibility.as_ref().filter(|_| options.shape_visibility) {
                let mut changed =
                    shape.occlusion.iter().map(|c| (c.point, Vec3::splat(visibility.change(c))));
                let changed = buffer.color_changes(vertices.len(), &to_vertices(&mut changed));
                target["COLOR_0"] = json!(or_still(changed, buffer));
            }
            targets.push(target);
        }
        if !targets.is_empty() {
            primitive["targets"] = json!(targets);
        }
        primitives.push(primitive);
        let points = buffer.indices(&points, mesh.points.len(), Target::None) as u32;
        entries.push(PartEntry {
            name: part.name.clone(),
            material: part.material,
            authored: is_authored,
            points,
        });
    }
    (primitives, entries)
}

/// Change of each normal at weight 1, where it exceeds about a sixteenth of a degree.
fn normal_offsets(head: &Head, shape: &BlendShape, rest: &[Vec3]) -> Vec<(u32, Vec3)> {
    let points = deform_points(&head.mesh, std::slice::from_ref(shape), &[1.0]);
    let turned = point_normals(&head.mesh, &points);
    (turned.iter().zip(rest).enumerate())
        .map(|(i, (n, n0))| (i as u32, *n - *n0))
        .filter(|(_, d)| d.length() > 1e-3)
        .collect()
}
