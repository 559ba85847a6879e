//! Simulated logs: rosbag2 directories with the noise-free truth beside them.
//!
//! [`write_bobcat`] records the skid-steer loader of Ryde & Brünig 2011 (see [`crate::simulate`]) as its
//! drivers would publish it:
//!
//! | topic | type | rate | stamp |
//! |---|---|---|---|
//! | `/left/points`, `/right/points`, `/top/points` | PointCloud2: x, y, z, intensity (f32), t (u32, ns since the stamp) | 75 Hz each | first beam |
//! | `/novatel/oem7/inspvax` | INSPVAX of the IMU; `height + undulation` is above the ellipsoid | 100 Hz | arrival, 2 to 9.5 ms late; `nov_header` has the exact GPS time |
//! | `/ins/odometry` | Odometry `map` -> `base_link`, the same measured pose | 100 Hz | exact |
//! | `/tf` | `base_link` -> `top_turntable` | 100 Hz | exact |
//! | `/tf_static` | `base_link` -> `left_laser`, `right_laser`, `imu`; `top_turntable` -> `top_laser` | once, latched | start |
//!
//! With [`BobcatOptions::scans`] the lasers write what drivers of the LMS200 do: LaserScan on `/left/scan`, `/right/scan`,
//! `/top/scan`, with 81.83 m, beyond `range_max`, where a beam has no return.
//!
//! Beams without a return are absent from the clouds, as is what the lasers see of the loader itself.
//! The map is east, north, up at [`BOBCAT_ORIGIN`]; the lever arm of the IMU is
//! [`BASE_FROM_IMU_M`](crate::simulate::BASE_FROM_IMU_M) in `base_link`'s axes and its boresight is the identity.
//! GPS time is ahead of UTC by [`BOBCAT_LEAP_SECONDS`].
//!
//! `truth/` in the log's directory holds `poses.csv` (true `base_link` in `map` at every INS epoch: stamp in ns, metres,
//! quaternion), `points.ply` (true points in `map`, one for each point of the clouds, in the order of the log) and
//! `site.yaml` (origin, mounts, noise, seed).
//!
//! [`write_house`] writes another world: a furnished house as a robot maps it and as a headset sees
//! four of its corners (see [`crate::simulate::house`]), for calibrations; [`write_images`] what cameras see of such
//! houses, for networks. [`write_drive`] writes the scans of a lidar that moves (see [`crate::simulate::drive`]), for
//! odometry.

mod bobcat_options;
mod drive;
mod facts;
mod house;
mod images;
mod indoor;
mod log;
mod messages;
mod town;
mod truth;
mod write;

pub use bobcat_options::BobcatOptions;
pub use drive::{DriveLogOptions, DriveLogSummary, TRUTH_FILE, write_drive};
pub use facts::{
    BASE_FRAME, BOBCAT_GPS_WEEK, BOBCAT_GPS_WEEK_MS, BOBCAT_LEAP_SECONDS, BOBCAT_ORIGIN,
    BOBCAT_UNDULATION_M, IMU_FRAME, INSPVAX_TOPIC, MAP_FRAME, ODOMETRY_TOPIC, TF_STATIC_TOPIC,
    TF_TOPIC, TURNTABLE_FRAME, bobcat_origin, bobcat_start_ns, points_topic, scan_topic,
};
pub use house::{
    CLASSES_FILE, HeadsetAxes, HouseOptions, HouseSummary, MAP_FILE, SceneTruth, write_house,
};
pub use images::{
    IMAGES_FILE, ImageCamera, ImageEntry, ImageHouses, ImageSet, ImagesOptions, ImagesSummary,
    write_images,
};
pub use indoor::{
    Indoor, IndoorOptions, IndoorSummary, LabelAccuracy, label_accuracy, write_indoor,
};
pub use town::{TownOptions, TownSummary, write_town};
pub use write::{BobcatSummary, write_bobcat};
