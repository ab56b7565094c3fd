use glam::{Vec2, Vec3};

use super::*;
use crate::authored::{AuthoredImage, AuthoredMaterial, AuthoredTexture, TextureTransform, Wrap};
use crate::bind::BoundRig;
use crate::evaluate::Evaluator;
use crate::expression::Rig;
use crate::head::{
    BlendShape, Distribution, Material, Mesh, OcclusionChange, Part, SkinMaps, Vertex, WrinkleZone,
};
use crate::map::Map;
use crate::timeline::Sequence;

fn shape(name: &str, points: &[u32]) -> BlendShape {
    BlendShape {
        name: name.into(),
        points: points.to_vec(),
        offsets: points.iter().map(|p| Vec3::new(0.1, 0.01 * *p as f32, 0.3)).collect(),
        occlusion: points
            .iter()
            .map(|p| OcclusionChange { point: *p, at_half: 0.25, at_full: -0.5 })
            .collect(),
    }
}

fn ramp(side: u32, channels: u32) -> Map {
    let values = (0..side * side * channels).map(|i| i as f32 / 64.0).collect();
    Map { width: side, height: side, channels, values }
}

/// Three parts of a triangle each, the first two sharing points 1 and 2; four shapes, three zones on two maps.
fn head(names: &[&str]) -> Head {
    let part = |name: &str, material, i| Part { name: name.into(), material, triangles: i..i + 1 };
    let texture = |image| AuthoredTexture {
        image,
        uv_set: 0,
        transform: TextureTransform::default(),
        wrap: [Wrap::Clamp; 2],
    };
    let picture =
        |name: &str, value| AuthoredImage { name: name.into(), width: 4, height: 4, rgba: vec![value; 64] };
    let zone = |name: &str, wrinkle_map| WrinkleZone { name: name.into(), wrinkle_map, mask: ramp(4, 1) };
    let distribution = |name: &str| Distribution { name: name.into(), scale: ramp(8, 1), bias: ramp(8, 1) };
    let mut head = Head {
        name: "small".into(),
        mesh: Mesh {
            points: (0..7).map(|i| Vec3::splat(i as f32)).collect(),
            occlusion: (0..7).map(|i| i as f32 / 8.0).collect(),
            vertices: (0..9)
                .map(|i| Vertex { point: [0, 1, 2, 1, 2, 3, 4, 5, 6][i], uv: Vec2::splat(i as f32) })
                .collect(),
            triangles: vec![[0, 1, 2], [3, 4, 5], [6, 7, 8]],
            parts: vec![
                part("face", Material::Skin, 0),
                part("glasses", Material::Other, 1),
                part("tooth", Material::Other, 2),
            ],
        },
        shapes: names.iter().enumerate().map(|(i, n)| shape(n, &[i as u32 % 4, 3 + i as u32 % 4])).collect(),
        maps: SkinMaps {
            melanin: Some(ramp(8, 1)),
            hemoglobin: Some(ramp(8, 1)),
            hemoglobin_mean: Some(ramp(8, 1)),
            distributions: vec![distribution("joy"), distribution("anger")],
            slopes: Some(ramp(16, 2)),
            wrinkle_slopes: vec![ramp(8, 2), ramp(4, 2)],
            zones: vec![zone("forehead", 0), zone("nose", 1), zone("chin", 1)],
            ..SkinMaps::default()
        },
        ..Head::default()
    };
    head.authored.images = vec![picture("glass", 9), picture("enamel", 200)];
    head.authored.materials = (0..2)
        .map(|i| AuthoredMaterial { base_color_texture: Some(texture(i)), ..AuthoredMaterial::default() })
        .collect();
    head.authored.of_parts = vec![None, Some(0), Some(1)];
    head.authored.second_uvs = (0..9).map(|i| Vec2::new(i as f32, 0.5)).collect();
    head
}

#[test]
fn nothing_less_is_the_same_head() {
    let head = head(&["a", "b", "c"]);
    let same = Reduction::default().head(&head);
    assert_eq!((&same.mesh, &same.shapes, &same.maps), (&head.mesh, &head.shapes, &head.maps));
    assert_eq!(same.authored, head.authored);
}

#[test]
fn a_shape_that_goes_leaves_the_others_bit_for_bit() {
    let head = head(&["a", "b", "c", "d"]);
    let reduced = Reduction { shapes: [1].into(), ..Reduction::default() }.head(&head);
    assert_eq!(reduced.shapes, [0, 2, 3].map(|i| head.shapes[i].clone()));
    assert_eq!((reduced.mesh, reduced.maps), (head.mesh, head.maps));
}

