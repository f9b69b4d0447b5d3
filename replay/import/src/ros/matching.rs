//! Assigns topics to sensors, either by a mapping, or automatically if only one assignment is possible.

use headrace_config::{ConfigError, Section};
use headrace_sensor::device::Sense;
use headrace_vehicle::VehicleConfig;

use super::clocks::Base;
use super::feed::{Feed, Manner};
use super::feeds::{Feeds, Topic};
use super::message::Type;
use super::points::Plane;
use crate::csv::{LENGTH, PRESSURE, SOUND_SPEED_MPS};
use crate::emulated::EmulatedSensor;

/// Reason why topics can't be assigned to sensors.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MatchError {
    /// The mapping of topics to sensors is invalid.
    #[error(transparent)]
    Mapping(#[from] ConfigError),
    /// More than one assignment of topics to sensors is possible.
    #[error(
        "can't tell which {sense} sends which topic: topics {topics}, sensors {sensors}; assign them with --map MAPPING.toml"
    )]
    Several {
        /// The kind of measurement that has several topics or sensors.
        sense: &'static str,
        /// The topics with this kind of measurement.
        topics: String,
        /// The sensors with this kind of measurement.
        sensors: String,
    },
    /// No assignment of topics to sensors is possible.
    #[error("no topic belongs to a sensor of the vehicle file: topics {topics}; sensors {sensors}")]
    None {
        /// The topics of the recording, each with its message type.
        topics: String,
        /// The sensors of the vehicle file, each with its kind of measurement.
        sensors: String,
    },
}

const SENSES: [Sense; 5] = [Sense::Head, Sense::Echosounder, Sense::Depth, Sense::Inertial, Sense::Velocity];

/// Maximum number of topics listed in an error; a recording may have hundreds.
const MOST_SHOWN: usize = 20;

impl Feeds {
    /// Assigns topics without a mapping.
    ///
    /// A sensor and a topic are matched if each is the only one for its kind of measurement.
    ///
    /// Errors: a kind of measurement has several topics or sensors, or no kind has both a topic and a sensor.
    pub fn matching(vehicle: &VehicleConfig, topics: &[Topic]) -> Result<Self, MatchError> {
        let mut feeds = Self::default();
        for sense in SENSES {
            let fitting =
                |topic: &&Topic| topic.of().is_some_and(|of| of.is_self_describing() && of.sense() == sense);
            let fitting: Vec<&Topic> = topics.iter().filter(fitting).collect();
            let sensors: Vec<_> =
                EmulatedSensor::all(vehicle).filter(|(_, device)| device.sense() == sense).collect();
            match (fitting.as_slice(), sensors.as_slice()) {
                ([], _) | (_, []) => (),
                ([topic], [(id, device)]) => {
                    let Some(of) = topic.of() else { continue };
                    let sensor = EmulatedSensor::new(id, *device, vehicle);
                    feeds.matched.push(format!("{} ({}) is assigned to {id}", topic.name, topic.type_name));
                    feeds.by_topic.insert(topic.name.clone(), Feed::new(of, sensor, Manner::default()));
                }
                (topics, sensors) => {
                    let ids: Vec<&str> = sensors.iter().map(|(id, _)| *id).collect();
                    let topics = shown(topics.iter().copied());
                    return Err(MatchError::Several {
                        sense: sense.as_str(),
                        topics,
                        sensors: ids.join(", "),
                    });
                }
            }
        }
        if feeds.by_topic.is_empty() {
            let sensors: Vec<String> = EmulatedSensor::all(vehicle)
                .map(|(id, device)| format!("{id} ({})", device.sense().as_str()))
                .collect();
            return Err(MatchError::None { topics: shown(topics.iter()), sensors: sensors.join(", ") });
        }
        Ok(feeds)
    }

