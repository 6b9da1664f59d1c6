//! Spectral elements along one coordinate: polynomials of high order through Lobatto's nodes, element after element.
//!
//! ```text
//! ∫ w f g dx ≈ Σ_i m_i f_i g_i,   ∫ w f' g' dx ≈ Σ_ij s_ij f_i g_j      m, s by Lobatto's quadrature: m is diagonal
//! ```
//!
//! The errors of smooth fields fall exponentially with the order. What is not smooth is the front behind a change of ramp,
//! at the depth √(4Kt) that it has reached; elements that grow with their distance from the surface resolve it at every
//! time, and cost a number of nodes that grows with the logarithm of the depth only.
//!
//! # Source
//! Patera, J. Comput. Phys. 54 (1984) 468; grading towards a singularity: Schwab, p- and hp-Finite Element Methods (1998),
//! section 3.3.

use nalgebra::DMatrix;

use crate::numeric::lobatto::{Lobatto, gauss};

/// Each element is so many times as wide as the next one towards the surface.
const GROWTH: f64 = 2.0;
/// What is left between two sides becomes one element if it is at most so many times as wide as the next one would be.
const LAST: f64 = 1.5;
/// A break closer than this share of an element's width to one that must be there gives way.
const CLOSE: f64 = 0.3;

/// The widths of elements along a length: the narrowest at the ends that are `Some`, growing to at most `widest`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grading {
    pub(crate) at_start: Option<f64>,
    pub(crate) at_end: Option<f64>,
    pub(crate) widest: f64,
}

impl Grading {
    /// Ends of elements from 0 to `length`.
    pub(crate) fn breaks(&self, length: f64) -> Vec<f64> {
        let (mut low, mut high) = (vec![0.0], vec![length]);
        let mut start = self.at_start.unwrap_or(self.widest).min(self.widest);
        let mut end = self.at_end.unwrap_or(self.widest).min(self.widest);
        loop {
            let (from, to) = (low[low.len() - 1], high[high.len() - 1]);
            let next = start.min(end);
            if to - from <= LAST * next {
                break;
            }
            if start < end {
                low.push(from + start);
                start = (start * GROWTH).min(self.widest);
            } else {
                high.push(to - end);
                end = (end * GROWTH).min(self.widest);
            }
        }
        low.extend(high.into_iter().rev());
        low
    }
}

/// Elements along a coordinate. Where two of them meet they share a node, or have one each.
#[derive(Debug, Clone)]
pub(super) struct Elements {
    reference: Lobatto,
    /// From where to where each reaches, and its first node.
    pieces: Vec<(f64, f64, usize)>,
    nodes: usize,
}

impl Elements {
    /// Between the given ends; at a cut both sides have nodes of their own, and an end is put there.
    pub(crate) fn new(order: usize, mut breaks: Vec<f64>, cuts: &[f64]) -> Self {
        for &cut in cuts {
            let after = breaks.partition_point(|b| *b <= cut).clamp(1, breaks.len() - 1);
            let width = breaks[after] - breaks[after - 1];
            let inner = 1..breaks.len() - 1;
            let near = [after - 1, after].into_iter().filter(|i| inner.contains(i));
            let near: Vec<usize> =
                near.filter(|&i| (breaks[i] - cut).abs() < CLOSE * width && !cuts.contains(&breaks[i])).collect();
            near.iter().rev().for_each(|&i| {
                breaks.remove(i);
            });
            if !breaks.contains(&cut) {
                breaks.push(cut);
                breaks.sort_by(f64::total_cmp);
            }
        }
        let mut first = 0;
        let mut pieces = Vec::with_capacity(breaks.len() - 1);
        for pair in breaks.windows(2) {
            if !pieces.is_empty() && cuts.contains(&pair[0]) {
                first += 1;
            }
            pieces.push((pair[0], pair[1], first));
            first += order;
        }
        Self { reference: Lobatto::new(order), pieces, nodes: first + 1 }
    }

    pub(crate) fn nodes(&self) -> usize {
        self.nodes
    }

    fn order(&self) -> usize {
        self.reference.nodes.len() - 1
    }

    /// Where an element begins at a cut, its first node; the node on the other side is the one before.
    pub(crate) fn node_behind(&self, cut: f64) -> Option<usize> {
        self.pieces.iter().find(|piece| piece.0 == cut).map(|piece| piece.2)
    }

    /// m, with the weight w(x).
    pub(crate) fn masses(&self, weight: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut masses = vec![0.0; self.nodes];
        for &(from, to, first) in &self.pieces {
            let half = 0.5 * (to - from);
            for (i, (x, w)) in self.reference.nodes.iter().zip(&self.reference.weights).enumerate() {
                masses[first + i] += half * w * weight(from + half * (x + 1.0));
            }
        }
        masses
    }

