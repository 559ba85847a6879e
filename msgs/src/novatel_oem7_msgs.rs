//! Inertial solution of the NovAtel OEM7 driver (ROS 2 branches).

use serde::{Deserialize, Serialize};

use crate::interface::messages;
use crate::std_msgs::Header;

messages! {
    "novatel_oem7_msgs" in "../definitions/novatel_oem7_msgs/";
    Oem7Header [];
    InertialSolutionStatus [];
    PositionOrVelocityType [];
    INSExtendedSolutionStatus [];
    INSPVA [Header, Oem7Header, InertialSolutionStatus];
    INSPVAX [Header, Oem7Header, InertialSolutionStatus, PositionOrVelocityType, INSExtendedSolutionStatus];
}

/// Header of a NovAtel OEM7 log; carries the GPS time of the data.
///
/// Layout of the driver for Humble and Jazzy; older drivers end with a uint8 idle_time instead.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Oem7Header {
    /// Name of the message, such as INSPVA.
    pub message_name: String,
    /// Number of the log type.
    pub message_id: u16,
    /// Bits of source and format.
    pub message_type: u8,
    /// Number of parts of the log that follow.
    pub sequence_number: u32,
    /// Quality of the GPS time, as numbered in the receiver manual.
    pub time_status: u8,
    /// GPS week: weeks since 1980-01-06.
    pub gps_week_number: u16,
    /// Time since the start of the GPS week, ms.
    pub gps_week_milliseconds: u32,
    /// Status bits, as numbered in the receiver manual.
    pub receiver_status: u32,
    /// Idle time of the receiver's processor, %; 255 if unknown.
    pub idle_time: f32,
}

impl Oem7Header {
    /// Value of `message_type` for a log.
    pub const OEM7MSGTYPE_LOG: u16 = 0;
}

/// State of the inertial solution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct InertialSolutionStatus {
    /// Status, one of the constants of this struct.
    pub status: u32,
}

impl InertialSolutionStatus {
    /// Not running.
    pub const INS_INACTIVE: u32 = 0;
    /// Aligning.
    pub const INS_ALIGNING: u32 = 1;
    /// Running, poor.
    pub const INS_HIGH_VARIANCE: u32 = 2;
    /// Running, good.
    pub const INS_SOLUTION_GOOD: u32 = 3;
    /// Good, without GNSS update.
    pub const INS_SOLUTION_FREE: u32 = 6;
    /// Aligned, vehicle not yet moved enough.
    pub const INS_ALIGNMENT_COMPLETE: u32 = 7;
    /// Finding which axis is up.
    pub const DETERMINING_ORIENTATION: u32 = 8;
    /// Waits for a position.
    pub const WAITING_INITIAL_POS: u32 = 9;
    /// Waits for a heading.
    pub const WAITING_AZIMUTH: u32 = 10;
    /// Estimates biases at rest.
    pub const INITIALIZING_BIASES: u32 = 11;
    /// Waits for motion to end.
    pub const MOTION_DETECT: u32 = 12;
}

/// Method of a position or velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PositionOrVelocityType {
    /// Type, one of the constants of this struct.
    #[serde(rename = "type")]
    pub type_: u32,
}

impl PositionOrVelocityType {
    /// No solution.
    pub const NONE: u32 = 0;
    /// Fixed by command.
    pub const FIXEDPOS: u32 = 1;
    /// Height fixed by command.
    pub const FIXEDHEIGHT: u32 = 2;
    /// Velocity from Doppler.
    pub const DOPPLER_VELOCITY: u32 = 8;
    /// Single point.
    pub const SINGLE: u32 = 16;
    /// Differential code.
    pub const PSRDIFF: u32 = 17;
    /// SBAS corrections.
    pub const WAAS: u32 = 18;
    /// Propagated by filter.
    pub const PROPAGATED: u32 = 19;
    /// Float ambiguities L1.
    pub const L1_FLOAT: u32 = 32;
    /// Float narrow lane.
    pub const NARROW_FLOAT: u32 = 34;
    /// Integer L1.
    pub const L1_INT: u32 = 48;
    /// Integer wide lane.
    pub const WIDE_INT: u32 = 49;
    /// Integer narrow lane.
    pub const NARROW_INT: u32 = 50;
    /// RTK updates direct to the INS.
    pub const RTK_DIRECT_INS: u32 = 51;
    /// INS with SBAS.
    pub const INS_SBAS: u32 = 52;
    /// INS with single point.
    pub const INS_PSRSP: u32 = 53;
    /// INS with differential code.
    pub const INS_PSRDIFF: u32 = 54;
    /// INS with RTK float.
    pub const INS_RTKFLOAT: u32 = 55;
    /// INS with RTK fixed.
    pub const INS_RTKFIXED: u32 = 56;
    /// PPP not yet converged.
    pub const PPP_CONVERGING: u32 = 68;
    /// PPP converged.
    pub const PPP: u32 = 69;
    /// Within operational limits.
    pub const OPERATIONAL: u32 = 70;
    /// Within warning limits.
    pub const WARNING: u32 = 71;
    /// Outside limits.
    pub const OUT_OF_BOUNDS: u32 = 72;
    /// INS with converging PPP.
    pub const INS_PPP_CONVERGING: u32 = 73;
    /// INS with PPP.
    pub const INS_PPP: u32 = 74;
    /// Basic PPP not yet converged.
    pub const PPP_BASIC_CONVERGING: u32 = 77;
    /// Basic PPP converged.
    pub const PPP_BASIC: u32 = 78;
    /// INS with converging basic PPP.
    pub const INS_PPP_BASIC_CONVERGING: u32 = 79;
    /// INS with basic PPP.
    pub const INS_PPP_BASIC: u32 = 80;
}

