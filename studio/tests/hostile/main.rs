//! Hostile files, made by code: each ends in a clear error or a right result, within 2 GiB and 10 s.
//!
//! `cargo test` tries a file of each kind; `RUBOR_HOSTILE=all` (`make check-hardening`) tries all of them and prints the
//! table of `docs/hardening.md`. `RUBOR_HOSTILE=gltf/` tries those whose names begin so.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

mod gltf;
mod images;
mod text;
mod tracks;

/// Longest time of a command: of a processor, as the machine of the tests may do other things beside, or by the clock where
/// that is less.
const LONGEST: Duration = Duration::from_secs(10);
/// A command that takes longer by the clock waits for something, and is ended.
const ENDLESS: Duration = Duration::from_secs(120);
/// Clock ticks of a second in `/proc` (`sysconf(_SC_CLK_TCK)` of every Linux).
const TICKS: f64 = 100.0;
/// Most resident memory of a command, bytes.
const MOST_MEMORY: u64 = 2 << 30;
/// A command that takes more is ended, so that the machine lives.
const DEADLY_MEMORY: u64 = 4 << 30;

/// A hostile file, or several, and the command that reads it.
pub(crate) struct Case {
    /// Kind and fault: `gltf/count-1e9`.
    name: String,
    /// `FILE` stands for the folder of the case.
    arguments: Vec<String>,
    make: Box<dyn FnOnce(&Path)>,
    /// In the subset of `cargo test`.
    is_small: bool,
    /// Must be refused, not read.
    must_fail: bool,
}

impl Case {
    /// A case whose files `make` writes into the folder of the case, `{}` in arguments.
    pub(crate) fn new(
        name: impl Into<String>,
        arguments: &[&str],
        make: impl FnOnce(&Path) + 'static,
    ) -> Self {
        let arguments = arguments.iter().map(|a| (*a).to_owned()).collect();
        Self { name: name.into(), arguments, make: Box::new(make), is_small: false, must_fail: false }
    }

    /// A case of one file that `rubor check` reads.
    pub(crate) fn check(
        name: impl Into<String>,
        file: &'static str,
        bytes: impl FnOnce() -> Vec<u8> + 'static,
    ) -> Self {
        let argument = format!("{{}}/{file}");
        Self::new(name, &["check", &argument], move |folder| write(folder, file, &bytes()))
    }

    /// Puts the case into the subset that every test run tries.
    pub(crate) fn small(mut self) -> Self {
        self.is_small = true;
        self
    }

    /// The file must be refused.
    pub(crate) fn refused(mut self) -> Self {
        self.must_fail = true;
        self
    }
}

/// Writes a file of a case.
pub(crate) fn write(folder: &Path, name: &str, bytes: &[u8]) {
    std::fs::write(folder.join(name), bytes).expect("a temporary file");
}

/// Cuts a file at every power of two.
pub(crate) fn truncated(
    kind: &str,
    file: &'static str,
    arguments: &'static [&'static str],
    whole: &[u8],
) -> Vec<Case> {
    let lengths = (0..).map(|n| 1_usize << n).take_while(|n| *n < whole.len());
    lengths
        .map(|length| {
            let bytes = whole[..length].to_vec();
            let case =
                Case::new(format!("{kind}/cut-at-{length}"), arguments, move |f| write(f, file, &bytes));
            if length == 64 { case.small() } else { case }
        })
        .collect()
}

/// What a command did.
struct Ended {
    code: Option<i32>,
    said: String,
    time: Duration,
    memory: u64,
}

fn memory_of(id: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.split_whitespace().next()?.parse::<u64>().ok()).unwrap_or(0) * 1024
}

/// Time of all processors that a process has taken.
fn time_of(id: u32) -> Duration {
    let stat = std::fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    // Behind the name in brackets: fields from the third on; user and system time are the 14th and 15th.
    let fields = stat.rsplit(')').next().unwrap_or_default();
    let ticks: f64 = fields.split_whitespace().skip(11).take(2).filter_map(|t| t.parse::<f64>().ok()).sum();
    Duration::from_secs_f64(ticks / TICKS)
}

