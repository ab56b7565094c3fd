//! Faces and things that are none, made by rules: for the tests of landmarks and for the model of their confidence.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

use glam::{Mat3, Vec2, Vec3};
use rubor_assets::import;
use rubor_rig::head::{Head, Material, Mesh, Part, Vertex};

/// The built-in head without maps and shapes; its landmarks are the truth.
pub(crate) fn default_head() -> Head {
    static HEAD: LazyLock<Head> = LazyLock::new(|| {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/head.glb"));
        let mut head = import::gltf::from_bytes(&std::fs::read(path).unwrap(), path).unwrap().head;
        head.shapes.clear();
        head.maps = Default::default();
        keep(&head, |material, _| !matches!(material, Material::Lash | Material::Hair | Material::Wet))
    });
    HEAD.clone()
}

/// The triangles of a head whose material and middle are wanted, with the points that they use.
pub(crate) fn keep(head: &Head, wanted: impl Fn(Material, Vec3) -> bool) -> Head {
    let mut mesh = Mesh::default();
    let mut new_point = vec![u32::MAX; head.mesh.points.len()];
    for part in &head.mesh.parts {
        let start = mesh.triangles.len() as u32;
        for t in &head.mesh.triangles[part.triangles.start as usize..part.triangles.end as usize] {
            let corners = t.map(|v| head.mesh.vertices[v as usize]);
            let middle = corners.iter().map(|c| head.mesh.points[c.point as usize]).sum::<Vec3>() / 3.0;
            if !wanted(part.material, middle) {
                continue;
            }
            let triangle = corners.map(|c| {
                let new = &mut new_point[c.point as usize];
                if *new == u32::MAX {
                    *new = mesh.points.len() as u32;
                    mesh.points.push(head.mesh.points[c.point as usize]);
                }
                mesh.vertices.push(Vertex { point: *new, uv: c.uv });
                mesh.vertices.len() as u32 - 1
            });
            mesh.triangles.push(triangle);
        }
        let triangles = start..mesh.triangles.len() as u32;
        if !triangles.is_empty() {
            mesh.parts.push(Part { triangles, ..part.clone() });
        }
    }
    Head { name: head.name.clone(), mesh, landmarks: head.landmarks.clone(), ..Head::default() }
}

/// Every point and landmark moved.
pub(crate) fn moved(mut head: Head, by: impl Fn(Vec3) -> Vec3) -> Head {
    head.mesh.points.iter_mut().for_each(|p| *p = by(*p));
    head.landmarks.values_mut().for_each(|p| *p = by(*p));
    head
}

/// Another person: the head bent by smooth random functions of some millimetres, the same on both sides but for a fifth.
pub(crate) fn another_person(head: Head, seed: u64, amount_mm: f32) -> Head {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut signed = move || 2.0 * random.f32() - 1.0;
    let (low, high) = head.bounds().unwrap();
    let nose = head.landmarks["pronasale"];
    let bumps: Vec<(Vec3, f32, Vec3, f32)> = (0..14)
        .map(|_| {
            let center =
                nose + Vec3::new(0.075 * signed().abs(), -0.02 + 0.1 * signed(), -0.05 + 0.05 * signed());
            let push = Vec3::new(signed(), signed(), signed()) * amount_mm * 0.001;
            (center, 0.022 + 0.02 * signed().abs(), push, 1.0 + 0.2 * signed())
        })
        .collect();
    let stretch = Vec3::new(1.0 + 0.07 * signed(), 1.0 + 0.07 * signed(), 1.0 + 0.07 * signed());
    let middle = 0.5 * (low + high);
    moved(head, |p| {
        let mut q = p;
        for (center, radius, push, other) in &bumps {
            for (side, share) in [(1.0f32, 1.0), (-1.0, *other)] {
                let mirror = Vec3::new(side, 1.0, 1.0);
                let d = p.distance(*center * mirror) / radius;
                q += *push * mirror * (share * (-0.5 * d * d).exp());
            }
        }
        middle + (q - middle) * stretch
    })
}

/// Noise of a scanner, in all directions.
pub(crate) fn noisy(mut head: Head, seed: u64, amount_mm: f32) -> Head {
    let mut random = fastrand::Rng::with_seed(seed);
    for p in &mut head.mesh.points {
        let mut normal = || (0..4).map(|_| random.f32() - 0.5).sum::<f32>() * 1.73;
        *p += Vec3::new(normal(), normal(), normal()) * amount_mm * 0.001;
    }
    head
}

