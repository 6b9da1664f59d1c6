//! What the rate error of given windings is at worst.

use crate::effect::FILM;
use crate::io::json::search::OtherBoundaryJson;
use crate::io::json::{EvaluateJson, GuaranteedBesideJson, PatternJson};
use crate::io::model::{Advice, ModelFile, NamedPattern};
use crate::pattern::Pattern;
use crate::profile::Profile;
use crate::rate::{CoilModel, RateModel};
use crate::search::aside::Aside;
use crate::search::cost::guaranteed::{Guaranteed, GuaranteedError, UnitStep};
use crate::search::cost::worst_case::{SolvedProfiles, WorstCase};
use crate::search::outlook::OtherBoundary;
use crate::units::deg_per_h_from_rad_per_s;

use super::{Observer, TaskError, advise, own_and_classics};

/// What is to be evaluated.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The coil and its profiles.
    pub model: &'a ModelFile,
    /// Empty for the model's own and all classics that fit.
    pub patterns: &'a [NamedPattern],
}

/// The document, and the profiles that attain the guaranteed worst cases.
#[derive(Debug)]
#[non_exhaustive]
pub struct Answer {
    /// As the program prints it.
    pub document: EvaluateJson,
    /// One a pattern, in their order; or why there is none.
    pub extremes: Result<Vec<Profile>, GuaranteedError>,
}

/// What is worked out once a model, for any of its windings.
#[derive(Debug)]
pub(crate) struct Groundwork {
    pub(crate) solved: SolvedProfiles,
    pub(crate) step: Result<UnitStep, GuaranteedError>,
    guaranteed_model: CoilModel,
    guaranteed_beside: Vec<GuaranteedBesideJson>,
    steepest_k_per_s: f64,
    aside: Aside,
}

/// A winding, judged.
#[derive(Debug)]
pub(crate) struct JudgedWinding {
    pub(crate) body: PatternJson,
    pub(crate) worst: WorstCase,
    pub(crate) bound: Option<Guaranteed>,
}

impl Groundwork {
    /// On the solved profiles of the model.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn on(solved: SolvedProfiles, file: &ModelFile) -> Result<Self, TaskError> {
        let (guaranteed_model, left_out) = file.model.without_unguaranteed(file.profiles.max_rate_k_per_s);
        let steepest = solved.profiles().iter().map(|p| p.profile.max_rate_k_per_s());
        Ok(Self {
            step: UnitStep::new(&guaranteed_model, file.profiles.max_rate_k_per_s),
            guaranteed_beside: GuaranteedBesideJson::all(&left_out),
            guaranteed_model,
            steepest_k_per_s: steepest.fold(file.profiles.max_rate_k_per_s, f64::max),
            aside: Aside::new(&file.model, &solved)?,
            solved,
        })
    }

    /// Judges a winding.
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub(crate) fn judge(
        &self,
        file: &ModelFile,
        NamedPattern { name, pattern }: &NamedPattern,
    ) -> Result<JudgedWinding, TaskError> {
        let worst = self.solved.worst_case(&file.model, pattern)?;
        let phase_rad = RateModel::new(&file.model, pattern, &[])?.phase_rad(worst.rate_rad_per_s);
        let bound = match &self.step {
            Ok(step) => Some(step.guaranteed(&self.guaranteed_model, pattern)?),
            Err(_) => None,
        };
        let bound_rad_per_s = bound.as_ref().map(|b| b.rate_rad_per_s);
        let grid_margin_rad_per_s = self.aside.margin.of(&self.solved, pattern, self.steepest_k_per_s)?;
        let pointing = self.aside.pointing(&file.model, &self.solved, pattern, file.profiles.max_rate_k_per_s)?;
        let body = PatternJson::new(name, pattern, &worst, phase_rad, bound_rad_per_s);
        Ok(JudgedWinding { body: body.with_margin(grid_margin_rad_per_s).with_pointing(&pointing), worst, bound })
    }

    /// What a reader of the guaranteed rates should know.
    pub(crate) fn notes(&self) -> Vec<String> {
        let beside = self.guaranteed_beside.iter().map(|formula| format!("note: {}", formula.in_words()));
        let unbounded = self.step.as_ref().err().filter(|e| matches!(e, GuaranteedError::Effect { .. }));
        beside.chain(unbounded.map(|reason| format!("note: {reason}"))).collect()
    }
}

