//! The passes' arithmetic: what the processor has for a product that is added.
//!
//! A pass is mostly products that are added. Fused, product and sum are one instruction where there were two, and are rounded once;
//! where the processor has none it would be a call, so there they are a product and then a sum. The last digits of a likelihood are
//! those of the kind of processor, and the same at any number of threads.

/// a b + c.
pub(super) trait Arithmetic: Copy {
    fn add_product(self, a: f64, b: f64, c: f64) -> f64;
}

/// Rounded once, by one instruction.
#[derive(Debug, Clone, Copy)]
pub(super) struct RoundedOnce;

impl Arithmetic for RoundedOnce {
    #[inline(always)]
    fn add_product(self, a: f64, b: f64, c: f64) -> f64 {
        a.mul_add(b, c)
    }
}

/// Rounded twice.
#[derive(Debug, Clone, Copy)]
pub(super) struct RoundedTwice;

impl Arithmetic for RoundedTwice {
    #[inline(always)]
    fn add_product(self, a: f64, b: f64, c: f64) -> f64 {
        a * b + c
    }
}

/// What is compiled once for each arithmetic.
pub(super) trait Pass {
    type Output;

    fn run(self, arithmetic: impl Arithmetic) -> Self::Output;
}

/// Runs a pass with the best that the processor has; it is compiled for that and, where a processor may lack it, once more.
pub(super) fn dispatched<P: Pass>(pass: P) -> P::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return simd.vectorize(Fused(pass));
    }
    // Every 64-bit ARM has it.
    #[cfg(target_arch = "aarch64")]
    return pass.run(RoundedOnce);
    #[cfg(not(target_arch = "aarch64"))]
    pass.run(RoundedTwice)
}

#[cfg(target_arch = "x86_64")]
struct Fused<P>(P);

#[cfg(target_arch = "x86_64")]
impl<P: Pass> pulp::NullaryFnOnce for Fused<P> {
    type Output = P::Output;

    #[inline(always)]
    fn call(self) -> Self::Output {
        self.0.run(RoundedOnce)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Sum<'a>(&'a [f64]);

    impl Pass for Sum<'_> {
        type Output = f64;

        #[inline(always)]
        fn run(self, arithmetic: impl Arithmetic) -> f64 {
            self.0.iter().fold(0.0, |sum, v| arithmetic.add_product(*v, *v, sum))
        }
    }

    #[test]
    fn both_ways_of_adding_products_agree_but_for_rounding() {
        let values: Vec<f64> = (0..1000).map(|i| (0.37 * f64::from(i)).sin()).collect();
        let (plain, fused) = (Sum(&values).run(RoundedTwice), Sum(&values).run(RoundedOnce));
        let found = dispatched(Sum(&values));
        assert!(found == plain || found == fused, "{found}");
        assert!((plain / fused - 1.0).abs() < 1e-13, "{plain} {fused}");
    }
}
