//! Parts of heads of other programs: what they are where no name says it, and the texture coordinates that rubor's materials
//! of teeth, lashes and eyes take, from their geometry alone.

mod eyes;
mod lashes;
mod recognise;
mod teeth;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, HashMap, HashSet};

use glam::{IVec3, Vec2, Vec3};
use rubor_rig::head::{Head, Material, Part};

use crate::notes::{Note, Notes};

pub(crate) use lashes::is_long;
pub use recognise::recognise;

/// Gives all teeth, lash cards and, where asked, eyes of a head the texture coordinates of rubor's materials. Lash cards
/// become single hairs. Coordinates of other programs mean other things there: teeth came out as gums, lashes as bands.
pub fn fit_coordinates(head: &mut Head, of_eyes: bool) -> Vec<Note> {
    let mut notes = Notes::default();
    for part in 0..head.mesh.parts.len() {
        match head.mesh.parts[part].material {
            Material::Teeth => teeth::assign(head, part),
            Material::Eye if of_eyes => eyes::assign(head, part),
            _ => {}
        }
    }
    lashes::assign(head, &mut notes);
    notes.into_vec()
}

/// Triangles that hang together, and their points.
#[derive(Clone, Debug)]
pub(crate) struct Component {
    /// Indices into the triangles of the mesh.
    pub triangles: Vec<u32>,
    /// Distinct points, increasing.
    pub points: Vec<u32>,
}

/// Pieces of a part that hang together; points at one place count as one.
pub(crate) fn components(head: &Head, part: usize) -> Vec<Component> {
    pieces(head, part, true)
}

/// Pieces of a part that hang together in the texture: layers of cards share their roots.
pub(crate) fn islands(head: &Head, part: usize) -> Vec<Component> {
    pieces(head, part, false)
}

fn pieces(head: &Head, part: usize, by_place: bool) -> Vec<Component> {
    let mesh = &head.mesh;
    let range = mesh.parts[part].triangles.clone();
    let mut at_place: HashMap<IVec3, u32> = HashMap::new();
    let mut parent: HashMap<u32, u32> = HashMap::new();
    fn root(parent: &mut HashMap<u32, u32>, mut a: u32) -> u32 {
        while parent[&a] != a {
            let up = parent[&parent[&a]];
            parent.insert(a, up);
            a = up;
        }
        a
    }
    // A thousandth of the part's size or finer.
    let points_of = |t: u32| mesh.triangles[t as usize].map(|v| mesh.vertices[v as usize].point);
    let nodes_of = |t: u32| if by_place { points_of(t) } else { mesh.triangles[t as usize] };
    let places = range.clone().flat_map(points_of).map(|p| mesh.points[p as usize]);
    let (low, high) = places.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)));
    let cell = ((high - low).max_element() * 2e-5).max(1e-9);
    let mut whole = |p: u32| {
        if !by_place {
            return p;
        }
        let key = ((mesh.points[p as usize] - low) / cell).round().as_ivec3();
        *at_place.entry(key).or_insert(p)
    };
    for t in range.clone() {
        let points = nodes_of(t).map(&mut whole);
        points.iter().for_each(|p| {
            parent.entry(*p).or_insert(*p);
        });
        let first = root(&mut parent, points[0]);
        for p in &points[1..] {
            let other = root(&mut parent, *p);
            parent.insert(other, first);
        }
    }
    let mut found: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let mut order: Vec<u32> = Vec::new();
    for t in range {
        let p = whole(nodes_of(t)[0]);
        let r = root(&mut parent, p);
        found.entry(r).or_insert_with(|| {
            order.push(r);
            Vec::new()
        });
        if let Some(list) = found.get_mut(&r) {
            list.push(t);
        }
    }
    order
        .iter()
        .filter_map(|r| found.remove(r))
        .map(|triangles| {
            let mut points: Vec<u32> = triangles.iter().flat_map(|t| points_of(*t)).collect();
            points.sort_unstable();
            points.dedup();
            Component { triangles, points }
        })
        .collect()
}

impl Component {
    pub(crate) fn places<'a>(&'a self, head: &'a Head) -> impl Iterator<Item = Vec3> + 'a {
        self.points.iter().map(|p| head.mesh.points[*p as usize])
    }

    pub(crate) fn bounds(&self, head: &Head) -> (Vec3, Vec3) {
        self.places(head).fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)))
    }

    pub(crate) fn center(&self, head: &Head) -> Vec3 {
        self.places(head).sum::<Vec3>() / self.points.len().max(1) as f32
    }
}

/// Gives the corners of some triangles texture coordinates by point; vertices that other triangles use too are doubled.
fn set_coordinates(head: &mut Head, triangles: &[u32], uv_of: &HashMap<u32, Vec2>) {
    let mesh = &mut head.mesh;
    let own: HashSet<u32> = triangles.iter().copied().collect();
    let mut of_others = vec![false; mesh.vertices.len()];
    for (t, corners) in mesh.triangles.iter().enumerate() {
        if !own.contains(&(t as u32)) {
            corners.iter().for_each(|v| of_others[*v as usize] = true);
        }
    }
    let mut doubled: HashMap<u32, u32> = HashMap::new();
    for t in triangles {
        for k in 0..3 {
            let v = mesh.triangles[*t as usize][k];
            let Some(uv) = uv_of.get(&mesh.vertices[v as usize].point) else { continue };
            let v = if of_others[v as usize] {
                *doubled.entry(v).or_insert_with(|| {
                    mesh.vertices.push(mesh.vertices[v as usize]);
                    mesh.vertices.len() as u32 - 1
                })
            } else {
                v
            };
            mesh.triangles[*t as usize][k] = v;
            mesh.vertices[v as usize].uv = *uv;
        }
    }
}

/// Replaces a part by several: names, materials and triangles of each, which together are those of the part.
fn split_part(head: &mut Head, part: usize, pieces: Vec<(String, Material, Vec<u32>)>) {
    let start = head.mesh.parts[part].triangles.start;
    let mut order: Vec<[u32; 3]> = Vec::new();
    let mut parts = Vec::new();
    for (name, material, triangles) in pieces {
        let first = start + order.len() as u32;
        order.extend(triangles.iter().map(|t| head.mesh.triangles[*t as usize]));
        parts.push(Part { name, material, triangles: first..start + order.len() as u32 });
    }
    debug_assert_eq!(order.len(), head.mesh.parts[part].triangles.len());
    let count = parts.len();
    head.mesh.triangles[start as usize..start as usize + order.len()].copy_from_slice(&order);
    head.mesh.parts.splice(part..=part, parts);
    if let Some(authored) = head.authored.of_parts.get(part).copied() {
        head.authored.of_parts.splice(part..=part, vec![authored; count]);
    }
}
