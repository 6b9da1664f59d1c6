//! The traveller's data: the schedule with everything that the shop floor needs.

use super::machine_program::machine_program;
use crate::io::json::schedule::{LENGTH_DECIMALS, ScheduleJson, rounded};
use crate::schedule::{Schedule, production::Production};

/// The schedule with reels' loads, crossovers, tension, potting, the balance of the halves, and cells to fill in.
pub fn traveller(
    plain: &ScheduleJson,
    schedule: &Schedule,
    production: &Production,
    axial_pitch_m: f64,
) -> ScheduleJson {
    let mut document = machine_program(plain, schedule, production, axial_pitch_m);
    document.document = "traveller".to_owned();
    for (row, step) in document.steps.iter_mut().zip(schedule.steps()) {
        row.balance_m = Some(rounded(step.balance_m, LENGTH_DECIMALS));
        row.measured_length_m = Some(String::new());
        row.checked_by = Some(String::new());
    }
    document
}
