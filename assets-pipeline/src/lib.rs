//! Files to heads and back.
