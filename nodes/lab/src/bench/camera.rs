//! Latency and processor time of `semantic_cloud` with the images of a camera.

use std::fs;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::sensor_msgs::{CameraInfo, Image, PointCloud2};
use lattice_msgs::std_msgs::Header;
use lattice_nodes::executables;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Publisher, Runtime, SubscriptionExecutor};
use serde::Serialize;

use super::clock::process_cpu_s;
use crate::AnyError;
use crate::options::within;

const NODE: &str = "semantic_cloud";
/// For the last cloud.
const PATIENCE: Duration = Duration::from_secs(5);
/// Images that go before the clock starts.
const WARM_UP: u64 = 10;

/// Images to send.
#[derive(Clone, Debug)]
pub struct CameraSetup {
    /// Pixels in a row and rows.
    pub size: [u32; 2],
    /// Images a second.
    pub rate_hz: f64,
    /// Images in all.
    pub count: u64,
    /// True if the node labels images of colours itself; otherwise it is sent labels.
    pub has_model: bool,
    /// Parameters of the node, NAME:=VALUE.
    pub params: Vec<String>,
}

/// Result.
#[derive(Clone, Debug, Serialize)]
pub struct CameraReport {
    /// Images sent.
    pub sent: u64,
    /// Clouds received.
    pub clouds: u64,
    /// Points of the last.
    pub points: u32,
    /// From the call of `publish` with an image to the handler of its cloud: median, ms.
    pub median_ms: f64,
    /// 99th of a hundred, ms.
    pub p99_ms: f64,
    /// Processor time of the threads of the node, in cores.
    pub node_cores: f64,
    /// The same of all threads of the process, with the camera and the listener.
    pub process_cores: f64,
}

/// Sends images to the node in this process, by channels as `lattice run` does.
pub fn camera(setup: &CameraSetup) -> Result<CameraReport, AnyError> {
    within("rate-hz", setup.rate_hz, 0.1, 1e4)?;
    within("count", setup.count as f64, 1.0, 1e6)?;
    let domain = LoopbackDomain::take()?;
    let network = Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env()?
    };
    let params = setup.params.iter();
    let params = params.flat_map(|param| ["-p".to_owned(), format!("{NODE}:{param}")]);
    let args = ["--ros-args".to_owned()].into_iter().chain(params);
    let runtime = Runtime::with_transport("bench", RosArgs::parse(args)?, &network)?;
    let start = executables::find(NODE).ok_or("there is no such node")?;
    let finish = start(&runtime, NODE)?;
    let node = runtime.node("camera")?;
    let (sender, heard) = channel();
    let handler = move |cloud: Arc<PointCloud2>| {
        let _ = sender.send((cloud.header.stamp.to_ns(), cloud.width, Instant::now()));
    };
    let clouds = node.subscribe(
        "points",
        Qos::SCANS,
        SubscriptionExecutor::Dedicated,
        handler,
    )?;
    let info = node.publisher::<CameraInfo>("rgb/camera_info", Qos::SCANS)?;
    let depth = node.publisher("depth_registered/image_rect", Qos::SCANS)?;
    let topic = ["labels/image", "rgb/image_rect_color"][usize::from(setup.has_model)];
    let pictures = node.publisher(topic, Qos::SCANS)?;
    info.publish(setup.camera_info())?;
    let report = setup.play(&depth, &pictures, &heard);
    drop(clouds);
    finish();
    report
}

impl CameraSetup {
    fn camera_info(&self) -> CameraInfo {
        let [width, height] = self.size;
        let f = 0.9 * f64::from(width);
        let middle = |n: u32| f64::from(n.saturating_sub(1)) / 2.0;
        CameraInfo {
            width,
            height,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![-0.12, 0.03, 0.002, -0.001, 0.0],
            k: [f, 0.0, middle(width), 0.0, f, middle(height), 0.0, 0.0, 1.0],
            ..CameraInfo::default()
        }
    }

    /// An image of a wall 2 m and a box 1.5 m away.
    fn image(&self, encoding: &str, pixel: impl Fn(bool) -> Vec<u8>) -> Image {
        let [width, height] = self.size;
        let is_box = |column: u32, row: u32| {
            let middle = |at: u32, n: u32| at > n / 3 && at < 2 * n / 3;
            middle(column, width) && middle(row, height)
        };
        let rows = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
        let data: Vec<u8> = rows.flat_map(|(c, r)| pixel(is_box(c, r))).collect();
        Image {
            header: Header {
                frame_id: "camera".to_owned(),
                ..Header::default()
            },
            width,
            height,
            encoding: encoding.to_owned(),
            step: data.len() as u32 / height.max(1),
            data: data.into(),
            ..Image::default()
        }
    }

