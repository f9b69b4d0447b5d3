//! Finds import cycles between files of a crate, because files in a cycle can't be understood, tested or moved
//! separately.
//!
//! A file depends on the files of its child modules, and on the file of each module that its paths name. `pub use`
//! counts like `use`, and an import of a reexported item depends on the file that reexports it. A path in code counts
//! if it begins with `crate`, `super` or `self`. Modules that exist only for tests don't count.

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

/// Path of a module, as its names from the crate's root on.
type Module = Vec<String>;

#[derive(Debug, Default)]
struct Content {
    /// Files of the module: usually one, but several if a Cargo feature determines which of them is used.
    files: Vec<PathBuf>,
    children: Vec<Module>,
    used: Vec<Used>,
}

/// All modules of a crate that have files of their own.
#[derive(Debug, Default)]
struct Sources(BTreeMap<Module, Content>);

/// An import cycle: files that depend on each other, sorted by name.
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
            // The modules that a root file or a mod.rs declares are in the folder of that file. The modules that any
            // other file declares are in a folder with the file's name.
            let own = if module.is_empty() || file.ends_with("mod.rs") {
                folder.to_owned()
            } else {
                file.with_extension("")
            };
            let mut children = Vec::new();
            for declared in found.modules {
                let path: PathBuf = declared.name.iter().collect();
                let file = match declared.file {
                    Some(name) => folder.join(name),
                    None => [own.join(&path).with_extension("rs"), own.join(&path).join("mod.rs")]
                        .into_iter()
                        .find(|file| load(file).is_some())
                        .unwrap_or_else(|| panic!("{}: no file of mod {}", file.display(), path.display())),
                };
                let child = [module.clone(), declared.name].concat();
                children.push(child.clone());
                waiting.push((child, file));
            }
            let content = sources.0.entry(module).or_default();
            content.files.push(file);
            content.children.extend(children);
            content.used.extend(found.used);
        }
        sources
    }

    /// Converts a path that the module `module` uses to a path from the crate's root; `None` if the path leads out of
    /// the crate.
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

    /// The module that a path from the crate's root names: the path's longest beginning that is a module with a file.
    fn named(&self, path: &[String]) -> Module {
        let is_module = |len: &usize| self.0.contains_key(&path[..*len]);
        path[..(1..=path.len()).take_while(is_module).last().unwrap_or(0)].to_vec()
    }

    fn circles(&self) -> Vec<Circle> {
        let needs = self.0.iter().map(|(module, content)| {
            let absolute = content.used.iter().filter_map(|used| self.absolute(module, used));
            let named = absolute.map(|path| self.named(&path));
            let mut needs: BTreeSet<Module> = named.chain(content.children.iter().cloned()).collect();
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

/// Strongly connected components of a graph: the largest sets of nodes in which each node reaches all others (Tarjan
/// 1972).
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
    /// Visits a node. Returns the smallest visit number of the nodes on the stack that this node reaches.
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
    fn child_that_imports_from_its_parent_is_in_a_cycle() {
        let root = ("src/lib.rs", "mod a;\nmod c;");
        let c = ("src/c.rs", "pub struct C;");
        for parent in ["src/a.rs", "src/a/mod.rs"] {
            let of = |child| circles(&[root, (parent, "mod b;\npub struct A;"), ("src/a/b.rs", child), c]);
            let mut files = [parent, "src/a/b.rs"];
            files.sort_unstable_by(|a, b| Path::new(a).cmp(Path::new(b)));
            for child in ["use super::A;", "use crate::a::A;", "use super::*;", "fn f(_: super::A) {}"] {
                assert_eq!(of(child), [files.join(" ")], "{child}");
            }
            assert_eq!(of("use crate::c::C;"), NONE);
        }
    }

    #[test]
    fn import_of_a_nested_item_depends_on_the_innermost_module() {
        let files = [
            ("src/lib.rs", "mod a;\nmod c;"),
            ("src/a.rs", "pub mod b;"),
            ("src/a/b.rs", "use crate::c::C;"),
            ("src/c.rs", "use crate::a::b::B;"),
        ];
        assert_eq!(circles(&files), ["src/a/b.rs src/c.rs"]);
    }

    #[test]
    fn import_of_a_reexport_depends_on_the_reexporting_file() {
        let root = ("src/lib.rs", "mod a;\nmod b;\npub use b::B as Other;");
        let b = ("src/b.rs", "pub struct B;");
        assert_eq!(circles(&[root, ("src/a.rs", "use crate::b::B;"), b]), NONE);
        for import in ["use crate::Other;", "use super::Other;", "pub use crate::Other;"] {
            assert_eq!(circles(&[root, ("src/a.rs", import), b]), ["src/a.rs src/lib.rs"], "{import}");
        }
    }

    #[test]
    fn reexport_depends_on_the_reexported_file() {
        let root = ("src/lib.rs", "mod a;\nmod b;");
        let b = ("src/b.rs", "use crate::a::X;");
        assert_eq!(circles(&[root, ("src/a.rs", "pub use crate::b::X;"), b]), ["src/a.rs src/b.rs"]);
    }

    #[test]
    fn tests_may_import_the_tested_module() {
        let root = ("src/lib.rs", "mod a;\n#[cfg(test)]\nmod tests;");
        let inline = "#[cfg(test)]\nmod tests { use super::*; use crate::tests::fixture; }";
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
