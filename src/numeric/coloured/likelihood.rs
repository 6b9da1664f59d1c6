//! The likelihood of the octaves and how it is maximised; equations in the module's head.
//!
//! Majorising steps never go down, and crawl where noises are alike. Two of them tell where they lead: a leap along them is taken where
//! the likelihood is higher there (squared extrapolation, Varadhan, Roland, Scand. J. Stat. 35 (2008) 335).

use std::f64::consts::{LN_2, PI};

use nalgebra::{DMatrix, DVector};

use crate::numeric::pyramid::Level;

use super::STRAY;

/// Quantisation, white, flicker as averaged, flicker as sampled, random walk as averaged, random walk as sampled.
pub(super) const COMPONENTS: usize = 6;

/// Haar variance of Hosking's flicker beside that of averaged flicker, octave by octave; from octave 9 on 1 to 1e-5.
const HOSKING: [f64; 8] = [
    std::f64::consts::LOG2_E,
    1.154_156_032_712,
    1.050_001_425_699,
    1.015_412_937_271,
    1.004_584_566_927,
    1.001_329_178_918,
    1.000_378_067_334,
    1.000_105_962_730,
];
/// Sums of the squared correlations of a coefficient of flicker with those so many octaves below it.
const FLICKER_CORRELATION: [f64; 8] = [1.0364, 0.1275, 0.1654, 0.1139, 0.0659, 0.0352, 0.0181, 0.0091];
/// The ramp may be anything: this many of its usual sizes.
const LOOSE: f64 = 1e6;
/// A column whose square sum is less than this part of the largest does not vary; nor does an octave of y.
const STILL: f64 = 1e-20;
/// Variances set out from no less than this part of the largest that an octave allows.
const FAINT: f64 = 1e-3;
/// Of a column's variance, beside 1 for as much as the whole signal's.
const LITTLE: f64 = 1e-8;
const MOST_ROUNDS: usize = 100;
const INNER_ROUNDS: usize = 150;
/// A step that shows less in every octave, in standard errors, ends a climb.
const UNSEEN: f64 = 1e-4;
/// A leap is at most so many steps long, and changes no variance by more than this power of e.
const FARTHEST: f64 = 64.0;
const MOST_POWERS: f64 = 12.0;
/// Of −2 log L: what does not matter beside a quantile of 6.6.
const SETTLED: f64 = 5e-4;

/// Where the likelihood was looked at.
#[derive(Debug, Clone)]
pub(super) struct Point {
    pub(crate) variances: [f64; COMPONENTS],
    /// Of the columns, by group.
    pub(super) group_variances: Vec<f64>,
    pub(crate) minus_two_log_likelihood: f64,
}

#[derive(Debug, Clone)]
pub(super) struct Octave {
    pub(super) n: f64,
    pub(super) weight: f64,
    yy: f64,
    xy: DVector<f64>,
    pub(super) xx: DMatrix<f64>,
    pub(super) units: [f64; COMPONENTS],
}

impl Octave {
    /// Of a coefficient.
    fn variance(&self, variances: &[f64; COMPONENTS]) -> f64 {
        variances.iter().zip(self.units).map(|(v, u)| v * u).sum::<f64>().max(f64::MIN_POSITIVE)
    }
}

#[derive(Debug, Clone)]
pub(super) struct Likelihood {
    pub(super) octaves: Vec<Octave>,
    /// Which group each column is in; None for the ramp.
    groups: Vec<Option<usize>>,
    group_count: usize,
    y_scale: f64,
    pub(super) ramp_scale: Option<f64>,
}

/// What is left of y at given variances.
pub(super) struct Rest {
    /// Square sums by octave, with what is uncertain in β.
    squares: Vec<f64>,
    pub(super) beta: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
    minus_two_log_likelihood: f64,
}

