//! The viewer's window on a virtual display, driven through its own input, beside `rubor render`.

#![cfg(all(unix, feature = "view"))]

mod support;

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use rubor::measure::difference;
use serde_json::{Value, json};
use support::can_draw;

/// A virtual display that ends with the test.
struct Display(Child, String);

impl Display {
    /// None where the program is not installed, which is said loudly.
    fn new() -> Option<Self> {
        let mut child = match Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1600x1000x24", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
        {
            Ok(child) => child,
            Err(_) => {
                writeln!(
                    std::io::stderr(),
                    "SKIPPED: no Xvfb (`make xvfb` installs it on Debian and Ubuntu)"
                )
                .expect("stderr is open");
                return None;
            }
        };
        let mut number = String::new();
        let stdout = child.stdout.take().expect("its output");
        BufReader::new(stdout).read_line(&mut number).expect("the number of the display");
        Some(Self(child, format!(":{}", number.trim())))
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        // Already gone at worst.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

const SEQUENCE: &str = r#"{
  "fps": 4, "duration": 2,
  "expressions": {
    // Comes.
    "joy": [{ "t": 0, "v": 0, "ease": "smooth" }, { "t": 1, "v": 1 }],
  },
  "environment": { "name": "studio" },
}
"#;
const RIG: &str = r#"{
  // Of a test.
  "expressions": { "joy": { "shapes": { "mouthSmileLeft": 1.0, "mouthSmileRight": 1.0 } } },
}
"#;

struct Window {
    folder: tempfile::TempDir,
    display: Display,
}

impl Window {
    fn new() -> Option<Self> {
        if !can_draw() {
            return None;
        }
        let window = Self { folder: tempfile::tempdir().expect("a folder"), display: Display::new()? };
        window.write("rig.json", RIG);
        window.write("sequence.json", SEQUENCE);
        Some(window)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).expect("a file");
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).expect("a file")
    }

    fn report(&self, name: &str) -> Value {
        serde_json::from_str(&self.read(name)).expect("a report")
    }

    fn command(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_rubor"))
            .args(arguments)
            .current_dir(self.folder.path())
            .env("DISPLAY", &self.display.1)
            .env("NODEVICE_SELECT", "1")
            .env_remove("WAYLAND_DISPLAY")
            .output()
            .expect("the command starts")
    }

    /// Opens the window, does the steps and returns when it is closed.
    fn view(&self, flags: &[&str], steps: &[Value]) -> Output {
        let lines: Vec<String> = steps.iter().map(Value::to_string).collect();
        self.write("script.jsonl", &lines.join("\n"));
        let files = ["view", "--rig", "rig.json", "--sequence", "sequence.json", "--script", "script.jsonl"];
        self.command(&[&files[..], flags].concat())
    }
}

fn done(output: &Output) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
}

/// Mean FLIP of two pictures.
fn flip(a: &Path, b: &Path) -> f64 {
    difference::of_files(a, b, 67.0).expect("two pictures").difference.flip_mean
}

