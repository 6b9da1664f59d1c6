//! What compensating a stream of rows came to.

use serde::Serialize;

use crate::compensate::stream::Flag;
use crate::numeric::statistics::RunningDeviation;
use crate::units::deg_per_h_from_rad_per_s;

/// What a stream did.
#[derive(Debug, Clone, Default, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct StreamSummary {
    /// Rows read.
    pub rows: usize,
    pub(crate) delay_rows: usize,
    /// Could not be read and were passed on as they stand.
    pub malformed: usize,
    /// Stamped no later than the row before.
    pub clock_back: usize,
    pub(crate) gap: usize,
    pub(crate) temperature_held: usize,
    /// A further column's last good value stood in.
    pub channel_held: usize,
    pub(crate) rate_held: usize,
    /// The rate was a gross error.
    pub rate_rejected: usize,
    /// Standard deviations over the rows without a flag.
    pub(crate) rate_deviation_deg_per_h: Option<f64>,
    pub(crate) compensated_deviation_deg_per_h: Option<f64>,
    /// What this start-up added to the bias; null where nobody asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) turn_on_offset_deg_per_h: Option<f64>,
    /// That the compensated rate scatters more than the gyro's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) caution: Option<String>,
}

impl StreamSummary {
    /// Sets both standard deviations, of rates in rad/s, and what they say.
    pub(crate) fn judge(&mut self, before: &RunningDeviation, after: &RunningDeviation) {
        let [before, after] = [before, after].map(|rates| rates.deviation().map(deg_per_h_from_rad_per_s));
        (self.rate_deviation_deg_per_h, self.compensated_deviation_deg_per_h) = (before, after);
        self.caution = before.zip(after).and_then(|(before, after)| scatters_more(before, after));
    }

    /// Counts what happened to a row.
    pub(crate) fn count(&mut self, flag: Flag) {
        *match flag {
            Flag::Malformed => &mut self.malformed,
            Flag::ClockBack => &mut self.clock_back,
            Flag::Gap => &mut self.gap,
            Flag::TemperatureHeld => &mut self.temperature_held,
            Flag::ChannelHeld => &mut self.channel_held,
            Flag::RateHeld => &mut self.rate_held,
            Flag::RateRejected => &mut self.rate_rejected,
        } += 1;
    }
}

/// A caution about standard deviations in °/h, where there is more after compensation than before.
pub(crate) fn scatters_more(before_deg_per_h: f64, after_deg_per_h: f64) -> Option<String> {
    (after_deg_per_h > before_deg_per_h).then(|| {
        format!(
            "the compensated rate scatters by {after_deg_per_h:.5} °/h, the gyro's own by {before_deg_per_h:.5}: this compensator makes \
             this record worse; `compare` says where its model fails, `compensate --all-methods` judges the other methods"
        )
    })
}
