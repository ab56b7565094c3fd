//! The picture in the window: drawn by the renderer on the window's own device, into a texture that the window shows. Nothing
//! is read back, unless an overlay or a file needs it.
//!
//! ```text
//! Model --shot, settings--> Studio::draw_into --> texture --> window
//!                                             \-> times of the passes, when the device is done
//! ```

use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, Waker};
use std::time::Instant;

use eframe::egui;
use eframe::egui_wgpu::RenderState;
use image::RgbImage;
use rubor_renderer::channels::{Channel, ChannelData};
use rubor_renderer::settings::{DetailMethod, ScatterMethod, Settings};
use rubor_renderer::{FrameTimes, Gpu, RenderError, native};
use rubor_rig::evaluate::Shot;

use super::model::Model;
use crate::error::{Failure, Outcome};
use crate::inputs::LoadedHead;
use crate::plan::spacing_m;
use crate::studio::{Frame, Studio};

/// Shadow maps of smaller pictures are smaller too, down to this.
const LEAST_SHADOW_SIZE: u32 = 256;

type Pending = Pin<Box<dyn Future<Output = Result<FrameTimes, RenderError>>>>;

/// The picture.
pub(crate) struct Picture {
    studio: Studio,
    state: RenderState,
    target: Option<Target>,
    head: Option<Arc<LoadedHead>>,
    pending: Option<Pending>,
    times: FrameTimes,
    /// From the submission of a frame to its end, milliseconds: set by the device.
    finished_ms: Arc<Mutex<Option<f64>>>,
    frame_ms: f64,
    is_busy: bool,
    /// Asks the thread that waits for the device.
    waits: std::sync::mpsc::Sender<()>,
    is_lost: Arc<std::sync::atomic::AtomicBool>,
    /// The last frame drawn, where antialiasing over time goes on.
    last_frame: Option<u32>,
    drawn: u64,
}

struct Target {
    texture: wgpu::Texture,
    id: egui::TextureId,
    size: [u32; 2],
}

impl Picture {
    /// A picture on the device of a window; `wake` is called when the device has finished a frame.
    ///
    /// # Errors
    /// The device refuses a shader.
    pub(crate) fn new(state: RenderState, wake: impl Fn() + Send + 'static) -> Outcome<Self> {
        let gpu = Gpu::from_device(state.device.clone(), state.queue.clone(), state.adapter.get_info());
        let (waits, asked) = std::sync::mpsc::channel();
        let is_lost = Arc::new(std::sync::atomic::AtomicBool::new(false));
        let (device, lost) = (state.device.clone(), is_lost.clone());
        std::thread::spawn(move || {
            for () in asked {
                let waited = device.poll(wgpu::PollType::wait_indefinitely());
                if waited.is_err() {
                    lost.store(true, std::sync::atomic::Ordering::Relaxed);
                }
                wake();
            }
        });
        Ok(Self {
            studio: Studio::on(gpu)?,
            state,
            target: None,
            head: None,
            pending: None,
            times: FrameTimes::default(),
            finished_ms: Arc::default(),
            frame_ms: 0.0,
            is_busy: false,
            waits,
            is_lost,
            last_frame: None,
            drawn: 0,
        })
    }

    /// The device.
    pub(crate) fn gpu(&self) -> &Gpu {
        self.studio.gpu()
    }

    /// Name of the device.
    pub(crate) fn adapter(&self) -> String {
        self.studio.adapter().name
    }

    /// What the window shows: texture and size in pixels.
    pub(crate) fn shown(&self) -> Option<(egui::TextureId, [u32; 2])> {
        self.target.as_ref().map(|t| (t.id, t.size))
    }

    /// Times of the passes of the last frame that the device has finished.
    pub(crate) fn times(&self) -> &FrameTimes {
        &self.times
    }

    /// Milliseconds from the submission of the last finished frame to its end.
    pub(crate) fn frame_ms(&self) -> f64 {
        self.frame_ms
    }

    /// Whether the device works on a frame.
    pub(crate) fn is_busy(&self) -> bool {
        self.is_busy
    }

