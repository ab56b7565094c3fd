//! Rigs, sequences, jobs, recordings and retarget files.

use super::{Case, truncated, write};

fn json(name: &str, file: &'static str, text: impl FnOnce() -> String + 'static) -> Case {
    Case::check(name, file, move || text().into_bytes())
}

fn list(count: usize, of: impl Fn(usize) -> String) -> String {
    (0..count).map(of).collect::<Vec<_>>().join(",")
}

fn rig(name: &str, text: impl FnOnce() -> String + 'static) -> Case {
    json(&format!("rig/{name}"), "rig.json", text)
}

fn rig_cases() -> Vec<Case> {
    let whole = "{ \"expressions\": { \"joy\": { \"shapes\": { \"mouthSmileLeft\": 1.0, \"mouthSmileRight\": 1.0 } } } }";
    let mut all = truncated("rig", "rig.json", &["check", "{}/rig.json"], whole.as_bytes());
    all.push(rig("expressions-100000", || {
        format!(
            "{{ \"expressions\": {{ {} }} }}",
            list(100_000, |i| format!("\"e{i}\": {{ \"shapes\": {{ \"jawOpen\": 1 }} }}"))
        )
    }));
    all.push(rig("expressions-without-effect-100000", || {
        format!("{{ \"expressions\": {{ {} }} }}", list(100_000, |i| format!("\"e{i}\": {{}}")))
    }));
    all.push(rig("states-100000", || {
        format!(
            "{{ \"states\": {{ {} }} }}",
            list(100_000, |i| format!("\"s{i}\": {{ \"hemoglobin\": {{ \"d{i}\": 0.5 }} }}"))
        )
    }));
    all.push(rig("unknown-zones-100000", || {
        format!(
            "{{ \"expressions\": {{ \"a\": {{ \"wrinkles\": {{ {} }} }} }} }}",
            list(100_000, |i| format!("\"z{i}\": 1"))
        )
    }));
    all.push(rig("unknown-zones-in-lines-100000", || {
        format!(
            "{{ \"expressions\": {{ \"a\": {{ \"wrinkles\": {{ {} }} }} }} }}",
            list(100_000, |i| format!("\n\"z{i}\": 1"))
        )
    }));
    all.push(rig("unknown-shapes-100000", || {
        format!(
            "{{ \"expressions\": {{ \"a\": {{ \"shapes\": {{ {} }} }} }} }}",
            list(100_000, |i| format!("\"s{i}\": 1"))
        )
    }));
    all.push(rig("weights-beyond-100000", || {
        format!(
            "{{ \"expressions\": {{ {} }} }}",
            list(100_000, |i| format!("\"e{i}\": {{ \"shapes\": {{ \"jawOpen\": 7 }} }}"))
        )
    }));
    all.push(rig("inbetweens-100000", || {
        format!(
            "{{ \"inbetweens\": [{}] }}",
            list(100_000, |i| format!(
                "{{ \"shape\": \"jawOpen\", \"target\": \"mouthPucker\", \"weight\": {} }}",
                (i + 1) as f64 / 100_002.0
            ))
        )
    }));
    all.push(rig("combinations-100000", || {
        format!(
            "{{ \"combinations\": [{}] }}",
            list(100_000, |_| "{ \"shape\": \"jawOpen\", \"drivers\": [\"mouthPucker\", \"cheekPuff\"] }"
                .into())
        )
    }));
    all.push(rig("drivers-100000", || {
        format!(
            "{{ \"combinations\": [{{ \"shape\": \"jawOpen\", \"drivers\": [{}] }}] }}",
            list(100_000, |i| format!("\"d{i}\""))
        )
    }));
    all.push(rig("levels-100000", || format!("{{ \"expressions\": {}", "[".repeat(100_000))));
    all.push(rig("objects-deep-100000", || "{ \"expressions\": ".repeat(100_000)));
    all.push(rig("values-30M", || format!("{{ \"expressions\": [{}] }}", list(30_000_000, |_| "0".into()))));
    all.push(rig("string-100MB", || format!("{{ \"expressions\": \"{}\" }}", "x".repeat(100_000_000))));
    all.push(rig("key-10MB", || format!("{{ \"{}\": 1 }}", "x".repeat(10_000_000))));
    all.push(rig("comment-100MB", || format!("/* {} */ {{}}", "x".repeat(100_000_000))));
    all.push(rig("comment-without-end", || "/*".into()));
    all.push(rig("keys-equal-100000", || {
        format!("{{ {} }}", list(100_000, |_| "\"expressions\": {}".into()))
    }));
    all.push(rig("no-utf-8-name", || "{ \"expressions\": { \"\\ud800\": {} } }".into()));
    for (name, number) in [
        ("1e999", "1e999"),
        ("nan", "NaN"),
        ("minus-0", "-0"),
        ("long", "1000000000000000000000000000000000000000"),
        ("infinity", "Infinity"),
    ] {
        all.push(rig(&format!("weight-{name}"), move || {
            format!("{{ \"expressions\": {{ \"a\": {{ \"shapes\": {{ \"jawOpen\": {number} }} }} }} }}")
        }));
    }
    all
}

