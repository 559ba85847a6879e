//! `voxel_markers` to foreign viewers whose receive buffer is that of a stock kernel: they end up with all markers, and each
//! change was sent once.

use std::fs;
use std::io::{BufRead, BufReader, Lines};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::mpsc::channel;
use std::thread;
use std::time::{Duration, Instant};

use lattice_core::lattice::LatticeKind;
use lattice_msgs::cdr;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::visualization_msgs::{Marker, MarkerArray};
use lattice_nodes::report;
use lattice_nodes::voxel_marker_publisher::{MarkerOptions, MarkerReport, VoxelMarkers};
use lattice_runtime::Runtime;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_test::clouds::cloud;
use lattice_test::domain::TestDomain;
use lattice_test::maps;
use lattice_test::peer::{Nodes, params};
use lattice_test::python::{python, ros_pythons, script};
use serde::Deserialize;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(120);

/// 10 Hz.
const CLOUD_PERIOD: Duration = Duration::from_millis(100);

/// Below the lease of a participant, above the patience of a queue that drops.
const STOP: Duration = Duration::from_secs(4);

const CELL_VOLUME_M3: f64 = 0.125;

/// A hill as a machine sees it that drives by: 10 m wide, 20 m long, a metre further with every cloud.
fn hill(number: usize) -> Vec<[f32; 3]> {
    let along = (0..100).map(|i| number as f32 + i as f32 * 0.2);
    let across = |x: f32| (0..50).map(move |j| (x, j as f32 * 0.2));
    let height = |x: f32, y: f32| 2.0 * (0.31 * x).sin() * (0.43 * y).cos();
    let points = along.flat_map(across);
    points.map(|(x, y)| [x, y, height(x, y)]).collect()
}

/// Markers that a viewer of the last map has, and the bytes of all changes, each sent once.
struct Expected {
    points: Vec<[f64; 3]>,
    bytes: u64,
}

impl Expected {
    fn of(clouds: usize) -> Self {
        let mut mapper = maps::mapper(maps::options(LatticeKind::Fcc, CELL_VOLUME_M3));
        let mut markers = VoxelMarkers::new(MarkerOptions::default());
        let mut bytes = 0;
        for number in 0..clouds {
            maps::insert(&mut mapper, &hill(number));
            if number == 0 {
                for chunk in mapper.keyframe() {
                    markers.on_map(&chunk).unwrap();
                }
            } else {
                for chunk in mapper.take_update() {
                    markers.on_update(&chunk).unwrap();
                }
            }
            bytes += bytes_of(&markers.take_arrays(usize::MAX));
        }
        markers.redraw();
        let arrays = markers.take_arrays(usize::MAX);
        let shown = arrays.iter().flat_map(|array| &array.markers);
        let mut points: Vec<[f64; 3]> = shown
            .filter(|marker| marker.action == Marker::ADD)
            .flat_map(|marker| {
                let at = &marker.pose.position;
                (marker.points.iter()).map(move |p| [at.x + p.x, at.y + p.y, at.z + p.z])
            })
            .collect();
        points.sort_by(|a, b| a.partial_cmp(b).unwrap());
        Self { points, bytes }
    }

    fn write(&self, file: &Path) {
        let bytes = self.points.iter().flatten().flat_map(|v| v.to_le_bytes());
        fs::write(file, bytes.collect::<Vec<u8>>()).unwrap();
    }
}

fn bytes_of(arrays: &[MarkerArray]) -> u64 {
    let bytes = |array| cdr::to_vec(array).unwrap().len() as u64;
    arrays.iter().map(bytes).sum()
}

/// Messages that a viewer received.
#[derive(Debug, Deserialize)]
struct Received {
    messages: u64,
    markers: u64,
    cleared: u64,
}

/// A viewer in Python, which ends with its input.
struct Viewer {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Viewer {
    fn start(python: &Path, kind: &str, domain: &TestDomain, expected: &Path) -> Self {
        let mut child = Command::new(python)
            .arg(script("marker_reader.py"))
            .args([kind, &domain.id().to_string()])
            .arg(expected)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        Self { child, lines }
    }

    fn line(&mut self) -> String {
        self.lines.next().unwrap().unwrap()
    }

