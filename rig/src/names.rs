//! Names of blend shapes, zones and distributions: matches the names that a rigger writes to those of a head.
//!
//! ```text
//! "EyeBlink_L"  \
//! "eyeBlinkLeft" >-- Key { base: "eyeblink", side: Left } --> shapes of the head with their factors
//! "eye blink l" /
//! ```
//!
//! ARKit's names are canonical. Letter case, spaces, dashes, underscores and the spelling of a side are ignored.
//! Names of Character Creator, MetaHuman, VRoid Studio and Oculus Lipsync are in `names/vocabularies.rs`.
//! ICT FaceKit splits `browInnerUp` and `cheekPuff` into halves: one written name may drive two shapes of a head,
//! and two written halves share the one shape of a head that has no halves.

use std::collections::HashMap;
use std::sync::LazyLock;

use crate::head::Head;

mod vocabularies;

pub use self::vocabularies::VISEMES;
use self::vocabularies::{ON_OTHER_HEADS, PREFIXES, SPELLINGS, VROID};

/// The 52 blend shapes of Apple's ARKit face anchor, canonical spelling.
pub const ARKIT: [&str; 52] = [
    "browDownLeft",
    "browDownRight",
    "browInnerUp",
    "browOuterUpLeft",
    "browOuterUpRight",
    "cheekPuff",
    "cheekSquintLeft",
    "cheekSquintRight",
    "eyeBlinkLeft",
    "eyeBlinkRight",
    "eyeLookDownLeft",
    "eyeLookDownRight",
    "eyeLookInLeft",
    "eyeLookInRight",
    "eyeLookOutLeft",
    "eyeLookOutRight",
    "eyeLookUpLeft",
    "eyeLookUpRight",
    "eyeSquintLeft",
    "eyeSquintRight",
    "eyeWideLeft",
    "eyeWideRight",
    "jawForward",
    "jawLeft",
    "jawOpen",
    "jawRight",
    "mouthClose",
    "mouthDimpleLeft",
    "mouthDimpleRight",
    "mouthFrownLeft",
    "mouthFrownRight",
    "mouthFunnel",
    "mouthLeft",
    "mouthLowerDownLeft",
    "mouthLowerDownRight",
    "mouthPressLeft",
    "mouthPressRight",
    "mouthPucker",
    "mouthRight",
    "mouthRollLower",
    "mouthRollUpper",
    "mouthShrugLower",
    "mouthShrugUpper",
    "mouthSmileLeft",
    "mouthSmileRight",
    "mouthStretchLeft",
    "mouthStretchRight",
    "mouthUpperUpLeft",
    "mouthUpperUpRight",
    "noseSneerLeft",
    "noseSneerRight",
    "tongueOut",
];

/// Shapes of ICT FaceKit that ARKit does not have, in canonical spelling.
pub const ICT_EXTRA: [&str; 8] = [
    "browInnerUpLeft",
    "browInnerUpRight",
    "cheekPuffLeft",
    "cheekPuffRight",
    "cheekRaiserLeft",
    "cheekRaiserRight",
    "pupilDilateLeft",
    "pupilDilateRight",
];

/// Action units of the Facial Action Coding System (P. Ekman, W. V. Friesen and J. C. Hager 2002) that a shape shows,
/// the main one first; `L` and `R` mark the side where the shape has one. Empty for shapes without a unit in FACS
/// and for unknown names. FACS codes gaze as 61 to 64 and the jaw as action descriptors (AD).
///
/// Shapes and units are matched by appearance: no ARKit shape was defined by a unit. A shape that mixes units lists all
/// of them.
///
/// ```
/// use rubor_rig::names::action_units;
/// assert_eq!(action_units("mouthSmile_L"), ["AU12L"]);
/// assert_eq!(action_units("browInnerUp"), ["AU1"]);
/// assert!(action_units("pupilDilateLeft").is_empty());
/// ```
pub fn action_units(shape: &str) -> &'static [&'static str] {
    let Some(name) = canonical(shape) else { return &[] };
    ACTION_UNITS.iter().find(|(known, _)| *known == name).map_or(&[], |(_, units)| units)
}

