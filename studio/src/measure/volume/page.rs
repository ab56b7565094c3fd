//! The files of the benchmark: `volume.json`, `volume.csv`, `stills.csv` and `index.html`.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use crate::error::{Failure, Outcome};
use crate::measure::chart::plot::escaped;
use crate::output;
use crate::report::{Report, VolumeReport};

const STYLE: &str = include_str!("../chart/page.css");
const OWN_STYLE: &str = ".bar{display:inline-block;height:9px;background:var(--dot);border-radius:2px}\
.stills{display:grid;grid-template-columns:repeat(auto-fill,minmax(150px,1fr));gap:10px;margin:8px 0 20px}\
.stills img{width:100%;display:block;image-rendering:pixelated;background:#000}.stills figcaption{font-size:12px;padding:4px 6px;color:var(--muted)}";

/// Names of patches, in the order of columns.
const PATCHES: [&str; 4] = ["lit", "terminator", "thin", "shadow"];

/// Writes the files into a folder, beside the pictures; returns the page.
///
/// # Errors
/// Files that cannot be written.
pub fn write(folder: &Path, report: &VolumeReport) -> Outcome<PathBuf> {
    output::write_json(&folder.join("volume.json"), &Report::Volume(report.clone()))?;
    output::write(&folder.join("volume.csv"), csv(report).as_bytes())?;
    output::write(&folder.join("stills.csv"), stills_csv(report).as_bytes())?;
    let page = folder.join("index.html");
    output::write(&page, html(report)?.as_bytes())?;
    Ok(page)
}

/// Skin, boundary, size, paths and device in a line.
pub fn about(report: &VolumeReport) -> String {
    let [width, height] = report.settings.output.size;
    let noise = worst_noise(report);
    format!(
        "{} (eta {}, alpha {}), {} stills of {width}x{height}, {} paths a pixel, noise of the volume at most {noise:.4}; methods on {}",
        report.medium.name(),
        report.eta,
        report.alpha,
        report.stills.len(),
        report.paths,
        report.adapter.name
    )
}

/// Largest relative standard error of the right light in a still.
pub fn worst_noise(report: &VolumeReport) -> f64 {
    report.stills.iter().map(|s| s.noise).fold(0.0, f64::max)
}

/// Cells of a method's row: error, worst still, bias by patch in percent.
pub fn cells(choice: &crate::report::VolumeChoice) -> Vec<String> {
    let mut cells = vec![format!("{:.3}", choice.relative_rmse), format!("{:.3}", choice.worst)];
    cells.extend(PATCHES.map(|patch| {
        choice.bias.get(patch).map_or_else(|| "-".into(), |bias| format!("{:+.1} %", 100.0 * bias))
    }));
    cells
}

/// Heads of [`cells`].
pub const COLUMNS: [&str; 6] =
    ["relative RMSE", "in the worst still", "bias: lit", "terminator", "thin", "shadow"];

fn short(v: f64) -> String {
    format!("{v:.5}").trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// One line for each still and method, and one for `all` stills.
fn csv(report: &VolumeReport) -> String {
    let mut out = String::from(
        "choice,still,relative_rmse,relative_rmse_with_noise,bias_lit,bias_terminator,bias_thin,bias_shadow\n",
    );
    for choice in &report.choices {
        for (point, still) in choice.points.iter().zip(&report.stills) {
            let [error, noisy] = [point.relative_rmse, point.relative_rmse_with_noise].map(short);
            let bias = biases(&point.bias);
            let _ = writeln!(out, "\"{}\",\"{}\",{error},{noisy},{bias}", choice.name, still.name);
        }
        let bias = biases(&choice.bias);
        let _ = writeln!(out, "\"{}\",all,{},,{bias}", choice.name, short(choice.relative_rmse));
    }
    out
}

fn biases(bias: &BTreeMap<String, f64>) -> String {
    PATCHES.map(|p| bias.get(p).map_or(String::new(), |b| short(*b))).join(",")
}

/// One line for each still and patch: the right light with its standard error.
fn stills_csv(report: &VolumeReport) -> String {
    let mut out = String::from("still,noise,lost,patch,pixels,r,g,b,r_error,g_error,b_error\n");
    for still in &report.stills {
        for p in &still.patches {
            let numbers = p.light.iter().chain(&p.error).map(|v| short(*v)).collect::<Vec<_>>().join(",");
            let [noise, lost] = [still.noise, still.lost].map(short);
            let _ = writeln!(out, "\"{}\",{noise},{lost},{},{},{numbers}", still.name, p.patch, p.pixels);
        }
    }
    out
}

fn html(report: &VolumeReport) -> Outcome<String> {
    let data = serde_json::to_string(report).map_err(Failure::job)?.replace("</", "<\\/");
    let most = report.choices.iter().map(|c| c.relative_rmse).fold(1e-9, f64::max);
    let mut body = String::from(
        "<section><h2>All stills</h2><p>Diffuse light of skin against paths traced through the volume of the head, over the light of \
         a flat piece of the same skin. Relative RMSE: 0 is right; root mean square over the stills, without the noise of the paths. \
         Bias: how much too bright (+) or too dark (-) the skin is that a lamp lights, that lies where its light ends, that is thin \
         and lit from behind, and that lies in shadow.</p><table><thead><tr><th>method</th><th></th>",
    );
    body.extend(COLUMNS.map(|c| format!("<th>{c}</th>")));
    body += "</tr></thead><tbody>";
    for choice in &report.choices {
        let cells: String = cells(choice).iter().map(|c| format!("<td>{c}</td>")).collect();
        let width = 160.0 * choice.relative_rmse / most;
        let _ = write!(
            body,
            "<tr><td>{}</td><td style=\"text-align:left\"><span class=bar style=\"width:{width:.0}px\"></span></td>{cells}</tr>",
            escaped(&choice.name)
        );
    }
    body += "</tbody></table></section><section><h2>Still by still</h2><p>Light, and where it is too bright (red) and too dark (blue); \
             a quarter of the brightest light is full colour. Grey is no skin.</p>";
    for (s, still) in report.stills.iter().enumerate() {
        let _ = write!(
            body,
            "<h3>{}</h3><p>{} Noise of the volume {:.4}.</p>",
            escaped(&still.name),
            escaped(&still.provokes),
            still.noise
        );
        let Some(truth) = &still.picture else { continue };
        let _ = write!(
            body,
            "<div class=stills><figure><img loading=lazy src=\"{0}\" alt=\"{1}, volume\"><figcaption>volume</figcaption></figure>",
            escaped(truth),
            escaped(&still.name)
        );
        for choice in &report.choices {
            let Some(point) = choice.points.get(s) else { continue };
            let (Some(picture), Some(difference)) = (&point.picture, &point.difference) else { continue };
            let name = escaped(&choice.name);
            let _ = write!(
                body,
                "<figure><img loading=lazy src=\"{0}\" alt=\"{1}, {name}\"><img loading=lazy src=\"{2}\" alt=\"difference\">\
                 <figcaption>{name}: {3:.3}</figcaption></figure>",
                escaped(picture),
                escaped(&still.name),
                escaped(difference),
                point.relative_rmse
            );
        }
        body += "</div>";
    }
    body += "</section>";
    Ok(format!(
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content=\"width=device-width\"><title>rubor volume</title>\
         <style>{STYLE}{OWN_STYLE}</style><header><h1>Light in skin: real time against the volume</h1><p>{}</p></header>\
         <main>{body}</main><script id=data type=\"application/json\">{data}</script></html>\n",
        escaped(&about(report))
    ))
}
