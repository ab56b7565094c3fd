//! How far pictures may be from their references: `tests/tolerances.json`, the only place that says so.
//!
//! References are blessed on one software rasteriser, which `pinned` names with its driver. There a picture may differ by
//! `largest_difference` steps of 255 (0: equal bytes); FLIP follows from that. Any other adapter or driver rounds
//! otherwise: there only the mean of FLIP counts.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::picture::Difference;

/// An adapter as its driver names it.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adapter {
    /// Name of the device.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
}

/// What a picture may differ by.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tolerance {
    /// On the pinned adapter: the largest difference of two values, steps of 255.
    pub largest_difference: u8,
    /// On other adapters: the largest mean of FLIP, 0 to 1.
    pub flip_mean: f64,
}

/// The file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tolerances {
    /// What the file says to its readers.
    pub about: String,
    /// The adapter of the references.
    pub pinned: Adapter,
    /// By the first word of a picture's name, which ends at the first `-`.
    pub groups: BTreeMap<String, Tolerance>,
    /// By the whole name of a picture: wins over its group.
    pub pictures: BTreeMap<String, Tolerance>,
}

/// What is wrong with the file.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {reason}")]
pub struct ToleranceError {
    /// Path.
    pub file: String,
    /// What was found, with line and column.
    pub reason: String,
}

/// The group of a picture.
pub fn group(picture: &str) -> &str {
    picture.split_once('-').map_or(picture, |(group, _)| group)
}

impl Tolerances {
    /// Reads the file.
    ///
    /// # Errors
    /// No such file, or one of another shape.
    pub fn read(file: &Path) -> Result<Self, ToleranceError> {
        let wrong = |reason: String| ToleranceError { file: file.display().to_string(), reason };
        let text = std::fs::read_to_string(file).map_err(|e| wrong(e.to_string()))?;
        serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))
    }

    /// The tolerance of a picture; `None` where neither it nor its group is listed.
    pub fn of(&self, picture: &str) -> Option<Tolerance> {
        self.pictures.get(picture).or_else(|| self.groups.get(group(picture))).copied()
    }
}

impl Tolerance {
    /// Says what is out of tolerance, if anything is.
    pub fn excess(&self, difference: &Difference, is_pinned: bool) -> Option<String> {
        let Difference { largest, pixels, flip_mean } = *difference;
        let allowed = self.largest_difference;
        if is_pinned && largest > allowed {
            return Some(format!(
                "the largest difference is {largest} of 255, allowed is {allowed}; {pixels} pixels differ, mean FLIP {flip_mean:.5}"
            ));
        }
        if !is_pinned && flip_mean > self.flip_mean {
            return Some(format!(
                "mean FLIP is {flip_mean:.5}, allowed is {}; the largest difference is {largest} of 255 in {pixels} pixels",
                self.flip_mean
            ));
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXACT: Tolerance = Tolerance { largest_difference: 0, flip_mean: 0.01 };

    #[test]
    fn a_picture_has_its_own_tolerance_or_that_of_its_group() {
        let loose = Tolerance { largest_difference: 3, flip_mean: 0.1 };
        let tolerances = Tolerances {
            about: String::new(),
            pinned: Adapter { name: "a".into(), driver: "b".into() },
            groups: [("scatter".to_owned(), EXACT)].into(),
            pictures: [("scatter-noisy".to_owned(), loose)].into(),
        };
        assert_eq!(tolerances.of("scatter-none"), Some(EXACT));
        assert_eq!(tolerances.of("scatter-noisy"), Some(loose));
        assert_eq!(tolerances.of("scattered"), None);
    }

    #[test]
    fn bytes_count_on_the_pinned_adapter_and_flip_elsewhere() {
        let step = Difference { largest: 1, pixels: 4, flip_mean: 0.001 };
        assert!(EXACT.excess(&step, true).expect("one step is too much").contains("1 of 255"));
        assert_eq!(EXACT.excess(&step, false), None);
        let visible = Difference { largest: 90, pixels: 400, flip_mean: 0.02 };
        assert!(EXACT.excess(&visible, false).expect("visible").contains("0.02"));
        assert_eq!(EXACT.excess(&Difference::default(), true), None);
    }
}
