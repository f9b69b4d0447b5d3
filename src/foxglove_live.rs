//! `--foxglove`: sends the messages for viewers, which a recording also has, while the dive runs, with Foxglove's own
//! server.
//!
//! A separate thread builds the messages, like the recorder's thread for a log. The loop's thread only copies the
//! results of each tick.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crossbeam::channel::{Receiver, RecvTimeoutError, Sender, bounded};
use foxglove::websocket::{
    PlaybackCommand as Asked, PlaybackControlRequest, PlaybackState, PlaybackStatus, ServerListener,
};
use foxglove::{
    ChannelBuilder, Context, PartialMetadata, RawChannel, Schema, WebSocketServer, WebSocketServerHandle,
};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::run::Loop;
use headrace_replay::log::DerivedChannels as _;
use headrace_replay::playback::PlaybackCommand;
use headrace_replay::record::{result_channels, result_messages};
use headrace_replay::view::{Site, View};

use crate::failure::Failure;
use crate::follower::Follower;

/// Maximum number of ticks whose results wait for the server's thread. It corresponds to about ten seconds at
/// 50 ticks a second.
const WAITING: usize = 512;
/// Time limit for the server to close its connections.
const ENDS_WITHIN: Duration = Duration::from_millis(500);
/// Interval at which the server's thread checks the flag of Ctrl-C.
const WAIT: Duration = Duration::from_millis(200);

/// A replay that Foxglove may control.
pub(crate) struct Controlled {
    pub(crate) commands: Sender<PlaybackCommand>,
    /// The log's first and last time.
    pub(crate) span: (MonoNs, MonoNs),
    pub(crate) speed: Option<f64>,
    /// Flag that Ctrl-C sets.
    pub(crate) interrupted: Arc<AtomicBool>,
}

enum Message {
    /// Time of a tick, and its results as channel and message.
    Results(MonoNs, Vec<(u16, Vec<u8>)>),
    /// Time at which a replay has paused, jumped or ended, and whether it has ended.
    Stopped(MonoNs, bool),
}

/// The follower that serves Foxglove.
pub(crate) struct Foxglove {
    results: Option<Sender<Message>>,
    thread: Option<JoinHandle<()>>,
    is_live: bool,
    dropped: u64,
}

impl Foxglove {
    /// Starts to serve at an address of this machine.
    ///
    /// Errors: the address belongs to another machine or is taken, or a thread can't be started.
    pub(crate) fn start(
        at: SocketAddr,
        vehicle: &str,
        site: Site,
        is_live: bool,
        controlled: Option<Controlled>,
    ) -> Result<Self, Failure> {
        if !at.ip().is_loopback() {
            let why = "everyone who reaches this address sees the dive without a token; \
                       use 127.0.0.1 and connect over ssh";
            return Err(Failure::Usage(format!("--foxglove {at}: {why}")));
        }
        let context = Context::new();
        let mut server = WebSocketServer::new()
            .name(format!("headrace: {vehicle}"))
            .bind(at.ip().to_string(), at.port())
            .context(&context);
        if let Some(controlled) = &controlled {
            let listener = Listener { commands: controlled.commands.clone(), begun: controlled.span.0 };
            server = server
                .playback_time_range(controlled.span.0.0, controlled.span.1.0)
                .listener(Arc::new(listener));
        }
        let failed = |error: &dyn core::fmt::Display| {
            Failure::Usage(format!(
                "--foxglove {at}: {error}; another program may use the port, choose another one"
            ))
        };
        let handle = server.start_blocking().map_err(|error| failed(&error))?;
        let channels = channels(&context).map_err(|error| failed(&error))?;
        tracing::info!(url = %handle.app_url(), "serving Foxglove");
        let (sender, messages) = bounded(WAITING);
        let serve = move || {
            Server {
                handle,
                channels,
                view: View::new(site.clone()),
                site,
                controlled,
                made: Vec::new(),
                _context: context,
            }
            .serve(&messages);
        };
        let source = thread::Builder::new().name("foxglove".to_owned()).spawn(serve);
        let thread =
            source.map_err(|source| Failure::System { what: "starting Foxglove's thread", source })?;
        Ok(Self { results: Some(sender), thread: Some(thread), is_live, dropped: 0 })
    }

    /// Hands a message to the server's thread. In a live dive, messages that find no room in the queue are
    /// dropped and counted.
    fn send(&mut self, message: Message) {
        let Some(results) = &self.results else { return };
        if self.is_live {
            self.dropped += u64::from(results.try_send(message).is_err());
        } else {
            results.send(message).ok();
        }
    }

