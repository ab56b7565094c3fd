//! The face and its skin as numbers.
//!
//! ```text
//! rig.json -------> expression::Rig ------+
//! Head (names) ---------------------------+--> bind::BoundRig -----+
//! sequence.json --> timeline::Sequence ----------------------------+--> evaluate::Evaluator
//!   (json: every error with file, line, column)                               | at(time)
//!                                                                             v
//! Head (points) --> deform (CPU reference of the kernels) <-- FaceState <-- evaluate::Shot --> renderer, export
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

pub mod atlas;
pub mod authored;
pub mod bind;
pub mod bvh;
pub mod camera;
pub mod color;
pub mod deform;
pub mod error;
pub mod evaluate;
pub mod exchange;
pub mod expression;
pub mod face_state;
pub mod framing;
pub mod head;
pub mod hemoglobin;
pub mod json;
pub mod landmarks;
pub mod level;
pub mod life;
pub mod lights;
pub mod limits;
pub mod map;
pub mod mask;
pub mod names;
pub mod random;
pub mod reduce;
pub mod skin;
pub mod strain;
pub mod timeline;
