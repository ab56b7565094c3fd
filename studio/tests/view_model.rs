//! A session of the viewer without its window: edits, steps, files and live weights.

#![cfg(feature = "view")]

use std::path::{Path, PathBuf};

use rubor::Outcome;
use rubor::view::document::{Document, Kind};
use rubor::view::live::Weights;
use rubor::view::messages::About;
use rubor::view::model::{Files, Model};
use rubor::view::pose::Group;
use rubor::view::tracks::path_of;
use rubor_renderer::settings::Settings;
use rubor_rig::timeline::{Ease, Track};

const RIG: &str = r#"// The rig of a test.
{
  "expressions": {
    // A smile.
    "joy": { "shapes": { "mouthSmileLeft": 1.0, "mouthSmileRight": 0.95 }, "wrinkles": { "crow-feet-left": 0.5 } },
  },
  "states": { "blush": { "hemoglobin": {}, "hemoglobinScale": 1.2 } },
}
"#;

const SEQUENCE: &str = r#"{
  "fps": 10, "duration": 2,
  "expressions": {
    // Comes and goes.
    "joy": [
      { "t": 0, "v": 0, "ease": "smooth" }, // calm
      { "t": 1, "v": 1 },
    ],
  },
  "shapes": { "eyeBlink": [{ "t": 0, "v": 0 }, { "t": 2, "v": 1 }] },
  "environment": { "name": "studio" },
}
"#;

struct Session {
    folder: tempfile::TempDir,
    model: Model,
}

impl Session {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).expect("a file");
            path
        };
        let files = Files {
            head: None,
            rig: Some(write("rig.json", RIG)),
            sequence: Some(write("sequence.json", SEQUENCE)),
        };
        let model = open(&files).expect("a session");
        Self { folder, model }
    }

    fn path(&self, kind: Kind) -> PathBuf {
        self.folder.path().join(format!("{}.json", kind.name()))
    }

    fn text(&self, kind: Kind) -> &str {
        self.model.document.part(kind).text()
    }

    fn error(&self, about: About) -> Option<&str> {
        self.model.messages.errors().find(|(a, _)| *a == about).map(|(_, text)| text)
    }

    fn weight(&self, group: Group, name: &str) -> f32 {
        let names = self.model.names(group);
        let index = names.iter().position(|n| n == name).expect("the name");
        self.model.weights(group)[index]
    }
}

fn open(files: &Files) -> Outcome<Model> {
    Model::open(files, |size| {
        let mut settings = Settings::default();
        settings.output.size = size.unwrap_or(settings.output.size);
        Ok(settings)
    })
}

#[test]
fn a_slider_becomes_a_key_that_undo_takes_back_and_save_writes() {
    let mut s = Session::new();
    s.model.seek(0.5);
    assert_eq!(s.weight(Group::Shapes, "eyeBlinkLeft"), 0.25);
    s.model.hold(Group::Shapes, "eyeBlinkLeft", 0.75);
    for half in ["eyeBlinkLeft", "eyeBlinkRight"] {
        assert_eq!(s.weight(Group::Shapes, half), 0.75, "both halves move");
    }
    s.model.key_held().expect("keys");
    assert!(s.model.pose.is_empty(), "what has a key is let go");
    let text = SEQUENCE
        .replace("{ \"t\": 0, \"v\": 0 }, {", "{ \"t\": 0, \"v\": 0 }, { \"t\": 0.5, \"v\": 0.75 }, {");
    assert_eq!(s.text(Kind::Sequence), text, "the track of both halves has a key more and nothing else");
    s.model.hold(Group::Expressions, "joy", 0.3);
    s.model.key_held().expect("keys");
    let line = "      { \"t\": 0, \"v\": 0, \"ease\": \"smooth\" }, // calm\n";
    let text =
        text.replace(line, &format!("{line}      {{ \"t\": 0.5, \"v\": 0.3, \"ease\": \"smooth\" }},\n"));
    assert_eq!(s.text(Kind::Sequence), text, "a new key goes on as the one before it");
    s.model.undo();
    s.model.undo();
    assert_eq!(s.text(Kind::Sequence), SEQUENCE);
    assert!(!s.model.document.is_changed());
    s.model.redo();
    s.model.redo();
    assert_eq!(s.text(Kind::Sequence), text);
    assert!(s.model.document.is_changed());
    assert!(s.model.save().is_empty());
    assert_eq!(std::fs::read_to_string(s.path(Kind::Sequence)).expect("saved"), text);
    assert!(!s.model.document.is_changed());
}

