//! Reports: the measurements of a job (`stats.json`), a benchmark, a chart, a gallery.

use std::collections::BTreeMap;
use std::path::PathBuf;

use rubor_renderer::FrameStats;
use rubor_renderer::footprint::Footprint;
use rubor_renderer::settings::Settings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A report. In JSON, `of` names the kind of work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "of", rename_all = "kebab-case")]
#[schemars(title = "rubor report")]
pub enum Report {
    /// Frames of a job.
    Job(JobReport),
    /// GPU time of passes.
    Bench(BenchReport),
    /// Cost and error of methods.
    Chart(ChartReport),
    /// A page of pictures.
    Gallery(GalleryReport),
}

impl Report {
    /// JSON schema of the file.
    pub fn json_schema_value() -> Value {
        schemars::schema_for!(Self).to_value()
    }
}

/// The device that was used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct Adapter {
    /// Name given by the driver.
    pub name: String,
    /// Vulkan, Metal or Dx12.
    pub backend: String,
    /// Version of the driver.
    pub driver: String,
}

/// Frames of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct JobReport {
    /// Device.
    pub adapter: Adapter,
    /// How frames were made.
    pub settings: Settings,
    /// Frames of the job.
    pub frames: usize,
    /// Those that this run drew; the others existed already.
    pub frames_drawn: usize,
    /// From the start of the run to the first frame that was written.
    pub seconds_to_first_frame: Option<f64>,
    /// Median over the frames drawn, of the time between two of them.
    pub seconds_per_frame: Option<f64>,
    /// Median over the frames drawn; empty where the device has no timestamps.
    pub gpu_milliseconds_per_pass: BTreeMap<String, f64>,
    /// Triangles of all heads.
    pub triangles: u64,
    /// Heads, buffers and images of the last frame.
    pub device_memory_bytes: u64,
    /// Textures of the maps of the first head.
    pub map_textures: Vec<MapTexture>,
    /// Other files in the folder.
    pub files: Vec<PathBuf>,
    /// Notes, one line per kind.
    pub notes: Vec<String>,
}

/// A texture of a head.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct MapTexture {
    /// Its contents.
    pub texture: String,
    /// Texels of the largest level.
    pub size: [u32; 2],
    /// Layers of an array.
    pub layers: u32,
    /// Format as it is stored.
    pub format: String,
    /// Bytes as it is stored, all levels and layers.
    pub bytes: u64,
    /// Suitable block format.
    pub block_format: String,
    /// Bytes in that format.
    pub block_bytes: u64,
}

impl From<Footprint> for MapTexture {
    fn from(f: Footprint) -> Self {
        Self {
            texture: f.texture.to_owned(),
            size: f.size,
            layers: f.layers,
            format: f.format.to_owned(),
            bytes: f.bytes,
            block_format: f.block_format.to_owned(),
            block_bytes: f.block_bytes,
        }
    }
}

/// GPU time of passes for several settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct BenchReport {
    /// Device.
    pub adapter: Adapter,
    /// Frames that were timed for each.
    pub frames: u32,
    /// Warm-up frames before them, not timed.
    pub warm_up: u32,
    /// One row for each settings.
    pub rows: Vec<BenchRow>,
}

/// One settings and number of heads in milliseconds per frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct BenchRow {
    /// Its methods, and the other settings that differ between rows.
    pub name: String,
    /// How frames were made.
    pub settings: Settings,
    /// Heads side by side.
    pub heads: usize,
    /// From the beginning of the first pass to the end of the last.
    pub frame: PassCost,
    /// Each pass, in the order of its first run.
    pub passes: Vec<PassCost>,
}

/// A pass in milliseconds per frame, over all its runs within the frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct PassCost {
    /// Name.
    pub name: String,
    /// Times that it runs in a frame.
    pub runs: usize,
    /// Middle of all frames.
    pub median: f64,
    /// Tenth percentile.
    pub p10: f64,
    /// Ninetieth percentile.
    pub p90: f64,
}

/// Cost and error of methods on one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct ChartReport {
    /// Device.
    pub adapter: Adapter,
    /// Relative standard error of the diffuse light of `reference-surface`; the largest where it was drawn several times.
    pub surface_noise: Option<f64>,
    /// One for each method.
    pub methods: Vec<ChartRow>,
}

/// A method in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct ChartRow {
    /// Its scattering method, and the other settings that differ between rows.
    pub name: String,
    /// How the frame was made.
    pub settings: Settings,
    /// Relative RMSE of diffuse radiance before albedo, on skin, to `reference-screen`.
    pub relative_rmse_to_screen: f64,
    /// The same to `reference-surface`.
    pub relative_rmse_to_surface: f64,
    /// FLIP of the displayed picture to that of `reference-surface`, over skin.
    pub flip_mean: f64,
    /// Its 99th percentile.
    #[serde(rename = "flip99")]
    pub flip_99: f64,
    /// GPU milliseconds of scattering; none without timestamps.
    pub scatter_ms: Option<f64>,
}

/// A page of pictures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct GalleryReport {
    /// Device.
    pub adapter: Adapter,
    /// How pictures were made.
    pub settings: Settings,
    /// The page; none if it was not written.
    pub page: Option<PathBuf>,
    /// Pictures in the order in which they stand on the page.
    pub pictures: Vec<GalleryPicture>,
}

/// A picture on the page.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct GalleryPicture {
    /// Its subject.
    pub name: String,
    /// Frame of its sequence, from 1.
    pub frame: u32,
    /// Name of the light rig.
    pub light: String,
    /// Name of the head.
    pub head: String,
}

/// GPU times over frames.
#[derive(Default)]
pub(crate) struct PassTimes {
    by_pass: BTreeMap<&'static str, Vec<f64>>,
    pub(crate) triangles: u64,
    pub(crate) memory_bytes: u64,
}

impl PassTimes {
    pub(crate) fn add(&mut self, stats: &FrameStats) {
        let mut frame: BTreeMap<&'static str, f64> = BTreeMap::new();
        for (name, ms) in &stats.passes_ms {
            *frame.entry(name).or_default() += ms;
        }
        for (name, ms) in frame {
            self.by_pass.entry(name).or_default().push(ms);
        }
        self.triangles = stats.triangles;
        self.memory_bytes = stats.memory_bytes;
    }

    pub(crate) fn medians(&mut self) -> BTreeMap<String, f64> {
        let medians = self.by_pass.iter_mut().map(|(name, ms)| Some(((*name).to_owned(), median(ms)?)));
        medians.flatten().collect()
    }
}

/// The median of values, which are sorted for it.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
