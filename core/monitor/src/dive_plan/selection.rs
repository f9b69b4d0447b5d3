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
struct Search<'a> {
    offers: &'a [Option<Offer>],
    /// Numbers of the possible passes: those that cover most per second come first.
    order: &'a [usize],
    ahead: Option<Ahead>,
    time_s: f64,
    best: Selection,
}

/// Selection of passes that add at most `time_s` to the dive, and cover the most wall.
///
/// At most one pass is shortened. This is the optimum: with two shortened passes, time moved from one to the other
/// covers no less. Work is bounded by 2^`offers.len()` steps; the bound leaves few of them.
pub(super) fn select(offers: &[Option<Offer>], ahead: Option<Ahead>, time_s: f64) -> Selection {
    debug_assert!(offers.len() <= MOST_PASSES, "{} passes", offers.len());
    let (mut order, mut count) = ([0; MOST_PASSES], 0);
    for (slot, (number, _)) in
        order.iter_mut().zip(offers.iter().enumerate().filter(|(_, offer)| offer.is_some()))
    {
        (*slot, count) = (number, count + 1);
    }
    let order = order.get_mut(..count).unwrap_or_default();
    let rate = |number: &usize| offers.get(*number).copied().flatten().map_or(0.0, |offer| offer.rate());
    order.sort_unstable_by(|a, b| rate(b).total_cmp(&rate(a)).then(a.cmp(b)));
    let mut search = Search { offers, order, ahead, time_s, best: Selection::default() };
    search.descend(0, Selection::default());
    search.best
}

impl Offer {
    /// Length that is covered per second, m/s.
    fn rate(&self) -> f64 {
        self.missed_m / self.more_s.max(f64::MIN_POSITIVE)
    }
}

/// Time that is left while passes of decreasing rates fill it, and the length that they cover, m.
struct Filling {
    left_s: f64,
    covered_m: f64,
    ahead: Option<Ahead>,
}

impl Filling {
    fn fill(&mut self, length_m: f64, more_s: f64) {
        let share = if more_s > self.left_s { self.left_s / more_s } else { 1.0 };
        self.covered_m += share * length_m;
        self.left_s -= share * more_s;
    }

    /// Fills time with the tunnel ahead if it covers more per second than `rate`, m/s.
    fn fill_ahead(&mut self, rate: f64) {
        let is_next = |ahead: &Ahead| ahead.length_m >= rate * ahead.more_s;
        if let Some(ahead) = self.ahead.take_if(|ahead| is_next(ahead)) {
            self.fill(ahead.length_m, ahead.more_s);
        }
    }
}

impl Search<'_> {
    fn offer(&self, place: usize) -> Option<(usize, Offer)> {
        let number = *self.order.get(place)?;
        Some((number, self.offers.get(number).copied().flatten()?))
    }

    /// Length that passes from a place of the order on cover at most, m, after a skipped one has been shortened.
    fn bound_m(&self, from: usize, so_far: &Selection, skipped: Option<Offer>) -> f64 {
        let left_s = self.time_s - so_far.more_s;
        let mut filling = Filling { left_s, covered_m: so_far.covered_m, ahead: self.ahead };
        let rest = (from..self.order.len()).filter_map(|place| Some(self.offer(place)?.1));
        for offer in skipped.into_iter().chain(rest) {
            filling.fill_ahead(offer.rate());
            filling.fill(offer.missed_m, offer.more_s);
        }
        filling.fill_ahead(0.0);
        filling.covered_m
    }

    fn descend(&mut self, from: usize, so_far: Selection) {
        let skipped =
            (0..from).filter_map(|place| self.offer(place)).filter(|(number, _)| !so_far.has(*number));
        let skipped = skipped.map(|(_, offer)| Some(offer)).chain([None]);
        let most_m = skipped.map(|offer| self.bound_m(from, &so_far, offer)).fold(0.0, f64::max);
        if most_m <= self.best.covered_m + ROUNDING_M {
            return;
        }
        let left_s = self.time_s - so_far.more_s;
        let Some((number, offer)) = self.offer(from) else {
            let full = self.with_rest(so_far, left_s);
            if full.is_better(&self.best) {
                self.best = full;
            }
            return;
        };
        if offer.more_s <= left_s {
            let whole = so_far.whole | 1 << number;
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
