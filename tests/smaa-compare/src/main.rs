//! Compares the antialiasing pass with the `smaa` crate (0.21, luma edges, preset high) on the images named on the
//! command line: how many pixels agree, and how long both take on the same adapter in the same run.
//!
//! The crate reads and mixes the values of its target as they are. A plain 8-bit target makes it detect edges in
//! encoded colour, which is right, and mix in encoded colour, so the pass is told to do the same.
//!
//! `RUBOR_RUNS` sets how often each time is taken (default 20, the median counts).

use rubor_renderer::{Gpu, PassTimer};
use rubor_renderer::antialias::{
    Antialias, BlendSpace, Filter, reference::Picture, Dispatch, History, Inputs, Mode, Preset, Settings,
};
use std::time::Instant;
use wgpu::{TextureFormat, TextureUsages};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

const FORMAT: TextureFormat = TextureFormat::Rgba8Unorm;

/// Draws a texture over the whole target, texel by texel.
const COPY: &str = "
@group(0) @binding(0) var source: texture_2d<f32>;
@vertex fn corner(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> {
    return vec4(vec2(f32(i & 1u), f32(i >> 1u)) * 4.0 - 1.0, 0.0, 1.0);
}
@fragment fn copy(@builtin(position) p: vec4<f32>) -> @location(0) vec4<f32> {
    return textureLoad(source, vec2<i32>(p.xy), 0);
}";

fn main() -> Result<()> {
    let gpu = Gpu::new(std::env::var("RUBOR_ADAPTER").ok().as_deref())?;
    let runs: usize = std::env::var("RUBOR_RUNS").ok().and_then(|runs| runs.parse().ok()).unwrap_or(20);
    println!("adapter: {} ({:?}, {})", gpu.info.name, gpu.info.backend, gpu.info.driver_info);
    println!("\npixels, luma edges, preset high, mixed as stored");
    println!("image                      within 1/255   mean difference/255   largest/255   changed pixels within 1/255");
    let mut first = None;
    for path in std::env::args().skip(1) {
        let image = image::open(&path)?.to_rgba8();
        let bench = Bench::new(&gpu, &image)?;
        let theirs = bench.theirs(&gpu)?;
        let ours = bench.ours(&gpu)?;
        let name = std::path::Path::new(&path).file_name().unwrap_or_default().to_string_lossy().into_owned();
        report(&name, &image, &ours, &theirs);
        explain(&gpu, &image, &ours, &theirs)?;
        if let Some(folder) = std::env::var_os("RUBOR_OUT") {
            let folder = std::path::PathBuf::from(folder);
            let save = |suffix: &str, bytes: Vec<u8>| {
                image::RgbaImage::from_raw(image.width(), image.height(), bytes)
                    .ok_or("wrong size")
                    .map(|out| out.save(folder.join(format!("{name}.{suffix}.png"))))
            };
            save("ours", ours)??;
            save("theirs", theirs)??;
        }
        first.get_or_insert(image);
    }
    let Some(first) = first else { return Err("name at least one image".into()) };
    for (width, height) in [(1280, 720), (1920, 1080)] {
        let image = image::RgbaImage::from_fn(width, height, |x, y| {
            *first.get_pixel(x % first.width(), y % first.height())
        });
        times(&gpu, &image, runs)?;
    }
    Ok(())
}

/// What the crate does.
fn as_published() -> Settings {
    Settings {
        blend_space: BlendSpace::Stored,
        ..Settings::published(Mode::Smaa1x, Preset::High)
    }
}

/// Sorts the pixels that differ by more than 1/255 by the weights there: whether the directions are a tie, so that one
/// step of rounding decides which neighbours are taken.
fn explain(gpu: &Gpu, image: &image::RgbaImage, ours: &[u8], theirs: &[u8]) -> Result<()> {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let pixels = image.pixels().map(|pixel| pixel.0.map(|v| f32::from(v) / 255.0)).collect();
    let weights = Filter::new(gpu, as_published())?.weights(&Picture { width, height, pixels })?;
    let weight = |x: usize, y: usize, channel: usize| {
        if x < width && y < height { i32::from(weights[y * width + x][channel]) } else { 0 }
    };
    // Of differences up to 3 and of larger ones: all, and those at ties of up to 2 and up to 4 steps of 1/255.
    let mut counts = [[0; 3]; 2];
    for i in 0..width * height {
        let worst = (0..3).map(|c| ours[4 * i + c].abs_diff(theirs[4 * i + c])).max().unwrap_or(0);
        if worst > 1 {
            let (x, y) = (i % width, i / width);
            let vertical = weight(x, y, 0).max(weight(x, y + 1, 1));
            let horizontal = weight(x, y, 2).max(weight(x + 1, y, 3));
            let counts = &mut counts[usize::from(worst > 3)];
            counts[0] += 1;
            counts[1] += usize::from((vertical - horizontal).abs() <= 2);
            counts[2] += usize::from((vertical - horizontal).abs() <= 4);
        }
    }
    for (name, [all, two, four]) in ["2 to 3", "over 3"].into_iter().zip(counts) {
        println!("    differences of {name:<7} {all:>5}: directions within 2/255 at {two:>5}, within 4/255 at {four:>5}");
    }
    Ok(())
}

fn report(name: &str, input: &image::RgbaImage, ours: &[u8], theirs: &[u8]) {
    let pixels = ours.chunks(4).zip(theirs.chunks(4)).zip(input.as_raw().chunks(4));
    let (mut near, mut changed, mut changed_near, mut sum, mut largest) = (0, 0, 0, 0u64, 0);
    for ((a, b), original) in pixels {
        let worst = (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap_or(0);
        sum += (0..3).map(|c| u64::from(a[c].abs_diff(b[c]))).sum::<u64>();
        largest = largest.max(worst);
        near += u32::from(worst <= 1);
        if a != original || b != original {
            changed += 1;
            changed_near += u32::from(worst <= 1);
        }
    }
    let count = ours.len() as f64 / 4.0;
    println!(
        "{name:<26} {:>10.4} % {:>17.5} {largest:>13} {:>20.3} % of {changed}",
        100.0 * f64::from(near) / count,
        sum as f64 / (3.0 * count),
        100.0 * f64::from(changed_near) / f64::from(changed),
    );
}

/// An image on the device, with what both sides need.
struct Bench {
    size: [u32; 2],
    input: wgpu::Texture,
    output: wgpu::Texture,
}

impl Bench {
    fn new(gpu: &Gpu, image: &image::RgbaImage) -> Result<Self> {
        let size = [image.width(), image.height()];
        let usage = TextureUsages::TEXTURE_BINDING
            | TextureUsages::STORAGE_BINDING
            | TextureUsages::RENDER_ATTACHMENT
            | TextureUsages::COPY_SRC
            | TextureUsages::COPY_DST;
        let target = |label| gpu.target(label, size, FORMAT, usage);
        let (input, output) = (target("input"), target("output"));
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * size[0]), rows_per_image: None };
        gpu.queue.write_texture(input.as_image_copy(), image.as_raw(), layout, input.size());
        Ok(Self { size, input, output })
    }

    fn view(texture: &wgpu::Texture) -> wgpu::TextureView {
        texture.create_view(&Default::default())
    }

    fn ours(&self, gpu: &Gpu) -> Result<Vec<u8>> {
        let pass = Antialias::new(gpu, &as_published(), self.size, FORMAT)?;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let input = Self::view(&self.input);
        let inputs = Inputs { colors: &[&input], ..Default::default() };
        pass.record(gpu, &mut encoder, &mut PassTimer::new(gpu), &inputs, &Self::view(&self.output), None)?;
        gpu.queue.submit([encoder.finish()]);
        Ok(gpu.read_texture(&self.output)?)
    }

    fn theirs(&self, gpu: &Gpu) -> Result<Vec<u8>> {
        let mut target = self.their_target(gpu);
        let output = Self::view(&self.output);
        let frame = target.start_frame(&gpu.device, &gpu.queue, &output);
        self.copy_to(gpu, &frame);
        frame.resolve();
        Ok(gpu.read_texture(&self.output)?)
    }

    fn their_target(&self, gpu: &Gpu) -> smaa::SmaaTarget {
        let [width, height] = self.size;
        smaa::SmaaTarget::new(&gpu.device, &gpu.queue, width, height, FORMAT, smaa::SmaaMode::Smaa1X)
    }

    fn copy_to(&self, gpu: &Gpu, target: &wgpu::TextureView) {
        let module = gpu.shader("copy", COPY);
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("copy"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("corner"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: None,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("copy"),
                compilation_options: Default::default(),
                targets: &[Some(FORMAT.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let source = wgpu::BindingResource::TextureView(&Self::view(&self.input));
        let group = gpu.bind_layout("copy", &pipeline.get_bind_group_layout(0), &[source]);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("copy"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: target,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..Default::default()
            });
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..3, 0..1);
        }
        gpu.queue.submit([encoder.finish()]);
    }
}

fn wait(gpu: &Gpu) -> Result<()> {
    gpu.device.poll(wgpu::PollType::wait_indefinitely())?;
    Ok(gpu.check()?)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Milliseconds from recording to the device being idle again, and by the device's clock where it has one.
fn times(gpu: &Gpu, image: &image::RgbaImage, runs: usize) -> Result<()> {
    let bench = Bench::new(gpu, image)?;
    let (input, output) = (Bench::view(&bench.input), Bench::view(&bench.output));
    println!("\n{} x {}, median of {runs}            wall ms   device ms   passes   MiB", bench.size[0], bench.size[1]);
    let mut target = bench.their_target(gpu);
    let mut wall = Vec::new();
    for run in 0..runs + 3 {
        let frame = target.start_frame(&gpu.device, &gpu.queue, &output);
        if run == 0 {
            bench.copy_to(gpu, &frame);
        }
        wait(gpu)?;
        let started = Instant::now();
        frame.resolve();
        wait(gpu)?;
        if run >= 3 {
            wall.push(started.elapsed().as_secs_f64() * 1e3);
        }
    }
    println!("smaa crate 1x high                   {:>9.3}", median(wall));

    let velocity = gpu.target("velocity", bench.size, TextureFormat::Rg32Float, TextureUsages::TEXTURE_BINDING);
    let velocity = Bench::view(&velocity);
    for (mode, preset, dispatch) in [
        (Mode::Smaa1x, Preset::High, Dispatch::Tiles),
        (Mode::Smaa1x, Preset::High, Dispatch::Screen),
        (Mode::Smaa1x, Preset::Low, Dispatch::Tiles),
        (Mode::Smaa1x, Preset::Ultra, Dispatch::Tiles),
        (Mode::Mlaa, Preset::High, Dispatch::Tiles),
        (Mode::SmaaT2x, Preset::High, Dispatch::Tiles),
        (Mode::SmaaS2x, Preset::High, Dispatch::Tiles),
        (Mode::Smaa4x, Preset::High, Dispatch::Tiles),
    ] {
        let settings = Settings::new(mode, preset);
        let pass = Antialias::with_dispatch(gpu, &settings, bench.size, FORMAT, dispatch)?;
        let mut history = History::new(gpu, bench.size);
        let mut timer = PassTimer::new(gpu);
        let (mut wall, mut device) = (Vec::new(), Vec::new());
        let mut passes = String::new();
        for run in 0..runs + 3 {
            timer.restart();
            let colors = vec![&input; mode.subsamples(0).len()];
            let inputs =
                Inputs { colors: &colors, velocity: Some(&velocity), frame: run as u64, ..Default::default() };
            wait(gpu)?;
            let started = Instant::now();
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            let kept = mode.is_temporal().then_some(&mut history);
            pass.record(gpu, &mut encoder, &mut timer, &inputs, &output, kept)?;
            timer.resolve(&mut encoder);
            gpu.queue.submit([encoder.finish()]);
            wait(gpu)?;
            if run >= 3 {
                wall.push(started.elapsed().as_secs_f64() * 1e3);
                let read = timer.read(gpu)?;
                device.push(read.iter().map(|(_, ms)| ms).sum::<f64>());
                let parts: Vec<String> = read.iter().map(|(_, ms)| format!("{ms:.4}")).collect();
                passes = parts.join(" ");
            }
        }
        let memory = pass.memory_bytes() + if mode.is_temporal() { history.memory_bytes() } else { 0 };
        println!(
            "rubor {:<9} {:<7} {:<8}        {:>9.3}   {:>9.4}   {passes}   {:.1}",
            mode.name(),
            format!("{preset:?}").to_lowercase(),
            format!("{dispatch:?}").to_lowercase(),
            median(wall),
            median(device),
            memory as f64 / f64::from(1 << 20),
        );
    }
    Ok(())
}
