//! What can be said of a formula without running it over a record: where a value ceases to be a number, how it depends on a
//! variable, and within which bounds it stays.

use std::ops::Range;

use thiserror::Error;

use super::memory::Recall;
use super::{Expression, Memory, Node, Operator, call};

/// Why a formula has no value, and which part of it (bytes).
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum EvaluationError {
    #[error("division by zero in {part}")]
    DivisionByZero { at: Range<usize>, part: String },
    #[error("{part} is larger than any number")]
    Overflow { at: Range<usize>, part: String },
    #[error("{part} is not defined where its argument is {argument}")]
    Undefined { at: Range<usize>, part: String, argument: f64 },
    #[error("{part} needs a {what} that is not negative, found {found}")]
    Negative { at: Range<usize>, part: String, what: &'static str, found: f64 },
}

/// How a value depends on some variables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Degree {
    Not,
    /// Linear in them with nothing added, whatever the other variables are.
    Homogeneous,
    /// Linear in them.
    Linear,
    Beyond,
}

/// Least and largest value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ValueRange {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl ValueRange {
    pub(crate) const EVERYTHING: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };

    pub(crate) fn at(value: f64) -> Self {
        Self { low: value, high: value }
    }

    fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut found = Self { low: f64::INFINITY, high: f64::NEG_INFINITY };
        for value in values {
            if value.is_nan() {
                return Self::EVERYTHING;
            }
            found = Self { low: found.low.min(value), high: found.high.max(value) };
        }
        found
    }

    fn holds(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// The largest size.
    pub(crate) fn size(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }
}

impl Expression {
    /// Why it has no value where all its variables have one, the memory being as it was before; None where it has.
    pub(crate) fn fault(&self, values: &[f64], time_s: f64, memory: &Memory) -> Option<EvaluationError> {
        let mut memory = memory.clone();
        self.checked(&self.root, values, &mut memory.at(time_s, self.memories)).err()
    }

    fn part(&self, at: &Range<usize>) -> String {
        self.source[at.clone()].to_owned()
    }

    fn checked(&self, node: &Node, values: &[f64], recall: &mut impl Recall) -> Result<f64, EvaluationError> {
        let named = |at: &Range<usize>| (at.clone(), self.part(at));
        let finite = |value: f64, inputs: &[f64], at: &Range<usize>| {
            let (at, part) = named(at);
            if value.is_finite() || inputs.iter().any(|x| !x.is_finite()) {
                Ok(value)
            } else if value.is_infinite() && !part.starts_with("ln") && !part.starts_with("log10") {
                Err(EvaluationError::Overflow { at, part })
            } else {
                Err(EvaluationError::Undefined { at, part, argument: inputs[0] })
            }
        };
        match node {
            Node::Number(number) => Ok(*number),
            Node::Variable(index) => Ok(values[*index]),
            Node::Negate(operand) => Ok(-self.checked(operand, values, recall)?),
            Node::Binary(operator, at, left, right) => {
                let (x, y) = (self.checked(left, values, recall)?, self.checked(right, values, recall)?);
                let zero = match operator {
                    Operator::Divide => y == 0.0,
                    Operator::Power => x == 0.0 && y < 0.0,
                    _ => false,
                };
                if zero {
                    let (at, part) = named(at);
                    return Err(EvaluationError::DivisionByZero { at, part });
                }
                finite(operator.of(x, y), &[x, y], at)
            }
            Node::Call(function, at, arguments) => {
                let x = self.checked(&arguments[0], values, recall)?;
                let y = arguments.get(1).map_or(Ok(0.0), |y| self.checked(y, values, recall))?;
                finite(call(function, x, y), &[x, y], at)
            }
            Node::Remember(keeper, slot, at, input, size) => {
                let x = self.checked(input, values, recall)?;
                let found = self.checked(size, values, recall)?;
                if found < 0.0 {
                    let (at, part) = named(at);
                    let what = if keeper.name() == "lag" { "time constant" } else { "half width" };
                    return Err(EvaluationError::Negative { at, part, what, found });
                }
                Ok(recall.remember(*keeper, *slot, x, found))
            }
        }
    }

    /// How it depends on the variables (by place) that `which` picks.
    pub(crate) fn degree(&self, which: &dyn Fn(usize) -> bool) -> Degree {
        degree(&self.root, which)
    }

    /// Whether a variable (by place) stands by itself as the time constant or half width of what remembers, and never
    /// elsewhere: it is then no sum's sign but a size.
    pub(crate) fn is_size(&self, variable: usize) -> bool {
        let (mut as_size, mut elsewhere) = (0, 0);
        count(&self.root, variable, &mut as_size, &mut elsewhere);
        as_size > 0 && elsewhere == 0
    }

