//! `optimise --field`: the search under temperatures that were computed elsewhere.

use std::time::Instant;

use super::optimise::{Arguments, of_run, saved_state};
use super::progress::StopFlag;
use super::screen::{Screen, held, table};
use super::watch::Watch;
use super::watching::Watching;
use super::{CliError, Ending};
use crate::io::json::field::FieldSearchJson;
use crate::io::model::ModelFile;
use crate::io::write::checkpoint::CHECKPOINT_FILE;
use crate::io::write::run_directory::{Request, check_kept};
use crate::search::answer::Ended;
use crate::search::run::RunError;
use crate::task::TaskError;
use crate::task::evaluate::{COLUMNS, cells};
use crate::task::optimise::Wishes;
use crate::task::under_fields::{self, FieldFile, FieldSearch};

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
    let plan = wishes.plan(file)?;
    let digests = digests(arguments, &fields)?;
    let request = Request {
        file,
        class,
        objective,
        plan: &plan,
        budget: options.budget.as_deref(),
        cutting_planes: false,
        fields: &digests,
    };
    let saved = folder.map_or(Ok(None), |folder| saved_state(arguments, folder, &request, screen))?;
    let started = Instant::now();
    let is_taken_up = folder.is_some_and(|f| arguments.resume && f.join(CHECKPOINT_FILE).exists());
    let mut watch = Watch::new(arguments, &request, budget, started, stop, screen, is_taken_up);
    let search = FieldSearch {
        model: file,
        fields: &fields,
        class,
        objective,
        plan: plan.clone(),
        prove: arguments.prove.is_some(),
        saved,
    };
    let found = under_fields::search(&search, &Watching::quiet(screen), &mut watch);
    watch.fault.take().map_or(Ok(()), Err)?;
    let found = match found {
        Err(TaskError::Run(RunError::Resume)) => return Err(of_run(RunError::Resume, folder)),
        found => found?,
    };
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

/// What a checkpoint knows its fields by.
fn digests(arguments: &Arguments, fields: &[FieldFile]) -> Result<Vec<String>, CliError> {
    let of = |field: &FieldFile| match &field.sha256 {
        Some(digest) => Ok(digest.clone()),
        None if arguments.resume => {
            let message = format!(
                "{} is a pipe, and the search that it belongs to cannot be told: give the file again that it was written from",
                field.file
            );
            Err(CliError::Option { option: "--resume", message })
        }
        None => Ok("a pipe".to_owned()),
    };
    fields.iter().map(of).collect()
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
