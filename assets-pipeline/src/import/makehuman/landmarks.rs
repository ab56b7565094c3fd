//! Landmarks of the hm08 topology by point of the base mesh (picked and checked by eye on the young adult mix).

use std::collections::BTreeMap;

use glam::Vec3;
use rubor_rig::landmarks::paired;

use super::eyes::Eye;
use crate::poly::PolyMesh;

/// First point of the cube at the joint between neck and skull.
pub(super) const JOINT_HEAD: u32 = 14070;
/// First point of the cube at the top of the skull.
pub(super) const JOINT_HEAD_TOP: u32 = 14566;

const MIDDLE: [(&str, u32); 10] = [
    ("vertex", 881),
    ("trichion", 983),
    ("glabella", 234),
    ("sellion", 136),
    ("pronasale", 297),
    ("subnasale", 5072),
    ("labrale-superius", 362),
    ("stomion", 493),
    ("labrale-inferius", 492),
    ("menton", 5296),
];

/// Name, left point, right point.
const PAIRED: [(&str, u32, u32); 13] = [
    ("endocanthion", 7795, 1103),
    ("exocanthion", 7782, 1090),
    ("lid-upper", 7774, 1082),
    ("lid-lower", 7787, 1095),
    ("cheilion", 7272, 527),
    ("brow-inner", 6983, 208),
    ("brow-middle", 6996, 222),
    ("brow-outer", 6999, 225),
    ("cheek", 11909, 5304),
    ("alare", 7081, 319),
    ("zygion", 11845, 5236),
    ("gonion", 7459, 739),
    ("ear", 12038, 5439),
];

/// Left and right point of a pair.
pub(super) fn pair(name: &str) -> Option<[u32; 2]> {
    PAIRED.iter().find(|p| p.0 == name).map(|(_, left, right)| [*left, *right])
}

/// Point of the middle line.
pub(super) fn middle(name: &str) -> Option<u32> {
    MIDDLE.iter().find(|m| m.0 == name).map(|m| m.1)
}

/// All landmarks of a mesh whose first points are those of the base mesh (subdivided or not).
pub(super) fn of(mesh: &PolyMesh, eyes: &[Eye]) -> BTreeMap<String, Vec3> {
    let at = |p: u32| mesh.points[p as usize];
    let middle = MIDDLE.iter().map(|(name, p)| ((*name).to_owned(), at(*p)));
    let sides = PAIRED
        .iter()
        .flat_map(|(name, left, right)| [(paired(name, true), at(*left)), (paired(name, false), at(*right))]);
    let eyes = eyes.iter().zip([true, false]).map(|(eye, left)| (paired("eye", left), eye.center));
    middle.chain(sides).chain(eyes).collect()
}