const ACTION_UNITS: [(&str, &[&str]); 58] = [
    ("browDownLeft", &["AU4L"]),
    ("browDownRight", &["AU4R"]),
    ("browInnerUp", &["AU1"]),
    ("browInnerUpLeft", &["AU1L"]),
    ("browInnerUpRight", &["AU1R"]),
    ("browOuterUpLeft", &["AU2L"]),
    ("browOuterUpRight", &["AU2R"]),
    ("cheekPuff", &["AD34"]),
    ("cheekPuffLeft", &["AD34L"]),
    ("cheekPuffRight", &["AD34R"]),
    ("cheekRaiserLeft", &["AU6L"]),
    ("cheekRaiserRight", &["AU6R"]),
    ("cheekSquintLeft", &["AU6L"]),
    ("cheekSquintRight", &["AU6R"]),
    ("eyeBlinkLeft", &["AU45L", "AU43L"]),
    ("eyeBlinkRight", &["AU45R", "AU43R"]),
    ("eyeLookDownLeft", &["AU64L"]),
    ("eyeLookDownRight", &["AU64R"]),
    ("eyeLookInLeft", &["AU62L"]),
    ("eyeLookInRight", &["AU61R"]),
    ("eyeLookOutLeft", &["AU61L"]),
    ("eyeLookOutRight", &["AU62R"]),
    ("eyeLookUpLeft", &["AU63L"]),
    ("eyeLookUpRight", &["AU63R"]),
    ("eyeSquintLeft", &["AU7L"]),
    ("eyeSquintRight", &["AU7R"]),
    ("eyeWideLeft", &["AU5L"]),
    ("eyeWideRight", &["AU5R"]),
    ("jawForward", &["AD29"]),
    ("jawLeft", &["AD30L"]),
    ("jawOpen", &["AU26", "AU27"]),
    ("jawRight", &["AD30R"]),
    ("mouthClose", &["AU8"]),
    ("mouthDimpleLeft", &["AU14L"]),
    ("mouthDimpleRight", &["AU14R"]),
    ("mouthFrownLeft", &["AU15L"]),
    ("mouthFrownRight", &["AU15R"]),
    ("mouthFunnel", &["AU22"]),
    ("mouthLowerDownLeft", &["AU16L"]),
    ("mouthLowerDownRight", &["AU16R"]),
    ("mouthPressLeft", &["AU24L", "AU23L"]),
    ("mouthPressRight", &["AU24R", "AU23R"]),
    ("mouthPucker", &["AU18"]),
    ("mouthRollLower", &["AU28", "AD32"]),
    ("mouthRollUpper", &["AU28"]),
    ("mouthShrugLower", &["AU17"]),
    ("mouthShrugUpper", &["AU17"]),
    ("mouthSmileLeft", &["AU12L"]),
    ("mouthSmileRight", &["AU12R"]),
    ("mouthStretchLeft", &["AU20L"]),
    ("mouthStretchRight", &["AU20R"]),
    ("mouthUpperUpLeft", &["AU10L"]),
    ("mouthUpperUpRight", &["AU10R"]),
    ("noseSneerLeft", &["AU9L"]),
    ("noseSneerRight", &["AU9R"]),
    ("tongueOut", &["AD19"]),
    // FACS has no unit for a mouth that moves to one side as a whole; a one-sided stretch of the lips looks the same.
    ("mouthLeft", &[]),
    ("mouthRight", &[]),
];

/// Presets of VRM 1.0 avatars (VRMC_vrm, `expressions.preset`) as ARKit shapes. Blinks and looks are defined by VRM;
/// the shares of vowels and moods are ours, judged by eye: VRM leaves their shape to each avatar.
pub const VRM_PRESETS: [(&str, &[(&str, f32)]); 17] = [
    ("blink", &[("eyeBlinkLeft", 1.0), ("eyeBlinkRight", 1.0)]),
    ("blinkLeft", &[("eyeBlinkLeft", 1.0)]),
    ("blinkRight", &[("eyeBlinkRight", 1.0)]),
    ("lookUp", &[("eyeLookUpLeft", 1.0), ("eyeLookUpRight", 1.0)]),
    ("lookDown", &[("eyeLookDownLeft", 1.0), ("eyeLookDownRight", 1.0)]),
    ("lookLeft", &[("eyeLookOutLeft", 1.0), ("eyeLookInRight", 1.0)]),
    ("lookRight", &[("eyeLookInLeft", 1.0), ("eyeLookOutRight", 1.0)]),
    ("aa", &[("jawOpen", 0.6)]),
    ("ih", &[("jawOpen", 0.15), ("mouthStretchLeft", 0.5), ("mouthStretchRight", 0.5)]),
    ("ou", &[("jawOpen", 0.15), ("mouthPucker", 0.8)]),
    ("ee", &[("jawOpen", 0.2), ("mouthSmileLeft", 0.4), ("mouthSmileRight", 0.4)]),
    ("oh", &[("jawOpen", 0.35), ("mouthFunnel", 0.8)]),
    (
        "happy",
        &[
            ("mouthSmileLeft", 0.8),
            ("mouthSmileRight", 0.8),
            ("cheekSquintLeft", 0.6),
            ("cheekSquintRight", 0.6),
        ],
    ),
    (
        "angry",
        &[("browDownLeft", 1.0), ("browDownRight", 1.0), ("noseSneerLeft", 0.4), ("noseSneerRight", 0.4)],
    ),
    ("sad", &[("browInnerUp", 0.7), ("mouthFrownLeft", 0.7), ("mouthFrownRight", 0.7)]),
    (
        "relaxed",
        &[("mouthSmileLeft", 0.3), ("mouthSmileRight", 0.3), ("eyeSquintLeft", 0.3), ("eyeSquintRight", 0.3)],
    ),
    ("surprised", &[("browInnerUp", 0.8), ("eyeWideLeft", 0.8), ("eyeWideRight", 0.8), ("jawOpen", 0.4)]),
];

