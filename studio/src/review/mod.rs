//! What people look at: contact sheets, maps in a corner of a frame, videos.

pub mod contact_sheet;
pub mod inset;
pub mod video;
