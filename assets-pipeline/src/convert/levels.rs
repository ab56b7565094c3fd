//! A ladder of coarser surfaces of a head: each step with twice the error of the one before.
//!
//! ```text
//! triangles of a part --collapse edges up to an error (quadrics of place, normal, texture, shapes)--> levels
//!                                                                                            |
//!                                              distance of each point at rest and per shape <-+
//! ```
//!
//! Edges collapse onto one of their ends (Garland and Heckbert 1997; attributes after Hoppe 1999, by `meshoptimizer-rs`), so a level
//! is a list of triangles over the vertices of the head. Seams of the texture stay
//! closed. Points that parts share, and landmarks, stay. Shapes take part as a few random sums of all of their displacements
//! (Johnson and Lindenstrauss 1984): what moves alike may merge, what moves apart may not.
//!
//! The error of a level is measured, not the quadric's: the distance of each point of the head from the nearest place of its part
//! in the level at rest, or, where that is more, from the plane of that place's triangle when any one shape moves both.
//!
//! Cost: 52 000 triangles and 130 shapes, see `examples/levels.rs`.

use glam::Vec3;
use meshoptimizer_rs::{
    Attributes, Positions, SimplifyOptions, SimplifySettings, VertexFlags, Workspace,
    simplify_with_attributes,
};
use rayon::prelude::*;
use rubor_rig::deform::point_normals;
use rubor_rig::head::{Head, Part};
use rubor_rig::level::Level;
use rubor_rig::random::SplitMix64;

use super::nearest::Surface;

/// Error of the first step as a share of the head; each of the others has twice the error of the one before.
const FIRST_ERROR: f32 = 0.0002;
/// Steps.
const STEPS: u32 = 7;
/// A step with more of the triangles of the level before is none.
const LEAST_GAIN: f32 = 0.75;
/// Parts of fewer triangles stay as they are.
const SMALL_PART: usize = 48;
/// Share of the points that are within the stated error.
const WITHIN: f64 = 0.99;
/// Random sums of shapes, three numbers each.
const SUMS: usize = 4;
/// Numbers of a vertex: normal, texture coordinate, sums of shapes.
const WIDTH: usize = 3 + 2 + 3 * SUMS;
/// Displacement that is as bad as a turn of the normal by one radian, metres.
const NORMAL_WEIGHT: f32 = 0.001;
/// How bad it is that shapes displace differently.
const SHAPE_WEIGHT: f32 = 2.0;
/// A slip of the texture is as bad as this share of the same displacement.
const TEXTURE_WEIGHT: f32 = 0.3;

/// No level of a head is off by less, metres.
pub fn least_error_metres(head: &Head) -> f32 {
    FIRST_ERROR * extent(head)
}

fn extent(head: &Head) -> f32 {
    head.bounds().map_or(0.0, |(low, high)| (high - low).max_element())
}

/// The ladder of a head, finest first; empty where nothing can go.
pub fn levels(head: &Head) -> Vec<Level> {
    let least = least_error_metres(head);
    if least <= 0.0 {
        return Vec::new();
    }
    let places: Vec<[f32; 3]> =
        head.mesh.vertices.iter().map(|v| head.mesh.points[v.point as usize].to_array()).collect();
    let attributes = attributes(head);
    let flags = flags(head);
    let moved = moved(head);
    let candidate = |step: u32| {
        let error = (1 << step) as f32 * least;
        let of_part = |part: &Part| {
            let triangles = triangles_of(head, part);
            if !part.material.is_opaque() || triangles.len() < SMALL_PART {
                return triangles.to_vec();
            }
            // What cannot be simplified stays as it is.
            coarser(triangles, error, &places, &attributes, &flags).unwrap_or_else(|| triangles.to_vec())
        };
        let parts: Vec<_> = head.mesh.parts.par_iter().map(of_part).collect();
        level(head, error_metres(head, &parts, &moved), &parts)
    };
    let candidates: Vec<Level> = (0..STEPS).into_par_iter().map(candidate).collect();
    let (mut last, mut error) = (head.mesh.triangles.len(), least);
    let mut result = Vec::new();
    for mut level in candidates {
        error = error.max(level.error_metres);
        if level.triangles.len() as f32 <= LEAST_GAIN * last as f32 {
            last = level.triangles.len();
            level.error_metres = error;
            result.push(level);
        }
    }
    result
}