/// Evaluates.
///
/// # Errors
/// A model that cannot be solved, patterns of another layer count.
pub fn run(request: &Request, observer: &dyn Observer) -> Result<Answer, TaskError> {
    let file = &request.model.clone().for_search();
    advise(file, observer);
    let all = if request.patterns.is_empty() { own_and_classics(file) } else { request.patterns.to_vec() };
    let solved = SolvedProfiles::new(&file.model, &file.profiles.profiles())?;
    let groundwork = Groundwork::on(solved, file)?;
    for note in groundwork.notes() {
        observer.note(&note);
    }
    let after = groundwork.solved.after_the_ends(&file.model)?;
    let mut patterns = Vec::with_capacity(all.len());
    let mut extremes = Vec::new();
    for (index, named) in all.iter().enumerate() {
        let name = &named.name;
        observer.at(index as f64 / all.len() as f64, name);
        let JudgedWinding { body, worst, bound } = groundwork.judge(file, named)?;
        if let Some(after) = &after {
            warn_of_growth(name, &worst, &after.worst_case(&file.model, &named.pattern)?, observer);
        }
        patterns.push(body);
        extremes.extend(bound.map(|b| b.profile(&format!("bang-bang-{name}"))));
    }
    if file.model.prescribes_outermost_layer() && holds_a_tie(&patterns) {
        observer.note(&format!("note: {}", Advice::PrescribedBoundary { film: FILM.spec.kind }));
    }
    let named: Vec<(String, Pattern)> = all.iter().map(|p| (p.name.clone(), p.pattern.clone())).collect();
    let other = OtherBoundary::under(&file.model, &file.profiles, &named)?;
    if let Some(sentence) = other.as_ref().and_then(|other| other.sentence(&best_of(&patterns)?.name)) {
        observer.note(&format!("note: {sentence}"));
    }
    let other_boundary = other.as_ref().map(OtherBoundaryJson::of);
    let Groundwork { step, guaranteed_beside, .. } = groundwork;
    let fields = Vec::new();
    let document = EvaluateJson { model: file.model.name.clone(), patterns, other_boundary, guaranteed_beside, fields };
    Ok(Answer { document, extremes: step.map(|_| extremes) })
}

/// What the table of windings says of one, under [`COLUMNS`].
pub(crate) fn cells(p: &PatternJson) -> [String; 11] {
    [
        p.name.clone(),
        format!("{:.4}", p.worst_rate_deg_per_h),
        p.guaranteed_worst_rate_deg_per_h.map_or("-".to_owned(), |g| format!("{g:.4}")),
        // A closed form has no grid.
        p.grid_margin_deg_per_h.filter(|m| *m > 0.0).map_or("-".to_owned(), |m| format!("{m:.1e}")),
        p.worst_pointing_error_deg.map_or("-".to_owned(), |p| format!("{p:.5}")),
        format!("{:.3e}", p.worst_phase_rad),
        p.worst_profile.clone(),
        format!("{:.2}", p.worst_time_s),
        p.windability.class.clone(),
        p.windability.reels.to_string(),
        p.windability.max_climb.to_string(),
    ]
}

/// The heads of the table of windings.
pub(crate) const COLUMNS: [&str; 11] = [
    "pattern",
    "worst °/h",
    "guaranteed °/h",
    "grid ± °/h",
    "pointing °",
    "phase rad",
    "profile",
    "at s",
    "class",
    "reels",
    "climb",
];

/// The winding that one would take: the smallest guaranteed worst rate, or worst rate where nothing is guaranteed.
fn best_of(answers: &[PatternJson]) -> Option<&PatternJson> {
    let figure = |p: &PatternJson| p.guaranteed_worst_rate_deg_per_h.unwrap_or(p.worst_rate_deg_per_h);
    answers.iter().filter(|_| answers.len() > 1).min_by(|a, b| figure(a).total_cmp(&figure(b)))
}

/// Whether two different windings have the same guaranteed worst rate.
fn holds_a_tie(answers: &[PatternJson]) -> bool {
    const SAME: f64 = 1e-6;
    let bound = |p: &PatternJson| p.guaranteed_worst_rate_deg_per_h;
    answers.iter().enumerate().any(|(i, a)| {
        let ties = |b: &PatternJson| bound(a).zip(bound(b)).is_some_and(|(x, y)| (x - y).abs() <= SAME * x.abs());
        answers[..i].iter().any(|b| b.segments != a.segments && ties(b))
    })
}

/// Profiles end with their last piece; the error may still grow while the pack settles.
fn warn_of_growth(name: &str, within: &WorstCase, after: &WorstCase, observer: &dyn Observer) {
    const GROWTH: f64 = 1e-3;
    if after.rate_rad_per_s.abs() > within.rate_rad_per_s.abs() * (1.0 + GROWTH) {
        observer.note(&format!(
            "note: with {name} the error still grows after the end of profile {}, to {:.4} °/h at {:.0} s if the drive stands \
             still: end the profile with a soak to have it counted",
            after.profile,
            deg_per_h_from_rad_per_s(after.rate_rad_per_s.abs()),
            after.time_s
        ));
    }
}
