//! Settings by need: for every frame the cheapest choices whose estimated error stays under a bound, or the most exact ones
//! that fit into a time.
//!
//! ```text
//! Shot --Outline--> Features --Calibration--> error and cost of each choice \
//!                                             bound, choices of the frame before / --> choices of the frame, and why
//! ```
//!
//! The error is the mean FLIP over the head, or the relative RMSE, against the same frame with the last choice of every group.
//! Choices follow from the sequence alone, frame by frame from the first: any part of a job, on any machine, draws the
//! frames of the whole. The estimates are those of one device ([`Calibration`]); the job holds them.
//!
//! A frame has one choice for all of its heads; its error is the mean over the pixels of all of them.

pub mod calibration;
pub mod experiment;
mod features;
pub mod measured;
mod shots;

use std::path::{Path, PathBuf};

use rubor_renderer::settings::{Leaf, Settings};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

pub use calibration::Calibration;
use calibration::{Expected, Group, Metric};
pub use features::{Features, Outline, features_of};
pub use shots::{CALIBRATED, unseen_shots};

use crate::error::{Failure, Outcome};
use crate::measure::file_name;
use crate::notes::Note;
use crate::output;

/// The measurements that ship with rubor: made by `rubor chart --calibrate` (docs/speed.md says where and when).
const SHIPPED: &str = include_str!("h200.json");

/// A choice stays while it keeps the bound, unless a cheaper one keeps this share of it.
const HYSTERESIS: f64 = 0.85;

/// Most combinations of choices that are tried for a frame.
const MOST_COMBINATIONS: usize = 10_000;

/// What limits a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub enum Bound {
    /// Mean FLIP over the head, above 0.
    Flip(#[schemars(schema_with = "flip_schema")] f64),
    /// Relative RMSE of the displayed picture in linear light over the head, above 0.
    RelativeRmse(#[schemars(schema_with = "relative_rmse_schema")] f64),
    /// Milliseconds of a frame, above 0.
    Milliseconds(#[schemars(schema_with = "milliseconds_schema")] f64),
}

fn flip_schema(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "number", "exclusiveMinimum": 0, "description": "Mean FLIP over the head." })
}

fn relative_rmse_schema(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "number", "exclusiveMinimum": 0, "description": "Relative RMSE over the head." })
}

fn milliseconds_schema(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "number", "exclusiveMinimum": 0, "description": "Milliseconds of a frame." })
}

impl std::str::FromStr for Bound {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!("found {text:?}, expected flip=X, rel-rmse=X or ms=X with X above 0, such as flip=0.02")
        };
        let (name, number) = text.split_once('=').ok_or_else(wrong)?;
        let number: f64 =
            number.trim().parse().ok().filter(|n: &f64| *n > 0.0 && n.is_finite()).ok_or_else(wrong)?;
        match name.trim() {
            "flip" => Ok(Self::Flip(number)),
            "rel-rmse" => Ok(Self::RelativeRmse(number)),
            "ms" => Ok(Self::Milliseconds(number)),
            _ => Err(wrong()),
        }
    }
}

impl std::fmt::Display for Bound {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Flip(most) => write!(f, "flip={most}"),
            Self::RelativeRmse(most) => write!(f, "rel-rmse={most}"),
            Self::Milliseconds(most) => write!(f, "ms={most}"),
        }
    }
}

/// Settings by need.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Auto {
    /// What limits a frame.
    pub bound: Bound,
    /// Flags of settings that stay as they are.
    #[serde(default)]
    pub held: Vec<String>,
    /// Estimates of a device.
    #[schemars(with = "serde_json::Value")]
    pub calibration: Calibration,
}

/// What a choice is expected to do in a frame.
#[derive(Clone, Copy, Debug)]
struct Part {
    flip: Expected,
    relative_rmse: Expected,
    milliseconds: f64,
}

/// What was chosen for a frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct Chosen {
    /// Index of the choice of each group of the calibration; of a held group none.
    pub choices: Vec<Option<usize>>,
    /// Estimated mean FLIP, which 95 % of frames do not exceed.
    pub flip: f64,
    /// Estimated relative RMSE, likewise.
    #[serde(default)]
    pub relative_rmse: f64,
    /// Estimated milliseconds.
    pub milliseconds: f64,
    /// Whether the bound is kept by that estimate.
    pub is_kept: bool,
}

impl Calibration {
    /// The one that ships with rubor.
    ///
    /// # Errors
    /// It does not read, which a test excludes.
    pub fn shipped() -> Outcome<Self> {
        serde_json::from_str(SHIPPED).map_err(Failure::job)
    }

