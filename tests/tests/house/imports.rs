//! Reads the declarations and imports of a Rust file from its tokens, to find the files on which the file depends.

/// A token of Rust, in as much detail as is needed to find imports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Token<'a> {
    Word(&'a str),
    /// `::`
    Separator,
    /// Content of an ordinary string literal, not a raw one.
    Text(&'a str),
    Mark(char),
}

use Token::{Mark, Separator, Text, Word};

/// Declaration of a module that has its own file (`mod name;`).
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Declared {
    /// Names of the inline modules around the declaration, followed by the name of the module itself.
    pub(crate) name: Vec<String>,
    /// Value of the module's `#[path]`.
    pub(crate) file: Option<String>,
}

/// A path (such as `crate::a::b`) that a file imports or names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Used {
    /// Names of the inline modules in which the path stands.
    pub(crate) inside: Vec<String>,
    pub(crate) path: Vec<String>,
}

/// Declarations and imports of a file, except those that exist only for tests.
#[derive(Debug, Default)]
pub(crate) struct Imports {
    pub(crate) modules: Vec<Declared>,
    /// Paths of `use` declarations, and paths in code that begin with `crate`, `super` or `self`.
    pub(crate) used: Vec<Used>,
}

/// Reads declarations and imports from the text of a file.
pub(crate) fn imports(text: &str) -> Imports {
    let tokens = tokens(text);
    let mut found = Imports::default();
    // The inline modules around the current token, each with the number of open braces outside it.
    let mut around: Vec<(&str, usize)> = Vec::new();
    let (mut depth, mut at) = (0_usize, 0);
    while at < tokens.len() {
        let (before, here) = tokens.split_at(at);
        let inside = || around.iter().map(|(name, _)| (*name).to_owned()).collect::<Vec<_>>();
        let mut taken = 1;
        match here {
            [Mark('{'), ..] => depth += 1,
            [Mark('}'), ..] => {
                depth = depth.saturating_sub(1);
                around.pop_if(|(_, outside)| *outside == depth);
            }
            [Word("mod"), Word(name), Mark(end @ ('{' | ';')), ..] => {
                let front = Front::of(before);
                match (front.is_test, end) {
                    (true, '{') => taken = 2 + block(&here[2..]),
                    (true, _) => {}
                    (false, '{') => {
                        around.push((name, depth));
                        depth += 1;
                        taken = 3;
                    }
                    (false, _) => {
                        let name = [inside(), vec![(*name).to_owned()]].concat();
                        found.modules.push(Declared { name, file: front.path.map(str::to_owned) });
                    }
                }
            }
            // The name of this module in a macro definition is an argument of the macro.
            [Word("mod"), Mark('$'), Word(name), Mark('{'), ..] => {
                around.push((name, depth));
                depth += 1;
                taken = 4;
            }
            // The condition `!= Mark('<')` excludes `use<..>`, a capture list in a type.
            [Word("use"), next, ..] if *next != Mark('<') => {
                let end = here.iter().position(|token| *token == Mark(';')).unwrap_or(here.len());
                let (front, mut leaves) = (Front::of(before), Vec::new());
                tree(&here[1..end], &[], &mut leaves);
                let owned = |path: Vec<&str>| path.into_iter().map(str::to_owned).collect::<Vec<_>>();
                if !front.is_test {
                    let used = |path| Used { inside: inside(), path: owned(path) };
                    found.used.extend(leaves.into_iter().map(used));
                }
                taken = end;
            }
            [Word(first @ ("crate" | "super" | "self")), rest @ ..]
                if rest.first() == Some(&Separator) && !matches!(before, [.., Mark('$') | Separator]) =>
            {
                let (mut path, mut rest) = (vec![(*first).to_owned()], rest);
                while let [Separator, Word(word), behind @ ..] = rest {
                    path.push((*word).to_owned());
                    rest = behind;
                }
                taken = here.len() - rest.len();
                found.used.push(Used { inside: inside(), path });
            }
            _ => {}
        }
        at += taken;
    }
    found
}

/// Attributes of an item, which come before its visibility.
#[derive(Debug, Default)]
struct Front<'a> {
    /// Whether `#[cfg(test)]` is present, alone or with other conditions.
    is_test: bool,
    /// Value of `#[path]`.
    path: Option<&'a str>,
}

