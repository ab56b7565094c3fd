//! The default head from MakeHuman data. `RUBOR_MAKEHUMAN` names the folder with `mpfb2/` and `faceunits01/`.

use std::collections::HashMap;
use std::io::Write;

use rubor_assets::convert::occlusion;
use rubor_assets::import::makehuman::{Options, import};
use rubor_rig::deform::{blend_occlusion, deform_points};
use rubor_rig::head::{Head, Material};
use rubor_rig::landmarks::{MIDDLE, PAIRED, paired};

fn head(subdivide: u32) -> Option<Head> {
    let Ok(data) = std::env::var("RUBOR_MAKEHUMAN") else {
        writeln!(std::io::stderr(), "SKIPPED: RUBOR_MAKEHUMAN is not set, the default head was not built")
            .expect("stderr is open");
        return None;
    };
    let options = Options { data: data.into(), subdivide, occlusion_rays: 8, ..Options::default() };
    Some(import(&options).unwrap())
}

#[test]
fn the_head_has_all_that_a_face_needs() {
    let Some(head) = head(1) else { return };
    assert_eq!(head.shapes.len(), 52);
    assert!(head.shapes.iter().all(|s| !s.points.is_empty()));
    for name in MIDDLE {
        assert!(head.landmarks.contains_key(name), "{name}");
        assert!(head.landmarks[name].x.abs() < 1e-4, "{name} is off the middle");
    }
    for name in PAIRED {
        let (l, r) = (head.landmarks[&paired(name, true)], head.landmarks[&paired(name, false)]);
        assert!(l.x > 0.0 && (l.x + r.x).abs() < 1e-3 && (l.y - r.y).abs() < 1e-3, "{name}: {l} {r}");
    }
    assert!((0.25..0.5).contains(&head.height()), "{} m", head.height());
    assert!(head.mesh.occlusion.iter().all(|o| (0.0..=1.0).contains(o)));
}

#[test]
fn skin_lies_inside_the_unit_square_without_overlap() {
    let Some(head) = head(1) else { return };
    let size = 1024;
    let mut owner: HashMap<(i32, i32), u32> = HashMap::new();
    let mut twice = 0;
    for part in head.mesh.parts.iter().filter(|p| p.material == Material::Skin) {
        for t in part.triangles.clone() {
            let uv = head.mesh.triangles[t as usize].map(|v| head.mesh.vertices[v as usize].uv);
            assert!(uv.iter().all(|p| p.min_element() > 0.0 && p.max_element() < 1.0));
            let p = uv.map(|p| p * size as f32);
            let low = p[0].min(p[1]).min(p[2]).floor().as_ivec2();
            let high = p[0].max(p[1]).max(p[2]).ceil().as_ivec2();
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let q = glam::Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                    let side = |a: usize, b: usize| (p[b] - p[a]).perp_dot(q - p[a]);
                    let (a, b, c) = (side(0, 1), side(1, 2), side(2, 0));
                    if (a > 0.0 && b > 0.0 && c > 0.0) || (a < 0.0 && b < 0.0 && c < 0.0) {
                        twice += u32::from(owner.insert((x, y), t).is_some());
                    }
                }
            }
        }
    }
    let filled = owner.len() as f32 / (size * size) as f32;
    assert!(filled > 0.5, "skin fills only {filled} of the square");
    assert!(
        (twice as f32) < 1e-3 * owner.len() as f32,
        "{twice} of {} texels belong to two triangles",
        owner.len()
    );
}

#[test]
fn the_same_data_gives_the_same_head() {
    let (Some(a), Some(b)) = (head(0), head(0)) else { return };
    assert_eq!(a.mesh, b.mesh);
    assert_eq!(a.shapes, b.shapes);
}

#[test]
fn missing_data_and_wrong_options_are_errors() {
    let missing = import(&Options { data: "/nowhere".into(), ..Options::default() }).unwrap_err().to_string();
    assert!(missing.contains("base.obj"), "{missing}");
    for options in [
        Options { gender: 1.5, ..Options::default() },
        Options { age: f32::NAN, ..Options::default() },
        Options { ethnicity: [0.0; 3], ..Options::default() },
        Options { subdivide: 3, ..Options::default() },
    ] {
        assert!(import(&options).unwrap_err().to_string().contains("option"));
    }
}

/// The error of blended visibility against rays in the posed head, and that of visibility that stays as at rest.
#[test]
fn ambient_visibility_follows_jaw_and_lids() {
    let Ok(data) = std::env::var("RUBOR_MAKEHUMAN") else {
        writeln!(std::io::stderr(), "SKIPPED: RUBOR_MAKEHUMAN is not set, the default head was not built")
            .expect("stderr is open");
        return;
    };
    let options = Options { data: data.into(), subdivide: 0, occlusion_rays: 0, ..Options::default() };
    let mut head = import(&options).unwrap();
    occlusion::bake(&mut head, 32);
    let rest = head.mesh.occlusion.clone();
    let blinks = ["eyeBlinkLeft", "eyeBlinkRight"];
    occlusion::bake_shapes(&mut head, 32, &[("jawOpen", None), (blinks[0], None), (blinks[1], None)]);
    assert_eq!(head.mesh.occlusion, rest);
    // The renderer finds the lids over eyes in the picture.
    let mut is_eye = vec![false; rest.len()];
    for part in head.mesh.parts.iter().filter(|p| p.material == Material::Eye) {
        let triangles = &head.mesh.triangles[part.triangles.start as usize..part.triangles.end as usize];
        let points = triangles.as_flattened().iter().map(|v| head.mesh.vertices[*v as usize].point);
        points.for_each(|p| is_eye[p as usize] = true);
    }
    let rms = |a: &[f32], b: &[f32]| {
        let squares =
            a.iter().zip(b).zip(&is_eye).filter(|(_, eye)| !**eye).map(|((x, y), _)| (x - y).powi(2));
        let squares: Vec<f32> = squares.collect();
        (squares.iter().sum::<f32>() / squares.len() as f32).sqrt()
    };
    // Weights of jaw and blinks. The same rays, so no noise: the rest comes from small changes and from weights between
    // those traced.
    for (jaw, blink) in [(0.0, 0.0), (1.0, 0.0), (0.75, 0.0), (0.5, 1.0)] {
        let mut weights = vec![0.0; head.shapes.len()];
        weights[head.shape_index("jawOpen").unwrap()] = jaw;
        blinks.iter().for_each(|b| weights[head.shape_index(b).unwrap()] = blink);
        let mut posed = head.clone();
        posed.mesh.points = deform_points(&head.mesh, &head.shapes, &weights);
        occlusion::bake(&mut posed, 32);
        let blended = blend_occlusion(&head.mesh, &head.shapes, &weights);
        let (error, still) = (rms(&blended, &posed.mesh.occlusion), rms(&rest, &posed.mesh.occlusion));
        println!("jaw {jaw}, lids {blink}: {error:.4}, as at rest {still:.4}");
        assert!(error < 0.01 && error <= 0.5 * still, "jaw {jaw}, lids {blink}: {error} of {still}");
    }
}
