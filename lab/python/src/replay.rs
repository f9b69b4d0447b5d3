//! Replays of a dive as Arrow tables.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

use headrace_replay::log::files_of;
use headrace_tables::{Parameters, replay_until};
use pyo3::exceptions::PyRuntimeError;
use pyo3::{PyResult, Python, pyclass, pyfunction, pymethods};

use crate::arguments::Named;
use crate::errors::Failure;
use crate::table::Table;
use crate::vehicle;

/// Interval at which Ctrl-C is checked during a replay.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// The tables of one dive. docs/reference/dive-tables.csv describes the columns.
#[pyclass(frozen, module = "headrace")]
pub(crate) struct Tables {
    tables: headrace_tables::Tables,
}

#[pymethods]
impl Tables {
    /// The dive as one row: its facts and result.
    ///
    /// `losses`, `lost` and `exit_code` state what is missing from its log.
    #[getter]
    fn dives(&self) -> Table {
        Table::of(self.tables.dives.clone())
    }

    /// A row for each section of the coverage extent: its verdict, hole, cause, and spacings.
    #[getter]
    fn sections(&self) -> Table {
        Table::of(self.tables.sections.clone())
    }

    /// A row for each hole that is the largest of a section.
    #[getter]
    fn holes(&self) -> Table {
        Table::of(self.tables.holes.clone())
    }

    /// A row for each section that was flagged.
    #[getter]
    fn flags(&self) -> Table {
        Table::of(self.tables.flags.clone())
    }

    /// A row for each run of flagged sections.
    #[getter]
    fn runs(&self) -> Table {
        Table::of(self.tables.runs.clone())
    }

    /// A row for each sensor.
    #[getter]
    fn sources(&self) -> Table {
        Table::of(self.tables.sources.clone())
    }

    /// A row for each alert.
    #[getter]
    fn alerts(&self) -> Table {
        Table::of(self.tables.alerts.clone())
    }

    fn __repr__(&self) -> String {
        format!("<Tables of a dive of {} sections>", self.tables.sections.num_rows())
    }
}

/// Replays a dive and returns its tables, with the judgements of `headrace replay`; takes one core, without the
/// interpreter's lock.
///
/// `log` is an MCAP file, the parts of a recording, or a folder with these. Parameters default to those of the vehicle
/// file attached to the log: `target_m` (0.01 to 20) is the largest hole that passes, `section_m` (0.05 to 10) the
/// length of a section, `sound_speed_mps` (1300 to 1700) the speed of sound; `vehicle` is the path of another vehicle
/// file. `smooth` judges along the smoothed trajectory.
///
/// Raises LogError if the log can't be read, ConfigError for an invalid vehicle file, ValueError for a parameter out of
/// range, ReplayError if the replay fails; Ctrl-C ends it. Losses aren't errors: see `dives`.
#[pyfunction]
#[pyo3(signature = (log, *, target_m=None, section_m=None, sound_speed_mps=None, vehicle=None, smooth=false))]
pub(crate) fn replay(
    py: Python<'_>,
    log: Named,
    target_m: Option<f64>,
    section_m: Option<f64>,
    sound_speed_mps: Option<f64>,
    vehicle: Option<PathBuf>,
    smooth: bool,
) -> PyResult<Tables> {
    let mut parameters = Parameters { target_m, section_m, sound_speed_mps, smooth, ..Parameters::default() };
    if let Some(path) = vehicle {
        let (text, config) = vehicle::read(&path)?;
        parameters.vehicle = Some(text);
        parameters.vehicle_files = config.attachments.into_iter().collect();
    }
    let named = log.paths();
    let stop = AtomicBool::new(false);
    #[expect(
        clippy::redundant_closure_for_method_calls,
        reason = "a path to it isn't general enough in its lifetime"
    )]
    py.detach(|| {
        std::thread::scope(|threads| {
            let (done, ended) = sync_channel(1);
            let work = || -> PyResult<headrace_tables::Tables> {
                let files = files_of(&named).map_err(Failure::from)?;
                Ok(replay_until(&files, &parameters, &stop).map_err(Failure::from)?)
            };
            threads.spawn(move || {
                // Sending fails if nobody waits for the result any more, as after an interrupt. The error is ignored.
                done.send(work()).ok();
            });
            loop {
                match ended.recv_timeout(LOOK_EVERY) {
                    Ok(tables) => return Ok(Tables { tables: tables? }),
                    Err(RecvTimeoutError::Timeout) => {
                        if let Err(interrupt) = Python::attach(|py| py.check_signals()) {
                            stop.store(true, Ordering::Relaxed);
                            return Err(interrupt);
                        }
                    }
                    // A panic of the thread continues when the scope ends.
                    Err(RecvTimeoutError::Disconnected) => {
                        return Err(PyRuntimeError::new_err("replaying a dive: its thread ended early"));
                    }
                }
            }
        })
    })
}
