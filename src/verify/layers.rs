//! A linear pack under Laplace's transform, layer by layer in closed form: no grid.
//!
//! ```text
//! (r T')' = q² r T,   q² = (s + K μ)/K          T = Σ a_n x^n,   x = (r − r₁)/h,   ε = h/r₁,   Q = q² h²
//! (n+1)(n+2) a_{n+2} = Q (a_n + ε a_{n−1}) − ε (n+1)² a_{n+1}
//! ```
//!
//! The power series gives what flows into a layer from the temperatures of its two faces, and its mean. Faces, spool and
//! film make a tridiagonal system in s. Where flanges exchange heat, the axis has the waves of a slab,
//! cos bζ + (β₁/b) sin bζ with (b² − β₁ β₂) tan b = b (β₁ + β₂) and β = h H/k of either flange; each carries such a system
//! with K μ = K b²/H² added to s.
//!
//! # Source
//! Carslaw and Jaeger, Conduction of Heat in Solids (1959), sections 3.4 (matrices of layers), 3.11 and 13.4.

use nalgebra::Complex;

use super::physics::{BoreHeat, Physics};
use crate::rate::CoilModel;

type C = Complex<f64>;

/// |q| h of the thickest piece that one series is used for.
const SERIES_REACH: f64 = 6.0;
/// Terms that it then takes to leave nothing.
const TERMS: usize = 60;
/// Nothing comes through a layer of this Re(q) h.
const OPAQUE: f64 = 40.0;
/// Cosines along the axis, and how many more per unit of h H/k; their shares fall as the fourth power of their number.
const COSINES: usize = 80;
const COSINES_PER_BIOT: f64 = 0.5;
const MOST_COSINES: usize = 400;

/// The pack as plain numbers, per radian and height.
#[derive(Debug, Clone)]
pub(super) struct Layers {
    pub(crate) layers: usize,
    pub(crate) outermost_is_drive: bool,
    /// Faces from the bore outwards; the last is where the drive is, or its film.
    faces_m: Vec<f64>,
    conductivity_w_per_m_k: f64,
    heat_capacity_j_per_m3_k: f64,
    /// Heat capacity, contact and mount of the spool, times the bore's radius.
    spool: Option<[f64; 3]>,
    bore_radius_m: f64,
    film: Option<f64>,
    cosines: Option<Vec<Cosine>>,
    /// Layers inside a contact, and its conductance per area [W/(m² K)].
    gaps: Vec<(usize, f64)>,
    /// Heat capacity and conductance inwards of each housing, and what joins the outermost to the drive, times the outer radius.
    housings: Vec<[f64; 2]>,
    outside: f64,
}

/// One cosine along the axis.
#[derive(Debug, Clone, Copy)]
struct Cosine {
    decay_per_s: f64,
    /// Of a uniform one, and of the air at the flange, per second.
    uniform: f64,
    from_air_per_s: f64,
    mean: f64,
    moment: f64,
}

/// What flows into a piece from either face, per kelvin of each, and its mean.
struct Piece {
    inner: C,
    between: C,
    outer: C,
    mean: [C; 2],
}

