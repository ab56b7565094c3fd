//! Names of anatomical points by which maps and cameras are placed.
//!
//! `left` and `right` are the character's; left is +X. A head need not have all of them.
//! Names follow anthropometry where it has one (exocanthion = outer corner of the eye, alare = wing of the nose,
//! cheilion = corner of the mouth, gonion = corner of the jaw, glabella = between the brows).

/// Points on the middle line, top to bottom.
pub const MIDDLE: [&str; 10] = [
    "vertex",           // highest point of the head
    "trichion",         // hairline
    "glabella",         // between the brows
    "sellion",          // root of the nose
    "pronasale",        // tip of the nose
    "subnasale",        // where nose meets upper lip
    "labrale-superius", // upper border of the upper lip
    "stomion",          // where the lips meet
    "labrale-inferius", // lower border of the lower lip
    "menton",           // lowest point of the chin
];

/// Paired points; each exists as `NAME-left` and `NAME-right`.
pub const PAIRED: [&str; 14] = [
    "eye",          // centre of the eyeball (inside the head)
    "endocanthion", // inner corner of the eye
    "exocanthion",  // outer corner of the eye
    "lid-upper",    // middle of the upper lid's edge
    "lid-lower",    // middle of the lower lid's edge
    "brow-inner",
    "brow-middle",
    "brow-outer",
    "alare",    // wing of the nose
    "cheilion", // corner of the mouth
    "zygion",   // cheek bone, in front of the ear
    "cheek",    // apple of the cheek
    "gonion",   // corner of the jaw
    "ear",      // middle of the ear's rim
];

/// `name-left` for side +1, `name-right` for -1.
pub fn paired(name: &str, left: bool) -> String {
    format!("{name}-{}", if left { "left" } else { "right" })
}
