use super::*;

fn ramp(channels: u32) -> Map {
    let values = (0..27 * 51 * channels).map(|i| (i % 1009) as f32 / 1008.0).collect();
    Map { width: 27, height: 51, channels, values }
}

#[test]
fn maps_survive_every_format() {
    let kept = tempfile::tempdir().unwrap();
    let folder = kept.path();
    for (name, kind, step) in [
        ("a.png", SampleKind::U8, 0.51 / 255.0),
        ("b.png", SampleKind::U16, 0.51 / 65535.0),
        ("c.tif", SampleKind::U16, 0.51 / 65535.0),
        ("d.tiff", SampleKind::F32, 0.0),
        ("e.exr", SampleKind::F32, 0.0),
    ] {
        for channels in [1, 3] {
            let map = ramp(channels);
            save_image(&folder.join(name), &map, kind).unwrap();
            let back = load_image(&folder.join(name)).unwrap();
            assert_eq!(back.kind, kind);
            let back = if channels == 1 { back.require_grey().unwrap() } else { back.require_rgb().unwrap() };
            assert_eq!((back.width, back.height, back.channels), (27, 51, channels), "{name}");
            for (a, b) in map.values.iter().zip(&back.values) {
                assert!((a - b).abs() <= step, "{name}: {a} {b}");
            }
        }
    }
    save_image(&folder.join("slopes.exr"), &ramp(2), SampleKind::F32).unwrap();
    assert_eq!(load_image(&folder.join("slopes.exr")).unwrap().map, ramp(2));
    let names = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    assert!(names.into_iter().all(|n| !n.contains(".part")));
}

#[test]
fn alpha_becomes_a_mask() {
    let kept = tempfile::tempdir().unwrap();
    let folder = kept.path();
    let file = folder.join("a.png");
    let image =
        image::RgbaImage::from_fn(4, 2, |x, _| image::Rgba([10, 20, 30, if x < 2 { 255 } else { 0 }]));
    image.save(&file).unwrap();
    let loaded = load_image(&file).unwrap();
    assert_eq!(loaded.map.channels, 3);
    assert_eq!(loaded.mask().mapped, [true, true, false, false, true, true, false, false]);
}

#[test]
fn errors_name_file_place_and_expectation() {
    let kept = tempfile::tempdir().unwrap();
    let folder = kept.path();
    let message = |e: ImageError| e.to_string();
    assert!(message(load_image(&folder.join("none.png")).unwrap_err()).contains("none.png"));
    std::fs::write(folder.join("text.png"), b"not an image").unwrap();
    assert!(message(load_image(&folder.join("text.png")).unwrap_err()).contains("not a readable image"));
    std::fs::write(folder.join("cut.exr"), [0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0, 9]).unwrap();
    assert!(load_image(&folder.join("cut.exr")).is_err());

    let mut bad = ramp(1);
    bad.values[27 + 3] = f32::NAN;
    save_image(&folder.join("nan.exr"), &bad, SampleKind::F32).unwrap();
    let loaded = load_image(&folder.join("nan.exr")).unwrap();
    let error = loaded.require_finite(&loaded.mask()).unwrap_err();
    assert!(message(error).contains("texel (3, 1): found [NaN]"));
    assert!(message(loaded.require_size(3, 4).unwrap_err()).contains("27x51"));
    save_image(&folder.join("color.png"), &ramp(3), SampleKind::U8).unwrap();
    let error = load_image(&folder.join("color.png")).unwrap().require_grey().unwrap_err();
    assert!(message(error).contains("a grey image"));
    assert!(message(save_image(&folder.join("a.gif"), &bad, SampleKind::U8).unwrap_err()).contains(".png"));
    assert!(
        message(save_image(&folder.join("a.png"), &bad, SampleKind::F32).unwrap_err()).contains("floats")
    );
}
