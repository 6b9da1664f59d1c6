//! Formulas that a user types: parsed once, evaluated often, unable to do anything but arithmetic.
//!
//! `+ - * / ^`, parentheses, numbers, the constant `pi`, the functions of [`FUNCTIONS`], and variables by name.
//! `^` binds most tightly and to the right, so −x^2 is −(x²). `lag` and `play` remember what their argument was before:
//! [`Expression::evaluate_after`] takes instants in order; [`Expression::evaluate`] is an instant that nothing came before.

mod analysis;
mod memory;
mod printed;

use std::ops::Range;

use pest::Parser;
use pest::iterators::{Pair, Pairs};
use pest::pratt_parser::{Assoc, Op, PrattParser};
use thiserror::Error;

mod grammar {
    #[derive(pest_derive::Parser)]
    #[grammar = "numeric/expression.pest"]
    pub(crate) struct FormulaParser;
}
use grammar::{FormulaParser, Rule};

pub(crate) use analysis::{Degree, EvaluationError, ValueRange};
pub use memory::Memory;
use memory::{AtRest, Keeper, Recall};

/// A formula that was understood.
///
/// # Shapes
/// `evaluate` takes one value a variable, in the order of [`Expression::variables`].
#[derive(Debug, Clone, PartialEq)]
pub struct Expression {
    source: String,
    root: Node,
    variables: Vec<Variable>,
    /// Calls that remember.
    memories: usize,
}

/// A name in a formula, and where it first stands (bytes).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Variable {
    pub(crate) name: String,
    pub(crate) at: Range<usize>,
}

