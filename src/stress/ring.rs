//! Layered thick ring: spool and pack as bonded annuli, axisymmetric, in generalised plane strain.
//!
//! ```text
//! C_r (u″ + u′/r) − C_θ u/r² + [(C_rz − C_θz) e − (β_r − β_θ) T]/r = 0
//! u = C r^γ + D r^−γ + p r,  γ² = C_θ/C_r;  σ_r and u continuous, σ_r = 0 at both surfaces, ∫ σ_z r dr = 0
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | u | radial displacement | m | `edges_m` |
//! | e | axial strain, the same everywhere | 1 | `axial` |
//! | T | change of temperature, uniform in each annulus | K | `changes_k` |
//! | C, β | stiffness and stress per kelvin; the fibre lies along θ | Pa, Pa/K | `LayerModuli` |
//!
//! Exact in each annulus: its two edges' displacements and e are the unknowns, so a ring of N annuli is a tridiagonal system
//! with one more row and column. Leaves out the ends: at a flange shear carries load from spool to pack.
//!
//! # Source
//! Lekhnitskii, Theory of Elasticity of an Anisotropic Body, section 38 (annulus of cylindrical anisotropy); Timoshenko and
//! Goodier, Theory of Elasticity (1951), sections 26 and 135.

use super::cell::LayerModuli;

/// One annulus, from within outwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Annulus {
    pub(crate) inner_m: f64,
    pub(crate) outer_m: f64,
    pub(crate) moduli: LayerModuli,
    /// Whether the fibre lies in it, along θ; else it is isotropic.
    pub(crate) is_wound: bool,
}

/// Strains of an annulus: hoop and radial at its middle and over its thickness, axial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strain {
    pub hoop: f64,
    pub radial: f64,
    pub axial: f64,
}

/// What an annulus answers: forces at its edges (r σ_r) and along the axis (∫ σ_z r dr) as linear in its two edges'
/// displacements, e and T.
#[derive(Debug, Clone, Copy)]
struct Element {
    inner_m: f64,
    outer_m: f64,
    /// Rows: r σ_r at the inner and the outer edge, ∫ σ_z r dr. Columns: u_inner, u_outer, e, T.
    force: [[f64; 4]; 3],
    /// u at the middle radius, of the same four.
    middle: [f64; 4],
}

/// Relative difference of C_θ and C_r below which an annulus is isotropic in its plane.
const SAME_STIFFNESS: f64 = 1e-10;

