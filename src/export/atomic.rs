//! Files that are complete or not there.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Why a file could not be written. What stood there before still stands.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// Free some space and write it again: the journal has all that it needs.
    #[error("{}: disk full; nothing of it was kept", path.display())]
    DiskFull {
        /// The file.
        path: PathBuf,
    },
    /// Permissions, or a folder that is not there.
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// Writes a file by way of a temporary one beside it: synced, then renamed. After a crash there is
/// the file as it was, or as it shall be, and never a part of it. An existing file is replaced; a
/// link to one stays a link. What is no file (a terminal, a pipe, /dev/null) is written to.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), ExportError> {
    let linked = std::fs::canonicalize(path);
    let target = linked.as_deref().unwrap_or(path);
    let partial = partial_of(target);
    let written = match std::fs::metadata(target) {
        Ok(found) if found.is_dir() => Err(ErrorKind::IsADirectory.into()),
        Ok(found) if !found.is_file() => write_to(target, false, write).map(|_| ()),
        _ => write_and_rename(target, &partial, write),
    };
    written.map_err(|source| {
        // It may not be there, and it is of no use.
        let _ = std::fs::remove_file(&partial);
        let path = path.to_owned();
        if is_disk_full(&source) {
            ExportError::DiskFull { path }
        } else {
            ExportError::Write { path, source }
        }
    })
}

/// Whether the disk, or what the user may take of it, is at its end.
fn is_disk_full(error: &io::Error) -> bool {
    use ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
    matches!(cause(error), FileTooLarge | QuotaExceeded | StorageFull)
}

/// What the system said: the writer of CSV wraps its error in one of its own.
pub fn cause(error: &io::Error) -> ErrorKind {
    let wrapped = error.get_ref().and_then(|inner| inner.downcast_ref::<csv::Error>());
    match wrapped.map(csv::Error::kind) {
        Some(csv::ErrorKind::Io(inner)) => cause(inner),
        _ => error.kind(),
    }
}

fn write_and_rename(
    path: &Path,
    partial: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    write_to(partial, true, write)?.sync_all()?;
    std::fs::rename(partial, path)?;
    // The new name is durable once its folder is.
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
}

fn write_to(
    path: &Path,
    is_file: bool,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<File> {
    let file = OpenOptions::new().write(true).create(is_file).truncate(is_file).open(path)?;
    let mut buffered = BufWriter::new(file);
    write(&mut buffered)?;
    buffered.into_inner().map_err(io::IntoInnerError::into_error)
}

/// A name beside `path` that no other process uses.
fn partial_of(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.{}.partial", std::process::id()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_file_is_replaced_as_a_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fit.json");
        for text in ["first", "2"] {
            write_atomically(&path, |out| out.write_all(text.as_bytes())).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(names(folder.path()), ["fit.json"]);
    }

    #[test]
    fn a_failure_leaves_what_was_there_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("samples.csv");
        let full = |out: &mut dyn Write| {
            out.write_all(b"half of it")?;
            Err(csv::Error::from(io::Error::from(ErrorKind::StorageFull)).into())
        };
        let error = write_atomically(&path, full).unwrap_err();
        assert!(error.to_string().ends_with("disk full; nothing of it was kept"), "{error}");
        assert_eq!(names(folder.path()), [""; 0]);
        std::fs::write(&path, "before").unwrap();
        write_atomically(&path, full).unwrap_err();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "before");
        assert_eq!(names(folder.path()), ["samples.csv"]);
    }

    #[test]
    fn what_is_no_file_is_written_to_and_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let (target, link) = (folder.path().join("fit-1.json"), folder.path().join("fit.json"));
        std::fs::write(&target, "before").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        write_atomically(&link, |out| out.write_all(b"after")).unwrap();
        assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(std::fs::read_to_string(&target).unwrap(), "after");
        let device = folder.path().join("null");
        std::os::unix::fs::symlink("/dev/null", &device).unwrap();
        write_atomically(&device, |out| out.write_all(b"nowhere")).unwrap();
        assert!(!std::fs::metadata("/dev/null").unwrap().is_file());
        let error = write_atomically(folder.path(), |_| Ok(())).unwrap_err();
        assert!(error.to_string().contains("directory"), "{error}");
    }

    #[test]
    fn a_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("nowhere/samples.csv");
        let error = write_atomically(&path, |_| Ok(())).unwrap_err();
        assert!(
            error.to_string().contains("nowhere/samples.csv: cannot be written: No such file"),
            "{error}"
        );
    }
}
