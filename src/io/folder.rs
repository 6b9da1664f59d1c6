//! One run a folder: whoever writes results into a folder holds it and says who it is, and its files are replaced as a whole.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::files::{NewFile, WriteError, claimed, folder_of, is_temporary};

/// The file that is locked while a run writes into a folder; it goes with the run.
pub(crate) const LOCK_FILE: &str = ".coilwright.lock";

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
        let held = Self::take_lock(folder, folder, LOCK_FILE, who)?;
        clear_left_behind(folder).map_err(|source| WriteError::Folder { path: folder.to_owned(), source })?;
        Ok(held)
    }

    /// The files `PREFIX.json`, `PREFIX.h` and so on alone: runs with other prefixes may write beside them.
    ///
    /// # Errors
    /// As [`HeldFolder::take`].
    pub fn take_prefix(prefix: &Path, who: &str) -> Result<Self, WriteError> {
        let folder = folder_of(prefix);
        let name = prefix.file_stem().unwrap_or_default().display();
        Self::take_lock(&folder, prefix, &format!(".{name}{LOCK_FILE}"), who)
    }

    fn take_lock(folder: &Path, held: &Path, lock: &str, who: &str) -> Result<Self, WriteError> {
        let fail = |source| WriteError::Folder { path: folder.to_owned(), source };
        std::fs::create_dir_all(folder).map_err(fail)?;
        let path = folder.join(lock);
        let Some(mut file) = claimed(&path).map_err(fail)? else {
            return Err(WriteError::Held { path: held.to_owned(), holder: holder(&path) });
        };
        writeln!(file, "{who}").and_then(|()| file.flush()).map_err(fail)?;
        Ok(Self { path, _file: file })
    }
}

/// Refuses to write over what a command reads: a file that lies in the folder under one of the names that the command writes
/// or takes away there.
///
/// # Errors
/// As said.
pub fn check_read<'a>(
    folder: &Path,
    kinds: &[&str],
    read: impl IntoIterator<Item = &'a Path>,
) -> Result<(), WriteError> {
    let Ok(place) = folder.canonicalize() else { return Ok(()) };
    let is_replaced = |path: &Path| {
        let name = path.file_name().and_then(|name| name.to_str());
        name.is_some_and(|name| kinds.iter().any(|kind| is_of(name, kind)))
            && folder_of(path).canonicalize().is_ok_and(|parent| parent == place)
    };
    match read.into_iter().find(|path| path.is_file() && is_replaced(path)) {
        Some(path) => Err(WriteError::WouldReplace { path: path.to_owned() }),
        None => Ok(()),
    }
}

/// As [`check_read`], of one file that is written.
///
/// # Errors
/// A file that the command reads.
pub fn check_file<'a>(written: &Path, read: impl IntoIterator<Item = &'a Path>) -> Result<(), WriteError> {
    let Ok(place) = written.canonicalize() else { return Ok(()) };
    let is_written = |path: &Path| path.is_file() && path.canonicalize().is_ok_and(|found| found == place);
    match read.into_iter().find(|path| is_written(path)) {
        Some(path) => Err(WriteError::WouldReplaceItself { path: path.to_owned() }),
        None => Ok(()),
    }
}

/// Refuses to write over a file of that name where none of the `marks` says that a run wrote it; a lock says so, too, which a
/// killed run leaves.
///
/// # Errors
/// As said.
pub(crate) fn check_ours(folder: &Path, name: &str, marks: &[&str]) -> Result<(), WriteError> {
    let path = folder.join(name);
    if path.is_file() && !marks.iter().chain(&[LOCK_FILE]).any(|mark| folder.join(mark).is_file()) {
        return Err(WriteError::NotOurs { path });
    }
    Ok(())
}

/// Takes away the temporary files that killed runs left; one that somebody still writes is locked and stays.
///
/// # Errors
/// A folder that cannot be read, or a file that cannot be removed.
pub(crate) fn clear_left_behind(folder: &Path) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.file_name().and_then(|name| name.to_str()).is_some_and(is_temporary)
            && let Ok(Some(_locked)) = claimed(&path)
        {
            std::fs::remove_file(&path)?;
        }
    }
    Ok(())
}

/// The files of one run on their way into a folder: all of them are whole before the first one takes its name, and what an
/// earlier run left under the names of the same kind goes before.
///
/// A run that is killed on the way leaves files of one run only: the earlier one's, or its own.
#[derive(Debug)]
pub struct Replacement<'a> {
    folder: &'a Path,
    staged: Vec<NewFile>,
}

impl<'a> Replacement<'a> {
    pub(crate) fn of(folder: &'a Path) -> Self {
        Self { folder, staged: Vec::new() }
    }

    /// Files that always come together, by their names.
    ///
    /// # Errors
    /// A file that cannot be written, removed or renamed.
    pub fn all(folder: &'a Path, files: &[(&str, String)]) -> Result<(), WriteError> {
        let mut replacement = Self::of(folder);
        files.iter().try_for_each(|(name, text)| replacement.add(name, text.as_bytes()))?;
        replacement.commit(&files.iter().map(|(name, _)| *name).collect::<Vec<_>>())
    }

