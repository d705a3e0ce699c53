//! The `gpsindy` program.
fn main() {}
