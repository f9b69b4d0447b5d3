//! Separates drops before the loop from a log's other losses.

/// Splits a log's losses into the number of packets dropped by lines, and all others.
pub(crate) fn apart(losses: &[String]) -> (u64, Vec<&String>) {
    let (dropped, others): (Vec<&String>, Vec<&String>) =
        losses.iter().partition(|loss| loss.contains(" dropped by the kernel or a full queue"));
    let count = |loss: &String| loss.split(" packets ").next()?.rsplit(' ').next()?.parse::<u64>().ok();
    (dropped.into_iter().filter_map(count).sum(), others)
}
