//! Treatment of each command of the pages in the test.

/// Treatment of a command.
#[derive(Clone, Copy, Debug)]
pub enum Rule {
    /// Run with these arguments more, that it does less work; it must succeed.
    Runs(&'static str),
    /// Started with these arguments more, waited for until a line has this text, and ended by a signal.
    Serves(&'static str, &'static str),
    /// Started, waited for until this node publishes on `/diagnostics`, and ended by a signal.
    Works(&'static str),
    /// The whole block that begins with this command is one script, which must succeed.
    Script,
    /// Not run, for a reason. A command of `lattice` must exist with its options all the same.
    NotHere(&'static str),
}

use Rule::{NotHere, Runs, Script, Serves, Works};

/// Beginnings of commands of a page, or of all (`*`), with what becomes of them; the longest holds.
pub const RULES: &[(&str, &str, Rule)] = &[
    // What is elsewhere, or takes long.
    (
        "*",
        "cargo",
        NotHere("the tests run in a build; .ci has the others"),
    ),
    (
        "*",
        "pip install",
        NotHere("needs PyPI; .ci/python builds the package"),
    ),
    (
        "*",
        ".ci/wheels",
        NotHere("needs PyPI; .ci/python builds the wheel"),
    ),
    (
        "*",
        "colcon",
        NotHere("needs colcon; .ci/run lists the packages"),
    ),
    ("*", "ros2", NotHere("needs ROS 2")),
    (
        "*",
        "RMW_IMPLEMENTATION=rmw_zenoh_cpp",
        NotHere("a feature of the build; .ci/zenoh"),
    ),
    ("*", "test/peers/", NotHere("needs the peers")),
    (
        "*",
        "lattice fleet",
        NotHere("lattice-fleet is built apart: .ci/fleet"),
    ),
    (
        "*",
        "lattice doctor",
        NotHere("finds what is wrong with the machine; doctor.rs"),
    ),
    (
        "*",
        "lattice evaluate",
        NotHere("takes minutes to hours; evaluate.rs"),
    ),
    ("*", "lattice paper", NotHere("takes minutes; paper.rs")),
    (
        "*",
        "lattice demo",
        NotHere("viewer.rs and indoor.rs run the demos"),
    ),
    // Pages of users.
    ("README.md", "lattice bag info LOG", Runs("")),
    ("README.md", "lattice replay LOG --direct", Runs("")),
    (
        "README.md",
        "lattice view map.lattice",
        Serves("--port 0", "the map is at"),
    ),
    (
        "README.md",
        "lattice view robot.yaml",
        Serves("--port 0", "the map is at"),
    ),
    (
        "README.md",
        "lattice run robot.yaml",
        Works("lattice_mapper"),
    ),
    (
        "README.md",
        "lattice health",
        NotHere("needs clouds at that time; health.rs"),
    ),
    (
        "docs/calibration.md",
        "lattice calibrate",
        NotHere("calibrate.rs"),
    ),
    ("docs/dev/calibration.md", "lattice simulate town", Runs("")),
    ("docs/commands.md", "lattice", Runs("")),
    (
        "docs/free_space.md",
        "lattice simulate bobcat",
        Runs("--duration 2"),
    ),
    ("docs/free_space.md", "lattice replay yard", Runs("")),
    ("docs/free_space.md", "lattice map diff", Runs("")),
    (
        "docs/front_ends.md",
        "lattice run params/rgbd.yaml",
        Works("lattice_mapper"),
    ),
    (
        "docs/front_ends.md",
        "lattice replay LOG",
        NotHere("needs the log of a depth camera; depth_logs"),
    ),
    ("docs/front_ends.md", "lattice bag info LOG", Script),
    (
        "docs/front_ends.md",
        "lattice run params/segmenter.yaml",
        NotHere("needs --features onnx"),
    ),
    (
        "docs/front_ends.md",
        "lattice run params/rgbd.yaml -- --ros-args -p semantic_cloud:model",
        NotHere("needs --features onnx"),
    ),
    (
        "docs/front_ends.md",
        "export ORT_DYLIB_PATH",
        NotHere("needs onnxruntime of PyPI"),
    ),
    (
        "docs/front_ends.md",
        "lattice bench camera",
        NotHere("measures for a minute"),
    ),
    (
        "docs/install.md",
        "",
        NotHere("needs PyPI or systemd; .ci/install installs the packages"),
    ),
    ("docs/headset.md", "lattice run", Works("lattice_mapper")),
    (
        "docs/mixed_reality.md",
        "lattice view",
        Serves("--port 0", "the map is at"),
    ),
    (
        "docs/nodes.md",
        "lattice node lattice_mapper",
        Works("lattice_mapper"),
    ),
    ("docs/nodes.md", "lattice run", Serves("", "the map is at")),
    (
        "docs/nodes.md",
        "lattice link",
        NotHere("writes outside of the folder; link.rs"),
    ),
    (
        "docs/octomap.md",
        "lattice node lattice_mapper",
        Works("octomap_server"),
    ),
    (
        "docs/parameters.md",
        "lattice node lattice_mapper --help",
        Runs(""),
    ),
    (
        "docs/parameters.md",
        "lattice node lattice_mapper --ros-args",
        Works("lattice_mapper"),
    ),
    ("docs/parameters.md", "lattice run", Works("lattice_mapper")),
    (
        "docs/files.md",
        "lattice view scan.ply",
        Serves("--port 0", "the map is at"),
    ),
    ("docs/files.md", "lattice quantize scan.ply", Runs("")),
    ("docs/files.md", "lattice map", Runs("")),
    (
        "docs/files.md",
        "lattice calibrate",
        NotHere("calibrate.rs"),
    ),
    (
        "docs/navigation.md",
        "lattice node map_projector",
        Works("map_projector"),
    ),
    ("docs/navigation.md", "lattice map export", Runs("")),
    ("docs/queries.md", "lattice map query", Runs("")),
    ("docs/octomap.md", "lattice map export", Runs("")),
    ("docs/octomap.md", "lattice quantize map.bt", Runs("")),
    ("docs/odometry.md", "lattice replay LOG", Runs("--direct")),
    ("docs/odometry.md", "lattice run", Works("lidar_odometry")),
    (
        "docs/odometry.md",
        "lattice simulate drive",
        Runs("--duration 3"),
    ),
    ("docs/odometry.md", "lattice evaluate odometry", Runs("")),
    ("docs/odd_logs.md", "lattice replay LOG --direct", Runs("")),
    (
        "docs/sensors.md",
        "lattice simulate bobcat",
        Runs("--duration 2"),
    ),
    ("docs/sensors.md", "lattice replay scanned", Runs("")),
    ("docs/poses.md", "lattice bag info LOG", Runs("")),
    ("docs/poses.md", "lattice replay LOG --direct", Runs("")),
    (
        "docs/poses.md",
        "lattice calibrate mounts",
        NotHere("mounts.rs"),
    ),
    (
        "docs/recording.md",
        "lattice record -a",
        Serves("", "recording /tf"),
    ),
    (
        "docs/recording.md",
        "lattice record /points",
        Serves("", "recording /tf"),
    ),
    (
        "docs/recording.md",
        "lattice record -e",
        Serves("-o matched", "recording to"),
    ),
    ("docs/recording.md", "lattice record -a -o killed &", Script),
    (
        "docs/security.md",
        "export",
        NotHere("needs --features security; .ci/dds"),
    ),
    (
        "docs/security.md",
        "lattice node",
        NotHere("needs --features security; .ci/dds"),
    ),
    ("docs/security.md", "xml=", Script),
    ("docs/tables.md", "lattice run", Serves("", "the map is at")),
    (
        "docs/viewer.md",
        "lattice view map.lattice",
        Serves("--port 0", "the map is at"),
    ),
    (
        "docs/viewer.md",
        "lattice view LOG",
        Serves("--port 0", "the map is at"),
    ),
    (
        "docs/viewer.md",
        "lattice view",
        Serves("--port 0", "the map is at"),
    ),
    ("docs/viewer.md", "lattice run", Serves("", "the map is at")),
];

/// The rule of a command of a page, by its place in the table.
pub fn rule_of(page: &str, command: &str) -> Option<usize> {
    let rules = RULES.iter().enumerate();
    let holds = |of: &str, begin: &str| (of == page || of == "*") && command.starts_with(begin);
    let holding = rules.filter(|(_, (of, begin, _))| holds(of, begin));
    holding
        .max_by_key(|(_, (_, begin, _))| begin.len())
        .map(|(i, _)| i)
}
