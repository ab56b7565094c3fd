//! Files to heads and back.
//!
//! ```text
//! OBJ, sets of OBJ +                                        +--> .glb (one file, any glTF viewer opens it)
//! glTF, VRM, USD --+--> import --> Head --> convert --------+--> .usda, .usdz
//! MakeHuman data --+                (occlusion, maps)       +--> check: faults and entries without effect
//! ```
//!
//! ```
//! use rubor_assets::{export, import};
//! use rubor_rig::head::{Head, Material, Mesh, Part, Vertex};
//!
//! let corner = |x: f32, y: f32| glam::Vec3::new(x, y, 0.0);
//! let mesh = Mesh {
//!     points: vec![corner(0.0, 0.0), corner(0.1, 0.0), corner(0.0, 0.1)],
//!     vertices: (0..3).map(|point| Vertex { point, uv: glam::Vec2::ZERO }).collect(),
//!     triangles: vec![[0, 1, 2]],
//!     parts: vec![Part { name: "face".into(), material: Material::Skin, triangles: 0..1 }],
//!     ..Mesh::default()
//! };
//! let head = Head { name: "triangle".into(), mesh, ..Head::default() };
//! let glb = export::gltf::to_bytes(&head, &export::gltf::Options::default())?;
//! let read = import::gltf::from_bytes(&glb, "triangle.glb".as_ref())?;
//! assert_eq!(read.head.mesh, head.mesh);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod check;
pub mod compare;
pub mod convert;
pub mod environment;
pub mod error;
pub mod export;
pub mod facial_appearance;
pub mod files;
pub mod image_io;
pub mod import;
pub mod landmarks;
pub mod notes;
pub mod parts;
pub mod poly;
pub mod synthesize;
pub mod usdz;
