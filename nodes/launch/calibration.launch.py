"""A headset in the map of a robot that keeps labels: lattice_mapper, semantic_icp_server."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable
from launch.substitutions import (
    EnvironmentVariable,
    LaunchConfiguration,
    PathJoinSubstitution,
)
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

NODES = ["lattice_mapper", "semantic_icp_server"]
PARAMS_FILE = "semantic_icp.yaml"
# Seconds before a node that has ended is started again.
RESPAWN_DELAY_S = 2.0


def arguments():
    share = FindPackageShare("lattice_nodes")
    defaults = {
        "params_file": (
            PathJoinSubstitution([share, "params", PARAMS_FILE]),
            "YAML file with the parameters of the nodes",
        ),
        "namespace": ("", "namespace of the nodes"),
        "use_sim_time": ("false", "true: the time is that on /clock"),
        "rmw": (
            EnvironmentVariable("RMW_IMPLEMENTATION", default_value=""),
            "rmw_cyclonedds_cpp where built in, or rustdds",
        ),
        "respawn": ("false", "true: a node that ends is started again"),
        "log_level": ("info", "debug to fatal"),
    }
    return [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in defaults.items()
    ]


def node(name):
    sim_time = ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
    return Node(
        package="lattice_nodes",
        executable=name,
        name=name,
        namespace=LaunchConfiguration("namespace"),
        parameters=[LaunchConfiguration("params_file"), {"use_sim_time": sim_time}],
        ros_arguments=["--log-level", LaunchConfiguration("log_level")],
        respawn=LaunchConfiguration("respawn"),
        respawn_delay=RESPAWN_DELAY_S,
        output="screen",
    )


def generate_launch_description():
    rmw = SetEnvironmentVariable("RMW_IMPLEMENTATION", LaunchConfiguration("rmw"))
    return LaunchDescription([*arguments(), rmw, *map(node, NODES)])
