//! Frames do not depend on which others are drawn, in which order, and by how many processes.

mod support;

use std::collections::BTreeMap;
use std::path::Path;

use rubor::inputs::{self, LoadedHead};
use rubor::job::FrameList;
use rubor::{Destination, Job, Plan, Stop, Studio, farm, run};
use rubor_renderer::settings::AntialiasMethod;
use rubor_rig::timeline::Sequence;
use support::can_draw;

/// A head that turns, talks and flushes under light that turns with every frame, seen by a camera that moves.
const MOVING: &str = r#"{ "fps": 12, "duration": 0.5,
    "expressions": { "joy": [{ "t": 0, "v": 0 }, { "t": 0.5, "v": 1 }] },
    "states": { "blush": [{ "t": 0, "v": 0 }, { "t": 0.5, "v": 1 }] },
    "shapes": { "jawOpen": [{ "t": 0, "v": 0 }, { "t": 0.2, "v": 0.8, "ease": "smooth" }, { "t": 0.5, "v": 0 }] },
    "head": { "yawDegrees": [{ "t": 0, "v": -20, "ease": "easeIn" }, { "t": 0.5, "v": 25 }],
              "translation": [{ "t": 0, "v": [0, 0, 0] }, { "t": 0.3, "v": [0.02, 0, 0] }] },
    "camera": { "framing": "close", "orbitDegrees": [{ "t": 0, "v": 0 }, { "t": 0.5, "v": 9 }] },
    "environment": { "name": "studio", "rotationDegrees": [{ "t": 0, "v": 0.4 }, { "t": 0.5, "v": 3.1 }] } }"#;

fn moving_job(heads: &[LoadedHead], antialias: AntialiasMethod) -> Job {
    let sequence = Sequence::from_json("moving.json", MOVING).expect("a sequence");
    let rig = inputs::rig(None, heads[0].rig.clone()).expect("a rig");
    let mut job = Job::new(heads, rig, sequence).expect("a job");
    job.settings.output.size = [64, 48];
    job.settings.quality.antialias = antialias;
    job.settings.quality.shadow_size = 128;
    job
}

/// The bytes of frames, in the order in which they are drawn.
fn drawn(plan: &Plan<'_>, studio: &mut Studio, frames: &[u32]) -> Vec<(u32, Vec<u8>)> {
    let mut all = Vec::new();
    plan.draw(studio, frames, |shown| {
        all.push((shown.frame, shown.drawn.image.rgba));
        Ok(())
    })
    .expect("frames");
    all
}

#[test]
fn every_order_gives_the_bytes_of_the_whole_run() {
    if !can_draw() {
        return;
    }
    let heads = [inputs::head(None).expect("the built-in head")];
    let mut studio = Studio::open(None).expect("a device");
    let mut other = Studio::open(None).expect("a device");
    for studio in [&mut studio, &mut other] {
        studio.set_heads([&heads[0].head]).expect("the head fits");
    }
    for antialias in AntialiasMethod::all() {
        let job = moving_job(&heads, antialias);
        let plan = Plan::new(&job, &heads).expect("a plan");
        let whole = drawn(&plan, &mut studio, plan.frames());
        assert_eq!(whole.len(), 6);
        let pictures: std::collections::BTreeSet<_> = whole.iter().map(|(_, bytes)| bytes).collect();
        assert_eq!(pictures.len(), 6, "{antialias}: something moves in every frame");
        let same = |found: Vec<(u32, Vec<u8>)>, how: &str| {
            for (frame, bytes) in found {
                let most = bytes.iter().zip(&whole[frame as usize].1).map(|(a, b)| a.abs_diff(*b)).max();
                assert_eq!(most, Some(0), "{antialias}, frame {frame}, {how}");
            }
        };
        same(drawn(&plan, &mut studio, &[5, 4, 3, 2, 1, 0]), "in reverse");
        if antialias.is_temporal() {
            for frame in 0..6 {
                same(drawn(&plan, &mut other, &[frame]), "alone, on another device");
            }
            same(drawn(&plan, &mut studio, &[0, 1, 4, 5, 2, 2]), "with gaps and a frame twice");
        } else {
            same(drawn(&plan, &mut other, &[4, 1]), "on another device");
        }
    }
}

