//! Rooms: the files and folders side by side in one folder, what each of them uses of the others, and that no two reach each other.

use std::collections::{BTreeMap, BTreeSet};

use crate::assert_no;
use crate::source::{Source, Token, sources};

/// Rooms by folder (a path of modules, empty for the crate's root), and who uses whom.
#[derive(Default)]
struct Plan {
    rooms: BTreeMap<Vec<String>, BTreeSet<String>>,
    arrows: BTreeMap<Vec<String>, BTreeSet<(String, String)>>,
}

/// The modules that lead to a file: `src/search/cost/mod.rs` is `search`, `cost`.
fn module_path(source: &Source) -> Vec<String> {
    let inside = source.name.trim_start_matches("src/").trim_end_matches(".rs");
    let mut path: Vec<String> = inside.split('/').map(str::to_owned).collect();
    if path.last().is_some_and(|name| ["mod", "lib"].contains(&name.as_str())) {
        path.pop();
    }
    path
}

/// What stands behind a token that begins a path, one path a leaf of its braces; a leaf `x as y` is `x`.
fn leaves(tokens: &[Token], at: &mut usize, before: &[String], found: &mut Vec<Vec<String>>) {
    let mut path = before.to_vec();
    while let Some(token) = tokens.get(*at) {
        if token.text == "{" {
            *at += 1;
            while tokens.get(*at).is_some_and(|t| t.text != "}") {
                leaves(tokens, at, &path, found);
                if tokens.get(*at).is_some_and(|t| t.text == "as") {
                    *at += 2;
                }
                if tokens.get(*at).is_some_and(|t| t.text == ",") {
                    *at += 1;
                }
            }
            *at += 1;
            return;
        }
        path.push(token.text.clone());
        *at += 1;
        let goes_on =
            tokens.get(*at).is_some_and(|t| t.text == ":") && tokens.get(*at + 1).is_some_and(|t| t.text == ":");
        if !goes_on {
            break;
        }
        *at += 2;
    }
    found.push(path);
}

/// All paths of a file that begin at the crate's root, at its own module or above it, from the root.
fn paths(source: &Source) -> Vec<Vec<String>> {
    let own = module_path(source);
    let mut found = Vec::new();
    let mut at = 0;
    while at < source.tokens.len() {
        let begins = ["crate", "super", "self"].contains(&source.tokens[at].text.as_str())
            && source.path_after(at).is_some()
            && (at == 0 || source.tokens[at - 1].text != ":");
        if !begins {
            at += 1;
            continue;
        }
        let mut relative = Vec::new();
        leaves(&source.tokens, &mut at, &[], &mut relative);
        for path in relative {
            let above = path.iter().take_while(|name| *name == "super").count();
            let kept = if path[0] == "crate" { 0 } else { own.len().saturating_sub(above) };
            let rest = path.iter().skip(above.max(1)).cloned();
            found.push(own[..kept].iter().cloned().chain(rest).collect());
        }
    }
    found
}

/// What a folder's own file passes on: a name and the room that it comes from.
fn passed_on(source: &Source) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for (i, _) in source.tokens.iter().enumerate().filter(|(_, token)| token.text == "use") {
        let is_passed_on = i > 0 && ["pub", ")"].contains(&source.tokens[i - 1].text.as_str());
        if is_passed_on {
            let mut all = Vec::new();
            leaves(&source.tokens, &mut (i + 1), &[], &mut all);
            let all = all.into_iter().map(|path| path.into_iter().filter(|n| n != "self").collect::<Vec<String>>());
            found.extend(all.filter(|path| path.len() > 1).map(|path| (path[path.len() - 1].clone(), path[0].clone())));
        }
    }
    found
}

fn plan<'a>(all: impl Iterator<Item = &'a Source>) -> Plan {
    let all: Vec<&Source> = all.filter(|source| !source.name.ends_with("/tests.rs")).collect();
    let mut plan = Plan::default();
    let mut aliases: BTreeMap<Vec<String>, BTreeMap<String, String>> = BTreeMap::new();
    for source in &all {
        let path = module_path(source);
        for depth in 0..path.len() {
            plan.rooms.entry(path[..depth].to_vec()).or_default().insert(path[depth].clone());
        }
        aliases.entry(path).or_default().extend(passed_on(source));
    }
    for source in &all {
        let own = module_path(source);
        for path in paths(source) {
            let shared = own.iter().zip(&path).take_while(|(a, b)| a == b).count();
            let (folder, Some(from), Some(name)) = (own[..shared].to_vec(), own.get(shared), path.get(shared)) else {
                continue;
            };
            let Some(rooms) = plan.rooms.get(&folder) else { continue };
            let to =
                if rooms.contains(name) { Some(name) } else { aliases.get(&folder).and_then(|known| known.get(name)) };
            if let Some(to) = to.filter(|to| rooms.contains(*to) && *to != from) {
                plan.arrows.entry(folder).or_default().insert((from.clone(), to.clone()));
            }
        }
    }
    plan
}

