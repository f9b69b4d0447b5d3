//! Files for other programs, from a replay and its report.

use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::path::Path;

use headrace_monitor::messages::{Outcome, PlacedPing, Placement, Update};
use headrace_monitor::result_stream::{RecordKind, first_record};
use headrace_monitor::run::Loop;

use crate::files::data::{Date, FileInfo, Point, TrackPoint, UNKNOWN_SD_M};
use crate::files::ply::{self, PointWriter};
use crate::files::tables::{self, TrackWriter};
use crate::files::{FileError, PathError, dxf, e57, encode_to, glb, las, map, xyz};
use crate::report::Delivery;

const POINTS: &str = "points.ply";
const TRACK: &str = "track.csv";
/// Names of the files that a delivery has for other programs. The files of the map are missing if no section was
/// judged.
pub const FILES: [&str; 18] = [
    POINTS,
    TRACK,
    "points.las",
    "points.laz",
    "points.e57",
    "points.xyz",
    "sections.dxf",
    "sheet.dxf",
    "sections.csv",
    "outlines.csv",
    "profile.dxf",
    "profile.csv",
    "findings.csv",
    "map.png",
    "map.pgw",
    "map.tif",
    "map.tfw",
    "wall.glb",
];
/// Deviation at which the colours of map and mesh saturate, m.
const COLOUR_LIMIT_M: f64 = 0.3;

/// Writes points and track while the replay goes on, so the needed memory does not grow with the dive.
pub struct Collector<'a> {
    points: PointWriter<'a, File>,
    track: TrackWriter<File>,
    /// Points whose returns have not been classified yet, in order, by receive time and source. Several returns of a
    /// head may have been received at once.
    waiting: BTreeMap<[u64; 2], VecDeque<Point>>,
    /// Standard deviations of angles and of positions at the latest advice update, rad and m.
    sd: Option<[f64; 2]>,
    ticks: u64,
    /// Name of the file that failed first, and its error.
    error: Option<(&'static str, FileError)>,
}

impl<'a> Collector<'a> {
    /// Begins the files of points and track in a folder. `info` needs neither date nor id yet.
    pub fn new(folder: &Path, info: &'a FileInfo) -> Result<Self, PathError> {
        let points = encode_to(&folder.join(POINTS), |file| {
            PointWriter::new(file.try_clone().map_err(FileError::io(POINTS))?, info)
        })?;
        let track = encode_to(&folder.join(TRACK), |file| {
            TrackWriter::new(file.try_clone().map_err(FileError::io(TRACK))?)
        })?;
        Ok(Self { points, track, waiting: BTreeMap::new(), sd: None, ticks: 0, error: None })
    }

    /// Adds the results of the latest tick. Call this method after every tick; further calls change nothing. The loop
    /// must keep its results. The first error is returned by [`finish`](Self::finish).
    pub fn take(&mut self, dive: &Loop) {
        let tick = dive.ticks();
        if core::mem::replace(&mut self.ticks, tick) != tick && self.error.is_none() {
            self.error = self.tick(dive).err();
        }
    }

    fn tick(&mut self, dive: &Loop) -> Result<(), (&'static str, FileError)> {
        let view = dive.view();
        for item in &view.placed().items {
            match &item.placement {
                Placement::Ping(ping) => self.ping(dive, ping),
                Placement::Update(update) => self.update(dive, update).map_err(|error| (TRACK, error))?,
            }
        }
        let mut words = view.surveyor().digests().pings.words();
        while let Some((record, rest)) = first_record(words) {
            words = rest;
            // Outcomes 1 and 2 are pings without a return, for which no point waits.
            let [received, source, 0 | 3, ..] = *record.words else { continue };
            let Some(mut point) = self.next_waiting([received, source]) else { continue };
            point.is_doubtful = record.kind == Some(RecordKind::Doubtful);
            if point.is_doubtful || record.kind == Some(RecordKind::Sample) {
                self.points.add(&point).map_err(|error| (POINTS, error))?;
            }
        }
        Ok(())
    }

    /// Removes the first point that waits for a receive time and source.
    fn next_waiting(&mut self, key: [u64; 2]) -> Option<Point> {
        let points = self.waiting.get_mut(&key)?;
        let point = points.pop_front();
        if points.is_empty() {
            self.waiting.remove(&key);
        }
        point
    }

    /// Keeps a return until it is classified.
    fn ping(&mut self, dive: &Loop, ping: &PlacedPing) {
        let (Outcome::Sample { point, arc_m }, Some(origin)) = (ping.outcome, ping.origin) else { return };
        let range_m = (point - origin).norm();
        // Combines the largest error of position with the largest error of angle at this range, as independent errors.
        let sd_m = |[angle_rad, position_m]: [f64; 2]| {
            (position_m * position_m + square(angle_rad * range_m)).sqrt()
        };
        let point = Point {
            position_m: [point.x(), point.y(), point.z()],
            range_m,
            position_sd_m: self.sd.map_or(UNKNOWN_SD_M, sd_m).min(UNKNOWN_SD_M),
            clock_h: dive.mission().profile.hour(arc_m),
            // A ping's time of validity may be shortly before the dive's first packet was received, so the time is not
            // negative.
            time_s: dive.view().clock().seconds(ping.valid_at).max(0.0),
            head: u8::try_from(ping.head).unwrap_or(u8::MAX),
            is_doubtful: false,
        };
        self.waiting.entry([ping.received.0, u64::from(ping.source.0)]).or_default().push_back(point);
    }

