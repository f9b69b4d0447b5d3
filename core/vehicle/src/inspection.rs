//! Planning input from a vehicle file.

use headrace_sampling::plan::Inspection;

use crate::VehicleConfig;

impl VehicleConfig {
    /// Returns the inspection of its tunnel by its heads as configured, steady in the centre.
    ///
    /// Errors: a message about a head's range setting without modes.
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
