//! Work that takes longer than a frame of a window: stills by methods that do not draw in one go, the error against the
//! reference, heads that are read again. Each on a thread, with a device of its own; the window goes on.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

use image::RgbImage;
use rubor_assets::compare::{flip, mean_and_percentile, relative_rmse};
use rubor_renderer::settings::{ScatterMethod, Settings};

use super::frame::Still;
use crate::error::Outcome;
use crate::inputs::{self, LoadedHead};
use crate::measure::difference;
use crate::studio::{Frame, Studio};

/// Pixels per degree at which differences are seen: FLIP's usual 0.7 m from a display of 0.7 m and 3840 pixels.
const PIXELS_PER_DEGREE: f64 = 67.0;
/// Batches of samples of the reference.
const REFERENCE_BATCHES: u32 = 64;
/// Longest side of the pictures that are compared on a processor, pixels.
const COMPARED_ON_PROCESSOR: u32 = 256;

/// What is to be done.
pub(crate) enum Task {
    /// Draw a still; the number is that of the state it shows.
    Draw(Still, u64),
    /// Compare the settings of a still with the reference.
    Compare(Still),
    /// Read the head of a file again.
    Read(Option<PathBuf>),
}

/// What was done.
pub(crate) enum Done {
    /// A still and the number of its state.
    Drawn(Outcome<Frame>, u64),
    /// How far settings are from the reference.
    Compared(Outcome<Comparison>),
    /// A head.
    Read(Outcome<LoadedHead>),
}

/// Settings beside the reference.
pub(crate) struct Comparison {
    /// Mean of the visible difference.
    pub(crate) flip_mean: f64,
    /// Its 99th percentile.
    pub(crate) flip_99: f64,
    /// Relative root mean square error of the displayed light.
    pub(crate) relative_rmse: f64,
    /// Size of the compared pictures.
    pub(crate) size: [u32; 2],
    /// The settings that were compared.
    pub(crate) settings: Settings,
    /// Where the difference is seen.
    pub(crate) difference: RgbImage,
}

/// A thread that does tasks in order.
pub(crate) struct Background {
    tasks: Sender<Task>,
    done: Receiver<Done>,
    waiting: usize,
}

impl Background {
    /// Starts the thread; `wake` is called after each task.
    pub(crate) fn new(adapter: Option<String>, wake: impl Fn() + Send + 'static) -> Self {
        let (tasks, receiver) = channel();
        let (sender, done) = channel();
        std::thread::spawn(move || {
            let mut worker = Worker { adapter, studio: None, head: None };
            for task in receiver {
                if sender.send(worker.work(task)).is_err() {
                    return;
                }
                wake();
            }
        });
        Self { tasks, done, waiting: 0 }
    }

    /// Adds a task.
    pub(crate) fn add(&mut self, task: Task) {
        if self.tasks.send(task).is_ok() {
            self.waiting += 1;
        }
    }

    /// Whether tasks wait or run.
    pub(crate) fn is_busy(&self) -> bool {
        self.waiting > 0
    }

    /// What was done since the last call.
    pub(crate) fn done(&mut self) -> Vec<Done> {
        let done: Vec<Done> = self.done.try_iter().collect();
        self.waiting -= done.len().min(self.waiting);
        done
    }
}

struct Worker {
    adapter: Option<String>,
    studio: Option<Studio>,
    head: Option<Arc<LoadedHead>>,
}

impl Worker {
    fn work(&mut self, task: Task) -> Done {
        match task {
            Task::Draw(still, version) => {
                let drawn = self.studio(&still).and_then(|studio| still.draw(studio));
                Done::Drawn(drawn, version)
            }
            Task::Compare(still) => Done::Compared(self.compare(still)),
            Task::Read(path) => Done::Read(inputs::head(path.as_deref())),
        }
    }

    /// The studio with the head of a still in it.
    fn studio(&mut self, still: &Still) -> Outcome<&mut Studio> {
        let mut studio = match self.studio.take() {
            Some(studio) => studio,
            None => Studio::open(self.adapter.as_deref())?,
        };
        if self.head.as_ref().is_none_or(|known| !Arc::ptr_eq(known, &still.head)) {
            studio.set_heads([&still.head.head])?;
            self.head = Some(still.head.clone());
        }
        Ok(self.studio.insert(studio))
    }

    /// Draws both and says how far they are apart. The reference differs in what `quality` chooses, not in antialiasing: the
    /// error is that of light and colour.
    fn compare(&mut self, mut still: Still) -> Outcome<Comparison> {
        let is_software = self.studio(&still)?.is_software();
        let size = &mut still.settings.output.size;
        let longest = size.iter().copied().max().unwrap_or(1);
        if is_software && longest > COMPARED_ON_PROCESSOR {
            *size = size.map(|n| (n * COMPARED_ON_PROCESSOR / longest).max(1));
        }
        let size = *size;
        let settings = still.settings.clone();
        let test = still.draw(self.studio(&still)?)?;
        let mut best = rubor_renderer::settings::Preset::Reference.quality();
        best.scatter = ScatterMethod::ReferenceSurface(REFERENCE_BATCHES);
        best.antialias = settings.quality.antialias;
        best.antialias_preset = settings.quality.antialias_preset;
        best.antialias_patterns = settings.quality.antialias_patterns;
        best.profile = settings.quality.profile.clone();
        best.raster = settings.quality.raster;
        still.settings.quality = best;
        let reference = still.draw(self.studio(&still)?)?;
        let (t, r) = (difference::pixels(&test.image), difference::pixels(&reference.image));
        let map = flip::ldr(&t, &r, PIXELS_PER_DEGREE);
        let (flip_mean, flip_99) = mean_and_percentile(&map);
        Ok(Comparison {
            flip_mean,
            flip_99,
            relative_rmse: relative_rmse(&t.linear, &r.linear),
            size,
            settings,
            difference: difference::picture(&map, size[0], size[1]),
        })
    }
}
