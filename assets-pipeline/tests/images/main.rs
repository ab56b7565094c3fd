//! Images as other programs write them: accepted, refused and noted cases.

use std::path::{Path, PathBuf};

use files::{
    Part, Tiff, exif, exr, exr_parts, jpeg, jpeg_with_exif, part, png, png_chunk, png_with_chunk, rgb,
};
use image::ExtendedColorType;
use rubor_assets::convert::normals::{GreenAxis, slopes_of};
use rubor_assets::environment;
use rubor_assets::image_io::{
    Limits, LoadedImage, Purpose, ReadOptions, decode_image, decode_stored, load_image, load_image_with,
    load_picture,
};

mod files;
mod mutations;
mod table;

fn decode(bytes: &[u8], options: &ReadOptions) -> Result<LoadedImage, String> {
    decode_image(Path::new("file"), bytes, options).map_err(|e| e.to_string())
}

fn read(bytes: &[u8]) -> LoadedImage {
    decode(bytes, &ReadOptions::default()).expect("a readable image")
}

fn layer(name: &str) -> ReadOptions {
    ReadOptions { layer: Some(name.into()), ..ReadOptions::default() }
}

/// Value of channel c: tells channels, columns and rows apart.
fn value(c: usize, x: usize, y: usize) -> f32 {
    c as f32 + 0.01 * x as f32 + 0.0001 * y as f32
}

const SIZE: [usize; 2] = [5, 4];

#[test]
fn exr_channels_go_by_meaning() {
    let plain = read(&exr(&["R", "G", "B"], SIZE, value));
    assert_eq!(plain.map.texel(2, 1), [0, 1, 2].map(|c| value(c, 2, 1)));
    for names in [
        ["ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B"],
        [".R", ".G", ".B"],
        ["red", "green", "blue"],
        ["x", "y", "z"],
        ["ViewLayer.Normal.X", "ViewLayer.Normal.Y", "ViewLayer.Normal.Z"],
        ["N.x", "N.y", "N.z"],
    ] {
        let image = read(&exr(&names, SIZE, value));
        assert_eq!(image.map, plain.map, "{names:?}");
        assert!(image.notes.is_empty(), "{names:?}: {:?}", image.notes);
    }
    let slopes = read(&exr(&["R", "G"], SIZE, value));
    assert_eq!((slopes.map.channels, slopes.map.texel(0, 0)), (2, &[0.0, 1.0][..]));
    let grey = read(&exr(&["melanin"], SIZE, value));
    assert_eq!(grey.map.channels, 1);
    let message = decode(&exr(&["melanin", "hemoglobin"], SIZE, value), &ReadOptions::default()).unwrap_err();
    assert!(message.contains("hemoglobin, melanin") && message.contains("name a channel"), "{message}");
}

