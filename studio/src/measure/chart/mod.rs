//! Speed against error: every choice of a frame in a suite of scenes.
//!
//! ```text
//! scenes x truths (reference-surface, ssaa, ...) --> right pictures and light
//! scenes x choices --> error                       \
//! rounds x choices x scenes --timestamps--> time   / --> Pareto front of each scene and of all --> report, table, page
//! ```
//!
//! Each group varies one setting; the others stay at the base, for the truth too, so errors of groups do not mix. Times are of
//! whole frames back to back. All choices take turns in several rounds, so that a drift of the device hits them alike.

pub mod choices;
mod front;
pub mod page;
pub mod plot;
pub mod suite;
mod truth;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rubor_renderer::settings::{ScatterMethod, Settings};

pub use choices::{Effort, Group, Measure, RightLight, groups};
pub use suite::{Scene, Suite, frames_of, scene_of, scenes};
use truth::save_light;
pub(crate) use truth::{Drawn, SETTLED_FRAMES, Truth, draw};

use super::file_name;
use crate::error::Outcome;
use crate::output;
use crate::report::{ChartChoice, ChartError, ChartGroup, ChartPoint, ChartReport, ChartScene, PassCost};
use crate::studio::Studio;
use crate::watch::Watch;

/// Frames that raise the clock of a graphics card.
pub(crate) const WAKING_FRAMES: u32 = 600;

/// Repetitions of timing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Times that all choices take their turn.
    pub rounds: u32,
    /// Frames of a choice in a scene and a round that are not timed.
    pub warm_up: u32,
    /// Frames after them that are.
    pub frames: u32,
}

/// Options of a chart.
#[derive(Clone, Debug)]
pub struct Options {
    /// How frames are timed; none leaves time out, as does a device without timestamps.
    pub timing: Option<Timing>,
    /// Folder for pictures of each choice, its visible differences, and the truths.
    pub folder: Option<PathBuf>,
    /// Whether the diffuse light of choices goes there too (EXR).
    pub light: bool,
}

/// Settings that several groups may share, and where they stand.
struct Drawing<'a> {
    settings: &'a Settings,
    /// Group and choice.
    places: Vec<[usize; 2]>,
}

