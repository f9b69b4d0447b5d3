use super::*;

/// Published critical values of the smaller rank sum, min(W+, W-): two-sided alpha 0.10, 0.05, 0.02, 0.01; 0 if there
/// is none. Source: Wilcoxon and Wilcox 1964, as reprinted in textbooks.
const CRITICAL: [(usize, [usize; 4]); 26] = [
    (5, [0, 99, 99, 99]),
    (6, [2, 0, 99, 99]),
    (7, [3, 2, 0, 99]),
    (8, [5, 3, 1, 0]),
    (9, [8, 5, 3, 1]),
    (10, [10, 8, 5, 3]),
    (11, [13, 10, 7, 5]),
    (12, [17, 13, 9, 7]),
    (13, [21, 17, 12, 9]),
    (14, [25, 21, 15, 12]),
    (15, [30, 25, 19, 15]),
    (16, [35, 29, 23, 19]),
    (17, [41, 34, 27, 23]),
    (18, [47, 40, 32, 27]),
    (19, [53, 46, 37, 32]),
    (20, [60, 52, 43, 37]),
    (21, [67, 58, 49, 42]),
    (22, [75, 65, 55, 48]),
    (23, [83, 73, 62, 54]),
    (24, [91, 81, 69, 61]),
    (25, [100, 89, 76, 68]),
    (26, [110, 98, 84, 75]),
    (27, [119, 107, 92, 83]),
    (28, [130, 116, 101, 91]),
    (29, [140, 126, 110, 100]),
    (30, [151, 137, 120, 109]),
];
const ALPHAS: [f64; 4] = [0.10, 0.05, 0.02, 0.01];
/// No value of W reaches the significance level.
const NONE: usize = 99;

#[test]
fn critical_values_match_published_tables() {
    for (n, row) in CRITICAL {
        for (critical, alpha) in row.into_iter().zip(ALPHAS) {
            let p = |w: usize| exact(n, w as f64)[0];
            if critical == NONE && n < 8 {
                assert!(p(0) > alpha, "{n} {alpha}: {}", p(0));
            } else {
                assert!(p(critical) <= alpha && p(critical + 1) > alpha, "{n} {alpha}: {}", p(critical));
            }
        }
    }
}

#[test]
fn ten_pairs_with_a_rank_sum_of_eight_have_the_known_exact_p_value() {
    // The differences are 1 to 10. Ranks 3 and 5 are positive, and all others are negative.
    let differences: Vec<f64> =
        (1..=10).map(|k| if k == 3 || k == 5 { f64::from(k) } else { -f64::from(k) }).collect();
    let test = of_differences(&differences, Options::default()).unwrap();
    assert_eq!((test.w_plus, test.w_minus, test.used, test.method), (8.0, 47.0, 10, Method::Exact));
    assert!((test.p_two_sided - 50.0 / 1024.0).abs() < 1e-15, "{test:?}");
    assert!((test.p_less - 25.0 / 1024.0).abs() < 1e-15);
}

/// Rank sums W+ for all choices of signs, for the given ranks.
fn all_choices(ranks: &[f64]) -> Vec<f64> {
    (0..1_u32 << ranks.len())
        .map(|signs| ranks.iter().enumerate().filter(|(k, _)| signs >> k & 1 == 1).map(|(_, r)| r).sum())
        .collect()
}

#[test]
fn exact_p_value_equals_a_count_over_all_sign_choices() {
    for n in 1..=12 {
        let ranks: Vec<f64> = (1..=n).map(f64::from).collect();
        let choices = all_choices(&ranks);
        for signs in (0..1_u32 << n).step_by(7) {
            let sign = |k: i32| if signs >> (k - 1) & 1 == 1 { 1.0 } else { -1.0 };
            let differences: Vec<f64> = (1..=n).map(|k| sign(k) * f64::from(k) * 0.37).collect();
            let test = of_differences(&differences, Options::default()).unwrap();
            let share = |good: &dyn Fn(f64) -> bool| {
                choices.iter().filter(|w| good(**w)).count() as f64 / choices.len() as f64
            };
            let (less, greater) = (share(&|w| w <= test.w_plus), share(&|w| w >= test.w_plus));
            assert!((test.p_less - less).abs() < 1e-12 && (test.p_greater - greater).abs() < 1e-12);
            assert!((test.p_two_sided - (2.0 * less.min(greater)).min(1.0)).abs() < 1e-12);
        }
    }
}

