//! Answers to requests of BlueOS and Cockpit. They need no token, and contain nothing about the dive.

use serde_json::{Value, json};

/// Path at which Cockpit looks for widgets and actions.
pub(super) const EXTRAS: &str = "/cockpit_extras.json";
/// Name of the service's icon in Material Design Icons, for BlueOS.
const ICON: &str = "mdi-tunnel";

/// Returns the description of this service that BlueOS lists.
pub(super) fn service() -> Value {
    json!({
        "name": "headrace",
        "description": "Coverage of a tunnel's wall while it is inspected: what was missed, why, and how fast to go.",
        "icon": ICON,
        "company": "headrace",
        "version": env!("CARGO_PKG_VERSION"),
        "webpage": "",
        "api": "",
        "new_page": true,
        "works_in_relative_paths": true,
        "extras": {"cockpit": EXTRAS},
    })
}

/// Returns widgets, actions and joystick buttons for Cockpit. `base` is this server's address as seen by the browser.
pub(super) fn extras(base: &str) -> Value {
    // Cockpit shows an image file, not a named icon. Newer versions read `iconUrl`, older ones `iframeIcon`.
    let icon = format!("{base}/assets/icon.svg");
    let widget = |name: &str, path: &str| {
        json!({"name": name, "iframeUrl": format!("{base}/widget/{path}"), "iconUrl": icon, "iframeIcon": icon,
            "version": env!("CARGO_PKG_VERSION"), "useExtensionPathAsBaseUrl": false})
    };
    let action = |id: &str, name: &str, path: &str, body: Value| {
        json!({"id": id, "name": name, "type": "http-request", "version": env!("CARGO_PKG_VERSION"),
            "config": {"name": name, "url": format!("{base}/actions/{path}"), "method": "POST",
                "headers": {"Content-Type": "application/json"}, "urlParams": {}, "body": body.to_string()}})
    };
    let button = |id: &str, name: &str, action: &str, button: u8, why: &str| {
        json!({"id": id, "actionProtocol": "cockpit-action", "actionName": name, "actionId": action, "button": button,
            "modifierKey": "shift", "description": why})
    };
    let (acknowledge, mark, silence) = ("headrace-acknowledge", "headrace-mark", "headrace-silence");
    json!({
        "targetSystem": "Cockpit",
        "targetCockpitApiVersion": "1.0.0",
        "widgets": [
            widget("headrace speed", "speed"),
            widget("headrace wall", "wall"),
            widget("headrace alerts", "alerts"),
        ],
        "actions": [
            action(acknowledge, "headrace: acknowledge alerts", "acknowledge", json!({"alert": 0, "by": "joystick"})),
            action(silence, "headrace: silence alerts", "silence", json!({"by": "joystick"})),
            action(mark, "headrace: mark this place", "mark", json!({"by": "joystick"})),
        ],
        "joystickSuggestions": [{
            "id": "headrace-alerts",
            "name": "headrace alerts",
            "description": "Acknowledge alerts and mark a place without leaving the joystick.",
            "version": env!("CARGO_PKG_VERSION"),
            "buttonMappingSuggestions": [
                button("headrace-acknowledge-button", "headrace: acknowledge alerts", acknowledge, 0, "All alerts that need it."),
                button("headrace-mark-button", "headrace: mark this place", mark, 1, "A note without text at the present place."),
            ],
        }],
    })
}