    fn end_serving(&mut self) {
        drop(self.results.take());
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("Foxglove's thread has ended early");
        }
        if core::mem::take(&mut self.dropped) > 0 {
            tracing::warn!("Foxglove couldn't keep up: parts of the dive were not sent");
        }
    }
}

/// Channels for viewers. The index is the number of the result channel.
fn channels(context: &Arc<Context>) -> Result<Vec<Option<Arc<RawChannel>>>, foxglove::FoxgloveError> {
    let channel = |channel: headrace_replay::log::ResultChannel| {
        if channel.schema.is_empty() {
            return Ok(None);
        }
        let schema = Schema::new(channel.schema_name, channel.schema_encoding, channel.schema.into_bytes());
        let built =
            ChannelBuilder::new(channel.topic).message_encoding(channel.message_encoding).schema(schema);
        built.context(context).build_raw().map(Some)
    };
    result_channels().into_iter().map(channel).collect()
}

impl Follower for Foxglove {
    fn tick(&mut self, dive: &Loop) {
        let results = result_messages(dive);
        if !results.is_empty() {
            self.send(Message::Results(dive.now(), results));
        }
    }

    fn stopped(&mut self, dive: &Loop, _: DurNs, ended: bool) {
        self.send(Message::Stopped(dive.now(), ended));
    }

    fn end(&mut self, _: &Loop) {
        self.end_serving();
    }
}

impl Drop for Foxglove {
    fn drop(&mut self) {
        self.end_serving();
    }
}

/// State of the thread that serves Foxglove.
struct Server {
    handle: WebSocketServerHandle,
    channels: Vec<Option<Arc<RawChannel>>>,
    view: View,
    site: Site,
    controlled: Option<Controlled>,
    made: Vec<headrace_replay::log::Made>,
    _context: Arc<Context>,
}

impl Server {
    fn serve(mut self, messages: &Receiver<Message>) {
        loop {
            match messages.recv_timeout(WAIT) {
                Ok(Message::Results(at, results)) => {
                    for (channel, message) in results {
                        self.view.take(channel, at, &message, &mut self.made);
                    }
                    self.show();
                }
                Ok(Message::Stopped(at, ended)) => self.stopped(at, ended),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if let Some(controlled) = &self.controlled
                && controlled.interrupted.load(Ordering::Relaxed)
            {
                controlled.commands.send(PlaybackCommand::End).ok();
            }
        }
        self.view.end(&mut self.made);
        self.show();
        // The wait gives messages that are being sent some time to arrive.
        thread::sleep(ENDS_WITHIN);
        drop(self.handle.stop());
    }

    fn show(&mut self) {
        for made in self.made.drain(..) {
            if let Some(Some(channel)) = self.channels.get(usize::from(made.channel)) {
                channel.log_with_meta(&made.bytes, PartialMetadata::with_log_time(made.at.0));
            }
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "Foxglove's speeds are of single precision")]
    fn stopped(&mut self, at: MonoNs, ended: bool) {
        // After a jump, the samples placed before it are no longer valid.
        self.view = View::new(self.site.clone());
        let Some(controlled) = &self.controlled else { return };
        self.handle.broadcast_playback_state(PlaybackState {
            status: if ended { PlaybackStatus::Ended } else { PlaybackStatus::Paused },
            current_time: at.0,
            playback_speed: controlled.speed.unwrap_or(1.0) as f32,
            did_seek: true,
            request_id: None,
        });
    }
}

/// Converts Foxglove's controls to commands of playback.
struct Listener {
    commands: Sender<PlaybackCommand>,
    begun: MonoNs,
}

impl ServerListener for Listener {
    fn on_playback_control_request(&self, request: PlaybackControlRequest) -> Option<PlaybackState> {
        let speed = f64::from(request.playback_speed);
        if speed > 0.0 {
            self.commands.send(PlaybackCommand::Speed(Some(speed))).ok()?;
        }
        let (command, status) = match request.playback_command {
            Asked::Play => (PlaybackCommand::Go, PlaybackStatus::Playing),
            Asked::Pause => (PlaybackCommand::Pause, PlaybackStatus::Paused),
        };
        if let Some(to) = request.seek_time {
            self.commands.send(PlaybackCommand::Seek(MonoNs(to))).ok()?;
        }
        self.commands.send(command).ok()?;
        Some(PlaybackState {
            status,
            current_time: request.seek_time.unwrap_or(self.begun.0),
            playback_speed: request.playback_speed,
            did_seek: request.seek_time.is_some(),
            request_id: Some(request.request_id),
        })
    }
}