#[test]
fn a_part_that_goes_takes_what_only_it_has() {
    let head = head(&["a", "b", "c", "d"]);
    let reduced = Reduction { parts: [1].into(), ..Reduction::default() }.head(&head);
    reduced.validate().unwrap();
    // Point 3 and vertices 3 to 5 were those of the glasses alone.
    let points: Vec<f32> = reduced.mesh.points.iter().map(|p| p.x).collect();
    assert_eq!(points, [0.0, 1.0, 2.0, 4.0, 5.0, 6.0]);
    assert_eq!(reduced.mesh.occlusion.len(), 6);
    let corners = |h: &Head, t: usize| {
        h.mesh.triangles[t].map(|v| {
            let v = h.mesh.vertices[v as usize];
            (h.mesh.points[v.point as usize], v.uv)
        })
    };
    assert_eq!([corners(&reduced, 0), corners(&reduced, 1)], [corners(&head, 0), corners(&head, 2)]);
    assert_eq!(reduced.mesh.parts[1].triangles, 1..2);
    // Shape 0 moved points 0 and 3, shape 1 points 1 and 4.
    assert_eq!((&reduced.shapes[0].points[..], &reduced.shapes[1].points[..]), (&[0][..], &[1, 3][..]));
    assert_eq!(reduced.shapes[1].offsets, head.shapes[1].offsets);
    assert_eq!(reduced.shapes[0].occlusion.len(), 1);
    // Its material and picture went with it.
    assert_eq!(reduced.authored.of_parts, [None, Some(0)]);
    assert_eq!(reduced.authored.images, head.authored.images[1..]);
    assert_eq!(reduced.authored.materials[0].base_color_texture.unwrap().image, 0);
    assert_eq!(reduced.authored.second_uvs, [0, 1, 2, 6, 7, 8].map(|i| head.authored.second_uvs[i]));
}

#[test]
fn zones_are_numbered_anew_and_their_maps_go_with_the_last_of_them() {
    let head = head(&["a"]);
    let without = |zones: &[usize]| {
        let less = Reduction { zones: zones.iter().copied().collect(), ..Reduction::default() };
        let reduced = less.head(&head);
        reduced.validate().unwrap();
        reduced.maps
    };
    let maps = without(&[0]);
    assert_eq!(maps.wrinkle_slopes, head.maps.wrinkle_slopes[1..]);
    let zones: Vec<_> = maps.zones.iter().map(|z| (z.name.as_str(), z.wrinkle_map)).collect();
    assert_eq!(zones, [("nose", 0), ("chin", 0)]);
    let maps = without(&[1]);
    assert_eq!((maps.wrinkle_slopes.len(), maps.zones[1].wrinkle_map), (2, 1));
    assert!(without(&[0, 1, 2]).wrinkle_slopes.is_empty());
}

#[test]
fn distributions_share_a_mean_that_goes_with_the_last() {
    let head = head(&["a"]);
    let without = |all: &[usize]| {
        Reduction { distributions: all.iter().copied().collect(), ..Reduction::default() }.head(&head).maps
    };
    assert!(without(&[0]).hemoglobin_mean.is_some());
    assert_eq!(without(&[0]).distributions, head.maps.distributions[1..]);
    assert!(without(&[0, 1]).hemoglobin_mean.is_none());
}

#[test]
fn halved_maps_are_means_and_pictures_means_of_light() {
    let mut head = head(&["a"]);
    head.authored.images[0].rgba = [[0, 0, 0, 255], [255, 255, 255, 255]].repeat(8).concat();
    let less = Reduction {
        halvings: [(MapKind::Melanin, 1), (MapKind::Slopes, 9), (MapKind::Pictures, 2)].into(),
        hairs: Some(7),
        ..Reduction::default()
    };
    let reduced = less.head(&head);
    reduced.validate().unwrap();
    let melanin = reduced.maps.melanin.unwrap();
    assert_eq!((melanin.width, melanin.values[0]), (4, (0.0 + 1.0 + 8.0 + 9.0) / 4.0 / 64.0));
    let slopes = reduced.maps.slopes.unwrap();
    assert_eq!((slopes.width, slopes.height), (1, 1));
    assert_eq!(reduced.maps.hemoglobin, head.maps.hemoglobin);
    assert_eq!(reduced.maps.hair_count, Some(7));
    // Half of the light is 188 in sRGB.
    assert_eq!(reduced.authored.images[0].rgba, [188, 188, 188, 255]);
    assert_eq!(reduced.authored.images[1].rgba, [200; 4]);
}

