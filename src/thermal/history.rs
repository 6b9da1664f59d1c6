//! What a field answers: the instants at which it is asked, and the temperatures and rates in every layer there.

/// From which side a time is approached: rates jump where the drive's rate does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// What holds until then.
    Before,
    /// What holds from then on.
    After,
}

/// A time at which a field is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    pub(crate) time_s: f64,
    pub(crate) side: Side,
}

impl Instant {
    /// At a time, as what holds from then on.
    pub fn after(time_s: f64) -> Self {
        Self { time_s, side: Side::After }
    }

    /// At a time, as what held until then.
    pub fn before(time_s: f64) -> Self {
        Self { time_s, side: Side::Before }
    }
}

/// Temperatures and their rates in every layer at a sequence of times.
///
/// # Shapes
/// Row-major, one row a time, `layers` columns, innermost layer first.
#[derive(Debug, Clone, PartialEq)]
pub struct ThermalHistory {
    /// Columns of a row.
    pub layers: usize,
    /// One entry a row; both sides of a kink share a time.
    pub times_s: Vec<f64>,
    /// One row a time.
    pub temperature_k: Vec<f64>,
    /// dT/dt, as `temperature_k`.
    pub rate_k_per_s: Vec<f64>,
    /// ∫ Ṫ ζ dζ over −½ ≤ ζ ≤ ½, ζ the axial coordinate over the height, growing away from the first flange; empty
    /// where nothing varies along the axis.
    pub axial_moment_k_per_s: Vec<f64>,
    /// ∫ T ζ dζ; empty where nothing varies along the axis.
    pub axial_moment_k: Vec<f64>,
    /// Of the air outside the film; one entry a row.
    pub ambient_k: Vec<f64>,
    /// Its rate of change.
    pub ambient_rate_k_per_s: Vec<f64>,
}

impl ThermalHistory {
    /// Without a row.
    pub fn with_capacity(layers: usize, times: usize) -> Self {
        Self {
            layers,
            times_s: Vec::with_capacity(times),
            temperature_k: Vec::with_capacity(times * layers),
            rate_k_per_s: Vec::with_capacity(times * layers),
            axial_moment_k_per_s: Vec::new(),
            axial_moment_k: Vec::new(),
            ambient_k: Vec::with_capacity(times),
            ambient_rate_k_per_s: Vec::with_capacity(times),
        }
    }

    /// Rows.
    pub fn len(&self) -> usize {
        self.times_s.len()
    }

    /// H ← a H + b G, entry by entry, of a history of the same layers and times.
    pub(crate) fn mix(&mut self, a: f64, other: &Self, b: f64) {
        let add = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(t, f)| *t = a * *t + b * f);
        add(&mut self.temperature_k, &other.temperature_k);
        add(&mut self.rate_k_per_s, &other.rate_k_per_s);
        add(&mut self.axial_moment_k, &other.axial_moment_k);
        add(&mut self.axial_moment_k_per_s, &other.axial_moment_k_per_s);
        add(&mut self.ambient_k, &other.ambient_k);
        add(&mut self.ambient_rate_k_per_s, &other.ambient_rate_k_per_s);
    }

    /// A row of a history of the same layers behind the last.
    pub(crate) fn push_row_of(&mut self, other: &Self, row: usize) {
        let here = row * other.layers..(row + 1) * other.layers;
        self.times_s.push(other.times_s[row]);
        self.temperature_k.extend_from_slice(other.temperatures_k(row));
        self.rate_k_per_s.extend_from_slice(other.rates_k_per_s(row));
        self.axial_moment_k_per_s.extend_from_slice(other.axial_moments_k_per_s(row));
        if !other.axial_moment_k.is_empty() {
            self.axial_moment_k.extend_from_slice(&other.axial_moment_k[here]);
        }
        self.ambient_k.push(other.ambient_k[row]);
        self.ambient_rate_k_per_s.push(other.ambient_rate_k_per_s[row]);
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.times_s.is_empty()
    }

    /// Of each layer in one row.
    pub fn temperatures_k(&self, row: usize) -> &[f64] {
        &self.temperature_k[row * self.layers..(row + 1) * self.layers]
    }

    /// dT/dt of each layer in one row.
    pub fn rates_k_per_s(&self, row: usize) -> &[f64] {
        &self.rate_k_per_s[row * self.layers..(row + 1) * self.layers]
    }

    /// ∫ Ṫ ζ dζ of each layer in one row; empty where nothing varies along the axis.
    pub fn axial_moments_k_per_s(&self, row: usize) -> &[f64] {
        if self.axial_moment_k_per_s.is_empty() {
            &[]
        } else {
            &self.axial_moment_k_per_s[row * self.layers..(row + 1) * self.layers]
        }
    }
}
