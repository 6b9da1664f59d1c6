//! `optimise --field`: the search under temperatures that were computed elsewhere.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::optimise::Arguments;
use super::progress::{Progress, StopFlag};
use super::screen::{Screen, held, table};
use super::watching::Watching;
use super::{CliError, Ending};
use crate::io::json::field::FieldSearchJson;
use crate::io::model::ModelFile;
use crate::io::write::run_directory::check_kept;
use crate::search::Observer;
use crate::search::anneal::rounds::Rounds;
use crate::search::answer::Ended;
use crate::search::run::Halt;
use crate::task::evaluate::{COLUMNS, cells};
use crate::task::optimise::Wishes;
use crate::task::under_fields::{self, FieldFile, Search};
use crate::units::deg_per_h_from_rad_per_s;

pub(super) fn run(
    arguments: &Arguments,
    file: &ModelFile,
    stop: &StopFlag,
    screen: &Screen,
) -> Result<Ending, CliError> {
    let options = &arguments.search;
    let budget = options.budget()?;
    let objective = under_fields::objective(file, options.objective)?;
    let wishes = Wishes { objective: Some(objective), ..options.wishes(file)? };
    let fields = arguments.field.iter().map(|path| FieldFile::read(path)).collect::<Result<Vec<_>, _>>()?;
    let folder = arguments.output.as_deref();
    folder.map_or(Ok(()), |folder| check_kept(folder, screen.named().chain(file.files())))?;
    let _held = folder.map(|folder| held(folder, "optimise")).transpose()?;
    let class = wishes.class(file);
    let request = Search { model: file, fields: &fields, class, objective, plan: wishes.plan(file)? };
    let started = Instant::now();
    let progress = screen.progress("optimise", request.plan.rules.moves);
    let mut watch = Watch { progress, stop, budget, started };
    let found = under_fields::search(&request, &Watching::quiet(screen), &mut watch)?;
    let seconds = started.elapsed().as_secs_f64();
    let Some(found) = found else {
        screen.note("interrupted before anything was found");
        return Ok(Ending::Interrupted);
    };
    if let Some(folder) = folder {
        found.write(folder, file)?;
        screen.note(&format!("wrote {}", folder.display()));
    }
    let interrupted = found.ended == Ended::Signal;
    let evaluations_per_s = Some(found.document.evaluations as f64 / seconds);
    screen.answer(FieldSearchJson { evaluations_per_s, seconds: Some(seconds), ..found.document }, text)?;
    Ok(if interrupted { Ending::Interrupted } else { Ending::Done })
}

fn text(body: &FieldSearchJson) -> String {
    let segments: Vec<String> = body.best.segments.iter().map(ToString::to_string).collect();
    format!(
        "{}{}\nbest pattern, innermost layer first: {}\n{} moves judged in {} rounds, ended by: {}\n",
        table(&COLUMNS, body.baselines.iter().chain([&body.best]).map(|p| cells(p).to_vec())),
        body.statement,
        segments.join(" "),
        body.evaluations,
        body.rounds,
        body.stopped_by
    )
}

/// Progress, the clock and the wish to stop.
struct Watch<'a> {
    progress: Progress,
    stop: &'a StopFlag,
    budget: Option<Duration>,
    started: Instant,
}

impl Observer for Watch<'_> {
    fn advanced(&mut self, search: &dyn Rounds) -> ControlFlow<Halt> {
        let best = search.best().map_or_else(String::new, |best| {
            format!("round {}, best {:.4} °/h", search.state().round + 1, deg_per_h_from_rad_per_s(best.cost))
        });
        self.progress.at(search.evaluations(), &best);
        if self.stop.is_set() {
            return ControlFlow::Break(Halt::Signal);
        }
        match self.budget {
            Some(budget) if self.started.elapsed() >= budget => ControlFlow::Break(Halt::Clock),
            _ => ControlFlow::Continue(()),
        }
    }

    fn goes_on(&self) -> bool {
        !self.stop.is_set()
    }
}
