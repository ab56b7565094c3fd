use std::io::Write;

use super::*;
use image::{GrayAlphaImage, GrayImage, Rgb, RgbImage, RgbaImage};

/// A folder of its own for a test, removed at its end.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

fn has_gpu() -> bool {
    let found = !rubor::studio::adapters().is_empty();
    assert!(found || std::env::var_os("RUBOR_REQUIRE_GPU").is_none(), "RUBOR_REQUIRE_GPU is set: no adapter");
    if !found {
        writeln!(std::io::stderr(), "SKIPPED: no graphics adapter").expect("stderr is open");
    }
    found
}

fn arguments(input: PathBuf, output: PathBuf) -> Arguments {
    Arguments {
        method: Method::Smaa,
        input,
        output,
        mode: EdgeMode::Luma,
        preset: Quality::High,
        patterns: EdgePatterns::Revised,
        threshold: None,
        stage: Stage::Result,
        non_finite: NonFinite::Error,
        adapter: None,
        json: false,
    }
}

/// A flat stair of edges: white over black.
fn white(x: u32, y: u32) -> bool {
    y < 10 + x / 6
}

#[test]
fn depth_and_channels_of_png_are_kept() {
    if !has_gpu() {
        return;
    }
    let folder = Folder::new();
    let (width, height) = (37, 29);
    let v8 = |x, y| if white(x, y) { 255 } else { 10 };
    let v16 = |x, y| u16::from(v8(x, y)) * 257;
    let images: Vec<(&str, DynamicImage)> = vec![
        ("l8", GrayImage::from_fn(width, height, |x, y| image::Luma([v8(x, y)])).into()),
        ("la8", GrayAlphaImage::from_fn(width, height, |x, y| image::LumaA([v8(x, y), 200])).into()),
        ("rgb8", RgbImage::from_fn(width, height, |x, y| Rgb([v8(x, y), 7, v8(x, y)])).into()),
        ("rgba8", RgbaImage::from_fn(width, height, |x, y| image::Rgba([0, 0, 0, v8(x, y)])).into()),
        (
            "l16",
            DynamicImage::ImageLuma16(image::ImageBuffer::from_fn(width, height, |x, y| {
                image::Luma([v16(x, y)])
            })),
        ),
        (
            "rgb16",
            DynamicImage::ImageRgb16(image::ImageBuffer::from_fn(width, height, |x, y| {
                Rgb([v16(x, y), 515, 9])
            })),
        ),
    ];
    for (name, image) in &images {
        image.save(folder.path(&format!("{name}.png"))).unwrap();
    }
    run(&arguments(folder.0.path().to_owned(), folder.path("out"))).unwrap();
    for (name, before) in &images {
        let after = image::open(folder.path("out").join(format!("{name}.png"))).unwrap();
        assert_eq!(after.color(), before.color(), "{name}");
        let (a, b) = (after.to_rgba32f(), before.to_rgba32f());
        let changed: Vec<_> = a.enumerate_pixels().filter(|(x, y, p)| *p != b.get_pixel(*x, *y)).collect();
        assert!(changed.len() > 20, "{name}: {} pixels changed", changed.len());
        // Only pixels beside the stair, and to values between the two sides.
        for (x, y, pixel) in changed {
            assert!(y.abs_diff(10 + x / 6) <= 1, "{name}: ({x}, {y}) became {pixel:?}");
        }
    }
    // A black shape on nothing keeps its colour and gets soft alpha.
    let shape = image::open(folder.path("out").join("rgba8.png")).unwrap().to_rgba8();
    assert!(shape.pixels().all(|p| p.0[..3] == [0, 0, 0]));
    assert!(shape.pixels().any(|p| p.0[3] > 20 && p.0[3] < 240));
}