#[test]
fn frames_that_overlap_have_the_bytes_of_frames_one_by_one() {
    if !can_draw() {
        return;
    }
    let heads = [inputs::head(None).expect("the built-in head")];
    let mut studio = Studio::open(None).expect("a device");
    studio.set_heads([&heads[0].head]).expect("the head fits");
    for antialias in [AntialiasMethod::None, AntialiasMethod::Smaa4x] {
        let job = moving_job(&heads, antialias);
        let plan = Plan::new(&job, &heads).expect("a plan");
        studio.cut(0);
        let alone: Vec<_> = (plan.frames().iter())
            .map(|frame| {
                let shots = plan.shots(*frame);
                let drawn = studio.render(&shots, plan.spacing_m(), plan.settings(*frame));
                (*frame, drawn.expect("a frame").image.rgba)
            })
            .collect();
        assert!(drawn(&plan, &mut studio, plan.frames()) == alone, "{antialias}");
        // Who takes them slowly gets the same, and no more wait than fit.
        let mut slow = Vec::new();
        plan.draw(&mut studio, plan.frames(), |shown| {
            std::thread::sleep(std::time::Duration::from_millis(30));
            slow.push((shown.frame, shown.drawn.image.rgba));
            Ok(())
        })
        .expect("frames");
        assert!(slow == alone, "{antialias}, slowly");
        let mut taken = 0;
        let stopped = plan.draw(&mut studio, plan.frames(), |_| {
            taken += 1;
            Err(rubor::Failure::job("enough"))
        });
        assert_eq!((taken, stopped.unwrap_err().to_string().as_str()), (1, "enough"));
    }
}

#[test]
fn parts_and_resumed_runs_make_the_same_files() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let heads = [inputs::head(None).expect("the built-in head")];
    let mut job = moving_job(&heads, AntialiasMethod::Smaa4x);
    job.settings.output.channels = vec![rubor_renderer::channels::Channel::Velocity];
    let run = |job: &Job, name: &str, resume: bool| {
        let plan = Plan::new(job, &heads).expect("a plan");
        let folder = folder.path().join(name);
        let to = Destination { resume, video: false, animated_head: false, ..Destination::new(folder) };
        // A device of its own, as another process has.
        run::run(&plan, &mut Studio::open(None).expect("a device"), &to, &mut ()).expect("a run")
    };
    let read = |folder_name: &str, file: &str| {
        std::fs::read(folder.path().join(folder_name).join(file)).unwrap_or_else(|e| panic!("{file}: {e}"))
    };
    assert_eq!(run(&job, "whole", false).frames_drawn, 6);
    let part =
        |frames: &str| Job { frames: Some(frames.parse::<FrameList>().expect("a list")), ..job.clone() };
    run(&part("3,6"), "parts", false);
    assert_eq!(run(&part("1,3"), "parts", true).frames_drawn, 1);
    let stored = Job::read(&folder.path().join("parts/job.json"), None).expect("a job");
    assert_eq!(stored, part("1,3,6"), "the folder holds the frames of both");
    std::fs::remove_file(folder.path().join("parts/frame.0001.velocity.exr")).expect("a lost channel");
    std::fs::write(folder.path().join("parts/frame.0005.png"), b"half").expect("a broken frame");
    // Frames 3 and 6 stay as they were drawn alone.
    assert_eq!(run(&job, "parts", true).frames_drawn, 4);
    for file in ["job.json", "contact_sheet.png"] {
        assert!(read("whole", file) == read("parts", file), "{file}");
    }
    for frame in 1..=6 {
        for kind in ["png", "velocity.exr"] {
            let file = format!("frame.{frame:04}.{kind}");
            assert!(read("whole", &file) == read("parts", &file), "{file}");
        }
    }
    let names = std::fs::read_dir(folder.path().join("parts")).expect("a folder");
    let names: Vec<_> = names.map(|e| e.expect("a file").file_name()).collect();
    assert!(!names.iter().any(|n| n.to_string_lossy().contains("partial")), "{names:?}");
}

