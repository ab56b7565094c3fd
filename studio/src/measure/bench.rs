//! GPU time of each pass, frames drawn back to back.
//!
//! ```text
//! a shot --each number of heads, each settings--> warm-up, frames --timestamps--> median and spread of each pass
//! ```

use rubor_renderer::FrameTimes;
use rubor_renderer::settings::Settings;
use rubor_rig::evaluate::Shot;
use rubor_rig::head::Head;

use super::names;
use crate::error::{Failure, Outcome};
use crate::plan;
use crate::report::{BenchReport, BenchRow, PassCost};
use crate::studio::Studio;

/// Frames of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frames {
    /// Those that are timed.
    pub timed: u32,
    /// Warm-up frames before them, which raise the clock of the device.
    pub warm_up: u32,
}

/// What is drawn: a head, once or as many times side by side.
#[derive(Clone, Copy, Debug)]
pub struct Crowd<'a> {
    /// The head.
    pub head: &'a Head,
    /// What each of them shows; the camera moves away until it sees all.
    pub shot: &'a Shot,
    /// Numbers of heads.
    pub counts: &'a [usize],
}

/// Times a shot of each number of heads with each settings; `told` gets each row as soon as it is measured.
///
/// # Errors
/// A device without timestamps; errors of the studio and of `told`.
pub fn run(
    studio: &mut Studio,
    crowd: &Crowd<'_>,
    all: &[Settings],
    frames: Frames,
    mut told: impl FnMut(&BenchRow, &mut Studio, &[Shot]) -> Outcome,
) -> Outcome<BenchReport> {
    if !studio.has_timestamps() {
        let name = studio.adapter().name;
        return Err(Failure::job(format!("{name} has no timestamps, so passes cannot be timed")));
    }
    let mut rows = Vec::new();
    let spacing_m = plan::spacing_m([crowd.head]);
    for &heads in crowd.counts {
        studio.set_heads(std::iter::repeat_n(crowd.head, heads))?;
        let mut shots = vec![crowd.shot.clone(); heads];
        plan::step_back(&mut shots);
        for (settings, mut name) in all.iter().zip(names(all, &["scatter", "transmit", "antialias"])) {
            if heads > 1 || crowd.counts.len() > 1 {
                name = format!("{name}, heads {heads}");
            }
            let times = studio.measure(&shots, spacing_m, settings, frames.warm_up, frames.timed)?;
            let frame = PassCost::of("frame", 1, times.iter().map(|t| t.frame_ms).collect());
            let row = BenchRow { name, settings: settings.clone(), heads, frame, passes: passes(&times) };
            told(&row, studio, &shots)?;
            rows.push(row);
        }
    }
    Ok(BenchReport { adapter: studio.adapter(), frames: frames.timed, warm_up: frames.warm_up, rows })
}

/// Passes of one name added up, in the order of their first run.
fn passes(times: &[FrameTimes]) -> Vec<PassCost> {
    let Some(first) = times.first() else { return Vec::new() };
    let mut names: Vec<&'static str> = Vec::new();
    for (name, _) in &first.passes_ms {
        if !names.contains(name) {
            names.push(name);
        }
    }
    let of = |t: &FrameTimes, name: &str| -> Vec<f64> {
        t.passes_ms.iter().filter(|(n, _)| *n == name).map(|(_, ms)| *ms).collect()
    };
    names
        .into_iter()
        .map(|name| {
            PassCost::of(
                name,
                of(first, name).len(),
                times.iter().map(|t| of(t, name).iter().sum()).collect(),
            )
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_a_pass_are_added_within_a_frame() {
        let frame = |a: f64| FrameTimes {
            passes_ms: vec![("shadow", a), ("shade", 5.0), ("shadow", 1.0)],
            frame_ms: 9.0,
        };
        let costs = passes(&[frame(1.0), frame(2.0), frame(30.0)]);
        let found: Vec<_> = costs.iter().map(|c| (c.name.as_str(), c.runs, c.median)).collect();
        assert_eq!(found, [("shadow", 2, 3.0), ("shade", 1, 5.0)]);
        assert_eq!(costs[0].p90, 31.0);
    }
}
