//! Services of the node: requests become events; files are read and written on separate threads.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{self, JoinHandle};

use lattice_core::voxels::Region;
use lattice_core::voxels::file::MapContents;
use lattice_msgs::RosService;
use lattice_msgs::lattice::{
    ClearBox, ClearBoxResponse, LoadMap, LoadMapRequest, LoadMapResponse, PlanPath, QueryMap,
    QueryMapResponse, SaveMap, SaveMapRequest, SaveMapResponse,
};

use lattice_msgs::octomap_msgs::BoundingBoxQueryResponse;

use super::call::Call;
use super::map_folder::MapFolder;
use super::octomap;
use super::operations::region_of;
use super::plan::{self, Planner};
use super::state::LatticeMapper;
use crate::compute::Inbox;
use crate::start::NodeError;
use lattice_runtime::{Node, Reply, Server};

const BUSY: &str = "the inbox of the node is full: call again";

/// Serves all calls; `wrap` converts one to an event.
pub(super) fn serve<E: Send + 'static>(
    node: &Node,
    inbox: &Inbox<E>,
    wrap: fn(Call) -> E,
    maps: MapFolder,
    max_voxels: Arc<AtomicUsize>,
) -> Result<[Server; 5], NodeError> {
    let to = inbox.clone();
    let load = node.service_later::<LoadMap>("~/load_map", move |request, reply| {
        let (to, late, maps) = (to.clone(), reply.clone(), maps.clone());
        let max_voxels = max_voxels.load(Ordering::Relaxed);
        let read = move || {
            load(&maps, &request, max_voxels, reply, |call| {
                to.send(wrap(call), 0)
            });
        };
        if let Err(error) = spawn("load map", read) {
            late.send(load_failed(error));
        }
    })?;
    let save = move |request, reply| wrap(Call::Save(request, reply));
    let clear_box = move |request, reply| wrap(Call::ClearBox(request, reply));
    let query = move |request, reply| wrap(Call::Query(request, reply));
    let (to, planner) = (inbox.clone(), Arc::new(Planner::default()));
    let plan = node.service_later::<PlanPath>("~/plan_path", move |request, reply| {
        let late = reply.clone();
        if !planner.take() {
            late.send(plan::failed(format!("another search is running: {BUSY}")));
        } else if !to.send(wrap(Call::Plan(request, reply, Arc::clone(&planner))), 0) {
            planner.free();
            late.send(plan::failed(BUSY));
        }
    })?;
    Ok([
        ask::<SaveMap, E>(node, "~/save_map", inbox, save, save_failed)?,
        load,
        ask::<ClearBox, E>(node, "~/clear_box", inbox, clear_box, |message| {
            ClearBoxResponse {
                message,
                ..Default::default()
            }
        })?,
        ask::<QueryMap, E>(node, "~/query", inbox, query, |message| QueryMapResponse {
            message,
            ..Default::default()
        })?,
        plan,
    ])
}

/// Serves requests as events; `failed` is the reply if the inbox is full.
fn ask<S: RosService + 'static, E: Send + 'static>(
    node: &Node,
    name: &str,
    inbox: &Inbox<E>,
    event: impl Fn(S::Request, Reply<S::Response>) -> E + Send + 'static,
    failed: fn(String) -> S::Response,
) -> Result<Server, NodeError> {
    let to = inbox.clone();
    let server = node.service_later::<S>(name, move |request, reply| {
        let busy = reply.clone();
        if !to.send(event(request, reply), 0) {
            busy.send(failed(BUSY.to_owned()));
        }
    });
    Ok(server?)
}

/// Outcome of a call.
#[derive(Default)]
pub(super) struct Done {
    /// Thread that writes a file.
    pub(super) writing: Option<JoinHandle<()>>,
    /// True if the map was replaced.
    pub(super) replaced: bool,
    /// The region that was cleared.
    pub(super) cleared: Option<Region>,
}

/// Executes a call on the compute thread.
pub(super) fn answer(
    machine: &mut LatticeMapper,
    call: Call,
    epoch: u64,
    maps: &MapFolder,
) -> Done {
    let mut done = Done::default();
    match call {
        Call::Save(request, reply) => {
            let (contents, late, maps) = (machine.contents(), reply.clone(), maps.clone());
            match spawn("save map", move || {
                reply.send(save(&maps, &request, &contents))
            }) {
                Ok(thread) => done.writing = Some(thread),
                Err(error) => late.send(save_failed(error.to_string())),
            }
        }
        Call::Load(contents, reply) => match machine.load(*contents, epoch) {
            Ok(voxels) => {
                done.replaced = true;
                reply.send(LoadMapResponse {
                    success: true,
                    message: format!("{voxels} voxels loaded"),
                    voxels: voxels as u64,
                });
            }
            Err(refusal) => reply.send(load_failed(refusal)),
        },
        Call::ClearBox(request, reply) => {
            reply.send(machine.clear_box(&request));
            done.cleared = region_of(&request).ok();
        }
        Call::ClearBoundingBox(request, reply) => {
            let cleared = machine.clear_box(&request);
            if !cleared.success {
                log::warn!("box not cleared: {}", cleared.message);
            }
            done.cleared = region_of(&request).ok();
            reply.send(BoundingBoxQueryResponse::default());
        }
        Call::Octomap(form, reply) => reply.send(octomap::response(machine, form)),
        Call::Query(request, reply) => reply.send(machine.query(&request)),
        Call::Plan(request, reply, planner) => planner.begin(machine, request, reply),
    }
    done
}

fn spawn(name: &str, work: impl FnOnce() + Send + 'static) -> std::io::Result<JoinHandle<()>> {
    thread::Builder::new().name(name.to_owned()).spawn(work)
}