    fn play(
        &self,
        depth: &Publisher<Image>,
        pictures: &Publisher<Image>,
        heard: &Receiver<(i64, u32, Instant)>,
    ) -> Result<CameraReport, AnyError> {
        let depth_m = |is_box: bool| if is_box { 1.5_f32 } else { 2.0 };
        let depths = self.image("32FC1", |is_box| depth_m(is_box).to_le_bytes().to_vec());
        let picture = match self.has_model {
            true => self.image("rgb8", |is_box| vec![if is_box { 200 } else { 20 }; 3]),
            false => self.image("mono8", |is_box| vec![u8::from(is_box)]),
        };
        let stamped = |image: &Image, i: u64| {
            let mut image = image.clone();
            image.header.stamp = Time::from_ns((1e9 * (1.0 + i as f64 / self.rate_hz)) as i64);
            image
        };
        let mut sent = Vec::new();
        let (mut start, mut before) = (Instant::now(), None);
        let begin = Instant::now();
        for i in 0..WARM_UP + self.count {
            let due = begin + Duration::from_secs_f64(i as f64 / self.rate_hz);
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            if i == WARM_UP {
                while heard.try_recv().is_ok() {}
                (start, before) = (Instant::now(), Some(cpu_s()?));
            }
            let (depths, picture) = (stamped(&depths, i), stamped(&picture, i));
            if i >= WARM_UP {
                sent.push((depths.header.stamp.to_ns(), Instant::now()));
            }
            depth.publish(depths)?;
            pictures.publish(picture)?;
        }
        let [of_node, of_all] = cpu_s()?;
        let wall_s = start.elapsed().as_secs_f64();
        let [node_before, all_before] = before.unwrap_or_default();
        let (mut delays_ms, mut points) = (Vec::new(), 0);
        let last = sent.last().map_or(0, |(stamp_ns, _)| *stamp_ns);
        while let Ok((stamp_ns, width, at)) = heard.recv_timeout(PATIENCE) {
            let mut of = sent.iter().filter(|(stamp, _)| *stamp == stamp_ns);
            // None of the images that went before.
            let Some((_, sent)) = of.next() else { continue };
            delays_ms.push(1e3 * at.duration_since(*sent).as_secs_f64());
            points = width;
            if stamp_ns == last {
                break;
            }
        }
        delays_ms.sort_by(f64::total_cmp);
        let share = |share: f64| {
            let last = delays_ms.len().saturating_sub(1);
            let found = delays_ms.get((share * last as f64).round() as usize);
            found.copied().unwrap_or(f64::NAN)
        };
        Ok(CameraReport {
            sent: self.count,
            clouds: delays_ms.len() as u64,
            points,
            median_ms: share(0.5),
            p99_ms: share(0.99),
            node_cores: (of_node - node_before) / wall_s,
            process_cores: (of_all - all_before) / wall_s,
        })
    }
}

/// Processor time so far of the threads of the node and of all, s, by Linux.
fn cpu_s() -> Result<[f64; 2], AnyError> {
    let mut of_node = 0.0;
    for task in fs::read_dir("/proc/self/task")? {
        let task = task?.path();
        let read = |name: &str| fs::read_to_string(task.join(name));
        // Threads may end meanwhile.
        let (Ok(name), Ok(spent)) = (read("comm"), read("schedstat")) else {
            continue;
        };
        if name.starts_with(NODE) {
            let spent_ns: f64 = spent.split(' ').next().unwrap_or("0").parse()?;
            of_node += spent_ns * 1e-9;
        }
    }
    Ok([of_node, process_cpu_s()])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_image_becomes_a_cloud_whose_time_is_measured() {
        let setup = CameraSetup {
            size: [64, 48],
            rate_hz: 100.0,
            count: 20,
            has_model: false,
            params: vec!["edge_jump:=0.0".to_owned(), "queue_size:=100".to_owned()],
        };
        let report = camera(&setup).unwrap();
        assert_eq!((report.sent, report.points), (20, 64 * 48));
        assert!(report.clouds >= 19, "{report:?}");
        assert!(report.median_ms > 0.0 && report.median_ms <= report.p99_ms);
        assert!(report.node_cores > 0.0 && report.node_cores <= report.process_cores);
    }
}
