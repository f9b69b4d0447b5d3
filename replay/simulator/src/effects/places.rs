//! The stretches of the tunnel in which an effect acts on each sensor.

use headrace_config::{ConfigError, Section};
use headrace_sensor::device::Sense;

use super::targets::{PerSensor, targets};
use crate::facts::Facts;
use crate::sensing::{Ray, Scenery};
use crate::stretch::Stretch;

/// The stretches in which an effect acts on one sensor, each with the effect's parameters there.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Places<P>(Vec<(Stretch, P)>);

impl<P: Clone> PerSensor<Places<P>> {
    /// Reads tables as [`PerSensor::read`] does. Each table applies only from `from_m` to `to_m`.
    ///
    /// A sensor may have several stretches if they don't overlap.
    ///
    /// Errors: those of [`PerSensor::read`]; stretches of one sensor overlap.
    pub(super) fn read_by_place(
        tables: Vec<Section<'_>>,
        facts: &Facts,
        senses: &[Sense],
        mut read: impl FnMut(&Section<'_>) -> Result<P, ConfigError>,
    ) -> Result<Self, ConfigError> {
        let mut found: Vec<(usize, Places<P>)> = Vec::new();
        for table in tables {
            let read = table.part(|| {
                let sensors = targets(&table, facts, senses);
                let stretch = Stretch::read(&table, facts.length_m)?;
                let parameters = read(&table)?;
                table.finish()?;
                Ok((sensors?, stretch, parameters))
            })?;
            let Some((sensors, stretch, parameters)) = read else { continue };
            for source in sensors {
                if !found.iter().any(|(other, _)| *other == source) {
                    found.push((source, Places(Vec::new())));
                }
                let of_sensor = found.iter_mut().find(|(other, _)| *other == source);
                let Some((_, places)) = of_sensor else { continue };
                if places.0.iter().any(|(other, _)| other.meets(&stretch)) {
                    let id = facts.sensors.get(source).map_or("", |sensor| sensor.id.as_str());
                    let problem = format!(
                        "names {id:?}, which an earlier table of this effect names for this place already"
                    );
                    return Err(table.invalid("sensors", &problem));
                }
                places.0.push((stretch, parameters.clone()));
            }
        }
        found.sort_by_key(|(source, _)| *source);
        Ok(Self(found))
    }
}

impl<P> Places<P> {
    /// The parameters at the origin of a sonar's beam `ray`, if the effect acts there.
    ///
    /// If the effect acts in the whole tunnel, the origin's chainage isn't computed.
    pub(super) fn here(&self, scenery: &Scenery, ray: &Ray) -> Option<&P> {
        self.at(|| {
            let [chainage_m, ..] = scenery.environment.axis().chart(ray.origin);
            chainage_m
        })
    }

    /// The parameters at a chainage, if the effect acts there.
    pub(super) fn at(&self, chainage_m: impl FnOnce() -> f64) -> Option<&P> {
        if let [(Stretch::ALL, everywhere)] = self.0.as_slice() {
            return Some(everywhere);
        }
        let chainage_m = chainage_m();
        self.0.iter().find(|(stretch, _)| stretch.has(chainage_m)).map(|(_, parameters)| parameters)
    }

    /// Returns the same stretches, with the effect's parameters converted by `how`.
    pub(super) fn map<Q>(&self, mut how: impl FnMut(&P) -> Q) -> Places<Q> {
        Places(self.0.iter().map(|(stretch, parameters)| (*stretch, how(parameters))).collect())
    }

    /// Parameters of the effect in each stretch, in the order of the scene.
    pub(super) fn all(&self) -> impl Iterator<Item = &P> {
        self.0.iter().map(|(_, parameters)| parameters)
    }
}

#[cfg(test)]
mod tests {
    use crate::TruthRow;
    use crate::testing::{Dive, assert_share};

    /// Chainage of each sounding, and whether the effects changed the sounding. The sonar is at the vehicle's middle,
    /// so its chainage is the vehicle's true chainage.
    fn touched(effects: &str) -> Vec<(f64, bool)> {
        let dive = Dive { seconds: 100.0, ..Dive::with_head() };
        let range_m = |row: &TruthRow| row.sounding.and_then(|sounding| sounding.measured.range_m);
        let effects = format!("[effects.motion_within_turn]\n{effects}");
        let (plain, with) = (dive.dive("[effects.motion_within_turn]"), dive.dive(&effects));
        plain.rows.iter().zip(&with.rows).map(|(a, b)| (a.chainage_m, range_m(a) != range_m(b))).collect()
    }

    #[test]
    fn effects_act_only_in_their_stretches() {
        for effect in [
            "missing_returns]]\nshare = 0.4\n",
            "outliers]]\nshare = 0.4\n",
            "range_noise]]\nsd_m = 0.1\n",
            "multipath]]\nsquare_share = 0.4\nshare = 0.4\n",
            "side_lobes]]\nshare = 0.4\nangle_deg = 20\n",
            "echo_strength]]\nwall_db = -20\ngain_db = 0\n",
            "near_returns]]\nshare = 0.4\n",
            "sound_speed_profile]]\nper_metre_mps = 3\n",
        ] {
            let two = format!(
                "[[effects.{effect}from_m = 5\nto_m = 8\n[[effects.{effect}from_m = 12\nto_m = 13.5\n"
            );
            let inside = |x_m: f64| (5.0..8.0).contains(&x_m) || (12.0..13.5).contains(&x_m);
            let (mut within, mut without) = ((0, 0), 0);
            for (x_m, changed) in touched(&two) {
                if inside(x_m) {
                    within = (within.0 + usize::from(changed), within.1 + 1);
                } else {
                    without += usize::from(changed);
                }
            }
            assert_eq!(without, 0, "{effect}");
            assert!(within.0 > within.1 / 20, "{effect}: {within:?}");
            if effect.starts_with("missing") {
                assert_share(within.0, within.1, 0.4);
            }
        }
    }

    /// With one table per stretch, an effect draws the same random numbers at each step as with one table for the
    /// tunnel.
    #[test]
    fn effect_in_adjacent_stretches_equals_the_effect_in_the_whole_tunnel() {
        let dive = Dive { seconds: 40.0, ..Dive::with_head() };
        for effect in
            ["outliers]]\nshare = 0.4\n", "range_noise]]\nsd_m = 0.1\n", "missing_returns]]\nshare = 0.2\n"]
        {
            let whole = dive.dive(&format!("[[effects.{effect}"));
            let parts = format!("[[effects.{effect}to_m = 4\n[[effects.{effect}from_m = 4\n");
            assert!(dive.dive(&parts).messages == whole.messages, "{effect}");
            dive.assert_slices_dont_matter(&parts);
        }
    }

    #[test]
    fn overlapping_and_empty_stretches_are_refused() {
        let refusal = |keys: &str| Dive::with_head().refusal(keys);
        let two = "[[effects.outliers]]\nfrom_m = 5\nto_m = 9\n[[effects.outliers]]\nfrom_m = 8\nto_m = 12";
        assert!(refusal(two).contains("which an earlier table of this effect names for this place already"));
        assert!(
            refusal("[effects.outliers]\nfrom_m = 5\nto_m = 5").contains("must be above from_m, which is 5")
        );
        assert!(refusal("[effects.outliers]\nfrom_m = 6000").contains("from 0 to 5000"));
    }
}
