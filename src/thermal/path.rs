//! What the heat flows through, from the drive to the bore, as effects edit it.

use crate::coil::Coil;
use crate::numeric::piecewise::PiecewiseLinear;

/// What the pack is made of, thermally.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PackMaterial {
    /// Only K = k/ρc is known; effects that exchange heat with something else need both.
    Diffusivity {
        /// K = k/ρc.
        m2_per_s: f64,
    },
    /// Both are known.
    Conductivity {
        /// k.
        w_per_m_k: f64,
        /// ρc.
        heat_capacity_j_per_m3_k: f64,
    },
}

impl PackMaterial {
    pub(crate) fn diffusivity_m2_per_s(&self) -> f64 {
        match *self {
            PackMaterial::Diffusivity { m2_per_s } => m2_per_s,
            PackMaterial::Conductivity { w_per_m_k, heat_capacity_j_per_m3_k } => w_per_m_k / heat_capacity_j_per_m3_k,
        }
    }

    /// The same material conducting `factor` times as well.
    pub(crate) fn scaled(self, factor: f64) -> Self {
        match self {
            PackMaterial::Diffusivity { m2_per_s } => PackMaterial::Diffusivity { m2_per_s: m2_per_s * factor },
            PackMaterial::Conductivity { w_per_m_k, heat_capacity_j_per_m3_k } => {
                PackMaterial::Conductivity { w_per_m_k: w_per_m_k * factor, heat_capacity_j_per_m3_k }
            }
        }
    }
}

/// Where the pack ends inwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// Nowhere: the paper's half space behind the outermost layer.
    HalfSpace,
    /// At an adiabatic bore (unless a spool is there), in cylindrical coordinates.
    Pack,
}

/// What the driving temperature is the temperature of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Location {
    /// The outermost layer itself.
    OuterLayer,
    /// The air outside the film; without a film, what it would cover: the outermost housing, or the pack's outer surface.
    Ambient,
    /// A housing by its place; what lies outside it no longer matters.
    Housing(usize),
    /// The lumped spool at the bore.
    Spool,
    /// A spool's flange.
    Flange(Flange),
}

/// A lumped spool behind a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spool {
    /// Per bore area.
    pub heat_capacity_j_per_m2_k: f64,
    /// Between the spool and the pack.
    pub contact_w_per_m2_k: f64,
    /// From the spool to the ambient.
    pub mount_w_per_m2_k: f64,
}

/// The spool's metal, where it conducts along the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpoolWall {
    /// k of the metal.
    pub conductivity_w_per_m_k: f64,
    /// Of the wall, radially.
    pub thickness_m: f64,
}

/// A flange of the spool: one temperature, in contact with the pack's face, open to what surrounds the coil.
///
/// All per area of the pack's face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpoolFlange {
    /// Which of the two.
    pub flange: Flange,
    /// Of the flange.
    pub heat_capacity_j_per_m2_k: f64,
    /// Between the flange and the pack.
    pub contact_w_per_m2_k: f64,
    /// Between the flange and the ambient.
    pub film_w_per_m2_k: f64,
}

/// A housing or shield around the coil: one temperature, and what joins it to what lies inside it.
///
/// Per area of the pack's outer surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Housing {
    /// Counted from 0 at the coil outwards; some may be missing.
    pub place: usize,
    /// Of the housing.
    pub heat_capacity_j_per_m2_k: f64,
    /// Across the gap inside it.
    pub gap_w_per_m2_k: f64,
}

/// A start that is not steady: by how much parts are warmer than the drive, and a ramp that ends there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// The pack, evenly.
    pub pack_above_k: f64,
    /// The spool, where there is one.
    pub spool_above_k: f64,
    /// All housings.
    pub housing_above_k: f64,
    /// Rate of the drive before the start, for how long.
    pub rate_k_per_s: f64,
    /// Duration of that ramp; above 0.
    pub lasted_s: f64,
}

impl Start {
    /// Whether anything is warmer or colder than the drive.
    pub(crate) fn is_uneven(&self) -> bool {
        self.pack_above_k != 0.0 || self.spool_above_k != 0.0 || self.housing_above_k != 0.0
    }

    /// A course with the ramp before its start.
    pub(crate) fn before(&self, course: &PiecewiseLinear) -> PiecewiseLinear {
        let (first_s, first_k) = (course.knots()[0], course.first_value());
        let knots = std::iter::once(first_s - self.lasted_s).chain(course.knots().iter().copied()).collect();
        let begun_k = first_k - self.rate_k_per_s * self.lasted_s;
        let values = std::iter::once(begun_k).chain(course.values().iter().copied()).collect();
        PiecewiseLinear::new(knots, values).unwrap_or_else(|_| course.clone())
    }
}

/// Heat into the bore after power-on at the drive's first knot: q∞ (1 − e^{−t/τ}).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoreHeat {
    pub(crate) power_w_per_m2: f64,
    pub(crate) time_constant_s: f64,
}

/// Which flange: layer 1 starts at the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flange {
    /// At ζ = −½.
    First,
    /// At ζ = +½.
    Second,
}

/// A flange that exchanges heat with the ambient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlangeFilm {
    /// Which of the two faces.
    pub flange: Flange,
    /// Between that face and the ambient.
    pub film_w_per_m2_k: f64,
}

/// The pack's dimensions as far as heat is concerned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PackShape {
    /// How many there are.
    pub layers: usize,
    /// From the coil's axis to the pack's inner face.
    pub bore_radius_m: f64,
    /// From one layer's middle to the next.
    pub radial_pitch_m: f64,
    /// Along the axis.
    pub height_m: f64,
}

