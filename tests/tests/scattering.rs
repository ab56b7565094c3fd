//! Scattering methods on the default head against the integral over its surface.

use std::path::Path;

use rubor::measure::chart::{self, Effort, Options, RightLight, Suite};
use rubor::measure::stability;
use rubor::{Outcome, Studio};
use rubor_assets::import;
use rubor_renderer::settings::{AntialiasMethod, Output, Quality, Settings};
use rubor_rig::expression::Rig;
use rubor_tests::can_draw;

#[test]
fn pre_integrated_light_on_the_head_is_near_the_reference() -> Outcome {
    if !can_draw() {
        return Ok(());
    }
    let head = import::gltf::from_bytes(include_bytes!("../../assets/head.glb"), "head.glb".as_ref())?.head;
    let mut studio = Studio::open(None)?;
    studio.set_heads([&head])?;
    // The shadow of the nose on the cheek.
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/nose.json");
    let (scene, _) = chart::scene_of(&scene, &head, &Rig::default_rig()?)?;
    let base = Settings {
        output: Output { size: [64, 64], ..Output::default() },
        quality: Quality { antialias: AntialiasMethod::None, shadow_size: 1024, ..Quality::default() },
        ..Settings::default()
    };
    let listed = [("scatter".to_owned(), vec!["pre-integrated:1".into(), "pre-integrated:3".into()])];
    let effort = Effort { light: RightLight::Surface(8), samples: 1 };
    let groups = chart::groups(Suite::Quick, &base, &listed, &[], effort)?;
    let options = Options { timing: None, folder: None, light: false };
    let report = chart::run(&mut studio, &base, &[scene], &groups, &options, &mut ())?;
    for name in ["pre-integrated:1", "pre-integrated:3"] {
        let choice = report.groups[0].choices.iter().find(|c| c.name == name);
        let error = choice.and_then(|c| c.overall.as_ref()).map_or(f64::NAN, |o| o.error);
        // 0.036, of which the reference's own noise is 0.016; `none` has 0.032 (docs/scatter.md says why).
        assert!(error > 0.0 && error < 0.045, "{name}: {error}");
    }
    Ok(())
}

#[test]
fn methods_are_steady_while_something_moves() -> Outcome {
    if !can_draw() {
        return Ok(());
    }
    let head = import::gltf::from_bytes(include_bytes!("../../assets/head.glb"), "head.glb".as_ref())?.head;
    let mut studio = Studio::open(None)?;
    let rig = Rig::default_rig()?;
    let base = Settings {
        output: Output { size: [48, 48], ..Output::default() },
        quality: Quality { antialias: AntialiasMethod::None, shadow_size: 512, ..Quality::default() },
        ..Settings::default()
    };
    let listed =
        [("scatter".to_owned(), vec!["none".into(), "separable:17".into(), "burley-disk:16".into()])];
    let groups =
        chart::groups(Suite::Quick, &base, &listed, &[], Effort { light: RightLight::Screen, samples: 1 })?;
    let sweeps: Vec<_> = stability::sweeps(&head, &rig, 4, 48)?
        .into_iter()
        .filter(|s| ["lamp-turns", "frown-weight"].contains(&s.name))
        .collect();
    let options = stability::Options { samples: 2, frames: 0 };
    let report = stability::run(&mut studio, &head, &base, &sweeps, &groups, options, &mut ())?;
    assert_eq!(report.rows.len(), 6);
    for row in &report.rows {
        let name = format!("{} in {}: {row:?}", row.choice, row.sweep);
        assert_eq!(row.broken_values, 0, "{name}");
        assert!(row.halo < 0.002, "{name}");
        // Light is spread and not made; docs/speed.md has 0.997 to 1.003 at 96 x 96.
        assert!(row.energy[0] > 0.98 && row.energy[1] < 1.02, "{name}");
        assert!(row.residual > 0.0 && row.residual < 0.05, "{name}");
    }
    Ok(())
}
