//! Animation curves: cubic Hermite segments between keys (Bezier in time where tangents are weighted).
//!
//! Tangent types of files: 1 fixed, 2 linear, 3 flat, 5 step, 9 spline, 10 clamped, 16 plateau, 17 step next, 18 auto.
//! Maya does not publish the formula of `auto`. Taken here: flat at the ends and at extrema, elsewhere the slope
//! between the neighbours, at most three times the smaller of both sides so that nothing overshoots (F. N. Fritsch and
//! R. E. Carlson 1980). Curves that are keyed flat, linear or stepped, or whose tangents are stored, are exact.

use rubor_rig::timeline::{Ease, Key, Track};

use crate::ascii::scene::CurveData;

/// A curve in seconds and in one unit of value.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    keys: Vec<Knot>,
    weighted: bool,
}

#[derive(Clone, Copy, Debug)]
struct Knot {
    time_s: f64,
    value: f64,
    /// Handles: (seconds, value) for fixed tangents.
    inward: Tangent,
    outward: Tangent,
}

#[derive(Clone, Copy, Debug)]
struct Tangent {
    kind: u32,
    x: f64,
    y: f64,
}

/// Largest number of frames at which the curves of a scene are sampled: 52 weights for 26 minutes at 60 per second.
pub(super) const MOST_BAKED_FRAMES: f64 = 5_000_000.0;

const FIXED: u32 = 1;
const LINEAR: u32 = 2;
const FLAT: u32 = 3;
const STEP: u32 = 5;
const SPLINE: u32 = 9;
const CLAMPED: u32 = 10;
const PLATEAU: u32 = 16;
const STEP_NEXT: u32 = 17;
const AUTO: u32 = 18;

/// Segments that no easing says and that are sampled at frames, up to a limit for a scene.
#[derive(Debug)]
pub(super) struct Baking {
    frames_left: f64,
    pub(super) segments: usize,
    /// Segments that would go over the limit and are straight instead.
    pub(super) too_long: usize,
}

impl Default for Baking {
    fn default() -> Self {
        Self { frames_left: MOST_BAKED_FRAMES, segments: 0, too_long: 0 }
    }
}

impl Baking {
    /// True if a segment of this many frames is sampled.
    pub(super) fn segment(&mut self, frames: f64) -> bool {
        let fits = frames <= self.frames_left;
        if fits {
            self.frames_left -= frames;
            self.segments += 1;
        } else {
            self.too_long += 1;
        }
        fits
    }
}

impl Curve {
    /// `fps`: units of time in a second. `unit`: factor of the written values; stored tangents are in
    /// seconds and in the unit that results.
    pub(super) fn new(data: &CurveData, fps: f64, unit: f64) -> Option<Self> {
        let mut keys: Vec<Knot> = Vec::with_capacity(data.keys.len());
        for (index, [time, value]) in &data.keys {
            let tangent =
                |types: &std::collections::BTreeMap<u32, u32>, x: Option<&f64>, y: Option<&f64>| Tangent {
                    kind: types.get(index).copied().unwrap_or(data.default_tangent),
                    x: x.copied().unwrap_or(1.0),
                    y: y.copied().unwrap_or(0.0),
                };
            keys.push(Knot {
                time_s: time / fps,
                value: value * unit,
                inward: tangent(&data.in_types, data.in_x.get(index), data.in_y.get(index)),
                outward: tangent(&data.out_types, data.out_x.get(index), data.out_y.get(index)),
            });
        }
        keys.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        keys.dedup_by(|later, earlier| later.time_s <= earlier.time_s);
        (!keys.is_empty()).then_some(Self { keys, weighted: data.weighted })
    }

    pub(super) fn first_s(&self) -> f64 {
        self.keys[0].time_s
    }

    pub(super) fn times_s(&self) -> impl Iterator<Item = f64> {
        self.keys.iter().map(|k| k.time_s)
    }

    pub(super) fn last_s(&self) -> f64 {
        self.keys[self.keys.len() - 1].time_s
    }

