//! A tolerance study as a JSON document.

use serde::Serialize;

use crate::search::cost::tolerance::{Distribution, Measure, ToleranceSpec};
use crate::units::deg_per_h_from_rad_per_s;

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct ToleranceJson {
    pub(crate) model: String,
    pub(crate) samples: usize,
    pub(crate) seed: u64,
    /// "guaranteed": over all profiles within the largest rate; "sampled": over the declared profiles.
    pub(crate) measure: &'static str,
    pub(crate) limit_deg_per_h: Option<f64>,
    pub(crate) patterns: Vec<DistributionJson>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct DistributionJson {
    pub(crate) name: String,
    pub(crate) nominal_deg_per_h: f64,
    pub(crate) median_deg_per_h: f64,
    pub(crate) p95_deg_per_h: f64,
    pub(crate) p99_deg_per_h: f64,
    /// The share of coils within the limit; null without a limit.
    #[serde(rename = "yield")]
    pub(crate) yield_share: Option<f64>,
    /// Largest first.
    pub(crate) variance_shares: Vec<VarianceShareJson>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct VarianceShareJson {
    pub(crate) spread: &'static str,
    pub(crate) share: f64,
}

impl ToleranceJson {
    pub(crate) fn new(model: &str, spec: &ToleranceSpec, measure: Measure, patterns: Vec<DistributionJson>) -> Self {
        Self {
            model: model.to_owned(),
            samples: spec.samples,
            seed: spec.seed,
            measure: match measure {
                Measure::Guaranteed => "guaranteed",
                Measure::Sampled => "sampled",
            },
            limit_deg_per_h: spec.limit_rad_per_s.map(deg_per_h_from_rad_per_s),
            patterns,
        }
    }
}

impl DistributionJson {
    pub(crate) fn new(name: &str, found: &Distribution) -> Self {
        let shares = found.variance_shares.iter();
        Self {
            name: name.to_owned(),
            nominal_deg_per_h: deg_per_h_from_rad_per_s(found.nominal_rad_per_s),
            median_deg_per_h: deg_per_h_from_rad_per_s(found.median_rad_per_s()),
            p95_deg_per_h: deg_per_h_from_rad_per_s(found.p95_rad_per_s()),
            p99_deg_per_h: deg_per_h_from_rad_per_s(found.p99_rad_per_s()),
            yield_share: found.yield_share,
            variance_shares: shares.map(|&(spread, share)| VarianceShareJson { spread: spread.key(), share }).collect(),
        }
    }
}
