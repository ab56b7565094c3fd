//! The cases of `RUBOR_SHARED/cases`: checked against the expectations in each README.

use std::path::{Path, PathBuf};

use glam::Vec3;
use rubor_assets::import::gltf::{ImportedHead, read};
use rubor_assets::import::obj_set::{ImportedSet, Options, read as read_set};
use rubor_rig::head::{Head, Material};

fn cases(kind: &str) -> Option<PathBuf> {
    let Ok(shared) = std::env::var("RUBOR_SHARED") else {
        eprintln!("SKIPPED: RUBOR_SHARED is not set, the cases were not read");
        return None;
    };
    let folder = Path::new(&shared).join("cases").join(kind);
    if !folder.is_dir() {
        eprintln!("SKIPPED: {} is missing, the cases were not read", folder.display());
        return None;
    }
    Some(folder)
}

/// Names of shapes and the sums of their offsets over vertices, as the files have them.
fn sums(head: &Head) -> Vec<(&str, Vec3)> {
    let of_point = |s: &rubor_rig::head::BlendShape, p: u32| {
        s.points.binary_search(&p).map_or(Vec3::ZERO, |i| s.offsets[i])
    };
    let sum = |s| head.mesh.vertices.iter().map(|v| of_point(s, v.point)).sum();
    head.shapes.iter().map(|s| (&s.name[..], sum(s))).collect()
}

fn said(notes: &[rubor_assets::notes::Note], word: &str) -> bool {
    notes.iter().any(|n| n.to_string().contains(word))
}

#[test]
fn gltf_cases_give_their_right_results() {
    let Some(folder) = cases("gltf") else { return };
    let get =
        |name: &str| read(&folder.join(format!("{name}.glb"))).unwrap_or_else(|e| panic!("{name}: {e}"));
    let weight = |i: &ImportedHead, shape: &str, t: f64| {
        i.animation.as_ref().map_or(f32::NAN, |a| a.shapes[shape].at(t))
    };

    let i = get("mesh-weights");
    assert_eq!(weight(&i, "jawOpen", 0.0), 1.0);
    assert!(said(&i.notes, "default weights"));
    let i = get("node-weights");
    assert_eq!((weight(&i, "jawOpen", 0.0), weight(&i, "mouthSmileLeft", 0.0)), (1.0, 0.25));
    for name in ["names-prim", "names-target", "names-accessor"] {
        let i = get(name);
        assert_eq!(
            i.head.shapes.iter().map(|s| &s.name[..]).collect::<Vec<_>>(),
            ["jawOpen", "mouthSmileLeft"]
        );
    }
    let i = get("duplicate-names");
    let found = sums(&i.head);
    assert_eq!((found[0].0, found[1].0), ("shape", "shape_1"));
    // The file moves 91 vertices (its README says 90).
    assert!(found[0].1.abs_diff_eq(Vec3::new(0.0, -1.82, 0.0), 1e-3), "{found:?}");
    assert!(found[1].1.abs_diff_eq(Vec3::new(0.52, 0.52, 0.0), 1e-3), "{found:?}");
    let end = i.animation.as_ref().unwrap().duration;
    assert_eq!((weight(&i, "shape", end), weight(&i, "shape_1", end)), (1.0, 0.5));
    let i = get("two-meshes-unnamed");
    assert_eq!(i.head.shapes.len(), 3, "{:?}", sums(&i.head));
    let animation = i.animation.unwrap();
    let reached: Vec<f32> =
        i.head.shapes.iter().filter_map(|s| animation.shapes.get(&s.name)).map(|t| t.at(1e3)).collect();
    assert!(reached.contains(&1.0) && reached.contains(&0.3), "{reached:?}");
    for name in ["channel-without-node", "animation-pointer"] {
        let i = get(name);
        assert!(i.animation.is_some() && said(&i.notes, "move nothing"), "{name}: {:?}", i.notes);
        let lint = rubor_assets::import::gltf::lint(
            &std::fs::read(folder.join(format!("{name}.glb"))).unwrap(),
            Path::new(name),
        );
        assert!(lint.unwrap().iter().any(|f| f.to_string().contains("move nothing")), "{name}");
    }
    for name in ["equal-key-times", "negative-key-time"] {
        let i = get(name);
        assert!(i.animation.is_some() && said(&i.notes, "keys"), "{name}: {:?}", i.notes);
    }
    for name in ["seam-equal", "seam-position-1ulp", "seam-no-normals-1ulp"] {
        let i = get(name);
        assert_eq!(i.head.mesh.points.len(), 362, "{name}");
        let normals = rubor_rig::deform::point_normals(&i.head.mesh, &i.head.mesh.points);
        for (p, n) in i.head.mesh.points.iter().zip(normals) {
            // Half axes 75, 110, 95 mm.
            let exact = (*p / Vec3::new(0.075, 0.11, 0.095).powf(2.0)).normalize();
            // Near the poles triangles are too coarse for one degree, at the seam as elsewhere.
            if p.y.abs() > 0.1 {
                continue;
            }
            let angle = n.dot(exact).clamp(-1.0, 1.0).acos().to_degrees();
            assert!(angle < 1.5, "{name}: {angle} degrees at {p}");
        }
    }
}

