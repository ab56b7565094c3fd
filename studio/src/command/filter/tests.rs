use std::io::Write;

use super::*;
use exr::prelude::read_all_flat_layers_from_file;
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

/// Name of a part and of its channels.
type PartNames<'a> = (&'a str, &'a [&'a str]);

/// Parts with a name and channels, all of 31 x 17 texels and of this light, each channel at a scale of its own.
fn write_parts(path: &Path, parts: &[PartNames<'_>]) {
    use exr::prelude::*;
    let light = |i: usize| if white((i % 31) as u32, (i / 31) as u32) { 4.0 } else { 0.01 };
    let layers = parts.iter().map(|(part, names)| {
        let channel = |(c, name): (usize, &&str)| {
            let samples = (0..31 * 17).map(|i| light(i) * (c + 1) as f32).collect();
            AnyChannel::new(*name, FlatSamples::F32(samples))
        };
        let channels = AnyChannels::sort(names.iter().enumerate().map(channel).collect());
        Layer::new((31, 17), LayerAttributes::named(*part), Encoding::SMALL_LOSSLESS, channels)
    });
    let window = IntegerBounds::new(Vec2(0, 0), Vec2(31, 17));
    let image =
        Image { attributes: ImageAttributes::new(window), layer_data: layers.collect::<SmallVec<_>>() };
    image.write().to_file(path).unwrap();
}

#[test]
fn colours_of_an_exr_are_found_by_meaning_and_data_are_kept() {
    if !has_gpu() {
        return;
    }
    let folder = Folder::new();
    let target = folder.path("out.exr");
    let cases: [(&[PartNames<'_>], &[&str], bool); 5] = [
        (&[("", &["red", "green", "blue"])], &["red", "green", "blue"], false),
        (
            &[(
                "",
                &[
                    "View.Combined.R",
                    "View.Combined.G",
                    "View.Combined.B",
                    "View.Normal.X",
                    "View.Normal.Y",
                    "View.Normal.Z",
                    "Crypto00.R",
                    "Crypto00.G",
                    "Crypto00.B",
                ],
            )],
            &["View.Combined.R", "View.Combined.G", "View.Combined.B"],
            true,
        ),
        (&[("left", &["R", "G", "B"]), ("right", &["Y"])], &["R", "G", "B", "Y"], false),
        (&[("beauty", &["R", "G", "B"]), ("normals", &["r", "g", "b"])], &["R", "G", "B"], true),
        (
            &[("", &["V.DiffCol.R", "V.DiffCol.G", "V.DiffCol.B"])],
            &["V.DiffCol.R", "V.DiffCol.G", "V.DiffCol.B"],
            false,
        ),
    ];
    for (number, (parts, filtered, says)) in cases.into_iter().enumerate() {
        let input = folder.path(&format!("{number}.exr"));
        write_parts(&input, parts);
        let options = arguments(input.clone(), target.clone());
        let gpu = open_device(None).unwrap();
        let mut filters = Filters::new(&gpu, &options).unwrap();
        filters.file(&input, &target).unwrap();
        assert_eq!(filters.notes.len(), usize::from(says), "{parts:?}: {:?}", filters.notes);
        let [before, after] = [&input, &target].map(|path| read_all_flat_layers_from_file(path).unwrap());
        assert_eq!(before.layer_data.len(), after.layer_data.len());
        for (a, b) in before.layer_data.iter().zip(&after.layer_data) {
            assert_eq!(a.attributes, b.attributes);
            for (a, b) in a.channel_data.list.iter().zip(&b.channel_data.list) {
                let name = a.name.to_string();
                assert_eq!(name, b.name.to_string());
                let is_kept = a.sample_data == b.sample_data;
                assert_eq!(is_kept, !filtered.contains(&name.as_str()), "{parts:?}: {name}");
            }
        }
    }
    let input = folder.path("data.exr");
    write_parts(&input, &[("", &["N.x", "N.y", "N.z"])]);
    let failure = run(&arguments(input, target)).unwrap_err();
    assert!(failure.exit_code() == 2 && failure.to_string().contains("a layer of colours"), "{failure}");
}

#[test]
fn headers_of_an_exr_are_not_believed() {
    let folder = Folder::new();
    let input = folder.path("in.exr");
    write_parts(&input, &[("", &["R", "G", "B"])]);
    let limited = |limits| load_stored_exr(&input, &limits).map(drop).map_err(|e| e.to_string());
    assert_eq!(limited(Limits::default()), Ok(()));
    let small = Limits { pixels: 500, ..Limits::default() };
    assert!(limited(small).unwrap_err().contains("the limit on pixels"));
    let narrow = Limits { side: 30, ..Limits::default() };
    assert!(limited(narrow).unwrap_err().contains("the limit on sides"));
    let poor = Limits { bytes: 10_000, ..Limits::default() };
    assert!(limited(poor).unwrap_err().contains("the limit on memory"));
    // Each part fits, all do not.
    let colors: &[&str] = &["R", "G", "B"];
    write_parts(&input, &["a", "b", "c", "d", "e"].map(|name| (name, colors)));
    let few = Limits { bytes: 25_000, ..Limits::default() };
    assert!(limited(few).unwrap_err().contains("in all"));
}

#[test]
fn pictures_stand_upright_and_floats_are_refused() {
    if !has_gpu() {
        return;
    }
    let folder = Folder::new();
    // 3 x 2 texels in a PNG whose Exif says: turn by 90 degrees (6).
    let input = folder.path("turned.png");
    RgbImage::from_fn(3, 2, |x, y| Rgb([20 * x as u8, 20 * y as u8, 9])).save(&input).unwrap();
    let mut png = std::fs::read(&input).unwrap();
    let exif = b"eXIfII*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    let crc = !exif.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    });
    let chunk = [&(exif.len() as u32 - 4).to_be_bytes()[..], exif, &crc.to_be_bytes()].concat();
    png.splice(33..33, chunk);
    std::fs::write(&input, png).unwrap();
    let target = folder.path("out.png");
    let options = arguments(input.clone(), target.clone());
    let gpu = open_device(None).unwrap();
    let mut filters = Filters::new(&gpu, &options).unwrap();
    filters.file(&input, &target).unwrap();
    assert!(filters.notes[0].to_string().contains("turned.png"), "{:?}", filters.notes);
    let picture = image::open(&target).unwrap().to_rgb8();
    assert_eq!((picture.width(), picture.height()), (2, 3));
    // The top left corner of a picture turned clockwise was its bottom left one.
    assert_eq!(picture.get_pixel(0, 0).0, [0, 20, 9]);
    let float = folder.path("light.tif");
    DynamicImage::from(image::Rgb32FImage::new(4, 4)).save(&float).unwrap();
    let failure = filters.file(&float, &target).unwrap_err();
    assert!(failure.to_string().contains("found floats"), "{failure}");
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
    assert!(
        text.contains("empty.png: the file is empty") && text.contains("cut.png: not a readable image"),
        "{text}"
    );
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
