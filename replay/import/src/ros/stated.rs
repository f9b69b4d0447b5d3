//! Reads the number of messages that the summary of an MCAP file states.
//!
//! Source: MCAP format specification, "Footer" and "Statistics".

use std::io::{BufReader, Read, Result, Seek, SeekFrom};

const STATISTICS: u8 = 0x0B;
const FOOTER: u8 = 0x02;
const FOOTER_BYTES: u64 = 20;
/// Length of a record's opcode and length field, bytes.
const HEAD_BYTES: u64 = 9;
/// Length of the footer record and the closing magic, bytes.
const END_BYTES: u64 = HEAD_BYTES + FOOTER_BYTES + 8;
/// Maximum number of records skipped in a summary. A recording of a day has some thousands of chunks.
const MOST_RECORDS: usize = 100_000;

/// Returns the number of messages stated in a file of `bytes` bytes.
///
/// Returns `None` without a summary, or without statistics in it.
///
/// Errors: the file can't be read.
pub(super) fn stated_messages(file: &mut (impl Read + Seek), bytes: u64) -> Result<Option<u64>> {
    let Some(end) = bytes.checked_sub(END_BYTES) else { return Ok(None) };
    let mut file = BufReader::new(file);
    file.seek(SeekFrom::Start(end))?;
    let footer = head(&mut file)?;
    let mut at = number(&mut file)?;
    if footer != (FOOTER, FOOTER_BYTES) || at == 0 {
        return Ok(None);
    }
    file.seek(SeekFrom::Start(at.min(end)))?;
    for _ in 0..MOST_RECORDS {
        if at >= end {
            break;
        }
        let (opcode, len) = head(&mut file)?;
        if opcode == STATISTICS {
            return number(&mut file).map(Some);
        }
        at = at.saturating_add(HEAD_BYTES).saturating_add(len);
        let Some(skipped) = i64::try_from(len).ok().filter(|_| at < end) else { break };
        file.seek_relative(skipped)?;
    }
    Ok(None)
}

fn head(file: &mut impl Read) -> Result<(u8, u64)> {
    let mut opcode = [0];
    file.read_exact(&mut opcode)?;
    Ok((opcode[0], number(file)?))
}

fn number(file: &mut impl Read) -> Result<u64> {
    let mut bytes = [0; 8];
    file.read_exact(&mut bytes)?;
    Ok(u64::from_le_bytes(bytes))
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
        [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
    }

    fn stated(summary: &[u8], summary_at: u64) -> Option<u64> {
        let footer = record(FOOTER, &[&summary_at.to_le_bytes()[..], &[0; 12]].concat());
        let file = [&[0; 50][..], summary, &footer, b"\x89MCAP0\r\n"].concat();
        let bytes = file.len() as u64;
        stated_messages(&mut Cursor::new(file), bytes).unwrap()
    }

    #[test]
    fn stated_message_count_is_found_after_other_records() {
        let statistics = record(STATISTICS, &[&1234_u64.to_le_bytes()[..], &[0; 38]].concat());
        let other = record(0x08, &[7; 100]);
        assert_eq!(stated(&[&other[..], &other, &statistics].concat(), 50), Some(1234));
        assert_eq!(stated(&statistics, 50), Some(1234));
    }

    #[test]
    fn files_without_statistics_have_no_message_count() {
        let endless = [&[0x08][..], &u64::MAX.to_le_bytes(), &[7; 100]].concat();
        for (summary, at) in [(&record(0x08, &[7; 100])[..], 50), (&[], 0), (&endless, 50), (&[], u64::MAX)] {
            assert_eq!(stated(summary, at), None);
        }
        assert_eq!(stated_messages(&mut Cursor::new([0; 20]), 20).unwrap(), None);
        assert_eq!(stated_messages(&mut Cursor::new([0; 200]), 200).unwrap(), None);
    }
}
