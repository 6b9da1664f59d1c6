//! A formula as an expression of the C language: for headers that are compiled without this program.

use super::{Expression, Node, Operator};

impl Expression {
    /// `variable` names each variable's value; a call that remembers becomes `lag_NAME(m, SLOT, x, size)` or
    /// `play_NAME(…)`, where `m` is where the memory is.
    pub(crate) fn in_c(&self, prefix: &str, variable: &dyn Fn(usize) -> String) -> String {
        printed(&self.root, prefix, variable)
    }

    /// The formula as it was written, with numbers in the place of names that have a value.
    pub(crate) fn with_values(&self, value: &dyn Fn(&str) -> Option<f64>) -> String {
        let shown = |v: f64| if v < 0.0 { format!("({v:?})") } else { format!("{v:?}") };
        self.with_names(&|name| value(name).map(shown))
    }

    /// The same with texts in the place of names.
    pub(crate) fn with_names(&self, value: &dyn Fn(&str) -> Option<String>) -> String {
        let mut text = String::with_capacity(self.source.len());
        let mut name = String::new();
        for c in self.source.chars().chain([' ']) {
            // A digit goes on with a name, and begins none.
            let goes_on = c == '_' || c.is_ascii_alphabetic() || (c.is_ascii_digit() && !name.is_empty());
            if goes_on {
                name.push(c);
                continue;
            }
            match value(&name).filter(|_| !name.is_empty()) {
                Some(shown) => text += &shown,
                None => text += &name,
            }
            name.clear();
            text.push(c);
        }
        text.pop();
        text
    }

    /// Calls that remember.
    pub(crate) fn memories(&self) -> usize {
        self.memories
    }
}

fn printed(node: &Node, prefix: &str, variable: &dyn Fn(usize) -> String) -> String {
    let of = |node: &Node| printed(node, prefix, variable);
    match node {
        Node::Number(number) => format!("{number:?}"),
        Node::Variable(index) => variable(*index),
        Node::Negate(operand) => format!("(-{})", of(operand)),
        Node::Binary(operator, _, left, right) => {
            let (left, right) = (of(left), of(right));
            match operator {
                Operator::Add => format!("({left} + {right})"),
                Operator::Subtract => format!("({left} - {right})"),
                Operator::Multiply => format!("({left} * {right})"),
                Operator::Divide => format!("({left} / {right})"),
                Operator::Power => format!("pow({left}, {right})"),
            }
        }
        Node::Call(function, _, arguments) => {
            let arguments: Vec<String> = arguments.iter().map(of).collect();
            let name = match *function {
                "abs" => "fabs".to_owned(),
                "ln" => "log".to_owned(),
                "min" => "fmin".to_owned(),
                "max" => "fmax".to_owned(),
                "sign" | "softplus" => format!("{function}_{prefix}"),
                other => other.to_owned(),
            };
            format!("{name}({})", arguments.join(", "))
        }
        Node::Remember(keeper, slot, _, input, size) => {
            format!("{}_{prefix}(m, {slot}, {}, {})", keeper.name(), of(input), of(size))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn c_says_the_same_with_every_precedence_written_out() {
        let e = Expression::parse("a*lag(abs(x), 300) - x^2/3").unwrap();
        let names = ["0.5", "v[0]"];
        let text = e.in_c("coil", &|i| names[i].to_owned());
        let valued = e.with_values(&|name| (name == "a").then_some(-0.5));
        assert_eq!(valued, "(-0.5)*lag(abs(x), 300) - x^2/3");
        assert_eq!(text, "((0.5 * lag_coil(m, 0, fabs(v[0]), 300.0)) - (pow(v[0], 2.0) / 3.0))");
    }
}
