//! Samples of a dive in order of arrival, 20 bytes each. They are stored in chunks that are searched by chainage.

use crate::wire::SampleRecord;

/// Number of samples in a chunk, which then takes 1.25 MiB.
const CHUNK: usize = 1 << 16;
/// Maximum number of samples kept, which take 160 MB. A dive of ten hours over 7 km with four heads has fewer samples.
/// Further samples are only counted.
pub const MOST_SAMPLES: usize = 8_000_000;

/// A chunk of samples and its range of chainage.
#[derive(Debug)]
struct Chunk {
    samples: Vec<SampleRecord>,
    from_m: f32,
    to_m: f32,
}

/// Samples of a dive. After a replay jumps back, only the samples before the new time are visible.
#[derive(Debug, Default)]
pub struct Samples {
    chunks: Vec<Chunk>,
    kept: usize,
    visible: usize,
    /// End time of each tick, ms, with the number of samples up to that time. A seek uses these marks to find the
    /// samples that were visible at a time.
    marks: Vec<(u32, u32)>,
    not_kept: u64,
}

impl Samples {
    /// Number of visible samples.
    pub fn len(&self) -> usize {
        self.visible
    }

    /// Whether no sample is visible.
    pub fn is_empty(&self) -> bool {
        self.visible == 0
    }

    /// Number of samples dropped because the store was full.
    pub fn not_kept(&self) -> u64 {
        self.not_kept
    }

    /// Adds the samples of a tick that ended `at_ms` after the dive began.
    ///
    /// If playback has jumped back, the tick's samples are already stored and become visible again. `marked` is true
    /// for dives that support seeks.
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

    /// Makes only the samples up to a time visible.
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

    /// Returns visible samples, beginning with sample number `first`.
    pub fn since(&self, first: usize) -> impl Iterator<Item = &SampleRecord> {
        let (whole, part) = (first / CHUNK, first % CHUNK);
        let chunks = self.chunks.iter().skip(whole).flat_map(|chunk| chunk.samples.iter());
        chunks.skip(part).take(self.visible.saturating_sub(first))
    }

    /// Returns visible samples between two chainages, m, thinned to at most `most` samples, and the thinning step.
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
    fn sample_queries_span_several_chunks_and_are_thinned() {
        let samples = filled(200_000);
        let (some, step) = samples.between(64.9, 66.1, 200_000);
        assert_eq!((some.len(), step, some[0].t_ms), (1201, 1, 64_900));
        let (some, step) = samples.between(0.0, 1e9, 100);
        assert_eq!((some.len(), step), (100, 2000));
        assert_eq!(samples.since(131_070).map(|sample| sample.t_ms).next(), Some(131_070));
        assert_eq!(samples.since(131_070).count(), 200_000 - 131_070);
    }

    #[test]
    fn playback_jump_back_hides_the_samples_after_the_new_time() {
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
