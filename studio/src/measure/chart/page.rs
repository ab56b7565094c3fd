//! The files of a chart: `chart.json`, `chart.csv`, `chart.svg` with all plots, `chart-GROUP.svg` with one, and `index.html`.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use super::choices::Measure;
use super::plot::{self, Dot, Plot, escaped, number};
use crate::error::Outcome;
use crate::output;
use crate::report::{ChartGroup, ChartReport, Report};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
/// Sizes of a plot of all scenes and of one scene.
const LARGE: [f64; 2] = [860.0, 440.0];
const SMALL: [f64; 2] = [250.0, 170.0];

/// Writes the files into a folder, beside the pictures; returns the page.
///
/// # Errors
/// Files that cannot be written.
pub fn write(folder: &Path, report: &ChartReport) -> Outcome<PathBuf> {
    output::write_json(&folder.join("chart.json"), &Report::Chart(report.clone()))?;
    output::write(&folder.join("chart.csv"), csv(report).as_bytes())?;
    let plots: Vec<String> =
        report.groups.iter().enumerate().map(|(g, group)| overall_plot(report, g, group)).collect();
    output::write(&folder.join("chart.svg"), plot::file(&plots, LARGE, &about(report)).as_bytes())?;
    for (group, plot) in report.groups.iter().zip(&plots).filter(|(_, plot)| !plot.is_empty()) {
        let alone = plot::file(std::slice::from_ref(plot), LARGE, &about(report));
        output::write(&folder.join(format!("chart-{}.svg", group.flag)), alone.as_bytes())?;
    }
    let page = folder.join("index.html");
    output::write(&page, html(report, &plots)?.as_bytes())?;
    Ok(page)
}

/// Device, size and repetitions in a line.
pub fn about(report: &ChartReport) -> String {
    let [width, height] = report.settings.output.size;
    let adapter = &report.adapter;
    let timing = match report.timing {
        Some([rounds, _, frames])
            if report
                .groups
                .iter()
                .flat_map(|g| &g.choices)
                .flat_map(|c| &c.points)
                .any(|p| p.frame.is_some()) =>
        {
            format!("medians of {} in {}", counted(rounds * frames, "frame"), counted(rounds, "round"))
        }
        _ => "not timed".to_owned(),
    };
    let scenes = counted(report.scenes.len() as u32, "scene");
    format!("{}, {} {}, {width}x{height}, {scenes}, {timing}", adapter.name, adapter.backend, adapter.driver)
        .replace("  ", " ")
}

/// `1 frame`, `2 frames`.
fn counted(n: u32, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// What the error of a group is, in words.
pub fn measured(group: &ChartGroup) -> &'static str {
    match group.measure {
        Measure::Light => "relative RMSE of the light in skin",
        Measure::Picture => "mean visible difference (FLIP)",
    }
}

fn title(group: &ChartGroup) -> String {
    format!("{}: time against error to {}", group.flag, group.truth)
}

fn overall_plot(report: &ChartReport, g: usize, group: &ChartGroup) -> String {
    let mut floor = None;
    let mut dots = Vec::new();
    for (c, choice) in group.choices.iter().enumerate() {
        let Some(overall) = &choice.overall else { continue };
        match overall.frame_ms {
            Some(ms) => dots.push(Dot {
                name: choice.name.clone(),
                ms,
                spread_ms: None,
                error: overall.error,
                is_on_front: overall.is_on_front,
                opens: format!("{g} {c}"),
            }),
            None => floor = Some((choice.name.as_str(), overall.error)),
        }
    }
    // Two points need no picture.
    if dots.len() < 3 {
        return String::new();
    }
    let scenes = report.scenes.len();
    let title = if scenes > 1 { format!("{}, {scenes} scenes", title(group)) } else { title(group) };
    plot::svg(&Plot {
        title: &title,
        error_axis: measured(group),
        dots: &dots,
        floor,
        size: LARGE,
        is_labelled: true,
    })
}

fn scene_plot(report: &ChartReport, g: usize, group: &ChartGroup, s: usize) -> String {
    let mut floor = None;
    let mut dots = Vec::new();
    for (c, choice) in group.choices.iter().enumerate() {
        let Some(point) = choice.points.get(s) else { continue };
        match &point.frame {
            Some(cost) => dots.push(Dot {
                name: choice.name.clone(),
                ms: cost.median,
                spread_ms: Some([cost.p10, cost.p90]),
                error: point.error.of(group.measure),
                is_on_front: point.is_on_front,
                opens: format!("{g} {c} {s}"),
            }),
            None => floor = Some((choice.name.as_str(), point.error.of(group.measure))),
        }
    }
    let title = report.scenes.get(s).map_or("", |scene| &scene.name);
    plot::svg(&Plot {
        title,
        error_axis: measured(group),
        dots: &dots,
        floor,
        size: SMALL,
        is_labelled: false,
    })
}

