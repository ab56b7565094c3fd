//! Functions of time as few keys, for formats with step, linear and cubic interpolation.
//!
//! ```text
//! breaks (authored keys, jumps) --split--> pieces --all constant--> step
//!                                                 --all straight--> linear --leave out keys--> Curve
//!                                                 --else: halve until a cubic fits, join while one fits--> cubic
//! ```
//!
//! The easings of a sequence are polynomials of degree three except one, so most curves are exported as they were
//! authored: a cubic through four values of a cubic is that cubic.

use std::collections::BTreeMap;

use rubor_rig::timeline::{Ease, Track, TrackValue};

/// Before a jump a curve is looked at this much earlier, seconds.
const BEFORE_S: f64 = 1e-9;
/// Pieces are not halved below this, seconds: a kink, where a weight meets its limit, would have no end.
const SHORTEST_S: f64 = 1.0 / 4096.0;
/// Largest error that counts as rounding of weights in f32.
const ROUNDING: f64 = 4e-7;
/// Samples of a piece: its ends, its thirds, and between them.
const SAMPLES: usize = 7;

/// Times at which a function may bend or jump.
#[derive(Clone, Debug)]
pub struct Breaks {
    /// By the bits of the time (which rise with times from 0 on): true where it jumps.
    times: BTreeMap<u64, bool>,
    end_s: f64,
}

impl Breaks {
    /// From 0 to the end; keys after it are left out.
    pub fn new(end_s: f64) -> Self {
        Self { times: [(0.0_f64.to_bits(), false), (end_s.to_bits(), false)].into(), end_s }
    }

    /// Adds the keys of a track.
    pub fn add<T: TrackValue>(&mut self, track: &Track<T>) {
        let Track::Keys(keys) = track else { return };
        for (i, key) in keys.iter().enumerate() {
            let before = i.checked_sub(1).map(|b| &keys[b]);
            self.insert(key.t, before.is_some_and(|k| k.ease == Ease::Step));
            if let (Ease::EaseInOut, Some(next)) = (key.ease, keys.get(i + 1)) {
                self.insert(0.5 * (key.t + next.t), false);
            }
        }
    }

    /// Adds every frame, so that events between keys (a saccade is shorter) are not missed.
    pub fn add_frames(&mut self, fps: f64) {
        let mut frame = 1.0;
        while frame / fps < self.end_s {
            self.insert(frame / fps, false);
            frame += 1.0;
        }
    }

    fn insert(&mut self, time_s: f64, jump: bool) {
        if time_s > 0.0 && time_s <= self.end_s {
            *self.times.entry(time_s.to_bits()).or_default() |= jump;
        }
    }
}

/// The way between two keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Holds the earlier key.
    Step,
    /// A straight line.
    Linear,
    /// A cubic with given slopes at both ends.
    Cubic,
}

/// Keys of several values that share their times.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Between keys.
    pub interpolation: Interpolation,
    /// Strictly increasing; at least one.
    pub keys: Vec<CurveKey>,
}

/// Values at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct CurveKey {
    /// Seconds.
    pub time_s: f32,
    /// One per channel.
    pub values: Vec<f32>,
    /// Slopes per second on the way in and out; empty unless the curve is cubic.
    pub slopes: [Vec<f32>; 2],
}

impl Curve {
    /// True where nothing ever changes.
    pub fn is_constant(&self) -> bool {
        self.keys.len() == 1
    }

    /// Values at a time, as a player computes them.
    pub fn at(&self, time_s: f32) -> Vec<f32> {
        let next = self.keys.partition_point(|k| k.time_s <= time_s);
        let (Some(from), Some(to)) = (next.checked_sub(1).map(|i| &self.keys[i]), self.keys.get(next)) else {
            return self.keys[next.saturating_sub(1)].values.clone();
        };
        let length = f64::from(to.time_s) - f64::from(from.time_s);
        let u = (f64::from(time_s) - f64::from(from.time_s)) / length;
        let value = |c: usize| {
            let (a, b) = (f64::from(from.values[c]), f64::from(to.values[c]));
            match self.interpolation {
                Interpolation::Step => a,
                Interpolation::Linear => a + u * (b - a),
                Interpolation::Cubic => {
                    let slopes = [from.slopes[1][c], to.slopes[0][c]].map(|s| length * f64::from(s));
                    hermite(a, b, slopes, u)
                }
            }
        };
        (0..from.values.len()).map(|c| value(c) as f32).collect()
    }
}

