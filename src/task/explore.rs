//! A model under a reader's hand: windings judged one after another, with the model's numbers moved in between.
//!
//! A page asks in JSON, one request at a time ([`AskJson`]). Every number comes from where `evaluate` has it.

use std::path::Path;

use crate::io::json::WindabilityJson;
use crate::io::json::explore::{AnswerJson, AskJson, NamedSegmentsJson, ProfileJson, SettingsJson};
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::model_file::parse_model;
use crate::io::read::pattern_file::print_pattern;
use crate::io::write::model_edit::with_sensor_and_pattern;
use crate::io::write::model_tuning::{has_surfaces, settings, tuned};
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::pattern::windability::WindingGraph;
use crate::rate::RateModel;
use crate::search::cost::columns::Norm;
use crate::search::cost::samples::SampleMatrix;
use crate::search::cost::worst_case::{SearchError, SolvedProfile, SolvedProfiles};
use crate::search::swap::{best_swap, shares};
use crate::thermal::Instant;
use crate::units::{celsius_from_kelvin, deg_per_h_from_rad_per_s};

use super::TaskError;
use super::evaluate::{COLUMNS, Groundwork, cells};

/// The model that is looked at, with what was worked out for it so far.
#[derive(Debug, Default)]
pub struct Session {
    open: Option<OpenModel>,
}

#[derive(Debug)]
struct OpenModel {
    file: ModelFile,
    ground: Ground,
    /// What exchanges are judged on.
    matrix: Option<SampleMatrix>,
}

/// The profiles' fields come first, so that there is a first number soon.
#[derive(Debug)]
enum Ground {
    Fields(Option<SolvedProfiles>),
    Whole(Box<Groundwork>),
}

impl Session {
    /// Answers a request, a JSON document, with another; what cannot be answered with `{"error": …}`.
    pub fn answer(&mut self, request: &str) -> String {
        let answer = serde_json::from_str(request).map_err(TaskError::from).and_then(|ask| self.respond(ask));
        let answer = answer.unwrap_or_else(|error| AnswerJson::Refused { error: error.to_string() });
        serde_json::to_string(&answer)
            .unwrap_or_else(|_| "{\"error\":\"the answer cannot be written down\"}".to_owned())
    }

    fn respond(&mut self, ask: AskJson) -> Result<AnswerJson, TaskError> {
        match ask {
            AskJson::Open { file, source, settings } => self.open(&file, &source, &settings),
            other => self.open.as_mut().ok_or_else(|| refused("ask", "no model is open"))?.respond(other),
        }
    }

    fn open(&mut self, file: &str, source: &str, set: &SettingsJson) -> Result<AnswerJson, TaskError> {
        let path = Path::new(file);
        let stated = parse_model(path, source)?;
        let source = tuned(&stated, set)?;
        let file = if source == stated.source { stated } else { parse_model(path, &source)? }.for_search();
        let profiles = file.profiles.profiles();
        let solved = SolvedProfiles::new(&file.model, &profiles)?;
        let layers = file.model.coil.layers();
        let classics = Classic::ALL.into_iter().filter_map(|classic| {
            let segments = classic.pattern(layers).ok()?.segments().to_vec();
            Some(NamedSegmentsJson { name: classic.key().to_owned(), title: classic.title().to_owned(), segments })
        });
        let answer = AnswerJson::Open {
            model: file.model.name.clone(),
            layers,
            notes: file.advice.iter().map(ToString::to_string).collect(),
            settings: settings(&file),
            has_surfaces: has_surfaces(&file),
            profiles: profiles
                .iter()
                .map(|p| ProfileJson { name: p.name().to_owned(), duration_s: p.duration_s() })
                .collect(),
            classics: classics.collect(),
            columns: COLUMNS.to_vec(),
        };
        self.open = Some(OpenModel { file, ground: Ground::Fields(Some(solved)), matrix: None });
        Ok(answer)
    }
}

