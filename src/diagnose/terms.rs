//! Whether formulas are sought, and among which.

/// Whether and among which terms an unlisted effect is sought.
#[derive(Debug, Clone, Copy, Default)]
pub enum Terms<'a> {
    /// Of every form and variable that there is.
    #[default]
    All,
    /// Of these forms and variables only.
    Among(&'a [String]),
    /// Nothing but the listed effects.
    None,
}

impl<'a> Terms<'a> {
    /// As a user says it: nothing said or the word `all`, no words, or some.
    pub fn asked(words: Option<&'a [String]>) -> Self {
        match words {
            None => Self::All,
            Some([]) => Self::None,
            Some([all]) if all == "all" => Self::All,
            Some(words) => Self::Among(words),
        }
    }
}
