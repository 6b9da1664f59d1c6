//! The library's public surface as a list of lines, read from the source's tokens: what others may use, and what a version promises.
//!
//! The compiler warns of a `pub` that nobody outside can reach, so every `pub` of the library is part of the surface, under the path
//! of the module that defines it. Beside the items stand what they derive and implement; a field or a method is a line of its own,
//! with its type. Items under `#[cfg(test)]` are none of it.

use std::collections::BTreeSet;
use std::str::FromStr;

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};

use crate::source::{Source, delimiters};

/// What differs between two surfaces, and what that asks of the version.
pub struct Difference {
    /// Lines that are gone or no longer as they were: whoever uses them must change.
    pub broken: Vec<String>,
    pub new: Vec<String>,
}

impl Difference {
    pub fn between(stored: &BTreeSet<String>, found: &BTreeSet<String>) -> Self {
        Self { broken: stored.difference(found).cloned().collect(), new: found.difference(stored).cloned().collect() }
    }
}

/// The least version that may follow a released one: before 1.0 the middle number is what breaks (Cargo's reading of semver).
pub fn least_version(released: [u32; 3], difference: &Difference) -> [u32; 3] {
    let [major, minor, patch] = released;
    match (difference.broken.is_empty(), difference.new.is_empty()) {
        (true, true) => released,
        (true, false) if major == 0 => [0, minor, patch + 1],
        (true, false) => [major, minor + 1, 0],
        (false, _) if major == 0 => [0, minor + 1, 0],
        (false, _) => [major + 1, 0, 0],
    }
}

/// The lines of all files of the library.
pub fn surface<'s>(sources: impl Iterator<Item = &'s Source>) -> BTreeSet<String> {
    let mut lines = BTreeSet::new();
    let mut implemented = Vec::new();
    for source in sources {
        // What only tests are built from has no tokens left.
        if source.name == "src/main.rs" || source.tokens.is_empty() {
            continue;
        }
        let stream = TokenStream::from_str(&source.text).expect("read before");
        items(stream, &module_path(&source.name), &mut lines, &mut implemented);
    }
    // Traits of types that others can name.
    let types: BTreeSet<String> = lines.iter().filter_map(|line| named_type(line)).collect();
    lines.extend(implemented.into_iter().filter(|(of, _)| types.contains(of)).map(|(_, line)| line));
    lines
}

/// `Coil` in `coilwright::coil: struct Coil`.
fn named_type(line: &str) -> Option<String> {
    let (_, words) = line.split_once(": ")?;
    let name = ["struct ", "enum ", "trait "].iter().find_map(|kind| words.strip_prefix(kind))?;
    Some(name.split(|c: char| !c.is_alphanumeric() && c != '_').next()?.to_owned())
}

/// `src/io/read/mod.rs` is `coilwright::io::read`.
fn module_path(file: &str) -> String {
    let inside = file.trim_start_matches("src/").trim_end_matches(".rs").trim_end_matches("/mod");
    if inside == "lib" { "coilwright".to_owned() } else { format!("coilwright::{}", inside.replace('/', "::")) }
}

/// An item: its attributes, the tokens before its braces or its end, and what the braces hold.
struct Item {
    attributes: Vec<String>,
    head: Vec<TokenTree>,
    body: Option<TokenStream>,
}

impl Item {
    fn is_of_tests(&self) -> bool {
        self.attributes.iter().any(|a| a.replace(' ', "") == "cfg(test)")
    }

    fn is_public(&self) -> bool {
        is_word(self.head.first(), "pub") && !matches!(self.head.get(1), Some(TokenTree::Group(_)))
    }

    /// The head without `pub`, as text.
    fn text(&self) -> String {
        text(&self.head[usize::from(self.is_public())..])
    }

    /// Behind a word of the head: the name in `pub struct Name`.
    fn name_behind(&self, word: &str) -> Option<String> {
        let place = self.head.iter().position(|t| is_word(Some(t), word))?;
        Some(self.head.get(place + 1)?.to_string())
    }

    fn derives(&self) -> Vec<String> {
        let of = |a: &String| Some(a.replace(' ', "").strip_prefix("derive(")?.trim_end_matches(')').to_owned());
        let all: Vec<String> = self.attributes.iter().filter_map(of).collect();
        all.iter().flat_map(|list| list.split(',')).filter(|d| !d.is_empty()).map(str::to_owned).collect()
    }
}

