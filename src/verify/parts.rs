//! A linear pack and what lies around it, under Laplace's transform: spool, flanges, housings, and waves along the axis.
//!
//! ```text
//! pack     T = p(ζ) + Σ_m θ_m(r) φ_m(ζ),   φ = cos bζ + (β₁/b) sin bζ,   (b² − β₁ β₂) tan b = b (β₁ + β₂)
//!          p'' = (s H²/K) p,   −p'(0) = Σ β_i (T_i − p),   p'(1) = Σ β_i (T_i − p)       β = h H/k of what touches a face
//!          θ_m: layers in closed form ([`super::layers`]) at s + K b²/H², driven by what spool and surroundings exceed p by
//! spool    s C T_s = k w T_s''/H² + c (T − T_s) + mount (T_around − T_s) + q,   T_s = Σ a_k P_k(2ζ − 1)
//! flange   s C T_f = h (⟨T(face)⟩ − T_f) + film (T_around − T_f) + joint (T_s(end) − T_f)
//! housing  s C T_h = what enters from either side
//! ```
//!
//! All is linear in what drives it: the drive, heat into the bore, and parts that begin warmer than the rest. A pack that
//! begins warmer by a is the same as a drive that steps down by a, all temperatures counted from the pack's. Where nothing
//! varies along the axis there is one wave, and one P.
//!
//! # Source
//! Carslaw and Jaeger, Conduction of Heat in Solids (1959), sections 3.11 (slab that exchanges heat) and 13.4.

use nalgebra::{Complex, DMatrix};

use super::layers::{CAUSES, Layers};
use super::physics::{BoreHeat, Physics, Sensor, SpoolFlange};
use super::waves::{POLYNOMIALS, Wave, at_end, stiffness, waves};
use crate::rate::CoilModel;

type C = Complex<f64>;

/// What drives everything, behind the unknowns of a form.
const DRIVE: usize = 0;
const HEAT: usize = 1;
/// Parts that begin warmer than the pack.
const START: usize = 2;
const INPUTS: usize = 3;

/// What touches one face of the pack.
#[derive(Debug, Clone, Copy)]
struct Touch {
    end: usize,
    film_w_per_m2_k: f64,
    /// Which of the spool's flanges; none: what surrounds the coil.
    flange: Option<usize>,
}

/// A flange of the spool; all per radian and height.
#[derive(Debug, Clone, Copy)]
struct Lump {
    end: usize,
    capacity: f64,
    film: f64,
    /// To the end of the spool's wall.
    joint: f64,
    is_drive: bool,
}

/// The spool, per radian and height.
#[derive(Debug, Clone, Copy)]
struct Wall {
    capacity: f64,
    contact: f64,
    mount: f64,
    /// k w r/H².
    along: f64,
    is_drive: bool,
}

/// A pack and its surroundings as plain numbers.
#[derive(Debug, Clone)]
pub(super) struct Parts {
    pub(crate) pack: Layers,
    waves: Vec<Wave>,
    varies_along: bool,
    diffusivity_per_s: f64,
    /// h/H over h H/k: a face's film by its β.
    film_per_biot: f64,
    biot_per_film: f64,
    /// (r₂² − r₁²)/2 of the face.
    face_m2: f64,
    touches: Vec<Touch>,
    lumps: Vec<Lump>,
    wall: Option<Wall>,
    polynomials: usize,
    /// Heat capacity and conductance inwards of each housing, and what joins the outermost to the drive.
    housings: Vec<[f64; 2]>,
    outside: f64,
    /// By how much the pack begins warmer than the drive, and spool and housings than the pack.
    pub(crate) pack_above_k: f64,
    spool_above_pack_k: f64,
    housing_above_pack_k: f64,
    has_start: bool,
}

/// A temperature as a sum over unknowns, then inputs.
type Form = Vec<C>;

/// s T̂ of every layer, and of its moment: under a unit ramp; by the bore's heat and by the start, less what they begin with.
#[derive(Debug, Clone)]
pub(super) struct Transforms {
    pub(crate) ramp: Vec<C>,
    pub(crate) heated: Option<Vec<C>>,
    pub(crate) started: Option<Vec<C>>,
}

/// Σ β_i T_i at a face is its slope: p at both ends, and its mean and moment over the axis.
struct Slab {
    ends: [Form; 2],
    mean: Form,
    moment: Form,
}

