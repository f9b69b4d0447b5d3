//! Separates packets that were dropped before the loop from all other losses of a log.

/// Splits a log's losses. Returns the number of packets that the lines dropped, and all other losses.
pub(crate) fn apart(losses: &[String]) -> (u64, Vec<&String>) {
    let (dropped, others): (Vec<&String>, Vec<&String>) =
        losses.iter().partition(|loss| loss.contains(" dropped by the kernel or a full queue"));
    let count = |loss: &String| loss.split(" packets ").next()?.rsplit(' ').next()?.parse::<u64>().ok();
    (dropped.into_iter().filter_map(count).sum(), others)
}
