//! VRM avatars: the expression table as expressions of a rig, which way version 0 faces, what of it is not drawn.
//!
//! ```text
//! VRM 0   VRM.blendShapeMaster.blendShapeGroups   mesh, target, weight 0 to 100
//! VRM 1   VRMC_vrm.expressions.preset, .custom    node, target, weight 0 to 1
//! ```
//!
//! Presets of version 0 get their names of version 1. Moods are also the basic expressions of rubor: `joy` is the
//! avatar's `happy`, with the blood and the wrinkles of `joy`.
//! Source: the specifications VRM 0.0 and VRMC_vrm 1.0 of the VRM Consortium.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use glam::Vec3;
use rubor_rig::expression::{Expression, Rig};
use rubor_rig::head::Head;
use serde_json::Value;

use super::document::Document;
use super::foreign::Instance;
use crate::notes::Notes;

/// Presets of version 0 and what version 1 calls them.
const PRESETS_OF_0: [(&str, &str); 17] = [
    ("neutral", "neutral"),
    ("a", "aa"),
    ("i", "ih"),
    ("u", "ou"),
    ("e", "ee"),
    ("o", "oh"),
    ("blink", "blink"),
    ("blink_l", "blinkLeft"),
    ("blink_r", "blinkRight"),
    ("joy", "happy"),
    ("angry", "angry"),
    ("sorrow", "sad"),
    ("fun", "relaxed"),
    ("lookup", "lookUp"),
    ("lookdown", "lookDown"),
    ("lookleft", "lookLeft"),
    ("lookright", "lookRight"),
];

/// Moods of VRM and the expressions of the default rig whose blood and wrinkles they get.
const MOODS: [(&str, &str); 4] =
    [("happy", "joy"), ("angry", "anger"), ("sad", "sadness"), ("surprised", "surprise")];

/// The default rig with the expressions of the avatar; `None` where the document has no table of them.
pub(super) fn rig(
    document: &Document,
    instances: &[Instance],
    head: &Head,
    notes: &mut Notes,
) -> Option<Rig> {
    let extensions = &document.raw["extensions"];
    let mut table = Table { instances, head, notes, expressions: BTreeMap::new() };
    match (extensions.get("VRMC_vrm"), extensions.get("VRM")) {
        (Some(vrm), _) => table.version_1(&vrm["expressions"]),
        (None, Some(vrm)) => {
            table.version_0(&vrm["blendShapeMaster"]["blendShapeGroups"]);
            let materials = vrm["materialProperties"].as_array().into_iter().flatten();
            for shaded in materials.filter(|m| m["shader"].as_str().is_some_and(|s| s.contains("MToon"))) {
                let message = "MToon is not drawn: the material looks as glTF has it, without toon shading and outlines";
                table.notes.add(message, shaded["name"].as_str().unwrap_or_default());
            }
        }
        (None, None) => return None,
    }
    table.finish()
}

/// Avatars of version 0 look along -z; turns the head around.
pub(super) fn turn(document: &Document, head: &mut Head, notes: &mut Notes) {
    let extensions = &document.raw["extensions"];
    if extensions.get("VRM").is_none() || extensions.get("VRMC_vrm").is_some() {
        return;
    }
    let around = |v: &mut Vec3| *v = Vec3::new(-v.x, v.y, -v.z);
    head.mesh.points.iter_mut().for_each(around);
    head.shapes.iter_mut().flat_map(|s| &mut s.offsets).for_each(around);
    head.authored.normals.iter_mut().for_each(around);
    notes.say("avatars of VRM 0 look along -z: this one was turned around");
}

struct Table<'a> {
    instances: &'a [Instance],
    head: &'a Head,
    notes: &'a mut Notes,
    expressions: BTreeMap<String, Expression>,
}

/// Which mesh a bind moves.
enum Of {
    Mesh(usize),
    Node(usize),
}