impl Layers {
    pub(crate) fn new(model: &CoilModel, physics: &Physics, height_m: f64) -> Self {
        let coil = &model.coil;
        let (layers, bore_m, pitch_m) = (coil.layers(), coil.bore_radius_m(), coil.radial_pitch_m());
        let outermost_is_drive = !physics.driven_from_outside;
        let mut faces_m: Vec<f64> = (0..=layers).map(|j| bore_m + j as f64 * pitch_m).collect();
        if outermost_is_drive {
            faces_m[layers] -= 0.5 * pitch_m;
        }
        let film = physics.film_w_per_m2_k.filter(|_| !outermost_is_drive);
        let cosines = (!physics.flanges.is_empty()).then(|| {
            let biot = |first: bool| -> f64 {
                let films = physics.flanges.iter().filter(|flange| flange.is_first == first);
                films.map(|flange| flange.film_w_per_m2_k * height_m / physics.conductivity_w_per_m_k).sum()
            };
            let (at_first, at_second) = (biot(true), biot(false));
            let per_s = physics.diffusivity_m2_per_s() / (height_m * height_m);
            let count = (COSINES + (COSINES_PER_BIOT * (at_first + at_second)) as usize).min(MOST_COSINES);
            (0..count)
                .map(|n| {
                    let b = root(n, at_first, at_second);
                    let (sine, cosine, tilt) = (b.sin(), b.cos(), at_first / b);
                    let twice = (2.0 * b).sin() / (2.0 * b);
                    let norm = 0.5 * (1.0 + twice)
                        + 0.5 * tilt * tilt * (1.0 - twice)
                        + tilt * (1.0 - (2.0 * b).cos()) / (2.0 * b);
                    let mean = sine / b + tilt * (1.0 - cosine) / b;
                    let first_moment = sine / b + (cosine - 1.0) / (b * b) + tilt * (sine / (b * b) - cosine / b);
                    Cosine {
                        decay_per_s: per_s * b * b,
                        uniform: mean / norm,
                        from_air_per_s: per_s * (at_first + at_second * (cosine + tilt * sine)) / norm,
                        mean,
                        moment: first_moment - 0.5 * mean,
                    }
                })
                .collect()
        });
        let outer_m = faces_m[layers];
        let housings: Vec<[f64; 2]> = physics.housings.iter().map(|h| h.map(|v| v * outer_m)).collect();
        // The pack's own surface faces the innermost housing.
        let film = housings.first().map(|housing| housing[1]).or(film.map(|h| h * outer_m));
        Self {
            layers,
            outermost_is_drive,
            film,
            outside: physics.film_w_per_m2_k.map_or(0.0, |h| h * outer_m),
            housings,
            faces_m,
            conductivity_w_per_m_k: physics.conductivity_w_per_m_k,
            heat_capacity_j_per_m3_k: physics.heat_capacity_j_per_m3_k,
            spool: physics
                .spool
                .map(|s| [s.heat_capacity_j_per_m2_k, s.contact_w_per_m2_k, s.mount_w_per_m2_k].map(|v| v * bore_m)),
            bore_radius_m: bore_m,
            cosines,
            gaps: physics.gaps.clone(),
        }
    }

    pub(crate) fn has_moments(&self) -> bool {
        self.cosines.is_some()
    }

    /// s T̂ of every layer (and of its moment) under a unit ramp, and under the bore's heat.
    pub(crate) fn transform(&self, heat: Option<BoreHeat>, s: C) -> (Vec<C>, Option<Vec<C>>) {
        let outputs = self.layers * if self.has_moments() { 2 } else { 1 };
        let zero = C::new(0.0, 0.0);
        let mut ramp = vec![zero; outputs];
        let mut heated = heat.map(|_| vec![zero; outputs]);
        let uniform = Cosine { decay_per_s: 0.0, uniform: 1.0, from_air_per_s: 0.0, mean: 1.0, moment: 0.0 };
        // s q̂ = q∞/(1 + s τ).
        let by_heat = heat.map(|h| h.power_w_per_m2 / (s * h.time_constant_s + 1.0));
        for cosine in self.cosines.as_deref().unwrap_or(&[uniform]) {
            let (mut by_drive, mut by_bore, from_inside) = self.means(s, cosine);
            if !self.housings.is_empty() {
                let [inner, heated] = self.innermost(s, from_inside);
                for (of_bore, of_drive) in by_bore.iter_mut().zip(&by_drive) {
                    *of_bore += of_drive * heated;
                }
                by_drive.iter_mut().for_each(|of_drive| *of_drive *= inner);
            }
            for layer in 0..self.layers {
                let put = |out: &mut [C], value: C| {
                    out[layer] += value * cosine.mean;
                    if self.cosines.is_some() {
                        out[self.layers + layer] += value * cosine.moment;
                    }
                };
                put(&mut ramp, by_drive[layer] / s);
                if let (Some(heated), Some(factor)) = (&mut heated, by_heat) {
                    put(heated, by_bore[layer] * factor);
                }
            }
        }
        (ramp, heated)
    }

    /// The innermost housing's temperature per kelvin of the drive, and per watt a square metre into the bore; `inside` is what
    /// comes back from within per kelvin of that housing, and per watt.
    fn innermost(&self, s: C, inside: [C; 2]) -> [C; 2] {
        // What the innermost passes on outwards: a chain of links, folded up from the drive inwards.
        let (mut link, mut source) = (C::new(self.outside, 0.0), C::new(1.0, 0.0));
        for (i, [capacity, inwards]) in self.housings.iter().enumerate().skip(1).rev() {
            let own = s * capacity + link + inwards;
            debug_assert!(i > 0);
            source = source * link / (own - inwards);
            link = (own - inwards) * inwards / own;
        }
        let [capacity, inwards] = self.housings[0];
        let mount = self.spool.map_or(0.0, |spool| spool[2]);
        let own = s * capacity + inwards + mount - inside[0] + link;
        [link * source / own, inside[1] / own]
    }