#[test]
fn palettes_become_colours() {
    if !has_gpu() {
        return;
    }
    let folder = Folder::new();
    // 8 x 2 pixels of one bit: index 0 is red, index 1 is blue.
    let mut bytes = vec![0x89, b'P', b'N', b'G', 13, 10, 26, 10];
    let mut chunk = |kind: &[u8; 4], data: &[u8]| {
        bytes.extend((data.len() as u32).to_be_bytes());
        let body = [kind.as_slice(), data].concat();
        let crc = !body.iter().fold(!0u32, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
        });
        bytes.extend(&body);
        bytes.extend(crc.to_be_bytes());
    };
    chunk(b"IHDR", &[0, 0, 0, 8, 0, 0, 0, 2, 1, 3, 0, 0, 0]);
    chunk(b"PLTE", &[255, 0, 0, 0, 0, 255]);
    // A stored deflate block: filter byte and one byte for each row.
    let rows = [0, 0b0000_1111, 0, 0b0000_1111];
    let (a, b) = rows.iter().fold((1u32, 0u32), |(a, b), v| (a + v, a + v + b));
    let mut data = vec![0x78, 1, 1, 4, 0, 0xfb, 0xff];
    data.extend(rows.map(|v| v as u8));
    data.extend((b << 16 | a).to_be_bytes());
    chunk(b"IDAT", &data);
    chunk(b"IEND", &[]);
    std::fs::write(folder.path("in.png"), &bytes).unwrap();
    run(&arguments(folder.path("in.png"), folder.path("out.png"))).unwrap();
    let out = image::open(folder.path("out.png")).unwrap();
    assert_eq!(out.color(), ColorType::Rgb8);
    assert_eq!(out.to_rgb8().get_pixel(0, 0).0, [255, 0, 0]);
    assert_eq!(out.to_rgb8().get_pixel(7, 1).0, [0, 0, 255]);
}

fn write_exr(path: &Path, value: impl Fn(u32, u32) -> f32 + Sync) {
    use exr::prelude::*;
    let (width, height) = (31, 17);
    let color = |y: usize, x: usize| value(x as u32, y as u32);
    let samples = |scale: f32| {
        FlatSamples::F32((0..width * height).map(|i| scale * color(i / width, i % width)).collect())
    };
    let channels = AnyChannels::sort(
        [("R", 1.0), ("G", 1.0), ("B", 1.0), ("Z", 3.0)]
            .into_iter()
            .map(|(name, scale)| AnyChannel::new(name, samples(scale)))
            .collect(),
    );
    Image::from_channels((width, height), channels).write().to_file(path).unwrap();
}

#[test]
fn exr_keeps_other_channels_and_light_over_one() {
    if !has_gpu() {
        return;
    }
    let folder = Folder::new();
    let (input, target) = (folder.path("in.exr"), folder.path("out.exr"));
    write_exr(&input, |x, y| if white(x, y) { 4.0 } else { 0.01 });
    run(&arguments(input.clone(), target.clone())).unwrap();
    let read = |path: &Path, name: &str| -> Vec<f32> {
        let image = read_all_flat_layers_from_file(path).unwrap();
        let layer = &image.layer_data[0];
        let channel = layer.channel_data.list.iter().find(|channel| channel.name.eq(name)).unwrap();
        channel.sample_data.values_as_f32().collect()
    };
    assert_eq!(read(&input, "Z"), read(&target, "Z"));
    let (before, after) = (read(&input, "G"), read(&target, "G"));
    assert!(after.iter().any(|v| *v > 0.1 && *v < 3.9));
    assert!(after.iter().all(|v| (0.01..=4.0).contains(v)));
    assert!(before.iter().zip(&after).filter(|(a, b)| a != b).count() < 150);
}

#[test]
fn values_that_are_no_numbers_are_reported_or_replaced() {
    if !has_gpu() {
        return;
    }
    let folder = Folder::new();
    let (input, target) = (folder.path("in.exr"), folder.path("out.exr"));
    write_exr(&input, |x, y| if (x, y) == (5, 3) { f32::NAN } else { 0.5 });
    let failure = run(&arguments(input.clone(), target.clone())).unwrap_err();
    assert_eq!(failure.exit_code(), 2);
    assert!(failure.to_string().contains("red is NaN at pixel (5, 3)"), "{failure}");
    assert!(!target.exists());
    run(&Arguments { non_finite: NonFinite::Zero, ..arguments(input, target.clone()) }).unwrap();
    let image = read_all_flat_layers_from_file(&target).unwrap();
    let colors = image.layer_data[0].channel_data.list.iter().filter(|channel| !channel.name.eq("Z"));
    assert!(colors.flat_map(|channel| channel.sample_data.values_as_f32()).all(f32::is_finite));
}

