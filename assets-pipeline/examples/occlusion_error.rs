//! Ambient and specular occlusion by what a renderer can know, against rays in the deformed head.
//!
//! `cargo run --release -p rubor-assets --example occlusion_error -- assets/head.glb` prints the tables of
//! `docs/occlusion.md`; `--shapes` instead how much each shape changes and what it costs.

use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use rubor_assets::convert::occlusion::{self, Blockers, Rays, SHAPES};
use rubor_assets::import;
use rubor_rig::deform::{blend_occlusion, deform_points, point_normals};
use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::Rig;
use rubor_rig::head::{Head, Material};
use rubor_rig::timeline::Sequence;

/// Pixels on a side of a view.
const SIDE: usize = 256;
/// Half the field of view, as a tangent.
const HALF_VIEW: f32 = 0.14;
const RAYS: u32 = 256;

/// Specular occlusion of a pixel: the reference, then estimates.
type Row = [f32; 1 + ESTIMATES.len()];
const ESTIMATES: [&str; 7] = [
    "none",
    "ambient visibility",
    "ambient visibility squared",
    "Lagarde and de Rousiers 2014, eq. 67",
    "cone about the normal, lobe",
    "cone towards the viewer, lobe",
    "cone towards the viewer, wide lobe",
];

/// The surface that a pixel shows.
#[derive(Clone, Copy)]
struct Pixel {
    place: Vec3,
    normal: Vec3,
    points: [usize; 3],
    weights: Vec3,
    material: Material,
}

/// A view with its depths, metres along the axis.
struct View {
    eye: Vec3,
    axes: [Vec3; 3],
    pixels: Vec<Option<Pixel>>,
}

impl View {
    fn new(head: &Head, points: &[Vec3], target: Vec3, from: Vec3) -> Self {
        let eye = target + from;
        let forward = -from.normalize();
        let right = forward.cross(Vec3::Y).normalize();
        let axes = [right, right.cross(forward), forward];
        let normals = point_normals(&head.mesh, points);
        let mut pixels = vec![None; SIDE * SIDE];
        let mut nearest = vec![f32::INFINITY; SIDE * SIDE];
        for part in head.mesh.parts.iter().filter(|p| p.material.is_opaque()) {
            for t in &head.mesh.triangles[part.triangles.start as usize..part.triangles.end as usize] {
                let corners = t.map(|v| head.mesh.vertices[v as usize].point as usize);
                let places = corners.map(|p| points[p]);
                let on_screen = places.map(|p| Self::project(eye, &axes, p));
                let low = on_screen.iter().fold(Vec2::INFINITY, |a, p| a.min(p.0)).max(Vec2::ZERO);
                let high = on_screen.iter().fold(Vec2::ZERO, |a, p| a.max(p.0)).min(Vec2::splat(SIDE as f32));
                for y in low.y as usize..(high.y.ceil() as usize).min(SIDE) {
                    for x in low.x as usize..(high.x.ceil() as usize).min(SIDE) {
                        let ray = Self::ray(&axes, x, y);
                        let [a, b, c] = places.map(|p| p - eye);
                        let v = Vec3::new(ray.dot(b.cross(c)), ray.dot(c.cross(a)), ray.dot(a.cross(b)));
                        let sum = v.x + v.y + v.z;
                        let w = v / sum;
                        if sum == 0.0 || w.min_element() < 0.0 {
                            continue;
                        }
                        let place = eye + w.x * a + w.y * b + w.z * c;
                        let depth = (place - eye).dot(forward);
                        if depth < nearest[y * SIDE + x] {
                            nearest[y * SIDE + x] = depth;
                            let normal = (0..3).map(|k| w[k] * normals[corners[k]]).sum::<Vec3>().normalize();
                            let normal = if normal.dot(ray) > 0.0 { -normal } else { normal };
                            let material = part.material;
                            pixels[y * SIDE + x] =
                                Some(Pixel { place, normal, points: corners, weights: w, material });
                        }
                    }
                }
            }
        }
        Self { eye, axes, pixels }
    }

    fn ray([right, up, forward]: &[Vec3; 3], x: usize, y: usize) -> Vec3 {
        let at = |i: usize| ((i as f32 + 0.5) / SIDE as f32 * 2.0 - 1.0) * HALF_VIEW;
        at(x) * *right - at(y) * *up + *forward
    }

