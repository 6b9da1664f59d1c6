//! Source files as Rust tokens, with and without what only tests are built from.

use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::OnceLock;

use proc_macro2::{Delimiter, Group, TokenStream, TokenTree};

pub struct Token {
    pub text: String,
    pub line: usize,
}

/// A source file as text and as tokens.
pub struct Source {
    /// Its path from the repository's root, with forward slashes.
    pub name: String,
    pub text: String,
    /// Without modules that only tests are built from.
    pub tokens: Vec<Token>,
    pub all_tokens: Vec<Token>,
}

impl Source {
    pub fn new(name: String, text: String) -> Self {
        let stream = TokenStream::from_str(&text).unwrap_or_else(|error| panic!("{name}: {error}"));
        let mut all_tokens = Vec::new();
        push_tokens(stream, false, &mut all_tokens);
        // `mod tests;` under `#[cfg(test)]` puts a module of tests into a file of its own.
        let tokens = if name.ends_with("/tests.rs") { Vec::new() } else { flatten(&text) };
        Self { tokens, all_tokens, name, text }
    }

    /// The module at the crate's root that the file belongs to.
    pub fn module(&self) -> String {
        let inside = self.name.strip_prefix("src/").unwrap_or(&self.name);
        inside.split('/').next().unwrap_or_default().trim_end_matches(".rs").to_owned()
    }

    /// The name behind the `::` behind token `i`.
    pub fn path_after(&self, i: usize) -> Option<&str> {
        path_after(&self.tokens, i)
    }

    /// The modules that paths from the crate's root lead into, with their lines.
    pub fn imported_modules(&self) -> Vec<(String, usize)> {
        let mut found = Vec::new();
        for (i, token) in self.tokens.iter().enumerate() {
            if !(token.text == "crate" || token.text == "coilwright") {
                continue;
            }
            match path_after(&self.tokens, i) {
                Some("{") => found.extend(heads_of_group(&self.tokens[i + 4..])),
                Some(name) => found.push((name.to_owned(), token.line)),
                None => {}
            }
        }
        found
    }
}

/// The first names of the paths in `{a::x, b, c::{d, e}}`; `tokens` begins behind the opening brace.
fn heads_of_group(tokens: &[Token]) -> Vec<(String, usize)> {
    let (mut heads, mut depth, mut at_head) = (Vec::new(), 0, true);
    for token in tokens {
        match token.text.as_str() {
            "{" => depth += 1,
            "}" if depth == 0 => break,
            "}" => depth -= 1,
            "," if depth == 0 => at_head = true,
            name if depth == 0 && at_head => {
                heads.push((name.to_owned(), token.line));
                at_head = false;
            }
            _ => {}
        }
    }
    heads
}

pub fn path_after(tokens: &[Token], i: usize) -> Option<&str> {
    let is_path = tokens.get(i + 1)?.text == ":" && tokens.get(i + 2)?.text == ":";
    if is_path { tokens.get(i + 3).map(|t| t.text.as_str()) } else { None }
}

/// The repository's root.
pub fn root() -> &'static Path {
    static ROOT: OnceLock<PathBuf> = OnceLock::new();
    ROOT.get_or_init(|| {
        let own = Path::new(env!("CARGO_MANIFEST_DIR"));
        own.ancestors().nth(2).expect("this package stands two folders below the root").to_path_buf()
    })
}

/// All Rust files below a folder, in the order of their names.
pub fn sources(folder: &str) -> impl Iterator<Item = &'static Source> {
    // Read once, however many rules ask.
    static ALL: OnceLock<Vec<Source>> = OnceLock::new();
    let all = ALL.get_or_init(|| ["benches", "examples", "src", "tests"].into_iter().flat_map(read_below).collect());
    let inside = format!("{folder}/");
    all.iter().filter(move |source| source.name.starts_with(&inside))
}

fn read_below(folder: &str) -> Vec<Source> {
    let mut files: Vec<PathBuf> = Vec::new();
    let mut folders = vec![root().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten() {
            let path = entry.expect("a folder of the repository can be listed").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
        .into_iter()
        .map(|path| {
            let name =
                path.strip_prefix(root()).expect("found below the root").display().to_string().replace('\\', "/");
            Source::new(name, fs::read_to_string(&path).expect("source files are UTF-8"))
        })
        .collect()
}

/// The tokens of the program proper: no comments, no modules under `#[cfg(test)]`.
pub fn flatten(text: &str) -> Vec<Token> {
    let stream = TokenStream::from_str(text).unwrap_or_else(|error| panic!("{text}: {error}"));
    let mut tokens = Vec::new();
    push_tokens(stream, true, &mut tokens);
    tokens
}

/// What a group begins and ends with.
pub fn delimiters(group: &Group) -> (&'static str, &'static str) {
    match group.delimiter() {
        Delimiter::Parenthesis => ("(", ")"),
        Delimiter::Brace => ("{", "}"),
        Delimiter::Bracket => ("[", "]"),
        Delimiter::None => ("", ""),
    }
}

fn push_tokens(stream: TokenStream, without_tests: bool, tokens: &mut Vec<Token>) {
    let trees: Vec<TokenTree> = stream.into_iter().collect();
    let mut i = 0;
    while i < trees.len() {
        let line = trees[i].span().start().line;
        let is_hash = matches!(&trees[i], TokenTree::Punct(p) if p.as_char() == '#');
        let is_test_only = trees.get(i + 1).is_some_and(|t| t.to_string().replace(' ', "") == "[cfg(test)]");
        if without_tests && is_hash && is_test_only {
            // Skips the item: up to its braces or its semicolon.
            i += 2;
            while i < trees.len() {
                let ends = match &trees[i] {
                    TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
                    TokenTree::Punct(punct) => punct.as_char() == ';',
                    _ => false,
                };
                i += 1;
                if ends {
                    break;
                }
            }
            continue;
        }
        match &trees[i] {
            TokenTree::Group(group) => {
                let (open, close) = delimiters(group);
                tokens.push(Token { text: open.to_owned(), line });
                push_tokens(group.stream(), without_tests, tokens);
                tokens.push(Token { text: close.to_owned(), line: group.span_close().start().line });
            }
            tree => tokens.push(Token { text: tree.to_string(), line }),
        }
        i += 1;
    }
}
