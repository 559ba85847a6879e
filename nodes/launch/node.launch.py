"""One node by its name, with the arguments that mapping and calibration have in common."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

# Seconds before a node that has ended is started again.
RESPAWN_DELAY_S = 2.0


ARGUMENTS = {
    "node": (None, "node"),
    "params_file": (None, "YAML file with its parameters"),
    "namespace": ("", "namespace of the nodes"),
    "use_sim_time": ("false", "true: the time is that on /clock"),
    "rmw": (
        EnvironmentVariable("RMW_IMPLEMENTATION", default_value=""),
        "any DDS of ROS: rmw_cyclonedds_cpp, rmw_fastrtps_cpp",
    ),
    "respawn": ("false", "true: a node that ends is started again"),
    "log_level": ("info", "debug to fatal"),
}


def generate_launch_description():
    sim_time = ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
    return LaunchDescription([
        *(
            DeclareLaunchArgument(name, default_value=default, description=description)
            for name, (default, description) in ARGUMENTS.items()
        ),
        SetEnvironmentVariable("RMW_IMPLEMENTATION", LaunchConfiguration("rmw")),
        Node(
            package="lattice_nodes",
            executable=LaunchConfiguration("node"),
            name=LaunchConfiguration("node"),
            namespace=LaunchConfiguration("namespace"),
            parameters=[LaunchConfiguration("params_file"), {"use_sim_time": sim_time}],
            ros_arguments=["--log-level", LaunchConfiguration("log_level")],
            respawn=LaunchConfiguration("respawn"),
            respawn_delay=RESPAWN_DELAY_S,
            output="screen",
        ),
    ])
