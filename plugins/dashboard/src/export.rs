//! Exports a dive as one file: the page together with all data that a server sends during a dive.

use std::io::{self, Write as _};
use std::thread::JoinHandle;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use headrace_monitor::run::Loop;
use headrace_monitor::voice::Voice;
use serde_json::{Map, Value, json};
use sha2::{Digest as _, Sha256};
use tokio::sync::mpsc;

use crate::assets;
use crate::collector::{Collector, WAITING};
use crate::fed::Fed;
use crate::model::Model;
use crate::site::{May, Site};
use crate::wire::sample_frame;

/// Maximum number of samples in an exported file. A dive with more samples is thinned.
const MOST_SAMPLES: usize = 500_000;
/// Maximum number of live states in an exported file: one per second for two hours. Longer dives keep every
/// second state, every fourth, and so on.
const MOST_STATES: usize = 7200;
/// Attribute that marks the embedded dive in an exported page.
pub const MARK: &str = "id=\"dive\"";
/// Fields of a live state that an exported file omits. They are stored once elsewhere in the file, or have no meaning
/// in a file.
const LEFT_OUT: [&str; 8] =
    ["type", "seq", "alert_list", "playback", "ended", "page_dropped", "rates", "recording"];

/// Reason why a dive can't be exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The export's thread can't be started.
    #[error("exporting a dive: its thread can't be started: {0}")]
    Thread(io::Error),
    /// The export's thread has panicked.
    #[error("exporting a dive: its thread has ended early")]
    Ended,
    /// The program was built without the page.
    #[error("exporting a dive: this program was built without its page")]
    NoPage,
    /// The dive's data can't be compressed.
    #[error("exporting a dive: {0}")]
    Pack(#[from] io::Error),
}

/// Collects a dive for an exported file.
pub struct Export {
    sender: mpsc::Sender<Fed>,
    thread: JoinHandle<Taken>,
}

/// Data of the dive, as the export's thread has collected it.
struct Taken {
    model: Model,
    states: States,
}

/// Live states of the dive, at most one per second.
struct States {
    every_s: f64,
    all: Vec<(f64, Map<String, Value>)>,
}

impl Export {
    /// Starts collecting a dive.
    ///
    /// Errors: the thread can't be started.
    pub fn start(site: Site) -> Result<Self, ExportError> {
        let (sender, mut fed) = mpsc::channel(WAITING);
        let take = move || {
            let mut taken = Taken {
                model: Model::new(site, "file".to_owned()),
                states: States { every_s: 1.0, all: Vec::new() },
            };
            taken.model.keep_whole();
            while let Some(one) = fed.blocking_recv() {
                taken.model.take(one);
                taken.states.take(&taken.model);
            }
            taken
        };
        let thread = std::thread::Builder::new().name("export".to_owned()).spawn(take);
        Ok(Self { sender, thread: thread.map_err(ExportError::Thread)? })
    }

    /// Returns a collector for a loop's results. The collector waits for room in the queue.
    pub fn collector(&self, dive: &Loop) -> Collector {
        Collector::new(self.sender.clone(), dive, true, false, None)
    }

    /// Returns the page with the dive. All collectors must have been dropped.
    ///
    /// `alerts` are all alerts of the dive, `voices` the recordings of the dive's notes, and `end` is the last message
    /// of the dive.
    ///
    /// Errors: see [`ExportError`].
    pub fn page(self, alerts: &Value, voices: &[Voice], end: &Value) -> Result<Vec<u8>, ExportError> {
        drop(self.sender);
        let taken = self.thread.join().map_err(|_| ExportError::Ended)?;
        let frames = taken.frames(alerts, voices, end)?;
        let page = with_policy(assets::single().ok_or(ExportError::NoPage)?).ok_or(ExportError::NoPage)?;
        let place = page.rfind("</body>").ok_or(ExportError::NoPage)?;
        let (before, after) = page.split_at(place);
        let dive = STANDARD.encode(frames);
        let text = format!(
            "{before}<script type=\"application/octet-stream;base64\" {MARK}>{dive}</script>\n{after}"
        );
        Ok(text.into_bytes())
    }
}

/// Adds a content security policy to the page, because a dive contains untrusted data.
///
/// The policy allows only the page's own scripts, and no network access.
fn with_policy(page: &str) -> Option<String> {
    let (head, rest) = page.split_at(page.find("<head>")? + "<head>".len());
    let hashes =
        scripts_of(page).map(|script| format!(" 'sha256-{}'", STANDARD.encode(Sha256::digest(script))));
    let hashes: String = hashes.collect();
    // The charts set inline styles, and voice notes play from blobs, so the policy allows both.
    Some(format!(
        "{head}\n<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src{hashes}; \
         style-src 'unsafe-inline'; img-src data: blob:; media-src data: blob:; connect-src 'none'; base-uri 'none'; \
         form-action 'none'\">{rest}"
    ))
}

