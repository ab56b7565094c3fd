//! What a reviewer gets: the page of a run, the page of two runs, and what they say about bad input.

#[path = "support/ffmpeg.rs"]
mod ffmpeg;
mod support;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use ffmpeg::has_program;
use rubor::review::page::PageData;
use rubor::{Job, Plan};
use support::can_draw;

fn rubor(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rubor")).args(arguments).output().expect("the command starts")
}

fn done(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    said
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// A sequence of some frames at 8 a second.
fn sequence(folder: &Path, frames: u32) -> PathBuf {
    let path = folder.join(format!("s{frames}.json"));
    let duration = f64::from(frames) / 8.0;
    let text = format!(
        r#"{{ "fps": 8, "duration": {duration},
             "expressions": {{ "joy": [{{ "t": 0, "v": 0 }}, {{ "t": 0.25, "v": 1 }}, {{ "t": 0.5, "v": 0.5 }}] }},
             "states": {{ "blush": 0.7 }}, "environment": {{ "name": "studio" }} }}"#
    );
    std::fs::write(&path, text).expect("a sequence");
    path
}

const FAST: &[&str] = &["--preset", "draft", "--shadow-size", "64", "--no-export"];

fn render(sequence: &Path, out: &Path, more: &[&str]) -> String {
    let quiet: &[&str] = if more.contains(&"--burn-in") { &[] } else { &["--no-video"] };
    let size: &[&str] = if more.contains(&"--size") { &[] } else { &["--size", "48x32"] };
    let command = ["render", "--sequence", text(sequence), "-o", text(out)];
    done(&rubor(&[&command[..], FAST, size, quiet, more].concat()))
}

#[test]
fn the_page_of_a_run_shows_its_frames_weights_marks_and_numbers() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("a <b> & \"c\"");
    render(&sequence(folder.path(), 4), &out, &["--inset", "hemoglobin"]);
    let data = PageData::read(&out.join("review.html")).expect("a page");
    assert_eq!((data.title.as_str(), data.fps, data.size), ("a <b> & \"c\"", 8.0, [48, 32]));
    assert_eq!(data.frames, [1, 2, 3, 4]);
    // The weights are those that the frames were drawn with.
    let job = Job::read(&out.join("job.json"), None).expect("a job");
    let heads = job.load_heads().expect("heads");
    let plan = Plan::new(&job, &heads).expect("a plan");
    let curve = |group: &str, name: &str| {
        let curve = data.curves.iter().find(|c| c.group == group && c.name == name);
        &curve.unwrap_or_else(|| panic!("{group} {name}")).values
    };
    assert_eq!(curve("expressions", "joy"), &[0.0, 0.5, 1.0, 0.75].map(Some));
    assert_eq!(curve("states", "blush"), &[0.7; 4].map(Some));
    for frame in 0..4 {
        let face = &plan.shots(frame)[0].face;
        let head = &heads[0].head;
        let same = |found: Option<f64>, expected: f32| {
            found.is_some_and(|found| (found - f64::from(expected)).abs() <= 0.51e-4)
        };
        for (zone, weight) in head.maps.zones.iter().zip(&face.zones) {
            assert!(same(curve("wrinkles", &zone.name)[frame as usize], *weight), "{}", zone.name);
        }
        for (distribution, weight) in head.maps.distributions.iter().zip(&face.distributions) {
            assert!(
                same(curve("blood", &distribution.name)[frame as usize], *weight),
                "{}",
                distribution.name
            );
        }
        assert!(same(curve("blood", "amount of blood")[frame as usize], face.hemoglobin_scale));
    }
    let peaks: Vec<_> =
        data.marks.iter().filter(|m| m.is_peak).map(|m| (&m.name[..], m.frame, m.frames)).collect();
    assert_eq!(peaks, [("blush 0.70", 1, 4), ("joy 1.00", 3, 1)]);
    let inset = data.inset.expect("an inset");
    assert_eq!(inset.name, "hemoglobin");
    let [x, y, w, h] = inset.rect;
    assert!(x + w < 48 && y + h < 32 && w.max(h) == 10, "{:?}", inset.rect);
    assert!(data.settings.iter().any(|(name, value)| name == "quality.shadowSize" && value == "64"));
    assert!(data.cost.seconds.iter().all(Option::is_some));
    let stats = std::fs::read_to_string(out.join("stats.json")).expect("stats.json");
    assert!(stats.contains("\"review.html\""), "the report names the page");
}

