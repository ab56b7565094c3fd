//! Roots of cropped hairs.

use std::collections::HashSet;

use glam::{IVec3, Vec2, Vec3};
use rubor_rig::head::{Head, Material};
use rubor_rig::map::Map;

/// A hair as cropped_hair.wesl reads it; the fields are described there.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Root {
    pub(crate) triangle: u32,
    pub(crate) weights: u32,
    pub(crate) flow: u32,
    pub(crate) look: u32,
}

/// Width of a hair at its root, metres.
pub(crate) const WIDTH_METRES: f32 = 0.00014;
/// Width in pixels of the hairs that are drawn, together with those that they stand for.
const PIXELS_OF_HAIR: f32 = 0.35;
/// Hairs per square metre of fully covered skin: 110 per square centimetre, about half of a real scalp; the tint of the
/// map stands for the rest.
const DENSITY: f32 = 1.1e6;
/// Largest number of hairs of a head.
const MOST: usize = 120_000;
/// Side that the hair map is averaged down to, texels: about 5 mm, so that single dots of stubble do not become tufts.
const AVERAGED: u32 = 128;
/// Cover at which hairs begin to grow, and at which all grow.
const COVER: [f32; 2] = [0.10, 0.62];
/// Shortest hair as a share of the longest.
const SHORTEST: f32 = 0.22;
/// Distance from strands that are geometry (brows, lashes) within which no cropped hair grows, metres.
const CLEAR: f32 = 0.005;
/// From the top of the head to the crown, metres: hair flows away from there.
const CROWN: Vec3 = Vec3::new(0.006, -0.004, -0.048);

/// Random bits of a number (M. O'Neill 2014, PCG-RXS-M-XS).
pub(crate) fn hash(number: u32) -> u32 {
    mixed_bits(advanced(number))
}

fn advanced(state: u32) -> u32 {
    state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453)
}

fn mixed_bits(state: u32) -> u32 {
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// Random numbers, the bits of one state after the other.
struct Random(u32);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = advanced(self.0);
        mixed_bits(self.0) as f32 * (1.0 / 4_294_967_296.0)
    }
}

fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Mean of each of `AVERAGED` by `AVERAGED` blocks of a map.
fn averaged(map: &Map) -> Map {
    let side = |n: u32| n.min(AVERAGED);
    let (width, height) = (side(map.width), side(map.height));
    let range = |i: u32, n: u32, of: u32| {
        let first = (u64::from(i) * u64::from(of) / u64::from(n)) as u32;
        first..((u64::from(i + 1) * u64::from(of) / u64::from(n)) as u32).max(first + 1)
    };
    let mut out = Map::filled(width, height, &[0.0]);
    for y in 0..height {
        for x in 0..width {
            let (rows, columns) = (range(y, height, map.height), range(x, width, map.width));
            let count = (rows.len() * columns.len()) as f32;
            let sum: f32 = rows
                .flat_map(|r| columns.clone().map(move |c| (c, r)))
                .map(|(c, r)| map.texel(c, r)[0])
                .sum();
            out.values[(y * width + x) as usize] = sum / count;
        }
    }
    out
}

/// Hairs of a head whose triangles are `triangles` (vertices and number of the material), in random order. The same head
/// has the same hairs.
pub(crate) fn roots(head: &Head, triangles: &[[u32; 4]]) -> Vec<Root> {
    let Some(map) = &head.maps.hair else { return Vec::new() };
    let cover = averaged(map);
    let mesh = &head.mesh;
    let skin = Material::ALL.iter().position(|m| *m == Material::Skin).unwrap_or(0) as u32;
    let cell = |p: Vec3| (p / CLEAR).floor().as_ivec3();
    let mut taken: HashSet<IVec3> = HashSet::new();
    for part in mesh.parts.iter().filter(|p| matches!(p.material, Material::Hair | Material::Lash)) {
        for v in mesh.triangles[part.triangles.start as usize..part.triangles.end as usize].iter().flatten() {
            let middle = cell(mesh.points[mesh.vertices[*v as usize].point as usize]);
            for i in 0..27 {
                taken.insert(middle + IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1));
            }
        }
    }
    let (low, high) = head.bounds().unwrap_or_default();
    let top = head.landmarks.get("vertex").copied().unwrap_or(Vec3::new(
        0.5 * (low.x + high.x),
        high.y,
        0.5 * (low.z + high.z),
    ));
    let crown = top + CROWN;

    let mut random = Random(1);
    let mut all = Vec::new();
    for (index, t) in triangles.iter().enumerate().filter(|(_, t)| t[3] == skin) {
        let corner = |i: usize| mesh.vertices[t[i] as usize];
        let [a, b, c] = [0, 1, 2].map(|i| mesh.points[corner(i).point as usize]);
        let uvs = [0, 1, 2].map(|i| corner(i).uv);
        let normal = (b - a).cross(c - a);
        let expected = DENSITY * 0.5 * normal.length();
        if !expected.is_finite() || expected <= 0.0 {
            continue;
        }
        let most = uvs.iter().map(|uv| cover.sample(uv.x, uv.y, 0)).fold(0.0f32, f32::max);
        if most <= COVER[0] {
            continue;
        }
        for _ in 0..(expected + random.next()) as usize {
            let [mut x, mut y] = [random.next(), random.next()];
            let [chance, pace, tone] = [random.next(), random.next(), random.next()];
            if x + y > 1.0 {
                (x, y) = (1.0 - x, 1.0 - y);
            }
            let weights = Vec3::new(x, y, 1.0 - x - y);
            let uv: Vec2 = weights.x * uvs[0] + weights.y * uvs[1] + weights.z * uvs[2];
            let here = smoothstep(COVER[0], COVER[1], cover.sample(uv.x, uv.y, 0));
            let place = weights.x * a + weights.y * b + weights.z * c;
            if chance >= here || taken.contains(&cell(place)) {
                continue;
            }
            if all.len() == MOST {
                return mixed(all, &mut random);
            }
            let length = (SHORTEST + (1.0 - SHORTEST) * here * (0.55 + 0.45 * pace)).min(1.0);
            all.push(Root {
                triangle: index as u32,
                weights: pack_unorm(weights.x, weights.y),
                flow: pack_half(flow(place - crown, [b - a, c - a], normal.normalize())),
                look: pack_unorm(length, tone),
            });
        }
    }
    mixed(all, &mut random)
}

