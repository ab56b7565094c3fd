//! `rubor check`: finds faults in files, entries without effect, and the reason why a wrinkle does not show; with --budget what
//! sequences do not need of a head (`budget.rs`).

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use rubor_assets::check::visibility::Scene;
use rubor_assets::check::{self, Finding, Severity};
use rubor_assets::import::capture::{self, Retarget};
use rubor_assets::import::gltf::lint;
use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::limits;
use rubor_rig::timeline::Sequence;
use serde::Serialize;

use super::budget;
use rubor::inputs;
use rubor::notes::{Note, summed};
use rubor::{Failure, Outcome};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Heads (.glb, .gltf, .vrm, .obj, .ma, .usda, .usdz), rigs, sequences, retarget files (.json), recordings (.csv, .json); files that
    /// are given together is checked together
    #[arg(required_unless_present = "budget", value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Fail on warnings too
    #[arg(long)]
    strict: bool,
    /// Print the findings, or the budget, as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    budget: budget::Arguments,
}

/// Kind of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Gltf,
    Maya,
    Usd,
    /// Read as a head; nothing is known of it that import does not say.
    Head,
    Rig,
    Sequence,
    Retarget,
    Capture,
}

impl Kind {
    fn words(self) -> &'static str {
        match self {
            Self::Gltf => "glTF",
            Self::Maya => "Maya ASCII",
            Self::Usd => "USD",
            Self::Head => "head",
            Self::Rig => "rig",
            Self::Sequence => "sequence",
            Self::Retarget => "retarget file",
            Self::Capture => "recording",
        }
    }
}

#[derive(Serialize)]
struct Report {
    file: PathBuf,
    kind: Kind,
    findings: Vec<Finding>,
}

/// A head and the rig and sequence that came with it.
struct Subject {
    /// Index of its report; `None` for the built-in head.
    report: Option<usize>,
    head: Head,
    rig: Option<Rig>,
    sequence: Option<Sequence>,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    if arguments.budget.budget {
        return budget::run(&arguments.budget, &arguments.files, arguments.json);
    }
    arguments.budget.refuse_settings()?;
    let mut reports = Vec::new();
    for file in &arguments.files {
        reports.push(Report { file: file.clone(), kind: kind(file)?, findings: Vec::new() });
    }
    let mut heads = Vec::new();
    for (i, report) in reports.iter_mut().enumerate() {
        let subject = match report.kind {
            Kind::Gltf => gltf(&report.file, &mut report.findings),
            Kind::Maya => maya(&report.file, &mut report.findings),
            Kind::Head => head(&report.file, &mut report.findings),
            Kind::Usd => {
                usd(&report.file, &mut report.findings);
                None
            }
            _ => None,
        };
        heads.extend(subject.map(|s| Subject { report: Some(i), ..s }));
    }
    let of_kind = |reports: &[Report], kind: Kind| -> Vec<usize> {
        (0..reports.len()).filter(|i| reports[*i].kind == kind).collect()
    };
    let rigs: Vec<(usize, Rig)> = of_kind(&reports, Kind::Rig)
        .into_iter()
        .filter_map(|i| parsed(&mut reports[i], Rig::load).map(|rig| (i, rig)))
        .collect();
    let sequences: Vec<(usize, Sequence)> = of_kind(&reports, Kind::Sequence)
        .into_iter()
        .filter_map(|i| sequence(&mut reports[i]).map(|sequence| (i, sequence)))
        .collect();
    let retargets: Vec<Retarget> = of_kind(&reports, Kind::Retarget)
        .into_iter()
        .filter_map(|i| {
            let loaded = Retarget::load(&reports[i].file);
            loaded.map_err(|e| reports[i].findings.push(Finding::error("", e.to_string()))).ok()
        })
        .collect();
    let needs_head = |r: &Report| !matches!(r.kind, Kind::Gltf | Kind::Maya | Kind::Usd | Kind::Head);
    let given = reports.iter().any(|r| matches!(r.kind, Kind::Gltf | Kind::Maya | Kind::Head));
    if !given && reports.iter().any(needs_head) {
        let built_in = inputs::head(None)?;
        heads.push(Subject { report: None, head: built_in.head, rig: built_in.rig, sequence: None });
    }
    for subject in &heads {
        together(subject, &rigs, &sequences, &mut reports)?;
    }
    let default = Retarget::default();
    for i in of_kind(&reports, Kind::Capture) {
        match capture::read(&reports[i].file) {
            Err(e) => reports[i].findings.push(Finding::error("", e.to_string())),
            Ok(recording) => {
                let retarget = retargets.first().unwrap_or(&default);
                for subject in &heads {
                    reports[i].findings.extend(check::capture::check(&recording, retarget, &subject.head));
                }
            }
        }
    }
    print(arguments, &mut reports)
}

