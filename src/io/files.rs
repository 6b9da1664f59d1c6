//! Reading whole text files, and writing them so that nothing is ever half there.

use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use thiserror::Error;

use super::fault::Faults;

/// Model and pattern files are pages long; anything larger is not one of them.
const LARGEST_TEXT_BYTES: u64 = 16 * 1024 * 1024;

/// Why a file was not written.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum WriteError {
    #[error("cannot create the folder {path}: {source}", path = .path.display())]
    Folder { path: PathBuf, source: std::io::Error },
    #[error("{holder} writes into {path}: wait until it has ended, or choose another folder", path = .path.display())]
    Held { path: PathBuf, holder: String },
    #[error("{path} is read here, and a file of that name is written into its folder: choose another folder", path = .path.display())]
    WouldReplace { path: PathBuf },
    #[error("{path} is read here: choose another name for what is written", path = .path.display())]
    WouldReplaceItself { path: PathBuf },
    #[error("{path} was left there by no run, and a file of that name is written: choose another folder", path = .path.display())]
    NotOurs { path: PathBuf },
    #[error("cannot write {path}: {source}", path = .path.display())]
    File { path: PathBuf, source: std::io::Error },
}

/// The folder in which a file of that path lies.
pub(crate) fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// Reads a text file that is to be understood as a whole.
///
/// # Errors
/// A file that is missing, a folder, empty, binary or too large.
pub(crate) fn read_text(path: &Path) -> Result<String, Faults> {
    read_text_up_to(path, LARGEST_TEXT_BYTES)
}

/// As [`read_text`], for files of another size.
///
/// # Errors
/// As [`read_text`].
pub(crate) fn read_text_up_to(path: &Path, largest_bytes: u64) -> Result<String, Faults> {
    let shown = path.display().to_string();
    let fault = |message: String| Faults::of_file(&shown, message);
    let found = std::fs::metadata(path).map_err(|e| fault(format!("cannot be read: {e}")))?;
    if found.is_dir() {
        return Err(fault("expected a file, found a folder".to_owned()));
    }
    if found.len() > largest_bytes {
        return Err(fault(format!("expected a text file of at most {largest_bytes} bytes, found {}", found.len())));
    }
    // A pipe or device has no length to check beforehand.
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(largest_bytes + 1).read_to_end(&mut bytes))
        .map_err(|e| fault(format!("cannot be read: {e}")))?;
    if bytes.len() as u64 > largest_bytes {
        return Err(fault(format!("expected a text file of at most {largest_bytes} bytes, found more")));
    }
    let text = String::from_utf8(bytes).map_err(|e| {
        fault(format!(
            "expected text in UTF-8, found other bytes at offset {}: is it the right file?",
            e.utf8_error().valid_up_to()
        ))
    })?;
    if text.contains('\0') {
        return Err(fault("expected text, found a NUL byte: is it the right file?".to_owned()));
    }
    if text.trim().is_empty() {
        return Err(fault("the file is empty".to_owned()));
    }
    Ok(text)
}

/// SHA-256 of a file's text, as 64 hexadecimal digits.
pub fn sha256_hex(text: &str) -> String {
    Sha256::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Writes to a temporary name in the same folder, then renames: readers see the old file or the new one, whole.
///
/// # Errors
/// A folder or file that cannot be written.
pub fn write_atomically(path: &Path, contents: &[u8]) -> Result<(), WriteError> {
    let mut file = NewFile::create(path)?;
    file.write_all(contents).map_err(|source| WriteError::File { path: path.to_owned(), source })?;
    file.finish()
}

/// A file that is written piece by piece under a temporary name in the same folder; it takes its own name at the end.
///
/// The temporary name follows from the file's own (`.NAME.0.coilwright`), and whoever writes holds a lock on it: what a
/// killed run left behind is taken over by the next one that writes the same file, and never one that is being written.
#[derive(Debug)]
pub struct NewFile {
    path: PathBuf,
    temporary: PathBuf,
    file: File,
    finished: bool,
}

/// So many runs may write the same file at once; the last one to end leaves its own.
const MOST_WRITERS: usize = 64;
/// Seldom do more than these write the same file at once; each costs a look at the folder for every file that is written.
const LOOKED_BEYOND: usize = 3;

impl NewFile {
    /// # Errors
    /// A folder or file that cannot be written.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let folder = &folder_of(path);
        std::fs::create_dir_all(folder).map_err(|source| WriteError::Folder { path: folder.to_owned(), source })?;
        let fail = |source| WriteError::File { path: path.to_owned(), source };
        let name = path.file_name().ok_or_else(|| fail(std::io::ErrorKind::InvalidFilename.into()))?;
        let of_slot = |slot: usize| {
            let mut own = std::ffi::OsString::from(".");
            own.push(name);
            own.push(format!(".{slot}.coilwright"));
            folder.join(own)
        };
        for slot in 0..MOST_WRITERS {
            let temporary = of_slot(slot);
            if let Some(file) = claimed(&temporary).map_err(fail)? {
                // What others left that wrote the same file at the same time and were killed.
                for left in (slot + 1..=slot + LOOKED_BEYOND).map(of_slot).filter(|left| left.is_file()) {
                    if let Ok(Some(_locked)) = claimed(&left) {
                        // Another run may have taken it away; what stays hinders nobody.
                        let _ = std::fs::remove_file(&left);
                    }
                }
                return Ok(Self { path: path.to_owned(), temporary, file, finished: false });
            }
        }
        Err(fail(std::io::Error::other("too many runs write this file at once")))
    }

    /// What was written so far is on the disk from here on.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(crate) fn sync(&self) -> Result<(), WriteError> {
        self.file.sync_all().map_err(|source| WriteError::File { path: self.path.clone(), source })
    }

    /// Readers see the old file until here, and the new one from here on.
    ///
    /// # Errors
    /// A file that cannot be written or renamed.
    pub fn finish(mut self) -> Result<(), WriteError> {
        let done = self
            .file
            .sync_all()
            .and_then(|()| share_with_readers(&self.temporary))
            .and_then(|()| std::fs::rename(&self.temporary, &self.path));
        self.finished = done.is_ok();
        done.map_err(|source| WriteError::File { path: self.path.clone(), source })
    }
}

