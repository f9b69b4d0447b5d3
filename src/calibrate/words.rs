//! Results of a calibration, as text and as JSON.

use crate::calibrate::collect::Collected;
use crate::calibrate::findings::Findings;
use crate::calibrate::table::{Found, Table, Value};
use headrace_vehicle::VehicleConfig;
use serde_json::{Value as Json, json};

use crate::cli::Calibrate;
use crate::output::append;

/// The results of a calibration as text.
pub(super) fn text(
    args: &Calibrate,
    vehicle: &VehicleConfig,
    collected: &Collected,
    findings: &Findings,
    table: &Table,
    losses: &[String],
) -> String {
    let mut text = String::new();
    let mut line = |words: &str| append(&mut text, format_args!("{}\n", words.trim_end()));
    let [from_s, to_s] = [collected.from, collected.to].map(|at| collected.seconds(at));
    line(&format!("{}: {from_s:.1} to {to_s:.1} s, {}", args.log.display(), vehicle.name));
    if let Ok(heads) = &findings.heads {
        let [y, z] = heads.place_m;
        let [from_s, to_s] = [heads.still.from, heads.still.to].map(|at| collected.seconds(at));
        line(&format!(
            "stationary from {from_s:.1} to {to_s:.1} s, {:.3} m left of the centre and {:.3} m above the floor (sd {:.3}, {:.3})",
            y.value, z.value, y.sd, z.sd
        ));
        line(&format!(
            "half of the returns are within {:.3} m of the profile; ranges are too long by {:+.2} % (sd {:.2})",
            heads.median_m,
            heads.scale.value * 100.0,
            heads.scale.sd * 100.0
        ));
        for head in heads.heads.iter().filter(|head| head.used > 0) {
            let id = vehicle.sensor_configs.get(head.source).map_or("", |sensor| &sensor.id);
            line(&format!(
                "  {id}: {} returns used, {} rejected, rms {:.1} cm, {:.0} degrees of wall",
                head.used,
                head.rejected,
                head.rms_m * 100.0,
                head.seen_deg
            ));
        }
    }
    if !table.found.is_empty() {
        line(&format!("\n{:<12} {:<28} {:>10} {:>10} {:>8}", "found", "", "file", "found", "sd"));
        table.found.iter().for_each(|found| line(&row(found)));
    }
    if !table.open.is_empty() {
        line("\nnot determined by this log");
        for open in &table.open {
            line(&format!("  {}, {}: {}", open.of, open.what, open.why));
        }
    }
    if table.lines.is_empty() && table.is_amiss() {
        line("\na fault was found, see above; no change of the vehicle file corrects it");
    } else if table.lines.is_empty() {
        line("\nnothing to change in the vehicle file");
    } else {
        line("\nfor the vehicle file");
        line(&toml(table));
    }
    for loss in losses {
        line(&format!("LOST: {loss}"));
    }
    text
}

fn row(found: &Found) -> String {
    let Found { of, what, unit, decimals, value } = found;
    let mark = if found.differs() { "  differs" } else { "" };
    match value {
        Value::Number { file, found } => format!(
            "{of:<12} {what:<28} {file:>10.decimals$} {:>10.decimals$} {:>8.decimals$} {unit}{mark}",
            found.value, found.sd
        ),
        Value::Facing { file, found } => {
            format!("{of:<12} {what:<28} {file:>10} {found:>10} {:>8} {mark}", "")
        }
    }
}

/// Lines for the vehicle file. A heading with the sensor's id precedes the lines of each sensor.
fn toml(table: &Table) -> String {
    let mut text = String::new();
    for (of, lines) in &table.lines {
        match of.strip_prefix("sensors.") {
            Some(id) => append(&mut text, format_args!("[[sensors]]  # id = \"{id}\"\n")),
            None => append(&mut text, format_args!("[{of}]\n")),
        }
        for line in lines {
            append(&mut text, format_args!("{line}\n"));
        }
    }
    text
}

/// The results of a calibration as JSON.
pub(super) fn json(
    args: &Calibrate,
    vehicle: &VehicleConfig,
    collected: &Collected,
    findings: &Findings,
    table: &Table,
    losses: &[String],
) -> Json {
    let still = findings.heads.as_ref().ok().map(|heads| {
        let [y, z] = heads.place_m;
        let of_head = |head: &crate::calibrate::heads::Head| {
            json!({
                "id": vehicle.sensor_configs.get(head.source).map(|sensor| &sensor.id),
                "used": head.used,
                "rejected": head.rejected,
                "rms_m": head.rms_m,
                "seen_deg": head.seen_deg,
            })
        };
        json!({
            "from_s": collected.seconds(heads.still.from),
            "to_s": collected.seconds(heads.still.to),
            "y_m": y.value,
            "y_sd_m": y.sd,
            "z_m": z.value,
            "z_sd_m": z.sd,
            "median_residual_m": heads.median_m,
            "heads": heads.heads.iter().map(of_head).collect::<Vec<_>>(),
        })
    });
    let found = table.found.iter().map(|found| {
        let (file, value, sd) = match found.value {
            Value::Number { file, found } => (json!(file), json!(found.value), json!(found.sd)),
            Value::Facing { file, found } => (json!(file), json!(found), Json::Null),
        };
        json!({
            "of": found.of,
            "what": found.what,
            "unit": found.unit,
            "file": file,
            "found": value,
            "sd": sd,
            "differs": found.differs(),
        })
    });
    let open = table
        .open
        .iter()
        .map(|open| json!({ "of": open.of, "what": open.what, "why": open.why.to_string() }));
    let change = table.lines.iter().map(|(of, lines)| (of.clone(), json!(lines)));
    json!({
        "log": args.log.display().to_string(),
        "vehicle": vehicle.name,
        "from_s": collected.seconds(collected.from),
        "to_s": collected.seconds(collected.to),
        "still": still,
        "found": found.collect::<Vec<_>>(),
        "untold": open.collect::<Vec<_>>(),
        "vehicle_file": change.collect::<serde_json::Map<_, _>>(),
        "losses": losses,
    })
}
