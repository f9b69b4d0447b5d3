//! Identifies the device on a line by queries.

use std::io;
use std::time::Duration;

use headrace_geometry::time::DurNs;
use headrace_sensor::connect::Connect;
use headrace_sensor::driver::Probe;

use crate::clock;
use crate::diagnosis;
use crate::lines::{self, Line, READ_BYTES};
use crate::open_error::OpenError;

/// Time to wait for an answer to each query.
const ANSWER_TIME: DurNs = DurNs::from_millis(400);

/// Result of a probe.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Answer {
    /// Identity reported by a device.
    Is(String),
    /// Number of received bytes; no probe recognised them.
    Unknown(u64),
    /// No bytes were received.
    Silence,
}

/// Opens a line and queries each kind of device in turn, until one identifies itself.
///
/// A query without an answer takes 0.4 s.
///
/// Errors: the line can't be opened, or fails; the error states the fix.
pub fn probe(connect: &Connect, probes: &mut [Box<dyn Probe>]) -> Result<Answer, OpenError> {
    let _span = tracing::info_span!("probe", address = %connect).entered();
    tracing::info!(kinds = probes.len(), "probing");
    let mut line = lines::open(connect)?;
    let mut unknown = 0;
    for probe in probes {
        let asked = ask(line.as_mut(), probe.as_mut(), &mut unknown);
        if let Some(identity) = asked.map_err(|error| diagnosis::probing(&connect.to_string(), &error))? {
            tracing::info!(identity, "device identified");
            return Ok(Answer::Is(identity));
        }
    }
    Ok(if unknown > 0 { Answer::Unknown(unknown) } else { Answer::Silence })
}

fn ask(line: &mut dyn Line, probe: &mut dyn Probe, bytes: &mut u64) -> io::Result<Option<String>> {
    let mut buffer = [0; READ_BYTES];
    for question in probe.questions() {
        line.write(&question)?;
        let until = clock::now() + ANSWER_TIME;
        loop {
            let left = until.since(clock::now());
            if left.0 <= 0 {
                break;
            }
            let Some((_, count)) = line.read(clock::duration(left).max(SHORTEST), &mut buffer)? else {
                continue;
            };
            *bytes += count as u64;
            probe.heard(buffer.get(..count).unwrap_or_default());
            if let Some(identity) = probe.identity() {
                return Ok(Some(identity));
            }
        }
    }
    Ok(None)
}

/// Shortest wait for bytes. It isn't zero, because a timeout of zero means no timeout.
const SHORTEST: Duration = Duration::from_millis(1);
