//! Messages of the simulated sensors.

use super::facts::{
    BASE_FRAME, BOBCAT_GPS_WEEK, BOBCAT_GPS_WEEK_MS, BOBCAT_UNDULATION_M, IMU_FRAME, MAP_FRAME,
    TURNTABLE_FRAME, bobcat_start_ns,
};
use crate::simulate::{BEAMS, Bobcat, InsSample, Laser, Lms200Scan, base_from_imu};
use std::f32::consts::{FRAC_PI_2, PI};

use lattice_core::geodesy::{EnuFrame, GeodesyError};
use lattice_msgs::geometry_msgs::Vector3;
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::novatel_oem7_msgs::{
    INSExtendedSolutionStatus, INSPVAX, InertialSolutionStatus, Oem7Header, PositionOrVelocityType,
};
use lattice_msgs::sensor_msgs::{LaserScan, PointCloud2, PointField};
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_nodes::convert::cloud::{dense_cloud, xyz_fields};
use lattice_nodes::convert::geometry::{header, pose_from, transform_stamped};

/// x, y, z, intensity (f32) and t (u32).
const POINT_STEP: u32 = 20;
/// Range of an LMS200 for a beam without a return, m: 8183 cm, its code of a value beyond the range.
const NO_RETURN_M: f32 = 81.83;
const WEEK_MS: u64 = 604_800_000;
/// Number of the INSPVAX log in the receiver's manual.
const INSPVAX_ID: u16 = 1465;
/// Time status "fine steering" in the receiver's manual.
const FINE_STEERING: u8 = 180;

/// Time in the log as UTC, ns.
fn utc_ns(time_ns: i64) -> i64 {
    bobcat_start_ns().saturating_add(time_ns)
}

/// A scan in its laser's frame; the stamp is the first beam's time and `t` (ns) counts from it.
pub(super) fn cloud(laser: Laser, scan: &Lms200Scan) -> PointCloud2 {
    let field = |name: &str, offset, datatype| PointField {
        name: name.to_owned(),
        offset,
        datatype,
        count: 1,
    };
    let mut fields = xyz_fields(PointField::FLOAT32, 4);
    fields.push(field("intensity", 12, PointField::FLOAT32));
    fields.push(field("t", 16, PointField::UINT32));
    let mut data = Vec::with_capacity(scan.returns.len() * POINT_STEP as usize);
    for hit in &scan.returns {
        for value in hit.point_m {
            data.extend_from_slice(&value.to_le_bytes());
        }
        data.extend_from_slice(&hit.intensity.to_le_bytes());
        data.extend_from_slice(&hit.offset_ns.to_le_bytes());
    }
    let header = header(laser.frame(), utc_ns(scan.start_ns));
    dense_cloud(header, fields, POINT_STEP, scan.returns.len(), data)
}

/// The same scan as drivers of the LMS200 publish it.
pub(super) fn laser_scan(laser: Laser, scan: &Lms200Scan) -> LaserScan {
    let mut ranges = vec![NO_RETURN_M; usize::from(BEAMS)];
    let mut intensities = vec![0.0; usize::from(BEAMS)];
    for hit in &scan.returns {
        let beam = usize::from(hit.beam);
        if let (Some(range_m), Some(intensity)) = (ranges.get_mut(beam), intensities.get_mut(beam))
        {
            (*range_m, *intensity) = (hit.range_m, hit.intensity);
        }
    }
    LaserScan {
        header: header(laser.frame(), utc_ns(scan.start_ns)),
        angle_min: -FRAC_PI_2,
        angle_max: FRAC_PI_2,
        angle_increment: PI / f32::from(BEAMS - 1),
        time_increment: 1.0 / 27_000.0,
        scan_time: 1.0 / 75.0,
        range_min: 0.0,
        range_max: 81.0,
        ranges,
        intensities,
    }
}

