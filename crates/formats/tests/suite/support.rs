//! What the tests share.

pub mod largest_allocation;
