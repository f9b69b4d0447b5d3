//! Site constants: water, gravity and the direction of the tunnel's axis. Every log records them.

/// Constants of the site: water, gravity and the direction of the tunnel's axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Site {
    /// Speed of sound in the tunnel's water, m/s. Measured ranges are rescaled to this speed.
    pub sound_speed_mps: f64,
    /// Density of the water, kg/m^3.
    pub density_kgpm3: f64,
    /// Local gravity, m/s^2.
    pub gravity_mps2: f64,
    /// Pressure at the water's surface, Pa.
    pub surface_pressure_pa: f64,
    /// Height of the water's surface above the tunnel's floor at the portal, m.
    pub surface_above_floor_m: f64,
    /// Yaw of the tunnel's axis in the IMU's level reference frame, radians.
    pub axis_yaw_rad: f64,
}

/// Speed of sound in fresh water at 0 to 95 degrees Celsius and an absolute pressure, m/s.
///
/// Source for pure water at one atmosphere, within 0.02 m/s: Marczak 1997, J. Acoust. Soc. Am. 102, 2776.
/// Source for the effect of depth, 0.0163 m/s per metre: Mackenzie 1981, J. Acoust. Soc. Am. 70, 807.
pub fn fresh_water_sound_speed_mps(temperature_degc: f64, pressure_pa: f64) -> f64 {
    const COEFFICIENTS: [f64; 6] =
        [1.402_385e3, 5.038_813, -5.799_136e-2, 3.287_156e-4, -1.398_845e-6, 2.787_860e-9];
    const MPS_PER_PA: f64 = 0.0163 / 9_806.65;
    const ATMOSPHERE_PA: f64 = 101_325.0;
    let at_surface =
        COEFFICIENTS.iter().rev().fold(0.0, |sum, coefficient| sum * temperature_degc + coefficient);
    at_surface + (pressure_pa - ATMOSPHERE_PA) * MPS_PER_PA
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
    /// Plausible air pressure at the water's surface, Pa: from high mountains to below sea level.
    pub const SURFACE_PRESSURE_PA: core::ops::RangeInclusive<f64> = 40_000.0..=110_000.0;

    /// Depth below the surface, m, at absolute pressure `pressure_pa`, in still water.
    pub fn depth_m(&self, pressure_pa: f64) -> f64 {
        (pressure_pa - self.surface_pressure_pa) / (self.density_kgpm3 * self.gravity_mps2)
    }

    /// Absolute pressure, Pa, at `depth_m` below the surface, in still water.
    pub fn pressure_pa(&self, depth_m: f64) -> f64 {
        self.surface_pressure_pa + depth_m * self.density_kgpm3 * self.gravity_mps2
    }

    /// Rescales a range, m, to the water's speed of sound. The device computed it with the speed `device_mps`.
    pub fn rescaled_range_m(&self, range_m: f64, device_mps: f64) -> f64 {
        range_m * (self.sound_speed_mps / device_mps)
    }
}

#[cfg(test)]
mod tests {
    use super::{Site, fresh_water_sound_speed_mps};

    /// The reference values come from the tables for pure water by Del Grosso and Mader 1972.
    #[test]
    fn sound_speed_equals_reference_tables() {
        for (degc, mps) in [(0.0, 1402.39), (5.0, 1426.16), (10.0, 1447.27), (20.0, 1482.34), (30.0, 1509.13)]
        {
            let ours = fresh_water_sound_speed_mps(degc, 101_325.0);
            assert!((ours - mps).abs() < 0.05, "{degc}: {ours}");
        }
        let deep = fresh_water_sound_speed_mps(10.0, 101_325.0 + 9_806.65 * 100.0);
        assert!((deep - 1447.27 - 1.63).abs() < 0.05, "{deep}");
    }

    #[test]
    fn pressure_and_depth_follow_from_the_weight_of_water_and_air() {
        // In sea water at 9.8 m/s^2 and under an air pressure of 900 hPa, a depth of 10 m gives 190,450 Pa.
        let sea = Site {
            density_kgpm3: 1025.0,
            gravity_mps2: 9.8,
            surface_pressure_pa: 90_000.0,
            ..Site::default()
        };
        assert!((sea.pressure_pa(10.0) - 190_450.0).abs() < 1e-9, "{}", sea.pressure_pa(10.0));
        assert!((sea.depth_m(190_450.0) - 10.0).abs() < 1e-12, "{}", sea.depth_m(190_450.0));
        // A density change of 2.5 % changes a depth of 50 m by 1.2 m.
        let deep_pa = 101_325.0 + 50.0 * 999.7 * 9.806_65;
        let salty = Site { density_kgpm3: 1025.0, ..Site::default() };
        assert!((Site::default().depth_m(deep_pa) - 50.0).abs() < 1e-9);
        assert!((salty.depth_m(deep_pa) - 48.765_9).abs() < 1e-3, "{}", salty.depth_m(deep_pa));
    }

    #[test]
    fn range_is_rescaled_to_the_local_sound_speed() {
        let site = Site { sound_speed_mps: 1450.0, ..Site::default() };
        assert!((site.rescaled_range_m(5.0, 1500.0) - 5.0 * 29.0 / 30.0).abs() < 1e-12);
    }
}
