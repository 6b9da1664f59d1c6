//! What the winding shop adds to the design: tension, allowance, adhesive.

/// The shop's settings for one coil.
#[derive(Debug, Clone, PartialEq)]
pub struct Production {
    pub(crate) part_number: String,
    pub(crate) revision: String,
    /// The spool's drawing number or name.
    pub(crate) spool: String,
    pub(crate) tension_n: f64,
    /// The tension falls by this share of the first layer's from layer to layer.
    pub(crate) tension_taper_per_layer: f64,
    /// How far the tension may be from its set-point, as a share of it.
    pub(crate) tension_limit: f64,
    /// Surplus on each reel, for leads and splices.
    pub(crate) allowance_m: f64,
    pub(crate) adhesive: String,
    /// Adhesive is applied after so many layers; 0: only after the last.
    pub(crate) potting_every_layers: usize,
    pub(crate) cure: String,
    pub(crate) winding_speed_turns_per_min: f64,
}

impl Default for Production {
    /// Values that are common for coils of 80 µm to 165 µm fibre; a shop states its own.
    fn default() -> Self {
        Self {
            part_number: String::new(),
            revision: String::new(),
            spool: String::new(),
            tension_n: 0.1,
            tension_taper_per_layer: 0.0,
            tension_limit: 0.1,
            allowance_m: 3.0,
            adhesive: String::new(),
            potting_every_layers: 1,
            cure: String::new(),
            winding_speed_turns_per_min: 60.0,
        }
    }
}

impl Production {
    /// Set-point for a layer, counted from 1.
    pub(crate) fn tension_n_at(&self, layer: usize) -> f64 {
        self.tension_n * (1.0 - self.tension_taper_per_layer * (layer.max(1) - 1) as f64).max(0.0)
    }

    /// The least and the largest tension at a layer, counted from 1.
    pub(crate) fn tension_limits_n_at(&self, layer: usize) -> [f64; 2] {
        let set_n = self.tension_n_at(layer);
        [set_n * (1.0 - self.tension_limit), set_n * (1.0 + self.tension_limit)]
    }

    /// Whether adhesive is applied after a layer, counted from 1, of so many.
    pub(crate) fn pots_after(&self, layer: usize, layers: usize) -> bool {
        layer == layers || (self.potting_every_layers > 0 && layer.is_multiple_of(self.potting_every_layers))
    }
}
