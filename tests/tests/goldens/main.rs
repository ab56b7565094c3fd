//! Goldens: one small picture for each pass, method, antialiasing mode, kind of light and material.
//!
//! ```text
//! scenes/NAME.json --Evaluator--> shots --Stage::draw--> picture --compare--> goldens/NAME.png
//!                                                   +--> values of a channel --hash--> goldens/values.json
//! ```
//!
//! `RUBOR_BLESS=1` writes the references, on the adapter that `tolerances.json` pins and on no other one. A failure
//! writes `NAME.actual.png`, `NAME.expected.png` and `NAME.difference.png` (amplified by 16). Eight bits do not hold all
//! that a channel does, so the pinned adapter also compares a hash of its values.
//!
//! All pictures are one test: opening the device and loading the heads costs more than drawing them.

mod cases;
mod show;
mod stage;

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::{Path, PathBuf};

use rubor_renderer::settings::GROUPS;
use rubor_rig::evaluate::{Evaluator, Shot};
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::timeline::Sequence;
use rubor_tests::picture::{Difference, Picture};
use rubor_tests::tolerance::{Tolerances, group};

use cases::Case;
use stage::{Outcome, Stage};

/// All references together, bytes.
const LARGEST_SET: u64 = 720_000;

/// Hashes of the values of channels, by the name of the picture.
type Hashes = BTreeMap<String, String>;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn hashes_file() -> PathBuf {
    folder("goldens").join("values.json")
}

fn reference_file(name: &str) -> PathBuf {
    folder("goldens").join(format!("{name}.png"))
}

/// Names of the pictures in `tests/goldens`, and the bytes of all its files.
fn references() -> Outcome<(BTreeSet<String>, u64)> {
    let (mut names, mut bytes) = (BTreeSet::new(), 0);
    for entry in std::fs::read_dir(folder("goldens"))? {
        let entry = entry?;
        bytes += entry.metadata()?.len();
        if entry.path() != hashes_file() {
            let name = entry.file_name().to_string_lossy().into_owned();
            names.insert(name.strip_suffix(".png").map_or(name.clone(), str::to_owned));
        }
    }
    Ok((names, bytes))
}

fn shots(head: &Head, case: &Case) -> Outcome<Vec<Shot>> {
    let file = folder("scenes").join(format!("{}.json", case.scene));
    let sequence = Sequence::load(&file)?;
    let (evaluator, notes) = Evaluator::new(head, &Rig::default_rig()?, &sequence)?;
    // Notes on the rig speak of shapes that the head lacks; a scene must have no such name.
    if let Some(note) = notes.iter().find(|note| Path::new(&note.place.file) == file) {
        return Err(note.to_string().into());
    }
    Ok((0..case.frames).map(|frame| evaluator.at(evaluator.frame_time_s(frame))).collect())
}

fn draw(stage: &mut Stage, case: &Case) -> Outcome<(Picture, Option<String>)> {
    let shots = shots(stage.head(case.models[0]), case)?;
    let drawn = stage.draw(case.models, &shots, case.size, &case.methods, case.channel)?;
    show::picture(&drawn, case).ok_or_else(|| "the channel has another number of values than pixels".into())
}

/// What is wrong with a picture; `None` if it is as its reference.
fn compare(
    case: &Case,
    actual: &(Picture, Option<String>),
    hashes: &Hashes,
    tolerances: &Tolerances,
    is_pinned: bool,
) -> Outcome<Option<String>> {
    let (picture, hash) = actual;
    let tolerance = tolerances.of(&case.name).ok_or("tolerances.json lists neither it nor its group")?;
    let output = Path::new(env!("CARGO_TARGET_TMPDIR")).join("goldens");
    let write = |what: &str, picture: &Picture| -> Outcome<()> {
        std::fs::create_dir_all(&output)?;
        Ok(picture.write(&output.join(format!("{}.{what}.png", case.name)))?)
    };
    let file = reference_file(&case.name);
    if !file.is_file() {
        write("actual", picture)?;
        return Ok(Some("it has no reference; RUBOR_BLESS=1 writes one".into()));
    }
    let reference = Picture::read(&file)?;
    let excess = match Difference::between(picture, &reference) {
        None => Some(format!(
            "its size is {}x{}, that of its reference {}x{}",
            picture.width, picture.height, reference.width, reference.height
        )),
        Some(difference) => tolerance.excess(&difference, is_pinned),
    };
    if let Some(excess) = excess {
        write("actual", picture)?;
        write("expected", &reference)?;
        write("difference", &picture.difference(&reference))?;
        let output = output.display();
        return Ok(Some(format!("{excess}; see {output}/{}.{{actual,expected,difference}}.png", case.name)));
    }
    let expected = hashes.get(&case.name);
    if is_pinned && tolerance.largest_difference == 0 && hash.as_ref() != expected {
        return Ok(Some(format!(
            "its picture is equal, the values behind it are not: found hash {hash:?}, expected {expected:?}"
        )));
    }
    Ok(None)
}