fn run(arguments: &[String], folder: &Path) -> Ended {
    let start = Instant::now();
    let said = folder.join("said");
    let out = std::fs::File::create(&said).expect("a temporary file");
    let mut child = Command::new(env!("CARGO_BIN_EXE_rubor"))
        .args(arguments)
        .env("NODEVICE_SELECT", "1")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(out)
        .spawn()
        .expect("the command starts");
    let (mut memory, mut taken) = (0, Duration::ZERO);
    let code = loop {
        memory = memory.max(memory_of(child.id()));
        taken = taken.max(time_of(child.id()));
        if let Some(status) = child.try_wait().expect("the command ends") {
            break status.code();
        }
        if start.elapsed() > ENDLESS || taken > 2 * LONGEST || memory > DEADLY_MEMORY {
            child.kill().expect("the command is ended");
            child.wait().expect("the command ends");
            break None;
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let clock = start.elapsed();
    let time = if clock > ENDLESS { clock } else { clock.min(taken) };
    let mut bytes = Vec::new();
    let file = std::fs::File::open(&said).expect("what it said");
    file.take(1 << 16).read_to_end(&mut bytes).expect("what it said");
    Ended { code, said: String::from_utf8_lossy(&bytes).into_owned(), time, memory }
}

/// What is wrong with how a case ended.
fn fault(case_must_fail: bool, ended: &Ended) -> Option<String> {
    let Ended { code, said, time, memory } = ended;
    if *time > LONGEST {
        return Some(format!("{:.1} s", time.as_secs_f64()));
    }
    if *memory > MOST_MEMORY {
        return Some(format!("{} MiB", memory >> 20));
    }
    match code {
        Some(0) if case_must_fail => Some("no error".into()),
        Some(0) => None,
        Some(2) if said.contains("error: ") && !said.contains("panicked") => None,
        code => {
            let line =
                said.lines().find(|l| l.contains("panicked") || l.contains("error")).unwrap_or("nothing");
            Some(format!("exit code {code:?}, said {:?}", line.chars().take(200).collect::<String>()))
        }
    }
}

#[derive(Default)]
struct Row {
    cases: usize,
    refused: usize,
    longest: Duration,
    most_memory: u64,
}

fn all() -> Vec<Case> {
    [gltf::cases(), images::cases(), text::cases(), tracks::cases()].into_iter().flatten().collect()
}

#[test]
fn hostile_files_end_in_an_error_or_a_result() {
    let wanted = std::env::var("RUBOR_HOSTILE").unwrap_or_default();
    let mut rows: BTreeMap<String, Row> = BTreeMap::new();
    let mut faults = Vec::new();
    let all = all();
    assert!(all.len() >= 200, "{} files", all.len());
    let mut names: Vec<&str> = all.iter().map(|c| c.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), all.len(), "each file has a name of its own");
    let chosen = all.into_iter().filter(|case| match wanted.as_str() {
        "" => case.is_small,
        "all" => true,
        begin => case.name.starts_with(begin),
    });
    for case in chosen {
        let temporary = tempfile::tempdir().expect("a temporary folder");
        let folder = temporary.path().join("case");
        std::fs::create_dir(&folder).expect("a folder");
        (case.make)(&folder);
        let path = folder.to_string_lossy().into_owned();
        let arguments: Vec<String> = case.arguments.iter().map(|a| a.replace("{}", &path)).collect();
        let ended = run(&arguments, temporary.path());
        let outside: Vec<PathBuf> = std::fs::read_dir(temporary.path())
            .expect("the folder")
            .map(|e| e.expect("an entry").path())
            .filter(|p| *p != folder && p.file_name().is_some_and(|n| n != "said"))
            .collect();
        let mut fault = fault(case.must_fail, &ended);
        if !outside.is_empty() {
            fault = Some(format!("wrote outside: {outside:?}"));
        }
        if !wanted.is_empty() {
            let line = ended.said.lines().last().unwrap_or_default().chars().take(150).collect::<String>();
            let (seconds, mib) = (ended.time.as_secs_f64(), ended.memory >> 20);
            let mark = if fault.is_some() { "FAULT" } else { "" };
            println!("{:40} {seconds:6.2} s {mib:5} MiB {:?} {mark} {line}", case.name, ended.code);
        }
        let row = rows.entry(case.name.split('/').next().unwrap_or_default().to_owned()).or_default();
        row.cases += 1;
        row.refused += usize::from(ended.code == Some(2));
        row.longest = row.longest.max(ended.time);
        row.most_memory = row.most_memory.max(ended.memory);
        faults.extend(fault.map(|f| format!("{}: {f}", case.name)));
    }
    let mut table = String::from(
        "| kind | files | refused | longest, s | most memory, MiB |\n| --- | --- | --- | --- | --- |\n",
    );
    for (kind, row) in &rows {
        let (seconds, mib) = (row.longest.as_secs_f64(), row.most_memory >> 20);
        table += &format!("| {kind} | {} | {} | {seconds:.2} | {mib} |\n", row.cases, row.refused);
    }
    if !wanted.is_empty() {
        println!("\n{table}");
        let count: usize = rows.values().map(|r| r.cases).sum();
        println!("{count} files, {} faults", faults.len());
    }
    let _ = std::io::stdout().flush();
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
    assert!(!rows.is_empty(), "no file is called {wanted:?}");
}
