use super::reference::*;
use super::scenes::*;
use super::*;

/// The device of the tests; without one they are skipped, or fail where `RUBOR_REQUIRE_GPU` is set.
fn gpu() -> Option<&'static Gpu> {
    static GPU: std::sync::OnceLock<Option<Gpu>> = std::sync::OnceLock::new();
    GPU.get_or_init(|| match Gpu::new(None) {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            assert!(std::env::var_os("RUBOR_REQUIRE_GPU").is_none(), "RUBOR_REQUIRE_GPU is set: {error}");
            eprintln!("SKIPPED: {error}");
            None
        }
    })
    .as_ref()
}

/// A small generator of repeatable noise (xorshift).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// Pictures that stress every branch, 8-bit values.
fn hostile_pictures(width: usize, height: usize) -> Vec<(&'static str, Picture)> {
    let mut noise = Noise(0x5eed);
    let byte = |v: f32| (v * 255.0).round() / 255.0;
    let stair = |slope: f64| {
        Picture::from_fn(width, height, move |x, y| {
            let v = if (x as f64) * slope + 0.3 > y as f64 { 1.0 } else { 0.0 };
            [v, v * 0.5, v, 1.0]
        })
    };
    vec![
        ("noise", Picture::from_fn(width, height, |_, _| [0, 1, 2, 3].map(|_| byte(noise.next())))),
        ("binary noise", Picture::from_fn(width, height, |_, _| {
            let v = noise.next().round();
            [v, v, v, 1.0]
        })),
        ("sparse", Picture::from_fn(width, height, |_, _| {
            let v = if noise.next() < 0.04 { 1.0 } else { 0.0 };
            [v, 0.0, v, 1.0]
        })),
        ("checker", Picture::from_fn(width, height, |x, y| [((x + y) % 2) as f32, 0.0, 0.0, 1.0])),
        ("flat stair", stair(0.07)),
        ("diagonal stair", stair(1.0)),
        ("steep stair", stair(7.3)),
        ("rows", Picture::from_fn(width, height, |_, y| [0.0, (y / 3 % 2) as f32, 0.0, 1.0])),
        ("columns", Picture::from_fn(width, height, |x, _| [0.0, (x / 3 % 2) as f32, 0.0, 1.0])),
        ("alpha", Picture::from_fn(width, height, |x, y| [0.0, 0.0, 0.0, if x > y + 3 { 1.0 } else { 0.0 }])),
    ]
}

fn to_bytes(picture: &Picture) -> Vec<u8> {
    picture.pixels.iter().flatten().map(|v| (v * 255.0).round() as u8).collect()
}

/// The 1x result of the reference for a picture.
fn reference_1x(picture: &Picture, settings: &Settings) -> (Edges, Vec<Weights>, Picture) {
    let tables = Tables::new(settings);
    let edges = detect_edges(picture, None, settings);
    let positions = tables.positions(&settings.mode.subsamples(0)[0]);
    let weights = blending_weights(&edges, positions, &tables.areas, settings);
    let blended = blend(picture, &weights, settings);
    (edges, weights, blended)
}

#[test]
fn kernels_equal_the_reference() {
    let Some(gpu) = gpu() else { return };
    for (width, height) in [(27, 51), (70, 33), (32, 64)] {
        for (mode, preset, source) in [
            (Mode::Mlaa, Preset::High, EdgeSource::Luma),
            (Mode::Smaa1x, Preset::Low, EdgeSource::Luma),
            (Mode::Smaa1x, Preset::High, EdgeSource::Color),
            (Mode::Smaa1x, Preset::Ultra, EdgeSource::Luma),
        ] {
            let settings = Settings { edges: source, ..Settings::new(mode, preset) };
            let mut filter = Filter::new(gpu, settings).unwrap();
            for (name, picture) in hostile_pictures(width, height) {
                let what = format!("{name} {width} x {height}, {} {preset:?} {source:?}", mode.name());
                let (edges, weights, blended) = reference_1x(&picture, &settings);
                assert_eq!(filter.edges(&picture).unwrap(), edges, "edges of {what}");
                let found = filter.weights(&picture).unwrap();
                let wrong = (0..found.len()).find(|&i| found[i] != weights[i]);
                assert_eq!(wrong.map(|i| (i % width, i / width, found[i], weights[i])), None, "weights of {what}");
                // The power functions of the two sides agree to some 1e-6, and steep parts of the sRGB curve
                // magnify that 13 times.
                let floats = filter.picture(&picture).unwrap();
                for (i, (a, b)) in floats.pixels.iter().zip(&blended.pixels).enumerate() {
                    for channel in 0..4 {
                        let difference = (a[channel] - b[channel]).abs();
                        assert!(difference < 3e-5, "{what}: pixel {i} is {a:?}, expected {b:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn explore() {
    let mut best = vec![];
    let size = [64, 64];
    for (name, flip) in [("as", 1.0f32), ("neg", -1.0)] {
        for mode in [Mode::Mlaa, Mode::Smaa1x, Mode::SmaaS2x, Mode::Smaa4x] {
            let mut s = Settings::new(mode, Preset::Ultra);
            s.encoding = Encoding::Linear;
            let mut err = 0.0; let mut n = 0;
            let tables = Tables::new(&s);
            for deg in (0..90).step_by(4) {
                let a = (deg as f64 + 0.3).to_radians();
                let scene = move |x: f64, y: f64| if (x - 32.0) * a.sin() + (y - 32.0) * a.cos() > 0.2 { 1.0 } else { 0.0 };
                let frames: Vec<_> = (0..2).map(|f| {
                    let pics: Vec<_> = mode.subsamples(f).iter().map(|ss| sampled(&scene, size, [flip*ss.position_px[0], flip*ss.position_px[1]])).collect();
                    filter_samples(&pics, f, &tables, &s)
                }).collect();
                let out = average(&frames, &s);
                for y in 16..48 { for x in 16..48 {
                    let mut t = 0.0;
                    for j in 0..8 { for i in 0..8 { t += scene(x as f64 + (i as f64 + 0.5) / 8.0, y as f64 + (j as f64 + 0.5) / 8.0); } }
                    t /= 64.0;
                    let o = out.pixels[y * 64 + x][0];
                    if t > 0.0 && t < 1.0 { err += (o - t).powi(2); n += 1; }
                }}
            }
            best.push((name, mode, (err / n as f32).sqrt()));
        }
    }
    for b in best { eprintln!("{b:?}"); }
}