/// What an ARKit shape drives on a head that has only VRM presets, and its share.
const ON_VRM_HEADS: [(&str, &str, f32); 17] = [
    ("eyeBlinkLeft", "blinkLeft", 1.0),
    ("eyeBlinkRight", "blinkRight", 1.0),
    ("eyeBlinkLeft", "blink", 0.5),
    ("eyeBlinkRight", "blink", 0.5),
    ("eyeLookUpLeft", "lookUp", 0.5),
    ("eyeLookUpRight", "lookUp", 0.5),
    ("eyeLookDownLeft", "lookDown", 0.5),
    ("eyeLookDownRight", "lookDown", 0.5),
    ("eyeLookOutLeft", "lookLeft", 0.5),
    ("eyeLookInRight", "lookLeft", 0.5),
    ("eyeLookInLeft", "lookRight", 0.5),
    ("eyeLookOutRight", "lookRight", 0.5),
    ("jawOpen", "aa", 1.0),
    ("mouthPucker", "ou", 1.0),
    ("mouthFunnel", "oh", 1.0),
    ("mouthStretchLeft", "ih", 0.5),
    ("mouthStretchRight", "ih", 0.5),
];

/// The VRM preset or the viseme of a name in any spelling.
fn preset(written: &str) -> Option<&'static (&'static str, &'static [(&'static str, f32)])> {
    let key = Key::spoken(written);
    VRM_PRESETS.iter().chain(&VISEMES).find(|(name, _)| Key::new(name) == key)
}

/// Half of the face, the character's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Side {
    /// +X.
    Left,
    /// -X.
    Right,
}

/// A name, independent of its spelling.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key {
    /// Lower case letters and digits of the name without its side.
    pub base: String,
    /// Half of the face that the name ends in.
    pub side: Option<Side>,
}

impl Key {
    /// Reads a name as written: `eyeBlink_L`, `eyeBlinkLeft`, `EYEBLINK-LEFT`, `eyeBlinkL`, `Eye Blink left` are one key.
    /// An `L` or `R` is a side after a separator or as a capital after a small letter, so `mouthRollLower` has none.
    pub fn new(written: &str) -> Self {
        let is_separator = |c: char| !c.is_alphanumeric();
        let trimmed = written.trim_matches(is_separator);
        let mut side = None;
        let mut stem = trimmed;
        let mut last_two = trimmed.chars().rev();
        if let (Some(last), Some(before)) = (last_two.next(), last_two.next()) {
            let marks_side = is_separator(before) || (before.is_lowercase() && last.is_uppercase());
            side = match last {
                'L' | 'l' if marks_side => Some(Side::Left),
                'R' | 'r' if marks_side => Some(Side::Right),
                _ => None,
            };
            if side.is_some() {
                stem = &trimmed[..trimmed.len() - last.len_utf8()];
            }
        }
        let mut base: String =
            stem.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
        if side.is_none() {
            for (word, this) in [("left", Side::Left), ("right", Side::Right)] {
                if base.len() > word.len() && base.ends_with(word) {
                    base.truncate(base.len() - word.len());
                    side = Some(this);
                    break;
                }
            }
        }
        Self { base, side }
    }

