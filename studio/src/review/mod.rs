//! Pictures for reviews: contact sheets, maps in a corner of a frame, videos.

pub mod contact_sheet;
pub mod inset;
pub mod video;
