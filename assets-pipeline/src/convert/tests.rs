use rubor_rig::color::{ciede2000, lab_from_rec709, srgb_encode};
use rubor_rig::map::Map;
use rubor_rig::mask::Mask;
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinLookup, SkinModel};

use super::{chromophores, hemoglobin, normals};
use crate::image_io::{LoadedImage, SampleKind, load_image, save_image};

fn map(width: u32, height: u32, value: impl Fn(u32, u32) -> f32) -> Map {
    let values =
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| value(x, y)).collect();
    Map { width, height, channels: 1, values }
}

fn texture(x: u32, y: u32) -> f32 {
    ((x * 7 + y * 13) % 17) as f32 / 17.0 - 0.5
}

#[test]
fn a_manifest_of_mixed_files_becomes_distributions() {
    let kept = tempfile::tempdir().unwrap();
    let folder = kept.path();
    // The same blood in three units and formats: 5 % with texture, and twice the contrast at 8 %.
    let neutral = map(128, 96, |x, y| 0.05 + 0.02 * texture(x, y));
    let anger = map(128, 96, |x, y| 0.08 + 0.04 * texture(x, y));
    let scaled = |m: &Map, f: f32| Map { values: m.values.iter().map(|v| v * f).collect(), ..m.clone() };
    save_image(&folder.join("neutral.exr"), &neutral, SampleKind::F32).unwrap();
    save_image(&folder.join("anger.tif"), &scaled(&anger, 1.0 / 0.32), SampleKind::U16).unwrap();
    save_image(&folder.join("anger.png"), &scaled(&anger, 1.0 / 0.32), SampleKind::U8).unwrap();
    save_image(&folder.join("percent.exr"), &scaled(&anger, 100.0), SampleKind::F32).unwrap();
    let text = r#"{
        "neutral": "neutral.exr",
        "calibration": { "unit": "volume-fraction" },
        "distributions": [
            { "name": "anger", "file": "anger.tif", "calibration": { "unit": "normalized" } },
            { "name": "anger-8", "file": "anger.png", "calibration": { "unit": "normalized" } },
            { "name": "anger-percent", "file": "percent.exr", "calibration": { "unit": "percent" } }
        ],
        "radius_px": 16,
        "size": 32
    }"#;
    std::fs::write(folder.join("maps.json"), text).unwrap();
    let manifest = hemoglobin::read_manifest(&folder.join("maps.json")).unwrap();
    let maps = hemoglobin::convert(&manifest, folder, None).unwrap();
    assert_eq!((maps.distributions.len(), maps.clamped_texels), (3, 0));
    for d in &maps.distributions {
        // 8 bits of 0..0.32 are steps of 0.00126, a tenth of the deviation: 1 % of the scale.
        let tolerance = if d.name == "anger-8" { 0.03 } else { 1e-3 };
        assert_eq!((d.scale.width, d.scale.height), (32, 32));
        for (i, (s, b)) in d.scale.values.iter().zip(&d.bias.values).enumerate() {
            assert!((s - 2.0).abs() < 2.0 * tolerance, "{} scale {s}", d.name);
            let expected = 0.08 + 2.0 * (maps.neutral_mean.values[i] - 0.05);
            assert!((b - expected).abs() < 0.02 * tolerance, "{} bias {b}, {expected}", d.name);
        }
    }
    let written = hemoglobin::write(&maps, &folder.join("out")).unwrap();
    assert_eq!(written.len(), 8);
    assert_eq!(load_image(&folder.join("out/neutral.exr")).unwrap().map, neutral);
}

