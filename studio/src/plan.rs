//! A job that was checked against its heads: its frames, which can be drawn in any order.
//!
//! ```text
//! Job + heads --new--> Plan --shots--> shots of a frame
//! frames to draw --evaluate, a thread--> shots: n+4, n+3 --record--> device: n+2, n+1 --arrive--> n --> taker
//! ```
//!
//! Frames do not depend on which others are drawn. Antialiasing over time mixes the light of the previous frame into a
//! frame, depending on the speeds of both, and the speed of the previous frame comes from positions one frame earlier.
//! So where a frame does not follow the last one drawn, the two before it are drawn first, after a cut. For motion as a
//! channel it is the one before.

use std::collections::VecDeque;
use std::sync::mpsc::sync_channel;

use rubor_renderer::channels::Channel;
use rubor_renderer::settings::Settings;
use rubor_rig::evaluate::{Evaluator, Shot};
use rubor_rig::head::Head;

use crate::auto::{Auto, Chosen, Outline, features_of};
use crate::error::{Failure, Outcome};
use crate::inputs::LoadedHead;
use crate::job::{FrameList, Job, MOST_FRAMES};
use crate::notes::Note;
use crate::studio::{Arrived, Frame, Studio};
use crate::utilisation::{Clock, Work};

/// Share of the width of a head that is left free between two heads.
const SPACING: f32 = 1.05;
/// Frames before a frame that its pixels depend on, with antialiasing over time.
pub(crate) const REMEMBERED_FRAMES: u32 = 2;

/// Frames whose shots are evaluated before the device has room for them.
const FRAMES_AHEAD: usize = 2;
/// Frames that are submitted before the oldest is waited for: the device has work while the next one is recorded.
const FRAMES_IN_FLIGHT: usize = 2;

/// A job that can be drawn.
pub struct Plan<'a> {
    job: &'a Job,
    heads: &'a [LoadedHead],
    evaluators: Vec<Evaluator>,
    frames: Vec<u32>,
    settings: Settings,
    spacing_m: f32,
    /// What was chosen for the frames up to the last one that is drawn, and settings with it; empty without `auto`.
    chosen: Vec<Chosen>,
    settings_of_frames: Vec<Settings>,
    notes: Vec<Note>,
}

impl<'a> Plan<'a> {
    /// Checks a job. The device is not needed.
    ///
    /// # Errors
    /// No head; names that rig or head do not have; frames after the end of the sequence; settings out of range.
    pub fn new(job: &'a Job, heads: &'a [LoadedHead]) -> Outcome<Self> {
        job.settings.validate()?;
        let sequence = job.lit_sequence();
        let (mut evaluators, mut notes) = (Vec::new(), Vec::new());
        for loaded in heads {
            notes.extend(loaded.notes.iter().cloned());
            let (evaluator, found) = Evaluator::new(&loaded.head, &job.rig, &sequence)?;
            let about = format!("head {:?}", loaded.head.name);
            notes.extend(found.iter().map(|note| Note::of_rig(&about, note)));
            evaluators.push(evaluator);
        }
        let Some(first) = evaluators.first() else { return Err(Failure::input("there is no head to draw")) };
        let count = first.frame_count();
        let listed = job.frames.as_ref().map_or(count, |list| list.numbers().len() as u32);
        if listed > MOST_FRAMES {
            let expected = format!("at most {MOST_FRAMES}: fewer frames per second, or a list of frames");
            return Err(Failure::input(format!("frames: found {listed}, expected {expected}")));
        }
        let frames = match &job.frames {
            None => (0..count).collect(),
            Some(list) => {
                if let Some(last) = list.numbers().last().filter(|last| **last > count) {
                    return Err(Failure::input(format!(
                        "frames: found {last}, expected at most {count}, the length of the sequence"
                    )));
                }
                list.numbers().iter().map(|n| n - 1).collect()
            }
        };
        if sequence.lights.is_empty() && sequence.environment.is_none() {
            let hint = "heads are black without lights and environment (`--lights three-point`, or \"environment\": \
                        { \"name\": \"studio\" } in the sequence)";
            notes.push(Note::new("sequence", hint));
        }
        let spacing_m = spacing_m(heads.iter().map(|h| &h.head));
        let mut plan = Self {
            job,
            heads,
            evaluators,
            frames,
            spacing_m,
            chosen: Vec::new(),
            settings: job.drawn_settings(),
            settings_of_frames: Vec::new(),
            notes,
        };
        if let Some(auto) = &job.auto {
            plan.choose(auto)?;
        }
        Ok(plan)
    }

