//! Plans by a vehicle file, as `headrace plan` does.

use std::path::PathBuf;

use headrace_devices::KINDS;
use headrace_sampling::plan::{Planner, Question};
use headrace_simulator::position_error_model;
use pyo3::{Python, pyfunction};

use crate::errors::Failure;
use crate::vehicle;

/// The answers of a plan as JSON. `headrace.sampling.plan` returns them as dictionaries.
#[pyfunction]
#[pyo3(signature = (vehicle, *, target_m, speed_mps, time_s, drift_m, yaw_rad, yaw_rate_radps))]
#[expect(
    clippy::too_many_arguments,
    clippy::needless_pass_by_value,
    reason = "Python has them by name; made for this call"
)]
pub(crate) fn plan_json(
    py: Python<'_>,
    vehicle: PathBuf,
    target_m: Option<f64>,
    speed_mps: Option<f64>,
    time_s: Option<f64>,
    drift_m: f64,
    yaw_rad: f64,
    yaw_rate_radps: f64,
) -> Result<String, Failure> {
    let question = Question { target_m, speed_mps, time_s };
    py.detach(|| {
        let file = vehicle.display().to_string();
        let wrong = |why: String| Failure::Vehicle { file: file.clone(), why };
        let (_, config) = vehicle::read(&vehicle)?;
        let name = vehicle.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
        let errors =
            position_error_model::expected_errors(&config, &name, &KINDS, &vehicle::bytes_beside(&vehicle));
        let errors = errors.map_err(|error| Failure::of_scene(&file, error))?;
        let mut inspection = config.inspection().map_err(wrong)?;
        (inspection.drift_m, inspection.yaw_rad) = (drift_m, yaw_rad);
        inspection.yaw_rate_radps = yaw_rate_radps;
        let question =
            Question { target_m: question.target_m.or(Some(config.target.max_hole_m)), ..question };
        let answers = Planner::new(inspection)?.with_errors(errors).answers(&question, None)?;
        serde_json::to_string(&answers).map_err(|error| wrong(error.to_string()))
    })
}