#[test]
fn exr_layers_are_chosen_by_name_or_with_a_note() {
    let names = [
        "View.Combined.R",
        "View.Combined.G",
        "View.Combined.B",
        "View.Combined.A",
        "View.Normal.X",
        "View.Normal.Y",
        "View.Normal.Z",
        "View.Depth.Z",
    ];
    let bytes = exr(&names, SIZE, value);
    let combined = read(&bytes);
    assert_eq!(combined.map.texel(0, 0), [0.0, 1.0, 2.0]);
    assert_eq!(combined.alpha.as_ref().unwrap().texel(1, 0), [3.01]);
    assert!(combined.notes[0].contains("View.Combined") && combined.notes[0].contains("View.Normal"));
    let normals =
        decode(&bytes, &ReadOptions { purpose: Purpose::Normals, ..ReadOptions::default() }).unwrap();
    assert_eq!(normals.map.texel(0, 0), [4.0, 5.0, 6.0]);
    assert!(
        normals.alpha.is_none() && normals.notes[0].contains("layer View.Normal was taken"),
        "{:?}",
        normals.notes
    );
    for name in ["normal", "View.Normal", "VIEW.NORMAL"] {
        let image = decode(&bytes, &layer(name)).unwrap();
        assert_eq!(image.map.texel(0, 0), [4.0, 5.0, 6.0], "{name}");
        assert!(image.notes.is_empty(), "{:?}", image.notes);
    }
    assert_eq!(decode(&bytes, &layer("View.Depth.Z")).unwrap().map.texel(0, 0), [7.0]);
    assert_eq!(decode(&bytes, &layer("View.Normal.Y")).unwrap().map.texel(0, 0), [5.0]);
    let message = decode(&bytes, &layer("shadow")).unwrap_err();
    assert!(message.contains("shadow") && message.contains("\"View.Combined\", \"View.Depth\""), "{message}");
    let two = exr(&["A.N.X", "A.N.Y", "A.N.Z", "B.N.X", "B.N.Y", "B.N.Z"], SIZE, value);
    assert!(decode(&two, &layer("n")).unwrap_err().contains("one layer only"));
    assert_eq!(decode(&two, &layer("b.n")).unwrap().map.texel(0, 0), [3.0, 4.0, 5.0]);
    let with_depth = read(&exr(&["R", "G", "B", "Z"], SIZE, value));
    assert!(with_depth.notes[0].contains("not read: Z"), "{:?}", with_depth.notes);
    let png = png(&rgb(3, 2), 3, 2, ExtendedColorType::Rgb8);
    assert!(decode(&png, &layer("normal")).unwrap_err().contains("no name of a layer"));
}

#[test]
fn exr_parts_are_chosen_by_name_or_with_a_note() {
    let parts = [
        part(Some("beauty"), &["R", "G", "B"], SIZE, value),
        part(Some("normals"), &["R", "G", "B"], SIZE, |c, x, y| 10.0 + value(c, x, y)),
    ];
    let bytes = exr_parts(&parts, ([0, 0], SIZE));
    let first = read(&bytes);
    assert_eq!(first.map.texel(0, 0), [0.0, 1.0, 2.0]);
    assert!(
        first.notes[0].contains("layer beauty") && first.notes[0].contains("normals"),
        "{:?}",
        first.notes
    );
    assert_eq!(decode(&bytes, &layer("normals")).unwrap().map.texel(0, 0), [10.0, 11.0, 12.0]);
    let by_purpose =
        decode(&bytes, &ReadOptions { purpose: Purpose::Normals, ..ReadOptions::default() }).unwrap();
    assert_eq!(by_purpose.map.texel(0, 0), [10.0, 11.0, 12.0]);
    assert!(by_purpose.notes[0].contains("layer normals"));
}

#[test]
fn exr_windows_give_the_display_window() {
    let at = |position: [i32; 2], size: [usize; 2], display: ([i32; 2], [usize; 2])| {
        let data = Part { position, ..part(None, &["R", "G", "B"], size, value) };
        decode(&exr_parts(&[data], display), &ReadOptions::default())
    };
    let cropped = at([3, 2], [4, 3], ([0, 0], [9, 8])).unwrap();
    assert_eq!((cropped.map.width, cropped.map.height), (9, 8));
    assert_eq!(cropped.map.texel(3, 2), [0.0, 1.0, 2.0]);
    assert_eq!(cropped.map.texel(6, 4)[0], value(0, 3, 2));
    assert_eq!(cropped.map.texel(7, 4), [0.0; 3]);
    assert_eq!(cropped.mask().count(), 12);
    assert!(cropped.notes[0].contains("4x3 texels of data at (3, 2) of 9x8"), "{:?}", cropped.notes);
    let overscan = at([-2, -1], [12, 10], ([0, 0], [8, 7])).unwrap();
    assert_eq!((overscan.map.width, overscan.map.height), (8, 7));
    assert_eq!(overscan.map.texel(0, 0)[0], value(0, 2, 1));
    assert!(overscan.alpha.is_none() && overscan.notes[0].contains("left out"));
    let moved = at([-5, 7], [4, 3], ([-5, 7], [4, 3])).unwrap();
    assert!(moved.notes.is_empty() && moved.map.texel(0, 0)[0] == 0.0);
    assert!(at([30, 0], [4, 3], ([0, 0], [9, 8])).unwrap_err().contains("within the display window"));
}

