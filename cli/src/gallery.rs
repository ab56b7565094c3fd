//! `rubor gallery`: one page that shows what a head, the expressions, the lights and the characters look like.

use std::path::{Path, PathBuf};

use image::RgbImage;
use rubor_assets::import::makehuman::CHARACTERS;
use rubor_rig::timeline::Sequence;

use crate::failure::{Failure, Outcome};
use crate::{contact_sheet, import, inputs, output, sequence_job};

/// Panels in a row of the page.
const COLUMNS: u32 = 6;
/// Name of the page in the output folder.
const PAGE_FILE: &str = "gallery.jpg";
const JPEG_QUALITY: u8 = 86;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// MakeHuman data (see `rubor import makehuman`): adds a row of all characters
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    #[command(flatten)]
    job: sequence_job::Arguments,
}

/// Pictures of one sequence under one light.
struct Row {
    name: String,
    head: Option<PathBuf>,
    light: &'static str,
    sequence: String,
}

/// Three views of the whole head, a second each.
const VIEWS: &str = r#"{ "fps": 1, "duration": 3, "camera": { "framing": "head", "elevationDegrees": 2, "target": [0, -0.02, -0.06],
    "orbitDegrees": [{ "t": 0, "v": 0 }, { "t": 1, "v": 38 }, { "t": 2, "v": 90 }] } }"#;
/// An eye, the mouth, an ear, the nose, the hairline, an eye from the side and the chin from near.
const DETAILS: &str = r#"{ "fps": 1, "duration": 7, "camera": { "framing": "close", "fovDegrees": 9,
    "position": [{ "t": 0, "v": [0.0, 0.0, 0.45] }, { "t": 1, "v": [-0.1, -0.06, 0.48] }, { "t": 2, "v": [0.5, 0.0, 0.12] },
        { "t": 3, "v": [-0.16, -0.06, 0.46] }, { "t": 4, "v": [0.34, 0.16, 0.4] }, { "t": 5, "v": [-0.32, 0.0, 0.34] }, { "t": 6, "v": [0.2, -0.12, 0.44] }],
    "target": [{ "t": 0, "v": [0.026, 0.004, 0.0] }, { "t": 1, "v": [0.0, -0.07, 0.0] }, { "t": 2, "v": [0.07, -0.015, -0.09] },
        { "t": 3, "v": [0.0, -0.028, 0.01] }, { "t": 4, "v": [0.045, 0.055, -0.03] }, { "t": 5, "v": [-0.03, 0.003, -0.005] }, { "t": 6, "v": [0.02, -0.1, -0.02] }] } }"#;
/// The three-quarter view.
const THREE_QUARTER: &str = r#"{ "fps": 1, "duration": 1, "camera": { "framing": "head", "target": [0, -0.02, -0.06], "orbitDegrees": 36, "elevationDegrees": 2 } }"#;
const FLUSH: &str = r#"{ "fps": 1, "duration": 2, "camera": { "framing": "close", "orbitDegrees": -12 },
    "states": { "blush": [{ "t": 0, "v": 1 }, { "t": 1, "v": 0 }], "exercise": [{ "t": 0, "v": 0 }, { "t": 1, "v": 1 }] },
    "shapes": { "jawOpen": [{ "t": 0, "v": 0 }, { "t": 1, "v": 0.14 }] } }"#;

/// Each emotion at its apex for a second.
fn emotions() -> String {
    let names = ["joy", "surprise", "anger", "fear", "disgust", "sadness"];
    let track = |i: usize| {
        let keys = (0..names.len()).map(|t| format!(r#"{{ "t": {t}, "v": {} }}"#, u8::from(t == i)));
        keys.collect::<Vec<_>>().join(", ")
    };
    let tracks: Vec<String> =
        names.iter().enumerate().map(|(i, name)| format!(r#""{name}": [{}]"#, track(i))).collect();
    format!(
        r#"{{ "fps": 1, "duration": {}, "camera": {{ "framing": "close", "orbitDegrees": -12 }}, "expressions": {{ {} }} }}"#,
        names.len(),
        tracks.join(", ")
    )
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let folder = &arguments.job.output;
    output::folder(folder)?;
    let row = |name: &str, light, sequence: &str| Row {
        name: name.into(),
        head: None,
        light,
        sequence: sequence.into(),
    };
    let mut rows = vec![
        row("views", "three-point", VIEWS),
        row("details", "three-point", DETAILS),
        row("emotions", "three-point", &emotions()),
        row("window", "window", THREE_QUARTER),
        row("backlit-ear", "backlit-ear", THREE_QUARTER),
        row("low-key", "low-key", THREE_QUARTER),
        row("soft-box", "soft-box", THREE_QUARTER),
        row("sky", "sky", THREE_QUARTER),
        row("three-point", "three-point", THREE_QUARTER),
        row("flush", "three-point", FLUSH),
    ];
    if let Some(data) = &arguments.data {
        for character in &CHARACTERS {
            let head = folder.join(format!("{}.glb", character.name));
            import::character(character, data, &head)?;
            let name = character.name.to_owned();
            rows.push(Row { head: Some(head), name, light: "three-point", sequence: THREE_QUARTER.into() });
        }
    }
    let mut panels = Vec::new();
    for row in &rows {
        panels.extend(draw(row, arguments)?);
    }
    let path = folder.join(PAGE_FILE);
    let page = contact_sheet::page_of(&panels, COLUMNS);
    output::commit(&path, |partial| {
        let file = std::io::BufWriter::new(std::fs::File::create(partial)?);
        let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(file, JPEG_QUALITY);
        page.write_with_encoder(encoder).map_err(std::io::Error::other)
    })?;
    println!("{} pictures on {}", panels.len(), path.display());
    Ok(())
}

fn draw(row: &Row, arguments: &Arguments) -> Outcome<Vec<RgbImage>> {
    let head = inputs::head(row.head.as_deref())?;
    let mut sequence = Sequence::from_json(&format!("gallery {}", row.name), &row.sequence)?;
    sequence.size = Some([320, 320]);
    sequence.relight(inputs::lights(row.light)?);
    let mut job = arguments.job.clone();
    job.output = arguments.job.output.join(&row.name);
    (job.no_video, job.no_export, job.json) = (true, true, false);
    let count = sequence.frame_count();
    let rig = inputs::rig(None, head.rig.clone())?;
    sequence_job::run(sequence_job::Job { rig, sequence, heads: vec![head] }, &job)?;
    (0..count).map(|frame| picture(&sequence_job::frame_path(&job.output, frame))).collect()
}

fn picture(path: &Path) -> Outcome<RgbImage> {
    let opened = image::open(path).map_err(|e| Failure::job(format!("{}: {e}", path.display())))?;
    Ok(opened.into_rgb8())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sequence_of_the_page_reads_and_fills_whole_rows() {
        let counts = [VIEWS, DETAILS, &emotions(), THREE_QUARTER, FLUSH]
            .map(|text| Sequence::from_json("gallery", text).unwrap().frame_count());
        assert_eq!(counts, [3, 7, 6, 1, 2]);
        assert_eq!((counts[0] + counts[1] + counts[2] + 6 * counts[3] + counts[4]) % COLUMNS, 0);
        assert_eq!(CHARACTERS.len() as u32 % COLUMNS, 0);
    }
}