#[test]
fn mean_and_variance_with_ties_and_zeros_match_all_sign_choices() {
    let values = [0.0, 0.0, 1.0, -1.0, 2.0, 2.0, -2.0, 3.0, 5.0, -5.0, 8.0];
    for (zeros, ranks) in [
        (Zeros::Wilcoxon, vec![1.5, 1.5, 4.0, 4.0, 4.0, 6.0, 7.5, 7.5, 9.0]),
        (Zeros::Pratt, vec![3.5, 3.5, 6.0, 6.0, 6.0, 8.0, 9.5, 9.5, 11.0]),
    ] {
        let test = of_differences(&values, Options { zeros, continuity: false }).unwrap();
        assert_eq!((test.zeros, test.used, test.method), (2, 9, Method::Normal));
        assert!((test.w_plus + test.w_minus - ranks.iter().sum::<f64>()).abs() < 1e-12);
        let choices = all_choices(&ranks);
        let count = choices.len() as f64;
        let mean = choices.iter().sum::<f64>() / count;
        let variance = choices.iter().map(|w| (w - mean) * (w - mean)).sum::<f64>() / count;
        let z = (test.w_plus - mean).abs() / math::sqrt(variance);
        let p = math::erfc(z / core::f64::consts::SQRT_2);
        assert!((test.p_two_sided - p).abs() < 1e-12, "{zeros:?}: {test:?}, {p}");
    }
}

#[test]
fn tie_correction_matches_the_textbook() {
    // The variance is n (n + 1) (2 n + 1) / 24 minus the sum of (t^3 - t) / 48 over all ties of t values.
    let values = [1.0, 1.0, 1.0, -2.0, 2.0, 4.0, -5.0, 5.0, 5.0, 5.0];
    let test = of_differences(&values, Options::default()).unwrap();
    let variance = 10.0 * 11.0 * 21.0 / 24.0 - (24.0 + 6.0 + 60.0) / 48.0;
    let p = math::erfc((test.w_plus - 27.5).abs() / math::sqrt(variance) / core::f64::consts::SQRT_2);
    assert!((test.p_two_sided - p).abs() < 1e-14);
}

#[test]
fn normal_approximation_starts_at_51_pairs_and_is_close_to_the_exact_p() {
    let differences = |n: i32| -> Vec<f64> {
        (1..=n).map(|k| if k % 3 == 0 { -f64::from(k) } else { f64::from(k) }).collect()
    };
    let at = |n, continuity| {
        of_differences(&differences(n), Options { continuity, ..Options::default() }).unwrap()
    };
    assert_eq!((at(50, true).method, at(51, true).method), (Method::Exact, Method::Normal));
    let ranks = || (1..=50).map(f64::from);
    let exact = at(50, true);
    let close = normal(ranks(), exact.w_plus, true);
    assert!((close[0] - exact.p_two_sided).abs() < 1e-3, "{close:?} {exact:?}");
    assert!(at(60, true).p_two_sided > at(60, false).p_two_sided);
}

#[test]
fn sign_choices_of_50_pairs_are_counted_exactly() {
    let counts = sign_choices(50);
    assert_eq!(
        counts.iter().sum::<f64>().to_bits(),
        (2.0_f64 * f64::from(1 << 29) * f64::from(1 << 20)).to_bits()
    );
    assert!(counts.iter().zip(counts.iter().rev()).all(|(a, b)| a.to_bits() == b.to_bits()));
}

#[test]
fn swapping_the_pairs_swaps_w_plus_and_w_minus() {
    let (left, right) = ([1.0, 2.5, 3.0, 9.0, 4.0], [1.1, 2.0, 1.0, 3.0, 4.9]);
    let test = of_pairs(&left, &right, Options::default()).unwrap();
    let swapped = of_pairs(&right, &left, Options::default()).unwrap();
    assert_eq!(test.w_plus.to_bits(), swapped.w_minus.to_bits());
    assert_eq!(test.p_two_sided.to_bits(), swapped.p_two_sided.to_bits());
    assert_eq!(test.p_less.to_bits(), swapped.p_greater.to_bits());
}

#[test]
fn input_without_ranks_is_refused() {
    let refused = |values: &[f64]| of_differences(values, Options::default()).err();
    assert_eq!(refused(&[]), Some(WilcoxonError::NoDifference));
    assert_eq!(refused(&[0.0, -0.0]), Some(WilcoxonError::NoDifference));
    assert_eq!(refused(&[1.0, f64::NAN]), Some(WilcoxonError::NotFinite { index: 1 }));
    let lengths = of_pairs(&[1.0], &[], Options::default()).err();
    assert_eq!(lengths, Some(WilcoxonError::Lengths { left: 1, right: 0 }));
    let one = of_differences(&[3.0], Options::default()).unwrap();
    assert_eq!((one.w_plus.to_bits(), one.p_two_sided.to_bits()), (1.0_f64.to_bits(), 1.0_f64.to_bits()));
}
