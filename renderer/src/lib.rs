//! Draws the state of a face.
