//! The answer of `optimise` as a document.

use serde::{Deserialize, Serialize};

use super::{PatternJson, ProofJson};
use crate::profile::Piece;
use crate::search::answer::{Answer, Cuts, Former, FoundBy};
use crate::search::aside::{GridCheck, GridFigure};
use crate::search::end_turns::BestEndTurns;
use crate::search::evaluator::Judged;
use crate::search::outlook::OtherBoundary;
use crate::search::prospect::{Gain, Outlook, Prospect};
use crate::search::recommendation::Recommendation;
use crate::search::validation::Validation;
use crate::search::{Objective, Request};
use crate::units::{c_per_h_from_k_per_s, deg_per_h_from_rad_per_s, mm_from_m, percent_from_fraction};

impl PatternJson {
    /// Of a pattern that was judged by the reference.
    pub(crate) fn of(judged: &Judged) -> Self {
        let Judged { name, pattern, worst, phase_rad, guaranteed_rad_per_s, .. } = judged;
        let body = Self {
            p95_rate_deg_per_h: judged.p95_rad_per_s.map(deg_per_h_from_rad_per_s),
            ..Self::new(name, pattern, worst, *phase_rad, *guaranteed_rad_per_s)
        };
        let body = match &judged.pointing {
            Some(pointing) => body.with_pointing(pointing),
            None => body,
        };
        match judged.grid_margin_rad_per_s {
            Some(margin) => body.with_margin(margin),
            None => body,
        }
    }
}

/// The answer of `optimise`.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct OptimiseJson {
    pub(crate) model: String,
    pub(crate) objective: String,
    pub(crate) windability: String,
    pub(crate) seed: u64,
    pub(crate) best: PatternJson,
    pub(crate) baselines: Vec<PatternJson>,
    /// QUA's objective over the best pattern's; null where QUA does not fit the layer count.
    pub(crate) improvement_over_qua: Option<f64>,
    pub(crate) statement: String,
    /// What to wind; null where the search was interrupted.
    pub(crate) recommendation: Option<RecommendationJson>,
    /// The best pattern and QUA on profiles that were not searched; null where the search was interrupted.
    pub(crate) validation: Option<ValidationJson>,
    /// Null for a half space or an interrupted search.
    pub(crate) other_boundary: Option<OtherBoundaryJson>,
    /// Null where the model is known.
    pub(crate) uncertainty: Option<UncertaintyJson>,
    /// Of the recommended winding over the former one, or over QUA; null where the model is known.
    pub(crate) predicted_gain: Option<GainJson>,
    /// Null where the temperature has no grid or the search was interrupted.
    pub(crate) grid_check: Option<GridCheckJson>,
    /// Absent where the search was for the pointing error or was interrupted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) rate_resolution: Option<RateResolutionJson>,
    /// Absent unless the search was for the pointing error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) pointing_resolution: Option<PointingResolutionJson>,
    /// Null where no former pattern was stated.
    pub(crate) compared_with: Option<FormerJson>,
    pub(crate) proof: ProofJson,
    /// Null unless worst admissible profiles were to join the searched ones.
    pub(crate) cutting_planes: Option<CutsJson>,
    /// Absent unless turns at the ends were to be chosen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) ends: Option<EndTurnsJson>,
    pub(crate) evaluations: u64,
    /// On the screen only: files don't depend on the clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) evaluations_per_s: Option<f64>,
    /// On the screen only: the whole search, without reading the model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) seconds: Option<f64>,
    pub(crate) best_found: BestFoundJson,
    pub(crate) rounds: u64,
    /// "proved", "no improvement", "rounds", "moves", "target", "clock" or "interrupted".
    pub(crate) stopped_by: String,
    /// False where the clock or a signal ended the search: the same request may then end elsewhere.
    pub(crate) reproducible: bool,
}

/// The best with turns of its own at the ends of the fibre.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct EndTurnsJson {
    /// What might be chosen.
    pub(crate) most_left_off_turns: u32,
    pub(crate) shares_outermost_layer: bool,
    /// Without `end_a_turns` and `end_b_turns` where none make it better.
    pub(crate) best: PatternJson,
    pub(crate) best_objective_deg_per_h: f64,
    /// The same order of whole layers.
    pub(crate) whole_layers: String,
    pub(crate) whole_layers_objective_deg_per_h: f64,
    pub(crate) statement: String,
}