fn triangles_of<'a>(head: &'a Head, part: &Part) -> &'a [[u32; 3]] {
    &head.mesh.triangles[part.triangles.start as usize..part.triangles.end as usize]
}

fn level(head: &Head, error_metres: f32, parts: &[Vec<[u32; 3]>]) -> Level {
    let mut level = Level { error_metres, triangles: parts.concat(), parts: Vec::new(), hosts: Vec::new() };
    let mut first = 0;
    for (part, triangles) in head.mesh.parts.iter().zip(parts) {
        let whole = triangles_of(head, part);
        level.parts.push(first..first + triangles.len() as u32);
        match surface_of(head, triangles).filter(|_| triangles.len() < whole.len()) {
            Some(surface) => level.hosts.par_extend(whole.par_iter().map(|t| {
                let middle = corners_of(head, t).map(|p| head.mesh.points[p]).iter().sum::<Vec3>() / 3.0;
                first + surface.nearest(middle).triangle as u32
            })),
            None => level.hosts.extend(first..first + whole.len() as u32),
        }
        first += triangles.len() as u32;
    }
    level
}

/// Points at the corners of a triangle.
fn corners_of(head: &Head, triangle: &[u32; 3]) -> [usize; 3] {
    triangle.map(|v| head.mesh.vertices[v as usize].point as usize)
}

fn surface_of(head: &Head, triangles: &[[u32; 3]]) -> Option<Surface> {
    Surface::new(triangles.iter().map(|t| corners_of(head, t).map(|p| head.mesh.points[p])).collect())
}

fn coarser(
    triangles: &[[u32; 3]],
    error_metres: f32,
    places: &[[f32; 3]],
    attributes: &[f32],
    flags: &[VertexFlags],
) -> Option<Vec<[u32; 3]>> {
    let settings = SimplifySettings {
        target_index_count: 0,
        target_error: error_metres,
        options: SimplifyOptions::SPARSE | SimplifyOptions::ERROR_ABSOLUTE,
    };
    let view = Attributes::from_interleaved(attributes, places.len(), WIDTH, WIDTH, 0).ok()?;
    let simplified = simplify_with_attributes(
        triangles.as_flattened(),
        Positions::from_packed(places),
        view,
        &[1.0; WIDTH],
        Some(flags),
        settings,
        &mut Workspace::default(),
    )
    .ok()?;
    Some(simplified.indices.as_chunks::<3>().0.to_vec())
}

/// What may not slip when vertices merge, as shares of the head: so places are compared too.
fn attributes(head: &Head) -> Vec<f32> {
    let mesh = &head.mesh;
    let normals = point_normals(mesh, &mesh.points);
    let mut sums = vec![[Vec3::ZERO; SUMS]; mesh.points.len()];
    let mut random = SplitMix64(1);
    for shape in &head.shapes {
        let signs: [f32; SUMS] = [0; SUMS].map(|_| if random.bits() & 1 == 0 { 1.0 } else { -1.0 });
        for (p, offset) in shape.points.iter().zip(&shape.offsets) {
            for (sum, sign) in sums[*p as usize].iter_mut().zip(signs) {
                *sum += sign * *offset;
            }
        }
    }
    let per_metre = 1.0 / extent(head);
    let per_texture = metres_per_texture(head) * per_metre;
    let of = |(v, vertex): (usize, &rubor_rig::head::Vertex)| {
        let authored = head.authored.normal(v as u32);
        let normal = if authored == Vec3::ZERO { normals[vertex.point as usize] } else { authored };
        let uv = TEXTURE_WEIGHT * per_texture * vertex.uv;
        let of_shapes =
            sums[vertex.point as usize].map(|s| SHAPE_WEIGHT * per_metre * s / (SUMS as f32).sqrt());
        let mut row = [0.0; WIDTH];
        row[..3].copy_from_slice(&(NORMAL_WEIGHT * per_metre * normal).to_array());
        row[3..5].copy_from_slice(&uv.to_array());
        for (to, from) in row[5..].chunks_exact_mut(3).zip(of_shapes) {
            to.copy_from_slice(&from.to_array());
        }
        row
    };
    mesh.vertices.iter().enumerate().flat_map(of).collect()
}

