//! What the stated materials make of the layers' optical paths, worked out again.
//!
//! ```text
//! ring:  (u, r σ_r) carried from the bore outwards through each annulus; u at the bore and ε_z from what the outer surface
//!        and the axis must be free of
//! cell:  the same from the glass to the cell's edge; transverse shear: that of a medium in which the cell makes no D/r
//! ```
//!
//! Nothing is assembled: both are shooting. Materials are interpolated here a second time, on a grid twice as fine.

use std::sync::OnceLock;

use nalgebra::{DMatrix, DVector};

use crate::coil::Coil;
use crate::stress::Materials;
use crate::stress::material::{COLDEST_K, Compression, HOTTEST_K, MOST_POISSON_RATIO, Material, Property};

const STEP_K: f64 = 0.0625;
/// Gauss's rule for what an annulus carries along the axis.
const GAUSS: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];
/// Halvings of the bracket of a shear modulus, in its logarithm.
const HALVINGS: usize = 60;

/// λ, μ and stress per kelvin of an isotropic material.
#[derive(Debug, Clone, Copy)]
struct Isotropic {
    lame: f64,
    shear: f64,
    heat: f64,
    expansion: f64,
}

fn value(property: &Property, at_k: f64, in_ratios: bool) -> f64 {
    let weigh = |a: f64, b: f64, share: f64| match in_ratios {
        true => a * (b / a).powf(share),
        false => a * (1.0 - share) + b * share,
    };
    match property {
        Property::Constant(v) => *v,
        Property::Transition { glassy, rubbery, transition_k, width_k } => {
            let glass = 0.5 * (1.0 - (0.5 * (at_k - transition_k) / width_k).tanh());
            weigh(*rubbery, *glassy, glass)
        }
        Property::Points(points) => {
            let mut found = points[0].1;
            for two in points.windows(2) {
                if at_k > two[0].0 {
                    let share = ((at_k - two[0].0) / (two[1].0 - two[0].0)).min(1.0);
                    found = weigh(two[0].1, two[1].1, share);
                }
            }
            found
        }
    }
}

fn isotropic(material: &Material, at_k: f64) -> Isotropic {
    let young = value(&material.youngs_modulus_pa, at_k, true);
    let ratio = match &material.compression {
        Compression::PoissonRatio(p) => value(p, at_k, false),
        Compression::BulkModulus(p) => 0.5 * (1.0 - young / (3.0 * value(p, at_k, true))),
    };
    let ratio = if ratio > MOST_POISSON_RATIO { MOST_POISSON_RATIO } else { ratio };
    let shear = 0.5 * young / (1.0 + ratio);
    let lame = 2.0 * shear * ratio / (1.0 - 2.0 * ratio);
    let expansion = value(&material.expansion_per_k, at_k, false);
    Isotropic { lame, shear, heat: young / (1.0 - 2.0 * ratio) * expansion, expansion }
}

/// A layer as one material: stress from strain along (a) and across (t) the fibre, and the glass's transverse strain.
#[derive(Debug, Clone, Copy)]
struct Layer {
    bulk: f64,
    cross: f64,
    along: f64,
    shear: f64,
    heat_t: f64,
    heat_a: f64,
    glass: [f64; 3],
    glass_expansion: f64,
}

/// Across a ring of a cell: mean strain A and B/r², from (u, σ_r) at its inner radius.
fn carried(m: &Isotropic, r: f64, u: f64, stress: f64, axial: f64, kelvin: f64) -> (f64, f64) {
    // σ_r = 2(λ+μ)A − 2μB/r² + λ e − heat T,  u/r = A + B/r².
    let rest = stress - m.lame * axial + m.heat * kelvin;
    let a = (rest + 2.0 * m.shear * u / r) / (2.0 * (m.lame + 2.0 * m.shear));
    (a, (u / r - a) * r * r)
}

