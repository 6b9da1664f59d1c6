//! One turn and its share of adhesive: what a layer of the pack is as a homogeneous material, and what its strain does
//! to the glass.
//!
//! ```text
//! u = A r + B/r in each ring,  σ_r = 2 k A − 2 μ B/r² + λ ε_a − 3 K α T
//! layer: σ_t = 2 k* ε_t + l* ε_a − β_t T,  σ_a = 2 l* ε_t + n* ε_a − β_a T,  transverse shear m*
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | a, t | along the fibre, across it (mean of the two directions) | | `axial`, `transverse` |
//! | k*, l*, n*, m* | Hill's moduli of the layer | Pa | `LayerModuli` |
//! | β | stress per kelvin at no strain | Pa/K | `LayerModuli` |
//!
//! Exact for concentric cylinders, but for m*, which is that of the generalised self-consistent scheme: a cell in a medium
//! of the layer's own stiffness. The glass may be a tube.
//!
//! # Source
//! Hill, J. Mech. Phys. Solids 12, 199 (1964); Hashin and Rosen, J. Appl. Mech. 31, 223 (1964); Christensen and Lo, J. Mech.
//! Phys. Solids 27, 315 (1979). The solution ∝ cos 2θ in a ring is Michell's.

use nalgebra::{DMatrix, DVector, Matrix4, Matrix4x2, Vector4};

use super::material::Elastic;

/// A ring of the cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ring {
    pub(crate) outer_radius_m: f64,
    pub(crate) material: Elastic,
}

/// Hill's moduli of a layer, transversely isotropic about its fibre, and its stress per kelvin at no strain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LayerModuli {
    pub(crate) plane_bulk_pa: f64,
    pub(crate) cross_pa: f64,
    pub(crate) axial_pa: f64,
    pub(crate) shear_pa: f64,
    pub(crate) transverse_pa_per_k: f64,
    pub(crate) axial_pa_per_k: f64,
}

impl LayerModuli {
    /// Of an isotropic material.
    pub(crate) fn isotropic(material: &Elastic) -> Self {
        Self {
            plane_bulk_pa: material.plane_bulk_pa(),
            cross_pa: material.lame_pa(),
            axial_pa: material.lame_pa() + 2.0 * material.shear_pa(),
            shear_pa: material.shear_pa(),
            transverse_pa_per_k: material.thermal_stress_pa_per_k(),
            axial_pa_per_k: material.thermal_stress_pa_per_k(),
        }
    }

    /// Expansion along and across the fibre where nothing holds it \[1/K\].
    pub(crate) fn free_expansion_per_k(&self) -> (f64, f64) {
        // [2k l; 2l n] (ε_t, ε_a) = (β_t, β_a).
        let determinant = 2.0 * (self.plane_bulk_pa * self.axial_pa - self.cross_pa * self.cross_pa);
        let transverse = (self.axial_pa * self.transverse_pa_per_k - self.cross_pa * self.axial_pa_per_k) / determinant;
        let axial =
            2.0 * (self.plane_bulk_pa * self.axial_pa_per_k - self.cross_pa * self.transverse_pa_per_k) / determinant;
        (axial, transverse)
    }
}

/// The transverse strain of the glass: of each unit of what the layer does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GlassStrain {
    pub(crate) per_transverse: f64,
    pub(crate) per_axial: f64,
    pub(crate) per_k: f64,
}

/// A layer's material at one temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LayerMaterial {
    pub(crate) moduli: LayerModuli,
    pub(crate) glass: GlassStrain,
    pub(crate) glass_expansion_per_k: f64,
}

