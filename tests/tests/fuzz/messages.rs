//! Reads the messages of a log, even of a damaged one.

use std::collections::BTreeMap;
use std::io::Cursor;

use headrace_replay::log::{LogReader, MessageKind};

/// Messages of a log. The key is a message's time and content; the value tells how often the message occurs.
pub(crate) type Said = BTreeMap<(u64, Vec<u8>), u32>;

/// Reads a log. Returns its messages, and whether the log is reported as complete. Errors: the file isn't a log.
pub(crate) fn said(bytes: &[u8]) -> Result<(Said, bool), String> {
    let mut log =
        LogReader::new(Cursor::new(bytes.to_vec()), "log".to_owned()).map_err(|error| error.to_string())?;
    let mut said = Said::new();
    while let Some(message) = log.next().map_err(|error| error.to_string())? {
        if matches!(message.kind, MessageKind::Raw { .. }) {
            *said.entry((message.log_time.0, message.data.to_vec())).or_default() += 1;
        }
    }
    for loss in log.losses() {
        assert!(!loss.to_string().is_empty());
    }
    Ok((said, log.losses().is_empty()))
}
