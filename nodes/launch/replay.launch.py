"""A rosbag2 log played into mapping.launch.py, whose arguments these are too; all ends with the log."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, Shutdown
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    mapping = PathJoinSubstitution(
        [FindPackageShare("lattice_nodes"), "launch", "mapping.launch.py"]
    )
    player = Node(
        package="lattice_nodes",
        executable="bag_player",
        name="bag_player",
        parameters=[
            LaunchConfiguration("params_file"),
            {
                "bag": ParameterValue(LaunchConfiguration("bag"), value_type=str),
                "rate": ParameterValue(LaunchConfiguration("rate"), value_type=float),
                "clock_hz": 100.0,
                "keyboard": False,
            },
        ],
        output="screen",
        on_exit=Shutdown(),
    )
    return LaunchDescription([
        DeclareLaunchArgument("bag", description="rosbag2 directory"),
        DeclareLaunchArgument("rate", default_value="1.0", description="log seconds per second"),
        IncludeLaunchDescription(PythonLaunchDescriptionSource(mapping)),
        player,
    ])
