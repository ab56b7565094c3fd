//! The mesh, its blend shapes and the subsets of its parts.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use glam::Vec3;
use rayon::prelude::*;
use rubor_rig::deform::{deform_points, point_normals};
use rubor_rig::head::Head;
use rubor_rig::names::action_units;

use super::{Target, quoted, unique};

/// Path of the mesh.
const MESH: &str = "/rubor_head/Face";

pub(super) fn write(out: &mut String, head: &Head, targets: &[Target], shape_normals: bool) {
    let mesh = &head.mesh;
    let normals = point_normals(mesh, &mesh.points);
    out.push_str(
        "    def Mesh \"Face\" (\n        prepend apiSchemas = [\"SkelBindingAPI\", \"MaterialBindingAPI\"]\n    )\n    {\n",
    );
    if let Some((low, high)) = head.bounds() {
        let _ = writeln!(out, "        float3[] extent = [{}, {}]", vector(low), vector(high));
    }
    let triangles = &mesh.triangles;
    let _ = writeln!(out, "        int[] faceVertexCounts = [{}]", vec!["3"; triangles.len()].join(", "));
    let points = triangles.as_flattened().iter().map(|v| mesh.vertices[*v as usize].point.to_string());
    list(out, 2, "int[] faceVertexIndices", points, "");
    list(
        out,
        2,
        "normal3f[] normals",
        normals.iter().map(|n| vector(*n)),
        " (\n            interpolation = \"vertex\"\n        )",
    );
    list(out, 2, "point3f[] points", mesh.points.iter().map(|p| vector(*p)), "");
    // USD's v grows upwards.
    let uvs = mesh.vertices.iter().map(|v| format!("({}, {})", v.uv.x, 1.0 - f64::from(v.uv.y)));
    list(
        out,
        2,
        "texCoord2f[] primvars:st",
        uvs,
        " (\n            interpolation = \"faceVarying\"\n        )",
    );
    list(out, 2, "int[] primvars:st:indices", triangles.as_flattened().iter().map(u32::to_string), "");
    if !targets.is_empty() {
        let names = targets.iter().map(|t| quoted(&head.shapes[t.shape].name));
        list(out, 2, "uniform token[] skel:blendShapes", names, "");
        let paths = targets.iter().map(|t| format!("<{MESH}/{}>", t.prim));
        list(out, 2, "rel skel:blendShapeTargets", paths, "");
    }
    out.push_str("        rel skel:skeleton = </rubor_head/Skeleton>\n");
    out.push_str("        uniform token subdivisionScheme = \"none\"\n");
    out.push_str("        uniform token subsetFamily:materialBind:familyType = \"partition\"\n\n");
    let prims: Vec<String> =
        targets.par_iter().map(|target| shape(head, target, &normals, shape_normals)).collect();
    prims.iter().for_each(|p| out.push_str(p));
    let mut names: BTreeSet<String> = targets.iter().map(|t| t.prim.clone()).collect();
    for (part, look) in mesh.parts.iter().zip(looks(head)) {
        if part.triangles.is_empty() {
            continue;
        }
        let name = unique(&part.name, &mut names);
        let _ = write!(
            out,
            "        def GeomSubset \"{name}\" (\n            prepend apiSchemas = [\"MaterialBindingAPI\"]\n        )\n        {{\n            \
             uniform token elementType = \"face\"\n            uniform token familyName = \"materialBind\"\n"
        );
        list(out, 3, "int[] indices", part.triangles.clone().map(|t| t.to_string()), "");
        let _ = writeln!(out, "            rel material:binding = </rubor_head/Looks/{look}>\n        }}\n");
    }
    out.push_str("    }\n\n");
}

/// Name of the material of each part.
pub(super) fn looks(head: &Head) -> Vec<String> {
    let mut names = BTreeSet::new();
    head.mesh.parts.iter().map(|p| unique(&p.name, &mut names)).collect()
}

/// A blend shape with its in-betweens, all over the points that any of them moves.
fn shape(head: &Head, target: &Target, normals: &[Vec3], with_normals: bool) -> String {
    let offsets_of = |s: usize| -> BTreeMap<u32, Vec3> {
        let shape = &head.shapes[s];
        shape.points.iter().copied().zip(shape.offsets.iter().copied()).collect()
    };
    let turned = |s: usize| -> Vec<Vec3> {
        let points = deform_points(&head.mesh, std::slice::from_ref(&head.shapes[s]), &[1.0]);
        point_normals(&head.mesh, &points).iter().zip(normals).map(|(n, rest)| *n - *rest).collect()
    };
    let all: Vec<usize> =
        std::iter::once(target.shape).chain(target.inbetweens.iter().map(|(_, s, _)| *s)).collect();
    let moved: BTreeSet<u32> = all.iter().flat_map(|s| head.shapes[*s].points.iter().copied()).collect();
    let name = &head.shapes[target.shape].name;
    let mut text = String::new();
    let out = &mut text;
    let units = action_units(name);
    let _ = write!(out, "        def BlendShape \"{}\"", target.prim);
    if !units.is_empty() {
        let units: Vec<String> = units.iter().map(|u| quoted(u)).collect();
        let _ = write!(
            out,
            " (\n            customData = {{\n                string[] actionUnits = [{}]\n            }}\n        )",
            units.join(", ")
        );
    }
    out.push_str("\n        {\n");
    let offsets = |s: usize| {
        let of = offsets_of(s);
        moved.iter().map(|p| vector(of.get(p).copied().unwrap_or(Vec3::ZERO))).collect::<Vec<_>>()
    };
    let turns = |s: usize| {
        let of = turned(s);
        moved.iter().map(|p| vector(of[*p as usize])).collect::<Vec<_>>()
    };
    for (weight, s, name) in &target.inbetweens {
        let attribute = format!("uniform vector3f[] inbetweens:{name}");
        let weight = format!(" (\n                weight = {weight}\n            )");
        list(out, 3, &attribute, offsets(*s).into_iter(), &weight);
        if with_normals {
            let attribute = format!("uniform vector3f[] inbetweens:{name}:normalOffsets");
            list(out, 3, &attribute, turns(*s).into_iter(), "");
        }
    }
    if with_normals {
        list(out, 3, "uniform vector3f[] normalOffsets", turns(target.shape).into_iter(), "");
    }
    list(out, 3, "uniform vector3f[] offsets", offsets(target.shape).into_iter(), "");
    list(out, 3, "uniform int[] pointIndices", moved.iter().map(u32::to_string), "");
    out.push_str("        }\n\n");
    text
}

fn vector(v: Vec3) -> String {
    format!("({}, {}, {})", v.x, v.y, v.z)
}

/// `name = [a, b, c]` and what follows it.
fn list(out: &mut String, depth: usize, name: &str, items: impl Iterator<Item = String>, after: &str) {
    let _ = write!(out, "{}{name} = [", "    ".repeat(depth));
    for (i, item) in items.enumerate() {
        if i > 0 {
            out.push_str(", ");
        }
        out.push_str(&item);
    }
    let _ = writeln!(out, "]{after}");
}
