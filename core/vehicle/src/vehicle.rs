//! `VEHICLE.toml`: the vehicle, its sensors, the tunnel and the target.

use core::cell::RefCell;

use crate::advice::parse_looks;
use crate::alerts::{AlertTiming, LimitsConfig};
use crate::coverage::CoverageConfig;
use crate::mission::Mission;
use crate::navigation::NavigationConfig;
use crate::sensors::{self, DEGREES, SENSOR_DISTANCE_M, Sensors};
use crate::tunnel::TunnelConfig;
use headrace_config::{ConfigError, ConfigErrors, Document, Loader, Section};
use headrace_coverage::StoreLayout;
use headrace_fusion::Navigation;
use headrace_geometry::frames::Vec3;
use headrace_geometry::site::Site;
use headrace_geometry::time::DurNs;
use headrace_sampling::advice::Looks;
use headrace_sampling::head::{HeadProgram, HeadSpec};
use headrace_sampling::layout::{self, HeadLayout};
use headrace_sampling::occlusion::Obstacle;
use headrace_sampling::plan::Inspection;
use headrace_sampling::{SamplingError, Target};
use headrace_sensor::SensorConfig;
use headrace_sensor::device::{CounterSpec, Device, DeviceKind, Sense};

/// A validated vehicle file.
pub struct VehicleConfig {
    /// Name of the vehicle.
    pub name: String,
    /// Coverage target, with the confidence of verdicts.
    pub target: Target,
    /// Length of a section along the tunnel, m.
    pub section_m: f64,
    /// Water properties, gravity and levels of the site.
    pub site: Site,
    /// Depth sensor whose temperature determines the speed of sound, instead of the site's value.
    pub sound_speed_from: Option<String>,
    /// The tunnel: profile and length.
    pub tunnel: TunnelConfig,
    /// Arrangement of the heads: phase-shift or sector-offset mode.
    pub layout: HeadLayout,
    /// Speed for which the heads' phases are planned, m/s. Zero means that the plan ignores the heads' positions along
    /// the hull.
    pub planned_speed_mps: f64,
    /// Parts of the vehicle that may occlude a head.
    pub hull: Vec<Obstacle>,
    /// Verdict parameters and openings of the wall.
    pub coverage: CoverageConfig,
    /// Navigation method and settings.
    pub navigation: NavigationConfig,
    /// Settings of the rays that locate the wall for the speed advice: the angle between them, and the movement of the
    /// vehicle after which they are cast again.
    pub looks: Looks,
    /// Maximum duration of the dive.
    pub dive_time: Option<DurNs>,
    /// Delays of alerts by alert class.
    pub alerts: AlertTiming,
    /// Limits of cable length and dive time.
    pub limits: LimitsConfig,
    /// The sensors in the order of the file. Their sources have the same order.
    pub sensors: Vec<Box<dyn Device>>,
    /// For each sensor in `sensors`, the keys that all kinds of sensor have.
    pub sensor_configs: Vec<SensorConfig>,
    /// Step and noise of the cable counter; `None` without one.
    pub counter: Option<CounterSpec>,
    /// Names and texts of the files that the vehicle file refers to, so that a log can be replayed without these files.
    pub attachments: Vec<(String, String)>,
}

/// The `[water]` table and the water levels, read into a [`Site`].
pub type WaterConfig = Site;

/// Allowed values of the target, m.
pub(super) const TARGET_M: core::ops::RangeInclusive<f64> = 0.01..=20.0;

/// Limits on the number of sections and wall cells. Each keeps the memory allocated at startup below some hundred
/// megabytes.
const MAX_SECTIONS: f64 = 400_000.0;
const MAX_CELLS: f64 = 2e8;

/// Number of wall cells that the sample store needs for a tunnel and a target.
fn wall_cells(tunnel: &TunnelConfig, target_m: f64) -> f64 {
    let cell_m = StoreLayout::cell_for_target_m(target_m);
    tunnel.length_m * tunnel.profile.perimeter_m() / (cell_m * cell_m)
}

