//! Files of other tools: bytes to tables and pixel grids. Each format has a module of its own, read strictly: a file
//! is understood whole or refused with the line, what was expected and what was found.
//!
//! No file is opened here, and nothing is known of rays, radiance or rigs: the caller brings the
//! bytes and gives the numbers their place.

pub mod lm63;
pub mod netpbm;
