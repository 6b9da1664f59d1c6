//! `campaign`: a grid of searches, in parts and with interruptions, with one table at the end.

use std::ops::ControlFlow;
use std::path::PathBuf;

use super::progress::StopFlag;
use super::screen::{Screen, held, table};
use super::{CliError, Ending};
use crate::io::files::write_atomically;
use crate::io::folder::{Replacement, remove_numbered};
use crate::io::read::campaign_file::{
    CampaignFile, CampaignJson, Cell, CellJson, cell_path, read_campaign, read_cell, summary_csv,
};
use crate::report::plot::{Axis, Chart, Series};
use crate::search::anneal::rounds::{DEFAULT_PATIENCE, DEFAULT_RESTARTS_PER_ROUND, Plan, Rounds, Rules};
use crate::search::answer::Ended;
use crate::search::cost::objective::Objective;
use crate::search::run::{Halt, RunError};
use crate::search::{self, Observer};
use crate::units::deg_per_h_from_rad_per_s;

/// A grid of searches (coils, layer counts, classes, objectives, seeds)
#[derive(Debug, clap::Args)]
#[command(
    after_help = "A campaign file:\n  name = \"two coils\"\n  models = [\"paper-200m.toml\", \"coil-998m.toml\"]   # beside the campaign file\n  \
    layers = [12, 16]                                 # default: the models' own\n  \
    classes = [\"standard\", \"captive:1\", \"any\"]       # default: standard\n  \
    objectives = [\"worst-rate\", \"p95\"]               # default: worst-rate\n  seeds = [1, 2, 3]                                 # default: 1\n\n\
    What is done is skipped, so the same command goes on after an interruption. Shards may run at the same time or on\n\
    other machines; copy their cells/ together and run once more without --shard for the table.\n\n\
    Example:\n  coilwright campaign grid.toml -o results/grid --shard 1/2"
)]
pub struct Arguments {
    /// The campaign file
    campaign: PathBuf,
    /// The folder of the cells' results and the table
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// Runs only every n-th cell, beginning with the i-th
    #[arg(long, value_name = "i/n", value_parser = parse_shard)]
    shard: Option<Shard>,
}

#[derive(Debug, Clone, Copy)]
struct Shard {
    index: usize,
    count: usize,
}

fn parse_shard(text: &str) -> Result<Shard, String> {
    let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match parts {
        Some((index, count)) if 1 <= index && index <= count => Ok(Shard { index, count }),
        _ => Err(format!("expected i/n with 1 ≤ i ≤ n, such as 1/4, found \"{text}\"")),
    }
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let stop = StopFlag::listen();
    let campaign = read_campaign(&arguments.campaign)?;
    let cells = campaign.cells()?;
    let folder = &arguments.output;
    // Shards of one campaign may work in one folder at once; they write different files.
    let _held = if arguments.shard.is_none() { Some(held(folder, "campaign")?) } else { None };
    let shard = arguments.shard.unwrap_or(Shard { index: 1, count: 1 });
    let progress = screen.progress("campaign", Some(cells.len() as u64));
    let mut searched = 0;
    for (index, cell) in cells.iter().enumerate().filter(|(index, _)| index % shard.count == shard.index - 1) {
        let fingerprint = campaign.fingerprint(cell);
        if read_cell(folder, index, &fingerprint).is_none() {
            let Some(found) = search(&campaign, cell, index, fingerprint, &stop)? else { break };
            let json = serde_json::to_string_pretty(&found).map_err(|e| CliError::Stdout(e.into()))? + "\n";
            write_atomically(&cell_path(folder, index), json.as_bytes())?;
            searched += 1;
        }
        progress.at(index as u64 + 1, "");
    }
    progress.finish();
    let results: Vec<CellJson> = cells
        .iter()
        .enumerate()
        .filter_map(|(index, cell)| read_cell(folder, index, &campaign.fingerprint(cell)))
        .collect();
    let answer = CampaignJson {
        campaign: campaign.name.clone(),
        cells: cells.len(),
        searched,
        missing: cells.len() - results.len(),
        results,
    };
    if answer.missing == 0 {
        let csv = summary_csv(&answer.results);
        let mut files = Replacement::of(folder);
        files.add("summary.csv", &csv)?;
        files.add("summary.svg", chart(&answer).as_bytes())?;
        files.commit(&["summary.csv", "summary.svg"])?;
        remove_numbered(&folder.join("cells"), answer.cells)?;
        screen.note(&format!("wrote {}", folder.join("summary.csv").display()));
    } else {
        screen.note(&format!("{} of {} cells are missing: no table yet", answer.missing, answer.cells));
    }
    screen.answer(answer, text)?;
    Ok(if stop.is_set() { Ending::Interrupted } else { Ending::Done })
}

