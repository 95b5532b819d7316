//! What a run is made of, put together from its files: the plan, the rig, the sequence of
//! readings, and for a simulated rig the compiled scene. Everything that can be wrong with the
//! input is found here, before anything moves.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use spanned_toml::{Document, Source};

use super::adapting;
use super::args::{EffectArgs, RigArgs};
use super::failure::Failure;
use super::inputs::{BUILT_IN, Inputs, beside};
use super::nominal::{misaligned, nominal};
use super::twins;
use crate::journal::{EffectWishes, Input, InputRole, Reader};
use crate::plan::{Plan, PlanHash, Region, Sequence};
use crate::rig::Rig;
use crate::study::adaptive::Account;

/// The simulated rig, compiled from its scene.
#[derive(Debug, Clone)]
pub(crate) struct Stage {
    pub(crate) compiled: Arc<sim::Compiled>,
    pub(crate) faults: sim::LinkFaults,
    pub(crate) device_faults: Vec<sim::DeviceFault>,
    /// For the how-manieth time devices of other makes are switched on for this run.
    pub(crate) boot: u32,
    pub(crate) seed: u64,
}

/// All that a run is made of.
#[derive(Debug, Clone)]
pub(crate) struct Setup {
    pub(crate) plan: Plan,
    pub(crate) plan_name: String,
    pub(crate) plan_hash: PlanHash,
    pub(crate) rig: Rig,
    /// All of it, but for what an adaptive run's rounds are still to add.
    pub(crate) sequence: Sequence,
    /// What an adaptive run's rounds found so far.
    pub(crate) accounts: Vec<Account>,
    /// The text of the plan's list of poses, if it has one.
    pub(crate) list: Option<Source>,
    /// `None` for a real rig.
    pub(crate) stage: Option<Stage>,
    pub(crate) seed: u64,
    /// What was wanted of a simulated rig's effects.
    pub(crate) wishes: EffectWishes,
    /// The files, byte for byte.
    pub(crate) inputs: Vec<Input>,
}

/// What is chosen beyond what the plan names.
#[derive(Debug, Clone, Default)]
struct Choice {
    rig: Option<PathBuf>,
    scene: Option<PathBuf>,
    seed: u64,
    wishes: EffectWishes,
    /// Whether a real rig's simulated twin takes its place.
    is_rehearsal: bool,
}

impl Setup {
    /// From the files on the disk.
    pub(crate) fn from_disk(
        plan: &Path,
        args: &RigArgs,
        effects: &EffectArgs,
    ) -> Result<Self, Failure> {
        let choice = Choice {
            rig: args.rig.clone(),
            scene: args.scene.clone(),
            seed: args.seed,
            wishes: effects.wishes(),
            is_rehearsal: false,
        };
        Self::build(Inputs::from_disk(), plan, choice, None)
    }

    /// The same on the rig's simulated twin, before the scene that the arguments or the plan name.
    pub(crate) fn for_rehearsal(plan: &Path, args: &RigArgs) -> Result<Self, Failure> {
        let choice = Choice {
            rig: args.rig.clone(),
            scene: args.scene.clone(),
            seed: args.seed,
            is_rehearsal: true,
            ..Choice::default()
        };
        Self::build(Inputs::from_disk(), plan, choice, None)
    }

    /// From what was read before: a journal's inputs, or a client's. `plan_name` is what the run
    /// was called then.
    pub(crate) fn from_inputs(
        inputs: Vec<Input>,
        plan_name: Option<String>,
        seed: u64,
        wishes: EffectWishes,
    ) -> Result<Self, Failure> {
        let choice = Choice { seed, wishes, ..Choice::default() };
        Self::build(Inputs::from_memory(inputs), Path::new("plan.toml"), choice, plan_name)
    }

