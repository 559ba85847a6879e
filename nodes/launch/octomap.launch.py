"""The nodes under the names that a user of octomap_server knows; docs/octomap.md tells what is not there."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

ARGUMENTS = {
    "resolution": ("0.05", "side of a cell, m"),
    "frame_id": ("map", "frame of the map"),
    "base_frame_id": ("base_footprint", "frame of the machine, child of the odometry"),
    "max_range": ("0.0", "sensor_model.max_range, m; 0: no limit"),
    "odometry": ("odom", "topic of the poses in the frame of the map (nav_msgs/Odometry)"),
    "namespace": ("", "namespace of the nodes"),
}


def value(of, kind):
    return ParameterValue(of, value_type=kind)


def node(executable, name, remappings, **parameters):
    share = FindPackageShare("lattice_nodes")
    return Node(
        package="lattice_nodes",
        executable=executable,
        name=name,
        namespace=LaunchConfiguration("namespace"),
        parameters=[PathJoinSubstitution([share, "params", "octomap_compat.yaml"]), parameters],
        remappings=remappings,
        output="screen",
    )


def generate_launch_description():
    frame = value(LaunchConfiguration("frame_id"), str)
    return LaunchDescription([
        *(
            DeclareLaunchArgument(name, default_value=default, description=description)
            for name, (default, description) in ARGUMENTS.items()
        ),
        node(
            "enu_transformer",
            "enu_transformer",
            [],
            **{
                "ins.topic": value(LaunchConfiguration("odometry"), str),
                "map_frame": frame,
                "base_frame": value(LaunchConfiguration("base_frame_id"), str),
                "max_range_m": value(LaunchConfiguration("max_range"), float),
            },
        ),
        node(
            "lattice_mapper",
            "octomap_server",
            [("map_centers", "octomap_point_cloud_centers")],
            map_frame=frame,
            cell_size_m=value(LaunchConfiguration("resolution"), float),
        ),
        node(
            "voxel_marker_publisher",
            "voxel_marker_publisher",
            [("voxel_markers", "occupied_cells_vis_array")],
        ),
    ])