/// Returns the texts of a page's inline scripts.
fn scripts_of(page: &str) -> impl Iterator<Item = &str> {
    page.split("<script")
        .skip(1)
        .filter_map(|script| Some(script.split_once('>')?.1.split_once("</script>")?.0))
}

impl Taken {
    /// Returns all messages and frames of the dive, compressed.
    fn frames(&self, alerts: &Value, voices: &[Voice], end: &Value) -> io::Result<Vec<u8>> {
        let model = &self.model;
        let mut packed = DeflateEncoder::new(Vec::new(), Compression::default());
        let mut put = |kind: u8, bytes: &[u8]| {
            let length = u32::try_from(bytes.len()).map_err(io::Error::other)?;
            packed.write_all(&length.to_le_bytes())?;
            packed.write_all(&[kind])?;
            packed.write_all(bytes)
        };
        let (samples, step) = model.samples().between(f32::NEG_INFINITY, f32::INFINITY, MOST_SAMPLES);
        let may = May { operate: false, playback: false };
        put(0, model.hello(may, false, (step > 1).then_some(step)).to_string().as_bytes())?;
        put(1, &model.sections_frame())?;
        put(1, &sample_frame(model.seq(), &samples))?;
        let mut texts = vec![json!({"type": "alerts", "list": alerts, "hidden": 0})];
        texts.extend(model.closing().into_iter().filter(|message| message["type"] != "alerts"));
        texts.extend(voices.iter().map(|voice| {
            json!({"type": "voice", "id": voice.id, "media_type": voice.container.media_type(),
                "audio": STANDARD.encode(&voice.audio)})
        }));
        texts.extend([self.states.timeline()]);
        texts.extend(model.state());
        texts.push(end.clone());
        for mut text in texts {
            if let Some(object) = text.as_object_mut() {
                object.insert("seq".to_owned(), model.seq().into());
            }
            put(0, text.to_string().as_bytes())?;
        }
        packed.finish()
    }
}

impl States {
    fn take(&mut self, model: &Model) {
        let Some(now_s) = model.now_s() else { return };
        if self.all.last().is_some_and(|(last_s, _)| now_s < last_s + self.every_s) {
            return;
        }
        let Some(Value::Object(mut state)) = model.state() else { return };
        state.retain(|key, _| !LEFT_OUT.contains(&key.as_str()));
        state.values_mut().for_each(short);
        self.all.push((now_s, state));
        if self.all.len() > MOST_STATES {
            self.every_s *= 2.0;
            let mut number = 0_usize;
            self.all.retain(|_| {
                number += 1;
                number % 2 == 1
            });
        }
    }

    /// Returns the timeline: the first state in full, and the differences of each later state from the first.
    fn timeline(&self) -> Value {
        let first = self.all.first().map(|(_, first)| first);
        let differs = |state: &Map<String, Value>| -> Map<String, Value> {
            let is_new =
                |(key, value): &(&String, &Value)| first.is_none_or(|first| first.get(*key) != Some(value));
            state.iter().filter(is_new).map(|(key, value)| (key.clone(), value.clone())).collect()
        };
        let others = self.all.iter().skip(1).map(|(_, state)| differs(state));
        let states: Vec<_> = first.cloned().into_iter().chain(others).collect();
        let t_s: Vec<_> = self.all.iter().map(|(at_s, _)| *at_s).collect();
        json!({"type": "timeline", "t_s": t_s, "states": states})
    }
}

/// Rounds all numbers in a JSON value to four decimal places.
fn short(value: &mut Value) {
    match value {
        Value::Number(number) if number.is_f64() => {
            let rounded = number.as_f64().map(|number| (number * 1e4).round() / 1e4);
            *value = json!(rounded);
        }
        Value::Array(all) => all.iter_mut().for_each(short),
        Value::Object(all) => all.values_mut().for_each(short),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exported_page_allows_only_its_own_script_and_no_network() {
        // The hash in this test is the hash of an empty text: `printf '' | openssl dgst -sha256 -binary | base64`.
        let page = with_policy("<html><head><title>t</title></head><script type=\"module\"></script></html>")
            .unwrap();
        let (before, after) = page.split_once("<title>").unwrap();
        assert!(after.ends_with("<script type=\"module\"></script></html>"));
        assert!(
            before.contains("script-src 'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU=';"),
            "{before}"
        );
        assert!(before.contains("default-src 'none'") && before.contains("connect-src 'none'"), "{before}");
    }

    #[test]
    fn built_page_scripts_have_no_carriage_return() {
        let Some(page) = assets::single() else { return };
        let scripts: Vec<_> = scripts_of(page).collect();
        assert!(!scripts.is_empty());
        // A browser converts carriage returns to line feeds before it computes the hash.
        assert!(scripts.iter().all(|script| !script.contains('\r')));
        assert!(!page.contains(" src=") && !page.contains("javascript:"), "nothing that the policy forbids");
    }
}