/// Weights of the shapes that are left must be those of the whole head, at any weights of expressions.
fn faces_agree(head: &Head, rig: &Rig, less: &Reduction) -> (Rig, RigLoss) {
    let (reduced_rig, loss) = less.rig(head, rig, &BTreeSet::new());
    let names = less.names_alone(head);
    let (whole, _) = BoundRig::new(head, rig).unwrap();
    let (left, notes) = BoundRig::new(&names, &reduced_rig).unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    for (i, name) in left.expression_names().enumerate() {
        let wanted = whole.face_of_expression(whole.expression_index(name).unwrap());
        let found = left.face_of_expression(i);
        let kept: Vec<f32> = kept(head.shapes.len(), &less.shapes).map(|s| wanted.shapes[s]).collect();
        assert_eq!(found.shapes, kept, "{name}");
        let zones: Vec<f32> = kept_of(&wanted.zones, &less.zones);
        let blood: Vec<f32> = kept_of(&wanted.distributions, &less.distributions);
        assert_eq!((found.zones, found.distributions), (zones, blood), "{name}");
    }
    (reduced_rig, loss)
}

fn kept_of(weights: &[f32], gone: &BTreeSet<usize>) -> Vec<f32> {
    kept(weights.len(), gone).map(|i| weights[i]).collect()
}

const RIG: &str = r#"{
    "expressions": {
        "joy": { "shapes": { "mouthSmile": 0.8, "cheekPuffLeft": 0.5 }, "wrinkles": { "forehead": 1, "chin": 0.5 }, "hemoglobin": { "joy": 1 } },
        "anger": { "shapes": { "browDown": 1 }, "hemoglobin": { "anger": 0.5 } },
        "still": { "shapes": { "jawOpen": 0.3 } }
    },
    "states": {
        "flush": { "hemoglobin": { "anger": 0.4 }, "fallback": { "hemoglobinScale": 1.2 } },
        "exercise": { "hemoglobin": { "exercise": 1 }, "fallback": { "hemoglobin": { "anger": 1 } } }
    }
}"#;

#[test]
fn names_mean_on_the_head_with_less_what_they_meant_on_the_whole() {
    let rig = Rig::from_json("rig.json", RIG).unwrap();
    let names = [
        "mouthSmileLeft",
        "mouthSmileRight",
        "cheekPuffLeft",
        "cheekPuff",
        "browDownLeft",
        "browDownRight",
        "jawOpen",
    ];
    let head = head(&names);
    // Without its left half, `cheekPuffLeft` would be half of `cheekPuff`; `mouthSmile` is what is left of it.
    let less = Reduction {
        shapes: [1, 2].into(),
        zones: [0].into(),
        distributions: [1].into(),
        ..Reduction::default()
    };
    let (reduced, loss) = faces_agree(&head, &rig, &less);
    assert_eq!(reduced.expressions["joy"].shapes, BTreeMap::from([("mouthSmile".to_owned(), 0.8)]));
    assert_eq!(reduced.expressions["joy"].wrinkles, BTreeMap::from([("chin".to_owned(), 0.5)]));
    assert_eq!(loss.lessened, ["anger", "joy"]);
    // A head with all that a state names does not fall back when it loses that; one that fell back still does.
    assert_eq!(loss.emptied, ["exercise", "flush"]);
    let needed = ["exercise", "flush"].map(str::to_owned).into();
    let (reduced, loss) = less.rig(&head, &rig, &needed);
    assert_eq!(loss.empty, ["exercise", "flush"]);
    let (names, whole) = (less.names_alone(&head), BoundRig::new(&head, &rig).unwrap().0);
    let (left, _) = BoundRig::new(&names, &reduced).unwrap();
    for name in ["exercise", "flush"] {
        let face = left.face_of_state(left.state_index(name).unwrap());
        let wanted = whole.face_of_state(whole.state_index(name).unwrap());
        assert_eq!(
            (face.hemoglobin_scale, face.distributions),
            (wanted.hemoglobin_scale, vec![0.0]),
            "{name}"
        );
    }
}