    /// The same rig and scene under another plan, whose text takes the place of this one's: a rung of
    /// a ladder.
    pub(crate) fn with_plan(&self, plan: Plan, seed: u64) -> Result<Self, Failure> {
        let sequence = plan.lay_out(&self.rig, self.list.as_ref())?;
        let plan_hash = plan.hash(&sequence);
        let terms = terms_of(&self.rig, &plan, &sequence, seed, &self.wishes);
        let stage = self.stage.as_ref();
        let stage = stage.map(|stage| stage.on_terms(&self.rig, &terms)).transpose()?;
        let mut inputs = self.inputs.clone();
        for input in inputs.iter_mut().filter(|input| input.role == InputRole::Plan) {
            input.bytes = plan.document().source().text().as_bytes().to_vec();
        }
        let accounts = Vec::new();
        Ok(Self { plan, plan_hash, sequence, accounts, stage, seed, inputs, ..self.clone() })
    }

    fn build(
        mut inputs: Inputs,
        plan_path: &Path,
        choice: Choice,
        plan_name: Option<String>,
    ) -> Result<Self, Failure> {
        let plan = Plan::read(inputs.document(InputRole::Plan, plan_path)?)?;
        let plan_name = plan.name.clone().or(plan_name).unwrap_or_else(|| folder_name(plan_path));
        let mut rig = read_rig(&mut inputs, plan_path, &plan, &choice)?;
        if choice.is_rehearsal {
            rig = rig.twin();
        }
        let (list, sequence) = lay_out(&mut inputs, plan_path, &plan, &rig)?;
        let plan_hash = plan.hash(&sequence);
        let Choice { seed, ref wishes, .. } = choice;
        let terms = terms_of(&rig, &plan, &sequence, seed, wishes);
        let stage = read_stage(&mut inputs, plan_path, &plan, &choice, &rig, &terms)?;
        let (inputs, wishes) = (inputs.read().to_vec(), choice.wishes);
        let accounts = Vec::new();
        Ok(Self {
            plan,
            plan_name,
            plan_hash,
            rig,
            sequence,
            accounts,
            list,
            stage,
            seed,
            wishes,
            inputs,
        })
    }

    /// The same with what a run's rounds have added to it by now.
    pub(crate) fn with_rounds(mut self, reader: &Reader) -> Result<Self, Failure> {
        if self.plan.adaptive().is_some() {
            self.sequence = self.sequence.with_steps(&self.rig, reader.steps()?);
            self.accounts = adapting::accounts(reader)?;
        }
        Ok(self)
    }

    /// The fit's region.
    pub(crate) fn region(&self) -> Region {
        self.plan.region
    }

    /// What is true, on a simulated rig.
    pub(crate) fn truth(&self) -> Option<sim::Truth<'_>> {
        let region = region_of(&self.plan);
        self.stage.as_ref().map(|stage| stage.compiled.truth(region))
    }
}

impl Stage {
    pub(crate) fn on_terms(&self, rig: &Rig, terms: &sim::Terms) -> Result<Self, Failure> {
        compile(self.compiled.scene().clone(), rig, terms)
    }
}

impl EffectArgs {
    /// As they are recorded.
    pub(crate) fn wishes(&self) -> EffectWishes {
        let (force, without) = (self.force.clone(), self.without.clone());
        EffectWishes { tolerance: self.tolerance, force, without, ignores_plan: false }
    }

    /// On which a rig is compiled where no plan is known.
    pub(crate) fn terms(&self, seed: u64) -> sim::Terms {
        terms_without_plan(seed, &self.wishes())
    }
}

fn terms_without_plan(seed: u64, wishes: &EffectWishes) -> sim::Terms {
    let EffectWishes { tolerance, force, without, .. } = wishes.clone();
    sim::Terms { tolerance, force, without, ..sim::Terms::seeded(seed) }
}

/// On which terms a plan's rig is compiled.
pub(crate) fn terms_of(
    rig: &Rig,
    plan: &Plan,
    sequence: &Sequence,
    seed: u64,
    wishes: &EffectWishes,
) -> sim::Terms {
    let terms = terms_without_plan(seed, wishes);
    if wishes.ignores_plan {
        return terms;
    }
    // What readings decide upon ends by the plan's limit.
    let limit = plan.stop.rig_time_max.filter(|_| plan.adaptive().is_some());
    let run_s = limit.map_or(sequence.prediction.total_s(), |limit| limit.as_secs_f64());
    sim::Terms {
        region: Some(region_of(plan)),
        dwell_s: plan.dwell.as_secs_f64(),
        sweep: sequence.speeds(rig),
        run_s,
        ..terms
    }
}

