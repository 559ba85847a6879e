"""Clouds of a lidar without poses to a map: lidar_odometry, enu_transformer, lattice_mapper, voxel_marker_publisher.

The other arguments are those of node.launch.py.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

NODES = ["lidar_odometry", "enu_transformer", "lattice_mapper", "voxel_marker_publisher"]


def include(name):
    path = PathJoinSubstitution([FindPackageShare("lattice_nodes"), "launch", "node.launch.py"])
    given = [("node", name), ("params_file", LaunchConfiguration("params_file"))]
    return IncludeLaunchDescription(PythonLaunchDescriptionSource(path), launch_arguments=given)


def generate_launch_description():
    params_file = DeclareLaunchArgument(
        "params_file",
        default_value=PathJoinSubstitution([FindPackageShare("lattice_nodes"), "params", "lidar_odometry.yaml"]),
        description="YAML file with the parameters of the nodes",
    )
    return LaunchDescription([params_file, *map(include, NODES)])
