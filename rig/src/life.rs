//! Gaze, pupils and the small involuntary motions of a living person, which are not keyed.
//!
//! ```text
//! time, seed --cells of time, one event each--> blinks, saccades --+
//! time, seed --sines of different periods--> breath, sway ------------+--> Motion, added to the tracks
//! ```
//!
//! Every value is a function of the time and the seed: no frame depends on another, and the frame rate changes only
//! which moments are sampled. The figures are those of people at rest: 12 to 20 blinks per minute of about 0.25 s
//! (Stern et al. 1984), fixations of 0.2 to 2 s with jumps of 0.03 s between them (Leigh and Zee 2015), 12 to 16
//! breaths per minute.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::random::{mixed, unit};
use crate::timeline::Track;

/// Gaze and pupils.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Eyes {
    /// Positive looks to the character's left. Relative to the head; shapes `eyeLook*` reach about 30 degrees.
    #[serde(default)]
    pub yaw_degrees: Track<f32>,
    /// Positive looks down.
    #[serde(default)]
    pub pitch_degrees: Track<f32>,
    /// Diameter of the pupils in millimetres, 1.5 to 9: about 3 in bright light, 7 in the dark, wider when aroused.
    #[serde(default = "calm_pupil")]
    pub pupil_mm: Track<f32>,
}

/// Diameter of a pupil in a lit room, millimetres.
pub const CALM_PUPIL_MM: f32 = 4.7;

fn calm_pupil() -> Track<f32> {
    Track::Constant(CALM_PUPIL_MM)
}

impl Default for Eyes {
    fn default() -> Self {
        Self { yaw_degrees: Track::default(), pitch_degrees: Track::default(), pupil_mm: calm_pupil() }
    }
}

/// Small motions; each is off at 0 and that of a calm person at 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Life {
    /// Seed of the random numbers; another seed gives other moments.
    #[serde(default)]
    pub seed: u32,
    /// How often the eyes blink: 1 is 15 times per minute, 4 is the largest value.
    #[serde(default)]
    #[schemars(range(min = 0, max = 4))]
    pub blinks: f32,
    /// How far the eyes jump from fixation to fixation: 1 is about 1.5 degrees.
    #[serde(default)]
    pub saccades: Track<f32>,
    /// How deep the breath is: 1 lifts the head by a millimetre and a half.
    #[serde(default)]
    pub breathing: Track<f32>,
    /// Breaths per minute.
    #[serde(default = "calm_breath")]
    #[schemars(range(min = 4, max = 60))]
    pub breaths_per_minute: f32,
    /// How much the head sways: 1 is about half a degree.
    #[serde(default)]
    pub sway: Track<f32>,
}

fn calm_breath() -> f32 {
    14.0
}

impl Default for Life {
    fn default() -> Self {
        Self {
            seed: 0,
            blinks: 0.0,
            saccades: Track::default(),
            breathing: Track::default(),
            breaths_per_minute: calm_breath(),
            sway: Track::default(),
        }
    }
}

/// The motion that life adds at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Weight of the blink of the left and of the right eye.
    pub blink: [f32; 2],
    /// Rotation of the gaze: yaw and pitch, degrees, as in [`Eyes`].
    pub gaze_degrees: [f32; 2],
    /// Rotation of the head: yaw, pitch and roll, degrees.
    pub head_degrees: [f32; 3],
    /// Translation of the head, metres.
    pub translation: [f32; 3],
    /// Weight of flared nostrils: breath in.
    pub nostrils: f32,
}

/// Seconds between two blinks at a rate of 1.
const BLINK_EVERY_S: f64 = 4.0;
/// Durations of closing, staying shut and opening, seconds.
const BLINK_S: [f64; 3] = [0.085, 0.045, 0.16];
/// The right lid follows the left by this, seconds.
const LAG_S: f64 = 0.008;
/// Mean length of a fixation and length of a jump, seconds.
const FIXATION_S: f64 = 0.85;
const JUMP_S: f64 = 0.035;

/// A random number from 0 to 1 for one purpose in the cell of time `cell`.
fn random(seed: u32, purpose: u32, cell: i64) -> f64 {
    let z = (u64::from(seed) << 32 | u64::from(purpose)).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ (cell as u64).wrapping_mul(0xd1b5_4a32_d192_ed03);
    unit(mixed(z))
}

