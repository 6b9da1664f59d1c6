//! Built coils over all blocks of a campaign: the distribution of each pattern's worst case.

use serde::Serialize;

use super::campaign::{BlockJson, BlockPatternJson};
use crate::numeric::quantiles::{EXACT_SHARE, QuantileSketch};
use crate::units::deg_per_h_from_rad_per_s;

/// Of one model.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct BuiltCoilsJson {
    pub(crate) model: String,
    pub(crate) layers: usize,
    pub(crate) samples: u64,
    pub(crate) seed: u64,
    /// "guaranteed": over all profiles within the largest rate; "sampled": over the declared profiles.
    pub(crate) measure: String,
    pub(crate) limit_deg_per_h: Option<f64>,
    pub(crate) patterns: Vec<BuiltPatternJson>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct BuiltPatternJson {
    pub(crate) name: String,
    pub(crate) segments: Vec<usize>,
    pub(crate) nominal_deg_per_h: f64,
    pub(crate) quantiles: Vec<QuantileJson>,
    pub(crate) largest_deg_per_h: f64,
    /// The share of coils within the limit; null without a limit.
    #[serde(rename = "yield")]
    pub(crate) yield_share: Option<f64>,
    /// Share of coils, and the worst case that it exceeds.
    pub(crate) exceeded: Vec<(f64, f64)>,
}

/// A quantile with the interval that holds it with 95 %, whatever the distribution.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct QuantileJson {
    pub(crate) share: f64,
    pub(crate) value_deg_per_h: f64,
    /// Null where there are too few coils.
    pub(crate) low_deg_per_h: Option<f64>,
    pub(crate) high_deg_per_h: Option<f64>,
    /// Whether these are coils' own numbers; else they are off by at most a thousandth.
    pub(crate) exact: bool,
}

/// Which quantiles are stated.
pub(crate) const SHARES: [f64; 4] = [0.5, 0.95, 0.99, 0.999];
const CONFIDENCE: f64 = 0.95;

/// Points of the curve a decade.
const POINTS_PER_DECADE: i32 = 8;

/// One model's blocks as they come, in constant memory but for the worst cases of the worst three coils in a hundred.
#[derive(Debug, Clone)]
pub(crate) struct Blocks {
    first: BlockJson,
    patterns: Vec<(BlockPatternJson, QuantileSketch)>,
}

impl Blocks {
    pub(crate) fn of(mut first: BlockJson) -> Self {
        let patterns = std::mem::take(&mut first.patterns).into_iter().map(|mut pattern| {
            let sketch = sketch(&mut pattern);
            (pattern, sketch)
        });
        let patterns = patterns.collect();
        Self { first, patterns }
    }

    /// Takes the next block of the same model in.
    pub(crate) fn add(&mut self, block: BlockJson) {
        self.first.coils += block.coils;
        for ((all, sum), mut own) in self.patterns.iter_mut().zip(block.patterns) {
            sum.add(&sketch(&mut own));
            all.within_limit = all.within_limit.zip(own.within_limit).map(|(a, b)| a + b);
        }
    }

    pub(crate) fn finish(self) -> BuiltCoilsJson {
        let BlockJson { model, layers, seed, coils, measure, limit_deg_per_h, .. } = self.first;
        let patterns = self.patterns.into_iter().map(|(pattern, sketch)| built(pattern, &sketch)).collect();
        BuiltCoilsJson { model, layers, samples: coils, seed, measure, limit_deg_per_h, patterns }
    }
}

fn sketch(pattern: &mut BlockPatternJson) -> QuantileSketch {
    QuantileSketch::from_parts(
        std::mem::take(&mut pattern.steps).into_iter(),
        std::mem::take(&mut pattern.largest_rad_per_s),
    )
}

fn built(pattern: BlockPatternJson, all: &QuantileSketch) -> BuiltPatternJson {
    let shown = deg_per_h_from_rad_per_s;
    let quantile = |share: f64| {
        let (low, high) = all.interval(share, CONFIDENCE);
        QuantileJson {
            share,
            value_deg_per_h: shown(all.quantile(share)),
            low_deg_per_h: low.map(shown),
            high_deg_per_h: high.map(shown),
            exact: share >= EXACT_SHARE,
        }
    };
    let decades = (all.count() as f64).log10().floor() as i32;
    let above = |k: i32| 10f64.powf(-f64::from(k) / f64::from(POINTS_PER_DECADE));
    let exceeded = (1..=decades * POINTS_PER_DECADE).map(|k| (above(k), shown(all.quantile(1.0 - above(k)))));
    BuiltPatternJson {
        quantiles: SHARES.into_iter().map(quantile).collect(),
        largest_deg_per_h: shown(all.quantile(1.0)),
        yield_share: pattern.within_limit.map(|within| within as f64 / all.count() as f64),
        exceeded: exceeded.collect(),
        nominal_deg_per_h: shown(pattern.nominal_rad_per_s),
        name: pattern.name,
        segments: pattern.segments,
    }
}
