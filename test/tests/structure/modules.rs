//! Modules of a crate depend on each other one way, and those of the core have a user.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use super::root;
use super::source::{code, files, module};

/// Modules of crates and of folders in layers: each may use those before it in the list.
const LAYERS: [(&str, &str); 26] = [
    (
        "lattice_core/src",
        "prefetch lattice kd_tree cloud geodesy pose voxels query raycast navigation registration odometry loop_closure",
    ),
    (
        "nodes/src",
        "hurry octree files convert mesh stamps start report compute options cloud_input map_follower map_input map_output camera segmenter semantic_cloud headset_cloud enu_transformer lidar_odometry lattice_mapper map_merger map_projector \
         voxel_marker_publisher semantic_icp_server viewer_server replay running executables bag_player bag_recorder",
    ),
    (
        "nodes/src/bag_player",
        "commands parameters player_report playhead steps lockstep playback controls keyboard waiting",
    ),
    (
        "nodes/src/bag_recorder",
        "cache choice definitions offered session controls writing",
    ),
    (
        "nodes/src/camera",
        "camera_error distortion image palette labels pinhole point_layout soft pixels points",
    ),
    (
        "nodes/src/cloud_input",
        "error records channels livox scan cloud_type subscription",
    ),
    (
        "nodes/src/enu_transformer",
        "cloud_clocks cloud_notes cloud_times ins_options options parameters attitude inertial refusals counts body_pose reference samples speed_gate stamp_order ins_refusal fixes ins link_orders waiting \
         state transforms body_mounts imu_intake drops verdict sampling placing pose_intake pose_frames machine tf_intake node",
    ),
    (
        "nodes/src/files/points",
        "format error collect label scalar bin_layout source e57 kitti las octree detect text pcd ply",
    ),
    (
        "nodes/src/headset_cloud",
        "counts marker refusal session chunks surfaces view options parameters poses waiting machine meshes node",
    ),
    (
        "nodes/src/lattice_mapper",
        "counts free_options options free_space occupancy map_folder outputs refusal state datum machine map_messages octree operations corrected report \
         plan call octomap services initial_map autosave parameters unmapped compute_state status node",
    ),
    (
        "nodes/src/lidar_odometry",
        "counts motions options machine live_loops loops parameters path node",
    ),
    (
        "nodes/src/map_follower",
        "followed followed_map incomplete follower keyframe",
    ),
    (
        "nodes/src/map_merger",
        "options parameters robot_map machine node",
    ),
    (
        "nodes/src/map_projector",
        "changes messages options parameters plan plan_counts counts robot window machine diagnosis planner inputs outputs node",
    ),
    (
        "nodes/src/replay",
        "packets camera_input topics disorder slice survey images cameras topic_plan poses statics plan camera_report depth_clouds scan_poses report pipeline mount_samples",
    ),
    (
        "nodes/src/segmenter",
        "checks counts jpeg network colors compressed labels options machine names file sizes onnx_runtime tract backends parameters worker inside node",
    ),
    (
        "nodes/src/semantic_cloud",
        "compressed counts network project waiting options machine parameters node",
    ),
    (
        "nodes/src/semantic_icp_server",
        "counts headset_scans options parameters search output state jobs map intake results machine diagnosis outputs search_thread node",
    ),
    (
        "nodes/src/viewer_server",
        "protocol session broadcast bridge http host_addresses tls server options access parameters map_source fixed sources node hostile_tests pause_tests tls_tests",
    ),
    (
        "nodes/src/voxel_marker_publisher",
        "blocks color options packer parameters shape machine node",
    ),
    (
        "nodes/runtime/src",
        "sync activity shutdown task_thread config logging error transport graph communication node",
    ),
    (
        "nodes/runtime/src/config",
        "names param_value params_file ros_args params security env",
    ),
    (
        "nodes/runtime/src/transport",
        "confine loopback_domain qos remote port arrivals gaps outbox peers cyclone rmw_zenoh local_bus",
    ),
    (
        "nodes/runtime/src/graph",
        "discovered_graph output_types type_versions endpoints local_graph",
    ),
    (
        "nodes/runtime/src/communication",
        "lifecycle_gate service subscription publisher action",
    ),
    (
        "nodes/runtime/src/node",
        "clock diagnostics timer rosout shared expected logical_node node_services action_server param_services logger_services type_description lifecycle tf_guard tf process",
    ),
];

/// First words after the path of a folder from the root of its crate, also in braces, and after as many
/// `super::` as lead to that folder.
fn root_names(code: &str, folder: &str, depth: usize) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let prefixes = [format!("crate::{folder}"), "super::".repeat(depth)];
    for prefix in prefixes.iter().filter(|prefix| !prefix.is_empty()) {
        for (at, _) in code.match_indices(prefix.as_str()) {
            // `super::super::` is also found in a longer chain, `crate::` in `$crate::`.
            if code[..at].ends_with(['$', ':']) {
                continue;
            }
            let rest = &code[at + prefix.len()..];
            match rest.strip_prefix('{') {
                None => found.extend(first_word(rest)),
                Some(list) => found.extend(items(list).iter().filter_map(|item| first_word(item))),
            }
        }
    }
    found
}

fn first_word(text: &str) -> Option<String> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let word: String = text
        .trim_start()
        .chars()
        .take_while(|c| is_word(*c))
        .collect();
    (!word.is_empty()).then_some(word)
}

