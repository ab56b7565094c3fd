//! Sources that move a weight of a blend shape: its value or curve, the envelope and the state of the node, what the
//! shape editor hides.

use crate::ascii::scene::{BlendShapeData, CurveData, Data, NodeId, Plug, Scene};
use crate::ascii::words::short;
use crate::notes::Notes;

/// Most connections that are followed one after another: more is a circle.
const MOST_HOPS: usize = 64;
/// Deepest groups of targets: more is a circle.
const DEEPEST_GROUPS: usize = 64;

/// Where a number comes from.
#[derive(Clone, Debug)]
pub(super) enum Drive<'s> {
    Constant(f64),
    Curve(NodeId, &'s CurveData),
    /// Something that is not evaluated; the number is the stored one.
    Foreign(&'s Plug, f64),
}

impl PartialEq for Drive<'_> {
    /// True if both always have the same value.
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Constant(a), Self::Constant(b)) => a == b,
            (Self::Curve(a, one), Self::Curve(b, two)) => a == b || one == two,
            (Self::Foreign(a, _), Self::Foreign(b, _)) => a == b,
            _ => false,
        }
    }
}

/// Effect of a weight: `weight x envelope x factor`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Effect<'s> {
    pub(super) weight: Drive<'s>,
    pub(super) envelope: Drive<'s>,
    /// 0 where the node or the target is switched off, the weights of its groups elsewhere.
    pub(super) factor: f64,
}

/// Follows an attribute through others that only pass it on.
fn follow<'s>(scene: &'s Scene, node: NodeId, names: &[&str], stored: f64) -> Drive<'s> {
    let into = |node: NodeId, names: &[&str]| names.iter().find_map(|name| scene.source(node, name));
    let Some(mut plug) = into(node, names) else { return Drive::Constant(stored) };
    for _ in 0..MOST_HOPS {
        let next = match &scene.nodes[plug.node].data {
            Data::Curve(curve) => return Drive::Curve(plug.node, curve),
            Data::BlendShape(data) => match weight_index(data, &plug.attribute) {
                Some(index) => {
                    let (indexed, alias) = weight_names(data, index);
                    match into(plug.node, &[&indexed, alias]) {
                        Some(next) => Some(next),
                        None => return Drive::Constant(data.weights.get(&index).copied().unwrap_or(0.0)),
                    }
                }
                None => None,
            },
            _ => scene.source(plug.node, &plug.attribute),
        };
        match next {
            Some(next) => plug = next,
            None => break,
        }
    }
    Drive::Foreign(plug, stored)
}

/// `w[3]` and the alias of that weight, as connections name it.
fn weight_names(data: &BlendShapeData, index: u32) -> (String, &str) {
    (format!("w[{index}]"), data.aliases.get(&index).map_or("", |alias| short(alias)))
}

/// The weight that an attribute of a blend shape is.
fn weight_index(data: &BlendShapeData, attribute: &str) -> Option<u32> {
    let indexed = attribute.strip_prefix("w[").and_then(|rest| rest.strip_suffix(']'));
    indexed
        .and_then(|index| index.parse().ok())
        .or_else(|| data.aliases.iter().find(|(_, alias)| short(alias) == attribute).map(|(index, _)| *index))
}

/// The source that moves a weight.
pub(super) fn effect<'s>(scene: &'s Scene, node: NodeId, data: &BlendShapeData, index: u32) -> Effect<'s> {
    let (indexed, alias) = weight_names(data, index);
    let stored = data.weights.get(&index).copied().unwrap_or(0.0);
    let shown = |map: &std::collections::BTreeMap<u32, bool>| map.get(&index).copied().unwrap_or(true);
    let on = !scene.nodes[node].is_off() && shown(&data.visible) && shown(&data.parent_visible);
    let mut factor = f64::from(u8::from(on));
    let mut group = data.group_of.get(&index);
    for _ in 0..DEEPEST_GROUPS {
        let Some(this) = group else { break };
        factor *= data.group_weights.get(this).copied().unwrap_or(1.0);
        group = data.group_parents.get(this).filter(|parent| *parent != this);
    }
    Effect {
        weight: follow(scene, node, &[&indexed, alias], stored),
        envelope: follow(scene, node, &["en"], scene.nodes[node].envelope),
        factor,
    }
}

/// Notes which parts of a blend shape change its weights, and which are not evaluated. `between`: it has in-betweens.
pub(super) fn tell(scene: &Scene, node: NodeId, data: &BlendShapeData, between: bool, notes: &mut Notes) {
    let this = &scene.nodes[node];
    match this.state {
        1 | 4 => notes.about("node states that switch a node off", format!("{} ({})", this.name, this.kind)),
        2 | 5 => notes
            .about("nodes that block are taken as switched off", format!("{} ({})", this.name, this.kind)),
        _ => {}
    }
    if let Some(plug) = scene.source(node, "nds") {
        let source = &scene.nodes[plug.node];
        notes.about(
            "driven node states are not followed, the stored ones count",
            format!("{} by {} ({})", this.name, source.name, source.kind),
        );
    }
    let envelope = follow(scene, node, &["en"], this.envelope);
    let how = match envelope {
        Drive::Constant(1.0) => None,
        Drive::Constant(value) => Some(value.to_string()),
        Drive::Curve(..) => Some("keyed".to_owned()),
        Drive::Foreign(plug, value) => {
            let source = &scene.nodes[plug.node];
            notes.about(
                "driven envelopes are not followed, the stored ones count (bake them to keys in Maya)",
                format!("{} by {} ({})", this.name, source.name, source.kind),
            );
            (value != 1.0).then(|| value.to_string())
        }
    };
    if let Some(how) = how {
        let name = format!("{} ({how})", this.name);
        notes.about(
            "envelopes are in the weights of the sequence; shapes have their full offsets",
            name.clone(),
        );
        if between {
            notes.about("an envelope moves where in-betweens are met, unlike in Maya", name);
        }
    }
    let name = |index: &u32| {
        let alias = data.aliases.get(index).cloned().unwrap_or_else(|| format!("weight_{index}"));
        format!("{}.{alias}", this.name)
    };
    for (index, _) in data.visible.iter().chain(&data.parent_visible).filter(|(_, shown)| !**shown) {
        notes.about("targets that the shape editor hides have no weight", name(index));
    }
    for (group, weight) in data.group_weights.iter().filter(|(_, weight)| **weight != 1.0) {
        notes.about(
            "weights of target groups are in those of their targets",
            format!("{}, group {group} ({weight})", this.name),
        );
    }
    for index in &data.post_deformed {
        notes.about("targets that follow the surface or a joint are read as plain offsets", name(index));
    }
    for (from, to) in scene.inputs(node) {
        let painted = [".tw[", ".bw["].iter().any(|part| to.attribute.contains(part));
        if painted && to.attribute.starts_with("it[") || to.attribute.starts_with("tgdt[") {
            let source = &scene.nodes[from.node];
            notes.about(
                "driven weights of points and groups are not followed, the stored ones count",
                format!("{}.{} by {} ({})", this.name, to.attribute, source.name, source.kind),
            );
        }
    }
}