    /// Chooses settings for every frame, from the first of the sequence on.
    fn choose(&mut self, auto: &Auto) -> Outcome {
        let outlines: Vec<Outline> = self.heads.iter().map(|h| Outline::of(&h.head)).collect();
        let size = self.job.settings.output.size;
        let end = self.frames.last().map_or(0, |last| last + 1);
        let outlines: Vec<&Outline> = outlines.iter().collect();
        let features = (0..end).map(|frame| features_of(&outlines, &self.shots(frame), self.spacing_m, size));
        self.chosen = auto.run(features, size);
        self.settings_of_frames =
            self.chosen.iter().map(|c| auto.settings(&self.settings, c)).collect::<Outcome<_>>()?;
        let device = &auto.calibration.adapter.name;
        let about = format!("settings by need ({}), by the estimates for {device}", auto.bound);
        self.notes.push(Note::new("auto", about));
        let broken =
            self.frames.iter().filter(|f| self.chosen.get(**f as usize).is_some_and(|c| !c.is_kept)).count();
        if broken > 0 {
            let message = format!(
                "{broken} of {} frames cannot keep {}; they come as near as they can",
                self.frames.len(),
                auto.bound
            );
            self.notes.push(Note::new("auto", message));
        }
        Ok(())
    }

    /// What `auto` chose for the frames of the job: runs of frames from 1, and words.
    pub fn chosen(&self) -> Vec<(String, String)> {
        let Some(auto) = &self.job.auto else { return Vec::new() };
        let of = |frame: &u32| self.chosen.get(*frame as usize);
        self.frames
            .chunk_by(|a, b| of(a).map(|c| &c.choices) == of(b).map(|c| &c.choices))
            .filter_map(|run| {
                let list = FrameList::new(run.iter().map(|f| f + 1))?;
                Some((list.to_string(), auto.words(of(run.first()?)?)))
            })
            .collect()
    }

    /// Settings of a frame.
    pub fn settings(&self, frame: u32) -> &Settings {
        self.settings_of_frames.get(frame as usize).unwrap_or(&self.settings)
    }