    /// # Errors
    /// A file that cannot be written.
    pub(crate) fn add(&mut self, name: impl AsRef<Path>, contents: &[u8]) -> Result<(), WriteError> {
        let path = self.folder.join(name);
        let mut file = NewFile::create(&path)?;
        file.write_all(contents).map_err(|source| WriteError::File { path, source })?;
        self.staged.push(file);
        Ok(())
    }

    /// As [`Replacement::add`], of a file that lists the others and takes its name before them: what a killed run leaves is
    /// then known to the next one.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(crate) fn add_list(&mut self, name: &str, contents: &[u8]) -> Result<(), WriteError> {
        self.add(name, contents)?;
        self.staged.rotate_right(1);
        Ok(())
    }

    /// `kinds` are the names of the files that such a run may leave; `#` stands for a number.
    ///
    /// # Errors
    /// A file that cannot be written, removed or renamed.
    pub(crate) fn commit(self, kinds: &[&str]) -> Result<(), WriteError> {
        for file in &self.staged {
            file.sync()?;
        }
        remove_kinds(self.folder, kinds)?;
        self.staged.into_iter().try_for_each(NewFile::finish)
    }
}

/// Takes away the files `00001.json` and so on, whatever their digits, whose number is above a count.
///
/// # Errors
/// A file that cannot be removed.
pub(crate) fn remove_numbered(folder: &Path, above: usize) -> Result<(), WriteError> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(()) };
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let number = |name: &str| name.strip_suffix(".json").and_then(|digits| digits.parse::<usize>().ok());
    let further: Vec<String> = names.filter(|name| number(name).is_some_and(|n| n > above)).collect();
    remove_kinds(folder, &further.iter().map(String::as_str).collect::<Vec<_>>())
}

/// Takes away the files of such names.
///
/// # Errors
/// A file that cannot be removed.
pub(crate) fn remove_kinds(folder: &Path, kinds: &[&str]) -> Result<(), WriteError> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(()) };
    let names: Vec<String> = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect();
    // In the order of the kinds: what stands for the whole is named first.
    for kind in kinds {
        for path in names.iter().filter(|name| is_of(name, kind)).map(|name| folder.join(name)) {
            if !path.is_file() {
                continue;
            }
            match std::fs::remove_file(&path) {
                Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                    return Err(WriteError::File { path, source });
                }
                _ => {}
            }
        }
    }
    Ok(())
}

fn is_of(name: &str, kind: &str) -> bool {
    match kind.split_once('#') {
        None => name == kind,
        Some((before, after)) => name
            .strip_prefix(before)
            .and_then(|rest| rest.strip_suffix(after))
            .is_some_and(|number| !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit())),
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

    #[test]
    fn a_held_prefix_leaves_other_prefixes_free() {
        let folder = tempfile::tempdir().unwrap();
        let held = HeldFolder::take_prefix(&folder.path().join("a"), "compensate (process 1)").unwrap();
        let refused = HeldFolder::take_prefix(&folder.path().join("a"), "compensate (process 2)").unwrap_err();
        assert!(refused.to_string().contains("compensate (process 1)"), "{refused}");
        let beside = HeldFolder::take_prefix(&folder.path().join("b"), "compensate (process 3)").unwrap();
        drop((held, beside));
        assert!(names(folder.path()).is_empty());
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn what_a_killed_run_left_goes_with_the_next_one_and_what_is_being_written_stays() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(".record-3.csv.0.coilwright"), "half").unwrap();
        std::fs::write(folder.path().join(".own.coilwright"), "of somebody else").unwrap();
        let written = NewFile::create(&folder.path().join("b.csv")).unwrap();
        let held = HeldFolder::take(folder.path(), "compare (process 1)").unwrap();
        assert_eq!(names(folder.path()), [".b.csv.0.coilwright", LOCK_FILE, ".own.coilwright"]);
        written.finish().unwrap();
        drop(held);
        assert_eq!(names(folder.path()), [".own.coilwright", "b.csv"]);
    }

    #[test]
    fn a_run_with_fewer_files_leaves_none_of_the_former_one() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["record-1.csv", "record-22.csv", "record-x.csv", "comparison.json", "notes.txt"] {
            std::fs::write(folder.path().join(name), "old").unwrap();
        }
        let mut files = Replacement::of(folder.path());
        files.add("record-1.csv", b"new").unwrap();
        assert_eq!(std::fs::read_to_string(folder.path().join("record-1.csv")).unwrap(), "old");
        files.commit(&["record-#.csv", "comparison.json"]).unwrap();
        assert_eq!(names(folder.path()), ["notes.txt", "record-1.csv", "record-x.csv"]);
        assert_eq!(std::fs::read_to_string(folder.path().join("record-1.csv")).unwrap(), "new");
    }
}
