//! How several heads share the work: phase shift and sector offset (the paper's §5).

use crate::app::device::{HeadProgram, HeadSpec};
use crate::frames::{Body, Rot, Sensor, head_direction};
use crate::math::{self, TAU};

/// How the heads of a vehicle share the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeadLayout {
    /// All turn on for ever, 2 pi / s apart where they pass the same place.
    PhaseShift,
    /// Each goes back and forth in its own sector of 2 pi / s.
    SectorOffset,
}

/// Programs for the heads of a vehicle, in the order given, such that at `speed_mps` their passes interleave evenly.
///
/// Head k of s starts at the body-frame angle gamma_k = 2 pi k / s - omega x_k / v, where x_k is how far it sits behind
/// the foremost head (Eq. 20); a head that faces aft turns the other way, so that its start is mirrored (Eq. 21).
/// At zero speed the offsets along the hull have no meaning and are left out.
/// Source: Jorge et al. 2021, Eq. 19 to 21 and §5.2.
pub fn programs(heads: &[HeadSpec], layout: HeadLayout, speed_mps: f64) -> Vec<HeadProgram> {
    let foremost = heads.iter().map(|head| head.mount.position.x()).fold(f64::MIN, f64::max);
    let share = TAU / heads.len().max(1) as f64;
    heads
        .iter()
        .enumerate()
        .map(|(k, head)| {
            let behind_m = foremost - head.mount.position.x();
            let delay_s = if speed_mps > 0.0 { behind_m / speed_mps } else { 0.0 };
            match layout {
                HeadLayout::PhaseShift => phase_shift(head, share * k as f64, delay_s),
                HeadLayout::SectorOffset => sector_offset(head, share * k as f64, share),
            }
        })
        .collect()
}

fn phase_shift(head: &HeadSpec, phase_rad: f64, delay_s: f64) -> HeadProgram {
    let omega = head.step_rad / head.ping_period_s;
    // All heads turn through the body's angles in one sense: a head that faces aft must then step downwards in its
    // own angles, or be mirrored. The 881 turns clockwise on its own, so the mirrored start is what Eq. 21 gives.
    let wanted = phase_rad - omega * delay_s;
    let start = if faces_aft(head.mount.rotation) { TAU - wanted } else { wanted };
    HeadProgram { start_rad: math::wrap(start, TAU), growing: !faces_aft(head.mount.rotation), sector: None }
}

fn sector_offset(head: &HeadSpec, least_rad: f64, size_rad: f64) -> HeadProgram {
    let aft = faces_aft(head.mount.rotation);
    let least = if aft { math::wrap(TAU - least_rad - size_rad, TAU) } else { least_rad };
    HeadProgram {
        start_rad: if aft { least + size_rad } else { least },
        growing: !aft,
        sector: Some((least, size_rad)),
    }
}

/// Whether a head's axis points aft, so that its angles grow the other way round in the body's frame.
pub fn faces_aft(rotation: Rot<Body, Sensor>) -> bool {
    (rotation * head_direction(math::FRAC_PI_2)).y() < 0.0
}
