//! Folders of runs as a user sees them: stopped, killed, two at once. `frames.rs` has what needs no process of its own.

#![cfg(unix)]

mod support;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use rubor_rig::random::SplitMix64;
use support::can_draw;

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rubor"));
    command.args(arguments).env("NODEVICE_SELECT", "1").stdin(Stdio::null());
    command
}

fn rubor(arguments: &[&str]) -> Output {
    command(arguments).output().expect("the command starts")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Kills of each command: those that the environment asks for, or a few.
fn kills() -> usize {
    std::env::var("RUBOR_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(3)
}

/// Draws fast: no relief, light from one lamp, small maps.
const FAST: &[&str] = &[
    "--size",
    "48x32",
    "--preset",
    "draft",
    "--shadow-size",
    "64",
    "--raster",
    "hardware",
    "--no-video",
    "--no-export",
];

fn sequence(folder: &Path, frames: u32) -> PathBuf {
    let path = folder.join(format!("s{frames}.json"));
    let duration = f64::from(frames) / 10.0;
    let text = format!(
        r#"{{ "fps": 10, "duration": {duration}, "expressions": {{ "joy": [{{ "t": 0, "v": 0 }}, {{ "t": {duration}, "v": 1 }}] }},
            "lights": [{{ "kind": "point", "position": [0.3, 0.3, 0.6], "intensity": 1 }}] }}"#
    );
    std::fs::write(&path, text).expect("a sequence");
    path
}

fn render<'a>(sequence: &'a str, out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["render", "--sequence", sequence, "-o", out][..], FAST, more].concat()
}

/// Files with measured times or the name of the folder, and the checksums of those.
const OWN: [&str; 4] = ["stats.json", "review.html", "sequence.otio", "manifest.json"];

/// Files of a folder with their bytes, but for what is its own.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).expect("the folder").map(|e| e.expect("an entry").path());
    let name = |p: &Path| p.file_name().expect("a name").to_string_lossy().into_owned();
    let files = entries.filter(|p| p.is_file() && !OWN.contains(&name(p).as_str()));
    files.map(|p| (name(&p), std::fs::read(&p).expect("a file"))).collect()
}

fn frames(folder: &Path) -> usize {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter(|e| e.file_name().to_string_lossy().ends_with(".png")).count()
}

fn wait_for(child: &mut Child, what: impl Fn() -> bool) {
    let start = Instant::now();
    while !what() && start.elapsed() < Duration::from_secs(60) {
        assert!(child.try_wait().expect("its state").is_none(), "it ended before");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

#[test]
fn stopped_runs_say_how_to_go_on_and_others_keep_out() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("100 %d out");
    let long = sequence(folder.path(), 400);
    let job = render(text(&long), text(&out), &["--channels", "depth"]);
    let mut run = command(&job).stderr(Stdio::piped()).spawn().expect("the command starts");
    wait_for(&mut run, || frames(&out) > 0);
    let second = rubor(&job);
    assert_eq!(second.status.code(), Some(1), "{}", said(&second));
    assert!(said(&second).contains("another run works in this folder"), "{}", said(&second));
    let status = Command::new("kill").args(["-INT", &run.id().to_string()]).status().expect("kill");
    assert!(status.success());
    let output = run.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130), "{}", said(&output));
    let drawn = frames(&out);
    let expected = [format!("{drawn} of 400 frames"), format!("--resume goes on at frame {}", drawn + 1)];
    assert!(drawn < 400 && expected.iter().all(|e| said(&output).contains(e)), "{drawn}: {}", said(&output));
    let names: Vec<String> = contents(&out).into_keys().collect();
    assert!(names.iter().all(|n| n.starts_with("frame.") || n == "job.json"), "{names:?}");
}

#[test]
#[ignore = "minutes; make check-hardening runs it"]
fn a_killed_render_resumes_to_the_same_bytes() {
    if !can_draw() {
        return;
    }
    let kills = kills();
    let folder = tempfile::tempdir().expect("a folder");
    let sequence = sequence(folder.path(), 8);
    let whole = folder.path().join("whole");
    let start = Instant::now();
    let run = rubor(&render(text(&sequence), text(&whole), &["--channels", "depth"]));
    assert!(run.status.success(), "{}", said(&run));
    let length = start.elapsed();
    let expected = contents(&whole);
    let mut random = SplitMix64(7);
    let mut halted = 0;
    for kill in 0..kills {
        let out = folder.path().join(format!("out{kill}"));
        let job = render(text(&sequence), text(&out), &["--channels", "depth"]);
        let mut run = command(&job).stderr(Stdio::null()).spawn().expect("the command starts");
        std::thread::sleep(length.mul_f64(random.below(1000) as f64 / 1000.0));
        // SIGKILL.
        run.kill().expect("it is killed");
        halted += usize::from(!run.wait().expect("it ends").success());
        for (name, bytes) in if out.is_dir() { contents(&out) } else { BTreeMap::new() } {
            let is_unfinished = name.starts_with(".rubor-");
            assert!(is_unfinished || expected.get(&name) == Some(&bytes), "kill {kill}: {name} is not whole");
        }
        let rest = rubor(&[&job[..], &["--resume"]].concat());
        assert!(rest.status.success(), "kill {kill}: {}", said(&rest));
        let found = contents(&out);
        assert!(found == expected, "kill {kill}: {:?}", found.keys().collect::<Vec<_>>());
        std::fs::remove_dir_all(&out).expect("the folder goes");
    }
    println!("render: {kills} kills, {halted} before the end, all resumed to the same bytes");
}

