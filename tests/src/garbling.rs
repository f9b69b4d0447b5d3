//! Line faults that damage bytes, drawn from a fixed seed.

use headrace_imagenex881::codec::{Model, ReturnCodec, Returns};
use headrace_ping1d::codec::PingCodec;
use headrace_sensor::codec::Codec;

use crate::faulty::{Fault, Wire};
use crate::random::Random;

/// Function that counts the good frames that a codec finds in some bytes.
pub type Count = fn(&[u8]) -> u64;

/// Number of good echosounder frames in some bytes.
pub fn of_ping(bytes: &[u8]) -> u64 {
    counted(&mut PingCodec::default(), bytes)
}

/// Number of good frames of a profiling head in some bytes.
pub fn of_head(bytes: &[u8]) -> u64 {
    counted(&mut ReturnCodec::new(Returns { model: Some(Model::Head881) }), bytes)
}

fn counted(codec: &mut impl Codec, bytes: &[u8]) -> u64 {
    codec.push(bytes, &mut |_| ());
    codec.flush(&mut |_| ());
    codec.counts().good_frames
}

/// A fault that changes bytes in transit. Some changes go undetected, because heads' returns have no checksum.
pub struct Garbled {
    random: Random,
    change: fn(&mut Random, &[u8]) -> Vec<u8>,
    count: Count,
}

impl Garbled {
    /// Passes all bytes through `change`. `count` counts the frames that are still good after the change.
    pub fn new(seed: u64, count: Count, change: fn(&mut Random, &[u8]) -> Vec<u8>) -> Self {
        Self { random: Random(seed), change, count }
    }
}

impl Fault for Garbled {
    fn to_host(&mut self, _: u64, frame: &[u8], line: &mut Wire) {
        let changed = (self.change)(&mut self.random, frame);
        if changed == frame {
            line.whole(frame);
        } else {
            line.part(&changed);
            line.count((self.count)(&changed));
        }
    }

    fn to_device(&mut self, bytes: Vec<u8>) -> Vec<u8> {
        (self.change)(&mut self.random, &bytes)
    }
}

/// Flips one bit in about one byte out of a hundred.
pub fn flipped(random: &mut Random, bytes: &[u8]) -> Vec<u8> {
    let flip = |byte: &u8| if random.one_in(100) { byte ^ (1 << (random.bits() % 8)) } else { *byte };
    bytes.iter().map(flip).collect()
}

/// Drops about one byte out of a hundred.
pub fn thinned(random: &mut Random, bytes: &[u8]) -> Vec<u8> {
    bytes.iter().copied().filter(|_| !random.one_in(100)).collect()
}

/// A line fault that a function causes. The function is called for each frame, with the frame's number and bytes.
pub struct EachFrame<F>(pub F);

impl<F: FnMut(u64, &[u8], &mut Wire) + Send> Fault for EachFrame<F> {
    fn to_host(&mut self, number: u64, frame: &[u8], line: &mut Wire) {
        (self.0)(number, frame, line);
    }
}