fn region_of(plan: &Plan) -> sim::Region {
    let Region { x_m, y_m, theta_max_rad } = plan.region;
    sim::Region { x_m, y_m, theta_max_rad }
}

/// A plan's list of poses, if it has one, and its readings.
pub(crate) fn lay_out(
    inputs: &mut Inputs,
    plan_path: &Path,
    plan: &Plan,
    rig: &Rig,
) -> Result<(Option<Source>, Sequence), Failure> {
    let list = plan.list_file().map(|name| read_list(inputs, plan_path, plan, name));
    let list = list.transpose()?;
    let sequence = plan.lay_out(rig, list.as_ref())?;
    Ok((list, sequence))
}

/// Reads the plan's list of poses.
fn read_list(
    inputs: &mut Inputs,
    plan_path: &Path,
    plan: &Plan,
    name: &str,
) -> Result<Source, Failure> {
    let expected = "a CSV of poses, relative to the plan's folder";
    let refused = |what: &str, help: &str| match plan.document().root().table("schedule") {
        Ok(Some(schedule)) => schedule.problem("file", what, expected, help).into(),
        _ => Failure::start(what),
    };
    let bytes = inputs
        .attachment(plan_path, name)
        .map_err(|error| refused(&error, "correct the path, or put the list there"))?;
    let text = String::from_utf8(bytes).map_err(|_| {
        refused(&format!("{name}: is not text in UTF-8"), "save the list as plain CSV")
    })?;
    Ok(Source::new(name, &text))
}

/// The path of a file that the plan names; where it is missing, the plan's line is at fault.
fn named_in_plan(
    inputs: &Inputs,
    plan_path: &Path,
    plan: &Plan,
    key: &str,
    name: &str,
) -> Result<PathBuf, Failure> {
    let path = beside(plan_path, name);
    let Some(error) = inputs.absence(&path) else { return Ok(path) };
    let help = format!("correct the path, or choose another file with --{key}");
    let what = format!("{}: cannot be read: {error}", path.display());
    let expected = "a file, relative to the plan's folder";
    Err(plan.document().root().problem(key, &what, expected, &help).into())
}

/// Reads the rig that the choice or the plan names; with neither it is an error, so that no
/// fabricated data come by forgetting a flag.
fn read_rig(
    inputs: &mut Inputs,
    plan_path: &Path,
    plan: &Plan,
    choice: &Choice,
) -> Result<Rig, Failure> {
    if inputs.remembers(InputRole::Rig) {
        return Ok(Rig::read(inputs.document(InputRole::Rig, Path::new("rig.toml"))?)?);
    }
    let path = match (&choice.rig, plan.rig.as_deref()) {
        (Some(path), _) => path.clone(),
        (None, Some(BUILT_IN)) => PathBuf::from(BUILT_IN),
        (None, Some(name)) => named_in_plan(inputs, plan_path, plan, "rig", name)?,
        (None, None) => {
            return Err(Failure::with_help(
                format!("{}: the plan names no rig, and neither does --rig", plan_path.display()),
                "add `rig = \"rig.toml\"` (or \"simulated\") to the plan, or give --rig",
            ));
        }
    };
    rig_at(inputs, &path)
}

/// The rig at a path, or the built-in one by its name.
pub(crate) fn rig_at(inputs: &mut Inputs, path: &Path) -> Result<Rig, Failure> {
    if path == Path::new(BUILT_IN) {
        let rig = Rig::built_in()?;
        inputs.note(InputRole::Rig, rig.document());
        return Ok(rig);
    }
    Ok(Rig::read(inputs.document(InputRole::Rig, path)?)?)
}