/// Length of the surface over that of the texture, by area.
fn metres_per_texture(head: &Head) -> f32 {
    let mesh = &head.mesh;
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
        let [p, q, r] = [a, b, c].map(|v| mesh.points[v.point as usize]);
        let of_texture = (b.uv - a.uv).perp_dot(c.uv - a.uv).abs();
        [(q - p).cross(r - p).length(), of_texture]
    };
    let sum = mesh.triangles.iter().map(area).fold([0.0f32; 2], |s, a| [s[0] + a[0], s[1] + a[1]]);
    if sum[1] > 0.0 { (sum[0] / sum[1]).sqrt() } else { 0.0 }
}

/// Vertices that stay: those of points that two parts share, and of the points nearest to landmarks.
fn flags(head: &Head) -> Vec<VertexFlags> {
    let mesh = &head.mesh;
    let mut owner: Vec<Option<usize>> = vec![None; mesh.points.len()];
    let mut stays = vec![false; mesh.points.len()];
    for (index, part) in mesh.parts.iter().enumerate() {
        for v in triangles_of(head, part).iter().flatten() {
            let p = mesh.vertices[*v as usize].point as usize;
            stays[p] |= owner[p].is_some_and(|o| o != index);
            owner[p] = Some(index);
        }
    }
    for landmark in head.landmarks.values() {
        let distance = |p: &usize| mesh.points[*p].distance_squared(*landmark);
        if let Some(p) = (0..mesh.points.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))) {
            stays[p] = true;
        }
    }
    let flag = |v: &rubor_rig::head::Vertex| match stays[v.point as usize] {
        true => VertexFlags::LOCK,
        false => VertexFlags::EMPTY,
    };
    mesh.vertices.iter().map(flag).collect()
}

/// Shapes and displacements of each point, shapes ascending.
fn moved(head: &Head) -> Vec<Vec<(u32, Vec3)>> {
    let mut moved = vec![Vec::new(); head.mesh.points.len()];
    for (index, shape) in head.shapes.iter().enumerate() {
        for (p, offset) in shape.points.iter().zip(&shape.offsets) {
            moved[*p as usize].push((index as u32, *offset));
        }
    }
    moved
}

/// Distance that all but one in a hundred points keep.
fn error_metres(head: &Head, parts: &[Vec<[u32; 3]>], moved: &[Vec<(u32, Vec3)>]) -> f32 {
    let mesh = &head.mesh;
    let mut errors: Vec<f32> = Vec::new();
    for (part, triangles) in mesh.parts.iter().zip(parts) {
        let whole = triangles_of(head, part);
        if triangles.len() == whole.len() {
            continue;
        }
        let Some(surface) = surface_of(head, triangles) else { continue };
        let mut points: Vec<usize> = whole.iter().flat_map(|t| corners_of(head, t)).collect();
        points.sort_unstable();
        points.dedup();
        errors.par_extend(points.par_iter().map(|p| {
            let place = surface.nearest(mesh.points[*p]);
            let corners = corners_of(head, &triangles[place.triangle]);
            let of_shapes = largest_distance(head, moved, *p, corners, place.weights);
            place.distance.max(of_shapes)
        }));
    }
    let Some(last) = errors.len().checked_sub(1) else { return 0.0 };
    let at = ((WITHIN * errors.len() as f64) as usize).min(last);
    *errors.select_nth_unstable_by(at, f32::total_cmp).1
}