fn add(form: &mut Form, other: &Form, factor: C) {
    form.iter_mut().zip(other).for_each(|(f, o)| *f += o * factor);
}

/// From the wall's end to the middle of the flange.
fn depth_m(model: &CoilModel) -> f64 {
    0.5 * model.coil.layers() as f64 * model.coil.radial_pitch_m()
}

/// The spool's flanges; `share_m` is the face per radian and height.
fn lumps(physics: &Physics, share_m: f64, joint: f64) -> Vec<Lump> {
    let lump = |flange: &SpoolFlange| Lump {
        end: usize::from(!flange.is_first),
        capacity: flange.heat_capacity_j_per_m2_k * share_m,
        film: flange.film_w_per_m2_k * share_m,
        joint,
        is_drive: physics.sensor == Sensor::Flange { is_first: flange.is_first },
    };
    physics.spool_flanges.iter().map(lump).collect()
}

impl Parts {
    pub(crate) fn new(model: &CoilModel, physics: &Physics, height_m: f64) -> Self {
        let pack = Layers::new(model, physics);
        let (bore_m, outer_m) = (pack.bore_radius_m(), pack.outer_radius_m());
        let face_m2 = 0.5 * (outer_m * outer_m - bore_m * bore_m);
        let wall_m2 = physics.spool_wall.map_or(0.0, |[k, thickness_m]| k * thickness_m * bore_m);
        let has_wall = physics.spool.is_some() && physics.spool_wall.is_some();
        let joint = if has_wall { wall_m2 / (depth_m(model) * height_m) } else { 0.0 };
        let lumps = lumps(physics, face_m2 / height_m, joint);
        let plain = physics.flanges.iter().map(|flange| Touch {
            end: usize::from(!flange.is_first),
            film_w_per_m2_k: flange.film_w_per_m2_k,
            flange: None,
        });
        let own = physics.spool_flanges.iter().enumerate().map(|(i, flange)| Touch {
            end: usize::from(!flange.is_first),
            film_w_per_m2_k: flange.contact_w_per_m2_k,
            flange: Some(i),
        });
        let touches: Vec<Touch> = plain.chain(own).collect();
        let varies_along = !touches.is_empty();
        let biot_per_film = height_m / physics.conductivity_w_per_m_k;
        let biots = [0, 1].map(|end| -> f64 {
            touches.iter().filter(|touch| touch.end == end).map(|touch| touch.film_w_per_m2_k * biot_per_film).sum()
        });
        let diffusivity_per_s = physics.diffusivity_m2_per_s() / (height_m * height_m);
        let polynomials = if varies_along { POLYNOMIALS } else { 1 };
        let [pack_above_k, spool_above_k, housing_above_k] = physics.above_k.unwrap_or_default();
        Self {
            waves: if varies_along { waves(biots, diffusivity_per_s, polynomials) } else { vec![Wave::even()] },
            varies_along,
            diffusivity_per_s,
            film_per_biot: physics.conductivity_w_per_m_k / (height_m * height_m),
            biot_per_film,
            face_m2,
            touches,
            lumps,
            wall: physics.spool.map(|spool| Wall {
                capacity: spool.heat_capacity_j_per_m2_k * bore_m,
                contact: spool.contact_w_per_m2_k * bore_m,
                mount: spool.mount_w_per_m2_k * bore_m,
                along: wall_m2 / (height_m * height_m),
                is_drive: physics.sensor == Sensor::Spool,
            }),
            polynomials,
            housings: physics.housings.iter().map(|housing| housing.map(|v| v * outer_m)).collect(),
            outside: physics.film_w_per_m2_k.map_or(0.0, |film| film * outer_m),
            pack_above_k,
            spool_above_pack_k: spool_above_k - pack_above_k,
            housing_above_pack_k: housing_above_k - pack_above_k,
            has_start: physics.above_k.is_some(),
            pack,
        }
    }

    pub(crate) fn has_moments(&self) -> bool {
        self.varies_along
    }

    /// The spool's polynomials, its flanges and the housings are unknown, in this order.
    fn spool(&self) -> usize {
        if self.wall.is_some_and(|wall| !wall.is_drive) { self.polynomials } else { 0 }
    }