    /// Frames that were drawn.
    pub(crate) fn drawn(&self) -> u64 {
        self.drawn
    }

    /// Bytes of the head on the device.
    pub(crate) fn head_bytes(&self) -> u64 {
        self.studio.head_bytes()
    }

    /// Notes on surroundings since the last call.
    pub(crate) fn take_notes(&mut self) -> Vec<crate::notes::Note> {
        self.studio.take_notes()
    }

    /// Whether a frame of these settings is drawn in one go; others take too long for a window to wait.
    pub(crate) fn draws_at_once(settings: &Settings) -> bool {
        !matches!(settings.quality.scatter, ScatterMethod::ReferenceSurface(_))
    }

    /// Puts the head of the model onto the device, unless it is there.
    ///
    /// # Errors
    /// The head does not fit the device; the one before stays.
    pub(crate) fn take_head(&mut self, head: &Arc<LoadedHead>) -> Outcome {
        if self.head.as_ref().is_none_or(|known| !Arc::ptr_eq(known, head)) {
            self.studio.set_heads([&head.head])?;
            self.head = Some(head.clone());
        }
        Ok(())
    }

    /// Submits a frame of the model, `divisor` times smaller than its settings say. `channels` can be read afterwards.
    ///
    /// # Errors
    /// Surroundings that do not load; settings that the device cannot draw; the device is lost.
    pub(crate) fn draw(&mut self, model: &Model, divisor: u32, channels: &[Channel]) -> Outcome {
        self.take_head(&model.head)?;
        let settings = Self::settings(model, divisor, channels);
        let spacing = spacing_m([&model.head.head]);
        let texture = self.target(settings.output.size);
        // Antialiasing over time depends on frames before; a frame that follows the last one has them.
        let frame = model.frame();
        if settings.quality.antialias.is_temporal() {
            if self.last_frame.and_then(|f| f.checked_add(1)) != Some(frame) {
                let start = frame.saturating_sub(crate::plan::REMEMBERED_FRAMES);
                self.studio.cut(start);
                for earlier in start..frame {
                    let shot = model.shot_at(model.composed().frame_time_s(earlier));
                    self.studio.draw_into(&[shot], spacing, &settings, &texture)?;
                }
            }
        } else {
            self.studio.cut(frame);
        }
        self.last_frame = Some(frame);
        let start = Instant::now();
        let times = self.studio.draw_into(&[model.shot()], spacing, &settings, &texture)?;
        self.pending = Some(Box::pin(times.read()));
        let finished = self.finished_ms.clone();
        self.gpu().queue.on_submitted_work_done(move || {
            if let Ok(mut slot) = finished.lock() {
                *slot = Some(start.elapsed().as_secs_f64() * 1e3);
            }
        });
        self.is_busy = true;
        self.drawn += 1;
        // The thread lives as long as the picture.
        let _ = self.waits.send(());
        Ok(())
    }

    /// Whether the device is gone for good.
    pub(crate) fn is_lost(&self) -> bool {
        self.is_lost.load(std::sync::atomic::Ordering::Relaxed) || self.gpu().is_lost()
    }

    /// Forgets the surroundings: their image is read again.
    pub(crate) fn forget_surroundings(&mut self) {
        self.studio.forget_surroundings();
    }

    /// The settings that frames of the window are drawn with.
    fn settings(model: &Model, divisor: u32, channels: &[Channel]) -> Settings {
        let mut settings = model.settings.clone();
        settings.output.size = settings.output.size.map(|n| n.div_ceil(divisor.max(1)));
        if divisor > 1 {
            let shadow_size = &mut settings.quality.shadow_size;
            *shadow_size = (*shadow_size / divisor).max(LEAST_SHADOW_SIZE.min(*shadow_size));
        }
        settings.output.channels = channels.to_vec();
        if !channels.is_empty() {
            // Ids number the triangles of the whole head.
            settings.quality.detail = DetailMethod::Full;
        }
        settings
    }

    /// Waits until the device has finished what it was given.
    pub(crate) fn wait(&self) {
        // A lost device is said by `poll`.
        let _ = self.gpu().device.poll(wgpu::PollType::wait_indefinitely());
    }

