//! A linear pack under Laplace's transform, layer by layer in closed form: no grid.
//!
//! ```text
//! (r T')' = q² r T,   q² = (s + K μ)/K          T = Σ a_n x^n,   x = (r − r₁)/h,   ε = h/r₁,   Q = q² h²
//! (n+1)(n+2) a_{n+2} = Q (a_n + ε a_{n−1}) − ε (n+1)² a_{n+1}
//! ```
//!
//! The power series gives what flows into a layer from the temperatures of its two faces, and its mean. Faces make a
//! tridiagonal system in s; what lies around the pack, and the waves along its axis whose K μ is added to s, stand in
//! [`super::parts`].
//!
//! # Source
//! Carslaw and Jaeger, Conduction of Heat in Solids (1959), sections 3.4 (matrices of layers) and 13.4.

use nalgebra::Complex;

use super::physics::Physics;
use crate::rate::CoilModel;

type C = Complex<f64>;

/// |q| h of the thickest piece that one series is used for.
const SERIES_REACH: f64 = 6.0;
/// Terms that it then takes to leave nothing.
const TERMS: usize = 60;
/// Nothing comes through a layer of this Re(q) h.
const OPAQUE: f64 = 40.0;

/// What drives a pack: what touches its bore, of one kelvin; what its surface faces; a heat flow of one watt into the bore.
pub(super) const CAUSES: usize = 3;

/// The pack as plain numbers, per radian and height.
#[derive(Debug, Clone)]
pub(super) struct Layers {
    pub(crate) layers: usize,
    pub(crate) outermost_is_drive: bool,
    /// Faces from the bore outwards; the last is where the drive is, or its film.
    faces_m: Vec<f64>,
    conductivity_w_per_m_k: f64,
    heat_capacity_j_per_m3_k: f64,
    /// Between the bore and a spool, times the bore's radius.
    contact: Option<f64>,
    /// Between the surface and what it faces, times the outer radius; none where its temperature is given.
    pub(crate) film: Option<f64>,
    /// Layers inside a contact, and its conductance per area [W/(m² K)].
    gaps: Vec<(usize, f64)>,
}

/// What each cause makes of a pack.
#[derive(Debug)]
pub(super) struct Felt {
    /// The layers' means, but of an outermost one that is the drive.
    pub(crate) means: [Vec<C>; CAUSES],
    /// Temperature of the bore and of the surface.
    pub(crate) bore: [C; CAUSES],
    pub(crate) surface: [C; CAUSES],
    /// ∫ r T dr.
    pub(crate) content: [C; CAUSES],
}

/// What flows into a piece from either face, per kelvin of each, and its mean.
struct Piece {
    inner: C,
    between: C,
    outer: C,
    mean: [C; 2],
}

impl Layers {
    pub(crate) fn new(model: &CoilModel, physics: &Physics) -> Self {
        let coil = &model.coil;
        let (layers, bore_m, pitch_m) = (coil.layers(), coil.bore_radius_m(), coil.radial_pitch_m());
        let outermost_is_drive = !physics.driven_from_outside;
        let mut faces_m: Vec<f64> = (0..=layers).map(|j| bore_m + j as f64 * pitch_m).collect();
        if outermost_is_drive {
            faces_m[layers] -= 0.5 * pitch_m;
        }
        // The pack's own surface faces the innermost housing.
        let film = physics.housings.first().map(|housing| housing[1]).or(physics.film_w_per_m2_k);
        Self {
            layers,
            outermost_is_drive,
            film: film.filter(|_| !outermost_is_drive).map(|h| h * faces_m[layers]),
            faces_m,
            conductivity_w_per_m_k: physics.conductivity_w_per_m_k,
            heat_capacity_j_per_m3_k: physics.heat_capacity_j_per_m3_k,
            contact: physics.spool.map(|spool| spool.contact_w_per_m2_k * bore_m),
            gaps: physics.gaps.clone(),
        }
    }

    pub(crate) fn bore_radius_m(&self) -> f64 {
        self.faces_m[0]
    }

    pub(crate) fn outer_radius_m(&self) -> f64 {
        self.faces_m[self.faces_m.len() - 1]
    }

    /// Layers that are solved for.
    pub(crate) fn solved(&self) -> usize {
        self.layers - usize::from(self.outermost_is_drive)
    }

