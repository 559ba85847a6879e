//! A service that sets a switch, and a client that calls it.
//!
//! `cargo run -p lattice_runtime --example 2_service`

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use lattice_msgs::cdr;
use lattice_msgs::std_srvs::{SetBool, SetBoolRequest, SetBoolResponse};
use lattice_runtime::env::Network;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Runtime};

const PATIENCE: Duration = Duration::from_secs(10);

fn main() -> Result<(), Box<dyn Error>> {
    // A domain of its own on this machine. On a robot: Runtime::start("lamp", args).
    let domain = LoopbackDomain::take()?;
    let network = Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env()?
    };
    let args = RosArgs::parse(std::env::args())?;
    let runtime = Runtime::with_transport("lamp", args, &network)?;

    // The handler runs on the io thread and returns at once; see Node::service_later for slow replies.
    let is_on = Arc::new(AtomicBool::new(false));
    let lamp = runtime.node("lamp")?;
    let state = Arc::clone(&is_on);
    let server = lamp.service::<SetBool>("~/set_on", move |request| {
        let was_on = state.swap(request.data, Relaxed);
        SetBoolResponse {
            success: true,
            message: format!("was {}", if was_on { "on" } else { "off" }),
        }
    })?;
    println!("serving {}", server.name());

    // A client sends and receives CDR; its future runs on any executor.
    let client = runtime.node("hand")?.client::<SetBool>(server.name())?;
    for (data, expected) in [(true, "was off"), (false, "was on")] {
        let request = cdr::to_vec(&SetBoolRequest { data })?;
        let reply = smol::block_on(client.call(request, PATIENCE))?;
        let reply: SetBoolResponse = cdr::from_slice(&reply)?;
        println!("set to {data}: {}", reply.message);
        assert!(reply.success && reply.message == expected);
        assert_eq!(is_on.load(Relaxed), data);
    }

    runtime.shutdown_handle().request();
    runtime.spin()?;
    Ok(())
}