    /// The job.
    pub fn job(&self) -> &'a Job {
        self.job
    }

    /// Its heads.
    pub fn heads(&self) -> &'a [LoadedHead] {
        self.heads
    }

    /// The performance on the first head.
    pub fn evaluator(&self) -> Option<&Evaluator> {
        self.evaluators.first()
    }

    /// Frames of the job by their index from 0, ascending.
    pub fn frames(&self) -> &[u32] {
        &self.frames
    }

    /// Notes on entries without effect.
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// Metres between the middles of two heads.
    pub fn spacing_m(&self) -> f32 {
        self.spacing_m
    }

    /// Shots of all heads at a frame, from the camera of the first; several heads are seen from further away.
    pub fn shots(&self, frame: u32) -> Vec<Shot> {
        let mut shots: Vec<Shot> = self.evaluators.iter().map(|e| e.at(e.frame_time_s(frame))).collect();
        step_back(&mut shots);
        shots
    }

    /// Puts the heads into a studio, in place of those before.
    ///
    /// # Errors
    /// A head does not fit the device.
    pub fn enter(&self, studio: &mut Studio) -> Outcome {
        studio.set_heads(self.heads.iter().map(|h| &h.head))
    }

    /// Draws frames in the order given, each with the pixels that it has in the whole run. `take` gets them one by one,
    /// while the device works on the next. The heads have to be in the studio: see [`Plan::enter`].
    ///
    /// # Errors
    /// Errors of the studio and of `take`.
    pub fn draw(
        &self,
        studio: &mut Studio,
        frames: &[u32],
        mut take: impl FnMut(Shown) -> Outcome,
    ) -> Outcome {
        let take =
            |Coming { frame, shots, drawn }: Coming| take(Shown { frame, shots, drawn: drawn.take()? });
        self.draw_ahead(studio, frames, &Clock::start(), take)
    }

    /// As [`Plan::draw`], with frames whose pictures are still in memory of the device, and work noted by a clock.
    pub(crate) fn draw_ahead(
        &self,
        studio: &mut Studio,
        frames: &[u32],
        clock: &Clock,
        mut take: impl FnMut(Coming) -> Outcome,
    ) -> Outcome {
        let steps = self.steps(frames);
        let (ahead, evaluated) = sync_channel(FRAMES_AHEAD);
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for step in steps {
                    let shots = clock.time(Work::Evaluate, || self.shots(step.frame));
                    // Drawing ended early.
                    if ahead.send((step, shots)).is_err() {
                        return;
                    }
                }
            });
            let mut waiting = VecDeque::new();
            let mut arrive = |studio: &mut Studio, (frame, shots, drawn)| {
                take(Coming { frame, shots, drawn: studio.arrive(drawn)? })
            };
            for (step, shots) in evaluated {
                let drawn = clock.time(Work::Record, || {
                    if step.is_cut {
                        studio.cut(step.frame);
                    }
                    studio.draw(&shots, self.spacing_m, self.settings(step.frame))
                })?;
                if step.is_shown {
                    waiting.push_back((step.frame, shots, drawn));
                }
                if waiting.len() > FRAMES_IN_FLIGHT
                    && let Some(oldest) = waiting.pop_front()
                {
                    arrive(studio, oldest)?;
                }
            }
            waiting.into_iter().try_for_each(|frame| arrive(studio, frame))
        })
    }

    /// Frames to draw for those that are wanted, in their order.
    fn steps(&self, frames: &[u32]) -> Vec<Step> {
        let settings = &self.settings;
        let before = match settings.quality.antialias.is_temporal() {
            true => REMEMBERED_FRAMES,
            false => u32::from(settings.output.channels.contains(&Channel::Velocity)),
        };
        let mut steps = Vec::new();
        let mut last = None;
        for &frame in frames {
            let follows = last.is_some_and(|last: u32| last.checked_add(1) == Some(frame));
            let start = if follows { frame } else { frame.saturating_sub(before) };
            steps.extend((start..=frame).map(|earlier| Step {
                frame: earlier,
                is_cut: !follows && earlier == start,
                is_shown: earlier == frame,
            }));
            last = Some(frame);
        }
        steps
    }
}

/// A frame that is drawn.
struct Step {
    frame: u32,
    /// It follows no frame before it.
    is_cut: bool,
    /// It was asked for, and not only drawn for the ones after it.
    is_shown: bool,
}

/// A frame of a plan that the device is done with.
pub(crate) struct Coming {
    pub(crate) frame: u32,
    pub(crate) shots: Vec<Shot>,
    pub(crate) drawn: Arrived,
}

/// A frame of a plan.
pub struct Shown {
    /// Index from 0.
    pub frame: u32,
    /// Shots of the heads.
    pub shots: Vec<Shot>,
    /// The finished frame.
    pub drawn: Frame,
}

/// Metres between the middles of heads that stand side by side.
pub fn spacing_m<'a>(heads: impl IntoIterator<Item = &'a Head>) -> f32 {
    let width = |head: &Head| head.bounds().map_or(0.0, |(low, high)| high.x - low.x);
    heads.into_iter().map(width).fold(0.0, f32::max) * SPACING
}

/// Moves the camera of the first shot, which is that of all, away until it shows as many heads side by side.
pub fn step_back(shots: &mut [Shot]) {
    let n = shots.len() as f32;
    if let Some(Shot { camera, .. }) = shots.first_mut() {
        let away = camera.position - camera.target;
        camera.position = camera.target + away * n;
        // What was in focus stays so.
        camera.lens.focus_metres += away.length() * (n - 1.0);
    }
}