impl VehicleConfig {
    /// Parses and checks a vehicle file against the device kinds in this build.
    ///
    /// Errors: every key that is missing, unknown or out of range, with its line.
    pub fn parse(
        document: Document<'_>,
        kinds: &[&dyn DeviceKind],
        load: Loader<'_>,
    ) -> Result<Self, ConfigErrors> {
        let attachments = RefCell::new(Vec::new());
        let load = |name: &str| {
            let text = load(name)?;
            let mut attachments = attachments.borrow_mut();
            if attachments.iter().all(|(attached, _)| attached != name) {
                attachments.push((name.to_owned(), text.clone()));
            }
            Ok(text)
        };
        let vehicle = document.read(|root| Self::from_root(root, kinds, &load))?;
        Ok(Self { attachments: attachments.into_inner(), ..vehicle })
    }

    /// Reads the whole vehicle file. `load` returns the text of a file to which it refers. `attachments` stays empty.
    ///
    /// If a part of the file is invalid, checks that depend on it are skipped.
    fn from_root(
        root: &Section<'_>,
        kinds: &[&dyn DeviceKind],
        load: Loader<'_>,
    ) -> Result<Self, ConfigError> {
        let name = root.text("name")?.unwrap_or_else(|| "unnamed vehicle".to_owned());
        let target_m = root.number("target_m", TARGET_M)?;
        let section_m = root.part(|| root.number("section_m", 0.05..=10.0))?.map(|m| m.unwrap_or(0.25));
        let dive_time = root.number("dive_hours", 0.01..=1000.0)?;
        let (tunnel, axis_yaw_rad) = parse_tunnel(root, load)?;
        if let (Some(tunnel), Some(target_m), Some(section_m)) = (&tunnel, target_m, section_m) {
            root.part(|| check_fineness(root, tunnel, target_m, section_m))?;
        }
        let usual = (Site { axis_yaw_rad, ..Site::default() }, None);
        let water = table_or(root, "water", usual, |water| parse_water(water, axis_yaw_rad))?;
        let (coverage, confidence_sd) =
            CoverageConfig::of_root(root, tunnel.as_ref().map(|tunnel| &tunnel.profile), target_m)?;
        let hull = parse_hulls(root)?;
        let tables = root.sections("sensors")?.into_iter().map(|table| table.with_files(load)).collect();
        let sensors = sensors::parse(root, tables, kinds)?;
        let devices = sensors.as_ref().map(|sensors| sensors.devices.as_slice());
        let counter = devices.unwrap_or_default().iter().find_map(|sensor| sensor.counter());
        let navigation = parse_navigation(root, devices.unwrap_or_default(), counter)?;
        let usual = (HeadLayout::PhaseShift, 0.0);
        let heads = table_or(root, "heads", usual, |section| parse_heads(section, devices))?;
        let looks = table_or(root, "advice", Looks::default(), parse_looks)?;
        let alerts = table_or(root, "alerts", AlertTiming::default(), AlertTiming::parse)?;
        let limits = table_or(root, "limits", LimitsConfig::default(), LimitsConfig::parse)?;
        if let Some(sensors) = &sensors {
            root.part(|| check_heads(root, &sensors.devices, &hull))?;
            root.part(|| check_sound(root, water.as_ref(), sensors))?;
        }
        root.finish()?;
        let (target_m, tunnel) = (root.required("target_m", target_m), root.required("tunnel", tunnel));
        let (site, sound_speed_from) = root.required("water", water)?;
        let (layout, planned_speed_mps) = root.required("heads", heads)?;
        let sensors = root.required("sensors", sensors)?;
        Ok(Self {
            name,
            target: Target { max_hole_m: target_m?, confidence_sd },
            section_m: root.required("section_m", section_m)?,
            site,
            sound_speed_from,
            tunnel: tunnel?,
            layout,
            planned_speed_mps,
            hull,
            coverage,
            navigation: root.required("navigation", navigation)?,
            counter,
            looks: root.required("advice", looks)?,
            dive_time: dive_time.map(|hours| DurNs::from_secs_f64(hours * 3600.0)),
            alerts: root.required("alerts", alerts)?,
            limits: root.required("limits", limits)?,
            sensors: sensors.devices,
            sensor_configs: sensors.configs,
            attachments: Vec::new(),
        })
    }

