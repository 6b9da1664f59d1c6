//! Reading whole text files, and writing them so that nothing is ever half there.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use thiserror::Error;

use super::fault::Faults;

/// Model and pattern files are pages long; anything larger is not one of them.
const LARGEST_TEXT_BYTES: u64 = 16 * 1024 * 1024;

#[derive(Debug, Error)]
pub enum WriteError {
    #[error("cannot create the folder {path}: {source}", path = .path.display())]
    Folder { path: PathBuf, source: std::io::Error },
    #[error("cannot write {path}: {source}", path = .path.display())]
    File { path: PathBuf, source: std::io::Error },
}

/// Reads a text file that is to be understood as a whole.
///
/// # Errors
/// A file that is missing, a folder, empty, binary or too large.
pub fn read_text(path: &Path) -> Result<String, Faults> {
    read_text_up_to(path, LARGEST_TEXT_BYTES)
}

/// As [`read_text`], for files of another size.
///
/// # Errors
/// As [`read_text`].
pub fn read_text_up_to(path: &Path, largest_bytes: u64) -> Result<String, Faults> {
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
    std::fs::File::open(path)
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
#[derive(Debug)]
pub struct NewFile {
    path: PathBuf,
    file: tempfile::NamedTempFile,
}

impl NewFile {
    /// # Errors
    /// A folder or file that cannot be written.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let folder = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        std::fs::create_dir_all(folder).map_err(|source| WriteError::Folder { path: folder.to_owned(), source })?;
        let fail = |source| WriteError::File { path: path.to_owned(), source };
        let file = tempfile::Builder::new().prefix(".coilwright-").tempfile_in(folder).map_err(fail)?;
        Ok(Self { path: path.to_owned(), file })
    }

    /// Readers see the old file until here, and the new one from here on.
    ///
    /// # Errors
    /// A file that cannot be written or renamed.
    pub fn finish(self) -> Result<(), WriteError> {
        let Self { path, file } = self;
        let fail = |source| WriteError::File { path: path.clone(), source };
        file.as_file().sync_all().map_err(fail)?;
        share_with_readers(file.path()).map_err(fail)?;
        file.persist(&path).map_err(|e| fail(e.error))?;
        Ok(())
    }
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
