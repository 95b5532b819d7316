//! What a study keeps of its runs: with a cache the same command goes on where it was stopped. It does not
//! know what a run of the study of cost is.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::cli::failure::Failure;
use crate::export::write_atomically;
use crate::plan::fnv1a64;
use crate::study::coverage::{Drawn, Run, Score};

/// Names this build of the program, by its own file's bytes: what a run comes to depends on nearly all
/// of them.
pub(super) fn program() -> Result<String, Failure> {
    let path = std::env::current_exe();
    let bytes = path.and_then(std::fs::read);
    let bytes = bytes.map_err(|error| {
        Failure::start(format!("--cache: this program's own file can't be read: {error}"))
    })?;
    Ok(format!("{:016x}", fnv1a64([&bytes[..]])))
}

/// Scores of runs of the study of coverage: a file a run, named by a hash of all that it depends on.
pub(super) struct Scores<'a> {
    folder: Option<&'a Path>,
    program: String,
}

impl<'a> Scores<'a> {
    /// Without a folder nothing is found nor kept.
    pub(super) fn new(folder: Option<&'a Path>) -> Result<Self, Failure> {
        let program = folder.map_or(Ok(String::new()), |_| program())?;
        Ok(Self { folder, program })
    }

    /// The run, if it was made. A file that can't be read, or is of something else, is as none.
    pub(super) fn find(&self, drawn: &Drawn, seed: u64) -> Option<Run> {
        let text = std::fs::read_to_string(self.path(drawn, seed)?).ok()?;
        let kept: Value = serde_json::from_str(&text).ok()?;
        if kept["of"] != self.of(drawn, seed) {
            return None;
        }
        let score = |pair: &Value| Some(Score { error: pair[0].as_f64()?, u: pair[1].as_f64()? });
        let scores = kept["scores"].as_array()?.iter().map(score).collect::<Option<_>>()?;
        Some(Run { scores })
    }

    /// Keeps a run.
    pub(super) fn keep(&self, drawn: &Drawn, seed: u64, run: &Run) -> Result<(), Failure> {
        let Some(path) = self.path(drawn, seed) else { return Ok(()) };
        let scores: Vec<[f64; 2]> = run.scores.iter().map(|score| [score.error, score.u]).collect();
        let kept = json!({ "of": self.of(drawn, seed), "scores": scores });
        write_atomically(&path, |out| writeln!(out, "{kept}")).map_err(Failure::midway)
    }

    fn path(&self, drawn: &Drawn, seed: u64) -> Option<PathBuf> {
        let seed = seed.to_le_bytes();
        let texts = [&self.program, &drawn.plan, &drawn.scene, &drawn.rig];
        let attached = drawn.attachments.iter().map(|attachment| &attachment.bytes[..]);
        let parts = texts.into_iter().map(String::as_bytes).chain([&seed[..]]).chain(attached);
        Some(self.folder?.join(format!("{:016x}.json", fnv1a64(parts))))
    }

    /// What can be compared by eye; the attachments are in the hash alone.
    fn of(&self, drawn: &Drawn, seed: u64) -> Value {
        let Drawn { plan, scene, rig, .. } = drawn;
        json!({ "program": self.program, "plan": plan, "scene": scene, "rig": rig, "seed": seed })
    }
}

/// What a study says that is stopped.
pub(super) fn stopped(cache: Option<&Path>) -> String {
    match cache {
        Some(cache) => format!(
            "stopped\n  help: the runs that were made are in {}: the same command goes on from there",
            cache.display()
        ),
        None => "stopped\n  help: with --cache FOLDER runs are kept, and the same command goes on"
            .to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::coverage::Attachment;

    #[test]
    fn a_kept_run_is_found_again_to_the_last_bit_and_nothing_else_is() {
        let folder = tempfile::tempdir().unwrap();
        let scores = Scores::new(Some(folder.path())).unwrap();
        let drawn = |byte| Drawn {
            plan: "plan".to_owned(),
            scene: "scene".to_owned(),
            rig: "rig".to_owned(),
            attachments: vec![Attachment { name: "table".to_owned(), bytes: vec![byte] }],
        };
        let run = Run { scores: vec![Score { error: 0.1 + 0.2, u: 1.0 / 3.0 }] };
        scores.keep(&drawn(1), 7, &run).unwrap();
        assert_eq!(scores.find(&drawn(1), 7), Some(run.clone()));
        assert_eq!(scores.find(&drawn(2), 7), None);
        assert_eq!(scores.find(&drawn(1), 8), None);
        let other = Scores { folder: Some(folder.path()), program: "another".to_owned() };
        assert_eq!(other.find(&drawn(1), 7), None);
        let nowhere = Scores::new(None).unwrap();
        nowhere.keep(&drawn(1), 7, &run).unwrap();
        assert_eq!(nowhere.find(&drawn(1), 7), None);
    }
}
