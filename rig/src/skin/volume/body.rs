//! The body that light walks in: skin and the lining of mouth and eyes as one closed surface, and what blocks light.

use std::collections::HashMap;

use glam::Vec3;

use super::walk::{Meet, Surroundings, What};
use crate::bvh::Bvh;
use crate::deform::{deform_points, point_normals};
use crate::error::HeadError;
use crate::face_state::FaceState;
use crate::head::{Head, MM_PER_METRE, Material};

/// Points that are nearer at rest, as part of the head's height, are one.
const WELD: f32 = 1e-6;
/// Rays to lamps skip this much of their way, mm: 2 micrometres, a hundred times the rounding of a coordinate of 200 mm.
const NEAR_MM: f32 = 2e-3;

/// Normals that light is refracted about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Normals {
    /// Interpolated between the points, as the renderer does.
    Smooth,
    /// Those of the triangles: what other programs agree on without a word.
    Facets,
}

/// A head in a pose, world space, mm.
pub struct Body {
    /// Corners of the closed surface, counter-clockwise seen from outside, then those of blockers.
    triangles: Vec<[u32; 3]>,
    /// Triangles of skin, of skin with lining, of skin with lining and caps; blockers follow.
    ends: [u32; 3],
    points: Vec<Vec3>,
    /// Of each corner.
    normals: Vec<[Vec3; 3]>,
    holes: usize,
    bvh: Bvh,
}

impl Body {
    /// The head of a shot. Skin and mucosa are the surface; points at one place at rest are one; each open rim is closed by a
    /// fan of triangles about its middle. Eyes, teeth, gums and other opaque parts block light.
    ///
    /// # Errors
    /// Edges that more than two triangles share the same way round: such a surface has no inside.
    pub fn new(head: &Head, face: &FaceState, normals: Normals) -> Result<Self, HeadError> {
        let mesh = &head.mesh;
        let deformed = deform_points(mesh, &head.shapes, &face.shapes);
        let smooth = point_normals(mesh, &deformed);
        let place = |p: Vec3| MM_PER_METRE * (face.head_rotation * p + face.head_translation);
        let welded = Welded::new(&mesh.points, WELD * head.height());
        let mut points: Vec<Vec3> = welded.first.iter().map(|i| place(deformed[*i as usize])).collect();
        let (mut triangles, mut corners) = (Vec::new(), Vec::new());
        let mut add = |wanted: &dyn Fn(Material) -> bool, triangles: &mut Vec<[u32; 3]>| {
            for part in mesh.parts.iter().filter(|p| wanted(p.material)) {
                for t in &mesh.triangles[part.triangles.start as usize..part.triangles.end as usize] {
                    let own = t.map(|v| mesh.vertices[v as usize].point);
                    let [a, b, c] = own.map(|p| welded.of[p as usize]);
                    if a != b && b != c && c != a {
                        triangles.push([a, b, c]);
                        corners.push(own.map(|p| face.head_rotation * smooth[p as usize]));
                    }
                }
            }
            triangles.len() as u32
        };
        let skin = add(&|m| m == Material::Skin, &mut triangles);
        let lining = add(&|m| m == Material::Mucosa, &mut triangles);
        let caps = caps(&triangles, &mut points).map_err(|edges| HeadError {
            head: head.name.clone(),
            at: "skin and lining".into(),
            found: format!("{edges} edges with more than two triangles"),
            expected: "a surface with an inside and an outside",
        })?;
        let holes = caps.holes;
        // Blockers are appended in order, so the fans are put in between.
        let mut blockers = Vec::new();
        let known = triangles.len();
        add(&|m| m.is_opaque() && !matches!(m, Material::Skin | Material::Mucosa), &mut blockers);
        let of_blockers = corners.split_off(known);
        triangles.extend(caps.triangles);
        let closed = triangles.len() as u32;
        let facet = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|p| points[p as usize]);
            (b - a).cross(c - a).normalize_or(Vec3::Z)
        };
        corners.extend(triangles[lining as usize..].iter().map(|t| [facet(t); 3]));
        triangles.extend(blockers);
        corners.extend(of_blockers);
        if normals == Normals::Facets {
            corners = triangles.iter().map(|t| [facet(t); 3]).collect();
        }
        let bvh = Bvh::new(triangles.iter().map(|t| t.map(|p| points[p as usize])).collect());
        Ok(Self { triangles, ends: [skin, lining, closed], points, normals: corners, holes, bvh })
    }

    /// Corners of the closed surface, mm, and of the parts that block light.
    pub fn points_mm(&self) -> &[Vec3] {
        &self.points
    }

    /// Triangles of the closed surface, counter-clockwise seen from outside.
    pub fn surface(&self) -> &[[u32; 3]] {
        &self.triangles[..self.ends[2] as usize]
    }

    /// Triangles that block light.
    pub fn blockers(&self) -> &[[u32; 3]] {
        &self.triangles[self.ends[2] as usize..]
    }

    /// Open rims that were closed.
    pub fn holes(&self) -> usize {
        self.holes
    }

    /// Volume inside, mm^3, by the divergence theorem; that of places that lie inside twice counts twice.
    pub fn volume_mm3(&self) -> f64 {
        let of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|p| self.points[p as usize].as_dvec3());
            a.dot(b.cross(c)) / 6.0
        };
        self.surface().iter().map(of).sum()
    }
}