    /// Returns the mission parameters of this vehicle.
    pub fn mission(&self) -> Mission {
        let mission = Mission {
            profile: self.tunnel.profile.clone(),
            site: self.site,
            sound_speed_from: self.sound_speed_from.clone(),
            target: self.target,
            section_m: self.section_m,
            length_m: self.tunnel.length_m,
            layout: self.layout,
            planned_speed_mps: self.planned_speed_mps,
            hull: self.hull.clone(),
            coverage: self.coverage.clone(),
            looks: self.looks,
            dive_time: self.dive_time,
            alerts: self.alerts,
            limits: LimitsConfig { dive_time: self.limits.dive_time.or(self.dive_time), ..self.limits },
        };
        debug_assert!(mission.is_valid(), "a mission has lengths: {mission:?}");
        mission
    }

    /// Returns the navigation at the start of a dive.
    pub fn navigation(&self) -> Box<dyn Navigation> {
        self.navigation.begin(&self.tunnel.profile, self.site)
    }

    /// Scan programs of the heads, in the order of the file. Empty if there are no heads.
    ///
    /// Errors: no program fits the heads.
    pub fn programs(&self) -> Result<Vec<HeadProgram>, SamplingError> {
        let heads = self.heads();
        if heads.is_empty() {
            return Ok(Vec::new());
        }
        layout::programs(&heads, self.layout, self.planned_speed_mps)
    }

    /// The profiling heads, in the order of the file.
    pub fn heads(&self) -> Vec<HeadSpec> {
        self.sensors.iter().filter_map(|sensor| sensor.head()).collect()
    }