/// Rooms that reach each other, each circle once.
fn circles(arrows: &BTreeSet<(String, String)>) -> BTreeSet<BTreeSet<String>> {
    let reached = |from: &String| {
        let mut seen: BTreeSet<String> = BTreeSet::new();
        let mut open = vec![from.clone()];
        while let Some(room) = open.pop() {
            for (_, to) in arrows.iter().filter(|(from, _)| *from == room) {
                if seen.insert(to.clone()) {
                    open.push(to.clone());
                }
            }
        }
        seen
    };
    let reach: BTreeMap<String, BTreeSet<String>> =
        arrows.iter().map(|(from, _)| (from.clone(), reached(from))).collect();
    let together = |room: &String| -> BTreeSet<String> {
        reach[room].iter().filter(|other| reach.get(*other).is_some_and(|back| back.contains(room))).cloned().collect()
    };
    reach.keys().filter(|room| reach[*room].contains(*room)).map(together).collect()
}

/// Rooms that still reach each other, by folder; it only gets shorter.
const STILL_CIRCLES: &[(&str, &[&str])] = &[
    ("cli", &["offered", "optimise", "optimise_field", "watch"]),
    ("diagnose/discover", &["courses", "grammar"]),
    ("diagnose/discover", &["grounds", "search"]),
    ("io/json", &["boundary", "built_coils", "campaign", "diagnosis", "further_schemas", "proposals", "schema"]),
    ("thermal", &["joined", "modal", "pack"]),
];

#[test]
fn no_rooms_of_a_folder_reach_each_other_but_those_that_did() {
    let plan = plan(sources("src"));
    let mut faults = Vec::new();
    let mut seen = Vec::new();
    for (folder, rooms) in &plan.rooms {
        let arrows = plan.arrows.get(folder).cloned().unwrap_or_default();
        let name = if folder.is_empty() { "the crate".to_owned() } else { folder.join("/") };
        let found = circles(&arrows);
        println!("{name}: {} rooms, {} arrows, {} circles", rooms.len(), arrows.len(), found.len());
        for circle in found {
            let is_known = |known: &&(&str, &[&str])| {
                known.0 == name && circle.iter().all(|room| known.1.contains(&room.as_str()))
            };
            if let Some(known) = STILL_CIRCLES.iter().find(is_known)
                && known.1.len() == circle.len()
            {
                seen.push(known);
                continue;
            }
            let within = arrows.iter().filter(|(from, to)| circle.contains(from) && circle.contains(to));
            let shown: Vec<String> = within.map(|(from, to)| format!("{from} -> {to}")).collect();
            faults.push(format!("{name}: {}", shown.join(", ")));
        }
    }
    let gone = STILL_CIRCLES.iter().filter(|known| !seen.contains(known));
    faults.extend(gone.map(|(folder, rooms)| format!("{folder}: {rooms:?} is no circle any more: shorten the list")));
    assert_no(faults);
}

#[test]
fn a_circle_is_seen_however_it_is_written() {
    let house = |texts: &[(&str, &str)]| -> Vec<Source> {
        texts.iter().map(|(name, text)| Source::new((*name).to_owned(), (*text).to_owned())).collect()
    };
    let found = |texts: &[(&str, &str)]| {
        let plan = plan(house(texts).iter());
        circles(&plan.arrows.get(&vec!["search".to_owned()]).cloned().unwrap_or_default()).len()
    };
    let root = ("src/search/mod.rs", "mod run; mod answer; pub use answer::{Answer, Ended as End};");
    let run = ("src/search/run.rs", "use super::{Answer, cost::{self, Cost}}; fn f() {}");
    for back in [
        "use crate::search::run::Halt;",
        "use super::run;",
        "fn f() { super::run::run() }",
        "use crate::{coil, search::{run::Halt}};",
    ] {
        assert_eq!(found(&[root, run, ("src/search/answer.rs", back)]), 1, "{back}");
    }
    for no_way_back in ["use super::cost::Cost;", "#[cfg(test)] mod tests { use super::super::run; }", "// super::run"]
    {
        assert_eq!(
            found(&[root, run, ("src/search/answer.rs", no_way_back), ("src/search/cost/mod.rs", "")]),
            0,
            "{no_way_back}"
        );
    }
    let deep = ("src/search/cost/rows.rs", "use super::super::run::Halt;");
    assert_eq!(found(&[root, run, ("src/search/cost/mod.rs", "mod rows;"), deep]), 1);
}
