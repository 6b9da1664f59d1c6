//! What an unlisted effect may look like: forms of variables, each a formula with an amplitude and at most two inner numbers.
//!
//! ```text
//! rate = … + a · form(x; inner numbers),   x a temperature, a difference, a rate of temperature, a further column, or time
//! ```
//!
//! Every candidate is a text of [`crate::effect::custom`]: what is found can be declared as it stands.

use crate::effect::custom::Formula;
use crate::numeric::expression::{Expression, Memory};

use super::courses::Courses;
pub(crate) use super::forms::{Class, FORMS, Form, FormulaVariable, Inner};
use Class::{Centred, Column, Difference, Rate, Temperature, Time};
use Inner::{At, HalfWidth, Knee, TimeConstant, Width};

/// A form of certain variables: candidates that differ in their inner numbers only.
#[derive(Debug, Clone)]
pub(crate) struct Family {
    pub(crate) form: &'static Form,
    pub(crate) x: FormulaVariable,
    pub(crate) y: Option<FormulaVariable>,
    /// Without the amplitude.
    pub(crate) text: String,
    expression: Expression,
}

/// A term: a family with its inner numbers.
#[derive(Debug, Clone)]
pub(crate) struct Term {
    pub(crate) family: Family,
    pub(crate) inner: Vec<f64>,
}

/// Centres of temperatures [°C].
const REFERENCE_C: f64 = 20.0;

/// The variables of a set of records.
pub(crate) fn variables(courses: &Courses) -> Vec<FormulaVariable> {
    let mut all = Vec::new();
    let mut add = |text: &str, name: &str, class, unit: &str, shift: f64| {
        let Some((low, high)) = courses.range(name) else { return };
        if high - low > 1e-9 * high.abs().max(low.abs()) {
            let (low, high) = (low - shift, high - shift);
            let (text, name, unit) = (text.to_owned(), name.to_owned(), unit.to_owned());
            all.push(FormulaVariable { text, name, class, unit, low, high });
        }
    };
    for name in ["T_mean", "T_in", "T"] {
        add(name, name, Temperature, "K", 0.0);
    }
    add("(T - T_in)", "T - T_in", Difference, "K", 0.0);
    for name in ["mean_rate", "dT_dt"] {
        add(name, name, Rate, "K/s", 0.0);
    }
    // A column that is called as a number of some form cannot stand in a formula beside it.
    let taken = |name: &str| name == "a" || FORMS.iter().any(|f| f.inner.iter().any(|i| i.key() == name));
    for (name, mean) in courses.columns().into_iter().filter(|(name, _)| !taken(name)) {
        let unit = format!("unit of {name}");
        add(&name, &name, Column, &unit, 0.0);
        let centre = rounded(mean);
        if centre != 0.0 {
            let sign = if centre < 0.0 { "+" } else { "-" };
            add(&format!("({name} {sign} {})", centre.abs()), &name, Centred, &unit, centre);
        }
    }
    add("t", "t", Time, "s", 0.0);
    all
}

/// To three digits: a centre is a convenience, its last digits say nothing.
fn rounded(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return 0.0;
    }
    let scale = 10f64.powi(2 - value.abs().log10().floor() as i32);
    (value * scale).round() / scale
}

/// What may be restricted.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Allowed {
    /// Keys of forms and names of variables; empty: all.
    pub(crate) words: Vec<String>,
}

impl Allowed {
    /// All words that mean something for some records.
    pub(crate) fn known(channels: &[String]) -> Vec<String> {
        let mut all: Vec<String> = FORMS.iter().map(|f| f.key.to_owned()).collect();
        all.extend(["T_mean", "T_in", "T", "mean_rate", "dT_dt", "t"].map(str::to_owned));
        all.extend(channels.iter().cloned());
        all.dedup();
        all
    }

