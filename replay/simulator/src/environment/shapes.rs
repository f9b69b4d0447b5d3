//! Bodies in the water and hollows in the rock.
//!
//! For a body, the question is where a ray first hits it. For a hollow, the question is how far a ray inside it
//! travels. A new kind of shape is a new variant of [`Solid`] or [`Hollow`].

use headrace_geometry::math;
use headrace_geometry::tunnel::{Profile, Yz};

#[cfg(feature = "mesh")]
use super::mesh_parts::MeshBody;
use super::vector::Frame;
use super::vector::{Ray, V3, along, dot, unit};

/// Largest distance between a point and a hollow at which the point counts as in the hollow, m.
///
/// A face of a hollow may lie on the wall itself, like the upper face of a ditch in a flat floor. Rounding errors must
/// not leave a wall between tube and hollow.
pub(super) const SKIN_M: f64 = 1e-6;

/// A solid body that stops a ray.
#[derive(Debug, Clone)]
pub(super) enum Solid {
    /// An ellipsoid with these half diameters along the axes of the frame, m.
    Ellipsoid(Frame, V3),
    /// A box with these half lengths along the axes of the frame, m.
    Block(Frame, V3),
    /// A body enclosed by the triangles of a mesh.
    #[cfg(feature = "mesh")]
    Mesh(MeshBody),
}

/// A hollow in the rock beyond the tunnel's wall, through which a ray continues.
#[derive(Debug, Clone)]
pub(super) enum Hollow {
    /// A box with these half lengths along the axes of the frame, m.
    Block(Frame, V3),
    /// A slot around the whole tunnel, as for a gate.
    Ring(Ring),
}

/// A short length of a wider tunnel: the profile, scaled up.
#[derive(Debug, Clone)]
pub(super) struct Ring {
    /// Frame with its origin on the axis at z = 0, and axes along the tunnel, left and up.
    pub(super) frame: Frame,
    /// Half the slot's extent along the tunnel, m.
    pub(super) half_width_m: f64,
    /// The tunnel's profile before scaling.
    pub(super) profile: Profile,
    /// Point (y, z) of the section about which the profile is scaled: the profile's reference point.
    pub(super) reference: Yz,
    /// Factor by which the slot's profile is larger than the tunnel's.
    pub(super) scale: f64,
}

/// Ray parameters at which a ray enters and leaves a convex shape, with the outward normals there.
struct Chord {
    enter: (f64, V3),
    leave: (f64, V3),
}

impl Solid {
    /// First hit of a ray on the body: the range, or 0 if the ray starts inside, and the outward normal.
    pub(super) fn meet(&self, ray: &Ray) -> Option<(f64, V3)> {
        let chord = match self {
            Self::Ellipsoid(frame, half) => ellipsoid_chord(frame, *half, ray)?,
            Self::Block(frame, half) => block_chord(frame, *half, ray)?,
            #[cfg(feature = "mesh")]
            Self::Mesh(body) => return body.meet(ray),
        };
        let (enter_m, normal) = chord.enter;
        (chord.leave.0 > 0.0).then_some((enter_m.max(0.0), normal))
    }

    /// Whether `point` is inside the body.
    pub(super) fn contains(&self, point: V3) -> bool {
        match self {
            Self::Ellipsoid(frame, half) => {
                let local = frame.local(point);
                let share: f64 = local.iter().zip(half).map(|(c, h)| (c / h) * (c / h)).sum();
                share < 1.0
            }
            Self::Block(frame, half) => block_contains(frame, half, point),
            #[cfg(feature = "mesh")]
            Self::Mesh(body) => body.contains(point),
        }
    }
}

impl Hollow {
    /// Range at which the ray leaves the hollow, and the normal towards the water there; `None` if the point at `t_m`
    /// is not in the hollow.
    pub(super) fn leave(&self, ray: &Ray, t_m: f64) -> Option<(f64, V3)> {
        match self {
            Self::Block(frame, half) => {
                let chord = block_chord(frame, *half, ray)?;
                let (leave_m, normal) = chord.leave;
                (chord.enter.0 <= t_m + SKIN_M && leave_m > t_m).then_some((leave_m, normal.map(|c| -c)))
            }
            Self::Ring(ring) => ring.leave(ray, t_m),
        }
    }

