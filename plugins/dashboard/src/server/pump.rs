//! Takes messages from the loop, encodes each one once and sends it to all viewers.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::{Instant, sleep_until};

use super::shared::Shared;
use crate::fed::Fed;
use crate::model::Message;

/// Minimum interval between message batches without urgent data: five a second, with a tolerance for early
/// updates.
const BATCH_EVERY: Duration = Duration::from_millis(190);
/// Interval at which the live state is sent again if there is no new one, as in a paused replay.
const AGAIN_AFTER: Duration = Duration::from_secs(2);

/// Passes messages from the loop to the viewers until the page ends.
pub(super) async fn pump(mut fed: mpsc::Receiver<Fed>, shared: Arc<Shared>) {
    let (mut flushed, mut is_due) = (Instant::now(), false);
    let mut is_open = true;
    loop {
        let wake = if is_due { flushed + BATCH_EVERY } else { flushed + AGAIN_AFTER };
        tokio::select! {
            one = fed.recv(), if is_open => match one {
                Some(one) => {
                    let is_urgent = take(one, &mut fed, &shared);
                    is_due = true;
                    if is_urgent || flushed.elapsed() >= BATCH_EVERY {
                        flush(&shared);
                        (flushed, is_due) = (Instant::now(), false);
                    }
                }
                None => is_open = false,
            },
            () = sleep_until(wake) => {
                if is_due {
                    flush(&shared);
                } else {
                    again(&shared);
                }
                (flushed, is_due) = (Instant::now(), false);
            }
            () = shared.stop.notified() => {
                while let Ok(one) = fed.try_recv() {
                    shared.model().take(one);
                }
                flush(&shared);
                return;
            }
        }
        if shared.has_ended.load(Ordering::Relaxed) && !is_open {
            flush(&shared);
            return;
        }
        // Lets viewers run even while a replay sends data as fast as it can.
        tokio::task::yield_now().await;
    }
}

/// Applies a message, and all messages that follow it in the queue, to the model. Returns whether any of them is
/// urgent.
fn take(one: Fed, fed: &mut mpsc::Receiver<Fed>, shared: &Shared) -> bool {
    let mut model = shared.model();
    let mut is_urgent = model.take(one);
    for _ in 0..crate::collector::WAITING {
        match fed.try_recv() {
            Ok(one) => is_urgent |= model.take(one),
            Err(_) => break,
        }
    }
    is_urgent
}

fn flush(shared: &Shared) {
    // The lock is held until all messages are sent. A viewer that connects meanwhile therefore gets either all of them
    // or none.
    let mut model = shared.model();
    let messages = model.flush();
    send(shared, messages);
}

fn again(shared: &Shared) {
    let mut model = shared.model();
    let messages = model.again().into_iter().collect();
    send(shared, messages);
}

fn send(shared: &Shared, messages: Vec<Message>) {
    if !messages.is_empty()
        && let Some(fan) = &*shared.fan()
    {
        // Sending fails if there is no viewer. The failure needs no action.
        let _nobody = fan.send(messages.into());
    }
}
