//! For reviews: the page, contact sheets, maps in a corner of a frame, videos, marks of the performance, two runs beside each other.

pub mod contact_sheet;
pub mod inset;
pub mod marks;
pub mod page;
pub mod text;
pub mod timeline;
pub mod versus;
pub mod video;
