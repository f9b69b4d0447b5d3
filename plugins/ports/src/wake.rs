//! Wakes the loop from the threads of the lines.
//!
//! The loop parks on its thread's token, one atomic word. A waker swaps it and makes one system call only if the loop
//! sleeps. Neither side takes a lock or waits for the other. Packets are in their ring before the token is set, and
//! the loop reads the rings after it has taken the token. So no packet is missed by a sleep.

use std::time::Duration;

/// Threads that can be parked: the system's, or those of a model.
pub trait Threads {
    /// Handle of a thread.
    type Thread: Clone;

    /// This thread.
    fn current() -> Self::Thread;

    /// Sets a thread's token.
    fn unpark(thread: &Self::Thread);

    /// Waits at most this long for this thread's token, and takes it.
    fn park(at_most: Duration);
}

/// The system's threads.
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

/// Wakes the thread that created it.
pub struct Waker<T: Threads = System>(T::Thread);

impl<T: Threads> Clone for Waker<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T: Threads> Waker<T> {
    /// Creates a waker of this thread.
    pub fn of_this_thread() -> Self {
        Self(T::current())
    }

    /// Ends the current sleep, or the next one. Earlier writes are visible after it.
    pub fn wake(&self) {
        T::unpark(&self.0);
    }
}

/// Sleeps until this thread is woken, or for `at_most`; returns at once if it was woken since its last sleep.
pub(crate) fn sleep<T: Threads>(at_most: Duration) {
    T::park(at_most);
}

#[cfg(test)]
mod tests {
    use std::mem::ManuallyDrop;

    use headrace_geometry::time::MonoNs;
    use headrace_monitor::byte_ring::model::{explore, packets};

    use super::*;

    /// Threads of a loom model, whose sleeps end only by being woken. A missed wake is a deadlock, which loom
    /// reports.
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

    /// A line's thread sends and wakes as `LineService` does; the loop reads its rings and sleeps as `LiveFeed` does.
    /// After a deadlock, values that loom checks on drop aren't dropped, because that would cause a second panic.
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
    fn no_packet_is_missed_by_a_sleep() {
        let executions = explore("wake-up of the loop", Some(4), || line_and_loop(2, false));
        assert!(executions > 50, "{executions}");
    }

    #[test]
    #[should_panic = "deadlock"]
    fn model_detects_a_wake_before_the_send() {
        explore("wake-up before the packet", Some(4), || line_and_loop(2, true));
    }
}
