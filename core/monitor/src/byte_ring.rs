//! Traits of a byte ring with one writer and one reader. Each push becomes visible as a whole.
//!
//! The loop's rings come from the crate ringbuf. Code that reads or writes packets uses only these traits, so
//! it also runs on a ring that explores every interleaving (feature `model`).

use ringbuf::traits::{Consumer, Producer};

#[cfg(any(test, feature = "model"))]
pub mod model;

/// Writing end of a ring of bytes. Never blocks.
pub trait ByteProducer {
    /// Number of free bytes. The reader may free more at any time.
    fn vacant(&self) -> usize;

    /// Publishes bytes all at once. Bytes that don't fit are left out.
    fn push(&mut self, bytes: &[u8]);

    /// Publishes bytes that aren't contiguous in memory, all at once.
    fn push_each(&mut self, bytes: impl Iterator<Item = u8>);
}

/// Reading end of a ring of bytes. Never blocks.
pub trait ByteConsumer {
    /// Number of waiting bytes. The writer may add more at any time.
    fn occupied(&self) -> usize;

    /// Copies waiting bytes without removing them. Returns their number.
    fn peek(&self, into: &mut [u8]) -> usize;

    /// Discards this many of the bytes that wait in the ring.
    fn skip(&mut self, count: usize);

    /// Copies the bytes that wait in the ring, and removes them. Returns their number.
    fn pop(&mut self, into: &mut [u8]) -> usize;
}

impl<R: Producer<Item = u8>> ByteProducer for R {
    fn vacant(&self) -> usize {
        self.vacant_len()
    }

    fn push(&mut self, bytes: &[u8]) {
        self.push_slice(bytes);
    }

    fn push_each(&mut self, bytes: impl Iterator<Item = u8>) {
        self.push_iter(bytes);
    }
}

impl<R: Consumer<Item = u8>> ByteConsumer for R {
    fn occupied(&self) -> usize {
        self.occupied_len()
    }

    fn peek(&self, into: &mut [u8]) -> usize {
        self.peek_slice(into)
    }

    fn skip(&mut self, count: usize) {
        Consumer::skip(self, count);
    }

    fn pop(&mut self, into: &mut [u8]) -> usize {
        self.pop_slice(into)
    }
}
