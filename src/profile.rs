//! Temperature-ramp profiles: what happens to the boundary while nobody moves the gyro.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use crate::numeric::piecewise::PiecewiseLinear;
use crate::units::k_per_s_from_c_per_h;

/// A ramp (or, at rate zero, a soak) of one duration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// Slope of the temperature; 0 for a soak.
    pub rate_k_per_s: f64,
    /// How long it lasts; above 0.
    pub duration_s: f64,
}

/// A named sequence of ramps, from a steady state at t = 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    name: String,
    pieces: Vec<Piece>,
}

/// Why ramps make no profile.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum ProfileError {
    #[error("a ramp profile needs at least one piece")]
    Empty,
    #[error(
        "piece {index} must have a finite rate and a positive duration, found {rate_k_per_s} K/s over {duration_s} s"
    )]
    Piece { index: usize, rate_k_per_s: f64, duration_s: f64 },
}

impl Profile {
    /// A profile of pieces, one behind the other.
    ///
    /// # Example
    /// ```
    /// use coilwright::{Piece, Profile, units::k_per_s_from_c_per_h};
    ///
    /// let ramp = Piece { rate_k_per_s: k_per_s_from_c_per_h(10.0), duration_s: 1800.0 };
    /// let soak = Piece { rate_k_per_s: 0.0, duration_s: 600.0 };
    /// let profile = Profile::new("ramp and soak", vec![ramp, soak])?;
    /// assert_eq!(profile.duration_s(), 2400.0);
    /// // 10 °C/h for half an hour.
    /// assert!((profile.temperature(293.15).value(2000.0) - 298.15).abs() < 1e-9);
    /// # Ok::<(), coilwright::profile::ProfileError>(())
    /// ```
    ///
    /// # Errors
    /// No piece, a rate that is not finite, a duration that is not positive.
    pub fn new(name: impl Into<String>, pieces: Vec<Piece>) -> Result<Self, ProfileError> {
        if pieces.is_empty() {
            return Err(ProfileError::Empty);
        }
        for (index, piece) in pieces.iter().enumerate() {
            let valid = piece.rate_k_per_s.is_finite() && piece.duration_s > 0.0 && piece.duration_s.is_finite();
            if !valid {
                return Err(ProfileError::Piece {
                    index,
                    rate_k_per_s: piece.rate_k_per_s,
                    duration_s: piece.duration_s,
                });
            }
        }
        Ok(Self { name: name.into(), pieces })
    }

    /// As it is shown.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// In their order in time.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Of all pieces together.
    pub fn duration_s(&self) -> f64 {
        self.pieces.iter().map(|p| p.duration_s).sum()
    }

    /// The largest size of any piece's slope.
    pub fn max_rate_k_per_s(&self) -> f64 {
        self.pieces.iter().map(|p| p.rate_k_per_s.abs()).fold(0.0, f64::max)
    }

    /// The boundary's temperature, beginning at `start_k`.
    pub fn temperature(&self, start_k: f64) -> PiecewiseLinear {
        let (mut time_s, mut value_k) = (0.0, start_k);
        let (mut knots, mut values) = (vec![time_s], vec![value_k]);
        for piece in &self.pieces {
            time_s += piece.duration_s;
            value_k += piece.rate_k_per_s * piece.duration_s;
            knots.push(time_s);
            values.push(value_k);
        }
        PiecewiseLinear::new(knots, values).expect("durations are positive and rates finite by construction")
    }
}

/// The profiles that a search and a worst case run over.
#[derive(Debug, Clone, PartialEq)]
pub struct ProfileSpec {
    /// No sampled ramp is steeper; also the bound of the guaranteed worst case.
    pub max_rate_k_per_s: f64,
    /// Number of sampled profiles.
    pub count: usize,
    /// Ramps in each of them.
    pub segments: usize,
    /// Of each of them.
    pub duration_s: f64,
    /// Of their random slopes.
    pub seed: u64,
    /// Those stated piece by piece, behind the drawn ones.
    pub listed: Vec<Profile>,
}

/// What a model file that says nothing of profiles is searched over: 64 profiles of 4 ramps of up to 60 °C/h in 6000 s.
impl Default for ProfileSpec {
    fn default() -> Self {
        Self {
            max_rate_k_per_s: k_per_s_from_c_per_h(60.0),
            count: 64,
            segments: 4,
            duration_s: 6000.0,
            seed: 1,
            listed: Vec::new(),
        }
    }
}

impl ProfileSpec {
    /// The listed profiles, then the sampled ones. The same seed gives the same profiles on every machine.
    ///
    /// # Example
    /// ```
    /// use coilwright::ProfileSpec;
    ///
    /// let spec = ProfileSpec { count: 3, seed: 7, ..ProfileSpec::default() };
    /// let profiles = spec.profiles();
    /// assert_eq!(profiles.len(), 3);
    /// assert!(profiles.iter().all(|p| p.max_rate_k_per_s() <= spec.max_rate_k_per_s));
    /// assert_eq!(profiles, spec.profiles());
    /// ```
    pub fn profiles(&self) -> Vec<Profile> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let sampled = (0..self.count).map(|i| self.sample(i, &mut random));
        self.listed.iter().cloned().chain(sampled).collect()
    }

    /// Rates uniform in ±max; break points uniform over the duration, no piece shorter than a fiftieth of the even share.
    fn sample(&self, index: usize, random: &mut impl Rng) -> Profile {
        let segments = self.segments.max(1);
        let shortest_s = self.duration_s / segments as f64 / 50.0;
        let free_s = self.duration_s - shortest_s * segments as f64;
        let mut breaks: Vec<f64> = (1..segments).map(|_| random.random::<f64>() * free_s).collect();
        breaks.sort_by(f64::total_cmp);
        breaks.push(free_s);
        let mut previous_s = 0.0;
        let pieces = breaks
            .into_iter()
            .map(|end_s| {
                let duration_s = end_s - previous_s + shortest_s;
                previous_s = end_s;
                Piece { rate_k_per_s: (2.0 * random.random::<f64>() - 1.0) * self.max_rate_k_per_s, duration_s }
            })
            .collect();
        Profile::new(format!("sampled-{}", index + 1), pieces).expect("sampled pieces have positive durations")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sampled_profiles_stay_within_rate_and_duration_and_repeat_with_the_seed() {
        let spec =
            ProfileSpec { max_rate_k_per_s: 0.01, count: 50, segments: 4, duration_s: 6000.0, seed: 9, listed: vec![] };
        let profiles = spec.profiles();
        assert_eq!(profiles, spec.profiles());
        for profile in &profiles {
            assert!(profile.max_rate_k_per_s() <= 0.01);
            assert!((profile.duration_s() - 6000.0).abs() < 1e-6);
            assert_eq!(profile.pieces().len(), 4);
        }
        assert_ne!(profiles[0].pieces(), profiles[1].pieces());
    }
}
