//! Light rigs by name: lights and surroundings that can replace those of any sequence.
//!
//! A rig is written as a sequence of which only `lights` and `environment` are used, so any sequence file can serve as
//! a light rig.

use crate::error::RigError;
use crate::timeline::Sequence;

/// Names and texts of the built-in rigs, comments included.
pub const LIGHT_RIGS: [(&str, &str); 6] = [
    ("three-point", include_str!("lights/three-point.json")),
    ("window", include_str!("lights/window.json")),
    ("backlit-ear", include_str!("lights/backlit-ear.json")),
    ("low-key", include_str!("lights/low-key.json")),
    ("soft-box", include_str!("lights/soft-box.json")),
    ("sky", include_str!("lights/sky.json")),
];

/// The built-in rig of this name; `None` if there is none.
///
/// # Errors
/// None that a user can cause: the texts are part of the program and a test reads them.
pub fn light_rig(name: &str) -> Option<Result<Sequence, RigError>> {
    let (name, text) = LIGHT_RIGS.iter().find(|r| r.0 == name)?;
    Some(Sequence::from_json(&format!("{name}.json"), text))
}

impl Sequence {
    /// Takes lights and environment from another sequence.
    pub fn relight(&mut self, from: Sequence) {
        self.lights = from.lights;
        self.environment = from.environment;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rig_reads_and_lights() {
        for (name, _) in LIGHT_RIGS {
            let rig = light_rig(name).unwrap().unwrap();
            assert!(!rig.lights.is_empty() && rig.environment.is_some(), "{name}");
        }
        assert!(light_rig("no such rig").is_none());
    }

    #[test]
    fn the_demo_has_the_three_point_light_and_can_be_relit() {
        let mut demo = Sequence::demo().unwrap();
        let three_point = light_rig("three-point").unwrap().unwrap();
        assert_eq!(demo.lights, three_point.lights);
        let window = light_rig("window").unwrap().unwrap();
        demo.relight(window.clone());
        assert_eq!((&demo.lights, &demo.environment), (&window.lights, &window.environment));
        assert!(!demo.expressions.is_empty());
    }
}