impl Table<'_> {
    fn version_0(&mut self, groups: &Value) {
        for (g, group) in groups.as_array().into_iter().flatten().enumerate() {
            let preset = group["presetName"].as_str().unwrap_or_default().to_ascii_lowercase();
            let known = PRESETS_OF_0.iter().find(|(old, _)| *old == preset).map(|(_, new)| *new);
            let given = group["name"].as_str().filter(|n| !n.trim().is_empty());
            let name = known.or(given).map_or_else(|| format!("expression {g}"), str::to_owned);
            let binds = group["binds"].as_array().into_iter().flatten();
            let binds = binds.map(|b| (index(&b["mesh"]).map(Of::Mesh), b, 0.01)).collect();
            self.expression(name, binds);
            let name = known.or(given).unwrap_or_default();
            self.not_drawn(name, &[&group["materialValues"]], group["isBinary"] == true);
        }
    }

    fn version_1(&mut self, expressions: &Value) {
        for list in ["preset", "custom"] {
            for (name, expression) in expressions[list].as_object().into_iter().flatten() {
                let binds = expression["morphTargetBinds"].as_array().into_iter().flatten();
                let binds = binds.map(|b| (index(&b["node"]).map(Of::Node), b, 1.0)).collect();
                self.expression(name.clone(), binds);
                let looks = [&expression["materialColorBinds"], &expression["textureTransformBinds"]];
                self.not_drawn(name, &looks, expression["isBinary"] == true);
                let overrides = ["overrideBlink", "overrideLookAt", "overrideMouth"];
                if overrides.iter().any(|o| expression[o].as_str().is_some_and(|how| how != "none")) {
                    let message = "expressions that hold back blinks, looks or the mouth do not: they add up";
                    self.notes.add(message, name.as_str());
                }
            }
        }
    }

    fn not_drawn(&mut self, name: &str, looks: &[&Value], is_binary: bool) {
        if looks.iter().any(|list| list.as_array().is_some_and(|l| !l.is_empty())) {
            let message = "colours and textures of materials that an expression changes stay as they are";
            self.notes.add(message, name);
        }
        if is_binary {
            self.notes.add("expressions that are on or off fade here", name);
        }
    }

    fn expression(&mut self, name: String, binds: Vec<(Option<Of>, &Value, f64)>) {
        let mut shapes = BTreeMap::new();
        for (b, (of, bind, unit)) in binds.into_iter().enumerate() {
            let found = of.and_then(|of| self.shape(&of, index(&bind["index"])?));
            let Some(shape) = found else {
                let mesh = if bind.get("mesh").is_some() { "mesh" } else { "node" };
                let place = format!("{name:?}, bind {b} ({mesh} {}, target {})", bind[mesh], bind["index"]);
                self.notes.add("binds of expressions to morph targets that do not exist are left out", place);
                continue;
            };
            // Version 1 says 1 where there is no weight.
            let weight =
                if bind["weight"].is_null() { 1.0 / unit } else { bind["weight"].as_f64().unwrap_or(0.0) };
            let weight = (weight * unit) as f32;
            if !(0.0..=1.0).contains(&weight) {
                self.notes.add(
                    "weights of binds beyond full are clamped",
                    format!("{name:?}, bind {b} ({weight})"),
                );
            }
            let weight = weight.clamp(0.0, 1.0);
            if weight > 0.0 {
                let most = shapes.entry(shape).or_insert(0.0_f32);
                *most = most.max(weight);
            }
        }
        match self.expressions.entry(name) {
            Entry::Occupied(known) => {
                self.notes.add("of expressions with one name only the first is read", known.key().as_str());
            }
            Entry::Vacant(free) if !shapes.is_empty() => {
                free.insert(Expression { shapes, ..Expression::default() });
            }
            Entry::Vacant(_) => {}
        }
    }

    fn shape(&self, of: &Of, target: usize) -> Option<String> {
        let instance = self.instances.iter().find(|i| match of {
            Of::Mesh(mesh) => i.mesh == *mesh,
            Of::Node(node) => i.node == Some(*node),
        })?;
        let slot = *instance.slots.get(target)?;
        self.head.shapes.get(slot as usize).map(|s| s.name.clone())
    }

    fn finish(mut self) -> Option<Rig> {
        if self.expressions.is_empty() {
            self.notes.say("the avatar has no expressions that move it");
            return None;
        }
        let names: Vec<&str> = self.expressions.keys().map(String::as_str).collect();
        let count = names.len();
        self.notes.add("expressions of the avatar are in the rig", names.join(", "));
        let mut rig = Rig::default_rig().ok()?;
        // Comments and places are those of another text.
        rig.source = rubor_rig::json::Source::default();
        rig.description = format!("{} with {count} expressions of its own", self.head.name);
        for (mood, basic) in MOODS {
            let (Some(of_avatar), Some(of_rig)) =
                (self.expressions.get_mut(mood), rig.expressions.get_mut(basic))
            else {
                continue;
            };
            of_rig.shapes.clone_from(&of_avatar.shapes);
            of_avatar.clone_from(of_rig);
            self.notes.add(
                "moods of the avatar have the blood and wrinkles of basic expressions",
                format!("{mood} is {basic}"),
            );
        }
        rig.expressions.append(&mut self.expressions);
        Some(rig)
    }
}

fn index(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|i| usize::try_from(i).ok())
}
