//! What a chart compares: groups of choices, each with the choice that counts as right.
//!
//! ```text
//! base settings + lists --groups--> group: choices that differ in one setting, truth, measure
//! ```

use rubor_renderer::settings::{
    AntialiasMethod, BounceMethod, ColorMethod, DetailMethod, Leaf, RasterMethod, ScatterMethod, Settings,
    TransmitMethod, WrinkleMethod,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::suite::Suite;
use crate::error::{Failure, Outcome};
use crate::measure::names;

/// What the error of a choice is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Measure {
    /// Relative RMSE of the diffuse light of skin, before albedo, linear.
    Light,
    /// Mean FLIP of the displayed picture, over the head.
    Picture,
}

/// What counts as right, and how much is spent on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// Light in skin.
    pub light: RightLight,
    /// Samples on a side of a pixel for antialiasing.
    pub samples: u32,
}

/// Light in skin that counts as right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RightLight {
    /// `reference-surface` with so many batches of 65 536 samples: as exact as time allows, with noise.
    Surface(u32),
    /// `reference-screen` and `shadow-depth`: the best that a frame in one go can reach. The measure is the picture.
    Screen,
}

/// Choices that differ in one setting.
#[derive(Clone, Debug)]
pub struct Group {
    /// The flag of the setting.
    pub flag: String,
    /// What is compared.
    pub measure: Measure,
    /// With these settings a picture is right.
    pub truth: Settings,
    /// Each choice with its name.
    pub choices: Vec<(String, Settings)>,
}

/// Methods of each group: those of the quick suite, then the others. What stands after a space changes a second setting.
const METHODS: &[(&str, &[&str], &[&str])] = &[
    (
        "scatter",
        &["none", "separable:9", "separable:17", "separable:33", "screen-gauss:6", "burley-disk:16"],
        &[
            "screen-gauss:4",
            "screen-jitter",
            "burley-disk:64",
            "pre-integrated:1",
            "pre-integrated:3",
            "texture-space:512",
            "texture-space:1024",
            "texture-space:1024 transmit=translucent-shadow-map",
            "dipole-cubemap:16",
            "dipole-cubemap:64",
        ],
    ),
    ("transmit", &["none", "shadow-depth"], &[]),
    ("wrinkles", &["none", "difference", "partial-derivative"], &[]),
    ("color", &["static", "hemoglobin"], &[]),
    ("antialias", &["none", "mlaa", "smaa-1x", "smaa-s2x"], &["smaa-t2x", "smaa-4x", "ssaa:2", "ssaa:4"]),
    ("bounce", &["none", "patches"], &[]),
    ("detail", &["auto", "full"], &[]),
    ("raster", &[], &["hardware", "compute"]),
];

/// Right settings of a group, as far as it has any: what measures it, and how the base changes.
fn truth(flag: &str, base: &Settings, effort: Effort) -> Option<(Measure, Settings)> {
    let mut right = base.clone();
    let quality = &mut right.quality;
    match (flag, effort.light) {
        ("scatter" | "transmit" | "curvature", RightLight::Surface(batches)) => {
            quality.scatter = ScatterMethod::ReferenceSurface(batches);
            // The integral over the surface includes the light from behind: that of slabs.
            quality.transmit = TransmitMethod::ShadowDepth;
            return Some((Measure::Light, right));
        }
        ("scatter" | "curvature", RightLight::Screen) => quality.scatter = ScatterMethod::ReferenceScreen,
        ("transmit", RightLight::Screen) => quality.transmit = TransmitMethod::ShadowDepth,
        ("wrinkles", _) => quality.wrinkles = WrinkleMethod::PartialDerivative,
        ("color", _) => quality.color = ColorMethod::Hemoglobin,
        ("antialias", _) => quality.antialias = AntialiasMethod::Ssaa(effort.samples),
        ("bounce", _) => quality.bounce = BounceMethod::Patches,
        ("detail", _) => quality.detail = DetailMethod::Full,
        ("raster", _) => quality.raster = RasterMethod::Hardware,
        _ => return None,
    }
    Some((Measure::Picture, right))
}

fn leaf(flag: &str) -> Outcome<&'static Leaf> {
    Leaf::of_flag(flag)
        .ok_or_else(|| Failure::input(format!("found {flag:?}, expected the name of a setting")))
}

/// Changes of the base for a row of [`METHODS`].
fn parse(flag: &str, text: &str) -> Outcome<Vec<Value>> {
    let mut words = text.split(' ');
    let first = words.next().map(|value| (flag, value));
    let rest = words.filter_map(|word| word.split_once('='));
    first
        .into_iter()
        .chain(rest)
        // Not checked alone: one may only be possible with the other.
        .map(|(flag, value)| Ok(leaf(flag)?.change(&value.into())))
        .collect()
}

