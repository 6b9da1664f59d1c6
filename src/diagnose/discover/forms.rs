//! The forms that a term may have, what each is likely to be, and where its inner numbers are looked for first.

/// What kind of thing a variable is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Class {
    Temperature,
    Difference,
    Rate,
    Column,
    /// A column less its mean.
    Centred,
    Time,
}

/// A variable as it stands in a formula.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FormulaVariable {
    /// With parentheses where it is a sum.
    pub(crate) text: String,
    /// The names of which it is made.
    pub(crate) name: String,
    pub(crate) class: Class,
    pub(crate) unit: String,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl FormulaVariable {
    /// How far it goes from its middle: that is free for a column.
    pub(crate) fn reach(&self) -> f64 {
        if self.class == Column { 0.5 * (self.high - self.low) } else { self.low.abs().max(self.high.abs()) }
    }
}

/// A number within a form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Inner {
    TimeConstant,
    HalfWidth,
    Knee,
    At,
    Width,
}

impl Inner {
    pub(crate) fn key(self) -> &'static str {
        match self {
            Inner::TimeConstant => "tau_s",
            Inner::HalfWidth => "half_width",
            Inner::Knee => "knee",
            Inner::At => "at",
            Inner::Width => "width",
        }
    }

    /// Whether it is a size, which is refined by its logarithm.
    pub(crate) fn is_size(self) -> bool {
        self != Inner::At
    }

    /// Where to look for it first.
    pub(crate) fn grid(self, x: &FormulaVariable, longest_s: f64) -> Vec<f64> {
        let range = x.high - x.low;
        match self {
            Inner::TimeConstant => spaced(40.0, longest_s.max(80.0), 12),
            Inner::HalfWidth => spaced(0.02 * range, 0.4 * range, 8),
            Inner::Knee => spaced(0.05 * x.reach(), x.reach(), 6),
            Inner::At => [0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9].iter().map(|q| x.low + q * range).collect(),
            Inner::Width => vec![0.03 * range, 0.1 * range],
        }
    }
}

fn spaced(from: f64, to: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| from * (to / from).powf(i as f64 / (count - 1) as f64)).collect()
}

/// One shape of a term.
#[derive(Debug)]
pub(crate) struct Form {
    pub(crate) key: &'static str,
    /// With {x}, {y} for variables and the keys of inner numbers.
    pub(crate) template: &'static str,
    pub(crate) inner: &'static [Inner],
    pub(crate) of: &'static [Class],
    /// The second factor of a product.
    pub(crate) with: &'static [Class],
    /// In plain words: what such a term is likely to be.
    pub(crate) reading: &'static str,
    /// Where that is said; None where it is a guess.
    pub(crate) source: Option<&'static str>,
}

use Class::{Centred, Column, Difference, Rate, Temperature, Time};
use Inner::{At, HalfWidth, Knee, TimeConstant, Width};

const FRICTION: &str =
    "play: friction or slip between coil and spool, or between layers; the rate depends on whence the temperature came";
const RELAXATION: &str = "a relaxation: potting or coating that creeps after a change of temperature and settles";
const SQUARE: &str = "the square of a current: Joule heating, or the magnetic field of a pair of leads; it does not know the current's sign";
const SIZE: &str = "the size of a current or flow, whichever its sign: heating by a bridge or a fan";
const THRESHOLD: &str = "a threshold: a transition of a polymer, condensation, or a regulator that sets in";
const SATURATION: &str = "saturates: slip beyond a limit of friction, an amplifier or a regulator at its limit";
const LAG: &str = "a lagged input: a shield, a housing or a mass that follows it";
const CREEP_SOURCE: Option<&str> =
    Some("Ferry, Viscoelastic Properties of Polymers (1980), chapter 1: stress relaxation of a polymer after a step");
const PLAY_SOURCE: Option<&str> =
    Some("Krasnosel'skii and Pokrovskii, Systems with Hysteresis (1989): the play operator of dry friction");
const GLASS_SOURCE: Option<&str> =
    Some("Ferry, Viscoelastic Properties of Polymers (1980), chapter 11: softening at a transition");

