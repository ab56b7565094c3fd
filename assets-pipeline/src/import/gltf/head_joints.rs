//! Which vertices of a whole figure belong to its head: by the joints that they follow.

use std::collections::HashSet;

use gltf::{Node, Primitive, Semantic};
use serde_json::Value;

use super::accessor::floats;
use super::document::Document;
use crate::error::ImportError;

/// Nodes of head and neck and all below them.
#[derive(Default)]
pub(super) struct HeadJoints {
    nodes: HashSet<usize>,
    /// Joints of each skin that are among them.
    skins: Vec<Vec<bool>>,
}

/// Levels of nodes that are followed.
const MOST_LEVELS: usize = 512;

impl HeadJoints {
    /// What VRM says, else joints whose name ends with head or neck.
    pub(super) fn of(document: &Document) -> Self {
        let mut nodes = HashSet::new();
        let said = said_by_vrm(document);
        let joints: HashSet<usize> =
            document.gltf.skins().flat_map(|s| s.joints().map(|j| j.index()).collect::<Vec<_>>()).collect();
        let is_root = |node: &Node<'_>| match said.is_empty() {
            true => joints.contains(&node.index()) && node.name().is_some_and(is_name),
            false => said.contains(&node.index()),
        };
        let mut open: Vec<(Node<'_>, usize)> =
            document.gltf.nodes().filter(is_root).map(|n| (n, 0)).collect();
        while let Some((node, level)) = open.pop() {
            if nodes.insert(node.index()) && level < MOST_LEVELS {
                open.extend(node.children().map(|child| (child, level + 1)));
            }
        }
        let of_skin = |skin: gltf::Skin<'_>| skin.joints().map(|j| nodes.contains(&j.index())).collect();
        let skins = document.gltf.skins().map(of_skin).collect();
        Self { nodes, skins }
    }

    /// How much each vertex of a primitive follows them.
    pub(super) fn shares(
        &self,
        document: &Document,
        at: &str,
        node: Option<usize>,
        primitive: &Primitive<'_>,
        count: usize,
    ) -> Result<Vec<f32>, ImportError> {
        let of_node = node.and_then(|n| document.gltf.nodes().nth(n));
        let skin = of_node.as_ref().and_then(Node::skin).and_then(|s| self.skins.get(s.index()));
        let Some(is_head) = skin else {
            let is_below = node.is_some_and(|n| self.nodes.contains(&n));
            return Ok(vec![f32::from(u8::from(is_below)); count]);
        };
        let mut sums = vec![(0.0_f32, 0.0_f32); count];
        for set in 0.. {
            let (Some(joints), Some(weights)) =
                (primitive.get(&Semantic::Joints(set)), primitive.get(&Semantic::Weights(set)))
            else {
                break;
            };
            let joints = floats::<4>(document, at, &joints)?;
            let weights = floats::<4>(document, at, &weights)?;
            for (sum, (joints, weights)) in sums.iter_mut().zip(joints.iter().zip(&weights)) {
                for (joint, weight) in joints.iter().zip(weights) {
                    let counts = is_head.get(*joint as usize).copied().unwrap_or(false);
                    sum.0 += if counts { *weight } else { 0.0 };
                    sum.1 += weight;
                }
            }
        }
        Ok(sums.into_iter().map(|(head, all)| if all > 0.0 { head / all } else { 0.0 }).collect())
    }
}

fn said_by_vrm(document: &Document) -> HashSet<usize> {
    let extensions = &document.raw["extensions"];
    let node = |value: &Value| value.as_u64().and_then(|n| usize::try_from(n).ok());
    let new = &extensions["VRMC_vrm"]["humanoid"]["humanBones"];
    let of_new = ["head", "neck"].into_iter().filter_map(|bone| node(&new[bone]["node"]));
    let old = extensions["VRM"]["humanoid"]["humanBones"].as_array().into_iter().flatten();
    let of_old = old.filter(|b| b["bone"] == "head" || b["bone"] == "neck").filter_map(|b| node(&b["node"]));
    of_new.chain(of_old).collect()
}

/// `Head`, `mixamorig:Neck`, `J_Bip_C_Head`, `CC_Base_NeckTwist01`, `neck_01`.
fn is_name(name: &str) -> bool {
    let lower = name.to_lowercase();
    let bare = lower.trim_end_matches(|c: char| !c.is_alphabetic());
    bare.ends_with("head") || bare.ends_with("neck") || bare.ends_with("necktwist")
}

#[cfg(test)]
mod tests {
    use super::is_name;

    #[test]
    fn names_of_common_skeletons_are_known() {
        for name in
            ["Head", "mixamorig:Neck", "J_Bip_C_Head", "CC_Base_NeckTwist01", "neck_01", "Bip001 Head"]
        {
            assert!(is_name(name), "{name}");
        }
        for name in ["Headband_L", "Spine2", "HeadTop_End", "LeftHand", "", "42"] {
            assert!(!is_name(name), "{name}");
        }
    }
}