fn read_stage(
    inputs: &mut Inputs,
    plan_path: &Path,
    plan: &Plan,
    choice: &Choice,
    rig: &Rig,
    terms: &sim::Terms,
) -> Result<Option<Stage>, Failure> {
    if !rig.is_simulated() {
        return match &choice.scene {
            None => Ok(None),
            Some(scene) => Err(Failure::with_help(
                format!("--scene {}: {} is a real rig", scene.display(), rig.name),
                "leave --scene out, or choose a simulated rig with --rig",
            )),
        };
    }
    let path = match (&choice.scene, plan.scene.as_deref()) {
        (Some(path), _) => path.clone(),
        (None, Some(name)) => named_in_plan(inputs, plan_path, plan, "scene", name)?,
        (None, None) if inputs.remembers(InputRole::Scene) => PathBuf::from("scene.toml"),
        (None, None) => {
            return Err(Failure::with_help(
                format!("{}: a simulated rig needs a scene to look at", plan_path.display()),
                "add `scene = \"scene.toml\"` to the plan, or give --scene",
            ));
        }
    };
    super::run::check_simulated(plan)?;
    twins::check_faults(rig, &rig.devices.as_ref().map(twins::of).unwrap_or_default())?;
    Ok(Some(stage_at(inputs, &path, rig, terms)?))
}

/// The refusal of a simulated rig that nobody gave anything to look at.
pub(crate) fn no_scene(rig: &Rig) -> Failure {
    Failure::with_help(
        format!("{}: a simulated rig needs a scene to look at", rig.name),
        "give one with --scene, for example examples/luminaire/scene.toml",
    )
}

/// Reads the scene at a path and compiles it for the rig.
pub(crate) fn stage_at(
    inputs: &mut Inputs,
    path: &Path,
    rig: &Rig,
    terms: &sim::Terms,
) -> Result<Stage, Failure> {
    let document: Document = inputs.document(InputRole::Scene, path)?;
    if document.root().has("schedule") {
        return Err(Failure::with_help(
            format!("{}: is a plan, not a scene", path.display()),
            "give the scene that the plan names; a plan goes with --plan",
        ));
    }
    let inputs = RefCell::new(inputs);
    let load = |name: &str| inputs.borrow_mut().attachment(path, name);
    let scene = sim::Scene::read(&document, nominal(rig).quantity, &load)?;
    compile(scene, rig, terms)
}

fn compile(scene: sim::Scene, rig: &Rig, terms: &sim::Terms) -> Result<Stage, Failure> {
    let root = rig.document().root();
    let simulated = root.table("simulated")?.map(sim::Simulated::read).transpose()?;
    let mut simulated = simulated.unwrap_or_default();
    simulated.misalignment = misaligned(rig, simulated.misalignment);
    let (faults, device_faults) = (simulated.faults, simulated.device_faults.clone());
    let compiled = sim::compile(scene, nominal(rig), simulated, terms)
        .map_err(|error| refused(&error, rig))?;
    Ok(Stage { compiled: Arc::new(compiled), faults, device_faults, boot: 1, seed: terms.seed })
}

/// Where what can't be compiled was written: in the rig's file, in the scene's, or on the command line.
fn refused(error: &sim::CompileError, rig: &Rig) -> Failure {
    use sim::CompileError as E;
    match error {
        E::Effect { .. } | E::Quantity { .. } | E::Terms(..) | E::UnknownEffect { .. } => {
            Failure::start(error)
        }
        E::Scene(_) | E::Unsupported(_) => Failure::start(format!("the scene: {error}")),
        _ => Failure::start(format!("{}: {error}", rig.document().source().name())),
    }
}

/// A plan without a name is called after its folder.
pub(crate) fn folder_name(plan: &Path) -> String {
    let absolute = std::path::absolute(plan).unwrap_or_else(|_| plan.to_owned());
    let folder = absolute.parent().and_then(Path::file_name);
    folder.map_or_else(|| "run".to_owned(), |name| name.to_string_lossy().into_owned())
}