/// A function between two breaks.
struct Piece {
    start_s: f64,
    end_s: f64,
    /// True where the function jumps at the start.
    jump: bool,
    samples: [Vec<f32>; SAMPLES],
}

impl Piece {
    fn new(f: &dyn Fn(f64) -> Vec<f32>, start_s: f64, end_s: f64, jumps: [bool; 2]) -> Self {
        let end = if jumps[1] { end_s - BEFORE_S } else { end_s };
        let at = |i: usize| {
            if i + 1 == SAMPLES {
                return f(end);
            }
            f(start_s + (end_s - start_s) * i as f64 / (SAMPLES - 1) as f64)
        };
        Self { start_s, end_s, jump: jumps[0], samples: std::array::from_fn(at) }
    }

    fn length_s(&self) -> f64 {
        self.end_s - self.start_s
    }

    fn channels(&self) -> usize {
        self.samples[0].len()
    }

    fn sample(&self, i: usize, c: usize) -> f64 {
        f64::from(self.samples[i][c])
    }

    fn is_constant(&self) -> bool {
        self.samples.iter().all(|s| *s == self.samples[0])
    }

    fn is_straight(&self, tolerance: f64) -> bool {
        (0..self.channels()).all(|c| {
            let (a, b) = (self.sample(0, c), self.sample(SAMPLES - 1, c));
            (1..SAMPLES - 1).all(|i| {
                let line = a + (b - a) * i as f64 / (SAMPLES - 1) as f64;
                (line - self.sample(i, c)).abs() <= tolerance
            })
        })
    }

    /// Slopes at both ends, times the length, of the cubic through the ends and the thirds.
    fn slopes(&self, c: usize) -> [f64; 2] {
        let [a, b, d, e] = [0, 2, 4, 6].map(|i| self.sample(i, c));
        [-5.5 * a + 9.0 * b - 4.5 * d + e, -a + 4.5 * b - 9.0 * d + 5.5 * e]
    }

    fn fits_cubic(&self, tolerance: f64) -> bool {
        (0..self.channels()).all(|c| {
            let slopes = self.slopes(c);
            let (a, b) = (self.sample(0, c), self.sample(SAMPLES - 1, c));
            [1, 3, 5].iter().all(|i| {
                let u = *i as f64 / (SAMPLES - 1) as f64;
                (hermite(a, b, slopes, u) - self.sample(*i, c)).abs() <= tolerance
            })
        })
    }

    /// Whether this longer piece passes the samples of a shorter one inside it.
    fn passes(&self, inner: &Piece, tolerance: f64) -> bool {
        (0..self.channels()).all(|c| {
            let slopes = self.slopes(c);
            let (a, b) = (self.sample(0, c), self.sample(SAMPLES - 1, c));
            (0..SAMPLES).all(|i| {
                let time = inner.start_s + inner.length_s() * i as f64 / (SAMPLES - 1) as f64;
                let u = (time - self.start_s) / self.length_s();
                (hermite(a, b, slopes, u) - inner.sample(i, c)).abs() <= tolerance
            })
        })
    }
}

/// Cubic from `a` to `b` whose slopes at the ends are given for the whole way.
fn hermite(a: f64, b: f64, slopes: [f64; 2], u: f64) -> f64 {
    let (u2, u3) = (u * u, u * u * u);
    let from_a = 2.0 * u3 - 3.0 * u2 + 1.0;
    from_a * a + (1.0 - from_a) * b + (u3 - 2.0 * u2 + u) * slopes[0] + (u3 - u2) * slopes[1]
}

