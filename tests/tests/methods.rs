//! `docs/methods.md` is the renderer's table of methods.

use std::fmt::Write;
use std::path::Path;

use rubor_renderer::settings::{GROUPS, leaves};

/// The page: a table per group, and every setting.
fn page() -> String {
    let mut text = String::from(
        "# Methods and settings\n\nMade from `renderer/src/settings` by \
         `RUBOR_UPDATE_DOCS=1 cargo test -p rubor-tests --test methods`. Each name is a value of the flag and of the field in \
         `job.json`.\n",
    );
    for group in GROUPS {
        let _ = write!(
            text,
            "\n## `--{}`: {}\n\n| name | does | stage | source |\n| --- | --- | --- | --- |\n",
            group.name, group.about
        );
        for method in group.methods {
            let stage =
                serde_json::to_value(method.stage).map(|v| v.as_str().unwrap_or_default().replace('-', " "));
            let _ = writeln!(
                text,
                "| `{}` | {} | {} | {} |",
                method.usage(),
                method.summary.trim(),
                stage.unwrap_or_default(),
                method.source
            );
        }
    }
    text.push_str(
        "\n## Every setting\n\n| flag | field | says | values | default |\n| --- | --- | --- | --- | --- |\n",
    );
    for leaf in leaves() {
        let _ = writeln!(
            text,
            "| `--{}` | `{}` | {} | {} | `{}` |",
            leaf.flag(),
            leaf.name(),
            leaf.about.replace('\n', " "),
            leaf.expected,
            leaf.default
        );
    }
    text
}

#[test]
fn the_page_is_the_table() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/methods.md");
    let page = page();
    if std::env::var_os("RUBOR_UPDATE_DOCS").is_some() {
        std::fs::write(&file, &page).expect("the page can be written");
    }
    let found = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(found == page, "docs/methods.md is stale: RUBOR_UPDATE_DOCS=1 writes it anew");
}