/// Charts groups of choices in scenes of the one head of a studio.
///
/// # Errors
/// Errors of the studio; files that cannot be written.
pub fn run(
    studio: &mut Studio,
    base: &Settings,
    scenes: &[Scene],
    groups: &[Group],
    options: &Options,
    watch: &mut dyn Watch,
) -> Outcome<ChartReport> {
    let folders = scenes.iter().map(|scene| pictures_of(options.folder.as_deref(), &scene.name));
    let folders: Vec<Option<PathBuf>> = folders.collect::<Outcome<_>>()?;
    let truths = draw_truths(studio, base, scenes, groups, &folders, options, watch)?;
    let drawings = drawings(groups);
    let mut points: BTreeMap<[usize; 3], ChartPoint> = BTreeMap::new();
    watch.begin("pictures", (drawings.len() * scenes.len()) as u64);
    for drawing in &drawings {
        let light = drawing.places.iter().any(|[g, _]| groups[*g].measure == Measure::Light);
        for (s, scene) in scenes.iter().enumerate() {
            let drawn = draw(studio, scene, drawing.settings, light)?;
            for &[g, c] in &drawing.places {
                let group = &groups[g];
                let Some(truth) = truths.get(&(s, key(group))) else { continue };
                let (error, map) = truth.error(&drawn);
                let mut point =
                    ChartPoint { error, frame: None, is_on_front: false, picture: None, difference: None };
                if let Some(folder) = &folders[s] {
                    let name = file_name(&format!("{}, {}", group.flag, group.choices[c].0));
                    let [picture, difference] = [format!("{name}.png"), format!("{name}-difference.png")];
                    output::save_picture(&folder.join(&picture), &drawn.frame.picture())?;
                    truth.save_difference(&folder.join(&difference), &map)?;
                    if options.light && light {
                        save_light(&folder.join(format!("{name}.exr")), &drawn.diffuse, drawing.settings)?;
                    }
                    point.picture = Some(relative(&scene.name, &picture));
                    point.difference = Some(relative(&scene.name, &difference));
                }
                points.insert([g, c, s], point);
            }
            watch.step();
        }
    }
    watch.end();
    if let Some(timing) = options.timing.filter(|_| studio.has_timestamps()) {
        time(studio, scenes, &drawings, timing, &mut points, watch)?;
    }
    let listed = |(s, scene): (usize, &Scene)| ChartScene {
        name: scene.name.clone(),
        provokes: scene.provokes.clone(),
        noise: truths.iter().filter(|((of, _), _)| *of == s).filter_map(|(_, t)| t.noise()).reduce(f64::max),
    };
    let mut report = ChartReport {
        adapter: studio.adapter(),
        settings: base.clone(),
        timing: options.timing.map(|t| [t.rounds, t.warm_up, t.frames]),
        scenes: scenes.iter().enumerate().map(listed).collect(),
        groups: groups
            .iter()
            .enumerate()
            .map(|(g, group)| ChartGroup {
                flag: group.flag.clone(),
                measure: group.measure,
                truth: match group.measure {
                    Measure::Light => group.truth.quality.scatter.to_string(),
                    Measure::Picture => {
                        super::names(std::slice::from_ref(&group.truth), &[&group.flag]).concat()
                    }
                },
                truth_pictures: match options.folder {
                    Some(_) => scenes.iter().map(|s| relative(&s.name, &truth_file(group))).collect(),
                    None => Vec::new(),
                },
                choices: (group.choices.iter().enumerate())
                    .map(|(c, (name, settings))| ChartChoice {
                        name: name.clone(),
                        settings: settings.clone(),
                        overall: None,
                        points: (0..scenes.len()).filter_map(|s| points.remove(&[g, c, s])).collect(),
                    })
                    .collect(),
            })
            .collect(),
    };
    front::mark(&mut report);
    Ok(report)
}

/// Truths that are equal are drawn once: their settings as text, and how they are measured.
type Key = (String, bool);

fn key(group: &Group) -> Key {
    let text = serde_json::to_string(&group.truth).unwrap_or_default();
    (text, group.measure == Measure::Light)
}

fn truth_file(group: &Group) -> String {
    format!("truth-{}.png", group.flag)
}

/// Folder for the pictures of a scene.
fn pictures_of(folder: Option<&Path>, scene: &str) -> Outcome<Option<PathBuf>> {
    let Some(folder) = folder.map(|f| f.join(file_name(scene))) else { return Ok(None) };
    output::folder(&folder)?;
    Ok(Some(folder))
}

/// Path of a picture as the page and the report name it.
fn relative(scene: &str, file: &str) -> String {
    format!("{}/{file}", file_name(scene))
}

fn draw_truths(
    studio: &mut Studio,
    base: &Settings,
    scenes: &[Scene],
    groups: &[Group],
    folders: &[Option<PathBuf>],
    options: &Options,
    watch: &mut dyn Watch,
) -> Outcome<BTreeMap<(usize, Key), Truth>> {
    let mut truths: BTreeMap<(usize, Key), Truth> = BTreeMap::new();
    watch.begin("right pictures", (groups.len() * scenes.len()) as u64);
    for group in groups {
        for (s, (scene, folder)) in scenes.iter().zip(folders).enumerate() {
            let known = (s, key(group));
            if !truths.contains_key(&known) {
                let truth = Truth::draw(studio, scene, &group.truth, group.measure, base)?;
                truths.insert(known.clone(), truth);
            }
            if let (Some(folder), Some(truth)) = (folder, truths.get(&known)) {
                let path = folder.join(truth_file(group));
                output::save_picture(&path, &truth.frame.picture())?;
                if options.light {
                    truth.save_light(&path.with_extension("exr"), &group.truth)?;
                }
            }
            watch.step();
        }
    }
    watch.end();
    Ok(truths)
}

