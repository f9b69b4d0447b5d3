//! ROS recordings: assignment of topics to sensors.

use headrace_config::Document;
use headrace_import::ros::{Feeds, MatchError, Topic};
use headrace_vehicle::VehicleConfig;

use crate::cli;
use crate::failure::Failure;
use crate::files;
use crate::logging::complain;

/// Assignment of topics to sensors.
///
/// It comes from the mapping file. Without such a file, unambiguous matches are used and listed on stderr.
pub(super) fn feeds(
    args: &cli::Import,
    vehicle: Option<&VehicleConfig>,
    topics: &[Topic],
) -> Result<Feeds, Failure> {
    let Some(vehicle) = vehicle else {
        let what = "import: ROS recordings need --vehicle VEHICLE.toml, to encode values for its sensors";
        return Err(Failure::Usage(what.to_owned()));
    };
    let Some(map) = &args.map else {
        let feeds = Feeds::matching(vehicle, topics).map_err(|error| unmatched(args, error))?;
        for matched in feeds.matched() {
            complain(&format!("headrace: {matched}"));
        }
        return Ok(feeds);
    };
    let (text, name) = (files::read(map)?, map.display().to_string());
    let mapping = Document::new(&name, &text).root()?;
    Feeds::mapped(&mapping, vehicle, topics).map_err(|error| unmatched(args, error))
}

fn unmatched(args: &cli::Import, error: MatchError) -> Failure {
    match error {
        MatchError::Mapping(error) => error.into(),
        error => Failure::Usage(format!("importing {}: {error}", args.file.display())),
    }
}