    fn place_of(&self, flange: usize) -> Option<usize> {
        let before = self.lumps[..flange].iter().filter(|lump| !lump.is_drive).count();
        (!self.lumps[flange].is_drive).then_some(self.spool() + before)
    }

    fn first_housing(&self) -> usize {
        self.spool() + self.lumps.iter().filter(|lump| !lump.is_drive).count()
    }

    fn unknowns(&self) -> usize {
        self.first_housing() + self.housings.len()
    }

    fn unit(&self, place: usize) -> Form {
        let mut form = vec![C::new(0.0, 0.0); self.unknowns() + INPUTS];
        form[place] = C::new(1.0, 0.0);
        form
    }

    fn drive(&self) -> Form {
        self.unit(self.unknowns() + DRIVE)
    }

    /// What surrounds the coil.
    fn around(&self) -> Form {
        if self.housings.is_empty() { self.drive() } else { self.unit(self.first_housing()) }
    }

    fn flange(&self, flange: usize) -> Form {
        self.place_of(flange).map_or_else(|| self.drive(), |place| self.unit(place))
    }

    /// The spool's temperature at an end of its wall.
    fn at_wall(&self, end: usize) -> Form {
        let mut form = vec![C::new(0.0, 0.0); self.unknowns() + INPUTS];
        form.iter_mut().enumerate().take(self.spool()).for_each(|(k, value)| *value = at_end(k, end).into());
        form
    }

    /// Everything at s.
    #[expect(clippy::too_many_lines, reason = "one balance of heat: every wave adds to the same rows")]
    pub(crate) fn transform(&self, heat: Option<BoreHeat>, s: C) -> Transforms {
        let unknowns = self.unknowns();
        let zero = C::new(0.0, 0.0);
        let empty = vec![zero; unknowns + INPUTS];
        let around = self.around();
        let mut pushes = [empty.clone(), empty.clone()];
        for touch in &self.touches {
            let of = touch.flange.map_or_else(|| around.clone(), |flange| self.flange(flange));
            add(&mut pushes[touch.end], &of, (touch.film_w_per_m2_k * self.biot_per_film).into());
        }
        let slab = self.slab(s, &pushes);
        let mut rows = self.own_rows(s, &slab);
        let first_housing = self.first_housing();
        let mut waves = Vec::with_capacity(self.waves.len());
        for wave in &self.waves {
            let per_s = s + wave.decay_per_s;
            let felt = self.pack.felt(per_s);
            let uniform: C = (wave.mean / wave.norm).into();
            let mut own = empty.clone();
            for (push, end) in pushes.iter().zip(wave.ends) {
                add(&mut own, push, self.diffusivity_per_s * end / (wave.norm * per_s));
            }
            let mut causes: [Form; CAUSES] = [(); CAUSES].map(|()| empty.clone());
            match self.wall {
                Some(wall) if wall.is_drive => causes[0][unknowns + DRIVE] = uniform,
                Some(_) => {
                    causes[0].iter_mut().zip(&wave.along).for_each(|(cause, along)| *cause = (along / wave.norm).into())
                }
                None => causes[2][unknowns + HEAT] = uniform * self.pack.bore_radius_m(),
            }
            add(&mut causes[0], &own, (-1.0).into());
            add(&mut causes[1], &around, uniform);
            add(&mut causes[1], &own, (-1.0).into());
            let seen = |factors: &[C; CAUSES]| {
                let mut form = empty.clone();
                causes.iter().zip(factors).for_each(|(cause, factor)| add(&mut form, cause, *factor));
                form
            };
            if let Some(wall) = self.wall.filter(|wall| !wall.is_drive) {
                let mut bore = seen(&felt.bore);
                add(&mut bore, &own, 1.0.into());
                for (row, along) in rows.iter_mut().zip(&wave.along).take(self.polynomials) {
                    add(row, &bore, (-wall.contact * along).into());
                }
            }
            let content = seen(&felt.content);
            for touch in &self.touches {
                let row = match touch.flange {
                    Some(flange) => self.place_of(flange),
                    None => (!self.housings.is_empty()).then_some(first_housing),
                };
                if let Some(row) = row {
                    let factor = touch.film_w_per_m2_k * self.biot_per_film * self.film_per_biot * wave.ends[touch.end];
                    add(&mut rows[row], &content, (-factor).into());
                }
            }
            if let (Some(film), false) = (self.pack.film, self.housings.is_empty()) {
                add(&mut rows[first_housing], &seen(&felt.surface), (-film * wave.mean).into());
            }
            waves.push((wave, felt, causes));
        }
        let known = self.solved(&rows);
        let at = |form: &Form, input: usize| -> C {
            form[..unknowns].iter().zip(known.column(input).iter()).map(|(f, x)| f * x).sum::<C>()
                + form[unknowns + input]
        };
        let layers = self.pack.layers;
        let of_input = |input: usize| -> Vec<C> {
            let mut out = vec![zero; layers * if self.varies_along { 2 } else { 1 }];
            let mut put = |layer: usize, mean: C, moment: C| {
                out[layer] += mean;
                if self.varies_along {
                    out[layers + layer] += moment;
                }
            };
            let (mean, moment) = (at(&slab.mean, input), at(&slab.moment, input));
            (0..self.pack.solved()).for_each(|layer| put(layer, mean, moment));
            for (wave, felt, causes) in &waves {
                let causes = causes.each_ref().map(|cause| at(cause, input));
                for layer in 0..self.pack.solved() {
                    let own: C = causes.iter().zip(&felt.means).map(|(cause, means)| cause * means[layer]).sum();
                    put(layer, own * wave.mean, own * wave.moment);
                }
            }
            out
        };
        let by_drive = of_input(DRIVE);
        // s q̂ = q∞/(1 + s τ).
        let heated = heat.map(|h| {
            let factor = h.power_w_per_m2 / (s * h.time_constant_s + 1.0);
            of_input(HEAT).into_iter().map(|of| of * factor).collect()
        });
        let started = self.has_start.then(|| {
            let by_parts = of_input(START);
            by_parts.iter().zip(&by_drive).map(|(part, drive)| s * part - drive * self.pack_above_k).collect()
        });
        Transforms { ramp: by_drive.iter().map(|of| of / s).collect(), heated, started }
    }