    /// Within which bounds it stays while its variables stay within theirs.
    pub(crate) fn range(&self, variables: &[ValueRange]) -> ValueRange {
        range(&self.root, variables)
    }
}

fn count(node: &Node, variable: usize, as_size: &mut usize, elsewhere: &mut usize) {
    match node {
        Node::Number(_) => {}
        Node::Variable(index) => *elsewhere += usize::from(*index == variable),
        Node::Negate(operand) => count(operand, variable, as_size, elsewhere),
        Node::Binary(_, _, left, right) => {
            [left, right].into_iter().for_each(|n| count(n, variable, as_size, elsewhere))
        }
        Node::Call(_, _, arguments) => arguments.iter().for_each(|n| count(n, variable, as_size, elsewhere)),
        Node::Remember(_, _, _, input, size) => {
            count(input, variable, as_size, elsewhere);
            match **size {
                Node::Variable(index) => *as_size += usize::from(index == variable),
                _ => count(size, variable, as_size, elsewhere),
            }
        }
    }
}

fn degree(node: &Node, which: &dyn Fn(usize) -> bool) -> Degree {
    use Degree::{Beyond, Homogeneous, Linear, Not};
    match node {
        Node::Number(_) => Not,
        Node::Variable(index) => {
            if which(*index) {
                Homogeneous
            } else {
                Not
            }
        }
        Node::Negate(operand) => degree(operand, which),
        Node::Binary(operator, _, left, right) => {
            let (x, y) = (degree(left, which), degree(right, which));
            match operator {
                Operator::Add | Operator::Subtract => match (x, y) {
                    (Not, Not) => Not,
                    (Homogeneous, Homogeneous) => Homogeneous,
                    _ => x.max(y).max(Linear),
                },
                Operator::Multiply if x == Not => y,
                Operator::Multiply | Operator::Divide if y == Not => x,
                Operator::Power if x == Not && y == Not => Not,
                _ => Beyond,
            }
        }
        Node::Call(_, _, arguments) => {
            if arguments.iter().all(|a| degree(a, which) == Not) {
                Not
            } else {
                Beyond
            }
        }
        Node::Remember(_, _, _, input, size) => match (degree(input, which), degree(size, which)) {
            (Not, Not) => Not,
            _ => Beyond,
        },
    }
}

/// Products of infinity and zero count as zero: the infinite side is a variable without bounds, which is finite.
fn product(x: f64, y: f64) -> f64 {
    if x == 0.0 || y == 0.0 { 0.0 } else { x * y }
}

fn corners(x: ValueRange, y: ValueRange, f: impl Fn(f64, f64) -> f64) -> ValueRange {
    ValueRange::of([f(x.low, y.low), f(x.low, y.high), f(x.high, y.low), f(x.high, y.high)])
}

fn range(node: &Node, variables: &[ValueRange]) -> ValueRange {
    match node {
        Node::Number(number) => ValueRange::at(*number),
        Node::Variable(index) => variables[*index],
        Node::Negate(operand) => {
            let x = range(operand, variables);
            ValueRange { low: -x.high, high: -x.low }
        }
        Node::Binary(operator, _, left, right) => {
            let (x, y) = (range(left, variables), range(right, variables));
            match operator {
                Operator::Add => ValueRange::of([x.low + y.low, x.high + y.high]),
                Operator::Subtract => ValueRange::of([x.low - y.high, x.high - y.low]),
                Operator::Multiply => corners(x, y, product),
                Operator::Divide if y.holds(0.0) => ValueRange::EVERYTHING,
                Operator::Divide => corners(x, y, |x, y| if y.is_infinite() { 0.0 } else { x / y }),
                Operator::Power => power(x, y),
            }
        }
        Node::Call(function, _, arguments) => {
            let x = range(&arguments[0], variables);
            let y = arguments.get(1).map_or(ValueRange::at(0.0), |y| range(y, variables));
            match *function {
                "abs" if x.holds(0.0) => ValueRange { low: 0.0, high: x.size() },
                "abs" => ValueRange::of([x.low.abs(), x.high.abs()]),
                "sin" | "cos" => ValueRange { low: -1.0, high: 1.0 },
                "tan" => ValueRange::EVERYTHING,
                "pow" => power(x, y),
                "min" | "max" => corners(x, y, |x, y| call(function, x, y)),
                // All the others grow with their argument.
                _ => ValueRange::of([call(function, x.low, 0.0), call(function, x.high, 0.0)]),
            }
        }
        // A lag and a play stay where their argument has been.
        Node::Remember(_, _, _, input, _) => range(input, variables),
    }
}

