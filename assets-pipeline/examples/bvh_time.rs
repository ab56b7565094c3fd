//! Time of any-hit rays in our hierarchy of triangles against the crate `bvh` (surface area heuristic).
//!
//! ```text
//! cargo run --release -p rubor-assets --example bvh_time -- [TRIANGLES] [RAYS]
//! ```

use std::time::Instant;

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::ray::Ray;
use glam::Vec3;
use nalgebra::{Point3, Vector3};

struct Triangle {
    corners: [Point3<f32>; 3],
    node: usize,
}

impl Bounded<f32, 3> for Triangle {
    fn aabb(&self) -> Aabb<f32, 3> {
        self.corners.iter().fold(Aabb::empty(), |a, c| a.grow(c))
    }
}

impl BHShape<f32, 3> for Triangle {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// A lumpy sphere: about as many rays of a hemisphere meet it again as on a face.
fn surface(rows: usize) -> Vec<[Vec3; 3]> {
    let place = |i: usize, j: usize| {
        let (u, v) =
            (i as f32 / rows as f32 * std::f32::consts::TAU, j as f32 / rows as f32 * std::f32::consts::PI);
        let radius = 0.1 * (1.0 + 0.15 * (5.0 * u).sin() * (4.0 * v).sin());
        radius * Vec3::new(u.sin() * v.sin(), v.cos(), u.cos() * v.sin())
    };
    let quads = (0..rows).flat_map(|j| (0..rows).map(move |i| (i, j)));
    quads
        .flat_map(|(i, j)| {
            let (a, b, c, d) = (place(i, j), place(i + 1, j), place(i + 1, j + 1), place(i, j + 1));
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

fn main() {
    let mut arguments = std::env::args().skip(1).map(|a| a.parse::<usize>().expect("a whole number"));
    let triangles = surface((arguments.next().unwrap_or(80_000) as f64 / 2.0).sqrt() as usize);
    let count = arguments.next().unwrap_or(1_000_000);
    let mut random = fastrand::Rng::with_seed(7);
    let rays: Vec<(Vec3, Vec3)> = (0..count)
        .map(|_| {
            let [a, b, c] = triangles[random.usize(..triangles.len())];
            let origin = (a + b + c) / 3.0;
            let direction = Vec3::from_array([0; 3].map(|_| random.f32() - 0.5)).normalize_or(Vec3::Y);
            (origin, if direction.dot(origin) < 0.0 { -direction } else { direction })
        })
        .collect();
    let (near, far) = (1e-4, 1.0);
    println!("{} triangles, {count} rays", triangles.len());

    let start = Instant::now();
    let own = rubor_rig::bvh::Bvh::new(triangles.clone());
    let built = start.elapsed();
    let start = Instant::now();
    let hits = rays.iter().filter(|(o, d)| own.hit(*o, *d, near, far)).count();
    println!("ours: build {built:?}, rays {:?}, {hits} hits", start.elapsed());

    let mut shapes: Vec<Triangle> = triangles
        .iter()
        .map(|t| Triangle { corners: t.map(|c| Point3::from(c.to_array())), node: 0 })
        .collect();
    let start = Instant::now();
    let tree = bvh::bvh::Bvh::build(&mut shapes);
    let built = start.elapsed();
    let test = |ray: &Ray<f32, 3>, t: &Triangle| {
        let [a, b, c] = t.corners;
        let distance = ray.intersects_triangle(&a, &b, &c).distance;
        // Its test sees front sides only; ours sees both.
        let back = ray.intersects_triangle(&a, &c, &b).distance;
        (distance > near && distance < far) || (back > near && back < far)
    };
    let start = Instant::now();
    let hits = rays
        .iter()
        .filter(|(o, d)| {
            let ray = Ray::new(Point3::from(o.to_array()), Vector3::from(d.to_array()));
            tree.traverse_iterator(&ray, &shapes).any(|t| test(&ray, t))
        })
        .count();
    println!("bvh:  build {built:?}, rays {:?}, {hits} hits", start.elapsed());
}
