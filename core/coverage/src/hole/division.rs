//! A tile of wall divided into the Voronoi cells of its samples.
//!
//! The share of each sample is a convex polygon. Its point farthest from the sample is a corner.

/// Maximum number of samples among which a tile is divided. With more samples, the tile is halved instead.
pub(super) const MAX_OWNERS: usize = 24;
/// Maximum number of corners of a sample's share of the tile. With more corners, the tile is halved instead.
const MAX_CORNERS: usize = 12;

/// Share of a tile: the Voronoi cell of one sample, clipped to the tile.
#[derive(Debug, Clone, Copy)]
pub(super) struct Share {
    /// Sample to which the share belongs, relative to the tile's centre, m.
    pub owner: (f64, f64),
    /// Corners relative to the share's sample, m. Differences of points near the sample are exact.
    corners: [(f64, f64); MAX_CORNERS],
    len: usize,
    /// Squared distance of the farthest corner from the sample, m2. Zero for an empty share.
    pub farthest2: f64,
    /// The corner farthest from the sample.
    pub farthest: (f64, f64),
}

impl Share {
    /// Returns the share of a tile's only sample. It is the whole tile, given by its half edges.
    fn whole(owner: (f64, f64), (half_x, half_arc): (f64, f64)) -> Self {
        let (left, right) = (-owner.0 - half_x, -owner.0 + half_x);
        let (low, high) = (-owner.1 - half_arc, -owner.1 + half_arc);
        let mut share =
            Self { owner, corners: [(0.0, 0.0); MAX_CORNERS], len: 0, farthest2: 0.0, farthest: (0.0, 0.0) };
        for corner in [(left, low), (right, low), (right, high), (left, high)] {
            share.push(corner);
        }
        share
    }

    /// Adds a corner to the share. Returns false if there is no room for it.
    fn push(&mut self, corner: (f64, f64)) -> bool {
        let Some(place) = self.corners.get_mut(self.len) else { return false };
        *place = corner;
        self.len += 1;
        let distance2 = corner.0 * corner.0 + corner.1 * corner.1;
        if distance2 > self.farthest2 {
            (self.farthest2, self.farthest) = (distance2, corner);
        }
        true
    }

    /// Clips the share to the points that are nearer to its own sample than to `rival`, another sample.
    ///
    /// Returns false if there are too many corners.
    fn clip(&mut self, rival: (f64, f64)) -> bool {
        let (nx, ny) = (rival.0 - self.owner.0, rival.1 - self.owner.1);
        let half = 0.5 * (nx * nx + ny * ny);
        // A rival more than twice as far from the share's sample as the farthest corner cuts off nothing.
        if half > 2.0 * self.farthest2 {
            return true;
        }
        let excess = |corner: (f64, f64)| nx * corner.0 + ny * corner.1 - half;
        let Some(corners) = self.corners.get(..self.len) else {
            debug_assert!(false, "a share has at most {MAX_CORNERS} corners: {}", self.len);
            return false;
        };
        if corners.iter().all(|corner| excess(*corner) <= 0.0) {
            return true;
        }
        let corners = self.corners;
        let corners = corners.iter().take(core::mem::take(&mut self.len));
        (self.farthest2, self.farthest) = (0.0, (0.0, 0.0));
        let Some(mut before) = corners.clone().next_back() else {
            debug_assert!(false, "a share with a corner beyond the rival has corners: {:?}", self.owner);
            return true;
        };
        let mut excess_before = excess(*before);
        let mut fits = true;
        for corner in corners {
            let excess_here = excess(*corner);
            if (excess_before > 0.0) != (excess_here > 0.0) {
                let share = excess_before / (excess_before - excess_here);
                let (dx, dy) = (corner.0 - before.0, corner.1 - before.1);
                fits &= self.push((before.0 + share * dx, before.1 + share * dy));
            }
            if excess_here <= 0.0 {
                fits &= self.push(*corner);
            }
            (before, excess_before) = (corner, excess_here);
        }
        fits
    }
}

/// A tile divided among the samples found so far.
///
/// The largest distance of a corner from its share's sample is an upper bound for all points of the tile. More samples
/// only reduce it.
#[derive(Debug)]
pub(super) struct Division {
    half_edges: (f64, f64),
    shares: Vec<Share>,
}

impl Default for Division {
    fn default() -> Self {
        Self { half_edges: (0.0, 0.0), shares: Vec::with_capacity(MAX_OWNERS) }
    }
}

impl Division {
    /// Starts the division with a tile and its first sample.
    pub(super) fn begin(&mut self, half_edges: (f64, f64), owner: (f64, f64)) {
        self.half_edges = half_edges;
        self.shares.clear();
        self.shares.push(Share::whole(owner, half_edges));
    }

    /// Returns the share with the largest distance of a corner from its sample.
    pub(super) fn worst(&self) -> Option<&Share> {
        self.shares.iter().max_by(|a, b| a.farthest2.total_cmp(&b.farthest2))
    }

    /// Adds the share of a sample.
    ///
    /// Returns false if the sample already has a share, or if there is no room for it. Then the tile must be halved.
    pub(super) fn add(&mut self, owner: (f64, f64)) -> bool {
        let same = |share: &Share| (share.owner.0 - owner.0).abs() + (share.owner.1 - owner.1).abs() <= 0.0;
        if self.shares.len() == MAX_OWNERS || self.shares.iter().any(same) {
            return false;
        }
        let mut added = Share::whole(owner, self.half_edges);
        let fits = self.shares.iter_mut().all(|share| added.clip(share.owner) && share.clip(owner));
        self.shares.push(added);
        fits
    }
}
