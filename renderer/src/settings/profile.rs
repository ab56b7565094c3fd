//! The diffusion profile of a frame: a published one by name, or any value of [`Profile`].

use std::borrow::Cow;
use std::ops::Deref;
use std::str::FromStr;
use std::sync::Arc;

use rubor_rig::names::nearest;
use rubor_rig::skin::profile::Profile;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// How far light goes in skin, for every method. In JSON it is a name, or a profile as `rubor profile` prints it.
#[derive(Clone, Debug, PartialEq)]
pub struct DiffusionProfile(Arc<Profile>);

/// A profile by its name.
type Published = (&'static str, fn() -> Profile);

/// The published profiles.
const PUBLISHED: [Published; 2] = [("deon-six", Profile::deon_six), ("jimenez-four", Profile::jimenez_four)];

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
        if let Some((_, make)) = PUBLISHED.iter().find(|(name, _)| *name == text) {
            return Ok(make().into());
        }
        let names = PUBLISHED.map(|(name, _)| name);
        let hint = nearest(text, names).map(|n| format!("; did you mean {n:?}?")).unwrap_or_default();
        Err(format!("found {text:?}, expected {} or a profile as a JSON object{hint}", names.join(", ")))
    }
}

impl Serialize for DiffusionProfile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match PUBLISHED.iter().find(|(_, make)| make() == *self.0) {
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
            Value(Profile),
        }
        match Written::deserialize(deserializer)? {
            Written::Name(name) => name.parse().map_err(serde::de::Error::custom),
            Written::Value(profile) => Ok(profile.into()),
        }
    }
}

impl JsonSchema for DiffusionProfile {
    fn schema_name() -> Cow<'static, str> {
        "DiffusionProfile".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let names = PUBLISHED.map(|(name, _)| name);
        json_schema!({
            "type": ["string", "object"],
            "description": format!("How far light goes in skin: {}, or a profile as an object.", names.join(", ")),
            "examples": names,
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
        assert!(
            "deon-sixx"
                .parse::<DiffusionProfile>()
                .expect_err("a slip")
                .contains("did you mean \"deon-six\"")
        );
    }
}
