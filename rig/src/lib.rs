//! The face and its skin as numbers.
//!
//! ```text
//! Head (mesh, shapes, maps) --+
//! Rig (rig.json) -------------+--> evaluate(time) --> FaceState --> renderer, export
//! Sequence (sequence.json) ---+                           |
//!                                                         +--> deform (CPU truth of the kernels)
//! ```
//!
//! Pure CPU: no GPU, no file formats beyond serde.
//!
//! ```
//! use rubor_rig::head::{Head, Mesh};
//! use rubor_rig::face_state::FaceState;
//!
//! let head = Head { name: "empty".into(), ..Head::default() };
//! head.validate().unwrap();
//! assert_eq!(FaceState::neutral(&head).hemoglobin_scale, 1.0);
//! ```

pub mod color;
pub mod deform;
pub mod error;
pub mod face_state;
pub mod head;
pub mod hemoglobin;
pub mod landmarks;
pub mod map;
pub mod mask;
pub mod skin;
pub mod strain;
