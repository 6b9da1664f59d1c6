//! From a boundary's temperature to the temperature and its rate in every layer.
//!
//! [`HeatPath`] says what the heat flows through; effects edit it. [`solve`] takes a heat path and a [`Drive`] and
//! gives a [`Field`], which can be asked for any instants. The field does not depend on the winding pattern.

mod bending;
mod checked;
mod elements;
pub(crate) mod exposure;
mod given;
pub(crate) mod half_space;
mod half_space_memory;
mod history;
mod joined;
mod modal;
mod network;
pub mod pack;
mod panel;
mod path;
pub(crate) mod reduced;
mod stepped;
mod varying;

use std::sync::Arc;

use thiserror::Error;

use crate::numeric::piecewise::PiecewiseLinear;
pub(crate) use checked::check;
pub(crate) use given::GivenField;
use half_space::HalfSpaceField;
pub use history::{Instant, Side, ThermalHistory};
use modal::{PackField, Prepared};
use pack::Pack;
pub use path::{
    BoreHeat, DEFAULT_CELLS_PER_LAYER, Extent, Flange, FlangeFilm, HeatPath, Housing, LayerGap, Location, PackMaterial,
    PackShape, Spool, SpoolFlange, SpoolWall, Start,
};
use stepped::SteppedField;
use varying::Varying;

/// What drives the field: temperatures against time, the pack being in a steady state before the first knot.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// The temperature at the heat path's [`Location`] \[K\].
    pub boundary_k: PiecewiseLinear,
    /// The ambient's, where it is known apart from the boundary \[K\].
    pub ambient_k: Option<PiecewiseLinear>,
}

impl Drive {
    /// One temperature, at the place that [`Location`] says.
    pub fn boundary(boundary_k: PiecewiseLinear) -> Self {
        Self { boundary_k, ambient_k: None }
    }

    pub(crate) fn ambient_k(&self) -> &PiecewiseLinear {
        self.ambient_k.as_ref().unwrap_or(&self.boundary_k)
    }

    pub(crate) fn start_s(&self) -> f64 {
        self.boundary_k.knots()[0]
    }

    /// With the ramp that ended where it begins.
    fn after(&self, start: &Start) -> Self {
        Self {
            boundary_k: start.before(&self.boundary_k),
            ambient_k: self.ambient_k.as_ref().map(|ambient_k| start.before(ambient_k)),
        }
    }
}

/// A part of the heat path that not every pack can have.
#[derive(Debug, Error, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum HeatPart {
    #[error("a film or an ambient sensor")]
    AmbientSensor,
    #[error("the film at the outer surface")]
    Film,
    #[error("the spool's heat capacity")]
    Spool,
    #[error("heat from the bore")]
    BoreHeat,
    #[error("a flange that exchanges heat")]
    Flange,
    #[error("a contact between layers")]
    Gap,
    #[error("a housing")]
    Housing,
    #[error("a start at which parts differ in temperature")]
    UnevenStart,
    #[error("a spool that conducts along its axis beside a conductivity that depends on temperature")]
    JoinedVarying,
    #[error("a start at which parts differ in temperature beside a conductivity that depends on temperature")]
    UnevenStartVarying,
    #[error("a sensor on a spool beside a spool that conducts along its axis, where it has no single temperature,")]
    SensorAlong,
    #[error("a conductivity that depends on temperature")]
    VaryingConductivity,
    #[error("a conductivity that depends on temperature, beside a flange that exchanges heat,")]
    VaryingConductivityBesideFlange,
}

/// Why a heat path cannot be solved.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum ThermalError {
    #[error(
        "{part} needs a pack that ends somewhere: set thermal.model = \"pack\", or add the effect that ends the pack"
    )]
    NeedsPack { part: HeatPart },
    #[error(
        "{part} needs thermal.conductivity_w_per_m_k and thermal.volumetric_heat_capacity_j_per_m3_k, found only thermal.diffusivity_m2_per_s"
    )]
    NeedsConductivity { part: HeatPart },
    #[error("cells per layer must be at least 1, found {found}")]
    Cells { found: usize },
    #[error("a contact between layers must lie above one of the layers 1 to {most}, found above layer {found}")]
    Gap { found: usize, most: usize },
    #[error(
        "the thermal operator's eigenvalues did not converge: check that all thermal values are of a physical size"
    )]
    Eigen,
    #[error(
        "the conductivity at {temperature_k:.1} K is not positive: the slope {slope_per_k} per K is too steep for this record or profile"
    )]
    ConductivityNotPositive { temperature_k: f64, slope_per_k: f64 },
    #[error(
        "the sensor is on {on}, which is not there: declare the effect that puts it into the heat's way, or move the sensor"
    )]
    NothingThere { on: &'static str },
    #[error(
        "with the sensor on {on}, the air reaches the coil through a film: add an [[effect]] of kind = \"surface_film\""
    )]
    NeedsFilm { on: &'static str },
    #[error("{part} cannot be solved: remove one of them")]
    Together { part: HeatPart },
    #[error("{part} makes the field nonlinear: it has no step response")]
    Nonlinear { part: HeatPart },
}