impl Likelihood {
    pub(super) fn new(levels: &[(usize, Level)], interval_s: f64, groups: &[usize]) -> Option<Self> {
        let rows: f64 = levels.iter().map(|(_, l)| l.count).sum();
        let total = |column: usize| -> f64 {
            levels.iter().filter(|(_, l)| column < l.columns).map(|(_, l)| l.product(column, column)).sum()
        };
        let y_scale = (total(0) / rows).sqrt();
        if !(y_scale > 0.0 && y_scale.is_finite()) {
            return None;
        }
        let mut kinds = vec![None];
        groups.iter().enumerate().for_each(|(g, size)| kinds.extend(std::iter::repeat_n(Some(g), *size)));
        let largest = (2..=kinds.len()).map(total).fold(0.0, f64::max);
        let kept: Vec<usize> = (1..=kinds.len())
            .filter(|c| total(*c) > if *c == 1 { 0.0 } else { STILL * largest } && total(*c).is_finite())
            .collect();
        let scales: Vec<f64> = kept.iter().map(|c| (total(*c) / rows).sqrt()).collect();
        let octaves = levels
            .iter()
            .map(|(number, level)| {
                let has_columns = level.columns > 1;
                let p = kept.len();
                let product = |a: usize, b: usize| level.product(a.min(b), a.max(b));
                Octave {
                    n: level.count,
                    weight: 1.0,
                    yy: level.product(0, 0) / (y_scale * y_scale),
                    xy: DVector::from_fn(p, |i, _| {
                        if has_columns { product(0, kept[i]) / (scales[i] * y_scale) } else { 0.0 }
                    }),
                    xx: DMatrix::from_fn(p, p, |i, j| {
                        if has_columns { product(kept[i], kept[j]) / (scales[i] * scales[j]) } else { 0.0 }
                    }),
                    units: units(*number, interval_s),
                }
            })
            .collect();
        Some(Self {
            octaves,
            groups: kept.iter().map(|c| kinds[c - 1]).collect(),
            group_count: groups.len(),
            y_scale,
            ramp_scale: (kept.first() == Some(&1)).then(|| scales[0]),
        })
    }

    /// One unit of the likelihood in units of y.
    pub(super) fn scale(&self) -> f64 {
        self.y_scale
    }

    /// Every noise as large as the quietest octave allows.
    pub(super) fn start(&self) -> Point {
        let variances = std::array::from_fn(|c| {
            let most = |o: &Octave| o.yy / o.n / o.units[c];
            let least = self.octaves.iter().map(most).fold(f64::INFINITY, f64::min);
            let usual = self.octaves.iter().map(most).sum::<f64>() / self.octaves.len() as f64;
            least + FAINT * usual
        });
        Point { variances, group_variances: vec![1.0; self.group_count], minus_two_log_likelihood: f64::INFINITY }
    }

    /// The higher of two ascents: from columns that explain much, and from columns that explain next to nothing. What columns
    /// take from a walk at first, the walk does not get back.
    pub(super) fn best(&self) -> Point {
        let much = self.start();
        let little = Point { group_variances: vec![LITTLE; self.group_count], ..much.clone() };
        let (much, little) = (self.maximised(&much, None), self.maximised(&little, None));
        if little.minus_two_log_likelihood < much.minus_two_log_likelihood { little } else { much }
    }

    /// Every noise as at the start, with what columns explain as elsewhere.
    pub(super) fn start_in(&self, point: &Point) -> Point {
        Point { group_variances: point.group_variances.clone(), ..self.start() }
    }

    /// A variance so small that no octave shows it. Octaves in which nothing varies but rounding would show any.
    pub(super) fn least_visible(&self, parts: &[usize]) -> f64 {
        let largest = self.octaves.iter().map(|o| o.yy / o.n).fold(0.0, f64::max);
        let varies = self.octaves.iter().filter(|o| o.yy / o.n > STILL * largest);
        let most = |o: &Octave| o.yy / o.n / parts.iter().map(|p| o.units[*p]).fold(0.0, f64::max);
        FAINT * varies.map(most).fold(f64::INFINITY, f64::min)
    }

    pub(super) fn model(&self, variances: &[f64; COMPONENTS]) -> Vec<f64> {
        self.octaves.iter().map(|octave| octave.variance(variances)).collect()
    }

    fn prior(&self, column: usize, group_variances: &[f64]) -> f64 {
        self.groups[column].map_or(LOOSE, |g| group_variances[g])
    }

