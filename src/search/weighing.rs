//! What patterns are weighed by, and which of them is to be wound; the table of figures and the rule stand in
//! [`recommendation`](super::recommendation).

use std::cmp::Ordering;

use super::cost::objective::Objective;
use super::evaluator::Judged;
use super::prospect::Prospect;
use super::weighed_pointing::PointingFigures;
use crate::pattern::windability::Windability;

/// Two figures closer than this count as equal: less than what a coil's own material values are known to.
pub(crate) const TIE: f64 = 0.02;

/// A pattern with all that it is weighed by.
#[derive(Debug, Clone)]
pub(super) struct Weighed {
    pub(crate) judged: Judged,
    pub(crate) windability: Windability,
    pub(crate) is_classic: bool,
    pub(crate) unseen_rad_per_s: f64,
    /// On the profiles that provoke patterns most, where nothing is guaranteed.
    pub(crate) provoked_rad_per_s: Option<f64>,
    pub(crate) p95_rad_per_s: Option<f64>,
    pub(crate) yield_share: Option<f64>,
    /// Where the model is not known for certain.
    pub(crate) prospect: Option<Prospect>,
    /// Where the pointing error is what is made small: it is weighed then, and not the rates.
    pub(crate) pointing: Option<PointingFigures>,
    /// Over the best classic of the class, the worst of all figures and sets of unseen profiles; 1: nowhere behind.
    pub(crate) regret: f64,
}

impl Weighed {
    pub(super) fn figure(&self) -> f64 {
        if let Some(pointing) = &self.pointing {
            return pointing.figure();
        }
        let prospect = self.prospect.map(|p| p.p95_rad_per_s);
        prospect.or(self.p95_rad_per_s).or(self.judged.guaranteed_rad_per_s).unwrap_or(self.unseen_rad_per_s)
    }

    /// The figure with its unit.
    pub(super) fn shown(&self) -> String {
        let of = if self.pointing.is_some() { Objective::Pointing } else { Objective::WorstRate };
        of.shown(self.figure())
    }

    /// Figures that differ by no more are the same in a coil that is wound.
    pub(super) fn same_rad_per_s(&self) -> f64 {
        self.pointing.map_or(0.0, |pointing| pointing.resolution_rad_per_s)
    }

    /// Whether the figure is that of another one, but for less than what a coil is known and wound to.
    pub(super) fn ties_with(&self, other: &Self) -> bool {
        (self.figure() - other.figure()).abs() <= TIE * other.figure() + other.same_rad_per_s()
    }

    pub(super) fn figure_words(&self) -> &'static str {
        if let Some(pointing) = &self.pointing {
            return pointing.figure_words();
        }
        match (self.p95_rad_per_s, self.judged.guaranteed_rad_per_s) {
            _ if self.prospect.is_some() => "95 % quantile over the models that the records allow",
            (Some(_), _) => "95 % quantile over built coils",
            (None, Some(_)) => "guaranteed worst rate error",
            (None, None) => "worst rate error on unseen profiles",
        }
    }

    fn easier(&self, other: &Self) -> Ordering {
        let effort =
            |w: &Self| (w.windability.captive, w.windability.max_climb, w.windability.long_crossovers, !w.is_classic);
        effort(self).cmp(&effort(other)).then(self.figure().total_cmp(&other.figure()))
    }
}

/// The one to wind, and the best classic where there is one.
pub(super) fn chosen(weighed: &[Weighed]) -> (usize, Option<usize>) {
    let all = || 0..weighed.len();
    let classics = || all().filter(|&i| weighed[i].is_classic);
    let best_classic = classics().min_by(|&a, &b| {
        (weighed[a].regret.total_cmp(&weighed[b].regret)).then(weighed[a].figure().total_cmp(&weighed[b].figure()))
    });
    let eligible: Vec<usize> = match best_classic.map(|classic| (classic, &weighed[classic])) {
        None => all().collect(),
        Some((classic, its)) => {
            let tolerated = its.regret.clamp(1.0, 1.0 + TIE);
            let is_good = |&i: &usize| !weighed[i].is_classic && weighed[i].regret <= tolerated;
            let found: Vec<usize> = all().filter(is_good).collect();
            // What is ahead by less than a tie is not worth leaving a classic for.
            let ahead: Vec<usize> =
                found.iter().copied().filter(|&i| weighed[i].regret * (1.0 + TIE) <= its.regret).collect();
            if its.regret > 1.0 + TIE && !ahead.is_empty() {
                ahead
            } else {
                let is_level = |&i: &usize| i == classic || weighed[i].regret <= its.regret * (1.0 + TIE);
                let better =
                    found.into_iter().filter(|&i| weighed[i].figure() < its.figure() && !weighed[i].ties_with(its));
                classics().filter(is_level).chain(better).collect()
            }
        }
    };
    let least = eligible.iter().copied().min_by(|&a, &b| weighed[a].figure().total_cmp(&weighed[b].figure()));
    let equal = eligible.iter().copied().filter(|&i| least.is_some_and(|least| weighed[i].ties_with(&weighed[least])));
    let easiest = equal.min_by(|&a, &b| weighed[a].easier(&weighed[b]));
    (easiest.or(best_classic).unwrap_or(0), best_classic)
}