fn smooth(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

/// How far a lid is shut, at a time since its blink began.
fn shut(since_s: f64) -> f64 {
    let [close, hold, open] = BLINK_S;
    if since_s < close { smooth(since_s / close) } else { 1.0 - smooth((since_s - close - hold) / open) }
}

/// Time of the event of a cell, in units of a cell: within its middle four fifths.
fn moment(seed: u32, purpose: u32, cell: i64) -> f64 {
    cell as f64 + 0.1 + 0.8 * random(seed, purpose, cell)
}

/// A sum of sines of different periods: smooth, from about -1 to 1, without a visible repetition.
fn wander(seed: u32, purpose: u32, time_s: f64) -> f64 {
    [(5.3, 0.5), (3.1, 0.3), (1.7, 0.2)]
        .iter()
        .enumerate()
        .map(|(i, (period_s, share))| {
            let phase = random(seed, purpose, i as i64);
            share * (std::f64::consts::TAU * (time_s / period_s + phase)).sin()
        })
        .sum()
}

impl Life {
    /// The motion that it adds at a time in seconds.
    pub fn at(&self, time_s: f64) -> Motion {
        let mut motion = Motion::default();
        if self.blinks > 0.0 {
            let every = BLINK_EVERY_S / f64::from(self.blinks);
            let now = (time_s / every).floor() as i64;
            for cell in [now - 1, now] {
                let since = time_s - moment(self.seed, 1, cell) * every;
                for (side, lag) in [0.0, LAG_S].into_iter().enumerate() {
                    if since > lag {
                        motion.blink[side] = motion.blink[side].max(shut(since - lag) as f32);
                    }
                }
            }
        }
        let saccades = f64::from(self.saccades.at(time_s));
        if saccades > 0.0 {
            let now = (time_s / FIXATION_S).floor() as i64;
            // The last jump began in this cell or in the one before.
            let last = if moment(self.seed, 2, now) * FIXATION_S <= time_s { now } else { now - 1 };
            let share = smooth((time_s - moment(self.seed, 2, last) * FIXATION_S) / JUMP_S);
            for (axis, reach) in [1.6, 1.0].into_iter().enumerate() {
                // The mean of two uniform numbers: small jumps are frequent, the largest are rare.
                let target = |cell: i64| {
                    let [a, b] = [3, 4].map(|k| random(self.seed, k + 2 * axis as u32, cell));
                    2.0 * reach * (a + b - 1.0)
                };
                let drift = 0.12 * wander(self.seed, 10 + axis as u32, time_s);
                let gaze = target(last - 1) * (1.0 - share) + target(last) * share + drift;
                motion.gaze_degrees[axis] = (saccades * gaze) as f32;
            }
        }
        let breathing = f64::from(self.breathing.at(time_s));
        if breathing > 0.0 {
            let phase = random(self.seed, 20, 0) + time_s * f64::from(self.breaths_per_minute) / 60.0;
            // Breathing in takes two fifths of the cycle.
            let u = phase - phase.floor();
            let full = if u < 0.4 { smooth(u / 0.4) } else { 1.0 - smooth((u - 0.4) / 0.6) };
            motion.translation[1] += (0.0015 * breathing * full) as f32;
            motion.translation[2] += (0.0008 * breathing * full) as f32;
            motion.head_degrees[1] -= (0.45 * breathing * full) as f32;
            let drawing = if u < 0.4 { (std::f64::consts::PI * u / 0.4).sin() } else { 0.0 };
            motion.nostrils = (0.06 * breathing * drawing) as f32;
        }
        let sway = f64::from(self.sway.at(time_s));
        if sway > 0.0 {
            for (axis, degrees) in [0.55, 0.4, 0.35].into_iter().enumerate() {
                motion.head_degrees[axis] +=
                    (sway * degrees * wander(self.seed, 30 + axis as u32, time_s)) as f32;
            }
            for (axis, metres) in [0.0011, 0.0005, 0.0009].into_iter().enumerate() {
                motion.translation[axis] +=
                    (sway * metres * wander(self.seed, 40 + axis as u32, time_s)) as f32;
            }
        }
        motion
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calm(seed: u32) -> Life {
        let on = || Track::Constant(1.0);
        Life { seed, blinks: 1.0, saccades: on(), breathing: on(), sway: on(), ..Life::default() }
    }

    #[test]
    fn without_amplitudes_nothing_moves() {
        for i in 0..200 {
            assert_eq!(Life::default().at(0.1 * f64::from(i)), Motion::default());
        }
    }

    #[test]
    fn people_blink_as_often_as_asked_and_briefly() {
        for (rate, seed) in [(1.0f32, 1), (2.0, 5), (4.0, 9)] {
            let life = Life { blinks: rate, ..calm(seed) };
            let step = 0.005;
            let (mut count, mut shut_s, mut was) = (0, 0.0, false);
            for i in 0..24_000 {
                let is = life.at(step * f64::from(i)).blink[0] > 0.5;
                count += u32::from(is && !was);
                shut_s += if is { step } else { 0.0 };
                was = is;
            }
            let expected = 120.0 / BLINK_EVERY_S * f64::from(rate);
            assert!((f64::from(count) - expected).abs() <= 1.0, "{count} blinks, expected {expected}");
            let each = shut_s / f64::from(count);
            assert!((0.1..0.25).contains(&each), "{each} s each");
        }
    }

    #[test]
    fn motion_is_smooth_small_and_the_same_each_time() {
        let life = calm(3);
        let mut before = life.at(0.0);
        let (mut least, mut most) = (0.0f32, 0.0f32);
        for i in 1..20_000 {
            let now = life.at(0.001 * f64::from(i));
            for k in 0..3 {
                assert!((now.head_degrees[k] - before.head_degrees[k]).abs() < 0.01);
                assert!(now.head_degrees[k].abs() < 1.2 && now.translation[k].abs() < 0.004);
            }
            for k in 0..2 {
                // The fastest saccades reach several hundred degrees a second.
                assert!((now.gaze_degrees[k] - before.gaze_degrees[k]).abs() < 0.5);
                assert!((now.blink[k] - before.blink[k]).abs() < 0.02);
            }
            (least, most) = (least.min(now.gaze_degrees[0]), most.max(now.gaze_degrees[0]));
            before = now;
        }
        assert!(least < -0.6 && most > 0.6, "gaze from {least} to {most}");
        assert_eq!(life.at(7.31), calm(3).at(7.31));
        assert_ne!(life.at(7.31), calm(4).at(7.31));
    }

    #[test]
    fn eyes_rest_between_jumps() {
        let life = Life { saccades: Track::Constant(1.0), ..Life::default() };
        let speed = |i: i32| {
            let t = 0.01 * f64::from(i);
            (life.at(t + 0.01).gaze_degrees[0] - life.at(t).gaze_degrees[0]).abs() / 0.01
        };
        let still = (0..2000).filter(|i| speed(*i) < 1.0).count();
        assert!((1700..1990).contains(&still), "{still} of 2000 moments are still");
    }
}
