//! The text of a page as its reader sees it, element by element.

use crate::verify::Shown;

/// Elements whose whole text is one piece.
const PIECES: &[&str] =
    &["h1", "h2", "h3", "p", "dt", "dd", "th", "td", "figcaption", "text", "title", "li", "summary"];
/// Elements whose content is not shown.
const HIDDEN: &[&str] = &["script", "style"];

/// Every piece of text that is not empty, in the page's order; white space as a browser has it.
pub(super) fn shown(html: &str) -> Vec<Shown> {
    let mut pieces = Vec::new();
    let mut open: Option<(&str, String)> = None;
    let mut rest = html;
    while !rest.is_empty() {
        let Some(start) = rest.find('<') else {
            take(&mut pieces, &mut open, rest);
            break;
        };
        take(&mut pieces, &mut open, &rest[..start]);
        rest = &rest[start..];
        if let Some(comment) = rest.strip_prefix("<!--") {
            rest = comment.split_once("-->").map_or("", |(_, after)| after);
            continue;
        }
        let Some(end) = rest.find('>') else { break };
        let tag = &rest[1..end];
        rest = &rest[end + 1..];
        let name = tag.trim_start_matches('/').split([' ', '\t', '\n', '/']).next().unwrap_or_default();
        if tag.starts_with('/') {
            if open.as_ref().is_some_and(|(element, _)| *element == name) {
                close(&mut pieces, &mut open);
            }
        } else if HIDDEN.contains(&name) {
            let closing = format!("</{name}");
            rest = rest.find(&closing).map_or("", |i| &rest[i..]);
        } else if let Some(element) = PIECES.iter().find(|p| **p == name) {
            close(&mut pieces, &mut open);
            open = Some((element, String::new()));
        }
    }
    close(&mut pieces, &mut open);
    pieces
}

fn take(pieces: &mut Vec<Shown>, open: &mut Option<(&str, String)>, text: &str) {
    match open {
        Some((_, piece)) => piece.push_str(text),
        None => push(pieces, "body", text),
    }
}

fn close(pieces: &mut Vec<Shown>, open: &mut Option<(&str, String)>) {
    if let Some((element, text)) = open.take() {
        push(pieces, element, &text);
    }
}

fn push(pieces: &mut Vec<Shown>, element: &str, raw: &str) {
    let text = raw.split_whitespace().collect::<Vec<_>>().join(" ");
    if !text.is_empty() {
        let marks = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&#39;", "'"), ("&amp;", "&")];
        let text = marks.iter().fold(text, |text, (mark, sign)| text.replace(mark, sign));
        pieces.push(Shown { element: element.to_owned(), text });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_of_a_page_comes_in_pieces_without_scripts_and_with_its_marks_resolved() {
        let html = "<h1>A &amp; B</h1><style>p{}</style><p>one <b>two</b>\n three</p>loose<td></td><td>4<script>5</script></td>";
        let found: Vec<(String, String)> = shown(html).into_iter().map(|s| (s.element, s.text)).collect();
        let expected = [("h1", "A & B"), ("p", "one two three"), ("body", "loose"), ("td", "4")];
        assert_eq!(found, expected.map(|(e, t)| (e.to_owned(), t.to_owned())));
    }
}