/// A figure over the least among others, as [`ratio_over`]; none where any of them lacks it.
pub(super) fn over_least(figures: &[Option<f64>], of: usize, among: &[usize], same_rad_per_s: f64) -> Option<f64> {
    let least = among.iter().map(|&i| figures[i]).collect::<Option<Vec<f64>>>()?.into_iter().reduce(f64::min)?;
    let mine = figures[of]?;
    Some(ratio_over(mine, least, same_rad_per_s).unwrap_or(if mine > 0.0 { f64::INFINITY } else { 1.0 }))
}

/// A figure over another one; what exceeds that by no more than `same` is the same. None over nothing.
pub(super) fn ratio_over(mine: f64, least: f64, same: f64) -> Option<f64> {
    let beyond = if mine > least { (mine - same).max(least) } else { mine };
    (least > 0.0).then(|| beyond / least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::Pattern;
    use crate::pattern::windability::WindingGraph;
    use crate::search::cost::worst_case::WorstCase;

    fn weighed(segments: &[usize], is_classic: bool, guaranteed_rad_per_s: f64, regret: f64) -> Weighed {
        let pattern = Pattern::new(segments.to_vec()).unwrap();
        let judged = Judged {
            name: "test".into(),
            pattern: pattern.clone(),
            worst: WorstCase { rate_rad_per_s: 1.0, profile: "p".into(), profile_index: 0, time_s: 0.0 },
            phase_rad: 0.0,
            guaranteed_rad_per_s: Some(guaranteed_rad_per_s),
            p95_rad_per_s: None,
            objective_rad_per_s: 1.0,
            grid_margin_rad_per_s: None,
            pointing: None,
        };
        let windability = WindingGraph::new(&pattern).windability();
        let unseen_rad_per_s = 1.0;
        Weighed {
            judged,
            windability,
            is_classic,
            unseen_rad_per_s,
            provoked_rad_per_s: None,
            p95_rad_per_s: None,
            yield_share: None,
            prospect: None,
            pointing: None,
            regret,
        }
    }

    #[test]
    fn the_classic_stays_unless_something_beats_it_everywhere_by_more_than_a_tie() {
        let qua = weighed(&[2, 3, 4, 1], true, 1.0, 1.0);
        let of = |found: Weighed| chosen(&[qua.clone(), found]).0;
        assert_eq!(of(weighed(&[3, 2, 4, 1], false, 0.9, 0.99)), 1);
        assert_eq!(of(weighed(&[3, 2, 4, 1], false, 0.985, 0.9)), 0, "a tie");
        assert_eq!(of(weighed(&[3, 2, 4, 1], false, 0.5, 1.01)), 0, "worse on a set of unseen profiles");
        assert_eq!(of(weighed(&[3, 2, 4, 1], false, 1.2, 1.2)), 0, "wins only on what it was searched on");
    }

    #[test]
    fn where_the_classics_change_places_a_pattern_that_is_nowhere_behind_takes_theirs() {
        let qua = weighed(&[2, 3, 4, 1], true, 1.0, 1.07);
        let dip = weighed(&[2, 3, 1, 4], true, 1.01, 1.05);
        let of = |found: Weighed| chosen(&[qua.clone(), dip.clone(), found]).0;
        assert_eq!(of(weighed(&[3, 2, 4, 1], false, 0.99, 1.015)), 2);
        assert_eq!(of(weighed(&[3, 2, 4, 1], false, 0.99, 1.03)), 1, "behind itself: the classic stays");
    }

    #[test]
    fn of_equals_the_one_that_is_easier_to_wind_is_taken() {
        let quadrupole = weighed(&[2, 3, 4, 1], true, 1.0, 1.0);
        let cylinder = weighed(&[1, 2, 3, 4], true, 1.01, 1.01);
        let worse = weighed(&[1, 2, 3, 4], true, 1.05, 1.05);
        assert_eq!(chosen(&[quadrupole.clone(), cylinder]).0, 1);
        assert_eq!(chosen(&[quadrupole, worse]).0, 0);
    }
}