/// A head with every rig and sequence of the command, or with its own.
fn together(
    subject: &Subject,
    rigs: &[(usize, Rig)],
    sequences: &[(usize, Sequence)],
    reports: &mut [Report],
) -> Outcome {
    let own;
    let rigs: Vec<(Option<usize>, &Rig)> = match (rigs, &subject.rig) {
        ([], Some(rig)) => vec![(subject.report, rig)],
        ([], None) => {
            own = Rig::default_rig()?;
            vec![(None, &own)]
        }
        (given, _) => given.iter().map(|(i, rig)| (Some(*i), rig)).collect(),
    };
    let sequences: Vec<(Option<usize>, &Sequence)> = match (sequences, &subject.sequence) {
        ([], Some(sequence)) => vec![(subject.report, sequence)],
        (given, _) => given.iter().map(|(i, sequence)| (Some(*i), sequence)).collect(),
    };
    for (of_rig, rig) in &rigs {
        // The default rig has optional names; missing ones are no fault of the head or of the rig.
        if let Some(i) = of_rig {
            reports[*i].findings.append(&mut check::performance::check_rig(&subject.head, rig));
        }
        let mut evaluators: Vec<(Option<usize>, Evaluator)> = Vec::new();
        for (of_sequence, sequence) in &sequences {
            let (mut found, evaluator) = check::performance::check_sequence(&subject.head, rig, sequence);
            if let Some(i) = of_sequence {
                reports[*i].findings.append(&mut found);
            }
            evaluators.extend(evaluator.map(|e| (*of_sequence, e)));
        }
        let scenes: Vec<(Option<usize>, Option<&Evaluator>)> = match &evaluators[..] {
            [] => vec![(of_rig.or(subject.report), None)],
            list => list.iter().map(|(i, e)| (*i, Some(e))).collect(),
        };
        for (target, evaluator) in scenes {
            let scene = Scene { head: &subject.head, rig, evaluator };
            if let Some(i) = target {
                reports[i].findings.extend(check::visibility::check(&scene));
            }
        }
    }
    Ok(())
}

/// By the file name, and for JSON by the contents.
fn kind(file: &Path) -> Outcome<Kind> {
    let extension = file.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if !file.is_file() {
        let found = if file.is_dir() { "a folder" } else { "no such file" };
        return Err(Failure::input(format!("{}: found {found}, expected a file", file.display())));
    }
    match extension.as_str() {
        "glb" | "gltf" | "vrm" => Ok(Kind::Gltf),
        "ma" => Ok(Kind::Maya),
        "usda" | "usd" | "usdc" => Ok(Kind::Usd),
        "obj" | "usdz" => Ok(Kind::Head),
        "csv" => Ok(Kind::Capture),
        "json" => json_kind(file),
        _ => Err(Failure::input(format!(
            "{}: found a name that ends in .{extension}, expected .glb, .gltf, .vrm, .obj, .ma, .usda, .usdz, .csv or .json",
            file.display()
        ))),
    }
}

fn json_kind(file: &Path) -> Outcome<Kind> {
    let text = limits::read_to_string(file).map_err(|e| Failure::read(file, e))?;
    let has = |key: &str| text.contains(&format!("\"{key}\""));
    // A rig has neither times nor channels; a sequence needs a length; recordings have frames or columns of weights.
    Ok(if has("frames") || has("weightMat") || has("weights") && has("names") {
        Kind::Capture
    } else if has("duration") || has("fps") {
        Kind::Sequence
    } else if has("smoothing") || has("limit") || has("neutral") || (has("shapes") && !has("expressions")) {
        Kind::Retarget
    } else {
        Kind::Rig
    })
}

fn gltf(file: &Path, findings: &mut Vec<Finding>) -> Option<Subject> {
    let loaded = limits::read(file)
        .map_err(|e| Failure::input(format!("cannot be read: {e}")))
        .and_then(|bytes| Ok(lint(&bytes, file)?));
    match loaded {
        Ok(mut found) => findings.append(&mut found),
        Err(e) => {
            findings.push(Finding::error("", e.to_string()));
            return None;
        }
    }
    match inputs::head(Some(file)) {
        Ok(loaded) => {
            findings.extend(check::head::check(&loaded.head));
            Some(Subject { report: None, head: loaded.head, rig: loaded.rig, sequence: loaded.sequence })
        }
        Err(e) => {
            findings.push(Finding::error("", e.to_string()));
            None
        }
    }
}