#[test]
fn subsampled_and_luminance_chroma_exr_are_refused() {
    let mut bytes = exr(&["Y", "BY", "RY"], [4, 4], value);
    // Name, sample type and a flag with padding stand before the two sampling rates (OpenEXR, "chlist").
    let at = bytes.windows(3).position(|w| w == b"BY\0").unwrap() + 3 + 8;
    bytes[at] = 2;
    bytes[at + 4] = 2;
    let message = decode(&bytes, &ReadOptions::default()).unwrap_err();
    assert!(message.contains("subsampling") || message.contains("resolution"), "{message}");
}

#[test]
fn signed_normals_of_an_exr_give_their_slopes() {
    let normal = |c: usize, x: usize, y: usize| {
        let s = [0.3 * (x as f32 / 6.0).sin(), 0.2 * (y as f32 / 5.0).cos()];
        let z = 1.0 / (s[0] * s[0] + s[1] * s[1] + 1.0).sqrt();
        [s[0] * z, s[1] * z, z][c]
    };
    let slopes = |bytes: &[u8]| slopes_of(&read(bytes), GreenAxis::OpenGl).unwrap();
    let (codes, notes) = slopes(&exr(&["R", "G", "B"], [64, 48], move |c, x, y| 0.5 + 0.5 * normal(c, x, y)));
    assert!(notes.is_empty() && (0.2..0.31).contains(&codes.largest), "{}", codes.largest);
    let (signed, notes) =
        slopes(&exr(&["View.Normal.X", "View.Normal.Y", "View.Normal.Z"], [64, 48], normal));
    assert!(notes[0].contains("-1 to 1"));
    for (a, b) in codes.map.values.iter().zip(&signed.map.values) {
        assert!((a - b).abs() < 1e-6);
    }
    let grey = exr(&["Y"], [64, 48], |_, x, _| x as f32 / 64.0);
    assert!(slopes_of(&read(&grey), GreenAxis::OpenGl).unwrap_err().to_string().contains("grey picture"));
}

/// Bytes of floats 0, 1, 2, ...
fn floats(count: usize) -> Vec<u8> {
    (0..count).flat_map(|i| (i as f32).to_le_bytes()).collect()
}