    pub(super) fn rest(&self, variances: &[f64; COMPONENTS], group_variances: &[f64]) -> Option<Rest> {
        let model = self.model(variances);
        let p = self.groups.len();
        let mut precision = DMatrix::zeros(p, p);
        let mut right = DVector::zeros(p);
        let mut minus_two_log_likelihood = 0.0;
        for (octave, s) in self.octaves.iter().zip(&model) {
            let by = octave.weight / s;
            precision += &octave.xx * by;
            right += &octave.xy * by;
            minus_two_log_likelihood += octave.weight * octave.n * s.ln() + by * octave.yy;
        }
        for column in 0..p {
            let prior = self.prior(column, group_variances);
            precision[(column, column)] += 1.0 / prior;
            minus_two_log_likelihood += prior.ln();
        }
        let root = precision.cholesky()?;
        minus_two_log_likelihood += 2.0 * root.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let beta = root.solve(&right);
        minus_two_log_likelihood -= beta.dot(&right);
        let covariance = root.inverse();
        let squares = self
            .octaves
            .iter()
            .map(|o| {
                let fit = o.yy - 2.0 * beta.dot(&o.xy) + beta.dot(&(&o.xx * &beta));
                fit.max(0.0) + o.xx.component_mul(&covariance).sum()
            })
            .collect();
        minus_two_log_likelihood.is_finite().then_some(Rest { squares, beta, covariance, minus_two_log_likelihood })
    }

    /// From `start` uphill; `held` keeps the sum of some components at a value.
    pub(super) fn maximised(&self, start: &Point, held: Option<(&[usize], f64)>) -> Point {
        let mut point = start.clone();
        if let Some((parts, sum)) = held {
            let before: f64 = parts.iter().map(|p| point.variances[*p]).sum();
            for part in parts {
                let share = if before > 0.0 { point.variances[*part] / before } else { 1.0 / parts.len() as f64 };
                point.variances[*part] = sum * share;
            }
            // What was zero can grow again once something else has to give way.
            for component in (0..COMPONENTS).filter(|c| !parts.contains(c)) {
                let faint = 1e-3 * self.least_visible(&[component]);
                point.variances[component] = point.variances[component].max(faint);
            }
        }
        let mut last = f64::INFINITY;
        for round in 0..MOST_ROUNDS {
            let Some(rest) = self.rest(&point.variances, &point.group_variances) else { break };
            point.minus_two_log_likelihood = rest.minus_two_log_likelihood;
            if last - rest.minus_two_log_likelihood < SETTLED && round > 2 {
                break;
            }
            last = rest.minus_two_log_likelihood;
            self.climb(&mut point.variances, &rest.squares, held);
            if !self.groups.is_empty() {
                self.regroup(&mut point.group_variances, &rest);
            }
        }
        point
    }

    /// Uphill with the residual squares as they are: pairs of majorising steps, and a leap along them where that is higher still.
    fn climb(&self, variances: &mut [f64; COMPONENTS], squares: &[f64], held: Option<(&[usize], f64)>) {
        for round in 0..INNER_ROUNDS {
            let before = *variances;
            let (first, most) = self.step(&before, squares, held);
            if most < UNSEEN && round > 1 {
                *variances = first;
                break;
            }
            let (second, _) = self.step(&first, squares, held);
            let leap = self.leap(&before, &first, &second, held);
            let is_higher = self.misfit(&leap, squares) < self.misfit(&second, squares);
            *variances = if is_higher { leap } else { second };
        }
    }

    /// One majorising step, and by how much it shows in the octave in which it shows most, in standard errors.
    fn step(
        &self,
        before: &[f64; COMPONENTS],
        squares: &[f64],
        held: Option<(&[usize], f64)>,
    ) -> ([f64; COMPONENTS], f64) {
        let (mut pull, mut push, mut shows) = ([0.0; COMPONENTS], [0.0; COMPONENTS], [0.0_f64; COMPONENTS]);
        for (octave, square) in self.octaves.iter().zip(squares) {
            let s = octave.variance(before);
            let (over, root) = (octave.weight / s, octave.n.sqrt() / s);
            for component in 0..COMPONENTS {
                let unit = octave.units[component];
                pull[component] += over * unit * square / s;
                push[component] += over * unit * octave.n;
                shows[component] = shows[component].max(unit * root);
            }
        }
        let mut after: [f64; COMPONENTS] = std::array::from_fn(|c| before[c] * (pull[c] / push[c]).sqrt());
        if let Some((parts, sum)) = held {
            hold(&mut after, before, parts, sum, &pull, &push);
        }
        let most = (0..COMPONENTS).map(|c| (after[c] - before[c]).abs() * shows[c]).fold(0.0, f64::max);
        (after, most)
    }

