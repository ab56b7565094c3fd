//! People to choose from: parameters of geometry and skin that belong together.

use super::Options;
use crate::synthesize;

/// A person as parameters of the two generators.
#[derive(Clone, Copy, Debug)]
pub struct Character {
    /// Name by which it is selected.
    pub name: &'static str,
    /// A short description.
    pub summary: &'static str,
    ethnicity: [f32; 3],
    gender: f32,
    age: f32,
    weight: f32,
    muscle: f32,
    targets: &'static [(&'static str, f32)],
    seed: u64,
    age_years: f32,
    melanin: f32,
    hemoglobin: f32,
    freckles: f32,
    moles: u32,
    brows: f32,
    stubble: f32,
    scalp_hair: f32,
    hair_melanin: f32,
    grey_hair: f32,
}

/// Targets of the head that ships with rubor. A path that starts with `*` stands for both sides (`l-` and `r-`). The
/// macro mix alone has a narrow, high skull.
pub(super) const DEFAULT_TARGETS: [(&str, f32); 11] = [
    ("head/head-scale-horiz-incr", 0.3),
    ("forehead/forehead-scale-vert-decr", 0.4),
    ("neck/neck-scale-horiz-decr", 0.25),
    ("eyes/*eye-height2-incr", 0.35),
    ("chin/chin-prominent-incr", 0.2),
    ("chin/chin-width-incr", 0.2),
    ("nose/nose-scale-horiz-decr", 0.35),
    ("nose/nose-hump-incr", 0.2),
    ("mouth/mouth-lowerlip-volume-incr", 0.3),
    ("cheek/*cheek-bones-incr", 0.3),
    ("cheek/*cheek-volume-decr", 0.3),
];

const DEFAULT: Character = Character {
    name: "default",
    summary: "man of 32, light skin, dark brown cropped hair",
    ethnicity: [0.7, 0.1, 0.2],
    gender: 0.95,
    age: 0.5,
    weight: 0.5,
    muscle: 0.6,
    targets: &DEFAULT_TARGETS,
    seed: 1,
    age_years: 32.0,
    melanin: 0.026,
    hemoglobin: 0.017,
    freckles: 0.3,
    moles: 7,
    brows: 1.0,
    stubble: 0.25,
    scalp_hair: 0.95,
    hair_melanin: 0.47,
    grey_hair: 0.0,
};

/// The people that `--character` knows. The first is the head that ships with rubor.
pub const CHARACTERS: [Character; 6] = [
    DEFAULT,
    Character {
        name: "maeve",
        summary: "woman of 27, very light freckled skin, copper hair",
        ethnicity: [1.0, 0.0, 0.0],
        gender: 0.12,
        targets: &[
            ("head/head-scale-horiz-incr", 0.3),
            ("forehead/forehead-scale-vert-decr", 0.4),
            ("eyes/*eye-height2-incr", 0.3),
            ("mouth/mouth-upperlip-height-incr", 0.3),
            ("mouth/mouth-lowerlip-height-incr", 0.3),
            ("cheek/*cheek-bones-incr", 0.4),
            ("cheek/*cheek-volume-decr", 0.3),
            ("nose/nose-scale-horiz-decr", 0.3),
            ("nose/nose-point-up", 0.2),
        ],
        seed: 12,
        age_years: 26.0,
        melanin: 0.018,
        freckles: 0.95,
        moles: 5,
        brows: 0.75,
        stubble: 0.0,
        hair_melanin: 0.24,
        ..DEFAULT
    },
    Character {
        name: "kofi",
        summary: "man of 35, very dark skin, black hair",
        ethnicity: [0.05, 0.0, 0.95],
        gender: 1.0,
        muscle: 0.65,
        targets: &[
            ("head/head-scale-horiz-incr", 0.25),
            ("forehead/forehead-scale-vert-decr", 0.35),
            ("eyes/*eye-height2-incr", 0.3),
            ("cheek/*cheek-bones-incr", 0.3),
            ("chin/chin-prominent-incr", 0.2),
        ],
        seed: 33,
        age_years: 35.0,
        melanin: 0.35,
        hemoglobin: 0.006,
        freckles: 0.0,
        moles: 4,
        stubble: 0.3,
        hair_melanin: 0.5,
        ..DEFAULT
    },
    Character {
        name: "yuna",
        summary: "woman of 24, light tan skin, black hair",
        ethnicity: [0.1, 0.9, 0.0],
        gender: 0.1,
        targets: &[
            ("head/head-scale-horiz-incr", 0.2),
            ("forehead/forehead-scale-vert-decr", 0.35),
            ("mouth/mouth-upperlip-height-incr", 0.2),
            ("mouth/mouth-lowerlip-height-incr", 0.2),
            ("cheek/*cheek-volume-decr", 0.2),
        ],
        seed: 47,
        age_years: 24.0,
        melanin: 0.055,
        freckles: 0.05,
        moles: 4,
        brows: 0.8,
        stubble: 0.0,
        hair_melanin: 0.5,
        ..DEFAULT
    },
    Character {
        name: "walter",
        summary: "man of 68, light weathered skin, grey hair",
        ethnicity: [1.0, 0.0, 0.0],
        gender: 1.0,
        age: 0.76,
        weight: 0.45,
        muscle: 0.5,
        targets: &[
            ("head/head-scale-horiz-incr", 0.3),
            ("forehead/forehead-scale-vert-decr", 0.35),
            ("eyes/*eye-bag-incr", 0.35),
            ("nose/nose-hump-incr", 0.35),
            ("cheek/*cheek-volume-decr", 0.4),
        ],
        seed: 68,
        age_years: 68.0,
        melanin: 0.035,
        hemoglobin: 0.018,
        freckles: 0.4,
        moles: 16,
        brows: 1.15,
        stubble: 0.35,
        scalp_hair: 0.75,
        hair_melanin: 0.4,
        grey_hair: 0.75,
    },
    Character {
        name: "anjali",
        summary: "woman of 46, brown skin, black hair with some grey",
        ethnicity: [0.6, 0.15, 0.25],
        gender: 0.15,
        age: 0.6,
        weight: 0.58,
        targets: &[
            ("head/head-scale-horiz-incr", 0.3),
            ("forehead/forehead-scale-vert-decr", 0.4),
            ("eyes/*eye-height2-incr", 0.35),
            ("mouth/mouth-lowerlip-height-incr", 0.3),
            ("nose/nose-hump-incr", 0.25),
        ],
        seed: 81,
        age_years: 46.0,
        melanin: 0.115,
        hemoglobin: 0.011,
        freckles: 0.1,
        moles: 8,
        brows: 1.1,
        stubble: 0.0,
        hair_melanin: 0.5,
        grey_hair: 0.03,
        ..DEFAULT
    },
];

