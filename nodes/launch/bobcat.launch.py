"""Map with a Velodyne and a NovAtel SPAN: points to the ENU frame, voxels, markers."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

NODES = ["enu_transformer", "lattice_mapper", "voxel_marker_publisher"]


def generate_launch_description():
    share = FindPackageShare("lattice_nodes")
    arguments = [
        DeclareLaunchArgument(
            "params_file",
            default_value=PathJoinSubstitution([share, "params", "bobcat.yaml"]),
            description="YAML file with the parameters of the nodes",
        ),
        DeclareLaunchArgument("namespace", default_value="", description="namespace of the nodes"),
        DeclareLaunchArgument("log_level", default_value="info", description="debug to fatal"),
    ]
    nodes = [
        Node(
            package="lattice_nodes",
            executable=name,
            name=name,
            namespace=LaunchConfiguration("namespace"),
            parameters=[LaunchConfiguration("params_file")],
            ros_arguments=["--log-level", LaunchConfiguration("log_level")],
            output="screen",
        )
        for name in NODES
    ]
    return LaunchDescription(arguments + nodes)
