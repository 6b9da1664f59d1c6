//! Schedules of windings with turns of their own at the ends, and with an outermost layer that both ends share.

use coilwright::io::json::schedule::ScheduleJson;
use coilwright::io::model::{ModelFile, NamedPattern};
use coilwright::pattern::classic::Classic;
use coilwright::pattern::{EndTurns, Half};
use coilwright::verify::RateCheck;

use super::WARM;
use super::forms::{LONG, PAPER, classic, forms, judged, model, plan, shuffled};

/// The same winding with turns left off, moved to the other end, and both.
fn with_ends(named: &NamedPattern) -> Vec<NamedPattern> {
    let mut all = vec![EndTurns { a: -3, b: 0 }, EndTurns { a: 0, b: -2 }, EndTurns { a: -1, b: -4 }];
    match named.pattern.end_on_outermost_layer() {
        Some(Half::A) => all.extend([EndTurns { a: -9, b: 9 }, EndTurns { a: -9, b: 5 }]),
        Some(Half::B) => all.extend([EndTurns { a: 9, b: -9 }, EndTurns { a: 5, b: -9 }]),
        None => {}
    }
    let built = |ends| NamedPattern {
        name: format!("{}-ends", named.name),
        pattern: named.pattern.clone().with_end_turns(ends).unwrap(),
    };
    all.into_iter().map(built).collect()
}

fn holds(file: &ModelFile, document: &ScheduleJson) -> bool {
    judged(file, &serde_json::to_string(document).unwrap()).unwrap().violations.is_empty()
}

#[test]
#[ignore = "long: --include-ignored"]
fn schedules_with_turns_of_their_own_at_the_ends_hold_in_every_form() {
    for text in [PAPER, LONG] {
        let file = model(text);
        let layers = file.model.coil.layers();
        let classics = Classic::ALL.into_iter().filter_map(|c| classic(c, layers));
        for named in classics.chain((0..2).map(|seed| shuffled(layers, seed))) {
            let (_, whole) = plan(&file, &named);
            for built in with_ends(&named) {
                for (form, text) in forms(&file, &built) {
                    let found = judged(&file, &text).unwrap_or_else(|| panic!("{built:?} {form} is not understood"));
                    assert_eq!(found.violations, [], "{} {} {form}", built.name, built.pattern);
                    assert!(matches!(found.rate_check, RateCheck::Independent { .. }));
                }
                let (schedule, document) = plan(&file, &built);
                let added = built.pattern.added_turns().is_some();
                assert_eq!(schedule.steps().len(), layers + usize::from(added));
                assert_ne!(document.worst_rate_deg_per_h, whole.worst_rate_deg_per_h, "{}", built.pattern);
                assert_eq!(document.expected_trim_m, 0.0);
            }
        }
    }
}

#[test]
#[ignore = "long: --include-ignored"]
fn their_rate_error_is_found_again_turn_by_turn_with_effects_that_weigh_layers_and_halves() {
    for effect in [
        "kind = 'axial_gradient'\nfilm_w_per_m2_k = 20.0\nflange = 'first'",
        "kind = 'stress_gradient'\nstrength = 0.05",
        "kind = 'strain_mismatch'\nmismatch = 0.01",
        "kind = 'midpoint_offset'\noffset_m = 0.3\nlead = 'ambient'",
        "kind = 'turn_mismatch'\nturns = 1.0",
    ] {
        let file = model(&format!("{WARM}[[effect]]\n{effect}\n"));
        for classic_of in [Classic::Zyl, Classic::Dip, Classic::Qua] {
            for built in with_ends(&classic(classic_of, 12).unwrap()) {
                let (_, document) = plan(&file, &built);
                let found = judged(&file, &serde_json::to_string(&document).unwrap()).unwrap();
                assert_eq!(found.violations, [], "{effect} {}", built.pattern);
                assert!(matches!(found.rate_check, RateCheck::Independent { .. }));
            }
        }
    }
}