#[test]
fn expressions_that_lose_everything_go_unless_they_are_needed() {
    let rig = Rig::from_json("rig.json", RIG).unwrap();
    let head = head(&["mouthSmileLeft", "browDownLeft", "browDownRight", "jawOpen"]);
    let less = Reduction { shapes: [1, 2].into(), distributions: [1].into(), ..Reduction::default() };
    let (reduced, loss) = less.rig(&head, &rig, &["anger".to_owned()].into());
    assert_eq!(
        (&loss.empty[..], reduced.expressions.contains_key("anger")),
        (&["anger".to_owned()][..], true)
    );
    let (reduced, loss) = less.rig(&head, &rig, &BTreeSet::new());
    assert!(loss.emptied.contains(&"anger".to_owned()) && !reduced.expressions.contains_key("anger"));
    assert!(reduced.expressions.contains_key("still"));
    reduced.check().unwrap();
}

#[test]
fn combinations_and_inbetweens_go_with_what_they_need() {
    let rig = Rig::from_json(
        "rig.json",
        r#"{ "expressions": { "a": { "shapes": { "jawOpen": 1, "mouthPucker": 1, "eyeBlink": 0.5 } } },
            "combinations": [{ "shape": "corrective", "drivers": ["jawOpen", "mouthPucker"] }],
            "inbetweens": [{ "shape": "eyeBlink", "target": "half", "weight": 0.5 }] }"#,
    )
    .unwrap();
    let head =
        head(&["jawOpen", "mouthPucker", "corrective", "eyeBlinkLeft", "eyeBlinkRight", "half_L", "half_R"]);
    let without = |gone: &[usize]| {
        let less = Reduction { shapes: gone.iter().copied().collect(), ..Reduction::default() };
        let (reduced, loss) = less.rig(&head, &rig, &BTreeSet::new());
        let (bound, _) = BoundRig::new(&less.names_alone(&head), &reduced).unwrap();
        (bound.face_of_expression(0).shapes, reduced, loss)
    };
    assert_eq!(without(&[]).0, [1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0]);
    let (shapes, _, loss) = without(&[1]);
    assert_eq!((&shapes[..2], &loss.combinations[..]), (&[1.0, 0.0][..], &["corrective".to_owned()][..]));
    // The right half of the in-between goes, the left one stays.
    let (shapes, reduced, loss) = without(&[6]);
    assert_eq!(shapes[3..], [0.0, 0.5, 1.0]);
    assert_eq!((reduced.inbetweens.len(), loss.inbetweens.len()), (1, 0));
    assert_eq!(reduced.inbetweens[0].target, "half_L");
    let (_, reduced, loss) = without(&[5, 6]);
    assert_eq!((reduced.inbetweens.len(), loss.inbetweens.len()), (0, 1));
}

#[test]
fn shapes_that_tracks_name_stay_where_their_names_would_mean_something_else() {
    let sequence = |text: &str| {
        Sequence::from_json("s.json", &format!(r#"{{ "fps": 1, "duration": 1, {text} }}"#)).unwrap()
    };
    let head = head(&["smirk", "cheekPuffLeft", "cheekPuff", "eyeBlinkLeft", "jawOpen", "aa"]);
    let held = |gone: &[usize], text: &str| -> Vec<usize> {
        let less = Reduction { shapes: gone.iter().copied().collect(), ..Reduction::default() };
        let held: Vec<usize> = less.held(&head, &sequence(text)).into_iter().collect();
        if held.is_empty() {
            // What is not held does no harm.
            let (rig, _) = less.rig(&head, &Rig::default(), &BTreeSet::new());
            Evaluator::new(&less.names_alone(&head), &rig, &sequence(text)).unwrap();
        }
        held
    };
    let tracks = r#""shapes": { "smirk": 0, "cheekPuffLeft": 0, "jawOpen": 0 }"#;
    assert_eq!(held(&[0], tracks), [0], "no program knows this name");
    assert_eq!(held(&[1], tracks), [1], "it would be half of cheekPuff");
    assert_eq!(held(&[1, 2], tracks), [] as [usize; 0]);
    assert_eq!(held(&[4], tracks), [4], "a head without jawOpen has aa for it");
    assert_eq!(held(&[3], tracks), [] as [usize; 0]);
    assert_eq!(held(&[0, 1, 3], r#""expressions": {}"#), [] as [usize; 0]);
    assert_eq!(held(&[3], r#""life": { "seed": 1 }"#), [] as [usize; 0]);
}