#[test]
fn a_session_from_opening_to_closing() {
    let Some(window) = Window::new() else { return };
    let broken = RIG.replace("1.0 } }", "1.0 } ]");
    let softer = RIG.replace("\"mouthSmileLeft\": 1.0", "\"mouthSmileLeft\": 0.5");
    let output = window.view(
        &["--preset", "draft", "--size", "192x192"],
        &[
            json!({ "until": "idle" }),
            json!({ "seek": 1.0 }),
            json!({ "drag": "shape jawOpen", "to": 0.6 }),
            json!({ "until": "idle" }),
            json!({ "report": "slider.json" }),
            json!({ "click": "button Key" }),
            json!({ "until": "idle" }),
            json!({ "picture": "keyed.png" }),
            json!({ "report": "keyed.json" }),
            json!({ "press": "Z", "ctrl": true }),
            json!({ "until": "undone" }),
            json!({ "report": "undone.json" }),
            json!({ "press": "Z", "ctrl": true, "shift": true }),
            json!({ "until": "done again" }),
            json!({ "click": "track expressions.joy" }),
            json!({ "drag": "key expressions.joy 2", "by": [200, 0] }),
            json!({ "report": "moved.json" }),
            json!({ "press": "Z", "ctrl": true }),
            json!({ "write": "rig.json", "text": broken }),
            json!({ "until": "error" }),
            json!({ "report": "broken.json" }),
            json!({ "write": "rig.json", "text": softer }),
            json!({ "until": "no error" }),
            json!({ "until": "idle" }),
            json!({ "picture": "softer.png" }),
            json!({ "click": "button Save" }),
            json!({ "until": "saved" }),
            json!({ "report": "saved.json" }),
            json!({ "close": true }),
        ],
    );
    done(&output);
    let slider = window.report("slider.json");
    assert!((slider["shapes"]["jawOpen"].as_f64().expect("held") - 0.6).abs() < 0.011, "{slider}");
    assert_eq!((&slider["held"], &slider["isChanged"]), (&json!(1), &json!(false)));
    let keyed = window.report("keyed.json");
    assert_eq!((&keyed["held"], &keyed["isChanged"], &keyed["steps"]), (&json!(0), &json!(true), &json!(1)));
    let undone = window.report("undone.json");
    assert_eq!((&undone["isChanged"], &undone["shapes"]), (&json!(false), &json!({})));
    let moved = window.report("moved.json");
    let joy = moved["expressions"]["joy"].as_f64().expect("it plays");
    assert!(joy > 0.5 && joy < 0.999, "the key at 1 s stands later: {joy}");
    let broken = window.report("broken.json");
    let error = broken["errors"][0].as_str().expect("an error");
    assert!(error.contains("rig.json:3:") && error.contains("expected"), "{error}");
    assert_eq!(broken["expressions"]["joy"], 1.0, "the last good state stays");
    let saved = window.report("saved.json");
    assert_eq!((&saved["isChanged"], &saved["errors"]), (&json!(false), &json!([])));
    let text = window.read("sequence.json");
    assert!(text.contains("// Comes.") && text.contains("\"jawOpen\": [{ \"t\": 1, \"v\": 0.6 }]"), "{text}");
    // What the window showed is what `rubor render` draws of the saved files.
    for (rig, name) in [(RIG, "keyed.png"), (&softer, "softer.png")] {
        window.write("rig.json", rig);
        let drawn = window.command(&[
            "render",
            "--rig",
            "rig.json",
            "--sequence",
            "sequence.json",
            "--preset",
            "draft",
            "--size",
            "192x192",
            "--frames",
            "5",
            "--no-video",
            "--no-export",
            "-o",
            name.trim_end_matches(".png"),
        ]);
        done(&drawn);
        let frame = window.path(name.trim_end_matches(".png")).join("frame.0005.png");
        let mean = flip(&window.path(name), &frame);
        eprintln!("{name}: mean FLIP {mean}");
        assert!(mean < 0.001, "{name}: {mean}");
    }
    assert!(flip(&window.path("keyed.png"), &window.path("softer.png")) > 0.001, "the reload showed");
}