    /// Where two steps lead if what lies between them goes on, each noise by its logarithm and as far as it counts.
    fn leap(
        &self,
        before: &[f64; COMPONENTS],
        first: &[f64; COMPONENTS],
        second: &[f64; COMPONENTS],
        held: Option<(&[usize], f64)>,
    ) -> [f64; COMPONENTS] {
        let mut counts = [0.0_f64; COMPONENTS];
        for octave in &self.octaves {
            let by = (octave.weight * octave.n).sqrt() / octave.variance(second);
            for component in 0..COMPONENTS {
                counts[component] = counts[component].max(second[component] * octave.units[component] * by);
            }
        }
        let change = |from: f64, to: f64| if from > 0.0 && to > 0.0 { (to / from).ln() } else { 0.0 };
        let steps: [(f64, f64); COMPONENTS] = std::array::from_fn(|c| {
            let one = change(before[c], first[c]);
            (one, change(first[c], second[c]) - one)
        });
        let size = |of: fn(&(f64, f64)) -> f64| {
            steps.iter().zip(counts).map(|(step, count)| (of(step) * count).powi(2)).sum::<f64>().sqrt()
        };
        let (along, bend) = (size(|step| step.0), size(|step| step.1));
        let far = if bend > 0.0 { (along / bend).clamp(1.0, FARTHEST) } else { 1.0 };
        let mut after: [f64; COMPONENTS] = std::array::from_fn(|c| {
            let (one, more) = steps[c];
            before[c] * (2.0 * far * one + far * far * more).clamp(-MOST_POWERS, MOST_POWERS).exp()
        });
        if let Some((parts, sum)) = held {
            let total: f64 = parts.iter().map(|part| after[*part]).sum();
            if total > 0.0 {
                parts.iter().for_each(|part| after[*part] *= sum / total);
            }
        }
        after
    }

    /// Of −2 log L what depends on the variances while the residual squares stay.
    fn misfit(&self, variances: &[f64; COMPONENTS], squares: &[f64]) -> f64 {
        let of = |(octave, square): (&Octave, &f64)| {
            let s = octave.variance(variances);
            octave.weight * (octave.n * s.ln() + square / s)
        };
        self.octaves.iter().zip(squares).map(of).sum()
    }

    fn regroup(&self, group_variances: &mut [f64], rest: &Rest) {
        for (group, variance) in group_variances.iter_mut().enumerate() {
            let members = || (0..self.groups.len()).filter(|c| self.groups[*c] == Some(group));
            let count = members().count();
            if count > 0 {
                let sum: f64 = members().map(|c| rest.beta[c].powi(2) + rest.covariance[(c, c)]).sum();
                *variance = (sum / count as f64).max(1e-12);
            }
        }
    }

    /// Weights the octaves by what the others don't tell.
    pub(super) fn weigh(&mut self, point: &Point) {
        let model = self.model(&point.variances);
        let share = |o: &Octave, s: f64, parts: [usize; 2]| {
            parts.iter().map(|p| point.variances[*p] * o.units[*p]).sum::<f64>() / s
        };
        let shares: Vec<(f64, f64, f64)> =
            self.octaves.iter().zip(&model).map(|(o, s)| (o.n, share(o, *s, [2, 3]), share(o, *s, [4, 5]))).collect();
        let weights: Vec<f64> = shares
            .iter()
            .enumerate()
            .map(|(j, (n, flicker, walk))| {
                let told: f64 = shares
                    .iter()
                    .enumerate()
                    .map(|(k, (other_n, other_flicker, other_walk))| {
                        let apart = j.abs_diff(k);
                        let of_flicker = FLICKER_CORRELATION.get(apart).copied().unwrap_or(0.0);
                        if apart == 0 {
                            return n * (1.0 + flicker * flicker * (of_flicker - 1.0));
                        }
                        let of_walk = 0.75 * (1.0 - 0.25f64.powi(apart as i32));
                        let amplitude =
                            (flicker * other_flicker * of_flicker).sqrt() + (walk * other_walk * of_walk).sqrt();
                        n.min(*other_n) * amplitude * amplitude
                    })
                    .sum();
                let stray = n * n * STRAY * STRAY * (flicker * flicker + walk * walk) / 2.0;
                n / (told + stray)
            })
            .collect();
        self.octaves.iter_mut().zip(weights).for_each(|(o, w)| o.weight = w);
    }