#[test]
fn tiff_of_any_sample_type_is_read() {
    let grey = Tiff::GREY_F32;
    let image = read(&grey.bytes(&floats(12)));
    assert_eq!((image.map.channels, image.map.texel(1, 2)), (1, &[9.0][..]));
    assert!(image.alpha.is_none() && image.notes.is_empty());
    let doubles: Vec<u8> = (0..12).flat_map(|i| f64::from(i).to_le_bytes()).collect();
    assert_eq!(read(&Tiff { bits: 64, ..grey }.bytes(&doubles)).map, image.map);
    let halves: Vec<u8> = (0..12).flat_map(|i| half::f16::from_f32(i as f32).to_le_bytes()).collect();
    assert_eq!(read(&Tiff { bits: 16, ..grey }.bytes(&halves)).map, image.map);
    let whole: Vec<u8> = (0..12u32).flat_map(|i| (i * (u32::MAX / 11)).to_le_bytes()).collect();
    assert_eq!(read(&Tiff { format: 1, ..grey }.bytes(&whole)).map.texel(3, 2), [1.0]);
    assert!(
        decode(&Tiff { format: 2, ..grey }.bytes(&whole), &ReadOptions::default())
            .unwrap_err()
            .contains("signed")
    );

    let rgb = Tiff { samples: 3, photometric: 2, ..grey };
    let colors = read(&rgb.bytes(&floats(36)));
    assert_eq!(colors.map.texel(1, 0), [3.0, 4.0, 5.0]);
    let planes = read(&Tiff { planar: true, ..rgb }.bytes(&floats(36)));
    assert_eq!(planes.map.texel(1, 0), [1.0, 13.0, 25.0]);
    let with_alpha = read(&Tiff { samples: 2, extra: &[2], ..grey }.bytes(&floats(24)));
    assert_eq!((with_alpha.map.channels, with_alpha.map.texel(1, 0)), (1, &[2.0][..]));
    assert_eq!(with_alpha.alpha.unwrap().texel(1, 0), [3.0]);
    let rgba = read(&Tiff { samples: 4, extra: &[2], ..rgb }.bytes(&floats(48)));
    assert_eq!((rgba.map.texel(1, 0), rgba.alpha.unwrap().texel(1, 0)), (&[4.0, 5.0, 6.0][..], &[7.0][..]));
    let four = Tiff { samples: 4, extra: &[0, 0, 0], ..grey }.bytes(&floats(48));
    assert!(decode(&four, &ReadOptions::default()).unwrap_err().contains("4 samples per texel"));
    let slopes = read(&Tiff { samples: 2, extra: &[0], ..grey }.bytes(&floats(24)));
    assert_eq!((slopes.map.channels, slopes.map.texel(1, 0)), (2, &[2.0, 3.0][..]));
    let pages = read(&Tiff { more_pages: true, ..grey }.bytes(&floats(12)));
    assert!(pages.notes[0].contains("several pages"));
    let turned = read(&Tiff { orientation: 3, ..grey }.bytes(&floats(12)));
    assert_eq!(turned.map.texel(0, 0), [11.0]);
    assert!(turned.notes[0].contains("orientation 3"));
    let inverse = read(&Tiff { photometric: 0, bits: 8, format: 1, ..grey }.bytes(&[255; 12]));
    assert_eq!(inverse.map.texel(0, 0), [0.0]);
    // As a picture: floats of grey become three equal channels.
    let kept = tempfile::tempdir().unwrap();
    let file = kept.path().join("grey.tif");
    std::fs::write(&file, grey.bytes(&floats(12))).unwrap();
    let picture = load_picture(&file, &Limits::default()).unwrap().image;
    assert_eq!(picture.to_rgb32f().get_pixel(1, 2).0, [9.0; 3]);
}

#[test]
fn exif_orientation_is_applied_once_in_every_kind_of_file() {
    let (w, h) = (6, 4);
    let plain = png(&rgb(w, h), w, h, ExtendedColorType::Rgb8);
    let chunk = |data: &[u8]| png_chunk(b"eXIf", data);
    let prefixed = |o| [b"Exif\0\0".to_vec(), exif(o)].concat();
    let tiff = Tiff { size: [w, h], samples: 3, bits: 8, format: 1, photometric: 2, ..Tiff::GREY_F32 };
    for orientation in 1..=8u8 {
        let mut upright = image::DynamicImage::from(image::RgbImage::from_raw(w, h, rgb(w, h)).unwrap());
        upright.apply_orientation(image::metadata::Orientation::from_exif(orientation).unwrap());
        let files = [
            ("jpg", jpeg_with_exif(&jpeg(&rgb(w, h), w, h), &exif(orientation)), 3),
            ("png", png_with_chunk(&plain, &chunk(&exif(orientation)), false), 0),
            ("late.png", png_with_chunk(&plain, &chunk(&exif(orientation)), true), 0),
            ("prefixed.png", png_with_chunk(&plain, &chunk(&prefixed(orientation)), false), 0),
            ("webp", files::webp(&rgb(w, h), w, h, Some(exif(orientation))), 0),
            ("tif", Tiff { orientation: orientation.into(), ..tiff }.bytes(&rgb(w, h)), 0),
        ];
        let folder = tempfile::tempdir().unwrap();
        for (name, bytes, tolerance) in files {
            let file = folder.path().join(name);
            std::fs::write(&file, &bytes).unwrap();
            let picture = load_picture(&file, &Limits::default()).unwrap();
            assert_eq!(picture.notes.is_empty(), orientation == 1, "{name} {:?}", picture.notes);
            let image = load_image(&file).unwrap();
            assert_eq!((image.map.width, image.map.height), (upright.width(), upright.height()), "{name}");
            let pixels = picture.image.to_rgb8();
            let values = image.map.values.iter().map(|v| (v * 255.0).round() as i32);
            for ((a, b), v) in pixels.as_raw().iter().zip(upright.as_bytes()).zip(values) {
                assert!(a.abs_diff(*b) <= tolerance && v == i32::from(*a), "{name} {orientation}");
            }
            if name != "tif" {
                let stored = decode_stored(&file, &bytes, &Limits::default()).unwrap();
                assert_eq!((stored.width(), stored.height()), (w, h), "{name} as stored");
            }
        }
    }
}

