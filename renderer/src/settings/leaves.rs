//! The single settings inside of [`Settings`], read from its schema: for command flags, range checks and documentation.

use std::sync::LazyLock;

use serde_json::Value;

use super::{Settings, SettingsError};

/// A single setting, as opposed to a group.
#[derive(Clone, Debug, PartialEq)]
pub struct Leaf {
    /// Names of the objects that contain it, and its own name: `["quality", "shadowSize"]`.
    pub path: [String; 2],
    /// Description of the setting.
    pub about: String,
    /// The allowed values: names of methods, a range, a form.
    pub expected: String,
    /// Its default.
    pub default: Value,
    /// Least and largest number.
    pub range: Option<[f64; 2]>,
    /// Type of its JSON value; of an array, that of an element.
    pub kind: String,
    /// Whether it is a list.
    pub is_list: bool,
}

impl Leaf {
    /// `output.supersampling`.
    pub fn name(&self) -> String {
        self.path.join(".")
    }

    /// The flag of the command: `--shadow-size` for `shadowSize`.
    pub fn flag(&self) -> String {
        let mut flag = String::new();
        for c in self.path[1].chars() {
            if c.is_ascii_uppercase() {
                flag.push('-');
            }
            flag.push(c.to_ascii_lowercase());
        }
        flag
    }

    /// The setting of a flag.
    pub fn of_flag(flag: &str) -> Option<&'static Self> {
        leaves().iter().find(|leaf| leaf.flag() == flag)
    }

    /// A change that [`Settings::overlay`] takes.
    pub fn change(&self, value: &Value) -> Value {
        let [group, field] = &self.path;
        Value::Object([(group.clone(), serde_json::json!({ field: value }))].into_iter().collect())
    }

    /// Its value in settings that were written as JSON.
    pub fn value_in<'a>(&self, settings: &'a Value) -> &'a Value {
        let [group, field] = &self.path;
        &settings[group][field]
    }

    /// The JSON value of a text on the command line.
    ///
    /// # Errors
    /// The text is not a value of this setting.
    pub fn parse(&self, text: &str) -> Result<Value, String> {
        let value = if self.path[1] == "size" {
            parse_size(text)?
        } else if self.is_list {
            Value::Array(
                text.split(',')
                    .filter(|t| !t.is_empty())
                    .map(|t| self.scalar(t))
                    .collect::<Result<_, _>>()?,
            )
        } else {
            self.scalar(text)?
        };
        let mut settings = Settings::default();
        settings.overlay(&self.change(&value)).and_then(|()| settings.validate()).map_err(|e| match e {
            SettingsError::Range { found, expected, .. } => format!("found {found}, expected {expected}"),
            SettingsError::Json(message) => message,
        })?;
        Ok(value)
    }

    fn scalar(&self, text: &str) -> Result<Value, String> {
        match self.kind.as_str() {
            "string" => Ok(Value::String(text.to_owned())),
            _ => {
                serde_json::from_str(text).map_err(|_| format!("found {text:?}, expected {}", self.expected))
            }
        }
    }
}

/// `1920x1080`.
fn parse_size(text: &str) -> Result<Value, String> {
    let wrong = || format!("found {text:?}, expected WIDTHxHEIGHT in pixels, such as 640x640");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let side = |t: &str| t.trim().parse::<u32>().ok().filter(|n| *n > 0).ok_or_else(wrong);
    Ok(serde_json::json!([side(width)?, side(height)?]))
}

/// Every setting, by the name of its group and its own.
pub fn leaves() -> &'static [Leaf] {
    static LEAVES: LazyLock<Vec<Leaf>> = LazyLock::new(read_schema);
    &LEAVES
}

