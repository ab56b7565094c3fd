//! The rig as riggers write it: expressions, states, combinations and in-betweens (`rig.json`).
//!
//! ```
//! use rubor_rig::expression::Rig;
//! let rig = Rig::from_json("rig.json", r#"{ "expressions": {
//!     "wink": { "shapes": { "eyeBlinkLeft": 1.0 }, "wrinkles": { "crow-feet-left": 0.5 } }, // the left eye only
//! } }"#).unwrap();
//! assert_eq!(rig.expressions["wink"].shapes["eyeBlinkLeft"], 1.0);
//!
//! let wrong = Rig::from_json("rig.json", "{\n  \"expresions\": {}\n}").unwrap_err();
//! assert_eq!((wrong.place.line, wrong.place.column), (2, 3));
//! assert_eq!(wrong.nearest.as_deref(), Some("expressions"));
//! ```

use std::collections::{BTreeMap, HashSet};
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::RigError;
use crate::json::{self, Source, Step, steps};

/// Everything that a face can do, by name. A rig belongs to no head: names are resolved when it meets one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[schemars(title = "rubor rig")]
pub struct Rig {
    /// Address of the JSON schema, for editors.
    #[serde(rename = "$schema", default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// What this rig is for, in words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
    /// Named facial expressions: joy, surprise, fear, anger, disgust, sadness and any other.
    #[serde(default)]
    pub expressions: BTreeMap<String, Expression>,
    /// Named states of the whole body that show in the skin: exercise, alcohol, blush, pallor and any other.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub states: BTreeMap<String, State>,
    /// Corrective shapes that other shapes drive together. Later ones see the result of earlier ones.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub combinations: Vec<Combination>,
    /// Shapes that a shape passes through on its way to full weight.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inbetweens: Vec<Inbetween>,
    /// The text that it was read from.
    #[serde(skip)]
    pub source: Source,
}

/// What one expression at full weight does. All of it scales with the weight of the expression.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Expression {
    /// Weight of each blend shape by name, nominally 0 to 1. A negative weight holds back what another expression does.
    #[serde(default)]
    pub shapes: BTreeMap<String, f32>,
    /// Weight of each wrinkle zone by name. Negative weights cancel wrinkles of other expressions; the sum over
    /// expressions is clamped to 0..1 (Jimenez 2012 section 8.2).
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub wrinkles: BTreeMap<String, f32>,
    /// Weight of each hemoglobin distribution by name, 0 or more, at most 1 together; the neutral one has the rest
    /// (Jimenez 2012 eq. 7.6: weights sum to one).
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub hemoglobin: BTreeMap<String, f32>,
    /// Global factor of hemoglobin at full weight; 1 changes nothing (Jimenez 2012 section 7.7: anger 1.27, fear 0.81).
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub hemoglobin_scale: f32,
}

/// What a state of the body at full weight does to the skin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct State {
    /// As in an expression.
    #[serde(default)]
    pub hemoglobin: BTreeMap<String, f32>,
    /// As in an expression.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub hemoglobin_scale: f32,
    /// Replaces both fields above on a head that lacks any distribution which `hemoglobin` names.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fallback: Option<Fallback>,
}

/// The second choice of a [`State`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Fallback {
    /// As in an expression.
    #[serde(default)]
    pub hemoglobin: BTreeMap<String, f32>,
    /// As in an expression.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub hemoglobin_scale: f32,
}

/// A corrective shape. Its weight is added to what drives it directly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Combination {
    /// The corrective shape.
    pub shape: String,
    /// The shapes that drive it. Both halves of a pair are two drivers; write `eyeBlinkLeft`, not `eyeBlink`, for one.
    pub drivers: Vec<String>,
    /// How the weights of the drivers are combined.
    #[serde(default)]
    pub mode: CombinationMode,
}

/// How the weights of drivers are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub enum CombinationMode {
    /// The product: smooth, weak until all drivers are strong.
    #[default]
    Product,
    /// The minimum: linear while the drivers rise together.
    Min,
}

/// A shape on the way to another. The path through all in-betweens of a shape is piecewise linear:
/// at `weight` only `target` acts, at 1 only `shape`, between two neighbours both share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Inbetween {
    /// The shape that is driven.
    pub shape: String,
    /// The shape that stands for it at `weight`.
    pub target: String,
    /// Between 0 and 1, both excluded.
    pub weight: f32,
}

fn one() -> f32 {
    1.0
}

fn is_one(scale: &f32) -> bool {
    *scale == 1.0
}

impl Default for Expression {
    fn default() -> Self {
        Self {
            shapes: BTreeMap::new(),
            wrinkles: BTreeMap::new(),
            hemoglobin: BTreeMap::new(),
            hemoglobin_scale: 1.0,
        }
    }
}

impl Default for State {
    fn default() -> Self {
        Self { hemoglobin: BTreeMap::new(), hemoglobin_scale: 1.0, fallback: None }
    }
}

/// File name that messages give the default rig.
const DEFAULT_RIG_FILE: &str = "default_rig.json";
/// The default rig as text, comments included: a rig to learn from.
pub const DEFAULT_RIG_JSON: &str = include_str!("default_rig.json");