fn sequence(name: &str, fields: impl FnOnce() -> String + 'static) -> Case {
    json(&format!("sequence/{name}"), "s.json", move || {
        format!("{{ \"duration\": 1, \"fps\": 24, {} }}", fields())
    })
}

fn sequence_cases() -> Vec<Case> {
    let whole = "{ \"fps\": 24, \"duration\": 1, \"expressions\": { \"joy\": [{ \"t\": 0, \"v\": 0 }, { \"t\": 1, \"v\": 1 }] } }";
    let mut all = truncated("seq", "s.json", &["check", "{}/s.json"], whole.as_bytes());
    let timed = |name: &str, duration: &'static str, fps: &'static str| {
        json(&format!("sequence/{name}"), "s.json", move || {
            format!(
                "{{ \"duration\": {duration}, \"fps\": {fps}, \"expressions\": {{ \"joy\": 1 }}, \"eyes\": {{}}, \"life\": {{ \"seed\": 1, \"blinks\": 4, \"saccades\": 5, \"breathing\": 5, \"sway\": 5 }} }}"
            )
        })
    };
    all.push(timed("a-day-with-life", "86400", "10000"));
    all.push(timed("a-year", "31536000", "24").refused());
    all.push(timed("fps-1e9", "1", "1e9").refused());
    all.push(timed("fps-0", "1", "0").refused());
    all.push(timed("fps-1e-300", "1", "1e-300"));
    all.push(timed("duration-1e-300", "1e-300", "24"));
    all.push(timed("duration-minus", "-1", "24").refused());
    all.push(sequence("keys-1M", || {
        format!(
            "\"expressions\": {{ \"joy\": [{}] }}",
            list(1_000_000, |i| format!("{{ \"t\": {}, \"v\": 0.5 }}", i as f64 / 1_000_001.0))
        )
    }));
    all.push(sequence("shapes-100000", || {
        format!("\"shapes\": {{ {} }}", list(100_000, |i| format!("\"s{i}\": 1")))
    }));
    all.push(sequence("expressions-100000", || {
        format!("\"expressions\": {{ {} }}", list(100_000, |i| format!("\"e{i}\": 1")))
    }));
    all.push(sequence("lights-100000", || {
        format!(
            "\"lights\": [{}]",
            list(100_000, |_| "{ \"kind\": \"point\", \"position\": [0, 0, 1], \"intensity\": 1 }".into())
        )
    }));
    all.push(sequence("camera-in-the-face", || {
        "\"camera\": { \"position\": [0, 0, 0], \"target\": [0, 0, 0] }".into()
    }));
    all.push(sequence("numbers-huge", || {
        "\"head\": { \"translation\": [3e38, 3e38, -3e38], \"yawDegrees\": 3e38 }".into()
    }));
    all.push(sequence("size-4e9", || "\"size\": [4000000000, 4000000000]".into()));
    all.push(sequence("size-0", || "\"size\": [0, 5]".into()).refused());
    for (name, file) in
        [("above", "../take.csv"), ("absolute", "/etc/passwd"), ("zero", "/dev/zero"), ("empty", "")]
    {
        all.push(
            sequence(&format!("capture-{name}"), move || format!("\"capture\": {{ \"file\": \"{file}\" }}"))
                .refused(),
        );
    }
    #[cfg(unix)]
    {
        for (name, target) in [("link-out", "/etc/hostname"), ("link-to-zero", "/dev/zero")] {
            all.push(
                Case::new(format!("sequence/capture-{name}"), &["check", "{}/s.json"], move |f| {
                    write(
                        f,
                        "s.json",
                        b"{ \"duration\": 1, \"fps\": 24, \"capture\": { \"file\": \"take.csv\" } }",
                    );
                    std::os::unix::fs::symlink(target, f.join("take.csv")).expect("a link");
                })
                .refused(),
            );
        }
        all.push(
            Case::new("sequence/capture-is-a-pipe", &["check", "{}/s.json"], |f| {
                write(
                    f,
                    "s.json",
                    b"{ \"duration\": 1, \"fps\": 24, \"capture\": { \"file\": \"take.csv\" } }",
                );
                super::gltf::fifo(f, "take.csv");
            })
            .refused(),
        );
        all.push(Case::new(
            "job/environment-is-a-pipe",
            &["job", "--sequence", "{}/s.json", "-o", "{}/o.yaml"],
            |f| {
                write(
                    f,
                    "s.json",
                    b"{ \"duration\": 1, \"fps\": 24, \"environment\": { \"name\": \"e.hdr\" } }",
                );
                super::gltf::fifo(f, "e.hdr");
            },
        ));
    }
    all
}