/// The IMU's pose as the NovAtel driver reports it: stamped on arrival, GPS time of validity in
/// `nov_header`.
pub(super) fn inspvax(map: &EnuFrame, sample: &InsSample) -> Result<INSPVAX, GeodesyError> {
    let place = map.geodetic_from_enu(&sample.map_from_imu.translation.vector)?;
    let local_from_map = map.enu_from_local_level(&place).inverse();
    let (roll_rad, nose_down_rad, yaw_rad) =
        (local_from_map * sample.map_from_imu.rotation).euler_angles();
    let velocity_mps = local_from_map * sample.velocity_mps;
    let ms = u64::from(BOBCAT_GPS_WEEK_MS)
        .saturating_add(u64::try_from(sample.time_ns / 1_000_000).unwrap_or(0));
    let week = u64::from(BOBCAT_GPS_WEEK).saturating_add(ms / WEEK_MS);
    let [east_m, north_m, up_m] = InsSample::POSITION_SIGMA_M.map(|sigma_m| sigma_m as f32);
    let [roll_deg, pitch_deg, azimuth_deg] =
        InsSample::ATTITUDE_SIGMA_DEG.map(|sigma_deg| sigma_deg as f32);
    let speed_mps = InsSample::VELOCITY_SIGMA_MPS as f32;
    Ok(INSPVAX {
        header: header(
            IMU_FRAME,
            utc_ns(sample.time_ns.saturating_add(sample.delay_ns)),
        ),
        nov_header: Oem7Header {
            message_name: "INSPVAX".to_owned(),
            message_id: INSPVAX_ID,
            message_type: 0,
            sequence_number: 0,
            time_status: FINE_STEERING,
            gps_week_number: u16::try_from(week).unwrap_or(u16::MAX),
            gps_week_milliseconds: u32::try_from(ms % WEEK_MS).unwrap_or(0),
            receiver_status: 0,
            idle_time: 50.0,
        },
        ins_status: InertialSolutionStatus {
            status: InertialSolutionStatus::INS_SOLUTION_GOOD,
        },
        pos_type: PositionOrVelocityType {
            type_: PositionOrVelocityType::INS_RTKFIXED,
        },
        latitude: place.latitude_deg(),
        longitude: place.longitude_deg(),
        height: place.height_m - f64::from(BOBCAT_UNDULATION_M),
        undulation: BOBCAT_UNDULATION_M,
        north_velocity: velocity_mps.y,
        east_velocity: velocity_mps.x,
        up_velocity: velocity_mps.z,
        roll: roll_rad.to_degrees(),
        pitch: -nose_down_rad.to_degrees(),
        azimuth: (90.0 - yaw_rad.to_degrees()).rem_euclid(360.0),
        latitude_stdev: north_m,
        longitude_stdev: east_m,
        height_stdev: up_m,
        north_velocity_stdev: speed_mps,
        east_velocity_stdev: speed_mps,
        up_velocity_stdev: speed_mps,
        roll_stdev: roll_deg,
        pitch_stdev: pitch_deg,
        azimuth_stdev: azimuth_deg,
        ext_sol_status: INSExtendedSolutionStatus {
            status: INSExtendedSolutionStatus::POSITION_UPDATE
                | INSExtendedSolutionStatus::PHASE_UPDATE
                | INSExtendedSolutionStatus::INS_SOLUTIN_CONVERGENCE_FLAG,
        },
        time_since_update: 0,
    })
}

