//! Which of the program's own files a text is, so that one in the place of another is told apart from a faulty one.

use crate::io::fault::Faults;

/// Whether a line of a text begins with one of such keys, be it a table's or a value's, and whatever else is wrong with it.
pub(super) fn states_any(source: &str, keys: &[&str]) -> bool {
    let states = |line: &str, key: &str| {
        let rest = line.trim_start().trim_start_matches('[').trim_start().strip_prefix(key);
        rest.is_some_and(|rest| rest.trim_start().starts_with(['=', ']', '.']))
    };
    source.lines().any(|line| keys.iter().any(|key| states(line, key)))
}

/// A file that people write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FileKind {
    Model,
    Pattern,
    Campaign,
}

impl FileKind {
    /// By keys that the other kinds lack; none of a text that has too little of either.
    fn of(source: &str) -> Option<Self> {
        if states_any(source, &["fibre", "winding", "thermal"]) {
            Some(FileKind::Model)
        } else if states_any(source, &["models", "gyro"]) {
            Some(FileKind::Campaign)
        } else {
            // Below a table's head the word may be that table's.
            let root: Vec<&str> = source.lines().take_while(|line| !line.trim_start().starts_with('[')).collect();
            states_any(&root.join("\n"), &["segments"]).then_some(FileKind::Pattern)
        }
    }

    fn words(self) -> &'static str {
        match self {
            FileKind::Model => "a model file",
            FileKind::Pattern => "a pattern file",
            FileKind::Campaign => "a campaign file",
        }
    }

    fn remedy(self) -> &'static str {
        match self {
            FileKind::Model => "give it where a model is asked for; a campaign lists it under models",
            FileKind::Pattern => "give it to --pattern, or name it under winding.pattern in the model file",
            FileKind::Campaign => "give it to `coilwright campaign`",
        }
    }

    /// What to say of a text that is a file of another kind; none of one that may be of this kind.
    pub(super) fn instead(self, source: &str) -> Option<String> {
        let found = FileKind::of(source).filter(|kind| *kind != self)?;
        let wanted = self.words().trim_start_matches("a ");
        Some(format!("is {}, no {wanted}: {}", found.words(), found.remedy()))
    }

    /// The same as faults of a file.
    ///
    /// # Errors
    /// A text that is of another kind.
    pub(super) fn check(self, file: &str, source: &str) -> Result<(), Faults> {
        self.instead(source).map_or(Ok(()), |message| Err(Faults::of_file(file, message)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_in_the_place_of_another_is_named_and_a_faulty_one_is_not() {
        let model = "name = \"x\"\n[winding]\nlayers = 4\n[profiles]\nsegments = 4\n";
        let (pattern, campaign) = ("layers = 4\nsegments = [1]\n", "models = [\"a.toml\"]\n");
        let all = [(FileKind::Model, model), (FileKind::Pattern, pattern), (FileKind::Campaign, campaign)];
        for (kind, own) in all {
            assert_eq!(kind.instead("name = \"x\"\n[profiles]\nsegments = 4\n"), None);
            for (_, text) in all {
                assert_eq!(kind.instead(text).is_some(), text != own, "{text}");
            }
        }
        let said = FileKind::Model.instead(pattern).unwrap();
        assert!(said.starts_with("is a pattern file, no model file: ") && said.contains("--pattern"), "{said}");
    }
}
