//! Finds import cycles between files of a crate, because such files can't be understood, tested or moved separately.
//!
//! A file depends on the file that defines an imported item. `pub use` is followed to that file and counts as no
//! dependency itself. A path in code counts if it begins with `crate`, `super` or `self`. Bare names of child modules
//! don't count.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::imports::{Used, imports};
use crate::workspace::{root, workspace};

#[test]
fn no_files_import_each_other_in_a_cycle() {
    let mut found = BTreeMap::new();
    let load = |file: &Path| std::fs::read_to_string(file).ok();
    let targets: Vec<PathBuf> = workspace().into_values().flat_map(|package| package.targets).collect();
    assert!(targets.len() > 20, "{} targets", targets.len());
    for target in targets {
        for circle in Sources::read(&target, &load).circles() {
            let name = |file: &PathBuf| file.strip_prefix(root()).unwrap().display().to_string();
            let imports = circle.imports.iter().map(|(from, to)| format!("{} -> {}", name(from), name(to)));
            found.insert(circle.files.iter().map(name).collect::<BTreeSet<_>>(), imports.collect::<Vec<_>>());
        }
    }
    assert!(found.is_empty(), "import cycles of files, with their imports: {found:#?}");
}

/// Path of a module: the names from the crate's root on.
type Module = Vec<String>;

#[derive(Debug, Default)]
struct Content {
    /// Files of the module: usually one, but several if Cargo features choose between them.
    files: Vec<PathBuf>,
    used: Vec<Used>,
    reexports: BTreeMap<String, Vec<String>>,
}

/// All modules of a crate that have their own files.
#[derive(Debug, Default)]
struct Sources(BTreeMap<Module, Content>);

/// Files that depend on each other, sorted by name.
#[derive(Debug, PartialEq, Eq)]
struct Circle {
    files: Vec<PathBuf>,
    /// Pairs of importing and imported file.
    imports: Vec<(PathBuf, PathBuf)>,
}

impl Sources {
    /// Reads all modules that the crate's root file declares, directly or indirectly.
    fn read(root: &Path, load: &dyn Fn(&Path) -> Option<String>) -> Self {
        let mut sources = Self::default();
        let mut waiting = vec![(Module::new(), root.to_owned())];
        while let Some((module, file)) = waiting.pop() {
            let text = load(&file).unwrap_or_else(|| panic!("no file {}", file.display()));
            let found = imports(&text);
            let folder = file.parent().unwrap();
            // Modules declared in a root file or a mod.rs are in the same folder. Modules declared in another file
            // are in a folder with that file's name.
            let own = if module.is_empty() || file.ends_with("mod.rs") {
                folder.to_owned()
            } else {
                file.with_extension("")
            };
            for declared in found.modules {
                let path: PathBuf = declared.name.iter().collect();
                let file = match declared.file {
                    Some(name) => folder.join(name),
                    None => [own.join(&path).with_extension("rs"), own.join(&path).join("mod.rs")]
                        .into_iter()
                        .find(|file| load(file).is_some())
                        .unwrap_or_else(|| panic!("{}: no file of mod {}", file.display(), path.display())),
                };
                waiting.push(([module.clone(), declared.name].concat(), file));
            }
            let content = sources.0.entry(module).or_default();
            content.files.push(file);
            content.used.extend(found.used);
            content.reexports.extend(found.reexports);
        }
        sources
    }

    /// Converts a used path to a path from the crate's root; `None` if the path leads out of the crate.
    fn absolute(&self, module: &[String], used: &Used) -> Option<Module> {
        let mut from = [module, &used.inside].concat();
        let mut path = used.path.as_slice();
        match path {
            [first, rest @ ..] if first == "crate" => (from, path) = (Module::new(), rest),
            [first, rest @ ..] if first == "self" => path = rest,
            [first, ..] if first == "super" => {}
            [first, ..] => {
                self.0.get(&[from.as_slice(), std::slice::from_ref(first)].concat())?;
            }
            [] => return None,
        }
        while let [first, rest @ ..] = path
            && first == "super"
        {
            from.pop();
            path = rest;
        }
        from.extend_from_slice(path);
        Some(from)
    }