    /// Returns the input of a plan. The vehicle has the configured heads and travels steadily in the tunnel's centre.
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

/// Reads a table. Returns `default` if the table is absent, and `None` if it is wrong.
fn table_or<T>(
    root: &Section<'_>,
    name: &'static str,
    default: T,
    parse: impl FnOnce(&Section<'_>) -> Result<T, ConfigError>,
) -> Result<Option<T>, ConfigError> {
    root.section(name)?.map_or(Ok(Some(default)), |section| root.part(|| parse(&section)))
}

/// Reads the tunnel and the yaw of its axis, radians.
///
/// The tunnel is `None` if it is missing or invalid.
fn parse_tunnel(root: &Section<'_>, load: Loader<'_>) -> Result<(Option<TunnelConfig>, f64), ConfigError> {
    let Some(section) = root.section("tunnel")? else { return Ok((None, 0.0)) };
    let axis_yaw_rad = section.number("axis_yaw_deg", DEGREES)?.unwrap_or(0.0).to_radians();
    Ok((root.part(|| TunnelConfig::from_section(&section, load))?, axis_yaw_rad))
}

/// Checks that sections and wall cells are large enough for the memory that the loop allocates.
fn check_fineness(
    root: &Section<'_>,
    tunnel: &TunnelConfig,
    target_m: f64,
    section_m: f64,
) -> Result<(), ConfigError> {
    let key = if tunnel.length_m / section_m > MAX_SECTIONS {
        "section_m"
    } else if wall_cells(tunnel, target_m) > MAX_CELLS {
        "target_m"
    } else {
        return Ok(());
    };
    let problem = format!(
        "is too small for a tunnel of {} m; increase {key}, or reduce tunnel.length_m",
        tunnel.length_m
    );
    Err(root.invalid(key, &problem))
}

fn parse_water(section: &Section<'_>, axis_yaw_rad: f64) -> Result<(Site, Option<String>), ConfigError> {
    let usual = Site::default();
    let or = |value: Option<f64>, default| value.unwrap_or(default);
    let site = Site {
        sound_speed_mps: or(section.number("sound_speed_mps", 1300.0..=1700.0)?, usual.sound_speed_mps),
        density_kgpm3: or(section.number("density_kgpm3", 900.0..=1100.0)?, usual.density_kgpm3),
        gravity_mps2: or(section.number("gravity_mps2", 9.7..=9.9)?, usual.gravity_mps2),
        surface_pressure_pa: or(
            section.number("surface_pressure_pa", Site::SURFACE_PRESSURE_PA)?,
            usual.surface_pressure_pa,
        ),
        surface_above_floor_m: or(
            section.number("surface_above_floor_m", 0.0..=1000.0)?,
            usual.surface_above_floor_m,
        ),
        axis_yaw_rad,
    };
    let sound_speed_from = section.text("sound_speed_from")?;
    section.finish()?;
    Ok((site, sound_speed_from))
}

/// Reads the boxes of the hull, except invalid ones.
fn parse_hulls(root: &Section<'_>) -> Result<Vec<Obstacle>, ConfigError> {
    let mut hull = Vec::new();
    for section in root.sections("hull")? {
        hull.extend(root.part(|| parse_hull(&section))?);
    }
    Ok(hull)
}

fn parse_hull(section: &Section<'_>) -> Result<Obstacle, ConfigError> {
    let corner = |key: &'static str| section.required(key, section.triple(key, SENSOR_DISTANCE_M)?);
    let (least, most) = (corner("least_m"), corner("most_m"));
    section.finish()?;
    let (least, most) = (least?, most?);
    if least.iter().zip(&most).any(|(least, most)| least >= most) {
        return Err(section.invalid("most_m", "must be larger than least_m in each of x, y, z"));
    }
    let point = |[x, y, z]: [f64; 3]| Vec3::new(x, y, z);
    Ok(Obstacle::Box { least: point(least), most: point(most) })
}

/// Reads the navigation settings of a vehicle with these sensors. `None` if the `[navigation]` table is wrong.
fn parse_navigation(
    root: &Section<'_>,
    devices: &[Box<dyn Device>],
    counter: Option<CounterSpec>,
) -> Result<Option<NavigationConfig>, ConfigError> {
    let noise = devices.iter().find_map(|sensor| sensor.inertial_noise());
    let section = root.section("navigation")?;
    root.part(|| NavigationConfig::parse(section, noise, counter))
}

/// Checks that the sensor that supplies the speed of sound exists and is a depth sensor.
fn check_sound(
    root: &Section<'_>,
    water: Option<&(Site, Option<String>)>,
    sensors: &Sensors,
) -> Result<(), ConfigError> {
    let Some(id) = water.and_then(|(_, from)| from.as_deref()) else { return Ok(()) };
    let named = sensors.configs.iter().zip(&sensors.devices).find(|(config, _)| config.id == id);
    if named.is_some_and(|(_, sensor)| sensor.sense() == Sense::Depth) {
        return Ok(());
    }
    let problem = format!("sound_speed_from = {id:?} is not the id of a depth sensor in this file");
    Err(root.invalid("water", &problem))
}

/// Checks the number of heads, and that no head is inside a hull box.
///
/// A head inside a hull box is an error, because the box could not occlude it.
fn check_heads(
    root: &Section<'_>,
    sensors: &[Box<dyn Device>],
    hull: &[Obstacle],
) -> Result<(), ConfigError> {
    let heads: Vec<HeadSpec> = sensors.iter().filter_map(|sensor| sensor.head()).collect();
    if !heads.is_empty() {
        HeadLayout::PhaseShift.check(heads.len()).map_err(|why| root.invalid("sensors", &why.to_string()))?;
    }
    for (number, part) in hull.iter().enumerate() {
        if heads.iter().any(|head| part.holds(head.mount.position)) {
            let problem = format!(
                "box {number} (from 0) has a profiling head inside; a head must be clear of the hull"
            );
            return Err(root.invalid("hull", &problem));
        }
    }
    Ok(())
}

/// Reads the layout and the planned speed, m/s. `sensors` is `None` unless all sensors are valid.
fn parse_heads(
    section: &Section<'_>,
    sensors: Option<&[Box<dyn Device>]>,
) -> Result<(HeadLayout, f64), ConfigError> {
    let layout = section.choice("layout", &HeadLayout::NAMES)?.unwrap_or(HeadLayout::PhaseShift);
    let speed = section.number("planned_speed_mps", 0.0..=5.0)?.unwrap_or(0.0);
    section.finish()?;
    if let (HeadLayout::SectorOffset, Some(sensors)) = (layout, sensors) {
        let heads = sensors.iter().filter(|sensor| sensor.head().is_some()).count();
        layout.check(heads).map_err(|why| section.invalid("layout", &why.to_string()))?;
    }
    Ok((layout, speed))
}