/// Aids that the inertial solution used; the names are spelt as the driver spells them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct INSExtendedSolutionStatus {
    /// Bit mask of the constants of this struct.
    pub status: u32,
}

impl INSExtendedSolutionStatus {
    /// Position used.
    pub const POSITION_UPDATE: u32 = 1;
    /// Carrier phase used.
    pub const PHASE_UPDATE: u32 = 2;
    /// Standstill used.
    pub const ZERO_VELOCITY_UPDATE: u32 = 4;
    /// Wheel sensor used.
    pub const WHEEL_SEONSOR_UPDATE: u32 = 8;
    /// Dual antenna heading used.
    pub const ALIGN_UPDATE: u32 = 16;
    /// External position used.
    pub const EXTERNAL_POSITION_UPDATE: u32 = 32;
    /// Solution converged.
    pub const INS_SOLUTIN_CONVERGENCE_FLAG: u32 = 64;
    /// Doppler used.
    pub const DOPPLER_UPDATE: u32 = 128;
    /// Pseudoranges used.
    pub const PSEUDORANGE_UPDATE: u32 = 256;
    /// Velocity used.
    pub const VELOCITY_UPDATE: u32 = 512;
    /// Reserved.
    pub const RESERVED_1: u32 = 1024;
    /// Dead reckoning used.
    pub const DEAD_RECONING_UPDATE: u32 = 2048;
    /// Phase wind-up used.
    pub const PHASE_WIND_UP_UPDATE: u32 = 4096;
    /// Course over ground used.
    pub const COURSE_OVER_GROUND_UPDATE: u32 = 8192;
    /// External velocity used.
    pub const EXTERNAL_VELOCITY_UPDATE: u32 = 16384;
    /// External attitude used.
    pub const EXTERNAL_ATTITUDE_UPDATE: u32 = 32768;
    /// Number in the driver; the bit is 0x10000.
    pub const EXTERNAL_HEADING_UPDATE: u32 = 65535;
    /// External height used.
    pub const EXTERNAL_HEIGHT_UPDATE: u32 = 131072;
    /// Reserved.
    pub const RESERVED_2: u32 = 262144;
    /// Reserved.
    pub const RESERVED_3: u32 = 524288;
    /// Rover position used.
    pub const ROVER_POSITION_UPDATE: u32 = 1048576;
    /// Rover position was RTK integer.
    pub const ROVER_POSITION_UPDATE_TYPE: u32 = 2097152;
    /// Reserved.
    pub const RESERVED_4: u32 = 4194304;
    /// Reserved.
    pub const RESERVED_5: u32 = 8388608;
    /// Biases estimated at standstill.
    pub const TURN_ON_BIASES_ESTIMATED: u32 = 16777216;
    /// Direction of travel verified.
    pub const ALIGNMENT_DIRECTION_VERIFIED: u32 = 33554432;
    /// Bit 0 of ALIGNMENT_*.
    pub const ALIGNMENT_INDICATION_1: u32 = 67108864;
    /// Bit 1 of ALIGNMENT_*.
    pub const ALIGNMENT_INDICATION_2: u32 = 134217728;
    /// Bit 2 of ALIGNMENT_*.
    pub const ALIGNMENT_INDICATION_3: u32 = 268435456;
    /// Number in the driver; the bit is 0x20000000.
    pub const NVM_SEED_INDICATION_1: u32 = 538870912;
    /// Bit 1 of NVM_SEED_*.
    pub const NVM_SEED_INDICATION_2: u32 = 1073741824;
    /// Bit 2 of NVM_SEED_*.
    pub const NVM_SEED_INDICATION_3: u32 = 2147483648;
    /// Not aligned.
    pub const ALIGNMENT_INCOMPLETE_ALIGNMENT: u32 = 0;
    /// Aligned at rest.
    pub const ALIGNMENT_STATIC: u32 = 1;
    /// Aligned in motion.
    pub const ALIGNMENT_KINETMATIC: u32 = 2;
    /// Aligned by two antennas.
    pub const ALIGNMENT_DUAL_ANTENNA: u32 = 3;
    /// Aligned by command.
    pub const ALIGNMENT_USER_COMMAND: u32 = 4;
    /// Aligned from stored state.
    pub const ALIGNMENT_NVM_SEED: u32 = 5;
    /// Not in use.
    pub const NVM_SEED_INACTIVE: u32 = 0;
    /// Stored state not valid.
    pub const NVM_SEED_STORED_INVALID: u32 = 1;
    /// Stored state being checked.
    pub const NVM_SEED_PENDING_VALIDATION: u32 = 2;
    /// Stored state taken.
    pub const NVM_SEED_INJECTED: u32 = 4;
    /// Stored state dropped.
    pub const NVM_SEEED_DATA_IGNORED: u32 = 5;
    /// Stored error model taken.
    pub const NVM_SEED_ERROR_MODEL_DATA_INJECTED: u32 = 6;
}

