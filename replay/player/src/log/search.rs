//! Searches a damaged file byte by byte for the next intact records.

use std::io::{Read, Seek};

use mcap::records::op;

use super::error::LogError;
use super::framing::{Found, Frame, Item, LogFile, look};

/// Number of consecutive records after which a position is accepted.
const CHAIN: usize = 3;
/// Number of bytes searched at once.
const SEARCH_BYTES: usize = 64 * 1024;

/// Returns the first position in `from..until` at which consecutive records begin.
///
/// Bytes before a record may look like another record whose length happens to end at a record boundary. A position with
/// an unconfirmed length is therefore accepted only if no records lie within that length.
pub(super) fn find_records<R: Read + Seek>(
    file: &mut LogFile<R>,
    from: u64,
    until: u64,
) -> Result<Option<u64>, LogError> {
    let mut first = find_chain(file, from, until)?;
    while let Some(Chain { at, end, confirmed: false }) = first {
        let Some(inner) = find_chain(file, at + 1, end.min(until))? else { break };
        first = Some(inner);
    }
    Ok(first.map(|chain| chain.at))
}

/// The first of several consecutive records found after damage.
struct Chain {
    at: u64,
    end: u64,
    confirmed: bool,
}

/// Returns the first position in `from..until` at which a log begins: the magic bytes and a header record.
pub(super) fn find_log<R: Read + Seek>(
    file: &mut LogFile<R>,
    from: u64,
    until: u64,
) -> Result<Option<u64>, LogError> {
    find(file, from, until, |file, head, at| {
        let is_log = head == mcap::MAGIC
            && matches!(
                look(file, at + mcap::MAGIC.len() as u64)?,
                Found::Record(Frame { item: Item::Header { .. }, .. })
            );
        Ok(is_log.then_some(at))
    })
}

fn find_chain<R: Read + Seek>(
    file: &mut LogFile<R>,
    from: u64,
    until: u64,
) -> Result<Option<Chain>, LogError> {
    find(file, from, until, |file, head, at| if may_begin(head) { chain_at(file, at) } else { Ok(None) })
}

/// Calls `examine` with the eight bytes at each position in `from..until`, and returns its first result.
fn find<R: Read + Seek, T>(
    file: &mut LogFile<R>,
    from: u64,
    until: u64,
    examine: impl Fn(&mut LogFile<R>, &[u8], u64) -> Result<Option<T>, LogError>,
) -> Result<Option<T>, LogError> {
    // Each position is examined together with the seven bytes after it. No more bytes are read than that, because many
    // short ranges may be searched.
    let after = mcap::MAGIC.len() - 1;
    let block_bytes = |start: u64| {
        usize::try_from(until - start).map_or(SEARCH_BYTES, |len| SEARCH_BYTES.min(len.saturating_add(after)))
    };
    let mut block = vec![0; block_bytes(from.min(until))];
    let mut start = from;
    while start < until.min(file.len()) {
        block.truncate(block_bytes(start));
        let got = file.read_at(start, &mut block)?;
        let bytes = block.get(..got).unwrap_or_default();
        for (at, head) in (start..until).zip(bytes.windows(mcap::MAGIC.len())) {
            if let Some(found) = examine(file, head, at)? {
                return Ok(Some(found));
            }
        }
        // Positions whose eight bytes cross the end of this block are examined with the next block.
        let whole_windows = got.saturating_sub(after);
        if whole_windows == 0 {
            break;
        }
        start += whole_windows as u64;
    }
    Ok(None)
}

/// Whether a record may begin with these bytes. This quick check rejects nearly every position.
///
/// It requires a known opcode and a length below 2^32, or the closing bytes.
fn may_begin(head: &[u8]) -> bool {
    match head {
        [1..=op::DATA_END, _, _, _, _, 0, 0, 0] => true,
        _ => head == mcap::MAGIC,
    }
}

fn chain_at<R: Read + Seek>(file: &mut LogFile<R>, from: u64) -> Result<Option<Chain>, LogError> {
    let mut chain = Chain { at: from, end: from, confirmed: true };
    let mut at = from;
    for link in 0..CHAIN {
        let follows = match look(file, at)? {
            Found::Record(frame) => {
                if link == 0 {
                    (chain.end, chain.confirmed) = (frame.end, frame.confirmed);
                }
                if frame.confirmed && matches!(frame.item, Item::Chunk(_)) {
                    return Ok(Some(chain));
                }
                at = frame.end;
                continue;
            }
            Found::Cut(frame) => frame.confirmed && matches!(frame.item, Item::Chunk(_)),
            Found::Closing => at.saturating_add(mcap::MAGIC.len() as u64) == file.len(),
            Found::End => at != from,
            Found::Nothing => false,
        };
        return Ok(follows.then_some(chain));
    }
    Ok(Some(chain))
}
