//! Randomly broken files: no reader may panic, hang, exceed its memory bound, or lose data of a dive log silently.
//!
//! The tested readers are those of dive logs, foreign logs, files written by people, device data, commands and
//! viewers' messages. `cargo test -p headrace_tests --test fuzz` tries a few files, which are the same in every run.
//! `.ci/run` runs for a minute from a new seed:
//!
//!     HEADRACE_FUZZ_SECONDS=600 cargo test -p headrace_tests --test fuzz -- --ignored --nocapture
//!     HEADRACE_FUZZ_SEED=42 HEADRACE_FUZZ_SECONDS=60 cargo test -p headrace_tests --test fuzz -- --ignored --nocapture
//!
//! A failing file is kept in the system's temporary folder and printed with seed, number and kind.
//! `HEADRACE_FUZZ_FILE=path` tries a kept file again. The name of the file contains its kind. Other fuzzers can call
//! [`targets::try_one`].

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]
#![expect(
    unsafe_code,
    reason = "a global allocator is an unsafe trait; this one counts and calls the system's"
)]

mod corpus;
mod messages;
mod mutate;
mod targets;

use std::alloc::{GlobalAlloc, Layout, System};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use headrace_geometry::time::DurNs;
use headrace_ports::now;
use headrace_tests::random::Random;

use corpus::{Corpus, Kind};
use targets::{Surroundings, try_one};

/// Largest memory that a reader may use for one file, bytes, even if the file claims larger sizes. Source:
/// `docs/reference/limits.md`.
const MOST_MEMORY: usize = 200 << 20;
/// Longest time for one file. A file usually takes less than a hundredth of this time.
const LONGEST: DurNs = DurNs::from_millis(20_000);
/// Number of damaged files tried in an ordinary test run.
const FEW: u64 = 1500;
const SEED_OF_FEW: u64 = 20_260_501;

struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST_HELD: AtomicUsize = AtomicUsize::new(0);

fn took(bytes: usize) {
    let held = HELD.fetch_add(bytes, Ordering::Relaxed) + bytes;
    MOST_HELD.fetch_max(held, Ordering::Relaxed);
}

// SAFETY: every call is passed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        took(layout.size());
        // SAFETY: the caller upholds the allocator's contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller upholds the allocator's contract.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        took(size);
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller upholds the allocator's contract.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A damaged file that is given to a reader.
struct Trial {
    seed: u64,
    number: u64,
    kind: Kind,
}

impl Trial {
    /// Keeps a failing file on disk, and returns a description of the failure.
    fn found(&self, bytes: &[u8], problem: &str) -> String {
        let Self { seed, number, kind } = self;
        let path = std::env::temp_dir().join(format!("headrace-fuzz-{seed}-{number}.{}", kind.name()));
        let kept = std::fs::write(&path, bytes)
            .map_or_else(|error| error.to_string(), |()| path.display().to_string());
        format!("seed {seed}, file {number} ({}): {problem}; kept as {kept}", kind.name())
    }

    /// Gives one file to its reader. Returns a description of the failure, if there is one.
    fn of(&self, bytes: &[u8], corpus: &Corpus, around: &Surroundings) -> Result<(), String> {
        let before = HELD.load(Ordering::Relaxed);
        MOST_HELD.store(before, Ordering::Relaxed);
        let tried = catch_unwind(AssertUnwindSafe(|| try_one(self.kind, bytes, corpus, around)));
        let most = MOST_HELD.load(Ordering::Relaxed).saturating_sub(before);
        match tried {
            Err(panic) => {
                let words = panic.downcast_ref::<String>().map(String::as_str);
                let words =
                    words.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without words");
                Err(self.found(bytes, &format!("panic: {words}")))
            }
            Ok(Err(problem)) => Err(self.found(bytes, &problem)),
            Ok(Ok(())) if most > MOST_MEMORY => {
                Err(self.found(bytes, &format!("took {} MiB; {} are allowed", most >> 20, MOST_MEMORY >> 20)))
            }
            Ok(Ok(())) => Ok(()),
        }
    }
}

