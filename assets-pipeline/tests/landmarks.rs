//! Landmarks of generated faces, of the built-in head bent into other people, of things that are no faces, and of
//! the heads in `RUBOR_SHARED`.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use glam::{Mat3, Vec3};
use rubor_assets::landmarks::{Fit, TRUSTED, canonical_face, draw_picture, find, find_with, read_given};
use rubor_assets::{import, parts};
use rubor_rig::head::{Head, Material};

#[path = "support/faces.rs"]
#[allow(dead_code, unreachable_pub, missing_docs)]
mod faces;

use faces::{another_person, default_head, keep, made_up_face, moved, no_faces, noisy, turn};

/// A coarser version of the built-in head: tests look at many heads.
fn face() -> Head {
    keep(&default_head(), |_, p| p.z > -0.12)
}

/// Errors of landmarks on the inner face, mm of an adult's: median and largest.
fn errors(head: &Head, fit: &Fit) -> (f32, f32, String) {
    let inner = [
        "endocanthion",
        "exocanthion",
        "lid-upper",
        "lid-lower",
        "alare",
        "cheilion",
        "pronasale",
        "subnasale",
        "sellion",
        "labrale-superius",
        "stomion",
        "labrale-inferius",
        "menton",
        "glabella",
        "brow-middle",
    ];
    let mut found: Vec<(f32, &String)> = (head.landmarks.iter())
        .filter(|(name, _)| inner.iter().any(|i| name.starts_with(i)))
        .map(|(name, place)| (fit.landmarks[name].distance(*place) * fit.unit_mm, name))
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let worst = found.last().unwrap();
    (found[found.len() / 2].0, worst.0, worst.1.clone())
}

fn is_found(what: &str, head: &Head, median_mm: f32, largest_mm: f32) {
    let fit = find(head).unwrap();
    let (median, largest, worst) = errors(head, &fit);
    assert!(fit.confidence > TRUSTED, "{what}: confidence {}, {:?}", fit.confidence, fit.measures);
    assert!(median < median_mm && largest < largest_mm, "{what}: median {median} mm, {worst} {largest} mm");
}