    /// That of the best of some devices for which one was kept, else the one that ships; and what of those that were kept does not read.
    ///
    /// # Errors
    /// As [`Calibration::shipped`].
    pub fn of_devices<'a>(names: impl IntoIterator<Item = &'a str>) -> Outcome<(Self, Vec<Note>)> {
        let mut notes = Vec::new();
        for file in names.into_iter().filter_map(kept_file).filter(|file| file.exists()) {
            let bytes = rubor_rig::limits::read(&file).map_err(|e| e.to_string());
            let kept = bytes.and_then(|b| serde_json::from_slice::<Self>(&b).map_err(|e| e.to_string()));
            match kept {
                Ok(kept) if kept.rubor == env!("CARGO_PKG_VERSION") => return Ok((kept, notes)),
                Ok(kept) => notes.push(outdated(&file, &format!("made by rubor {}", kept.rubor))),
                Err(why) => notes.push(outdated(&file, &why)),
            }
        }
        Ok((Self::shipped()?, notes))
    }

    /// Keeps it for its device; returns the file, or none where the system names no folder for such data.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn keep(&self) -> Outcome<Option<PathBuf>> {
        let Some(file) = kept_file(&self.adapter.name) else { return Ok(None) };
        if let Some(folder) = file.parent() {
            output::folder(folder)?;
        }
        output::write_json(&file, self)?;
        Ok(Some(file))
    }
}

/// Kept estimates are not used.
fn outdated(file: &Path, why: &str) -> Note {
    let message =
        format!("estimates of this device are not used ({why}): `rubor chart --calibrate` makes them again");
    Note::new(file.display().to_string(), message)
}

fn kept_file(device: &str) -> Option<PathBuf> {
    let name = file_name(&format!("auto-{device}.json"));
    directories::ProjectDirs::from("", "", "rubor").map(|dirs| dirs.data_dir().join(name))
}

impl Auto {
    /// Checks what a job says.
    ///
    /// # Errors
    /// A bound that is not above 0, a setting that there is not, or more combinations than are tried.
    pub fn check(&self) -> Outcome {
        let wrong = |what: String, found: String, expected: &str| {
            Err(Failure::input(format!("auto.{what}: found {found}, expected {expected}")))
        };
        let (Bound::Flip(most) | Bound::RelativeRmse(most) | Bound::Milliseconds(most)) = self.bound;
        if !(most > 0.0 && most.is_finite()) {
            return wrong("bound".into(), most.to_string(), "a number above 0");
        }
        let groups = &self.calibration.groups;
        for flag in self.held.iter().chain(groups.iter().map(|g| &g.flag)) {
            if Leaf::of_flag(flag).is_none() {
                return wrong("held and calibration.groups".into(), format!("{flag:?}"), "flags of settings");
            }
        }
        let combinations = groups.iter().try_fold(1usize, |n, g| n.checked_mul(g.choices.len()));
        if !combinations.is_some_and(|n| (1..=MOST_COMBINATIONS).contains(&n)) {
            let found = combinations.map_or("more".into(), |n| n.to_string());
            return wrong("calibration.groups".into(), found, "1 to 10000 combinations of choices");
        }
        Ok(())
    }

    /// Whether it chooses the setting of a flag.
    pub fn chooses(&self, flag: &str) -> bool {
        self.calibration.groups.iter().any(|g| g.flag == flag) && !self.held.iter().any(|h| h == flag)
    }

    /// Every combination of choices: an index for each group, none where the setting is held.
    pub(crate) fn combinations(&self) -> Vec<Vec<Option<usize>>> {
        let mut all = vec![Vec::new()];
        for group in &self.calibration.groups {
            let is_held = self.held.contains(&group.flag);
            let choices: Vec<Option<usize>> =
                if is_held { vec![None] } else { (0..group.choices.len()).map(Some).collect() };
            let longer = |c: Vec<Option<usize>>| {
                choices.iter().map(move |choice| [&c[..], &[*choice]].concat()).collect::<Vec<_>>()
            };
            all = all.into_iter().flat_map(longer).collect();
        }
        all
    }