#[test]
fn closing_with_changes_asks_and_a_lost_device_keeps_the_work() {
    let Some(window) = Window::new() else { return };
    let changes = |last: &[Value]| {
        let first = [
            json!({ "until": "idle" }),
            json!({ "drag": "expression joy", "to": 0.7 }),
            json!({ "press": "K" }),
            json!({ "until": "idle" }),
        ];
        [&first[..], last].concat()
    };
    let flags = ["--preset", "draft", "--size", "64x64"];
    let steps = changes(&[
        json!({ "close": true }),
        json!({ "click": "button Cancel" }),
        json!({ "close": true }),
        json!({ "screenshot": "question.png" }),
        json!({ "click": "button Save and close" }),
    ]);
    done(&window.view(&flags, &steps));
    let saved = window.read("sequence.json");
    assert!(saved.contains("\"v\": 0.7"), "{saved}");
    window.write("sequence.json", SEQUENCE);
    done(&window.view(&flags, &changes(&[json!({ "close": true }), json!({ "click": "button Discard" })])));
    assert_eq!(window.read("sequence.json"), SEQUENCE);
    let lost = window.view(&flags, &changes(&[json!({ "lose": "device" }), json!({ "wait": 30.0 })]));
    let said = String::from_utf8_lossy(&lost.stderr).into_owned();
    assert_eq!(lost.status.code(), Some(1), "{said}");
    assert!(said.contains("lost") && said.contains("sequence.json.unsaved"), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    assert!(window.read("sequence.json.unsaved").contains("\"v\": 0.7"));
    assert_eq!(window.read("sequence.json"), SEQUENCE);
}

#[test]
fn a_busy_port_a_missing_display_and_wrong_files_are_said() {
    let Some(window) = Window::new() else { return };
    let busy = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = busy.local_addr().expect("its address").to_string();
    let refused = window.view(&["--size", "64x64", "--live", &address], &[json!({ "close": true })]);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(said.contains(&address) && said.contains("hint"), "{said}");
    let wrong = window.command(&["view", "--rig", "none.json"]);
    assert_eq!(wrong.status.code(), Some(2));
    let blind = Command::new(env!("CARGO_BIN_EXE_rubor"))
        .arg("view")
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .output()
        .expect("the command starts");
    let said = String::from_utf8_lossy(&blind.stderr).into_owned();
    if cfg!(not(target_os = "macos")) {
        assert_eq!(blind.status.code(), Some(1), "{said}");
        assert!(said.contains("DISPLAY") && said.contains("rubor render"), "{said}");
    }
}

#[test]
fn live_weights_arrive_and_become_tracks() {
    let Some(window) = Window::new() else { return };
    let address = {
        let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        free.local_addr().expect("its address").to_string()
    };
    let to = address.clone();
    let sender = std::thread::spawn(move || {
        let start = std::time::Instant::now();
        let mut stream = loop {
            match std::net::TcpStream::connect(&to) {
                Ok(stream) => break stream,
                Err(e) => assert!(start.elapsed().as_secs() < 60, "{e}"),
            }
            std::thread::sleep(std::time::Duration::from_millis(50));
        };
        stream.write_all(b"{\"type\":\"hello\",\"version\":1,\"from\":\"a test\"}\n").expect("it listens");
        // Until the window is closed.
        for i in 0.. {
            let weight = 0.5 - 0.5 * (f64::from(i) * 0.1).cos();
            let line = json!({ "type": "weights", "shapes": { "jawOpen": weight, "nonsense": 1.0 } });
            if stream.write_all(format!("{line}\n").as_bytes()).is_err() {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
    });
    let output = window.view(
        &["--preset", "draft", "--size", "64x64", "--live", &address],
        &[
            json!({ "until": "a test is connected" }),
            json!({ "wait": 0.5 }),
            json!({ "report": "live.json" }),
            json!({ "click": "button Record" }),
            json!({ "wait": 3.0 }),
            json!({ "click": "button End recording" }),
            json!({ "until": "recorded" }),
            json!({ "click": "button Stop" }),
            json!({ "click": "button Save" }),
            json!({ "until": "saved" }),
            json!({ "close": true }),
        ],
    );
    done(&output);
    sender.join().expect("the sender");
    let live = window.report("live.json");
    assert!(live["live"].as_u64().expect("a number") >= 1, "{live}");
    let log = live["log"].to_string();
    assert!(log.contains("nonsense") && log.contains("a test is connected"), "{log}");
    let saved = window.read("sequence.json");
    let keys = saved.matches("\"t\":").count();
    assert!(saved.contains("\"jawOpen\": [") && keys > 6, "{saved}");
    assert!(!saved.contains("\"duration\": 2"), "it became longer: {saved}");
}

#[test]
fn memory_stays_and_speed_is_told() {
    let Some(window) = Window::new() else { return };
    let other = RIG.replace("\"mouthSmileLeft\": 1.0", "\"mouthSmileLeft\": 0.5");
    let both = json!([
        { "write": "rig.json", "text": other }, { "wait": 0.16 }, { "until": "idle" },
        { "write": "rig.json", "text": RIG }, { "wait": 0.16 }, { "until": "idle" },
    ]);
    let output = window.view(
        &["--preset", "draft", "--size", "64x64"],
        &[
            json!({ "until": "idle" }),
            json!({ "repeat": 3, "steps": both }),
            json!({ "report": "early.json" }),
            json!({ "repeat": 7, "steps": both }),
            json!({ "report": "late.json" }),
            json!({ "measure": 8, "drag": "shape jawOpen" }),
            json!({ "report": "speed.json" }),
            json!({ "close": true }),
        ],
    );
    done(&output);
    let (early, late) = (window.report("early.json"), window.report("late.json"));
    let steps = |r: &Value| r["steps"].as_u64().expect("a number");
    assert_eq!((steps(&early), steps(&late)), (6, 20), "every save was read");
    if let (Some(a), Some(b)) = (early["residentBytes"].as_u64(), late["residentBytes"].as_u64()) {
        eprintln!("resident: {} KiB after 6 reloads, {} KiB after 20", a >> 10, b >> 10);
        assert!(b < a + (16 << 20), "{a} to {b} bytes");
    }
    let measured = &window.report("speed.json")["measured"];
    eprintln!("64 x 64: {measured}");
    assert!(measured["framesPerSecond"].as_f64().expect("a number") > 1.0, "{measured}");
}