#[test]
fn bad_hemoglobin_input_is_explained() {
    let kept = tempfile::tempdir().unwrap();
    let folder = kept.path();
    save_image(&folder.join("n.exr"), &map(16, 8, |_, _| 0.05), SampleKind::F32).unwrap();
    save_image(&folder.join("mask.png"), &map(8, 8, |_, _| 1.0), SampleKind::U8).unwrap();
    save_image(&folder.join("black.png"), &map(16, 8, |_, _| 0.0), SampleKind::U8).unwrap();
    let message = |fields: &str| {
        let text = format!("{{ \"neutral\": \"n.exr\", {fields} }}");
        std::fs::write(folder.join("m.json"), text).unwrap();
        hemoglobin::read_manifest(&folder.join("m.json"))
            .and_then(|m| hemoglobin::convert(&m, folder, None))
            .unwrap_err()
            .to_string()
    };
    assert!(message("\"radius_px\": 0").contains("radius: found 0 texels"));
    assert!(message("\"radius_px\": 17").contains("1 to 16"));
    assert!(message("\"mask\": \"mask.png\"").contains("8x8 texels, expected 16x8"));
    assert!(message("\"mask\": \"black.png\"").contains("no mapped texel"));
    assert!(message("\"calibration\": { \"unit\": \"litres\" }").contains("volume-fraction"));
    let twice = r#""distributions": [{"name": "a", "file": "n.exr"}, {"name": "a", "file": "n.exr"}]"#;
    assert!(message(twice).contains("name \"a\""));
    assert!(message(r#""distributions": [{"name": "a", "file": "gone.exr"}]"#).contains("gone.exr"));
    assert!(message("\"size\": 0").contains("size"));
}

#[test]
fn albedo_goes_to_chromophores_and_back() {
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(64, 64);
    let melanin = map(40, 30, |x, _| 0.003 + 0.25 * (x as f32 / 40.0).powi(2));
    let blood = map(40, 30, |_, y| 0.003 + 0.1 * (y as f32 / 30.0).powi(2));
    let albedo = chromophores::albedo(&melanin, &blood, &lookup).unwrap();
    // Through an 8-bit sRGB texture, as heads come.
    let codes = albedo.values.iter().map(|v| (srgb_encode(*v) * 255.0).round() / 255.0).collect();
    let image = LoadedImage {
        file: "albedo.png".into(),
        map: Map { values: codes, ..albedo.clone() },
        alpha: None,
        kind: SampleKind::U8,
        notes: Vec::new(),
    };
    let read = chromophores::linear_albedo(&image, chromophores::AlbedoEncoding::Automatic).unwrap();
    let given = chromophores::Options { gain: Some(1.0), ..Default::default() };
    let found = chromophores::convert(&read, &image.mask(), &lookup, &given).unwrap();
    assert_eq!(found.summary.out_of_gamut_texels, 0);
    let back = chromophores::albedo(&found.melanin, &found.hemoglobin, &lookup).unwrap();
    let lab = |c: &[f32]| lab_from_rec709([c[0], c[1], c[2]].map(f64::from));
    let differences: Vec<f64> = albedo
        .values
        .chunks_exact(3)
        .zip(back.values.chunks_exact(3))
        .map(|(a, b)| ciede2000(lab(a), lab(b)))
        .collect();
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    assert!(mean < 0.3, "{mean}");
    let codes = |c: &[f32]| [c[0], c[1], c[2]].map(|v| (srgb_encode(v) * 255.0).round());
    let colors = albedo.values.chunks_exact(3).zip(back.values.chunks_exact(3));
    for ((a, b), (before, after)) in melanin.values.iter().zip(&found.melanin.values).zip(colors) {
        // Pale skin hardly shows its melanin, and least beside much blood: no inversion can tell apart what has the same
        // 8-bit codes or the next ones.
        let is_next = codes(before).into_iter().zip(codes(after)).all(|(p, q)| (p - q).abs() <= 1.0);
        assert!((a - b).abs() < 0.05 * a + 2e-3 || is_next, "{a} {b}");
    }
}

#[test]
fn texels_that_are_no_skin_are_marked_and_holes_filled() {
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(64, 64);
    let skin = lookup.sample(0.02, 0.015);
    let mut albedo = Map::filled(8, 8, &skin);
    albedo.values[3 * 9..3 * 9 + 3].copy_from_slice(&[0.02, 0.3, 0.7]);
    albedo.values[..3].fill(0.0);
    let mut mask = Mask::full(8, 8);
    mask.mapped[0] = false;
    let options = chromophores::Options::default();
    let found = chromophores::convert(&albedo, &mask, &lookup, &options).unwrap();
    assert_eq!(found.out_of_gamut.count(), 1);
    assert!(found.out_of_gamut.mapped[9] && found.residual.values[9] > 20.0);
    // The marked texel has the blood and the pigment of the skin around it, as the hole has.
    for i in [0, 9] {
        assert!((found.hemoglobin.values[i] - 0.015).abs() < 1e-3, "{}", found.hemoglobin.values[i]);
        assert!((found.melanin.values[i] - 0.02).abs() < 1e-3, "{}", found.melanin.values[i]);
    }
    assert!((found.melanin.values[20] - 0.02).abs() < 1e-4);
    assert!(chromophores::convert(&albedo, &Mask::full(3, 3), &lookup, &options).is_err());
    assert!(chromophores::convert(&Map::filled(8, 8, &[0.1]), &mask, &lookup, &options).is_err());
}

/// Skin of varied melanin and blood times a factor, as a camera that is not calibrated gives it.
fn exposed(lookup: &SkinLookup, factor: f32) -> Map {
    let value = |i: u32| lookup.sample(0.006 + 0.002 * (i % 9) as f32, 0.008 + 0.003 * (i / 24 % 7) as f32);
    let values = (0..24 * 24).flat_map(|i| value(i).map(|c| factor * c)).collect();
    Map { width: 24, height: 24, channels: 3, values }
}

#[test]
fn the_exposure_of_a_picture_is_found_and_its_confidence_said() {
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(64, 64);
    let full = Mask::full(24, 24);
    let threshold = chromophores::DEFAULT_GAMUT_THRESHOLD;
    let true_one = chromophores::estimate_exposure(&exposed(&lookup, 1.0), &full, &lookup, threshold);
    assert_eq!(true_one.gain, 1.0);
    let bright = chromophores::estimate_exposure(&exposed(&lookup, 1.45), &full, &lookup, threshold);
    assert!((1.45 * bright.gain - 1.0).abs() < 0.1 && bright.range[1] < 1.0, "{bright}");
    // The cast of a green lamp is found: no gain alone makes it skin.
    let mut lit_green = exposed(&lookup, 1.0);
    for color in lit_green.values.chunks_exact_mut(3) {
        color.iter_mut().zip([0.8, 1.3, 0.8]).for_each(|(value, factor)| *value *= factor);
    }
    let lit_green = chromophores::estimate_exposure(&lit_green, &full, &lookup, threshold);
    assert!(lit_green.balance[0] > 1.1 * lit_green.balance[1], "{lit_green}");
    assert_eq!((true_one.balance, bright.balance), ([1.0; 3], [1.0; 3]));
    // A green picture has no exposure at which it is skin.
    let green = Map::filled(24, 24, &[0.1, 0.6, 0.1]);
    let none = chromophores::estimate_exposure(&green, &full, &lookup, threshold);
    assert!(none.confidence < 0.05 && bright.confidence > 2.0 * none.confidence + 0.3, "{none}; {bright}");
    // A given gain is taken as it is; the wrong ones are refused.
    let options = |gain| chromophores::Options { gain: Some(gain), ..Default::default() };
    let given = chromophores::convert(&green, &full, &lookup, &options(0.5)).unwrap().exposure;
    assert_eq!((given.gain, given.confidence), (0.5, 1.0));
    for wrong in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(chromophores::convert(&green, &full, &lookup, &options(wrong)).is_err(), "{wrong}");
    }
}

#[test]
fn painted_skin_has_the_blood_of_a_face_everywhere() {
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(64, 64);
    // Rosy flat paint, with blue eyelids.
    let values = (0..32 * 32).flat_map(|i| if i % 32 < 4 { [0.1, 0.2, 0.9] } else { [0.95, 0.30, 0.75] });
    let albedo = Map { width: 32, height: 32, channels: 3, values: values.collect() };
    let found =
        chromophores::convert(&albedo, &Mask::full(32, 32), &lookup, &chromophores::Options::default())
            .unwrap();
    assert!(found.summary.is_painted && found.exposure.confidence < 0.1, "{:?}", found.summary);
    let blood = found.hemoglobin.values[0];
    assert!((0.01..=0.035).contains(&blood), "{blood}");
    assert!(found.hemoglobin.values.iter().all(|h| *h == blood));
    assert!(found.melanin.values.iter().all(|m| *m == found.melanin.values[0]));
}

#[test]
fn slopes_beyond_45_degrees_survive() {
    // Slopes up to 3 (72 degrees) in both conventions.
    let slopes = Map {
        width: 13,
        height: 7,
        channels: 2,
        values: (0..13 * 7).flat_map(|i| [(i % 13) as f32 / 2.0 - 3.0, (i % 7) as f32 / 1.0 - 3.0]).collect(),
    };
    for green in [normals::GreenAxis::OpenGl, normals::GreenAxis::DirectX] {
        let codes = normals::normals_from_slopes(&slopes, green).unwrap();
        let back = normals::slopes_from_normals(&codes, green).unwrap();
        assert_eq!((back.clamped_texels, back.largest > 2.99), (0, true));
        assert!(back.beyond_45_degrees > 50);
        for (a, b) in slopes.values.iter().zip(&back.map.values) {
            assert!((a - b).abs() < 1e-4, "{a} {b}");
        }
    }
    for bits in [8, 16] {
        let encoded = normals::encode_signed(&slopes, None, bits).unwrap();
        assert_eq!(encoded.range, 3.0);
        let step = 3.0 / ((1 << (bits - 1)) - 1) as f32;
        for (a, b) in slopes.values.iter().zip(&normals::decode_signed(&encoded).values) {
            assert!((a - b).abs() <= 0.501 * step, "{a} {b}");
        }
    }
    // A range of 1 clamps, which is what the range is for.
    let narrow = normals::decode_signed(&normals::encode_signed(&slopes, Some(1.0), 8).unwrap());
    assert!(narrow.values.iter().all(|v| v.abs() <= 1.0 + 1e-6));
}

#[test]
fn flat_stays_flat_and_overhangs_are_bounded() {
    let flat = Map::filled(2, 2, &[0.0, 0.0]);
    for bits in [8, 16] {
        let back = normals::decode_signed(&normals::encode_signed(&flat, None, bits).unwrap());
        assert!(back.values.iter().all(|v| v.abs() < 1e-6));
    }
    // n_z of 0, n_z negative, an empty texel.
    let codes =
        Map { width: 3, height: 1, channels: 3, values: vec![1.0, 0.5, 0.5, 0.9, 0.5, 0.2, 0.5, 0.5, 0.5] };
    let slopes = normals::slopes_from_normals(&codes, normals::GreenAxis::OpenGl).unwrap();
    assert!(slopes.map.values.iter().all(|v| v.is_finite() && v.abs() <= normals::MAX_SLOPE + 1e-4));
    assert_eq!(slopes.map.values[4..], [0.0, 0.0]);
    assert!(normals::encode_signed(&flat, Some(0.0), 8).is_err());
    assert!(normals::encode_signed(&flat, None, 12).is_err());
}

#[test]
fn differences_bring_the_wrinkles_back() {
    let slope = |f: f32| Map {
        width: 9,
        height: 5,
        channels: 2,
        values: (0..45).flat_map(|i| [f * ((i % 9) as f32 - 4.0) / 8.0, f * 0.1]).collect(),
    };
    let green = normals::GreenAxis::OpenGl;
    let base = normals::normals_from_slopes(&slope(0.3), green).unwrap();
    let wrinkles = normals::normals_from_slopes(&slope(1.4), green).unwrap();
    let difference = normals::difference(&base, &wrinkles).unwrap();
    let stored = normals::decode_signed(&normals::encode_signed(&difference, None, 8).unwrap());
    let full = normals::apply_difference(&base, &stored, 1.0).unwrap();
    let none = normals::apply_difference(&base, &stored, 0.0).unwrap();
    for i in 0..base.values.len() {
        assert!((full.values[i] - wrinkles.values[i]).abs() < 2.5 / 255.0);
        assert!((none.values[i] - base.values[i]).abs() < 1e-6);
    }
    assert!(normals::difference(&base, &Map::filled(2, 2, &[0.5, 0.5, 1.0])).is_err());
}