impl PackShape {
    pub(crate) fn of(coil: &Coil) -> Self {
        Self {
            layers: coil.layers(),
            bore_radius_m: coil.bore_radius_m(),
            radial_pitch_m: coil.radial_pitch_m(),
            height_m: coil.height_m(),
        }
    }
}

/// Everything that the heat flows through, from the drive to the bore.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatPath {
    /// Where its layers are.
    pub shape: PackShape,
    /// Where the pack ends inwards.
    pub extent: Extent,
    /// Of the pack, effective.
    pub material: PackMaterial,
    /// Where the driving temperature is.
    pub location: Location,
    /// At the outer surface; only used where the drive is the ambient.
    pub film_w_per_m2_k: Option<f64>,
    /// At the bore.
    pub spool: Option<Spool>,
    /// None: the spool is one lump at every place of the axis.
    pub spool_wall: Option<SpoolWall>,
    /// At most one of each.
    pub spool_flanges: Vec<SpoolFlange>,
    /// Between the coil and the air, from the coil outwards.
    pub housings: Vec<Housing>,
    /// None: steady before the drive's first knot.
    pub start: Option<Start>,
    /// None: the bore is adiabatic or behind a spool.
    pub bore_heat: Option<BoreHeat>,
    /// None: both faces are adiabatic or behind flanges.
    pub flange: Option<FlangeFilm>,
    /// Of the other flange, where that exchanges heat too.
    pub opposite_flange: Option<FlangeFilm>,
    /// a in k = k0 (1 + a (T − 20 °C)).
    pub conductivity_slope_per_k: f64,
    /// Places where layers touch less well than the pack conducts.
    pub gaps: Vec<LayerGap>,
    /// How fine the grid is: the elements at the surface are half a layer over this number, and of a higher order.
    pub cells_per_layer: usize,
}

/// A contact between two layers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayerGap {
    /// Layers inside it.
    pub(crate) above_layer: usize,
    pub(crate) conductance_w_per_m2_k: f64,
}

/// A grid that puts guaranteed and worst rates within a few millionths of the continuum (`tests/validation/pack.rs`).
pub const DEFAULT_CELLS_PER_LAYER: usize = 1;

impl HeatPath {
    /// Without anything around the pack.
    pub fn new(shape: PackShape, extent: Extent, material: PackMaterial, location: Location) -> Self {
        Self {
            shape,
            extent,
            material,
            location,
            film_w_per_m2_k: None,
            spool: None,
            spool_wall: None,
            spool_flanges: Vec::new(),
            housings: Vec::new(),
            start: None,
            bore_heat: None,
            flange: None,
            opposite_flange: None,
            conductivity_slope_per_k: 0.0,
            gaps: Vec::new(),
            cells_per_layer: DEFAULT_CELLS_PER_LAYER,
        }
    }

    /// Whether something changes the field that no drive does: heat from the bore, a start that is not steady.
    pub(crate) fn has_own_course(&self) -> bool {
        self.bore_heat.is_some() || self.start.is_some()
    }

    /// As the drive alone moves it.
    pub(crate) fn driven_only(&self) -> Self {
        Self { bore_heat: None, start: None, ..self.clone() }
    }

    /// The time constant of what changes by itself, beside the pack's own.
    pub(crate) fn own_course_s(&self) -> f64 {
        self.bore_heat.map_or(0.0, |heat| heat.time_constant_s)
    }

    /// The housings whose temperature is to be found, and what then joins the outermost of them (or the pack) to the drive;
    /// None where the drive is the surface itself.
    pub(crate) fn enclosure(&self) -> (&[Housing], Option<f64>) {
        let inside = |count: usize| (&self.housings[..count], Some(self.housings[count].gap_w_per_m2_k));
        match self.location {
            Location::OuterLayer => (&[], None),
            Location::Housing(place) => match self.housings.iter().position(|housing| housing.place == place) {
                Some(index) => inside(index),
                None => (&self.housings, self.film_w_per_m2_k),
            },
            _ if self.film_w_per_m2_k.is_none() && !self.housings.is_empty() => inside(self.housings.len() - 1),
            _ => (&self.housings, self.film_w_per_m2_k),
        }
    }

    /// The part that carries the sensor, where that is neither the air nor the coil itself.
    pub(crate) fn sensors_part(&self) -> Option<Location> {
        match self.location {
            Location::OuterLayer | Location::Ambient => None,
            part => Some(part),
        }
    }

    /// Whether nothing says how fast what the sensor sits on follows the air: the film is not stated, or lies behind a prescribed layer.
    pub(crate) fn film_is_unknown(&self) -> bool {
        self.location == Location::OuterLayer || (self.sensors_part().is_some() && self.film_w_per_m2_k.is_none())
    }

    /// Whether parts meet that do not share the modes of the axis: one temperature of a flange or a housing faces all places.
    pub(crate) fn is_joined(&self) -> bool {
        let along = self.spool_wall.is_some() || !self.enclosure().0.is_empty();
        !self.spool_flanges.is_empty() || (self.flange.is_some() && along)
    }

    /// Whether temperature varies along the axis.
    pub(crate) fn varies_along(&self) -> bool {
        self.flange.is_some() || !self.spool_flanges.is_empty()
    }

    /// What lies between the drive and the first layer that does not touch it.
    pub(crate) fn untouched_m(&self) -> f64 {
        self.shape.radial_pitch_m * if self.location == Location::OuterLayer { 0.5 } else { 1.0 }
    }
}
