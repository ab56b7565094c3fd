//! What riggers write: messages with places, the default rig, the demo sequence, and what both do to a head.

use glam::{Quat, Vec3};
use rubor_rig::bind::BoundRig;
use rubor_rig::error::RigError;
use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::{Rig, rig_schema};
use rubor_rig::head::{BlendShape, Distribution, Head, WrinkleZone};
use rubor_rig::map::Map;
use rubor_rig::names::ARKIT;
use rubor_rig::timeline::{Ease, LightKind, Sequence, Track, sequence_schema};
use std::io::Write;

/// Zones of Jimenez 2012 table 8.1 in the order of its columns.
const TABLE_ZONES: [&str; 8] = [
    "forehead-outer-right",
    "forehead-outer-left",
    "forehead-inner-right",
    "forehead-inner-left",
    "nose-right",
    "nose-left",
    "glabella",
    "chin",
];
/// Jimenez 2012 table 8.1.
const TABLE: [(&str, [f32; 8]); 6] = [
    ("joy", [1.0, 1.0, 0.2, 0.2, 0.0, 0.0, 0.0, 0.0]),
    ("surprise", [0.8, 0.8, 0.8, 0.8, 0.0, 0.0, 0.0, 0.0]),
    ("fear", [0.2, 0.2, 0.75, 0.75, 0.3, 0.3, 0.0, 0.6]),
    ("anger", [-0.6, -0.6, -0.8, -0.8, 0.8, 0.8, 1.0, 0.0]),
    ("disgust", [0.0, 0.0, -0.1, -0.1, 1.0, 1.0, 1.0, 0.5]),
    ("sadness", [0.2, 0.2, 0.75, 0.75, 0.0, 0.0, 0.1, 1.0]),
];
const EMOTIONS: [&str; 6] = ["joy", "surprise", "fear", "anger", "disgust", "sadness"];

/// A head of names only: nothing here looks at geometry.
fn head(shapes: &[&str], zones: &[&str], distributions: &[&str]) -> Head {
    let map = || Map { width: 1, height: 1, channels: 1, values: vec![0.5] };
    let mut head = Head { name: "names".into(), ..Head::default() };
    head.shapes = shapes.iter().map(|n| BlendShape { name: (*n).into(), ..BlendShape::default() }).collect();
    head.maps.zones =
        zones.iter().map(|n| WrinkleZone { name: (*n).into(), wrinkle_map: 0, mask: map() }).collect();
    head.maps.distributions =
        distributions.iter().map(|n| Distribution { name: (*n).into(), scale: map(), bias: map() }).collect();
    head
}

fn arkit_head() -> Head {
    head(&ARKIT, &TABLE_ZONES, &EMOTIONS)
}

fn rig(text: &str) -> Rig {
    Rig::from_json("rig.json", text).unwrap_or_else(|e| panic!("{e}"))
}

fn bind(head: &Head, text: &str) -> BoundRig {
    BoundRig::new(head, &rig(text)).unwrap_or_else(|e| panic!("{e}")).0
}

/// Takes the mark `@@` out of a text; the place of the mark is where the error belongs.
fn without_mark(marked: &str) -> (String, usize, usize) {
    let at = marked.find("@@").expect("a mark");
    let before = &marked[..at];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
    (marked.replacen("@@", "", 1), line, column)
}

/// Reads a marked text as `T` would and compares the error's place, a word of the message and the nearest name.
fn assert_error(
    marked: &str,
    read: impl Fn(&str) -> Result<(), RigError>,
    word: &str,
    nearest_name: Option<&str>,
) {
    let (text, line, column) = without_mark(marked);
    let error = read(&text).expect_err(marked);
    let message = error.to_string();
    assert_eq!((error.place.line, error.place.column), (line, column), "{message}\nin {marked}");
    assert!(message.contains(word), "{message:?} lacks {word:?}\nin {marked}");
    assert_eq!(error.nearest.as_deref(), nearest_name, "{message}");
    assert!(message.starts_with(&format!("wrong.json:{line}:{column}: found ")), "{message}");
}

fn read_rig(text: &str) -> Result<(), RigError> {
    Rig::from_json("wrong.json", text).map(|_| ())
}

fn bind_rig(text: &str) -> Result<(), RigError> {
    BoundRig::new(&arkit_head(), &Rig::from_json("wrong.json", text)?).map(|_| ())
}

fn read_sequence(text: &str) -> Result<(), RigError> {
    let rig = Rig::default_rig()?;
    Evaluator::new(&arkit_head(), &rig, &Sequence::from_json("wrong.json", text)?).map(|_| ())
}

#[test]
fn syntax_errors_have_a_place() {
    for (marked, word) in [
        ("@@", "an object"),
        ("// only a comment@@", "an object"),
        ("{ \"expressions\": { }@@ \"states\": {} }", "`\"states\": {} }`, expected a comma"),
        ("{\n  \"expressions\" @@{ } }", "a colon"),
        ("{ @@expressions: {} }", "double quotes"),
        ("{ @@'expressions': {} }", "double quotes"),
        ("@@{ \"expressions\": {}", "a closing }"),
        ("{ \"description\": @@\"never ends }", "ends in a double quote"),
        ("{ /* é */ \"expressions\": @@nul }", "a value"),
        ("{ } @@{ }", "the end of the file"),
        ("{ \"inbetweens\": [ { \"weight\": @@.5 } ] }", "decimal number"),
        ("{ \"inbetweens\": [ { \"weight\": @@NaN } ] }", "a number"),
        ("{ @@/* never ends", "a closing */"),
        ("{ \"inbetweens\": [ @@}", "a value, or the bracket"),
    ] {
        assert_error(marked, read_rig, word, None);
    }
}

