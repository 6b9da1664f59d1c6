//! A film between air and pack that changes to another one and back, as a fan is switched on and off.
//!
//! ```text
//! h' = ρ h:   h' (a − T) = h (a' − T),   a' = ρ a + (1 − ρ) T,   T = Σ_i a_i x_i + r a'
//! a' = (ρ a + (1 − ρ) Σ_i a_i x_i)/(1 − (1 − ρ) r)
//! ```
//!
//! The modes stay those of one film: behind the other they follow the air a' that would bring the same heat through the first.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | h, h', ρ | the film, the other one, and their ratio | W/(m²K), 1 |
//! | a, T | air, outermost layer | K |
//! | a_i, r | shares of the modes and of the drive in the outermost layer | 1 |

use super::filter::{MEASURED, Move};
use super::layout::Layout;
use super::row::Film;
use super::series::{Series, Shape, TimeStep, place_of};
use crate::thermal::reduced::Reduced;

/// What the modes follow, over the states: the air, or the skin of a half space; behind a film of another ratio what would bring the same
/// heat through the usual one.
pub(super) fn drive(layout: &Layout, reduced: &Reduced, film_ratio: f64) -> Vec<f64> {
    let mut row = vec![0.0; layout.size];
    if let Some(skin) = layout.skin {
        row[skin] = 1.0;
        return row;
    }
    let outermost = reduced.layers - 1;
    let share = 1.0 / (1.0 - (1.0 - film_ratio) * reduced.residue[outermost]);
    layout.air().into_iter().for_each(|i| row[i] = film_ratio * share);
    let of_pack = (1.0 - film_ratio) * share;
    row.iter_mut().zip(reduced.row(outermost)).for_each(|(r, a)| *r += of_pack * a);
    row
}

/// A share of a step that counts as none.
const NO_SHARE: f64 = 1e-3;

impl Series {
    /// The films of the record.
    pub(super) fn films(&self) -> &'static [Film] {
        if self.film_switches_s.is_empty() { &Film::BOTH[..1] } else { &Film::BOTH }
    }

    /// The film at a row.
    pub(super) fn film_at(&self, row: usize) -> Film {
        self.shapes[self.shape_of(row)].film
    }

    /// The same record with its film switched at these times and no others, ascending; one before the first row is that the record begins behind the
    /// other film.
    pub(super) fn with_film_switches(&self, times_s: &[f64]) -> Self {
        let mut with = self.clone();
        with.film_switches_s = times_s.to_vec();
        // Only those of the films that it has.
        (with.steps, with.after_kinks, with.shapes) = (Vec::new(), Vec::new(), Vec::new());
        let mut film = Film::Usual;
        let mut left = times_s.iter().copied().peekable();
        for k in 0..with.rows.len() {
            let mut at_s = if k > 0 { with.times_s[k - 1] } else { f64::NEG_INFINITY };
            let mut moves = Vec::new();
            let mut before = std::mem::take(&mut with.rows[k].moves).into_iter().peekable();
            while let Some(movement) = before.next() {
                let Move::Step(step) = movement else {
                    moves.push(behind(movement, film));
                    continue;
                };
                let length_s = self.steps[step as usize].length_s;
                let end_s = at_s + length_s;
                let mut kinks_s = Vec::new();
                while let Some(&Move::Kink(place)) = before.peek() {
                    kinks_s.push(end_s - self.after_kink_s(place));
                    before.next();
                }
                let (mut pieces, mut begun_s) = (Vec::new(), at_s);
                while let Some(switch_s) = left.next_if(|&t| t < end_s - NO_SHARE * length_s) {
                    if switch_s > begun_s + NO_SHARE * length_s {
                        pieces.push((switch_s, film));
                        begun_s = switch_s;
                    }
                    film = film.other();
                }
                pieces.push((end_s, film));
                for (to_s, film) in pieces {
                    moves.push(Move::Step(with.step_of(TimeStep { length_s: to_s - at_s, film })));
                    let own_s = kinks_s.extract_if(.., |kink_s| *kink_s < to_s || to_s >= end_s);
                    moves.extend(own_s.map(|kink_s| with.kink_before(TimeStep { length_s: to_s - kink_s, film })));
                    at_s = to_s;
                }
            }
            // A switch at the row itself is behind its steps.
            while left.next_if(|&t| t <= with.times_s[k]).is_some() {
                film = film.other();
            }
            with.rows[k].moves = moves;
            let like = Shape { film, ..self.shapes[self.shape_of(k)] };
            let shape = place_of(&mut with.shapes, like);
            with.shape_of[k] = shape as u16;
            for (m, h) in with.rows[k].measured.iter_mut().enumerate() {
                *h = h.map(|_| (shape * MEASURED + m) as u16);
            }
        }
        with
    }
}