#[test]
fn crossovers_and_a_diameter_by_length_are_worked_out_again_with_whole_layers_and_with_split_ones() {
    let extra = "crossover_turns = 0.6\nsagnac_diameter = \"by_length\"\nlayer_length";
    for text in [WARM, PAPER] {
        let (plain, file) = (model(text), model(&text.replace("layer_length", extra)));
        let layers = file.model.coil.layers();
        let whole = classic(Classic::Qua, layers).unwrap();
        let all = [vec![whole.clone()], with_ends(&whole)].concat();
        for built in all {
            let (_, document) = plan(&file, &built);
            let found = judged(&file, &serde_json::to_string(&document).unwrap()).unwrap();
            assert_eq!(found.violations, [], "{}", built.pattern);
            assert!(matches!(found.rate_check, RateCheck::Independent { .. }));
            // Each layer, and each piece of a shared one, is 0.6 turns longer, unless the whole length is stated.
            let per_turn_m =
                |d: &ScheduleJson, i: usize| d.steps[i].length_m / (2e-3 * std::f64::consts::PI * d.steps[i].radius_mm);
            let last = document.steps.len() - 1;
            if file.model.coil.layer_length() == coilwright::coil::LayerLength::Actual {
                for i in [0, last] {
                    assert!((per_turn_m(&document, i) - document.steps[i].turns - 0.6).abs() < 1e-4);
                }
            } else {
                let (_, without) = plan(&plain, &built);
                assert!((document.steps[0].length_m - without.steps[0].length_m).abs() < 1e-6);
            }
        }
    }
}

#[test]
fn ends_that_were_altered_are_violations() {
    let file = model(LONG);
    let named = classic(Classic::Qua, 40).unwrap();
    let pattern = named.pattern.clone().with_end_turns(EndTurns { a: -9, b: 7 }).unwrap();
    let (_, document) = plan(&file, &NamedPattern { name: "x".to_owned(), pattern });
    assert!(holds(&file, &document));
    let altered = |change: &dyn Fn(&mut ScheduleJson)| {
        let mut other = document.clone();
        change(&mut other);
        !holds(&file, &other)
    };
    assert!(altered(&|d| d.end_a_turns = Some(-8)));
    assert!(altered(&|d| (d.end_a_turns, d.end_b_turns) = (None, None)));
    assert!(altered(&|d| d.steps[40].turns += 1.0));
    assert!(altered(&|d| d.steps[40].segment = 1));
    assert!(altered(&|d| d.steps[40].step = 40));
    assert!(altered(&|d| d.steps[39].turns -= 1.0));
    assert!(altered(&|d| _ = d.steps.pop()));
    assert!(altered(&|d| d.expected_trim_m = 1.0));
    // The carriage begins elsewhere along the layer, though its way is as long.
    let gcode =
        forms(&file, &NamedPattern { name: "x".to_owned(), pattern: document_pattern(&named) }).pop().unwrap().1;
    assert!(judged(&file, &gcode).unwrap().violations.is_empty());
    let lines: Vec<&str> = gcode.lines().collect();
    let last = lines.iter().rposition(|line| line.starts_with("G1 X")).unwrap();
    let shifted = |line: &str| {
        let words: Vec<String> = line
            .split(' ')
            .map(|word| match word.strip_prefix('X') {
                Some(x) => format!("X{}", (x.parse::<f64>().unwrap() * 1e4 + 1910.0).round() / 1e4),
                None => word.to_owned(),
            })
            .collect();
        words.join(" ")
    };
    let moved: String = lines
        .iter()
        .enumerate()
        .map(|(i, line)| format!("{}\n", if i == last || i + 2 == last { shifted(line) } else { (*line).to_owned() }))
        .collect();
    let found = judged(&file, &moved).unwrap();
    let fields: Vec<&str> = found.violations.iter().map(|violation| violation.field.as_str()).collect();
    assert_eq!(fields, ["the place along the axis"]);
}

#[test]
fn a_classic_name_stands_for_whole_layers_only() {
    let file = model(LONG);
    let named = classic(Classic::Qua, 40).unwrap();
    let pattern = named.pattern.clone().with_end_turns(EndTurns { a: -9, b: 7 }).unwrap();
    for (form, text) in forms(&file, &NamedPattern { name: "qua".to_owned(), pattern }) {
        let found = judged(&file, &text).unwrap();
        let fields: Vec<&str> = found.violations.iter().map(|violation| violation.field.as_str()).collect();
        // A table of steps alone does not say its pattern's name.
        assert!(fields == ["pattern"] || (fields.is_empty() && !text.contains("qua")), "{form}: {fields:?}");
    }
    assert!(forms(&file, &named).iter().all(|(_, text)| judged(&file, text).unwrap().violations.is_empty()));
}

fn document_pattern(named: &NamedPattern) -> coilwright::pattern::Pattern {
    named.pattern.clone().with_end_turns(EndTurns { a: -9, b: 7 }).unwrap()
}
