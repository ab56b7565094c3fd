//! Measuring: time of passes, error of methods, difference of pictures.

pub mod bench;
pub mod budget;
pub mod chart;
pub mod difference;
pub mod stability;
pub mod volume;

use rubor_assets::files::plain_names;
use rubor_renderer::settings::{Leaf, Settings, leaves};
use serde_json::Value;

/// Every choice of one value from each list, applied to `base`; the last list changes fastest. The lists are changes as
/// [`Settings::overlay`] takes them.
///
/// # Errors
/// A value that the settings refuse.
pub fn product(base: &Settings, lists: &[Vec<Value>]) -> crate::Outcome<Vec<Settings>> {
    let mut all = vec![base.clone()];
    for list in lists {
        let mut next = Vec::with_capacity(all.len() * list.len());
        for settings in &all {
            for change in list {
                let mut settings = settings.clone();
                settings.overlay(change)?;
                next.push(settings);
            }
        }
        all = next;
    }
    all.iter().try_for_each(Settings::validate)?;
    Ok(all)
}

/// A name for each of several settings: the values of the flags in `always`, and of those that differ.
pub(crate) fn names(all: &[Settings], always: &[&str]) -> Vec<String> {
    let values: Vec<Value> = all.iter().map(|s| serde_json::to_value(s).unwrap_or_default()).collect();
    let of = |value: &Value, leaf: &Leaf| leaf.value_in(value).clone();
    let differs = |leaf: &Leaf| values.windows(2).any(|pair| of(&pair[0], leaf) != of(&pair[1], leaf));
    let first = always.iter().filter_map(|flag| Leaf::of_flag(flag));
    let then = leaves().iter().filter(|leaf| !always.contains(&leaf.flag().as_str()) && differs(leaf));
    let leaves: Vec<&Leaf> = first.chain(then).collect();
    let text = |leaf: &Leaf, value: Value| match value {
        Value::String(text) => text,
        Value::Array(list) if leaf.flag() == "size" => {
            list.iter().map(Value::to_string).collect::<Vec<_>>().join("x")
        }
        Value::Object(profile) => profile["name"].as_str().unwrap_or("profile").to_owned(),
        // A bare number needs the name of its setting.
        other => format!("{} {other}", leaf.flag()),
    };
    values
        .iter()
        .map(|value| leaves.iter().map(|leaf| text(leaf, of(value, leaf))).collect::<Vec<_>>().join(", "))
        .collect()
}

/// A file name for the name of settings; the name of a profile comes from a file and may be any text.
pub fn file_name(name: &str) -> String {
    let name = name.replace(", ", "_").replace([':', ' '], "-");
    plain_names([name.as_str()]).concat()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn products_have_every_choice_and_names_tell_what_differs() {
        let change = |group: &str, field: &str, values: &[Value]| -> Vec<Value> {
            values.iter().map(|v| json!({ group: { field: v } })).collect()
        };
        let lists = [
            change("quality", "scatter", &["none".into(), "separable:5".into()]),
            change("quality", "shadowSize", &[64.into(), 128.into()]),
        ];
        let all = product(&Settings::default(), &lists).unwrap();
        assert_eq!(
            names(&all, &["antialias"]),
            [
                "smaa-s2x, none, shadow-size 64",
                "smaa-s2x, none, shadow-size 128",
                "smaa-s2x, separable:5, shadow-size 64",
                "smaa-s2x, separable:5, shadow-size 128",
            ]
        );
        assert_eq!(file_name("separable:5, shadow-size 64"), "separable-5_shadow-size-64");
        assert_eq!(file_name("../victim/evil"), ".._victim_evil");
        assert!(product(&Settings::default(), &[change("quality", "shadowSize", &[1.into()])]).is_err());
    }
}
