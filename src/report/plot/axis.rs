//! Where an axis begins and ends, and which numbers stand along it.

/// How an axis spaces its numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Scale {
    Linear,
    /// As linear, but only whole numbers stand along it.
    Whole,
    /// Decades; values that are not positive are left out.
    Log,
    /// Decades of the values' sizes; what is smaller than the floor is drawn there.
    Size {
        floor: f64,
    },
}

/// One axis: its label, which names the unit in square brackets, and its scale.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    pub(super) label: String,
    scale: Scale,
    /// Values that the axis must reach whatever the data are.
    include: Vec<f64>,
}

impl Axis {
    /// Evenly spaced, with a range from the data.
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), scale: Scale::Linear, include: Vec::new() }
    }

    pub(crate) fn log(label: impl Into<String>) -> Self {
        Self { label: label.into(), scale: Scale::Log, include: Vec::new() }
    }

    /// Of counts.
    pub(crate) fn whole(label: impl Into<String>) -> Self {
        Self { label: label.into(), scale: Scale::Whole, include: Vec::new() }
    }

    /// Logarithmic, of the sizes of values that may have either sign; `floor` is positive.
    pub(crate) fn sizes(label: impl Into<String>, floor: f64) -> Self {
        Self { label: label.into(), scale: Scale::Size { floor }, include: Vec::new() }
    }

    /// The axis reaches `value` even where no data do.
    pub fn reaching(mut self, value: f64) -> Self {
        self.include.push(value);
        self
    }

    pub(super) fn is_log(&self) -> bool {
        matches!(self.scale, Scale::Log | Scale::Size { .. })
    }

    /// What smaller sizes are drawn at.
    pub(super) fn floor(&self) -> Option<f64> {
        if let Scale::Size { floor } = self.scale { Some(floor) } else { None }
    }

    pub(super) fn admits(&self, value: f64) -> bool {
        value.is_finite() && (self.scale != Scale::Log || value > 0.0)
    }

    /// Position on a straight ruler: the value itself or its decade.
    pub(super) fn position(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear | Scale::Whole => value,
            Scale::Log => value.log10(),
            Scale::Size { floor } => value.abs().max(floor).log10(),
        }
    }

    /// The ruler that holds all `values` with about `wanted` labelled ticks; `margin` is left free at both ends.
    pub(super) fn ruler(&self, values: impl Iterator<Item = f64>, wanted: usize, margin: f64) -> Ruler {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.chain(self.include.iter().copied()).filter(|v| self.admits(*v)) {
            low = low.min(self.position(value));
            high = high.max(self.position(value));
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        match self.scale {
            Scale::Linear => linear_ruler(low, high, wanted, margin, 0.0),
            Scale::Whole => linear_ruler(low, high, wanted, margin, 1.0),
            Scale::Log | Scale::Size { .. } => log_ruler(low, high, wanted),
        }
    }
}

/// A labelled or unlabelled place on a ruler.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tick {
    pub(crate) position: f64,
    /// Empty for a minor tick.
    pub(crate) label: String,
}

/// An axis with its ends and ticks found.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ruler {
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) ticks: Vec<Tick>,
    /// Behind the axis label: the power of ten that the tick labels leave out.
    pub(crate) suffix: String,
}

impl Ruler {
    /// Where columns and bars stand on: zero, or the low end where there is none.
    pub(super) fn base(&self, axis: &Axis) -> f64 {
        if axis.is_log() { self.low } else { 0f64.clamp(self.low, self.high) }
    }
}

/// Ticks are no less than `least_step` apart.
fn linear_ruler(low: f64, high: f64, wanted: usize, margin: f64, least_step: f64) -> Ruler {
    let (low, high) = if high - low > 1e-12 * low.abs().max(high.abs()) && high > low {
        (low - margin * (high - low), high + margin * (high - low))
    } else if low == 0.0 {
        (-1.0, 1.0)
    } else {
        (low - 0.1 * low.abs(), high + 0.1 * high.abs())
    };
    let raw = (high - low) / wanted.max(2) as f64;
    let decade = 10f64.powf(raw.log10().floor());
    let step =
        [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * decade).find(|s| *s >= raw * 0.7).unwrap_or(raw).max(least_step);
    let largest = low.abs().max(high.abs());
    let exponent = if (1e-3..1e5).contains(&largest) { 0 } else { largest.log10().floor() as i32 };
    let shown_step = step / 10f64.powi(exponent);
    let decimals = (-(shown_step * 1.0001).log10().floor()).max(0.0) as usize;
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    let ticks = (first..=last)
        .map(|i| Tick { position: i as f64 * step, label: number(i as f64 * step / 10f64.powi(exponent), decimals) })
        .collect();
    let suffix = if exponent == 0 { String::new() } else { format!(" × 10{}", superscript(exponent)) };
    Ruler { low, high, ticks, suffix }
}