impl Element {
    fn new(annulus: &Annulus) -> Self {
        let m = &annulus.moduli;
        let (sum, difference) = (m.plane_bulk_pa + m.shear_pa, m.plane_bulk_pa - m.shear_pa);
        // Radial and axial are across the fibre, θ along it.
        let (c_r, c_t, c_rt, c_rz, c_tz, c_z) = (sum, m.axial_pa, m.cross_pa, difference, m.cross_pa, sum);
        let (b_r, b_t, b_z) = (m.transverse_pa_per_k, m.axial_pa_per_k, m.transverse_pa_per_k);
        let (a, b) = (annulus.inner_m, annulus.outer_m);
        let is_isotropic = !annulus.is_wound || (c_t - c_r).abs() <= SAME_STIFFNESS * c_t;
        let gamma = if is_isotropic { 1.0 } else { (c_t / c_r).sqrt() };
        // u = p r for e = 1 and for T = 1.
        let particular = |load: f64| if is_isotropic { 0.0 } else { load / (c_t - c_r) };
        let p = [0.0, 0.0, particular(c_rz - c_tz), particular(b_t - b_r)];
        // The rest of u at the edges, split into (r/a)^γ and (r/a)^−γ.
        let growth = (b / a).powf(gamma);
        let determinant = 1.0 / growth - growth;
        let split = |at_inner: f64, at_outer: f64| {
            let up = (at_inner / growth - at_outer) / determinant;
            (up, at_inner - up)
        };
        let edges = [(1.0, 0.0), (0.0, 1.0), (-p[2] * a, -p[2] * b), (-p[3] * a, -p[3] * b)];
        let parts = edges.map(|(inner, outer)| split(inner, outer));
        let middle = 0.5 * (a + b);
        let middle_growth = (middle / a).powf(gamma);
        // ∫ (r/a)^±γ dr over the annulus.
        let integral_up = (b * growth - a) / (gamma + 1.0);
        let integral_down =
            if (gamma - 1.0).abs() < 1e-9 { a * (b / a).ln() } else { (b / growth - a) / (1.0 - gamma) };
        let (strain_e, kelvin) = ([0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]);
        let mut element = Self { inner_m: a, outer_m: b, force: [[0.0; 4]; 3], middle: [0.0; 4] };
        for load in 0..4 {
            let (up, down) = parts[load];
            // r σ_r = C_r r u′ + C_rθ u + (C_rz e − β_r T) r; `high` is (r/a)^γ.
            let edge = |r: f64, high: f64| {
                let low = 1.0 / high;
                let u = up * high + down * low + p[load] * r;
                let r_slope = gamma * (up * high - down * low) + p[load] * r;
                c_r * r_slope + c_rt * u + (c_rz * strain_e[load] - b_r * kelvin[load]) * r
            };
            element.force[0][load] = edge(a, 1.0);
            element.force[1][load] = edge(b, growth);
            // ∫ (C_rz r u′ + C_θz u + (C_z e − β_z T) r) dr, with ∫ r u′ = [r u] − ∫ u.
            let integral = up * integral_up + down * integral_down + 0.5 * p[load] * (b * b - a * a);
            let u_edges = [if load == 0 { 1.0 } else { 0.0 }, if load == 1 { 1.0 } else { 0.0 }];
            element.force[2][load] = c_rz * (b * u_edges[1] - a * u_edges[0] - integral)
                + c_tz * integral
                + 0.5 * (c_z * strain_e[load] - b_z * kelvin[load]) * (b * b - a * a);
            element.middle[load] = up * middle_growth + down / middle_growth + p[load] * middle;
        }
        element
    }
}

/// A ring ready for any temperatures.
#[derive(Debug, Clone)]
pub(crate) struct LayeredRing {
    elements: Vec<Element>,
    /// Pivots and multipliers of the tridiagonal part.
    pivot: Vec<f64>,
    below: Vec<f64>,
    above: Vec<f64>,
    /// The edges' displacements for e = 1 where no temperature changes, and the axial force with them.
    for_axial: Vec<f64>,
    axial_stiffness: f64,
}

impl LayeredRing {
    /// Of annuli that touch one another, from within outwards.
    pub(crate) fn new(annuli: &[Annulus]) -> Self {
        let elements: Vec<Element> = annuli.iter().map(Element::new).collect();
        let nodes = elements.len() + 1;
        let (mut diagonal, mut below, mut above) = (vec![0.0; nodes], vec![0.0; nodes], vec![0.0; nodes]);
        for (i, element) in elements.iter().enumerate() {
            // At a node the annulus within pulls outwards and the one beyond inwards.
            diagonal[i] -= element.force[0][0];
            above[i] -= element.force[0][1];
            below[i + 1] += element.force[1][0];
            diagonal[i + 1] += element.force[1][1];
        }
        let mut pivot = diagonal;
        for i in 1..nodes {
            below[i] /= pivot[i - 1];
            pivot[i] -= below[i] * above[i - 1];
        }
        let mut ring = Self { elements, pivot, below, above, for_axial: Vec::new(), axial_stiffness: 1.0 };
        let load = ring.load(|element, row| element.force[row][2]);
        ring.for_axial = ring.solve(load);
        ring.axial_stiffness =
            ring.axial_force(&ring.for_axial) + ring.elements.iter().map(|e| e.force[2][2]).sum::<f64>();
        ring
    }