    /// Error and time of each choice of each group, for heads with these features.
    fn parts(&self, heads: &[Features], size: [u32; 2]) -> Vec<Vec<Part>> {
        let calibration = &self.calibration;
        // Errors are means over the pixels of all heads; what a pass costs before its first pixel is paid once.
        let share: f64 = heads.iter().map(|f| f.share).sum();
        let all = Features { share, ..Features::default() };
        let part = |g: usize, choice: usize| {
            let error = |metric| {
                let mut mean = Expected::default();
                for f in heads {
                    let of = calibration.error(metric, g, choice, f);
                    mean.mean += of.mean * f.share / share.max(1e-9);
                    mean.margin += of.margin * f.share / share.max(1e-9);
                }
                mean
            };
            Part {
                flip: error(Metric::Flip),
                relative_rmse: error(Metric::RelativeRmse),
                milliseconds: calibration.cost_ms(g, choice, &all, size),
            }
        };
        let groups = calibration.groups.iter().enumerate();
        groups.map(|(g, group)| (0..group.choices.len()).map(|c| part(g, c)).collect()).collect()
    }

    /// The last choice of each group, or the cheapest where none makes a difference.
    fn most_exact(&self, parts: &[Vec<Part>]) -> Vec<Option<usize>> {
        let of = |(group, parts): (&Group, &Vec<Part>)| {
            if self.held.contains(&group.flag) {
                return None;
            }
            let is_free = |part: &Part| part.flip.mean == 0.0 && part.relative_rmse.mean == 0.0;
            let free = parts.iter().enumerate().filter(|(_, part)| is_free(part));
            let cheapest = free.min_by(|(_, a), (_, b)| a.milliseconds.total_cmp(&b.milliseconds));
            cheapest.map(|(i, _)| i).or(parts.len().checked_sub(1))
        };
        self.calibration.groups.iter().zip(parts).map(of).collect()
    }

    /// Error and time of some choices, from those of each.
    fn estimate(&self, choices: Vec<Option<usize>>, base_ms: f64, parts: &[Vec<Part>]) -> Chosen {
        let made: Vec<&Part> =
            choices.iter().zip(parts).filter_map(|(choice, of)| of.get((*choice)?)).collect();
        let error = |metric, of: fn(&Part) -> Expected| {
            let parts: Vec<Expected> = made.iter().map(|p| of(p)).collect();
            self.calibration.together(metric).error(&parts)
        };
        let mut chosen = Chosen {
            flip: error(Metric::Flip, |p| p.flip),
            relative_rmse: error(Metric::RelativeRmse, |p| p.relative_rmse),
            milliseconds: base_ms + made.iter().map(|p| p.milliseconds).sum::<f64>(),
            choices,
            is_kept: false,
        };
        chosen.is_kept = match self.bound {
            Bound::Flip(most) => chosen.flip <= most,
            Bound::RelativeRmse(most) => chosen.relative_rmse <= most,
            Bound::Milliseconds(most) => chosen.milliseconds <= most,
        };
        chosen
    }

    /// The error that it looks at.
    fn error(&self, chosen: &Chosen) -> f64 {
        match self.bound {
            Bound::RelativeRmse(_) => chosen.relative_rmse,
            Bound::Flip(_) | Bound::Milliseconds(_) => chosen.flip,
        }
    }

    /// Choices for a frame after those of the frame before, for heads with these features.
    pub fn choose(&self, heads: &[Features], size: [u32; 2], before: Option<&Chosen>) -> Chosen {
        let share = heads.iter().map(|f| f.share).sum();
        let base_ms = self.calibration.base_ms(&Features { share, ..Features::default() }, size);
        let parts = self.parts(heads, size);
        let estimate = |choices: Vec<Option<usize>>| self.estimate(choices, base_ms, &parts);
        let mut all: Vec<Chosen> = self.combinations().into_iter().map(estimate).collect();
        let exact = estimate(self.most_exact(&parts));
        all.sort_by(|a, b| {
            a.milliseconds.total_cmp(&b.milliseconds).then(self.error(a).total_cmp(&self.error(b)))
        });
        // Along the front the time rises and the error falls.
        let mut least = f64::INFINITY;
        all.retain(|c| {
            let is_nearer = self.error(c) < least;
            least = least.min(self.error(c));
            is_nearer
        });
        let Some(fastest) = all.first() else { return exact };
        let under = |share: f64| match self.bound {
            Bound::Flip(most) | Bound::RelativeRmse(most) => {
                all.iter().find(|c| self.error(c) <= share * most)
            }
            Bound::Milliseconds(most) => all.iter().rfind(|c| c.milliseconds <= share * most),
        };
        let stays = before.map(|b| estimate(b.choices.clone())).filter(|c| c.is_kept);
        let Some(stays) = stays else {
            if matches!(self.bound, Bound::Milliseconds(_)) {
                return under(1.0).unwrap_or(fastest).clone();
            }
            // Where no choice is expected to keep a bound of error, the differences of their estimates say too little.
            let is_exact = before.is_some_and(|b| b.choices == exact.choices);
            return under(if is_exact { HYSTERESIS } else { 1.0 }).cloned().unwrap_or(exact);
        };
        let is_better = |c: &&Chosen| match self.bound {
            Bound::Flip(_) | Bound::RelativeRmse(_) => c.milliseconds < stays.milliseconds,
            Bound::Milliseconds(_) => c.flip < stays.flip,
        };
        under(HYSTERESIS).filter(is_better).cloned().unwrap_or(stays)
    }

