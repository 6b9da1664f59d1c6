//! The shell of a page: one file that opens offline, on a screen, a phone or paper, light or dark.

use data_encoding::BASE64;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use sha2::{Digest, Sha256};

use super::plot;
use crate::text::sink;
use crate::verify::Assets;

/// A whole page.
///
/// Its policy lets a browser run the one script and use the two styles that the program ships, told by their hashes, and
/// load nothing: whatever a name could put on a page, it does nothing.
pub(super) fn page(title: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(policy());
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                // No icon: a browser would ask the network for one.
                link rel="icon" href="data:,";
                style { (PreEscaped(STYLE)) }
            }
            body {
                main { (body) }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    sink::Markup::of(&page.into_string()).into_string()
}

/// What a browser may load and run.
fn policy() -> String {
    let hash = |text: &str| format!("'sha256-{}'", BASE64.encode(&Sha256::digest(text.as_bytes())));
    format!(
        "default-src 'none'; script-src {}; style-src {} {}; img-src data:; base-uri 'none'; form-action 'none'",
        hash(SCRIPT),
        hash(STYLE),
        hash(plot::STYLE)
    )
}

/// What every page holds besides its words, for the verification of one.
pub fn assets() -> Assets {
    let hex = |text: &str| Sha256::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect();
    Assets {
        style_sha256: hex(STYLE),
        drawing_style_sha256: hex(plot::STYLE),
        script_sha256: hex(SCRIPT),
        policy: policy(),
    }
}

/// A picture with its caption; a page's script puts tools beside it.
pub(super) fn figure(svg: &str, caption: &str) -> Markup {
    html! {
        figure {
            div.zoom tabindex="0" role="group" aria-label="picture" { (PreEscaped(svg)) }
            figcaption { (caption) }
        }
    }
}

pub(super) const STYLE: &str = "
:root{--ink:#1b1f24;--paper:#fff;--soft:#f3f5f7;--line:#cfd5db;--a:#2f7fd6;--b:#d9730d}
@media(prefers-color-scheme:dark){:root{--ink:#e3e6ea;--paper:#15181c;--soft:#1f242a;--line:#3b424a}}
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%}
body{margin:0;background:var(--paper);color:var(--ink);font:16px/1.5 system-ui,'DejaVu Sans',Arial,sans-serif}
main{max-width:78rem;margin:0 auto;padding:1rem}
h1{font-size:1.6rem;line-height:1.25;margin:.5rem 0}h2{font-size:1.2rem;margin:1.8rem 0 .5rem}
p{max-width:46rem}
h1,h2,h3,p,li,figcaption,summary{overflow-wrap:break-word}
.scroll{overflow-x:auto;padding-right:1px;margin:.5rem 0}
table{border-collapse:collapse;font-size:.86rem;font-variant-numeric:tabular-nums}
th,td{border:1px solid var(--line);padding:.25rem .5rem;text-align:right;vertical-align:top}
th{background:var(--soft);font-weight:600}
td.word,th.word{text-align:left}
tr.best td{font-weight:700}
dl.facts{display:grid;grid-template-columns:max-content 1fr;gap:.15rem 1rem;margin:.5rem 0}
dl.facts dt{color:var(--ink);opacity:.75}dl.facts dd{margin:0;overflow-wrap:anywhere}
.big{font-size:1.35rem;font-weight:700}
figure{margin:1rem 0;min-width:0}figcaption{font-size:.86rem;opacity:.85;max-width:46rem}
.pair,.two{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,30rem),1fr));gap:.6rem 1.2rem;align-items:start}
.pair figure,.two figure{margin:0}
figure svg{max-width:100%;height:auto;display:block}figure svg[data-plot]{width:100%}
.panel{font-size:.82rem;margin:.3rem 0}
.tools,.keys{display:flex;flex-wrap:wrap;gap:.3rem .4rem;align-items:center}
.panel button,.panel select{font:inherit;color:var(--ink);background:var(--soft);border:1px solid var(--line);border-radius:3px;min-height:1.7rem;cursor:pointer;max-width:100%}
.panel button:disabled{opacity:.5;cursor:default}
.tools [aria-pressed=true]{border-color:var(--ink);font-weight:600}
.keys [aria-pressed=false]{text-decoration:line-through}
.keys div{display:flex;gap:.5rem;align-items:center}
.read{min-height:1.5em;margin:.3rem 0;max-width:none}.read,output{font-variant-numeric:tabular-nums}
figure.open{position:fixed;inset:0;z-index:9;margin:0;padding:1rem;background:var(--paper);overflow:auto}
figure.open .zoom svg{width:100%;max-height:78vh}
@media screen and (min-width:64rem){main>figure{display:grid;grid-template-columns:minmax(0,54rem) minmax(12rem,1fr);grid-template-rows:auto 1fr;gap:0 1.2rem}main>figure>.zoom{grid-row:1/span 2}main>figure .keys{flex-direction:column;align-items:start}main>figure.open{display:block}}
.change{min-width:14rem;max-width:34rem}.change p{margin:0 0 .3rem}.fill{min-width:5rem}.long{min-width:10.5rem}.keep{white-space:nowrap}
.reel{border-left:.6em solid var(--line);padding-left:.35em}.r0{border-color:#2f7fd6}.r1{border-color:#d9730d}.r2{border-color:#1a9850}.r3{border-color:#9b5fc0}.r4{border-color:#d64550}.r5{border-color:#179aa2}.r6{border-color:#a5744a}.r7{border-color:#7d8590}
td code{display:inline-block;min-width:12rem}
code,pre{font-family:ui-monospace,'DejaVu Sans Mono',monospace;font-size:.86em;overflow-wrap:anywhere;white-space:pre-wrap}
@media screen and (max-width:40rem){.zoom{overflow-x:auto}figure svg,figure svg[data-plot]{max-width:none;width:560px}body{font-size:15px}dl.facts{grid-template-columns:1fr}dl.facts dt{margin-top:.3rem}}
@page{margin:14mm 12mm 16mm;@bottom-right{content:'page ' counter(page) ' of ' counter(pages);font:9pt sans-serif}}
@media print{
.two,.pair{display:block}:root{--ink:#000;--paper:#fff;--soft:#eee;--line:#888}
body{font-size:10pt}main{max-width:none;padding:0}
h1{font-size:15pt}h2{font-size:12pt;break-after:avoid}
table{font-size:7.3pt;width:100%}th,td{padding:1.2pt 2pt}.keep{white-space:normal}thead{display:table-header-group}tr{break-inside:avoid}
figure{break-inside:avoid}figure svg{max-height:225mm}.scroll{overflow:visible;padding-right:1.5pt}.fill{min-width:0}.long{min-width:17mm}.screen,.panel{display:none}td code{min-width:0}
details::details-content{content-visibility:visible;block-size:auto}summary{list-style:none}
}
";

/// Shows a picture over the whole window, and a chart's values, parts, scales and differences, in all charts over the same time
/// at once.
const SCRIPT: &str = include_str!("page.js");
