//! History of speed, allowed speed and forecast spacing T over the last half hour, with one value per second.

use std::collections::VecDeque;

use headrace_monitor::live_state::json::LiveStateJson;
use serde_json::{Value, json};

/// Maximum number of values kept: half an hour at one per second.
const MOST: usize = 1800;

/// History of a dive's speed, of the speed that was allowed, and of the forecast spacing T.
#[derive(Debug, Default)]
pub struct History {
    /// Time, s; then speed, m/s, allowed speed, m/s, and forecast spacing T, m.
    values: VecDeque<(f64, [Option<f64>; 3])>,
    /// Whether the whole dive is kept instead of the last half hour.
    pub(crate) whole: bool,
}

impl History {
    /// Adds the values of a live state, at most once a second.
    pub(crate) fn take(&mut self, state: &LiveStateJson) {
        let Some(at_s) = state.at_s else { return };
        let second = at_s.floor();
        if self.values.back().is_some_and(|(last, _)| second <= *last) {
            return;
        }
        let t_m = state.turn.as_ref().and_then(|turn| turn.predicted_t_m);
        self.values.push_back((second, [state.speed_mps, state.v_max_mps, t_m]));
        if self.values.len() > MOST && !self.whole {
            self.values.pop_front();
        }
    }

    /// Removes values later than this time, seconds.
    pub(crate) fn jump(&mut self, at_s: f64) {
        self.values.retain(|(second, _)| *second <= at_s);
    }

    /// Returns the history as a message.
    pub(crate) fn message(&self, seq: u64) -> Value {
        let column = |place: usize| -> Vec<Value> {
            let of = |(_, values): &(f64, [Option<f64>; 3])| {
                let value = values.get(place).copied().flatten().filter(|value| value.is_finite());
                value.map_or(Value::Null, |value| json!((value * 1000.0).round() / 1000.0))
            };
            self.values.iter().map(of).collect()
        };
        let t_s: Vec<_> = self.values.iter().map(|(second, _)| *second).collect();
        json!({"type": "history", "seq": seq, "t_s": t_s, "v_mps": column(0), "v_max_mps": column(1), "t_m": column(2)})
    }
}