    fn project(eye: Vec3, [right, up, forward]: &[Vec3; 3], p: Vec3) -> (Vec2, f32) {
        let q = p - eye;
        let depth = q.dot(*forward);
        let at = |v: f32| (v / depth / HALF_VIEW + 1.0) * 0.5 * SIDE as f32;
        (Vec2::new(at(q.dot(*right)), at(-q.dot(*up))), depth)
    }

    /// Horizon-based ambient occlusion of what the screen shows within `radius` metres (Jimenez et al. 2016), with as many
    /// directions and steps as leave no noise, at every second pixel of every second row as at half resolution.
    fn ground_truth_ao(&self, pixel: &Pixel, radius: f32) -> f32 {
        const SLICES: usize = 16;
        const STEPS: usize = 12;
        let (center, depth) = Self::project(self.eye, &self.axes, pixel.place);
        let reach = radius / depth / HALF_VIEW * 0.5 * SIDE as f32;
        let to_eye = (self.eye - pixel.place).normalize();
        let mut sum = 0.0;
        for slice in 0..SLICES {
            let phi = PI * (slice as f32 + 0.5) / SLICES as f32;
            let direction = phi.cos() * self.axes[0] - phi.sin() * self.axes[1];
            let across = direction.cross(to_eye).normalize();
            let along = to_eye.cross(across);
            let projected = pixel.normal - across * pixel.normal.dot(across);
            let length = projected.length();
            let gamma = projected.dot(along).atan2(projected.dot(to_eye));
            let mut horizons = [-1.0f32; 2];
            for (side, horizon) in horizons.iter_mut().enumerate() {
                let sign = 2.0 * side as f32 - 1.0;
                for step in 1..=STEPS {
                    let far = reach * (step as f32 / STEPS as f32).powi(2);
                    // The depth is that of half resolution.
                    let at = center + sign * far.max(2.0) * Vec2::new(phi.cos(), phi.sin());
                    let (x, y) = ((at.x as usize) & !1, (at.y as usize) & !1);
                    if at.min_element() < 0.0 || x >= SIDE || y >= SIDE {
                        break;
                    }
                    let Some(seen) = self.pixels[y * SIDE + x] else { continue };
                    let way = seen.place - pixel.place;
                    let fade = (2.5 - 2.5 * way.length() / radius).clamp(0.0, 1.0);
                    let cosine = way.normalize_or_zero().dot(to_eye);
                    *horizon = horizon.max(-1.0 + (cosine + 1.0) * fade);
                }
            }
            let h = [-horizons[0].clamp(-1.0, 1.0).acos(), horizons[1].clamp(-1.0, 1.0).acos()];
            let h = [gamma + (h[0] - gamma).max(-FRAC_PI_2), gamma + (h[1] - gamma).min(FRAC_PI_2)];
            let arc = |h: f32| 0.25 * (-(2.0 * h - gamma).cos() + gamma.cos() + 2.0 * h * gamma.sin());
            sum += length * (arc(h[0]) + arc(h[1]));
        }
        (sum / SLICES as f32).clamp(0.0, 1.0)
    }
}

/// Solid angle of the intersection of two cones over that of the second (Oat and Sander 2007).
fn cone_in_cone(first: f32, second: f32, between: f32) -> f32 {
    let solid = |angle: f32| 1.0 - angle.cos();
    let least = solid(first.min(second));
    let apart = ((between - (first - second).abs()) / (2.0 * first.min(second)).max(1e-4)).clamp(0.0, 1.0);
    least * (1.0 - apart * apart * (3.0 - 2.0 * apart)) / solid(second).max(1e-6)
}