#[test]
fn halves_that_differ_become_two_tracks() {
    let mut s = Session::new();
    s.model.seek(1.0);
    s.model.links_pairs = false;
    s.model.hold(Group::Shapes, "eyeBlinkLeft", 0.9);
    assert_eq!(s.weight(Group::Shapes, "eyeBlinkRight"), 0.5, "the other half stays");
    s.model.key_held().expect("keys");
    let shapes = &s.model.document.sequence().shapes;
    let names: Vec<&str> = shapes.keys().map(String::as_str).collect();
    assert_eq!(names, ["eyeBlinkLeft", "eyeBlinkRight"]);
    assert_eq!((shapes["eyeBlinkLeft"].at(1.0), shapes["eyeBlinkRight"].at(1.0)), (0.9, 0.5));
    s.model.mirror();
    assert_eq!(s.weight(Group::Shapes, "eyeBlinkRight"), 0.9);
    assert_eq!(s.weight(Group::Shapes, "eyeBlinkLeft"), 0.5);
    s.model.release_all();
    assert_eq!(s.weight(Group::Shapes, "eyeBlinkLeft"), 0.9);
}

#[test]
fn keys_are_moved_between_neighbours_eased_and_deleted() {
    let mut s = Session::new();
    let joy = path_of("expressions", "joy");
    let document = &mut s.model.document;
    document.set_key(&joy, 1.5, 0.2, None).expect("a key at the end");
    document.move_key(&joy, 1, 9.0, Some(0.6), None).expect("it stops at its neighbour");
    let keys = |document: &Document| match &document.sequence().expressions["joy"] {
        Track::Keys(keys) => keys.iter().map(|k| (k.t, k.v, k.ease)).collect::<Vec<_>>(),
        Track::Constant(_) => Vec::new(),
    };
    let (smooth, linear) = (Ease::Smooth, Ease::Linear);
    assert_eq!(keys(document), [(0.0, 0.0, smooth), (1.499, 0.6, linear), (1.5, 0.2, linear)]);
    document.set_ease(&joy, 1, Ease::Step).expect("an easing");
    assert_eq!(keys(document)[1].2, Ease::Step);
    for _ in 0..3 {
        document.delete_key(&joy, 0).expect("a key");
    }
    assert!(document.sequence().expressions.is_empty(), "a track without keys goes");
    assert!(document.part(Kind::Sequence).text().contains("// Comes and goes."));
    assert!(document.delete_key(&joy, 0).is_err());
    assert!(document.set_key(&joy, 0.0, 3.0, None).is_err(), "weights end at 2");
    assert!(document.sequence().expressions.is_empty(), "what is refused changes nothing");
}

#[test]
fn the_rig_is_edited_in_place() {
    let mut s = Session::new();
    let joy = (Group::Expressions, "joy");
    s.model.set_rig_weight(joy, "shapes", "mouthSmileLeft", 0.5).expect("a weight");
    s.model.set_rig_weight(joy, "shapes", "jawOpen", 0.25).expect("a new weight");
    s.model.set_rig_weight(joy, "wrinkles", "crow-feet-left", 0.25).expect("a zone");
    s.model.set_hemoglobin_scale((Group::States, "blush"), 1.3).expect("a factor");
    let expected = RIG
        .replace(
            "\"mouthSmileLeft\": 1.0, \"mouthSmileRight\": 0.95 }",
            "\"mouthSmileLeft\": 0.5, \"mouthSmileRight\": 0.5, \"jawOpen\": 0.25 }",
        )
        .replace("\"crow-feet-left\": 0.5 }", "\"crow-feet-left\": 0.25, \"crow-feet-right\": 0.25 }")
        .replace("1.2 }", "1.3 }");
    assert_eq!(s.text(Kind::Rig), expected);
    s.model.add_expression("smirk").expect("an expression");
    assert!(s.model.add_expression("smirk").is_err() && s.model.add_expression(" ").is_err());
    s.model.solo = Some((Group::Expressions, "joy".into()));
    s.model.compose();
    let shot = s.model.shot();
    let smile = s.model.names(Group::Shapes).iter().position(|n| n == "mouthSmileLeft").expect("the shape");
    assert_eq!(shot.face.shapes[smile], 0.5, "alone at full weight");
}

#[test]
fn files_are_read_again_and_broken_ones_leave_the_last_good_state() {
    let mut s = Session::new();
    s.model.seek(1.0);
    let before = s.model.shot();
    std::fs::write(s.path(Kind::Rig), RIG.replace("\"hemoglobinScale\": 1.2", "\"hemoglobinScale\": oops"))
        .expect("a file");
    s.model.reload(Kind::Rig);
    let error = s.error(About::File(Kind::Rig)).expect("an error");
    assert!(error.contains("rig.json:7:63"), "{error}");
    assert_eq!(s.model.shot(), before);
    let stronger = RIG.replace("\"mouthSmileLeft\": 1.0", "\"mouthSmileLeft\": 0.4");
    std::fs::write(s.path(Kind::Rig), &stronger).expect("a file");
    s.model.reload(Kind::Rig);
    assert_eq!(s.error(About::File(Kind::Rig)), None);
    assert_ne!(s.model.shot(), before);
    assert_eq!(s.text(Kind::Rig), stronger);
    s.model.undo();
    assert_eq!(s.text(Kind::Rig), RIG, "what a file brought can be taken back too");
    s.model.redo();
    // A rig that lacks what the sequence plays is right by itself and wrong with it.
    std::fs::write(s.path(Kind::Rig), RIG.replace("\"joy\":", "\"jooy\":")).expect("a file");
    let before = s.model.shot();
    s.model.reload(Kind::Rig);
    let error = s.error(About::Scene).expect("an error");
    assert!(error.contains("sequence.json:5:5") && error.contains("did you mean \"jooy\""), "{error}");
    assert_eq!(s.model.shot(), before);
    std::fs::write(s.path(Kind::Rig), RIG).expect("a file");
    s.model.reload(Kind::Rig);
    assert_eq!(s.model.messages.errors().count(), 0);
    std::fs::remove_file(s.path(Kind::Rig)).expect("it is removed");
    s.model.reload(Kind::Rig);
    assert!(s.error(About::File(Kind::Rig)).expect("an error").contains("no such file"));
    assert_eq!(s.text(Kind::Rig), RIG);
    assert!(s.model.save_one(Kind::Rig, None), "save writes it again");
    assert_eq!(std::fs::read_to_string(s.path(Kind::Rig)).expect("a file"), RIG);
    assert_eq!(s.model.messages.errors().count(), 0);
}

