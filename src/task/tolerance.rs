//! What windings are worth when they are built imperfectly.

use crate::io::json::tolerance::{DistributionJson, ToleranceJson};
use crate::io::model::{ModelFile, NamedPattern};
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::search::cost::tolerance::{ToleranceSpec, measure, study};

use super::{Observer, TaskError, advise, own_and_classics};

/// What is to be studied.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The coil and how built ones spread.
    pub model: &'a ModelFile,
    /// Empty for the model's own and all classics that fit; QUA always joins them where it fits.
    pub patterns: &'a [NamedPattern],
    /// Coils to draw; none for the model's own number.
    pub samples: Option<usize>,
    /// Of the draws; None for the model's own.
    pub seed: Option<u64>,
    /// A coil whose worst case is larger is scrap.
    pub limit_rad_per_s: Option<f64>,
}

impl<'a> Request<'a> {
    /// As the model's `[tolerance]` says.
    pub fn new(model: &'a ModelFile) -> Self {
        Self { model, patterns: &[], samples: None, seed: None, limit_rad_per_s: None }
    }
}

/// Draws coils and studies them.
///
/// # Errors
/// A model without tolerances, or one that cannot be solved.
pub fn run(request: &Request, observer: &dyn Observer) -> Result<ToleranceJson, TaskError> {
    let file = &request.model.clone().for_search();
    advise(file, observer);
    let Some(declared) = &file.tolerance else {
        return Err(TaskError::NoTolerance { path: file.path.display().to_string() });
    };
    let spec = ToleranceSpec {
        samples: request.samples.unwrap_or(declared.samples),
        seed: request.seed.unwrap_or(declared.seed),
        limit_rad_per_s: request.limit_rad_per_s.or(declared.limit_rad_per_s),
        ..declared.clone()
    };
    let layers = file.model.coil.layers();
    let mut named = if request.patterns.is_empty() { own_and_classics(file) } else { request.patterns.to_vec() };
    if let Ok(pattern) = Classic::Qua.pattern(layers)
        && !named.iter().any(|n| n.pattern == pattern)
    {
        named.push(NamedPattern { name: Classic::Qua.key().to_owned(), pattern });
    }
    let patterns: Vec<Pattern> = named.iter().map(|n| n.pattern.clone()).collect();
    let found = study(&file.model, &file.profiles, &spec, &patterns)?;
    let measure = measure(&file.model, file.profiles.max_rate_k_per_s)?;
    let rows = named.iter().zip(&found).map(|(named, found)| DistributionJson::new(&named.name, found)).collect();
    Ok(ToleranceJson::new(&file.model.name, &spec, measure, rows))
}
