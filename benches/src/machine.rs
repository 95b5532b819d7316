//! What a number was measured on: without it no number of time means anything.

use std::fs;
use std::path::Path;

use crate::{Arguments, Unmeasured};

/// The machine, as Linux describes it.
#[derive(Debug, Clone)]
pub struct Machine {
    processor: String,
    cores: usize,
    disk: String,
    load_before: String,
}

impl Machine {
    /// Looks around.
    pub fn look(arguments: &Arguments) -> Result<Self, Unmeasured> {
        if arguments.doc.is_some() && arguments.date.is_none() {
            return Err(Unmeasured::because("--doc needs --date: the document states the day"));
        }
        let processors = fs::read_to_string("/proc/cpuinfo")?;
        let model = |line: &str| {
            line.strip_prefix("model name")
                .and_then(|rest| Some(rest.split_once(": ")?.1.to_owned()))
        };
        Ok(Self {
            processor: processors.lines().find_map(model).unwrap_or_else(|| "unnamed".to_owned()),
            cores: std::thread::available_parallelism()?.get(),
            disk: file_system_of(&std::env::temp_dir()),
            load_before: load()?,
        })
    }

    /// One sentence for the document.
    pub fn describe(&self, arguments: &Arguments) -> Result<String, Unmeasured> {
        let Self { processor, cores, disk, load_before } = self;
        let (date, beside) = (arguments.date.as_deref().unwrap_or("undated"), &arguments.beside);
        let load_after = load()?;
        Ok(format!(
            "{date} · {processor}, {cores} cores · {disk} · beside it: {beside} (load average \
             {load_before} before, {load_after} after)"
        ))
    }
}

/// The mean number of processes that wanted to run in the last minute.
fn load() -> Result<String, Unmeasured> {
    let averages = fs::read_to_string("/proc/loadavg")?;
    Ok(averages.split(' ').next().unwrap_or("unknown").to_owned())
}

/// The file system and the device that hold a folder.
pub fn file_system_of(folder: &Path) -> String {
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let mounts = fs::read_to_string("/proc/self/mounts").unwrap_or_default();
    let holding = mounts.lines().filter_map(|line| {
        let mut words = line.split(' ');
        let (device, place, kind) = (words.next()?, words.next()?, words.next()?);
        folder.starts_with(place).then_some((place.len(), device, kind))
    });
    // Of equal ones the last hides the others.
    let Some((_, device, kind)) = holding.max_by_key(|(length, ..)| *length) else {
        return "an unknown file system".to_owned();
    };
    let name = device.rsplit('/').next().unwrap_or(device);
    let is_virtual = name.starts_with("vd");
    let medium = if is_virtual { "a virtual machine's disk" } else { "a disk" };
    if kind == "tmpfs" {
        "tmpfs, in memory".to_owned()
    } else {
        format!("{kind} on {device}, {medium}")
    }
}