#[test]
fn obj_cases_give_their_right_results() {
    let Some(folder) = cases("obj") else { return };
    let get = |name: &str| -> ImportedSet {
        let options = Options { folder: folder.join(name), occlusion_rays: 0, ..Options::default() };
        read_set(&options).unwrap_or_else(|e| panic!("{name}: {e}"))
    };
    let jaw = |set: &ImportedSet| {
        let shape = &set.head.shapes[0];
        (shape.name.clone(), shape.points.len(), shape.offsets.iter().map(|o| o.length()).fold(0.0, f32::max))
    };
    for name in ["plain", "bom-v", "other-vertex-order", "usemtl-spaces"] {
        let set = get(name);
        let (shape, points, longest) = jaw(&set);
        // One file has the mesh twice.
        let expected = if name == "usemtl-spaces" { 36 } else { 18 };
        assert_eq!((&shape[..], points), ("jawOpen", expected), "{name}");
        assert!((longest - 0.02).abs() < 1e-5, "{name}: {longest}");
    }
    assert!(said(&get("other-vertex-order").notes, "matched by faces"));
    let parts =
        |name: &str| -> Vec<Material> { get(name).head.mesh.parts.iter().map(|p| p.material).collect() };
    assert_eq!(parts("usemtl-spaces"), [Material::Skin, Material::Teeth]);
    assert_eq!(parts("groups"), [Material::Skin, Material::Teeth]);
    assert!(!get("continuation").head.mesh.triangles.is_empty());
    assert!(!get("cr").head.mesh.triangles.is_empty());
    let concave = get("concave").head;
    let areas: Vec<f32> = concave
        .mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| concave.mesh.points[concave.mesh.vertices[v as usize].point as usize]);
            (b - a).cross(c - a).z / 2.0 * 1e4
        })
        .collect();
    assert!((areas.iter().sum::<f32>() - 10.0).abs() < 1e-3 && areas.iter().all(|a| *a > 0.0), "{areas:?}");
    // Texture coordinates of the face are those of the file: every vt is used by one of its corners.
    let text = std::fs::read_to_string(folder.join("mixed-vt/neutral.obj")).unwrap();
    let numbers =
        |line: &str| line.split_whitespace().skip(1).map(|w| w.parse::<f32>().unwrap()).collect::<Vec<_>>();
    let uvs: Vec<Vec<f32>> = text.lines().filter(|l| l.starts_with("vt ")).map(numbers).collect();
    let points: Vec<Vec<f32>> = text.lines().filter(|l| l.starts_with("v ")).map(numbers).collect();
    let set = get("mixed-vt");
    let mut checked = 0;
    for corner in text.lines().filter(|l| l.starts_with("f ")).flat_map(|l| l.split_whitespace().skip(1)) {
        let mut words = corner.split('/').map(|w| w.parse::<usize>().ok());
        let (Some(Some(p)), Some(Some(t))) = (words.next(), words.next()) else { continue };
        let place = 0.01 * Vec3::from_slice(&points[p - 1]);
        let uv = glam::Vec2::new(uvs[t - 1][0], 1.0 - uvs[t - 1][1]);
        let mesh = &set.head.mesh;
        let found = mesh
            .vertices
            .iter()
            .any(|v| mesh.points[v.point as usize].abs_diff_eq(place, 1e-6) && v.uv.abs_diff_eq(uv, 1e-6));
        assert!(found, "{corner}");
        checked += 1;
    }
    assert!(checked > 0);
}