/// What is wrong with a formula, and where (bytes).
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum ExpressionError {
    #[error("the formula is {found} characters long: {LONGEST} are the most that is understood")]
    TooLong { found: usize },
    #[error("parentheses are nested more than {DEEPEST} deep")]
    TooDeep { at: Range<usize> },
    #[error("expected {expected}, found {found}")]
    Syntax { at: Range<usize>, expected: String, found: String },
    #[error("no function is called {found}: known are {known}")]
    UnknownFunction { at: Range<usize>, found: String, known: String },
    #[error("{function} takes {expected} argument(s), found {found}")]
    Arguments { at: Range<usize>, function: &'static str, expected: usize, found: usize },
}

const LONGEST: usize = 2000;
const DEEPEST: usize = 64;

/// Name and arity of every function.
pub(crate) const FUNCTIONS: [(&str, usize); 17] = [
    ("abs", 1),
    ("sign", 1),
    ("sqrt", 1),
    ("exp", 1),
    ("ln", 1),
    ("log10", 1),
    ("sin", 1),
    ("cos", 1),
    ("tan", 1),
    ("atan", 1),
    ("tanh", 1),
    ("min", 2),
    ("max", 2),
    ("pow", 2),
    ("softplus", 1),
    ("lag", 2),
    ("play", 2),
];

#[derive(Debug, Clone, PartialEq)]
enum Node {
    Number(f64),
    Variable(usize),
    Negate(Box<Node>),
    Binary(Operator, Range<usize>, Box<Node>, Box<Node>),
    Call(&'static str, Range<usize>, Vec<Node>),
    /// What it is, its place among those that remember, what it follows, and its time constant or half width.
    Remember(Keeper, usize, Range<usize>, Box<Node>, Box<Node>),
}

/// A node and where it stands.
type Built = (Node, Range<usize>);

/// What a formula is made of, as far as it was read.
#[derive(Default)]
struct Parts {
    variables: Vec<Variable>,
    memories: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
}

impl ExpressionError {
    /// Where in the formula, if it is one place.
    pub(crate) fn at(&self) -> Option<Range<usize>> {
        match self {
            ExpressionError::TooLong { .. } => None,
            ExpressionError::TooDeep { at }
            | ExpressionError::Syntax { at, .. }
            | ExpressionError::UnknownFunction { at, .. }
            | ExpressionError::Arguments { at, .. } => Some(at.clone()),
        }
    }
}

impl Expression {
    /// # Errors
    /// The first place at which the text stops being a formula.
    pub fn parse(source: &str) -> Result<Self, ExpressionError> {
        if source.len() > LONGEST {
            return Err(ExpressionError::TooLong { found: source.len() });
        }
        check_depth(source)?;
        let mut pairs = FormulaParser::parse(Rule::formula, source).map_err(|e| syntax_error(source, &e))?;
        let mut parts = Parts::default();
        let root = match pairs.next() {
            Some(expression) => build(expression.into_inner(), &mut parts)?.0,
            None => Node::Number(0.0),
        };
        Ok(Self { source: source.to_owned(), root, variables: parts.variables, memories: parts.memories })
    }

    pub(crate) fn source(&self) -> &str {
        &self.source
    }

    /// In the order of their first appearance.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// At an instant that nothing came before: what remembers is at rest.
    pub fn evaluate(&self, values: &[f64]) -> f64 {
        evaluate(&self.root, values, &mut AtRest)
    }

    /// At an instant after those that the memory has seen; an empty memory begins at rest.
    pub fn evaluate_after(&self, values: &[f64], time_s: f64, memory: &mut Memory) -> f64 {
        evaluate(&self.root, values, &mut memory.at(time_s, self.memories))
    }

    /// Whether its value depends on earlier ones.
    pub(crate) fn remembers(&self) -> bool {
        self.memories > 0
    }
}

/// Nesting is bounded before a recursive parser sees it.
fn check_depth(source: &str) -> Result<(), ExpressionError> {
    let (mut depth, mut signs) = (0usize, 0usize);
    for (at, c) in source.char_indices() {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        signs = if c == '-' || c == '^' {
            signs + 1
        } else if c.is_whitespace() {
            signs
        } else {
            0
        };
        if depth > DEEPEST || signs > DEEPEST {
            return Err(ExpressionError::TooDeep { at: at..at + c.len_utf8() });
        }
    }
    Ok(())
}

fn syntax_error(source: &str, error: &pest::error::Error<Rule>) -> ExpressionError {
    let start = match error.location {
        pest::error::InputLocation::Pos(at) => at,
        pest::error::InputLocation::Span((at, _)) => at,
    };
    let found = source[start..].chars().next();
    let expected = match &error.variant {
        pest::error::ErrorVariant::ParsingError { positives, .. } => {
            let wants_operand =
                positives.iter().any(|r| matches!(r, Rule::number | Rule::variable | Rule::call | Rule::primary));
            if wants_operand { "a number, a name or a parenthesis" } else { "an operator or the end" }
        }
        pest::error::ErrorVariant::CustomError { .. } => "a formula",
    };
    ExpressionError::Syntax {
        at: start..start + found.map_or(0, char::len_utf8),
        expected: expected.to_owned(),
        found: found.map_or_else(|| "the end".to_owned(), |c| format!("'{c}'")),
    }
}

fn build(pairs: Pairs<Rule>, parts: &mut Parts) -> Result<Built, ExpressionError> {
    let binding = PrattParser::new()
        .op(Op::infix(Rule::add, Assoc::Left) | Op::infix(Rule::subtract, Assoc::Left))
        .op(Op::infix(Rule::multiply, Assoc::Left) | Op::infix(Rule::divide, Assoc::Left))
        .op(Op::prefix(Rule::negate))
        .op(Op::infix(Rule::power, Assoc::Right));
    let parts = std::cell::RefCell::new(parts);
    binding
        .map_primary(|pair| primary(pair, &mut parts.borrow_mut()))
        .map_prefix(|sign, operand| {
            let (operand, at) = operand?;
            Ok((Node::Negate(Box::new(operand)), sign.as_span().start()..at.end))
        })
        .map_infix(|left, operator, right| {
            let operator = match operator.as_rule() {
                Rule::add => Operator::Add,
                Rule::subtract => Operator::Subtract,
                Rule::multiply => Operator::Multiply,
                Rule::divide => Operator::Divide,
                _ => Operator::Power,
            };
            let ((left, from), (right, to)) = (left?, right?);
            let at = from.start..to.end;
            Ok((Node::Binary(operator, at.clone(), Box::new(left), Box::new(right)), at))
        })
        .parse(pairs)
}

fn primary(pair: Pair<Rule>, parts: &mut Parts) -> Result<Built, ExpressionError> {
    let span = pair.as_span();
    let at = span.start()..span.end();
    match pair.as_rule() {
        // The grammar admits only what `f64` can read.
        Rule::number => Ok((Node::Number(pair.as_str().parse().unwrap_or(f64::NAN)), at)),
        Rule::variable => {
            let name = pair.as_str();
            if name == "pi" {
                return Ok((Node::Number(std::f64::consts::PI), at));
            }
            let known = parts.variables.iter().position(|v| v.name == name);
            let index = known.unwrap_or_else(|| {
                parts.variables.push(Variable { name: name.to_owned(), at: at.clone() });
                parts.variables.len() - 1
            });
            Ok((Node::Variable(index), at))
        }
        Rule::call => {
            let mut inner = pair.into_inner();
            let name = inner.next().map_or("", |n| n.as_str());
            let Some(&(function, arity)) = FUNCTIONS.iter().find(|f| f.0 == name) else {
                let known = FUNCTIONS.map(|f| f.0).join(", ");
                return Err(ExpressionError::UnknownFunction {
                    at: at.start..at.start + name.len(),
                    found: name.to_owned(),
                    known,
                });
            };
            let arguments = inner.map(|a| Ok(build(a.into_inner(), parts)?.0)).collect::<Result<Vec<_>, _>>()?;
            if arguments.len() != arity {
                return Err(ExpressionError::Arguments { at, function, expected: arity, found: arguments.len() });
            }
            let Some(keeper) = Keeper::named(function) else {
                return Ok((Node::Call(function, at.clone(), arguments), at));
            };
            let mut arguments = arguments.into_iter();
            let (Some(input), Some(size)) = (arguments.next(), arguments.next()) else {
                return Err(ExpressionError::Arguments { at, function, expected: arity, found: 0 });
            };
            let slot = parts.memories;
            parts.memories += 1;
            Ok((Node::Remember(keeper, slot, at.clone(), Box::new(input), Box::new(size)), at))
        }
        _ => {
            // The part with its parentheses, which the grammar leaves out of the pair.
            let source = pair.get_input();
            let from = source[..at.start].rfind('(').unwrap_or(at.start);
            let to = source[at.end..].find(')').map_or(at.end, |more| at.end + more + 1);
            let (inner, _) = build(pair.into_inner(), parts)?;
            Ok((inner, from..to))
        }
    }
}

fn evaluate(node: &Node, values: &[f64], recall: &mut impl Recall) -> f64 {
    match node {
        Node::Number(number) => *number,
        Node::Variable(index) => values[*index],
        Node::Negate(operand) => -evaluate(operand, values, recall),
        Node::Binary(operator, _, left, right) => {
            let left = evaluate(left, values, recall);
            operator.of(left, evaluate(right, values, recall))
        }
        Node::Call(function, _, arguments) => {
            let x = evaluate(&arguments[0], values, recall);
            let y = arguments.get(1).map_or(0.0, |y| evaluate(y, values, recall));
            call(function, x, y)
        }
        Node::Remember(keeper, slot, _, input, size) => {
            let x = evaluate(input, values, recall);
            let size = evaluate(size, values, recall);
            recall.remember(*keeper, *slot, x, size)
        }
    }
}

impl Operator {
    fn of(self, left: f64, right: f64) -> f64 {
        match self {
            Operator::Add => left + right,
            Operator::Subtract => left - right,
            Operator::Multiply => left * right,
            Operator::Divide => left / right,
            Operator::Power => left.powf(right),
        }
    }
}

/// A function of [`FUNCTIONS`] that remembers nothing; `y` counts only where it takes two arguments.
fn call(function: &str, x: f64, y: f64) -> f64 {
    match function {
        "abs" => x.abs(),
        "sign" => {
            if x == 0.0 {
                0.0
            } else {
                x.signum()
            }
        }
        "sqrt" => x.sqrt(),
        "exp" => x.exp(),
        "ln" => x.ln(),
        "log10" => x.log10(),
        "sin" => x.sin(),
        "cos" => x.cos(),
        "tan" => x.tan(),
        "atan" => x.atan(),
        "tanh" => x.tanh(),
        // Where x is no number, neither is what is larger.
        "min" if !x.is_nan() => x.min(y),
        "max" if !x.is_nan() => x.max(y),
        "min" | "max" => x,
        "softplus" => x.max(0.0) + (-x.abs()).exp().ln_1p(),
        _ => x.powf(y),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(source: &str) -> f64 {
        Expression::parse(source).unwrap().evaluate(&[])
    }

    #[test]
    fn precedence_is_that_of_mathematics() {
        assert_eq!(value("1 + 2*3 - 4/8"), 6.5);
        assert_eq!(value("-3^2"), -9.0);
        assert_eq!(value("2^3^2"), 512.0);
        assert_eq!(value("2 - 3 - 4"), -5.0);
        assert_eq!(value("1/3"), 1.0 / 3.0);
        assert_eq!(value("2^-1"), 0.5);
        assert_eq!(value("max(1, min(7, 3)) + cos(pi)"), 2.0);
        assert_eq!(value("1.5e-3*2"), 3e-3);
    }

    #[test]
    fn variables_come_in_the_order_of_their_appearance() {
        let e = Expression::parse("a*T + b*dT_dt + a").unwrap();
        assert_eq!(e.variables().iter().map(|v| v.name.as_str()).collect::<Vec<_>>(), ["a", "T", "b", "dT_dt"]);
        assert_eq!(e.evaluate(&[2.0, 3.0, 5.0, 7.0]), 43.0);
    }

    #[test]
    fn errors_point_at_the_character() {
        let at = |source: &str| Expression::parse(source).unwrap_err().at().unwrap();
        assert_eq!(at("a * * b"), 4..5);
        assert_eq!(at("a + (b - 2"), 10..10);
        assert_eq!(at("a + sine(b)"), 4..8);
        assert_eq!(at("max(1)"), 0..6);
        assert_eq!(at("a $ b"), 2..3);
        assert_eq!(at(""), 0..0);
    }

    #[test]
    fn what_remembers_is_its_argument_at_an_instant_that_nothing_came_before() {
        let e = Expression::parse("lag(x, 900) - play(x, 2) + softplus(0)").unwrap();
        assert!(e.remembers());
        assert_eq!(e.evaluate(&[7.0]), 2f64.ln());
        assert_eq!(value("softplus(800) - softplus(-800)"), 800.0);
        let missing = Expression::parse("lag(x)").unwrap_err();
        assert_eq!(missing.at(), Some(0..6));
    }

    #[test]
    fn absurd_nesting_and_length_are_refused_without_overflow() {
        let deep = "(".repeat(500) + "1" + &")".repeat(500);
        assert!(matches!(Expression::parse(&deep), Err(ExpressionError::TooDeep { .. })));
        assert!(matches!(Expression::parse(&"-".repeat(1000)), Err(ExpressionError::TooDeep { .. })));
        assert!(matches!(Expression::parse(&"1+".repeat(5000)), Err(ExpressionError::TooLong { .. })));
    }
}
