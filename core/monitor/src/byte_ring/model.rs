//! A ring for loom, which explores all orders of memory accesses and all effects of weak memory ordering.
//!
//! The indices are loom's atomics, with the same memory orderings as in ringbuf. The bytes are visible as
//! soon as they are stored. The model still shows every behaviour of ringbuf, because only the indices decide
//! which bytes a reader may see.

use std::sync::atomic::AtomicU8;
use std::sync::atomic::Ordering::Relaxed;

use loom::sync::Arc;
use loom::sync::atomic::AtomicUsize;
use loom::sync::atomic::Ordering::{Acquire, Release};

use super::{ByteConsumer, ByteProducer};
use crate::ring::{Port, PortReader};

struct Shared {
    bytes: Vec<AtomicU8>,
    read: AtomicUsize,
    write: AtomicUsize,
}

impl Shared {
    fn byte(&self, at: usize) -> Option<&AtomicU8> {
        self.bytes.get(at % self.bytes.len().max(1))
    }
}

/// Writing end. It caches its own index, because an additional load would make loom miss some orders of
/// accesses.
pub struct ModelProducer {
    shared: Arc<Shared>,
    write: usize,
}

/// Reading end. It caches its own index, like the writing end.
pub struct ModelConsumer {
    shared: Arc<Shared>,
    read: usize,
}

/// A ring of `capacity` bytes, for use within `loom::model`.
pub fn ring(capacity: usize) -> (ModelProducer, ModelConsumer) {
    let bytes = (0..capacity).map(|_| AtomicU8::new(0)).collect();
    let shared = Arc::new(Shared { bytes, read: AtomicUsize::new(0), write: AtomicUsize::new(0) });
    (ModelProducer { shared: Arc::clone(&shared), write: 0 }, ModelConsumer { shared, read: 0 })
}

impl ByteProducer for ModelProducer {
    fn vacant(&self) -> usize {
        self.shared.bytes.len() + self.shared.read.load(Acquire) - self.write
    }

    fn push(&mut self, bytes: &[u8]) {
        self.push_each(bytes.iter().copied());
    }

    fn push_each(&mut self, bytes: impl Iterator<Item = u8>) {
        for byte in bytes.take(self.vacant()) {
            if let Some(place) = self.shared.byte(self.write) {
                place.store(byte, Relaxed);
            }
            self.write += 1;
        }
        self.shared.write.store(self.write, Release);
    }
}

impl ByteConsumer for ModelConsumer {
    fn occupied(&self) -> usize {
        self.shared.write.load(Acquire) - self.read
    }

    fn peek(&self, into: &mut [u8]) -> usize {
        let count = self.occupied().min(into.len());
        for (at, place) in (self.read..self.read + count).zip(into) {
            *place = self.shared.byte(at).map_or(0, |byte| byte.load(Relaxed));
        }
        count
    }

    fn skip(&mut self, count: usize) {
        self.read += count.min(self.occupied());
        self.shared.read.store(self.read, Release);
    }

    fn pop(&mut self, into: &mut [u8]) -> usize {
        let count = self.peek(into);
        self.skip(count);
        count
    }
}

/// A reading end that always claims to have all bytes, so that the ring's protocol doesn't wait for the whole packet.
///
/// Models of deliberately broken protocols use it, and loom must detect that they fail.
pub struct Hasty(pub ModelConsumer);

impl ByteConsumer for Hasty {
    fn occupied(&self) -> usize {
        usize::MAX
    }

    fn peek(&self, into: &mut [u8]) -> usize {
        self.0.peek(into)
    }

    fn skip(&mut self, count: usize) {
        self.0.skip(count);
    }

    fn pop(&mut self, into: &mut [u8]) -> usize {
        self.0.pop(into)
    }
}

/// The packet ring of the loop, with loom's model of a byte ring in place of the real one.
pub fn packets(capacity: usize) -> (Port<ModelProducer>, ModelReader) {
    packets_by(capacity, |consumer| consumer)
}

/// The packet ring of the loop on loom's model of a byte ring. `reading` replaces the reading end.
pub fn packets_by<R: ByteConsumer>(
    capacity: usize,
    reading: impl FnOnce(ModelConsumer) -> R,
) -> (Port<ModelProducer>, ModelReader<R>) {
    let (producer, consumer) = ring(capacity);
    (Port::on(producer), ModelReader(PortReader::on(reading(consumer))))
}

/// Reading end of the loop's packet ring, built on the model.
pub struct ModelReader<R: ByteConsumer = ModelConsumer>(PortReader<R>);

impl<R: ByteConsumer> ModelReader<R> {
    /// Next packet in the order in which the loop takes it: receive time and bytes.
    pub fn take_next(&mut self) -> Option<(u64, Vec<u8>)> {
        let header = self.0.peek()?;
        let mut bytes = vec![0; header.len];
        self.0.take(&mut bytes);
        Some((header.received.0, bytes))
    }
}

/// Runs a loom model. Prints and returns its number of executions.
pub fn explore(name: &str, preemptions: Option<usize>, model: impl Fn() + Sync + Send + 'static) -> usize {
    let executions = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let count = std::sync::Arc::clone(&executions);
    let mut builder = loom::model::Builder::new();
    builder.preemption_bound = preemptions;
    builder.check(move || {
        count.fetch_add(1, Relaxed);
        model();
    });
    let executions = executions.load(Relaxed);
    println!("{name}: {executions} executions");
    executions
}