#[test]
fn parts_of_a_run_share_a_page_and_notes_stay_with_their_job() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let sequence = sequence(folder.path(), 4);
    let out = folder.path().join("out");
    let page = || PageData::read(&out.join("review.html")).expect("a page");
    render(&sequence, &out, &["--frames", "2"]);
    assert_eq!(page().frames, [2]);
    render(&sequence, &out, &["--frames", "4"]);
    let parts = page();
    assert_eq!(parts.frames, [2, 4]);
    assert_eq!(parts.cost.seconds[0], None, "what another run drew was not measured");
    assert!(parts.cost.seconds[1].is_some());
    render(&sequence, &out, &["--resume"]);
    let whole = page();
    assert_eq!(whole.frames, [1, 2, 3, 4]);
    assert_eq!(whole.id, parts.id, "notes of the parts are notes of the whole");
    // Another job has other notes, and its page replaces this one.
    render(&sequence, &out, &["--exposure", "1"]);
    assert_ne!(page().id, whole.id);
}

#[test]
fn two_runs_share_a_page_and_what_is_unlike_is_said() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    render(&sequence(folder.path(), 4), &at("one"), &[]);
    render(&sequence(folder.path(), 4), &at("two"), &["--exposure", "2.5"]);
    render(&sequence(folder.path(), 2), &at("short"), &["--size", "32x32"]);
    let compare = |a: &str, b: &str, more: &[&str]| {
        rubor(&[&["compare", text(&at(a)), text(&at(b)), "--page", text(&at("page"))][..], more].concat())
    };
    done(&compare("one", "two", &[]));
    let data = PageData::read(&at("page/review.html")).expect("a page");
    let second = data.second.expect("a second run");
    assert_eq!((&data.title[..], &second.title[..]), ("one", "two"));
    assert_eq!((&data.folder[..], &second.folder[..]), ("a/", "b/"));
    for (run, copy) in [("one", "a"), ("two", "b")] {
        for frame in 1..=4 {
            let name = format!("frame.{frame:04}.png");
            let read = |path: PathBuf| std::fs::read(path).expect("a frame");
            assert_eq!(read(at(run).join(&name)), read(at("page").join(copy).join(&name)));
        }
    }
    let flip = &data.curves[0];
    assert_eq!((&flip.group[..], &flip.name[..]), ("difference", "FLIP, mean"));
    assert!(flip.values.iter().all(|v| v.is_some_and(|v| v > 0.001)), "{:?}", flip.values);

    // Another size and length; the frames of the page before are gone.
    let said = done(&compare("one", "short", &["--json"]));
    for phrase in ["found 32x32 pixels, expected 48x32", "partners of 2 of the 4 frames"] {
        assert!(said.contains(phrase), "{said}");
    }
    assert!(!at("page/b/frame.0003.png").exists());
    assert!(at("page/b/frame.0002.png").exists());

    let own = rubor(&["compare", text(&at("one")), text(&at("two")), "--page", text(&at("one"))]);
    assert_eq!(own.status.code(), Some(2), "the page of a run is not replaced");

    // A lost frame and a broken one do not hide the others.
    std::fs::remove_file(at("two/frame.0001.png")).expect("a frame");
    std::fs::write(at("two/frame.0002.png"), b"half").expect("a frame");
    let output = compare("one", "two", &["--json"]);
    let said = done(&output);
    for phrase in ["no picture of 1 of 4 frames; the first is 1", "frame.0001.png", "frame.0002.png"] {
        assert!(said.contains(phrase), "{said}");
    }
    let rows: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(rows.as_array().map(Vec::len), Some(2));
    assert_eq!(compare("one", "two", &["--most", "0.0001"]).status.code(), Some(1));

    // No page, no job: the frames alone are compared.
    std::fs::remove_file(at("one/review.html")).expect("a page");
    let said = done(&compare("one", "two", &[]));
    assert!(said.contains("weights and settings are unknown"), "{said}");
    assert_eq!(PageData::read(&at("page/review.html")).expect("a page").fps, 8.0);
    std::fs::remove_file(at("one/job.json")).expect("a job");
    assert!(done(&compare("one", "two", &[])).contains("24 frames a second are assumed"));

    for (wrong, phrase) in [("nowhere", "no such folder"), ("s2.json", "a file"), ("page", "found no frames")]
    {
        let output = compare("one", wrong, &[]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(phrase), "{said}");
    }
}