/// Share of the specular lobe of Beckmann roughness `m` about a pixel that no part of the head hides.
fn lobe_seen(blockers: &Blockers, pixel: &Pixel, to_eye: Vec3, m: f32) -> f32 {
    let (tangent, bitangent) = pixel.normal.any_orthonormal_pair();
    let (mut seen, mut all) = (0.0, 1e-6);
    for i in 0..64u32 {
        let tan2 = -m * m * (1.0 - (i as f32 + 0.5) / 64.0).ln();
        let cosine = 1.0 / (1.0 + tan2).sqrt();
        let phi = TAU * (i.reverse_bits() as f32 / 2_f32.powi(32));
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let half = sine * (phi.cos() * tangent + phi.sin() * bitangent) + cosine * pixel.normal;
        let light = 2.0 * half.dot(to_eye) * half - to_eye;
        let up = light.dot(pixel.normal);
        if up > 0.0 && half.dot(to_eye) > 0.0 {
            let square = (light + to_eye).length_squared().max(0.3);
            let fresnel = 0.028 + 0.972 * (1.0 - half.dot(to_eye)).powi(5);
            let weight = fresnel * up / square * half.dot(to_eye) / cosine;
            all += weight;
            if blockers.sees(pixel.place, pixel.normal, light) {
                seen += weight;
            }
        }
    }
    seen / all
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("expected a head (.glb)")?;
    let mut head = import::gltf::read(Path::new(&path))?.head;
    let named = |list: &[(&str, f32)]| -> Vec<f32> {
        let of = |name: &String| list.iter().find(|(n, _)| n == name).map_or(0.0, |(_, w)| *w);
        head.shapes.iter().map(|s| of(&s.name)).collect()
    };
    let expression = |name: &str| -> Result<Vec<f32>, Box<dyn std::error::Error>> {
        let text = format!("{{\"fps\": 1, \"duration\": 1, \"expressions\": {{\"{name}\": 1}}}}");
        let sequence = Sequence::from_json("", &text)?;
        Ok(Evaluator::new(&head, &Rig::default_rig()?, &sequence)?.0.at(0.0).face.shapes)
    };
    let poses = [
        ("neutral", named(&[])),
        ("jaw open", named(&[("jawOpen", 1.0)])),
        ("jaw half open", named(&[("jawOpen", 0.5)])),
        ("eyes closed", named(&[("eyeBlinkLeft", 1.0), ("eyeBlinkRight", 1.0)])),
        ("joy", expression("joy")?),
        ("surprise", expression("surprise")?),
        ("anger", expression("anger")?),
        ("disgust", expression("disgust")?),
    ];
    let which = arguments.next();
    if which.as_deref() == Some("--shapes") {
        return shapes(&mut head);
    }
    let started = std::time::Instant::now();
    occlusion::bake(&mut head, 128);
    println!("rest: {:.1} s", started.elapsed().as_secs_f64());
    let started = std::time::Instant::now();
    if head.shapes.iter().all(|s| s.occlusion.is_empty()) {
        occlusion::bake_shapes(&mut head, 64, &SHAPES);
    }
    println!("{} shapes: {:.1} s", SHAPES.len(), started.elapsed().as_secs_f64());
    let points: usize = head.shapes.iter().map(|s| s.occlusion.len()).sum();
    println!("{points} changes, {} bytes", 4 * points);
    println!(
        "| pose | region | pixels | rest only | rest and shapes | screen 20 mm | 40 mm | 80 mm | 160 mm | rest x screen 20 mm |"
    );
    let mut specular: Vec<Row> = Vec::new();
    let mut half: Vec<Row> = Vec::new();
    for (name, weights) in &poses {
        pose(&head, name, weights, &mut specular, &mut half);
    }
    for (m, list) in [(0.28, specular), (0.45, half)] {
        println!("specular occlusion, roughness {m}: {} pixels", list.len());
        for (i, what) in ESTIMATES.iter().enumerate() {
            let n = list.len() as f32;
            let rms = (list.iter().map(|p| (p[i + 1] - p[0]).powi(2)).sum::<f32>() / n).sqrt();
            let bias = list.iter().map(|p| p[i + 1] - p[0]).sum::<f32>() / n;
            println!("| {what} | {rms:.3} | {bias:+.3} |");
        }
    }
    Ok(())
}

