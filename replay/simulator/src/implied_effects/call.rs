//! Calls for effects. A call is a reason to simulate an effect, such as silt in the scene's water.

/// An effect that a scene implies, with its tables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Called {
    /// Name of the effect.
    pub effect: &'static str,
    /// Parts of the scene or its vehicle file that imply the effect.
    pub by: Vec<String>,
    /// Tables of the effect, in the form in which a scene would contain them.
    pub tables: String,
    /// Whether and how the implied effect is simulated.
    pub fate: Fate,
}

/// Whether and how an implied effect is simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// The effect is simulated with its implied tables.
    Taken,
    /// The effect is simulated with tables that the scene itself has.
    Named,
    /// The effect isn't simulated: the scene asks only for the effects that it names itself.
    NotTaken,
    /// The effect isn't simulated: the scene's key `leave` lists it.
    Left,
}

impl Fate {
    /// Whether and how the effect is simulated, as text for display.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Taken => "taken",
            Self::Named => "as named",
            Self::NotTaken => "not taken",
            Self::Left => "left",
        }
    }
}

/// A value of an effect's key, as TOML text.
pub(super) type Value = String;

/// A call: one reason to simulate an effect, with the sensors, the range of chainage and the keys that follow from this
/// reason.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Call {
    pub(super) effect: &'static str,
    pub(super) by: String,
    /// Sensors that the effect acts on; `None` for an effect on the vehicle or the water.
    pub(super) sensors: Option<Vec<String>>,
    /// Chainages between which the effect acts; `None` if it acts everywhere.
    pub(super) place_m: Option<[f64; 2]>,
    pub(super) keys: Vec<(&'static str, Value)>,
}

impl Call {
    pub(super) fn new(effect: &'static str, by: impl Into<String>, keys: &[(&'static str, Value)]) -> Self {
        Self { effect, by: by.into(), sensors: None, place_m: None, keys: keys.to_vec() }
    }

    pub(super) fn on(self, sensors: &[String]) -> Self {
        Self { sensors: Some(sensors.to_vec()), ..self }
    }

    pub(super) fn within(self, place_m: [f64; 2]) -> Self {
        Self { place_m: Some(place_m), ..self }
    }
}

/// Formats a number as TOML.
pub(super) fn number(value: f64) -> Value {
    format!("{value:?}")
}
