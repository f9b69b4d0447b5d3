//! Query for the heads, shared by the systems that process georeferenced pings.

use bevy_ecs::prelude::Query;

use crate::entities::{Head, HeadFrontier, HeadSweep, HiddenAngles, Mounted};

/// Components of a head: number, mount, hidden angles, sweep and reach.
pub(super) type Heads<'w, 's> = Query<'w, 's, HeadParts>;
type HeadParts = (
    &'static Head,
    &'static Mounted,
    &'static HiddenAngles,
    &'static mut HeadSweep,
    &'static mut HeadFrontier,
);
