//! Pictures: bombs, headers that lie, sides of 0, cut files; through every command that reads one.

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;

use super::{Case, truncated, write};

fn crc(bytes: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    crc.sum()
}

fn chunk(out: &mut Vec<u8>, kind: &[u8; 4], data: &[u8]) {
    out.extend((data.len() as u32).to_be_bytes());
    let start = out.len();
    out.extend(kind);
    out.extend(data);
    let sum = crc(&out[start..]);
    out.extend(sum.to_be_bytes());
}

fn deflated(length: usize) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    let zeros = vec![0; 1 << 20];
    let mut left = length;
    while left > 0 {
        let now = left.min(zeros.len());
        encoder.write_all(&zeros[..now]).expect("zeros deflate");
        left -= now;
    }
    encoder.finish().expect("zeros deflate")
}

/// A PNG of a kind of colour (0 grey, 2 RGB, 6 RGBA), with `data` after its header.
fn png(
    [width, height]: [u32; 2],
    bits: u8,
    color: u8,
    data: &[u8],
    more: impl FnOnce(&mut Vec<u8>),
) -> Vec<u8> {
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut header = Vec::new();
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    header.extend([bits, color, 0, 0, 0]);
    chunk(&mut out, b"IHDR", &header);
    more(&mut out);
    chunk(&mut out, b"IDAT", data);
    chunk(&mut out, b"IEND", &[]);
    out
}

/// A black grey picture of 8 bits.
pub(crate) fn grey_png(width: u32, height: u32) -> Vec<u8> {
    png([width, height], 8, 0, &deflated((width as usize + 1) * height as usize), |_| {})
}

/// A picture that is a header and little else.
pub(crate) fn png_header(width: u32, height: u32) -> Vec<u8> {
    png([width, height], 16, 6, &deflated(100), |_| {})
}

/// A TIFF of one strip with these entries of its directory (tag, kind, count, value).
fn tiff(entries: &[(u16, u16, u32, u32)], data: &[u8]) -> Vec<u8> {
    let mut out = b"II*\0\x08\0\0\0".to_vec();
    out.extend((entries.len() as u16).to_le_bytes());
    for (tag, kind, count, value) in entries {
        out.extend(tag.to_le_bytes());
        out.extend(kind.to_le_bytes());
        out.extend(count.to_le_bytes());
        out.extend(value.to_le_bytes());
    }
    out.extend([0; 4]);
    out.resize(256, 0);
    out.extend(data);
    out
}

fn plain_tiff(width: u32, height: u32, bits: u32, samples: u32, compression: u32) -> Vec<u8> {
    let data = if compression == 8 { deflated(1000) } else { vec![0; 1000] };
    let entries = [
        (256, 4, 1, width),
        (257, 4, 1, height),
        (258, 3, 1, bits),
        (259, 3, 1, compression),
        (262, 3, 1, if samples == 3 { 2 } else { 1 }),
        (273, 4, 1, 256),
        (277, 3, 1, samples),
        (278, 4, 1, height),
        (279, 4, 1, data.len() as u32),
    ];
    tiff(&entries, &data)
}

fn hdr(size: &str, data: &[u8]) -> Vec<u8> {
    let mut out = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n").into_bytes();
    out.extend(data);
    out
}

/// An EXR of one float channel; its data window can lie.
fn exr(window: [i32; 4], channels: usize, compression: u8, data: &[u8]) -> Vec<u8> {
    let mut out = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        out.extend(name.as_bytes());
        out.push(0);
        out.extend(kind.as_bytes());
        out.push(0);
        out.extend((value.len() as u32).to_le_bytes());
        out.extend(value);
    };
    let mut list = Vec::new();
    for c in 0..channels {
        list.extend(format!("c{c:06}").as_bytes());
        list.push(0);
        list.extend([2, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
    }
    list.push(0);
    let window: Vec<u8> = window.iter().flat_map(|v| v.to_le_bytes()).collect();
    attribute("channels", "chlist", &list);
    attribute("compression", "compression", &[compression]);
    attribute("dataWindow", "box2i", &window);
    attribute("displayWindow", "box2i", &window);
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &1.0_f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1.0_f32.to_le_bytes());
    out.push(0);
    out.extend(data);
    out
}

fn jpeg(width: u16, height: u16, marker: u8) -> Vec<u8> {
    let small = image::RgbImage::from_pixel(16, 16, image::Rgb([9, 99, 199]));
    let mut out = std::io::Cursor::new(Vec::new());
    small.write_to(&mut out, image::ImageFormat::Jpeg).expect("a JPEG");
    let mut out = out.into_inner();
    // Start of frame: two bytes of length, one of precision, height, width.
    let at = out.windows(2).position(|w| w == [0xff, 0xc0]).expect("a frame");
    out[at + 1] = marker;
    out[at + 5..at + 7].copy_from_slice(&height.to_be_bytes());
    out[at + 7..at + 9].copy_from_slice(&width.to_be_bytes());
    out
}

