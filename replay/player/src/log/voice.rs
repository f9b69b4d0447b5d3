//! Voice recordings in a log: passes them from the operator's page to the recorder, and reads them back.
//!
//! A message of `/notes/voice` contains, in little-endian order: u32 id of the note, u32 seconds, u16 length of the
//! media type, the media type, and the recording as the browser made it. The message has its own chunk, so damage to it
//! affects nothing else.
//!
//! A replay doesn't read voice messages, because the operator's commands contain everything that the loop needs.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use headrace_geometry::time::MonoNs;
use headrace_monitor::voice::{Container, Voice, VoiceError};

use super::dive_log::DiveLog;
use super::error::LogError;
use super::fields::Fields;
use super::queue::State;
use super::reader::MessageKind;

/// Reason why a voice recording isn't accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotKept {
    /// The medium fails, or the recorder has already ended.
    #[error("the voice note isn't recorded: nothing is being recorded at present")]
    Failing,
    /// The queue of recordings is full.
    #[error("the voice note isn't recorded: others are still being written; send it again")]
    Full,
}

/// Reason why a message isn't a valid voice recording.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum VoiceMessageError {
    /// The message is shorter than the fields at its beginning.
    #[error("a voice message of {0} bytes is too short for its header")]
    Short(usize),
    /// The recording in the message is invalid.
    #[error(transparent)]
    Voice(#[from] VoiceError),
}

/// Accepts recordings of voice notes from any thread.
#[derive(Clone)]
pub struct VoicePort {
    pub(super) state: Arc<State>,
}

impl VoicePort {
    /// Passes a recording to the log, without blocking.
    ///
    /// The recording is as safe as sensor data. It is written within a second. If the medium fails, the recording is
    /// written again to another part.
    ///
    /// Errors: see [`NotKept`]; the recording was not accepted.
    pub fn keep(&self, voice: &Voice) -> Result<(), NotKept> {
        if self.state.failing.load(Ordering::Acquire) || self.state.voices_end.load(Ordering::SeqCst) {
            return Err(NotKept::Failing);
        }
        self.state.voices.push(encode(voice)).map_err(|_| NotKept::Full)?;
        // The recorder sets this flag before it looks at the queue for the last time. If the flag is unset, the
        // recorder is still going to take this recording from the queue.
        if self.state.voices_end.load(Ordering::SeqCst) { Err(NotKept::Failing) } else { Ok(()) }
    }
}

/// Encodes a recording as a message.
pub fn encode(voice: &Voice) -> Vec<u8> {
    let media_type = voice.container.media_type().as_bytes();
    let mut message = Vec::with_capacity(10 + media_type.len() + voice.audio.len());
    message.extend(voice.id.to_le_bytes());
    message.extend(voice.seconds.to_le_bytes());
    message.extend(u16::try_from(media_type.len()).unwrap_or(0).to_le_bytes());
    message.extend(media_type);
    message.extend(&voice.audio);
    message
}

/// Decodes a message. The recording must pass the checks that the page applies to it, because a log may come from
/// anywhere.
///
/// Errors: see [`VoiceMessageError`].
pub fn decode(message: &[u8]) -> Result<Voice, VoiceMessageError> {
    let parts = || {
        let mut fields = Fields::new(message);
        let (id, seconds, len) = (fields.u32()?, fields.u32()?, fields.u16()?);
        Some((id, seconds, fields.take(len.into())?, fields.rest()))
    };
    let (id, seconds, media_type, audio) = parts().ok_or(VoiceMessageError::Short(message.len()))?;
    let media_type = String::from_utf8_lossy(media_type);
    let container = Container::of_media_type(&media_type)
        .ok_or_else(|| VoiceError::Type(media_type.chars().take(40).collect()))?;
    Ok(Voice { id, seconds, container, audio: audio.to_vec() }.checked()?)
}

/// Finds the recording of a note in a log. `from` is the time of the note, and its recording isn't earlier.
///
/// Returns `None` if the log has no readable recording of the note.
///
/// Errors: the log can't be read.
pub fn find_voice(files: &[PathBuf], id: u32, from: MonoNs) -> Result<Option<Voice>, LogError> {
    let mut log = DiveLog::open(files)?;
    if !log.has_voices() {
        return Ok(None);
    }
    log.pass_before(from)?;
    while let Some(message) = log.next()? {
        if message.kind == MessageKind::Voice
            && let Ok(voice) = decode(message.data)
            && voice.id == id
        {
            return Ok(Some(voice));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn voice(audio: &[u8]) -> Voice {
        Voice { id: 258, seconds: 12, container: Container::Ogg, audio: audio.to_vec() }
    }

    #[test]
    fn voice_message_has_the_documented_layout() {
        let message = encode(&voice(b"OggS.."));
        assert_eq!(message[..10], [2, 1, 0, 0, 12, 0, 0, 0, 9, 0]);
        assert_eq!(&message[10..], b"audio/oggOggS..");
        assert_eq!(decode(&message), Ok(voice(b"OggS..")));
    }

    #[test]
    fn invalid_voice_messages_give_specific_errors() {
        let message = encode(&voice(b"OggS"));
        assert_eq!(decode(&message[..9]), Err(VoiceMessageError::Short(9)));
        assert_eq!(decode(&message[..18]), Err(VoiceMessageError::Short(18)));
        let html = [&message[..8], &[9, 0], b"text/html", b"<script>"].concat();
        assert_eq!(decode(&html), Err(VoiceError::Type("text/html".to_owned()).into()));
        let disguised = [&message[..19], b"<script>"].concat();
        assert_eq!(decode(&disguised), Err(VoiceError::Contents("audio/ogg").into()));
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_decode_to_a_valid_voice_recording_or_an_error(bytes: Vec<u8>) {
            if let Ok(voice) = decode(&bytes) {
                prop_assert_eq!(voice.checked().map(|voice| encode(&voice).len()), Ok(bytes.len()));
            }
        }
    }
}