#[test]
fn wrong_rigs_have_a_place_and_a_nearest_name() {
    let cases: [(&str, &str, Option<&str>); 17] = [
        ("{ @@\"expresions\": {} }", "unknown field", Some("expressions")),
        ("{ \"expressions\": { \"joy\": { @@\"shape\": {} } } }", "unknown field", Some("shapes")),
        ("{ \"expressions\": { \"joy\": { @@\"hemoglobinscale\": 1 } } }", "field", Some("hemoglobinScale")),
        ("{ \"expressions\": { \"joy\": { \"shapes\": { \"jawOpen\": @@\"1\" } } } }", "a number", None),
        ("{ \"expressions\": { \"joy\": { \"shapes\": @@[ 1 ] } } }", "an object", None),
        ("{ \"expressions\": { \"joy\": { \"shapes\": { \"jawOpen\": @@null } } } }", "a number", None),
        ("{ \"expressions\": { \"joy\": { \"shapes\": { \"jawOpen\": @@1e39 } } } }", "finite", None),
        ("{ \"expressions\": { \"joy\": { \"shapes\": { \"jawOpen\": @@1e999 } } } }", "finite", None),
        ("{ \"expressions\": { \"joy\": {},\n @@\"joy\": {} } }", "once", None),
        ("{ \"expressions\": { \"joy\": { \"hemoglobin\": { \"joy\": @@-0.1 } } } }", "0 or more", None),
        (
            "{ \"expressions\": { \"joy\": { \"hemoglobin\": @@{ \"joy\": 0.6, \"fear\": 0.5 } } } }",
            "sum to 1.1",
            None,
        ),
        ("{ \"states\": { \"x\": { \"hemoglobinScale\": @@-1 } } }", "0 or more", None),
        ("{ \"combinations\": [ { \"shape\": \"jawOpen\", \"drivers\": @@[] } ] }", "one driver", None),
        (
            "{ \"combinations\": [ { \"shape\": \"a\", \"drivers\": [ \"b\" ], \"mode\": @@\"prodct\" } ] }",
            "unknown name",
            Some("product"),
        ),
        ("{ \"combinations\": [ @@{ \"shape\": \"a\" } ] }", "\"drivers\"", None),
        ("{ \"inbetweens\": [ { \"shape\": \"a\", \"target\": \"b\", \"weight\": @@1 } ] }", "between", None),
        (
            "{ \"inbetweens\": [ { \"shape\": \"a\", \"target\": @@\"a\", \"weight\": 0.5 } ] }",
            "another",
            None,
        ),
    ];
    for (marked, word, nearest_name) in cases {
        assert_error(marked, read_rig, word, nearest_name);
    }
    for (marked, nearest_name) in [
        (
            "{ \"expressions\": {\n\t\"joy\": { \"shapes\": { @@\"mouthSmielLeft\": 1 } } } }",
            Some("mouthSmileLeft"),
        ),
        ("{ \"expressions\": { \"joy\": { \"shapes\": { @@\"qqqq\": 1 } } } }", None),
        (
            "{ \"combinations\": [ { \"shape\": @@\"jawOpn\", \"drivers\": [ \"jawLeft\" ] } ] }",
            Some("jawOpen"),
        ),
        (
            "{ \"combinations\": [ { \"shape\": \"jawOpen\", \"drivers\": [ \"jawLeft\", @@\"jawRigth\" ] } ] }",
            Some("jawRight"),
        ),
    ] {
        assert_error(marked, bind_rig, "unknown shape", nearest_name);
    }
}