    /// Assigns topics to sensors only as a mapping says.
    ///
    /// Errors: a key has an invalid value, a sensor or topic is unknown, or a topic doesn't fit its sensor's kind.
    pub fn mapped(
        mapping: &Section<'_>,
        vehicle: &VehicleConfig,
        topics: &[Topic],
    ) -> Result<Self, MatchError> {
        let mut feeds = Self::default();
        let sections = mapping.sections("topics")?;
        if sections.is_empty() {
            let problem = "is missing; at least one table headed [[topics]] must assign a topic to a sensor";
            return Err(mapping.invalid("topics", problem).into());
        }
        for section in sections {
            let (topic, feed) = feed(&section, vehicle, topics)?;
            let same_sensor = |other: &Feed| other.sensor_id() == feed.sensor_id();
            if let Some((earlier, _)) = feeds.by_topic.iter().find(|(_, other)| same_sensor(other)) {
                let problem = format!("already has a topic, {earlier}; assign one topic to each sensor");
                return Err(section.invalid("sensor", &problem).into());
            }
            if feeds.by_topic.insert(topic, feed).is_some() {
                let problem = "is named twice; assign each topic to one sensor";
                return Err(section.invalid("topic", problem).into());
            }
            section.finish()?;
        }
        mapping.finish()?;
        Ok(feeds)
    }
}

fn feed(
    section: &Section<'_>,
    vehicle: &VehicleConfig,
    topics: &[Topic],
) -> Result<(String, Feed), MatchError> {
    let name = section.required("topic", section.text("topic")?)?;
    let Some(topic) = topics.iter().find(|topic| topic.name == name) else {
        let problem = format!("isn't a topic of the file, which has {}", shown(topics.iter()));
        return Err(section.invalid("topic", &problem).into());
    };
    let of = match &topic.known {
        Ok(of) => *of,
        Err(why) => return Err(section.invalid("topic", &format!("can't be read: {why}")).into()),
    };
    let id = section.required("sensor", section.text("sensor")?)?;
    let sensor = EmulatedSensor::named(section, vehicle, &id)?;
    if sensor.sense != of.sense() {
        let (is, wants) = (sensor.sense.as_str(), of.sense().as_str());
        let problem = format!(
            "is {}, but a topic of {} belongs to {}",
            with_article(is),
            topic.type_name,
            with_article(wants)
        );
        return Err(section.invalid("sensor", &problem).into());
    }
    let base = section.choice("time", &[("record", Base::Record), ("header", Base::Header)])?;
    if base == Some(Base::Header) && !of.is_self_describing() {
        return Err(section.invalid("time", "must be \"record\": such messages have no header").into());
    }
    let units = if of.sense() == Sense::Depth { PRESSURE } else { LENGTH };
    let takes_unit = matches!(of.sense(), Sense::Depth | Sense::Tether);
    let unit = if takes_unit { section.choice("unit", units)? } else { None };
    let factor = if takes_unit { section.number("factor", -1e9..=1e9)? } else { None };
    let pressures = [("pressure", false), ("gauge_pressure", true)];
    let is_gauge = if of.sense() == Sense::Depth { section.choice("quantity", &pressures)? } else { None };
    let has_ranges = matches!(of.sense(), Sense::Head | Sense::Echosounder);
    let sound_speed_mps = if has_ranges { section.number("sound_speed_mps", SOUND_SPEED_MPS)? } else { None };
    let takes_plane = matches!(of, Type::PointCloud | Type::PointCloud2);
    let planes = [("yz", Plane::Yz), ("xy", Plane::Xy)];
    let plane = if takes_plane { section.choice("plane", &planes)? } else { None };
    let manner = Manner {
        base: base.unwrap_or_default(),
        unit: unit.unwrap_or(1.0) * factor.unwrap_or(1.0),
        is_gauge: is_gauge.unwrap_or(false),
        sound_speed_mps,
        plane: plane.unwrap_or(Plane::Yz),
    };
    Ok((name, Feed::new(of, sensor, manner)))
}

impl Topic {
    fn of(&self) -> Option<Type> {
        self.known.as_ref().ok().copied()
    }
}

fn shown<'a>(topics: impl ExactSizeIterator<Item = &'a Topic>) -> String {
    let further = topics.len().saturating_sub(MOST_SHOWN);
    let mut all: Vec<String> =
        topics.take(MOST_SHOWN).map(|topic| format!("{} ({})", topic.name, topic.type_name)).collect();
    if all.is_empty() {
        return "none".to_owned();
    }
    if further > 0 {
        all.push(format!("and {further} others"));
    }
    all.join(", ")
}
/// Returns a noun with its indefinite article, "a" or "an".
fn with_article(noun: &str) -> String {
    let article = if noun.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
    format!("{article} {noun}")
}
