//! The model of the confidence of landmarks: measures of faces and of things that are none, and the logistic weights that tell
//! them apart.
//!
//! `cargo run --release -p rubor-assets --example landmark_confidence [HEAD.glb | FOLDER ...]` prints one line for each and the
//! weights for `landmarks::MODEL`; with `face` it makes `src/landmarks/face.bin` of the built-in head. Heads that are given count as faces; `no:HEAD.glb` as none.

use std::path::Path;
use std::time::Instant;

use glam::{Mat3, Vec3};
use rubor_assets::{import, landmarks};
use rubor_rig::head::{Head, Material};

#[path = "../tests/support/faces.rs"]
mod faces;

fn main() {
    let mut rows: Vec<(Vec<f64>, bool)> = Vec::new();
    let mut look = |name: &str, head: &Head, is_face: bool| {
        let start = Instant::now();
        let Some(fit) = landmarks::find(head) else { return println!("{name}: nothing") };
        let error = |(n, p): (&String, &Vec3)| Some(fit.landmarks.get(n)?.distance(*p) * fit.unit_mm);
        let mut errors: Vec<(f32, &String)> =
            head.landmarks.iter().filter_map(|l| Some((error(l)?, l.0))).collect();
        errors.sort_by(|a, b| b.0.total_cmp(&a.0));
        let median = errors.get(errors.len() / 2).map_or(f32::NAN, |e| e.0);
        let worst: Vec<String> = errors.iter().take(6).map(|(e, n)| format!("{n} {e:.1}")).collect();
        let measures: Vec<String> = fit.measures.iter().map(|(n, v)| format!("{n} {v:.2}")).collect();
        println!(
            "{} {name}: confidence {:.3}, {:.1} s, {} triangles, turned {:.0}, unit {:.1} mm, error {median:.1} mm ({})\n    {}",
            if is_face { "+" } else { "-" },
            fit.confidence,
            start.elapsed().as_secs_f32(),
            head.mesh.triangles.len(),
            fit.turned_degrees,
            fit.unit_mm,
            worst.join(", "),
            measures.join(", "),
        );
        rows.push((fit.measures.iter().map(|m| f64::from(m.1)).collect(), is_face));
        if let Ok(folder) = std::env::var("PICTURES")
            && let Some(picture) = landmarks::draw_picture(head, Some(&fit), &fit.landmarks)
        {
            let file = format!("{folder}/{}.png", name.replace(['/', ' '], "_"));
            let image = image::RgbImage::from_raw(picture.width, picture.height, picture.rgb).unwrap();
            image.save(file).unwrap();
        }
    };
    let given: Vec<String> = std::env::args().skip(1).collect();
    if given == ["face"] {
        let bytes = landmarks::canonical_face(&faces::default_head());
        println!("{} bytes", bytes.len());
        std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/landmarks/face.bin"), bytes).unwrap();
        return;
    }
    for path in &given {
        let (path, is_face) = path.strip_prefix("no:").map_or((path.as_str(), true), |p| (p, false));
        look(path, &read(Path::new(path)), is_face);
    }
    if std::env::var("ONLY_GIVEN").is_ok() {
        return;
    }
    let head = faces::default_head();
    look("default", &head, true);
    for seed in 1..=6 {
        look(&format!("person {seed}"), &faces::another_person(head.clone(), seed, 3.0 + seed as f32), true);
    }
    for seed in 1..=4 {
        let turn = faces::turn(seed);
        let person = faces::another_person(head.clone(), 10 + seed, 5.0);
        look(&format!("turned {seed}"), &faces::moved(person, |p| turn * p * 37.0 + Vec3::ONE), true);
    }
    for (seed, mm) in [(1, 0.3), (2, 0.8), (3, 1.5)] {
        look(&format!("noise of {mm} mm"), &faces::noisy(head.clone(), seed, mm), true);
    }
    let nose = head.landmarks["pronasale"];
    let mask = faces::keep(&head, |_, p| p.z > nose.z - 0.09 && p.y > nose.y - 0.11);
    look("mask", &mask, true);
    let turn = Mat3::from_rotation_x(-1.2) * Mat3::from_rotation_y(0.7);
    look("turned mask", &faces::moved(mask, |p| turn * p), true);
    look("no ears", &faces::keep(&head, |_, p| p.x.abs() < 0.068), true);
    look("no eyes", &faces::keep(&head, |m, _| m == Material::Skin), true);
    look("made up", &faces::made_up_face(1.0), true);
    look("made up, strong", &faces::made_up_face(1.3), true);
    for (name, thing) in faces::no_faces() {
        look(name, &thing, false);
    }
    let weights = logistic(&rows);
    println!("{weights:?}");
}

/// Weights of a logistic model: constant first. Newton steps with a small ridge, both classes of equal weight.
fn logistic(rows: &[(Vec<f64>, bool)]) -> Vec<f32> {
    const RIDGE: f64 = 0.02;
    let n = rows[0].0.len() + 1;
    let positive = rows.iter().filter(|r| r.1).count() as f64;
    let mut w = nalgebra::DVector::<f64>::zeros(n);
    for _ in 0..60 {
        let mut gradient = -RIDGE * &w;
        let mut hessian = nalgebra::DMatrix::<f64>::identity(n, n) * RIDGE;
        for (values, is_face) in rows {
            let x = nalgebra::DVector::from_iterator(n, std::iter::once(1.0).chain(values.iter().copied()));
            let p = 1.0 / (1.0 + (-w.dot(&x)).exp());
            let (target, weight) =
                if *is_face { (1.0, 0.5 / positive) } else { (0.0, 0.5 / (rows.len() as f64 - positive)) };
            gradient += weight * 20.0 * (target - p) * &x;
            hessian += weight * 20.0 * p * (1.0 - p) * &x * x.transpose();
        }
        if let Some(step) = hessian.lu().solve(&gradient) {
            w += step * 0.7;
        }
    }
    w.iter().map(|v| *v as f32).collect()
}

fn read(path: &Path) -> Head {
    if path.is_dir() {
        let options =
            import::obj_set::Options { folder: path.into(), occlusion_rays: 0, ..Default::default() };
        return import::obj_set::import(&options).unwrap();
    }
    import::gltf::from_bytes(&std::fs::read(path).unwrap(), path).unwrap().head
}
