//! Time and memory that reading a scene takes: `cargo run --release -p rubor-maya --example read_time [SCENE.ma | MB]`.
//!
//! Without a scene, one of dense targets on a grid is made up first, of 100 MB or as many as asked.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use rubor_maya::read;

/// Points along a side of the grid.
const SIDE: usize = 164;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let argument = std::env::args().nth(1).unwrap_or_else(|| "100".into());
    let path = match argument.parse::<usize>() {
        Ok(megabytes) => {
            let path = std::env::temp_dir().join("rubor_read_time.ma");
            std::fs::write(&path, scene(megabytes * 1_000_000)?)?;
            path
        }
        Err(_) => PathBuf::from(argument),
    };
    let megabytes = std::fs::metadata(&path)?.len() as f64 * 1e-6;
    let before = status_mb("VmRSS:");
    // The peak so far is that of making the scene up: it starts anew, where the system allows that.
    let reset = std::fs::write("/proc/self/clear_refs", "5").is_ok();
    let started = Instant::now();
    let imported = read::read(&path, &read::Options::default())?;
    let took = started.elapsed();
    println!(
        "{megabytes:.1} MB: {:.2} s, {} points, {} targets",
        took.as_secs_f64(),
        imported.head.mesh.points.len(),
        imported.head.shapes.len()
    );
    if let (Some(before), Some(peak), true) = (before, status_mb("VmHWM:"), reset) {
        println!(
            "memory at its peak {:.0} MB, {:.2} times the file",
            peak - before,
            (peak - before) / megabytes
        );
    }
    if path.starts_with(std::env::temp_dir())
        && path.file_name() == Path::new("rubor_read_time.ma").file_name()
    {
        std::fs::remove_file(path)?;
    }
    Ok(())
}

/// A field of this process's status on Linux, megabytes.
fn status_mb(field: &str) -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find(|l| l.starts_with(field))?;
    line.split_ascii_whitespace().nth(1)?.parse::<f64>().ok().map(|kb| kb * 1.024e-3)
}

fn scene(bytes: usize) -> Result<String, std::fmt::Error> {
    let mut text = String::with_capacity(bytes + 10_000_000);
    let n = SIDE * SIDE;
    text.push_str(
        "//Maya ASCII 2022 scene\nrequires maya \"2022\";\ncurrentUnit -l centimeter -a degree -t film;\n",
    );
    text.push_str("createNode transform -n \"grid\";\ncreateNode mesh -n \"gridShape\" -p \"grid\";\n");
    text.push_str("createNode mesh -n \"gridShapeOrig\" -p \"grid\";\n\tsetAttr \".io\" yes;\n");
    write!(text, "\tsetAttr -s {n} \".vt[0:{}]\"", n - 1)?;
    let wave = |i: usize, k: usize| ((i * 37 + k * 101) as f64).sin();
    for i in 0..n {
        write!(text, " {:.7} {:.7} {:.7}", (i % SIDE) as f64 * 0.1, (i / SIDE) as f64 * 0.1, wave(i, 0))?;
        text.push_str(if i % 6 == 5 { "\n\t\t" } else { "" });
    }
    let across = SIDE * (SIDE - 1);
    write!(text, ";\n\tsetAttr -s {} \".ed[0:{}]\"", 2 * across, 2 * across - 1)?;
    for y in 0..SIDE {
        for x in 0..SIDE - 1 {
            write!(text, " {} {} 0", y * SIDE + x, y * SIDE + x + 1)?;
        }
    }
    for y in 0..SIDE - 1 {
        for x in 0..SIDE {
            write!(text, " {} {} 0", y * SIDE + x, (y + 1) * SIDE + x)?;
        }
    }
    let faces = (SIDE - 1) * (SIDE - 1);
    write!(text, ";\n\tsetAttr -s {faces} -ch {} \".fc[0:{}]\" -type \"polyFaces\"", 4 * faces, faces - 1)?;
    for y in 0..SIDE - 1 {
        for x in 0..SIDE - 1 {
            let (bottom, top) = (y * (SIDE - 1) + x, (y + 1) * (SIDE - 1) + x);
            let (left, right) = (across + y * SIDE + x, across + y * SIDE + x + 1);
            write!(text, "\n\t\tf 4 {bottom} {right} -{} -{}", top + 1, left + 1)?;
        }
    }
    text.push_str(";\ncreateNode blendShape -n \"shapes\";\n");
    let mut target = 0;
    while text.len() < bytes {
        write!(text, "\tsetAttr \".it[0].itg[{target}].iti[6000].ipt\" -type \"pointArray\" {n}")?;
        for i in 0..n {
            write!(text, " {} {} {} 1", wave(i, target), wave(i, target + 1), 0.01 * wave(i, target + 2))?;
            text.push_str(if i % 3 == 2 { "\n\t\t" } else { "" });
        }
        writeln!(
            text,
            ";\n\tsetAttr \".it[0].itg[{target}].iti[6000].ict\" -type \"componentList\" 1 \"vtx[0:{}]\";",
            n - 1
        )?;
        target += 1;
    }
    text.push_str("connectAttr \"gridShapeOrig.w\" \"shapes.ip[0].ig\";\nconnectAttr \"shapes.og[0]\" \"gridShape.i\";\n");
    Ok(text)
}