    /// The same octaves without a ramp of this slope, in the ramp's own units, and without any other.
    pub(super) fn without_ramp(&self, slope: f64) -> Self {
        let octaves = self.octaves.iter().map(|o| Octave {
            yy: (o.yy - 2.0 * slope * o.xy[0] + slope * slope * o.xx[(0, 0)]).max(0.0),
            xy: (&o.xy - o.xx.column(0) * slope).remove_row(0),
            xx: o.xx.clone().remove_row(0).remove_column(0),
            ..*o
        });
        Self {
            octaves: octaves.collect(),
            groups: self.groups[1..].to_vec(),
            group_count: self.group_count,
            y_scale: self.y_scale,
            ramp_scale: None,
        }
    }

    /// Root mean square of what the further columns explain, in units of y.
    pub(super) fn explained(&self, point: &Point) -> f64 {
        let Some(rest) = self.rest(&point.variances, &point.group_variances) else { return 0.0 };
        let mut beta = rest.beta;
        if self.ramp_scale.is_some() {
            beta[0] = 0.0;
        }
        let square: f64 = self.octaves.iter().map(|o| beta.dot(&(&o.xx * &beta))).sum();
        let rows: f64 = self.octaves.iter().map(|o| o.n).sum();
        self.y_scale * (square.max(0.0) / rows).sqrt()
    }
}

/// The step that keeps a sum: the same majorant under a multiplier, found by bisection.
fn hold(
    variances: &mut [f64; COMPONENTS],
    before: &[f64; COMPONENTS],
    parts: &[usize],
    sum: f64,
    pull: &[f64; COMPONENTS],
    push: &[f64; COMPONENTS],
) {
    if let [one] = parts {
        variances[*one] = sum;
        return;
    }
    let least = parts.iter().map(|p| push[*p]).fold(f64::INFINITY, f64::min);
    let step = |multiplier: f64| -> Vec<f64> {
        parts.iter().map(|p| before[*p] * (pull[*p] / (push[*p] - least + multiplier)).sqrt()).collect()
    };
    let (mut low, mut high) = (1e-14 * least, 1e14 * least);
    for _ in 0..100 {
        let middle = (low * high).sqrt();
        if step(middle).iter().sum::<f64>() > sum { low = middle } else { high = middle }
    }
    let found = step(high);
    let total: f64 = found.iter().sum();
    for (part, value) in parts.iter().zip(found) {
        variances[*part] = if total > 0.0 { value * sum / total } else { sum / parts.len() as f64 };
    }
}

/// Haar variance of a unit of each component at an octave, 1 being the finest.
fn units(octave: usize, interval_s: f64) -> [f64; COMPONENTS] {
    let m = 2f64.powi(octave as i32 - 1);
    let flicker = m * 2.0 * LN_2 / PI;
    let walk = m * m * interval_s / 3.0;
    [
        3.0 / (m * interval_s * interval_s),
        1.0 / interval_s,
        flicker,
        flicker * HOSKING.get(octave - 1).copied().unwrap_or(1.0),
        walk,
        walk + interval_s / 6.0,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sampled_flickers_haar_variance_is_the_integral_of_its_spectrum() {
        // S = 1/(2π) · π/sin πf for B = 1; |H|² = 4 sin⁴(π f W/2)/(W sin² πf).
        for (octave, ratio) in HOSKING.iter().enumerate() {
            let (width, nodes) = (2f64.powi(octave as i32 + 1), 1 << 17);
            let mean = (0..nodes).map(|i| {
                let x = PI * (f64::from(i) + 0.5) / (2.0 * f64::from(nodes));
                0.5 / x.sin() * 4.0 * (x * width / 2.0).sin().powi(4) / (width * x.sin().powi(2))
            });
            let variance = mean.sum::<f64>() / f64::from(nodes);
            let found = variance / units(octave + 1, 1.0)[2];
            assert!((found / ratio - 1.0).abs() < 1e-5, "{octave}: {found}");
        }
    }
}
