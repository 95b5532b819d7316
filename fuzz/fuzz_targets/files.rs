//! Written files from bytes: rigs, plans, scenes, photometric files and images. A reader gives what
//! it read or says why not, in words; what a scene becomes is compiled too.
#![no_main]

use std::fmt::Display;

use gonio::plan::Plan;
use gonio::rig::Rig;
use libfuzzer_sys::fuzz_target;
use sim::{Quantity, Scene, Simulated};
use spanned_toml::{Document, Source};

/// What a scene may name: the bytes themselves, in the place of whatever file.
fn loaded(bytes: &[u8], name: &str) -> Result<Vec<u8>, String> {
    if name.is_empty() { Err("there is none".to_owned()) } else { Ok(bytes.to_vec()) }
}

fn in_words<T>(result: Result<T, impl Display>) -> Option<T> {
    match result {
        Ok(read) => Some(read),
        Err(error) => {
            assert!(!error.to_string().trim().is_empty(), "an error without words");
            None
        }
    }
}

fn run(kind: u8, bytes: &[u8]) {
    if kind % 8 == 6 {
        in_words(photometry_files::lm63::read(bytes));
        return;
    }
    if kind % 8 == 7 {
        in_words(photometry_files::netpbm::read(bytes));
        return;
    }
    // What a scene's files hold follows a byte that no text has.
    let mut parts = bytes.splitn(2, |byte| *byte == 0);
    let (text, rest) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    let text = String::from_utf8_lossy(text);
    let Some(document) = in_words(Document::parse(Source::new("a.toml", &text))) else { return };
    match kind % 8 {
        0 | 1 => drop(in_words(Rig::read(document))),
        2 => drop(in_words(Plan::read(document))),
        3 => drop(in_words(Simulated::read(document.root()))),
        _ => {
            let load = |name: &str| loaded(rest, name);
            in_words(Scene::read(&document, Quantity::Radiance, &load));
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    if let Some((kind, bytes)) = bytes.split_first() {
        run(*kind, bytes);
    }
});
