//! Where a mesh stands: the transform of its node, or its joints in their rest pose.

use std::collections::HashMap;

use glam::Mat4;
use gltf::{Node, Primitive, Semantic};

use super::accessor::floats;
use super::document::Document;
use crate::error::ImportError;

/// Of a mesh.
pub(super) enum Placement {
    /// All vertices by one transform.
    Rigid(Mat4),
    /// Joint transforms times inverse bind matrices; the node's own transform does not count (glTF 2.0, 3.7.3.2).
    Skinned(Vec<Mat4>),
}

/// Of the vertices of a primitive.
pub(super) enum Worlds {
    One(Mat4),
    Each(Vec<Mat4>),
}

impl Worlds {
    pub(super) fn at(&self, vertex: usize) -> Mat4 {
        match self {
            Self::One(world) => *world,
            Self::Each(list) => list.get(vertex).copied().unwrap_or(Mat4::IDENTITY),
        }
    }
}

impl Placement {
    pub(super) fn of(
        document: &Document,
        node: &Node<'_>,
        world: &HashMap<usize, Mat4>,
    ) -> Result<Self, ImportError> {
        let Some(skin) = node.skin() else {
            return Ok(Self::Rigid(world.get(&node.index()).copied().unwrap_or(Mat4::IDENTITY)));
        };
        let at = format!("skin {}", skin.index());
        let count = skin.joints().count();
        let inverse = match skin.inverse_bind_matrices() {
            Some(accessor) => floats::<16>(document, &at, &accessor)?,
            None => vec![Mat4::IDENTITY.to_cols_array(); count],
        };
        if inverse.len() < count {
            let found = format!("{} inverse bind matrices", inverse.len());
            return Err(document.fail(&at, found, format!("one for each of the {count} joints")));
        }
        let joint = |(joint, inverse): (Node<'_>, &[f32; 16])| {
            let Some(world) = world.get(&joint.index()) else {
                let found = format!("joint {} outside the scene", joint.index());
                return Err(document.fail(&at, found, "joints in the same scene"));
            };
            Ok(*world * Mat4::from_cols_array(inverse))
        };
        skin.joints().zip(&inverse).map(joint).collect::<Result<_, _>>().map(Self::Skinned)
    }

    pub(super) fn of_vertices(
        &self,
        document: &Document,
        at: &str,
        primitive: &Primitive<'_>,
        count: usize,
    ) -> Result<Worlds, ImportError> {
        let joints = match self {
            Self::Rigid(world) => return Ok(Worlds::One(*world)),
            Self::Skinned(joints) => joints,
        };
        let mut sums = vec![(Mat4::ZERO, 0.0_f32); count];
        for set in 0.. {
            let (Some(indices), Some(weights)) =
                (primitive.get(&Semantic::Joints(set)), primitive.get(&Semantic::Weights(set)))
            else {
                break;
            };
            let at = |what: &str| format!("{at}{what}_{set}");
            // Joints are bytes or shorts: exact as floats.
            let indices = floats::<4>(document, &at("JOINTS"), &indices)?;
            let weights = floats::<4>(document, &at("WEIGHTS"), &weights)?;
            if indices.len() != count || weights.len() != count {
                let found = format!("{} joints and {} weights", indices.len(), weights.len());
                return Err(document.fail(&at("JOINTS"), found, format!("{count} of each")));
            }
            for (v, sum) in sums.iter_mut().enumerate() {
                for k in (0..4).filter(|k| weights[v][*k] != 0.0) {
                    let Some(joint) = joints.get(indices[v][k] as usize) else {
                        let found = format!("joint {}", indices[v][k]);
                        return Err(document.fail(
                            &at("JOINTS"),
                            found,
                            format!("one below {}", joints.len()),
                        ));
                    };
                    sum.0 += *joint * weights[v][k];
                    sum.1 += weights[v][k];
                }
            }
        }
        // Weights that do not sum to one are scaled; a vertex without any stays where it is.
        let world =
            |(sum, weight): (Mat4, f32)| if weight > 0.0 { sum * (1.0 / weight) } else { Mat4::IDENTITY };
        let worlds: Vec<Mat4> = sums.into_iter().map(world).collect();
        if worlds.iter().any(|w| !w.is_finite()) {
            return Err(document.fail(at, "a joint that is not finite", "finite numbers"));
        }
        Ok(Worlds::Each(worlds))
    }
}
