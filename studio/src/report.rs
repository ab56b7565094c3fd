//! Reports: the measurements of a job (`stats.json`), a benchmark, a chart, a budget, a gallery.

mod budget;

use std::collections::BTreeMap;
use std::path::PathBuf;

use rubor_renderer::FrameStats;
use rubor_renderer::footprint::Footprint;
use rubor_renderer::settings::Settings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use budget::{
    BudgetCoding, BudgetError, BudgetFate, BudgetFrame, BudgetItem, BudgetKind, BudgetReport, BudgetSequence,
    BudgetTotals,
};

use crate::measure::chart::Measure;
use crate::measure::volume::MediumName;
use crate::utilisation::Utilisation;

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
    /// Steadiness of methods while something moves.
    Stability(StabilityReport),
    /// Choices of `auto` beside every fixed setting.
    Auto(AutoReport),
    /// What sequences need of a head.
    Budget(BudgetReport),
    /// Light of methods beside that of the volume.
    Volume(VolumeReport),
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
    /// What was chosen for frames, in words, where settings are chosen by need.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub auto: Vec<AutoRun>,
    /// Frames of the job.
    pub frames: usize,
    /// Those that this run drew; the others existed already.
    pub frames_drawn: usize,
    /// From the start of the run to the first frame that was written.
    pub seconds_to_first_frame: Option<f64>,
    /// Median over the frames drawn, of the time between two of them.
    pub seconds_per_frame: Option<f64>,
    /// What was at work while frames were drawn; none if no frame was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub utilisation: Option<Utilisation>,
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

/// Frames with the same choices.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct AutoRun {
    /// Numbers of frames from 1.
    pub frames: String,
    /// Choices, and the estimated error and time of the first of these frames.
    pub chosen: String,
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

impl PassCost {
    /// From the milliseconds of all frames.
    pub(crate) fn of(name: &str, runs: usize, mut ms: Vec<f64>) -> Self {
        ms.sort_by(f64::total_cmp);
        let at =
            |share: f64| ms.get(((ms.len() as f64 - 1.0) * share).round() as usize).copied().unwrap_or(0.0);
        Self { name: name.to_owned(), runs, median: at(0.5), p10: at(0.1), p90: at(0.9) }
    }
}

/// Cost and error of choices in scenes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct ChartReport {
    /// Device.
    pub adapter: Adapter,
    /// The base: each group changes one setting of it.
    pub settings: Settings,
    /// Rounds, warm-up frames and timed frames of a choice in a scene and a round; none if nothing was timed.
    pub timing: Option<[u32; 3]>,
    /// What was drawn.
    pub scenes: Vec<ChartScene>,
    /// What was compared.
    pub groups: Vec<ChartGroup>,
}

/// A scene of a chart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct ChartScene {
    /// Name.
    pub name: String,
    /// The failure that it provokes.
    pub provokes: String,
    /// Relative standard error of the diffuse light of `reference-surface`.
    pub noise: Option<f64>,
}

/// Choices that differ in one setting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct ChartGroup {
    /// The flag of the setting.
    pub flag: String,
    /// What the error is.
    pub measure: Measure,
    /// The settings that count as right.
    pub truth: String,
    /// Right pictures, one for each scene, relative to the report.
    pub truth_pictures: Vec<String>,
    /// The choices.
    pub choices: Vec<ChartChoice>,
}

/// A choice in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct ChartChoice {
    /// The value of the setting, and what else differs from the base.
    pub name: String,
    /// How frames were made.
    pub settings: Settings,
    /// Over all scenes.
    pub overall: Option<ChartOverall>,
    /// One for each scene.
    pub points: Vec<ChartPoint>,
}

/// A choice over all scenes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct ChartOverall {
    /// Error: of light the root of the mean square over scenes, of pictures the mean.
    pub error: f64,
    /// Error in the worst scene.
    pub worst: f64,
    /// Mean over scenes of the median time of a frame, milliseconds; none if it was not timed.
    pub frame_ms: Option<f64>,
    /// Whether no other choice of the group is at most as slow and at most as wrong.
    pub is_on_front: bool,
}

/// A choice in a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct ChartPoint {
    /// How far it is from the truth of its group.
    pub error: ChartError,
    /// Time of a whole frame; none if it was not timed.
    pub frame: Option<PassCost>,
    /// Whether no other choice of the group is at most as slow and at most as wrong in this scene.
    pub is_on_front: bool,
    /// Its picture, relative to the report.
    pub picture: Option<String>,
    /// Its map of visible differences, relative to the report.
    pub difference: Option<String>,
}

/// Errors of a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct ChartError {
    /// FLIP of the displayed picture: over skin where the measure is light, else over the head and the pixels around it.
    pub flip_mean: f64,
    /// Its 99th percentile.
    #[serde(rename = "flip99")]
    pub flip_99: f64,
    /// Relative RMSE of the displayed picture in linear light, over the same pixels.
    #[serde(default)]
    pub relative_rmse: f64,
    /// Relative RMSE of diffuse radiance before albedo, on skin, to `reference-surface`; only where the measure is light.
    pub relative_rmse_to_surface: Option<f64>,
    /// The same to `reference-screen`.
    pub relative_rmse_to_screen: Option<f64>,
}

impl ChartError {
    /// The number by which choices are compared.
    pub fn of(&self, measure: Measure) -> f64 {
        match measure {
            Measure::Light => self.relative_rmse_to_surface.unwrap_or(f64::NAN),
            Measure::Picture => self.flip_mean,
        }
    }
}

