//! Which choices are worth their time: Pareto fronts.

use super::choices::Measure;
use crate::report::{ChartGroup, ChartOverall, ChartReport};

/// Time against error of a choice.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Price {
    ms: f64,
    error: f64,
}

/// Whether each is on the front: nothing else is at most as slow and at most as wrong, and better in one of the two.
fn front(prices: &[Option<Price>]) -> Vec<bool> {
    let beats = |a: Price, b: Price| a.ms <= b.ms && a.error <= b.error && (a.ms < b.ms || a.error < b.error);
    prices
        .iter()
        .map(|price| price.is_some_and(|price| !prices.iter().flatten().any(|other| beats(*other, price))))
        .collect()
}

/// Marks the front of each scene, and adds what all scenes together say: light adds up its squares, pictures their means.
pub(super) fn mark(report: &mut ChartReport) {
    for group in &mut report.groups {
        for s in 0..report.scenes.len() {
            let prices: Vec<_> = group
                .choices
                .iter()
                .map(|c| {
                    let point = c.points.get(s)?;
                    Some(Price { ms: point.frame.as_ref()?.median, error: point.error.of(group.measure) })
                })
                .collect();
            for (choice, is_on_front) in group.choices.iter_mut().zip(front(&prices)) {
                if let Some(point) = choice.points.get_mut(s) {
                    point.is_on_front = is_on_front;
                }
            }
        }
        overall(group);
    }
}

fn overall(group: &mut ChartGroup) {
    let measure = group.measure;
    for choice in &mut group.choices {
        let n = choice.points.len();
        if n == 0 {
            continue;
        }
        let errors = choice.points.iter().map(|p| p.error.of(measure));
        let error = match measure {
            Measure::Light => (errors.map(|e| e * e).sum::<f64>() / n as f64).sqrt(),
            Measure::Picture => errors.sum::<f64>() / n as f64,
        };
        let ms: Option<f64> = choice.points.iter().map(|p| p.frame.as_ref().map(|f| f.median)).sum();
        choice.overall = Some(ChartOverall {
            error,
            worst: choice.points.iter().map(|p| p.error.of(measure)).fold(0.0, f64::max),
            frame_ms: ms.map(|ms| ms / n as f64),
            is_on_front: false,
        });
    }
    let prices: Vec<_> = group
        .choices
        .iter()
        .map(|c| {
            let overall = c.overall.as_ref()?;
            Some(Price { ms: overall.frame_ms?, error: overall.error })
        })
        .collect();
    for (choice, is_on_front) in group.choices.iter_mut().zip(front(&prices)) {
        if let Some(overall) = &mut choice.overall {
            overall.is_on_front = is_on_front;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let price = |ms, error| Some(Price { ms, error });
        let prices =
            [price(1.0, 0.5), price(2.0, 0.1), price(2.0, 0.2), price(3.0, 0.3), None, price(1.0, 0.5)];
        assert_eq!(front(&prices), [true, true, false, false, false, true]);
    }
}