    /// Slope of the spline through a key.
    fn spline_slope(&self, i: usize) -> f64 {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(self.keys.len() - 1));
        if before == after { 0.0 } else { self.chord(before, after) }
    }

    fn chord(&self, a: usize, b: usize) -> f64 {
        (self.keys[b].value - self.keys[a].value) / (self.keys[b].time_s - self.keys[a].time_s)
    }

    /// Slope of a tangent at key `i`, value per second; `out` is the side after the key.
    fn slope(&self, i: usize, out: bool) -> f64 {
        let key = &self.keys[i];
        let tangent = if out { key.outward } else { key.inward };
        let (before, after) = (i.checked_sub(1), Some(i + 1).filter(|n| *n < self.keys.len()));
        match tangent.kind {
            // A vertical handle is as steep as can be drawn.
            FIXED if tangent.x.abs() < 1e-9 => tangent.y.signum() * 1e9,
            FIXED => tangent.y / tangent.x,
            LINEAR => match if out { after } else { before } {
                Some(other) if out => self.chord(i, other),
                Some(other) => self.chord(other, i),
                None => 0.0,
            },
            SPLINE => self.spline_slope(i),
            CLAMPED | PLATEAU | AUTO => {
                let (Some(before), Some(after)) = (before, after) else {
                    return if tangent.kind == CLAMPED { self.spline_slope(i) } else { 0.0 };
                };
                let (left, right) = (self.chord(before, i), self.chord(i, after));
                if tangent.kind == CLAMPED {
                    let near = |a: usize, b: usize| (self.keys[a].value - self.keys[b].value).abs() < 0.05;
                    return if near(before, i) || near(i, after) { 0.0 } else { self.spline_slope(i) };
                }
                if left * right <= 0.0 {
                    return 0.0;
                }
                let most = 3.0 * left.abs().min(right.abs());
                self.spline_slope(i).clamp(-most, most)
            }
            FLAT => 0.0,
            _ => 0.0,
        }
    }

    /// Control points of a segment in (seconds, value) relative to its first key; none where it is stepped.
    fn handles(&self, i: usize) -> [[f64; 2]; 2] {
        let (from, to) = (&self.keys[i], &self.keys[i + 1]);
        let length = to.time_s - from.time_s;
        let third = length / 3.0;
        let plain = |slope: f64| [third, slope * third];
        let stored = |tangent: Tangent| self.weighted && tangent.kind == FIXED;
        let out = if stored(from.outward) {
            [from.outward.x / 3.0, from.outward.y / 3.0]
        } else {
            plain(self.slope(i, true))
        };
        let inward = if stored(to.inward) {
            [to.inward.x / 3.0, to.inward.y / 3.0]
        } else {
            plain(self.slope(i + 1, false))
        };
        // A handle that reaches over the segment would make time run backwards.
        let shorten = |[x, y]: [f64; 2]| {
            let x = x.max(0.0);
            if x > length { [length, y * length / x] } else { [x, y] }
        };
        [shorten(out), shorten(inward)]
    }

    /// Value at a time in seconds; outside the keys the first and last values hold.
    pub(super) fn at(&self, time_s: f64) -> f64 {
        let next = self.keys.partition_point(|k| k.time_s <= time_s);
        let Some(i) = next.checked_sub(1) else { return self.keys[0].value };
        let Some(to) = self.keys.get(next) else { return self.keys[i].value };
        let from = &self.keys[i];
        if time_s == from.time_s {
            return from.value;
        }
        match from.outward.kind {
            STEP => return from.value,
            STEP_NEXT => return to.value,
            _ => {}
        }
        let length = to.time_s - from.time_s;
        let [[out_x, out_y], [in_x, in_y]] = self.handles(i);
        let x = [0.0, out_x / length, 1.0 - in_x / length, 1.0];
        let y = [from.value, from.value + out_y, to.value - in_y, to.value];
        let share = (time_s - from.time_s) / length;
        let bezier = |p: [f64; 4], u: f64| {
            let w = 1.0 - u;
            w * w * w * p[0] + 3.0 * w * w * u * p[1] + 3.0 * w * u * u * p[2] + u * u * u * p[3]
        };
        let mut u = share;
        if (x[1] - 1.0 / 3.0).abs() > 1e-12 || (x[2] - 2.0 / 3.0).abs() > 1e-12 {
            // Time rises monotonically along the curve: bisection to the last bit that matters.
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..50 {
                u = 0.5 * (low + high);
                if bezier(x, u) < share { low = u } else { high = u }
            }
        }
        bezier(y, u)
    }

    /// The curve as a track: key by key where an easing says the same, frame by frame elsewhere. `value` turns values
    /// into what the track holds.
    pub(super) fn track(
        &self,
        start_s: f64,
        fps: f64,
        baking: &mut Baking,
        value: impl Fn(f64) -> f32,
    ) -> Track<f32> {
        let mut keys: Vec<Key<f32>> = Vec::new();
        for (i, knot) in self.keys.iter().enumerate() {
            let ease = if i + 1 < self.keys.len() { self.ease(i) } else { Some(Ease::Linear) };
            // Exact where the scene starts at 0.
            let t = (knot.time_s - start_s).max(0.0);
            keys.push(Key { t, v: value(knot.value), ease: ease.unwrap_or_default() });
            if ease.is_none() {
                let end = self.keys[i + 1].time_s - start_s;
                if !baking.segment((end - t) * fps) {
                    continue;
                }
                let first = (t * fps + 1e-6).floor() as u64 + 1;
                for frame in first.. {
                    let time = frame as f64 / fps;
                    if time >= end - 1e-9 {
                        break;
                    }
                    keys.push(Key { t: time, v: value(self.at(time + start_s)), ease: Ease::Linear });
                }
            }
        }
        Track::Keys(keys)
    }

    /// The easing of a segment, where one is the same curve.
    fn ease(&self, i: usize) -> Option<Ease> {
        let (from, to) = (&self.keys[i], &self.keys[i + 1]);
        match from.outward.kind {
            STEP => return Some(Ease::Step),
            STEP_NEXT => return None,
            _ => {}
        }
        let length = to.time_s - from.time_s;
        let rise = to.value - from.value;
        let [[out_x, out_y], [in_x, in_y]] = self.handles(i);
        // Slopes in shares of the way a share of the time.
        let near = |a: f64, b: f64| (a - b).abs() < 1e-6;
        if !near(3.0 * out_x / length, 1.0) || !near(3.0 * in_x / length, 1.0) {
            return None;
        }
        if rise == 0.0 {
            return (out_y == 0.0 && in_y == 0.0).then_some(Ease::Linear);
        }
        let (a, b) = (3.0 * out_y / rise, 3.0 * in_y / rise);
        [
            (Ease::Linear, 1.0, 1.0),
            (Ease::Smooth, 0.0, 0.0),
            (Ease::EaseIn, 0.0, 2.0),
            (Ease::EaseOut, 2.0, 0.0),
        ]
        .into_iter()
        .find(|(_, start, end)| near(a, *start) && near(b, *end))
        .map(|(ease, ..)| ease)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(keys: &[[f64; 2]], tangent: u32) -> Curve {
        let data = CurveData {
            keys: keys.iter().enumerate().map(|(i, k)| (i as u32, *k)).collect(),
            default_tangent: tangent,
            ..CurveData::default()
        };
        Curve::new(&data, 24.0, 1.0).unwrap()
    }

    #[test]
    fn every_tangent_type_passes_its_keys_and_known_points() {
        let keys = [[0.0, 0.0], [24.0, 1.0], [48.0, 3.0], [72.0, 3.0]];
        for tangent in [LINEAR, FLAT, STEP, SPLINE, CLAMPED, PLATEAU, STEP_NEXT, AUTO] {
            let c = curve(&keys, tangent);
            for [t, v] in keys {
                assert_eq!(c.at(t / 24.0), v, "tangent {tangent}");
            }
            assert_eq!((c.at(-1.0), c.at(9.0)), (0.0, 3.0));
        }
        assert_eq!(curve(&keys, LINEAR).at(0.25), 0.25);
        assert_eq!(curve(&keys, FLAT).at(0.5), 0.5);
        assert_eq!(curve(&keys, FLAT).at(0.25), 0.15625);
        assert_eq!(curve(&keys, STEP).at(0.99), 0.0);
        assert_eq!(curve(&keys, STEP_NEXT).at(0.01), 1.0);
        // Spline: slopes 1 at the start (end slope = chord) and 1.5 at the middle key.
        let expected = 0.125 * 1.0 - 0.125 * 1.5 + 0.5;
        assert!((curve(&keys, SPLINE).at(0.5) - expected).abs() < 1e-12);
        // Auto never leaves the range of its two keys.
        let c = curve(&keys, AUTO);
        for i in 0..=300 {
            let t = f64::from(i) / 100.0;
            let (low, high) = if t < 1.0 {
                (0.0, 1.0)
            } else if t < 2.0 {
                (1.0, 3.0)
            } else {
                (3.0, 3.0)
            };
            assert!((low - 1e-12..=high + 1e-12).contains(&c.at(t)), "{t}: {}", c.at(t));
        }
    }

    #[test]
    fn keys_years_apart_are_not_sampled_at_frames() {
        let c = curve(&[[0.0, 0.0], [7.0, 0.3], [1e12, 1.0], [2e12, 3.0]], SPLINE);
        let mut baking = Baking::default();
        let Track::Keys(keys) = c.track(0.0, 24.0, &mut baking, |v| v as f32) else {
            panic!("keys expected")
        };
        assert_eq!((baking.segments, baking.too_long), (1, 2));
        assert_eq!(keys.len(), 4 + 6);
    }

    #[test]
    fn weighted_handles_bend_time() {
        let mut data = CurveData { weighted: true, default_tangent: FIXED, ..CurveData::default() };
        data.keys = [(0, [0.0, 0.0]), (1, [24.0, 1.0])].into();
        // Handles of full length along time: a very steep middle.
        for (x, y) in [(&mut data.out_x, &mut data.out_y), (&mut data.in_x, &mut data.in_y)] {
            *x = [(0, 3.0), (1, 3.0)].into();
            *y = [(0, 0.0), (1, 0.0)].into();
        }
        let c = Curve::new(&data, 24.0, 1.0).unwrap();
        // In the middle the curve is vertical: time fixes the parameter only to the cube root of its last bit.
        assert!((c.at(0.5) - 0.5).abs() < 1e-4);
        // Parametric: t = 3u(1-u)^2 + u^3 at u = 0.25 is 0.4375, value there 3u^2(1-u) + u^3 = 0.15625.
        assert!((c.at(0.4375) - 0.15625).abs() < 1e-9, "{}", c.at(0.4375));
        // Handles at thirds are the unweighted curve.
        for x in [&mut data.out_x, &mut data.in_x] {
            *x = [(0, 1.0), (1, 1.0)].into();
        }
        let c = Curve::new(&data, 24.0, 1.0).unwrap();
        assert!((c.at(0.25) - 0.15625).abs() < 1e-12);
    }

    #[test]
    fn tracks_follow_the_curve_at_every_frame() {
        let keys = [[0.0, 0.0], [7.0, 0.3], [20.0, 1.0], [21.0, 1.0], [40.0, 0.2]];
        for tangent in [LINEAR, FLAT, STEP, SPLINE, CLAMPED, PLATEAU, STEP_NEXT, AUTO] {
            let c = curve(&keys, tangent);
            let mut baking = Baking::default();
            let track = c.track(0.0, 24.0, &mut baking, |v| v as f32);
            let exact = [LINEAR, FLAT, STEP].contains(&tangent);
            assert_eq!(baking.segments == 0, exact, "tangent {tangent}: {baking:?}");
            for frame in 0..45 {
                let t = f64::from(frame) / 24.0;
                assert!((f64::from(track.at(t)) - c.at(t)).abs() < 1e-6, "tangent {tangent}, frame {frame}");
            }
        }
    }
}