impl Character {
    /// The person of a name.
    pub fn find(name: &str) -> Option<&'static Self> {
        CHARACTERS.iter().find(|c| c.name == name)
    }

    /// Geometry, except the folder of the data.
    pub fn head(&self) -> Options {
        Options {
            name: self.name.into(),
            ethnicity: self.ethnicity,
            gender: self.gender,
            age: self.age,
            weight: self.weight,
            muscle: self.muscle,
            targets: targets(self.targets),
            ..Options::default()
        }
    }

    /// Maps and hair.
    pub fn skin(&self) -> synthesize::Options {
        synthesize::Options {
            seed: self.seed,
            age_years: self.age_years,
            melanin: self.melanin,
            hemoglobin: self.hemoglobin,
            freckles: self.freckles,
            moles: self.moles,
            brows: self.brows,
            stubble: self.stubble,
            scalp_hair: self.scalp_hair,
            hair_melanin: self.hair_melanin,
            grey_hair: self.grey_hair,
            ..synthesize::Options::default()
        }
    }
}

/// Paths and weights with `*` written out for both sides.
pub(super) fn targets(list: &[(&str, f32)]) -> Vec<(String, f32)> {
    let sides = |(path, weight): &(&str, f32)| {
        let sides: &[&str] = if path.contains('*') { &["l-", "r-"] } else { &[""] };
        sides.iter().map(|side| (path.replace('*', side), *weight)).collect::<Vec<_>>()
    };
    list.iter().flat_map(sides).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_character_is_the_default_head() {
        assert_eq!(CHARACTERS[0].head(), Options::default());
        assert!(Character::find("nobody").is_none());
    }

    #[test]
    fn people_have_names_and_seeds_of_their_own_and_every_target_has_both_sides() {
        for (i, a) in CHARACTERS.iter().enumerate() {
            assert!(CHARACTERS[..i].iter().all(|b| a.name != b.name && a.seed != b.seed), "{}", a.name);
            let targets = a.head().targets;
            assert!(targets.iter().all(|(path, _)| !path.contains('*')));
            let count = |side: &str| targets.iter().filter(|(p, _)| p.contains(side)).count();
            assert_eq!(count("/l-"), count("/r-"), "{}", a.name);
        }
        assert_eq!(targets(&[("eyes/*eye-bag-incr", 0.5)])[1], ("eyes/r-eye-bag-incr".into(), 0.5));
    }
}
