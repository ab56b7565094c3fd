//! Conversions between what files hold and what heads hold.

mod bvh;
pub mod occlusion;
