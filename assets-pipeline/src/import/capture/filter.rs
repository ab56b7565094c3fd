//! Curves of a recording: neutral pose, jitter, resampling, key reduction.

use rubor_rig::timeline::{Ease, Key, Track};

/// Median of the values whose times lie in a range; `None` if none does.
pub(super) fn median_in(times_s: &[f64], values: &[f32], from_s: f64, to_s: f64) -> Option<f32> {
    let inside = times_s.iter().zip(values).filter(|(t, _)| (from_s..=to_s).contains(*t));
    let mut inside: Vec<f32> = inside.map(|(_, v)| *v).collect();
    if inside.is_empty() {
        return None;
    }
    let middle = inside.len() / 2;
    Some(*inside.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// Samples on each side that a smoothed one looks at: two seconds of the fastest tracker of faces.
const MOST_NEIGHBOURS: usize = 256;

/// Bilateral filter over time (Tomasi and Manduchi 1998): a mean of neighbours near in time *and* in value. Jitter
/// smaller than `amplitude` goes, a blink stays as sharp as it was, and nothing is delayed.
///
/// `window_s` is the standard deviation in time, `amplitude` that in value. At most [`MOST_NEIGHBOURS`] samples on each
/// side count, which bounds the time for dense samples.
pub(super) fn smooth(times_s: &[f64], values: &[f32], window_s: f64, amplitude: f64) -> Vec<f32> {
    // Beyond three deviations a weight is below 0.012.
    let reach = 3.0 * window_s;
    let (in_time, in_value) = (-0.5 / (window_s * window_s), -0.5 / (amplitude * amplitude));
    let mut start = 0;
    let mut out = Vec::with_capacity(values.len());
    for (i, (time, value)) in times_s.iter().zip(values).enumerate() {
        start = start.max(i.saturating_sub(MOST_NEIGHBOURS));
        while times_s[start] < time - reach {
            start += 1;
        }
        let end = (i + MOST_NEIGHBOURS + 1).min(values.len());
        let (mut sum, mut weights) = (0.0, 0.0);
        for (t, v) in times_s[start..end].iter().zip(&values[start..end]) {
            if *t > time + reach {
                break;
            }
            let change = f64::from(v - value);
            let weight = (in_time * (t - time) * (t - time) + in_value * change * change).exp();
            sum += weight * f64::from(*v);
            weights += weight;
        }
        // Never 0: the sample itself has the weight 1.
        out.push((sum / weights) as f32);
    }
    out
}

/// Values at `count` times i / fps. Straight lines between samples; where frames are longer than samples, the mean of
/// that line over one frame, so that nothing between two frames is missed or aliased.
pub(super) fn resample(times_s: &[f64], values: &[f32], fps: f64, count: usize, rate: f64) -> Vec<f32> {
    let line = Line::new(times_s, values);
    let half = 0.5 / fps;
    // Frames up to a tenth longer than samples are sampled as they are: a mean would only blur them.
    let averaged = fps < 0.9 * rate;
    (0..count)
        .map(|i| {
            let time = i as f64 / fps;
            if averaged { line.mean(time - half, time + half) as f32 } else { line.at(time) as f32 }
        })
        .collect()
}

/// A piecewise linear curve that holds before its start and after its end.
struct Line<'a> {
    times_s: &'a [f64],
    values: &'a [f32],
    /// Integral from the first time to each time.
    integral: Vec<f64>,
}

impl<'a> Line<'a> {
    fn new(times_s: &'a [f64], values: &'a [f32]) -> Self {
        let mut sum = 0.0;
        let steps = times_s.windows(2).zip(values.windows(2));
        let integral = std::iter::once(0.0)
            .chain(steps.map(|(t, v)| {
                sum += 0.5 * (t[1] - t[0]) * (f64::from(v[0]) + f64::from(v[1]));
                sum
            }))
            .collect();
        Self { times_s, values, integral }
    }

    /// Index of the sample at or before a time, and the way to the next one; clamped.
    fn place(&self, time: f64) -> (usize, f64) {
        let next = self.times_s.partition_point(|t| *t <= time);
        let Some(i) = next.checked_sub(1) else { return (0, 0.0) };
        match self.times_s.get(next) {
            Some(end) => (i, (time - self.times_s[i]) / (end - self.times_s[i])),
            None => (i, 0.0),
        }
    }

    fn at(&self, time: f64) -> f64 {
        let (i, share) = self.place(time);
        let a = f64::from(self.values[i]);
        match self.values.get(i + 1) {
            Some(b) => a * (1.0 - share) + f64::from(*b) * share,
            None => a,
        }
    }

    /// Mean between two times inside the curve; outside it is not counted.
    fn mean(&self, from: f64, to: f64) -> f64 {
        let (first, last) = (self.times_s[0], self.times_s[self.times_s.len() - 1]);
        let (from, to) = (from.clamp(first, last), to.clamp(first, last));
        if to - from < 1e-9 { self.at(from) } else { (self.area(to) - self.area(from)) / (to - from) }
    }

    fn area(&self, time: f64) -> f64 {
        let (i, _) = self.place(time);
        self.integral[i] + 0.5 * (time - self.times_s[i]) * (f64::from(self.values[i]) + self.at(time))
    }
}

/// Keys of which straight lines pass every value within `tolerance`. The keys are values themselves, and one is only
/// left out if all lines that replace it keep the tolerance: the slopes that do are a cone from the last key, which
/// every value narrows (Reumann and Witkam's corridor with a moving end).
pub(super) fn reduce(values: &[f32], fps: f64, tolerance: f32) -> Track<f32> {
    let key = |i: usize| Key { t: i as f64 / fps, v: values[i], ease: Ease::Linear };
    let Some(first) = values.first() else { return Track::Constant(0.0) };
    if values.iter().all(|v| (v - first).abs() <= tolerance) {
        // The middle of the range is within the tolerance of all of them.
        return Track::Constant(if values.iter().all(|v| v == first) { *first } else { middle(values) });
    }
    let mut keys = vec![key(0)];
    let mut anchor = 0;
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for i in 1..values.len() {
        let from = f64::from(values[anchor]);
        let slope = |v: f64, i: usize| (v - from) / (i - anchor) as f64;
        let tolerance = f64::from(tolerance);
        let straight = slope(f64::from(values[i]), i);
        if straight < low || straight > high {
            keys.push(key(i - 1));
            anchor = i - 1;
            let from = f64::from(values[anchor]);
            low = f64::from(values[i]) - tolerance - from;
            high = f64::from(values[i]) + tolerance - from;
        } else {
            low = low.max(slope(f64::from(values[i]) - tolerance, i));
            high = high.min(slope(f64::from(values[i]) + tolerance, i));
        }
    }
    keys.push(key(values.len() - 1));
    Track::Keys(keys)
}

fn middle(values: &[f32]) -> f32 {
    let low = values.iter().copied().fold(f32::INFINITY, f32::min);
    let high = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    0.5 * (low + high)
}