    /// As [`Key::new`], of the name that ARKit and VRM have for what another program calls so.
    fn spoken(written: &str) -> Self {
        static CANONICAL: LazyLock<HashMap<Key, Key>> = LazyLock::new(|| {
            let mut canonical = HashMap::new();
            for (there, here) in SPELLINGS {
                if !there.contains('*') {
                    canonical.insert(Key::new(there), Key::new(here));
                    continue;
                }
                for (letter, word) in [("L", "Left"), ("R", "Right")] {
                    canonical
                        .insert(Key::new(&there.replace('*', letter)), Key::new(&here.replace('*', word)));
                }
            }
            canonical
        });
        let bare = PREFIXES.iter().find_map(|prefix| written.strip_prefix(prefix)).unwrap_or(written);
        let bare = bare.find(VROID).map_or(bare, |start| &bare[start..]);
        let key = Self::new(bare);
        CANONICAL.get(&key).cloned().unwrap_or(key)
    }

    fn with_side(&self, side: Option<Side>) -> Self {
        Self { base: self.base.clone(), side }
    }

    /// `jawLeft` and `jawRight` move the whole jaw, so they are not halves of a shape `jaw`; the same holds for the
    /// mouth.
    fn has_halves(&self) -> bool {
        self.base != "jaw" && self.base != "mouth"
    }
}

/// Canonical spelling of a known shape name (ARKit or ICT FaceKit), such as `eyeBlinkLeft` for `EyeBlink_L`.
///
/// A prefix that an exporter put before the last `.`, `:` or `|` is dropped: `blendShape1.jawOpen`.
///
/// ```
/// use rubor_rig::names::canonical;
/// assert_eq!(canonical("eyeBlink_L"), Some("eyeBlinkLeft"));
/// assert_eq!(canonical("brow inner up-r"), Some("browInnerUpRight"));
/// assert_eq!(canonical("eyeBlink"), None); // a pair, not a shape
/// ```
pub fn canonical(written: &str) -> Option<&'static str> {
    // Made once: files have up to 100 000 names.
    static BY_KEY: LazyLock<HashMap<Key, &'static str>> = LazyLock::new(|| {
        let mut by_key = HashMap::new();
        for known in vocabulary() {
            by_key.entry(Key::new(known)).or_insert(known);
        }
        by_key
    });
    let find = |name: &str| BY_KEY.get(&Key::spoken(name)).copied();
    find(written).or_else(|| find(written.rsplit(['.', ':', '|']).next()?))
}

/// Every shape name that rubor knows without a head.
pub fn vocabulary() -> impl Iterator<Item = &'static str> {
    ARKIT.into_iter().chain(ICT_EXTRA)
}

/// True for a name that [`canonical`] knows, or that is both halves of one: `eyeBlink`, `cheekRaiser`.
pub fn is_known_shape(written: &str) -> bool {
    if canonical(written).is_some() || preset(written).is_some() {
        return true;
    }
    let key = Key::spoken(written);
    key.side.is_none() && key.has_halves() && vocabulary().map(Key::new).any(|k| k.base == key.base)
}

/// A shape, zone or distribution of a head that a written name drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Index into the list that the [`Resolver`] was made from.
    pub index: u32,
    /// Factor on the written weight: 1, or 1/2 where two written halves drive one shape.
    pub factor: f32,
}

/// Finds written names among the names of a head.
#[derive(Clone, Debug)]
pub struct Resolver {
    names: Vec<String>,
    keys: Vec<Key>,
    /// Of each name: another spelling of its key, and not what another program calls it.
    is_plain: Vec<bool>,
}