    /// The layers' means under drive and air of one kelvin, and under a heat flow of one watt a square metre into the bore; and
    /// what surface and spool give back to what drives them.
    #[expect(clippy::too_many_lines, reason = "one elimination: assembled, swept and read again over the same nodes")]
    fn means(&self, s: C, cosine: &Cosine) -> (Vec<C>, Vec<C>, [C; 2]) {
        let capacity = self.heat_capacity_j_per_m3_k;
        let diffusivity = self.conductivity_w_per_m_k / capacity;
        let per_s = s + cosine.decay_per_s;
        let q = (per_s / diffusivity).sqrt();
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
        let spool = usize::from(self.spool.is_some());
        // Pieces share a face, but where a contact lies between them each has its own.
        let (mut contacts, mut inner_of) = (Vec::new(), Vec::with_capacity(cut.len()));
        let mut face = spool;
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
        // What the flange's air makes of the pack by itself stands apart: it is the same everywhere in it.
        let by_air = C::new(cosine.from_air_per_s, 0.0) / per_s;
        let (mut diagonal, mut off) = (vec![zero; last + 1], vec![zero; last]);
        let (mut driven, mut warmed) = (vec![zero; last + 1], vec![zero; last + 1]);
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
        warmed[0] = (self.bore_radius_m * cosine.uniform).into();
        if let Some([heat, contact, mount]) = self.spool {
            diagonal[0] = s * heat + contact + mount;
            off[0] = (-contact).into();
            diagonal[1] += contact;
            driven[0] = by_air * contact + mount * cosine.uniform;
            driven[1] -= by_air * contact;
        }
        match self.film {
            Some(film) => {
                diagonal[last] += film;
                driven[last] += (C::new(cosine.uniform, 0.0) - by_air) * film;
            }
            None => {
                // Its temperature is given.
                let given = C::new(cosine.uniform, 0.0) - by_air;
                driven[last - 1] -= off[last - 1] * given;
                (diagonal[last], driven[last], warmed[last]) = (C::new(1.0, 0.0), given, zero);
            }
        }
        let is_given = self.film.is_none();
        for i in 1..=last {
            if i == last && is_given {
                break;
            }
            let share = off[i - 1] / diagonal[i - 1];
            let (before, before_warmed) = (driven[i - 1], warmed[i - 1]);
            diagonal[i] -= share * off[i - 1];
            driven[i] -= share * before;
            warmed[i] -= share * before_warmed;
        }
        for right in [&mut driven, &mut warmed] {
            for i in (0..=last).rev() {
                let next = if i < last && !(is_given && i + 1 == last) { off[i] * right[i + 1] } else { zero };
                right[i] = (right[i] - next) / diagonal[i];
            }
        }
        let solved = self.layers - usize::from(self.outermost_is_drive);
        let (mut by_drive, mut by_bore) = (vec![zero; self.layers], vec![zero; self.layers]);
        let volume = |from_m: f64, to_m: f64| to_m * to_m - from_m * from_m;
        for (i, (piece, &(layer, from_m, to_m))) in pieces.iter().zip(&cut).enumerate() {
            if layer < solved {
                let share = volume(from_m, to_m) / volume(self.faces_m[layer], self.faces_m[layer + 1]);
                let mean = |of: &[C]| (piece.mean[0] * of[inner_of[i]] + piece.mean[1] * of[inner_of[i] + 1]) * share;
                by_drive[layer] += mean(&driven) + by_air * share;
                by_bore[layer] += mean(&warmed);
            }
        }
        let mount = self.spool.map_or(0.0, |spool| spool[2]);
        let back = |of: &[C]| of[last] * self.film.unwrap_or(0.0) + if spool > 0 { of[0] * mount } else { zero };
        let given_back = [back(&driven), back(&warmed)];
        (by_drive, by_bore, given_back)
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

/// The n-th root of (b² − β₁ β₂) tan b = b (β₁ + β₂), in (nπ, (n + 1)π).
fn root(n: usize, at_first: f64, at_second: f64) -> f64 {
    let start = n as f64 * std::f64::consts::PI;
    // The tangent's period takes the sign of sine and cosine along.
    let (mut low, mut high) = (0.0, std::f64::consts::PI);
    for _ in 0..100 {
        let middle: f64 = 0.5 * (low + high);
        let b = start + middle;
        if (b * b - at_first * at_second) * middle.sin() < b * (at_first + at_second) * middle.cos() {
            low = middle;
        } else {
            high = middle;
        }
    }
    start + 0.5 * (low + high)
}