/// Files with measured times or the name of the folder, and the checksums of those.
const OWN: [&str; 4] = ["stats.json", "review.html", "sequence.otio", "manifest.json"];

/// Names and bytes of a folder, but for what is its own.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path());
    let name = |p: &Path| p.file_name().expect("a name").to_string_lossy().into_owned();
    let files = entries.filter(|p| p.is_file() && !OWN.contains(&name(p).as_str()));
    files.map(|p| (name(&p), std::fs::read(&p).expect("a file"))).collect()
}

#[test]
fn a_folder_has_the_frames_of_its_job_alone_and_chunks_become_one_run() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let heads = [inputs::head(None).expect("the built-in head")];
    let mut studio = Studio::open(None).expect("a device");
    let mut run = |job: &Job, to: &Destination| {
        let plan = Plan::new(job, &heads).expect("a plan");
        run::run(&plan, &mut studio, to, &mut ())
    };
    let to = |name: &str, resume: bool| Destination {
        resume,
        video: false,
        animated_head: false,
        ..Destination::new(at(name))
    };
    let mut long = moving_job(&heads, AntialiasMethod::SmaaT2x);
    long.settings.output.size = [32, 24];
    long.sequence.duration = 0.3;
    long.settings.output.channels = vec![rubor_renderer::channels::Channel::Depth];
    long.seal(&heads).expect("fingerprints");
    run(&long, &to("whole", false)).expect("a run");
    let whole = contents(&at("whole"));

    // A run that is asked to stop finishes the frame at hand.
    let stop = Stop::default();
    stop.ask(2);
    let failure = run(&long, &Destination { stop, ..to("stopped", false) }).expect_err("it stops");
    assert_eq!((failure.exit_code(), at("stopped").exists()), (130, false), "{failure}");

    // The frames of the long job, then a shorter one that stops after its first frame, then the rest of it.
    let mut short = long.clone();
    short.settings.look.exposure = 3.0;
    short.sequence.duration = 0.15;
    let refused = run(&short, &to("whole", true)).expect_err("another job");
    assert!(refused.to_string().contains("another job"), "{refused}");
    assert!(contents(&at("whole")) == whole, "a refused run changes nothing");
    let first = Job { frames: Some("1".parse::<FrameList>().expect("a list")), ..short.clone() };
    let report = run(&first, &to("whole", false)).expect("a run");
    assert!(report.notes.iter().any(|n| n.contains("earlier run were removed")), "{:?}", report.notes);
    std::fs::write(at("whole/.rubor-killed.part.png"), b"half").expect("a leftover");
    assert_eq!(run(&short, &to("whole", true)).expect("a run").frames_drawn, 1);
    run(&short, &to("short", false)).expect("a run");
    assert!(contents(&at("whole")) == contents(&at("short")), "{:?}", contents(&at("whole")).keys());

    // Chunks in any order, one of them twice.
    let template = at("shot.yaml");
    let written = farm::write(&long, &heads, Some(3), &template).expect("a template");
    assert_eq!((written.frames, written.tasks), (4, 2));
    let job = Job::read(&at("shot.json"), None).expect("a job");
    assert_eq!(job, long);
    for frames in ["4", "1-3", "4"] {
        let chunk = Job { frames: Some(frames.parse::<FrameList>().expect("a list")), ..job.clone() };
        run(&chunk, &to(&format!("out/chunks/{frames}"), true)).expect("a chunk");
    }
    let gather = Destination { chunks: Some(at("out/chunks")), ..to("out", true) };
    assert_eq!(run(&job, &gather).expect("a run").frames_drawn, 0);
    assert!(contents(&at("out")) == whole);
    let other =
        run(&short, &Destination { folder: at("none"), ..gather }).expect_err("chunks of another job");
    assert!(other.to_string().contains("another job"), "{other}");
}