/// Runs `work`. Ends the program if a file takes too long, because nothing else can stop a hanging reader.
fn watched<T>(work: impl FnOnce(&dyn Fn(&Trial, &[u8])) -> T) -> T {
    static NUMBER: AtomicUsize = AtomicUsize::new(0);
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let (mut number, mut since) = (0, now());
            while !done.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(20));
                let current = NUMBER.load(Ordering::Relaxed);
                if current != number {
                    (number, since) = (current, now());
                } else if now().since(since) > LONGEST {
                    eprintln!("hangs: no end of a file within {} s; see last.*", LONGEST.as_secs_f64());
                    std::process::abort();
                }
            }
        });
        // Every file is kept before it is tried, because it can't be kept once its reader hangs.
        let result = work(&|trial, bytes| {
            NUMBER.fetch_add(1, Ordering::Relaxed);
            let name = format!("headrace-fuzz-last-{}.{}", std::process::id(), trial.kind.name());
            if trial.seed != SEED_OF_FEW {
                drop(std::fs::write(std::env::temp_dir().join(name), bytes));
            }
        });
        done.store(true, Ordering::Relaxed);
        result
    })
}

/// Tries random files, drawn from `seed`, until `enough` returns true for the number of files tried. Returns the
/// failures.
fn fuzz(seed: u64, enough: impl Fn(u64) -> bool) -> Vec<String> {
    let corpus = Corpus::new();
    let around = Surroundings::new();
    let (mut random, mut number, mut slowest) = (Random(seed), 0, (DurNs(0), 0));
    let mut problems = Vec::new();
    watched(|begin| {
        while !enough(number) && problems.len() < 10 {
            let (kind, bytes) = corpus.mutant(&mut random);
            let trial = Trial { seed, number, kind };
            begin(&trial, &bytes);
            let began = now();
            problems.extend(trial.of(&bytes, &corpus, &around).err());
            slowest = slowest.max((now().since(began), number));
            number += 1;
        }
    });
    let (longest, which) = slowest;
    println!("seed {seed}: {number} files tried; the slowest, {which}, took {:.3} s", longest.as_secs_f64());
    problems
}

fn number(variable: &str) -> Option<u64> {
    let text = std::env::var(variable).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{variable}={text} is no number")))
}

#[test]
fn intact_files_have_no_findings() {
    let (corpus, around) = (Corpus::new(), Surroundings::new());
    for (number, file) in (0..).zip(&corpus.files) {
        let trial = Trial { seed: 0, number, kind: file.kind };
        assert_eq!(trial.of(&file.bytes, &corpus, &around), Ok(()));
        assert!(
            targets::gives(file.kind, &file.bytes, &around) > 0,
            "{:?} {number}: the reader gets nothing",
            file.kind
        );
    }
}

#[test]
fn broken_files_cause_no_panic_hang_or_silent_loss() {
    let problems = fuzz(SEED_OF_FEW, |tried| tried >= FEW);
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

#[test]
#[ignore = "takes a minute; .ci/run has it"]
fn minute_of_broken_files_causes_no_panic_hang_or_silent_loss() {
    let seconds = number("HEADRACE_FUZZ_SECONDS").unwrap_or(60);
    let seed = number("HEADRACE_FUZZ_SEED").unwrap_or_else(|| now().0 ^ u64::from(std::process::id()) << 40);
    println!("HEADRACE_FUZZ_SEED={seed}");
    let end = now() + DurNs::from_millis(i64::try_from(seconds * 1000).unwrap());
    let problems = match std::env::var("HEADRACE_FUZZ_FILE") {
        Ok(path) => {
            let path = PathBuf::from(path);
            let kind = path.extension().and_then(|name| Kind::named(&name.to_string_lossy())).unwrap();
            let trial = Trial { seed, number: 0, kind };
            let bytes = std::fs::read(&path).unwrap();
            trial.of(&bytes, &Corpus::new(), &Surroundings::new()).err().into_iter().collect()
        }
        Err(_) => fuzz(seed, |_| now() > end),
    };
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}