    fn signal(&self, name: &str) {
        let kill = Command::new("kill")
            .args([name, &self.child.id().to_string()])
            .status();
        assert!(kill.unwrap().success());
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Maps clouds before viewers, who stand still meanwhile if they are to.
fn draw(clouds: usize, chunk_bytes: usize, stop: bool) {
    let mut pythons: Vec<(PathBuf, &str)> = python()
        .into_iter()
        .map(|python| (python, "cyclone"))
        .collect();
    pythons.extend(ros_pythons().into_iter().map(|python| (python, "rclpy")));
    if pythons.is_empty() {
        return;
    }
    let domain = TestDomain::take();
    let directory = tempfile::tempdir().unwrap();
    let (file, reported) = (
        directory.path().join("expected"),
        directory.path().join("report"),
    );
    let expected = Expected::of(clouds);
    expected.write(&file);
    let reliable = "qos.points_enu.reliability:=reliable";
    let mut markers = params(&format!("chunk_bytes:={chunk_bytes}"));
    markers.push(format!("report_file:={}", reported.display()));
    let mapper = params(&format!(
        "lattice:=fcc cell_volume_m3:={CELL_VOLUME_M3} {reliable}"
    ));
    let nodes = [
        ("lattice_mapper", mapper),
        ("voxel_marker_publisher", markers),
    ];
    let nodes = Nodes::start(&domain, &nodes);
    let args = RosArgs::parse([]).unwrap();
    let runtime = Runtime::with_transport("driver", args, &domain.transport()).unwrap();
    let driver = runtime.node("driver").unwrap();
    let points = driver
        .publisher::<PointCloud2>("/points_enu", Qos::reliable(clouds))
        .unwrap();
    let (sender, joined) = channel();
    points.on_subscriber_joined(move || {
        let _ = sender.send(());
    });
    joined.recv_timeout(PATIENCE).unwrap();
    let start = |(python, kind): &(PathBuf, &str)| Viewer::start(python, kind, &domain, &file);
    let mut viewers: Vec<Viewer> = pythons.iter().map(start).collect();
    for viewer in &mut viewers {
        assert_eq!(viewer.line(), "ready");
    }
    let begin = Instant::now();
    let mut stopped = None;
    for number in 0..clouds {
        points
            .publish(cloud("map", 1 + number as i64, &hill(number)))
            .unwrap();
        // The rate of the sensor.
        thread::sleep(CLOUD_PERIOD);
        if stop && number == clouds / 6 {
            viewers.iter().for_each(|viewer| viewer.signal("-STOP"));
            stopped = Some(Instant::now());
        }
        if stopped.is_some_and(|since| since.elapsed() > STOP) {
            viewers.iter().for_each(|viewer| viewer.signal("-CONT"));
            stopped = None;
        }
    }
    assert!(stopped.is_none(), "too few clouds for a stop");
    let mut received = Vec::new();
    for (viewer, (_, kind)) in viewers.iter_mut().zip(&pythons) {
        let line = viewer.line();
        let took_s = begin.elapsed().as_secs_f64();
        println!("{clouds} clouds, {kind}: {line} after {took_s:.1} s");
        received.push(serde_json::from_str::<Received>(&line).unwrap());
    }
    nodes.finish();
    let report: MarkerReport = report::read(&reported).unwrap();
    println!(
        "{} points, {} bytes of changes; {report:?}",
        expected.points.len(),
        expected.bytes
    );
    assert_eq!(
        (report.arrays_not_published, report.blocks_not_drawn),
        (0, 0)
    );
    assert!(
        report.published_bytes <= expected.bytes,
        "more than what changed"
    );
    let drawn = report.counts.markers_added + report.counts.markers_deleted;
    for received in received {
        assert!(received.cleared <= 1, "{received:?}");
        assert!(
            received.messages <= report.counts.arrays_out,
            "{received:?}"
        );
        assert!(received.markers <= drawn + received.cleared, "{received:?}");
    }
}

#[test]
fn viewers_with_stock_buffers_have_the_markers_of_60_clouds_despite_a_stop() {
    // More arrays than the history holds change in the time of the stop.
    draw(60, 8000, true);
}

#[test]
fn viewers_with_stock_buffers_have_the_markers_of_150_clouds() {
    draw(150, 60_000, false);
}