impl LayerMaterial {
    /// From the glass outwards; `hole_radius_m` is 0 where the glass is solid.
    pub(crate) fn new(hole_radius_m: f64, rings: &[Ring]) -> Self {
        let (first, last) = (rings[0], rings[rings.len() - 1]);
        let radius_m = last.outer_radius_m;
        // Unit loads: transverse strain, axial strain, one kelvin.
        let loads = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)].map(|(transverse, axial, kelvin)| {
            let constants = constants(hole_radius_m, rings, transverse, axial, kelvin);
            let of = |ring: usize| (constants[2 * ring], constants[2 * ring + 1]);
            let (a, b) = of(rings.len() - 1);
            let outer = &last.material;
            let stress_pa = 2.0 * outer.plane_bulk_pa() * a - 2.0 * outer.shear_pa() * b / radius_m.powi(2)
                + outer.lame_pa() * axial
                - outer.thermal_stress_pa_per_k() * kelvin;
            let mut along_pa = 0.0;
            let mut inner_m = hole_radius_m;
            for (place, ring) in rings.iter().enumerate() {
                let share = (ring.outer_radius_m.powi(2) - inner_m.powi(2)) / radius_m.powi(2);
                let m = &ring.material;
                along_pa += share
                    * (2.0 * m.lame_pa() * of(place).0 + (m.lame_pa() + 2.0 * m.shear_pa()) * axial
                        - m.thermal_stress_pa_per_k() * kelvin);
                inner_m = ring.outer_radius_m;
            }
            (stress_pa, along_pa, of(0).0)
        });
        let [of_transverse, of_axial, of_kelvin] = loads;
        Self {
            moduli: LayerModuli {
                plane_bulk_pa: 0.5 * of_transverse.0,
                cross_pa: of_axial.0,
                axial_pa: of_axial.1,
                shear_pa: transverse_shear_pa(hole_radius_m, rings),
                transverse_pa_per_k: -of_kelvin.0,
                axial_pa_per_k: -of_kelvin.1,
            },
            glass: GlassStrain { per_transverse: of_transverse.2, per_axial: of_axial.2, per_k: of_kelvin.2 },
            glass_expansion_per_k: first.material.expansion_per_k,
        }
    }

    /// Between two cells: whatever is linear in the share.
    pub(crate) fn between(&self, other: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + share * (b - a);
        let (m, n) = (&self.moduli, &other.moduli);
        let (g, h) = (&self.glass, &other.glass);
        Self {
            moduli: LayerModuli {
                plane_bulk_pa: mix(m.plane_bulk_pa, n.plane_bulk_pa),
                cross_pa: mix(m.cross_pa, n.cross_pa),
                axial_pa: mix(m.axial_pa, n.axial_pa),
                shear_pa: mix(m.shear_pa, n.shear_pa),
                transverse_pa_per_k: mix(m.transverse_pa_per_k, n.transverse_pa_per_k),
                axial_pa_per_k: mix(m.axial_pa_per_k, n.axial_pa_per_k),
            },
            glass: GlassStrain {
                per_transverse: mix(g.per_transverse, h.per_transverse),
                per_axial: mix(g.per_axial, h.per_axial),
                per_k: mix(g.per_k, h.per_k),
            },
            glass_expansion_per_k: mix(self.glass_expansion_per_k, other.glass_expansion_per_k),
        }
    }
}

/// A and B of each ring, B in units of the cell's radius squared times metres, for a strain of the cell's edge.
fn constants(hole_radius_m: f64, rings: &[Ring], transverse: f64, axial: f64, kelvin: f64) -> DVector<f64> {
    let count = rings.len();
    let radius_m = rings[count - 1].outer_radius_m;
    let scale_pa = rings.iter().map(|r| r.material.plane_bulk_pa()).fold(0.0, f64::max);
    let (mut matrix, mut right) = (DMatrix::zeros(2 * count, 2 * count), DVector::zeros(2 * count));
    let stress =
        |m: &Elastic, inverse: f64| [2.0 * m.plane_bulk_pa() / scale_pa, -2.0 * m.shear_pa() * inverse / scale_pa];
    let given = |m: &Elastic| (m.lame_pa() * axial - m.thermal_stress_pa_per_k() * kelvin) / scale_pa;
    // B is taken in units of the cell's radius squared.
    if hole_radius_m > 0.0 {
        let m = &rings[0].material;
        let [a, b] = stress(m, (radius_m / hole_radius_m).powi(2));
        (matrix[(0, 0)], matrix[(0, 1)], right[0]) = (a, b, -given(m));
    } else {
        matrix[(0, 1)] = 1.0;
    }
    for (i, two) in rings.windows(2).enumerate() {
        let inverse = (radius_m / two[0].outer_radius_m).powi(2);
        let (row, column) = (1 + 2 * i, 2 * i);
        matrix[(row, column)] = 1.0;
        matrix[(row, column + 1)] = inverse;
        matrix[(row, column + 2)] = -1.0;
        matrix[(row, column + 3)] = -inverse;
        for (side, ring) in two.iter().enumerate() {
            let sign = if side == 0 { 1.0 } else { -1.0 };
            let [a, b] = stress(&ring.material, inverse);
            matrix[(row + 1, column + 2 * side)] = sign * a;
            matrix[(row + 1, column + 2 * side + 1)] = sign * b;
            right[row + 1] -= sign * given(&ring.material);
        }
    }
    let last = 2 * count - 1;
    (matrix[(last, last - 1)], matrix[(last, last)], right[last]) = (1.0, 1.0, transverse);
    let mut found = matrix.lu().solve(&right).unwrap_or_else(|| DVector::from_element(2 * count, f64::NAN));
    found.iter_mut().skip(1).step_by(2).for_each(|b| *b *= radius_m.powi(2));
    found
}

