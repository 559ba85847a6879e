//! The router of the crate `zenohd`, in place of that of PyPI's Zenoh.

use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::std_msgs::String as RosString;
use lattice_msgs::std_srvs::{Trigger, TriggerRequest};
use lattice_runtime::Runtime;
use lattice_runtime::qos::Qos;
use lattice_test::domain::TestDomain;
use lattice_test::python::zenohd;
use serde_bytes::ByteBuf;

use super::mapping::call;
use super::{PATIENCE, free_endpoint, hear, network, runtime, text};

/// Bytes of a large message.
const LARGE: usize = 2 << 20;

/// A router, which is killed when this is dropped.
struct Router(Child);

impl Router {
    fn start(program: &Path, endpoint: &str) -> Self {
        let mut command = Command::new(program);
        command.args([
            "--no-multicast-scouting",
            "--adminspace-permissions",
            "none",
        ]);
        command.args(["--listen", endpoint]);
        let child = command.stdout(Stdio::null()).spawn().unwrap();
        let router = Self(child);
        let address = endpoint.strip_prefix("tcp/").unwrap();
        let start = Instant::now();
        while TcpStream::connect(address).is_err() {
            assert!(start.elapsed() < PATIENCE, "no router at {endpoint}");
            thread::yield_now();
        }
        router
    }
}

impl Drop for Router {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Nodes that are clients of a router, so that every message passes through it.
struct Site {
    program: PathBuf,
    endpoint: String,
    domain: TestDomain,
}

impl Site {
    fn new() -> Option<Self> {
        Some(Self {
            program: zenohd()?,
            endpoint: free_endpoint(),
            domain: TestDomain::take(),
        })
    }

    fn router(&self) -> Router {
        Router::start(&self.program, &self.endpoint)
    }

    fn runtime(&self, name: &str) -> Runtime {
        // Looks for a lost router every 100 ms.
        let overrides = format!(
            "mode=\"client\";connect/endpoints=[\"{}\"];\
             connect/retry={{period_init_ms:100,period_max_ms:100,period_increase_factor:1}}",
            self.endpoint
        );
        runtime(name, &[], &network(&self.domain, &overrides, "0"))
    }
}

#[test]
fn topics_and_services_pass_through_zenohd() {
    let Some(site) = Site::new() else { return };
    let _router = site.router();
    let (from, to) = (site.runtime("from"), site.runtime("to"));
    let (from, to) = (from.node("from").unwrap(), to.node("to").unwrap());
    let name = from.publisher("/map_name", Qos::LATCHED).unwrap();
    for data in ["old", "kept"] {
        name.publish(text(data)).unwrap();
    }
    let clouds = from.publisher("/clouds", Qos::reliable(3)).unwrap();
    let (subscription, heard) = hear::<PointCloud2>(&to, "/clouds", Qos::reliable(3));
    let (sender, joined) = std::sync::mpsc::channel();
    clouds.on_subscriber_joined(move || {
        let _ = sender.send(());
    });
    joined.recv_timeout(PATIENCE).unwrap();
    let cloud = PointCloud2 {
        data: ByteBuf::from(vec![3; LARGE]),
        ..PointCloud2::default()
    };
    for width in 0..10 {
        let cloud = PointCloud2 {
            width,
            ..cloud.clone()
        };
        clouds.publish(cloud).unwrap();
        let received = heard.recv_timeout(PATIENCE).unwrap();
        assert_eq!((received.width, received.data.len()), (width, LARGE));
    }
    assert_eq!(subscription.lost(), 0);
    let (_late, kept) = hear::<RosString>(&to, "/map_name", Qos::LATCHED);
    assert_eq!(kept.recv_timeout(PATIENCE).unwrap().data, "kept");
    let _reset = from.service_trigger("~/reset", || (true, "done".to_owned()));
    let response = call::<Trigger>(&to, "/from/reset", &TriggerRequest::default());
    assert_eq!(response.message, "done");
}

#[test]
fn a_router_that_was_killed_and_restarted_connects_its_nodes_again() {
    let Some(site) = Site::new() else { return };
    let router = site.router();
    let (from, to) = (site.runtime("from"), site.runtime("to"));
    let (from, to) = (from.node("from").unwrap(), to.node("to").unwrap());
    let name = from.publisher("/map_name", Qos::LATCHED).unwrap();
    let chatter = from.publisher("/chatter", Qos::reliable(10)).unwrap();
    let _reset = from.service_trigger("~/reset", || (true, "done".to_owned()));
    let (subscription, heard) = hear::<RosString>(&to, "/chatter", Qos::reliable(10));
    name.publish(text("kept")).unwrap();
    let matched = |expected| {
        let start = Instant::now();
        let counts = || (chatter.subscriber_count(), subscription.publisher_count());
        while counts() != (expected, expected) {
            assert!(start.elapsed() < PATIENCE, "{:?} match", counts());
            thread::sleep(Duration::from_millis(1));
        }
    };
    let exchange = |data: &str| {
        chatter.publish(text(data)).unwrap();
        assert_eq!(heard.recv_timeout(PATIENCE).unwrap().data, data);
        let response = call::<Trigger>(&to, "/from/reset", &TriggerRequest::default());
        assert!(response.success);
    };
    matched(1);
    exchange("before");
    drop(router);
    matched(0);
    let _router = site.router();
    matched(1);
    exchange("after");
    let late = site.runtime("late");
    let late = late.node("late").unwrap();
    let (_late, kept) = hear::<RosString>(&late, "/map_name", Qos::LATCHED);
    assert_eq!(kept.recv_timeout(PATIENCE).unwrap().data, "kept");
}