    /// The module with the file that defines the item at this path.
    fn definition(&self, path: &[String], depth: u32) -> Module {
        let mut here = Module::new();
        for (place, name) in path.iter().enumerate() {
            here.push(name.clone());
            if self.0.contains_key(&here) {
                continue;
            }
            here.pop();
            // The depth is limited, because two modules may reexport each other by globs.
            if let Some(behind) = self.0.get(&here).and_then(|content| content.reexports.get(name))
                && depth < 8
                && let Some(on) = self.absolute(&here, &Used { inside: Vec::new(), path: behind.clone() })
            {
                return self.definition(&[&on, &path[place + 1..]].concat(), depth + 1);
            }
            break;
        }
        here
    }

    fn circles(&self) -> Vec<Circle> {
        let needs = self.0.iter().map(|(module, content)| {
            let absolute = content.used.iter().filter_map(|used| self.absolute(module, used));
            let mut needs: BTreeSet<Module> = absolute.map(|path| self.definition(&path, 0)).collect();
            needs.remove(module);
            (module.clone(), needs)
        });
        let needs: BTreeMap<Module, BTreeSet<Module>> = needs.collect();
        let file = |module: &Module| self.0[module].files.iter().min().unwrap().clone();
        let mut circles: Vec<Circle> = components(&needs)
            .into_iter()
            .filter(|circle| circle.len() > 1)
            .map(|circle| {
                let mut files: Vec<PathBuf> = circle.iter().map(file).collect();
                files.sort();
                let imports = circle
                    .iter()
                    .flat_map(|from| needs[from].intersection(&circle).map(move |to| (file(from), file(to))));
                let mut imports: Vec<_> = imports.collect();
                imports.sort();
                Circle { files, imports }
            })
            .collect();
        circles.sort_by(|a, b| a.files.cmp(&b.files));
        circles
    }
}

/// Strongly connected components of a graph: the largest sets in which every node reaches every other (Tarjan 1972).
fn components<N: Ord + Clone>(graph: &BTreeMap<N, BTreeSet<N>>) -> Vec<BTreeSet<N>> {
    let mut search = Search { graph, seen: BTreeMap::new(), stack: Vec::new(), found: Vec::new() };
    for node in graph.keys() {
        if !search.seen.contains_key(node) {
            search.visit(node);
        }
    }
    search.found
}

struct Search<'a, N> {
    graph: &'a BTreeMap<N, BTreeSet<N>>,
    /// Visited nodes, each with its number in the order of visits.
    seen: BTreeMap<&'a N, usize>,
    /// Visited nodes that don't belong to a component yet.
    stack: Vec<&'a N>,
    found: Vec<BTreeSet<N>>,
}