impl Resolver {
    /// For any list of names; targets are indices into it.
    pub fn new<'a>(names: impl IntoIterator<Item = &'a str>) -> Self {
        let names: Vec<String> = names.into_iter().map(str::to_owned).collect();
        let key = |n: &String| canonical(n).map_or_else(|| Key::spoken(n), Key::new);
        let keys: Vec<Key> = names.iter().map(key).collect();
        let is_plain = names.iter().zip(&keys).map(|(n, key)| Key::new(n) == *key).collect();
        Self { names, keys, is_plain }
    }

    /// For the blend shapes of a head.
    pub fn shapes(head: &Head) -> Self {
        Self::new(head.shapes.iter().map(|s| s.name.as_str()))
    }

    /// For the wrinkle zones of a head.
    pub fn zones(head: &Head) -> Self {
        Self::new(head.maps.zones.iter().map(|z| z.name.as_str()))
    }

    /// For the hemoglobin distributions of a head.
    pub fn distributions(head: &Head) -> Self {
        Self::new(head.maps.distributions.iter().map(|d| d.name.as_str()))
    }

    /// The targets of a written name; empty if the head has none. Matches are tried in this order:
    /// 1. the exact name,
    /// 2. the same name in another spelling,
    /// 3. both halves, for a name without a side (`browInnerUp` on a head with `browInnerUp_L` and `_R`),
    /// 4. the undivided shape at half the weight, for a half (`cheekPuffLeft` on a head with `cheekPuff`),
    /// 5. the ARKit shapes of a VRM preset or a viseme, and what a head without ARKit's shapes has for one of them.
    pub fn resolve(&self, written: &str) -> Vec<Target> {
        let targets = self.resolve_name(written);
        if !targets.is_empty() {
            return targets;
        }
        if let Some((_, shapes)) = preset(written) {
            let scaled = |(shape, share): &(&str, f32)| {
                let share = *share;
                self.resolve_name(shape).into_iter().map(move |t| Target { factor: share * t.factor, ..t })
            };
            return shapes.iter().flat_map(scaled).collect();
        }
        let Some(shape) = canonical(written) else { return Vec::new() };
        let of_head = |(preset, share): (&str, f32)| {
            let key = Key::spoken(preset);
            let index = self.keys.iter().position(|k| *k == key)?;
            Some(Target { index: index as u32, factor: share })
        };
        // The first match is the closer one: `blink` is used only where there is no `blinkLeft`.
        let presets = ON_VRM_HEADS.iter().filter(|(name, ..)| *name == shape);
        if let Some(target) = presets.filter_map(|(_, preset, share)| of_head((*preset, *share))).next() {
            return vec![target];
        }
        let others = ON_OTHER_HEADS.iter().filter(|(name, _)| *name == shape);
        let all = |(_, parts): &(&str, &[(&str, f32)])| parts.iter().map(|part| of_head(*part)).collect();
        others.map(all).find_map(|found: Option<Vec<Target>>| found).unwrap_or_default()
    }

    fn resolve_name(&self, written: &str) -> Vec<Target> {
        let whole = |index: usize| Target { index: index as u32, factor: 1.0 };
        if let Some(index) = self.names.iter().position(|n| n == written) {
            return vec![whole(index)];
        }
        let key = canonical(written).map_or_else(|| Key::spoken(written), Key::new);
        // A head may have a shape under ARKit's name and under another one.
        let find = |key: &Key| {
            let mut same = (0..self.keys.len()).filter(|i| self.keys[*i] == *key);
            let first = same.next()?;
            Some(std::iter::once(first).chain(same).find(|i| self.is_plain[*i]).unwrap_or(first))
        };
        if let Some(index) = find(&key) {
            return vec![whole(index)];
        }
        if !key.has_halves() {
            return Vec::new();
        }
        match key.side {
            None => [Side::Left, Side::Right]
                .iter()
                .filter_map(|side| find(&key.with_side(Some(*side))))
                .map(whole)
                .collect(),
            Some(_) => find(&key.with_side(None))
                .map(|index| Target { index: index as u32, factor: 0.5 })
                .into_iter()
                .collect(),
        }
    }

    /// Names as the head spells them.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.names.iter().map(String::as_str)
    }

    /// True for a head that has none.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }
}