fn head(file: &Path, findings: &mut Vec<Finding>) -> Option<Subject> {
    match inputs::plain_head(Some(file)) {
        Ok(loaded) => {
            findings.extend(loaded.notes.iter().map(|n| Finding::warning("", n.message.clone())));
            findings.extend(check::head::check(&loaded.head));
            Some(Subject { report: None, head: loaded.head, rig: loaded.rig, sequence: loaded.sequence })
        }
        Err(e) => {
            findings.push(Finding::error("", e.to_string()));
            None
        }
    }
}

fn maya(file: &Path, findings: &mut Vec<Finding>) -> Option<Subject> {
    match rubor_maya::read::read(file, &rubor_maya::read::Options::default()) {
        Ok(imported) => {
            findings.extend(imported.notes.iter().map(|n| Finding::warning("", n.clone())));
            findings.extend(check::head::check(&imported.head));
            Some(Subject { report: None, head: imported.head, rig: None, sequence: imported.sequence })
        }
        Err(e) => {
            findings.push(Finding::error("", e.to_string()));
            None
        }
    }
}

fn usd(file: &Path, findings: &mut Vec<Finding>) {
    match limits::read(file) {
        Ok(bytes) => findings.extend(check::usd::check(&bytes, file.parent().unwrap_or(Path::new("")))),
        Err(e) => findings.push(Finding::error("", format!("cannot be read: {e}"))),
    }
}

fn parsed<T>(
    report: &mut Report,
    load: impl Fn(&Path) -> Result<T, rubor_rig::error::RigError>,
) -> Option<T> {
    load(&report.file).map_err(|e| report.findings.push(check::performance::of_error(&e))).ok()
}

/// Reads a sequence with the recording that it names.
fn sequence(report: &mut Report) -> Option<Sequence> {
    let mut sequence = parsed(report, Sequence::load)?;
    let folder = report.file.parent().unwrap_or(Path::new("")).to_owned();
    match capture::load_into(&mut sequence, &folder) {
        Ok(loaded) => {
            if let Some(loaded) = loaded {
                report.findings.extend(loaded.notes.iter().map(|n| Finding::warning("capture", n.clone())));
                for channel in &loaded.unmapped {
                    let message = "no shape is known for this column: it moves nothing";
                    report.findings.push(
                        Finding::warning(format!("capture, column {channel:?}"), message)
                            .fix("name a shape for it in a retarget file"),
                    );
                }
            }
            Some(sequence)
        }
        Err(e) => {
            report.findings.push(Finding::error("capture", e.to_string()));
            None
        }
    }
}

/// A finding as it is printed, with its fix on a line of its own.
fn as_note(finding: &Finding) -> Note {
    let word = match finding.severity {
        Severity::Error => "  error",
        Severity::Warning => "  warning",
        Severity::Note => "  note",
    };
    let fix = finding.fix.as_ref().map(|fix| format!("\n    fix: {fix}")).unwrap_or_default();
    // Findings differ by a name in the place as by one in the message; the line is that of the first finding.
    if finding.at.starts_with("line ") {
        let place = format!("{}: ", finding.at);
        return Note { about: word.into(), place, message: format!("{}{fix}", finding.message) };
    }
    Note::new(word, format!("{finding}{fix}"))
}

fn print(arguments: &Arguments, reports: &mut [Report]) -> Outcome {
    for report in reports.iter_mut() {
        report.findings.sort_by_key(|f| f.severity);
        let mut seen = HashSet::new();
        report.findings.retain(|f| seen.insert(f.clone()));
    }
    let count = |severity: Severity| -> usize {
        reports.iter().flat_map(|r| &r.findings).filter(|f| f.severity == severity).count()
    };
    let [errors, warnings, notes] = [Severity::Error, Severity::Warning, Severity::Note].map(count);
    if arguments.json {
        super::print_json(&serde_json::json!({
            "files": reports, "errors": errors, "warnings": warnings, "notes": notes,
        }))?;
    } else {
        for report in reports.iter() {
            say!(
                "{}: {}{}",
                report.file.display(),
                report.kind.words(),
                match report.findings.len() {
                    0 => ", nothing to say",
                    _ => "",
                }
            );
            for line in summed(&report.findings.iter().map(as_note).collect::<Vec<_>>()) {
                say!("{line}");
            }
        }
        say!("errors: {errors}, warnings: {warnings}, notes: {notes}");
    }
    match (errors, warnings) {
        (0, 0) => Ok(()),
        (0, _) if !arguments.strict => Ok(()),
        (0, n) => Err(Failure::input(format!("--strict: warnings: {n}"))),
        (n, _) => Err(Failure::input(format!("errors: {n}"))),
    }
}
