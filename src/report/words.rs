//! Words that pages about windings use, explained once a page.

use maud::{Markup, html};

use crate::pattern::classic::Classic;

/// What a traveller says instead of a trim where the ends have turns of their own. `verify` holds its own copy against this one.
pub(super) const OF_ENDS: &str =
    "The pattern says how many turns either end has: wind every step as it stands, and trim neither end.";

/// What worst, guaranteed, class, captive and climb mean, and what the classics' short names stand for.
pub(super) fn of_windings() -> Markup {
    html! {
        details {
            summary { "What these words mean" }
            p { b { "Worst" } ": the largest size of the rate error under the model's profiles, at any time. "
                b { "Guaranteed" } ": no profile of any length whose ramps are no steeper makes it larger. "
                b { "Class" } ": " code { "standard" } " can be wound with no captive run; "
                code { "captive:2" } " holds at most two. " b { "Captive run" }
                ": fibre both ends of which are on the coil already, so that its reel must travel around the coil. "
                b { "Climb" } ": how many layers a crossover passes from one segment of the fibre to the next." }
            p { @for (index, classic) in Classic::ALL.into_iter().enumerate() {
                @if index > 0 { ", " } b { (classic.key()) } " " (classic.title())
            } "." }
        }
    }
}

/// The same for a winding shop: what a traveller's words ask of it. `verify` holds its own copy against this one.
pub(super) fn of_a_traveller() -> Markup {
    let names: Vec<String> = Classic::ALL.into_iter().map(|c| format!("{} {}", c.key(), c.title())).collect();
    html! {
        p { "Class standard is wound with no captive run, class captive:2 with at most two. Captive: both ends of the fibre on this reel are on \
             the coil already, so the reel must travel around the coil. A crossover over several layers climbs past those between. Windings by their short names: "
            (names.join(", ")) "." }
    }
}