impl OpenModel {
    fn respond(&mut self, ask: AskJson) -> Result<AnswerJson, TaskError> {
        match ask {
            AskJson::Open { .. } => Err(refused("ask", "a model is open already")),
            AskJson::Worst { segments } => {
                let pattern = pattern_of(segments)?;
                let worst = self.solved().worst_case(&self.file.model, &pattern)?;
                let worst_rate_deg_per_h = deg_per_h_from_rad_per_s(worst.rate_rad_per_s.abs());
                Ok(AnswerJson::Worst {
                    worst_rate_deg_per_h,
                    shown: format!("{worst_rate_deg_per_h:.4}"),
                    windability: WindabilityJson::of(&pattern),
                })
            }
            AskJson::Judge { name, segments } => {
                let named = NamedPattern { name, pattern: pattern_of(segments)? };
                let hard_because = WindingGraph::new(&named.pattern).first_captive_run().map(|run| run.to_string());
                self.lay_ground()?;
                let Ground::Whole(ground) = &self.ground else { return Err(refused("ask", "the model is not solved")) };
                let pattern = ground.judge(&self.file, &named)?.body;
                Ok(AnswerJson::Judge { cells: cells(&pattern).to_vec(), pattern, hard_because })
            }
            AskJson::Series { profile, patterns } => self.series(&profile, patterns),
            AskJson::Moment { profile, time_s, segments } => self.moment(&profile, time_s, segments),
            AskJson::Swap { segments, as_easy } => self.swap(segments, as_easy),
            AskJson::Save { name, segments } => self.save(name, segments),
        }
    }

    fn solved(&self) -> &SolvedProfiles {
        match &self.ground {
            Ground::Fields(solved) => solved.as_ref().expect("taken only where the ground is laid on them"),
            Ground::Whole(ground) => &ground.solved,
        }
    }

    fn lay_ground(&mut self) -> Result<(), TaskError> {
        if let Ground::Fields(solved) = &mut self.ground {
            let solved = match solved.take() {
                Some(solved) => solved,
                None => SolvedProfiles::new(&self.file.model, &self.file.profiles.profiles())?,
            };
            self.ground = Ground::Whole(Box::new(Groundwork::on(solved, &self.file)?));
        }
        Ok(())
    }

    fn profile(&self, name: &str) -> Result<&SolvedProfile, TaskError> {
        let found = self.solved().profiles().iter().find(|p| p.profile.name() == name);
        found
            .ok_or_else(|| TaskError::UnknownProfile { stated: name.to_owned(), known: "those of the list".to_owned() })
    }

    fn series(&self, profile: &str, patterns: Vec<Vec<usize>>) -> Result<AnswerJson, TaskError> {
        let solved = self.profile(profile)?;
        let series = |segments: Vec<usize>| -> Result<Vec<f64>, TaskError> {
            let rate_model = RateModel::new(&self.file.model, &pattern_of(segments)?, &[])?;
            Ok(solved.series_rad_per_s(&rate_model).into_iter().map(deg_per_h_from_rad_per_s).collect())
        };
        Ok(AnswerJson::Series {
            times_s: solved.history.times_s.clone(),
            boundary_c: solved.history.ambient_k.iter().map(|t| celsius_from_kelvin(*t)).collect(),
            rates_deg_per_h: patterns.into_iter().map(series).collect::<Result<_, _>>()?,
        })
    }

    fn moment(&self, profile: &str, time_s: f64, segments: Vec<usize>) -> Result<AnswerJson, TaskError> {
        let (solved, pattern) = (self.profile(profile)?, pattern_of(segments)?);
        if !(0.0..=solved.profile.duration_s()).contains(&time_s) {
            return Err(refused("time_s", "is outside the profile"));
        }
        let instant = Instant::after(time_s);
        let history = solved.field.at(&[instant]);
        let shares = match shares(&self.file.model, solved, &pattern, instant) {
            Ok(shares) => Some(shares),
            Err(SearchError::Rate(crate::rate::RateError::NotSearchable { .. })) => None,
            Err(error) => return Err(error.into()),
        };
        Ok(AnswerJson::Moment {
            temperatures_c: history.temperatures_k(0).iter().map(|t| celsius_from_kelvin(*t)).collect(),
            boundary_c: celsius_from_kelvin(history.ambient_k[0]),
            rest_deg_per_h: shares.as_ref().map_or(0.0, |s| deg_per_h_from_rad_per_s(s.rest_rad_per_s)),
            shares_deg_per_h: shares.map(|s| s.layers_rad_per_s.into_iter().map(deg_per_h_from_rad_per_s).collect()),
        })
    }