#[test]
fn wrong_sequences_have_a_place_and_a_nearest_name() {
    let body = |rest: &str| format!("{{ \"fps\": 24, \"duration\": 2,\n {rest} }}");
    for (marked, word, nearest_name) in [
        ("{ \"fps\": @@0, \"duration\": 1 }", "more than 0", None),
        ("{ \"fps\": @@-24, \"duration\": 1 }", "more than 0", None),
        ("{ \"fps\": 24, \"duration\": @@0 }", "more than 0", None),
        ("{ \"fps\": 24, \"duration\": @@\"2 s\" }", "a number", None),
        ("@@{ \"fps\": 24 }", "\"duration\"", None),
        ("{ \"fps\": 24, \"duration\": 1, \"size\": @@[0, 640] }", "1 pixel", None),
        ("{ \"fps\": 24, \"duration\": 1, \"size\": @@[640] }", "2", None),
        ("{ \"fps\": 24, \"duration\": 1, \"size\": @@[640, 480, 3] }", "an array of 2", None),
        ("{ \"fps\": 24, \"duration\": 1, \"size\": [640, @@-1] }", "0 or more", None),
        ("{ \"fps\": 24, \"duration\": 1, \"size\": [640, @@0.5] }", "whole number", None),
    ] {
        assert_error(marked, read_sequence, word, nearest_name);
    }
    for (rest, word, nearest_name) in [
        ("\"expressions\": { @@\"angre\": 1 }", "unknown expression", Some("anger")),
        ("\"expressions\": { @@\"Joy\": 1 }", "unknown expression", Some("joy")),
        ("\"states\": { @@\"palor\": 1 }", "unknown state", Some("pallor")),
        ("\"shapes\": { @@\"eyeBlnk\": 1 }", "unknown shape", Some("eyeBlinkLeft")),
        ("\"expressions\": { \"joy\": @@[] }", "array of keys", None),
        ("\"expressions\": { \"joy\": [ @@1 ] }", "a key", None),
        ("\"expressions\": { \"joy\": @@{ \"t\": 0, \"v\": 1 } }", "array of keys", None),
        ("\"expressions\": { \"joy\": @@-1 }", "from 0 to 2", None),
        ("\"expressions\": { \"joy\": [ { \"t\": 0, \"v\": @@3 } ] }", "from 0 to 2", None),
        ("\"expressions\": { \"joy\": [ { \"t\": @@-0.5, \"v\": 1 } ] }", "0 or more", None),
        ("\"expressions\": { \"joy\": [ @@{ \"t\": 0 } ] }", "\"v\"", None),
        (
            "\"expressions\": { \"joy\": [ { \"t\": 0, \"v\": 1, @@\"eas\": \"step\" } ] }",
            "field",
            Some("ease"),
        ),
        (
            "\"expressions\": { \"joy\": [ { \"t\": 0, \"v\": 1, \"ease\": @@\"smoth\" } ] }",
            "unknown name",
            Some("smooth"),
        ),
        (
            "\"expressions\": { \"joy\": [ { \"t\": 1, \"v\": 1 },\n { \"t\": @@0.5, \"v\": 0 } ] }",
            "after that of the key before it (1)",
            None,
        ),
        (
            "\"expressions\": { \"joy\": [ { \"t\": 1, \"v\": 1 }, { \"t\": @@1, \"v\": 0 } ] }",
            "after that of the key before it (1)",
            None,
        ),
        ("\"camera\": { \"framing\": @@\"clos\" }", "unknown name", Some("close")),
        ("\"camera\": { \"position\": @@[0, 1] }", "three numbers", None),
        ("\"camera\": { \"position\": @@[0, 1, 2, 3] }", "three numbers", None),
        ("\"camera\": { \"position\": [{ \"t\": 0, \"v\": @@[0, 1] }] }", "3", None),
        ("\"camera\": { \"position\": @@1 }", "three numbers", None),
        ("\"camera\": { \"fovDegrees\": @@180 }", "from 1 to 170", None),
        ("\"lights\": [ @@{ \"kind\": \"spot\" } ]", "\"position\"", None),
        ("\"lights\": [ @@{ \"kind\": \"directional\" } ]", "\"direction\"", None),
        ("\"lights\": [ { \"kind\": @@\"sun\" } ]", "\"directional\", \"spot\", \"point\"", None),
        ("\"lights\": [ { \"kind\": \"directional\", \"direction\": @@[0, 0, 0] } ]", "length 0", None),
        (
            "\"lights\": [ { \"kind\": \"point\", \"position\": [0, 0, 1], \"intensity\": @@-1 } ]",
            "0 or more",
            None,
        ),
        (
            "\"lights\": [ { \"kind\": \"spot\", \"position\": [0, 0, 1], \"coneDegrees\": @@[50, 40] } ]",
            "inner",
            None,
        ),
        ("\"environment\": @@{ }", "\"name\"", None),
        ("\"head\": { @@\"yaw\": 3 }", "unknown field", Some("yawDegrees")),
    ] {
        assert_error(&body(rest), read_sequence, word, nearest_name);
    }
}

#[test]
fn numbers_that_json_cannot_hold_are_errors_too() {
    let mut sequence = Sequence::still(f64::NAN, 1.0);
    assert!(sequence.check().is_err());
    sequence.fps = f64::INFINITY;
    assert!(sequence.check().is_err());
    sequence.fps = 24.0;
    sequence.duration = f64::NAN;
    let error = sequence.check().unwrap_err();
    assert!(error.to_string().starts_with("found NaN, expected a length"), "{error}");
    sequence.duration = 1.0;
    assert!(sequence.check().is_ok());
    sequence.shapes.insert("jawOpen".into(), Track::Constant(f32::NAN));
    assert!(sequence.check().is_err());
    sequence.shapes.insert("jawOpen".into(), Track::Keys(Vec::new()));
    assert!(sequence.check().is_err());
}

#[test]
fn missing_files_are_named() {
    let error = Rig::load(std::path::Path::new("no/such/rig.json")).unwrap_err();
    assert_eq!(error.place.file, "no/such/rig.json");
    assert!(error.to_string().starts_with("no/such/rig.json: found "), "{error}");
}

#[test]
fn comments_trailing_commas_and_a_byte_order_mark_are_fine() {
    let text = "\u{feff}{ // line\n /* block\n */ \"expressions\": { \"a\": { \"shapes\": { \"jawOpen\": 0.5, }, }, }, }";
    assert_eq!(rig(text).expressions["a"].shapes["jawOpen"], 0.5);
    assert_error("{ // \"a\n/* \n */ @@\"expression\": {} }", read_rig, "unknown field", Some("expressions"));
    assert_error(
        "\u{feff}{ @@\"expression\": {} }".trim_start_matches('\u{feff}'),
        read_rig,
        "field",
        Some("expressions"),
    );
    assert!(Rig::from_json("deep.json", &"[".repeat(100_000)).is_err());
}

#[test]
fn defaults_survive_a_round_trip() {
    let rig = Rig::default_rig().unwrap();
    let text = serde_json::to_string(&rig).unwrap();
    assert_eq!(Rig::from_json("again.json", &text).unwrap(), rig);
    let demo = Sequence::demo().unwrap();
    let text = serde_json::to_string(&demo).unwrap();
    assert_eq!(Sequence::from_json("again.json", &text).unwrap(), demo);
}

#[test]
fn the_default_rig_is_table_8_1() {
    let rig = Rig::default_rig().unwrap();
    for (name, row) in TABLE {
        for (zone, weight) in TABLE_ZONES.iter().zip(row) {
            assert_eq!(rig.expressions[name].wrinkles[*zone], weight, "{name} {zone}");
        }
        assert_eq!(rig.expressions[name].hemoglobin[name], 1.0);
    }
    assert_eq!(rig.expressions["anger"].hemoglobin_scale, 1.27);
    assert_eq!(rig.expressions["fear"].hemoglobin_scale, 0.81);
    for state in ["exercise", "alcohol", "blush", "pallor"] {
        assert!(rig.states.contains_key(state));
    }
}

