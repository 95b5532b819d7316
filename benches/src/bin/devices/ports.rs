//! Simulated devices at pseudo-terminals, in a process of their own, and a run on them.

use std::io::Read as _;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use benches::{Program, Unmeasured};

use crate::rigs::METER;

const PATIENCE: Duration = Duration::from_secs(10);
/// In which axes that nobody stops come to rest, and are seen to.
const AFTERMATH: Duration = Duration::from_secs(6);

/// Ends with this.
pub(crate) struct Simulated(Child);

impl Drop for Simulated {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Simulated {
    /// `gonio sim` with these words, at these links.
    pub(crate) fn switched_on(
        program: &Program,
        words: &[&str],
        links: &[&str],
    ) -> Result<Self, Unmeasured> {
        let mut command = program.command(words);
        command.args(["--pty", &links.join(",")]).stderr(Stdio::piped());
        let simulated = Self(command.spawn()?);
        let began = Instant::now();
        while links.iter().any(|link| !Path::new(link).exists()) {
            if began.elapsed() > PATIENCE {
                return Err(Unmeasured::because("`gonio sim` made no pseudo-terminals"));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        Ok(simulated)
    }

    /// Switches it off; what it said.
    fn said(mut self) -> Result<String, Unmeasured> {
        self.0.kill()?;
        let mut said = String::new();
        if let Some(mut error) = self.0.stderr.take() {
            error.read_to_string(&mut said)?;
        }
        Ok(said)
    }
}

/// Runs the plan of a folder on its rig's devices, which answer at ports; what the devices noted,
/// and what the run said.
pub(crate) fn run(
    program: &Program,
    folder: &Path,
    axes: &str,
) -> Result<(String, String), Unmeasured> {
    let path = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let links = [path(axes), path(METER)];
    let mut real = std::fs::read_to_string(folder.join("rig.toml"))?;
    real.truncate(real.find("\n[simulated]").unwrap_or(real.len()));
    real = real.replace("kind = \"simulated\"", "kind = \"devices\"");
    for (driver, link) in [axes, METER].into_iter().zip(&links) {
        let line = format!("driver = \"{driver}\"\n");
        real = real.replace(&line, &format!("{line}port = \"{link}\"\n"));
    }
    std::fs::write(folder.join("real.toml"), real)?;
    let plan = std::fs::read_to_string(folder.join("plan.toml"))?;
    let plan = plan.replace("scene = \"scene.toml\"\n", "");
    std::fs::write(folder.join("real-plan.toml"), plan)?;
    let (rig, scene) = (path("rig.toml"), path("scene.toml"));
    let words = ["sim", "--rig", &rig, "--scene", &scene];
    let simulated = Simulated::switched_on(program, &words, &[&links[0], &links[1]])?;
    let run = ["run", &path("real-plan.toml"), "--rig", &path("real.toml"), "--out", &path("run")];
    let error = program.run(&run)?.error;
    std::thread::sleep(AFTERMATH);
    Ok((simulated.said()?, error))
}
