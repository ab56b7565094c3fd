//! A USD layer with UsdSkel blend shapes.

use std::collections::BTreeSet;
use std::path::{Component, Path};

use rubor_rig::names::nearest;

use super::{Finding, list};
use crate::import::usda::{Layer, Prim, Value, parse};

/// Units and axes, blend shapes and their animation, pictures. `folder` is that of the layer.
pub fn check(bytes: &[u8], folder: &Path) -> Vec<Finding> {
    let layer = match parse(bytes) {
        Ok(layer) => layer,
        Err(e) => {
            return vec![Finding::error(
                format!("line {}", e.line),
                format!("found {}, expected {}", e.found, e.expected),
            )];
        }
    };
    let mut findings = Vec::new();
    stage(&layer, &mut findings);
    for mesh in layer.prims.iter().filter(|p| p.kind == "Mesh") {
        shapes(&layer, mesh, &mut findings);
    }
    let known: BTreeSet<&str> = layer.prims.iter().flat_map(|p| texts(p, "skel:blendShapes")).collect();
    for animation in layer.prims.iter().filter(|p| p.kind == "SkelAnimation") {
        weights(animation, &known, &mut findings);
    }
    for prim in &layer.prims {
        for (name, value) in &prim.properties {
            if let Value::Asset(asset) = value {
                picture(prim, name, asset, folder, &mut findings);
            }
            let target = value.text().filter(|_| name.ends_with(".connect") || name == "material:binding");
            let of_prim = target.map(|t| t.split('.').next().unwrap_or(t));
            if let Some(path) = of_prim.filter(|p| layer.prim(p).is_none()) {
                let message = format!("{name} leads to {path}, which is not there");
                findings.push(Finding::error(place(prim), message));
            }
        }
    }
    findings
}

fn place(prim: &Prim) -> String {
    format!("{} (line {})", prim.path, prim.line)
}

fn texts<'a>(prim: &'a Prim, name: &str) -> Vec<&'a str> {
    prim.properties.get(name).map(|v| v.list().iter().filter_map(Value::text).collect()).unwrap_or_default()
}

fn stage(layer: &Layer, findings: &mut Vec<Finding>) {
    for (name, why) in [
        ("metersPerUnit", "programs take centimetres: a head in metres becomes a hundredth of its size"),
        ("upAxis", "programs choose an axis of their own"),
        ("defaultPrim", "nobody can reference the layer without naming a prim"),
    ] {
        if !layer.metadata.contains_key(name) {
            let message = format!("there is no {name}: {why}");
            findings.push(
                Finding::warning("layer", message).fix(format!("write {name} in the layer's metadata")),
            );
        }
    }
    if let Some(Value::Text(name)) = layer.metadata.get("defaultPrim")
        && layer.prim(&format!("/{name}")).is_none()
    {
        findings.push(Finding::error("layer", format!("defaultPrim {name:?} is not there")));
    }
    if !layer.prims.iter().any(|p| p.kind == "BlendShape") {
        findings.push(Finding::warning("layer", "there are no BlendShape prims: the face cannot move"));
    }
}

fn shapes(layer: &Layer, mesh: &Prim, findings: &mut Vec<Finding>) {
    let points = mesh.properties.get("points").map_or(0, |p| p.list().len());
    let names = texts(mesh, "skel:blendShapes");
    let targets = match mesh.properties.get("skel:blendShapeTargets") {
        Some(Value::Path(path)) => vec![path.as_str()],
        _ => texts(mesh, "skel:blendShapeTargets"),
    };
    if names.len() != targets.len() {
        let message = format!("{} names and {} targets of blend shapes", names.len(), targets.len());
        findings.push(Finding::error(place(mesh), message).fix("one target a name, in the same order"));
    }
    for path in targets {
        let Some(shape) = layer.prim(path).filter(|p| p.kind == "BlendShape") else {
            findings.push(Finding::error(place(mesh), format!("the blend shape {path} is not there")));
            continue;
        };
        let offsets = shape.properties.get("offsets").map_or(0, |v| v.list().len());
        let indices = shape.properties.get("pointIndices").map(Value::list);
        let count = indices.map_or(points, <[Value]>::len);
        if offsets == 0 {
            let message = "it moves no points: its weight has no effect";
            findings
                .push(Finding::warning(place(shape), message).fix("delete the shape, or export it again"));
        }
        for (name, value) in &shape.properties {
            let is_offsets = name == "offsets" || name == "normalOffsets" || name.starts_with("inbetweens:");
            if is_offsets && value.list().len() != count {
                let message = format!("{name} has {} entries for {count} points", value.list().len());
                findings.push(Finding::error(place(shape), message));
            }
        }
        let outside = |v: &&Value| matches!(v, Value::Number(n) if *n < 0.0 || *n >= points as f64);
        let far = indices.map_or(0, |list| list.iter().filter(outside).count());
        if far > 0 {
            let message = format!("{far} point indices are not below the {points} points of the mesh");
            findings.push(Finding::error(place(shape), message));
        }
    }
}

fn weights(animation: &Prim, known: &BTreeSet<&str>, findings: &mut Vec<Finding>) {
    let names = texts(animation, "blendShapes");
    let unknown: Vec<&str> = names.iter().copied().filter(|n| !known.contains(n)).collect();
    if !unknown.is_empty() {
        let message = format!("no mesh has the shapes {}: their weights move nothing", list(&unknown));
        let finding = Finding::warning(place(animation), message);
        findings.push(match nearest(unknown[0], known.iter().copied()) {
            Some(near) => finding.fix(format!("write {near:?}, if that is meant")),
            None => finding,
        });
    }
    let samples: Vec<(&str, &Value)> = match animation.properties.get("blendShapeWeights.timeSamples") {
        Some(Value::Table(table)) => table.iter().map(|(t, v)| (t.as_str(), v)).collect(),
        _ => animation.properties.get("blendShapeWeights").map(|v| ("default", v)).into_iter().collect(),
    };
    if samples.is_empty() && !names.is_empty() {
        findings.push(Finding::warning(place(animation), "there are no weights: nothing moves"));
    }
    let mut outside = 0;
    for (time, value) in samples {
        let list = value.list();
        if list.len() != names.len() {
            let message = format!("{} weights for {} shapes at time {time}", list.len(), names.len());
            findings.push(Finding::error(place(animation), message));
            break;
        }
        outside +=
            list.iter().filter(|v| matches!(v, Value::Number(n) if !(-0.001..=1.001).contains(n))).count();
    }
    if outside > 0 {
        findings.push(Finding::note(place(animation), format!("{outside} weights leave 0 to 1")));
    }
}

fn picture(prim: &Prim, name: &str, asset: &str, folder: &Path, findings: &mut Vec<Finding>) {
    let inside = Path::new(asset).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    if !inside {
        let message = format!("{name} leaves the folder of the layer: {asset:?}");
        findings.push(Finding::warning(place(prim), message).fix("copy the file beside the layer"));
    } else if !folder.join(asset).is_file() {
        let message = format!("{name}: there is no file {asset:?}");
        findings.push(Finding::warning(place(prim), message).fix("copy the file beside the layer"));
    }
}