#[test]
fn the_default_rig_fits_an_arkit_head_and_is_slightly_asymmetric() {
    let rig = Rig::default_rig().unwrap();
    let (_, notes) = BoundRig::new(&arkit_head(), &rig).unwrap();
    // Zones beyond the table, and nothing else.
    assert_eq!(notes.len(), 4, "{notes:?}");
    assert!(notes.iter().all(|n| n.message.contains("crow-feet") || n.message.contains("nasolabial")));
    assert!(notes.iter().all(|n| n.place.file == "default_rig.json" && n.place.line > 10));
    for name in EMOTIONS {
        let shapes = &rig.expressions[name].shapes;
        let pairs = shapes.iter().filter_map(|(left, weight)| {
            left.strip_suffix("Left").map(|base| (*weight, shapes[&format!("{base}Right")]))
        });
        let differences: Vec<f32> = pairs.map(|(l, r)| (l - r).abs()).collect();
        assert!(differences.iter().any(|d| *d > 0.0), "{name} is symmetric");
        assert!(differences.iter().all(|d| *d <= 0.08), "{name}: {differences:?}");
        assert!(shapes.values().any(|w| *w >= 0.8), "{name} is weak");
    }
}

#[test]
fn surprise_and_anger_cancel_on_the_forehead() {
    let bound = BoundRig::new(&arkit_head(), &Rig::default_rig().unwrap()).unwrap().0;
    let zones_of = |names: &[&str]| {
        let mut weights = bound.neutral_weights();
        for name in names {
            weights.expressions[bound.expression_index(name).unwrap()] = 1.0;
        }
        bound.face(&weights).zones
    };
    assert_eq!(zones_of(&["surprise"])[..4], [0.8; 4]);
    assert_eq!(zones_of(&["anger"])[..4], [0.0; 4], "a negative sum is no wrinkle");
    let both = zones_of(&["surprise", "anger"]);
    for (zone, expected) in both.iter().zip([0.2, 0.2, 0.0, 0.0, 0.8, 0.8, 1.0, 0.0]) {
        assert!((zone - expected).abs() < 1e-6, "{both:?}");
    }
    // joy + surprise would be 1.8 at the outer forehead.
    assert_eq!(zones_of(&["joy", "surprise"])[0], 1.0);
}

#[test]
fn shapes_add_and_clamp() {
    let text = r#"{ "expressions": {
        "a": { "shapes": { "jawOpen": 0.7, "browInnerUp": 0.5 } },
        "b": { "shapes": { "jawOpen": 0.6, "browInnerUp": -0.25 } },
    } }"#;
    let bound = bind(&head(&["jawOpen", "browInnerUp_L", "browInnerUp_R"], &[], &[]), text);
    let mut weights = bound.neutral_weights();
    weights.expressions = vec![0.5, 0.5];
    let half = bound.face(&weights).shapes;
    for (weight, expected) in half.iter().zip([0.65, 0.125, 0.125]) {
        assert!((weight - expected).abs() < 1e-6, "{half:?}");
    }
    weights.expressions = vec![1.0, 1.0];
    weights.shapes[2] = -1.0;
    let full = bound.face(&weights).shapes;
    // The sum of expressions is held at 1; a track of a shape may go below 0.
    assert_eq!(full, [1.0, 0.25, -0.75]);
}

#[test]
fn distributions_share_and_scales_add() {
    let text = r#"{ "expressions": {
        "a": { "hemoglobin": { "joy": 0.8 }, "hemoglobinScale": 1.27 },
        "b": { "hemoglobin": { "fear": 0.8 }, "hemoglobinScale": 0.81 },
    }, "states": { "off": { "hemoglobinScale": 0 } } }"#;
    let bound = bind(&head(&[], &[], &["joy", "fear"]), text);
    let face = |a: f32, b: f32, off: f32| {
        let mut weights = bound.neutral_weights();
        weights.expressions = vec![a, b];
        weights.states = vec![off];
        bound.face(&weights)
    };
    assert_eq!(face(0.5, 0.25, 0.0).distributions, [0.4, 0.2]);
    assert!((face(0.5, 0.0, 0.0).hemoglobin_scale - 1.135).abs() < 1e-6);
    let both = face(1.0, 1.0, 0.0);
    assert_eq!(both.distributions, [0.5, 0.5]);
    assert!((both.hemoglobin_scale - 1.08).abs() < 1e-6);
    assert_eq!(face(0.0, 0.0, 2.0).hemoglobin_scale, 0.0, "never negative");
    assert_eq!(face(0.0, 0.0, 0.0).hemoglobin_scale, 1.0);
}

#[test]
fn a_state_falls_back_on_a_head_without_its_distribution() {
    let rig = Rig::default_rig().unwrap();
    let blush = |distributions: &[&str]| {
        let (bound, _) = BoundRig::new(&head(&ARKIT, &[], distributions), &rig).unwrap();
        let mut weights = bound.neutral_weights();
        weights.states[bound.state_index("blush").unwrap()] = 1.0;
        bound.face(&weights)
    };
    let own = blush(&["anger", "blush"]);
    assert_eq!((own.distributions, own.hemoglobin_scale), (vec![0.0, 1.0], 1.0));
    let fallback = blush(&["anger"]);
    assert_eq!((fallback.distributions, fallback.hemoglobin_scale), (vec![0.6], 1.15));
    let none = blush(&[]);
    assert_eq!((none.distributions.len(), none.hemoglobin_scale), (0, 1.15));
}

