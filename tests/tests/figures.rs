//! Tables of docs/speed.md are those of the chart that lies in docs/figures.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

const BEGIN: &str = "<!-- made from docs/figures/chart.csv: RUBOR_UPDATE_DOCS=1 cargo test -p rubor-tests --test figures -->\n";
const END: &str = "<!-- end -->\n";

/// A line of the chart.
struct Line {
    group: String,
    choice: String,
    is_light: bool,
    error: f64,
    ms: Option<f64>,
}

/// Fields of a line with quotes around those that may have commas.
fn fields(line: &str) -> Vec<String> {
    let mut all = vec![String::new()];
    let mut is_quoted = false;
    for c in line.chars() {
        match c {
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => all.push(String::new()),
            _ => all.last_mut().expect("a field").push(c),
        }
    }
    all
}

fn lines(text: &str) -> Vec<Line> {
    let mut rows = text.lines();
    let names = fields(rows.next().expect("names of columns"));
    let column = |name: &str| names.iter().position(|n| n == name).expect("a column");
    let [group, choice, measure, error, ms] = ["group", "choice", "measure", "error", "frame_ms"].map(column);
    rows.map(fields)
        .map(|f| Line {
            group: f[group].clone(),
            choice: f[choice].clone(),
            is_light: f[measure] == "light",
            error: f[error].parse().expect("an error"),
            ms: f[ms].parse().ok(),
        })
        .collect()
}

/// A table for each group: mean time, error over all scenes, error in the worst.
fn tables(lines: &[Line]) -> String {
    let mut groups: Vec<&str> = Vec::new();
    for line in lines {
        if !groups.contains(&line.group.as_str()) {
            groups.push(&line.group);
        }
    }
    let mut out = String::new();
    for group in groups {
        let of_group: Vec<&Line> = lines.iter().filter(|l| l.group == group).collect();
        let error = if of_group[0].is_light { "relative RMSE of light in skin" } else { "mean FLIP" };
        let _ = write!(
            out,
            "\n| `--{group}` | ms a frame | {error} | in the worst scene |\n| --- | --- | --- | --- |\n"
        );
        let mut order: Vec<&str> = Vec::new();
        let mut choices: BTreeMap<&str, Vec<&Line>> = BTreeMap::new();
        for line in of_group {
            if !order.contains(&line.choice.as_str()) {
                order.push(&line.choice);
            }
            choices.entry(&line.choice).or_default().push(line);
        }
        for name in order {
            let all = &choices[name];
            let n = all.len() as f64;
            let ms: Option<f64> = all.iter().map(|l| l.ms).sum();
            let mean = if all[0].is_light {
                (all.iter().map(|l| l.error.powi(2)).sum::<f64>() / n).sqrt()
            } else {
                all.iter().map(|l| l.error).sum::<f64>() / n
            };
            let worst = all.iter().map(|l| l.error).fold(0.0, f64::max);
            let ms = ms.map_or("-".to_owned(), |ms| format!("{:.2}", ms / n));
            let _ = writeln!(out, "| `{name}` | {ms} | {mean:.4} | {worst:.4} |");
        }
    }
    out.push('\n');
    out
}

#[test]
fn tables_are_those_of_the_chart() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let chart = std::fs::read_to_string(docs.join("figures/chart.csv")).expect("the chart");
    let tables = tables(&lines(&chart));
    let page = docs.join("speed.md");
    let text = std::fs::read_to_string(&page).expect("the page");
    let (before, rest) = text.split_once(BEGIN).expect("where the tables begin");
    let (found, after) = rest.split_once(END).expect("where they end");
    if std::env::var_os("RUBOR_UPDATE_DOCS").is_some() {
        std::fs::write(&page, format!("{before}{BEGIN}{tables}{END}{after}")).expect("the page is written");
        return;
    }
    assert_eq!(found, tables, "docs/speed.md is stale: RUBOR_UPDATE_DOCS=1 writes it anew");
}

#[test]
fn quoted_fields_keep_their_commas() {
    assert_eq!(fields(r#"a,"b, c",,d"#), ["a", "b, c", "", "d"]);
}