    fn slab(&self, s: C, pushes: &[Form; 2]) -> Slab {
        let empty = vec![C::new(0.0, 0.0); pushes[0].len()];
        let mut slab = Slab { ends: [empty.clone(), empty.clone()], mean: empty.clone(), moment: empty };
        if !self.varies_along {
            return slab;
        }
        let biots = [0, 1].map(|end| -> f64 {
            let own = self.touches.iter().filter(|touch| touch.end == end);
            own.map(|touch| touch.film_w_per_m2_k * self.biot_per_film).sum()
        });
        let rate = (s / self.diffusivity_per_s).sqrt();
        let left = (-rate).exp();
        // p = C₁ e^{−σζ} + C₂ e^{−σ(1−ζ)}.
        let (a, b) = (rate + biots[0], (biots[0] - rate) * left);
        let (c, d) = ((biots[1] - rate) * left, rate + biots[1]);
        let determinant = a * d - b * c;
        // Means of the two, and moments about the middle.
        let mean = (C::new(1.0, 0.0) - left) / rate;
        let moment = (C::new(1.0, 0.0) - left) / (rate * rate) - left / rate - mean * 0.5;
        let own = [[d, -c], [-b, a]];
        for (push, own) in pushes.iter().zip(own) {
            let [first, second] = own.map(|v| v / determinant);
            add(&mut slab.ends[0], push, first + second * left);
            add(&mut slab.ends[1], push, first * left + second);
            add(&mut slab.mean, push, (first + second) * mean);
            add(&mut slab.moment, push, (first - second) * moment);
        }
        slab
    }

    /// The balances of spool, flanges and housings, but for what the waves bring.
    fn own_rows(&self, s: C, slab: &Slab) -> Vec<Form> {
        let mut rows = vec![vec![C::new(0.0, 0.0); self.unknowns() + INPUTS]; self.unknowns()];
        self.balance_spool(s, &mut rows);
        self.balance_flanges(s, &mut rows);
        self.balance_faces_and_housings(s, slab, &mut rows);
        rows
    }

