//! Whether a schedule, a traveller or a machine program is right for a coil.

use crate::io::files::sha256_hex;
use crate::io::json::{VerifyJson, ViolationJson};
use crate::io::model::ModelFile;
use crate::io::read::schedule_reader::shop_of;
use crate::report::page::assets;
use crate::units::deg_per_h_from_rad_per_s;
use crate::verify::{Claim, RateCheck, Truth, verify};

/// What is to be checked against what.
#[derive(Debug)]
pub struct Request<'a> {
    /// The coil and its profiles, as the schedule should have them.
    pub model: &'a ModelFile,
    /// The file that is checked.
    pub claim: &'a Claim,
    /// What the document calls the claim.
    pub claim_name: &'a str,
}

/// The document, and how many profiles the rate was worked out over.
#[derive(Debug)]
pub struct Answer {
    /// As the program prints it.
    pub document: VerifyJson,
    pub(crate) profiles: usize,
}

/// Checks with code that shares nothing with what emitted the claim.
pub fn run(request: &Request) -> Answer {
    let file = &request.model.clone().for_search();
    let truth = Truth {
        model: &file.model,
        profiles: &file.profiles,
        model_sha256: &sha256_hex(&file.source),
        shop: &shop_of(&file.production),
        assets: &assets(),
    };
    let found = verify(&truth, request.claim);
    let deg_per_h = deg_per_h_from_rad_per_s;
    let (rate_check, worst, tolerance, finer, profiles) = match found.rate_check {
        RateCheck::None => ("not claimed or not possible", None, None, None, 0),
        RateCheck::Independent { worst_rad_per_s, tolerance_rad_per_s, finer_rad_per_s, profiles } => (
            "independent solution",
            Some(deg_per_h(worst_rad_per_s)),
            Some(deg_per_h(tolerance_rad_per_s)),
            finer_rad_per_s.map(deg_per_h),
            profiles,
        ),
    };
    let document = VerifyJson {
        model: file.path.display().to_string(),
        schedule: request.claim_name.to_owned(),
        checks: found.checks,
        rate_check: rate_check.to_owned(),
        independent_worst_rate_deg_per_h: worst,
        rate_tolerance_deg_per_h: tolerance,
        finer_worst_rate_deg_per_h: finer,
        recomputed: found.recomputed,
        taken_as_given: found.taken_as_given,
        violations: found
            .violations
            .iter()
            .map(|v| ViolationJson {
                row: v.row,
                field: v.field.clone(),
                expected: v.expected.clone(),
                found: v.found.clone(),
                remedy: v.remedy.to_owned(),
                message: v.to_string(),
            })
            .collect(),
    };
    Answer { document, profiles }
}