#[test]
fn combinations_follow_their_drivers() {
    let text = |mode: &str| {
        format!(
            r#"{{ "combinations": [
                {{ "shape": "smileOpen", "drivers": ["jawOpen", "mouthSmile"], "mode": "{mode}" }},
            ] }}"#
        )
    };
    let head = head(&["jawOpen", "mouthSmile_L", "mouthSmile_R", "smileOpen"], &[], &[]);
    let corrective = |mode: &str, weights: [f32; 4]| {
        let bound = bind(&head, &text(mode));
        let mut w = bound.neutral_weights();
        w.shapes = weights.to_vec();
        bound.face(&w).shapes[3]
    };
    assert_eq!(corrective("product", [0.5, 0.5, 1.0, 0.0]), 0.25);
    assert_eq!(corrective("min", [0.5, 0.75, 1.0, 0.0]), 0.5);
    assert_eq!(corrective("min", [0.0, 1.0, 1.0, 0.0]), 0.0);
    assert_eq!(corrective("product", [1.0, 1.0, 1.0, 0.5]), 1.0, "added to its own weight, clamped");
    // The head lacks an ARKit driver: there is a note, and the other drivers alone do not trigger the corrective.
    let lacking = self::head(&["jawOpen", "smileOpen"], &[], &[]);
    let (bound, notes) = BoundRig::new(&lacking, &rig(&text("min"))).unwrap();
    assert_eq!(notes.len(), 1);
    let mut weights = bound.neutral_weights();
    weights.shapes = vec![1.0, 0.0];
    assert_eq!(bound.face(&weights).shapes, [1.0, 0.0]);
}

#[test]
fn inbetweens_are_piecewise_linear() {
    let head = head(&["eyeBlinkLeft", "half", "most"], &[], &[]);
    let bound = bind(
        &head,
        r#"{ "inbetweens": [
            { "shape": "eyeBlinkLeft", "target": "most", "weight": 0.75 },
            { "shape": "eyeBlinkLeft", "target": "half", "weight": 0.5 },
        ] }"#,
    );
    let at = |weight: f32| {
        let mut weights = bound.neutral_weights();
        weights.shapes[0] = weight;
        bound.face(&weights).shapes
    };
    assert_eq!(at(0.0), [0.0, 0.0, 0.0]);
    assert_eq!(at(0.25), [0.0, 0.5, 0.0]);
    assert_eq!(at(0.5), [0.0, 1.0, 0.0]);
    assert_eq!(at(0.625), [0.0, 0.5, 0.5]);
    assert_eq!(at(0.75), [0.0, 0.0, 1.0]);
    assert_eq!(at(0.875), [0.5, 0.0, 0.5]);
    assert_eq!(at(1.0), [1.0, 0.0, 0.0]);
}

#[test]
fn inbetweens_of_a_pair_go_side_by_side() {
    let head = head(&["eyeBlink_L", "eyeBlink_R", "cheekRaiser_L", "cheekRaiser_R"], &[], &[]);
    let text = r#"{ "inbetweens": [{ "shape": "eyeBlink", "target": "cheekRaiser", "weight": 0.5 }] }"#;
    let bound = bind(&head, text);
    let mut weights = bound.neutral_weights();
    weights.shapes[1] = 0.5;
    assert_eq!(bound.face(&weights).shapes, [0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn easings_start_at_0_and_end_at_1_and_rise() {
    for ease in Ease::ALL {
        assert_eq!(ease.apply(0.0), 0.0, "{ease:?}");
        assert_eq!(ease.apply(1.0), 1.0, "{ease:?}");
        let steps: Vec<f64> = (0..=1000).map(|i| ease.apply(f64::from(i) / 1000.0)).collect();
        assert!(steps.windows(2).all(|w| w[0] <= w[1]), "{ease:?}");
        assert!(steps.iter().all(|v| (0.0..=1.0).contains(v)), "{ease:?}");
    }
    assert_eq!(Ease::Smooth.apply(0.5), 0.5);
    assert_eq!(Ease::EaseIn.apply(0.5), 0.25);
    assert_eq!(Ease::EaseOut.apply(0.5), 0.75);
    assert_eq!(Ease::Step.apply(0.999), 0.0);
}

#[test]
fn tracks_hold_outside_and_hit_their_keys() {
    let text = r#"{ "fps": 10, "duration": 4, "expressions": { "joy": [
        { "t": 1, "v": 0.25, "ease": "step" }, { "t": 2, "v": 0.5 }, { "t": 3, "v": 1 },
    ] }, "camera": { "target": [{ "t": 0, "v": [0, 1, 2] }, { "t": 2, "v": [2, 1, 0] }] } }"#;
    let sequence = Sequence::from_json("s.json", text).unwrap();
    let joy = &sequence.expressions["joy"];
    for (time, value) in [
        (-1.0, 0.25),
        (0.0, 0.25),
        (1.0, 0.25),
        (1.99, 0.25),
        (2.0, 0.5),
        (2.5, 0.75),
        (3.0, 1.0),
        (9.0, 1.0),
    ] {
        assert_eq!(joy.at(time), value, "at {time}");
    }
    assert_eq!(sequence.camera.target.as_ref().unwrap().at(1.0), [1.0, 1.0, 1.0]);
}