fn pose(head: &Head, name: &str, weights: &[f32], specular: &mut Vec<Row>, rough: &mut Vec<Row>) {
    let points = deform_points(&head.mesh, &head.shapes, weights);
    let blockers = Blockers::new(&head.mesh, &points, head.height());
    let rays = Rays::new(RAYS);
    let baked = [head.mesh.occlusion.clone(), blend_occlusion(&head.mesh, &head.shapes, weights)];
    let eye = (head.landmarks["eye-left"] + head.landmarks["eye-right"]) / 2.0;
    let target = eye + Vec3::new(0.0, -0.03, -0.05);
    let froms = [Vec3::Z, Vec3::new(0.64, 0.0, 0.77), Vec3::new(0.1, -0.6, 0.8)];
    // Reference and estimates of each pixel.
    let mut found: Vec<(Pixel, Vec<f32>)> = Vec::new();
    for from in froms {
        let view = View::new(head, &points, target, from);
        let places: Vec<usize> = (0..SIDE * SIDE)
            .filter(|i| i % 2 == 1 && i / SIDE % 2 == 1)
            .filter(|i| view.pixels[*i].is_some_and(|p| p.material != Material::Eye))
            .collect();
        let all: Vec<(Pixel, Vec<f32>, [Row; 2])> = places
            .par_iter()
            .filter_map(|i| {
                let pixel = view.pixels[*i]?;
                let turn = (*i as u32).wrapping_mul(0x9E37_79B9) as f32 / 2_f32.powi(32);
                let truth = blockers.visibility(pixel.place, pixel.normal, &rays, turn);
                let of = |list: &[f32]| -> f32 {
                    (0..3).map(|k| pixel.weights[k] * list[pixel.points[k]]).sum::<f32>().clamp(0.0, 1.0)
                };
                let mut row = vec![truth, of(&baked[0]), of(&baked[1])];
                row.extend([0.02, 0.04, 0.08, 0.16].map(|r| view.ground_truth_ao(&pixel, r)));
                row.push(row[1] * row[3]);
                let to_eye = (view.eye - pixel.place).normalize();
                let cosine = pixel.normal.dot(to_eye).clamp(0.0, 1.0);
                let v = row[2];
                let lobes = [0.28f32, 0.45].map(|m| {
                    let lagarde = ((cosine + v).powf((-16.0 * m - 1.0).exp2()) - 1.0 + v).clamp(0.0, 1.0);
                    let open = (1.0 - v).sqrt().acos();
                    let reflected = 2.0 * cosine * pixel.normal - to_eye;
                    // A place that the viewer sees is open towards the viewer.
                    let axis = (v * pixel.normal + (1.0 - v) * to_eye).normalize();
                    let cones = [(pixel.normal, 1.2f32), (axis, 0.83), (axis, 1.2)].map(|(axis, k)| {
                        let lobe = (2.0 * (k * m).atan()).min(FRAC_PI_2);
                        cone_in_cone(open, lobe, axis.dot(reflected).clamp(-1.0, 1.0).acos())
                            / cone_in_cone(FRAC_PI_2, lobe, cosine.acos()).max(1e-3)
                    });
                    let [a, b, c] = cones.map(|c| c.min(1.0));
                    [lobe_seen(&blockers, &pixel, to_eye, m), 1.0, v, v * v, lagarde, a, b, c]
                });
                Some((pixel, row, lobes))
            })
            .collect();
        for (pixel, row, [a, b]) in all {
            if row[0] < 0.7 {
                specular.push(a);
                rough.push(b);
            }
            found.push((pixel, row));
        }
    }
    let landmark = |n: &str| head.landmarks.get(n).copied();
    let lids = [landmark("eye-left"), landmark("eye-right")];
    type Region<'a> = (&'a str, Box<dyn Fn(&Pixel) -> bool + 'a>);
    let at_lids = move |p: &Pixel| lids.iter().flatten().any(|e| (p.place - *e).length() < 0.027);
    let in_mouth = |p: &Pixel| matches!(p.material, Material::Mucosa | Material::Teeth | Material::Gums);
    let regions: [Region<'_>; 3] = [
        ("all", Box::new(|_| true)),
        ("lids", Box::new(move |p| p.material == Material::Skin && at_lids(p))),
        ("mouth", Box::new(in_mouth)),
    ];
    for (region, inside) in &regions {
        let rows: Vec<&Vec<f32>> = found.iter().filter(|(p, _)| inside(p)).map(|(_, r)| r).collect();
        if rows.is_empty() {
            continue;
        }
        print!("| {name} | {region} | {}", rows.len());
        for i in 1..rows[0].len() {
            let n = rows.len() as f32;
            let rms = (rows.iter().map(|r| (r[i] - r[0]).powi(2)).sum::<f32>() / n).sqrt();
            let bias = rows.iter().map(|r| r[i] - r[0]).sum::<f32>() / n;
            print!(" | {rms:.3} ({bias:+.3})");
        }
        println!(" |");
    }
}

/// The change by each shape at weight 1.
fn shapes(head: &mut Head) -> Result<(), Box<dyn std::error::Error>> {
    let names: Vec<String> = head.shapes.iter().map(|s| s.name.clone()).collect();
    let alone: Vec<_> = names.iter().map(|n| (n.as_str(), None)).collect();
    occlusion::bake_shapes(head, 64, &alone);
    println!("| shape | points | bytes | sum of squares |");
    for shape in &head.shapes {
        let energy: f32 = shape.occlusion.iter().map(|c| c.at_full * c.at_full).sum();
        let count = shape.occlusion.len();
        println!("| {} | {count} | {} | {energy:.1} |", shape.name, 4 * count);
    }
    Ok(())
}