/// Keys of a function within `tolerance` of its values; 0 leaves out no authored key.
///
/// Where the function has a kink of slope `s` between two breaks, the error there may be up to `s` / 32768.
/// `only_lines` gives no cubic: more keys, for programs that drop the slopes of cubic keys.
pub fn fit(breaks: &Breaks, f: &dyn Fn(f64) -> Vec<f32>, tolerance: f32, only_lines: bool) -> Curve {
    let times: Vec<(f64, bool)> = breaks.times.iter().map(|(t, jump)| (f64::from_bits(*t), *jump)).collect();
    let mut pieces: Vec<Piece> =
        times.windows(2).map(|w| Piece::new(f, w[0].0, w[1].0, [w[0].1, w[1].1])).collect();
    let end = f(breaks.end_s);
    let key = |time_s: f64, values: &Vec<f32>| CurveKey {
        time_s: time_s as f32,
        values: values.clone(),
        slopes: Default::default(),
    };
    let tolerance = f64::from(tolerance);
    if pieces.iter().all(Piece::is_constant) {
        let mut keys: Vec<CurveKey> = Vec::new();
        let starts = pieces.iter().map(|p| (p.start_s, &p.samples[0]));
        for (time, values) in starts.chain([(breaks.end_s, &end)]) {
            if keys.last().is_none_or(|k| k.values != *values) {
                keys.push(key(time, values));
            }
        }
        // A last key at the end, so that a player that loops keeps the length.
        if keys.len() > 1 && keys.last().is_some_and(|k| k.time_s < breaks.end_s as f32) {
            keys.push(key(breaks.end_s, &end));
        }
        return Curve { interpolation: Interpolation::Step, keys };
    }
    let straight = (0.5 * tolerance).max(ROUNDING);
    if only_lines {
        pieces = halve(f, pieces, &|p| p.is_straight(straight));
    }
    if only_lines || pieces.iter().all(|p| p.is_straight(straight)) {
        let pieces = join_lines(&pieces, 0.5 * tolerance);
        let mut keys: Vec<CurveKey> = Vec::new();
        for (first, last) in pieces {
            begin(&mut keys, first);
            keys.push(key(last.end_s, &last.samples[SAMPLES - 1]));
        }
        finish(&mut keys, breaks.end_s, &end);
        return Curve { interpolation: Interpolation::Linear, keys };
    }
    pieces = halve(f, pieces, &|p| p.fits_cubic((0.5 * tolerance).max(2.0 * ROUNDING)));
    let joined = join_cubics(f, pieces, 0.5 * tolerance);
    let mut keys: Vec<CurveKey> = Vec::new();
    for piece in &joined {
        begin(&mut keys, piece);
        let per_second = 1.0 / piece.length_s();
        let slopes: Vec<[f64; 2]> = (0..piece.channels()).map(|c| piece.slopes(c)).collect();
        let side = |k: usize| slopes.iter().map(|s| (s[k] * per_second) as f32).collect::<Vec<f32>>();
        if let Some(last) = keys.last_mut() {
            last.slopes[1] = side(0);
        }
        let mut next = key(piece.end_s, &piece.samples[SAMPLES - 1]);
        next.slopes[0] = side(1);
        keys.push(next);
    }
    finish(&mut keys, breaks.end_s, &end);
    for key in &mut keys {
        let channels = key.values.len();
        key.slopes.iter_mut().for_each(|s| s.resize(channels, 0.0));
    }
    Curve { interpolation: Interpolation::Cubic, keys }
}

/// The key at the start of a piece: that at the end of the one before, unless the function jumps between them.
fn begin(keys: &mut Vec<CurveKey>, piece: &Piece) {
    let start = CurveKey {
        time_s: piece.start_s as f32,
        values: piece.samples[0].clone(),
        slopes: Default::default(),
    };
    match keys.last_mut() {
        None => keys.push(start),
        Some(last) if piece.jump => {
            before(last);
            keys.push(start);
        }
        Some(_) => {}
    }
}

/// A jump is two keys that no number lies between.
fn before(key: &mut CurveKey) {
    key.time_s = key.time_s.next_down();
}

/// A jump at the very end is a key of its own.
fn finish(keys: &mut Vec<CurveKey>, end_s: f64, end: &[f32]) {
    if let Some(last) = keys.last_mut()
        && last.values.iter().zip(end).any(|(a, b)| f64::from((a - b).abs()) > ROUNDING)
    {
        before(last);
        keys.push(CurveKey { time_s: end_s as f32, values: end.to_vec(), slopes: Default::default() });
    }
    // Times that f32 cannot tell apart are one.
    keys.dedup_by(|later, earlier| later.time_s <= earlier.time_s);
}