/// Items of a list in braces, of which `list` is what follows the opening one.
fn items(list: &str) -> Vec<String> {
    let (mut items, mut depth) = (vec![String::new()], 0);
    for c in list.chars() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => items.push(String::new()),
            _ if depth == 0 => items.last_mut().unwrap().push(c),
            _ => {}
        }
    }
    items
}

/// Names that the root of a crate or folder brings up from its modules, with the module of each.
fn reexports(source: &Path) -> Vec<(String, String)> {
    let library = source.join("lib.rs");
    let text = if library.exists() {
        code(&library)
    } else {
        code(&source.join("mod.rs"))
    };
    let mut found = Vec::new();
    for statement in text.split(';') {
        let Some((_, path)) = statement.split_once("pub use ") else {
            continue;
        };
        let Some((from, names)) = path.split_once("::") else {
            continue;
        };
        let names = names.trim_start_matches('{').trim_end_matches('}');
        let names = names
            .split([',', '{', '}'])
            .filter_map(|name| first_word(name.rsplit("::").next()?));
        found.extend(names.map(|name| (name, from.trim().to_owned())));
    }
    found
}

#[test]
fn modules_point_one_way() {
    for (source, layers) in LAYERS {
        let (_, folder) = source.split_once("/src").unwrap();
        let folder = folder.split('/').skip(1).map(|name| format!("{name}::"));
        let folder: String = folder.collect();
        let source = root().join(source);
        let layers: Vec<&str> = layers.split_whitespace().collect();
        let place = |name: &str| layers.iter().position(|layer| *layer == name);
        let brought_up = reexports(&source);
        let mut seen = BTreeSet::new();
        for file in files(&source) {
            let Some(path) = module(&source, &file) else {
                continue;
            };
            let Some(here) = path.first() else {
                continue;
            };
            let from = place(here).unwrap_or_else(|| {
                panic!("{here} is missing in the layers of {}", source.display())
            });
            seen.insert(here.clone());
            for name in root_names(&code(&file), &folder, path.len()) {
                let module = brought_up.iter().find(|(item, _)| *item == name);
                let to = module.map_or(name.as_str(), |(_, module)| module);
                if let Some(to_place) = place(to) {
                    assert!(
                        to_place <= from,
                        "{}: {here} uses {to}, which comes after it",
                        file.display()
                    );
                }
            }
        }
        let layers: BTreeSet<String> = layers.into_iter().map(str::to_owned).collect();
        assert_eq!(seen, layers, "{}", source.display());
    }
}

/// Public modules below a file, as paths after the crate's name.
fn public_modules(source: &Path) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for file in files(source) {
        let Some(path) = module(source, &file) else {
            continue;
        };
        for line in code(&file).lines() {
            if let Some(name) = line.strip_prefix("pub mod ").and_then(first_word) {
                found.push([path.clone(), vec![name]].concat());
            }
        }
    }
    found
}

#[test]
fn every_public_module_of_the_core_has_a_user() {
    let mut users = String::new();
    for directory in ["nodes/src", "nodes/cli/src"] {
        let directory = root().join(directory);
        for file in files(&directory) {
            if module(&directory, &file)
                .is_some_and(|path| path.first().is_none_or(|name| name != "lab"))
            {
                users += &code(&file);
            }
        }
    }
    let core = root().join("lattice_core/src");
    for path in public_modules(&core) {
        // A nested module may serve a node by way of another module of the core.
        let elsewhere = files(&core).into_iter().filter(|file| {
            path.len() > 1
                && module(&core, file).is_some_and(|other| !other.starts_with(path.as_slice()))
        });
        let inside: String = elsewhere.map(|file| code(&file)).collect();
        // Of nested modules the last two names say enough.
        let tail = path[path.len().saturating_sub(2)..].join("::");
        let named = if path.len() == 1 {
            format!("lattice_core::{tail}")
        } else {
            tail
        };
        assert!(
            users.contains(&named) || inside.contains(&named),
            "no node and no command uses lattice_core::{}",
            path.join("::")
        );
    }
}

/// Places that write files by other means than `AtomicFile`: itself, and those whose files are read as far as
/// they go, the writers of bags and of the log; builds write where cargo says.
const WRITERS: [&str; 4] = [
    "nodes/src/files/atomic_write.rs",
    "nodes/bag/src/writer/",
    "nodes/runtime/cyclone_sys/build.rs",
    "nodes/runtime/src/logging/file.rs",
];

#[test]
fn files_are_written_by_the_one_writer() {
    for directory in ["lattice_core/src", "nodes"] {
        for file in files(&root().join(directory)) {
            let name = file.strip_prefix(root()).unwrap().display().to_string();
            let is_test =
                name.contains("/tests") || WRITERS.iter().any(|place| name.starts_with(place));
            let code = code(&file).replace("AtomicFile::create", "");
            for writes in ["File::create", "fs::write("] {
                assert!(
                    is_test || !code.contains(writes),
                    "{name}: {writes} is not AtomicFile"
                );
            }
        }
    }
}

#[test]
fn files_are_small() {
    let mut lines = Vec::new();
    for directory in ["lattice_core", "msgs", "nodes", "test"] {
        for file in files(&root().join(directory)) {
            let count = fs::read_to_string(&file).unwrap().lines().count();
            assert!(
                count <= 400,
                "{}: {count} lines: are there two things in one?",
                file.display()
            );
            lines.push(count);
        }
    }
    lines.sort_unstable();
    let median = lines[lines.len() / 2];
    assert!(
        median <= 150,
        "half of the files have more than {median} lines"
    );
}
