use rubor_rig::skin::volume::{Body, Normals, View};

use super::*;
use crate::inputs;

fn loaded() -> (Head, rubor_rig::expression::Rig) {
    let loaded = inputs::head(None).unwrap();
    let rig = inputs::rig(None, loaded.rig.clone()).unwrap();
    (loaded.head, rig)
}

#[test]
fn there_are_24_stills_and_every_one_shows_skin() {
    let (head, rig) = loaded();
    let (stills, notes) = stills(Suite::Whole, &head, &rig).unwrap();
    assert_eq!((stills.len(), notes.len()), (24, 0));
    for still in &stills {
        let shot = skin::bare_shot(&still.shot);
        let body = Body::new(&head, &shot.face, Normals::Smooth).unwrap();
        let view = View::new(&shot.camera, [32, 32]);
        let shown = rubor_rig::skin::volume::patches(&body, &skin::lamps(&shot), &view);
        let count = shown.iter().flatten().count();
        assert!(count >= if still.name == "tiny-face" { 5 } else { 80 }, "{}: {count}", still.name);
    }
}

#[test]
fn the_built_in_head_is_closed_at_the_neck_alone() {
    let (head, rig) = loaded();
    let (stills, _) = stills(Suite::Whole, &head, &rig).unwrap();
    for name in ["near-0", "open-mouth", "crease"] {
        let still = stills.iter().find(|s| s.name == name).unwrap();
        let body = Body::new(&head, &still.shot.face, Normals::Smooth).unwrap();
        assert_eq!(body.holes(), 1, "{name}");
        // A head with neck and shoulders, litres.
        let litres = 1e-6 * body.volume_mm3();
        assert!((3.0..12.0).contains(&litres), "{name}: {litres}");
    }
}

#[test]
fn the_integral_over_the_surface_is_the_last_choice_and_lists_of_pictures_are_refused() {
    let base = MediumName::Skin1.settings(&Settings::default()).unwrap();
    let all = choices(&base, &[], 2).unwrap();
    assert_eq!(all.last().unwrap().0, "reference-surface:2");
    assert!(all.len() > 15 && all.iter().all(|(_, s)| s.quality.profile == base.quality.profile));
    let listed = [("wrinkles".to_owned(), vec!["none".into(), "difference".into()])];
    let message = choices(&base, &listed, 2).unwrap_err().to_string();
    assert!(message.contains("--wrinkles"), "{message}");
}

#[test]
fn errors_leave_out_what_noise_adds() {
    // Truth 1 with noise of 0.1 that is really there, light 1.2: the error is 0.2, whatever the noise.
    let n = 4000;
    let mut random = rubor_rig::random::SplitMix64(3);
    let mut noisy = || 1.0 + 0.1 * 12f64.sqrt() * (random.uniform() - 0.5);
    let truth = Truth {
        light: (0..n).map(|_| [noisy() as f32; 3]).collect(),
        error: vec![[0.1; 3]; n],
        patches: (0..n).map(|i| (i % 4 > 0).then_some(Patch::Lit)).collect(),
        lost: 0.0,
    };
    let light: Vec<_> = (0..n).map(|i| (i % 5 > 0).then_some([1.2; 3])).collect();
    let point = Compared::new(&light, &truth).point();
    assert!((point.relative_rmse - 0.2).abs() < 0.01, "{point:?}");
    assert!((point.relative_rmse_with_noise - 0.05f64.sqrt()).abs() < 0.01, "{point:?}");
    assert!((point.bias["lit"] - 0.2).abs() < 0.01 && point.bias.len() == 1);
    assert!((noise(&truth) - 0.1).abs() < 2e-3);
}

#[test]
fn truths_are_read_again_only_where_nothing_changed() {
    let (head, rig) = loaded();
    let (stills, _) = stills(Suite::Quick, &head, &rig).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let flesh = MediumName::Skin1.flesh().unwrap();
    let of = |still: usize, paths| {
        let shot = skin::bare_shot(&stills[still].shot);
        truth::of(&head, &shot, &flesh, [12, 10], [paths, 1], Some(folder.path())).unwrap()
    };
    let first = of(0, 8);
    assert!(first.light.iter().flatten().any(|v| *v > 0.0));
    let about = folder.path().join("truth.json");
    let written = std::fs::metadata(&about).unwrap().modified().unwrap();
    let again = of(0, 8);
    assert_eq!((again.light, again.error, again.patches), (first.light.clone(), first.error, first.patches));
    assert_eq!(std::fs::metadata(&about).unwrap().modified().unwrap(), written, "nothing was drawn");
    assert_ne!(of(0, 16).light, first.light);
    assert_ne!(of(1, 16).light, first.light);
}
