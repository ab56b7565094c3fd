//! The command as a person uses it: its results, and its messages on wrong input.

mod support;

use std::path::Path;
use std::process::{Command, Output};

use rubor_assets::image_io::{SampleKind, save_image};
use rubor_rig::map::Map;
use support::can_draw;

fn rubor(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rubor")).args(arguments).output().expect("the command starts")
}

/// A fresh folder that is removed when the test ends.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    fn file(&self, name: &str, content: &[u8]) -> String {
        let path = self.0.path().join(name);
        std::fs::write(&path, content).expect("a temporary file");
        text(&path)
    }

    fn path(&self, name: &str) -> String {
        text(&self.0.path().join(name))
    }

    fn names(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path().join(folder)).into_iter().flatten().flatten();
        let mut names: Vec<_> = entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// The command must refuse: exit code 2, every phrase in one message, and nothing in the output folder.
fn refused(folder: &Folder, arguments: &[&str], phrases: &[&str]) {
    let out = folder.path("out");
    let mut all = arguments.to_vec();
    if arguments.first() == Some(&"render") {
        all.extend(["-o", &out]);
    }
    let output = rubor(&all);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?} said {said}");
    for phrase in phrases {
        assert!(said.contains(phrase), "{arguments:?} said {said:?}, expected {phrase:?}");
    }
    assert!(!Path::new(&out).exists(), "{arguments:?} left {:?}", folder.names("out"));
}

const STILL: &str =
    r#"{ "fps": 2, "duration": 1, "expressions": { "joy": 1 }, "environment": { "name": "studio" } }"#;

#[test]
fn a_small_job_makes_everything_and_resumes() {
    if !can_draw() {
        return;
    }
    let folder = Folder::new();
    let sequence = folder.file("s.json", STILL.as_bytes());
    let out = folder.path("out");
    let job = [
        "render",
        "--sequence",
        &sequence,
        "-o",
        &out,
        "--size",
        "64x48",
        "--antialias",
        "smaa-1x",
        "--json",
    ];
    let first = rubor(&job);
    assert!(first.status.success(), "{}", String::from_utf8_lossy(&first.stderr));
    let stats: serde_json::Value = serde_json::from_slice(&first.stdout).expect("statistics are JSON");
    assert_eq!((&stats["of"], &stats["framesDrawn"]), (&"job".into(), &2.into()));
    assert_eq!(stats["settings"]["quality"]["antialias"], "smaa-1x");
    let kept = std::fs::read(folder.0.path().join("out/stats.json")).expect("stats.json");
    let kept: rubor::Report = serde_json::from_slice(&kept).expect("stats.json is a report");
    assert_eq!(serde_json::to_value(&kept).expect("JSON")["files"], stats["files"]);
    assert!(stats["triangles"].as_u64().is_some_and(|n| n > 10_000));
    let at_work = &stats["utilisation"];
    for what in ["evaluate", "record", "read", "encode", "write", "idle"] {
        assert!(
            at_work[what].as_f64().is_some_and(|share| (0.0..=1.0).contains(&share)),
            "{what}: {at_work}"
        );
    }
    assert!(at_work["seconds"].as_f64().is_some_and(|s| s > 0.0) && at_work["encode"].as_f64() > Some(0.0));
    let names = folder.names("out");
    for expected in [
        "animated_head.glb",
        "contact_sheet.png",
        "frame.0001.png",
        "frame.0002.png",
        "job.json",
        "stats.json",
    ] {
        assert!(names.iter().any(|n| n == expected), "{names:?} lacks {expected}");
    }
    assert!(!names.iter().any(|n| n.contains("partial")), "{names:?}");

    // One frame is lost, the other half written by a killed run: both are drawn again, with the same bytes.
    let frame = |n: u32| folder.0.path().join(format!("out/frame.{n:04}.png"));
    let whole = std::fs::read(frame(1)).expect("frame 1");
    std::fs::write(frame(1), &whole[..whole.len() / 2]).expect("cut");
    let again = rubor(&[&job[..], &["--resume"]].concat());
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    let stats: serde_json::Value = serde_json::from_slice(&again.stdout).expect("statistics are JSON");
    assert_eq!(stats["framesDrawn"], 1);
    assert_eq!(std::fs::read(frame(1)).expect("frame 1"), whole);

    // Another job does not resume into these frames.
    let other = rubor(&[&job[..], &["--resume", "--exposure", "3"]].concat());
    assert_eq!(other.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&other.stderr).contains("another job"));

    // The animated head is a head again.
    let reread = rubor(&["import", &folder.path("out/animated_head.glb"), "-o", &folder.path("again.glb")]);
    assert!(reread.status.success(), "{}", String::from_utf8_lossy(&reread.stderr));
    assert!(String::from_utf8_lossy(&reread.stdout).contains("52 shapes"));
}