/// Every settings once, in the order of the groups.
fn drawings(groups: &[Group]) -> Vec<Drawing<'_>> {
    let mut all: Vec<Drawing<'_>> = Vec::new();
    for (g, group) in groups.iter().enumerate() {
        for (c, (_, settings)) in group.choices.iter().enumerate() {
            match all.iter_mut().find(|d| d.settings == settings) {
                Some(known) => known.places.push([g, c]),
                None => all.push(Drawing { settings, places: vec![[g, c]] }),
            }
        }
    }
    all
}

/// Milliseconds of a frame of each choice of groups in each scene, none for references: by group, choice and scene.
///
/// # Errors
/// Errors of the studio.
pub fn times(
    studio: &mut Studio,
    scenes: &[Scene],
    groups: &[Group],
    timing: Timing,
    watch: &mut dyn Watch,
) -> Outcome<BTreeMap<[usize; 3], f64>> {
    let drawings = drawings(groups);
    let mut points: BTreeMap<[usize; 3], ChartPoint> = BTreeMap::new();
    let error = ChartError {
        flip_mean: 0.0,
        flip_99: 0.0,
        relative_rmse: 0.0,
        relative_rmse_to_surface: None,
        relative_rmse_to_screen: None,
    };
    let empty = ChartPoint { error, frame: None, is_on_front: false, picture: None, difference: None };
    for &[g, c] in drawings.iter().flat_map(|d| &d.places) {
        points.extend((0..scenes.len()).map(|s| ([g, c, s], empty.clone())));
    }
    time(studio, scenes, &drawings, timing, &mut points, watch)?;
    Ok(points.into_iter().filter_map(|(place, p)| Some((place, p.frame?.median))).collect())
}

/// Times all settings in all scenes, taking turns.
fn time(
    studio: &mut Studio,
    scenes: &[Scene],
    drawings: &[Drawing<'_>],
    timing: Timing,
    points: &mut BTreeMap<[usize; 3], ChartPoint>,
    watch: &mut dyn Watch,
) -> Outcome {
    let is_timed = |d: &&Drawing<'_>| {
        let scatter = d.settings.quality.scatter;
        !matches!(scatter, ScatterMethod::ReferenceScreen | ScatterMethod::ReferenceSurface(_))
    };
    let timed: Vec<&Drawing<'_>> = drawings.iter().filter(is_timed).collect();
    let mut all = vec![vec![Vec::new(); scenes.len()]; timed.len()];
    // An idle device has a low clock.
    if let (Some(drawing), Some(scene), false) = (timed.first(), scenes.first(), studio.is_software()) {
        studio.measure(&scene.shots(), scene.spacing_m, drawing.settings, WAKING_FRAMES, 1)?;
    }
    watch.begin("settings timed", u64::from(timing.rounds) * timed.len() as u64);
    for _ in 0..timing.rounds {
        for (drawing, times) in timed.iter().zip(&mut all) {
            for (scene, times) in scenes.iter().zip(times) {
                let frames = studio.measure(
                    &scene.shots(),
                    scene.spacing_m,
                    drawing.settings,
                    timing.warm_up,
                    timing.frames,
                )?;
                times.extend(frames.iter().map(|frame| frame.frame_ms));
            }
            watch.step();
        }
    }
    watch.end();
    for (drawing, times) in timed.iter().zip(all) {
        for (s, times) in times.into_iter().enumerate().filter(|(_, times)| !times.is_empty()) {
            let cost = PassCost::of("frame", 1, times);
            for &[g, c] in &drawing.places {
                if let Some(point) = points.get_mut(&[g, c, s]) {
                    point.frame = Some(cost.clone());
                }
            }
        }
    }
    Ok(())
}
