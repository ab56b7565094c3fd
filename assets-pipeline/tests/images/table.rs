//! The table of `docs/interchange.md` is what the readers do. `RUBOR_UPDATE_DOCS=1` writes it.

use std::path::Path;

use image::ExtendedColorType;
use rubor_assets::convert::normals::{GreenAxis, slopes_of};
use rubor_assets::environment;
use rubor_assets::image_io::{Limits, Purpose, ReadOptions, load_image_with, load_picture};

use crate::files::{
    Part, Tiff, exif, exr, exr_parts, jpeg, jpeg_with_exif, part, png, png_chunk, png_claiming,
    png_with_chunk, radiance, rgb,
};
use crate::{SIZE, floats, value};

/// How a row of the table is read.
#[derive(Clone, Copy)]
enum As {
    Map,
    Normals,
    Picture,
    Environment,
}

/// Kinds of input, how each is read, and its bytes.
fn rows() -> Vec<(&'static str, As, Vec<u8>)> {
    let combined = ["ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B"];
    let with_normals =
        [&combined[..], &["ViewLayer.Normal.X", "ViewLayer.Normal.Y", "ViewLayer.Normal.Z"]].concat();
    let parts = || {
        [
            part(Some("beauty"), &["R", "G", "B"], SIZE, value),
            part(Some("normals"), &["R", "G", "B"], SIZE, move |c, x, _| normal(c, x)),
        ]
    };
    let windows = |position, size: [usize; 2], display: [usize; 2]| {
        let data = Part { position, ..part(None, &["R", "G", "B"], size, value) };
        exr_parts(&[data], ([0, 0], display))
    };
    let light = |_: usize, _: usize, _: usize| 0.5;
    let pixel = [128, 128, 128, 128];
    let plain = png(&rgb(6, 4), 6, 4, ExtendedColorType::Rgb8);
    let grey = png(&[0, 60, 90, 255, 128, 7], 3, 2, ExtendedColorType::L8);
    let grey_as_color = png(&[0, 0, 0, 60, 60, 60, 90, 90, 90], 3, 1, ExtendedColorType::Rgb8);
    let two_channels = png(&[128, 128, 0, 160, 100, 0, 90, 90, 0], 3, 1, ExtendedColorType::Rgb8);
    let tiff = Tiff::GREY_F32;
    let whole: Vec<u8> = (0..12u32).flat_map(|i| i.to_le_bytes()).collect();
    let cube = Part { is_cube_map: true, ..part(None, &["R", "G", "B"], [4, 24], light) };
    let dark = |_: usize, x: usize, _: usize| if x == 3 { -0.5 } else { 0.5 };
    let ringing = |_: usize, x: usize, _: usize| if x == 3 { -0.001 } else { 0.5 };
    let infinite = |_: usize, x: usize, _: usize| if x == 3 { f32::INFINITY } else { 0.5 };
    let cut = jpeg(&rgb(8, 8), 8, 8);
    vec![
        ("EXR `R G B`, `.R`, `red`, `N.x`, one layer", As::Map, exr(&combined, SIZE, value)),
        ("EXR with several layers", As::Map, exr(&with_normals, SIZE, value)),
        ("EXR with several parts", As::Map, exr_parts(&parts(), ([0, 0], SIZE))),
        ("EXR with several parts, as a normal map", As::Normals, exr_parts(&parts(), ([0, 0], SIZE))),
        ("EXR `R G B` with depth", As::Map, exr(&["R", "G", "B", "Z"], SIZE, value)),
        ("EXR, channels without known meaning", As::Map, exr(&["melanin", "blood"], SIZE, value)),
        ("EXR, data within the display window", As::Map, windows([1, 1], [3, 2], [5, 4])),
        ("EXR, data around the display window", As::Map, windows([-1, -1], [7, 6], [5, 4])),
        ("EXR, data beside the display window", As::Map, windows([9, 0], [3, 2], [5, 4])),
        ("normals -1 to 1 as floats", As::Normals, exr(&["X", "Y", "Z"], SIZE, |c, x, _| normal(c, x))),
        ("normal map without blue", As::Normals, two_channels),
        ("grey picture as a normal map", As::Normals, grey),
        ("colour picture with equal channels as a normal map", As::Normals, grey_as_color),
        ("TIFF, grey of floats (16, 32, 64 bits)", As::Map, tiff.bytes(&floats(12))),
        ("TIFF, signed whole numbers", As::Map, Tiff { format: 2, ..tiff }.bytes(&whole)),
        ("TIFF with several pages", As::Map, Tiff { more_pages: true, ..tiff }.bytes(&floats(12))),
        ("JPEG, PNG, WebP, TIFF with an orientation", As::Picture, jpeg_with_exif(&cut, &exif(6))),
        ("JPEG without its end", As::Picture, cut[..cut.len() - 30].to_vec()),
        (
            "PNG or WebP that moves",
            As::Picture,
            png_with_chunk(&plain, &png_chunk(b"acTL", &[0, 0, 0, 1, 0, 0, 0, 0]), false),
        ),
        ("header that claims 60000 x 60000", As::Picture, png_claiming(&plain, 60000, 60000)),
        ("header that claims a side of 0", As::Environment, radiance("#?RADIANCE\n", 0, 4, pixel)),
        ("environment, `#?RADIANCE` or `#?RGBE`", As::Environment, radiance("#?RGBE\n", 8, 4, pixel)),
        (
            "environment, `EXPOSURE`, `COLORCORR`",
            As::Environment,
            radiance("#?RGBE\nEXPOSURE=2\n", 8, 4, pixel),
        ),
        ("environment, `GAMMA` other than 1", As::Environment, radiance("#?RGBE\nGAMMA=2.2\n", 8, 4, pixel)),
        (
            "environment, `FORMAT=32-bit_rle_xyze`",
            As::Environment,
            radiance("#?RGBE\nFORMAT=32-bit_rle_xyze\n", 8, 4, pixel),
        ),
        ("environment, EXR", As::Environment, exr(&["R", "G", "B"], [8, 4], light)),
        ("environment, EXR cube map", As::Environment, exr_parts(&[cube], ([0, 0], [4, 24]))),
        ("environment, 8 or 16 bits", As::Environment, png(&[200; 96], 8, 4, ExtendedColorType::Rgb8)),
        ("environment, not twice as wide as high", As::Environment, exr(&["R", "G", "B"], [6, 6], light)),
        ("environment, slightly negative", As::Environment, exr(&["R", "G", "B"], [8, 4], ringing)),
        ("environment, clearly negative", As::Environment, exr(&["R", "G", "B"], [8, 4], dark)),
        ("environment, infinite or not a number", As::Environment, exr(&["R", "G", "B"], [8, 4], infinite)),
    ]
}