/// The channels of an OpenEXR file of one part, by name.
fn layers(path: &Path) -> std::collections::BTreeMap<String, exr::prelude::FlatSamples> {
    let read = exr::prelude::read_all_flat_layers_from_file(path).unwrap_or_else(|e| panic!("{path:?}: {e}"));
    assert_eq!(read.layer_data.len(), 1);
    let channels = read.layer_data.into_iter().flat_map(|layer| layer.channel_data.list);
    channels.map(|channel| (channel.name.to_string(), channel.sample_data)).collect()
}

#[test]
fn frames_have_their_layers_in_one_file_that_adds_up() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let sequence = sequence(folder.path(), 3);
    let out = folder.path().join("out");
    let exr = ["--format", "exr", "--size", "96x64"];
    render(&sequence, &out, &exr);
    let file = |n: u32| out.join(format!("frame.{n:04}.exr"));
    let all = layers(&file(2));
    let floats = |name: &str| -> Vec<f32> {
        let samples = all.get(name).unwrap_or_else(|| panic!("no {name} in {:?}", all.keys()));
        samples.values_as_f32().collect()
    };
    let bits = |name: &str| match &all[name] {
        exr::prelude::FlatSamples::U32(values) => values.clone(),
        other => panic!("{name}: {other:?}"),
    };
    let (skin, part, head, depth) = (floats("mask.skin"), bits("id.part"), bits("id.head"), floats("Z"));
    let count = 96 * 64;
    assert!(all.values().all(|samples| samples.len() == count));
    let shown = (0..count).filter(|i| part[*i] != 0).count();
    assert!(shown > count / 8, "{shown} pixels of the head");
    for i in 0..count {
        assert_eq!(skin[i], f32::from(u8::from(part[i] == 1)), "pixel {i}");
        assert_eq!(head[i] == 0, part[i] == 0, "pixel {i}");
        // Half a metre to a few metres from the camera, or nothing.
        assert!(
            if part[i] == 0 { depth[i].is_infinite() } else { depth[i] > 0.3 && depth[i] < 5.0 },
            "{}",
            depth[i]
        );
    }
    // Beauty is diffuse light times albedo, and specular, under hair and lashes.
    let covered = floats("hair.A");
    assert!(covered.iter().any(|a| *a > 0.5) && covered.iter().all(|a| (0.0..=1.001).contains(a)));
    for component in ["R", "G", "B"] {
        let of = |layer: &str| floats(&format!("{layer}{component}"));
        let (beauty, diffuse, albedo, specular) = (of(""), of("diffuse."), of("albedo."), of("specular."));
        let hair = of("hair.");
        // Half floats are cut to 11 bits once for every hair that lies over a pixel; fifty may.
        for i in (0..count).filter(|i| part[*i] != 0) {
            let sum = (diffuse[i] * albedo[i] + specular[i]) * (1.0 - covered[i]) + hair[i];
            let error = (sum - beauty[i]).abs();
            let share = if covered[i] > 0.0 { 0.025 } else { 4e-3 };
            let bound = share * sum.abs().max(beauty[i]) + 1e-4;
            let what = format!("{component} of pixel {i}, covered by {}", covered[i]);
            assert!(error <= bound, "{what}: {sum} in parts, {} in all", beauty[i]);
        }
        let of_skin: Vec<usize> = (0..count).filter(|i| skin[*i] == 1.0).collect();
        let (before, through) = (of("irradiance."), of("transmittance."));
        assert!(through.iter().zip(&before).all(|(part, all)| *part <= all + 1e-3 * all.abs() + 1e-4));
        assert!(of_skin.iter().any(|i| (before[*i] - diffuse[*i]).abs() > 0.01), "light scatters");
    }
    let normals = ["N.X", "N.Y", "N.Z"].map(floats);
    for i in (0..count).filter(|i| part[*i] != 0) {
        let length: f32 = normals.iter().map(|n| n[i] * n[i]).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 2e-3, "pixel {i}: a normal of length {length}");
    }
    let hemoglobin = floats("chromophores.hemoglobin");
    let of_skin =
        (0..count).filter(|i| skin[*i] == 1.0 && hemoglobin[*i] > 0.001 && hemoglobin[*i] < 0.32).count();
    assert!(of_skin * 10 > 9 * skin.iter().filter(|v| **v == 1.0).count(), "{of_skin} pixels have blood");
    let velocity = floats("velocity.Y");
    assert!(velocity.iter().any(|v| v.abs() > 0.05), "joy moves the face");

    // Motion of a frame that is drawn alone is that of the whole run; a lost file is drawn again.
    let alone = folder.path().join("alone");
    render(&sequence, &alone, &[&exr[..], &["--frames", "2"]].concat());
    let whole = std::fs::read(file(2)).expect("layers");
    assert!(std::fs::read(alone.join("frame.0002.exr")).expect("layers") == whole);
    std::fs::remove_file(file(2)).expect("layers");
    render(&sequence, &out, &[&exr[..], &["--resume"]].concat());
    assert!(std::fs::read(file(2)).expect("layers") == whole);
    // Without the format, the files of the run before go.
    render(&sequence, &out, &[]);
    assert!(!file(2).exists());
}

