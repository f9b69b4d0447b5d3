//! Contents of the files, as plain values in the tunnel frame: x chainage, y left, z up from the floor's centre, m.

/// Frame of the positions, as each file states it.
pub const FRAME: &str =
    "tunnel frame, m: x chainage from the portal, y left, z up from the floor's centre; no EPSG code";
/// The tunnel frame as well-known text, for file formats that have a field for the frame.
pub const FRAME_WKT: &str = concat!(
    "LOCAL_CS[\"tunnel frame\",LOCAL_DATUM[\"portal\",32767],UNIT[\"metre\",1],",
    "AXIS[\"chainage\",OTHER],AXIS[\"left\",OTHER],AXIS[\"up\",UP]]"
);

/// Description of a dive in the headers of its files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileInfo {
    /// Plant, tunnel and dive, as the report's cover names them.
    pub title: String,
    /// Program and version.
    pub program: String,
    /// Date of the dive in UTC; `None` if its clock was never set.
    pub date: Option<Date>,
    /// Identity of the dive, from its digest. It becomes the files' GUID.
    pub id: [u8; 16],
}

/// Date in the form that LAS uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Date {
    /// Year.
    pub year: u16,
    /// Day of the year, from 1.
    pub day: u16,
}

/// Standard deviation of a position if the navigation method states none, m.
pub const UNKNOWN_SD_M: f64 = 1000.0;

/// A return on the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Position of the return in the tunnel frame.
    pub position_m: [f64; 3],
    /// Range from the head to the return.
    pub range_m: f64,
    /// Standard deviation of the position in the direction in which it is least certain; [`UNKNOWN_SD_M`] if unknown.
    pub position_sd_m: f64,
    /// Clock position of the return, hours, looking inwards along the tunnel.
    pub clock_h: f64,
    /// Dive time, s.
    pub time_s: f64,
    /// Number of the head, from zero.
    pub head: u8,
    /// Whether the return is doubtful, which means that it may not be wall.
    pub is_doubtful: bool,
}

/// Cross-section.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Section {
    /// Chainage as engineers write it, for instance 1+240.50.
    pub station: String,
    /// Chainage of the cross-section.
    pub chainage_m: f64,
    /// Measured outline: y and z, in pieces that end where the wall was not measured.
    pub measured_m: Vec<Vec<[f64; 2]>>,
    /// Design profile: y and z of a closed outline.
    pub design_m: Vec<[f64; 2]>,
    /// Verdict of the section, as the report words it.
    pub verdict: String,
    /// Diameter of the section's hole D, if it is known.
    pub hole_m: Option<f64>,
    /// Standard deviation of the hole diameter D.
    pub hole_sd_m: Option<f64>,
}

/// Floor, crown and walls of a cross-section; `None` where the wall was not measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Edges {
    /// z of the floor's centre.
    pub floor_m: Option<f64>,
    /// z of the crown.
    pub crown_m: Option<f64>,
    /// y of the left wall.
    pub left_m: Option<f64>,
    /// y of the right wall.
    pub right_m: Option<f64>,
}

/// Station of the longitudinal profile.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ProfileStation {
    /// Chainage as engineers write it.
    pub station: String,
    /// Chainage of the station.
    pub chainage_m: f64,
    /// Edges (floor, crown and walls) as measured.
    pub measured: Edges,
    /// Edges (floor, crown and walls) as designed.
    pub design: Edges,
}

/// Pose of the vehicle with its standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackPoint {
    /// Dive time, s.
    pub time_s: f64,
    /// Position of the vehicle in the tunnel frame.
    pub position_m: [f64; 3],
    /// Roll, pitch and yaw, degrees.
    pub attitude_deg: [f64; 3],
    /// Standard deviation of the chainage.
    pub chainage_sd_m: Option<f64>,
    /// Standard deviation of the position in the cross-section, in the direction in which it is less certain.
    pub lateral_sd_m: Option<f64>,
    /// Standard deviation of roll or pitch, whichever is larger, degrees.
    pub tilt_sd_deg: Option<f64>,
    /// Standard deviation of yaw, degrees.
    pub yaw_sd_deg: Option<f64>,
}

/// Finding on a stretch of the tunnel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Finding {
    /// First and last chainage, as engineers write them.
    pub stations: [String; 2],
    /// First and last chainage.
    pub chainages_m: [f64; 2],
    /// Kind of the finding, for instance missed or deposit.
    pub kind: String,
    /// Cause of the finding; empty if there is none.
    pub cause: String,
    /// Description of the finding.
    pub text: String,
}

/// Map of the unrolled wall: chainage to the right, arc length upwards. Row 0 is at the top.
pub struct WallMap<'a> {
    /// Number of pixels along the tunnel and around it.
    pub size: [u32; 2],
    /// Chainage and arc length of the map's lower left corner.
    pub from_m: [f64; 2],
    /// Size of a pixel: chainage and arc length.
    pub pixel_m: [f64; 2],
    /// Deviation at a column and row, outwards positive; `None` where the wall was not measured.
    pub deviation_m: &'a dyn Fn(u32, u32) -> Option<f64>,
}

/// Part of the wall as triangles.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WallMesh {
    /// Positions of the corners.
    pub corners_m: Vec<[f64; 3]>,
    /// Deviation at each corner, outwards positive; `None` where the wall was not measured.
    pub deviations_m: Vec<Option<f64>>,
    /// Numbers of each triangle's corners, counter-clockwise as seen from inside the tunnel.
    pub triangles: Vec<[u32; 3]>,
}