impl<'a, N: Ord + Clone> Search<'a, N> {
    /// Visits a node. Returns the smallest visit number on the stack that the node reaches.
    fn visit(&mut self, node: &'a N) -> usize {
        let number = self.seen.len();
        self.seen.insert(node, number);
        let place = self.stack.len();
        self.stack.push(node);
        let mut earliest = number;
        for next in self.graph.get(node).into_iter().flatten() {
            match self.seen.get(next) {
                None => earliest = earliest.min(self.visit(next)),
                Some(seen) if self.stack.contains(&next) => earliest = earliest.min(*seen),
                Some(_) => {}
            }
        }
        if earliest == number {
            self.found.push(self.stack.drain(place..).cloned().collect());
        }
        earliest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the files of each import cycle in a crate that has these files. The first file is the crate's root.
    fn circles(files: &[(&str, &str)]) -> Vec<String> {
        let load = |file: &Path| {
            files.iter().find(|(name, _)| Path::new(name) == file).map(|(_, text)| (*text).to_owned())
        };
        let circles = Sources::read(Path::new(files[0].0), &load).circles();
        let names = |circle: &Circle| {
            circle.files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>().join(" ")
        };
        circles.iter().map(names).collect()
    }

    const NONE: [&str; 0] = [];

    #[test]
    fn two_files_that_import_each_other_are_a_cycle() {
        let root = ("src/lib.rs", "mod a;\nmod b;");
        let b = ("src/b.rs", "pub struct B;");
        let a = ("src/a.rs", "use crate::b::B;\npub struct A;");
        assert_eq!(circles(&[root, a, b]), NONE);
        for back in
            ["use crate::a::A;", "use super::a::A;", "fn f(_: super::a::A) {}", "use crate::a::{self};"]
        {
            assert_eq!(circles(&[root, a, ("src/b.rs", back)]), ["src/a.rs src/b.rs"], "{back}");
        }
    }

    #[test]
    fn long_cycle_excludes_files_that_only_lead_to_it() {
        let files = [
            ("src/lib.rs", "mod a;\nmod b;\nmod c;\nmod d;\nmod e;\nuse a::A;"),
            ("src/a.rs", "use crate::b::B;"),
            ("src/b.rs", "use crate::{c::C, e::E};"),
            ("src/c.rs", "use crate::d::D;"),
            ("src/d.rs", "use crate::b::B;"),
            ("src/e.rs", "pub struct E;"),
        ];
        assert_eq!(circles(&files), ["src/b.rs src/c.rs src/d.rs"]);
    }

    #[test]
    fn two_cycles_are_reported_separately() {
        let files = [
            ("src/lib.rs", "mod a;\nmod b;\nmod c;\nmod d;"),
            ("src/a.rs", "use crate::b::B;"),
            ("src/b.rs", "use crate::a::A;\nuse crate::c::C;"),
            ("src/c.rs", "use crate::d::D;"),
            ("src/d.rs", "use crate::c::C;"),
        ];
        assert_eq!(circles(&files), ["src/a.rs src/b.rs", "src/c.rs src/d.rs"]);
    }

    #[test]
    fn parent_and_child_that_import_each_other_are_a_cycle() {
        let child = ("src/a/b.rs", "use super::A;");
        for (parent, text) in [("src/a.rs", "mod b;\nuse b::B;"), ("src/a/mod.rs", "mod b;\nuse self::b::B;")]
        {
            let mut files = [parent, "src/a/b.rs"];
            files.sort_unstable_by(|a, b| Path::new(a).cmp(Path::new(b)));
            assert_eq!(circles(&[("src/lib.rs", "mod a;"), (parent, text), child]), [files.join(" ")]);
        }
        assert_eq!(circles(&[("src/lib.rs", "mod a;"), ("src/a.rs", "mod b;"), child]), NONE);
    }

    #[test]
    fn reexport_is_followed_and_is_no_import_itself() {
        let root = "mod a;\nmod b;\npub use b::B as Other;\npub struct Error;";
        let files = [
            ("src/lib.rs", root),
            ("src/a.rs", "use crate::Other;\npub struct A;"),
            ("src/b.rs", "use crate::Error;\npub struct B;"),
        ];
        assert_eq!(circles(&files), NONE, "lib.rs reexports b, and b needs lib.rs");
        let back = ("src/b.rs", "use crate::a::A;\npub struct B;");
        assert_eq!(
            circles(&[files[0], files[1], back]),
            ["src/a.rs src/b.rs"],
            "a needs b by its other name"
        );
    }

    #[test]
    fn mutual_glob_reexports_terminate() {
        let files = [
            ("src/lib.rs", "mod a;\nmod b;\nmod c;"),
            ("src/a.rs", "pub use crate::b::X;"),
            ("src/b.rs", "pub use crate::a::X;"),
            ("src/c.rs", "use crate::a::X;"),
        ];
        assert_eq!(circles(&files), NONE);
    }

    #[test]
    fn tests_may_import_the_tested_module() {
        let root = ("src/lib.rs", "mod a;\n#[cfg(test)]\nmod tests;");
        let inline =
            "use crate::Error;\n#[cfg(test)]\nmod tests { use super::*; use crate::tests::fixture; }";
        let tests = ("src/tests.rs", "use crate::a::A;");
        assert_eq!(circles(&[root, ("src/a.rs", inline), tests]), NONE);
    }

    #[test]
    fn inline_module_belongs_to_its_file() {
        let files = [
            ("src/lib.rs", "mod a;\nmod b;"),
            ("src/a.rs", "pub mod inner { use super::A; use super::super::b::B; }\npub struct A;"),
            ("src/b.rs", "pub struct B;"),
        ];
        assert_eq!(circles(&files), NONE);
        let back = ("src/b.rs", "use crate::a::inner::C;");
        assert_eq!(circles(&[files[0], files[1], back]), ["src/a.rs src/b.rs"]);
    }

    #[test]
    fn every_file_chosen_by_a_feature_counts() {
        let files = [
            ("src/lib.rs", "mod b;\n#[cfg(unix)]\nmod a;\n#[cfg(not(unix))]\n#[path = \"other.rs\"]\nmod a;"),
            ("src/a.rs", ""),
            ("src/other.rs", "use crate::b::B;"),
            ("src/b.rs", "use crate::a::A;"),
        ];
        assert_eq!(circles(&files).len(), 1);
    }
}