    fn swap(&mut self, segments: Vec<usize>, as_easy: bool) -> Result<AnswerJson, TaskError> {
        let pattern = pattern_of(segments)?;
        if self.matrix.is_none() {
            self.matrix = Some(SampleMatrix::of_profiles(&self.file.model, self.solved())?.0);
        }
        let matrix = self.matrix.as_ref().expect("made above");
        let Some(swap) = best_swap(&self.file.model, matrix, Norm::Largest, &pattern, as_easy)? else {
            return Ok(AnswerJson::Swap {
                layers: None,
                segments: Vec::new(),
                worst_rate_deg_per_h: None,
                class: None,
            });
        };
        let worst = self.solved().worst_case(&self.file.model, &swap.pattern)?;
        Ok(AnswerJson::Swap {
            layers: Some([swap.layers.0, swap.layers.1]),
            segments: swap.pattern.segments().to_vec(),
            worst_rate_deg_per_h: Some(deg_per_h_from_rad_per_s(worst.rate_rad_per_s.abs())),
            class: Some(WindabilityJson::of(&swap.pattern).class),
        })
    }

    fn save(&self, name: String, segments: Vec<usize>) -> Result<AnswerJson, TaskError> {
        if let Some(fault) = crate::text::name_fault(&name) {
            return Err(TaskError::Option { option: "name", message: fault });
        }
        let pattern_file = format!("{}.toml", file_stem(&name));
        let own = self.file.path.display().to_string();
        let named = NamedPattern { name, pattern: pattern_of(segments)? };
        Ok(AnswerJson::Save {
            model_toml: with_sensor_and_pattern(&own, &self.file.source, None, &pattern_file)?,
            model_file: format!("{}-with-{pattern_file}", own.trim_end_matches(".toml")),
            pattern_toml: print_pattern(&named, &[]),
            pattern_file,
        })
    }
}

/// What a file can be called after a name on every system.
fn file_stem(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || "._-".contains(c) { c } else { '-' };
    let stem: String = name.chars().map(plain).take(80).collect();
    let stem = stem.trim_matches(['.', '-']).to_owned();
    // A classic's key would be read as the classic.
    if stem.is_empty() || Classic::from_key(&stem).is_ok() { format!("pattern-{stem}") } else { stem }
}

fn pattern_of(segments: Vec<usize>) -> Result<Pattern, TaskError> {
    Pattern::new(segments).map_err(|error| refused("segments", &error.to_string()))
}

