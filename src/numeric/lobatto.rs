//! Polynomials through the nodes of Legendre, Gauss and Lobatto: interpolation, differentiation, quadrature.
//!
//! ```text
//! ∫_{−1}^{1} f dx ≈ Σ_i w_i f(x_i),   x_0 = −1, x_p = 1, the others the roots of P_p',   w_i = 2/(p (p+1) P_p(x_i)²)
//! ```
//!
//! Exact for polynomials of degree 2p − 1 (Lobatto, p + 1 nodes) and 2n − 1 (Gauss, n nodes).
//!
//! # Source
//! Canuto, Hussaini, Quarteroni, Zang, Spectral Methods: Fundamentals in Single Domains (2006), section 2.3.

use nalgebra::DMatrix;

/// Newton's iteration from Chebyshev's nodes needs five or six.
const ITERATIONS: usize = 50;

/// Nodes, weights and the matrix of derivatives of one order p.
#[derive(Debug, Clone)]
pub(crate) struct Lobatto {
    /// p + 1, ascending from −1 to 1.
    pub(crate) nodes: Vec<f64>,
    pub(crate) weights: Vec<f64>,
    /// D_ij = ℓ_j'(x_i).
    pub(crate) derivative: DMatrix<f64>,
    /// Of the barycentric formula.
    barycentric: Vec<f64>,
}

/// P_p and P_{p−1} at x.
fn legendre(order: usize, x: f64) -> (f64, f64) {
    let (mut before, mut here) = (0.0, 1.0);
    for k in 0..order {
        let k = k as f64;
        (before, here) = (here, ((2.0 * k + 1.0) * x * here - k * before) / (k + 1.0));
    }
    (here, before)
}

impl Lobatto {
    /// # Panics
    /// If `order` is 0.
    pub(crate) fn new(order: usize) -> Self {
        assert!(order > 0, "a polynomial through both ends has at least degree one");
        let p = order as f64;
        let nodes: Vec<f64> = (0..=order)
            .map(|i| {
                if i == 0 || i == order {
                    return if i == 0 { -1.0 } else { 1.0 };
                }
                let mut x = -(std::f64::consts::PI * i as f64 / p).cos();
                for _ in 0..ITERATIONS {
                    let (here, before) = legendre(order, x);
                    let step = (x * here - before) / ((p + 1.0) * here);
                    x -= step;
                    if step.abs() < 1e-16 {
                        break;
                    }
                }
                x
            })
            .collect();
        let at_nodes: Vec<f64> = nodes.iter().map(|&x| legendre(order, x).0).collect();
        let weights = at_nodes.iter().map(|l| 2.0 / (p * (p + 1.0) * l * l)).collect();
        let barycentric: Vec<f64> = (0..=order)
            .map(|i| (0..=order).filter(|&j| j != i).map(|j| 1.0 / (nodes[i] - nodes[j])).product())
            .collect();
        let mut derivative = DMatrix::from_fn(order + 1, order + 1, |i, j| {
            if i == j { 0.0 } else { barycentric[j] / barycentric[i] / (nodes[i] - nodes[j]) }
        });
        // A constant has no derivative.
        for i in 0..=order {
            derivative[(i, i)] = -derivative.row(i).sum();
        }
        Self { nodes, weights, derivative, barycentric }
    }

    /// ℓ_j(x) of every node.
    pub(crate) fn basis(&self, x: f64) -> Vec<f64> {
        if let Some(at) = self.nodes.iter().position(|node| *node == x) {
            return (0..self.nodes.len()).map(|j| f64::from(j == at)).collect();
        }
        let parts: Vec<f64> = self.nodes.iter().zip(&self.barycentric).map(|(node, b)| b / (x - node)).collect();
        let whole: f64 = parts.iter().sum();
        parts.iter().map(|part| part / whole).collect()
    }
}

/// Nodes and weights of Gauss on −1 … 1.
pub(crate) fn gauss(count: usize) -> Vec<(f64, f64)> {
    let n = count as f64;
    (0..count)
        .map(|i| {
            let mut x = -(std::f64::consts::PI * (i as f64 + 0.75) / (n + 0.5)).cos();
            let slope_at = |x: f64| {
                let (here, before) = legendre(count, x);
                (here, n * (before - x * here) / (1.0 - x * x))
            };
            for _ in 0..ITERATIONS {
                let (here, slope) = slope_at(x);
                x -= here / slope;
                if (here / slope).abs() < 1e-16 {
                    break;
                }
            }
            let slope = slope_at(x).1;
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrature_is_exact_up_to_its_degree_and_not_beyond() {
        let exact = |degree: i32| if degree % 2 == 0 { 2.0 / f64::from(degree + 1) } else { 0.0 };
        for order in [1, 2, 5, 8, 12] {
            let lobatto = Lobatto::new(order);
            let of = |d: i32| lobatto.nodes.iter().zip(&lobatto.weights).map(|(x, w)| w * x.powi(d)).sum::<f64>();
            for degree in 0..2 * order as i32 {
                assert!((of(degree) - exact(degree)).abs() < 1e-14, "{order} {degree}");
            }
            assert!((of(2 * order as i32) - exact(2 * order as i32)).abs() > 1e-9);
            let nodes = gauss(order);
            let of = |d: i32| nodes.iter().map(|(x, w)| w * x.powi(d)).sum::<f64>();
            for degree in 0..2 * order as i32 {
                assert!((of(degree) - exact(degree)).abs() < 1e-14, "{order} {degree}");
            }
        }
    }

    #[test]
    fn polynomials_are_interpolated_and_differentiated_exactly() {
        let lobatto = Lobatto::new(7);
        let f = |x: f64| 3.0 * x.powi(7) - x.powi(4) + 0.5 * x - 2.0;
        let slope = |x: f64| 21.0 * x.powi(6) - 4.0 * x.powi(3) + 0.5;
        let values: Vec<f64> = lobatto.nodes.iter().map(|x| f(*x)).collect();
        for (i, x) in lobatto.nodes.iter().enumerate() {
            let found: f64 = (0..8).map(|j| lobatto.derivative[(i, j)] * values[j]).sum();
            assert!((found - slope(*x)).abs() < 1e-12, "{x}");
        }
        for x in [-1.0, -0.83, 0.11, 0.999, 1.0] {
            let found: f64 = lobatto.basis(x).iter().zip(&values).map(|(l, v)| l * v).sum();
            assert!((found - f(x)).abs() < 1e-13, "{x}");
        }
    }
}