fn is_word(token: Option<&TokenTree>, word: &str) -> bool {
    matches!(token, Some(TokenTree::Ident(ident)) if ident == word)
}

fn is_mark(token: Option<&TokenTree>, mark: char) -> bool {
    matches!(token, Some(TokenTree::Punct(punct)) if punct.as_char() == mark)
}

/// Tokens as one line that does not depend on how the source is laid out.
fn text(tokens: &[TokenTree]) -> String {
    let mut line = String::new();
    let words = words(tokens);
    for (i, word) in words.iter().enumerate() {
        // A comma behind the last of a list is a matter of layout.
        if word == "," && words.get(i + 1).is_none_or(|next| [")", "]", ">", "}"].contains(&next.as_str())) {
            continue;
        }
        let begins_word = word.starts_with(|c: char| c.is_alphanumeric() || "_'\"".contains(c));
        let ended_word = line.ends_with(|c: char| c.is_alphanumeric() || "_\"".contains(c));
        let is_apart = begins_word && (ended_word || line.ends_with([',', ')', ']', '>', '+', '=']))
            || line.ends_with("->")
            || (line.ends_with(':') && !line.ends_with("::") && word != ":")
            || ["->", "=", "+", "{", "}"].contains(&word.as_str())
            || line.ends_with('{')
            || line.ends_with(',');
        if is_apart && !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    // How a function holds its own argument is no one else's matter.
    line.replace("(mut self", "(self").replace(", mut ", ", ").replace("(mut ", "(")
}

/// Words and marks, groups opened; what is one mark (`::`, `->`, a lifetime) stays one.
fn words(tokens: &[TokenTree]) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut is_joint = false;
    for token in tokens {
        let was_joint = std::mem::take(&mut is_joint);
        match token {
            TokenTree::Group(group) => {
                let (open, close) = delimiters(group);
                words.push(open.to_owned());
                words.extend(self::words(&group.stream().into_iter().collect::<Vec<_>>()));
                words.push(close.to_owned());
            }
            TokenTree::Punct(punct) => {
                is_joint = punct.spacing() == Spacing::Joint;
                let mark = punct.as_char();
                match words.last_mut() {
                    Some(last) if was_joint && matches!((last.as_str(), mark), (":", ':') | ("-" | "=", '>')) => {
                        last.push(mark)
                    }
                    _ => words.push(mark.to_string()),
                }
            }
            _ if was_joint && words.last().is_some_and(|last| last == "'") => {
                words.pop();
                words.push(format!("'{token}"));
            }
            _ => words.push(token.to_string()),
        }
    }
    words
}

/// Cuts a file or a body into items: each ends with its braces or its semicolon.
fn cut(stream: TokenStream) -> Vec<Item> {
    let mut items = Vec::new();
    let (mut attributes, mut head) = (Vec::new(), Vec::new());
    let mut trees = stream.into_iter().peekable();
    while let Some(tree) = trees.next() {
        if is_mark(Some(&tree), '#') && head.is_empty() {
            let _ = trees.next_if(|next| is_mark(Some(next), '!'));
            if let Some(TokenTree::Group(group)) = trees.next() {
                attributes.push(group.stream().to_string());
            }
            continue;
        }
        let (ends, body) = match &tree {
            // A `use` ends with its semicolon, and so does a value that is written with braces.
            TokenTree::Group(group)
                if group.delimiter() == Delimiter::Brace && !is_of(&head, "use") && !is_of(&head, "const") =>
            {
                (true, Some(group.stream()))
            }
            TokenTree::Punct(punct) if punct.as_char() == ';' => (true, None),
            _ => (false, None),
        };
        if ends {
            items.push(Item { attributes: std::mem::take(&mut attributes), head: std::mem::take(&mut head), body });
        } else {
            head.push(tree);
        }
    }
    items
}

/// Whether the item is a `use`, or a `const` that is no function.
fn is_of(head: &[TokenTree], word: &str) -> bool {
    head.iter().any(|t| is_word(Some(t), word)) && !head.iter().any(|t| is_word(Some(t), "fn"))
}

