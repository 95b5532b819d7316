//! The reference cases: what is asked, and the answer to 17 digits.

use std::path::Path;

use serde_json::Value;

use crate::Unmeasured;

/// Every case of `tests/data/cases.jsonl`, as its README describes them.
pub fn cases() -> Result<Vec<Value>, Unmeasured> {
    cases_of(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/cases.jsonl"))
}

/// Every case of a file of the same form.
pub fn cases_of(path: &Path) -> Result<Vec<Value>, Unmeasured> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| Unmeasured::because(format!("{}: {error}", path.display())))?;
    text.lines().map(|line| Ok(serde_json::from_str(line)?)).collect()
}