    /// Looks, without waiting, at what the device has finished. Whether there is news.
    ///
    /// # Errors
    /// The device is lost.
    pub(crate) fn poll(&mut self) -> Outcome<bool> {
        // A lost device is said by the check below.
        let _ = self.gpu().device.poll(wgpu::PollType::Poll);
        self.gpu().check()?;
        let mut news = false;
        if let Some(ms) = self.finished_ms.lock().ok().and_then(|mut slot| slot.take()) {
            self.frame_ms = ms;
            self.is_busy = false;
            news = true;
        }
        if let Some(pending) = &mut self.pending
            && let Poll::Ready(times) = pending.as_mut().poll(&mut Context::from_waker(Waker::noop()))
        {
            self.pending = None;
            self.times = times?;
            news = true;
        }
        Ok(news)
    }

    /// Shows a picture that was drawn elsewhere.
    pub(crate) fn show(&mut self, frame: &Frame) {
        let size = [frame.image.width, frame.image.height];
        let texture = self.target(size);
        self.gpu().queue.write_texture(
            texture.as_image_copy(),
            &frame.image.rgba,
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * size[0]), rows_per_image: None },
            wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
        );
        self.times.passes_ms.clone_from(&frame.stats.passes_ms);
        self.times.frame_ms = frame.stats.passes_ms.iter().map(|(_, ms)| ms).sum();
        self.drawn += 1;
        self.last_frame = None;
    }

    /// A channel of the last frame. Waits for the device.
    ///
    /// # Errors
    /// The device failed.
    pub(crate) fn read(&self, channel: Channel) -> Outcome<ChannelData> {
        self.studio.read(channel)
    }

    /// The picture as it is. Waits for the device.
    ///
    /// # Errors
    /// Nothing was drawn; the device failed.
    pub(crate) fn image(&self) -> Outcome<RgbImage> {
        let Some(Target { texture, size: [width, height], .. }) = &self.target else {
            return Err(Failure::job("no picture was drawn yet"));
        };
        let rgba = native::wait(self.gpu(), self.gpu().read_texture(texture))?;
        let rgb: Vec<u8> = rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        RgbImage::from_raw(*width, *height, rgb).ok_or_else(|| Failure::job("the picture is incomplete"))
    }

    /// The texture of a size; the window keeps its number.
    fn target(&mut self, size: [u32; 2]) -> wgpu::Texture {
        if let Some(target) = self.target.as_ref().filter(|t| t.size == size) {
            return target.texture.clone();
        }
        let usage = wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::COPY_DST;
        let format = wgpu::TextureFormat::Rgba8Unorm;
        let texture = self.gpu().target("picture", size, format, usage);
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut renderer = self.state.renderer.write();
        let device = &self.state.device;
        let filter = wgpu::FilterMode::Linear;
        let id = match &self.target {
            Some(target) => {
                renderer.update_egui_texture_from_wgpu_texture(device, &view, filter, target.id);
                target.id
            }
            None => renderer.register_native_texture(device, &view, filter),
        };
        drop(renderer);
        self.last_frame = None;
        self.target = Some(Target { texture: texture.clone(), id, size });
        texture
    }
}

/// Everything of a still that is drawn elsewhere.
#[derive(Clone)]
pub(crate) struct Still {
    /// The head.
    pub(crate) head: Arc<LoadedHead>,
    /// Face, camera and lights.
    pub(crate) shot: Shot,
    /// How it is drawn.
    pub(crate) settings: Settings,
}

impl Still {
    /// The picture of a model.
    pub(crate) fn of(model: &Model) -> Self {
        let mut settings = model.settings.clone();
        settings.output.channels.clear();
        Self { head: model.head.clone(), shot: model.shot(), settings }
    }

    /// Draws it and waits for it.
    ///
    /// # Errors
    /// As [`Studio::draw`].
    pub(crate) fn draw(&self, studio: &mut Studio) -> Outcome<Frame> {
        studio.cut(0);
        studio.render(std::slice::from_ref(&self.shot), spacing_m([&self.head.head]), &self.settings)
    }
}