fn normal(channel: usize, x: usize) -> f32 {
    let slope = 0.2 * (x as f32).sin();
    [slope, 0.0, 1.0][channel] / (1.0 + slope * slope).sqrt()
}

/// Outcome of an input, in the reader's words.
fn outcome(file: &Path, how: As) -> String {
    let with = |purpose| ReadOptions { purpose, ..ReadOptions::default() };
    let result = match how {
        As::Map => load_image_with(file, &with(Purpose::Values)).map(|i| i.notes).map_err(|e| e.to_string()),
        As::Normals => {
            load_image_with(file, &with(Purpose::Normals)).map_err(|e| e.to_string()).and_then(|image| {
                let (_, notes) = slopes_of(&image, GreenAxis::OpenGl).map_err(|e| e.to_string())?;
                Ok([image.notes, notes].concat())
            })
        }
        As::Picture => load_picture(file, &Limits::default()).map(|p| p.notes).map_err(|e| e.to_string()),
        As::Environment => {
            environment::read(file, &ReadOptions::default()).map(|e| e.1).map_err(|e| e.to_string())
        }
    };
    match result {
        Ok(notes) if notes.is_empty() => "read".into(),
        Ok(notes) => format!("read; {}", notes.join("; ")),
        Err(message) => {
            let name = file.display().to_string();
            format!("refused: {}", message.replace(&name, "").trim_start_matches([':', ',', ' ']))
        }
    }
}

#[test]
fn the_table_of_the_docs_is_what_the_readers_do() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("image");
    let mut table = String::from("| input | result and note |\n| --- | --- |\n");
    for (what, how, bytes) in rows() {
        std::fs::write(&file, bytes).unwrap();
        table += &format!("| {what} | {} |\n", outcome(&file, how).replace('|', "\\|"));
    }
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/interchange.md");
    let text = std::fs::read_to_string(&docs).unwrap();
    let start = text.find("| input | result and note |").expect("the docs hold a table of images");
    let length = text[start..].find("\n\n").map_or(text.len() - start, |at| at + 1);
    if std::env::var_os("RUBOR_UPDATE_DOCS").is_some() {
        let updated = format!("{}{table}{}", &text[..start], &text[start + length..]);
        std::fs::write(&docs, updated).unwrap();
        return;
    }
    for (written, made) in text[start..start + length].lines().zip(table.lines()) {
        assert_eq!(written, made, "RUBOR_UPDATE_DOCS=1 writes the table anew");
    }
    assert_eq!(text[start..start + length].lines().count(), table.lines().count());
}
