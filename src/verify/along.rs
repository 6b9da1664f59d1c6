//! A profile followed piece by piece, in work that grows with the number of its ramps and not with its square.
//!
//! ```text
//! T(t) = Σ_j Δ_j f(t − t_j),   f(t) = Im Σ_k w_k f̂(s_k) e^{s_k t}  within a window of times
//! Σ_j Δ_j f(t + d − t_j) = Im Σ_k w_k f̂(s_k) e^{s_k d} E_k,   E_k = Σ_j Δ_j e^{s_k (t − t_j)}
//! ```
//!
//! Ramps whose age stays within one window of [`super::laplace`] all through a piece are gathered in E_k, which goes on from piece
//! to piece: a ramp joins the window that it grows into and leaves the one that it grows out of. The others, the latest and the few
//! at a window's border, are added one by one.
//!
//! # Source
//! C. Lubich, A. Schädle, SIAM J. Sci. Comput. 24 (2002) 161: fast convolution by contour integrals.

use nalgebra::Complex;

use super::heat::{Heat, State};
use super::laplace::Response;
use crate::profile::Profile;

/// The ramps gathered at the nodes of one window: those from one number to before another.
#[derive(Debug, Clone, Default)]
struct Gathered {
    from: usize,
    to: usize,
    sums: Vec<Complex<f64>>,
    /// Since when they only went on.
    summed_at_s: f64,
}

/// A place in a profile, at the beginning of one of its pieces.
#[derive(Debug)]
pub(super) struct Along<'h> {
    heat: &'h Heat,
    response: &'h Response,
    windows_s: Vec<(f64, f64)>,
    /// When each ramp begins, the end of the last one among them; by how much the rate changes there.
    starts_s: Vec<f64>,
    changes_k_per_s: Vec<f64>,
    /// Of the boundary, from each of these times on and at it.
    rates_k_per_s: Vec<f64>,
    rises_k: Vec<f64>,
    gathered: Vec<Gathered>,
    /// Ramps that are added one by one.
    apart: Vec<usize>,
    /// The piece that comes next.
    next: usize,
}

impl<'h> Along<'h> {
    /// None where the states are no sums over ramps.
    pub(crate) fn new(heat: &'h Heat, profile: &Profile) -> Option<Self> {
        let response = heat.gathered()?;
        let (mut starts_s, mut rises_k) = (vec![0.0], vec![0.0]);
        for piece in profile.pieces() {
            starts_s.push(starts_s[starts_s.len() - 1] + piece.duration_s);
            rises_k.push(rises_k[rises_k.len() - 1] + piece.rate_k_per_s * piece.duration_s);
        }
        let rates_k_per_s: Vec<f64> = profile.pieces().iter().map(|piece| piece.rate_k_per_s).chain([0.0]).collect();
        let before = std::iter::once(&0.0).chain(&rates_k_per_s);
        let changes_k_per_s = rates_k_per_s.iter().zip(before).map(|(rate, before)| rate - before).collect();
        let windows_s: Vec<(f64, f64)> = response.windows_s().collect();
        let gathered = vec![Gathered::default(); windows_s.len()];
        let apart = Vec::new();
        Some(Self {
            heat,
            response,
            windows_s,
            starts_s,
            changes_k_per_s,
            rates_k_per_s,
            rises_k,
            gathered,
            apart,
            next: 0,
        })
    }

    /// Goes on to the next piece and gives its number and duration; the last is the moment at which the profile ends.
    pub(crate) fn go_on(&mut self) -> Option<(usize, f64)> {
        let piece = self.next;
        let start_s = *self.starts_s.get(piece)?;
        let duration_s = self.starts_s.get(piece + 1).map_or(0.0, |end_s| end_s - start_s);
        self.next = piece + 1;
        for window in 0..self.windows_s.len() {
            self.gather(window, piece, start_s, duration_s);
        }
        self.apart.clear();
        let mut done = 0;
        for gathered in self.gathered.iter().rev() {
            self.apart.extend(done..gathered.from);
            done = done.max(gathered.to);
        }
        self.apart.extend(done..=piece);
        Some((piece, duration_s))
    }

    /// The ramps that are older than the window's first time now and no older than its last at the piece's end.
    fn gather(&mut self, window: usize, piece: usize, start_s: f64, duration_s: f64) {
        let (youngest_s, oldest_s) = self.windows_s[window];
        let earlier = &self.starts_s[..piece];
        let to = earlier.partition_point(|t| start_s - t > youngest_s);
        let from = earlier.partition_point(|t| start_s + duration_s - t > oldest_s).min(to);
        let gathered = &mut self.gathered[window];
        // What rounding leaves grows with time: it is summed anew before it can.
        let is_anew = from >= gathered.to || start_s - gathered.summed_at_s > oldest_s;
        let add = |sums: &mut Vec<Complex<f64>>, ramps: std::ops::Range<usize>, sign: f64| {
            for ramp in ramps {
                let (change, lasted_s) = (sign * self.changes_k_per_s[ramp], start_s - self.starts_s[ramp]);
                self.response.gather(window, sums, change, lasted_s);
            }
        };
        if is_anew {
            gathered.sums.clear();
            gathered.summed_at_s = start_s;
            add(&mut gathered.sums, from..to, 1.0);
        } else {
            let passed_s = start_s - self.starts_s[piece - 1];
            self.response.pass(window, &mut gathered.sums, passed_s);
            add(&mut gathered.sums, gathered.from..from, -1.0);
            add(&mut gathered.sums, gathered.to..to, 1.0);
        }
        (gathered.from, gathered.to) = (from, to);
    }