/// One line for each scene and choice.
fn csv(report: &ChartReport) -> String {
    let mut out = String::from(
        "group,choice,scene,measure,error,relative_rmse_to_surface,relative_rmse_to_screen,flip_mean,flip_99,frame_ms,frame_ms_p10,frame_ms_p90,is_on_front\n",
    );
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let short = |v: f64| format!("{:.6}", v).trim_end_matches('0').trim_end_matches('.').to_owned();
    let some = |v: Option<f64>| v.map_or(String::new(), short);
    for group in &report.groups {
        let measure = match group.measure {
            Measure::Light => "light",
            Measure::Picture => "picture",
        };
        for choice in &group.choices {
            for (point, scene) in choice.points.iter().zip(&report.scenes) {
                let (e, f) = (&point.error, point.frame.as_ref());
                let _ = writeln!(
                    out,
                    "{},{},{},{measure},{},{},{},{},{},{},{},{},{}",
                    group.flag,
                    quoted(&choice.name),
                    quoted(&scene.name),
                    short(e.of(group.measure)),
                    some(e.relative_rmse_to_surface),
                    some(e.relative_rmse_to_screen),
                    short(e.flip_mean),
                    short(e.flip_99),
                    some(f.map(|f| f.median)),
                    some(f.map(|f| f.p10)),
                    some(f.map(|f| f.p90)),
                    point.is_on_front
                );
            }
        }
    }
    out
}

fn table(group: &ChartGroup) -> String {
    let mut out = format!(
        "<table><thead><tr><th>{}</th><th>ms a frame</th><th>error</th><th>worst scene</th><th>on the front</th></tr></thead><tbody>",
        escaped(&group.flag)
    );
    for choice in &group.choices {
        let Some(o) = &choice.overall else { continue };
        let ms = o.frame_ms.map_or("-".into(), number);
        let class = if o.is_on_front { " class=front" } else { "" };
        let front = if o.is_on_front { "yes" } else { "" };
        let _ = write!(
            out,
            "<tr{class}><td>{}</td><td>{ms}</td><td>{}</td><td>{}</td><td>{front}</td></tr>",
            escaped(&choice.name),
            number(o.error),
            number(o.worst)
        );
    }
    out + "</tbody></table>"
}

fn html(report: &ChartReport, plots: &[String]) -> Outcome<String> {
    let data = serde_json::to_string(report).map_err(crate::Failure::job)?.replace("</", "<\\/");
    let mut body = String::new();
    for (g, group) in report.groups.iter().enumerate() {
        let _ = write!(
            body,
            "<section id=\"{0}\"><h2>{0}</h2><p>Error: {1}, against <code>{2}</code>. Left is faster, down is better; the red stairs \
             join what nothing else beats. A click on a point shows its pictures.</p>",
            escaped(&group.flag),
            measured(group),
            escaped(&group.truth)
        );
        let is_plotted = !plots[g].is_empty();
        let is_open = if is_plotted { "" } else { " open" };
        let _ = write!(
            body,
            "<div class=plot>{}</div><details{is_open}><summary>All numbers</summary>{}</details>",
            plots[g],
            table(group)
        );
        if report.scenes.len() > 1 && is_plotted {
            body.push_str("<h3>Scene by scene</h3><div class=scenes>");
            for s in 0..report.scenes.len() {
                let _ = write!(
                    body,
                    "<figure title=\"{}\">{}</figure>",
                    escaped(&report.scenes[s].provokes),
                    scene_plot(report, g, group, s)
                );
            }
            body.push_str("</div>");
        }
        body.push_str("</section>");
    }
    let links: String =
        report.groups.iter().map(|g| format!("<a href=\"#{0}\">{0}</a>", escaped(&g.flag))).collect();
    Ok(format!(
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content=\"width=device-width\"><title>rubor chart</title>\
         <style>{STYLE}</style><header><h1>Speed against error</h1><p>{}</p><nav>{links}</nav></header><main>{body}</main>\
         <dialog id=shown aria-label=\"Pictures of a choice\"></dialog><script id=data type=\"application/json\">{data}</script>\
         <script>{SCRIPT}</script></html>\n",
        escaped(&about(report))
    ))
}