#[test]
fn wrong_files_get_one_clear_message() {
    let folder = Folder::new();
    let missing = folder.path("nothing.glb");
    refused(&folder, &["render", "--head", &missing], &["nothing.glb", "no such file"]);
    let is_folder = text(folder.0.path());
    refused(&folder, &["render", "--head", &is_folder], &["a folder", "expected a head"]);
    let head = include_bytes!("../../assets/head.glb");
    let cut = folder.file("cut.glb", &head[..100_000]);
    refused(&folder, &["render", "--head", &cut], &["cut.glb"]);
    let empty = folder.file("empty.glb", b"");
    refused(&folder, &["render", "--head", &empty], &["empty.glb"]);

    let typo = folder.file("typo.json", STILL.replace("joy", "jjoy").as_bytes());
    refused(&folder, &["render", "--sequence", &typo], &["typo.json:1:", "jjoy", "did you mean \"joy\""]);
    let field = folder.file("field.json", STILL.replace("\"fps\"", "\"fpss\"").as_bytes());
    refused(&folder, &["render", "--sequence", &field], &["field.json:1:3", "fpss", "fps"]);
    let zero = folder.file("zero.json", STILL.replace("\"duration\": 1", "\"duration\": 0").as_bytes());
    refused(&folder, &["render", "--sequence", &zero], &["zero.json:1:25", "found 0", "a length in seconds"]);
    let shape = r#"{ "expressions": { "joy": { "shapes": { "mouthSmileLef": 1 } } } }"#;
    let shape = folder.file("rig.json", shape.as_bytes());
    refused(&folder, &["render", "--rig", &shape], &["rig.json:1:", "mouthSmileLef", "mouthSmileLeft"]);
    let sum = r#"{ "expressions": { "joy": { "hemoglobin": { "joy": 0.8, "anger": 0.7 } } } }"#;
    let sum = folder.file("sum.json", sum.as_bytes());
    refused(&folder, &["render", "--rig", &sum], &["sum.json:1:", "1.5"]);
    let nowhere = folder.file("nowhere.json", STILL.replace("studio", "stdio").as_bytes());
    if can_draw() {
        refused(&folder, &["render", "--sequence", &nowhere], &["stdio", "studio"]);
    }
}

#[test]
fn wrong_arguments_get_one_clear_message() {
    let folder = Folder::new();
    refused(&folder, &["render", "--size", "0x64"], &["0x64"]);
    refused(&folder, &["render", "--size", "wide"], &["WIDTHxHEIGHT"]);
    refused(&folder, &["render", "--scatter", "separable:16"], &["separable:16"]);
    refused(&folder, &["render", "--antialias", "smaa"], &["smaa-1x"]);
    refused(&folder, &["render", "--frames", "9999"], &["9999", "at most"]);
    refused(&folder, &["import", "no/such/folder", "-o", "x.glb"], &["no/such/folder"]);
    if can_draw() {
        refused(&folder, &["render", "--size", "100000x100000"], &["100000x100000"]);
        refused(&folder, &["render", "--adapter", "abacus"], &["abacus", "there are"]);
    }
    let file = folder.file("file", b"");
    let inside = format!("{file}/frames");
    let output = rubor(&["render", "-o", &inside]);
    if can_draw() {
        assert_eq!(output.status.code(), Some(1), "a folder inside a file cannot be made");
    }
}

#[test]
fn obj_sets_of_unequal_size_and_broken_numbers_are_refused() {
    let folder = Folder::new();
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let import = |folder: &Folder, phrases: &[&str]| {
        let (set, out) = (folder.path("set"), folder.path("head.glb"));
        refused(folder, &["import", &set, "-o", &out], phrases);
        assert!(!Path::new(&out).exists());
    };
    std::fs::create_dir(folder.0.path().join("set")).expect("a folder");
    folder.file("set/neutral.obj", triangle.as_bytes());
    folder.file("set/smile.obj", format!("v 2 2 2\n{triangle}").as_bytes());
    import(&folder, &["smile.obj", "4", "3"]);
    folder.file("set/smile.obj", triangle.replace("v 1 0 0", "v NaN 0 0").as_bytes());
    import(&folder, &["smile.obj", "line 2", "NaN"]);
    folder.file("set/smile.obj", b"");
    import(&folder, &["smile.obj"]);
}