impl<'a> Front<'a> {
    fn of(mut before: &[Token<'a>]) -> Self {
        let mut front = Self::default();
        if let [rest @ .., Word("pub")] = before {
            before = rest;
        } else if let [.., Mark(')')] = before
            && let Some(open) = before.iter().rposition(|token| *token == Mark('('))
            && let [rest @ .., Word("pub")] = &before[..open]
        {
            before = rest;
        }
        while let [.., Mark(']')] = before {
            let mut depth = 0_usize;
            let open = before.iter().rposition(|token| {
                depth = match token {
                    Mark(']') => depth + 1,
                    Mark('[') => depth - 1,
                    _ => depth,
                };
                depth == 0
            });
            let Some(open) = open else { break };
            let [rest @ .., Mark('#')] = &before[..open] else { break };
            match &before[open + 1..before.len() - 1] {
                [Word("cfg"), condition @ ..] => {
                    front.is_test |= condition.contains(&Word("test")) && !condition.contains(&Word("not"));
                }
                [Word("path"), Mark('='), Text(path)] => front.path = Some(path),
                _ => {}
            }
            before = rest;
        }
        front
    }
}

/// Collects the paths of the leaves of a `use` tree.
fn tree<'a>(tokens: &[Token<'a>], around: &[&'a str], leaves: &mut Vec<Vec<&'a str>>) {
    let (mut path, mut rest) = (around.to_vec(), tokens);
    while let [Word(word), Separator, behind @ ..] = rest {
        path.push(word);
        rest = behind;
    }
    match rest {
        [Mark('{'), inner @ .., Mark('}')] => {
            let mut depth = 0_usize;
            let parts = inner.split(|token| {
                depth = match token {
                    Mark('{') => depth + 1,
                    Mark('}') => depth - 1,
                    _ => depth,
                };
                depth == 0 && *token == Mark(',')
            });
            parts.for_each(|part| tree(part, &path, leaves));
        }
        // `self` and a glob both stand for the module whose path comes before them.
        [Word("self"), ..] | [Mark('*')] => leaves.push(path),
        [Word(word), ..] => leaves.push([path, vec![word]].concat()),
        _ => {}
    }
}

/// Number of tokens in a block, including both braces.
fn block(tokens: &[Token<'_>]) -> usize {
    let mut depth = 0_usize;
    let end = tokens.iter().position(|token| {
        depth = match token {
            Mark('{') => depth + 1,
            Mark('}') => depth - 1,
            _ => depth,
        };
        depth == 0
    });
    end.map_or(tokens.len(), |end| end + 1)
}

fn tokens(text: &str) -> Vec<Token<'_>> {
    let is_word = |character: char| character.is_alphanumeric() || character == '_';
    let mut tokens = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let len = match first {
            '/' if rest.starts_with("//") => rest.find('\n').unwrap_or(rest.len()),
            '/' if rest.starts_with("/*") => comment(rest),
            '"' => {
                let len = quoted(rest);
                tokens.push(Text(&rest[1..len.saturating_sub(1).max(1)]));
                len
            }
            '\'' => character(rest),
            ':' if rest.starts_with("::") => {
                tokens.push(Separator);
                2
            }
            _ if is_word(first) => {
                let len = rest.find(|character| !is_word(character)).unwrap_or(rest.len());
                let (word, behind) = rest.split_at(len);
                if let Some(string) = raw(behind).filter(|_| matches!(word, "r" | "br" | "cr")) {
                    len + string
                } else {
                    tokens.push(Word(word));
                    len
                }
            }
            _ => {
                if !first.is_whitespace() {
                    tokens.push(Mark(first));
                }
                first.len_utf8()
            }
        };
        rest = &rest[len..];
    }
    tokens
}

/// Length of a block comment, including nested comments.
fn comment(text: &str) -> usize {
    let (mut depth, mut at) = (0_usize, 0);
    loop {
        let rest = &text[at..];
        if rest.is_empty() {
            return at;
        } else if rest.starts_with("/*") {
            depth += 1;
            at += 2;
        } else if rest.starts_with("*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                return at;
            }
        } else {
            at += rest.chars().next().map_or(1, char::len_utf8);
        }
    }
}

/// Length of a string, including its quotes.
fn quoted(text: &str) -> usize {
    let mut is_escaped = false;
    let end = text.char_indices().skip(1).find(|(_, character)| {
        let ends = *character == '"' && !is_escaped;
        is_escaped = *character == '\\' && !is_escaped;
        ends
    });
    end.map_or(text.len(), |(at, _)| at + 1)
}