    /// Whether `point` is inside the hollow.
    pub(super) fn contains(&self, point: V3) -> bool {
        match self {
            Self::Block(frame, half) => block_contains(frame, half, point),
            Self::Ring(ring) => ring.holds(ring.frame.local(point)),
        }
    }
}

impl Ring {
    fn unscaled(&self, [_, y, z]: V3) -> Yz {
        let [ry, rz] = self.profile.reference();
        [ry + (y - self.reference[0]) / self.scale, rz + (z - self.reference[1]) / self.scale]
    }

    fn holds(&self, local: V3) -> bool {
        local[0].abs() <= self.half_width_m && self.profile.contains(self.unscaled(local))
    }

    fn leave(&self, ray: &Ray, t_m: f64) -> Option<(f64, V3)> {
        let ray = self.frame.local_ray(ray);
        // The tested point lies slightly farther along the ray, because rounding alone decides whether a point exactly
        // on the hollow's boundary is inside.
        let t_m = t_m + SKIN_M;
        let at = ray.at(t_m);
        if !self.holds(at) {
            return None;
        }
        let [dx, dy, dz] = ray.direction;
        let side = dx.signum();
        let slab_m = if dx == 0.0 { f64::INFINITY } else { (side * self.half_width_m - at[0]) / dx };
        let wall = self
            .profile
            .cast_from_inside(self.unscaled(at), [dy / self.scale, dz / self.scale])
            .filter(|hit| hit.range_m < slab_m);
        let (further_m, normal) = match wall {
            Some(hit) => (hit.range_m, [0.0, hit.normal[0], hit.normal[1]]),
            None => (slab_m, [-side, 0.0, 0.0]),
        };
        Some((t_m + further_m, self.frame.outwards(normal)))
    }
}

fn block_contains(frame: &Frame, half: &V3, point: V3) -> bool {
    frame.local(point).iter().zip(half).all(|(c, h)| c.abs() <= *h)
}

fn block_chord(frame: &Frame, half: V3, ray: &Ray) -> Option<Chord> {
    let local = frame.local_ray(ray);
    let mut enter = (f64::NEG_INFINITY, [0.0; 3]);
    let mut leave = (f64::INFINITY, [0.0; 3]);
    for (k, axis) in frame.axes.iter().enumerate() {
        let (at, slope) = (local.origin[k], local.direction[k]);
        if slope == 0.0 {
            if at.abs() > half[k] {
                return None;
            }
            continue;
        }
        let side = slope.signum();
        let (near, far) = ((-side * half[k] - at) / slope, (side * half[k] - at) / slope);
        if near > enter.0 {
            enter = (near, axis.map(|c| -side * c));
        }
        if far < leave.0 {
            leave = (far, axis.map(|c| side * c));
        }
    }
    (enter.0 < leave.0).then_some(Chord { enter, leave })
}

fn ellipsoid_chord(frame: &Frame, half: V3, ray: &Ray) -> Option<Chord> {
    let local = frame.local_ray(ray);
    // In units of the half diameters, the ellipsoid is a unit sphere. Half the chord follows from the ray's least
    // distance to the centre. This loses fewer digits than the discriminant b * b - a * c.
    let origin = [local.origin[0] / half[0], local.origin[1] / half[1], local.origin[2] / half[2]];
    let slope = [local.direction[0] / half[0], local.direction[1] / half[1], local.direction[2] / half[2]];
    let a = dot(slope, slope);
    let middle = -dot(origin, slope) / a;
    let nearest = along(origin, middle, slope);
    let rest = 1.0 - dot(nearest, nearest);
    if rest <= 0.0 {
        return None;
    }
    let half_chord = math::sqrt(rest / a);
    let end = |t: f64| {
        let on_sphere = along(origin, t, slope);
        let gradient = [on_sphere[0] / half[0], on_sphere[1] / half[1], on_sphere[2] / half[2]];
        (t, unit(frame.outwards(gradient)))
    };
    Some(Chord { enter: end(middle - half_chord), leave: end(middle + half_chord) })
}