/// How well `auto` chooses in scenes that its estimates never saw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct AutoReport {
    /// Device.
    pub adapter: Adapter,
    /// Settings that it does not choose.
    pub settings: Settings,
    /// Names of the scenes.
    pub scenes: Vec<String>,
    /// Combinations of choices that were drawn and timed in each scene.
    pub combinations: usize,
    /// One for each bound.
    pub rows: Vec<AutoRow>,
}

/// `auto` under a bound.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct AutoRow {
    /// Mean FLIP that a frame may have.
    pub bound: f64,
    /// Scenes in which some combination keeps it.
    pub possible: usize,
    /// Those in which the chosen one keeps it.
    pub kept: usize,
    /// Mean time of the chosen ones, milliseconds.
    pub mean_ms: f64,
    /// That time over that of the cheapest combination of each scene that keeps the bound.
    pub over_cheapest: f64,
    /// That time over that of the cheapest one combination for all scenes that keeps the bound as often; none if there is none.
    pub over_fixed: Option<f64>,
    /// Mean error of the chosen ones.
    pub mean_flip: f64,
}

/// Steadiness of choices while one quantity moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct StabilityReport {
    /// Device.
    pub adapter: Adapter,
    /// The base: each group changes one setting of it.
    pub settings: Settings,
    /// What moved.
    pub sweeps: Vec<SweepReport>,
    /// One for each choice and sweep.
    pub rows: Vec<StabilityRow>,
}

/// A sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct SweepReport {
    /// Name.
    pub name: String,
    /// What moves, and its unit.
    pub moves: String,
    /// Whether each step multiplies the quantity.
    pub is_geometric: bool,
    /// The quantity at each step.
    pub values: Vec<f64>,
}

/// A choice in a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct StabilityRow {
    /// The flag of its group.
    pub group: String,
    /// Its name.
    pub choice: String,
    /// Name of the sweep.
    pub sweep: String,
    /// Largest temporal residual: root of the mean square over pixels of the change from a step to the next, less that of the
    /// truth; displayed light, 0 to 1.
    pub residual: f64,
    /// Largest residual of a step over the mean of its neighbours'; 1 where none stands out.
    pub jump: f64,
    /// Largest light two pixels or more outside of the head that the truth does not have, 0 to 1.
    pub halo: f64,
    /// Least and most diffuse light of skin, over that of `reference-screen`.
    pub energy: [f64; 2],
    /// Values of diffuse light that are no finite numbers.
    pub broken_values: usize,
    /// The slowest step over the median; none if nothing was timed.
    pub cost_spike: Option<f64>,
    /// Residual of each step to the next.
    pub residuals: Vec<f64>,
    /// Diffuse light of each step over that of `reference-screen`.
    pub energies: Vec<f64>,
}

/// Light of methods beside that of paths through the volume of the head.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct VolumeReport {
    /// Device.
    pub adapter: Adapter,
    /// The base: each choice changes one setting of it, or a few.
    pub settings: Settings,
    /// The skin.
    pub medium: MediumName,
    /// Its index of refraction.
    pub eta: f64,
    /// Roughness of its boundary, alpha of GGX.
    pub alpha: f64,
    /// Share of an even sky that a flat piece of it returns towards the normal, R, G, B; light is over that.
    pub flat: [f64; 3],
    /// Paths of a pixel.
    pub paths: u32,
    /// Stills.
    pub stills: Vec<VolumeStill>,
    /// Methods.
    pub choices: Vec<VolumeChoice>,
}

/// A still.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct VolumeStill {
    /// Name, also of its folder.
    pub name: String,
    /// The failure that it provokes; empty for a scene of the user.
    pub provokes: String,
    /// Standard error of the right light over that light: roots of the mean squares over skin.
    pub noise: f64,
    /// Share of paths that left a closed surface unseen, by rounding.
    pub lost: f64,
    /// What its skin shows.
    pub patches: Vec<VolumePatch>,
    /// The right light as a picture.
    pub picture: Option<String>,
}

/// Pixels of a still that show the same kind of light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct VolumePatch {
    /// `lit`, `terminator`, `thin` or `shadow`.
    pub patch: String,
    /// Their number.
    pub pixels: usize,
    /// Mean of the right light, R, G, B.
    pub light: [f64; 3],
    /// Standard error of the mean.
    pub error: [f64; 3],
}

/// A method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct VolumeChoice {
    /// Its name.
    pub name: String,
    /// Its settings.
    pub settings: Settings,
    /// Root mean square over the stills of their relative RMSE.
    pub relative_rmse: f64,
    /// The largest of a still.
    pub worst: f64,
    /// Light over the right light less 1, by patch, all stills together.
    pub bias: BTreeMap<String, f64>,
    /// Each still.
    pub points: Vec<VolumePoint>,
}

/// A method in a still.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct VolumePoint {
    /// Relative RMSE of the light on skin, less what the noise of the right light adds.
    pub relative_rmse: f64,
    /// The same with that noise.
    pub relative_rmse_with_noise: f64,
    /// Light over the right light less 1, by patch.
    pub bias: BTreeMap<String, f64>,
    /// Its light as a picture.
    pub picture: Option<String>,
    /// Where it is too bright (red) and too dark (blue).
    pub difference: Option<String>,
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