fn job_cases() -> Vec<Case> {
    let job = |name: &str, text: fn() -> String| {
        Case::new(format!("job/{name}"), &["job", "--job", "{}/a.json", "-o", "{}/o.yaml"], move |f| {
            write(f, "a.json", text().as_bytes())
        })
    };
    let body = "\"rig\": {}, \"sequence\": { \"fps\": 24, \"duration\": 1 }";
    let _ = body;
    vec![
        job("plain", || "{ \"rig\": {}, \"sequence\": { \"fps\": 24, \"duration\": 1 } }".into()),
        job("empty", String::new).refused(),
        job("frames-1e9", || "{ \"rig\": {}, \"sequence\": { \"fps\": 24, \"duration\": 1 }, \"frames\": \"1-1000000000\" }".into()).refused(),
        job("frames-many", || format!("{{ \"rig\": {{}}, \"sequence\": {{ \"fps\": 10000, \"duration\": 86400 }}, \"frames\": \"{}\" }}", list(1000, |i| format!("{}-{}", i * 1_000_000 + 1, i * 1_000_000 + 900_000)))),
        job("a-day", || "{ \"rig\": {}, \"sequence\": { \"fps\": 10000, \"duration\": 86400 } }".into()),
        job("head-above", || "{ \"rig\": {}, \"sequence\": { \"fps\": 24, \"duration\": 1 }, \"heads\": [{ \"file\": \"../../../../etc/passwd\" }] }".into()).refused(),
        job("head-zero", || "{ \"rig\": {}, \"sequence\": { \"fps\": 24, \"duration\": 1 }, \"heads\": [{ \"file\": \"/dev/zero\" }] }".into()).refused().small(),
        job("environment-zero", || "{ \"rig\": {}, \"sequence\": { \"fps\": 24, \"duration\": 1, \"environment\": { \"name\": \"/dev/zero\" } } }".into()),
        job("heads-1000", || format!("{{ \"rig\": {{}}, \"sequence\": {{ \"fps\": 24, \"duration\": 1 }}, \"heads\": [{}] }}", list(1000, |_| "{}".into()))),
        job("size-4e9", || "{ \"rig\": {}, \"sequence\": { \"fps\": 24, \"duration\": 1 }, \"settings\": { \"output\": { \"size\": [4000000000, 4000000000] } } }".into()),
        job("levels-100000", || "[".repeat(100_000)).refused(),
        job("values-30M", || format!("{{ \"rig\": [{}] }}", list(30_000_000, |_| "0".into()))).refused(),
    ]
}

const CSV: &str =
    "Timecode,BlendShapeCount,JawOpen,EyeBlinkLeft\n00:00:01:00.000,2,0,0.1\n00:00:01:30.000,2,0.5,0.2\n";

fn csv(name: &str, text: impl FnOnce() -> String + 'static) -> Case {
    json(&format!("capture/csv-{name}"), "a.csv", text)
}