/// The same measured pose, carried to `base_link`, stamped with its time of validity.
pub(super) fn odometry(sample: &InsSample) -> Odometry {
    let mut odometry = Odometry {
        header: header(MAP_FRAME, utc_ns(sample.time_ns)),
        child_frame_id: BASE_FRAME.to_owned(),
        ..Odometry::default()
    };
    odometry.pose.pose = pose_from(&sample.map_from_base);
    let attitude_rad = InsSample::ATTITUDE_SIGMA_DEG.map(f64::to_radians);
    let pose_sigmas = InsSample::POSITION_SIGMA_M.into_iter().chain(attitude_rad);
    let diagonal = odometry.pose.covariance.iter_mut().step_by(7);
    for (diagonal, sigma) in diagonal.zip(pose_sigmas) {
        *diagonal = sigma * sigma;
    }
    odometry.twist.twist.linear = vector(&sample.base_velocity_mps);
    odometry.twist.twist.angular = vector(&sample.base_turn_rate_radps);
    for diagonal in odometry.twist.covariance.iter_mut().step_by(7).take(3) {
        *diagonal = InsSample::VELOCITY_SIGMA_MPS * InsSample::VELOCITY_SIGMA_MPS;
    }
    odometry
}

pub(super) fn turntable(bobcat: &Bobcat, time_ns: i64) -> TFMessage {
    let pose = bobcat.base_from_turntable(time_ns);
    let transform = transform_stamped(BASE_FRAME, TURNTABLE_FRAME, utc_ns(time_ns), &pose);
    TFMessage {
        transforms: vec![transform],
    }
}

pub(super) fn mounts() -> TFMessage {
    let mount = |parent, child, pose| transform_stamped(parent, child, bobcat_start_ns(), &pose);
    let laser = |parent, laser: Laser| mount(parent, laser.frame(), laser.mount());
    TFMessage {
        transforms: vec![
            laser(BASE_FRAME, Laser::Left),
            laser(BASE_FRAME, Laser::Right),
            laser(TURNTABLE_FRAME, Laser::Top),
            mount(BASE_FRAME, IMU_FRAME, base_from_imu()),
        ],
    }
}

fn vector(v: &nalgebra::Vector3<f64>) -> Vector3 {
    let [x, y, z] = (*v).into();
    Vector3 { x, y, z }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::datasets::bobcat_origin;
    use lattice_core::geodesy::utc_ns_from_gps;

    #[test]
    fn inspvax_carries_exact_gps_time_and_a_late_stamp() {
        let bobcat = Bobcat::new(3, 2.0).unwrap();
        let map = EnuFrame::new(bobcat_origin().unwrap());
        for sample in bobcat.ins() {
            let ins = inspvax(&map, &sample).unwrap();
            let week = u32::from(ins.nov_header.gps_week_number);
            let valid_ns = utc_ns_from_gps(week, ins.nov_header.gps_week_milliseconds, 18);
            assert_eq!(valid_ns, odometry(&sample).header.stamp.to_ns());
            assert_eq!(ins.header.stamp.to_ns() - valid_ns, sample.delay_ns);
        }
    }

    #[test]
    fn gps_time_goes_on_in_the_next_week() {
        let bobcat = Bobcat::new(3, 1.0).unwrap();
        let map = EnuFrame::new(bobcat_origin().unwrap());
        let mut sample = bobcat.ins().next().unwrap();
        sample.time_ns =
            i64::try_from(WEEK_MS - u64::from(BOBCAT_GPS_WEEK_MS) + 10).unwrap() * 1_000_000;
        let header = inspvax(&map, &sample).unwrap().nov_header;
        assert_eq!(header.gps_week_number, 2401);
        assert_eq!(header.gps_week_milliseconds, 10);
    }

    #[test]
    fn each_frame_has_one_parent() {
        let bobcat = Bobcat::new(3, 2.0).unwrap();
        let mut children = mounts().transforms;
        children.extend(turntable(&bobcat, 0).transforms);
        children.sort_by(|a, b| a.child_frame_id.cmp(&b.child_frame_id));
        let names = children.iter();
        let names = names.map(|t| format!("{}/{}", t.header.frame_id, t.child_frame_id));
        let names: Vec<String> = names.collect();
        assert_eq!(
            names.join(" "),
            "base_link/imu base_link/left_laser base_link/right_laser \
             top_turntable/top_laser base_link/top_turntable"
        );
    }
}
