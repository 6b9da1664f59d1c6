//! What a formula may be made of, as it is asked for on the command line.

use crate::diagnose::Terms;

#[derive(Debug, clap::Args)]
pub(crate) struct TermArguments {
    /// Seeks no formula for what the listed effects leave
    #[arg(long, conflicts_with = "terms")]
    no_discovery: bool,
    /// Forms and variables that a formula for what the listed effects leave may be made of, such as relaxation, hysteresis,
    /// T_mean or a column's name; all without it
    #[arg(long, value_name = "all|WORD,…", value_delimiter = ',')]
    terms: Vec<String>,
}

impl TermArguments {
    pub(crate) fn asked(&self) -> Terms<'_> {
        let is_unsaid = self.terms.is_empty() && !self.no_discovery;
        Terms::asked((!is_unsaid).then_some(self.terms.as_slice()))
    }
}