/// First and last piece of each line: every value between them is within the tolerance. The slopes that keep it are a
/// cone from the first key, which every value narrows.
fn join_lines(pieces: &[Piece], tolerance: f64) -> Vec<(&Piece, &Piece)> {
    let mut joined: Vec<(&Piece, &Piece)> = Vec::new();
    let mut cones: Vec<(f64, f64)> = Vec::new();
    for piece in pieces {
        if let Some((first, last)) = joined.last_mut()
            && tolerance > 0.0
            && !piece.jump
        {
            // The values of the last piece narrow the cone before it is asked whether a line to this end lies in it.
            let over = |p: &Piece| p.end_s - first.start_s;
            let (done, now) = (over(last), over(piece));
            let fits = cones.iter_mut().enumerate().all(|(c, cone)| {
                let from = first.sample(0, c);
                let passed = last.sample(SAMPLES - 1, c) - from;
                cone.0 = cone.0.max((passed - tolerance) / done);
                cone.1 = cone.1.min((passed + tolerance) / done);
                let slope = (piece.sample(SAMPLES - 1, c) - from) / now;
                (cone.0..=cone.1).contains(&slope)
            });
            if fits {
                *last = piece;
                continue;
            }
        }
        cones = vec![(f64::NEG_INFINITY, f64::INFINITY); piece.channels()];
        joined.push((piece, piece));
    }
    joined
}

/// Frames of which straight lines pass the values of all others within the tolerance; the first and the last stay.
/// Where nothing changes one frame is enough.
pub(super) fn kept_frames(values: &[Vec<f32>], tolerance: f32) -> Vec<usize> {
    let Some(first) = values.first() else { return Vec::new() };
    if values.iter().all(|v| v == first) {
        return vec![0];
    }
    let line = |i: usize, a: &Vec<f32>, b: &Vec<f32>| Piece {
        start_s: i as f64,
        end_s: (i + 1) as f64,
        jump: false,
        samples: std::array::from_fn(|k| if k + 1 == SAMPLES { b.clone() } else { a.clone() }),
    };
    let pieces: Vec<Piece> = values.windows(2).enumerate().map(|(i, w)| line(i, &w[0], &w[1])).collect();
    let joined = join_lines(&pieces, f64::from(tolerance));
    std::iter::once(0).chain(joined.iter().map(|(_, last)| last.end_s as usize)).collect()
}

/// Halves pieces until each fits.
fn halve(f: &dyn Fn(f64) -> Vec<f32>, pieces: Vec<Piece>, fits: &dyn Fn(&Piece) -> bool) -> Vec<Piece> {
    let mut out = Vec::new();
    let mut todo: Vec<Piece> = pieces.into_iter().rev().collect();
    while let Some(piece) = todo.pop() {
        if piece.length_s() <= SHORTEST_S || fits(&piece) {
            out.push(piece);
            continue;
        }
        let middle = 0.5 * (piece.start_s + piece.end_s);
        let mut late = Piece::new(f, middle, piece.end_s, [false, false]);
        late.samples[SAMPLES - 1].clone_from(&piece.samples[SAMPLES - 1]);
        todo.push(late);
        todo.push(Piece::new(f, piece.start_s, middle, [piece.jump, false]));
    }
    out
}