/// Groups of a chart: the lists of the user, each a flag with the values of its setting, or those of the suite without any
/// setting in `held`. Each group varies one setting of the base. Of a setting without a right answer the last value
/// counts as right.
///
/// # Errors
/// Values that the settings refuse.
pub fn groups(
    suite: Suite,
    base: &Settings,
    listed: &[(String, Vec<Value>)],
    held: &[String],
    effort: Effort,
) -> Outcome<Vec<Group>> {
    base.validate()?;
    let changes: Vec<(String, Vec<Vec<Value>>)> = if listed.is_empty() {
        let chosen = |(flag, quick, rest): &(&str, &[&str], &[&str])| -> Outcome<(String, Vec<Vec<Value>>)> {
            let rest = if suite == Suite::Whole { *rest } else { &[] };
            let all = quick.iter().chain(rest).map(|text| parse(flag, text)).collect::<Outcome<_>>()?;
            Ok(((*flag).to_owned(), all))
        };
        let free = METHODS.iter().filter(|(flag, ..)| !held.iter().any(|h| h == flag));
        free.map(chosen).collect::<Outcome<_>>()?
    } else {
        let of = |(flag, values): &(String, Vec<Value>)| -> Outcome<(String, Vec<Vec<Value>>)> {
            let leaf = leaf(flag)?;
            Ok((flag.clone(), values.iter().map(|value| vec![leaf.change(value)]).collect()))
        };
        listed.iter().map(of).collect::<Outcome<_>>()?
    };
    let mut groups = Vec::new();
    for (flag, changes) in changes {
        let mut choices = Vec::new();
        for change in &changes {
            let mut settings = base.clone();
            change.iter().try_for_each(|change| settings.overlay(change))?;
            settings.validate()?;
            choices.push(settings);
        }
        choices.dedup();
        if choices.len() < 2 {
            continue;
        }
        let last = choices.last().cloned().unwrap_or_else(|| base.clone());
        let (measure, truth) = truth(&flag, base, effort).unwrap_or((Measure::Picture, last));
        truth.validate()?;
        if flag == "scatter" {
            // What a method on the screen can reach.
            let mut screen = base.clone();
            screen.quality.scatter = ScatterMethod::ReferenceScreen;
            choices.retain(|c| *c != screen);
            choices.insert(0, screen);
        }
        let name =
            |choice: &Settings| names(&[base.clone(), choice.clone()], &[&flag]).pop().unwrap_or_default();
        let choices = choices.into_iter().map(|choice| (name(&choice), choice)).collect();
        groups.push(Group { flag, measure, truth, choices });
    }
    if groups.is_empty() {
        let expected = "expected several values of a setting, or one that no flag holds";
        return Err(Failure::input(format!("chart: found nothing to compare, {expected}")));
    }
    Ok(groups)
}

#[cfg(test)]
mod tests {
    use rubor_renderer::settings::GROUPS;

    use super::*;

    const EFFORT: Effort = Effort { light: RightLight::Surface(2), samples: 2 };

    #[test]
    fn every_group_of_methods_is_charted_or_a_matter_of_taste() {
        let whole = groups(Suite::Whole, &Settings::default(), &[], &[], EFFORT).unwrap();
        for group in GROUPS {
            let is_charted = whole.iter().any(|g| g.flag == group.name);
            let is_taste =
                ["specular", "tone-map", "depth-of-field", "backdrop", "dither"].contains(&group.name);
            // Only pre-integrated light asks for the curvature.
            assert!(is_charted != (is_taste || group.name == "curvature"), "{}", group.name);
        }
        for group in GROUPS.iter().filter(|g| whole.iter().any(|w| w.flag == g.name)) {
            let charted = &whole.iter().find(|w| w.flag == group.name).unwrap().choices;
            for method in
                group.methods.iter().map(|m| m.name).filter(|m| !m.starts_with("reference") && *m != "auto")
            {
                let is_there = whole.iter().flat_map(|g| &g.choices).any(|(name, _)| name.contains(method));
                assert!(is_there, "{method} of {}: {charted:?}", group.name);
            }
        }
    }

    #[test]
    fn lists_of_the_user_replace_the_suite_and_change_one_setting_each() {
        let base = Settings::default();
        let listed = [
            ("scatter".to_owned(), vec!["none".into(), "separable:5".into()]),
            ("shadow-size".to_owned(), vec![64.into(), 128.into(), 256.into()]),
        ];
        let found = groups(Suite::Whole, &base, &listed, &[], EFFORT).unwrap();
        let names: Vec<Vec<&str>> =
            found.iter().map(|g| g.choices.iter().map(|(name, _)| name.as_str()).collect()).collect();
        assert_eq!(names[0], ["reference-screen", "none", "separable:5"]);
        assert_eq!(names[1], ["shadow-size 64", "shadow-size 128", "shadow-size 256"]);
        assert_eq!(found[1].truth.quality.shadow_size, 256, "the last one is right");
        assert_eq!(found[0].truth.quality.scatter, ScatterMethod::ReferenceSurface(2));
        let twice = [("scatter".to_owned(), vec!["none".into(), "none".into()])];
        let message = groups(Suite::Quick, &base, &twice, &[], EFFORT).unwrap_err().to_string();
        assert!(message.contains("nothing to compare"), "{message}");
        let held = groups(Suite::Quick, &base, &[], &["scatter".to_owned()], EFFORT).unwrap();
        assert!(!held.iter().any(|g| g.flag == "scatter") && held.iter().any(|g| g.flag == "antialias"));
    }

    #[test]
    fn names_tell_what_differs() {
        let whole = groups(Suite::Whole, &Settings::default(), &[], &[], EFFORT).unwrap();
        let scatter = &whole[0].choices;
        assert!(scatter.iter().any(|(name, _)| name == "texture-space:1024, translucent-shadow-map"));
        let mut names: Vec<_> = scatter.iter().map(|(name, _)| name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), scatter.len());
    }
}