/// Faults of the set as a whole.
fn faults_of_the_set(cases: &[Case], hashes: &Hashes, tolerances: &Tolerances) -> Outcome<Vec<String>> {
    let mut faults = Vec::new();
    let names: BTreeSet<&str> = cases.iter().map(|case| case.name.as_str()).collect();
    if names.len() != cases.len() {
        faults.push(format!("{} cases have {} names: two cases share one", cases.len(), names.len()));
    }
    let (files, bytes) = references()?;
    for name in files.iter().chain(hashes.keys()).filter(|name| !names.contains(name.as_str())) {
        faults.push(format!("{name}: tests/goldens holds it and no case draws it; delete it"));
    }
    let groups: BTreeSet<&str> = names.iter().map(|name| group(name)).collect();
    let unknown_groups = tolerances.groups.keys().filter(|name| !groups.contains(name.as_str()));
    let unknown_pictures = tolerances.pictures.keys().filter(|name| !names.contains(name.as_str()));
    for name in unknown_groups.chain(unknown_pictures) {
        faults.push(format!("{name}: tolerances.json lists it and no case has that name"));
    }
    for group in GROUPS {
        for method in group.methods {
            let shows = |case: &Case| {
                let name = case.methods.of_group(group.name).unwrap_or_default();
                name.split(':').next() == Some(method.name)
            };
            if !cases.iter().any(shows) {
                faults.push(format!("{} {}: no picture shows it", group.name, method.name));
            }
        }
    }
    if bytes > LARGEST_SET {
        faults.push(format!("tests/goldens holds {bytes} bytes, expected at most {LARGEST_SET}"));
    }
    Ok(faults)
}

/// Writes all references and removes those that no case draws.
fn bless(stage: &mut Stage, cases: &[Case]) -> Outcome<()> {
    let mut hashes = Hashes::new();
    for case in cases {
        let (picture, hash) = draw(stage, case).map_err(|e| format!("{}: {e}", case.name))?;
        picture.write(&reference_file(&case.name))?;
        hashes.extend(hash.map(|hash| (case.name.clone(), hash)));
    }
    std::fs::write(hashes_file(), serde_json::to_string_pretty(&hashes)? + "\n")?;
    for name in references()?.0.iter().filter(|name| cases.iter().all(|case| case.name != **name)) {
        std::fs::remove_file(reference_file(name))?;
    }
    Ok(())
}

#[test]
fn every_picture_is_as_its_reference() -> Outcome<()> {
    let mut stage = match Stage::open() {
        Ok(stage) => stage,
        Err(error) => {
            for variable in ["RUBOR_REQUIRE_GPU", "RUBOR_ADAPTER"] {
                assert!(std::env::var_os(variable).is_none(), "{variable} is set: {error}");
            }
            // The harness hides what a passing test prints by a macro, but not what it writes.
            writeln!(std::io::stderr(), "SKIPPED: goldens: {error}")?;
            return Ok(());
        }
    };
    let cases = cases::all();
    let tolerances = Tolerances::read(&folder("tolerances.json"))?;
    let adapter = stage.adapter();
    let is_pinned = adapter == tolerances.pinned;
    if std::env::var_os("RUBOR_BLESS").is_some_and(|value| value == "1") {
        let pinned = &tolerances.pinned;
        assert!(
            is_pinned,
            "references are blessed on {pinned:?}, found {adapter:?}: a new driver is written into tests/tolerances.json first"
        );
        bless(&mut stage, &cases)?;
    }
    let hashes: Hashes = serde_json::from_str(&std::fs::read_to_string(hashes_file())?)?;
    let mut faults = faults_of_the_set(&cases, &hashes, &tolerances)?;
    for case in &cases {
        let verdict = draw(&mut stage, case)
            .and_then(|actual| compare(case, &actual, &hashes, &tolerances, is_pinned))
            .unwrap_or_else(|error| Some(error.to_string()));
        faults.extend(verdict.map(|verdict| format!("{}: {verdict}", case.name)));
    }
    let rule = if is_pinned { "equal bytes" } else { "FLIP, as the references come from another one" };
    assert!(
        faults.is_empty(),
        "{} faults in {} pictures on {} ({}; compared by {rule}):\n{}",
        faults.len(),
        cases.len(),
        adapter.name,
        adapter.driver,
        faults.join("\n")
    );
    Ok(())
}