impl Rig {
    /// Reads and checks a rig. `file` is the name that messages give it.
    ///
    /// # Errors
    /// The first fault that does not depend on the head, with its place.
    pub fn from_json(file: &str, text: &str) -> Result<Self, RigError> {
        let (mut rig, source) = json::from_str::<Self>(file, text)?;
        rig.source = source;
        rig.check()?;
        Ok(rig)
    }

    /// Reads a rig file.
    ///
    /// # Errors
    /// As [`Rig::from_json`], and if the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, RigError> {
        Self::from_json(&path.display().to_string(), &json::read_text(path)?)
    }

    /// The rig that ships with rubor: six basic expressions and four states for ARKit names.
    ///
    /// # Errors
    /// None that a user can cause: the text is part of the program and a test reads it.
    pub fn default_rig() -> Result<Self, RigError> {
        Self::from_json(DEFAULT_RIG_FILE, DEFAULT_RIG_JSON)
    }

    /// Checks what does not depend on a head.
    ///
    /// # Errors
    /// The first violation, with its place if the rig was read from a text.
    pub fn check(&self) -> Result<(), RigError> {
        for (name, expression) in &self.expressions {
            let at = steps!["expressions", name];
            self.check_finite(&at, "shapes", &expression.shapes)?;
            self.check_finite(&at, "wrinkles", &expression.wrinkles)?;
            self.check_hemoglobin(&at, &expression.hemoglobin, expression.hemoglobin_scale)?;
        }
        for (name, state) in &self.states {
            let at = steps!["states", name];
            self.check_hemoglobin(&at, &state.hemoglobin, state.hemoglobin_scale)?;
            if let Some(fallback) = &state.fallback {
                let at = steps!["states", name, "fallback"];
                self.check_hemoglobin(&at, &fallback.hemoglobin, fallback.hemoglobin_scale)?;
            }
        }
        for (i, combination) in self.combinations.iter().enumerate() {
            let mut before = HashSet::new();
            if combination.drivers.is_empty() {
                return self.wrong(&steps!["combinations", i, "drivers"], "no driver", "at least one driver");
            }
            for (j, driver) in combination.drivers.iter().enumerate() {
                if *driver == combination.shape || !before.insert(driver.as_str()) {
                    let found = format!("{driver:?} again");
                    let expected = "drivers that differ from each other and from the shape they drive";
                    return self.wrong(&steps!["combinations", i, "drivers", j], &found, expected);
                }
            }
        }
        let mut before = HashSet::new();
        for (i, inbetween) in self.inbetweens.iter().enumerate() {
            if !(inbetween.weight > 0.0 && inbetween.weight < 1.0) {
                let found = inbetween.weight.to_string();
                return self.wrong(&steps!["inbetweens", i, "weight"], &found, "a weight between 0 and 1");
            }
            if inbetween.target == inbetween.shape {
                let found = format!("{:?} as its own in-between", inbetween.target);
                return self.wrong(&steps!["inbetweens", i, "target"], &found, "another shape");
            }
            if !before.insert((inbetween.shape.as_str(), inbetween.weight.to_bits())) {
                let found = format!("a second in-between of {:?} at {}", inbetween.shape, inbetween.weight);
                return self.wrong(&steps!["inbetweens", i, "weight"], &found, "different weights");
            }
        }
        Ok(())
    }

    fn check_finite(
        &self,
        at: &[Step],
        field: &str,
        weights: &BTreeMap<String, f32>,
    ) -> Result<(), RigError> {
        for (name, weight) in weights {
            if !weight.is_finite() {
                let inner = [at, &steps![field, name]].concat();
                return self.wrong(&inner, &weight.to_string(), "a finite weight");
            }
        }
        Ok(())
    }

    fn check_hemoglobin(
        &self,
        at: &[Step],
        weights: &BTreeMap<String, f32>,
        scale: f32,
    ) -> Result<(), RigError> {
        // Decimal fractions such as 0.7 + 0.2 + 0.1 may exceed 1 by rounding only.
        const ROUNDING: f32 = 1e-5;
        for (name, weight) in weights {
            if !(weight.is_finite() && *weight >= 0.0) {
                let inner = [at, &steps!["hemoglobin", name]].concat();
                return self.wrong(&inner, &weight.to_string(), "a weight of 0 or more");
            }
        }
        let sum: f32 = weights.values().sum();
        if sum > 1.0 + ROUNDING {
            let inner = [at, &steps!["hemoglobin"]].concat();
            let expected = "hemoglobin weights that sum to 1 at most (neutral has the rest)";
            return self.wrong(&inner, &format!("weights that sum to {sum}"), expected);
        }
        if !(scale.is_finite() && scale >= 0.0) {
            let inner = [at, &steps!["hemoglobinScale"]].concat();
            return self.wrong(&inner, &scale.to_string(), "a finite factor of 0 or more");
        }
        Ok(())
    }

    fn wrong<T>(&self, path: &[Step], found: &str, expected: &str) -> Result<T, RigError> {
        Err(RigError {
            place: self.source.place_of_value(path),
            found: found.to_owned(),
            expected: expected.to_owned(),
            nearest: None,
        })
    }
}

/// JSON schema of `rig.json`.
pub fn rig_schema() -> serde_json::Value {
    schemars::schema_for!(Rig).to_value()
}