    fn admits(&self, family: &Family) -> bool {
        let is_form = |word: &String| FORMS.iter().any(|f| f.key == word);
        let forms: Vec<&String> = self.words.iter().filter(|w| is_form(w)).collect();
        let names: Vec<&String> = self.words.iter().filter(|w| !is_form(w)).collect();
        (forms.is_empty() || forms.iter().any(|f| *f == family.form.key))
            && (names.is_empty() || family.variables().iter().all(|v| names.contains(&v)))
    }
}

/// All families of some variables.
pub(crate) fn families(variables: &[FormulaVariable], allowed: &Allowed) -> Vec<Family> {
    let mut all: Vec<Family> = Vec::new();
    for form in FORMS {
        for (place, x) in variables.iter().enumerate().filter(|(_, v)| form.of.contains(&v.class)) {
            if form.with.is_empty() {
                all.extend(Family::new(form, x, None));
            }
            for (other, y) in variables.iter().enumerate().filter(|(_, v)| form.with.contains(&v.class)) {
                // Two columns are multiplied once.
                if x.name != y.name && (y.class != Column || other > place) && x.class != Centred {
                    all.extend(Family::new(form, x, Some(y)));
                }
            }
        }
    }
    all.retain(|family| allowed.admits(family));
    all
}

impl Family {
    fn new(form: &'static Form, x: &FormulaVariable, y: Option<&FormulaVariable>) -> Option<Self> {
        // The size of what never changes its sign is that itself, for which there is a plainer form.
        if form.template.contains("abs({x})") && (x.low >= 0.0 || x.high <= 0.0) {
            return None;
        }
        // Powers and products of a temperature are counted from 20 °C, what remembers and thresholds as it is read.
        let shifted = form.inner.is_empty();
        let text_of = |v: &FormulaVariable| match v.class {
            Temperature if shifted => format!("({} - {REFERENCE_C})", v.text),
            _ => v.text.clone(),
        };
        let mut text = form.template.replace("{x}", &text_of(x));
        if let Some(y) = y {
            text = text.replace("{y}", &text_of(y));
        }
        let expression = Expression::parse(&text).ok()?;
        Some(Self { form, x: x.clone(), y: y.cloned(), text, expression })
    }

    /// The names that it reads, without its inner numbers.
    pub(crate) fn variables(&self) -> Vec<String> {
        let own = self.expression.variables().iter().map(|v| v.name.clone());
        own.filter(|name| !self.form.inner.iter().any(|i| i.key() == name)).collect()
    }

    /// Points of the grid of its inner numbers.
    pub(crate) fn grid(&self, longest_s: f64) -> Vec<Vec<f64>> {
        let mut points = vec![Vec::new()];
        for inner in self.form.inner {
            let values = inner.grid(&self.x, longest_s);
            points = points
                .iter()
                .flat_map(|point: &Vec<f64>| {
                    values.iter().map(move |v| point.iter().copied().chain([*v]).collect::<Vec<f64>>())
                })
                .collect();
        }
        points
    }

    /// Bounds of an inner number.
    pub(crate) fn bounds(&self, place: usize, longest_s: f64) -> (f64, f64) {
        let range = self.x.high - self.x.low;
        match self.form.inner[place] {
            TimeConstant => (10.0, 3.0 * longest_s),
            HalfWidth => (0.005 * range, 0.5 * range),
            Knee => (0.01 * self.x.reach(), 5.0 * self.x.reach()),
            At => (self.x.low, self.x.high),
            Width => (0.003 * range, 0.3 * range),
        }
    }

    /// Whether it reads a temperature of the pack, a rate or a difference.
    pub(crate) fn is_of_coil(&self) -> bool {
        std::iter::once(&self.x).chain(&self.y).any(|v| matches!(v.class, Temperature | Difference | Rate))
    }

    /// Whether it depends on nothing but time.
    pub(crate) fn is_of_time_alone(&self) -> bool {
        self.x.class == Time
    }