fn webp_header(width: u32, height: u32) -> Vec<u8> {
    let mut body = b"WEBPVP8L".to_vec();
    let bits = (width - 1) | (height - 1) << 14;
    let mut data = vec![0x2f];
    data.extend(bits.to_le_bytes());
    data.extend([0; 20]);
    body.extend((data.len() as u32).to_le_bytes());
    body.extend(&data);
    let mut out = b"RIFF".to_vec();
    out.extend((body.len() as u32).to_le_bytes());
    out.extend(body);
    out
}

fn encoded(format: image::ImageFormat) -> Vec<u8> {
    let picture =
        image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([x as u8 * 4, y as u8 * 4, (x * y) as u8]));
    let mut out = std::io::Cursor::new(Vec::new());
    match format {
        image::ImageFormat::Hdr => {
            image::DynamicImage::ImageRgb8(picture)
                .to_rgb32f()
                .write_to(&mut out, format)
                .expect("a picture");
        }
        _ => picture.write_to(&mut out, format).expect("a picture"),
    }
    out.into_inner()
}

const COMPARE: &[&str] = &["compare", "{}/a", "{}/a"];

/// A file through `compare`, which reads values of any kind of image.
fn compare(name: &str, bytes: impl FnOnce() -> Vec<u8> + 'static) -> Case {
    Case::new(format!("image/{name}"), COMPARE, move |folder| write(folder, "a", &bytes()))
}

