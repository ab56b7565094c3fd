//! Memory of a session of the viewer, alone in its process: other tests would be counted too.

#![cfg(feature = "view")]

use rubor::view::document::Kind;
use rubor::view::model::{Files, Model};
use rubor::view::script::resident_bytes;
use rubor_renderer::settings::Settings;

const RIG: &str = r#"// The rig of a test.
{
  "expressions": {
    // A smile.
    "joy": { "shapes": { "mouthSmileLeft": 1.0, "mouthSmileRight": 0.95 }, "wrinkles": { "crow-feet-left": 0.5 } },
  },
  "states": { "blush": { "hemoglobin": {}, "hemoglobinScale": 1.2 } },
}
"#;

#[test]
fn a_thousand_reloads_leave_memory_as_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("rig.json");
    std::fs::write(&path, RIG).expect("a file");
    let sequence = folder.path().join("sequence.json");
    std::fs::write(&sequence, r#"{ "fps": 4, "duration": 2, "expressions": { "joy": 0.5 } }"#)
        .expect("a file");
    let files = Files { rig: Some(path.clone()), sequence: Some(sequence), head: None };
    let mut model = Model::open(&files, |_| Ok(Settings::default())).expect("a session");
    let mut start = 0;
    for i in 0..1000u32 {
        let weight = format!("\"mouthSmileLeft\": {}", f64::from(i) / 1000.0);
        std::fs::write(&path, RIG.replace("\"mouthSmileLeft\": 1.0", &weight)).expect("a file");
        model.reload(Kind::Rig);
        assert_eq!(model.messages.errors().count(), 0);
        // By then every list is as long as it gets, but for the steps, which are small.
        if i == 199 {
            start = resident_bytes().unwrap_or_default();
        }
    }
    let end = resident_bytes().unwrap_or_default();
    eprintln!("resident: {} KiB after 200 reloads, {} KiB after 1000", start >> 10, end >> 10);
    assert!(end < start + (4 << 20), "{start} to {end} bytes");
    assert_eq!(model.document.part(Kind::Rig).text().matches("0.999").count(), 1);
    assert_eq!(model.document.history().len(), 1000);
}
