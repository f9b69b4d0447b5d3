//! Serves one viewer of the feed over a WebSocket.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message as Frame, WebSocket, close_code};
use serde_json::{Value, json};
use tokio::sync::broadcast::error::RecvError;
use tokio::time::{Instant, sleep_until, timeout};

use super::budget::Budget;
use super::shared::{STALLED_AFTER, Shared};
use crate::access::Role;
use crate::command::{Asked, Command, LONGEST};
use crate::model::{Body, Message, Sort};
use crate::site::May;

/// Time from a viewer's pong to the next WebSocket ping, and timeout of a pong.
///
/// Pings and the timeout drop a stalled viewer within [`STALLED_AFTER`], even if its machine buffers the feed while the
/// viewer reads nothing.
const PING_EVERY: Duration = Duration::from_secs(2);
const ANSWERS_WITHIN: Duration = Duration::from_secs(8);
/// Minimum speed at which a viewer must read a long message, bytes per second. Slower viewers are dropped.
const SLOWEST_PER_S: f64 = 20_000.0;
/// Maximum number of messages read from a viewer after the server has closed the connection.
const MOST_AFTER_CLOSE: usize = 64;
/// Maximum rate of messages from a viewer, per second.
pub(super) const MOST_PER_S: f64 = 20.0;

/// Instance of the dive, and number of the last message that a viewer received before it lost its connection.
pub(super) struct Resume {
    pub(super) instance: String,
    pub(super) since: u64,
}

/// Counts a viewer while it is connected.
struct Counted(Arc<Shared>);

