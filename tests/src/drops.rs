//! What a log says was dropped before the loop could take it.

/// A log's losses as two: how many packets lines dropped, and the other losses.
pub(crate) fn apart(losses: &[String]) -> (u64, Vec<&String>) {
    let (dropped, others): (Vec<&String>, Vec<&String>) =
        losses.iter().partition(|loss| loss.contains(" dropped before the program took them"));
    let count = |loss: &String| loss.split(" packets ").next()?.rsplit(' ').next()?.parse::<u64>().ok();
    (dropped.into_iter().filter_map(count).sum(), others)
}