impl EndTurnsJson {
    pub(crate) fn of(ends: &BestEndTurns) -> Self {
        let BestEndTurns { choice, judged, whole, statement } = ends;
        Self {
            most_left_off_turns: choice.most_left_off,
            shares_outermost_layer: choice.shares_outermost,
            best: PatternJson::of(judged),
            best_objective_deg_per_h: deg_per_h_from_rad_per_s(judged.objective_rad_per_s),
            whole_layers: whole.0.clone(),
            whole_layers_objective_deg_per_h: deg_per_h_from_rad_per_s(whole.1),
            statement: statement.clone(),
        }
    }
}

/// What windings would cost with the boundary that the model has not.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct OtherBoundaryJson {
    pub(crate) boundary: String,
    /// The winding that would be best there.
    pub(crate) best: Option<String>,
    pub(crate) patterns: Vec<BoundaryCostJson>,
}

#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct BoundaryCostJson {
    pub(crate) name: String,
    /// Guaranteed where the model has that, else over the profiles.
    pub(crate) worst_rate_deg_per_h: f64,
}

impl OtherBoundaryJson {
    pub(crate) fn of(other: &OtherBoundary) -> Self {
        let cost = |(name, rate): &(String, f64)| BoundaryCostJson {
            name: name.clone(),
            worst_rate_deg_per_h: deg_per_h_from_rad_per_s(*rate),
        };
        Self {
            boundary: other.words.clone(),
            best: other.best().map(|(name, _)| name.clone()),
            patterns: other.worst_rad_per_s.iter().map(cost).collect(),
        }
    }
}

/// What windings promise over the models that the records allow.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct UncertaintyJson {
    pub(crate) models: usize,
    /// The best first.
    pub(crate) patterns: Vec<ProspectJson>,
}

#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ProspectJson {
    pub(crate) name: String,
    pub(crate) expected_worst_rate_deg_per_h: f64,
    pub(crate) p95_worst_rate_deg_per_h: f64,
}

impl UncertaintyJson {
    fn of(outlook: &Outlook) -> Self {
        let prospect = |(name, prospect): &(String, Prospect)| ProspectJson {
            name: name.clone(),
            expected_worst_rate_deg_per_h: deg_per_h_from_rad_per_s(prospect.expected_rad_per_s),
            p95_worst_rate_deg_per_h: deg_per_h_from_rad_per_s(prospect.p95_rad_per_s),
        };
        Self { models: outlook.models, patterns: outlook.prospects.iter().map(prospect).collect() }
    }
}

/// How many times smaller the recommended winding's error is than that of the winding that it replaces.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct GainJson {
    pub(crate) value: f64,
    /// 5 and 95 % of the models that the records allow lie below.
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl GainJson {
    pub(crate) fn of(gain: &Gain) -> Self {
        let Gain { value, low, high } = *gain;
        Self { value, low, high }
    }

    /// In one sentence.
    pub(crate) fn words(&self) -> String {
        format!(
            "predicted gain over the winding so far: {:.2} times less error (5 to 95 % of what the records allow: {:.2} to {:.2})",
            self.value, self.low, self.high
        )
    }
}

/// Worst admissible profiles that joined the searched ones.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct CutsJson {
    /// The best pattern's worst rate over all searched profiles, and over all admissible ones.
    pub(crate) sampled_worst_rate_deg_per_h: f64,
    pub(crate) admissible_worst_rate_deg_per_h: f64,
    /// False where many drawn profiles stand for all admissible ones.
    pub(crate) guaranteed: bool,
    pub(crate) agree: bool,
    pub(crate) joined: Vec<JoinedProfileJson>,
}

#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct JoinedProfileJson {
    pub(crate) name: String,
    pub(crate) pieces: Vec<JoinedPieceJson>,
}

#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct JoinedPieceJson {
    pub(crate) rate_c_per_h: f64,
    pub(crate) duration_s: f64,
}

impl CutsJson {
    fn of(cuts: &Cuts) -> Self {
        let piece = |piece: &Piece| JoinedPieceJson {
            rate_c_per_h: c_per_h_from_k_per_s(piece.rate_k_per_s),
            duration_s: piece.duration_s,
        };
        let joined = cuts.joined.iter().map(|profile| JoinedProfileJson {
            name: profile.name().to_owned(),
            pieces: profile.pieces().iter().map(piece).collect(),
        });
        Self {
            sampled_worst_rate_deg_per_h: deg_per_h_from_rad_per_s(cuts.sampled_rad_per_s),
            admissible_worst_rate_deg_per_h: deg_per_h_from_rad_per_s(cuts.worst_rad_per_s),
            guaranteed: cuts.is_guaranteed,
            agree: cuts.agree(),
            joined: joined.collect(),
        }
    }
}