impl Surroundings for Body {
    fn meet(&self, origin: Vec3, direction: Vec3, far_mm: f32, on: Option<u32>) -> Option<Meet> {
        let meeting = self.bvh.first(origin, direction, 0.0, far_mm, on)?;
        let t = meeting.triangle as usize;
        let [a, b, c] = self.triangles[t].map(|p| self.points[p as usize]);
        let [u, v] = meeting.uv;
        let w = 1.0 - u - v;
        let place = w * a + u * b + v * c;
        let facet = (b - a).cross(c - a).normalize_or(Vec3::Z);
        let [na, nb, nc] = self.normals[t];
        // From the facet onto the tangent planes of its corners (Hanika 2021).
        let lift = |corner: Vec3, n: Vec3| (place - corner).dot(n).min(0.0) * n;
        let lifted = place - w * lift(a, na) - u * lift(b, nb) - v * lift(c, nc);
        let [skin, _, closed] = self.ends;
        let what = match meeting.triangle {
            i if i < skin => What::Skin,
            i if i < closed => What::Lining,
            _ => What::Blocker,
        };
        let normal = (w * na + u * nb + v * nc).normalize_or(facet);
        Some(Meet {
            distance_mm: meeting.distance,
            place,
            facet,
            normal,
            lifted,
            what,
            number: meeting.triangle,
        })
    }

    fn is_blocked(&self, origin: Vec3, direction: Vec3, far_mm: f32) -> bool {
        self.bvh.hit(origin, direction, NEAR_MM, far_mm)
    }

    fn bounds(&self) -> (Vec3, Vec3) {
        self.bvh.bounds()
    }
}

/// Points by place.
struct Welded {
    /// Of each point.
    of: Vec<u32>,
    /// The first point of each.
    first: Vec<u32>,
}

impl Welded {
    fn new(points: &[Vec3], step: f32) -> Self {
        let mut known = HashMap::new();
        let mut first = Vec::new();
        let of = (points.iter().zip(0_u32..)).map(|(p, i)| {
            let cell = (*p / step.max(f32::MIN_POSITIVE)).round().as_i64vec3();
            *known.entry(cell).or_insert_with(|| {
                first.push(i);
                first.len() as u32 - 1
            })
        });
        let of = of.collect();
        Self { of, first }
    }
}

struct Caps {
    triangles: Vec<[u32; 3]>,
    holes: usize,
}

/// Fans over the rims of a surface, with a new point in the middle of each; or the number of edges that several triangles
/// have the same way round.
fn caps(triangles: &[[u32; 3]], points: &mut Vec<Vec3>) -> Result<Caps, usize> {
    let mut edges: HashMap<[u32; 2], u32> = HashMap::new();
    for [a, b, c] in triangles {
        for edge in [[*a, *b], [*b, *c], [*c, *a]] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    let doubled = edges.values().filter(|n| **n > 1).count();
    if doubled > 0 {
        return Err(doubled);
    }
    let mut open: Vec<[u32; 2]> =
        edges.keys().filter(|[a, b]| !edges.contains_key(&[*b, *a])).copied().collect();
    open.sort_unstable();
    // Rims are connected sets of open edges.
    let mut rim_of: HashMap<u32, u32> = open.iter().flatten().map(|p| (*p, *p)).collect();
    fn root(of: &mut HashMap<u32, u32>, p: u32) -> u32 {
        let mut at = p;
        while of[&at] != at {
            at = of[&at];
        }
        of.insert(p, at);
        at
    }
    for [a, b] in &open {
        let (a, b) = (root(&mut rim_of, *a), root(&mut rim_of, *b));
        rim_of.insert(a.max(b), a.min(b));
    }
    let mut rims: Vec<(u32, Vec<[u32; 2]>)> = Vec::new();
    for edge in open {
        let rim = root(&mut rim_of, edge[0]);
        match rims.iter_mut().find(|(of, _)| *of == rim) {
            Some((_, edges)) => edges.push(edge),
            None => rims.push((rim, vec![edge])),
        }
    }
    let mut fans = Vec::new();
    for (_, edges) in &rims {
        let middle = edges.iter().map(|[a, _]| points[*a as usize]).sum::<Vec3>() / edges.len() as f32;
        let top = points.len() as u32;
        points.push(middle);
        fans.extend(edges.iter().map(|[a, b]| [*b, *a, top]));
    }
    Ok(Caps { triangles: fans, holes: rims.len() })
}