#[test]
fn cut_and_moving_pictures_are_told() {
    let jpeg = jpeg(&rgb(20, 20), 20, 20);
    for cut in [jpeg.len() - 2, jpeg.len() / 2] {
        assert!(decode(&jpeg[..cut], &ReadOptions::default()).unwrap_err().contains("cut"));
    }
    let plain = png(&rgb(6, 4), 6, 4, ExtendedColorType::Rgb8);
    assert!(decode(&plain[..plain.len() - 20], &ReadOptions::default()).is_err());
    let moving = png_with_chunk(&plain, &png_chunk(b"acTL", &[0, 0, 0, 1, 0, 0, 0, 0]), false);
    assert!(read(&moving).notes[0].contains("first frame"));
}

#[test]
fn claims_of_headers_are_not_believed_by_any_entry_point() {
    let folder = tempfile::tempdir().unwrap();
    let plain = png(&rgb(6, 4), 6, 4, ExtendedColorType::Rgb8);
    let huge = Tiff { size: [60000, 60000], ..Tiff::GREY_F32 };
    let mut exr_claim = exr(&["R", "G", "B"], SIZE, value);
    for name in [&b"dataWindow\0box2i\0"[..], b"displayWindow\0box2i\0"] {
        let at = exr_claim.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4 + 8;
        exr_claim[at..at + 4].copy_from_slice(&59999i32.to_le_bytes());
        exr_claim[at + 4..at + 8].copy_from_slice(&59999i32.to_le_bytes());
    }
    let mut jpeg_claim = jpeg(&rgb(8, 8), 8, 8);
    let at = jpeg_claim.windows(2).position(|w| w == [0xff, 0xc0]).unwrap() + 5;
    jpeg_claim[at..at + 4].copy_from_slice(&[0xea, 0x60, 0xea, 0x60]);
    let small = Limits { pixels: 20, ..Limits::default() };
    for (name, claim) in [
        ("a.png", files::png_claiming(&plain, 60000, 60000)),
        ("a.tif", huge.bytes(&floats(12))),
        ("a.hdr", b"#?RGBE\n\n-Y 60000 +X 60000\n\x01\x02\x03\x80".to_vec()),
        ("a.exr", exr_claim),
        ("a.jpg", jpeg_claim),
    ] {
        let file = folder.path().join(name);
        std::fs::write(&file, &claim).unwrap();
        let results = [
            load_image(&file).map(drop),
            load_image_with(&file, &ReadOptions { limits: small, ..ReadOptions::default() }).map(drop),
            environment::read(&file, &ReadOptions::default()).map(drop),
            if name == "a.exr" { load_image(&file).map(drop) } else { load_picture(&file, &small).map(drop) },
        ];
        for result in results {
            let message = result.unwrap_err().to_string();
            // The EXR crate compares the count of blocks with the size before we see it.
            assert!(message.contains("the limit on") || message.contains("chunk"), "{name}: {message}");
        }
        assert!(decode_stored(&file, &claim, &small).is_err());
    }
    // An honest file beyond a limit that was set.
    let file = folder.path().join("honest.png");
    std::fs::write(&file, &plain).unwrap();
    assert!(load_picture(&file, &small).unwrap_err().to_string().contains("the limit on pixels"));
    assert!(load_picture(&file, &Limits { pixels: 24, ..small }).is_ok());
    for tight in [Limits { bytes: 20, ..Limits::default() }, Limits { side: 5, ..Limits::default() }] {
        assert!(load_picture(&file, &tight).is_err());
    }
    if Path::new("/dev/zero").exists() {
        assert!(load_image(Path::new("/dev/zero")).unwrap_err().to_string().contains("device"));
    }
    assert!(load_image(folder.path()).unwrap_err().to_string().contains("a folder"));
}

