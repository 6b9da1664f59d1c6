//! The explorer: one page that holds a model and the module that judges windings of it.
//!
//! The page needs no network and no other file. Its policy lets it run its own script (by its hash), compile the module,
//! and start a thread from its own script; it can load nothing.

use data_encoding::BASE64;
use maud::{DOCTYPE, PreEscaped, html};
use sha2::{Digest, Sha256};

use super::{page, words};
use crate::io::json::explore::ExplorerDataJson;
use crate::text::sink::{JsonText, Markup};

/// The library as a WebAssembly module, compressed: `explorer/build` makes it.
pub(crate) const MODULE: &[u8] = include_bytes!("model.wasm.gz");

const SCRIPT: &str = include_str!("page.js");
const STYLE: &str = include_str!("style.css");

fn policy() -> String {
    let hash = |text: &str| format!("'sha256-{}'", BASE64.encode(&Sha256::digest(text.as_bytes())));
    format!(
        "default-src 'none'; script-src {} 'wasm-unsafe-eval'; worker-src blob:; style-src {} {}; img-src data:; \
         base-uri 'none'; form-action 'none'",
        hash(SCRIPT),
        hash(page::STYLE),
        hash(STYLE)
    )
}

/// The page about a model.
///
/// # Errors
/// None that data with finite numbers could cause.
#[expect(clippy::too_many_lines, reason = "a page as it stands on the screen")]
pub(crate) fn explorer_page(model: &str, data: &ExplorerDataJson) -> Result<String, serde_json::Error> {
    let json = JsonText::embedded(&serde_json::to_string(data)?).into_string();
    let number = |id: &str, title: &str, value: &str, unit: &str| {
        html! { div { dt { (title) } dd { span id=(id) { (value) } @if !unit.is_empty() { " " small { (unit) } } } } }
    };
    let button = |id: &str, words: &str| html! { button type="button" id=(id) { (words) } };
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(policy());
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { "Explorer: " (model) }
                link rel="icon" href="data:,";
                style { (PreEscaped(page::STYLE)) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                main {
                    h1 { "Explorer: " (model) }
                    p.big id="verdict" { "The model is being solved …" }
                    noscript { p { "This page computes and needs scripts. The same numbers without them: "
                        code { "coilwright evaluate" } "." } }
                    p id="fault" role="alert" hidden {}
                    p.unseen id="said" role="status" {}
                    dl.numbers {
                        (number("worst", "worst rate error over the profiles", "…", "°/h"))
                        (number("guaranteed", "guaranteed over all profiles", "…", "°/h"))
                        (number("class", "class", "…", ""))
                        (number("reels", "supply reels", "…", ""))
                        (number("captive", "captive runs", "…", ""))
                        (number("climb", "largest climb", "…", "layers"))
                    }
                    (words::of_windings())
                    div.bench {
                        section aria-labelledby="section-layers" {
                            h2 id="section-layers" { "The winding" }
                            div.hands {
                                label { "begin with " select id="start" {} }
                                label { "moving a layer " select id="way" {
                                    option value="shift" { "shifts the others" }
                                    option value="exchange" { "exchanges two" }
                                } }
                            }
                            p.noprint id="how" { "Drag a layer by mouse, or by ⠿ with a finger. With keys: up and down walk, with Alt they move the layer; space picks up and puts down." }
                            p.outside { "outside: layer, segment and half of the fibre, what it adds now, temperature" }
                            ol.layers id="layers" aria-label="layers, outermost first" {}
                            p.spool { "spool" }
                            label for="typed" { "The segments, innermost layer first" }
                            textarea id="typed" spellcheck="false" aria-describedby="wrong" {}
                            p id="wrong" role="status" {}
                            p id="hard" {}
                        }
                        div {
                            section aria-labelledby="section-rates" {
                                h2 id="section-rates" { "Rate error over time" }
                                div.hands {
                                    label { "profile " select id="profile" {} }
                                    label { input type="checkbox" id="follow" checked; " the worst one" }
                                    label { "scale " select id="scale" {
                                        option value="log" { "logarithmic" }
                                        option value="linear" { "linear" }
                                    } }
                                    button type="button" id="whole" hidden { "all of the time" }
                                }
                                svg id="rates" role="img" aria-label="rate error over time of the windings compared" {}
                                div.legend id="legend" {}
                                div.hands { label for="time" { "time" } input type="range" id="time" min="0" max="1" step="any" value="0"; }
                                p id="moment" {}
                            }
                            div.hands {
                                (button("undo", "undo")) (button("redo", "redo")) (button("compare", "keep for comparison"))
                                (button("help", "which exchange helps, as easy to wind")) (button("any", "which exchange helps most"))
                            }
                            p id="hinted" hidden { span id="hint" {} (button("take", "do it")) }
                            div.hands {
                                label { "name " input id="name" maxlength="200"; }
                                (button("keep-pattern", "save the pattern")) (button("keep-model", "save the model with it"))
                            }
                            section aria-labelledby="section-model" {
                                h2 id="section-model" { "The model" }
                                div.knobs id="knobs" {}
                                div.hands { (button("reset", "as in the file")) }
                                ul id="notes" {}
                            }
                        }
                    }
                    section aria-labelledby="section-compared" {
                        h2 id="section-compared" { "Compared" }
                        div.scroll tabindex="0" role="region" aria-label="table of the windings compared" {
                            table { thead { tr id="heads" {} } tbody id="rows" {} }
                        }
                        p { "The same as " code { "coilwright evaluate" } " prints for the saved pattern, by the same code." }
                    }
                }
                script type="application/json" id="data" { (PreEscaped(json)) }
                script type="text/plain" id="module" { (BASE64.encode(MODULE)) }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    Ok(Markup::of(&page.into_string()).into_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_of_a_model_can_leave_the_element_it_stands_in() {
        let hostile = "</script><script>alert(1)</script><!--";
        let data = ExplorerDataJson { file: hostile.into(), source: hostile.into(), patterns: Vec::new() };
        let page = explorer_page(hostile, &data).unwrap();
        assert_eq!(page.matches("<script").count(), 3);
        assert_eq!(page.matches("</script").count(), 3);
        assert!(!page.contains("<!--"), "a comment would hide what follows");
    }

    #[test]
    fn the_module_is_compressed_without_a_time_stamp() {
        assert_eq!(MODULE[..2], [0x1f, 0x8b], "it is compressed by gzip");
        assert_eq!(MODULE[4..8], [0; 4], "it bears no time stamp");
    }
}
