//! headrace as a Python package: reads logs, replays them as Arrow tables, evaluates the sampling equations, and finds
//! holes in point clouds.
//!
//! `python/headrace/_headrace.pyi` has the types for Python, and a test compares these types with this code. The
//! interpreter's lock is released while a log is read or a wall is searched.

mod arguments;
mod errors;
mod holes;
mod log;
mod losses;
mod messages;
mod plan;
mod profile;
mod replay;
mod spacing;
mod table;
mod vehicle;

use pyo3::pymodule;

/// The compiled part of headrace; import `headrace` instead.
#[pymodule]
mod _headrace {
    #[pymodule_export]
    use crate::holes::holes;
    #[pymodule_export]
    use crate::log::{Log, Source};
    #[pymodule_export]
    use crate::losses::Loss;
    #[pymodule_export]
    use crate::messages::{Message, Messages};
    #[pymodule_export]
    use crate::plan::plan_json;
    #[pymodule_export]
    use crate::profile::Profile;
    #[pymodule_export]
    use crate::replay::{Tables, replay};
    #[pymodule_export]
    use crate::spacing::{
        Spiral, Turn, beam_width_m, footprint_m, overlap, range_resolution_m, speed_for_target_mps, t_c_m,
        t_max_m, t_y1_m, t_y2_m, t_y2_mean_m, t_yp_m,
    };
    #[pymodule_export]
    use crate::table::Table;
    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "Python's name for it")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