pub(crate) fn turn(seed: u64) -> Mat3 {
    let mut random = fastrand::Rng::with_seed(seed);
    let axis = Vec3::new(random.f32() - 0.5, random.f32() - 0.5, random.f32() - 0.5).normalize_or(Vec3::Y);
    Mat3::from_axis_angle(axis, random.f32() * 6.0)
}

/// A head of one closed surface given as distance from its middle by direction (metres), without landmarks.
pub(crate) fn star(rows: usize, radius: impl Fn(Vec3) -> f32) -> Head {
    let mut mesh = Mesh::default();
    let columns = 2 * rows;
    for j in 0..=rows {
        for i in 0..columns {
            let (theta, phi) = (
                std::f32::consts::PI * j as f32 / rows as f32,
                std::f32::consts::TAU * i as f32 / columns as f32,
            );
            let d = Vec3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos());
            mesh.points.push(d * radius(d));
            let uv = Vec2::new(i as f32 / columns as f32, j as f32 / rows as f32);
            mesh.vertices.push(Vertex { point: (j * columns + i) as u32, uv });
        }
    }
    for j in 0..rows {
        for i in 0..columns {
            let at = |i: usize, j: usize| (j * columns + i % columns) as u32;
            mesh.triangles.push([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
            mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
        }
    }
    let triangles = 0..mesh.triangles.len() as u32;
    mesh.parts.push(Part { name: "surface".into(), material: Material::Skin, triangles });
    Head { name: "made up".into(), mesh, landmarks: BTreeMap::new(), ..Head::default() }
}

/// A coarse face of an egg, a wedge for a nose and a few dents and swellings; 1 unit is a head's radius. `amount` scales all of
/// its features.
pub(crate) fn made_up_face(amount: f32) -> Head {
    star(64, |d| {
        let egg = 1.0 / Vec3::new(d.x / 0.76, d.y / if d.y > 0.0 { 1.0 } else { 1.12 }, d.z / 0.95).length();
        if d.z <= 0.0 {
            return egg;
        }
        // On the front, in radii: nose from 0.1 to -0.32, eyes at -0.02, mouth at -0.62.
        let (x, y) = (d.x * egg, d.y * egg);
        let bump = |cx: f32, cy: f32, rx: f32, ry: f32| {
            let (a, b) = ((x.abs() - cx) / rx, (y - cy) / ry);
            (-(a * a + b * b)).exp()
        };
        let down = ((0.06 - y) / 0.40).clamp(0.0, 1.0);
        let ridge = if y > -0.37 { 0.05 + 0.16 * down } else { 0.21 * (-((y + 0.37) / 0.05).powi(2)).exp() };
        let width = 0.055 + 0.06 * down;
        let nose = ridge * (-(x / width).powi(2)).exp() * ((0.16 - y) / 0.1).clamp(0.0, 1.0);
        let brow = 0.05 * bump(0.26, 0.16, 0.2, 0.06);
        let socket = -0.085 * bump(0.27, -0.02, 0.15, 0.085);
        let ball = 0.045 * bump(0.3, -0.02, 0.09, 0.05);
        let lips = 0.05 * bump(0.0, -0.545, 0.18, 0.045) + 0.05 * bump(0.0, -0.655, 0.16, 0.045)
            - 0.03 * bump(0.0, -0.6, 0.2, 0.018);
        let under = -0.04 * bump(0.0, -0.74, 0.16, 0.04);
        let chin = 0.09 * bump(0.0, -0.88, 0.16, 0.11);
        let cheeks = 0.05 * bump(0.42, -0.22, 0.14, 0.14);
        egg + amount * (nose + brow + socket + ball + lips + under + chin + cheeks)
    })
}

/// Capsules one after another, each from a place to a place with a radius.
pub(crate) fn capsules(list: &[(Vec3, Vec3, f32)]) -> Head {
    let mut all = Head { name: "made up".into(), ..Head::default() };
    for (from, to, radius) in list {
        let one = star(14, |_| 1.0);
        let axis = (*to - *from).normalize_or(Vec3::Y);
        let (side, _) = axis.any_orthonormal_pair();
        let frame = Mat3::from_cols(side, axis, side.cross(axis));
        let first = all.mesh.points.len() as u32;
        for p in &one.mesh.points {
            let end = if p.y > 0.0 { *to } else { *from };
            all.mesh.points.push(end + frame * *p * *radius);
        }
        let vertex = all.mesh.vertices.len() as u32;
        all.mesh
            .vertices
            .extend(one.mesh.vertices.iter().map(|v| Vertex { point: first + v.point, uv: v.uv }));
        all.mesh.triangles.extend(one.mesh.triangles.iter().map(|t| t.map(|v| vertex + v)));
    }
    let triangles = 0..all.mesh.triangles.len() as u32;
    all.mesh.parts.push(Part { name: "surface".into(), material: Material::Skin, triangles });
    all
}

/// Things without a face, by name.
pub(crate) fn no_faces() -> Vec<(&'static str, Head)> {
    let wave = |seed: u64| {
        let mut random = fastrand::Rng::with_seed(seed);
        let waves: Vec<(Vec3, f32, f32)> = (0..10)
            .map(|_| {
                let d = Vec3::new(random.f32() - 0.5, random.f32() - 0.5, random.f32() - 0.5) * 14.0;
                (d, random.f32() * 6.0, 0.02 + 0.05 * random.f32())
            })
            .collect();
        star(60, move |d| 1.0 + waves.iter().map(|(k, phase, a)| a * (k.dot(d) + phase).sin()).sum::<f32>())
    };
    let v = Vec3::new;
    let hand: Vec<(Vec3, Vec3, f32)> = (0..4)
        .map(|i| (v(-0.03 + 0.02 * i as f32, 0.04, 0.0), v(-0.045 + 0.03 * i as f32, 0.13, 0.01), 0.009))
        .chain((0..6).map(|i| {
            (v(-0.03 + 0.012 * i as f32, -0.04, 0.0), v(-0.03 + 0.012 * i as f32, 0.04, 0.0), 0.016)
        }))
        .chain([(v(0.03, -0.03, 0.0), v(0.075, 0.03, 0.025), 0.012)])
        .collect();
    let teapot: Vec<(Vec3, Vec3, f32)> = [
        (v(0.0, -0.02, 0.0), v(0.0, 0.02, 0.0), 0.08),
        (v(0.0, 0.09, 0.0), v(0.0, 0.11, 0.0), 0.015),
        (v(0.07, -0.02, 0.0), v(0.12, 0.02, 0.0), 0.016),
        (v(0.12, 0.02, 0.0), v(0.14, 0.07, 0.0), 0.012),
        (v(-0.07, 0.04, 0.0), v(-0.13, 0.04, 0.0), 0.009),
        (v(-0.13, 0.04, 0.0), v(-0.13, -0.03, 0.0), 0.009),
        (v(-0.13, -0.03, 0.0), v(-0.07, -0.05, 0.0), 0.009),
    ]
    .into();
    let mannequin = [
        (v(0.0, 0.9, 0.0), v(0.0, 1.4, 0.0), 0.15),
        (v(0.0, 1.6, 0.0), v(0.0, 1.68, 0.0), 0.1),
        (v(0.2, 1.4, 0.0), v(0.8, 1.4, 0.0), 0.05),
        (v(-0.2, 1.4, 0.0), v(-0.8, 1.4, 0.0), 0.05),
        (v(0.1, 0.1, 0.0), v(0.1, 0.9, 0.0), 0.07),
        (v(-0.1, 0.1, 0.0), v(-0.1, 0.9, 0.0), 0.07),
    ];
    let back = keep(&default_head(), |_, p| p.z < 0.0);
    let mut things = vec![
        ("a ball", star(48, |_| 1.0)),
        ("an egg", made_up_face(0.0)),
        ("a cube", star(64, |d| 1.0 / d.abs().max_element())),
        ("a hand", capsules(&hand)),
        ("a teapot", capsules(&teapot)),
        ("a mannequin", capsules(&mannequin)),
        ("the back of a head", back),
    ];
    for (name, seed) in [("a rock", 1), ("another rock", 2), ("a third rock", 3), ("a fourth rock", 4)] {
        things.push((name, wave(seed)));
    }
    things
}
