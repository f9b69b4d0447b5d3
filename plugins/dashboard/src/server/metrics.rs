//! Metrics of the page and the dive for Prometheus.

use std::fmt::Write as _;
use std::sync::atomic::Ordering;

use serde_json::Value;

use super::shared::Shared;

/// Returns the metrics in Prometheus' text format.
pub(super) fn metrics(shared: &Shared) -> String {
    let model = shared.model();
    let counts = &shared.counts;
    let mut text = String::new();
    let mut put = |name: &str, kind: &str, help: &str, value: f64| {
        // Writing to a string can't fail.
        let _infallible = write!(
            text,
            "# HELP headrace_{name} {help}\n# TYPE headrace_{name} {kind}\nheadrace_{name} {value}\n"
        );
    };
    let of = |counter: &std::sync::atomic::AtomicU64| counter.load(Ordering::Relaxed) as f64;
    put("page_viewers", "gauge", "Viewers of the page.", counts.viewers.load(Ordering::Relaxed) as f64);
    put("page_viewers_total", "counter", "Viewers so far.", of(&counts.served));
    put("page_stalled_total", "counter", "Viewers dropped because they read nothing.", of(&counts.stalled));
    put("page_lagged_total", "counter", "Times a slow viewer got all changes at once.", of(&counts.lagged));
    put("page_refused_total", "counter", "Messages of viewers that were refused.", of(&counts.refused));
    put("page_unauthorised_total", "counter", "Requests without a valid token.", of(&counts.unauthorised));
    put(
        "page_foreign_total",
        "counter",
        "Requests with a wrong host or from another origin.",
        of(&counts.foreign),
    );
    put("page_sent_bytes_total", "counter", "Bytes of the feed.", of(&counts.bytes));
    put("page_samples", "gauge", "Samples in the page's memory.", model.samples().len() as f64);
    put(
        "page_samples_not_kept_total",
        "counter",
        "Samples beyond the page's memory.",
        model.samples().not_kept() as f64,
    );
    put(
        "page_dropped_samples_total",
        "counter",
        "Samples dropped because the queue was full.",
        model.dropped().samples as f64,
    );
    put(
        "page_dropped_lines_total",
        "counter",
        "Events dropped because the queue was full.",
        model.dropped().events as f64,
    );
    put("page_sections", "gauge", "Sections in the page's memory.", model.sections() as f64);
    if let Some(state) = model.state() {
        let number = |path: &str| state.pointer(path).and_then(Value::as_f64);
        for (name, path, help) in [
            ("chainage_metres", "/position/chainage_m", "Chainage."),
            ("speed_mps", "/speed_mps", "Speed along the tunnel."),
            ("v_max_mps", "/v_max_mps", "Largest speed advised."),
            ("state_age_seconds", "/age_s", "Age of the live state."),
            ("way_metres", "/metres/way_m", "Coverage extent in metres."),
            ("pass_metres", "/metres/pass_m", "Metres that pass."),
            ("fail_metres", "/metres/fail_m", "Metres that fail."),
            ("cannot_say_metres", "/metres/cannot_say_m", "Metres with the verdict can't say."),
            ("open_metres", "/metres/open_m", "Metres still open."),
            ("not_inspected_metres", "/metres/not_inspected_m", "Metres not inspected."),
            ("alerts_unacknowledged", "/alert_counts/unacknowledged", "Unacknowledged alerts."),
            ("alerts_active", "/alert_counts/active", "Active alerts."),
        ] {
            if let Some(value) = number(path) {
                put(name, "gauge", help, value);
            }
        }
    }
    text
}