    /// So long after the piece that was gone on to began, and within it.
    pub(crate) fn state(&self, since_s: f64) -> State {
        let piece = self.next.saturating_sub(1);
        let start_s = self.starts_s[piece];
        let mut state = self.heat.still(start_s + since_s);
        for &ramp in &self.apart {
            let lasted_s = if ramp == piece { since_s } else { start_s - self.starts_s[ramp] + since_s };
            self.heat.add(&mut state, self.changes_k_per_s[ramp], lasted_s);
        }
        let (rate_k_per_s, rise_k) =
            (self.rates_k_per_s[piece], self.rises_k[piece] + self.rates_k_per_s[piece] * since_s);
        let (of_rate, of_rise) = (rate_k_per_s - state.ambient_rate_k_per_s, rise_k - state.ambient_rise_k);
        for (window, gathered) in self.gathered.iter().enumerate().filter(|(_, gathered)| gathered.from < gathered.to) {
            let State { rate_k_per_s, rise_k, moment_k_per_s, .. } = &mut state;
            self.response.add_gathered(window, &gathered.sums, since_s, rate_k_per_s, rise_k, moment_k_per_s);
        }
        if self.response.outermost_is_drive() {
            if let Some(rate) = state.rate_k_per_s.last_mut() {
                *rate += of_rate;
            }
            if let Some(rise) = state.rise_k.last_mut() {
                *rise += of_rise;
            }
        }
        (state.ambient_rate_k_per_s, state.ambient_rise_k) = (rate_k_per_s, rise_k);
        self.heat.finish(&mut state);
        state
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::Piece;
    use crate::thermal::Extent;
    use crate::verify::heat::Moment;
    use crate::verify::laplace::tests::model;
    use crate::verify::physics::Physics;

    /// Ramps up and down, some of which are a thousand times longer than others.
    fn profile(ramps: usize) -> Profile {
        let piece = |i: usize| Piece {
            rate_k_per_s: 0.01 * ((i * 7919 % 13) as f64 - 6.0),
            duration_s: if i % 50 == 49 { 900.0 } else { 0.5 + (i * 104_729 % 17) as f64 },
        };
        Profile::new("many", (0..ramps).map(piece).collect()).unwrap()
    }

    #[test]
    fn the_states_of_many_ramps_are_their_sum() {
        let profile = profile(400);
        for extent in [Extent::Pack, Extent::HalfSpace] {
            let mut model = model();
            model.extent = extent;
            let mut physics = Physics::read(&model).unwrap();
            physics.path_slopes_per_k.push(1e-3);
            let heat = Heat::new(&model, &physics, 0.01, profile.duration_s());
            let mut along = Along::new(&heat, &profile).unwrap();
            let (mut start_s, mut worst) = (0.0, [0.0_f64; 2]);
            while let Some((piece, duration_s)) = along.go_on() {
                // The last piece is a moment.
                for since_s in
                    [0.0, 0.01 * duration_s, 0.7 * duration_s].into_iter().filter(|t| *t < duration_s || *t == 0.0)
                {
                    if piece % 7 != 0 && duration_s > 0.0 {
                        continue;
                    }
                    let (found, sum) =
                        (along.state(since_s), heat.at(&profile, Moment { time_s: start_s + since_s, after: true }));
                    let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    worst[0] = worst[0].max(off(&found.rate_k_per_s, &sum.rate_k_per_s));
                    worst[1] = worst[1].max(off(&found.rise_k, &sum.rise_k));
                    assert!((found.ambient_rise_k - sum.ambient_rise_k).abs() < 1e-9);
                }
                start_s += duration_s;
            }
            println!("{extent:?}: rates within {:.1e} K/s, temperatures within {:.1e} K", worst[0], worst[1]);
            // Of ramps of up to 0.06 K/s that take the pack through tens of kelvins.
            assert!(worst[0] < 1e-12 && worst[1] < 1e-9);
        }
    }

    #[test]
    fn the_work_grows_with_the_number_of_ramps_and_not_with_its_square() {
        let model = model();
        let physics = Physics::read(&model).unwrap();
        let apart_a_piece = |ramps: usize| {
            let profile = profile(ramps);
            let heat = Heat::new(&model, &physics, 0.01, profile.duration_s());
            let mut along = Along::new(&heat, &profile).unwrap();
            let mut apart = 0;
            while along.go_on().is_some() {
                apart += along.apart.len();
            }
            apart as f64 / ramps as f64
        };
        let (few, many) = (apart_a_piece(100), apart_a_piece(3_000));
        println!("ramps that are added one by one, a piece: {few:.1} of 100, {many:.1} of 3000");
        assert!(many < 2.0 * few && many < 40.0);
    }
}
