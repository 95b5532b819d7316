//! gonio
fn main() {}