pub(crate) fn cases() -> Vec<Case> {
    let mut all = Vec::new();
    use image::ImageFormat as F;
    for (kind, format) in
        [("png", F::Png), ("jpeg", F::Jpeg), ("tiff", F::Tiff), ("webp", F::WebP), ("hdr", F::Hdr)]
    {
        all.extend(truncated(kind, "a", COMPARE, &encoded(format)));
    }
    let data: Vec<u8> = vec![0; 64];
    all.extend(truncated("exr", "a", COMPARE, &exr([0, 0, 3, 3], 3, 0, &data)));

    // Headers that claim, data that are not there.
    for (name, side) in [("0", 0), ("1e4", 10_000), ("6e4", 60_000), ("2e31", 1 << 31), ("2e32", u32::MAX)] {
        let case = compare(&format!("png-claims-{name}"), move || png_header(side, side));
        all.push(if side == 60_000 { case.small() } else { case });
        all.push(compare(&format!("png-claims-wide-{name}"), move || png_header(side, 1)));
        all.push(compare(&format!("png-claims-tall-{name}"), move || png_header(1, side)));
        let case = compare(&format!("hdr-claims-{name}"), move || hdr(&format!("-Y {side} +X {side}"), &[]));
        all.push(if side == 0 { case.small().refused() } else { case });
        all.push(compare(&format!("hdr-claims-wide-{name}"), move || {
            hdr(&format!("-Y 1 +X {side}"), &[2, 2, 0xff, 0xff])
        }));
        for (bits, samples) in [(8, 1), (16, 3), (32, 3), (64, 1)] {
            let name = format!("tiff-claims-{name}-{samples}x{bits}");
            all.push(compare(&name, move || plain_tiff(side, side, bits, samples, 8)));
        }
    }
    for (name, samples, bits) in
        [("0", 0, 8), ("65535", 65_535, 8), ("bits-0", 1, 0), ("bits-65535", 1, 65_535)]
    {
        all.push(compare(&format!("tiff-samples-{name}"), move || plain_tiff(16, 16, bits, samples, 1)));
    }
    all.push(compare("tiff-strip-of-4GB", || {
        tiff(
            &[
                (256, 4, 1, 16),
                (257, 4, 1, 16),
                (258, 3, 1, 8),
                (259, 3, 1, 1),
                (262, 3, 1, 1),
                (273, 4, 1, 256),
                (277, 3, 1, 1),
                (278, 4, 1, 16),
                (279, 4, 1, u32::MAX),
            ],
            &[0; 256],
        )
    }));
    all.push(compare("tiff-strips-1e9", || {
        tiff(
            &[
                (256, 4, 1, 16),
                (257, 4, 1, 16),
                (258, 3, 1, 8),
                (262, 3, 1, 1),
                (273, 4, 1_000_000_000, 256),
                (279, 4, 1_000_000_000, 256),
            ],
            &[0; 256],
        )
    }));
    all.push(compare("tiff-tiles-huge", || {
        tiff(
            &[
                (256, 4, 1, 16),
                (257, 4, 1, 16),
                (258, 3, 1, 8),
                (259, 3, 1, 1),
                (262, 3, 1, 1),
                (277, 3, 1, 1),
                (322, 4, 1, 1 << 31),
                (323, 4, 1, 1 << 31),
                (324, 4, 1, 256),
                (325, 4, 1, 256),
            ],
            &[0; 256],
        )
    }));
    all.push(compare("tiff-directory-loops", || {
        let mut bytes = plain_tiff(16, 16, 8, 1, 1);
        let at = 8 + 2 + 9 * 12;
        bytes[at..at + 4].copy_from_slice(&8_u32.to_le_bytes());
        bytes
    }));
    all.push(compare("tiff-of-other-endianness", || {
        let mut bytes = plain_tiff(16, 16, 8, 1, 1);
        bytes[..4].copy_from_slice(b"MM\0*");
        bytes
    }));
    for (name, marker) in [("baseline", 0xc0), ("progressive", 0xc2)] {
        all.push(compare(&format!("jpeg-claims-65535-{name}"), move || jpeg(65_535, 65_535, marker)));
        all.push(compare(&format!("jpeg-claims-16000-{name}"), move || jpeg(16_000, 16_000, marker)));
    }
    all.push(compare("jpeg-claims-0", || jpeg(0, 0, 0xc0)));
    all.push(compare("webp-claims-16384", || webp_header(16_384, 16_384)));
    for (name, window) in [
        ("empty", [0, 0, -1, -1]),
        ("backwards", [5, 5, 0, 0]),
        ("1e9", [0, 0, 1_000_000_000, 1_000_000_000]),
        ("all", [i32::MIN, i32::MIN, i32::MAX, i32::MAX]),
        ("2e31", [0, 0, i32::MAX, 0]),
        ("far", [i32::MAX - 1, i32::MAX - 1, i32::MAX, i32::MAX]),
    ] {
        for compression in [0, 3, 4] {
            let case = compare(&format!("exr-window-{name}-{compression}"), move || {
                exr(window, 1, compression, &[0; 64])
            });
            all.push(if name == "1e9" && compression == 3 { case.small() } else { case });
        }
    }
    all.push(compare("exr-channels-100000", || exr([0, 0, 63, 63], 100_000, 0, &[0; 4096])));
    all.push(compare("exr-compression-99", || exr([0, 0, 3, 3], 1, 99, &[0; 64])));

    // Bombs: little that becomes much.
    all.push(compare("png-bomb-20000", || grey_png(20_000, 20_000)));
    all.push(compare("png-bomb-16384", || grey_png(16_384, 16_384)));
    all.push(compare("png-bomb-12000", || grey_png(12_000, 12_000)));
    all.push(compare("png-bomb-of-more-than-it-says", || png([64, 64], 8, 0, &deflated(1 << 30), |_| {})));
    for kind in [b"zTXt", b"iCCP"] {
        let name = format!("png-bomb-in-{}", String::from_utf8_lossy(kind));
        all.push(compare(&name, move || {
            let mut data = b"name\0\0".to_vec();
            data.extend(deflated(1 << 30));
            png([8, 8], 8, 0, &deflated(72), move |out| chunk(out, kind, &data))
        }));
    }
    all.push(compare("png-chunk-of-2e31", || {
        let mut bytes = grey_png(8, 8);
        bytes[33..37].copy_from_slice(&(u32::MAX >> 1).to_be_bytes());
        bytes
    }));
    all.push(compare("hdr-header-without-end", || {
        [b"#?RADIANCE\n".to_vec(), b"A=1\n".repeat(10_000_000)].concat()
    }));
    all.push(compare("hdr-line-of-100MB", || [b"#?RADIANCE\n".to_vec(), vec![b'x'; 100_000_000]].concat()));
    all.push(compare("hdr-exposure-nan", || {
        b"#?RADIANCE\nEXPOSURE=nan\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\x01\x01\x01\x80".to_vec()
    }));
    all.push(compare("zeros-100MB", || vec![0; 100_000_000]));
    all.push(compare("empty", Vec::new));

    // Other commands, and what they do with links and pipes.
    all.push(Case::new("image/filter-bomb", &["filter", "{}/a.png", "-o", "{}/b.png"], |f| {
        write(f, "a.png", &grey_png(20_000, 20_000));
    }));
    all.push(
        Case::new("image/filter-claims", &["filter", "{}/a.png", "-o", "{}/b.png"], |f| {
            write(f, "a.png", &png_header(60_000, 60_000));
        })
        .refused(),
    );
    #[cfg(unix)]
    {
        all.push(
            Case::new("image/zero-behind-a-link", COMPARE, |f| {
                std::os::unix::fs::symlink("/dev/zero", f.join("a")).expect("a link");
            })
            .refused()
            .small(),
        );
        all.push(Case::new("image/pipe", COMPARE, |f| super::gltf::fifo(f, "a")).refused());
        all.push(
            Case::new("image/filter-zero", &["filter", "{}/a.png", "-o", "{}/b.png"], |f| {
                std::os::unix::fs::symlink("/dev/zero", f.join("a.png")).expect("a link");
            })
            .refused(),
        );
    }
    all
}