#[test]
fn a_manifest_and_a_timeline_stand_beside_the_frames() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("shot");
    render(&sequence(folder.path(), 4), &out, &[]);
    let read = |name: &str| -> serde_json::Value {
        let text = std::fs::read(out.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        serde_json::from_slice(&text).unwrap_or_else(|e| panic!("{name}: {e}"))
    };
    let manifest = read("manifest.json");
    let listed: Vec<&str> =
        manifest["files"].as_array().expect("files").iter().filter_map(|f| f["file"].as_str()).collect();
    let mut names: Vec<String> = std::fs::read_dir(&out)
        .expect("the folder")
        .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
        .filter(|name| name != "manifest.json")
        .collect();
    names.sort();
    assert_eq!(listed, names);
    for entry in manifest["files"].as_array().expect("files") {
        let path = out.join(entry["file"].as_str().expect("a name"));
        let length = std::fs::metadata(&path).expect("a file").len();
        assert_eq!(entry["bytes"], length, "{path:?}");
        assert_eq!(entry["sha256"].as_str().map(str::len), Some(64));
    }
    let timeline = read("sequence.otio");
    let clip = &timeline["tracks"]["children"][0]["children"][0];
    assert_eq!(clip["name"], "shot");
    let markers: Vec<_> =
        clip["markers"].as_array().expect("markers").iter().map(|m| m["name"].clone()).collect();
    assert_eq!(markers, ["blush 0.70", "joy 0.00", "joy 1.00"]);
    assert!(clip["media_references"]["video"].is_null(), "no video was made");
    let report = read("stats.json");
    for name in ["review.html", "sequence.otio", "manifest.json"] {
        assert!(report["files"].as_array().expect("files").iter().any(|f| f == name), "{name}");
    }
}

