//! What a reader of a diagnosis should know beside its answer.

use thiserror::Error;

use crate::chamber::FilmSwitches;
use crate::record::{Record, SharedRows};

/// Something that a reader of the answer should know.
#[derive(Debug, Clone, PartialEq, Error)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum Caution {
    #[error("{record}: {rows} rows were left out because of gross errors")]
    Outliers { record: String, rows: usize },
    #[error(
        "{record}: {rows} rows from {from_s} s on are also in {other}: what both say counts twice, and nothing of it is confirmed; leave one of them out, or cut what they share out of one"
    )]
    SharedRows { record: String, other: String, rows: usize, from_s: f64 },
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

/// Records of which one has rows of an earlier one.
pub(super) fn shared_rows(records: &[&Record]) -> Vec<Caution> {
    let of = |place: usize| {
        let record = records[place];
        let caution = move |other: &&Record| {
            let SharedRows { from_s, rows } = record.shared_with(other)?;
            Some(Caution::SharedRows { record: record.name().to_owned(), other: other.name().to_owned(), rows, from_s })
        };
        records[..place].iter().filter_map(caution)
    };
    (0..records.len()).flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::experiment::fixtures::model;
    use crate::diagnose::tests::bare_day;

    #[test]
    fn a_record_that_is_given_twice_is_said_to_be() {
        let days = [1, 2].map(|seed| bare_day(&model(Vec::new()), 10.0, seed));
        let [first, second] = [&days[0], &days[1]];
        assert_eq!(shared_rows(&[first, second]), []);
        let found = shared_rows(&[first, second, first]);
        let expected = Caution::SharedRows { record: "day".into(), other: "day".into(), rows: 600, from_s: 10.0 };
        assert_eq!(found, [expected]);
        assert!(found[0].to_string().contains("600 rows from 10 s on are also in day"), "{}", found[0]);
    }
}
