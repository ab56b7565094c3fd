//! `docs/json.md` says every field of every JSON file, as the schemas have it.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use rubor::manifest::Manifest;
use rubor::{Job, Report};
use serde_json::Value;

/// Name of the file, what it is, what reads or writes it, its schema.
fn files() -> [(&'static str, &'static str, Value); 5] {
    [
        (
            "sequence.json",
            "A performance over time, its camera and its lights: `rubor render --sequence`. Comments and trailing commas \
             are allowed. `rubor schema sequence` prints the schema for editors.",
            rubor_rig::timeline::sequence_schema(),
        ),
        (
            "rig.json",
            "What expressions and states do to shapes, wrinkles and blood: `rubor render --rig`. `rubor schema rig`.",
            rubor_rig::expression::rig_schema(),
        ),
        (
            "job.json",
            "Everything that decides the pixels of a run; it is written beside the frames, and `rubor render --job` draws \
             it again. `rubor schema job`. Values of the settings are in [methods.md](methods.md).",
            Job::json_schema_value(),
        ),
        (
            "stats.json",
            "What was measured, of a run, a benchmark, a chart or a gallery; `--json` prints the same. `rubor schema report`.",
            Report::json_schema_value(),
        ),
        (
            "manifest.json",
            "The files of a run with their checksums, to check a copy of the folder by: \
             `jq -r '.files[] | \"\\(.sha256)  \\(.file)\"' manifest.json | sha256sum --check`.",
            Manifest::json_schema_value(),
        ),
    ]
}

/// Words of a schema on one line of a table.
fn words(schema: &Value) -> String {
    schema["description"]
        .as_str()
        .unwrap_or_default()
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
        .replace('|', "\\|")
}

fn name_of_ref(schema: &Value) -> Option<&str> {
    schema["$ref"].as_str().and_then(|r| r.rsplit('/').next())
}

/// A heading of a definition: `Key_of_float` is `Key of float`.
fn heading(name: &str) -> String {
    name.replace('_', " ")
}

fn link(name: &str) -> String {
    let heading = heading(name);
    format!("[{heading}](#{})", heading.to_lowercase().replace(' ', "-"))
}

/// What a value may be.
fn kind(schema: &Value) -> String {
    if let Some(name) = name_of_ref(schema) {
        return link(name);
    }
    if let Some(value) = schema.get("const") {
        return format!("`{value}`");
    }
    if let Some(values) = schema["enum"].as_array() {
        return values.iter().map(|v| format!("`{v}`")).collect::<Vec<_>>().join(", ");
    }
    for choice in ["anyOf", "oneOf", "allOf"] {
        if let Some(all) = schema[choice].as_array() {
            let mut kinds: Vec<String> = all.iter().filter(|s| s["type"] != "null").map(kind).collect();
            kinds.dedup();
            return kinds.join(" or ");
        }
    }
    let types: Vec<&str> = match &schema["type"] {
        Value::String(one) => vec![one],
        Value::Array(many) => many.iter().filter_map(Value::as_str).filter(|t| *t != "null").collect(),
        _ => return "any".into(),
    };
    let one = |name: &str| match name {
        "array" => {
            let of = schema
                .get("items")
                .or_else(|| schema["prefixItems"].get(0))
                .map_or_else(|| "any".into(), kind);
            match (schema["minItems"].as_u64(), schema["maxItems"].as_u64()) {
                (Some(a), Some(b)) if a == b => format!("{a} of {of}"),
                _ => format!("list of {of}"),
            }
        }
        "object" => match schema.get("additionalProperties").filter(|s| s.is_object()) {
            Some(of) => format!("names with {}", kind(of)),
            None => "object".into(),
        },
        "string" => "text".into(),
        "integer" => "whole number".into(),
        "boolean" => "`true` or `false`".into(),
        other => other.to_owned(),
    };
    let mut text = types.into_iter().map(one).collect::<Vec<_>>().join(" or ");
    let bound = |key: &str| schema[key].as_f64().map(|v| v.to_string());
    let limits = [
        bound("minimum")
            .filter(|v| v != "0" || schema["format"].as_str().is_none_or(|f| !f.starts_with("uint")))
            .map(|v| format!("from {v}")),
        bound("exclusiveMinimum").map(|v| format!("over {v}")),
        bound("maximum")
            .filter(|_| schema["format"].is_null() || schema.get("minimum").is_some())
            .map(|v| format!("to {v}")),
    ];
    for limit in limits.into_iter().flatten() {
        text = format!("{text} {limit}");
    }
    text
}