    fn update(&mut self, dive: &Loop, update: &Update) -> Result<(), FileError> {
        self.sd = update.sd.map(|sd| [sd.tilt_rad.max(sd.yaw_rad), sd.along_m.max(sd.place_m)]);
        let Ok(fix) = update.fix else { return Ok(()) };
        let (roll, pitch, yaw) = fix.pose.attitude.roll_pitch_yaw();
        let place = fix.pose.position;
        self.track.add(&TrackPoint {
            time_s: dive.view().clock().seconds(update.at),
            position_m: [place.x(), place.y(), place.z()],
            attitude_deg: [roll, pitch, yaw].map(f64::to_degrees),
            chainage_sd_m: update.sd.map(|sd| sd.along_m),
            lateral_sd_m: update.sd.map(|sd| sd.place_m),
            tilt_sd_deg: update.sd.map(|sd| sd.tilt_rad.to_degrees()),
            yaw_sd_deg: update.sd.map(|sd| sd.yaw_rad.to_degrees()),
        })
    }

    /// Completes the files of points and track.
    ///
    /// Errors: the first error since the beginning.
    pub fn finish(mut self, folder: &Path) -> Result<(), PathError> {
        let at = |(name, source)| PathError { path: folder.join(name), source };
        self.error.map_or(Ok(()), Err).map_err(at)?;
        // At the end of a dive, the surveyor counts returns that still wait as doubtful.
        for point in self.waiting.into_values().flatten() {
            let doubtful = Point { is_doubtful: true, ..point };
            self.points.add(&doubtful).map_err(|error| at((POINTS, error)))?;
        }
        self.points.finish().map_err(|error| at((POINTS, error)))?;
        self.track.finish().map_err(|error| at((TRACK, error)))?;
        Ok(())
    }
}

fn square(value: f64) -> f64 {
    value * value
}

/// Writes all files except the points as PLY and the track, after [`Collector::finish`].
pub fn write_files(folder: &Path, info: &FileInfo, delivery: &Delivery) -> Result<(), PathError> {
    let info = &FileInfo { date: date(delivery), id: id(delivery), ..info.clone() };
    let encode = |name: &str, encode: &dyn Fn(&mut File) -> Result<u64, FileError>| {
        encode_to(&folder.join(name), |file| encode(file)).map(|_| ())
    };
    let points = || {
        let file = File::open(folder.join(POINTS)).map_err(FileError::io(POINTS))?;
        ply::read_points(file)
    };
    encode("points.las", &|file| las::write(file, info, false, points()?))?;
    encode("points.laz", &|file| las::write(file, info, true, points()?))?;
    encode("points.e57", &|file| e57::write(file, info, points()?))?;
    encode("points.xyz", &|file| xyz::write(file, info, points()?))?;
    let sections = delivery.sections();
    encode("sections.dxf", &|file| dxf::write_sections(file, info, &sections))?;
    encode("sheet.dxf", &|file| dxf::write_sheet(file, info, &sections))?;
    encode("sections.csv", &|file| tables::write_sections(file, &sections))?;
    encode("outlines.csv", &|file| tables::write_outlines(file, &sections))?;
    let profile = delivery.profile();
    encode("profile.dxf", &|file| dxf::write_profile(file, info, &profile))?;
    encode("profile.csv", &|file| tables::write_profile(file, &profile))?;
    encode("findings.csv", &|file| tables::write_findings(file, &delivery.findings()))?;
    let mesh = delivery.mesh();
    encode_to(&folder.join("wall.glb"), |file| glb::write(file, info, &mesh, COLOUR_LIMIT_M))?;
    delivery.map(|map| write_map(folder, info, map)).unwrap_or(Ok(()))
}

fn write_map(folder: &Path, info: &FileInfo, wall: &crate::files::data::WallMap) -> Result<(), PathError> {
    encode_to(&folder.join("map.png"), |file| map::write_png(file, info, wall, COLOUR_LIMIT_M))?;
    encode_to(&folder.join("map.tif"), |file| map::write_tiff(file, info, wall))?;
    for name in ["map.pgw", "map.tfw"] {
        encode_to(&folder.join(name), |file| map::write_world_file(file, wall))?;
    }
    Ok(())
}

/// Identity of a dive: the letters of its digest.
fn id(delivery: &Delivery) -> [u8; 16] {
    let mut letters = delivery.report.digest.bytes();
    [0; 16].map(|zero: u8| letters.next().unwrap_or(zero))
}

/// Date of a dive, from the beginning of its UTC, for instance 2026-11-30T05:12:33Z.
fn date(delivery: &Delivery) -> Option<Date> {
    const DAYS: [u16; 12] = [31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let utc = delivery.report.begun_utc.as_deref()?;
    let mut numbers = utc.split(['-', 'T']).map(|number| number.parse::<u16>().ok());
    let (year, month, day) = (numbers.next()??, numbers.next()??, numbers.next()??);
    let is_leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    let before: u16 = DAYS.iter().take(usize::from(month.checked_sub(1)?)).sum();
    Some(Date { year, day: before + u16::from(is_leap && month > 2) + day })
}