    /// Settings with what was chosen.
    ///
    /// # Errors
    /// A calibration with values that the settings refuse.
    pub fn settings(&self, base: &Settings, chosen: &Chosen) -> Outcome<Settings> {
        let mut settings = base.clone();
        for (group, choice) in self.calibration.groups.iter().zip(&chosen.choices) {
            let leaf = Leaf::of_flag(&group.flag);
            if let (Some(leaf), Some(choice)) = (leaf, choice.and_then(|c| group.choices.get(c))) {
                settings.overlay(&leaf.change(&choice.value))?;
            }
        }
        settings.validate()?;
        Ok(settings)
    }

    /// Choices for frames one after the other; each has the features of every head.
    pub fn run(&self, frames: impl Iterator<Item = Vec<Features>>, size: [u32; 2]) -> Vec<Chosen> {
        let mut all: Vec<Chosen> = Vec::new();
        for heads in frames {
            let chosen = self.choose(&heads, size, all.last());
            all.push(chosen);
        }
        all
    }

    /// What was chosen, in words.
    pub fn words(&self, chosen: &Chosen) -> String {
        let of = |(group, choice): (&calibration::Group, &Option<usize>)| {
            choice.and_then(|c| group.choices.get(c)).map(|c| match c.name.starts_with(&group.flag) {
                // Numbers have the name of their setting.
                true => c.name.clone(),
                false => format!("{} {}", group.flag, c.name),
            })
        };
        let names: Vec<String> = self.calibration.groups.iter().zip(&chosen.choices).filter_map(of).collect();
        let kept = if chosen.is_kept { "" } else { "; no choice keeps the bound, this one comes nearest" };
        let error = match self.bound {
            Bound::RelativeRmse(_) => format!("relative RMSE {:.4}", chosen.relative_rmse),
            _ => format!("FLIP {:.4}", chosen.flip),
        };
        format!("{}: {error}, {:.2} ms{kept}", names.join(", "), chosen.milliseconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn auto(bound: Bound) -> Auto {
        Auto { bound, held: Vec::new(), calibration: Calibration::shipped().unwrap() }
    }

    const NEAR: Features = Features {
        mm_per_pixel: 0.25,
        share: 0.6,
        backlight: 0.1,
        contrast: 0.8,
        wrinkles: 0.0,
        blood: 0.0,
        brightness: 0.4,
        relief: 0.05,
        through: 0.002,
        facing: 0.9,
    };

    #[test]
    fn a_smaller_bound_costs_more_and_errs_less() {
        let size = [1920, 1080];
        let of = |most: f64| auto(Bound::Flip(most)).choose(&[NEAR], size, None);
        let (loose, tight) = (of(0.2), of(0.01));
        assert!(loose.milliseconds < tight.milliseconds && loose.flip > tight.flip, "{loose:?} {tight:?}");
        assert!(loose.is_kept && loose.flip <= 0.2);
        let slow = auto(Bound::Milliseconds(100.0)).choose(&[NEAR], size, None);
        let fast = auto(Bound::Milliseconds(loose.milliseconds)).choose(&[NEAR], size, None);
        assert!(slow.flip < fast.flip, "{slow:?} {fast:?}");
        let of = |most: f64| auto(Bound::RelativeRmse(most)).choose(&[NEAR], size, None);
        let (loose, tight) = (of(0.5), of(0.02));
        assert!(loose.milliseconds < tight.milliseconds && loose.relative_rmse > tight.relative_rmse);
        assert!(loose.is_kept && loose.relative_rmse <= 0.5);
        let never = auto(Bound::Milliseconds(1e-6)).choose(&[NEAR], size, None);
        assert!(!never.is_kept);
        // Where nothing keeps a bound of error, the last choice of every group.
        let auto = auto(Bound::Flip(1e-6));
        let exact: Vec<_> = auto.calibration.groups.iter().map(|g| Some(g.choices.len() - 1)).collect();
        let never = auto.choose(&[Features { wrinkles: 1.0, blood: 1.0, ..NEAR }], size, None);
        assert!(!never.is_kept && never.choices == exact, "{never:?}");
    }

    #[test]
    fn a_head_beyond_the_shots_has_wider_margins() {
        let calibration = Calibration::shipped().unwrap();
        let error = |mm_per_pixel| calibration.error(Metric::Flip, 0, 0, &Features { mm_per_pixel, ..NEAR });
        let (far, further) = (error(20.0), error(60.0));
        assert!(far.mean == further.mean && far.margin < further.margin, "{far:?} {further:?}");
    }

    #[test]
    fn what_a_face_does_not_do_is_left_out() {
        let auto = auto(Bound::Flip(0.03));
        let settings = |f: Features| {
            auto.settings(&Settings::default(), &auto.choose(&[f], [1280, 720], None)).unwrap().quality
        };
        let calm = settings(NEAR);
        assert_eq!((calm.wrinkles.name(), calm.color.name()), ("none", "static"));
        let acting = settings(Features { wrinkles: 1.0, blood: 1.0, ..NEAR });
        assert_eq!((acting.wrinkles.name(), acting.color.name()), ("partial-derivative", "hemoglobin"));
    }

    #[test]
    fn choices_do_not_swing_to_and_fro() {
        let auto = auto(Bound::Flip(0.03));
        let size = [1280, 720];
        let mut before: Option<Chosen> = None;
        let (mut changes, mut free) = (0, 0);
        let mut left: Vec<(i32, Vec<Option<usize>>)> = Vec::new();
        let mut last_free: Option<Chosen> = None;
        let exact = Auto { bound: Bound::Flip(1e-9), ..auto.clone() }.choose(&[NEAR], size, None).choices;
        for i in 0..400 {
            // A slow zoom with a tremble.
            let tremble = if i % 2 == 0 { 1.04 } else { 1.0 };
            let f = Features { mm_per_pixel: 0.1 * 1.01f64.powi(i) * tremble, ..NEAR };
            let chosen = auto.choose(&[f], size, before.as_ref());
            let alone = auto.choose(&[f], size, None);
            if let Some(before) = before.as_ref().filter(|b| b.choices != chosen.choices) {
                changes += 1;
                // What was left is not taken again soon.
                let back = left.iter().find(|(at, choices)| i - at < 24 && *choices == chosen.choices);
                assert!(back.is_none(), "{back:?} again in frame {i}");
                left.push((i, before.choices.clone()));
            }
            free += usize::from(last_free.as_ref().is_some_and(|b| b.choices != alone.choices));
            let comes_first = chosen.is_kept || !alone.is_kept || chosen.choices == exact;
            assert!(comes_first, "the bound comes first");
            (before, last_free) = (Some(chosen), Some(alone));
        }
        assert!(3 * changes < free, "{changes} changes, {free} without memory");
    }

    #[test]
    fn jobs_with_impossible_wishes_are_refused() {
        auto(Bound::Flip(0.02)).check().unwrap();
        let refused = |change: fn(&mut Auto), phrase: &str| {
            let mut auto = auto(Bound::Flip(0.02));
            change(&mut auto);
            let message = auto.check().unwrap_err().to_string();
            assert!(message.contains(phrase), "{message}");
        };
        refused(|a| a.bound = Bound::Flip(-1.0), "found -1");
        refused(|a| a.bound = Bound::Milliseconds(f64::NAN), "found NaN");
        refused(|a| a.held.push("scater".into()), "scater");
        refused(|a| a.calibration.groups.iter_mut().for_each(|g| g.choices.clear()), "found 0");
        refused(
            |a| {
                let group = a.calibration.groups[0].clone();
                a.calibration.groups.extend(std::iter::repeat_n(group, 60));
            },
            "found more",
        );
    }

    #[test]
    fn held_settings_stay_and_bounds_read_back() {
        let mut auto = auto("flip=0.5".parse().unwrap());
        auto.held = vec!["scatter".to_owned()];
        let base = Settings::default();
        let settings = auto.settings(&base, &auto.choose(&[NEAR], [640, 640], None)).unwrap();
        assert_eq!(settings.quality.scatter, base.quality.scatter);
        for text in ["flip=0.02", "rel-rmse=0.1", "ms=1.5"] {
            assert_eq!(text.parse::<Bound>().unwrap().to_string(), text);
        }
        for wrong in ["", "flip", "flip=0", "ms=-1", "ms=nan", "psnr=3"] {
            assert!(wrong.parse::<Bound>().unwrap_err().contains("expected flip=X"), "{wrong}");
        }
    }
}