#[test]
fn folders_of_mixed_sizes_and_bad_files() {
    if !has_gpu() {
        return;
    }
    let folder = Folder::new();
    for (name, width, height) in [("a.png", 1, 1), ("b.png", 1, 9), ("c.png", 64, 5)] {
        RgbImage::from_fn(width, height, |x, _| Rgb([x as u8, 3, 0])).save(folder.path(name)).unwrap();
    }
    std::fs::write(folder.path("notes.txt"), "not an image").unwrap();
    let target = folder.path("out");
    run(&arguments(folder.0.path().to_owned(), target.clone())).unwrap();
    assert_eq!(std::fs::read_dir(&target).unwrap().count(), 3);
    std::fs::write(folder.path("empty.png"), "").unwrap();
    std::fs::write(folder.path("cut.png"), [0x89, b'P', b'N', b'G', 13, 10, 26, 10, 0, 0]).unwrap();
    let failure = run(&arguments(folder.0.path().to_owned(), target)).unwrap_err();
    let text = failure.to_string();
    assert!(text.contains("2 of 5 images failed"), "{text}");
    assert!(text.contains("empty.png: the file is empty") && text.contains("cut.png: cannot read"), "{text}");
}

#[test]
fn wrong_names_are_refused() {
    let folder = Folder::new();
    RgbImage::new(2, 2).save(folder.path("a.png")).unwrap();
    let message = |input: &str, output: &str| {
        let failure = run(&arguments(folder.path(input), folder.path(output))).unwrap_err();
        assert_eq!(failure.exit_code(), 2);
        failure.to_string()
    };
    assert!(message("missing.png", "b.png").contains("there is no such file"));
    assert!(message("a.png", "b.gif").contains("expected a name that ends in .png"));
    assert!(message("a.png", "b.exr").contains("expected a name that ends in .png"));
    std::fs::create_dir(folder.path("none")).unwrap();
    assert!(message("none", "out").contains("no images here"));
}

#[test]
fn stages_are_pictures() {
    if !has_gpu() {
        return;
    }
    let folder = Folder::new();
    let image = GrayImage::from_fn(40, 30, |x, y| image::Luma([if white(x, y) { 255 } else { 0 }]));
    image.save(folder.path("in.png")).unwrap();
    for stage in [Stage::Edges, Stage::Weights] {
        let target = folder.path("stage.png");
        run(&Arguments { stage, ..arguments(folder.path("in.png"), target.clone()) }).unwrap();
        let picture = image::open(target).unwrap().to_rgba8();
        for (x, y, pixel) in picture.enumerate_pixels() {
            // The pixel above this one is white and this one is black: its top edge.
            let top = y > 0 && white(x, y - 1) && !white(x, y);
            let left = x > 0 && white(x - 1, y) != white(x, y);
            match stage {
                Stage::Edges => assert_eq!(pixel.0[..2], [u8::from(left) * 255, u8::from(top) * 255]),
                _ => assert!(top || left || pixel.0 == [0; 4], "({x}, {y}) is {pixel:?}"),
            }
        }
        assert!(picture.pixels().any(|p| p.0[..2] != [0, 0]));
    }
}

#[test]
fn methods_for_moving_pictures_are_refused_by_name() {
    assert_eq!(parse_method("smaa"), Ok(Method::Smaa));
    assert_eq!(parse_method("smaa-1x"), Ok(Method::Smaa));
    assert_eq!(parse_method("mlaa"), Ok(Method::Mlaa));
    for (name, needs) in [
        ("smaa-t2x", "frame before"),
        ("smaa-4x", "frame before"),
        ("smaa-s2x", "samples"),
        ("ssaa:4", "samples"),
    ] {
        let message = parse_method(name).unwrap_err();
        assert!(message.contains("does not exist for stills") && message.contains(needs), "{message}");
    }
    assert!(parse_method("fxaa").unwrap_err().contains("expected smaa or mlaa"));
}

#[test]
fn published_patterns_give_other_pixels() {
    if !has_gpu() {
        return;
    }
    let folder = Folder::new();
    let stairs = GrayImage::from_fn(40, 40, |x, y| image::Luma([if y < 10 + x { 255 } else { 0 }]));
    stairs.save(folder.path("in.png")).unwrap();
    let filtered = |patterns, name: &str| {
        run(&Arguments { patterns, ..arguments(folder.path("in.png"), folder.path(name)) }).unwrap();
        image::open(folder.path(name)).unwrap().into_luma8()
    };
    let [ours, theirs] =
        [filtered(EdgePatterns::Revised, "a.png"), filtered(EdgePatterns::Published, "b.png")];
    assert!(ours != stairs && theirs != stairs && ours != theirs);
}
