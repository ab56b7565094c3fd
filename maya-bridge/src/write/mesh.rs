//! Meshes, shading groups of their parts, and blend shapes.

use std::collections::{HashMap, HashSet};
use std::fmt::Write as _;

use rubor_rig::expression::Inbetween;
use rubor_rig::head::{BlendShape, Head};

use super::{centimetres, digits, line, values};
use crate::ascii::lexer::quoted;
use crate::plain_name;
use crate::read::head::shading_group;

const MESH: &str = "rubor_head_mesh";

/// The mesh as it is seen, and the one that it is deformed from.
pub(super) fn write(out: &mut String, head: &Head) {
    line(out, &format!("createNode mesh -n \"{MESH}\" -p \"rubor_head\";"));
    for (i, part) in head.mesh.parts.iter().enumerate().filter(|(_, p)| !p.triangles.is_empty()) {
        let (from, to) = (part.triangles.start, part.triangles.end - 1);
        line(
            out,
            &format!("\tsetAttr \".iog[0].og[{i}].gcl\" -type \"componentList\" 1 \"f[{from}:{to}]\";"),
        );
    }
    uv_names(out);
    if head.shapes.is_empty() {
        geometry(out, head);
        return;
    }
    line(out, &format!("createNode mesh -n \"{MESH}Orig\" -p \"rubor_head\";\n\tsetAttr \".io\" yes;"));
    uv_names(out);
    geometry(out, head);
}

fn uv_names(out: &mut String) {
    line(out, "\tsetAttr \".uvst[0].uvsn\" -type \"string\" \"map1\";");
    line(out, "\tsetAttr \".cuvs\" -type \"string\" \"map1\";");
}

/// A texture coordinate for each vertex, so that vertices keep their order.
fn geometry(out: &mut String, head: &Head) {
    let mesh = &head.mesh;
    let last = |n: usize| n.saturating_sub(1);
    let n = mesh.vertices.len();
    let _ = write!(out, "\tsetAttr -s {n} \".uvst[0].uvsp[0:{}]\" -type \"float2\"", last(n));
    // Maya's v grows upwards. In f64 the difference is exact, so v comes back as it was.
    values(out, mesh.vertices.iter().map(|v| format!("{} {}", v.uv.x, 1.0 - f64::from(v.uv.y))));
    line(out, ";");
    let n = mesh.points.len();
    let _ = write!(out, "\tsetAttr -s {n} \".vt[0:{}]\"", last(n));
    values(out, mesh.points.iter().map(|p| p.to_array().map(centimetres).join(" ")));
    line(out, ";");

    let mut edges: Vec<[u32; 2]> = Vec::new();
    let mut index: HashMap<[u32; 2], i64> = HashMap::new();
    let mut faces: Vec<[i64; 3]> = Vec::with_capacity(mesh.triangles.len());
    for triangle in &mesh.triangles {
        let points = triangle.map(|v| mesh.vertices[v as usize].point);
        faces.push([0, 1, 2].map(|k| {
            let (from, to) = (points[k], points[(k + 1) % 3]);
            if let Some(edge) = index.get(&[from, to]) {
                return *edge;
            }
            if let Some(edge) = index.get(&[to, from]) {
                return -edge - 1;
            }
            edges.push([from, to]);
            let edge = edges.len() as i64 - 1;
            index.insert([from, to], edge);
            edge
        }));
    }
    let n = edges.len();
    let _ = write!(out, "\tsetAttr -s {n} \".ed[0:{}]\"", last(n));
    values(out, edges.iter().map(|[a, b]| format!("{a} {b} 0")));
    line(out, ";");
    // Maya splits long lists of faces; so do we, as one line a list is hard to read by eye.
    const BLOCK: usize = 500;
    for (block, (faces, triangles)) in faces.chunks(BLOCK).zip(mesh.triangles.chunks(BLOCK)).enumerate() {
        let from = block * BLOCK;
        let (n, to) = (faces.len(), from + faces.len() - 1);
        let _ = write!(out, "\tsetAttr -s {n} -ch {} \".fc[{from}:{to}]\" -type \"polyFaces\"", 3 * n);
        for ([a, b, c], [u, v, w]) in faces.iter().zip(triangles) {
            let _ = write!(out, "\n\t\tf 3 {a} {b} {c}\n\t\tmu 0 3 {u} {v} {w}");
        }
        line(out, ";");
    }
}

/// Groups of faces to their shading groups, and the deformer to the mesh.
pub(super) fn connect(out: &mut String, head: &Head) {
    if !head.shapes.is_empty() {
        line(out, &format!("connectAttr \"{MESH}Orig.w\" \"rubor_shapes.ip[0].ig\";"));
        line(out, &format!("connectAttr \"{MESH}Orig.o\" \"rubor_shapes.orggeom[0]\";"));
        line(out, &format!("connectAttr \"rubor_shapes.og[0]\" \"{MESH}.i\";"));
    }
    for (i, part) in head.mesh.parts.iter().enumerate().filter(|(_, p)| !p.triangles.is_empty()) {
        let group = shading_group(i, &part.name);
        line(out, &format!("connectAttr \"{group}_id.id\" \"{MESH}.iog.og[{i}].gid\";"));
        line(out, &format!("connectAttr \"{group}.mwc\" \"{MESH}.iog.og[{i}].gco\";"));
        line(out, &format!("connectAttr \"{MESH}.iog[0].og[{i}]\" \"{group}.dsm\" -na;"));
        line(out, &format!("connectAttr \"{group}_id.msg\" \"{group}.gn\" -na;"));
        line(out, &format!("connectAttr \"{group}.pa\" \":renderPartition.st\" -na;"));
    }
}

