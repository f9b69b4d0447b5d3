//! Reduces a failure to the fewest faults.

/// Returns some of the faults. Together they still make a test fail, but if any single one of them is left out, the
/// test succeeds.
///
/// `fails` tells whether the test fails with the given faults. With all faults together it must fail.
pub fn fewest<T: Clone>(faults: &[T], mut fails: impl FnMut(&[T]) -> bool) -> Vec<T> {
    let mut left = faults.to_vec();
    let mut number = 0;
    while number < left.len() {
        let mut fewer = left.clone();
        fewer.remove(number);
        if fails(&fewer) {
            (left, number) = (fewer, 0);
        } else {
            number += 1;
        }
    }
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failure_is_reduced_to_the_faults_that_it_needs() {
        let needed = |faults: &[u8]| faults.contains(&2) && (faults.contains(&5) || faults.contains(&7));
        assert_eq!(fewest(&[1, 2, 3, 5, 6, 7, 8], needed), [2, 7]);
        assert_eq!(fewest(&[1, 2, 3], |_| true), [0; 0]);
    }
}
