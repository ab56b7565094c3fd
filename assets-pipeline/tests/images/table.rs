//! The table of `docs/interchange.md`, made from what the readers do. `RUBOR_UPDATE_DOCS=1` writes it.
pub(crate) fn unused() {}