fn capture_cases() -> Vec<Case> {
    let mut all = truncated("csv", "a.csv", &["check", "{}/a.csv"], CSV.repeat(4).as_bytes());
    all.push(csv("plain", || CSV.into()));
    all.push(csv("columns-100000", || {
        let row = |time: &str, value: &str| format!("{time},1,0.5,{}\n", list(100_000, |_| value.into()));
        format!("Timecode,BlendShapeCount,JawOpen,{}\n", list(100_000, |i| format!("c{i}")))
            + &row("00:00:01:00.000", "0.1")
            + &row("00:00:01:30.000", "0.2")
    }));
    all.push(csv("columns-of-one-name-100000", || {
        let row = |time: &str| format!("{time},{}\n", list(100_000, |_| "0.1".into()));
        format!("Timecode,{}\n", list(100_000, |_| "JawOpen".into()))
            + &row("00:00:01:00.000")
            + &row("00:00:01:30.000")
    }));
    all.push(csv("rows-1M", || {
        "Timecode,JawOpen\n".to_owned()
            + &(0..1_000_000).map(|i| format!("{},0.5\n", i as f64 / 60.0)).collect::<String>()
    }));
    all.push(csv("line-of-200MB", || format!("Timecode,JawOpen,{}\n", "x".repeat(200_000_000))));
    all.push(csv("quote-without-end-100MB", || format!("Timecode,JawOpen\n\"{}", "x".repeat(100_000_000))));
    all.push(csv("empty-lines-50M", || format!("{CSV}{}", "\n".repeat(50_000_000))));
    for (name, row) in [
        ("nan", "00:00:02:00.000,2,nan,inf"),
        ("1e39", "00:00:02:00.000,2,1e39,1"),
        ("years", "99999999:00:00:00.000,2,1,1"),
        ("frames-1e9", "00:00:00:1000000000.000,2,1,1"),
        ("minus", "-00:00:02:00.000,2,1,1"),
        ("short", "00:00:02:00.000"),
        ("words", "a,b,c,d"),
    ] {
        all.push(csv(&format!("row-{name}"), move || format!("{CSV}{row}\n{CSV}")));
    }
    let recording = |name: &str, text: fn() -> String| json(&format!("capture/json-{name}"), "a.json", text);
    all.push(recording("names-100000", || {
        format!(
            "{{ \"frames\": [{{ \"blendShapes\": {{ {} }} }}] }}",
            list(100_000, |i| format!("\"n{i}\": 0.5"))
        )
    }));
    all.push(recording("new-names-each-frame", || {
        format!(
            "{{ \"frames\": [{}] }}",
            list(20_000, |i| format!(
                "{{ \"timestamp\": {i}, \"blendShapes\": {{ \"jawOpen\": 0.5, \"n{i}\": 0.5 }} }}"
            ))
        )
    }));
    all.push(recording("columns-100000", || {
        format!(
            "{{ \"facsNames\": [{}], \"weightMat\": [[{}]] }}",
            list(100_000, |i| format!("\"n{i}\"")),
            list(100_000, |_| "0".into())
        )
    }));
    all.push(recording("frames-1M", || {
        format!(
            "{{ \"frames\": [{}] }}",
            list(1_000_000, |_| "{ \"blendShapes\": { \"jawOpen\": 1 } }".into())
        )
    }));
    all.push(recording("times-1e300", || "{ \"frames\": [{ \"timestamp\": 0, \"blendShapes\": { \"jawOpen\": 1 } }, { \"timestamp\": 1e300, \"blendShapes\": { \"jawOpen\": 0 } }] }".into()));
    all.push(recording("times-years", || "{ \"frames\": [{ \"timestampSeconds\": 0, \"blendShapes\": { \"jawOpen\": 1 } }, { \"timestampSeconds\": 1e9, \"blendShapes\": { \"jawOpen\": 0 } }] }".into()));
    all.push(recording("levels-100000", || format!("{{ \"frames\": {}", "[".repeat(100_000))));
    all.push(recording("objects-5M", || {
        format!("{{ \"frames\": [{}] }}", list(5_000_000, |_| "{\"a\":0}".into()))
    }));
    all.push(recording("matrix-nan", || "{ \"frames\": [{ \"blendShapes\": { \"jawOpen\": 1 }, \"transform\": [1e300,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1] }] }".into()));
    let retarget = |name: &str, text: fn() -> String| {
        Case::new(format!("capture/retarget-{name}"), &["check", "{}/a.csv", "{}/r.json"], move |f| {
            write(f, "a.csv", CSV.as_bytes());
            write(f, "r.json", text().as_bytes());
        })
    };
    all.push(retarget("amplitude-1e30", || {
        "{ \"smoothing\": { \"windowMs\": 500, \"amplitude\": 1e30 } }".into()
    }));
    all.push(retarget("window-1e30", || {
        "{ \"smoothing\": { \"windowMs\": 1e30, \"amplitude\": 10 } }".into()
    }));
    all.push(retarget("gain-1e30", || {
        "{ \"shapes\": { \"JawOpen\": { \"shape\": \"jawOpen\", \"gain\": 1e30 } } }".into()
    }));
    all.push(retarget("entries-100000", || {
        format!("{{ \"shapes\": {{ {} }} }}", list(100_000, |i| format!("\"c{i}\": \"s{i}\"")))
    }));
    all.push(Case::new(
        "capture/targets-20000-of-a-long-take",
        &["import", "capture", "{}/a.csv", "--retarget", "{}/r.json", "-o", "{}/s.json"],
        |f| {
            let rows: String = (0..100_000).map(|i| format!("{},0.5\n", i as f64 / 60.0)).collect();
            write(f, "a.csv", format!("Timecode,JawOpen\n{rows}").as_bytes());
            write(
                f,
                "r.json",
                format!("{{ \"shapes\": {{ \"JawOpen\": [{}] }} }}", list(20_000, |i| format!("\"s{i}\"")))
                    .as_bytes(),
            );
        },
    ));
    all
}

pub(crate) fn cases() -> Vec<Case> {
    [rig_cases(), sequence_cases(), job_cases(), capture_cases()].into_iter().flatten().collect()
}
