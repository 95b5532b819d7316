//! The files that a run is made from, byte for byte: read once, from the disk, from a journal or
//! from what a client sent, and journalled as they were read.
//!
//! It does not know what they say: it finds a file by its role and by the name that another file
//! calls it.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use spanned_toml::{Document, Source};

use super::failure::Failure;
use crate::journal::{Input, InputRole};

/// The largest attachment: a photometric file or a list of poses is far below.
const ATTACHMENT_BYTES_MAX: u64 = 64 << 20;
/// The name of the built-in rig, on the command line and in plans.
pub(crate) const BUILT_IN: &str = "simulated";

/// Where files come from.
#[derive(Debug, Clone)]
enum Origin {
    /// The disk; names are relative to the file that names them.
    Disk,
    /// Memory: a journal's inputs, or what a client sent. Nothing else is looked at.
    Memory(Vec<Input>),
}

/// Files as they were read, in order.
#[derive(Debug, Clone)]
pub(crate) struct Inputs {
    origin: Origin,
    read: Vec<Input>,
}

impl Inputs {
    /// From the disk.
    pub(crate) fn from_disk() -> Self {
        Self { origin: Origin::Disk, read: Vec::new() }
    }

    /// From what was read before.
    pub(crate) fn from_memory(inputs: Vec<Input>) -> Self {
        Self { origin: Origin::Memory(inputs), read: Vec::new() }
    }

    /// What was read so far.
    pub(crate) fn read(&self) -> &[Input] {
        &self.read
    }

    /// Reads and parses plan, rig or scene. `path` is where it lies on the disk.
    pub(crate) fn document(&mut self, role: InputRole, path: &Path) -> Result<Document, Failure> {
        let source = match &self.origin {
            Origin::Disk => Source::read(path)?,
            Origin::Memory(inputs) => {
                let input = inputs.iter().find(|input| input.role == role).ok_or_else(|| {
                    Failure::start(format!("no {} came with the run", role.name()))
                })?;
                let text = String::from_utf8_lossy(&input.bytes);
                Source::new(&input.name, &text)
            }
        };
        self.remember(role, source.name().to_owned(), source.text().as_bytes().to_vec());
        Ok(Document::parse(source)?)
    }

    /// Notes a document that is not a file: the built-in rig.
    pub(crate) fn note(&mut self, role: InputRole, document: &Document) {
        let source = document.source();
        self.remember(role, source.name().to_owned(), source.text().as_bytes().to_vec());
    }

    /// Whether memory holds a file of this role; the disk is never asked.
    pub(crate) fn remembers(&self, role: InputRole) -> bool {
        match &self.origin {
            Origin::Disk => false,
            Origin::Memory(inputs) => inputs.iter().any(|input| input.role == role),
        }
    }

    /// Whether `path` can't be looked up: why not. What was read before is not looked up again.
    pub(crate) fn absence(&self, path: &Path) -> Option<std::io::Error> {
        match &self.origin {
            Origin::Disk => std::fs::metadata(path).err(),
            Origin::Memory(_) => None,
        }
    }

    /// Reads what `named_in` calls `name`: a photometric file, a list of poses.
    pub(crate) fn attachment(&mut self, named_in: &Path, name: &str) -> Result<Vec<u8>, String> {
        let bytes = match &self.origin {
            Origin::Disk => read_bounded(&beside(named_in, name))?,
            Origin::Memory(inputs) => inputs
                .iter()
                .find(|input| input.role == InputRole::Attachment && input.name == name)
                .map(|input| input.bytes.clone())
                .ok_or_else(|| format!("{name}: did not come with the run"))?,
        };
        self.remember(InputRole::Attachment, name.to_owned(), bytes.clone());
        Ok(bytes)
    }

    fn remember(&mut self, role: InputRole, name: String, bytes: Vec<u8>) {
        if !self.read.iter().any(|input| input.role == role && input.name == name) {
            self.read.push(Input { role, name, bytes });
        }
    }
}

/// `name` seen from the folder of the file that names it.
pub(crate) fn beside(named_in: &Path, name: &str) -> PathBuf {
    named_in.parent().unwrap_or(Path::new("")).join(name)
}

fn read_bounded(path: &Path) -> Result<Vec<u8>, String> {
    use std::io::Read as _;
    let shown = path.display();
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(ATTACHMENT_BYTES_MAX + 1).read_to_end(&mut bytes))
        .map_err(|error| format!("{shown}: cannot be read: {error}"))?;
    if bytes.len() as u64 > ATTACHMENT_BYTES_MAX {
        return Err(format!("{shown}: is larger than {} MiB", ATTACHMENT_BYTES_MAX >> 20));
    }
    Ok(bytes)
}

/// The inputs of a run as one document: what `submit` sends and the daemon's queue keeps.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Bundle {
    /// The seed of everything random on a simulated rig.
    #[serde(default)]
    pub(crate) seed: u64,
    /// What the plan is called if it doesn't say: the client knows its folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) name: Option<String>,
    files: Vec<BundledFile>,
}

/// Text files are sent as they are; a byte that is not UTF-8 is not in any of their formats but
/// old photometric ones, whose keywords may be Latin-1: those go as numbers.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct BundledFile {
    role: String,
    name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    text: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    bytes: Option<Vec<u8>>,
}

impl Bundle {
    /// Packs what was read.
    pub(crate) fn pack(seed: u64, name: Option<String>, inputs: &[Input]) -> Self {
        let pack = |input: &Input| {
            let (role, name) = (input.role.name().to_owned(), input.name.clone());
            match String::from_utf8(input.bytes.clone()) {
                Ok(text) => BundledFile { role, name, text: Some(text), bytes: None },
                Err(e) => BundledFile { role, name, text: None, bytes: Some(e.into_bytes()) },
            }
        };
        Self { seed, name, files: inputs.iter().map(pack).collect() }
    }

    /// Unpacks it again; names the first file that makes no sense.
    pub(crate) fn unpack(self) -> Result<Vec<Input>, String> {
        let unpack = |file: BundledFile| {
            let role = InputRole::from_name(&file.role)
                .ok_or_else(|| format!("{}: no such role as \"{}\"", file.name, file.role))?;
            let bytes = match (file.text, file.bytes) {
                (Some(text), None) => text.into_bytes(),
                (None, Some(bytes)) => bytes,
                _ => return Err(format!("{}: expected either text or bytes", file.name)),
            };
            Ok(Input { role, name: file.name, bytes })
        };
        self.files.into_iter().map(unpack).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bundle_carries_every_byte() {
        let inputs = [
            Input { role: InputRole::Plan, name: "plan.toml".into(), bytes: b"a = 1\n".to_vec() },
            Input { role: InputRole::Attachment, name: "l.ies".into(), bytes: vec![0xe9, 10, 0] },
        ];
        let text = serde_json::to_string(&Bundle::pack(7, None, &inputs)).unwrap();
        let bundle: Bundle = serde_json::from_str(&text).unwrap();
        assert_eq!(bundle.seed, 7);
        assert_eq!(bundle.unpack().unwrap(), inputs);
    }

    #[test]
    fn memory_is_all_there_is() {
        let mut inputs = Inputs::from_memory(Vec::new());
        assert!(inputs.attachment(Path::new("/etc/x"), "hostname").is_err());
        assert!(inputs.document(InputRole::Plan, Path::new("/etc/hostname")).is_err());
    }
}
