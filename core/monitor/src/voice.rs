//! Recordings of voice notes: limits and formats. The monitoring loop handles only the notes. The recordings
//! go straight from the page to the log.

/// Maximum length of a voice recording, seconds.
pub const MAX_VOICE_S: u32 = 60;
/// Maximum size of a voice recording, bytes. A minute at 24 kbit/s takes 180 kB.
pub const MAX_VOICE_BYTES: usize = 512 << 10;

/// Container format of a voice recording. Browsers record Opus in WebM or Ogg, or AAC in MP4.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Container {
    /// WebM.
    Webm,
    /// Ogg.
    Ogg,
    /// MP4.
    Mp4,
}

impl Container {
    /// All allowed container formats, in order.
    pub const ALL: [Self; 3] = [Self::Webm, Self::Ogg, Self::Mp4];

    /// Container format for a media type, with or without parameters: `audio/webm;codecs=opus`. `None` if the
    /// type isn't allowed.
    pub fn of_media_type(text: &str) -> Option<Self> {
        let essence = text.split(';').next().unwrap_or_default().trim();
        Self::ALL.into_iter().find(|container| container.media_type().eq_ignore_ascii_case(essence))
    }

    /// Media type of the container format.
    pub fn media_type(self) -> &'static str {
        match self {
            Self::Webm => "audio/webm",
            Self::Ogg => "audio/ogg",
            Self::Mp4 => "audio/mp4",
        }
    }

    /// File extension of the container format.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Webm => "webm",
            Self::Ogg => "ogg",
            Self::Mp4 => "m4a",
        }
    }

    /// Whether bytes begin like a file of this container.
    ///
    /// Source: RFC 8794 section 11.2 (EBML), RFC 3533 section 6, ISO/IEC 14496-12 section 4.3.
    pub fn holds(self, bytes: &[u8]) -> bool {
        match self {
            Self::Webm => bytes.starts_with(&[0x1a, 0x45, 0xdf, 0xa3]),
            Self::Ogg => bytes.starts_with(b"OggS"),
            Self::Mp4 => bytes.get(4..8) == Some(b"ftyp".as_slice()),
        }
    }
}

/// The recording of a voice note.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Voice {
    /// Id of the note; not 0.
    pub id: u32,
    /// Length of the recording, seconds.
    pub seconds: u32,
    /// Container format of the audio.
    pub container: Container,
    /// Contents of the recording's audio file.
    pub audio: Vec<u8>,
}

/// Reason for refusing a recording of a voice note.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum VoiceError {
    /// The id of the recording is 0.
    #[error("a voice note has the id 0; expected 1 to 4294967295")]
    Id,
    /// The recording is too long or too short.
    #[error("a voice note of {0} s; expected 1 to {MAX_VOICE_S} s")]
    Seconds(u32),
    /// The recording is too large.
    #[error("a voice note of {0} bytes; at most {MAX_VOICE_BYTES} bytes are allowed")]
    Bytes(usize),
    /// The media type isn't allowed.
    #[error("a voice note of type {0:?}; expected audio/webm, audio/ogg or audio/mp4")]
    Type(String),
    /// The contents don't match the stated type.
    #[error("a voice note's bytes aren't {0} as its type states; send the file with its own type")]
    Contents(&'static str),
}

impl Voice {
    /// Checks the recording against the limits.
    ///
    /// Errors: the first violation.
    pub fn checked(self) -> Result<Self, VoiceError> {
        if self.id == 0 {
            return Err(VoiceError::Id);
        }
        if !(1..=MAX_VOICE_S).contains(&self.seconds) {
            return Err(VoiceError::Seconds(self.seconds));
        }
        if self.audio.len() > MAX_VOICE_BYTES {
            return Err(VoiceError::Bytes(self.audio.len()));
        }
        if !self.container.holds(&self.audio) {
            return Err(VoiceError::Contents(self.container.media_type()));
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn voice(audio: &[u8]) -> Voice {
        Voice { id: 7, seconds: 12, container: Container::Ogg, audio: audio.to_vec() }
    }

    #[test]
    fn only_recordings_in_allowed_containers_are_accepted() {
        for (text, container) in [
            ("audio/webm;codecs=opus", Some(Container::Webm)),
            (" Audio/OGG ; codecs=opus", Some(Container::Ogg)),
            ("audio/mp4", Some(Container::Mp4)),
            ("audio/webm2", None),
            ("video/webm", None),
            ("text/html", None),
            ("", None),
        ] {
            assert_eq!(Container::of_media_type(text), container, "{text:?}");
        }
        assert!(Container::Mp4.holds(b"\0\0\0\x20ftypM4A ") && !Container::Mp4.holds(b"ftypM4A "));
        assert!(Container::Webm.holds(&[0x1a, 0x45, 0xdf, 0xa3, 1]) && !Container::Webm.holds(b"OggS"));
    }

    #[test]
    fn voice_recording_error_names_the_violated_limit() {
        assert!(voice(b"OggS and so on").checked().is_ok());
        assert_eq!(Voice { id: 0, ..voice(b"OggS") }.checked(), Err(VoiceError::Id));
        assert_eq!(Voice { seconds: 61, ..voice(b"OggS") }.checked(), Err(VoiceError::Seconds(61)));
        assert_eq!(voice(b"<html>").checked(), Err(VoiceError::Contents("audio/ogg")));
        let mut long = b"OggS".to_vec();
        long.resize(MAX_VOICE_BYTES + 1, 0);
        assert_eq!(voice(&long).checked(), Err(VoiceError::Bytes(MAX_VOICE_BYTES + 1)));
    }
}
