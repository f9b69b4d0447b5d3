//! Wakes the loop when the line threads have data for it.
//!
//! The loop parks on its thread's token, an atomic word. A waker sets the token, and makes a system call only if the
//! loop sleeps. Neither side takes a lock or waits for the other.
//!
//! A line puts its packet into the ring before it sets the token. The loop takes the token before it reads the rings.
//! A sleep therefore can't miss a packet.

use std::time::Duration;

/// Functions that park threads of the system, or threads of a model.
pub trait Threads {
    /// Handle by which a thread can be woken.
    type Thread: Clone;

    /// Returns a handle of this thread.
    fn current() -> Self::Thread;

    /// Sets a thread's token, which ends the thread's wait.
    fn unpark(thread: &Self::Thread);

    /// Waits for this thread's token, for at most `at_most`, and takes the token.
    fn park(at_most: Duration);
}

/// Threads of the operating system.
pub struct System;

impl Threads for System {
    type Thread = std::thread::Thread;

    fn current() -> Self::Thread {
        std::thread::current()
    }

    fn unpark(thread: &Self::Thread) {
        thread.unpark();
    }

    fn park(at_most: Duration) {
        std::thread::park_timeout(at_most);
    }
}

/// Wakes the thread on which the waker was created.
pub struct Waker<T: Threads = System>(T::Thread);

impl<T: Threads> Clone for Waker<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T: Threads> Waker<T> {
    /// Creates a waker for this thread.
    pub fn of_this_thread() -> Self {
        Self(T::current())
    }

    /// Ends the thread's present sleep, or its next one. The thread then sees all earlier writes.
    pub fn wake(&self) {
        T::unpark(&self.0);
    }
}

/// Sleeps until this thread is woken, at most for `at_most`. Returns at once if the thread was woken since its previous
/// sleep.
pub(crate) fn sleep<T: Threads>(at_most: Duration) {
    T::park(at_most);
}

#[cfg(test)]
mod tests {
    use std::mem::ManuallyDrop;

    use headrace_geometry::time::MonoNs;
    use headrace_monitor::byte_ring::model::{explore, packets};

    use super::*;

    /// Threads of a loom model. Only a wake ends their sleep, so a missed wake is a deadlock, which loom reports.
    struct Modelled;

    impl Threads for Modelled {
        type Thread = loom::thread::Thread;

        fn current() -> Self::Thread {
            loom::thread::current()
        }

        fn unpark(thread: &Self::Thread) {
            thread.unpark();
        }

        fn park(_: Duration) {
            loom::thread::park();
        }
    }

    /// A modelled line sends packets and wakes the loop as `LineService` does. The loop reads its ring and sleeps as
    /// `LiveFeed` does.
    ///
    /// After a deadlock, values that loom checks on drop are not dropped, because that would cause a second panic.
    fn line_and_loop(packets_sent: u8, wakes_first: bool) {
        let (mut port, reader) = packets(64);
        let mut reader = ManuallyDrop::new(reader);
        let waker = Waker::<Modelled>::of_this_thread();
        let line = ManuallyDrop::new(loom::thread::spawn(move || {
            for number in 0..packets_sent {
                if wakes_first {
                    waker.wake();
                }
                port.send(MonoNs(number.into()), &[number + 1]).unwrap();
                if !wakes_first {
                    waker.wake();
                }
            }
        }));
        let mut taken = Vec::new();
        loop {
            taken.extend(std::iter::from_fn(|| reader.take_next()));
            if taken.len() == usize::from(packets_sent) {
                break;
            }
            sleep::<Modelled>(Duration::MAX);
        }
        ManuallyDrop::into_inner(line).join().unwrap();
        drop(ManuallyDrop::into_inner(reader));
        let sent: Vec<_> = (0..packets_sent).map(|number| (u64::from(number), vec![number + 1])).collect();
        assert_eq!(taken, sent);
    }

    #[test]
    fn sleeping_loop_misses_no_packet() {
        let executions = explore("wake-up of the loop", Some(4), || line_and_loop(2, false));
        assert!(executions > 50, "{executions}");
    }

    #[test]
    #[should_panic = "deadlock"]
    fn loom_model_detects_a_wake_before_the_send() {
        explore("wake-up before the packet", Some(4), || line_and_loop(2, true));
    }
}