/// A head that is quick to write: two triangles, a shape, no maps.
fn small_head(folder: &Folder) -> String {
    let vertices = "v 0 0 0\nv 20 0 0\nv 20 25 0\nv 0 25 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    let faces = "usemtl skin\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";
    std::fs::create_dir_all(folder.0.path().join("set")).expect("a folder");
    folder.file("set/neutral.obj", format!("{vertices}{faces}").as_bytes());
    folder.file("set/jawOpen.obj", format!("{vertices}{faces}").replace("v 0 0 0", "v 0 -2 0").as_bytes());
    let (set, head) = (folder.path("set"), folder.path("small.glb"));
    let output = rubor(&["import", &set, "--maps", "0", "-o", &head]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    head
}

const JAW: &str = r#"{ "fps": 24, "duration": 1, "shapes": { "jawOpen": [{ "t": 0, "v": 0, "ease": "smooth" }, { "t": 1, "v": 1 }] } }"#;

#[test]
fn a_head_goes_out_and_comes_back_with_its_performance() {
    let folder = Folder::new();
    let head = small_head(&folder);
    let sequence = folder.file("s.json", JAW.as_bytes());
    let json = |arguments: &[&str]| -> serde_json::Value {
        let output = rubor(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).expect("a report is JSON")
    };
    let glb = folder.path("out.glb");
    let report = json(&["export", "--head", &head, "--sequence", &sequence, "-o", &glb, "--json"]);
    assert_eq!((&report["shapes"], &report["points"]), (&1.into(), &4.into()));
    let back = folder.path("back.json");
    let output =
        rubor(&["import", &glb, "--sequence", &back, "--maps", "0", "-o", &folder.path("again.glb")]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read: serde_json::Value =
        serde_json::from_slice(&std::fs::read(&back).expect("a sequence")).expect("JSON");
    assert_eq!(read["shapes"]["jawOpen"][0]["ease"], "smooth");

    let usd = folder.path("out.usda");
    json(&["export", "--head", &glb, "-o", &usd, "--json"]);
    let text = std::fs::read_to_string(&usd).expect("a layer");
    assert!(text.starts_with("#usda 1.0") && text.contains("blendShapeWeights.timeSamples"));
    // Results are beside the file, and no partial file remains.
    let names = folder.names("");
    assert!(!names.iter().any(|n| n.contains("part")), "{names:?}");

    refused(&folder, &["export", "--head", &head, "-o", &folder.path("x.fbx")], &[".glb, .usda or .usdz"]);
    refused(&folder, &["export", "--textures", "ktx2", "-o", &glb], &["Basis Universal"]);
    refused(&folder, &["export", "--head", &head, "--bake", "jooy", "-o", &glb], &["jooy", "\"joy\""]);
    refused(
        &folder,
        &["export", "--head", &head, "--still", "--bake", "0.5", "-o", &glb],
        &["needs a sequence"],
    );
    refused(
        &folder,
        &["export", "--head", &head, "--sequence", &sequence, "--bake", "7", "-o", &glb],
        &["0 to 1 s"],
    );
    refused(&folder, &["export", "--head", &head, "--tolerance", "2", "-o", &glb], &["0.5"]);
    refused(&folder, &["export", "--head", &head, "--textures", "webp", "-o", &usd], &["png or jpeg"]);
    let nowhere = rubor(&["export", "--head", &head, "-o", &folder.path("no/such/folder/x.glb")]);
    assert_eq!(nowhere.status.code(), Some(1), "what cannot be written is no wrong input");
    assert!(String::from_utf8_lossy(&nowhere.stderr).contains("x.glb"));
}

#[test]
fn check_gives_reasons_fixes_and_exit_codes() {
    let folder = Folder::new();
    let head = small_head(&folder);
    let good = folder.file("s.json", JAW.as_bytes());
    let check = |arguments: &[&str], code: i32| -> String {
        let output = rubor(&[&["check"], arguments].concat());
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(output.status.code(), Some(code), "{arguments:?} said {said}");
        said
    };
    let said = check(&[&head, &good], 0);
    assert!(said.contains("small.glb: glTF") && said.contains("s.json: sequence"), "{said}");
    let late = folder.file("late.json", JAW.replace("\"t\": 1,", "\"t\": 3,").as_bytes());
    assert!(check(&[&head, &late], 0).contains("has keys after the end"));
    check(&["--strict", &head, &late], 2);
    let typo = folder.file("typo.json", JAW.replace("jawOpen", "jawOpne").as_bytes());
    let said = check(&[&head, &typo], 2);
    assert!(said.contains("line 1") && said.contains("fix: write \"jawOpen\""), "{said}");
    let take = folder.file("take.csv", b"Timecode,JawOpen,Wobble\n0:0:0:0,0,1\n0:0:1:0,1,0\n0:0:2:0,0,1\n");
    let said = check(&[&head, &take], 0);
    assert!(said.contains("column \"Wobble\"") && said.contains("51 ARKit columns are missing"), "{said}");
    let retarget = folder.file("actor.json", br#"{ "shapes": { "Wobble": "jawOpen", "Nope": null } }"#);
    let said = check(&[&head, &take, &retarget], 0);
    assert!(!said.contains("\"Wobble\": no shape") && said.contains("\"Nope\""), "{said}");
    let report: serde_json::Value = serde_json::from_str(&check(&["--json", &head, &take], 0)).expect("JSON");
    assert_eq!(report["files"][1]["kind"], "capture");
    let findings = report["files"][1]["findings"].as_array().expect("a list");
    assert!(findings.iter().any(|f| f["at"] == "column \"Wobble\"" && f["fix"].is_string()), "{report}");
    check(&[&folder.path("nothing.glb")], 2);
    check(&[&folder.file("x.txt", b"")], 2);
}

#[test]
fn files_that_cannot_be_trusted_are_refused_and_nothing_is_written() {
    let folder = Folder::new();
    let out = folder.path("out.glb");
    let import = |name: &str, content: &str, phrases: &[&str]| {
        let file = folder.file(name, content.as_bytes());
        let before = folder.names("");
        let arguments: Vec<&str> = match name.rsplit('.').next() {
            Some("ma") => vec!["maya", "import", &file, "-o", &out],
            Some("csv") => vec!["import", "capture", &file, "-o", &out],
            _ => vec!["import", &file, "--maps", "0", "-o", &out],
        };
        refused(&folder, &arguments, phrases);
        assert_eq!(folder.names(""), before, "{name}");
    };
    let gltf = |buffer: &str, nodes: &str, accessor: &str| {
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": {nodes},
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
            "accessors": [{{"bufferView": 0, "componentType": 5126, "count": {accessor}, "type": "VEC3", "min": [0,0,0], "max": [1,1,1]}}],
            "bufferViews": [{{"buffer": 0, "byteLength": 36}}], "buffers": [{{"byteLength": 36, "uri": "{buffer}"}}]}}"#
        )
    };
    let zeros = "data:;base64,AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA";
    import("up.gltf", &gltf("../secret.bin", r#"[{"mesh": 0}]"#, "3"), &["secret.bin", "in the folder"]);
    import("host.gltf", &gltf("http://example.org/x.bin", r#"[{"mesh": 0}]"#, "3"), &["in the folder"]);
    import(
        "ring.gltf",
        &gltf(zeros, r#"[{"mesh": 0, "children": [1]}, {"children": [0]}]"#, "3"),
        &["node 0", "a tree"],
    );
    import("far.gltf", &gltf(zeros, r#"[{"mesh": 0}]"#, "400"), &["POSITION", "view 0 of 36 bytes"]);
    import("none.gltf", &gltf(zeros, r#"[{"mesh": 7}]"#, "3"), &["nodes[0].mesh"]);
    import("broken.gltf", "{\"asset\"", &["broken.gltf"]);
    import(
        "needs.ma",
        "//Maya ASCII 2024 scene\nrequires \"weta\" \"1\";\ncreateNode skinCluster -n \"s\";\n",
        &["needs.ma"],
    );
    import(
        "cut.ma",
        "//Maya ASCII 2024 scene\ncreateNode mesh -n \"a\";\n\tsetAttr \".vt[0:9]\" 0 0",
        &["cut.ma:"],
    );
    import("text.csv", "Timecode,JawOpen\n0:0:0:0,0.1\n0:0:1:0,wide\n", &["text.csv", "line 3", "wide"]);
    import("empty.csv", "Timecode,JawOpen\n", &["empty.csv"]);
    import("columns.csv", "a,b\n1,2\n", &["columns.csv"]);
    // Columns in another order, some missing: read, and named.
    let take = folder
        .file("order.csv", b"JawOpen,Timecode,EyeBlinkLeft\n0.1,0:0:0:0,0\n0.2,0:0:1:0,1\n0.3,0:0:2:0,0\n");
    let output = rubor(&["import", "capture", &take, "-o", &folder.path("order.json")]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(rubor(&["check", &take]).stdout.windows(21).any(|w| w == b"50 ARKit columns are "));
}

#[test]
fn schemas_and_adapters_are_json() {
    for of in ["job", "settings", "rig", "sequence", "report"] {
        let output = rubor(&["schema", of]);
        let schema: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a schema is JSON");
        assert!(schema["properties"].is_object() || schema["oneOf"].is_array(), "{of}");
    }
    let output = rubor(&["adapters", "--json"]);
    let list: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a list is JSON");
    assert!(list.is_array());
}

#[test]
fn a_job_that_was_written_draws_the_same_bytes() {
    if !can_draw() {
        return;
    }
    let folder = Folder::new();
    let sequence = folder.file("s.json", JAW.replace("24", "2").as_bytes());
    let light =
        folder.file("light.json", br#"{ "fps": 1, "duration": 1, "environment": { "name": "here.exr" } }"#);
    let sky = Map { width: 8, height: 4, channels: 3, values: (0..96).map(|i| 0.02 * i as f32).collect() };
    save_image(&folder.0.path().join("here.exr"), &sky, SampleKind::F32).expect("an environment");
    let head = small_head(&folder);
    let (out, again) = (folder.path("first"), folder.path("again"));
    let short = ["--no-export", "--no-video"];
    let settings = ["--size", "48x32", "--antialias", "smaa-t2x", "--exposure", "2.3", "--shadow-size", "64"];
    let first = ["render", "--head", &head, "--sequence", &sequence, "--lights", &light, "-o", &out];
    let done =
        |output: Output| assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    done(rubor(&[&first[..], &settings, &short].concat()));
    let job = folder.path("first/job.json");
    let command = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rubor"));
        // Another folder: paths in the job do not depend on it.
        command.current_dir("/").args(arguments).output().expect("the command starts")
    };
    done(command(&[&["render", "--job", &job, "-o", &again][..], &short].concat()));
    for file in ["frame.0001.png", "frame.0002.png", "contact_sheet.png", "job.json"] {
        let [a, b] = [&out, &again].map(|f| std::fs::read(Path::new(f).join(file)).expect("a result"));
        assert!(a == b, "{file}");
    }
    // Frames of two processes, one of them the last frame alone.
    let parts = folder.path("parts");
    let part =
        |frame: &str| command(&["render", "--job", &job, "-o", &parts, "--no-export", "--frames", frame]);
    done(part("2"));
    done(part("1"));
    for file in ["frame.0001.png", "frame.0002.png"] {
        let [a, b] = [&out, &parts].map(|f| std::fs::read(Path::new(f).join(file)).expect("a frame"));
        assert!(a == b, "{file}");
    }
    // Flags change what they name, and nothing else.
    let other = folder.path("other");
    done(command(&[&["render", "--job", &job, "-o", &other, "--size", "32x32"][..], &short].concat()));
    let changed: serde_json::Value =
        serde_json::from_slice(&std::fs::read(Path::new(&other).join("job.json")).expect("a job"))
            .expect("JSON");
    assert_eq!(changed["settings"]["output"]["size"], serde_json::json!([32, 32]));
    assert_eq!(changed["settings"]["quality"]["antialias"], "smaa-t2x");
    let idle = command(
        &[&["render", "--job", &job, "-o", &other, "--preset", "draft", "--frames", "1"][..], &short]
            .concat(),
    );
    assert!(String::from_utf8_lossy(&idle.stderr).contains("--preset has no effect"));

    refused(&folder, &["render", "--job", &job, "--head", &head], &["--job", "--head"]);
    refused(&folder, &["render", "--job", &folder.path("none.json")], &["none.json", "no such file"]);
    let text = std::fs::read_to_string(&job).expect("a job");
    let slip = folder.file("slip.json", text.replace("\"scatter\"", "\"scater\"").as_bytes());
    refused(&folder, &["render", "--job", &slip], &["slip.json:", "scater", "scatter"]);
    save_image(&folder.0.path().join("here.exr"), &Map { values: vec![1.0; 96], ..sky }, SampleKind::F32)
        .expect("another");
    refused(&folder, &["render", "--job", &job], &["here.exr", "changed", "hint"]);
    std::fs::copy(folder.path("small.glb"), folder.path("kept.glb")).expect("a copy");
    folder.file("small.glb", include_bytes!("../../assets/head.glb"));
    refused(&folder, &["render", "--job", &job], &["small.glb", "changed", "hint"]);
}

#[test]
fn closed_pipes_end_quietly() {
    let folder = Folder::new();
    let file = folder.file("s.json", JAW.as_bytes());
    for arguments in [&["schema", "sequence"][..], &["check", &file], &["profile"]] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rubor"));
        let mut child = command
            .args(arguments)
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .expect("the command starts");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("the command ends");
        assert_eq!(String::from_utf8_lossy(&output.stderr), "", "{arguments:?}");
        assert!(output.status.success(), "{arguments:?}");
    }
}

#[test]
fn a_machine_without_a_desktop_is_no_error() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rubor"));
    command.arg("adapters").env_remove("NODEVICE_SELECT").env_remove("XDG_RUNTIME_DIR");
    let said = String::from_utf8_lossy(&command.output().expect("the command starts").stderr).into_owned();
    assert!(!said.contains("XDG_RUNTIME_DIR"), "{said}");
}

#[test]
fn notes_of_one_kind_are_one_line() {
    let folder = Folder::new();
    let head = small_head(&folder);
    let output = rubor(&["check", &head, &folder.file("s.json", LACKING.as_bytes())]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let lines = said.lines().filter(|l| l.contains("has no shape")).count();
    assert!(lines == 2 && said.contains("(4 times)"), "one line for the rig, one for the sequence: {said}");
    if !can_draw() {
        return;
    }
    let sequence = folder.path("s.json");
    let short = ["--size", "16x16", "--frames", "1", "--no-export", "-o", &folder.path("out")];
    let output = rubor(&[&["render", "--head", &head, "--sequence", &sequence][..], &short].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let lines: Vec<_> = said.lines().filter(|l| l.contains("the head has no shape \"")).collect();
    assert!(output.status.success() && lines.len() == 1, "{said}");
}

#[test]
fn what_readers_of_heads_say_is_printed() {
    let folder = Folder::new();
    let out = folder.path("head.glb");
    let import = |from: &str| {
        let output = rubor(&["import", from, "-o", &out, "--maps", "0"]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        said
    };
    std::fs::create_dir(folder.0.path().join("set")).expect("a folder");
    let points = "v 0 0 0\nv 20 0 0\nv 0 25 0\n";
    folder.file("set/neutral.obj", format!("{points}f 1 2 3\n").as_bytes());
    folder.file("set/smile.obj", b"v 0 0 0\nv 20 1 0\nv 0 25 0\n");
    let said = import(&folder.path("set"));
    assert!(said.contains("note: ") && said.contains("the order of points alone: smile.obj"), "{said}");
    // Positions (0, 0, 0), (1, 0, 0), (0, 1, 0) as floats; two targets of one name.
    let gltf = folder.file(
        "twice.gltf",
        br#"{ "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "extras": { "targetNames": ["smile", "smile"] }, "primitives": [
            { "attributes": { "POSITION": 0 }, "targets": [{ "POSITION": 0 }, { "POSITION": 1 }] }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
            { "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [0, 0, 0] }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "buffers": [{ "byteLength": 36,
            "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA" }] }"#,
    );
    let said = import(&gltf);
    assert!(said.contains("note: ") && said.contains("smile_1"), "{said}");
}

const LACKING: &str = r#"{ "fps": 1, "duration": 1, "shapes": { "mouthSmileLeft": 1, "mouthSmileRight": 1, "browInnerUp": 1, "tongueOut": 1 } }"#;
