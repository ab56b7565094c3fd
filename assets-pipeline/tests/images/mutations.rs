//! Mutated files: whatever is done to the bytes, a reader returns within bounds.
//!
//! A few hundred run with the suite. `RUBOR_MUTATIONS=10000` runs that many.

use std::path::Path;
use std::time::{Duration, Instant};

use image::ExtendedColorType;
use rubor_assets::convert::normals::{GreenAxis, slopes_of};
use rubor_assets::environment;
use rubor_assets::image_io::{Limits, Purpose, ReadOptions, decode_image, decode_stored, load_picture};

use crate::files::{
    Tiff, exif, exr, exr_parts, jpeg, jpeg_with_exif, part, png, png_chunk, png_with_chunk, radiance, rgb,
    webp,
};

/// Images small enough for any number of runs, and one large claim away from them.
const LIMITS: Limits = Limits { side: 1 << 16, pixels: 1 << 20, bytes: 64 << 20 };
/// A reader of a few kilobytes that takes this long hangs, also on a busy machine.
const LONGEST: Duration = Duration::from_secs(5);

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let plain = png(&rgb(12, 9), 12, 9, ExtendedColorType::Rgb8);
    let value = |c: usize, x: usize, y: usize| 0.1 * c as f32 + 0.01 * x as f32 + 0.001 * y as f32;
    let size = [12, 9];
    let parts = [
        part(Some("beauty"), &["R", "G", "B", "A"], size, value),
        part(Some("normals"), &["N.X", "N.Y", "N.Z"], size, value),
    ];
    let floats: Vec<u8> = (0..48).flat_map(|i| (i as f32).to_le_bytes()).collect();
    let tiff = Tiff { samples: 4, photometric: 2, extra: &[2], orientation: 6, ..Tiff::GREY_F32 };
    vec![
        ("png", png_with_chunk(&plain, &png_chunk(b"eXIf", &exif(6)), false)),
        ("png16", png(&rgb(12, 9)[..108], 6, 9, ExtendedColorType::L16)),
        ("jpeg", jpeg_with_exif(&jpeg(&rgb(24, 17), 24, 17), &exif(5))),
        ("webp", webp(&rgb(12, 9), 12, 9, Some(exif(3)))),
        ("tiff", Tiff { more_pages: true, ..tiff }.bytes(&floats)),
        ("tiff planes", Tiff { planar: true, ..tiff }.bytes(&floats)),
        ("tiff grey", Tiff::GREY_F32.bytes(&floats)),
        ("exr", exr(&["View.Combined.R", "View.Combined.G", "View.Combined.B", "View.Depth.Z"], size, value)),
        ("exr parts", exr_parts(&parts, ([-1, 2], [14, 9]))),
        (
            "hdr",
            radiance(
                "#?RADIANCE\nEXPOSURE=2\nCOLORCORR=1 1 2\nFORMAT=32-bit_rle_rgbe\n",
                12,
                9,
                [90, 80, 7, 128],
            ),
        ),
        ("hdr runs", runs(16, 5)),
    ]
}

/// A Radiance picture in the run-length code of 1991: each component of a line as one run.
fn runs(width: u8, height: u8) -> Vec<u8> {
    let mut bytes = format!("#?RGBE\n\n+Y {height} -X {width}\n").into_bytes();
    for _ in 0..height {
        bytes.extend([2, 2, 0, width]);
        bytes.extend([100, 90, 80, 128].iter().flat_map(|v| [128 + width, *v]));
    }
    bytes
}