#[test]
fn environments_are_radiance_from_every_kind_of_file() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str, bytes: &[u8]| {
        let file = folder.path().join(name);
        std::fs::write(&file, bytes).unwrap();
        environment::read(&file, &ReadOptions::default()).map_err(|e| e.to_string())
    };
    // 0.75 = 192 / 256, the exponent 128 is 2^0.
    let flat =
        read("a.hdr", &files::radiance("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", 64, 32, [192, 96, 48, 128]));
    let (flat, notes) = flat.unwrap();
    assert_eq!((flat.width, flat.height), (64, 32));
    assert_eq!(flat.texels[77].to_array(), [0.75, 0.375, 0.1875]);
    assert!(notes.is_empty());
    let rgbe = read("b.hdr", &files::radiance("#?RGBE\n", 64, 32, [192, 96, 48, 128])).unwrap();
    assert_eq!(rgbe.0, flat);
    let exposed = read("c.hdr", &files::radiance("#?RADIANCE\nEXPOSURE=2\n", 64, 32, [192, 96, 48, 129]));
    let (exposed, notes) = exposed.unwrap();
    assert_eq!(exposed, flat);
    assert!(notes[0].contains("EXPOSURE"));
    let light = |c: usize, _: usize, _: usize| [0.75, 0.375, 0.1875][c];
    let (exr_map, notes) = read("d.exr", &exr(&["R", "G", "B"], [64, 32], light)).unwrap();
    assert_eq!(exr_map, flat);
    assert!(notes.is_empty());
    let (layered, notes) = read(
        "e.exr",
        &exr(&["L.Combined.R", "L.Combined.G", "L.Combined.B", "L.Depth.Z"], [64, 32], |c, x, y| {
            if c < 3 { [0.75, 0.375, 0.1875][c] } else { value(c, x, y) }
        }),
    )
    .unwrap();
    assert_eq!(layered, flat);
    assert_eq!(notes.len(), 1);
    let codes = [128, 64, 255].repeat(64 * 32);
    let (low, notes) = read("f.png", &png(&codes, 64, 32, ExtendedColorType::Rgb8)).unwrap();
    assert!((low.texels[0].x - 0.21586).abs() < 1e-4 && low.texels[0].z == 1.0, "{}", low.texels[0]);
    assert!(notes[0].contains("low dynamic range"));

    let (square, notes) = read("g.exr", &exr(&["R", "G", "B"], [32, 32], light)).unwrap();
    assert_eq!(square.width, 32);
    assert!(notes[0].contains("twice as wide"));
    let ringing = move |c: usize, x: usize, y: usize| if (x, y) == (3, 4) { -0.001 } else { light(c, x, y) };
    let (repaired, notes) = read("h.exr", &exr(&["R", "G", "B"], [64, 32], ringing)).unwrap();
    assert_eq!(repaired.texels[4 * 64 + 3].to_array(), [0.0; 3]);
    assert!(notes[0].contains("3 slightly negative"), "{notes:?}");
    for bad in [f32::NAN, f32::INFINITY, -0.5] {
        let broken = move |c: usize, x: usize, y: usize| if (x, y) == (3, 4) { bad } else { light(c, x, y) };
        let message = read("i.exr", &exr(&["R", "G", "B"], [64, 32], broken)).unwrap_err();
        assert!(message.contains("texel (3, 4)") && message.contains("finite"), "{message}");
    }
    for size in ["-Y 0 +X 64", "-Y 32 +X 0"] {
        let message = read("j.hdr", format!("#?RADIANCE\n\n{size}\n").as_bytes()).unwrap_err();
        assert!(message.contains("at least 1"), "{message}");
    }
    let cube = Part { is_cube_map: true, ..part(None, &["R", "G", "B"], [8, 48], light) };
    let cube = exr_parts(&[cube], ([0, 0], [8, 48]));
    let message = read("k.exr", &cube).unwrap_err();
    assert!(message.contains("cube map"), "{message}");
}