    /// The unit of the form's value.
    pub(crate) fn unit(&self) -> String {
        let x = &self.x.unit;
        match (self.form.key, &self.y) {
            (_, Some(y)) => format!("({x})·({})", y.unit),
            ("square" | "signed_square" | "lagged_square", _) => format!("({x})²"),
            ("cubic", _) => format!("({x})³"),
            ("saturation" | "settling" | "decay", _) => "1".to_owned(),
            _ => x.clone(),
        }
    }

    pub(crate) fn inner_unit(&self, place: usize) -> String {
        match self.form.inner[place] {
            TimeConstant => "s".to_owned(),
            At if self.x.class == Temperature => "°C".to_owned(),
            HalfWidth | Knee | At | Width => self.x.unit.clone(),
        }
    }
}

impl Term {
    /// The formula with its amplitude: what a custom effect declares.
    pub(crate) fn formula_text(&self) -> String {
        let bare = &self.family.text;
        let is_whole = ["max(", "tanh(", "width"].iter().any(|start| bare.starts_with(start));
        if self.family.form.template.contains(" - ") && !is_whole { format!("a*({bare})") } else { format!("a*{bare}") }
    }

    /// Names of its parameters, the amplitude first.
    pub(crate) fn parameter_names(&self) -> Vec<String> {
        std::iter::once("a").chain(self.family.form.inner.iter().map(|i| i.key())).map(str::to_owned).collect()
    }

    pub(crate) fn formula(&self) -> Option<Formula> {
        Formula::new(&self.formula_text(), self.parameter_names()).ok()
    }

    /// With its numbers in the place of names, the amplitude in front.
    pub(crate) fn in_numbers(&self, amplitude: f64) -> String {
        let inner = |name: &str| self.family.form.inner.iter().position(|i| i.key() == name);
        let shown = |name: &str| match inner(name) {
            Some(place) => Some(short(self.inner[place])),
            None => (name == "a").then(|| short(amplitude)),
        };
        let text = self.formula_text();
        Expression::parse(&text).map_or(text, |expression| expression.with_names(&shown))
    }

    /// Its value at each row of a record.
    pub(crate) fn course(&self, courses: &Courses, record: usize) -> Vec<f64> {
        enum Source<'a> {
            Rows(&'a [f64]),
            Number(f64),
        }
        let sources: Vec<Source> = self
            .family
            .expression
            .variables()
            .iter()
            .map(|v| {
                let inner = self.family.form.inner.iter().position(|i| i.key() == v.name);
                match inner {
                    Some(place) => Source::Number(self.inner[place]),
                    None => Source::Rows(courses.of(&v.name, record)),
                }
            })
            .collect();
        let mut memory = Memory::default();
        let mut values = vec![0.0; sources.len()];
        courses
            .times_s(record)
            .iter()
            .enumerate()
            .map(|(row, &time_s)| {
                for (value, source) in values.iter_mut().zip(&sources) {
                    *value = match source {
                        Source::Rows(rows) => rows.get(row).copied().unwrap_or(f64::NAN),
                        Source::Number(number) => *number,
                    };
                }
                self.family.expression.evaluate_after(&values, time_s, &mut memory)
            })
            .collect()
    }

    /// Whether two say nearly the same of the same names.
    pub(crate) fn is_sister_of(&self, other: &Self) -> bool {
        self.family.text == other.family.text
    }
}