/// Length of a raw string after the `r`; `None` if there is no raw string.
fn raw(text: &str) -> Option<usize> {
    let content = text.trim_start_matches('#');
    let hashes = &text[..text.len() - content.len()];
    let content = content.strip_prefix('"')?;
    let end = format!("\"{hashes}");
    Some(hashes.len() + 1 + content.find(&end).map_or(content.len(), |at| at + end.len()))
}

/// Length of a character literal including its quotes, or of the mark of a lifetime.
fn character(text: &str) -> usize {
    let mut characters = text.char_indices().skip(1);
    match (characters.next(), characters.next()) {
        (Some((_, '\\')), Some((escaped, _))) => {
            let behind = escaped + text[escaped..].chars().next().map_or(1, char::len_utf8);
            text[behind..].find('\'').map_or(text.len(), |at| behind + at + 1)
        }
        (Some(_), Some((at, '\''))) => at + 1,
        _ => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn used(text: &str) -> Vec<String> {
        imports(text).used.into_iter().map(|used| used.path.join("::")).collect()
    }

    #[test]
    fn use_tree_has_a_path_for_each_leaf() {
        let text = "use crate::{a::{self, B as C}, d::*, e};\nuse super::super::f::G as _;\nuse h as i;";
        let paths = ["crate::a", "crate::a::B", "crate::d", "crate::e", "super::super::f::G", "h"];
        assert_eq!(used(text), paths);
    }

    #[test]
    fn reexports_count_as_imports() {
        let text = "pub use a::{B, C as D};\npub(crate) use self::e::F;\npub(super) use h::*;";
        assert_eq!(used(text), ["a::B", "a::C", "self::e::F", "h"]);
    }

    #[test]
    fn paths_in_code_count_if_they_begin_with_crate_super_or_self() {
        let text = "fn f(a: crate::a::A) -> super::B { self::c::d(); a.self_::e(); x::crate_::f() }";
        assert_eq!(used(text), ["crate::a::A", "super::B", "self::c::d"]);
    }

    #[test]
    fn comments_strings_characters_and_macros_contain_no_imports() {
        let text = r##"
            // use crate::a;
            /* use crate::b; /* and */ use crate::c; */
            const D: &str = "use crate::d; \" use crate::e;";
            const F: &str = r#"use crate::f; " use crate::g;"#;
            const H: [char; 3] = ['"', '\'', '\u{22}'];
            macro_rules! i { () => { $crate::i::j() } }
            fn k<'a>(text: &'a str) -> impl Iterator<Item = char> + use<'a> { text.chars() }
            use crate::l;
        "##;
        assert_eq!(used(text), ["crate::l"]);
    }

    #[test]
    fn imports_in_test_code_are_ignored() {
        let text = "#[cfg(test)]\nuse crate::a;\n#[cfg(test)]\n#[allow(dead_code)]\npub(crate) mod tests { use crate::b; mod c; }\n\
            #[cfg(all(test, unix))]\nmod d;\n#[cfg(not(test))]\nmod e;\nuse crate::f;";
        assert_eq!(used(text), ["crate::f"]);
        let modules: Vec<_> =
            imports(text).modules.into_iter().map(|module| module.name.join("::")).collect();
        assert_eq!(modules, ["e"]);
    }

    #[test]
    fn paths_include_their_inline_modules() {
        let found = imports(
            "mod a { use super::B; mod c { fn d() { super::e() } } }\nuse super::F;\nmod g { mod h; }\n\
             macro_rules! i { ($j:ident) => { mod $j { use super::K; } } }",
        );
        let used: Vec<_> =
            found.used.iter().map(|used| (used.inside.join("::"), used.path.join("::"))).collect();
        let expected = [("a", "super::B"), ("a::c", "super::e"), ("", "super::F"), ("j", "super::K")];
        assert_eq!(used, expected.map(|(inside, path)| (inside.to_owned(), path.to_owned())));
        assert_eq!(found.modules, [Declared { name: vec!["g".to_owned(), "h".to_owned()], file: None }]);
    }

    #[test]
    fn path_attribute_gives_the_file_of_a_module() {
        let found = imports("#[cfg(feature = \"mesh\")]\n#[path = \"other.rs\"]\npub mod a;");
        let file = Some("other.rs".to_owned());
        assert_eq!(found.modules, [Declared { name: vec!["a".to_owned()], file }]);
    }
}