/// Joins neighbours while one cubic passes all their samples: tries ever longer runs, then the middle between the
/// longest that did and the shortest that did not.
fn join_cubics(f: &dyn Fn(f64) -> Vec<f32>, pieces: Vec<Piece>, tolerance: f64) -> Vec<Piece> {
    if tolerance <= 0.0 {
        return pieces;
    }
    let mut out = Vec::new();
    let mut start = 0;
    while start < pieces.len() {
        let limit = (start + 1..pieces.len()).find(|i| pieces[*i].jump).unwrap_or(pieces.len());
        let join = |end: usize| {
            let (first, last) = (&pieces[start], &pieces[end - 1]);
            let mut whole = Piece::new(f, first.start_s, last.end_s, [first.jump, false]);
            whole.samples[SAMPLES - 1].clone_from(&last.samples[SAMPLES - 1]);
            pieces[start..end].iter().all(|p| whole.passes(p, tolerance)).then_some(whole)
        };
        let (mut good, mut best) = (start + 1, None);
        let mut bad = limit + 1;
        while good + 1 < bad {
            let tried =
                if bad > limit { (2 * good - start).clamp(good + 1, limit) } else { good.midpoint(bad) };
            match join(tried) {
                Some(whole) => (good, best) = (tried, Some(whole)),
                None => bad = tried,
            }
            if good == limit {
                break;
            }
        }
        out.push(best.unwrap_or_else(|| {
            let p = &pieces[start];
            Piece { start_s: p.start_s, end_s: p.end_s, jump: p.jump, samples: p.samples.clone() }
        }));
        start = good;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use rubor_rig::timeline::Key;

    fn track(keys: &[(f64, f32, Ease)]) -> Track<f32> {
        Track::Keys(keys.iter().map(|(t, v, ease)| Key { t: *t, v: *v, ease: *ease }).collect())
    }

    fn fitted(tracks: &[Track<f32>], end_s: f64, tolerance: f32) -> Curve {
        let mut breaks = Breaks::new(end_s);
        tracks.iter().for_each(|t| breaks.add(t));
        fit(&breaks, &|t| tracks.iter().map(|track| track.at(t)).collect(), tolerance, false)
    }

    fn worst(curve: &Curve, tracks: &[Track<f32>], end_s: f64) -> f32 {
        let error = |t: f32| {
            let values = curve.at(t);
            tracks.iter().zip(values).map(|(track, v)| (track.at(f64::from(t)) - v).abs()).fold(0.0, f32::max)
        };
        (0..=2000).map(|i| error(end_s as f32 * i as f32 / 2000.0)).fold(0.0, f32::max)
    }

    #[test]
    fn authored_interpolations_stay() {
        let steps = track(&[(0.0, 0.0, Ease::Step), (0.4, 1.0, Ease::Step), (0.7, 0.25, Ease::Step)]);
        let curve = fitted(std::slice::from_ref(&steps), 1.0, 0.0);
        assert_eq!(curve.interpolation, Interpolation::Step);
        assert_eq!(
            curve.keys.iter().map(|k| (k.time_s, k.values[0])).collect::<Vec<_>>(),
            [(0.0, 0.0), (0.4, 1.0), (0.7, 0.25), (1.0, 0.25)]
        );
        let lines = track(&[(0.25, 0.0, Ease::Linear), (0.5, 1.0, Ease::Linear), (1.0, 0.5, Ease::Linear)]);
        let curve = fitted(std::slice::from_ref(&lines), 1.0, 0.0);
        assert_eq!(curve.interpolation, Interpolation::Linear);
        assert_eq!(curve.keys.iter().map(|k| k.time_s).collect::<Vec<_>>(), [0.0, 0.25, 0.5, 1.0]);
        let cubics = track(&[
            (0.0, 0.0, Ease::Smooth),
            (0.3, 1.0, Ease::EaseIn),
            (0.5, 0.2, Ease::EaseOut),
            (0.8, 0.9, Ease::EaseInOut),
            (1.0, 0.0, Ease::Linear),
        ]);
        let curve = fitted(std::slice::from_ref(&cubics), 1.0, 0.0);
        assert_eq!(curve.interpolation, Interpolation::Cubic);
        // Authored keys and the middle of the one easing that is two cubics.
        assert_eq!(curve.keys.len(), 6);
        assert!(worst(&curve, std::slice::from_ref(&cubics), 1.0) < 1e-6);
    }

    #[test]
    fn mixed_easings_with_jumps_stay_within_the_tolerance() {
        let tracks = [
            track(&[(0.0, 0.0, Ease::Smoother), (0.9, 1.0, Ease::Linear), (1.7, 0.0, Ease::Linear)]),
            track(&[(0.2, 0.5, Ease::Step), (0.55, 1.0, Ease::Smooth), (2.0, 0.0, Ease::Linear)]),
            track(&[(0.0, 0.3, Ease::Step), (2.0, 0.8, Ease::Linear)]),
        ];
        for tolerance in [0.0, 1e-5, 1e-3] {
            let curve = fitted(&tracks, 2.0, tolerance);
            assert_eq!(curve.interpolation, Interpolation::Cubic);
            assert!(curve.keys.windows(2).all(|w| w[0].time_s < w[1].time_s));
            let error = worst(&curve, &tracks, 2.0);
            assert!(error <= tolerance.max(2e-6), "{error} at {tolerance}");
            assert_eq!(curve.at(2.0)[2], 0.8, "a jump at the very end is kept");
        }
    }

    #[test]
    fn a_larger_tolerance_leaves_out_keys() {
        let noisy: Vec<(f64, f32, Ease)> = (0..=120)
            .map(|i| {
                (f64::from(i) / 60.0, (i as f32 * 0.02).sin() + 1e-4 * (i as f32 * 7.3).sin(), Ease::Linear)
            })
            .collect();
        let noisy = [track(&noisy)];
        let counts: Vec<usize> = [0.0, 1e-3, 1e-2]
            .iter()
            .map(|tolerance| {
                let curve = fitted(&noisy, 2.0, *tolerance);
                assert_eq!(curve.interpolation, Interpolation::Linear);
                assert!(worst(&curve, &noisy, 2.0) <= tolerance.max(2e-6));
                curve.keys.len()
            })
            .collect();
        assert_eq!(counts[0], 121);
        assert!(counts[1] < 90 && counts[2] < 30 && counts[2] > 4, "{counts:?}");
    }

    #[test]
    fn a_clamped_curve_is_followed_into_its_kink() {
        let rising = track(&[(0.0, 0.0, Ease::Linear), (1.0, 2.0, Ease::Linear)]);
        let mut breaks = Breaks::new(1.0);
        breaks.add(&rising);
        let clamped = |t: f64| vec![rising.at(t).min(1.3)];
        let curve = fit(&breaks, &clamped, 1e-5, false);
        let error = |t: f64| (curve.at(t as f32)[0] - clamped(t)[0]).abs();
        let worst = (0..=10_000).map(|i| error(f64::from(i) * 1e-4)).fold(0.0, f32::max);
        assert!(worst < 2.0 / 32768.0 + 1e-6, "{worst}");
        assert!(curve.keys.len() < 40, "{}", curve.keys.len());
    }

    #[test]
    fn lines_alone_stay_within_the_tolerance() {
        let tracks = [
            track(&[(0.0, 0.0, Ease::Smooth), (0.9, 1.0, Ease::Step), (1.7, 0.0, Ease::Linear)]),
            track(&[(0.2, 0.5, Ease::EaseInOut), (1.5, 1.0, Ease::Linear)]),
        ];
        let mut breaks = Breaks::new(2.0);
        tracks.iter().for_each(|t| breaks.add(t));
        let curve = fit(&breaks, &|t| tracks.iter().map(|track| track.at(t)).collect(), 1e-3, true);
        assert_eq!(curve.interpolation, Interpolation::Linear);
        assert!(worst(&curve, &tracks, 2.0) <= 1.001e-3);
        assert!((20..90).contains(&curve.keys.len()), "{}", curve.keys.len());
    }

    #[test]
    fn kept_frames_pass_all_others() {
        let values: Vec<Vec<f32>> =
            (0..100).map(|i| vec![(i as f32 * 0.03).sin(), if i < 50 { 0.0 } else { 1.0 }]).collect();
        let kept = kept_frames(&values, 1e-3);
        assert!(kept.len() < 40 && kept[0] == 0 && *kept.last().unwrap() == 99, "{kept:?}");
        assert!(kept.contains(&49) && kept.contains(&50));
        for w in kept.windows(2) {
            for i in w[0]..=w[1] {
                let share = (i - w[0]) as f32 / (w[1] - w[0]) as f32;
                for c in 0..2 {
                    let line = values[w[0]][c] + share * (values[w[1]][c] - values[w[0]][c]);
                    assert!((line - values[i][c]).abs() <= 1.001e-3, "{i}");
                }
            }
        }
        assert_eq!(kept_frames(&values, 0.0).len(), 100);
        assert_eq!(kept_frames(&vec![vec![0.5]; 9], 0.0), [0]);
    }

    #[test]
    fn what_never_changes_is_one_key() {
        let curve = fitted(&[Track::Constant(0.5)], 3.0, 1e-5);
        assert!(curve.is_constant());
        assert_eq!(curve.at(2.0), [0.5]);
    }
}
