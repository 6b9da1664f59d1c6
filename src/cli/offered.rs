//! Values that a shell's completion offers for an argument, whatever else the argument may be.

use std::ffi::OsStr;

use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};
use clap::{Arg, Command, Error};

use crate::effect::{CATALOGUE, CHANNEL, CUSTOM, THERMAL_STRESS};
use crate::pattern::classic::Classic;
use crate::search::cost::objective::Objective;

use super::optimise::{parse_class, parse_objective};

/// Reads as `read` does and offers some values. Such an argument hides them in its help, whose words say what it may be.
#[derive(Clone)]
pub(super) struct Offered<P> {
    read: P,
    values: Vec<&'static str>,
}

impl<P: TypedValueParser> TypedValueParser for Offered<P> {
    type Value = P::Value;

    fn parse_ref(&self, command: &Command, argument: Option<&Arg>, value: &OsStr) -> Result<P::Value, Error> {
        self.read.parse_ref(command, argument, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(self.values.iter().map(PossibleValue::new)))
    }
}

/// A winding's name, or a pattern file.
pub(super) fn patterns() -> Offered<StringValueParser> {
    let values = Classic::ALL.into_iter().map(Classic::key).collect();
    Offered { read: StringValueParser::new(), values }
}

pub(super) fn effects() -> Offered<StringValueParser> {
    let values = CATALOGUE.iter().copied().chain([CHANNEL, CUSTOM, THERMAL_STRESS]).map(|spec| spec.kind).collect();
    Offered { read: StringValueParser::new(), values }
}

pub(super) fn objectives() -> impl TypedValueParser<Value = Objective> {
    Offered { read: parse_objective, values: Objective::ALL.into_iter().map(Objective::key).collect() }
}

pub(super) fn classes() -> impl TypedValueParser<Value = crate::pattern::windability::WindabilityClass> {
    Offered { read: parse_class, values: vec!["standard", "captive:1", "captive:2", "any"] }
}