fn layer(hole_m: f64, rings: &[(f64, Isotropic)]) -> Layer {
    let edge_m = rings[rings.len() - 1].0;
    // From an inner displacement (or the solid glass's strain) to u and σ_r at the edge, and ∫σ_a and the glass's strain.
    let shoot = |inner: f64, axial: f64, kelvin: f64| {
        let (mut u, mut stress, mut along, mut glass) = (0.0, 0.0, 0.0, 0.0);
        let mut from_m = hole_m;
        for (place, (to_m, m)) in rings.iter().enumerate() {
            let (a, b) = match place {
                0 if hole_m == 0.0 => (inner, 0.0),
                0 => carried(m, hole_m, inner * hole_m, 0.0, axial, kelvin),
                _ => carried(m, from_m, u, stress, axial, kelvin),
            };
            if place == 0 {
                glass = a;
            }
            along += (to_m * to_m - from_m * from_m)
                * (2.0 * m.lame * a + (m.lame + 2.0 * m.shear) * axial - m.heat * kelvin);
            u = a * to_m + b / to_m;
            stress =
                2.0 * (m.lame + m.shear) * a - 2.0 * m.shear * b / (to_m * to_m) + m.lame * axial - m.heat * kelvin;
            from_m = *to_m;
        }
        [u / edge_m, stress, along / (edge_m * edge_m), glass]
    };
    let free = shoot(1.0, 0.0, 0.0);
    let with = |transverse: f64, axial: f64, kelvin: f64| {
        let given = shoot(0.0, axial, kelvin);
        let inner = (transverse - given[0]) / free[0];
        [1, 2, 3].map(|i| given[i] + inner * free[i])
    };
    let (t, a, k) = (with(1.0, 0.0, 0.0), with(0.0, 1.0, 0.0), with(0.0, 0.0, 1.0));
    Layer {
        bulk: 0.5 * t[0],
        cross: 0.5 * t[1],
        along: a[1],
        shear: sheared(hole_m, rings),
        heat_t: -k[0],
        heat_a: -k[1],
        glass: [t[2], a[2], k[2]],
        glass_expansion: rings[0].1.expansion,
    }
}

/// The medium's shear modulus at which the cell in it makes no field ∝ 1/r.
fn sheared(hole_m: f64, rings: &[(f64, Isotropic)]) -> f64 {
    let stiffest = rings.iter().map(|(_, m)| m.shear).fold(0.0, f64::max);
    let softest = rings.iter().map(|(_, m)| m.shear).fold(f64::INFINITY, f64::min);
    // A hole is softer than anything.
    let mut low = if hole_m > 0.0 { 1e-9 * softest } else { softest };
    let mut high = stiffest;
    let at_high = disturbance(hole_m, rings, high * (1.0 + 1e-9));
    for _ in 0..HALVINGS {
        let middle = (low * high).sqrt();
        if disturbance(hole_m, rings, middle) * at_high > 0.0 { high = middle } else { low = middle }
    }
    (low * high).sqrt()
}