    fn load(&self, of: impl Fn(&Element, usize) -> f64) -> Vec<f64> {
        let mut load = vec![0.0; self.pivot.len()];
        for (i, element) in self.elements.iter().enumerate() {
            load[i] += of(element, 0);
            load[i + 1] -= of(element, 1);
        }
        load
    }

    fn solve(&self, mut load: Vec<f64>) -> Vec<f64> {
        for i in 1..load.len() {
            load[i] -= self.below[i] * load[i - 1];
        }
        for i in (0..load.len()).rev() {
            let beyond = load.get(i + 1).map_or(0.0, |next| self.above[i] * next);
            load[i] = (load[i] - beyond) / self.pivot[i];
        }
        load
    }

    fn axial_force(&self, edges_m: &[f64]) -> f64 {
        self.elements.iter().zip(edges_m.windows(2)).map(|(e, u)| e.force[2][0] * u[0] + e.force[2][1] * u[1]).sum()
    }

    /// Strains of every annulus for changes of temperature, or their rates for its rates.
    pub(crate) fn strains(&self, changes_k: &[f64]) -> Vec<Strain> {
        let mut load = vec![0.0; self.pivot.len()];
        for (i, (element, change)) in self.elements.iter().zip(changes_k).enumerate() {
            load[i] += element.force[0][3] * change;
            load[i + 1] -= element.force[1][3] * change;
        }
        let mut edges_m = self.solve(load);
        let thermal: f64 = self.elements.iter().zip(changes_k).map(|(e, change)| e.force[2][3] * change).sum();
        let axial = -(self.axial_force(&edges_m) + thermal) / self.axial_stiffness;
        edges_m.iter_mut().zip(&self.for_axial).for_each(|(u, of_axial)| *u += axial * of_axial);
        let annuli = self.elements.iter().zip(edges_m.windows(2)).zip(changes_k);
        annuli
            .map(|((element, u), change)| {
                let m = &element.middle;
                let middle_m = m[0] * u[0] + m[1] * u[1] + m[2] * axial + m[3] * change;
                Strain {
                    hoop: 2.0 * middle_m / (element.inner_m + element.outer_m),
                    radial: (u[1] - u[0]) / (element.outer_m - element.inner_m),
                    axial,
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stress::material::Elastic;

    fn elastic(youngs_modulus_pa: f64, poisson_ratio: f64, expansion_per_k: f64) -> Elastic {
        Elastic { youngs_modulus_pa, poisson_ratio, expansion_per_k }
    }

    fn layers(from_m: f64, to_m: f64, count: usize, material: &Elastic) -> Vec<Annulus> {
        let at = |i: usize| from_m + (to_m - from_m) * i as f64 / count as f64;
        (0..count)
            .map(|i| Annulus {
                inner_m: at(i),
                outer_m: at(i + 1),
                moduli: LayerModuli::isotropic(material),
                is_wound: false,
            })
            .collect()
    }

    #[test]
    fn one_material_at_one_temperature_expands_freely() {
        let ring = LayeredRing::new(&layers(0.03, 0.04, 7, &elastic(70e9, 0.33, 2.3e-5)));
        for strain in ring.strains(&[2.0; 7]) {
            for value in [strain.hoop, strain.radial, strain.axial] {
                assert!((value / 4.6e-5 - 1.0).abs() < 1e-9, "{value}");
            }
        }
    }

    #[test]
    fn a_gradient_in_a_thick_ring_strains_it_as_timoshenkos_cylinder() {
        // Timoshenko and Goodier, section 135: u = (1+ν)/(1−ν) α/r ∫_a^r T r dr + C r + D/r, ends free of force.
        let (a, b, nu, alpha): (f64, f64, f64, f64) = (0.02, 0.04, 0.3, 1.7e-5);
        let errors: Vec<f64> = [20, 40]
            .into_iter()
            .map(|count| {
                let annuli = layers(a, b, count, &elastic(200e9, nu, alpha));
                // T = 100 (r − a)/(b − a), in each annulus its mean over the area.
                let slope = 100.0 / (b - a);
                let moment = |r: f64| slope * (r.powi(3) / 3.0 - a * r * r / 2.0);
                let mean = |from: f64, to: f64| 2.0 * (moment(to) - moment(from)) / (to * to - from * from);
                let loads: Vec<f64> = annuli.iter().map(|x| mean(x.inner_m, x.outer_m)).collect();
                let total = moment(b) - moment(a);
                let (free, spread) = (2.0 * alpha * total / (b * b - a * a), (1.0 + nu) / (1.0 - nu) * alpha);
                let expected_u = |r: f64| {
                    let own = (moment(r) - moment(a)) / r;
                    let c = (1.0 - 3.0 * nu) / (1.0 + nu) * total / (b * b - a * a);
                    spread * (own + c * r + a * a * total / (b * b - a * a) / r)
                };
                let found = LayeredRing::new(&annuli).strains(&loads);
                assert!((found[0].axial / free - 1.0).abs() < 1e-9);
                let off = annuli.iter().zip(&found).map(|(x, strain)| {
                    let middle = 0.5 * (x.inner_m + x.outer_m);
                    (strain.hoop * middle / expected_u(middle) - 1.0).abs()
                });
                off.fold(0.0, f64::max)
            })
            .collect();
        println!("errors {errors:?}, order {:.2}", (errors[0] / errors[1]).log2());
        assert!(errors[1] < 4e-4 && (3.9..4.1).contains(&(errors[0] / errors[1])), "{errors:?}");
    }

    #[test]
    fn a_shrunk_sleeve_presses_as_lame_says() {
        // Two tubes, the outer colder by one kelvin, e = 0 is not asked for: compare with plane strain plus a free end by
        // Lamé's constants solved by hand from the same three conditions.
        let (a, c, b) = (0.02, 0.03, 0.05);
        let (inner, outer) = (elastic(70e9, 0.33, 2.3e-5), elastic(110e9, 0.31, 9e-6));
        let mut annuli = layers(a, c, 3, &inner);
        annuli.extend(layers(c, b, 4, &outer));
        let found = LayeredRing::new(&annuli).strains(&[1.0; 7]);
        // u = A r + B/r in each tube: unknown A1, B1, A2, B2, e.
        let (l1, m1, l2, m2) = (inner.lame_pa(), inner.shear_pa(), outer.lame_pa(), outer.shear_pa());
        let (t1, t2) = (inner.thermal_stress_pa_per_k(), outer.thermal_stress_pa_per_k());
        let (s1, s2) = (c * c - a * a, b * b - c * c);
        let matrix = nalgebra::Matrix5::new(
            2.0 * (l1 + m1),
            -2.0 * m1 / (a * a),
            0.0,
            0.0,
            l1,
            2.0 * (l1 + m1),
            -2.0 * m1 / (c * c),
            -2.0 * (l2 + m2),
            2.0 * m2 / (c * c),
            l1 - l2,
            c * 1e12,
            1e12 / c,
            -c * 1e12,
            -1e12 / c,
            0.0,
            0.0,
            0.0,
            2.0 * (l2 + m2),
            -2.0 * m2 / (b * b),
            l2,
            2.0 * l1 * s1,
            0.0,
            2.0 * l2 * s2,
            0.0,
            (l1 + 2.0 * m1) * s1 + (l2 + 2.0 * m2) * s2,
        );
        let right = nalgebra::Vector5::new(t1, t1 - t2, 0.0, t2, t1 * s1 + t2 * s2);
        let x = matrix.lu().solve(&right).unwrap();
        for (annulus, strain) in annuli.iter().zip(&found) {
            let r = 0.5 * (annulus.inner_m + annulus.outer_m);
            let (p, q) = if r < c { (x[0], x[1]) } else { (x[2], x[3]) };
            assert!((strain.hoop / (p + q / (r * r)) - 1.0).abs() < 1e-9);
            assert!((strain.axial / x[4] - 1.0).abs() < 1e-9);
        }
        assert!(found[0].hoop < 2.3e-5 && found[6].hoop > 9e-6);
    }
}
