//! Reference cases in, one a line on standard input; for each `id,value,ns` on standard output: our
//! kernel's answer and its time per call. For comparisons in one run with programs that are not
//! Rust. A quantity that is no kernel of `radiometry`'s has neither value nor time.

use std::hint::black_box;
use std::io::{self, BufRead as _, Write as _};
use std::process::ExitCode;

use benches::{Unmeasured, call_ns, kernel};
use serde_json::Value;

fn main() -> ExitCode {
    match answer() {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("not measured: {why}");
            ExitCode::FAILURE
        }
    }
}

fn answer() -> Result<(), Unmeasured> {
    let mut out = io::stdout().lock();
    for line in io::stdin().lock().lines() {
        let case: Value = serde_json::from_str(&line?)?;
        let text = |key: &str| case[key].as_str().unwrap_or_default();
        match kernel::call(text("quantity"), &case["inputs"])? {
            Some(call) => {
                let ns = call_ns(|| black_box(call.answer()));
                writeln!(out, "{},{:e},{ns:.2}", text("id"), call.answer())?;
            }
            None => writeln!(out, "{},,", text("id"))?,
        }
    }
    Ok(())
}