    /// s, with the weight w(x).
    pub(crate) fn stiffness(&self, weight: impl Fn(f64) -> f64) -> DMatrix<f64> {
        let mut stiffness = DMatrix::zeros(self.nodes, self.nodes);
        let (order, d) = (self.order(), &self.reference.derivative);
        for &(from, to, first) in &self.pieces {
            let half = 0.5 * (to - from);
            let at_nodes: Vec<f64> = self
                .reference
                .nodes
                .iter()
                .zip(&self.reference.weights)
                .map(|(x, w)| w * weight(from + half * (x + 1.0)) / half)
                .collect();
            for i in 0..=order {
                for j in 0..=order {
                    stiffness[(first + i, first + j)] +=
                        at_nodes.iter().enumerate().map(|(q, w)| w * d[(q, i)] * d[(q, j)]).sum::<f64>();
                }
            }
        }
        stiffness
    }

    /// Factors of the nodes' values in ∫ w f dx over from … to.
    pub(crate) fn integral(&self, from: f64, to: f64, weight: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut factors = vec![0.0; self.nodes];
        // Exact for the polynomial times a weight of the first degree.
        let points = gauss(self.order() / 2 + 2);
        for &(start, end, first) in &self.pieces {
            let (low, high) = (start.max(from), end.min(to));
            if high <= low {
                continue;
            }
            let half = 0.5 * (high - low);
            for (x, w) in &points {
                let place = low + half * (x + 1.0);
                let inside = (2.0 * (place - start) / (end - start) - 1.0).clamp(-1.0, 1.0);
                for (i, l) in self.reference.basis(inside).iter().enumerate() {
                    factors[first + i] += half * w * weight(place) * l;
                }
            }
        }
        factors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_grow_from_graded_ends_and_fill_the_length() {
        for (length, at_start, at_end, widest) in [
            (7.5, None, Some(0.5), 8.0),
            (96.0, Some(0.5), Some(0.5), 8.0),
            (200.0, None, Some(0.25), 8.0),
            (0.3, None, None, 8.0),
        ] {
            let breaks = Grading { at_start, at_end, widest }.breaks(length);
            let widths: Vec<f64> = breaks.windows(2).map(|b| b[1] - b[0]).collect();
            assert!((breaks[0], breaks[breaks.len() - 1]) == (0.0, length));
            assert!(widths.iter().all(|w| *w > 0.0 && *w <= LAST * widest), "{widths:?}");
            assert!(widths.windows(2).all(|w| w[0] / w[1] < 3.1 && w[1] / w[0] < 3.1), "{widths:?}");
            if let Some(narrowest) = at_end.filter(|e| length > 2.0 * e) {
                assert!(widths[widths.len() - 1] <= LAST * narrowest, "{widths:?}");
            }
        }
    }

    #[test]
    fn polynomials_have_their_integrals_and_energies() {
        let elements = Elements::new(6, vec![1.0, 1.5, 2.5, 4.0], &[2.5]);
        assert_eq!(elements.nodes(), 20);
        assert_eq!(elements.node_behind(2.5), Some(13));
        let place = |i: usize| -> f64 {
            let piece = elements.pieces.iter().rev().find(|p| p.2 <= i).unwrap();
            piece.0 + 0.5 * (piece.1 - piece.0) * (elements.reference.nodes[i - piece.2] + 1.0)
        };
        let values: Vec<f64> = (0..20).map(|i| place(i).powi(3)).collect();
        let over = |factors: &[f64]| factors.iter().zip(&values).map(|(f, v)| f * v).sum::<f64>();
        // ∫ x · x³ from 1.2 to 3.7.
        let exact = (3.7_f64.powi(5) - 1.2_f64.powi(5)) / 5.0;
        assert!((over(&elements.integral(1.2, 3.7, |x| x)) - exact).abs() < 1e-12);
        let masses = elements.masses(|x| x);
        assert!((over(&masses) - (4.0_f64.powi(5) - 1.0) / 5.0).abs() < 1e-11);
        // ∫ x (3x²)² from 1 to 4.
        let column = nalgebra::DVector::from_vec(values.clone());
        let energy = (column.transpose() * elements.stiffness(|x| x) * &column)[(0, 0)];
        assert!((energy / (9.0 * (4.0_f64.powi(6) - 1.0) / 6.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_cut_takes_the_place_of_a_break_close_to_it() {
        let elements = Elements::new(4, vec![0.0, 1.0, 2.0, 4.0], &[1.1, 3.0]);
        let ends: Vec<f64> = elements.pieces.iter().map(|p| p.1).collect();
        assert_eq!(ends, [1.1, 2.0, 3.0, 4.0]);
        assert_eq!(elements.nodes(), 4 * 4 + 1 + 2);
    }
}