fn refused(option: &'static str, message: &str) -> TaskError {
    TaskError::Option { option, message: message.to_owned() }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use crate::io::read::model_file::read_model;
    use crate::task::Unobserved;
    use crate::task::evaluate::{Request, run as evaluate};

    const MODEL: &str = "examples/paper-200m.toml";

    fn ask(session: &mut Session, request: &Value) -> Value {
        let answer: Value = serde_json::from_str(&session.answer(&request.to_string())).unwrap();
        assert!(answer.get("error").is_none(), "{answer}");
        answer
    }

    fn opened(settings: &Value) -> (Session, Value) {
        let source = std::fs::read_to_string(MODEL).unwrap().replace("count = 64", "count = 4");
        let mut session = Session::default();
        let open = json!({"ask": "open", "file": "paper.toml", "source": source, "settings": settings});
        let answer = ask(&mut session, &open);
        (session, answer)
    }

    #[test]
    fn what_is_saved_evaluates_to_the_numbers_that_were_shown() {
        let (mut session, open) = opened(&json!({"diffusivity_m2_per_s": 4e-7, "max_rate_c_per_h": 25.0}));
        assert_eq!(open["settings"]["max_rate_c_per_h"], 25.0);
        let mut segments: Vec<usize> = (1..=12).collect();
        segments.swap(2, 9);
        let judged = ask(&mut session, &json!({"ask": "judge", "name": "mine", "segments": segments}));
        let first = ask(&mut session, &json!({"ask": "worst", "segments": segments}));
        assert_eq!(judged["cells"][1], first["shown"]);
        let saved = ask(&mut session, &json!({"ask": "save", "name": "mine", "segments": segments}));
        let folder = tempfile::tempdir().unwrap();
        for part in ["pattern", "model"] {
            let name = saved[format!("{part}_file")].as_str().unwrap();
            std::fs::write(folder.path().join(name), saved[format!("{part}_toml")].as_str().unwrap()).unwrap();
        }
        let file = read_model(&folder.path().join(saved["model_file"].as_str().unwrap())).unwrap();
        let patterns = [file.pattern.clone().unwrap()];
        let evaluated = evaluate(&Request { model: &file, patterns: &patterns }, &Unobserved).unwrap();
        let found = serde_json::to_value(&evaluated.document.patterns[0]).unwrap();
        for (key, value) in judged["pattern"].as_object().unwrap().iter().filter(|(key, _)| *key != "name") {
            assert_eq!(*value, found[key], "{key}");
        }
        assert_eq!(found["segments"], json!(segments));
    }

    #[test]
    fn series_moments_and_hints_belong_together() {
        let (mut session, open) = opened(&json!({}));
        let dip = open["classics"].as_array().unwrap().iter().find(|c| c["name"] == "dip").unwrap()["segments"].clone();
        let judged = ask(&mut session, &json!({"ask": "judge", "name": "dip", "segments": dip}))["pattern"].clone();
        let profile = judged["worst_profile"].clone();
        let series = ask(&mut session, &json!({"ask": "series", "profile": profile, "patterns": [dip]}));
        let rates = series["rates_deg_per_h"][0].as_array().unwrap();
        let largest = rates.iter().map(|r| r.as_f64().unwrap().abs()).fold(0.0, f64::max);
        let worst = judged["worst_rate_deg_per_h"].as_f64().unwrap();
        assert!(largest <= worst * (1.0 + 1e-12) && largest > 0.95 * worst, "{largest} {worst}");
        let time = judged["worst_time_s"].clone();
        let moment = ask(&mut session, &json!({"ask": "moment", "profile": profile, "time_s": time, "segments": dip}));
        let shares = moment["shares_deg_per_h"].as_array().unwrap().iter().map(|s| s.as_f64().unwrap());
        let sum = shares.sum::<f64>() + moment["rest_deg_per_h"].as_f64().unwrap();
        assert!((sum.abs() / worst - 1.0).abs() < 1e-9, "{sum} {worst}");
        let hint = ask(&mut session, &json!({"ask": "swap", "segments": dip, "as_easy": false}));
        assert!(hint["worst_rate_deg_per_h"].as_f64().unwrap() < worst, "{hint}");
    }

    #[test]
    fn what_makes_no_sense_is_answered_with_words() {
        let (mut session, _) = opened(&json!({}));
        for request in [
            "",
            "{}",
            "{\"ask\":\"judge\",\"name\":\"x\",\"segments\":[1,1]}",
            "{\"ask\":\"worst\",\"segments\":[1,2]}",
        ] {
            let answer: Value = serde_json::from_str(&session.answer(request)).unwrap();
            assert!(answer["error"].as_str().is_some_and(|words| words.len() > 10), "{request}: {answer}");
        }
        let nothing: Value =
            serde_json::from_str(&Session::default().answer("{\"ask\":\"worst\",\"segments\":[1,2]}")).unwrap();
        assert!(nothing["error"].is_string());
        assert_eq!(file_stem("../qua"), "pattern-qua");
        assert_eq!(file_stem("a b/c"), "a-b-c");
    }
}
