//! Logs in which clouds, clocks, poses and fixes are otherwise than messages say they should be. The table of
//! `docs/odd_logs.md` quotes what is said of each.

use super::cases::{Case, mcap, sqlite3};

const UNIT_US: &[&str] = &["-p", "time.unit:=us"];
const UNIT_MS: &[&str] = &["-p", "time.unit:=ms"];

pub fn oddities() -> Vec<Case> {
    [fields(), times(), extents(), clocks(), places()].concat()
}

fn fields() -> Vec<Case> {
    vec![
        mcap("field_uint64"),
        sqlite3("field_bool"),
        mcap("field_unknown_type").says(&[
            "field 'intensity' has datatype 77, not one of 1 to 11",
            "the field is ignored",
        ]),
        mcap("field_beyond_point")
            .says(&[
                "field 'intensity' ends at byte 22 of a point of 20 bytes: the field is ignored",
            ])
            .over_dds(),
        sqlite3("field_twice").says(&["field 'x' is declared twice: the field is ignored"]),
        mcap("field_count_zero").says(&["field 'intensity' has count 0, read as 1"]),
    ]
}

fn times() -> Vec<Case> {
    vec![
        mcap("time_uint64")
            .says(&["time of points: field 'timestamp', in ns, absolute"])
            .over_dds(),
        sqlite3("time_int64"),
        mcap("time_int32").says(&["time of points: field 't', in ns, stamp_start"]),
        mcap("time_name_with_unit").says(&["time of points: field 'time_offset_ns', in ns"]),
        sqlite3("time_ts").says(&["time of points: field 'ts', in s, stamp_start"]),
        mcap("time_us_float").refused(&[
            "times of field 'time' read as s span",
            "set `time.unit: us`",
        ]),
        mcap("time_us_float").with(UNIT_US).over_dds(),
        sqlite3("time_us_uint32").with(UNIT_US),
        mcap("time_us_uint32_moved").says(&["if they are us, set `time.unit: us`"]),
        mcap("time_tai").refused(&["are 37", "s from the stamp: synchronise the sensor"]),
        mcap("time_ms_double").refused(&[
            "times of field 'offset_time' read as s span",
            "set `time.unit: ms`",
        ]),
        mcap("time_ms_double").with(UNIT_MS),
        mcap("time_curvature").with(&["-p", "time.unit:=ms", "-p", "time.field:=curvature"]),
        mcap("time_pair").says(&[
            "no field is known as time, all points of a cloud are taken at its stamp",
            "if one of sec, nsec is their time, set `time.field` and `time.unit`",
        ]),
        sqlite3("time_nan").says(&["times of field 'time' are all NaN or infinite"]),
        mcap("time_none").says(&["no time field: all points of a cloud are taken at its stamp"]),
        mcap("time_outlier")
            .says(&["time of points: field 'timestamp'"])
            .over_dds(),
    ]
}

fn extents() -> Vec<Case> {
    vec![
        mcap("row_step_zero")
            .says(&["row_step is 0, read as width * point_step"])
            .over_dds(),
        sqlite3("row_step_of_a_point").says(&["row_step is 20, read as width * point_step"]),
        mcap("row_step_huge"),
        mcap("height_zero").says(&["height is 0, read as 1: data has"]),
        sqlite3("width_zero").refused(&[
            "width 0 * height 1 is 0 points, but data has",
            "nothing was mapped: 0 points in 30 clouds",
        ]),
    ]
}

fn clocks() -> Vec<Case> {
    vec![
        mcap("poses_jitter"),
        sqlite3("poses_twice").says(&["that of the message before"]),
        mcap("poses_of_another_year").says(&["from the newest, and those around it do not agree"]),
        mcap("clock_step_part").says(&["s before the first pose"]),
        sqlite3("clock_step_small").says(&["s before the first pose"]),
        mcap("clock_step_long").says(&["s before the first pose"]),
        mcap("clock_step_tf").says(&["as tf, of base_link in odom"]),
        mcap("clock_step_fixes").says(&["s before the first pose"]),
        mcap("log_twice"),
    ]
}

fn places() -> Vec<Case> {
    vec![
        mcap("utm_odometry").says(&["points are far from the origin of utm"]),
        mcap("fixes_null_island_between")
            .says(&["/fix: latitude and longitude are 0: the receiver has no position"])
            .over_dds(),
        sqlite3("fixes_one_fix_off").says(&[
            "/fix: position is 55.",
            "over 50 m/s (`ins.max_speed_m_per_s`)",
        ]),
        mcap("fixes_heights_flip").says(&["/fix: position is 40.", "over 50 m/s"]),
        mcap("fixes_no_height")
            .refused(&["poses usable: /fix: altitude is NaN: the receiver gives no height"]),
        sqlite3("fixes_status_unknown")
            .refused(&["fix status is -2 (unknown: the driver has set none), expected 0 or more"]),
        mcap("fixes_longitude_positive"),
        mcap("fixes_latitude_longitude_swapped").refused(&[
            "is not within -90..=90; check the unit and the order of latitude and longitude",
        ]),
        mcap("poses_teleport").says(&[
            "/odom: position is 30.",
            "over 50 m/s (`ins.max_speed_m_per_s`)",
        ]),
        mcap("poses_elsewhere").says(&[
            "/odom: position jumped by 28.",
            "and stayed there: the map continues there",
        ]),
        sqlite3("mount_without_rotation").refused(&[
            "transform of 'lidar' in 'base_link' is not finite, or its quaternion is zero",
        ]),
    ]
}