/// A window that begins keeps what there is behind its film.
fn behind(movement: Move, film: Film) -> Move {
    match (movement, film) {
        (Move::Keep(slot), Film::Usual) => Move::Keep(slot % SLOTS),
        (Move::Keep(slot), Film::Switched) => Move::Keep(slot % SLOTS + SLOTS),
        _ => movement,
    }
}

/// Slots of windows behind one film.
const SLOTS: u8 = 2;

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::super::dense::tests::model;
    use super::super::kinks::tests::kinked;
    use super::super::layout::{OutputGains, Parts, RecordKind};
    use super::super::shows::Shows;
    use super::super::system::driven_by_air;
    use super::*;
    use crate::pattern::classic::Classic;
    use crate::rate::CoilModel;

    fn reduced(model: &CoilModel, film_w_per_m2_k: f64) -> Reduced {
        let (driven, _) = driven_by_air(&model.heat_path().unwrap(), film_w_per_m2_k);
        Reduced::new(&driven, None, 9, 10.0, 1e4).unwrap()
    }

    #[test]
    fn modes_of_one_film_follow_the_air_behind_another_as_the_modes_of_that_do() {
        let model = model(Vec::new());
        let (one, other) = (reduced(&model, 25.0), reduced(&model, 60.0));
        let gains = OutputGains { outputs: vec![0.0; one.outputs], air: 0.0 };
        let parts = Parts {
            reduced: &one,
            gains: &gains,
            skin_s: None,
            shows: Shows::OuterLayer,
            lag_s: 0.0,
            drift: false,
            cycle: false,
        };
        let layout = Layout::with(&parts, &RecordKind::default());
        let row = drive(&layout, &one, 60.0 / 25.0);
        // What is as warm as the air stays so.
        let levels: f64 = row[..one.modes()].iter().sum::<f64>() + row[layout.trend];
        assert!((levels - 1.0).abs() < 1e-9, "{levels}");
        let own = |i: usize, k: usize| one.decay_per_s[i] * (row[k] - f64::from(i == k));
        let decays = DMatrix::from_fn(one.modes(), one.modes(), own).complex_eigenvalues();
        let slowest = decays.iter().map(|l| -l.re).fold(f64::INFINITY, f64::min);
        // The outermost layer stands for the surface, from which half a layer divides it.
        assert!((slowest / other.decay_per_s[0] - 1.0).abs() < 2e-2, "{slowest} {}", other.decay_per_s[0]);
        assert!((slowest / one.decay_per_s[0] - 1.0).abs() > 0.5);
    }

    #[test]
    fn switches_divide_the_steps_of_a_record_and_nothing_else() {
        let model = model(Vec::new());
        let record = kinked(&model, &Classic::Zyl.pattern(8).unwrap());
        let chamber = super::super::Chamber::new(&model, &[&record]).unwrap();
        let whole = &chamber.observed[0].series;
        let with = whole.with_film_switches(&[whole.start_s, 1003.0, 2000.0]);
        let lasts = |series: &Series, film: Film| -> f64 {
            let steps = series.rows.iter().flat_map(|row| &row.moves).filter_map(|m| match m {
                Move::Step(step) => Some(series.steps[*step as usize]),
                _ => None,
            });
            steps.filter(|s| s.film == film).map(|s| s.length_s).sum()
        };
        let all_s = lasts(whole, Film::Usual);
        let switched_s = 1003.0 - whole.start_s + (whole.start_s + whole.duration_s - 2000.0);
        assert!((lasts(&with, Film::Switched) - switched_s).abs() < 1e-6);
        assert!((lasts(&with, Film::Usual) + switched_s - all_s).abs() < 1e-6);
        let at = |time_s: f64| with.film_at(with.times_s.iter().position(|t| *t == time_s).unwrap());
        let films = [whole.start_s, 1000.0, 1010.0, 2000.0, 2010.0].map(at);
        let (usual, switched) = (Film::Usual, Film::Switched);
        assert_eq!(films, [switched, switched, usual, switched, switched]);
    }
}