/// What ffprobe says of the stream and the file of a video.
fn probe(path: &Path) -> String {
    let entries = "stream=codec_name,pix_fmt,width,height,color_range,color_space,color_transfer,color_primaries,                   nb_frames,r_frame_rate";
    let arguments = ["-v", "error", "-show_entries", entries, "-of", "default=nw=1", text(path)];
    let output = Command::new("ffprobe").args(arguments).output().expect("ffprobe starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn videos_say_what_their_colours_are_and_play_while_they_load() {
    if !can_draw() || !has_program("ffmpeg") || !has_program("ffprobe") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let sequence = sequence(folder.path(), 4);
    // An odd width; a folder with signs that ffmpeg has a meaning for.
    let one = at("100 %d: one");
    render(&sequence, &one, &["--burn-in", "--size", "97x64"]);
    let said = probe(&one.join("video.mp4"));
    for tag in [
        "codec_name=h264",
        "width=98",
        "height=64",
        "pix_fmt=yuv420p",
        "color_range=tv",
        "color_space=bt709",
        "color_transfer=iec61966-2-1",
        "color_primaries=bt709",
        "r_frame_rate=8/1",
        "nb_frames=4",
    ] {
        assert!(said.contains(tag), "expected {tag}: {said}");
    }
    let bytes = std::fs::read(one.join("video.mp4")).expect("a video");
    let place = |name: &[u8]| bytes.windows(4).position(|w| w == name);
    assert!(place(b"moov") < place(b"mdat"), "the index comes first");
    // The words are on the video, not on the frames.
    let first = |video: &Path, to: &Path| {
        let arguments = ["-v", "error", "-y", "-i", text(video), "-frames:v", "1", text(to)];
        assert!(Command::new("ffmpeg").args(arguments).status().expect("ffmpeg starts").success());
        image::open(to).expect("a picture").into_rgb8()
    };
    let burnt = first(&one.join("video.mp4"), &at("first.png"));
    let frame = image::open(one.join("frame.0001.png")).expect("a frame").into_rgb8();
    let apart = |rows: std::ops::Range<u32>| {
        let places = rows.flat_map(|y| (0..97).map(move |x| (x, y)));
        places.map(|(x, y)| burnt.get_pixel(x, y).0[1].abs_diff(frame.get_pixel(x, y).0[1])).max()
    };
    assert!(apart(8..16) > Some(100), "no words: {:?}", apart(8..16));
    assert!(apart(40..64) < Some(30), "the rest is the frame: {:?}", apart(40..64));
    let page = PageData::read(&one.join("review.html")).expect("a page");
    assert!(page.files.iter().any(|file| file == Path::new("video.mp4")));
    let timeline = std::fs::read_to_string(one.join("sequence.otio")).expect("a timeline");
    assert!(timeline.contains("\"target_url\": \"video.mp4\""));

    // Two runs in one video.
    render(&sequence, &at("two"), &["--exposure", "2.5", "--size", "97x64"]);
    for (layout, width) in [("side-by-side", 194), ("wipe", 98), ("difference", 98)] {
        let film = at(&format!("{layout}.mp4"));
        let two = at("two");
        let command = ["compare", text(&one), text(&two), "--video", text(&film), "--layout", layout];
        done(&rubor(&command));
        let said = probe(&film);
        assert!(
            said.contains(&format!("width={width}\n")) && said.contains("nb_frames=4"),
            "{layout}: {said}"
        );
    }
    // Frames that cannot be read, other sizes, a place where nothing can be written: said, and no half video is left.
    let film = at("none.mp4");
    let compare = |b: &str| rubor(&["compare", text(&one), text(&at(b)), "--video", text(&film)]);
    render(&sequence, &at("small"), &[]);
    let refused = |output: Output, code: i32, phrase: &str| {
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(code) && said.contains(phrase), "{said}");
        assert!(!film.exists());
    };
    refused(compare("small"), 2, "a video needs one size");
    std::fs::write(at("two/frame.0003.png"), b"half").expect("a broken frame");
    refused(compare("two"), 2, "frame.0003.png");
    let nowhere = at("two/frame.0001.png/a.mp4");
    let output = rubor(&["compare", text(&one), text(&one), "--video", text(&nowhere)]);
    refused(output, 1, "cannot be written");
    let left: Vec<_> = std::fs::read_dir(folder.path())
        .expect("a folder")
        .map(|e| e.expect("an entry").file_name())
        .collect();
    assert!(!left.iter().any(|name| name.to_string_lossy().contains(".part")), "{left:?}");
}
