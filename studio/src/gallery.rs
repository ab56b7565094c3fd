//! A page of pictures of a head, the expressions, the lights and the characters.
//!
//! ```text
//! rows (head, light, sequence) --Plan--> pictures in memory --> one page
//! ```

use std::path::Path;

use image::RgbImage;
use rubor_assets::import::makehuman::CHARACTERS;
use rubor_renderer::settings::Settings;
use rubor_rig::timeline::Sequence;

use crate::error::{Failure, Outcome};
use crate::inputs::{self, LoadedHead};
use crate::job::Job;
use crate::output;
use crate::plan::Plan;
use crate::report::{GalleryPicture, GalleryReport};
use crate::review::contact_sheet;
use crate::studio::Studio;
use crate::watch::Watch;

/// Pictures per row of the page.
const COLUMNS: u32 = 6;
/// Side of a picture, unless settings say otherwise.
pub const SIDE: u32 = 320;
const JPEG_QUALITY: u8 = 86;

/// Pictures of one sequence under one light.
struct Row {
    name: &'static str,
    light: &'static str,
    sequence: String,
}

/// Three views of the whole head, one second each.
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

/// The rows of the built-in head.
fn rows() -> Vec<Row> {
    let row = |name, light, sequence: &str| Row { name, light, sequence: sequence.to_owned() };
    vec![
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
    ]
}

/// Draws the page. With the folder of the MakeHuman data (see `rubor import makehuman`), all characters too.
///
/// # Errors
/// Missing or broken data; errors of the studio.
pub fn run(
    studio: &mut Studio,
    settings: &Settings,
    data: Option<&Path>,
    watch: &mut dyn Watch,
) -> Outcome<(RgbImage, GalleryReport)> {
    let mut page = Page { pictures: Vec::new(), told: Vec::new() };
    let head = [inputs::head(None)?];
    let rows = rows();
    let characters: &[_] = if data.is_some() { &CHARACTERS } else { &[] };
    watch.begin("rows of pictures", (rows.len() + characters.len()) as u64);
    studio.set_heads(head.iter().map(|h| &h.head))?;
    for row in &rows {
        page.add(studio, settings, row, &head)?;
        watch.step();
    }
    for (character, data) in characters.iter().zip(data.into_iter().cycle()) {
        let head = [inputs::character(character, data, &|| {})?];
        studio.set_heads(head.iter().map(|h| &h.head))?;
        let row = Row { name: character.name, light: "three-point", sequence: THREE_QUARTER.to_owned() };
        page.add(studio, settings, &row, &head)?;
        watch.step();
    }
    watch.end();
    let report = GalleryReport {
        adapter: studio.adapter(),
        settings: settings.clone(),
        page: None,
        pictures: page.told,
    };
    Ok((contact_sheet::page_of(&page.pictures, COLUMNS), report))
}

/// Writes a page as JPEG.
///
/// # Errors
/// The system refuses.
pub fn save(path: &Path, page: &RgbImage) -> Outcome {
    output::commit(path, |partial| {
        let file = std::io::BufWriter::new(std::fs::File::create(partial)?);
        let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(file, JPEG_QUALITY);
        page.write_with_encoder(encoder).map_err(std::io::Error::other)
    })
}

struct Page {
    pictures: Vec<RgbImage>,
    told: Vec<GalleryPicture>,
}

impl Page {
    fn add(&mut self, studio: &mut Studio, settings: &Settings, row: &Row, heads: &[LoadedHead]) -> Outcome {
        let Some(head) = heads.first() else { return Err(Failure::input("there is no head to draw")) };
        let sequence = Sequence::from_json(&format!("gallery {}", row.name), &row.sequence)?;
        let mut job = Job::new(heads, inputs::rig(None, head.rig.clone())?, sequence)?;
        job.relight(inputs::lights(row.light)?)?;
        job.settings = settings.clone();
        let plan = Plan::new(&job, heads)?;
        plan.draw(studio, plan.frames(), |shown| {
            self.pictures.push(shown.drawn.picture());
            self.told.push(GalleryPicture {
                name: row.name.to_owned(),
                frame: shown.frame + 1,
                light: row.light.to_owned(),
                head: head.head.name.clone(),
            });
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sequence_of_the_page_reads_and_fills_whole_rows() {
        let counts: Vec<u32> = rows()
            .iter()
            .map(|row| Sequence::from_json("gallery", &row.sequence).unwrap().frame_count())
            .collect();
        assert_eq!(counts, [3, 7, 6, 1, 1, 1, 1, 1, 1, 2]);
        assert_eq!(counts.iter().sum::<u32>() % COLUMNS, 0);
        assert_eq!(CHARACTERS.len() as u32 % COLUMNS, 0);
    }
}
