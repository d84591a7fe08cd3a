//! The commands of `rfl`, one file each.

pub mod drive;