/// Largest distance of a point from the plane of a triangle that holds it at rest at some weights, when one shape moves both.
fn largest_distance(
    head: &Head,
    moved: &[Vec<(u32, Vec3)>],
    point: usize,
    corners: [usize; 3],
    weights: Vec3,
) -> f32 {
    let mut shapes: Vec<u32> =
        [point, corners[0], corners[1], corners[2]].iter().flat_map(|p| &moved[*p]).map(|m| m.0).collect();
    shapes.sort_unstable();
    shapes.dedup();
    let posed = |p: usize, shape: u32| {
        let offset = moved[p].binary_search_by_key(&shape, |m| m.0).map_or(Vec3::ZERO, |i| moved[p][i].1);
        head.mesh.points[p] + offset
    };
    let distance = |shape: u32| {
        let [a, b, c] = corners.map(|p| posed(p, shape));
        let from = posed(point, shape) - (weights.x * a + weights.y * b + weights.z * c);
        (b - a).cross(c - a).normalize_or_zero().dot(from).abs()
    };
    shapes.into_iter().map(distance).fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use glam::Vec2;
    use rubor_rig::head::{BlendShape, Material, Mesh, Vertex};

    use super::super::nearest::nearest_in_triangle;
    use super::*;

    const SIDE: u32 = 48;

    /// A bowl of 0.2 m in two parts, the halves left and right of x = 0; with `ridge` a shape that folds it along y = 0.05.
    fn bowl(ridge: bool) -> Head {
        let at = |i: u32| i as f32 / SIDE as f32;
        let places: Vec<Vec2> =
            (0..=SIDE).flat_map(|y| (0..=SIDE).map(move |x| Vec2::new(at(x), at(y)))).collect();
        let place = |uv: &Vec2| {
            let p = 0.2 * (*uv - 0.5);
            p.extend(0.05 - 2.0 * p.length_squared())
        };
        let cell = |x: u32, y: u32| {
            let [a, b, c, d] =
                [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]].map(|[x, y]| y * (SIDE + 1) + x);
            [[a, b, c], [b, d, c]]
        };
        let half = |xs: Range<u32>| (0..SIDE).flat_map(move |y| xs.clone().flat_map(move |x| cell(x, y)));
        let triangles: Vec<[u32; 3]> = half(0..SIDE / 2).chain(half(SIDE / 2..SIDE)).collect();
        let middle = triangles.len() as u32 / 2;
        let part = |name: &str, triangles| Part { name: name.into(), material: Material::Skin, triangles };
        let points: Vec<Vec3> = places.iter().map(place).collect();
        let fold = |p: &Vec3| Vec3::Z * 0.02 * (1.0 - (p.y - 0.05).abs() / 0.01).max(0.0);
        let shapes = match ridge {
            true => vec![BlendShape {
                name: "ridge".into(),
                points: (0..points.len() as u32).collect(),
                offsets: points.iter().map(fold).collect(),
                occlusion: Vec::new(),
            }],
            false => Vec::new(),
        };
        let vertices = (0u32..).zip(places).map(|(point, uv)| Vertex { point, uv }).collect();
        let parts = vec![part("left", 0..middle), part("right", middle..2 * middle)];
        let landmarks = [("spot".to_owned(), points[700])].into();
        Head {
            mesh: Mesh { points, occlusion: Vec::new(), vertices, triangles, parts },
            shapes,
            landmarks,
            ..Head::default()
        }
    }

    #[test]
    fn each_level_has_fewer_triangles_and_the_error_that_it_states() {
        let head = bowl(false);
        let ladder = levels(&head);
        assert!(ladder.len() >= 3, "{}", ladder.len());
        let mut last = (head.mesh.triangles.len(), 0.0);
        for level in &ladder {
            head.at_level(level).validate().unwrap();
            assert!(level.triangles.len() < last.0 && level.error_metres >= last.1);
            assert!(level.error_metres >= least_error_metres(&head));
            last = (level.triangles.len(), level.error_metres);
            let corners = |t: &[u32; 3]| t.map(|v| head.mesh.points[v as usize]);
            let distance = |p: &Vec3| {
                let of = |t: &[u32; 3]| {
                    let [a, b, c] = corners(t);
                    let w = nearest_in_triangle(*p, a, b, c);
                    p.distance(w.x * a + w.y * b + w.z * c)
                };
                level.triangles.iter().map(of).fold(f32::INFINITY, f32::min)
            };
            let within = head.mesh.points.iter().filter(|p| distance(p) <= level.error_metres + 1e-7).count();
            assert!(within as f64 >= WITHIN * head.mesh.points.len() as f64, "{within}");
        }
        let coarsest = ladder.last().unwrap();
        assert!(coarsest.triangles.len() * 10 < head.mesh.triangles.len(), "{}", coarsest.triangles.len());
    }

    #[test]
    fn parts_stay_whole_and_closed_and_landmarks_stay() {
        let head = bowl(false);
        for level in levels(&head) {
            assert_eq!((level.parts[0].start, level.parts[0].end), (0, level.parts[1].start));
            assert_eq!(level.parts[1].end as usize, level.triangles.len());
            let used = |part: usize| {
                let range = level.parts[part].start as usize..level.parts[part].end as usize;
                level.triangles[range].as_flattened().to_vec()
            };
            // The seam between the parts has all of its points on both sides.
            let seam = (0..=SIDE).map(|y| y * (SIDE + 1) + SIDE / 2);
            let (left, right) = (used(0), used(1));
            assert!(seam.clone().all(|v| left.contains(&v) && right.contains(&v)));
            assert!(left.contains(&700) || right.contains(&700), "the landmark");
        }
    }

    #[test]
    fn levels_follow_what_shapes_fold() {
        let (plain, folded) = (bowl(false), bowl(true));
        let of = |level: &Level| -> Vec<Vec<[u32; 3]>> {
            level.parts.iter().map(|r| level.triangles[r.start as usize..r.end as usize].to_vec()).collect()
        };
        for (blind, seeing) in levels(&plain).iter().zip(levels(&folded)).take(4) {
            let error = error_metres(&folded, &of(blind), &moved(&folded));
            assert!(3.0 * seeing.error_metres < error, "{} and {error}", seeing.error_metres);
            assert!(seeing.triangles.len() < blind.triangles.len() * 5 / 4);
        }
    }

    #[test]
    fn hosts_are_the_nearest_triangles_of_the_part() {
        let head = bowl(true);
        for level in levels(&head) {
            assert_eq!(level.hosts.len(), head.mesh.triangles.len());
            for (part, range) in head.mesh.parts.iter().zip(&level.parts) {
                let hosts = &level.hosts[part.triangles.start as usize..part.triangles.end as usize];
                assert!(hosts.iter().all(|h| range.contains(h)));
            }
            let middle = |t: &[u32; 3]| t.iter().map(|v| head.mesh.points[*v as usize]).sum::<Vec3>() / 3.0;
            for (t, host) in head.mesh.triangles.iter().zip(&level.hosts) {
                let [a, b, c] = level.triangles[*host as usize].map(|v| head.mesh.points[v as usize]);
                let w = nearest_in_triangle(middle(t), a, b, c);
                let distance = middle(t).distance(w.x * a + w.y * b + w.z * c);
                assert!(distance < 4.0 * level.error_metres, "{distance} at {}", level.error_metres);
            }
        }
    }

    #[test]
    fn heads_without_surface_have_no_levels() {
        assert!(levels(&Head::default()).is_empty());
        let mut flat = bowl(false);
        flat.mesh.points.iter_mut().for_each(|p| *p = Vec3::ONE);
        assert!(levels(&flat).is_empty());
    }
}
