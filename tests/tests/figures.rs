//! Tables of docs/speed.md and docs/benchmark.md are those of the files that lie in docs/figures.

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

/// Puts text between marks of a page, or sees that it is there.
fn check(page: &str, begin: &str, made: &str) {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let page = docs.join(page);
    let text = std::fs::read_to_string(&page).expect("the page");
    let (before, rest) = text.split_once(begin).expect("where the tables begin");
    let (found, after) = rest.split_once(END).expect("where they end");
    if std::env::var_os("RUBOR_UPDATE_DOCS").is_some() {
        std::fs::write(&page, format!("{before}{begin}{made}{END}{after}")).expect("the page is written");
        return;
    }
    assert_eq!(found, made, "{} is stale: RUBOR_UPDATE_DOCS=1 writes it anew", page.display());
}

fn figure(name: &str) -> Vec<BTreeMap<String, String>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/figures").join(name);
    let text = std::fs::read_to_string(path).expect("a table");
    let mut rows = text.lines().map(fields);
    let names = rows.next().expect("names of columns");
    rows.map(|row| names.iter().cloned().zip(row).collect()).collect()
}

#[test]
fn tables_are_those_of_the_chart() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let chart = std::fs::read_to_string(docs.join("figures/chart.csv")).expect("the chart");
    check("speed.md", BEGIN, &tables(&lines(&chart)));
}

/// Methods beside the volume: errors of all stills and of the worst, bias by patch.
fn volume_table(rows: &[BTreeMap<String, String>]) -> String {
    const PATCHES: [&str; 4] = ["lit", "terminator", "thin", "shadow"];
    let mut out = String::from(
        "\n| method | relative RMSE | in the worst still | bias: lit | terminator | thin | shadow |\n| --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let error = |row: &BTreeMap<String, String>| row["relative_rmse"].parse::<f64>().expect("an error");
    for all in rows.iter().filter(|row| row["still"] == "all") {
        let stills: Vec<_> =
            rows.iter().filter(|row| row["choice"] == all["choice"] && row["still"] != "all").collect();
        let worst = stills.iter().max_by(|a, b| error(a).total_cmp(&error(b))).expect("a still");
        let mean = (stills.iter().map(|row| error(row).powi(2)).sum::<f64>() / stills.len() as f64).sqrt();
        assert!((mean - error(all)).abs() < 2e-5, "{}: {mean} and {}", all["choice"], all["relative_rmse"]);
        let bias = PATCHES.map(|patch| {
            let bias = &all[&format!("bias_{patch}")];
            bias.parse::<f64>().map_or("-".to_owned(), |b| format!("{:+.1} %", 100.0 * b))
        });
        let _ = writeln!(
            out,
            "| `{}` | {mean:.3} | {:.3} (`{}`) | {} |",
            all["choice"],
            error(worst),
            worst["still"],
            bias.join(" | ")
        );
    }
    out.push('\n');
    out
}

#[test]
fn the_table_of_methods_is_that_of_the_volume() {
    const BEGIN: &str = "<!-- made from docs/figures/volume.csv: RUBOR_UPDATE_DOCS=1 cargo test -p rubor-tests --test figures -->\n";
    check("benchmark.md", BEGIN, &volume_table(&figure("volume.csv")));
}

/// Other programs over ours: pictures by channel, and intervals that hold 1.
fn agreement_table(rows: &[BTreeMap<String, String>]) -> String {
    let mut out = String::from(
        "\n| program | still | R | G | B | pixels: difference over noise | intervals of patches that hold 1 |\n| --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for pixels in rows.iter().filter(|row| row["patch"] == "pixels") {
        let own: Vec<_> = (rows.iter())
            .filter(|row| row["program"] == pixels["program"] && row["still"] == pixels["still"])
            .filter(|row| row["patch"] != "pixels")
            .collect();
        let number = |row: &BTreeMap<String, String>, of: &str| row[of].parse::<f64>().expect("a number");
        let ratio = |c: &str| {
            let row = own.iter().find(|row| row["patch"] == "all" && row["channel"] == c).expect("a channel");
            format!("{:.4} ± {:.4}", number(row, "ratio"), number(row, "interval95"))
        };
        let patches: Vec<_> = own.iter().filter(|row| row["patch"] != "all").collect();
        let holds = patches
            .iter()
            .filter(|row| (number(row, "ratio") - 1.0).abs() <= number(row, "interval95"))
            .count();
        let _ = writeln!(
            out,
            "| {} | `{}` | {} | {} | {} | {:.3} | {holds} of {} |",
            pixels["program"],
            pixels["still"],
            ratio("R"),
            ratio("G"),
            ratio("B"),
            number(pixels, "over_noise"),
            patches.len()
        );
    }
    out.push('\n');
    out
}

#[test]
fn the_table_of_programs_is_that_of_their_pictures() {
    const BEGIN: &str = "<!-- made from docs/figures/agreement.csv: RUBOR_UPDATE_DOCS=1 cargo test -p rubor-tests --test figures -->\n";
    check("benchmark.md", BEGIN, &agreement_table(&figure("agreement.csv")));
}

#[test]
fn quoted_fields_keep_their_commas() {
    assert_eq!(fields(r#"a,"b, c",,d"#), ["a", "b, c", "", "d"]);
}
