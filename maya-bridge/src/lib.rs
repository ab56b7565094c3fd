//! Maya ASCII scenes in and out.
//!
//! ```text
//! .ma --ascii (lexer, parser)--> Scene --read (geometry, curve, head, motion)--> Head + Sequence + in-betweens
//! Head + Sequence --write--> .ma + textures (PNG) + the OSL shader
//! osl/rubor_skin.osl   hemoglobin, look-up and wrinkles for any OSL renderer
//! python/rubor_maya    a module for Maya's own Python: export, live weights, import
//! ```
//!
//! ```
//! use rubor_maya::read::{Options, from_bytes};
//! let scene = br#"//Maya ASCII 2024 scene
//! requires maya "2024";
//! currentUnit -l centimeter -a degree -t film;
//! createNode transform -n "face";
//! createNode mesh -n "faceShape" -p "face";
//!     setAttr -s 3 ".vt[0:2]" 0 0 0 10 0 0 0 10 0;
//!     setAttr -s 3 ".ed[0:2]" 0 1 0 1 2 0 2 0 0;
//!     setAttr ".fc[0]" -type "polyFaces" f 3 0 1 2;
//! "#;
//! let imported = from_bytes(scene, "face.ma".as_ref(), &Options::default())?;
//! assert_eq!(imported.head.mesh.points[1], glam::Vec3::new(0.1, 0.0, 0.0));
//! # Ok::<(), rubor_maya::error::ReadError>(())
//! ```

mod appearance;
mod ascii;
pub mod error;
mod notes;
pub mod read;
pub mod write;

/// The shader of skin colour, the text of the file in `osl/`.
pub const SKIN_OSL: &str = include_str!("../osl/rubor_skin.osl");

/// A name that Maya accepts for nodes and aliases: letters, digits and `_`, not starting with a digit.
pub(crate) fn plain_name(name: &str) -> String {
    let mut out: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if out.is_empty() || out.starts_with(|c: char| c.is_ascii_digit()) {
        out.insert(0, '_');
    }
    out
}