impl Counted {
    fn new(shared: Arc<Shared>) -> Self {
        shared.counts.viewers.fetch_add(1, Ordering::Relaxed);
        Shared::count(&shared.counts.served, 1);
        Self(shared)
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.counts.viewers.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Reason why the server stops serving a viewer.
enum Over {
    /// The viewer has disconnected.
    Gone,
    /// The viewer accepts no data.
    Stalled,
    /// The viewer sent a message that isn't allowed.
    Refused,
    /// The server of the page ends.
    Ended,
}

struct Viewer {
    socket: WebSocket,
    shared: Arc<Shared>,
    may: May,
    instance: String,
    /// Number of the latest message sent to the viewer.
    seq: u64,
    state_every: Duration,
    state_sent: Option<Instant>,
    budget: Budget,
    /// Time of the next WebSocket ping.
    ping_at: Instant,
    /// Deadline for the pong to the latest WebSocket ping; `None` if no pong is due.
    answer_by: Option<Instant>,
}

/// Serves a viewer until it disconnects.
pub(super) async fn serve(socket: WebSocket, shared: Arc<Shared>, role: Role, resume: Option<Resume>) {
    let _counted = Counted::new(Arc::clone(&shared));
    let may = may(&shared, role);
    let (instance, seq) = resume.map_or((String::new(), 0), |resume| (resume.instance, resume.since));
    let mut viewer = Viewer {
        socket,
        shared,
        may,
        instance,
        seq,
        state_every: Duration::ZERO,
        state_sent: None,
        budget: Budget::new(MOST_PER_S, MOST_PER_S),
        ping_at: Instant::now(),
        answer_by: None,
    };
    let (code, reason) = match viewer.watch().await {
        Over::Gone => return,
        Over::Stalled => {
            viewer.shared.count_stalled();
            return;
        }
        Over::Refused => (close_code::POLICY, "refused"),
        Over::Ended => (close_code::AWAY, "ended"),
    };
    let close = Frame::Close(Some(CloseFrame { code, reason: reason.into() }));
    // The viewer may already have disconnected. Otherwise, wait for its answer to the close frame, so that it reads all
    // data sent before. The number of messages read is limited, because a client may flood the server.
    let _closed = timeout(Duration::from_millis(500), async {
        if viewer.socket.send(close).await.is_ok() {
            for _ in 0..MOST_AFTER_CLOSE {
                if !matches!(viewer.socket.recv().await, Some(Ok(_))) {
                    return;
                }
            }
        }
    })
    .await;
}

/// Returns the rights of a role in this dive.
pub(super) fn may(shared: &Shared, role: Role) -> May {
    let model = shared.model();
    let operates = role == Role::Operator;
    May { operate: operates && model.site().takes_commands, playback: operates && model.site().is_playback }
}

impl Viewer {
    async fn watch(&mut self) -> Over {
        loop {
            // Subscribe under the model's lock, so that no message is missed or sent twice.
            let (messages, mut batches, instance) = {
                let model = self.shared.model();
                let Some(batches) = self.shared.fan().as_ref().map(tokio::sync::broadcast::Sender::subscribe)
                else {
                    return Over::Ended;
                };
                let instance = model.instance();
                let since = (self.instance == instance).then_some(self.seq);
                (model.catch_up(since, self.may, self.shared.access.tokens.is_some()), batches, instance)
            };
            self.instance = instance;
            for message in &messages {
                if let Err(over) = self.send(message).await {
                    return over;
                }
            }
            loop {
                tokio::select! {
                    batch = batches.recv() => match batch {
                        Ok(batch) => {
                            if self.has_jumped() {
                                break;
                            }
                            if let Err(over) = self.send_batch(&batch).await {
                                return over;
                            }
                        }
                        Err(RecvError::Lagged(_)) => {
                            Shared::count(&self.shared.counts.lagged, 1);
                            break;
                        }
                        Err(RecvError::Closed) => return Over::Ended,
                    },
                    message = self.socket.recv() => {
                        let Some(Ok(message)) = message else { return Over::Gone };
                        if let Err(over) = self.hear(message).await {
                            return over;
                        }
                    }
                    () = sleep_until(self.answer_by.unwrap_or(self.ping_at)) => {
                        if let Err(over) = self.ping().await {
                            return over;
                        }
                    }
                }
            }
        }
    }

    fn has_jumped(&self) -> bool {
        self.shared.model().instance() != self.instance
    }

    async fn send_batch(&mut self, batch: &[Message]) -> Result<(), Over> {
        for message in batch {
            if message.sort == Sort::State && !self.wants_state() {
                continue;
            }
            self.send(message).await?;
        }
        Ok(())
    }

    /// Whether the rate that the viewer requested allows another live state now.
    fn wants_state(&mut self) -> bool {
        let now = Instant::now();
        let is_due = self.state_sent.is_none_or(|sent| now.duration_since(sent) >= self.state_every);
        if is_due {
            self.state_sent = Some(now);
        }
        is_due
    }

    async fn send(&mut self, message: &Message) -> Result<(), Over> {
        let (frame, bytes) = match &message.body {
            Body::Text(text) => (Frame::Text(text.clone()), text.len()),
            Body::Binary(bytes) => (Frame::Binary(bytes.clone()), bytes.len()),
        };
        self.put(frame, bytes).await?;
        self.seq = self.seq.max(message.seq);
        Shared::count(&self.shared.counts.bytes, bytes as u64);
        Ok(())
    }

    async fn put(&mut self, frame: Frame, bytes: usize) -> Result<(), Over> {
        let began = Instant::now();
        let within = STALLED_AFTER + Duration::from_secs_f64(bytes as f64 / SLOWEST_PER_S);
        match timeout(within, self.socket.send(frame)).await {
            Ok(Ok(())) => {
                // The server reads no pongs while it sends. A slow connection delivers buffered data before a pong, so
                // the pong's deadline is extended.
                self.answer_by = self.answer_by.map(|by| by + began.elapsed());
                Ok(())
            }
            Ok(Err(_)) => Err(Over::Gone),
            Err(_) => Err(Over::Stalled),
        }
    }

    /// Sends a WebSocket ping. The viewer's pong shows that the viewer has read all earlier data.
    async fn ping(&mut self) -> Result<(), Over> {
        if self.answer_by.is_some() {
            return Err(Over::Stalled);
        }
        self.put(Frame::Ping(Bytes::new()), 0).await?;
        self.answer_by = Some(Instant::now() + ANSWERS_WITHIN);
        Ok(())
    }

    async fn answer(&mut self, value: &Value) -> Result<(), Over> {
        let text = value.to_string();
        let bytes = text.len();
        self.put(Frame::Text(text.into()), bytes).await
    }

    async fn hear(&mut self, message: Frame) -> Result<(), Over> {
        let text = match message {
            Frame::Text(text) => text,
            Frame::Ping(_) | Frame::Pong(_) => {
                if matches!(message, Frame::Pong(_)) && self.answer_by.take().is_some() {
                    self.ping_at = Instant::now() + PING_EVERY;
                }
                return if self.budget.take() {
                    Ok(())
                } else {
                    self.refuse("more than 20 messages per second").await
                };
            }
            Frame::Close(_) => return Err(Over::Gone),
            Frame::Binary(_) => return self.refuse("expected JSON text, not bytes").await,
        };
        if text.len() > LONGEST {
            return self.refuse(&format!("a message of {} bytes; at most {LONGEST}", text.len())).await;
        }
        if !self.budget.take() {
            return self.refuse("more than 20 messages per second").await;
        }
        match serde_json::from_str::<Value>(&text) {
            Ok(Value::Object(_)) => {}
            _ => return self.refuse("expected a JSON object").await,
        }
        match self.obey(&text) {
            Ok(done) => self.answer(&json!({"type": "done", "seq": self.seq, "do": done})).await,
            Err(why) => {
                Shared::count(&self.shared.counts.refused, 1);
                self.answer(&json!({"type": "refused", "seq": self.seq, "why": why})).await
            }
        }
    }

    fn obey(&mut self, text: &str) -> Result<&'static str, String> {
        match Asked::parse(text)? {
            Asked::Rate(hz) => {
                // The minimum interval is slightly shorter than the requested period, so that no state is skipped
                // because of jitter.
                self.state_every = Duration::from_secs_f64((0.9 / hz).max(0.0));
                Ok("rate")
            }
            Asked::Play(_) if !self.may.playback => {
                Err("this dive can't be paused, or the token is for viewing only".to_owned())
            }
            Asked::Play(play) => (self.shared.direct)(play).map(|()| "play"),
            Asked::Command(_) if !self.may.operate => {
                Err("not possible in this dive, or the token is for viewing only".to_owned())
            }
            Asked::Command(command) => {
                let done = command.word();
                let voice = if let Command::Voice { id, .. } = command { Some(id) } else { None };
                (self.shared.act)(command)?;
                if let Some(id) = voice {
                    self.shared.voices.begin(id);
                }
                Ok(done)
            }
        }
    }

    /// Refuses a message that this program's page never sends, and ends the connection.
    async fn refuse(&mut self, why: &str) -> Result<(), Over> {
        Shared::count(&self.shared.counts.refused, 1);
        self.answer(&json!({"type": "refused", "seq": self.seq, "why": why})).await?;
        Err(Over::Refused)
    }
}