/// Every form that is tried; the simplest of equals comes first.
pub(crate) const FORMS: &[Form] = &[
    form(
        "linear",
        "{x}",
        &[],
        &[Difference, Rate],
        "linear in a temperature difference or a rate: a stress that follows it",
        None,
    ),
    form(
        "square",
        "{x}^2",
        &[],
        &[Temperature, Difference, Rate],
        "a stress or an expansion that grows with the square",
        None,
    ),
    form(
        "square",
        "{x}^2",
        &[],
        &[Column, Centred],
        SQUARE,
        Some("Joule's law; the field of a pair of leads by Biot and Savart"),
    ),
    form(
        "cubic",
        "{x}^3",
        &[],
        &[Temperature, Difference, Rate, Centred],
        "an expansion or a dn/dT with a higher term",
        None,
    ),
    form(
        "size",
        "abs({x})",
        &[],
        &[Difference, Rate],
        "the same for both signs of a rate: friction, or a second-order stress",
        None,
    ),
    form("size", "abs({x})", &[], &[Column, Centred], SIZE, None),
    form(
        "signed_square",
        "{x}*abs({x})",
        &[],
        &[Difference, Rate, Column, Centred],
        "grows with the square and keeps its sign: turbulent flow, a nonlinear stress",
        None,
    ),
    form(
        "one_sided",
        "max({x}, 0)",
        &[],
        &[Difference, Rate],
        "acts in one direction only: a contact that opens, a valve",
        None,
    ),
    form(
        "one_sided",
        "max(-{x}, 0)",
        &[],
        &[Difference, Rate],
        "acts in one direction only: a contact that opens, a valve",
        None,
    ),
    form("saturation", "tanh({x}/knee)", &[Knee], &[Difference, Rate], SATURATION, None),
    // A difference or a rate is nothing in the middle; where the middle of a column is, nobody knows.
    form("saturation", "tanh(({x} - at)/knee)", &[At, Knee], &[Column], SATURATION, None),
    form("threshold", "max({x} - at, 0)", &[At], &[Temperature, Column], THRESHOLD, None),
    form("threshold", "max(at - {x}, 0)", &[At], &[Temperature, Column], THRESHOLD, None),
    form(
        "softening",
        "width*softplus(({x} - at)/width)",
        &[At, Width],
        &[Temperature, Column],
        "a threshold that sets in gradually: a polymer that softens above a transition",
        GLASS_SOURCE,
    ),
    form(
        "softening",
        "width*softplus((at - {x})/width)",
        &[At, Width],
        &[Temperature, Column],
        "a threshold that sets in gradually: a polymer that stiffens below a transition",
        GLASS_SOURCE,
    ),
    // The lag of a temperature's rate is the temperature's relaxation, but for a factor of tau.
    form("lagged", "lag({x}, tau_s)", &[TimeConstant], &[Difference, Column], LAG, None),
    form("relaxation", "{x} - lag({x}, tau_s)", &[TimeConstant], &[Temperature], RELAXATION, CREEP_SOURCE),
    form(
        "relaxation",
        "{x} - lag({x}, tau_s)",
        &[TimeConstant],
        &[Column],
        "passes changes of a column and forgets its level: a coupling through a capacity",
        None,
    ),
    form(
        "one_sided_relaxation",
        "max({x} - lag({x}, tau_s), 0)",
        &[TimeConstant],
        &[Temperature],
        RELAXATION,
        CREEP_SOURCE,
    ),
    form(
        "one_sided_relaxation",
        "max(lag({x}, tau_s) - {x}, 0)",
        &[TimeConstant],
        &[Temperature],
        RELAXATION,
        CREEP_SOURCE,
    ),
    form("lagged_size", "lag(abs({x}), tau_s)", &[TimeConstant], &[Rate, Column, Centred], SIZE, None),
    form(
        "lagged_square",
        "lag({x}^2, tau_s)",
        &[TimeConstant],
        &[Column, Centred],
        SQUARE,
        Some("Joule's law, into a mass that warms"),
    ),
    form("hysteresis", "play({x}, half_width) - {x}", &[HalfWidth], &[Temperature, Column], FRICTION, PLAY_SOURCE),
    Form {
        with: &[Temperature],
        ..form(
            "product",
            "{x}*{y}",
            &[],
            &[Rate, Difference],
            "a rate or gradient times a temperature: an expansion or stress that depends on temperature",
            None,
        )
    },
    Form {
        with: &[Temperature, Difference, Rate, Column],
        ..form(
            "product",
            "{x}*{y}",
            &[],
            &[Column, Centred],
            "a column that acts together with another quantity: its effect depends on temperature or on the other column",
            None,
        )
    },
    form(
        "settling",
        "ln(1 + t/tau_s)",
        &[TimeConstant],
        &[Time],
        "settling since switch-on: ageing or warming up that slows down with the logarithm of time",
        CREEP_SOURCE,
    ),
    form("decay", "exp(-t/tau_s)", &[TimeConstant], &[Time], "a start that decays: warming up after switch-on", None),
    form("drift", "t", &[], &[Time], "a drift in time", None),
];

const fn form(
    key: &'static str,
    template: &'static str,
    inner: &'static [Inner],
    of: &'static [Class],
    reading: &'static str,
    source: Option<&'static str>,
) -> Form {
    Form { key, template, inner, of, with: &[], reading, source }
}