/// One change or a few: bits, bytes, words of all sizes with telling values, cuts, doubled and moved stretches.
fn mutated(bytes: &[u8], random: &mut fastrand::Rng) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..random.usize(1..=3) {
        if bytes.is_empty() {
            break;
        }
        // Headers decide most, so half of all changes fall on the first bytes.
        let reach = if random.bool() { bytes.len().min(400) } else { bytes.len() };
        let at = random.usize(..reach);
        match random.u8(..8) {
            0 => bytes[at] ^= 1 << random.u8(..8),
            1 => bytes[at] = random.u8(..),
            2 | 3 => {
                let word: u32 = [0, 1, 0xff, 0xffff, 0x7fff_ffff, 0xffff_ffff, 0x8000_0000, random.u32(..)]
                    [random.usize(..8)];
                let word = if random.bool() { word.to_le_bytes() } else { word.to_be_bytes() };
                let length = (bytes.len() - at).min([1, 2, 4][random.usize(..3)]);
                bytes[at..at + length].copy_from_slice(&word[..length]);
            }
            4 => bytes.truncate(at),
            5 => {
                let end = (at + random.usize(1..40)).min(bytes.len());
                let stretch = bytes[at..end].to_vec();
                bytes.splice(at..at, stretch);
            }
            6 => {
                let end = (at + random.usize(1..40)).min(bytes.len());
                bytes.drain(at..end);
            }
            _ => {
                // A digit of a text header.
                if let Some(digit) = bytes[at..].iter_mut().find(|b| b.is_ascii_digit()) {
                    *digit = random.u8(b'0'..=b'9');
                }
            }
        }
    }
    // Checksums guard what stands behind them; a mutated PNG should get past its header.
    if bytes.len() > 33 && bytes.starts_with(b"\x89PNG") && random.bool() {
        let header = png_chunk(b"IHDR", &bytes[16..29]);
        bytes.splice(8..33, header);
    }
    bytes
}

#[test]
fn mutated_images_end_in_a_result_or_an_error() {
    let count: usize =
        std::env::var("RUBOR_MUTATIONS").map_or(400, |n| n.parse().expect("RUBOR_MUTATIONS is a number"));
    let mut random = fastrand::Rng::with_seed(20);
    let seeds = seeds();
    let folder = tempfile::tempdir().unwrap();
    let options = ReadOptions { limits: LIMITS, ..ReadOptions::default() };
    for (name, bytes) in &seeds {
        assert!(decode_image(Path::new(name), bytes, &options).is_ok(), "the unchanged {name} is readable");
    }
    let (mut read, mut longest) = (0, (Duration::ZERO, String::new()));
    for i in 0..count {
        let (name, bytes) = &seeds[i % seeds.len()];
        let bytes = mutated(bytes, &mut random);
        let file = folder.path().join("mutated");
        std::fs::write(&file, &bytes).unwrap();
        let start = Instant::now();
        let options = ReadOptions {
            purpose: if i % 2 == 0 { Purpose::Values } else { Purpose::Normals },
            ..options.clone()
        };
        if let Ok(image) = decode_image(&file, &bytes, &options) {
            read += 1;
            let size = image.map.width as usize * image.map.height as usize;
            assert_eq!(image.map.values.len(), size * image.map.channels as usize, "{name} {i}");
            assert!(size as u64 <= LIMITS.pixels && (1..=3).contains(&image.map.channels), "{name} {i}");
            assert!(image.alpha.as_ref().is_none_or(|a| a.values.len() == size), "{name} {i}");
            // The result serves or is refused.
            let _ = slopes_of(&image, GreenAxis::OpenGl);
        }
        if let Ok((map, _)) = environment::read(&file, &options) {
            assert_eq!(map.texels.len(), map.width as usize * map.height as usize);
            assert!(map.texels.iter().all(|t| t.is_finite() && t.min_element() >= 0.0), "{name} {i}");
        }
        let _ = load_picture(&file, &LIMITS);
        let _ = decode_stored(&file, &bytes, &LIMITS);
        let time = start.elapsed();
        if time > longest.0 {
            longest = (time, format!("{name}, mutation {i}"));
        }
        assert!(time < LONGEST, "{name}, mutation {i}: {time:?}");
    }
    println!("{count} mutations, {read} still readable, longest {:?} ({})", longest.0, longest.1);
    assert!(read > 0 && read < count, "{read} of {count} are readable");
    if let Some(peak) = peak_memory_mib() {
        println!("peak memory {peak} MiB");
        assert!(peak < 1024, "peak memory {peak} MiB");
    }
}

/// Largest resident memory of this process so far, where the system tells it.
fn peak_memory_mib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches(" kB").parse::<u64>().ok()? / 1024)
}