fn items(stream: TokenStream, path: &str, lines: &mut BTreeSet<String>, implemented: &mut Vec<(String, String)>) {
    for item in cut(stream).into_iter().filter(|item| !item.is_of_tests()) {
        if is_word(item.head.first(), "impl") {
            implementation(&item, path, lines, implemented);
            continue;
        }
        if !item.is_public() {
            continue;
        }
        let words = item.text();
        let kind = words.split(' ').find(|word| KINDS.contains(word)).unwrap_or_default();
        match kind {
            "struct" | "enum" | "trait" => {
                let Some(name) = item.name_behind(kind) else { continue };
                let own = format!("{path}::{name}");
                lines.insert(format!("{path}: {words}"));
                lines.extend(item.derives().into_iter().map(|derived| format!("{own}: derives {derived}")));
                if item.attributes.iter().any(|a| a == "non_exhaustive") {
                    lines.insert(format!("{own}: non_exhaustive"));
                }
                let Some(body) = item.body else { continue };
                match kind {
                    "struct" => fields(body, &own, lines),
                    "enum" => variants(body, &own, lines),
                    _ => lines.extend(cut(body).iter().map(|method| format!("{own}: {}", method.text()))),
                }
            }
            // Its value is no promise.
            "const" | "static" => {
                lines.insert(format!("{path}: {}", words.split(" = ").next().unwrap_or_default()));
            }
            "" => {}
            _ => {
                lines.insert(format!("{path}: {words}"));
            }
        }
    }
}

/// In this order: `pub const fn` is a function.
const KINDS: &[&str] = &["struct", "enum", "trait", "fn", "mod", "use", "type", "const", "static"];

/// Public methods and constants of a type; of a trait that is implemented the type and the line.
fn implementation(item: &Item, path: &str, lines: &mut BTreeSet<String>, implemented: &mut Vec<(String, String)>) {
    let head = text(&item.head);
    if let Some(place) = item.head.iter().rposition(|t| is_word(Some(t), "for")) {
        // The last name of the path: `Coil` in `for crate::coil::Coil<'_>`.
        let path_of_type = item.head[place + 1..].iter().take_while(|t| !is_mark(Some(t), '<'));
        if let Some(TokenTree::Ident(name)) = path_of_type.filter(|t| matches!(t, TokenTree::Ident(_))).last() {
            implemented.push((name.to_string(), format!("{path}: {head}")));
        }
        return;
    }
    for member in item.body.clone().map(cut).unwrap_or_default() {
        if member.is_public() && !member.is_of_tests() {
            let words = member.text();
            let words =
                if is_of(&member.head, "const") { words.split(" = ").next().unwrap_or_default() } else { &words };
            lines.insert(format!("{path}: {head} {{ {words} }}"));
        }
    }
}

/// The parts of a list that commas divide, outside of groups and of `<…>`, without attributes.
fn parts(stream: TokenStream) -> Vec<Vec<TokenTree>> {
    let (mut parts, mut part, mut depth) = (Vec::new(), Vec::new(), 0);
    let mut trees = stream.into_iter();
    while let Some(tree) = trees.next() {
        if is_mark(Some(&tree), '#') && part.is_empty() {
            trees.next();
            continue;
        }
        if is_mark(Some(&tree), '<') {
            depth += 1;
        } else if is_mark(Some(&tree), '>') && !is_mark(part.last(), '-') {
            depth -= 1;
        }
        if is_mark(Some(&tree), ',') && depth == 0 {
            parts.push(std::mem::take(&mut part));
        } else {
            part.push(tree);
        }
    }
    parts.push(part);
    parts.retain(|part| !part.is_empty());
    parts
}

/// Public fields, each with its type; a struct with others besides cannot be written as a literal.
fn fields(body: TokenStream, own: &str, lines: &mut BTreeSet<String>) {
    for part in parts(body) {
        let is_public = is_word(part.first(), "pub") && !matches!(part.get(1), Some(TokenTree::Group(_)));
        lines.insert(match is_public {
            true => format!("{own}: {}", text(&part[1..])),
            false => format!("{own}: has private fields"),
        });
    }
}

/// Variants, each with its fields.
fn variants(body: TokenStream, own: &str, lines: &mut BTreeSet<String>) {
    for part in parts(body) {
        let name = part[0].to_string();
        let Some(TokenTree::Group(group)) = part.get(1) else {
            lines.insert(format!("{own}::{name}"));
            continue;
        };
        let fields: Vec<String> = parts(group.stream()).iter().map(|field| text(field)).collect();
        lines.insert(format!("{own}::{name} {{ {} }}", fields.join(", ")));
    }
}
