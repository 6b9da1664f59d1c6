//! What a reader of a diagnosis should know beside its answer.

use thiserror::Error;

use crate::chamber::FilmSwitches;

/// Something that a reader of the answer should know.
#[derive(Debug, Clone, PartialEq, Error)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum Caution {
    #[error("{record}: {rows} rows were left out because of gross errors")]
    Outliers { record: String, rows: usize },
    #[error("{record}: column {channel} lacks values and was not considered")]
    ChannelIncomplete { record: String, channel: String },
    #[error(
        "{record}: the declared coil predicts its rate no better than a constant does: does the model file belong to this coil?"
    )]
    WrongCoil { record: String },
    #[error("the winding {winding} explains the records without any effect: is the declared pattern the coil's?")]
    OtherWinding { winding: &'static str },
    #[error("{}: {}: was a fan switched? What is said of the coil takes this into account", .0.record, .0)]
    FilmSwitched(FilmSwitches),
    #[error("no hold-out record: effects were confirmed on blocks in time that they were not fitted to")]
    NoHoldout,
    #[error(
        "the records to fit show nothing that the model lacks, the hold-out does: what is said was fitted to the hold-out and confirmed on the records to fit"
    )]
    FittedToHoldout,
    #[error("{kind} was not accepted: {reason}")]
    Refused { kind: String, reason: Refusal },
}

/// Why an effect that fits was refused.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum Refusal {
    #[error("it does not explain data that it was not fitted to")]
    Unconfirmed,
    #[error("it is too small to matter beside the model's own accuracy")]
    Small,
    #[error("the factor is within 2 % of one")]
    FactorNearOne,
    #[error("what is left over, or a plain function of time, is larger than what it explains")]
    Outdone,
}
