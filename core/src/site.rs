//! Constants of the place: water, gravity, and how the tunnel lies. Recorded with every log.

/// The site's constants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Site {
    /// Speed of sound in the tunnel's water, m/s. Ranges are rescaled to it (metrics.md, "Errors and uncertainty").
    pub sound_speed_mps: f64,
    /// Density of the water, kg/m^3.
    pub density_kgpm3: f64,
    /// Local gravity, m/s^2.
    pub gravity_mps2: f64,
    /// Pressure at the water's surface, Pa.
    pub surface_pressure_pa: f64,
    /// Height of the water's surface above the tunnel's floor at the portal, m.
    pub surface_above_floor_m: f64,
    /// Yaw of the tunnel's axis in the IMU's level reference, radians.
    pub axis_yaw_rad: f64,
}

impl Default for Site {
    /// Fresh water at about 10 degrees Celsius, standard gravity and atmosphere, 50 m of water above the floor.
    fn default() -> Self {
        Self {
            sound_speed_mps: 1447.0,
            density_kgpm3: 999.7,
            gravity_mps2: 9.806_65,
            surface_pressure_pa: 101_325.0,
            surface_above_floor_m: 50.0,
            axis_yaw_rad: 0.0,
        }
    }
}

impl Site {
    /// What the air's pressure may be at a place where water stands, Pa: from high in the mountains to below the sea's level.
    pub const SURFACE_PRESSURE_PA: core::ops::RangeInclusive<f64> = 40_000.0..=110_000.0;

    /// Depth below the surface in metres of a place at absolute pressure `pressure_pa`, in water at rest.
    pub fn depth_m(&self, pressure_pa: f64) -> f64 {
        (pressure_pa - self.surface_pressure_pa) / (self.density_kgpm3 * self.gravity_mps2)
    }

    /// Absolute pressure in Pa at `depth_m` below the surface, in water at rest.
    pub fn pressure_pa(&self, depth_m: f64) -> f64 {
        self.surface_pressure_pa + depth_m * self.density_kgpm3 * self.gravity_mps2
    }

    /// A range that a device computed with `device_mps`, rescaled to the water's own speed of sound.
    pub fn rescaled_range_m(&self, range_m: f64, device_mps: f64) -> f64 {
        range_m * (self.sound_speed_mps / device_mps)
    }
}
