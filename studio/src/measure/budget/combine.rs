//! Which of many small losses go together under a bound.

use crate::error::Outcome;

/// Something that may go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Step {
    /// What it is about. Of the steps of one subject an earlier one goes before a later one.
    pub(super) subject: usize,
    /// Number of the step of its subject, from 1.
    pub(super) level: u32,
    /// What it saves over the step before, bytes.
    pub(super) saves: u64,
    /// The error that it adds to the step before, alone.
    pub(super) error: f64,
}

/// Errors under this are no difference between steps: then bytes decide.
const LEAST_ERROR: f64 = 1e-5;

/// Brings steps into the order of bytes over error, those of a subject by their level.
pub(super) fn sort(steps: &mut [Step]) {
    let ratio = |step: &Step| step.saves as f64 / step.error.max(LEAST_ERROR);
    // A step is worth no more than the worst before it of its subject: it cannot go earlier.
    let worth: Vec<f64> = (steps.iter())
        .map(|step| {
            let before = steps.iter().filter(|s| s.subject == step.subject && s.level <= step.level);
            before.map(ratio).fold(f64::INFINITY, f64::min)
        })
        .collect();
    let mut order: Vec<usize> = (0..steps.len()).collect();
    order.sort_by(|a, b| {
        let (x, y) = (&steps[*a], &steps[*b]);
        worth[*b].total_cmp(&worth[*a]).then((x.subject, x.level).cmp(&(y.subject, y.level)))
    });
    let sorted: Vec<Step> = order.iter().map(|i| steps[*i]).collect();
    steps.copy_from_slice(&sorted);
}

/// Takes as many steps as stay under a bound together, in their order, and leaves out single ones that do not. `keeps` measures
/// whether some steps together keep the bound.
///
/// Steps are taken several at a time, twice as many after each success. If they pass the bound together, halving finds the
/// first of them that does; it and the further steps of its subject are left out.
pub(super) fn combine(steps: &[Step], mut keeps: impl FnMut(&[Step]) -> Outcome<bool>) -> Outcome<Vec<Step>> {
    let mut taken: Vec<Step> = Vec::new();
    let mut open: Vec<Step> = steps.to_vec();
    let mut batch = 4;
    while !open.is_empty() {
        let count = open.len().min(batch);
        let with = |taken: &[Step], more: &[Step]| [taken, more].concat();
        if keeps(&with(&taken, &open[..count]))? {
            taken.extend(open.drain(..count));
            batch *= 2;
            continue;
        }
        // The first `good` keep the bound, the first `bad` do not.
        let (mut good, mut bad) = (0, count);
        while bad - good > 1 {
            let middle = good.midpoint(bad);
            if keeps(&with(&taken, &open[..middle]))? {
                good = middle;
            } else {
                bad = middle;
            }
        }
        taken.extend(open.drain(..good));
        let refused = open.remove(0);
        open.retain(|s| s.subject != refused.subject || s.level < refused.level);
        batch = 1;
    }
    Ok(taken)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(subject: usize, level: u32, saves: u64, error: f64) -> Step {
        Step { subject, level, saves, error }
    }

    #[test]
    fn steps_are_taken_by_bytes_over_error_and_levels_in_turn() {
        let mut steps = vec![
            step(0, 1, 10, 0.1),
            step(1, 1, 1000, 0.1),
            // The second level is worth more than the first, and still comes after it.
            step(2, 1, 50, 0.1),
            step(2, 2, 9000, 0.1),
            step(3, 1, 1, 0.0),
        ];
        sort(&mut steps);
        let order: Vec<_> = steps.iter().map(|s| (s.subject, s.level)).collect();
        assert_eq!(order, [(3, 1), (1, 1), (2, 1), (2, 2), (0, 1)]);
    }

    #[test]
    fn what_goes_together_stays_under_the_bound_and_nothing_more_would_fit() {
        // Errors add up: 40 steps of 1 to 8 hundredths under a bound of half.
        let steps: Vec<Step> =
            (0..40).map(|i| step(i, 1, 1000 - i as u64, ((i * 7) % 8 + 1) as f64 * 0.01)).collect();
        let sum = |all: &[Step]| all.iter().map(|s| s.error).sum::<f64>();
        let mut measured = 0;
        let taken = combine(&steps, |all| {
            measured += 1;
            Ok(sum(all) <= 0.5 + 1e-12)
        })
        .unwrap();
        assert!(sum(&taken) <= 0.5 + 1e-12);
        let rest = steps.iter().filter(|s| !taken.contains(s)).map(|s| s.error).fold(f64::INFINITY, f64::min);
        assert!(sum(&taken) + rest > 0.5, "{} and {rest}", sum(&taken));
        assert!(measured < 60, "{measured} measurements");
    }

    #[test]
    fn a_refused_level_ends_its_subject() {
        let steps = [step(0, 1, 4, 0.1), step(1, 1, 3, 0.9), step(1, 2, 2, 0.0), step(2, 1, 1, 0.1)];
        let taken = combine(&steps, |all| Ok(all.iter().map(|s| s.error).sum::<f64>() < 0.5)).unwrap();
        let found: Vec<_> = taken.iter().map(|s| (s.subject, s.level)).collect();
        assert_eq!(found, [(0, 1), (2, 1)]);
        assert!(combine(&steps, |_| Ok(false)).unwrap().is_empty());
    }
}