/// Rates on a grid twice as fine: the guaranteed ones or the pointing errors where the search was for them, the worst ones
/// otherwise.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct GridCheckJson {
    pub(crate) cells_per_layer: usize,
    pub(crate) finer_cells_per_layer: usize,
    /// The best pattern, then QUA.
    pub(crate) patterns: Vec<GridCheckedJson>,
    /// Null where the grid changes little.
    pub(crate) caution: Option<String>,
}

#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct GridCheckedJson {
    pub(crate) name: String,
    #[serde(flatten)]
    pub(crate) rates: GridRatesJson,
    pub(crate) change_percent: f64,
}

#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub(crate) enum GridRatesJson {
    Worst { worst_rate_deg_per_h: f64, finer_worst_rate_deg_per_h: f64 },
    Guaranteed { guaranteed_worst_rate_deg_per_h: f64, finer_guaranteed_worst_rate_deg_per_h: f64 },
    Pointing { worst_pointing_error_deg: f64, finer_worst_pointing_error_deg: f64 },
}

impl GridCheckJson {
    pub(crate) fn of(check: &GridCheck) -> Self {
        let patterns = check.patterns.iter().map(|checked| {
            let (rate, finer) =
                (deg_per_h_from_rad_per_s(checked.rate_rad_per_s), deg_per_h_from_rad_per_s(checked.finer_rad_per_s));
            let rates = match check.of {
                GridFigure::GuaranteedRate => GridRatesJson::Guaranteed {
                    guaranteed_worst_rate_deg_per_h: rate,
                    finer_guaranteed_worst_rate_deg_per_h: finer,
                },
                GridFigure::WorstRate => {
                    GridRatesJson::Worst { worst_rate_deg_per_h: rate, finer_worst_rate_deg_per_h: finer }
                }
                // A degree an hour for one hour is a degree.
                GridFigure::Pointing => {
                    GridRatesJson::Pointing { worst_pointing_error_deg: rate, finer_worst_pointing_error_deg: finer }
                }
            };
            let change_percent = percent_from_fraction(checked.change());
            GridCheckedJson { name: checked.name.clone(), rates, change_percent }
        });
        Self {
            cells_per_layer: check.cells_per_layer,
            finer_cells_per_layer: check.finer_cells_per_layer,
            patterns: patterns.collect(),
            caution: check.caution(),
        }
    }
}

/// Rate errors that are closer together than this are the same in a coil that is wound.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct RateResolutionJson {
    /// Between the middle of the fibre and that of the coil: the fibre's diameter.
    pub(crate) midpoint_offset_mm: f64,
    /// What that changes the best pattern's rate error at most; its rms where that is what was made small.
    pub(crate) rate_error_deg_per_h: f64,
}

/// Pointing errors that are closer together than this are the same in a coil that is wound.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct PointingResolutionJson {
    /// Between the middle of the fibre and that of the coil: the fibre's diameter.
    pub(crate) midpoint_offset_mm: f64,
    /// What that adds to the best pattern's pointing error at most.
    pub(crate) pointing_error_deg: f64,
}

/// When the best pattern was come upon.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct BestFoundJson {
    /// "classic", "annealing", "shared" where a search for another objective found it, or "bounds" where the search by
    /// bounds at the end found better.
    pub(crate) by: &'static str,
    /// Moves judged by then.
    pub(crate) evaluations: u64,
    /// On the screen only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) seconds: Option<f64>,
}

/// A former pattern under the model of this search.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct FormerJson {
    #[serde(flatten)]
    pub(crate) pattern: PatternJson,
    /// Whether the best pattern of this search is better by more than rounding.
    pub(crate) best_changed: bool,
    /// The former pattern's objective, and as a multiple of the best one's.
    pub(crate) cost_deg_per_h: f64,
    pub(crate) cost_factor: Option<f64>,
    pub(crate) statement: String,
}

/// What to wind, in one sentence with its reasons.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct RecommendationJson {
    /// Its name.
    pub(crate) pattern: String,
    pub(crate) segments: Vec<usize>,
    pub(crate) sentence: String,
    /// The figure that decided, in words.
    pub(crate) weighed_by: String,
    pub(crate) reasons: Vec<String>,
}

impl RecommendationJson {
    pub(crate) fn of(recommendation: &Recommendation) -> Self {
        Self {
            pattern: recommendation.name.clone(),
            segments: recommendation.pattern.segments().to_vec(),
            sentence: recommendation.sentence.clone(),
            weighed_by: recommendation.weighed_by.to_owned(),
            reasons: recommendation.reasons.clone(),
        }
    }
}