#[test]
fn changes_on_both_sides_are_a_choice() {
    let mut s = Session::new();
    for takes_file in [false, true] {
        let mine = s.text(Kind::Rig).to_owned();
        s.model
            .set_hemoglobin_scale((Group::States, "blush"), if takes_file { 1.5 } else { 1.4 })
            .expect("an edit");
        let edited = s.text(Kind::Rig).to_owned();
        assert_ne!(mine, edited);
        let theirs = RIG.replace("// A smile.", if takes_file { "// Theirs." } else { "// Also theirs." });
        std::fs::write(s.path(Kind::Rig), &theirs).expect("a file");
        s.model.reload(Kind::Rig);
        assert!(s.error(About::File(Kind::Rig)).expect("a question").contains("another program"));
        assert_eq!(s.text(Kind::Rig), edited, "nothing is lost meanwhile");
        s.model.document.settle(Kind::Rig, takes_file).expect("a choice");
        assert_eq!(s.text(Kind::Rig), if takes_file { &theirs } else { &edited });
        s.model.undo();
        assert_eq!(s.text(Kind::Rig), if takes_file { &edited } else { &mine });
        s.model.redo();
        assert!(s.model.save_one(Kind::Rig, None));
    }
}

#[test]
fn a_text_without_a_file_asks_for_one_and_is_rescued() {
    let mut model = open(&Files::default()).expect("the built-in head");
    model.hold(Group::Expressions, "joy", 0.5);
    model.key_held().expect("a key");
    assert_eq!(model.save(), [Kind::Sequence]);
    let folder = tempfile::tempdir().expect("a folder");
    let nowhere = folder.path().join("none/sequence.json");
    assert!(!model.save_one(Kind::Sequence, Some(&nowhere)), "no such folder");
    assert!(model.document.is_changed() && model.document.part(Kind::Sequence).path.is_none());
    let path = folder.path().join("sequence.json");
    assert!(model.save_one(Kind::Sequence, Some(&path)));
    assert!(!model.document.is_changed());
    model.hold(Group::Expressions, "joy", 0.75);
    model.key_held().expect("a key");
    let rescued = model.document.rescue().expect("a copy");
    assert_eq!(rescued, [Path::new(&format!("{}.unsaved", path.display()))]);
    assert_eq!(
        std::fs::read_to_string(&rescued[0]).expect("a copy"),
        model.document.part(Kind::Sequence).text()
    );
    assert_ne!(std::fs::read_to_string(&path).expect("the file"), model.document.part(Kind::Sequence).text());
}

#[test]
fn live_weights_take_any_spelling_and_strange_names_get_the_nearest() {
    let mut s = Session::new();
    let weights = Weights {
        shapes: vec![("EyeBlink_L".into(), 0.8), ("jawOpne".into(), 0.5)],
        expressions: vec![("Joy".into(), 0.5), ("anger".into(), 1.0)],
        states: vec![],
        head_degrees: Some([10.0, 0.0, 0.0]),
    };
    let unknown = s.model.take_live(&weights);
    assert_eq!(unknown.len(), 2, "{unknown:?}");
    assert!(unknown[0].contains("jawOpne") && unknown[0].contains("did you mean \"jawOpen\""), "{unknown:?}");
    assert!(unknown[1].contains("anger"), "{unknown:?}");
    assert_eq!(s.weight(Group::Shapes, "eyeBlinkLeft"), 0.8);
    assert_eq!(s.weight(Group::Expressions, "joy"), 0.5);
    assert!(s.model.shot().face.head_rotation.y > 0.08, "the head turns to its left");
    s.model.hold(Group::Expressions, "joy", 0.1);
    assert_eq!(s.weight(Group::Expressions, "joy"), 0.1, "a hand wins over what arrives");
    assert!(!s.model.document.is_changed());
}