fn log_ruler(low: f64, high: f64, wanted: usize) -> Ruler {
    let (low, high) = if high - low < 1e-9 { (low - 0.5, high + 0.5) } else { (low, high) };
    let whole = high - low >= 1.3;
    // Few decades: end at the next 1, 2 or 5; many: at the next decade.
    let marks: &[f64] = if whole { &[1.0] } else { &[1.0, 2.0, 5.0] };
    let positions = |from: i32, to: i32| {
        (from..=to).flat_map(|d| (1..10).map(move |m| (d, m))).map(|(d, m)| (f64::from(d) + f64::from(m).log10(), d, m))
    };
    let (from, to) = (low.floor() as i32 - 1, high.ceil() as i32 + 1);
    let labelled = |m: i32| marks.contains(&f64::from(m));
    let start =
        positions(from, to).filter(|p| labelled(p.2) && p.0 <= low + 1e-9).map(|p| p.0).fold(f64::from(from), f64::max);
    let end =
        positions(from, to).filter(|p| labelled(p.2) && p.0 >= high - 1e-9).map(|p| p.0).fold(f64::from(to), f64::min);
    let decades = (end - start).ceil() as usize;
    let every = decades.div_ceil(wanted.max(2)) as i32;
    let ticks = positions(from, to)
        .filter(|p| p.0 >= start - 1e-9 && p.0 <= end + 1e-9)
        .filter(|p| labelled(p.2) || every == 1)
        .map(|(position, d, m)| {
            let shown = labelled(m) && d.rem_euclid(every) == 0;
            Tick { position, label: if shown { log_label(d, m) } else { String::new() } }
        })
        .collect();
    Ruler { low: start, high: end, ticks, suffix: String::new() }
}

fn log_label(decade: i32, multiple: i32) -> String {
    match (decade, multiple) {
        (-3..=4, _) => number(f64::from(multiple) * 10f64.powi(decade), (-decade).max(0) as usize),
        (_, 1) => format!("10{}", superscript(decade)),
        _ => format!("{multiple}·10{}", superscript(decade)),
    }
}

/// A number with a true minus sign and no "−0".
pub(super) fn number(value: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", value.abs());
    let zero = text.chars().all(|c| matches!(c, '0' | '.'));
    if value < 0.0 && !zero { format!("−{text}") } else { text }
}

/// Three significant digits, for the end of a bar.
pub(in crate::report) fn three_digits(value: f64) -> String {
    significant(value, 3)
}

/// So many significant digits, for a table.
pub(in crate::report) fn significant(value: f64, count: i32) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = value.abs().log10().floor() as i32;
    if (-4..6).contains(&exponent) {
        number(value, (count - 1 - exponent).max(0) as usize)
    } else {
        format!("{}·10{}", number(value / 10f64.powi(exponent), (count - 1) as usize), superscript(exponent))
    }
}

fn superscript(exponent: i32) -> String {
    exponent
        .to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            '0' => '⁰',
            digit => char::from_u32('⁰' as u32 + digit as u32 - '0' as u32).unwrap_or(digit),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(ruler: &Ruler) -> Vec<&str> {
        ruler.ticks.iter().map(|t| t.label.as_str()).filter(|l| !l.is_empty()).collect()
    }

    #[test]
    fn ticks_are_round_numbers_with_a_true_minus_sign() {
        let ruler = Axis::linear("").ruler([-1.0, 1.0].into_iter(), 5, 0.0);
        assert_eq!(labels(&ruler), ["−1.0", "−0.5", "0.0", "0.5", "1.0"]);
    }

    #[test]
    fn very_small_numbers_share_one_power_of_ten() {
        let ruler = Axis::linear("").ruler([0.0, 4e-6].into_iter(), 4, 0.0);
        assert_eq!((labels(&ruler), ruler.suffix.as_str()), (vec!["0", "1", "2", "3", "4"], " × 10⁻⁶"));
    }

    #[test]
    fn decades_are_labelled_as_they_are_read_aloud() {
        let ruler = Axis::log("").ruler([0.03, 2e6].into_iter(), 10, 0.0);
        assert_eq!(labels(&ruler), ["0.01", "0.1", "1", "10", "100", "1000", "10000", "10⁵", "10⁶", "10⁷"]);
        let ruler = Axis::log("").ruler([3.0, 8.0].into_iter(), 5, 0.0);
        assert_eq!(labels(&ruler), ["2", "5", "10"]);
    }

    #[test]
    fn data_that_are_absent_constant_or_not_finite_still_give_an_axis() {
        for values in [vec![], vec![f64::NAN], vec![0.0], vec![-3.0], vec![1e300, -1e300]] {
            for axis in [Axis::linear(""), Axis::log("")] {
                let ruler = axis.ruler(values.iter().copied(), 5, 0.05);
                assert!(ruler.low < ruler.high && ruler.ticks.len() < 200, "{values:?} {ruler:?}");
            }
        }
    }
}
