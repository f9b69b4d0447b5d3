//! Draws cases, checks properties and reports failing cases.

use std::panic::{AssertUnwindSafe, catch_unwind};

use headrace_geometry::math;
use headrace_tests::random::Random;

/// Number of random cases of each subject that ordinary tests try. `SEED_OF_FEW` is the seed of the first case.
const FEW: u64 = 3000;
const SEED_OF_FEW: u64 = 20_260_901;
/// Default number of cases in a long run, for all subjects together.
const MANY: u64 = 10_000_000;
const SUBJECTS: u64 = 5;

/// Source of a test case's random values.
pub(crate) struct Case(Random);

impl Case {
    /// A random number from 0 to below 1.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.0.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A random number from `from` to below `to`.
    pub(crate) fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.unit()
    }

    /// A random power of ten with an exponent between `from` and `to`.
    pub(crate) fn power_of_ten(&mut self, from: f64, to: f64) -> f64 {
        math::exp(self.between(from, to) * core::f64::consts::LN_10)
    }

    /// A random number of either sign with a magnitude between two powers of ten.
    pub(crate) fn of_any_size(&mut self, from: i32, to: i32) -> f64 {
        let size = self.power_of_ten(f64::from(from), f64::from(to));
        if self.below(2) == 0 { size } else { -size }
    }

    /// A random integer below `limit`.
    pub(crate) fn below(&mut self, limit: usize) -> usize {
        self.0.below(limit)
    }

    /// A random integer below `limit`.
    pub(crate) fn count_below(&mut self, limit: u32) -> u32 {
        u32::try_from(self.0.bits() % u64::from(limit)).unwrap()
    }

    pub(crate) fn byte(&mut self) -> u8 {
        self.0.byte()
    }
}

/// Whether an error is at most its bound; false if the error isn't a number.
pub(crate) fn within(error: f64, bound: f64) -> bool {
    error <= bound
}

type Property<'a> = &'a dyn Fn(&mut Case) -> Result<(), String>;

/// Runs `count` cases of a property. Returns the cases that fail or panic, up to ten.
fn failing(subject: &str, seed: u64, count: u64, property: Property<'_>) -> Vec<String> {
    let mut found = Vec::new();
    for number in 0..count {
        let of_this = seed.wrapping_add(number);
        let tried = catch_unwind(AssertUnwindSafe(|| {
            property(&mut Case(Random(of_this.wrapping_mul(0x2545_F491_4F6C_DD1D))))
        }));
        let problem = match tried {
            Ok(Ok(())) => continue,
            Ok(Err(problem)) => problem,
            Err(_) => "a panic".to_owned(),
        };
        found.push(format!("{subject}: HEADRACE_PROPERTY_SEED={of_this}: {problem}"));
        if found.len() >= 10 {
            break;
        }
    }
    found
}

/// Checks a property with a few thousand random cases.
#[track_caller]
pub(crate) fn few(subject: &str, property: Property<'_>) {
    let found = failing(subject, SEED_OF_FEW, FEW, property);
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// Checks a property in a long run, with this subject's share of all cases.
#[track_caller]
pub(crate) fn many(subject: &str, property: Property<'_>) {
    let number = |name: &str| {
        let text = std::env::var(name).ok()?;
        Some(text.parse::<u64>().unwrap_or_else(|_| panic!("{name}={text} is no number")))
    };
    let seed = number("HEADRACE_PROPERTY_SEED")
        .unwrap_or_else(|| headrace_ports::now().0 ^ u64::from(std::process::id()) << 40);
    let count = number("HEADRACE_PROPERTY_CASES").unwrap_or(MANY) / SUBJECTS;
    println!("{subject}: {count} cases, HEADRACE_PROPERTY_SEED={seed}");
    let found = failing(subject, seed, count, property);
    assert!(found.is_empty(), "{}", found.join("\n"));
    println!("{subject}: {count} cases hold");
}

/// The property in this test fails on purpose in some cases. The run must find such a case and report its seed.
#[test]
fn failing_case_is_reported_and_repeatable() {
    let rare = |case: &mut Case| if case.below(500) == 7 { Err("seven".to_owned()) } else { Ok(()) };
    let found = failing("planted", 1, 5000, &rare);
    assert!(found.len() > 3, "{found:?}");
    let seed = found[0].split(['=', ':']).nth(2).unwrap().parse().unwrap();
    assert_eq!(failing("planted", seed, 1, &rare), found[..1]);
    let broken = |case: &mut Case| if case.below(500) == 7 { panic!("planted") } else { Ok(()) };
    assert_eq!(failing("planted", seed, 1, &broken).len(), 1);
}
