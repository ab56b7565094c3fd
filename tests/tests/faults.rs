//! Wrong methods are noticed: each fault in a shader makes a measured error much larger. Faults of the antialiasing are not
//! among them: over a head the aliasing of highlights is larger than theirs; its filters are compared bit by bit instead
//! (`renderer/src/passes/antialias`).
//!
//! ```text
//! fault --shader--> renderer --chart--> error of a choice, beside the error without it
//! ```

use std::io::Write;
use std::path::Path;

use rubor::measure::chart::{self, Effort, Options, RightLight, Scene, Suite};
use rubor::report::ChartError;
use rubor::{Outcome, Studio};
use rubor_assets::import;
use rubor_renderer::faults::{self, Fault};
use rubor_renderer::settings::{AntialiasMethod, BounceMethod, Output, Quality, ScatterMethod, Settings};
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_tests::can_draw;
use serde_json::Value;

/// A fault and the error that tells of it.
struct Case {
    what: &'static str,
    scene: &'static str,
    flag: &'static str,
    choice: &'static str,
    fault: Fault,
}

const fn case(
    what: &'static str,
    [scene, flag, choice]: [&'static str; 3],
    [module, right, wrong]: [&'static str; 3],
) -> Case {
    Case { what, scene, flag, choice, fault: Fault { module, right, wrong } }
}

const CASES: &[Case] = &[
    case(
        "a kernel scaled by 1.1",
        ["pores", "scatter", "separable:17"],
        ["line", "result += pair.rgb * (", "result += 1.1 * pair.rgb * ("],
    ),
    case(
        "taps one pixel aside",
        ["pores", "scatter", "separable:17"],
        ["line", "(vec2f(at) + 0.5 + x * vec2f(axis))", "(vec2f(at) + 0.5 + (x + 1.0) * vec2f(axis))"],
    ),
    case(
        "a kernel of half its width",
        ["pores", "scatter", "separable:17"],
        ["line", "strength * per_mm / across", "0.5 * strength * per_mm / across"],
    ),
    case(
        "a depth test turned round",
        ["silhouette", "scatter", "separable:17"],
        [
            "screen_common",
            "saturate(1.0 - follow_per_mm * abs(gap_mm))",
            "saturate(follow_per_mm * abs(gap_mm))",
        ],
    ),
    case(
        "a wrong level of detail",
        ["pores", "scatter", "screen-gauss:6"],
        ["line", "across = f32(1u << params.level);", "across = f32(1u << (params.level + 1u));"],
    ),
    case(
        "a disk of a tenth of its width",
        ["pores", "scatter", "burley-disk:16"],
        ["disk", "round(clamp(place * center.scale", "round(clamp(0.1 * place * center.scale"],
    ),
    case(
        "taps twice as far",
        ["pores", "scatter", "screen-jitter"],
        ["jitter", "clamp(tap.place.xy * center.scale", "clamp(2.0 * tap.place.xy * center.scale"],
    ),
    case(
        "disks of light cubemaps that count each sample twice",
        ["nose", "scatter", "dipole-cubemap:16"],
        ["cubemap_gather", "var weight = place.w;", "var weight = 2.0 * place.w;"],
    ),
    case(
        "a quarter of the thickness",
        ["ear", "transmit", "shadow-depth"],
        ["shade_transmit", "params.slab, thickness_mm, albedo)", "params.slab, 0.25 * thickness_mm, albedo)"],
    ),
    case(
        "wrinkles of the wrong sign in one of two methods",
        ["frown", "wrinkles", "difference"],
        [
            "shade",
            "sum += params.wrinkle_strength * weights[i % 4u] * vec3f(change, z - base.z);",
            "sum -= params.wrinkle_strength * weights[i % 4u] * vec3f(change, z - base.z);",
        ],
    ),
    case(
        "the nearest triangle that is the farthest",
        ["head", "raster", "compute"],
        ["raster", "atomicMax(&pixels[pixel], ONE - bits);", "atomicMin(&pixels[pixel], ONE - bits);"],
    ),
];

/// Batches of `reference-surface`: light from behind is wrong by far more than their noise.
const BATCHES: u32 = 2;

/// The error of a choice in a scene: of light in skin that to `reference-screen`, which has no noise.
fn error(head: &Head, rig: &Rig, scene: &str, flag: &str, choice: &str) -> Outcome<f64> {
    let mut studio = Studio::open(None)?;
    studio.set_heads([head])?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{scene}.json"));
    let (scene, _): (Scene, _) = chart::scene_of(&path, head, rig)?;
    let base = Settings {
        output: Output { size: [72, 72], ..Output::default() },
        quality: Quality {
            scatter: ScatterMethod::Separable(17),
            antialias: AntialiasMethod::None,
            bounce: BounceMethod::None,
            shadow_size: 512,
            ..Quality::default()
        },
        ..Settings::default()
    };
    // The second value only makes it a list.
    let other = match flag {
        "raster" => "hardware",
        _ => "none",
    };
    let listed = [(flag.to_owned(), vec![Value::from(choice), Value::from(other)])];
    let groups = chart::groups(
        Suite::Quick,
        &base,
        &listed,
        &[],
        Effort { light: RightLight::Surface(BATCHES), samples: 4 },
    )?;
    let options = Options { timing: None, folder: None, light: false };
    let report = chart::run(&mut studio, &base, &[scene], &groups, &options, &mut ())?;
    let found = report.groups[0].choices.iter().find(|c| c.name == choice);
    let error =
        |e: &ChartError| e.relative_rmse_to_screen.filter(|_| flag == "scatter").unwrap_or(e.flip_mean);
    Ok(found.and_then(|c| c.points.first()).map_or(f64::NAN, |p| error(&p.error)))
}

#[test]
fn every_fault_is_measured() -> Outcome {
    if !can_draw() {
        return Ok(());
    }
    let head = import::gltf::from_bytes(include_bytes!("../../assets/head.glb"), "head.glb".as_ref())?.head;
    let rig = Rig::default_rig()?;
    let mut right: Vec<([&str; 3], f64)> = Vec::new();
    let mut missed = Vec::new();
    for case in CASES {
        let key = [case.scene, case.flag, case.choice];
        let known = right.iter().find(|(k, _)| *k == key).map(|(_, e)| *e);
        let expected = match known {
            Some(error) => error,
            None => {
                faults::set(None);
                let error = error(&head, &rig, case.scene, case.flag, case.choice)?;
                right.push((key, error));
                error
            }
        };
        faults::set(Some(case.fault));
        let found = error(&head, &rig, case.scene, case.flag, case.choice)?;
        let uses = faults::set(None);
        writeln!(std::io::stderr(), "{}: {found:.4}, {expected:.4} without it", case.what)
            .expect("stderr is open");
        assert!(uses > 0, "{}: no shader used the module {}", case.what, case.fault.module);
        // A fifth more is beyond what the same device repeats, which is nothing.
        let is_noticed = found.is_nan() || found > 1.2 * expected + 1e-4;
        if !is_noticed {
            missed.push(format!("{}: {found:.4} with it, {expected:.4} without", case.what));
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
    Ok(())
}
