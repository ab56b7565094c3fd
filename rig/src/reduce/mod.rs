//! A head with less: without some shapes, distributions, zones and parts, with smaller maps and fewer hairs.
//!
//! ```text
//! Head + Reduction --head--> Head           what stays is the same, bit for bit, and in the same order
//! Rig  + Reduction --rig---> Rig, RigLoss   names of what went are gone from it
//! Sequence + Reduction --held--> shapes that have to stay, or the names of its tracks would mean something else
//! ```
//!
//! Names make this more than leaving things out: on a head without `cheekPuffLeft`, the name `cheekPuffLeft` may mean half of another
//! shape ([`crate::names::Resolver::resolve`]). So the rig is written anew with what each of its names meant on the whole head.
//!
//! ```
//! use rubor_rig::{head::{BlendShape, Head}, reduce::Reduction};
//! let shape = |name: &str| BlendShape { name: name.into(), ..BlendShape::default() };
//! let head = Head { shapes: ["jawOpen", "tongueOut"].map(shape).to_vec(), ..Head::default() };
//! let reduced = Reduction { shapes: [0].into(), ..Reduction::default() }.head(&head);
//! assert_eq!(reduced.shapes, [shape("tongueOut")]);
//! ```

mod maps;
mod mesh;
mod names;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use crate::head::Head;

pub use maps::MapKind;
pub use names::RigLoss;

/// What a head is to lose; the default is nothing. Indices are those of the whole head; those beyond its lists have no effect.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reduction {
    /// Of [`Head::shapes`].
    pub shapes: BTreeSet<usize>,
    /// Of [`crate::head::SkinMaps::distributions`]. Without any of them the mean of the neutral hemoglobin goes too.
    pub distributions: BTreeSet<usize>,
    /// Of [`crate::head::SkinMaps::zones`]. Wrinkle maps that no zone is left of go with them.
    pub zones: BTreeSet<usize>,
    /// Of [`crate::head::Mesh::parts`], with the points, vertices, materials and pictures that only they have.
    pub parts: BTreeSet<usize>,
    /// How many times the sides of maps are halved; a side keeps at least one texel.
    pub halvings: BTreeMap<MapKind, u32>,
    /// Most single hairs of the scalp ([`crate::head::SkinMaps::hair_count`]).
    pub hairs: Option<u32>,
}

impl Reduction {
    /// Whether nothing goes.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// This without what only changes weights: what has to be drawn from other buffers and textures.
    #[must_use]
    pub fn without_weights(&self) -> Self {
        Self {
            shapes: BTreeSet::new(),
            distributions: BTreeSet::new(),
            zones: BTreeSet::new(),
            ..self.clone()
        }
    }

    /// The head with less.
    pub fn head(&self, head: &Head) -> Head {
        let (mesh, shapes, authored) = self.geometry(head);
        Head {
            name: head.name.clone(),
            mesh,
            shapes,
            maps: self.maps(&head.maps),
            authored,
            landmarks: head.landmarks.clone(),
            provenance: head.provenance.clone(),
        }
    }
}

/// Indices of a list without some.
fn kept(count: usize, gone: &BTreeSet<usize>) -> impl Iterator<Item = usize> + Clone + '_ {
    (0..count).filter(|i| !gone.contains(i))
}
