//! The files of a stability report: `stability.json`, `stability.csv` and `stability.svg`.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use crate::error::Outcome;
use crate::measure::chart::plot::{self, Line};
use crate::output;
use crate::report::{Report, StabilityReport};

/// Size of a plot.
const SIZE: [f64; 2] = [900.0, 360.0];

/// Writes the files into a folder; returns the picture of all sweeps.
///
/// # Errors
/// Files that cannot be written.
pub fn write(folder: &Path, report: &StabilityReport) -> Outcome<PathBuf> {
    output::write_json(&folder.join("stability.json"), &Report::Stability(report.clone()))?;
    output::write(&folder.join("stability.csv"), csv(report).as_bytes())?;
    let picture = folder.join("stability.svg");
    output::write(&picture, plot::file(&plots(report), SIZE, &about(report)).as_bytes())?;
    Ok(picture)
}

/// Device and size in a line.
pub fn about(report: &StabilityReport) -> String {
    let [width, height] = report.settings.output.size;
    let adapter = &report.adapter;
    format!("{}, {} {}, {width}x{height}", adapter.name, adapter.backend, adapter.driver).replace("  ", " ")
}

/// Residuals of each group in each sweep; the number behind a name is its largest.
fn plots(report: &StabilityReport) -> Vec<String> {
    let mut groups: Vec<&str> = Vec::new();
    for row in &report.rows {
        if !groups.contains(&row.group.as_str()) {
            groups.push(&row.group);
        }
    }
    let mut all = Vec::new();
    for sweep in &report.sweeps {
        for group in &groups {
            let of = |r: &&crate::report::StabilityRow| r.group == *group && r.sweep == sweep.name;
            let lines: Vec<Line> = (report.rows.iter().filter(of))
                .map(|r| Line { name: r.choice.clone(), values: r.residuals.clone() })
                .collect();
            // A residual stands at the step that it leads to.
            let values = sweep.values.get(1..).unwrap_or_default();
            let title = format!("{}: {group}", sweep.name);
            all.push(plot::lines(
                &title,
                (&sweep.moves, values, sweep.is_geometric),
                "temporal residual",
                &lines,
                SIZE,
            ));
        }
    }
    all
}

fn csv(report: &StabilityReport) -> String {
    let mut out = String::from(
        "group,choice,sweep,residual,jump,halo,energy_least,energy_most,broken_values,cost_spike\n",
    );
    for r in &report.rows {
        let spike = r.cost_spike.map_or(String::new(), |v| v.to_string());
        let [least, most] = r.energy;
        let _ = writeln!(
            out,
            "{},\"{}\",{},{},{},{},{least},{most},{},{spike}",
            r.group, r.choice, r.sweep, r.residual, r.jump, r.halo, r.broken_values
        );
    }
    out
}