/// The response of every layer's rate to a unit step of the boundary's rate at t = 0.
#[derive(Debug, Clone)]
pub enum StepResponse {
    /// In closed form.
    HalfSpace(half_space::HalfSpace),
    /// By its modes.
    Pack(Box<Pack>),
}

impl StepResponse {
    /// # Errors
    /// Heat paths that are nonlinear, or that lack what they need.
    pub fn of(path: &HeatPath) -> Result<Self, ThermalError> {
        check(path)?;
        if path.conductivity_slope_per_k != 0.0 {
            return Err(ThermalError::Nonlinear { part: HeatPart::VaryingConductivity });
        }
        Ok(match path.extent {
            Extent::HalfSpace => StepResponse::HalfSpace(half_space::HalfSpace::new(path)),
            Extent::Pack => StepResponse::Pack(Box::new(Pack::new(path)?)),
        })
    }

    /// Ṫ_j/k0 at `time_s` ≥ 0 after the step (the right limit at 0), written to `layers`.
    pub fn rates(&self, time_s: f64, layers: &mut [f64]) {
        match self {
            StepResponse::HalfSpace(half_space) => half_space.step_rates(time_s, layers),
            StepResponse::Pack(pack) => pack.step_rates(time_s, layers),
        }
    }

    /// A time after which the response no longer changes, or after which it follows its power-law tail.
    pub fn settling_s(&self) -> f64 {
        match self {
            StepResponse::HalfSpace(half_space) => half_space.settling_s(),
            StepResponse::Pack(pack) => pack.settling_s(),
        }
    }

    /// The shortest time on which the response changes: that of the thinnest cell or spacing.
    pub(crate) fn shortest_s(&self) -> f64 {
        match self {
            StepResponse::HalfSpace(half_space) => half_space.shortest_s(),
            StepResponse::Pack(pack) => pack.shortest_s(),
        }
    }
}

/// The temperature field under one drive.
#[derive(Debug, Clone)]
pub enum Field {
    /// In closed form.
    HalfSpace(HalfSpaceField),
    /// By its modes.
    Pack(Box<PackField>),
    /// The modes with what a conductivity that depends on temperature adds.
    Stepped(Box<SteppedField>),
}

/// Solves a heat path under a drive.
///
/// # Errors
/// A heat path whose parts contradict each other or lack a material property.
pub fn solve(path: &HeatPath, drive: &Drive) -> Result<Field, ThermalError> {
    Solver::new(path)?.field(drive)
}

/// A heat path ready for any number of drives, which share what does not depend on them.
#[derive(Debug, Clone)]
pub(crate) struct Solver {
    path: HeatPath,
    /// Of a pack that is linear.
    pack: Option<Arc<Prepared>>,
    /// Of one that is not.
    varying: Arc<Varying>,
}

impl Solver {
    /// # Errors
    /// As [`solve`].
    pub(crate) fn new(path: &HeatPath) -> Result<Self, ThermalError> {
        check(path)?;
        let is_modal = path.extent == Extent::Pack && path.conductivity_slope_per_k == 0.0;
        let pack = is_modal.then(|| Ok(Arc::new(Prepared::new(Pack::new(path)?)))).transpose()?;
        Ok(Self { path: path.clone(), pack, varying: Arc::default() })
    }

    pub(crate) fn path(&self) -> &HeatPath {
        &self.path
    }

    /// # Errors
    /// A conductivity that does not stay positive under the drive.
    pub(crate) fn field(&self, drive: &Drive) -> Result<Field, ThermalError> {
        let path = &self.path;
        if let Some(pack) = &self.pack {
            return Ok(Field::Pack(Box::new(PackField::new(Arc::clone(pack), drive))));
        }
        Ok(match path.extent {
            Extent::HalfSpace => {
                let boundary = &drive.boundary_k;
                let boundary_k = path.start.map_or_else(|| boundary.clone(), |start| start.before(boundary));
                let drive = Drive { boundary_k, ambient_k: drive.ambient_k.clone() };
                Field::HalfSpace(HalfSpaceField::new(half_space::HalfSpace::new(path), &drive))
            }
            Extent::Pack => Field::Stepped(Box::new(SteppedField::new(path, &self.varying, drive)?)),
        })
    }
}

