//! Samples of a dive in order of arrival: 20 bytes each, in chunks, searched by chainage.

use crate::wire::SampleRecord;

/// Number of samples in a chunk: 1.25 MiB.
const CHUNK: usize = 1 << 16;
/// Largest number of samples kept: 160 MB, more than 7 km with four heads in ten hours need. Further samples are only
/// counted.
pub const MOST_SAMPLES: usize = 8_000_000;

/// A chunk with the chainages that it spans.
#[derive(Debug)]
struct Chunk {
    samples: Vec<SampleRecord>,
    from_m: f32,
    to_m: f32,
}

/// Samples, of which the first ones are visible: a replay that has jumped back stores more than it shows.
#[derive(Debug, Default)]
pub struct Samples {
    chunks: Vec<Chunk>,
    kept: usize,
    visible: usize,
    /// Time of each tick with the number of samples up to it, in order of time. Kept for seeks.
    marks: Vec<(u32, u32)>,
    not_kept: u64,
}

impl Samples {
    /// Number of visible samples.
    pub fn len(&self) -> usize {
        self.visible
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.visible == 0
    }

    /// Number of samples that weren't kept for lack of room.
    pub fn not_kept(&self) -> u64 {
        self.not_kept
    }

    /// Adds the samples of a tick that ended `at_ms` after the beginning. After a seek back, samples of known ticks
    /// become visible again. `marked` is for dives that may be sought.
    pub fn take(&mut self, at_ms: u32, new: &[SampleRecord], marked: bool) {
        if marked && self.marks.last().is_some_and(|(last, _)| at_ms <= *last) {
            self.visible = self.visible.max(self.count_at(at_ms));
            return;
        }
        for sample in new {
            self.push(*sample);
        }
        self.visible = self.kept;
        if marked && !new.is_empty() {
            self.marks.push((at_ms, u32::try_from(self.kept).unwrap_or(u32::MAX)));
        }
    }

    /// Shows the samples up to a time.
    pub fn jump(&mut self, at_ms: u32) {
        self.visible = self.count_at(at_ms);
    }

    fn count_at(&self, at_ms: u32) -> usize {
        let marks = self.marks.partition_point(|(at, _)| *at <= at_ms);
        marks.checked_sub(1).and_then(|last| self.marks.get(last)).map_or(0, |(_, count)| *count as usize)
    }

    fn push(&mut self, sample: SampleRecord) {
        if self.kept >= MOST_SAMPLES {
            self.not_kept += 1;
            return;
        }
        if self.chunks.last().is_none_or(|chunk| chunk.samples.len() == CHUNK) {
            let samples = Vec::with_capacity(CHUNK);
            self.chunks.push(Chunk { samples, from_m: f32::INFINITY, to_m: f32::NEG_INFINITY });
        }
        if let Some(chunk) = self.chunks.last_mut() {
            chunk.from_m = chunk.from_m.min(sample.x_m);
            chunk.to_m = chunk.to_m.max(sample.x_m);
            chunk.samples.push(sample);
            self.kept += 1;
        }
    }

    /// Visible samples from this number on.
    pub fn since(&self, first: usize) -> impl Iterator<Item = &SampleRecord> {
        let (whole, part) = (first / CHUNK, first % CHUNK);
        let chunks = self.chunks.iter().skip(whole).flat_map(|chunk| chunk.samples.iter());
        chunks.skip(part).take(self.visible.saturating_sub(first))
    }

    /// Visible samples between two chainages, thinned to at most `most`. Returns them and the thinning step.
    pub fn between(&self, from_m: f32, to_m: f32, most: usize) -> (Vec<SampleRecord>, usize) {
        let count = self.each(from_m, to_m).count();
        let step = count.div_ceil(most.max(1)).max(1);
        (self.each(from_m, to_m).step_by(step).copied().collect(), step)
    }

    fn each(&self, from_m: f32, to_m: f32) -> impl Iterator<Item = &SampleRecord> {
        let visible = move |number: usize| self.visible.saturating_sub(number * CHUNK).min(CHUNK);
        let chunks = self.chunks.iter().enumerate();
        let near = chunks.filter(move |(_, chunk)| chunk.from_m <= to_m && chunk.to_m >= from_m);
        let all = near.flat_map(move |(number, chunk)| chunk.samples.iter().take(visible(number)));
        all.filter(move |sample| (from_m..=to_m).contains(&sample.x_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(number: u32) -> SampleRecord {
        let x_m = number as f32 / 1000.0;
        SampleRecord { t_ms: number, x_m, y_m: 0.0, z_m: 0.0, arc: 0, head: 0, outcome: 0 }
    }

    fn filled(count: u32) -> Samples {
        let mut samples = Samples::default();
        for at in 0..count / 10 {
            let new: Vec<_> = (at * 10..at * 10 + 10).map(sample).collect();
            samples.take(at, &new, true);
        }
        samples
    }

    #[test]
    fn ranges_are_found_across_chunks_and_thinned() {
        let samples = filled(200_000);
        let (some, step) = samples.between(64.9, 66.1, 200_000);
        assert_eq!((some.len(), step, some[0].t_ms), (1201, 1, 64_900));
        let (some, step) = samples.between(0.0, 1e9, 100);
        assert_eq!((some.len(), step), (100, 2000));
        assert_eq!(samples.since(131_070).map(|sample| sample.t_ms).next(), Some(131_070));
        assert_eq!(samples.since(131_070).count(), 200_000 - 131_070);
    }

    #[test]
    fn jump_back_hides_samples_and_keeps_none_twice() {
        let mut samples = filled(1000);
        samples.jump(49);
        assert_eq!((samples.len(), samples.between(0.0, 9.0, 9999).0.len()), (500, 500));
        assert_eq!(samples.since(400).count(), 100);
        let again: Vec<_> = (500..510).map(sample).collect();
        samples.take(50, &again, true);
        assert_eq!((samples.len(), samples.kept), (510, 1000));
        samples.jump(99);
        samples.take(100, &[sample(1000)], true);
        assert_eq!((samples.len(), samples.kept), (1001, 1001));
        assert_eq!(samples.since(1000).next().map(|sample| sample.t_ms), Some(1000));
        samples.jump(0);
        assert_eq!(samples.len(), 10);
    }
}