/// Searches one cell; none if a signal came first.
fn search(
    campaign: &CampaignFile,
    cell: &Cell,
    index: usize,
    fingerprint: String,
    stop: &StopFlag,
) -> Result<Option<CellJson>, CliError> {
    let (model, layers) = (&cell.file.model, cell.file.model.coil.layers());
    let plan = Plan {
        seed: cell.seed,
        restarts_per_round: DEFAULT_RESTARTS_PER_ROUND,
        moves_per_restart: campaign
            .moves_per_restart
            .unwrap_or_else(|| cell.objective.default_moves_per_restart(layers)),
        rules: Rules {
            rounds: campaign.rounds.unwrap_or(u64::MAX),
            patience: DEFAULT_PATIENCE,
            moves: None,
            target: None,
        },
        starts: Vec::new(),
    };
    let request = search::Request {
        model,
        profiles: &cell.file.profiles,
        tolerance: cell.file.tolerance.as_ref(),
        objective: cell.objective,
        class: cell.class,
        plan,
        saved: None,
        former: None,
        prove: false,
        recommend: false,
        cuts: false,
        uncertain: &[],
    };
    let answer = match search::run(&request, &mut UntilStopped(stop)) {
        Ok(answer) => answer.filter(|answer| answer.ended != Ended::Signal),
        Err(RunError::Judge(error)) => return Err(error.into()),
        // Nothing was saved that might not fit.
        Err(RunError::Resume) => None,
    };
    Ok(answer.map(|answer| CellJson {
        cell: index + 1,
        fingerprint,
        model: model.name.clone(),
        layers,
        windability: cell.class.to_string(),
        objective: cell.objective.key().to_owned(),
        seed: cell.seed,
        worst_rate_deg_per_h: deg_per_h_from_rad_per_s(answer.best.worst.rate_rad_per_s.abs()),
        objective_deg_per_h: (cell.objective != Objective::WorstPhase)
            .then(|| deg_per_h_from_rad_per_s(answer.best.objective_rad_per_s)),
        improvement_over_qua: answer.improvement_over_qua,
        evaluations: answer.evaluations,
        stopped_by: answer.ended.key().to_owned(),
        segments: answer.best.pattern.segments().to_vec(),
    }))
}

/// Ends a search as soon as a signal comes.
struct UntilStopped<'a>(&'a StopFlag);

impl Observer for UntilStopped<'_> {
    fn advanced(&mut self, _search: &dyn Rounds) -> ControlFlow<Halt> {
        if self.0.is_set() { ControlFlow::Break(Halt::Signal) } else { ControlFlow::Continue(()) }
    }

    fn goes_on(&self) -> bool {
        !self.0.is_set()
    }
}

/// The worst rate of every cell, one series a class.
fn chart(answer: &CampaignJson) -> String {
    let mut classes: Vec<&str> = answer.results.iter().map(|r| r.windability.as_str()).collect();
    classes.sort_unstable();
    classes.dedup();
    let mut chart = Chart::new(answer.campaign.clone()).x(Axis::linear("cell")).y(Axis::log("worst rate error [°/h]"));
    for class in classes {
        let of_class = answer.results.iter().filter(|r| r.windability == class);
        let points = of_class.map(|r| (r.cell as f64, r.worst_rate_deg_per_h)).collect();
        chart = chart.with(Series::points(class, points));
    }
    chart.svg()
}

fn text(answer: &CampaignJson) -> String {
    let rows = answer.results.iter().map(|r| {
        vec![
            r.model.clone(),
            r.layers.to_string(),
            r.windability.clone(),
            r.objective.clone(),
            r.seed.to_string(),
            format!("{:.4}", r.worst_rate_deg_per_h),
            r.objective_deg_per_h.map_or_else(|| "–".to_owned(), |o| format!("{o:.4}")),
            r.improvement_over_qua.map_or_else(|| "–".to_owned(), |f| format!("{f:.3}")),
        ]
    });
    let header = ["model", "layers", "class", "objective", "seed", "worst °/h", "objective °/h", "QUA's over it"];
    format!(
        "{}: {} cells, {} searched now, {} missing\n\n{}",
        answer.campaign,
        answer.cells,
        answer.searched,
        answer.missing,
        table(&header, rows)
    )
}