/// How many of the hairs, the first ones, stand for all where a pixel has a width.
pub(crate) fn drawn_hairs(all: u32, pixel_metres: f32) -> u32 {
    let share = (WIDTH_METRES / (PIXELS_OF_HAIR * pixel_metres)).min(1.0);
    ((share * all as f32).ceil() as u32).clamp(1.min(all), all)
}

/// Roots of a head on the triangles of a level: each at the place of its host that is nearest within its plane. Both heads
/// come with the order of their triangles; `host` gives the triangle of the level's mesh.
pub(crate) fn moved_roots(
    roots: &[Root],
    (head, order): (&Head, &[u32]),
    (level, level_order): (&Head, &[u32]),
    host: impl Fn(u32) -> u32,
) -> Vec<Root> {
    let mut number = vec![0; level.mesh.triangles.len()];
    for (i, t) in level_order.iter().enumerate() {
        number[*t as usize] = i as u32;
    }
    let corners = |head: &Head, t: u32| {
        head.mesh.triangles[t as usize]
            .map(|v| head.mesh.points[head.mesh.vertices[v as usize].point as usize])
    };
    let moved = |root: &Root| {
        let [a, b, c] = corners(head, order[root.triangle as usize]);
        let [x, y] = unpack_unorm(root.weights);
        let place = x * a + y * b + (1.0 - x - y) * c;
        let [along_1, along_2] = unpack_half(root.flow);
        let flow_metres = along_1 * (b - a) + along_2 * (c - a);
        let triangle = host(root.triangle);
        let [a, b, c] = corners(level, triangle);
        let (e1, e2) = (b - a, c - a);
        let normal = e1.cross(e2);
        let area = normal.length_squared().max(f32::MIN_POSITIVE);
        // Weights of the foot of the perpendicular, brought into the triangle.
        let of_b = (place - a).cross(e2).dot(normal) / area;
        let of_c = e1.cross(place - a).dot(normal) / area;
        let weights = Vec3::new(1.0 - of_b - of_c, of_b, of_c).max(Vec3::ZERO);
        let weights = weights / weights.element_sum();
        Root {
            triangle: number[triangle as usize],
            weights: pack_unorm(weights.x, weights.y),
            flow: pack_half(flow(flow_metres, [e1, e2], normal.normalize_or(Vec3::Y))),
            look: root.look,
        }
    };
    roots.iter().map(moved).collect()
}

/// The hairs in random order (Fisher and Yates), so that any number of the first ones stands for all.
fn mixed(mut all: Vec<Root>, random: &mut Random) -> Vec<Root> {
    for i in (1..all.len()).rev() {
        all.swap(i, ((random.next() * (i + 1) as f32) as usize).min(i));
    }
    all
}

/// A direction laid on a triangle, as factors of its two edges that result in a unit vector.
fn flow(away: Vec3, [e1, e2]: [Vec3; 2], normal: Vec3) -> [f32; 2] {
    let lying = (away - normal * away.dot(normal)).normalize_or(e1.normalize_or(Vec3::X));
    // lying = x e1 + y e2 within the plane.
    let (d11, d12, d22) = (e1.dot(e1), e1.dot(e2), e2.dot(e2));
    let (l1, l2) = (lying.dot(e1), lying.dot(e2));
    let determinant = (d11 * d22 - d12 * d12).max(f32::MIN_POSITIVE);
    // Half floats end at 65504, which a sliver of a triangle can exceed.
    [l1 * d22 - l2 * d12, l2 * d11 - l1 * d12].map(|v| (v / determinant).clamp(-6e4, 6e4))
}

fn pack_unorm(x: f32, y: f32) -> u32 {
    let half = |v: f32| (v.clamp(0.0, 1.0) * 65535.0).round() as u32;
    half(x) | half(y) << 16
}

fn unpack_unorm(bits: u32) -> [f32; 2] {
    [bits & 0xffff, bits >> 16].map(|v| v as f32 / 65535.0)
}

fn unpack_half(bits: u32) -> [f32; 2] {
    [bits as u16, (bits >> 16) as u16].map(|v| half::f16::from_bits(v).to_f32())
}

fn pack_half([x, y]: [f32; 2]) -> u32 {
    let bits = |v: f32| u32::from(half::f16::from_f32(v).to_bits());
    bits(x) | bits(y) << 16
}
