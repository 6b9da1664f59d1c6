//! Whether a search's best pattern differs from a former one, and what the former one costs under this model.

use std::path::Path;

use super::CliError;
use crate::io::fault::Faults;
use crate::io::json::PatternJson;
use crate::io::model::NamedPattern;
use crate::io::read::pattern_file::resolve_pattern;
use crate::io::write::run_directory::FormerJson;
use crate::pattern::windability::WindabilityClass;
use crate::search::evaluator::{EQUALLY_GOOD, Evaluator, Judged};
use crate::units::deg_per_h_from_rad_per_s;

/// A winding's name, a pattern file, or the folder of a search, whose best pattern counts.
pub(super) fn former_pattern(stated: &str, layers: usize) -> Result<NamedPattern, CliError> {
    let folder = Path::new(stated);
    if !folder.is_dir() {
        return Ok(resolve_pattern(stated, layers, None)?);
    }
    let best = folder.join("best.toml");
    if !best.is_file() {
        let message = "holds no best.toml: is it the folder that `coilwright optimise … -o DIR` wrote?";
        return Err(Faults::of_file(stated, message).into());
    }
    Ok(resolve_pattern(&best.display().to_string(), layers, None)?)
}

/// The former pattern judged under the model of the search, beside the best one found.
pub(super) fn compare_with_former(
    evaluator: &Evaluator,
    class: WindabilityClass,
    best: &Judged,
    former: &NamedPattern,
) -> Result<FormerJson, CliError> {
    let old = evaluator.judge(&former.name, &former.pattern)?;
    let (new_cost, old_cost) = (best.objective_rad_per_s, old.objective_rad_per_s);
    let best_changed = new_cost < old_cost * (1.0 - EQUALLY_GOOD);
    let what = evaluator.objective.key();
    let shown = |cost: f64| format!("{:.4} °/h", deg_per_h_from_rad_per_s(cost));
    let (old_shown, new_shown, name) = (shown(old_cost), shown(new_cost), &former.name);
    let statement = if best_changed {
        format!(
            "The best pattern changed: under this model the former one, {name}, costs {old_shown} ({what}), {:.2} times the {new_shown} of the new one, {}.",
            old_cost / new_cost,
            best.name
        )
    } else if old_cost < new_cost * (1.0 - EQUALLY_GOOD) {
        let why = if class.admits(&former.pattern) {
            "search longer, or begin with it (--init)".to_owned()
        } else {
            format!("it is not of the class {class}")
        };
        format!(
            "The former pattern, {name}, is better than what was found: it costs {old_shown} ({what}) under this model, the new one {new_shown}; {why}."
        )
    } else {
        format!(
            "The best pattern did not change: under this model the former one, {name}, costs {old_shown} ({what}), and nothing better was found."
        )
    };
    Ok(FormerJson {
        best_changed,
        cost_deg_per_h: deg_per_h_from_rad_per_s(old_cost),
        // A pattern without any error has no multiple.
        cost_factor: (new_cost > 0.0).then(|| old_cost / new_cost),
        pattern: PatternJson::of(&old),
        statement,
    })
}