impl Drop for NewFile {
    fn drop(&mut self) {
        if !self.finished {
            // The lock is still held: nobody else's file goes.
            let _ = std::fs::remove_file(&self.temporary);
        }
    }
}

/// Whether a name is one that a file has while it is written: `.NAME.0.coilwright`.
pub(super) fn is_temporary(name: &str) -> bool {
    name.strip_prefix('.')
        .and_then(|rest| rest.strip_suffix(".coilwright"))
        .and_then(|rest| rest.rsplit_once('.'))
        .is_some_and(|(own, slot)| !own.is_empty() && slot.parse::<usize>().is_ok_and(|slot| slot < MOST_WRITERS))
}

/// An empty file of that name, locked; none where another run has it.
///
/// # Errors
/// A file that can be neither made nor taken over.
pub(super) fn claimed(path: &Path) -> std::io::Result<Option<File>> {
    // Twice: between opening and locking, its owner may have renamed or removed it.
    for _ in 0..8 {
        if std::fs::symlink_metadata(path).is_ok_and(|found| !found.is_file()) {
            return Err(std::io::ErrorKind::AlreadyExists.into());
        }
        let file = File::options().create(true).truncate(false).write(true).read(true).open(path)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(std::fs::TryLockError::WouldBlock) => return Ok(None),
            // A file system without locks: then the name alone has to do.
            Err(std::fs::TryLockError::Error(error)) if error.kind() == std::io::ErrorKind::Unsupported => {}
            Err(std::fs::TryLockError::Error(error)) => return Err(error),
        }
        if is_at(&file, path) {
            file.set_len(0)?;
            return Ok(Some(file));
        }
    }
    Ok(None)
}

/// Whether an open file is still the one of that name.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), std::fs::symlink_metadata(path)) {
        (Ok(a), Ok(b)) => (a.dev(), a.ino()) == (b.dev(), b.ino()),
        _ => false,
    }
}

#[cfg(not(unix))]
fn is_at(_file: &File, path: &Path) -> bool {
    path.exists()
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

/// Temporary files are private to their owner; results are for whoever may read the folder.
#[cfg(unix)]
fn share_with_readers(path: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn share_with_readers(_path: &Path) -> std::io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn what_a_killed_run_left_behind_is_gone_after_the_next_write_of_the_same_file() {
        let folder = tempfile::tempdir().unwrap();
        for slot in 0..3 {
            std::fs::write(folder.path().join(format!(".a.csv.{slot}.coilwright")), "half of a fi").unwrap();
        }
        write_atomically(&folder.path().join("a.csv"), b"whole").unwrap();
        assert_eq!(names(folder.path()), ["a.csv"]);
        assert_eq!(std::fs::read_to_string(folder.path().join("a.csv")).unwrap(), "whole");
    }

    #[test]
    fn two_writers_of_one_file_do_not_meet_and_the_last_one_leaves_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let (mut first, mut second) = (NewFile::create(&path).unwrap(), NewFile::create(&path).unwrap());
        first.write_all(b"first").unwrap();
        second.write_all(b"second").unwrap();
        first.finish().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "first");
        second.finish().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "second");
        drop(NewFile::create(&path).unwrap());
        assert_eq!(names(folder.path()), ["a.csv"]);
    }
}
