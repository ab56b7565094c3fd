use rubor_rig::random::SplitMix64;

use super::reference::*;
use super::scenes::*;
use super::*;
use crate::device::native;
use crate::testing::{assert_layout, assert_workgroups, gpu, offsets};

/// Pictures that stress every branch, 8-bit values.
fn hostile_pictures(width: usize, height: usize) -> Vec<(&'static str, Picture)> {
    let mut noise = SplitMix64(0x5eed);
    let byte = |v: f32| (v * 255.0).round() / 255.0;
    let stair = |slope: f64| {
        Picture::from_fn(width, height, move |x, y| {
            let v = if (x as f64) * slope + 0.3 > y as f64 { 1.0 } else { 0.0 };
            [v, v * 0.5, v, 1.0]
        })
    };
    vec![
        ("noise", Picture::from_fn(width, height, |_, _| [0, 1, 2, 3].map(|_| byte(noise.uniform() as f32)))),
        (
            "binary noise",
            Picture::from_fn(width, height, |_, _| {
                let v = (noise.uniform() as f32).round();
                [v, v, v, 1.0]
            }),
        ),
        (
            "sparse",
            Picture::from_fn(width, height, |_, _| {
                let v = if (noise.uniform() as f32) < 0.04 { 1.0 } else { 0.0 };
                [v, 0.0, v, 1.0]
            }),
        ),
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

fn assert_close(found: &Picture, expected: &Picture, bound: f32, what: &str) {
    for (i, (a, b)) in found.pixels.iter().zip(&expected.pixels).enumerate() {
        for channel in 0..4 {
            let difference = (a[channel] - b[channel]).abs();
            assert!(difference <= bound, "{what}: pixel {i} is {a:?}, expected {b:?}");
        }
    }
}

fn assert_kernels_equal_the_reference(sizes: &[(usize, usize)], settings: Settings) {
    let Some(gpu) = gpu() else { return };
    let mut filter = Filter::new(gpu, settings).unwrap();
    for &(width, height) in sizes {
        for (name, picture) in hostile_pictures(width, height) {
            let what = format!("{name} {width} x {height}");
            let (edges, weights, blended) = reference_1x(&picture, &settings);
            assert_eq!(native::wait(gpu, filter.edges(&picture)).unwrap(), edges, "edges of {what}");
            let found = native::wait(gpu, filter.weights(&picture)).unwrap();
            let wrong = (0..found.len()).find(|&i| found[i] != weights[i]);
            let detail = wrong.map(|i| (i % width, i / width, found[i], weights[i]));
            assert_eq!(detail, None, "weights of {what}");
            // The power functions of the two sides agree to some 1e-6, and the steepest part of the sRGB curve
            // magnifies that 13 times.
            assert_close(&native::wait(gpu, filter.picture(&picture)).unwrap(), &blended, 3e-5, &what);
        }
    }
}

#[test]
fn mlaa_kernels_equal_the_reference() {
    assert_kernels_equal_the_reference(&[(27, 51)], Settings::new(Mode::Mlaa, Preset::High));
}

#[test]
fn smaa_kernels_equal_the_reference() {
    // One and two words per line, a whole word, and lines of one pixel.
    let sizes = [(27, 51), (70, 33), (32, 64), (1, 40), (40, 1), (1, 1)];
    assert_kernels_equal_the_reference(&sizes, Settings::new(Mode::Smaa1x, Preset::Ultra));
}

#[test]
fn smaa_kernels_equal_the_reference_on_colour_edges() {
    let settings = Settings {
        edges: EdgeSource::Color,
        alpha: Alpha::Associated,
        ..Settings::published(Mode::Smaa1x, Preset::High)
    };
    assert_kernels_equal_the_reference(&[(51, 27)], settings);
}

#[test]
fn full_screen_dispatch_gives_the_same_bits() {
    let Some(gpu) = gpu() else { return };
    let picture = &hostile_pictures(51, 37)[0].1;
    let settings = Settings::new(Mode::Smaa1x, Preset::High);
    let run = |dispatch| {
        let mut frames = Frames::new(gpu, settings, [51, 37], TextureFormat::Rgba8Unorm, dispatch);
        frames.run(std::slice::from_ref(picture), None, None)
    };
    assert_eq!(run(Dispatch::Tiles), run(Dispatch::Screen));
}

#[test]
fn one_colour_keeps_its_bits() {
    let Some(gpu) = gpu() else { return };
    for mode in [Mode::Mlaa, Mode::Smaa1x] {
        let mut filter = Filter::new(gpu, Settings::new(mode, Preset::Ultra)).unwrap();
        for (width, height) in [(1, 1), (1, 45), (45, 1), (33, 65)] {
            let bytes = [13, 200, 255, 77].repeat(width * height);
            assert_eq!(native::wait(gpu, filter.bytes(width as u32, height as u32, &bytes)).unwrap(), bytes);
            let odd = [0.1f32, 7.3, 1e-7, 0.31];
            let picture = Picture::from_fn(width, height, |_, _| odd);
            assert_eq!(native::wait(gpu, filter.picture(&picture)).unwrap(), picture);
        }
    }
}

#[test]
fn every_mode_keeps_one_colour() {
    let Some(gpu) = gpu() else { return };
    let size = [37, 33];
    for mode in [Mode::SmaaS2x, Mode::SmaaT2x, Mode::Smaa4x] {
        let settings = Settings::new(mode, Preset::High);
        let mut frames = Frames::new(gpu, settings, size, TextureFormat::Rgba8Unorm, Dispatch::Tiles);
        let color = [13.0 / 255.0, 200.0 / 255.0, 1.0, 77.0 / 255.0];
        let picture = Picture::from_fn(37, 33, |_, _| color);
        let pictures = vec![picture.clone(); mode.subsamples(0).len()];
        let still = vec![[0.0; 2]; 37 * 33];
        for _ in 0..3 {
            assert_eq!(frames.run(&pictures, Some(&still), None), picture, "{}", mode.name());
        }
    }
}

#[test]
fn large_images_stay_inside_the_limits() {
    let Some(gpu) = gpu() else { return };
    let settings = Settings::new(Mode::Smaa1x, Preset::High);
    // 8192 x 8192 has 65 536 tiles, one more than a dispatch takes in one dimension.
    let pass = Antialias::new(gpu, &settings, [8192, 8192], TextureFormat::Rgba8Unorm).unwrap();
    assert!(pass.memory_bytes() < 310 << 20, "{} bytes", pass.memory_bytes());
    gpu.check().unwrap();
    // Every tile of a long, thin image has edges.
    let mut filter = Filter::new(gpu, settings).unwrap();
    let width = 8192;
    let picture =
        Picture::from_fn(width, 3, |x, y| if (x / 7 + y) % 2 == 0 { [1.0; 4] } else { [0.0, 0.0, 0.0, 1.0] });
    assert_close(
        &native::wait(gpu, filter.picture(&picture)).unwrap(),
        &reference_1x(&picture, &settings).2,
        3e-5,
        "8192 x 3",
    );
}

#[test]
fn sizes_settings_and_inputs_are_checked() {
    let Some(gpu) = gpu() else { return };
    let settings = Settings::default();
    let limit = gpu.device.limits().max_texture_dimension_2d;
    let size = |size| Antialias::new(gpu, &settings, size, TextureFormat::Rgba8Unorm).err();
    assert_eq!(size([0, 5]), Some(AntialiasError::Size { width: 0, height: 5, limit }));
    assert_eq!(size([limit + 1, 5]), Some(AntialiasError::Size { width: limit + 1, height: 5, limit }));
    let format = Antialias::new(gpu, &settings, [4, 4], TextureFormat::Rg8Unorm).err();
    assert_eq!(format, Some(AntialiasError::Format { found: TextureFormat::Rg8Unorm }));
    let wrong = Settings { search_steps: 113, ..settings };
    let message = wrong.validate().unwrap_err().to_string();
    assert_eq!(message, "antialias setting search-steps is 113, expected 1 to 112");
    assert!(Settings { threshold: f32::NAN, ..settings }.validate().is_err());
    let temporal = Settings::new(Mode::SmaaT2x, Preset::High);
    assert_eq!(Filter::new(gpu, temporal).err(), Some(AntialiasError::NotAFilter { mode: "smaa-t2x" }));
    let short = native::wait(gpu, Filter::new(gpu, settings).unwrap().bytes(2, 2, &[0; 15]));
    assert!(matches!(short, Err(AntialiasError::Inputs { expected: 16, found: 15, .. })), "{short:?}");
    let pass = Antialias::new(gpu, &temporal, [4, 4], TextureFormat::Rgba8Unorm).unwrap();
    let view = gpu.target(
        "t",
        [4, 4],
        TextureFormat::Rgba8Unorm,
        TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING,
    );
    let view = view.create_view(&Default::default());
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let inputs = Inputs { colors: &[&view], ..Default::default() };
    let missing = pass.record(gpu, &mut encoder, &mut PassTimer::default(), &inputs, &view, None);
    assert!(matches!(missing, Err(AntialiasError::Inputs { what: "velocities", .. })), "{missing:?}");
}

#[test]
fn depth_edges_and_predication() {
    let Some(gpu) = gpu() else { return };
    let size = [43usize, 38];
    let mut noise = SplitMix64(77);
    let picture = Picture::from_fn(size[0], size[1], |_, _| {
        let v = ((noise.uniform() as f32) * 64.0).round() / 255.0;
        [v, v, v, 1.0]
    });
    let depth: Vec<f32> = (0..size[0] * size[1])
        .map(|i| if (i % size[0]) as f64 * 0.4 + 5.0 > (i / size[0]) as f64 { 0.25 } else { 0.75 })
        .collect();
    for settings in [
        Settings { edges: EdgeSource::Depth, ..Settings::new(Mode::Smaa1x, Preset::High) },
        Settings { edges: EdgeSource::Depth, ..Settings::new(Mode::Mlaa, Preset::High) },
        Settings { predication: Some(Predication::default()), ..Settings::new(Mode::Smaa1x, Preset::High) },
    ] {
        let tables = Tables::new(&settings);
        let expected =
            filter_sample(&picture, Some(&depth), &Mode::Smaa1x.subsamples(0)[0], &tables, &settings);
        assert_ne!(expected, picture);
        let mut frames =
            Frames::new(gpu, settings, size.map(|s| s as u32), TextureFormat::Rgba32Float, Dispatch::Tiles);
        let found = frames.run(std::slice::from_ref(&picture), None, Some(&depth));
        assert_close(&found, &expected, 3e-5, &format!("{settings:?}"));
    }
}

/// Runs the pass frame after frame, as a renderer does.
struct Frames {
    gpu: &'static Gpu,
    pass: Antialias,
    size: [u32; 2],
    format: TextureFormat,
    output: wgpu::Texture,
    history: History,
    frame: u64,
}

impl Frames {
    fn new(
        gpu: &'static Gpu,
        settings: Settings,
        size: [u32; 2],
        format: TextureFormat,
        dispatch: Dispatch,
    ) -> Self {
        let pass = Antialias::with_dispatch(gpu, &settings, size, format, dispatch).unwrap();
        let output =
            gpu.target("out", size, format, TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC);
        Self { gpu, pass, size, format, output, history: History::new(gpu, size), frame: 0 }
    }

    fn upload(&self, format: TextureFormat, texels: &[u8]) -> TextureView {
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST;
        let texture = self.gpu.target("in", self.size, format, usage);
        let bytes_per_row = Some(format.block_copy_size(None).unwrap() * self.size[0]);
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row, rows_per_image: None };
        self.gpu.queue.write_texture(texture.as_image_copy(), texels, layout, texture.size());
        texture.create_view(&Default::default())
    }

    fn run(
        &mut self,
        pictures: &[Picture],
        velocity_px: Option<&[[f32; 2]]>,
        depth: Option<&[f32]>,
    ) -> Picture {
        let bytes = self.format == TextureFormat::Rgba8Unorm;
        let colors: Vec<TextureView> = pictures
            .iter()
            .map(|picture| match bytes {
                true => self.upload(self.format, &to_bytes(picture)),
                false => self.upload(self.format, bytemuck::cast_slice(&picture.pixels)),
            })
            .collect();
        let colors: Vec<&TextureView> = colors.iter().collect();
        let velocity = velocity_px.map(|v| self.upload(TextureFormat::Rg32Float, bytemuck::cast_slice(v)));
        let depth = depth.map(|d| self.upload(TextureFormat::R32Float, bytemuck::cast_slice(d)));
        let depths: Vec<&TextureView> = depth.iter().collect();
        let inputs =
            Inputs { colors: &colors, depths: &depths, velocity: velocity.as_ref(), frame: self.frame };
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let output = self.output.create_view(&Default::default());
        let history = self.pass.settings().mode.is_temporal().then_some(&mut self.history);
        self.pass
            .record(self.gpu, &mut encoder, &mut PassTimer::default(), &inputs, &output, history)
            .unwrap();
        self.gpu.queue.submit([encoder.finish()]);
        self.frame += 1;
        let texels = native::wait(self.gpu, self.gpu.read_texture(&self.output)).unwrap();
        let pixels = if bytes {
            texels.chunks(4).map(|p| [0, 1, 2, 3].map(|c| f32::from(p[c]) / 255.0)).collect()
        } else {
            bytemuck::pod_collect_to_vec(&texels)
        };
        Picture { width: self.size[0] as usize, height: self.size[1] as usize, pixels }
    }
}

/// A grey disk of radius 9.3 px at (x, y) in front of a dark background.
fn disk(x: f64, y: f64) -> impl Fn(f64, f64) -> f32 + Sync {
    move |px, py| if (px - x).hypot(py - y) < 9.3 { 0.8 } else { 0.1 }
}

fn samples(scene: &Scene, size: [usize; 2], mode: Mode, frame: u64) -> Vec<Picture> {
    mode.subsamples(frame).iter().map(|subsample| sampled(scene, size, subsample.position_px)).collect()
}

#[test]
fn pairs_of_samples_equal_the_reference() {
    let Some(gpu) = gpu() else { return };
    let size = [41usize, 35];
    let settings = Settings::new(Mode::SmaaS2x, Preset::High);
    let tables = Tables::new(&settings);
    let scene = disk(20.3, 17.1);
    let pictures = samples(&scene, size, Mode::SmaaS2x, 0);
    let mut frames =
        Frames::new(gpu, settings, size.map(|s| s as u32), TextureFormat::Rgba32Float, Dispatch::Tiles);
    let found = frames.run(&pictures, None, None);
    assert_close(&found, &filter_samples(&pictures, 0, &tables, &settings), 3e-5, "disk");
}

#[test]
fn still_images_take_half_of_the_previous_frame() {
    let Some(gpu) = gpu() else { return };
    let size = [41usize, 35];
    let still = vec![[0.0; 2]; size[0] * size[1]];
    let scene = disk(20.3, 17.1);
    for mode in [Mode::SmaaT2x, Mode::Smaa4x] {
        let settings = Settings::new(mode, Preset::High);
        let tables = Tables::new(&settings);
        let mut frames =
            Frames::new(gpu, settings, size.map(|s| s as u32), TextureFormat::Rgba32Float, Dispatch::Tiles);
        let reference = [0, 1]
            .map(|frame| filter_samples(&samples(&scene, size, mode, frame), frame, &tables, &settings));
        for frame in 0..4 {
            let found = frames.run(&samples(&scene, size, mode, frame), Some(&still), None);
            let expected = match frame {
                0 => reference[0].clone(),
                _ => average(&reference, &settings),
            };
            // The previous frame is kept in half floats: 1/2048 of the light, a little more once encoded.
            assert_close(&found, &expected, 5e-4, &format!("{} frame {frame}", mode.name()));
        }
        frames.history.invalidate();
        let cut = frames.run(&samples(&scene, size, mode, 4), Some(&still), None);
        assert_close(&cut, &reference[0], 3e-5, "after a cut");
    }
}

#[test]
fn a_new_size_starts_without_history() {
    let Some(gpu) = gpu() else { return };
    let settings = Settings::new(Mode::SmaaT2x, Preset::High);
    let make = |size: [u32; 2]| Frames::new(gpu, settings, size, TextureFormat::Rgba32Float, Dispatch::Tiles);
    let white = Picture::from_fn(20, 20, |_, _| [1.0; 4]);
    let black = Picture::from_fn(30, 10, |_, _| [0.0, 0.0, 0.0, 1.0]);
    let mut first = make([20, 20]);
    first.run(&[white], Some(&vec![[0.0; 2]; 400]), None);
    let mut second = make([30, 10]);
    second.history = first.history;
    assert_eq!(second.run(std::slice::from_ref(&black), Some(&vec![[0.0; 2]; 300]), None), black);
}

#[test]
fn moving_shapes_leave_no_trail() {
    let Some(gpu) = gpu() else { return };
    let size = [96usize, 48];
    let settings = Settings::new(Mode::SmaaT2x, Preset::High);
    let mut frames =
        Frames::new(gpu, settings, size.map(|s| s as u32), TextureFormat::Rgba32Float, Dispatch::Tiles);
    let step = 3.0;
    let place = |frame: u64| 14.0 + step * frame as f64;
    for frame in 0..20 {
        let scene = disk(place(frame), 24.0);
        let position = settings.mode.subsamples(frame)[0].position_px;
        let velocity: Vec<[f32; 2]> = sampled(&scene, size, position)
            .pixels
            .iter()
            .map(|color| if color[0] > 0.5 { [step as f32, 0.0] } else { [0.0, 0.0] })
            .collect();
        let found = frames.run(&samples(&scene, size, settings.mode, frame), Some(&velocity), None);
        for (i, color) in found.pixels.iter().enumerate() {
            let (x, y) = ((i % size[0]) as f64 + 0.5, (i / size[0]) as f64 + 0.5);
            let distance = (x - place(frame)).hypot(y - 24.0);
            // Naive mixing leaves half of the disk behind. Here all pixels that had a share of the disk, and their
            // neighbours, had its speed.
            if distance > 11.3 {
                assert!((color[0] - 0.1).abs() < 0.004, "frame {frame}: ({x}, {y}) is {color:?}");
            }
            if distance < 7.3 {
                assert!((color[0] - 0.8).abs() < 0.004, "frame {frame}: ({x}, {y}) is {color:?}");
            }
        }
    }
}

#[test]
fn the_list_of_tiles_is_empty_for_the_next_image() {
    let Some(gpu) = gpu() else { return };
    let settings = Settings::new(Mode::Smaa1x, Preset::High);
    let mut filter = Filter::new(gpu, settings).unwrap();
    let pictures = hostile_pictures(130, 70);
    let first: Vec<Picture> =
        pictures.iter().map(|(_, picture)| native::wait(gpu, filter.picture(picture)).unwrap()).collect();
    for ((name, picture), first) in pictures.iter().zip(&first).rev() {
        assert_eq!(&native::wait(gpu, filter.picture(picture)).unwrap(), first, "{name}");
    }
}

#[test]
fn outlines_of_what_moves_take_half_of_the_previous_frame() {
    let Some(gpu) = gpu() else { return };
    let size = [64usize, 48];
    let settings = Settings::new(Mode::SmaaT2x, Preset::High);
    let tables = Tables::new(&settings);
    let mut frames =
        Frames::new(gpu, settings, size.map(|s| s as u32), TextureFormat::Rgba32Float, Dispatch::Tiles);
    // A whole number of pixels per frame: in its own frame of reference the disk stands still.
    let scene = |frame: u64| disk(17.3 + 2.0 * frame as f64, 24.1);
    for frame in 0..6 {
        let position = settings.mode.subsamples(frame)[0].position_px;
        let velocity: Vec<[f32; 2]> = sampled(&scene(frame), size, position)
            .pixels
            .iter()
            .map(|color| if color[0] > 0.5 { [2.0, 0.0] } else { [0.0, 0.0] })
            .collect();
        let found = frames.run(&samples(&scene(frame), size, settings.mode, frame), Some(&velocity), None);
        if frame > 0 {
            let still = [0, 1].map(|turn| {
                filter_samples(&samples(&scene(frame), size, settings.mode, turn), turn, &tables, &settings)
            });
            let expected = average(&still, &settings);
            for (i, (a, b)) in found.pixels.iter().zip(&expected.pixels).enumerate() {
                let (x, y) = ((i % size[0]) as f64 + 0.5, (i / size[0]) as f64 + 0.5);
                let distance = (x - 17.3 - 2.0 * frame as f64).hypot(y - 24.1) - 9.3;
                // Further out only one of the samples may have the disk next to the pixel, so the history is rejected.
                if distance.abs() > 0.7 {
                    continue;
                }
                assert!((a[0] - b[0]).abs() < 2e-3, "frame {frame}: ({x}, {y}) is {a:?}, expected {b:?}");
            }
        }
    }
}

#[test]
fn history_fades_with_the_difference_of_speeds() {
    assert_eq!(history_share(0.01, 0.01), 0.5);
    assert!((history_share(0.0, 1.0 / 3600.0) - 0.25).abs() < 1e-6);
    assert_eq!(history_share(0.0, 1.0 / 900.0), 0.0);
    assert_eq!(history_share(0.3, 0.0), 0.0);
}

#[test]
fn more_samples_come_closer_to_coverage() {
    let size = [64usize, 64];
    let errors: Vec<f64> = [Mode::None, Mode::Mlaa, Mode::Smaa1x, Mode::SmaaS2x, Mode::Smaa4x]
        .into_iter()
        .map(|mode| {
            let settings = Settings { encoding: Encoding::Linear, ..Settings::new(mode, Preset::Ultra) };
            let tables = Tables::new(&settings);
            let (mut sum, mut count) = (0.0, 0.0);
            for degrees in (0..90).step_by(6) {
                let scene = half_plane(f64::from(degrees) + 0.3, [32.0, 32.2]);
                let frames = [0, 1].map(|frame| {
                    filter_samples(&samples(&scene, size, mode, frame), frame, &tables, &settings)
                });
                let result = average(&frames, &settings);
                for (x, y) in (16..48).flat_map(|y| (16..48).map(move |x| (x, y))) {
                    let truth = f64::from(covered(&scene, x, y, 8));
                    if truth > 0.0 && truth < 1.0 {
                        sum += (f64::from(result.at(x as isize, y as isize)[0]) - truth).powi(2);
                        count += 1.0;
                    }
                }
            }
            (sum / count).sqrt()
        })
        .collect();
    eprintln!("none, mlaa, 1x, S2x, 4x: {errors:.4?}");
    assert!(errors.windows(2).all(|pair| pair[1] < 0.9 * pair[0]), "{errors:?}");
}

#[test]
fn turned_and_mirrored_images_give_turned_and_mirrored_results() {
    // A disk and stairs of all slopes; the test counts pixels that the filter changes.
    let size = 64usize;
    let mut scenes: Vec<Box<Scene>> = vec![Box::new(disk(31.7, 32.4))];
    for degrees in (0..90).step_by(5) {
        scenes.push(Box::new(half_plane(f64::from(degrees), [32.13, 32.13])));
    }
    let pictures: Vec<Picture> = scenes.iter().map(|scene| sampled(scene, [size; 2], [0.0; 2])).collect();
    // Of more than two colours an edge may be masked by one to its right and not by one to its left (equation 10.1).
    let two_colors =
        hostile_pictures(size, size).into_iter().filter(|(name, _)| !["noise", "alpha"].contains(name));
    let pictures: Vec<Picture> = pictures.into_iter().chain(two_colors.map(|(_, picture)| picture)).collect();
    let settings = Settings::new(Mode::Smaa1x, Preset::High);
    let tables = Tables::new(&settings);
    let filter =
        |picture: &Picture| filter_sample(picture, None, &Mode::Smaa1x.subsamples(0)[0], &tables, &settings);
    let last = size - 1;
    type Place = fn(usize, usize, usize) -> (usize, usize);
    // Mirrored, upside down and transposed make all others. Each is its own inverse.
    let turns: [Place; 3] = [|x, y, last| (last - x, y), |x, y, last| (x, last - y), |x, y, _| (y, x)];
    for (name, turn) in ["mirrored", "upside down", "transposed"].into_iter().zip(turns) {
        let (mut changed, mut different) = (0, 0);
        for picture in &pictures {
            let turned = |from: &Picture| {
                Picture::from_fn(size, size, |x, y| {
                    let (x, y) = turn(x, y, last);
                    from.pixels[y * size + x]
                })
            };
            let (direct, turned) = (filter(picture), turned(&filter(&turned(picture))));
            for i in 0..size * size {
                let [a, b] = [direct.pixels[i], turned.pixels[i]];
                changed += usize::from(a != picture.pixels[i] || b != picture.pixels[i]);
                different += usize::from((0..4).any(|c| (a[c] - b[c]).abs() > 1.0 / 255.0));
            }
        }
        assert!(changed > 1000 && different == 0, "{name}: {different} of {changed} pixels");
    }
}

#[test]
fn searches_equal_those_with_the_search_texture() {
    // The published search on one line: bilinear fetches of two rows, two pixels per step, decoded by the texture.
    let table = lookups::search_texture_uncropped();
    let mut noise = SplitMix64(9);
    for _ in 0..2000 {
        let length = 80isize;
        let dense = (noise.uniform() as f32) * 0.3 + 0.7;
        let line: Vec<bool> = (0..length).map(|_| (noise.uniform() as f32) < dense).collect();
        let cross: [Vec<bool>; 2] =
            [0, 1].map(|_| (0..length).map(|_| (noise.uniform() as f32) > dense + 0.2).collect());
        let bit = |bits: &[bool], x: isize| usize::from(bits[x.clamp(0, length - 1) as usize]);
        // Sums of weights in 1/32; the row above has no edges along the line.
        let fetch = |x: isize, before: isize| {
            let along = 21 * bit(&line, x) + 7 * bit(&line, x + before);
            let across = 21 * bit(&cross[1], x)
                + 7 * bit(&cross[1], x + before)
                + 3 * bit(&cross[0], x)
                + bit(&cross[0], x + before);
            (across, along)
        };
        let start = 40;
        if !line[start as usize] {
            continue;
        }
        let steps = 8;
        let (mut at, mut last) = (start, (0, 0));
        for _ in 0..steps {
            last = fetch(at, -1);
            at -= 2;
            if last.1 != 28 || last.0 != 0 {
                break;
            }
        }
        // 127 stands for one pixel; the search went two pixels further than its last fetch.
        let left = start - (at + 3 - isize::from(u8::min(table[last.1 * 66 + last.0] / 127, 2)));
        let (mut at, mut last) = (start + 1, (0, 0));
        for _ in 0..steps {
            last = fetch(at, 1);
            at += 2;
            if last.1 != 28 || last.0 != 0 {
                break;
            }
        }
        let right = (at - 3 + isize::from(u8::min(table[last.1 * 66 + 33 + last.0] / 127, 2))) - start;

        let picture_edges = Edges {
            width: length as usize,
            height: 3,
            top: [vec![false; 80], line.clone(), vec![false; 80]].concat(),
            left: [cross[0].clone(), cross[1].clone(), vec![false; 80]].concat(),
        };
        let published = Settings::published(Mode::Smaa1x, Preset::High);
        let settings = Settings { search_steps: steps as u32, ..published };
        assert_eq!(row_distances(&picture_edges, start, 1, &settings), (left as u32, right as u32));
    }
}

#[test]
fn rust_and_wgsl_agree_on_the_parameters() {
    for mode in [Mode::Mlaa, Mode::Smaa1x, Mode::Smaa4x] {
        for step in [Step::Edges, Step::Weights, Step::Blend, Step::Resolve] {
            for (dispatch, format) in
                [(Dispatch::Tiles, "rgba8"), (Dispatch::Screen, "rgba16"), (Dispatch::Tiles, "rgba32")]
            {
                let (program, entry) = step.program(&Settings::new(mode, Preset::High), dispatch, format);
                assert_layout(
                    &program,
                    entry,
                    "Params",
                    size_of::<Params>(),
                    &offsets!(Params; size as "size", words as "words", thresholds as "thresholds",
                        search_limits as "search_limits", blocks as "blocks", first_column as "first_column",
                        stride as "stride", diagonal_base as "diagonal_base", diagonal_steps as "diagonal_steps",
                        depth_threshold as "depth_threshold", corner_rounding as "corner_rounding",
                        history_valid as "history_valid", falling_in_columns as "falling_in_columns"),
                );
                let group = match (step, dispatch) {
                    (Step::Edges, _) => [TILE, 8, 1],
                    (Step::Resolve, _) | (Step::Weights, Dispatch::Screen) => [8, 8, 1],
                    _ => [128, 1, 1],
                };
                assert_workgroups(&program, &[(entry, group)]);
            }
        }
    }
}

#[test]
fn settings_survive_json() {
    for mode in Mode::ALL {
        let settings =
            Settings { predication: Some(Predication::default()), ..Settings::new(mode, Preset::Low) };
        let json = serde_json::to_string(&settings).unwrap();
        assert!(json.contains(mode.name()), "{json}");
        assert_eq!(serde_json::from_str::<Settings>(&json).unwrap(), settings);
    }
    assert!(serde_json::from_str::<Settings>(r#"{"treshold": 0.1}"#).is_err());
}