fn save_failed(message: String) -> SaveMapResponse {
    SaveMapResponse {
        message,
        ..SaveMapResponse::default()
    }
}

fn load_failed(why: impl ToString) -> LoadMapResponse {
    LoadMapResponse {
        message: why.to_string(),
        ..LoadMapResponse::default()
    }
}

fn load(
    maps: &MapFolder,
    request: &LoadMapRequest,
    max_voxels: usize,
    reply: Reply<LoadMapResponse>,
    send: impl FnOnce(Call) -> bool,
) {
    match maps.read(&request.path, max_voxels) {
        Ok(contents) => {
            let busy = reply.clone();
            if !send(Call::Load(Box::new(contents), reply)) {
                busy.send(load_failed(BUSY));
            }
        }
        Err(refusal) => reply.send(load_failed(refusal)),
    }
}

fn save(maps: &MapFolder, request: &SaveMapRequest, contents: &MapContents) -> SaveMapResponse {
    match maps.write(&request.path, contents) {
        Ok(()) => SaveMapResponse {
            success: true,
            message: format!("saved to {:?}", request.path),
            voxels: contents.keys().len() as u64,
        },
        Err(refusal) => save_failed(refusal.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use lattice_core::lattice::{Lattice, LatticeKind};
    use lattice_core::voxels::VoxelList;
    use nalgebra::Vector3;

    use super::*;
    use crate::lattice_mapper::MapperOptions;

    fn machine() -> LatticeMapper {
        let lattice = Lattice::new(LatticeKind::Bcc, 0.125).unwrap();
        LatticeMapper::new(MapperOptions::new(lattice), 1).unwrap()
    }

    fn with_points() -> LatticeMapper {
        let mut machine = machine();
        let cloud = lattice_core::cloud::Cloud {
            stamp_ns: 5,
            datum_m: Vector3::zeros(),
            offsets_m: (0..100).map(|x| [x as f32, 0.0, 0.0]).collect(),
        };
        let lattice = machine.list().lattice().clone();
        let mut list = VoxelList::new(lattice, Vector3::zeros(), 1000).unwrap();
        list.insert(&cloud);
        assert_eq!(machine.load(MapContents::from_list(&list), 2).unwrap(), 100);
        machine
    }

    fn maps(folder: &Path) -> MapFolder {
        MapFolder::new(&folder.display().to_string()).unwrap()
    }

    fn save_to(machine: &mut LatticeMapper, maps: &MapFolder, path: &str) -> SaveMapResponse {
        let (reply, answered) = Reply::channel();
        let path = path.to_owned();
        let done = answer(machine, Call::Save(SaveMapRequest { path }, reply), 9, maps);
        done.writing.unwrap().join().unwrap();
        answered.try_recv().unwrap()
    }

    fn load_from(machine: &mut LatticeMapper, maps: &MapFolder, path: &str) -> LoadMapResponse {
        let (reply, answered) = Reply::channel();
        let path = path.to_owned();
        load(maps, &LoadMapRequest { path }, 1000, reply, |call| {
            answer(machine, call, 9, maps);
            true
        });
        answered.try_recv().unwrap()
    }

    #[test]
    fn a_saved_map_is_loaded_by_another_node() {
        let dir = tempfile::tempdir().unwrap();
        let (maps, path) = (maps(dir.path()), "site.lattice");
        let mut first = with_points();
        for _ in 0..2 {
            let saved = save_to(&mut first, &maps, path);
            assert!(saved.success && saved.voxels == 100, "{}", saved.message);
        }
        let files = fs::read_dir(dir.path()).unwrap().count();
        assert_eq!(files, 1, "nothing but the map is left");
        let mut second = machine();
        let loaded = load_from(&mut second, &maps, path);
        assert!(loaded.success && loaded.voxels == 100, "{}", loaded.message);
        assert_eq!(second.list().sorted(), first.list().sorted());
    }

    #[test]
    fn what_is_no_map_is_refused_with_the_reason() {
        let dir = tempfile::tempdir().unwrap();
        let (maps, name) = (maps(dir.path()), "site.lattice");
        let path = dir.path().join(name);
        let mut machine = with_points();
        save_to(&mut machine, &maps, name);
        let good = fs::read(&path).unwrap();
        let mut flipped = good.clone();
        flipped[good.len() / 2] ^= 4;
        let cut = &good[..good.len() - 3];
        for hostile in [&b"not a map at all"[..], b"", cut, &flipped] {
            fs::write(&path, hostile).unwrap();
            let refused = load_from(&mut machine, &maps, name);
            let message = &refused.message;
            assert!(
                !refused.success && message.contains("site.lattice"),
                "{message}"
            );
        }
        for nowhere in ["absent", "", "/etc/passwd", "../site.lattice"] {
            assert!(!load_from(&mut machine, &maps, nowhere).success);
        }
        for nowhere in ["absent/map", "", "/tmp/map", "../map"] {
            let refused = save_to(&mut machine, &maps, nowhere);
            assert!(!refused.success && !refused.message.is_empty());
        }
        assert_eq!(machine.list().len(), 100);
    }

    #[test]
    fn a_full_inbox_or_an_ended_node_is_told() {
        let dir = tempfile::tempdir().unwrap();
        let (maps, path) = (maps(dir.path()), "site.lattice".to_owned());
        let mut machine = with_points();
        save_to(&mut machine, &maps, &path);
        let (reply, answered) = Reply::channel();
        load(&maps, &LoadMapRequest { path }, 1000, reply, |_| false);
        assert_eq!(answered.try_recv().unwrap().message, BUSY);
    }
}