/// The candidate that is most like `written` without regard to letter case; `None` if none is similar.
///
/// ```
/// let emotions = ["joy", "anger", "sadness"];
/// assert_eq!(rubor_rig::names::nearest("angr", emotions), Some("anger".to_owned()));
/// assert_eq!(rubor_rig::names::nearest("q", emotions), None);
/// ```
pub fn nearest<'a>(written: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<String> {
    // Below this Jaro-Winkler similarity a guess does not help; tuned on misspelt ARKit names.
    const LEAST_SIMILARITY: f64 = 0.72;
    let lower = written.to_lowercase();
    let mut best: Option<(f64, &str)> = None;
    for candidate in candidates {
        let other = candidate.to_lowercase();
        let winkler = strsim::jaro_winkler(&lower, &other);
        if winkler < LEAST_SIMILARITY {
            continue;
        }
        // Winkler's bonus for a common start alone would prefer a short name to a long misspelt one.
        let similarity = winkler + strsim::normalized_damerau_levenshtein(&lower, &other);
        if best.is_none_or(|(most, _)| similarity > most) {
            best = Some((similarity, candidate));
        }
    }
    best.map(|(_, name)| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names of the files of ICT FaceKit's light model.
    const ICT: [&str; 57] = [
        "PupilDilate_L",
        "PupilDilate_R",
        "browDown_L",
        "browDown_R",
        "browInnerUp_L",
        "browInnerUp_R",
        "browOuterUp_L",
        "browOuterUp_R",
        "cheekPuff_L",
        "cheekPuff_R",
        "cheekRaiser_L",
        "cheekRaiser_R",
        "cheekSquint_L",
        "cheekSquint_R",
        "eyeBlink_L",
        "eyeBlink_R",
        "eyeLookDown_L",
        "eyeLookDown_R",
        "eyeLookIn_L",
        "eyeLookIn_R",
        "eyeLookOut_L",
        "eyeLookOut_R",
        "eyeLookUp_L",
        "eyeLookUp_R",
        "eyeSquint_L",
        "eyeSquint_R",
        "eyeWide_L",
        "eyeWide_R",
        "jawForward",
        "jawLeft",
        "jawOpen",
        "jawRight",
        "mouthClose",
        "mouthDimple_L",
        "mouthDimple_R",
        "mouthFrown_L",
        "mouthFrown_R",
        "mouthFunnel",
        "mouthLeft",
        "mouthLowerDown_L",
        "mouthLowerDown_R",
        "mouthPress_L",
        "mouthPress_R",
        "mouthPucker",
        "mouthRight",
        "mouthRollLower",
        "mouthRollUpper",
        "mouthShrugLower",
        "mouthShrugUpper",
        "mouthSmile_L",
        "mouthSmile_R",
        "mouthStretch_L",
        "mouthStretch_R",
        "mouthUpperUp_L",
        "mouthUpperUp_R",
        "noseSneer_L",
        "noseSneer_R",
    ];

    fn resolved(resolver: &Resolver, written: &str) -> Vec<(String, f32)> {
        let names: Vec<&str> = resolver.names().collect();
        resolver.resolve(written).iter().map(|t| (names[t.index as usize].to_owned(), t.factor)).collect()
    }

    #[test]
    fn every_arkit_name_is_its_own_canonical_name_and_keys_differ() {
        let mut keys: Vec<Key> = vocabulary().map(Key::new).collect();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), ARKIT.len() + ICT_EXTRA.len());
        for name in vocabulary() {
            assert_eq!(canonical(name), Some(name));
        }
    }

    #[test]
    fn action_units_of_every_shape_keep_the_side() {
        for name in vocabulary() {
            let units = action_units(name);
            let without = ["mouthLeft", "mouthRight", "pupilDilateLeft", "pupilDilateRight"].contains(&name);
            assert_eq!(units.is_empty(), without, "{name}");
            let mirrored = if name.ends_with("Left") {
                name.replace("Left", "Right")
            } else {
                continue;
            };
            let mirror = |unit: &&str| match unit.split_at(unit.len() - 1) {
                // The direction of a gaze mirrors too: 61 turns to the left, 62 to the right.
                ("AU61", "L") => "AU62R".to_owned(),
                ("AU62", "L") => "AU61R".to_owned(),
                (number, "L") => format!("{number}R"),
                _ => panic!("{name}: {unit} has no side"),
            };
            assert_eq!(units.iter().map(mirror).collect::<Vec<_>>(), action_units(&mirrored), "{name}");
        }
        assert!(ACTION_UNITS.iter().all(|(name, _)| canonical(name) == Some(name)));
        assert_eq!(action_units("Face:EYEBLINK_R"), ["AU45R", "AU43R"]);
        assert!(action_units("nonsense").is_empty());
    }

    #[test]
    fn every_ict_file_has_a_canonical_name() {
        for name in ICT {
            let known = canonical(name).unwrap_or_else(|| panic!("{name} is unknown"));
            assert_eq!(
                known.to_lowercase(),
                name.replace("_L", "Left").replace("_R", "Right").to_lowercase()
            );
        }
    }

    #[test]
    fn every_arkit_shape_but_the_tongue_drives_the_ict_head() {
        let ict = Resolver::new(ICT);
        for name in ARKIT {
            let expected = match name {
                "tongueOut" => 0,
                "browInnerUp" | "cheekPuff" => 2,
                _ => 1,
            };
            assert_eq!(ict.resolve(name).len(), expected, "{name}");
        }
        assert_eq!(
            resolved(&ict, "browInnerUp"),
            [("browInnerUp_L".to_owned(), 1.0), ("browInnerUp_R".to_owned(), 1.0)]
        );
        assert_eq!(resolved(&ict, "cheekPuffLeft"), [("cheekPuff_L".to_owned(), 1.0)]);
        assert_eq!(resolved(&ict, "jawLeft"), [("jawLeft".to_owned(), 1.0)]);
    }

    #[test]
    fn ict_names_drive_an_arkit_head_and_halves_share_a_shape() {
        let arkit = Resolver::new(ARKIT);
        for name in ICT {
            let expected = usize::from(!name.starts_with("PupilDilate") && !name.starts_with("cheekRaiser"));
            assert_eq!(arkit.resolve(name).len(), expected, "{name}");
        }
        assert_eq!(resolved(&arkit, "browInnerUp_L"), [("browInnerUp".to_owned(), 0.5)]);
        assert_eq!(resolved(&arkit, "browInnerUp_R"), [("browInnerUp".to_owned(), 0.5)]);
        assert_eq!(resolved(&arkit, "eyeBlink").len(), 2);
    }

    #[test]
    fn spellings_of_one_name() {
        for written in [
            "eyeBlinkLeft",
            "EyeBlinkLeft",
            "eyeBlink_L",
            "eyeblink_l",
            "EYEBLINK_L",
            "EYEBLINKLEFT",
            "eye blink left",
            "eye-blink-l",
            "eyeBlink.L",
            "eyeBlinkL",
            "eyeBlink_Left",
            "blendShape1.eyeBlink_L",
            "Face:eyeBlinkLeft",
        ] {
            assert_eq!(canonical(written), Some("eyeBlinkLeft"), "{written}");
        }
        assert_eq!(canonical("mouthRollLower"), Some("mouthRollLower"));
        assert_eq!(canonical("mouth_L"), Some("mouthLeft"));
        for not_a_shape in ["", "_", "L", "left", "mouth", "jaw", "é", "eyeBlinkLeftLeft"] {
            assert_eq!(canonical(not_a_shape), None, "{not_a_shape}");
        }
    }

    #[test]
    fn mouth_and_jaw_are_no_pairs() {
        let arkit = Resolver::new(ARKIT);
        for name in ["mouth", "jaw"] {
            assert!(arkit.resolve(name).is_empty());
            assert!(!is_known_shape(name));
        }
        assert!(is_known_shape("cheekRaiser"));
        assert!(is_known_shape("EyeBlink"));
        assert!(!is_known_shape("eyeBlinks"));
    }

    #[test]
    fn vrm_presets_meet_arkit_shapes_in_both_directions() {
        let arkit = Resolver::new(ARKIT);
        for (preset, shapes) in VRM_PRESETS {
            assert!(shapes.iter().all(|(name, share)| ARKIT.contains(name) && (0.0..=1.0).contains(share)));
            assert_eq!(arkit.resolve(preset).len(), shapes.len(), "{preset}");
            assert!(is_known_shape(preset) && canonical(preset).is_none(), "{preset}");
        }
        assert_eq!(resolved(&arkit, "Blink_L"), [("eyeBlinkLeft".to_owned(), 1.0)]);
        let vrm = Resolver::new(VRM_PRESETS.map(|(name, _)| name));
        assert_eq!(resolved(&vrm, "eyeBlinkLeft"), [("blinkLeft".to_owned(), 1.0)]);
        assert_eq!(resolved(&vrm, "jawOpen"), [("aa".to_owned(), 1.0)]);
        assert_eq!(resolved(&vrm, "eyeLookInRight"), [("lookLeft".to_owned(), 0.5)]);
        assert!(vrm.resolve("noseSneerLeft").is_empty());
        // VRM 0 avatars often have one blink.
        let one = Resolver::new(["Blink"]);
        assert_eq!(resolved(&one, "eyeBlinkRight"), [("Blink".to_owned(), 0.5)]);
        // Zones and distributions have names of their own.
        assert!(Resolver::new(["joy", "forehead"]).resolve("happy").is_empty());
    }

    #[test]
    fn names_of_other_programs_are_those_of_arkit() {
        for (written, expected) in [
            ("Brow_Drop_L", "browDownLeft"),
            ("Brow_Raise_Inner_R", "browInnerUpRight"),
            ("Eye_Blink_L", "eyeBlinkLeft"),
            ("Eye_R_Look_L", "eyeLookInRight"),
            ("Mouth_Up_Upper_R", "mouthUpperUpRight"),
            ("Mouth_L", "mouthLeft"),
            ("Jaw_Forward", "jawForward"),
            ("CTRL_expressions_browDownL", "browDownLeft"),
            ("CTRL_expressions.mouthCornerPullR", "mouthSmileRight"),
            ("CTRL_expressions_eyeLookLeftR", "eyeLookInRight"),
            ("CTRL_expressions_jawFwd", "jawForward"),
            ("CTRL_expressions_eyePupilWideL", "pupilDilateLeft"),
            ("Fcl_EYE_Close_R", "eyeBlinkRight"),
            ("Face.M_F00_000_00_Fcl_EYE_Close_L", "eyeBlinkLeft"),
        ] {
            assert_eq!(canonical(written), Some(expected), "{written}");
            // Both ways: a head with the one name follows the other.
            assert_eq!(resolved(&Resolver::new([written]), expected), [(written.to_owned(), 1.0)]);
            assert_eq!(resolved(&Resolver::new([expected]), written), [(expected.to_owned(), 1.0)]);
        }
        for (_, here) in SPELLINGS {
            let known = here.replace("_*", "").replace('*', "Left");
            assert!(is_known_shape(&known), "{here} is no name of ours");
        }
        let both = Resolver::new(["Fcl_EYE_Close_L", "EyeBlinkLeft"]);
        assert_eq!(resolved(&both, "eyeBlink_L"), [("EyeBlinkLeft".to_owned(), 1.0)]);
        for own in ["CTRL_expressions_earUpL", "Nose_Nostril_Dilate_L", "Fcl_HA_Hide", "viseme_sil"] {
            assert!(canonical(own).is_none() && !is_known_shape(own), "{own}");
        }
    }

    #[test]
    fn visemes_and_quarters_of_lips_meet_arkit_shapes() {
        let arkit = Resolver::new(ARKIT);
        for (viseme, shapes) in VISEMES {
            assert!(shapes.iter().all(|(name, share)| ARKIT.contains(name) && (0.0..=1.0).contains(share)));
            assert_eq!(arkit.resolve(viseme).len(), shapes.len(), "{viseme}");
        }
        let spoken = Resolver::new(VISEMES.map(|(name, _)| name));
        assert_eq!(resolved(&spoken, "jawOpen"), [("viseme_aa".to_owned(), 1.0)]);
        assert!(spoken.resolve("eyeBlinkLeft").is_empty());
        let quarters = ["UL", "UR", "DL", "DR"].map(|q| format!("CTRL_expressions_mouthFunnel{q}"));
        let human = Resolver::new(quarters.iter().map(String::as_str));
        assert_eq!(human.resolve("mouthFunnel").len(), 4);
        assert!(Resolver::new(["CTRL_expressions_mouthFunnelUL"]).resolve("mouthFunnel").is_empty());
        let halves = Resolver::new(["Mouth_Roll_In_Upper_L", "Mouth_Roll_In_Upper_R"]);
        assert_eq!(halves.resolve("mouthRollUpper").len(), 2);
        let vroid =
            Resolver::new(["Face_Fcl_ALL_Joy", "Face_Fcl_MTH_A", "Face_Fcl_MTH_U", "Face_Fcl_BRW_Sorrow"]);
        assert_eq!(resolved(&vroid, "jawOpen"), [("Face_Fcl_MTH_A".to_owned(), 1.0)]);
        assert_eq!(resolved(&vroid, "happy"), [("Face_Fcl_ALL_Joy".to_owned(), 1.0)]);
        assert_eq!(resolved(&vroid, "mouthPucker"), [("Face_Fcl_MTH_U".to_owned(), 1.0)]);
        assert_eq!(resolved(&vroid, "browInnerUp"), [("Face_Fcl_BRW_Sorrow".to_owned(), 1.0)]);
    }

    #[test]
    fn the_nearest_name_of_a_misspelling() {
        for (written, expected) in [
            ("eyeBlnkLeft", "eyeBlinkLeft"),
            ("mouthSmilLeft", "mouthSmileLeft"),
            ("browInerUp", "browInnerUp"),
            ("jawOpne", "jawOpen"),
            ("mouthLowerDownLft", "mouthLowerDownLeft"),
        ] {
            assert_eq!(nearest(written, ARKIT).as_deref(), Some(expected));
        }
        assert_eq!(nearest("xyzzy", ARKIT), None);
        assert_eq!(nearest("anything", []), None);
    }
}
