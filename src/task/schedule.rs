//! The order of work at the winding machine.

use crate::io::json::schedule::ScheduleJson;
use crate::io::model::{ModelFile, NamedPattern};
use crate::schedule::Schedule;
use crate::search::cost::worst_case::SolvedProfiles;

use super::{TaskError, pattern_or_own};

/// What leaves for the shop floor.
pub const FILES: [&str; 8] = [
    "schedule.csv",
    "schedule.json",
    "traveller.html",
    "traveller.csv",
    "traveller.json",
    "program.gcode",
    "program.csv",
    "cross-section.svg",
];

/// What is to be wound.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The coil and its winding shop.
    pub model: &'a ModelFile,
    /// None for the model's own.
    pub pattern: Option<&'a NamedPattern>,
}

/// The schedule and the document that claims it.
#[derive(Debug)]
pub struct Answer {
    /// As the program prints it.
    pub document: ScheduleJson,
    pub(crate) schedule: Schedule,
    pub(crate) pattern: NamedPattern,
}

/// Plans the winding.
///
/// # Errors
/// No pattern, one of another layer count, a model that cannot be solved.
pub fn run(request: &Request) -> Result<Answer, TaskError> {
    let file = &request.model.clone().for_search();
    let pattern = pattern_or_own(file, request.pattern)?;
    let coil = file.model.wound_coil().map_err(crate::rate::RateError::from)?;
    let schedule = Schedule::new(&coil, &pattern.pattern)?;
    let solved = SolvedProfiles::new(&file.model, &file.profiles.profiles())?;
    let worst = solved.worst_case(&file.model, &pattern.pattern)?;
    let document = ScheduleJson::new(file, &pattern, &schedule, &worst);
    Ok(Answer { document, schedule, pattern })
}

impl Answer {
    /// schedule.csv and schedule.json.
    ///
    /// # Errors
    /// None that a schedule causes.
    pub(crate) fn tables(&self) -> Result<Vec<(&'static str, String)>, TaskError> {
        Ok(vec![("schedule.csv", csv(&self.document)?), ("schedule.json", json(&self.document)?)])
    }
}

fn csv(document: &ScheduleJson) -> Result<String, TaskError> {
    document.csv().map_err(|error| TaskError::Unprintable(error.to_string()))
}

fn json(document: &ScheduleJson) -> Result<String, TaskError> {
    Ok(serde_json::to_string_pretty(document)? + "\n")
}

#[cfg(feature = "report")]
mod shop_floor {
    use super::{Answer, ModelFile, TaskError, csv, json};
    use crate::io::write::machine_program::{gcode, machine_program};
    use crate::io::write::traveller::traveller;
    use crate::report::cross_section::cross_section;
    use crate::report::traveller::traveller_page;

    impl Answer {
        /// Everything that leaves for the shop floor, by file name.
        ///
        /// # Errors
        /// None that a schedule causes.
        pub fn files(&self, model: &ModelFile) -> Result<Vec<(&'static str, String)>, TaskError> {
            let axial_pitch_m = model.model.coil.axial_pitch_m();
            let traveller = traveller(&self.document, &self.schedule, &model.production, axial_pitch_m);
            let program = machine_program(&self.document, &self.schedule, &model.production, axial_pitch_m);
            let title = format!("{}, {}", model.model.name, self.pattern.name);
            let mut files = self.tables()?;
            files.extend([
                ("traveller.html", traveller_page(&traveller, &self.pattern.pattern)),
                ("traveller.csv", csv(&traveller)?),
                ("traveller.json", json(&traveller)?),
                ("program.gcode", gcode(&program, &self.schedule)),
                ("program.csv", csv(&program)?),
                ("cross-section.svg", cross_section(&title, &self.pattern.pattern)),
            ]);
            Ok(files)
        }
    }
}