#[test]
fn the_canonical_face_is_that_of_the_built_in_head() {
    let stored = include_bytes!("../src/landmarks/face.bin");
    let made = canonical_face(&default_head());
    // Points are thinned out one after another, so a rounding may choose others; landmarks and relief are compared.
    let count = |bytes: &[u8]| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize;
    let (here, there) = (count(&made), count(stored));
    assert!(
        here.abs_diff(there) * 50 < there,
        "{here} and {there} points: run the example landmark_confidence with `face`"
    );
    let rest = |bytes: &[u8], points: usize| -> Vec<i16> {
        bytes[4 + 10 * points..].chunks_exact(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect()
    };
    let (made, stored) = (rest(&made, here), rest(stored, there));
    assert_eq!(made.len(), stored.len());
    // Hundredths of a millimetre; at outlines a pixel may see another surface.
    let differing = made.iter().zip(&stored).filter(|(a, b)| a.abs_diff(**b) > 10).count();
    assert!(differing * 50 < stored.len(), "{differing} of {} values differ", stored.len());
}

#[test]
fn the_built_in_head_is_found_to_a_few_millimetres() {
    is_found("default", &face(), 3.0, 6.0);
}

#[test]
fn other_people_are_found() {
    for seed in [1, 2] {
        is_found("another person", &another_person(face(), seed, 5.0), 4.0, 9.0);
    }
}

#[test]
fn turned_scaled_and_cut_heads_are_found() {
    let turn = turn(3);
    let head = moved(keep(&face(), |_, p| p.z > -0.02), |p| turn * p * 37.0 + Vec3::ONE);
    is_found("turned, of another unit, without its back", &head, 4.0, 9.0);
}

#[test]
fn noise_and_missing_parts_do_not_matter() {
    is_found("noisy", &noisy(face(), 1, 0.8), 3.0, 8.0);
    is_found("without ears", &keep(&face(), |_, p| p.x.abs() < 0.068), 3.0, 9.0);
}

#[test]
fn a_coarse_face_made_by_rules_is_found() {
    let head = made_up_face(1.0);
    let fit = find(&head).unwrap();
    assert!(fit.confidence > TRUSTED, "{} {:?}", fit.confidence, fit.measures);
    let nose = fit.landmarks["pronasale"];
    let tip = head.mesh.points.iter().copied().max_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
    assert!(nose.distance(tip) < 0.06, "{nose}, not {tip}");
    // The chin lies below the lips, the brows over the eyes.
    assert!(fit.landmarks["menton"].y < fit.landmarks["stomion"].y - 0.15);
    assert!(fit.landmarks["brow-middle-left"].y > fit.landmarks["lid-upper-left"].y);
}

#[test]
fn what_is_no_face_is_not_taken_for_one() {
    for (name, thing) in no_faces() {
        let fit = find(&thing).unwrap();
        assert!(fit.confidence < TRUSTED, "{name}: {} {:?}", fit.confidence, fit.measures);
    }
    assert!(find(&Head::default()).is_none());
}

#[test]
fn given_landmarks_are_kept_and_the_others_follow() {
    let head = face();
    let truth = &head.landmarks;
    let vertex = |place: Vec3| {
        let distance = |v: &usize| head.mesh.points[head.mesh.vertices[*v].point as usize].distance(place);
        (0..head.mesh.vertices.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap()
    };
    let point = truth["cheilion-left"].to_array();
    let text = format!(
        r#"{{"pronasale": {}, "menton": {}, "cheilion-left": {point:?}, "exocanthion-right": {}, "exocanthion-left": {}}}"#,
        vertex(truth["pronasale"]),
        vertex(truth["menton"]),
        vertex(truth["exocanthion-right"]),
        vertex(truth["exocanthion-left"]),
    );
    let given = read_given(&text, &head, None).unwrap();
    let fit = find_with(&head, &given).unwrap();
    assert!(fit.confidence == 1.0 && given.iter().all(|(name, place)| fit.landmarks[name] == *place));
    let (median, largest, worst) = errors(&head, &fit);
    assert!(median < 3.0 && largest < 6.0, "median {median} mm, {worst} {largest} mm");
    for (text, expected) in [
        ("[1]", "a JSON object"),
        (r#"{"xyzzy": 1}"#, "one of vertex"),
        (r#"{"pronasal": 1}"#, "did you mean \"pronasale\"?"),
        (r#"{"pronasale": 4000000}"#, "a vertex below"),
        (r#"{"pronasale": "tip"}"#, "a vertex, three coordinates"),
        (r#"{"pronasale": {"pixel": [-4, 3]}}"#, "a pixel of the picture"),
        (r#"{"pronasale": {"pixel": [1, 1]}}"#, "that shows the head"),
    ] {
        let error = read_given(text, &head, None).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn pixels_of_the_picture_mean_the_places_that_it_shows() {
    let head = face();
    let marks = [("pronasale".to_owned(), head.landmarks["pronasale"])].into();
    let picture = draw_picture(&head, None, &marks).unwrap();
    assert_eq!(picture.rgb.len(), 3 * (picture.width * picture.height) as usize);
    // The mark is the only pure colour of the picture.
    let pixel = |i: usize| [picture.rgb[3 * i], picture.rgb[3 * i + 1], picture.rgb[3 * i + 2]];
    let marked: Vec<usize> = (0..picture.rgb.len() / 3).filter(|i| pixel(*i) == [80, 255, 120]).collect();
    let mean =
        |of: &dyn Fn(usize) -> usize| marked.iter().map(|i| of(*i) as f32).sum::<f32>() / marked.len() as f32;
    let width = picture.width as usize;
    let text =
        format!(r#"{{"pronasale": {{"pixel": [{}, {}]}}}}"#, mean(&|i| i % width), mean(&|i| i / width));
    let found = read_given(&text, &head, None).unwrap()["pronasale"];
    assert!(found.distance(head.landmarks["pronasale"]) < 0.002, "{found}");
}

#[test]
fn untextured_pieces_of_one_mesh_are_told_by_shape_and_place() {
    let mut head = face();
    let (eyes, teeth) = (count(&head, Material::Eye), count(&head, Material::Teeth));
    assert!(eyes > 0 && teeth > 0);
    for part in &mut head.mesh.parts {
        part.material = Material::Skin;
        part.name = "Object".into();
    }
    let fit = find(&head).unwrap();
    let notes = parts::recognise(&mut head, &fit, |_| false);
    head.validate().unwrap();
    // Shells around them count as eyes too.
    assert!(count(&head, Material::Eye) >= eyes, "{notes:?}");
    assert!(count(&head, Material::Teeth) >= teeth / 2, "{notes:?}");
    assert!(notes.iter().any(|n| n.message.contains("told by shape and place to be eyes")), "{notes:?}");
}

/// Triangles of a material.
fn count(head: &Head, material: Material) -> usize {
    head.mesh.parts.iter().filter(|p| p.material == material).map(|p| p.triangles.len()).sum()
}

/// The folder of third-party data, or a loud word.
fn shared(path: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("RUBOR_SHARED") else {
        eprintln!("SKIPPED: RUBOR_SHARED is not set, {path} is not looked at");
        return None;
    };
    let path = PathBuf::from(folder).join(path);
    assert!(path.exists(), "{} is missing in RUBOR_SHARED", path.display());
    Some(path)
}

fn ict() -> Option<&'static Head> {
    static HEAD: LazyLock<Option<Head>> = LazyLock::new(|| {
        let source = shared("heads/ict")?;
        // The neutral and the shape that opens the jaw: reading all takes long.
        let folder = tempfile::tempdir().unwrap();
        for file in ["generic_neutral_mesh.obj", "jawOpen.obj", "vertex_indices.json"] {
            std::fs::copy(source.join(file), folder.path().join(file)).unwrap();
        }
        let options = import::obj_set::Options {
            folder: folder.path().into(),
            occlusion_rays: 0,
            ..Default::default()
        };
        Some(import::obj_set::import(&options).unwrap())
    });
    HEAD.as_ref()
}

#[test]
fn the_ict_head_is_found_where_its_own_landmarks_are() {
    let Some(head) = ict() else { return };
    is_found("ICT", head, 4.0, 11.0);
    is_found("another identity of ICT", &another_person(head.clone(), 5, 4.0), 4.5, 12.0);
}

#[test]
fn teeth_and_lashes_of_the_ict_head_are_what_they_are() {
    let Some(head) = ict() else { return };
    let vertices = |material: Material| {
        head.mesh.parts.iter().filter(move |p| p.material == material).flat_map(|p| {
            head.mesh.triangles[p.triangles.start as usize..p.triangles.end as usize].iter().flatten()
        })
    };
    for v in vertices(Material::Teeth).map(|v| head.mesh.vertices[*v as usize].uv) {
        assert!((v.y - 0.5).abs() < 0.065 && v.x.abs() < 0.56, "no gums on teeth: {v}");
    }
    // Upper and lower rows, left and right.
    let rows: std::collections::BTreeSet<(bool, bool)> = vertices(Material::Teeth)
        .map(|v| head.mesh.vertices[*v as usize].uv)
        .map(|v| (v.y > 0.5, v.x > 0.0))
        .collect();
    assert_eq!(rows.len(), 4);
    // Hairs, not bands.
    assert!(vertices(Material::Lash).all(|v| head.mesh.vertices[*v as usize].uv.x >= 2.0));
    let names: Vec<&str> =
        head.mesh.parts.iter().filter(|p| p.material == Material::Lash).map(|p| p.name.as_str()).collect();
    assert_eq!(names.len(), 4, "{names:?}");
}

#[test]
fn the_scan_of_lee_perry_smith_is_found() {
    let Some(path) = shared("heads/lee-perry-smith/LeePerrySmith.glb") else { return };
    let head = import::gltf::from_bytes(&std::fs::read(&path).unwrap(), Path::new("scan")).unwrap().head;
    let fit = find(&head).unwrap();
    assert!(fit.confidence > TRUSTED, "{} {:?}", fit.confidence, fit.measures);
    // Picked on a picture of the scan, its units.
    let tip = fit.landmarks["pronasale"];
    let front = head
        .mesh
        .points
        .iter()
        .copied()
        .filter(|p| p.y.abs() < 1.5)
        .max_by(|a, b| a.z.total_cmp(&b.z))
        .unwrap();
    assert!(tip.distance(front) < 0.12, "{tip}, not {front}");
    assert!((30.0..70.0).contains(&fit.unit_mm), "a unit is about 50 mm: {}", fit.unit_mm);
    let turned = moved(head, |p| Mat3::from_rotation_y(0.5) * p);
    let fit = find(&turned).unwrap();
    assert!(fit.confidence > TRUSTED && (fit.turned_degrees - 28.6).abs() < 8.0, "{}", fit.turned_degrees);
}