fn power(x: ValueRange, y: ValueRange) -> ValueRange {
    let whole = y.low == y.high && y.low.fract() == 0.0 && y.low >= 0.0;
    if whole {
        let ends = ValueRange::of([x.low.powf(y.low), x.high.powf(y.low)]);
        let even = y.low % 2.0 == 0.0 && y.low > 0.0;
        return if even && x.holds(0.0) { ValueRange { low: 0.0, ..ends } } else { ends };
    }
    if x.low > 0.0 { corners(x, y, f64::powf) } else { ValueRange::EVERYTHING }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(source: &str, x: f64) -> EvaluationError {
        Expression::parse(source).unwrap().fault(&[x], 0.0, &Memory::default()).unwrap()
    }

    #[test]
    fn the_part_that_has_no_value_is_named() {
        assert_eq!(
            fault("1 + 2/(x - 3)", 3.0),
            EvaluationError::DivisionByZero { at: 4..13, part: "2/(x - 3)".into() }
        );
        assert_eq!(fault("5 * exp(x*x)", 99.0), EvaluationError::Overflow { at: 4..12, part: "exp(x*x)".into() });
        assert!(matches!(fault("ln(x)", 0.0), EvaluationError::Undefined { argument: 0.0, .. }));
        assert!(matches!(fault("sqrt(x)", -2.0), EvaluationError::Undefined { argument: -2.0, .. }));
        assert!(matches!(fault("lag(x, -x)", 4.0), EvaluationError::Negative { found: -4.0, .. }));
        assert!(matches!(fault("x^-1", 0.0), EvaluationError::DivisionByZero { .. }));
        let fine = Expression::parse("1/x").unwrap();
        assert_eq!(fine.fault(&[2.0], 0.0, &Memory::default()), None);
        // A variable without a value is no fault of the formula.
        assert_eq!(fine.fault(&[f64::NAN], 0.0, &Memory::default()), None);
    }

    #[test]
    fn degrees_are_those_of_algebra() {
        let of = |source: &str| Expression::parse(source).unwrap().degree(&|v| v == 0);
        assert_eq!(of("x*a/3"), Degree::Homogeneous);
        assert_eq!(of("-x*a + 2"), Degree::Linear);
        assert_eq!(of("x*x"), Degree::Beyond);
        assert_eq!(of("2/x"), Degree::Beyond);
        assert_eq!(of("lag(x, 3)"), Degree::Beyond);
        assert_eq!(Expression::parse("a + tanh(b)").unwrap().degree(&|_| false), Degree::Not);
    }

    #[test]
    fn a_parameter_is_a_size_where_it_is_nothing_but_one() {
        let of = |source: &str| {
            let e = Expression::parse(source).unwrap();
            e.is_size(e.variables().iter().position(|v| v.name == "s").unwrap())
        };
        assert!(of("x - lag(x, s)"));
        assert!(of("play(x, s)"));
        assert!(!of("s*play(x, s)"));
        assert!(!of("lag(x, 2*s)"));
    }

    #[test]
    fn ranges_hold_every_value_and_are_tight_where_a_variable_occurs_once() {
        let of =
            |source: &str, low: f64, high: f64| Expression::parse(source).unwrap().range(&[ValueRange { low, high }]);
        assert_eq!(of("3*tanh(x)", f64::NEG_INFINITY, f64::INFINITY), ValueRange { low: -3.0, high: 3.0 });
        assert_eq!(of("x^2", -2.0, 1.0), ValueRange { low: 0.0, high: 4.0 });
        assert_eq!(of("lag(max(x, 0), 5)", -2.0, 1.0), ValueRange { low: 0.0, high: 1.0 });
        assert_eq!(of("1/x", -1.0, 1.0), ValueRange::EVERYTHING);
        assert_eq!(of("x - lag(x, 5)", f64::NEG_INFINITY, f64::INFINITY).size(), f64::INFINITY);
        for source in ["abs(x)*x", "softplus(x) - x/3", "exp(-x)*sin(x)", "x*x*x"] {
            let e = Expression::parse(source).unwrap();
            let bounds = e.range(&[ValueRange { low: -1.5, high: 2.5 }]);
            for k in 0..=40 {
                let value = e.evaluate(&[-1.5 + 0.1 * f64::from(k)]);
                assert!(bounds.low <= value + 1e-12 && value <= bounds.high + 1e-12, "{source} {value} {bounds:?}");
            }
        }
    }
}
