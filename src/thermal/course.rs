//! What a stepped solution leaves behind: outputs and their rates at each step, and everything between by cubic Hermite
//! polynomials.

/// The course of one output: its value and its rate at each step.
#[derive(Debug, Clone, Default)]
pub(super) struct Course {
    pub times_s: Vec<f64>,
    /// Row-major, steps × outputs.
    pub value: Vec<f64>,
    pub rate: Vec<f64>,
}

impl Course {
    /// Cubic Hermite between steps; constant before the first and behind the last.
    pub fn at(&self, time_s: f64, outputs: usize, value: &mut [f64], rate: &mut [f64]) {
        let row = |data: &'_ [f64], i: usize, j: usize| data[i * outputs + j];
        let last = self.times_s.len() - 1;
        let after = self.times_s.partition_point(|&t| t <= time_s);
        if after == 0 || after > last {
            let i = if after == 0 { 0 } else { last };
            value.copy_from_slice(&self.value[i * outputs..(i + 1) * outputs]);
            rate.fill(0.0);
            return;
        }
        let (a, b) = (after - 1, after);
        let h = self.times_s[b] - self.times_s[a];
        let x = (time_s - self.times_s[a]) / h;
        for j in 0..outputs {
            let (y0, y1) = (row(&self.value, a, j), row(&self.value, b, j));
            let (f0, f1) = (row(&self.rate, a, j), row(&self.rate, b, j));
            let change = (y1 - y0) / h;
            let (bend0, bend1) = (f0 - change, f1 - change);
            value[j] = y0 + (y1 - y0) * x + h * x * (1.0 - x) * ((1.0 - x) * bend0 - x * bend1);
            rate[j] = change + (1.0 - x) * (1.0 - 3.0 * x) * bend0 - x * (2.0 - 3.0 * x) * bend1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_followed_exactly_and_stands_still_outside() {
        let (y, f) = (|t: f64| t * t * t - 2.0 * t, |t: f64| 3.0 * t * t - 2.0);
        let times_s = vec![0.0, 1.0, 3.0];
        let course = Course {
            value: times_s.iter().map(|t| y(*t)).collect(),
            rate: times_s.iter().map(|t| f(*t)).collect(),
            times_s,
        };
        let (mut value, mut rate) = ([0.0], [0.0]);
        for t in [0.0, 0.4, 1.0, 1.7, 2.9] {
            course.at(t, 1, &mut value, &mut rate);
            assert!((value[0] - y(t)).abs() < 1e-12 && (rate[0] - f(t)).abs() < 1e-12, "{t}: {value:?} {rate:?}");
        }
        for (t, expected) in [(-1.0, y(0.0)), (4.0, y(3.0))] {
            course.at(t, 1, &mut value, &mut rate);
            assert_eq!((value[0], rate[0]), (expected, 0.0));
        }
    }
}