    fn balance_spool(&self, s: C, rows: &mut [Form]) {
        let Some(wall) = self.wall else { return };
        let (unknowns, first_housing) = (self.unknowns(), self.first_housing());
        let has_housing = !self.housings.is_empty();
        if wall.is_drive && has_housing {
            rows[first_housing][first_housing] += wall.mount;
            add(&mut rows[first_housing], &self.drive(), (-wall.mount).into());
        }
        for (k, row) in rows.iter_mut().enumerate().take(self.spool()) {
            row[k] += (s * wall.capacity + wall.mount + wall.contact) / (2 * k + 1) as f64;
            for (l, own) in row.iter_mut().enumerate().take(self.polynomials) {
                *own += wall.along * stiffness(k, l);
            }
        }
        if self.spool() > 0 {
            // Only the first polynomial has a mean.
            add(&mut rows[0], &self.around(), (-wall.mount).into());
            rows[0][unknowns + HEAT] -= self.pack.bore_radius_m();
            rows[0][unknowns + START] -= wall.capacity * self.spool_above_pack_k;
            if has_housing {
                rows[first_housing][first_housing] += wall.mount;
                rows[first_housing][0] -= wall.mount;
            }
        }
    }

    fn balance_flanges(&self, s: C, rows: &mut [Form]) {
        let (around, start, first_housing) = (self.around(), self.unknowns() + START, self.first_housing());
        let has_housing = !self.housings.is_empty();
        for (i, lump) in self.lumps.iter().enumerate() {
            let own = self.flange(i);
            if let Some(place) = self.place_of(i) {
                add(&mut rows[place], &own, s * lump.capacity + lump.film + lump.joint);
                add(&mut rows[place], &around, (-lump.film).into());
                rows[place][start] -= lump.capacity * self.spool_above_pack_k;
                add(&mut rows[place], &self.at_wall(lump.end), (-lump.joint).into());
            }
            let of_wall = self.at_wall(lump.end);
            for (k, row) in rows.iter_mut().enumerate().take(self.spool()) {
                add(row, &of_wall, (lump.joint * at_end(k, lump.end)).into());
                add(row, &own, (-lump.joint * at_end(k, lump.end)).into());
            }
            if has_housing {
                rows[first_housing][first_housing] += lump.film;
                add(&mut rows[first_housing], &own, (-lump.film).into());
            }
        }
    }

    fn balance_faces_and_housings(&self, s: C, slab: &Slab, rows: &mut [Form]) {
        let (unknowns, around, first_housing) = (self.unknowns(), self.around(), self.first_housing());
        let (has_housing, start) = (!self.housings.is_empty(), unknowns + START);
        for touch in &self.touches {
            let (row, own) = match touch.flange {
                Some(flange) => (self.place_of(flange), self.flange(flange)),
                None => (has_housing.then_some(first_housing), around.clone()),
            };
            if let Some(row) = row {
                let film = touch.film_w_per_m2_k * self.biot_per_film * self.film_per_biot * self.face_m2;
                add(&mut rows[row], &own, film.into());
                add(&mut rows[row], &slab.ends[touch.end], (-film).into());
            }
        }
        for (i, [capacity, inwards]) in self.housings.iter().enumerate() {
            let place = first_housing + i;
            rows[place][place] += s * capacity + inwards;
            rows[place][start] -= capacity * self.housing_above_pack_k;
            if i > 0 {
                rows[place][place - 1] -= inwards;
                rows[place - 1][place - 1] += inwards;
                rows[place - 1][place] -= inwards;
            } else {
                // What the waves are above p comes with them.
                add(&mut rows[place], &slab.mean, (-inwards).into());
            }
        }
        if has_housing {
            let last = unknowns - 1;
            rows[last][last] += self.outside;
            add(&mut rows[last], &self.drive(), (-self.outside).into());
        }
    }

    /// The unknowns per unit of each input.
    fn solved(&self, rows: &[Form]) -> DMatrix<C> {
        let n = rows.len();
        if n == 0 {
            return DMatrix::zeros(0, INPUTS);
        }
        let matrix = DMatrix::from_fn(n, n, |i, j| rows[i][j]);
        let mut known = DMatrix::from_fn(n, INPUTS, |i, input| -rows[i][n + input]);
        // Heat capacities and conductances, all positive: never singular.
        if !matrix.lu().solve_mut(&mut known) {
            known.fill(C::new(f64::NAN, 0.0));
        }
        known
    }
}