/// Worst rates on profiles that were not searched.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ValidationJson {
    pub(crate) profiles: usize,
    pub(crate) seed: u64,
    pub(crate) best_worst_rate_deg_per_h: f64,
    /// Null where QUA does not fit the layer count.
    pub(crate) qua_worst_rate_deg_per_h: Option<f64>,
    /// Null unless the search was for the pointing error, which is held as the rate that makes it in one hour.
    pub(crate) best_pointing_error_deg: Option<f64>,
    pub(crate) qua_pointing_error_deg: Option<f64>,
}

impl ValidationJson {
    pub(crate) fn of(validation: &Validation) -> Self {
        Self {
            profiles: validation.profiles,
            seed: validation.seed,
            best_worst_rate_deg_per_h: deg_per_h_from_rad_per_s(validation.best_rad_per_s),
            qua_worst_rate_deg_per_h: validation.qua_rad_per_s.map(deg_per_h_from_rad_per_s),
            best_pointing_error_deg: validation.pointing.map(|p| deg_per_h_from_rad_per_s(p.best_rad_per_s)),
            qua_pointing_error_deg: validation.pointing.and_then(|p| p.qua_rad_per_s).map(deg_per_h_from_rad_per_s),
        }
    }
}

impl OptimiseJson {
    /// Of a search of a model by its name; `seconds`: of the whole search, and until the best was found.
    pub fn of(model: &str, request: &Request, answer: &Answer, seconds: f64, found_s: f64) -> Self {
        let found_s = match answer.found_by {
            FoundBy::Classic => 0.0,
            FoundBy::Annealing => found_s,
            FoundBy::Shared | FoundBy::Bounds => seconds,
        };
        let is_of_pointing = request.objective == Objective::Pointing;
        let (of_pointing, of_rate) = if is_of_pointing { (answer.resolution, None) } else { (None, answer.resolution) };
        Self {
            model: model.to_owned(),
            objective: request.objective.key().to_owned(),
            windability: request.class.to_string(),
            seed: request.plan.seed,
            best: PatternJson::of(&answer.best),
            baselines: answer.baselines.iter().map(PatternJson::of).collect(),
            improvement_over_qua: answer.improvement_over_qua,
            statement: answer.statement.clone(),
            recommendation: answer.recommendation.as_ref().map(RecommendationJson::of),
            validation: answer.validation.as_ref().map(ValidationJson::of),
            other_boundary: answer.boundary.as_ref().map(OtherBoundaryJson::of),
            uncertainty: answer.outlook.as_ref().map(UncertaintyJson::of),
            predicted_gain: answer.outlook.as_ref().and_then(|o| o.gain.as_ref()).map(GainJson::of),
            grid_check: answer.grid_check.as_ref().map(GridCheckJson::of),
            rate_resolution: of_rate.map(|resolution| RateResolutionJson {
                midpoint_offset_mm: mm_from_m(resolution.offset_m),
                rate_error_deg_per_h: deg_per_h_from_rad_per_s(resolution.change_rad_per_s),
            }),
            pointing_resolution: of_pointing.map(|resolution| PointingResolutionJson {
                midpoint_offset_mm: mm_from_m(resolution.offset_m),
                pointing_error_deg: deg_per_h_from_rad_per_s(resolution.change_rad_per_s),
            }),
            compared_with: answer.compared_with.as_ref().map(|former| FormerJson::of(former, &answer.best)),
            proof: ProofJson::of(&answer.proof),
            cutting_planes: answer.cuts.as_ref().map(CutsJson::of),
            ends: answer.ends.as_ref().map(EndTurnsJson::of),
            evaluations: answer.evaluations,
            evaluations_per_s: Some(answer.evaluations_now as f64 / seconds),
            seconds: Some(seconds),
            best_found: BestFoundJson {
                by: answer.found_by.key(),
                evaluations: answer.evaluations_when_found,
                seconds: Some(found_s),
            },
            rounds: answer.state.round,
            stopped_by: answer.ended.key().to_owned(),
            reproducible: answer.is_reproducible(),
        }
    }
}

impl FormerJson {
    fn of(former: &Former, best: &Judged) -> Self {
        let (new_cost, old_cost) = (best.objective_rad_per_s, former.judged.objective_rad_per_s);
        Self {
            best_changed: former.best_changed,
            cost_deg_per_h: deg_per_h_from_rad_per_s(old_cost),
            // A pattern without any error has no multiple.
            cost_factor: (new_cost > 0.0).then(|| old_cost / new_cost),
            pattern: PatternJson::of(&former.judged),
            statement: former.statement.clone(),
        }
    }
}