/// Rows of an object, those of objects within it by their path. Counts the fields.
fn rows(schema: &Value, path: &str, text: &mut String, count: &mut usize) {
    let required: BTreeSet<&str> =
        schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    for (name, field) in schema["properties"].as_object().into_iter().flatten() {
        let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        let default = match field.get("default") {
            _ if required.contains(name.as_str()) => "required".into(),
            Some(Value::Object(_)) | None => String::new(),
            Some(value) => format!("`{value}`"),
        };
        let _ = writeln!(text, "| `{path}` | {} | {default} | {} |", kind(field), words(field));
        *count += 1;
        rows(field, &path, text, count);
    }
}

const HEAD: &str = "\n| field | value | default | says |\n| --- | --- | --- | --- |\n";

fn object(schema: &Value, text: &mut String, count: &mut usize) {
    if schema["properties"].is_object() {
        text.push_str(HEAD);
        rows(schema, "", text, count);
    }
    // One of several kinds of objects, or of names.
    for choice in schema["oneOf"].as_array().into_iter().chain(schema["anyOf"].as_array()).flatten() {
        if choice["properties"].is_object() {
            let tag = choice["properties"]
                .as_object()
                .into_iter()
                .flatten()
                .find(|(_, v)| v.get("const").is_some());
            let name = tag.map(|(key, v)| format!("`{key}` is `{}`", v["const"])).unwrap_or_default();
            let target = name_of_ref(choice)
                .map(|name| format!(" The fields are those of {}.", link(name)))
                .unwrap_or_default();
            let _ = write!(text, "\n{name}: {}{target}\n", words(choice));
            text.push_str(HEAD);
            rows(choice, "", text, count);
        } else {
            let _ = writeln!(text, "- {}: {}", kind(choice), words(choice));
        }
    }
}

/// The page, and how many fields it has.
fn page() -> (String, usize) {
    let mut text = String::from(
        "# Every field of every JSON file\n\nMade from the schemas by \
         `RUBOR_UPDATE_DOCS=1 cargo test -p rubor-tests --test json_reference`. A field without a default and without \
         *required* may be left out.\n\nNotes of the review page have a file of their own, which the page writes and reads: \
         `format` and `version`, `run` (which it was), and `notes`, each with `id`, `from` and `to` (frames from 1), `text`, \
         `strokes` (`color`, `points` in parts of width and height), `done` and `changed`.\n",
    );
    let (mut count, mut known) = (0, BTreeSet::new());
    for (file, about, schema) in files() {
        let _ = write!(text, "\n## {file}\n\n{about}\n");
        object(&schema, &mut text, &mut count);
        for (name, definition) in schema["$defs"].as_object().into_iter().flatten() {
            if known.insert(name.clone()) {
                let _ = write!(text, "\n### {}\n\n{}\n", heading(name), words(definition));
                let is_plain = definition["properties"].is_null() && definition["oneOf"].is_null();
                if is_plain && definition["anyOf"].is_null() {
                    let _ = write!(text, "\n{}\n", kind(definition));
                } else if definition["properties"].is_null() {
                    text.push('\n');
                }
                object(definition, &mut text, &mut count);
            }
        }
    }
    (text, count)
}

#[test]
fn the_page_is_the_schemas() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/json.md");
    let (page, count) = page();
    if std::env::var_os("RUBOR_UPDATE_DOCS").is_some() {
        std::fs::write(&file, &page).expect("the page can be written");
    }
    assert!(count > 150, "{count} fields");
    let found = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(found == page, "docs/json.md is stale: RUBOR_UPDATE_DOCS=1 writes it anew");
}

#[test]
fn every_field_has_words_and_every_link_has_an_end() {
    fn fields(schema: &Value, at: &str, without: &mut Vec<String>) {
        match schema {
            Value::Object(map) => {
                for (name, field) in map.get("properties").and_then(Value::as_object).into_iter().flatten() {
                    // The tag of a kind has one value, which says it.
                    if words(field).is_empty() && field.get("const").is_none() {
                        without.push(format!("{at}.{name}"));
                    }
                }
                map.iter().for_each(|(key, value)| fields(value, &format!("{at}.{key}"), without));
            }
            Value::Array(list) => list.iter().for_each(|value| fields(value, at, without)),
            _ => {}
        }
    }
    let mut without = Vec::new();
    for (file, _, schema) in files() {
        fields(&schema, file, &mut without);
    }
    assert!(without.is_empty(), "fields without a description: {without:#?}");
    let (page, _) = page();
    let ends: BTreeSet<String> = page
        .lines()
        .filter_map(|line| line.strip_prefix("### "))
        .map(|title| title.to_lowercase().replace(' ', "-"))
        .collect();
    let links = page.split("](#").skip(1).filter_map(|rest| rest.split(')').next());
    for link in links {
        assert!(ends.contains(link), "the link #{link} leads nowhere");
    }
}
