//! Viewer of a constant map, without ROS.

use std::io;
use std::sync::Arc;

use lattice_core::voxels::VoxelList;
use lattice_core::voxels::label_names::LabelNames;
use lattice_msgs::cdr;
use lattice_msgs::std_msgs::Header;
use lattice_msgs::vision_msgs::{LabelInfo, VisionClass};

use super::access::Access;
use super::broadcast::{Broadcaster, Class, entry, thin};
use super::options::ViewerOptions;
use super::server::Server;
use crate::convert::map::{History, MapStamp, keyframe};
use crate::hurry::Hurry;

/// Largest map message, bytes.
const CHUNK_BYTES: usize = 60_000;

/// Serves a map; returns the server and its URLs.
pub fn serve(list: &VoxelList, options: &ViewerOptions) -> io::Result<(Server, Access)> {
    serve_labelled(list, &LabelNames::new(), options)
}

/// Serves a map with the names of its labels.
pub fn serve_labelled(
    list: &VoxelList,
    names: &LabelNames,
    options: &ViewerOptions,
) -> io::Result<(Server, Access)> {
    let broadcaster = Arc::new(Broadcaster::of_file(options.max_clients));
    broadcaster.map_channels("/voxel_map", "/voxel_map_updates");
    if !names.is_empty() {
        let channel =
            broadcaster.channel::<LabelInfo>("/label_info", Class::Newest { depth: 1 }, true);
        let info = cdr::to_vec(&label_info(names)).map_err(io::Error::other)?;
        broadcaster.offer(channel, info);
    }
    let stamp = MapStamp {
        hurry: Hurry::default(),
        header: Header {
            frame_id: "map".to_owned(),
            ..Header::default()
        },
        epoch: entry(Vec::new()).stamp_ns,
        sequence: 1,
        history: History::default(),
        origin: None,
        chunk_bytes: CHUNK_BYTES,
    };
    let chunks = keyframe(list, &stamp).into_iter().map(thin::both);
    let chunks: Vec<_> = chunks.collect::<Result<_, _>>().map_err(io::Error::other)?;
    broadcaster.change_map(|stream| stream.set_keyframe(chunks));
    let auth = options.request_auth()?;
    let identity = options.identity().map_err(io::Error::other)?;
    let tls = identity.as_ref().map(|identity| identity.config.clone());
    let server = Server::start(options.address, auth.clone(), tls, broadcaster)?;
    let access = Access::new(server.address(), &auth, identity.as_ref());
    Ok((server, access))
}

fn label_info(names: &LabelNames) -> LabelInfo {
    let class = |(&class_id, name): (&u16, &String)| VisionClass {
        class_id,
        class_name: name.clone(),
    };
    LabelInfo {
        class_map: names.iter().map(class).collect(),
        ..LabelInfo::default()
    }
}