/// Four digits, as a person writes them.
pub(crate) fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = (3 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.digits$}");
    let scale = 10f64.powi(4 - 1 - value.abs().log10().floor() as i32);
    if value.abs() >= 1e4 {
        return format!("{:.0}", (value * scale).round() / scale);
    }
    if value.abs() < 1e-4 {
        return format!("{value:.3e}");
    }
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn variable(text: &str, class: Class, low: f64, high: f64) -> FormulaVariable {
        let (name, unit) = (text.trim_matches(['(', ')']).to_owned(), "K".to_owned());
        FormulaVariable { text: text.to_owned(), name, class, unit, low, high }
    }

    fn all() -> Vec<FormulaVariable> {
        vec![
            variable("T_mean", Temperature, 10.0, 60.0),
            variable("T_in", Temperature, 12.0, 58.0),
            variable("T", Temperature, 8.0, 61.0),
            variable("(T - T_in)", Difference, -3.0, 3.0),
            variable("mean_rate", Rate, -0.02, 0.02),
            variable("dT_dt", Rate, -0.03, 0.03),
            variable("fan_a", Column, -2.0, 2.0),
            variable("heater_a", Column, 0.2, 1.4),
            variable("(heater_a - 0.9)", Centred, -0.7, 0.5),
            variable("t", Time, 0.0, 17000.0),
        ]
    }

    #[test]
    fn every_family_is_a_formula_of_its_own_parameters_and_every_form_has_one() {
        let families = families(&all(), &Allowed::default());
        for form in FORMS {
            assert!(families.iter().any(|f| f.form.key == form.key), "{}", form.key);
        }
        for family in &families {
            for inner in family.grid(17000.0) {
                let term = Term { family: family.clone(), inner };
                let formula = term.formula().unwrap_or_else(|| panic!("{}", term.formula_text()));
                assert_eq!(formula.parameters(), term.parameter_names(), "{}", term.formula_text());
                for (place, value) in term.inner.iter().enumerate() {
                    let (low, high) = family.bounds(place, 17000.0);
                    assert!(low <= *value && *value <= high, "{} {low} {value} {high}", family.text);
                }
            }
        }
        let texts: Vec<&str> = families.iter().map(|f| f.text.as_str()).collect();
        for wanted in [
            "T_mean - lag(T_mean, tau_s)",
            "play(T_in, half_width) - T_in",
            "mean_rate*(T_mean - 20)",
            "lag(abs(fan_a), tau_s)",
            "width*softplus((T_mean - at)/width)",
            "heater_a^2",
            "max(fan_a - at, 0)",
            "ln(1 + t/tau_s)",
            "tanh((heater_a - at)/knee)",
        ] {
            assert!(texts.contains(&wanted), "{wanted} is not among {texts:?}");
        }
        // A current that never changes its direction is its own size.
        assert!(!texts.iter().any(|text| text.contains("abs(heater_a)")), "{texts:?}");
        let mut once = texts.clone();
        once.sort_unstable();
        once.dedup();
        assert_eq!(once.len(), texts.len(), "a formula is tried twice");
    }

    #[test]
    fn numbers_stand_where_names_stood() {
        let families = families(&all(), &Allowed::default());
        let relaxation = families.iter().find(|f| f.text == "T_mean - lag(T_mean, tau_s)").unwrap().clone();
        let term = Term { family: relaxation, inner: vec![900.0] };
        assert_eq!(term.formula_text(), "a*(T_mean - lag(T_mean, tau_s))");
        assert_eq!(term.in_numbers(0.012), "0.012*(T_mean - lag(T_mean, 900))");
        let saturation = families.iter().find(|f| f.text == "tanh((fan_a - at)/knee)").unwrap().clone();
        let term = Term { family: saturation, inner: vec![-0.2, 0.5] };
        println!("{}", term.in_numbers(3.0));
        assert_eq!(term.formula_text(), "a*tanh((fan_a - at)/knee)");
    }

    #[test]
    fn words_restrict_forms_and_variables() {
        let of = |words: &[&str]| {
            let allowed = Allowed { words: words.iter().map(|w| (*w).to_owned()).collect() };
            families(&all(), &allowed)
        };
        assert!(of(&["hysteresis"]).iter().all(|f| f.form.key == "hysteresis"));
        assert!(!of(&["hysteresis"]).is_empty());
        assert!(of(&["fan_a"]).iter().all(|f| f.variables() == ["fan_a"]));
        let both = of(&["square", "heater_a"]);
        assert!(both.iter().any(|f| f.text == "heater_a^2") && both.len() == 2, "{:?}", both.len());
    }
}