/// Displacements and stresses (u_r, u_θ, σ_r, τ) at a radius, of each of Michell's four solutions ∝ cos 2θ; radius in
/// units of the cell's, stresses in units of `scale_pa`.
fn solutions(radius: f64, material: &Elastic, scale_pa: f64) -> Matrix4<f64> {
    let (nu, mu) = (material.poisson_ratio, material.shear_pa() / scale_pa);
    let r = radius;
    let columns = [
        [-2.0 * r, 2.0 * r, -2.0, 2.0],
        [-4.0 * nu * r.powi(3), (6.0 - 4.0 * nu) * r.powi(3), 0.0, 6.0 * r * r],
        [2.0 * r.powi(-3), 2.0 * r.powi(-3), -6.0 * r.powi(-4), -6.0 * r.powi(-4)],
        [4.0 * (1.0 - nu) / r, -2.0 * (1.0 - 2.0 * nu) / r, -4.0 * r.powi(-2), -2.0 * r.powi(-2)],
    ];
    Matrix4::from_columns(&columns.map(|[u, v, s, t]| Vector4::new(0.5 * u / mu, 0.5 * v / mu, s, t)))
}

/// The shear modulus of a medium in which the cell is not noticed: its displaced and stressed edge is that of uniform
/// shear and the one disturbance that does no work, C/r³.
fn transverse_shear_pa(hole_radius_m: f64, rings: &[Ring]) -> f64 {
    let radius_m = rings[rings.len() - 1].outer_radius_m;
    let scale_pa = rings.iter().map(|r| r.material.shear_pa()).fold(0.0, f64::max);
    // Two independent fields at the glass, carried outwards.
    let first = &rings[0].material;
    let mut inner = hole_radius_m / radius_m;
    let mut fields = if hole_radius_m > 0.0 {
        // Free of stress at the hole: any displacement of it.
        Matrix4x2::from_columns(&[Vector4::new(1.0, 0.0, 0.0, 0.0), Vector4::new(0.0, 1.0, 0.0, 0.0)])
    } else {
        inner = rings[0].outer_radius_m / radius_m;
        solutions(inner, first, scale_pa).fixed_columns::<2>(0).into_owned()
    };
    for ring in rings.iter().skip(usize::from(hole_radius_m <= 0.0)) {
        let outer = ring.outer_radius_m / radius_m;
        let Some(back) = solutions(inner, &ring.material, scale_pa).try_inverse() else { return f64::NAN };
        fields = solutions(outer, &ring.material, scale_pa) * (back * fields);
        inner = outer;
    }
    let minor = |i: usize, j: usize| fields[(i, 0)] * fields[(j, 1)] - fields[(j, 0)] * fields[(i, 1)];
    // det [fields, C/r³, shear] as a quadratic in the medium's μ.
    let square = 24.0 * minor(0, 1);
    let linear = 8.0 * minor(0, 2) - 4.0 * minor(0, 3) + 4.0 * minor(1, 2) - 8.0 * minor(1, 3);
    let constant = -2.0 * minor(2, 3);
    positive_root(square, linear, constant) * scale_pa
}

