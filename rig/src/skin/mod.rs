//! Light in skin: how far it travels before it leaves.
//!
//! ```text
//! Medium (sigma_s', sigma_a, eta) --> dipoles, multipole, photon beam diffusion --+
//!            |                                                                    +--> Profile (R, G, B)
//!            +--> photon walk --> radial table --> fits -------------------------+        |
//! measured sums of Gaussians ---------------------------------------------------+         +--> sum of Gaussians
//!                                                                                          +--> separable kernel
//!                                                                                          +--> T(s) look-up
//!                                                                                          +--> light on round skin, shadows
//! ```
//!
//! The colour of skin as a whole (melanin, hemoglobin --> linear Rec. 709) is in `chromophores`.
//!
//! Lengths are millimetres, coefficients are per millimetre, everything is f64.
//!
//! ```
//! use rubor_rig::skin::kernel::SeparableKernel;
//! use rubor_rig::skin::profile::Profile;
//!
//! let kernel = SeparableKernel::of(&Profile::deon_six(), 17).unwrap();
//! let red: f64 = kernel.weights.iter().map(|w| w[0]).sum();
//! assert!((red - 1.0).abs() < 1e-12);
//! ```

pub mod accuracy;
pub mod chromophores;
pub mod diffusion;
pub mod directional;
pub mod fit;
pub mod gaussians;
pub mod kernel;
pub mod medium;
pub mod model;
pub mod monte_carlo;
pub(crate) mod numerics;
pub mod preintegrated;
pub mod profile;
pub mod report;
pub mod slab;
pub mod table;
pub mod transmittance;
pub mod volume;