#[test]
fn frames_are_counted_without_rounding_surprises() {
    for (fps, duration, frames) in [
        (24.0, 12.0, 288),
        (24.0, 0.01, 1),
        (30.0, 0.1, 3),
        (29.97, 1.0, 30),
        (4.0, 12.0, 48),
        (10.0, 0.3, 3),
    ] {
        let sequence = Sequence::still(fps, duration);
        assert_eq!(sequence.frame_count(), frames, "{fps} fps, {duration} s");
        assert!(sequence.frame_time_s(frames - 1) < duration);
    }
}

#[test]
fn the_demo_shows_what_it_promises() {
    let head =
        head(&ARKIT, &TABLE_ZONES, &["joy", "surprise", "fear", "anger", "disgust", "sadness", "exercise"]);
    let (rig, mut demo) = (Rig::default_rig().unwrap(), Sequence::demo().unwrap());
    demo.fps = 4.0; // the slowest that the command renders it at
    let (evaluator, _) = Evaluator::new(&head, &rig, &demo).unwrap();
    assert_eq!(evaluator.frame_count(), 80);
    let times: Vec<f64> = (0..80).map(|i| evaluator.frame_time_s(i)).collect();
    let longest_alone = |name: &str| {
        times
            .iter()
            .filter(|t| demo.expressions[name].at(**t) > 0.9)
            .filter(|t| demo.expressions.iter().all(|(other, track)| other == name || track.at(**t) < 0.05))
            .count()
    };
    for name in EMOTIONS {
        assert!(longest_alone(name) >= 2, "{name} is alone at its apex in {} frames", longest_alone(name));
    }
    for (state, least) in [("blush", 0.85), ("pallor", 0.75), ("exercise", 0.95)] {
        assert!(times.iter().any(|t| demo.states[state].at(*t) >= least), "{state}");
    }
    let both =
        |t: &f64| demo.expressions["surprise"].at(*t) > 0.95 && demo.expressions["anger"].at(*t) > 0.95;
    assert!(times.iter().any(both));
    let blink = &demo.shapes["eyeBlink"];
    assert!(times.iter().all(|t| blink.at(*t) < 0.05), "a blink falls on a frame");
    assert!((0..480).any(|i| blink.at(f64::from(i) / 24.0) > 0.95));
    for t in &times {
        let face = evaluator.at(*t).face;
        assert!(face.shapes.iter().chain(&face.zones).all(|w| (0.0..=1.0).contains(w)));
        assert!(face.distributions.iter().sum::<f32>() <= 1.0 + 1e-6);
        assert!((0.5..1.5).contains(&face.hemoglobin_scale), "{} at {t}", face.hemoglobin_scale);
    }
}