/// The coefficient of 1/r in the medium, for uniform shear far away: one dense system of all rings' four constants.
fn disturbance(hole_m: f64, rings: &[(f64, Isotropic)], medium: f64) -> f64 {
    let edge_m = rings[rings.len() - 1].0;
    let scale = rings.iter().map(|(_, m)| m.shear).fold(medium, f64::max);
    let of = |r: f64, m: &Isotropic| {
        let (nu, mu) = (0.5 * m.lame / (m.lame + m.shear), 2.0 * m.shear / scale);
        let s = r / edge_m;
        [
            [-2.0 * s / mu, 2.0 * s / mu, -2.0, 2.0],
            [-4.0 * nu * s.powi(3) / mu, (6.0 - 4.0 * nu) * s.powi(3) / mu, 0.0, 6.0 * s * s],
            [2.0 / s.powi(3) / mu, 2.0 / s.powi(3) / mu, -6.0 / s.powi(4), -6.0 / s.powi(4)],
            [4.0 * (1.0 - nu) / s / mu, -2.0 * (1.0 - 2.0 * nu) / s / mu, -4.0 / (s * s), -2.0 / (s * s)],
        ]
    };
    let is_hollow = hole_m > 0.0;
    let count = 4 * rings.len() - if is_hollow { 0 } else { 2 } + 2;
    let (mut matrix, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
    // Solid glass has no fields that are infinite at its axis.
    let first_column = |ring: usize| if is_hollow { 4 * ring } else { (4 * ring).saturating_sub(2) };
    let fields = |ring: usize| if ring == 0 && !is_hollow { 2 } else { 4 };
    let mut row = 0;
    if is_hollow {
        for (k, field) in of(hole_m, &rings[0].1).iter().enumerate() {
            (matrix[(0, k)], matrix[(1, k)]) = (field[2], field[3]);
        }
        row = 2;
    }
    // Any Poisson's ratio of the medium does: only its D/r would know it, and that is to vanish.
    let outside = of(edge_m, &Isotropic { lame: medium, shear: medium, heat: 0.0, expansion: 0.0 });
    for (ring, (outer_m, m)) in rings.iter().enumerate() {
        for (k, field) in of(*outer_m, m).iter().take(fields(ring)).enumerate() {
            (0..4).for_each(|i| matrix[(row + i, first_column(ring) + k)] = field[i]);
        }
        match rings.get(ring + 1) {
            Some((_, next)) => {
                for (k, field) in of(*outer_m, next).iter().enumerate() {
                    (0..4).for_each(|i| matrix[(row + i, first_column(ring + 1) + k)] = -field[i]);
                }
            }
            None => {
                for i in 0..4 {
                    matrix[(row + i, count - 2)] = -outside[2][i];
                    matrix[(row + i, count - 1)] = -outside[3][i];
                    right[row + i] = outside[0][i];
                }
            }
        }
        row += 4;
    }
    matrix.try_inverse().map_or(f64::NAN, |inverse| (inverse * right)[count - 1])
}

/// The strain of one coil, worked out from its materials.
#[derive(Debug)]
pub(super) struct Strain {
    materials: Materials,
    bore_m: f64,
    pitch_m: f64,
    cell_m: f64,
    index: f64,
    index_per_k: f64,
    /// By temperature, as far as asked for.
    layers: Vec<OnceLock<Layer>>,
}

/// One annulus: inner and outer radius, stiffness in its own directions, whether its stiff direction is the hoop.
struct Annulus {
    from_m: f64,
    to_m: f64,
    layer: Layer,
}

impl Annulus {
    /// γ, and u = p r of e and of T, where stiffness along the hoop and across differ.
    fn powers(&self) -> (f64, f64, f64) {
        let l = &self.layer;
        let (radial, hoop) = (l.bulk + l.shear, l.along);
        if (hoop / radial - 1.0).abs() < 1e-9 {
            return (1.0, 0.0, 0.0);
        }
        let free = hoop - radial;
        ((hoop / radial).sqrt(), (l.bulk - l.shear - l.cross) / free, (l.heat_a - l.heat_t) / free)
    }

    /// What u = `inner` and r σ_r = `pull` at the inner edge become: u at a radius, r u′ there.
    fn at(&self, r: f64, inner: f64, pull: f64, axial: f64, kelvin: f64) -> (f64, f64) {
        let l = &self.layer;
        let (gamma, of_axial, of_kelvin) = self.powers();
        let p = of_axial * axial + of_kelvin * kelvin;
        let rest = pull - l.cross * inner - ((l.bulk - l.shear) * axial - l.heat_t * kelvin) * self.from_m;
        // r u′ = γ (up − down) + p r at the inner edge.
        let difference = (rest / (l.bulk + l.shear) - p * self.from_m) / gamma;
        let sum = inner - p * self.from_m;
        let ratio = (r / self.from_m).powf(gamma);
        let (up, down) = (0.5 * (sum + difference) * ratio, 0.5 * (sum - difference) / ratio);
        (up + down + p * r, gamma * (up - down) + p * r)
    }

    fn pull(&self, r: f64, u: f64, r_slope: f64, axial: f64, kelvin: f64) -> f64 {
        let l = &self.layer;
        (l.bulk + l.shear) * r_slope + l.cross * u + ((l.bulk - l.shear) * axial - l.heat_t * kelvin) * r
    }
}

impl Strain {
    pub(crate) fn new(materials: &Materials, coil: &Coil) -> Self {
        let fibre = coil.fibre();
        let area_m2 = coil.radial_pitch_m() * coil.axial_pitch_m();
        Self {
            materials: materials.clone(),
            bore_m: coil.bore_radius_m(),
            pitch_m: coil.radial_pitch_m(),
            cell_m: (area_m2 / std::f64::consts::PI).sqrt(),
            index: fibre.refractive_index,
            index_per_k: fibre.thermo_optic_per_k,
            layers: vec![OnceLock::new(); ((HOTTEST_K - COLDEST_K) / STEP_K) as usize + 1],
        }
    }

    fn layer(&self, at_k: f64) -> Layer {
        let place = ((at_k - COLDEST_K) / STEP_K).clamp(0.0, (self.layers.len() - 2) as f64);
        let below = place.floor();
        let (a, b, share) = (self.node(below as usize), self.node(below as usize + 1), place - below);
        let mix = |of: fn(&Layer) -> f64| of(&a) * (1.0 - share) + of(&b) * share;
        Layer {
            bulk: mix(|l| l.bulk),
            cross: mix(|l| l.cross),
            along: mix(|l| l.along),
            shear: mix(|l| l.shear),
            heat_t: mix(|l| l.heat_t),
            heat_a: mix(|l| l.heat_a),
            glass: [mix(|l| l.glass[0]), mix(|l| l.glass[1]), mix(|l| l.glass[2])],
            glass_expansion: mix(|l| l.glass_expansion),
        }
    }

    fn node(&self, place: usize) -> Layer {
        *self.layers[place].get_or_init(|| {
            let node_k = COLDEST_K + place as f64 * STEP_K;
            let fibre = &self.materials.fibre;
            let mut rings = vec![(fibre.glass_radius_m, isotropic(&fibre.glass, node_k))];
            rings.extend(fibre.coatings.iter().map(|(m, outer_m)| (*outer_m, isotropic(m, node_k))));
            rings.push((self.cell_m, isotropic(&self.materials.adhesive, node_k)));
            layer(fibre.hole_radius_m, &rings)
        })
    }

    /// Change of optical path per metre of fibre and second, a layer.
    pub(crate) fn paths(&self, temperatures_k: &[f64], rates_k_per_s: &[f64]) -> Vec<f64> {
        let mut annuli = Vec::with_capacity(rates_k_per_s.len() + 1);
        let mut changes = Vec::with_capacity(rates_k_per_s.len() + 1);
        if let Some(spool) = &self.materials.spool {
            let m = isotropic(&spool.material, temperatures_k[0]);
            let layer = Layer {
                bulk: m.lame + m.shear,
                cross: m.lame,
                along: m.lame + 2.0 * m.shear,
                shear: m.shear,
                heat_t: m.heat,
                heat_a: m.heat,
                glass: [0.0; 3],
                glass_expansion: 0.0,
            };
            annuli.push(Annulus { from_m: self.bore_m - spool.thickness_m, to_m: self.bore_m, layer });
            changes.push(rates_k_per_s[0]);
        }
        for (j, (&temperature_k, &rate)) in temperatures_k.iter().zip(rates_k_per_s).enumerate() {
            let from_m = self.bore_m + j as f64 * self.pitch_m;
            annuli.push(Annulus { from_m, to_m: from_m + self.pitch_m, layer: self.layer(temperature_k) });
            changes.push(rate);
        }
        // What pull at the outer surface and along the axis is left, of u at the bore, of e, and of the heat.
        let left =
            |inner: f64, axial: f64, heated: f64| shoot(&annuli, &changes, inner, axial, heated, &mut |_, _, _| {});
        let ([a, b], [c, d], [f, g]) = (left(1.0, 0.0, 0.0), left(0.0, 1.0, 0.0), left(0.0, 0.0, 1.0));
        let determinant = a * d - c * b;
        let (inner, axial) = ((c * g - d * f) / determinant, (b * f - a * g) / determinant);
        let (n, p11, p12) = (self.index, self.materials.fibre.p11, self.materials.fibre.p12);
        let mut paths = Vec::with_capacity(annuli.len());
        shoot(&annuli, &changes, inner, axial, 1.0, &mut |place, hoop, radial| {
            let (l, kelvin) = (&annuli[place].layer, changes[place]);
            let across = l.glass[0] * 0.5 * (radial + axial) + l.glass[1] * hoop + l.glass[2] * kelvin;
            let free = l.glass_expansion * kelvin;
            let strained = (p11 + p12) * (across - free) + p12 * (hoop - free);
            paths.push(self.index_per_k * kelvin + n * hoop - 0.5 * n.powi(3) * strained);
        });
        paths.split_off(paths.len() - rates_k_per_s.len())
    }
}

/// Carries u and r σ_r from the bore outwards; pull that is left at the outer surface and along the axis. `seen` is told of
/// each annulus's hoop strain at its middle and radial strain.
fn shoot(
    annuli: &[Annulus],
    changes: &[f64],
    inner: f64,
    axial: f64,
    heated: f64,
    seen: &mut dyn FnMut(usize, f64, f64),
) -> [f64; 2] {
    let (mut u, mut pull, mut along) = (inner, 0.0, 0.0);
    for (place, (annulus, change)) in annuli.iter().zip(changes).enumerate() {
        let (kelvin, l) = (change * heated, &annulus.layer);
        let (middle_m, half_m) = (0.5 * (annulus.from_m + annulus.to_m), 0.5 * (annulus.to_m - annulus.from_m));
        for (at, weight) in GAUSS {
            let r = middle_m + at * half_m;
            let (u_r, slope) = annulus.at(r, u, pull, axial, kelvin);
            let stress =
                (l.bulk - l.shear) * slope + l.cross * u_r + ((l.bulk + l.shear) * axial - l.heat_t * kelvin) * r;
            along += weight * half_m * stress;
        }
        let (outer, slope) = annulus.at(annulus.to_m, u, pull, axial, kelvin);
        let hoop = annulus.at(middle_m, u, pull, axial, kelvin).0 / middle_m;
        seen(place, hoop, (outer - u) / (annulus.to_m - annulus.from_m));
        pull = annulus.pull(annulus.to_m, outer, slope, axial, kelvin);
        u = outer;
    }
    [pull, along]
}