/// Inertial position, velocity and attitude.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct INSPVA {
    /// Stamp is the time of arrival at the driver.
    pub header: Header,
    /// GPS time of the solution.
    pub nov_header: Oem7Header,
    /// Latitude, degrees, in the datum of the receiver (WGS 84 by default).
    pub latitude: f64,
    /// Longitude, degrees, in the datum of the receiver (WGS 84 by default).
    pub longitude: f64,
    /// Height above the ellipsoid, m.
    pub height: f64,
    /// North velocity, m/s.
    pub north_velocity: f64,
    /// East velocity, m/s.
    pub east_velocity: f64,
    /// Up velocity, m/s.
    pub up_velocity: f64,
    /// Roll, degrees, right-handed about the forward (y) axis.
    pub roll: f64,
    /// Pitch, degrees, right-handed about the right (x) axis.
    pub pitch: f64,
    /// Azimuth, degrees, clockwise from true north.
    pub azimuth: f64,
    /// State of the solution.
    pub status: InertialSolutionStatus,
}

/// Inertial position, velocity and attitude with standard deviations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct INSPVAX {
    /// Stamp is the time of arrival at the driver.
    pub header: Header,
    /// GPS time of the solution.
    pub nov_header: Oem7Header,
    /// State of the solution.
    pub ins_status: InertialSolutionStatus,
    /// Method of the position.
    pub pos_type: PositionOrVelocityType,
    /// Latitude, degrees, in the datum of the receiver (WGS 84 by default).
    pub latitude: f64,
    /// Longitude, degrees, in the datum of the receiver (WGS 84 by default).
    pub longitude: f64,
    /// Height above mean sea level, m: the ellipsoidal height is height + undulation.
    pub height: f64,
    /// Height of the geoid above the ellipsoid, m.
    pub undulation: f32,
    /// North velocity, m/s.
    pub north_velocity: f64,
    /// East velocity, m/s.
    pub east_velocity: f64,
    /// Up velocity, m/s.
    pub up_velocity: f64,
    /// Roll, degrees, right-handed about the forward (y) axis.
    pub roll: f64,
    /// Pitch, degrees, right-handed about the right (x) axis.
    pub pitch: f64,
    /// Azimuth, degrees, clockwise from true north.
    pub azimuth: f64,
    /// Standard deviation of the latitude, m.
    pub latitude_stdev: f32,
    /// Standard deviation of the longitude, m.
    pub longitude_stdev: f32,
    /// Standard deviation of the height, m.
    pub height_stdev: f32,
    /// Standard deviation of the north velocity, m/s.
    pub north_velocity_stdev: f32,
    /// Standard deviation of the east velocity, m/s.
    pub east_velocity_stdev: f32,
    /// Standard deviation of the up velocity, m/s.
    pub up_velocity_stdev: f32,
    /// Standard deviation of the roll, degrees.
    pub roll_stdev: f32,
    /// Standard deviation of the pitch, degrees.
    pub pitch_stdev: f32,
    /// Standard deviation of the azimuth, degrees.
    pub azimuth_stdev: f32,
    /// Aids in use.
    pub ext_sol_status: INSExtendedSolutionStatus,
    /// Time since the last position or zero velocity update, s.
    pub time_since_update: u16,
}