#[test]
fn eyes_and_life_move_the_shapes_that_they_name() {
    let head = arkit_head();
    let index = |name: &str| head.shapes.iter().position(|s| s.name == name).unwrap();
    let face = |body: &str, time: f64| {
        let text = format!(r#"{{ "fps": 24, "duration": 60, {body} }}"#);
        let sequence = Sequence::from_json("s.json", &text).unwrap();
        Evaluator::new(&head, &Rig::default(), &sequence).unwrap().0.at(time).face
    };
    let still = face("", 3.0);
    // To the character's left: the left eye turns outwards, the right one inwards. 30 degrees are the whole shape.
    let left = face(r#""eyes": { "yawDegrees": 15, "pitchDegrees": -6, "pupilMm": 6 }"#, 3.0);
    for (name, weight) in [
        ("eyeLookOutLeft", 0.5),
        ("eyeLookInRight", 0.5),
        ("eyeLookInLeft", 0.0),
        ("eyeLookUpLeft", 0.2),
        ("eyeLookDownRight", 0.0),
    ] {
        assert!((left.shapes[index(name)] - weight).abs() < 1e-6, "{name}: {}", left.shapes[index(name)]);
    }
    assert_eq!((left.pupil_mm, still.pupil_mm), (6.0, 4.7));
    // An empty sequence moves nothing.
    assert_eq!(face(r#""life": {}"#, 3.0), still);
    let alive = r#""life": { "seed": 3, "blinks": 1, "breathing": 1, "sway": 1 }"#;
    let blinks = (0..600).map(|i| face_weight(&face(alive, f64::from(i) * 0.1), index("eyeBlinkLeft")));
    assert!(blinks.fold(0.0f32, f32::max) > 0.9);
    assert_ne!(face(alive, 3.0).head_translation, still.head_translation);
    assert_ne!(face(alive, 3.0).head_rotation, still.head_rotation);
    assert_eq!(face(alive, 3.0), face(alive, 3.0));
    let wrong = |body: &str| {
        let text = format!(r#"{{ "fps": 24, "duration": 60, {body} }}"#);
        Sequence::from_json("s.json", &text).unwrap_err().to_string()
    };
    assert!(wrong(r#""eyes": { "pupilMm": 12 }"#).contains("12"));
    assert!(wrong(r#""life": { "blinks": 9 }"#).contains("from 0 to 4"));
    assert!(wrong(r#""life": { "breathsPerMinute": 0 }"#).contains("4 to 60"));
    assert!(wrong(r#""life": { "sway": -1 }"#).contains("-1"));
}

fn face_weight(face: &rubor_rig::face_state::FaceState, shape: usize) -> f32 {
    face.shapes[shape]
}

#[test]
fn the_same_time_gives_the_same_shot() {
    let (rig, demo) = (Rig::default_rig().unwrap(), Sequence::demo().unwrap());
    let evaluate = || Evaluator::new(&arkit_head(), &rig, &demo).unwrap().0;
    let (a, b) = (evaluate(), evaluate());
    for i in (0..a.frame_count()).rev() {
        let time = a.frame_time_s(i);
        assert_eq!(a.at(time), b.at(time));
    }
}

#[test]
fn the_head_turns_to_its_own_left_and_nods_down() {
    let mut sequence = Sequence::still(1.0, 1.0);
    let nose = |sequence: &Sequence| {
        let (evaluator, _) = Evaluator::new(&arkit_head(), &Rig::default(), sequence).unwrap();
        evaluator.at(0.0).face.head_rotation * Vec3::Z
    };
    assert_eq!(nose(&sequence), Vec3::Z);
    sequence.head.yaw_degrees = Track::Constant(90.0);
    assert!((nose(&sequence) - Vec3::X).length() < 1e-6);
    sequence.head.yaw_degrees = Track::Constant(0.0);
    sequence.head.pitch_degrees = Track::Constant(90.0);
    assert!((nose(&sequence) - Vec3::NEG_Y).length() < 1e-6);
    sequence.head.pitch_degrees = Track::Constant(0.0);
    sequence.head.roll_degrees = Track::Constant(90.0);
    let (evaluator, _) = Evaluator::new(&arkit_head(), &Rig::default(), &sequence).unwrap();
    assert!((evaluator.at(0.0).face.head_rotation * Vec3::Y - Vec3::NEG_X).length() < 1e-6);
}

#[test]
fn camera_and_lights_stand_relative_to_the_eyes() {
    let mut head = arkit_head();
    for (name, place) in [
        ("eye-left", [0.03, 1.6, 0.05]),
        ("eye-right", [-0.03, 1.6, 0.05]),
        ("vertex", [0.0, 1.72, 0.0]),
        ("menton", [0.0, 1.49, 0.05]),
    ] {
        head.landmarks.insert(name.into(), Vec3::from(place));
    }
    let text = r#"{ "fps": 1, "duration": 1, "lights": [
        { "kind": "spot", "position": [0, 0, 2], "color": [1, 0.5, 0.25], "intensity": 4, "coneDegrees": [20, 40] },
        { "kind": "directional", "direction": [0, -3, 0] },
    ], "camera": { "orbitDegrees": 90 } }"#;
    let sequence = Sequence::from_json("s.json", text).unwrap();
    let (evaluator, _) = Evaluator::new(&head, &Rig::default(), &sequence).unwrap();
    let shot = evaluator.at(0.0);
    let eyes = Vec3::new(0.0, 1.6, 0.05);
    let spot = &shot.lights[0];
    assert_eq!(spot.kind, LightKind::Spot);
    assert!((spot.position - (eyes + Vec3::Z * 2.0)).length() < 1e-6);
    assert!((spot.direction - Vec3::NEG_Z).length() < 1e-6, "towards the face");
    assert_eq!(spot.power_linear, Vec3::new(4.0, 2.0, 1.0));
    assert!((spot.cone_half_angles[1] - 20f32.to_radians()).abs() < 1e-6);
    assert_eq!(shot.lights[1].direction, Vec3::NEG_Y);
    let camera = shot.camera;
    // From the character's left, at the height of the target, the whole head in the picture.
    let away = camera.position - camera.target;
    assert!(away.normalize().dot(Vec3::X) > 0.9999, "{away}");
    let visible = 2.0 * away.length() * (0.5 * camera.fov_y).tan();
    assert!(camera.target.y + 0.5 * visible > 1.72 && camera.target.y - 0.5 * visible < 1.49, "{camera:?}");
    assert_eq!(camera.up, Vec3::Y);
    assert_eq!(shot.face.head_rotation, Quat::IDENTITY);
}

#[test]
fn framings_grow_and_keep_the_face_at_another_lens() {
    let head = arkit_head();
    let height_at = |camera: &str, size: &str| {
        let text = format!(r#"{{ "fps": 1, "duration": 1, {size} "camera": {{ {camera} }} }}"#);
        let sequence = Sequence::from_json("s.json", &text).unwrap();
        let (evaluator, _) = Evaluator::new(&head, &Rig::default(), &sequence).unwrap();
        let camera = evaluator.at(0.0).camera;
        2.0 * (camera.position - camera.target).length() * (0.5 * camera.fov_y).tan()
    };
    let framed = ["close", "head", "bust"].map(|f| height_at(&format!("\"framing\": \"{f}\""), ""));
    assert!(framed[0] < framed[1] && framed[1] < framed[2], "{framed:?}");
    assert!((height_at("\"fovDegrees\": 50", "") - framed[1]).abs() < 1e-5);
    let narrow = height_at("", "\"size\": [400, 1000],");
    assert!((narrow - 2.0 * framed[1]).abs() < 1e-5, "the width of a narrow picture fits the head");
}

#[test]
fn keys_after_the_end_are_noted() {
    let text = "{ \"fps\": 1, \"duration\": 1,\n \"expressions\": { \"joy\": [{ \"t\": 3, \"v\": 1 }] } }";
    let sequence = Sequence::from_json("late.json", text).unwrap();
    let (_, notes) = Evaluator::new(&arkit_head(), &Rig::default_rig().unwrap(), &sequence).unwrap();
    let late = notes.iter().find(|n| n.place.file == "late.json").expect("a note");
    assert_eq!((late.place.line, late.place.column), (2, 19));
    assert!(late.to_string().starts_with("late.json:2:19: \"joy\" has keys after the end"), "{late}");
}

#[test]
fn the_ict_head_plays_the_default_rig() {
    let Ok(shared) = std::env::var("RUBOR_SHARED") else {
        writeln!(
            std::io::stderr(),
            "SKIPPED: RUBOR_SHARED is not set, so the names of the ICT FaceKit head are not read"
        )
        .expect("stderr is open");
        return;
    };
    let folder = std::path::Path::new(&shared).join("heads/ict");
    let mut shapes: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .filter_map(|entry| entry.unwrap().file_name().to_str()?.strip_suffix(".obj").map(str::to_owned))
        .filter(|name| name != "generic_neutral_mesh")
        .collect();
    shapes.sort();
    assert_eq!(shapes.len(), 57);
    let names: Vec<&str> = shapes.iter().map(String::as_str).collect();
    let head = head(&names, &[], &[]);
    let (evaluator, notes) =
        Evaluator::new(&head, &Rig::default_rig().unwrap(), &Sequence::demo().unwrap()).unwrap();
    // One note for its missing zones and one for its missing distributions; no shape is missing.
    assert_eq!(notes.len(), 2, "{notes:?}");
    let face = evaluator.at(2.6).face;
    let weight = |name: &str| face.shapes[names.iter().position(|n| *n == name).unwrap()];
    assert!(weight("browInnerUp_L") > 0.9 && weight("browInnerUp_L") == weight("browInnerUp_R"));
    assert!(weight("eyeWide_L") > weight("eyeWide_R"));
    assert_eq!(weight("mouthSmile_L"), 0.0);
}

#[test]
fn schemas_name_every_field_and_forbid_others() {
    let rig = rig_schema();
    assert_eq!(rig["additionalProperties"], false);
    for field in ["expressions", "states", "combinations", "inbetweens", "description", "$schema"] {
        assert!(rig["properties"][field].is_object(), "{field}");
    }
    assert!(rig["properties"]["source"].is_null());
    let expression = &rig["$defs"]["Expression"]["properties"];
    for field in ["shapes", "wrinkles", "hemoglobin", "hemoglobinScale"] {
        assert!(expression[field]["description"].is_string(), "{field}");
    }
    let sequence = sequence_schema();
    assert_eq!(sequence["required"], serde_json::json!(["fps", "duration"]));
    for field in ["size", "shapes", "head", "camera", "lights", "environment"] {
        assert!(sequence["properties"][field].is_object(), "{field}");
    }
    assert_eq!(sequence["properties"]["fps"]["exclusiveMinimum"], 0);
    assert!(sequence["$defs"]["Key_of_float"]["properties"]["ease"].is_object());
    let eases = sequence["$defs"]["Ease"].to_string();
    for ease in Ease::ALL {
        assert!(eases.contains(&serde_json::to_string(&ease).unwrap()), "{ease:?}");
    }
}

#[test]
fn tracks_of_shapes_pass_as_authored_and_sums_of_expressions_are_held() {
    let head = head(&["jawOpen", "puff", "puff50"], &[], &[]);
    let rig = rig(r#"{"expressions": {"open": {"shapes": {"jawOpen": 0.75}}},
        "inbetweens": [{"shape": "puff", "target": "puff50", "weight": 0.5}]}"#);
    let weights = |text: &str| {
        let sequence = Sequence::from_json("s.json", text).unwrap();
        Evaluator::new(&head, &rig, &sequence).unwrap().0.face_at(0.0).shapes
    };
    assert_eq!(weights(r#"{"fps": 30, "duration": 1, "shapes": {"jawOpen": 1.5}}"#)[0], 1.5);
    assert_eq!(weights(r#"{"fps": 30, "duration": 1, "shapes": {"jawOpen": -0.5}}"#)[0], -0.5);
    // What an expression adds does not lead beyond 1, nor beyond the track.
    assert_eq!(
        weights(r#"{"fps": 30, "duration": 1, "shapes": {"jawOpen": 0.5}, "expressions": {"open": 1}}"#)[0],
        1.0
    );
    assert_eq!(
        weights(r#"{"fps": 30, "duration": 1, "shapes": {"jawOpen": 1.5}, "expressions": {"open": 1}}"#)[0],
        1.5
    );
    assert_eq!(
        weights(r#"{"fps": 30, "duration": 1, "shapes": {"jawOpen": -0.5}, "expressions": {"open": 1}}"#)[0],
        0.25
    );
    // Involuntary blinks do not close a closed eye further.
    let eyes = self::head(&["eyeLookOutLeft"], &[], &[]);
    let text = r#"{"fps": 30, "duration": 1, "shapes": {"eyeLookOutLeft": 0.9}, "eyes": {"yawDegrees": 30}}"#;
    let sequence = Sequence::from_json("s.json", text).unwrap();
    assert_eq!(Evaluator::new(&eyes, &self::rig("{}"), &sequence).unwrap().0.face_at(0.0).shapes[0], 1.0);
    // Segments of in-betweens are extrapolated: 1.5 lies twice the way from puff50 to puff; -0.5 once the way back.
    assert_eq!(weights(r#"{"fps": 30, "duration": 1, "shapes": {"puff": 1.5}}"#)[1..], [2.0, -1.0]);
    assert_eq!(weights(r#"{"fps": 30, "duration": 1, "shapes": {"puff": -0.5}}"#)[1..], [0.0, -1.0]);
}

#[test]
fn notes_of_one_kind_become_one() {
    let rig = rig(r#"{"expressions": {"a": {"shapes": {"jawOpen": 1, "mouthPucker": 1, "cheekPuff": 1},
        "wrinkles": {"brow": 1}}}}"#);
    let (_, notes) = BoundRig::new(&head(&[], &[], &[]), &rig).unwrap();
    assert_eq!(notes.len(), 4, "{notes:?}");
    let summed = rubor_rig::error::summed(&notes);
    assert_eq!(summed.len(), 2, "{summed:?}");
    assert_eq!(
        summed[0].message,
        "the head has no shape \"cheekPuff\", \"jawOpen\", \"mouthPucker\": it has no effect (3 times)"
    );
    // One alone stays as it is.
    assert_eq!(summed[1], notes[3]);
}