/// The positive root of a x² + b x + c whose roots have opposite signs, without loss of digits.
fn positive_root(a: f64, b: f64, c: f64) -> f64 {
    let root = (b * b - 4.0 * a * c).sqrt();
    let q = -0.5 * (b + b.signum() * root);
    [q / a, c / q].into_iter().fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(outer_um: f64, youngs_modulus_pa: f64, poisson_ratio: f64, expansion_per_k: f64) -> Ring {
        let material = Elastic { youngs_modulus_pa, poisson_ratio, expansion_per_k };
        Ring { outer_radius_m: crate::units::m_from_um(outer_um), material }
    }

    fn close(found: f64, expected: f64, within: f64) {
        assert!((found / expected - 1.0).abs() < within, "{found} for {expected}");
    }

    #[test]
    fn a_cell_of_one_material_is_that_material() {
        let of = |outer| ring(outer, 3e9, 0.35, 6e-5);
        let cell = LayerMaterial::new(0.0, &[of(40.0), of(60.0), of(100.0)]);
        let same = LayerModuli::isotropic(&of(1.0).material);
        let (m, n) = (&cell.moduli, &same);
        close(m.plane_bulk_pa, n.plane_bulk_pa, 1e-12);
        close(m.cross_pa, n.cross_pa, 1e-12);
        close(m.axial_pa, n.axial_pa, 1e-12);
        close(m.shear_pa, n.shear_pa, 1e-10);
        close(m.transverse_pa_per_k, n.transverse_pa_per_k, 1e-12);
        close(cell.glass.per_transverse, 1.0, 1e-12);
        assert!(cell.glass.per_axial.abs() < 1e-12 && cell.glass.per_k.abs() < 1e-16);
        let (along, across) = m.free_expansion_per_k();
        close(along, 6e-5, 1e-12);
        close(across, 6e-5, 1e-12);
    }

    #[test]
    fn a_fibre_in_a_matrix_has_hills_and_christensens_moduli() {
        let (fibre, matrix) = (ring(60.0, 72e9, 0.17, 5.5e-7), ring(100.0, 3e9, 0.35, 6e-5));
        let cell = LayerMaterial::new(0.0, &[fibre, matrix]);
        let (f, m) = (fibre.material, matrix.material);
        let (vf, vm) = (0.36, 0.64);
        let (kf, km, gm) = (f.plane_bulk_pa(), m.plane_bulk_pa(), m.shear_pa());
        // Hill (1964): k = km + vf/(1/(kf − km) + vm/(km + μm)).
        let bulk = km + vf / (1.0 / (kf - km) + vm / (km + gm));
        close(cell.moduli.plane_bulk_pa, bulk, 1e-12);
        // E_A = vf Ef + vm Em + 4 vf vm (νf − νm)²/(vf/km + vm/kf + 1/μm).
        let (ef, em, nf, nm) = (f.youngs_modulus_pa, m.youngs_modulus_pa, f.poisson_ratio, m.poisson_ratio);
        let denominator = vf / km + vm / kf + 1.0 / gm;
        let young = vf * ef + vm * em + 4.0 * vf * vm * (nf - nm).powi(2) / denominator;
        let found = cell.moduli.axial_pa - cell.moduli.cross_pa.powi(2) / cell.moduli.plane_bulk_pa;
        close(found, young, 1e-12);
        // Between the bounds of Hashin and Hill for the transverse shear.
        let lower = gm + vf / (1.0 / (f.shear_pa() - gm) + vm * (km + 2.0 * gm) / (2.0 * gm * (km + gm)));
        assert!(cell.moduli.shear_pa > lower && cell.moduli.shear_pa < 1.2 * lower, "{}", cell.moduli.shear_pa / lower);
    }

    #[test]
    fn the_shear_of_a_stiff_fibre_is_that_of_the_published_quadratic() {
        // Christensen and Lo (1979), their equation for cylinders: A x² + 2 B x + C = 0, x = μ/μm.
        let (fibre, matrix) = (ring(60.0, 72e9, 0.17, 0.0), ring(100.0, 3e9, 0.35, 0.0));
        let (c, x) = (0.36_f64, fibre.material.shear_pa() / matrix.material.shear_pa());
        let (ei, em) = (3.0 - 4.0 * 0.17, 3.0 - 4.0 * 0.35);
        let square = |v: f64| v * v;
        let a = 3.0 * c * square(1.0 - c) * (x - 1.0) * (x + ei)
            + (x * em + ei * em - (x * em - ei) * c.powi(3)) * (c * em * (x - 1.0) - (x * em + 1.0));
        let b = -6.0 * c * square(1.0 - c) * (x - 1.0) * (x + ei)
            + (x * em + (x - 1.0) * c + 1.0) * ((em - 1.0) * (x + ei) - 2.0 * (x * em - ei) * c.powi(3))
            + (em + 1.0) * c * (x - 1.0) * (x + ei + (x * em - ei) * c.powi(3));
        let d = 3.0 * c * square(1.0 - c) * (x - 1.0) * (x + ei)
            + (x * em + (x - 1.0) * c + 1.0) * (x + ei + (x * em - ei) * c.powi(3));
        let ratio = positive_root(a, b, d);
        let found = LayerMaterial::new(0.0, &[fibre, matrix]).moduli.shear_pa / matrix.material.shear_pa();
        close(found, ratio, 1e-9);
    }

    #[test]
    fn a_tube_gives_way_as_a_hole_and_a_soft_core_do() {
        let tube = LayerMaterial::new(50e-6, &[ring(100.0, 72e9, 0.17, 5.5e-7)]);
        let filled = LayerMaterial::new(0.0, &[ring(50.0, 1.0, 0.0, 0.0), ring(100.0, 72e9, 0.17, 5.5e-7)]);
        close(tube.moduli.plane_bulk_pa, filled.moduli.plane_bulk_pa, 1e-8);
        close(tube.moduli.shear_pa, filled.moduli.shear_pa, 1e-8);
        close(tube.moduli.axial_pa, filled.moduli.axial_pa, 1e-8);
        let (along, across) = tube.moduli.free_expansion_per_k();
        close(along, 5.5e-7, 1e-10);
        close(across, 5.5e-7, 1e-10);
    }
}
