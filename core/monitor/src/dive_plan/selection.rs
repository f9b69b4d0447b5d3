//! Passes that cover the most wall in a limited time.

/// Maximum number of passes in a plan. The search compares up to 2^10 sets of passes.
pub(super) const MOST_PASSES: usize = 10;

/// Lengths that differ by less are equal, m.
const ROUNDING_M: f64 = 1e-9;

/// Pass that could be made, on the way that takes the least time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Offer {
    /// Missed length that the pass covers, m.
    pub(super) missed_m: f64,
    /// Time that the pass adds to the dive, s.
    pub(super) more_s: f64,
    /// Share of the pass that covers no missed wall; `None` if the pass cannot be shortened.
    pub(super) run_up_share: Option<f64>,
}

/// Wall at the turning point, of which any part can be covered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ahead {
    /// Length of the whole, m.
    pub(super) length_m: f64,
    /// Time that the whole adds to the dive, s.
    pub(super) more_s: f64,
    /// Share of the drive that covers nothing.
    pub(super) run_up_share: f64,
    /// Whether a part of it is no choice.
    pub(super) is_whole: bool,
}

/// Selected passes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Selection {
    /// Bitmask of the whole passes.
    pub(super) whole: u16,
    /// Number of a shortened pass, and the share of it that is made.
    pub(super) part: Option<(usize, f64)>,
    /// Share of the wall at the turning point that is driven, and the length that it covers, m.
    pub(super) ahead: (f64, f64),
    /// Length that is covered in all, m.
    pub(super) covered_m: f64,
    /// Time that the passes add to the dive, s.
    pub(super) more_s: f64,
}

impl Selection {
    pub(super) fn has(&self, pass: usize) -> bool {
        self.whole >> pass & 1 == 1
    }

    /// Whether this selection covers more, or as much in less time.
    pub(super) fn is_better(&self, than: &Self) -> bool {
        let more_m = self.covered_m - than.covered_m;
        more_m > ROUNDING_M || more_m > -ROUNDING_M && self.more_s < than.more_s
    }
}

/// Search for the best selection by branch and bound.
pub(super) struct Search<'a> {
    offers: &'a [Option<Offer>],
    ahead: Option<Ahead>,
    time_s: f64,
    best: Selection,
}

/// Selection of passes that add at most `time_s` to the dive, and cover the most wall.
///
/// At most one pass is shortened. This is the optimum: with two shortened passes, time moved from one to the other
/// covers no less. Work is bounded by 2^`offers.len()` steps.
pub(super) fn select(offers: &[Option<Offer>], ahead: Option<Ahead>, time_s: f64) -> Selection {
    debug_assert!(offers.len() <= MOST_PASSES, "{} passes", offers.len());
    let mut search = Search { offers, ahead, time_s, best: Selection::default() };
    search.descend(0, Selection::default());
    search.best
}

impl Search<'_> {
    fn descend(&mut self, from: usize, so_far: Selection) {
        let left_s = self.time_s - so_far.more_s;
        let rest = self.offers.get(from..).unwrap_or_default();
        let rest_m: f64 = rest.iter().flatten().map(|offer| offer.missed_m).sum();
        let skipped = self.offers.iter().take(from).enumerate().filter(|(pass, _)| !so_far.has(*pass));
        let part_m = skipped.filter_map(|(_, offer)| *offer).map(|offer| offer.missed_m).fold(0.0, f64::max);
        let ahead_m = self.ahead.map_or(0.0, |ahead| ahead.within(left_s).1);
        if so_far.covered_m + rest_m + part_m + ahead_m <= self.best.covered_m + ROUNDING_M {
            return;
        }
        let Some(offer) = rest.first() else {
            let full = self.with_rest(so_far, left_s);
            if full.is_better(&self.best) {
                self.best = full;
            }
            return;
        };
        if let Some(offer) = offer.filter(|offer| offer.more_s <= left_s) {
            let whole = so_far.whole | 1 << from;
            let (covered_m, more_s) = (so_far.covered_m + offer.missed_m, so_far.more_s + offer.more_s);
            self.descend(from + 1, Selection { whole, covered_m, more_s, ..so_far });
        }
        self.descend(from + 1, so_far);
    }

    /// Fills the time that whole passes leave with tunnel ahead, then with a shortened pass.
    fn with_rest(&self, whole: Selection, left_s: f64) -> Selection {
        let mut full = whole;
        let (share, ahead_m) = self.ahead.map_or((0.0, 0.0), |ahead| ahead.within(left_s));
        let ahead_s = share * self.ahead.map_or(0.0, |ahead| ahead.more_s);
        (full.ahead, full.covered_m, full.more_s) =
            ((share, ahead_m), full.covered_m + ahead_m, full.more_s + ahead_s);
        let left_s = left_s - ahead_s;
        let mut best = full;
        for (pass, offer) in self.offers.iter().enumerate().filter(|(pass, _)| !whole.has(*pass)) {
            let Some((offer, run_up_share)) = offer.and_then(|offer| Some((offer, offer.run_up_share?)))
            else {
                continue;
            };
            let share = left_s / offer.more_s;
            let covered_m = offer.missed_m * (share - run_up_share) / (1.0 - run_up_share);
            if share < 1.0 && covered_m > 0.0 {
                let (covered_m, more_s) = (full.covered_m + covered_m, full.more_s + left_s);
                let with_part = Selection { part: Some((pass, share)), covered_m, more_s, ..full };
                best = if with_part.is_better(&best) { with_part } else { best };
            }
        }
        best
    }
}

impl Ahead {
    /// Share that can be driven in a time, and the length that it covers, m.
    fn within(&self, time_s: f64) -> (f64, f64) {
        let share = (time_s / self.more_s).clamp(0.0, 1.0);
        let covered_m = self.length_m * (share - self.run_up_share) / (1.0 - self.run_up_share);
        if covered_m > 0.0 && (share >= 1.0 || !self.is_whole) { (share, covered_m) } else { (0.0, 0.0) }
    }
}
