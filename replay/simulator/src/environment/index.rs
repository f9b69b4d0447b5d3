//! Index of objects in the tunnel by chainage.

use headrace_geometry::math;

/// Index of objects by buckets of chainage. An object is listed in each bucket that it extends into.
#[derive(Debug, Clone, Default)]
pub(super) struct Index {
    first_m: f64,
    bucket_m: f64,
    /// Position in `numbers` at which each bucket's list starts, followed by the end of the last list. The list is
    /// empty if there are no objects.
    starts: Vec<usize>,
    /// Numbers of the indexed objects, bucket by bucket.
    numbers: Vec<u32>,
}

/// Length of a bucket, m: about the length of a boulder, and several times the chainage that a profiler's ray spans.
const BUCKET_M: f64 = 1.0;
/// Maximum number of buckets. A tunnel that would need more buckets has longer ones instead.
const MOST_BUCKETS: f64 = 65_536.0;

impl Index {
    /// Indexes objects. Object number k extends from chainage `spans[k].0` to chainage `spans[k].1`, m.
    ///
    /// Allocates: startup only.
    pub(super) fn new(spans: &[(f64, f64)]) -> Self {
        if spans.is_empty() {
            return Self::default();
        }
        let first_m = spans.iter().map(|span| span.0).fold(f64::INFINITY, f64::min);
        let last_m = spans.iter().map(|span| span.1).fold(f64::NEG_INFINITY, f64::max);
        let bucket_m = BUCKET_M.max((last_m - first_m) / MOST_BUCKETS);
        let mut index = Self { first_m, bucket_m, starts: Vec::new(), numbers: Vec::new() };
        let count = index.bucket(last_m) + 1;
        let mut lists = vec![Vec::new(); count];
        for (number, (from_m, to_m)) in (0_u32..).zip(spans) {
            for list in lists.iter_mut().take(index.bucket(*to_m) + 1).skip(index.bucket(*from_m)) {
                list.push(number);
            }
        }
        index.starts.push(0);
        for list in lists {
            index.numbers.extend(list);
            index.starts.push(index.numbers.len());
        }
        index
    }

    /// Numbers of all objects that extend into `[from_m, to_m]`. A number may occur more than once, and objects near
    /// this range may be included.
    pub(super) fn near(&self, from_m: f64, to_m: f64) -> &[u32] {
        let Some(count) = self.starts.len().checked_sub(1) else { return &[] };
        if to_m < self.first_m {
            return &[];
        }
        let first = self.bucket(from_m);
        if first >= count {
            return &[];
        }
        let past = (self.bucket(to_m) + 1).min(count);
        &self.numbers[self.starts[first]..self.starts[past]]
    }

    fn bucket(&self, chainage_m: f64) -> usize {
        usize::try_from(math::floor_to_i64((chainage_m - self.first_m) / self.bucket_m)).unwrap_or(0)
    }
}
