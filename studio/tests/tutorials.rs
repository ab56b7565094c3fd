//! The commands of the tutorials are run as they stand there.

#![cfg(unix)]

#[path = "support/ffmpeg.rs"]
mod ffmpeg;
mod support;

use std::path::Path;
use std::process::Command;

use ffmpeg::has_program;
use support::can_draw;

/// The blocks of a page that are for a shell, one after the other.
fn commands(page: &str) -> String {
    let blocks = page.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next());
    blocks.collect::<Vec<_>>().join("\n")
}

/// Runs the commands of a page in a fresh folder, which has to hold `files` then.
fn run(page: &str, files: &[&str]) {
    if !can_draw() || !has_program("ffmpeg") {
        return;
    }
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/tutorials");
    let text = std::fs::read_to_string(docs.join(page)).expect("the page");
    let folder = tempfile::tempdir().expect("a folder");
    let program = Path::new(env!("CARGO_BIN_EXE_rubor"));
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = program.parent().map(Path::to_owned).into_iter().chain(std::env::split_paths(&path));
    let output = Command::new("sh")
        .args(["-e", "-u", "-c", &commands(&text)])
        .current_dir(folder.path())
        .env("PATH", std::env::join_paths(folders).expect("a path"))
        .env("NODEVICE_SELECT", "1")
        .output()
        .expect("a shell");
    let said = [&output.stdout[..], &output.stderr[..]].map(String::from_utf8_lossy).join("\n");
    assert!(output.status.success(), "{page}: {said}");
    assert!(!said.contains("DIFFERS"), "{page}: {said}");
    for file in files {
        assert!(folder.path().join(file).is_file(), "{page} makes no {file}: {said}");
    }
    // Links and pictures of the page are there.
    for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
        assert!(docs.join(link).exists(), "{page}: {link} is not there");
    }
}

#[test]
fn the_tutorial_of_a_rigger_runs() {
    run(
        "rigger.md",
        &["smirk/review.html", "both/review.html", "both/b/frame.0001.png", "smirk.glb", "smirk.usda"],
    );
}

#[test]
fn the_tutorial_of_a_capture_artist_runs() {
    run("capture-artist.md", &["take.json", "actor.json", "retargeted.json", "take/review.html"]);
}

#[test]
fn the_tutorial_of_a_supervisor_runs() {
    run(
        "supervisor.md",
        &["first/video.mp4", "first/sequence.otio", "both/review.html", "both.mp4", "plates/frame.0005.exr"],
    );
}