    /// What each cause makes of the pack; `per_s` is s + K μ.
    #[expect(clippy::too_many_lines, reason = "one elimination: assembled, swept and read again over the same faces")]
    pub(crate) fn felt(&self, per_s: C) -> Felt {
        let q = (per_s * self.heat_capacity_j_per_m3_k / self.conductivity_w_per_m_k).sqrt();
        let mut cut = Vec::new();
        for (layer, pair) in self.faces_m.windows(2).enumerate() {
            let thickness_m = pair[1] - pair[0];
            let parts =
                if q.re * thickness_m > OPAQUE { 1.0 } else { (q.norm() * thickness_m / SERIES_REACH).ceil().max(1.0) };
            for part in 0..parts as usize {
                let at = |i: f64| pair[0] + thickness_m * i / parts;
                cut.push((layer, at(part as f64), at(part as f64 + 1.0)));
            }
        }
        let pieces: Vec<Piece> = cut.iter().map(|&(_, from_m, to_m)| self.piece(q, per_s, from_m, to_m)).collect();
        let zero = C::new(0.0, 0.0);
        // Pieces share a face, but where a contact lies between them each has its own.
        let (mut contacts, mut inner_of) = (Vec::new(), Vec::with_capacity(cut.len()));
        let mut face = 0;
        for (i, &(layer, from_m, _)) in cut.iter().enumerate() {
            let is_first = i > 0 && cut[i - 1].0 != layer;
            if let Some((_, conductance)) = self.gaps.iter().find(|gap| is_first && gap.0 == layer) {
                contacts.push((face, conductance * from_m));
                face += 1;
            }
            inner_of.push(face);
            face += 1;
        }
        let last = face;
        let (mut diagonal, mut off) = (vec![zero; last + 1], vec![zero; last]);
        let mut faces = [(); CAUSES].map(|()| vec![zero; last + 1]);
        for (i, piece) in pieces.iter().enumerate() {
            diagonal[inner_of[i]] += piece.inner;
            diagonal[inner_of[i] + 1] += piece.outer;
            off[inner_of[i]] = piece.between;
        }
        for (inner, conductance) in contacts {
            diagonal[inner] += conductance;
            diagonal[inner + 1] += conductance;
            off[inner] = (-conductance).into();
        }
        if let Some(contact) = self.contact {
            diagonal[0] += contact;
            faces[0][0] += contact;
        }
        faces[2][0] += 1.0;
        match self.film {
            Some(film) => {
                diagonal[last] += film;
                faces[1][last] += film;
            }
            None => {
                // Its temperature is given.
                faces[1][last - 1] -= off[last - 1];
                (diagonal[last], faces[1][last], off[last - 1]) = (C::new(1.0, 0.0), C::new(1.0, 0.0), zero);
            }
        }
        for i in 1..=last {
            let share = off[i - 1] / diagonal[i - 1];
            diagonal[i] -= share * off[i - 1];
            for right in &mut faces {
                let before = right[i - 1];
                right[i] -= share * before;
            }
        }
        for right in &mut faces {
            for i in (0..=last).rev() {
                let next = if i < last { off[i] * right[i + 1] } else { zero };
                right[i] = (right[i] - next) / diagonal[i];
            }
        }
        let of = |right: &[C]| {
            let (mut means, mut content) = (vec![zero; self.layers], zero);
            for (i, (piece, &(layer, from_m, to_m))) in pieces.iter().zip(&cut).enumerate() {
                let held = (piece.mean[0] * right[inner_of[i]] + piece.mean[1] * right[inner_of[i] + 1])
                    * (0.5 * (to_m * to_m - from_m * from_m));
                content += held;
                means[layer] += held;
            }
            for (mean, pair) in means.iter_mut().zip(self.faces_m.windows(2)) {
                *mean /= 0.5 * (pair[1] * pair[1] - pair[0] * pair[0]);
            }
            (means, content)
        };
        let held = faces.each_ref().map(|right| of(right));
        Felt {
            bore: faces.each_ref().map(|right| right[0]),
            surface: faces.each_ref().map(|right| right[last]),
            content: held.each_ref().map(|(_, content)| *content),
            means: held.map(|(means, _)| means),
        }
    }

    fn piece(&self, q: C, per_s: C, from_m: f64, to_m: f64) -> Piece {
        let (k, h) = (self.conductivity_w_per_m_k, to_m - from_m);
        let held = per_s * (self.heat_capacity_j_per_m3_k * 0.5 * (to_m * to_m - from_m * from_m));
        if q.re * h > OPAQUE {
            // A wave dies away from each face as e^{−qx}/√r.
            let inner = (q + 0.5 / from_m) * (k * from_m);
            let outer = (q - 0.5 / to_m) * (k * to_m);
            return Piece { inner, between: C::new(0.0, 0.0), outer, mean: [inner / held, outer / held] };
        }
        let epsilon = h / from_m;
        let big_q = q * q * (h * h);
        // From 1 and 0, and from 0 and 1, at the inner face: value and slope at the outer one, and mean over the volume.
        let [u, v] = [[1.0, 0.0], [0.0, 1.0]].map(|[value, slope]| {
            let (mut a, mut b, mut before) = (C::new(value, 0.0), C::new(slope, 0.0), C::new(0.0, 0.0));
            let (mut end, mut end_slope, mut mean) = (a + b, b, a * (1.0 + 0.5 * epsilon) + b * (0.5 + epsilon / 3.0));
            for n in 0..TERMS {
                let one = n as f64 + 1.0;
                let next = (big_q * (a + before * epsilon) - b * (epsilon * one * one)) / (one * (one + 1.0));
                (before, a, b) = (a, b, next);
                end += next;
                end_slope += next * (one + 1.0);
                mean += next * (1.0 / (one + 2.0) + epsilon / (one + 3.0));
            }
            (end, end_slope, mean / (1.0 + 0.5 * epsilon))
        });
        let (inner_w, outer_w) = (k * from_m / h, k * to_m / h);
        Piece {
            inner: u.0 / v.0 * inner_w,
            between: C::new(-inner_w, 0.0) / v.0,
            outer: v.1 / v.0 * outer_w,
            mean: [u.2 - v.2 * u.0 / v.0, v.2 / v.0],
        }
    }
}