fn read_schema() -> Vec<Leaf> {
    let generator = schemars::generate::SchemaSettings::draft2020_12().with(|s| s.inline_subschemas = true);
    let schema = generator.into_generator().into_root_schema_for::<Settings>();
    let defaults = serde_json::to_value(Settings::default()).unwrap_or_default();
    let mut leaves = Vec::new();
    let groups = schema.get("properties").and_then(Value::as_object).into_iter().flatten();
    for (group, inner) in groups {
        for (field, leaf) in inner["properties"].as_object().into_iter().flatten() {
            let about = leaf["description"].as_str().unwrap_or_default().to_owned();
            let is_list = leaf["type"] == "array" && leaf["x-flag"].is_null();
            let element = if is_list { &leaf["items"] } else { leaf };
            let range = match (leaf["minimum"].as_f64(), leaf["maximum"].as_f64()) {
                (Some(least), Some(most)) => Some([least, most]),
                _ => None,
            };
            leaves.push(Leaf {
                path: [group.clone(), field.clone()],
                about,
                expected: expected(element, range),
                default: defaults[group][field].clone(),
                range,
                kind: kind(element),
                is_list,
            });
        }
    }
    leaves
}

fn kind(schema: &Value) -> String {
    let first = match &schema["type"] {
        Value::Array(kinds) => kinds.first().cloned().unwrap_or_default(),
        kind => kind.clone(),
    };
    first.as_str().unwrap_or("string").to_owned()
}

fn expected(schema: &Value, range: Option<[f64; 2]>) -> String {
    if let Some(form) = schema["x-flag"].as_str() {
        return form.to_owned();
    }
    if let Some([least, most]) = range {
        return format!("{least} to {most}");
    }
    let texts = |key: &str| -> Vec<String> {
        let all = schema[key].as_array().into_iter().flatten();
        all.filter_map(|v| v["const"].as_str().or(v.as_str()).map(str::to_owned)).collect()
    };
    let names = [texts("enum"), texts("oneOf")].concat();
    if !names.is_empty() {
        return names.join(", ");
    }
    schema["x-usage"].as_str().map_or_else(|| texts("examples").join(", "), str::to_owned)
}

/// Checks the numbers that have a range.
pub(super) fn check_ranges(settings: &Settings) -> Result<(), SettingsError> {
    let values = serde_json::to_value(settings).map_err(|e| SettingsError::Json(e.to_string()))?;
    for leaf in leaves() {
        let value = leaf.value_in(&values);
        if let (Some([least, most]), Some(number)) = (leaf.range, value.as_f64())
            && !(least..=most).contains(&number)
        {
            return Err(SettingsError::Range {
                setting: leaf.name(),
                found: value.to_string(),
                expected: leaf.expected.clone(),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_is_a_leaf_with_words_and_a_default_that_parses() {
        let names: Vec<String> = leaves().iter().map(Leaf::flag).collect();
        assert!(names.contains(&"shadow-size".to_owned()), "{names:?}");
        for leaf in leaves() {
            assert!(!leaf.about.is_empty() && !leaf.expected.is_empty(), "{leaf:?}");
            let text = match &leaf.default {
                Value::String(text) => text.clone(),
                Value::Array(all) if leaf.flag() == "size" => format!("{}x{}", all[0], all[1]),
                Value::Array(all) => all.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(","),
                other => other.to_string(),
            };
            assert_eq!(leaf.parse(&text), Ok(leaf.default.clone()), "{}", leaf.name());
        }
        let unique: std::collections::BTreeSet<_> = names.iter().collect();
        assert_eq!(unique.len(), names.len(), "flags are unique");
    }

    #[test]
    fn wrong_texts_say_what_is_expected() {
        let wrong = |flag: &str, text: &str| {
            let leaf = Leaf::of_flag(flag).expect("it is a setting");
            leaf.parse(text).expect_err("it is wrong")
        };
        assert!(wrong("size", "640").contains("WIDTHxHEIGHT"));
        assert!(wrong("size", "0x4").contains("WIDTHxHEIGHT"));
        assert!(wrong("shadow-size", "many").contains("16 to 16384"));
        assert!(wrong("supersampling", "9").contains("1 to 8"));
        assert!(wrong("scatter", "separable:8").contains("N odd, 5 to 65"));
        assert!(wrong("channels", "depht").contains("depth"));
    }
}