/// One weight of the blend shape node.
pub(super) struct Target {
    /// Shape at full weight.
    pub(super) shape: usize,
    pub(super) alias: String,
    /// Item (5000 + 1000 weight) and shape of each in-between.
    between: Vec<(u32, usize)>,
}

/// The weights of the blend shape node, in their order.
pub(super) struct Targets(pub(super) Vec<Target>);

impl Targets {
    pub(super) fn new(head: &Head, inbetweens: &[Inbetween], notes: &mut Vec<String>) -> Self {
        let mut between: HashMap<usize, Vec<(u32, usize)>> = HashMap::new();
        let mut covered: HashSet<usize> = HashSet::new();
        for entry in inbetweens {
            match (head.shape_index(&entry.shape), head.shape_index(&entry.target)) {
                (Some(shape), Some(target)) if shape != target && !covered.contains(&target) => {
                    let item = (5000.0 + 1000.0 * entry.weight).round() as u32;
                    between.entry(shape).or_default().push((item, target));
                    covered.insert(target);
                }
                _ => notes.push(format!(
                    "the in-between {:?} of {:?} is written as a target: the head lacks one of both",
                    entry.target, entry.shape
                )),
            }
        }
        let mut taken: HashSet<String> = HashSet::new();
        let mut targets = Vec::new();
        // In-betweens last, so that the others keep the index of their shape where there are none.
        for (shape, blend) in head.shapes.iter().enumerate().filter(|(i, _)| !covered.contains(i)) {
            let mut alias = plain_name(&blend.name);
            let mut number = 1;
            while !taken.insert(alias.clone()) {
                number += 1;
                alias = format!("{}_{number}", plain_name(&blend.name));
            }
            if number > 1 {
                notes.push(format!("the shape {:?} is called {alias} in Maya", blend.name));
            }
            targets.push(Target { shape, alias, between: between.remove(&shape).unwrap_or_default() });
        }
        Self(targets)
    }

    pub(super) fn write(&self, out: &mut String, head: &Head, weights: &[f32]) {
        let n = self.0.len();
        if n == 0 {
            return;
        }
        line(out, "createNode blendShape -n \"rubor_shapes\";");
        line(
            out,
            "\taddAttr -ci true -h true -sn \"aal\" -ln \"attributeAliasList\" -dt \"attributeAlias\";",
        );
        let _ = write!(out, "\tsetAttr -s {n} \".w[0:{}]\"", n - 1);
        values(out, (0..n).map(|i| weights.get(i).copied().unwrap_or_default().to_string()));
        line(out, &format!(";\n\tsetAttr -s {n} \".it[0].itg\";"));
        for (i, target) in self.0.iter().enumerate() {
            item(out, i, 6000, &head.shapes[target.shape]);
            for (item_index, shape) in &target.between {
                item(out, i, *item_index, &head.shapes[*shape]);
                let name = quoted(&head.shapes[*shape].name);
                line(
                    out,
                    &format!("\tsetAttr \".ibig[{i}].ibi[{item_index}].ibtn\" -type \"string\" {name};"),
                );
            }
        }
        let aliases: Vec<String> =
            self.0.iter().enumerate().map(|(i, t)| format!("\"{}\",\"weight[{i}]\"", t.alias)).collect();
        line(out, &format!("\tsetAttr \".aal\" -type \"attributeAlias\" {{{}}} ;", aliases.join(",")));
    }
}

fn item(out: &mut String, target: usize, item: u32, shape: &BlendShape) {
    let path = format!(".it[0].itg[{target}].iti[{item}]");
    let _ = write!(out, "\tsetAttr \"{path}.ipt\" -type \"pointArray\" {}", shape.offsets.len());
    values(out, shape.offsets.iter().map(|o| format!("{} 1", o.to_array().map(offset).join(" "))));
    line(out, ";");
    let mut ranges: Vec<[u32; 2]> = Vec::new();
    for point in &shape.points {
        match ranges.last_mut() {
            Some([_, to]) if *to + 1 == *point => *to = *point,
            _ => ranges.push([*point, *point]),
        }
    }
    let _ = write!(out, "\tsetAttr \"{path}.ict\" -type \"componentList\" {}", ranges.len());
    let name = |[from, to]: &[u32; 2]| {
        if from == to { format!("\"vtx[{from}]\"") } else { format!("\"vtx[{from}:{to}]\"") }
    };
    values(out, ranges.iter().map(name));
    line(out, ";");
}

fn offset(metres: f32) -> String {
    digits(f64::from(metres) * 100.0)
}
