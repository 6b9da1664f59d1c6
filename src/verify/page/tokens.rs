//! A page's markup in pieces: tags, texts, and what stands raw in style and script.

use std::ops::Range;

/// One piece of a page as its file has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Piece<'h> {
    pub(crate) raw: &'h str,
    pub(crate) kind: Kind,
    /// Where it begins in the file.
    pub(crate) offset: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A tag, a comment, a declaration: all that begins with `<`.
    Tag,
    Text,
    /// The content of `style` and `script`.
    Raw,
}

/// Elements whose content is no markup.
const RAW: [&str; 2] = ["style", "script"];

/// Every piece in order; joined they are the file again. Empty texts are no pieces.
pub(super) fn pieces(html: &str) -> Vec<Piece<'_>> {
    let mut found = Vec::new();
    let mut push = |span: Range<usize>, kind| {
        if !span.is_empty() {
            found.push(Piece { raw: &html[span.clone()], kind, offset: span.start });
        }
    };
    let mut at = 0;
    while at < html.len() {
        let rest = &html[at..];
        if !rest.starts_with('<') {
            let end = at + rest.find('<').unwrap_or(rest.len());
            push(at..end, Kind::Text);
            at = end;
            continue;
        }
        let end = at + rest.find('>').map_or(rest.len(), |i| i + 1);
        push(at..end, Kind::Tag);
        let name: String =
            html[at + 1..end].chars().take_while(char::is_ascii_alphanumeric).collect::<String>().to_ascii_lowercase();
        at = end;
        if RAW.contains(&name.as_str()) {
            let end = at + html[at..].find(&format!("</{name}")).unwrap_or(html.len() - at);
            push(at..end, Kind::Raw);
            at = end;
        }
    }
    found
}

/// Counted from 1: line, and character of it.
pub(super) fn line_and_column(html: &str, offset: usize) -> (usize, usize) {
    let before = &html[..offset];
    let line = before.matches('\n').count() + 1;
    let start = before.rfind('\n').map_or(0, |i| i + 1);
    (line, before[start..].chars().count() + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_comes_in_pieces_that_are_the_page_again() {
        let html = "<!DOCTYPE html><p class=\"a\">one &amp; <b>two</b></p><style>p{}\n</style><!-- x --><script>1<2</script>\n";
        let found = pieces(html);
        assert_eq!(found.iter().map(|p| p.raw).collect::<String>(), html);
        let raws: Vec<&str> = found.iter().filter(|p| p.kind == Kind::Raw).map(|p| p.raw).collect();
        assert_eq!(raws, ["p{}\n", "1<2"]);
        let texts: Vec<&str> = found.iter().filter(|p| p.kind == Kind::Text).map(|p| p.raw).collect();
        assert_eq!(texts, ["one &amp; ", "two", "\n"]);
        assert_eq!(line_and_column(html, html.find("</style>").unwrap()), (2, 1));
        assert_eq!(pieces("<p").len(), 1);
    }
}