#[test]
#[ignore = "minutes; make check-hardening runs it"]
fn a_killed_import_or_export_leaves_no_half_file() {
    let kills = kills();
    let folder = tempfile::tempdir().expect("a folder");
    let head = folder.path().join("head.glb");
    std::fs::write(&head, include_bytes!("../../assets/head.glb")).expect("a head");
    for (what, flag, file) in [("import", None, "a.glb"), ("export", Some("--head"), "a.usda")] {
        let run = |out: &Path| {
            let arguments = [Some(what), flag, Some(text(&head)), Some("-o"), Some(text(out))];
            command(&arguments.into_iter().flatten().collect::<Vec<_>>())
        };
        let whole = folder.path().join(format!("whole-{what}"));
        std::fs::create_dir(&whole).expect("a folder");
        let start = Instant::now();
        let output = run(&whole.join(file)).output().expect("it starts");
        assert!(output.status.success(), "{}", said(&output));
        let length = start.elapsed();
        let expected = contents(&whole);
        let mut random = SplitMix64(9);
        let mut halted = 0;
        for kill in 0..kills {
            let out = folder.path().join(format!("{what}{kill}"));
            std::fs::create_dir(&out).expect("a folder");
            let mut child =
                run(&out.join(file)).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("it starts");
            // Writing is at the end.
            let share = if random.below(2) == 0 { 0.0 } else { 0.8 };
            std::thread::sleep(length.mul_f64(share + (1.0 - share) * random.below(1000) as f64 / 1000.0));
            child.kill().expect("it is killed");
            halted += usize::from(!child.wait().expect("it ends").success());
            for (name, bytes) in contents(&out) {
                let whole = expected.get(&name) == Some(&bytes);
                assert!(whole || name.starts_with(".rubor-"), "{what}, kill {kill}: {name} is not whole");
            }
            let again = run(&out.join(file)).output().expect("it starts");
            assert!(again.status.success(), "{what}, kill {kill}: {}", said(&again));
            assert!(
                contents(&out) == expected,
                "{what}, kill {kill}: {:?}",
                contents(&out).keys().collect::<Vec<_>>()
            );
            std::fs::remove_dir_all(&out).expect("the folder goes");
        }
        println!("{what}: {kills} kills, {halted} before the end, the next run gives the same bytes");
    }
}

#[test]
fn limits_are_arguments_and_wrong_ones_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let big = folder.path().join("a.obj");
    std::fs::write(&big, "v 0 0 0\n".repeat(400_000)).expect("a file");
    let tight = rubor(&["check", text(&big), "--limit-memory", "16M"]);
    assert_eq!(tight.status.code(), Some(2));
    let words = String::from_utf8_lossy(&tight.stdout).into_owned();
    assert!(words.contains("bytes of text") && words.contains("--limit-memory"), "{words}");
    let by_variable =
        command(&["check", text(&big)]).env("RUBOR_LIMIT_MEMORY", "16M").output().expect("it starts");
    assert_eq!(String::from_utf8_lossy(&by_variable.stdout), words);
    let wrong = command(&["adapters"]).env("RUBOR_LIMIT_MEMORY", "lots").output().expect("it starts");
    assert_eq!(wrong.status.code(), Some(2));
    assert!(said(&wrong).contains("RUBOR_LIMIT_MEMORY") && said(&wrong).contains("lots"), "{}", said(&wrong));
    let wrong = rubor(&["adapters", "--limit-memory", "2 bananas"]);
    assert_eq!(wrong.status.code(), Some(2));
}

#[test]
fn completions_and_manual_pages_name_every_command() {
    let folder = tempfile::tempdir().expect("a folder");
    let script = String::from_utf8(rubor(&["completions", "bash"]).stdout).expect("a script");
    let pages = rubor(&["man", "-o", text(folder.path())]);
    assert!(pages.status.success(), "{}", said(&pages));
    for command in ["render", "gather", "job", "check", "maps"] {
        assert!(script.contains(command), "{command}");
        let page = std::fs::read_to_string(folder.path().join(format!("rubor-{command}.1"))).expect(command);
        assert!(page.contains(".SH OPTIONS"), "{command}");
    }
    assert!(folder.path().join("rubor.1").is_file());
}
