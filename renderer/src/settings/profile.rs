//! The diffusion profile of a frame: a published one by name, or any value of [`Profile`].

use std::borrow::Cow;
use std::ops::Deref;
use std::str::FromStr;
use std::sync::{Arc, LazyLock};

use rubor_rig::names::nearest;
use rubor_rig::skin::medium::{SKIN1, SKIN2, rgb_media};
use rubor_rig::skin::model::ProfileModel;
use rubor_rig::skin::profile::Profile;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// How far light goes in skin, for every method. In JSON it is a name, or a profile as `rubor profile` prints it: the whole
/// report, or its field `profile`. A name may hold such an object as text, as a flag does.
#[derive(Clone, Debug, PartialEq)]
pub struct DiffusionProfile(Arc<Profile>);

/// Profiles by name: sums of Gaussians, and the dipoles of the two skins of Jensen et al. 2001 with an index of 1.4.
const NAMES: [&str; 8] = [
    "deon-six",
    "jimenez-four",
    "skin1-standard-dipole",
    "skin1-better-dipole",
    "skin1-directional-dipole",
    "skin2-standard-dipole",
    "skin2-better-dipole",
    "skin2-directional-dipole",
];

/// The profiles of [`NAMES`], in that order. A directional dipole takes a moment, so they are kept.
static PUBLISHED: LazyLock<Vec<Arc<Profile>>> = LazyLock::new(|| {
    let dipole = |name: &str| -> Option<Profile> {
        let (skin, model) = name.split_once('-')?;
        let coefficients = if skin == "skin1" { SKIN1 } else { SKIN2 };
        let model: ProfileModel = model.parse().ok()?;
        model.profile(name, &rgb_media(&coefficients, 1.4).ok()?, None, 0).ok()
    };
    let profile = |name: &&str| match *name {
        "deon-six" => Profile::deon_six(),
        "jimenez-four" => Profile::jimenez_four(),
        name => dipole(name).expect("published media have dipoles"),
    };
    NAMES.iter().map(|name| Arc::new(profile(name))).collect()
});

impl DiffusionProfile {
    /// The value, shared.
    pub fn shared(&self) -> &Arc<Profile> {
        &self.0
    }
}

impl Default for DiffusionProfile {
    /// The six measured Gaussians of d'Eon and Luebke 2007.
    fn default() -> Self {
        Profile::deon_six().into()
    }
}

impl From<Profile> for DiffusionProfile {
    fn from(profile: Profile) -> Self {
        Self(Arc::new(profile))
    }
}

impl Deref for DiffusionProfile {
    type Target = Profile;

    fn deref(&self) -> &Profile {
        &self.0
    }
}

impl FromStr for DiffusionProfile {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some(place) = NAMES.iter().position(|name| *name == text) {
            return Ok(Self(PUBLISHED[place].clone()));
        }
        if text.trim_start().starts_with('{') {
            return serde_json::from_str(text).map_err(|e| format!("found a JSON object; {e}"));
        }
        let hint = nearest(text, NAMES).map(|n| format!("; did you mean {n:?}?")).unwrap_or_default();
        Err(format!("found {text:?}, expected {} or a profile as a JSON object{hint}", NAMES.join(", ")))
    }
}

impl Serialize for DiffusionProfile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match NAMES.iter().zip(PUBLISHED.iter()).find(|(_, profile)| **profile == self.0) {
            Some((name, _)) => serializer.serialize_str(name),
            None => self.0.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for DiffusionProfile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Written {
            Name(String),
            Report { profile: Profile },
            Value(Profile),
        }
        match Written::deserialize(deserializer)? {
            Written::Name(name) => name.parse().map_err(serde::de::Error::custom),
            Written::Report { profile } | Written::Value(profile) => Ok(profile.into()),
        }
    }
}

impl JsonSchema for DiffusionProfile {
    fn schema_name() -> Cow<'static, str> {
        "DiffusionProfile".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": ["string", "object"],
            "description": format!("How far light goes in skin: {}, or a profile as an object.", NAMES.join(", ")),
            "examples": NAMES,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_profiles_are_names_and_others_are_values() {
        let by_name: DiffusionProfile = "jimenez-four".parse().expect("it is known");
        assert_eq!(serde_json::to_string(&by_name).expect("it is written"), "\"jimenez-four\"");
        let mut own = Profile::deon_six();
        own.name = "mine".into();
        own.channels.swap(0, 2);
        let own = DiffusionProfile::from(own);
        let text = serde_json::to_string(&own).expect("it is written");
        assert_eq!(serde_json::from_str::<DiffusionProfile>(&text).expect("it reads back"), own);
        let report = format!("{{\"total\":[1,1,1],\"profile\":{text}}}");
        assert_eq!(serde_json::from_str::<DiffusionProfile>(&report).expect("a report reads"), own);
        assert_eq!(text.parse::<DiffusionProfile>().expect("an object as text reads"), own);
        assert!("{\"name\":1}".parse::<DiffusionProfile>().is_err());
        for name in NAMES {
            let published: DiffusionProfile = name.parse().expect("it is known");
            assert_eq!(serde_json::to_string(&published).expect("it is written"), format!("{name:?}"));
            assert_eq!(published.directional().is_some(), name.ends_with("directional-dipole"));
        }
        assert!(
            "deon-sixx"
                .parse::<DiffusionProfile>()
                .expect_err("a slip")
                .contains("did you mean \"deon-six\"")
        );
    }
}