/// The cases of the shared folder; none of their bytes are in the repository.
#[test]
fn shared_cases_give_their_right_results() {
    let Some(shared) = std::env::var_os("RUBOR_SHARED").map(PathBuf::from) else {
        eprintln!("SKIPPED: RUBOR_SHARED names no folder, so the shared images are not read");
        return;
    };
    let images = shared.join("cases/images");
    let normals = ReadOptions { purpose: Purpose::Normals, ..ReadOptions::default() };
    let slopes = |name: &str| {
        let image = load_image_with(&images.join(name), &normals).map_err(|e| e.to_string())?;
        let notes = image.notes.clone();
        let (slopes, more) = slopes_of(&image, GreenAxis::OpenGl).map_err(|e| e.to_string())?;
        Ok::<_, String>((slopes, [notes, more].concat()))
    };
    let (plain, notes) = slopes("plain.exr").unwrap();
    assert!(notes.is_empty());
    for name in ["blender-combined", "vray-dot", "names-long", "blender-normal", "xyz", "multipart"] {
        let (found, notes) = slopes(&format!("{name}.exr")).unwrap();
        let error = found.map.values.iter().zip(&plain.map.values).map(|(a, b)| (a - b).abs());
        let error = error.fold(0.0, f32::max);
        assert!(error < 1e-5, "{name}: {error} {notes:?}");
    }
    for (name, size) in [("datawindow-cropped.exr", (64, 48)), ("datawindow-overscan.exr", (48, 32))] {
        let (found, notes) = slopes(name).unwrap();
        assert_eq!((found.map.width, found.map.height), size, "{name}");
        assert!(notes[0].contains("texels of data"), "{notes:?}");
    }
    for name in ["y-only.exr", "height-grey.png"] {
        assert!(slopes(name).unwrap_err().contains("grey picture"), "{name}");
    }
    assert_eq!(load_image(&images.join("greyf32.tif")).unwrap().map.channels, 1);
    for (name, size) in [("exif6.jpg", (40, 64)), ("exif6.png", (40, 64)), ("exif3.tif", (64, 40))] {
        let picture = load_picture(&images.join(name), &Limits::default()).unwrap();
        assert_eq!((picture.image.width(), picture.image.height()), size, "{name}");
        assert!(picture.notes[0].contains("orientation"), "{name}");
    }
    let env = |name: &str| environment::read(&shared.join("cases/env").join(name), &ReadOptions::default());
    let flat = env("flat.hdr").unwrap().0;
    for name in ["plain.exr", "rgbe-head.hdr", "exposure2.hdr"] {
        let (found, _) = env(name).unwrap();
        for (a, b) in found.texels.iter().zip(&flat.texels) {
            // A step of the shared exponent of the brightest channel, 1.5.
            assert!(a.abs_diff_eq(*b, 2.0 / 256.0), "{name}: {a} {b}");
        }
    }
    assert!(env("ldr.png").unwrap().1[0].contains("low dynamic range"));
}
