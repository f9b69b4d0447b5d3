//! Planning input from a vehicle file.

use headrace_sampling::plan::Inspection;

use crate::VehicleConfig;

impl VehicleConfig {
    /// Returns the inspection with the heads as configured and the vehicle steady in the centre.
    ///
    /// Errors: no modes are known for a head's range setting.
    pub fn inspection(&self) -> Result<Inspection, String> {
        let heads = self.sensors.iter().filter_map(|sensor| Some((sensor.head()?, sensor.modes(None))));
        let heads = heads.map(|(spec, modes)| Ok((spec, modes?))).collect::<Result<_, String>>()?;
        Ok(Inspection {
            profile: self.tunnel.profile.clone(),
            length_m: self.tunnel.length_m,
            place: self.tunnel.profile.reference(),
            heads,
            hull: self.hull.clone(),
            layout: self.layout,
            drift_m: 0.0,
            yaw_rad: 0.0,
            yaw_rate_radps: 0.0,
            sound_speed_mps: self.site.sound_speed_mps,
        })
    }
}
