//! One run a folder: whoever writes results into a folder holds it, and says who it is.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::files::{WriteError, claimed};

/// The file that is locked while a run writes into a folder; it goes with the run.
pub const LOCK_FILE: &str = ".coilwright.lock";

/// A folder that no other run writes into as long as this lives.
///
/// The lock is the kernel's: it ends with its process, however that ends. A file that a killed run left behind stops
/// nobody.
#[derive(Debug)]
pub struct HeldFolder {
    path: PathBuf,
    _file: File,
}

impl HeldFolder {
    /// Makes the folder if need be; `who` is what another run is told, such as `optimise (process 4711)`.
    ///
    /// # Errors
    /// A folder that cannot be written, or that another run holds.
    pub fn take(folder: &Path, who: &str) -> Result<Self, WriteError> {
        let fail = |source| WriteError::Folder { path: folder.to_owned(), source };
        std::fs::create_dir_all(folder).map_err(fail)?;
        let path = folder.join(LOCK_FILE);
        let Some(mut file) = claimed(&path).map_err(fail)? else {
            return Err(WriteError::Held { path: folder.to_owned(), holder: holder(&path) });
        };
        writeln!(file, "{who}").and_then(|()| file.flush()).map_err(fail)?;
        Ok(Self { path, _file: file })
    }
}

impl Drop for HeldFolder {
    fn drop(&mut self) {
        // While the lock is held nobody else's file can be there.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// What the holder wrote; it may be about to write it.
fn holder(path: &Path) -> String {
    let mut text = String::new();
    let read = File::open(path).and_then(|mut file| {
        file.seek(SeekFrom::Start(0))?;
        file.take(200).read_to_string(&mut text)
    });
    match (read, text.lines().next()) {
        (Ok(_), Some(line)) if !line.is_empty() => line.to_owned(),
        _ => "another run".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_folder_names_its_holder_and_is_free_again_afterwards() {
        let folder = tempfile::tempdir().unwrap();
        let held = HeldFolder::take(folder.path(), "optimise (process 1)").unwrap();
        let refused = HeldFolder::take(folder.path(), "pareto (process 2)").unwrap_err();
        assert!(refused.to_string().contains("optimise (process 1)"), "{refused}");
        drop(held);
        assert!(!folder.path().join(LOCK_FILE).exists());
        std::fs::write(folder.path().join(LOCK_FILE), "optimise (process 3)").unwrap();
        HeldFolder::take(folder.path(), "pareto (process 4)").unwrap();
    }
}