/// Which columns of a history are wanted; the others stay empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WantedColumns {
    All,
    Rates,
    Temperatures,
}

impl WantedColumns {
    fn rates(self) -> bool {
        self != WantedColumns::Temperatures
    }

    fn temperatures(self) -> bool {
        self != WantedColumns::Rates
    }
}

impl Field {
    /// The field at given instants.
    pub fn at(&self, instants: &[Instant]) -> ThermalHistory {
        self.sample(instants, WantedColumns::All)
    }

    /// As [`Field::at`] without the temperatures, which stay empty: half the work.
    pub fn rates_at(&self, instants: &[Instant]) -> ThermalHistory {
        self.sample(instants, WantedColumns::Rates)
    }

    fn sample(&self, instants: &[Instant], wanted: WantedColumns) -> ThermalHistory {
        match self {
            Field::HalfSpace(field) => field.at(instants, wanted),
            Field::Pack(field) => field.at(instants, wanted),
            Field::Stepped(field) => field.at(instants, wanted),
        }
    }

    /// The mean over the window that ends at each time: what a logger that averages sees.
    ///
    /// A layer's mean rate over a window is exactly its change of temperature over the window; its temperature is
    /// taken as the mean of both ends. The same holds for axial moments. A window of zero gives the instants themselves.
    pub fn means(&self, ends_s: &[f64], window_s: f64) -> ThermalHistory {
        let (instants, places) = window_instants(ends_s, window_s);
        if window_s <= 0.0 {
            return self.at(&instants);
        }
        let at = self.sample(&instants, WantedColumns::Temperatures);
        let over = |values: &[f64], columns: usize, f: fn(f64, f64) -> f64| -> Vec<f64> {
            if values.is_empty() {
                return Vec::new();
            }
            let mut out = Vec::with_capacity(places.len() * columns);
            for &place in &places {
                let (start, end) = values[(place - 1) * columns..(place + 1) * columns].split_at(columns);
                out.extend(start.iter().zip(end).map(|(a, b)| f(*a, *b)));
            }
            out
        };
        let middle = |a: f64, b: f64| 0.5 * (a + b);
        let change = |values: &[f64], columns: usize| {
            let mut changes = over(values, columns, |a, b| b - a);
            changes.iter_mut().for_each(|c| *c /= window_s);
            changes
        };
        ThermalHistory {
            layers: at.layers,
            times_s: ends_s.to_vec(),
            temperature_k: over(&at.temperature_k, at.layers, middle),
            rate_k_per_s: change(&at.temperature_k, at.layers),
            axial_moment_k: over(&at.axial_moment_k, at.layers, middle),
            axial_moment_k_per_s: change(&at.axial_moment_k, at.layers),
            ambient_k: over(&at.ambient_k, 1, middle),
            ambient_rate_k_per_s: change(&at.ambient_k, 1),
        }
    }
}

/// The instants between which windows lie, and of each window the place of its end; a beginning stands before its end.
/// A window of zero is one instant.
fn window_instants(ends_s: &[f64], window_s: f64) -> (Vec<Instant>, Vec<usize>) {
    if window_s <= 0.0 {
        return (ends_s.iter().map(|&t| Instant::after(t)).collect(), (0..ends_s.len()).collect());
    }
    // Where a window begins at the end of the one before, one instant serves both.
    let joined = |row: usize| row > 0 && (ends_s[row] - window_s - ends_s[row - 1]).abs() <= 1e-9 * window_s;
    let mut instants = Vec::with_capacity(2 * ends_s.len());
    let places = ends_s
        .iter()
        .enumerate()
        .map(|(row, &end_s)| {
            if !joined(row) {
                // Temperatures are continuous; just before a knot the fast modes are over.
                instants.push(Instant::before(end_s - window_s));
            }
            instants.push(Instant::before(end_s));
            instants.len() - 1
        })
        .collect();
    (instants, places)
}

fn push_ambient(history: &mut ThermalHistory, drive: &Drive, instant: Instant) {
    let ambient = drive.ambient_k();
    history.ambient_k.push(ambient.value(instant.time_s));
    history.ambient_rate_k_per_s.push(match instant.side {
        Side::Before => ambient.slope_before(instant.time_s),
        Side::After => ambient.slope_after(instant.time_s),
    });
}
