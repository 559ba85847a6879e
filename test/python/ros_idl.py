"""The ROS messages that the peers over DDS speak, as IDL types of the cyclonedds package."""

from cyclonedds.idl import annotations, make_idl_struct
from cyclonedds.idl.types import array, float32, float64, int8, int16, int32, int64
from cyclonedds.idl.types import sequence, uint8, uint16, uint32, uint64


def ros(name, /, **fields):
    """A final struct under the name that ROS gives the type on DDS."""
    package, kind, last = name.split("/")
    made = make_idl_struct(last, f"{package}::{kind}::dds_::{last}_", fields)
    return annotations.final(made)


Time = ros("builtin_interfaces/msg/Time", sec=int32, nanosec=uint32)
Duration = ros("builtin_interfaces/msg/Duration", sec=int32, nanosec=uint32)
Header = ros("std_msgs/msg/Header", stamp=Time, frame_id=str)
ColorRGBA = ros("std_msgs/msg/ColorRGBA", r=float32, g=float32, b=float32, a=float32)

XYZ = {"x": float64, "y": float64, "z": float64}
Point = ros("geometry_msgs/msg/Point", **XYZ)
Vector3 = ros("geometry_msgs/msg/Vector3", **XYZ)
Quaternion = ros("geometry_msgs/msg/Quaternion", **XYZ, w=float64)
Pose = ros("geometry_msgs/msg/Pose", position=Point, orientation=Quaternion)
Twist = ros("geometry_msgs/msg/Twist", linear=Vector3, angular=Vector3)
PoseWithCovariance = ros(
    "geometry_msgs/msg/PoseWithCovariance", pose=Pose, covariance=array[float64, 36]
)
TwistWithCovariance = ros(
    "geometry_msgs/msg/TwistWithCovariance", twist=Twist, covariance=array[float64, 36]
)
Odometry = ros(
    "nav_msgs/msg/Odometry",
    header=Header,
    child_frame_id=str,
    pose=PoseWithCovariance,
    twist=TwistWithCovariance,
)
MapMetaData = ros(
    "nav_msgs/msg/MapMetaData",
    map_load_time=Time,
    resolution=float32,
    width=uint32,
    height=uint32,
    origin=Pose,
)
OccupancyGrid = ros(
    "nav_msgs/msg/OccupancyGrid", header=Header, info=MapMetaData, data=sequence[int8]
)
OccupancyGridUpdate = ros(
    "map_msgs/msg/OccupancyGridUpdate",
    header=Header,
    x=int32,
    y=int32,
    width=uint32,
    height=uint32,
    data=sequence[int8],
)
MultiArrayDimension = ros(
    "std_msgs/msg/MultiArrayDimension", label=str, size=uint32, stride=uint32
)
MultiArrayLayout = ros(
    "std_msgs/msg/MultiArrayLayout", dim=sequence[MultiArrayDimension], data_offset=uint32
)
Float32MultiArray = ros(
    "std_msgs/msg/Float32MultiArray", layout=MultiArrayLayout, data=sequence[float32]
)
GridMapInfo = ros(
    "grid_map_msgs/msg/GridMapInfo",
    resolution=float64,
    length_x=float64,
    length_y=float64,
    pose=Pose,
)
GridMap = ros(
    "grid_map_msgs/msg/GridMap",
    header=Header,
    info=GridMapInfo,
    layers=sequence[str],
    basic_layers=sequence[str],
    data=sequence[Float32MultiArray],
    outer_start_index=uint16,
    inner_start_index=uint16,
)
Octomap = ros(
    "octomap_msgs/msg/Octomap",
    header=Header,
    binary=bool,
    id=str,
    resolution=float64,
    data=sequence[int8],
)
Transform = ros("geometry_msgs/msg/Transform", translation=Vector3, rotation=Quaternion)
TransformStamped = ros(
    "geometry_msgs/msg/TransformStamped", header=Header, child_frame_id=str, transform=Transform
)
TFMessage = ros("tf2_msgs/msg/TFMessage", transforms=sequence[TransformStamped])

PointField = ros(
    "sensor_msgs/msg/PointField", name=str, offset=uint32, datatype=uint8, count=uint32
)
PointCloud2 = ros(
    "sensor_msgs/msg/PointCloud2",
    header=Header,
    height=uint32,
    width=uint32,
    fields=sequence[PointField],
    is_bigendian=bool,
    point_step=uint32,
    row_step=uint32,
    data=sequence[uint8],
    is_dense=bool,
)

Image = ros(
    "sensor_msgs/msg/Image",
    header=Header,
    height=uint32,
    width=uint32,
    encoding=str,
    is_bigendian=uint8,
    step=uint32,
    data=sequence[uint8],
)
RegionOfInterest = ros(
    "sensor_msgs/msg/RegionOfInterest",
    x_offset=uint32,
    y_offset=uint32,
    height=uint32,
    width=uint32,
    do_rectify=bool,
)
CameraInfo = ros(
    "sensor_msgs/msg/CameraInfo",
    header=Header,
    height=uint32,
    width=uint32,
    distortion_model=str,
    d=sequence[float64],
    k=array[float64, 9],
    r=array[float64, 9],
    p=array[float64, 12],
    binning_x=uint32,
    binning_y=uint32,
    roi=RegionOfInterest,
)
CompressedImage = ros(
    "sensor_msgs/msg/CompressedImage", header=Header, format=str, data=sequence[uint8]
)
UVCoordinate = ros("visualization_msgs/msg/UVCoordinate", u=float32, v=float32)
MeshFile = ros("visualization_msgs/msg/MeshFile", filename=str, data=sequence[uint8])
Marker = ros(
    "visualization_msgs/msg/Marker",
    header=Header,
    ns=str,
    id=int32,
    type=int32,
    action=int32,
    pose=Pose,
    scale=Vector3,
    color=ColorRGBA,
    lifetime=Duration,
    frame_locked=bool,
    points=sequence[Point],
    colors=sequence[ColorRGBA],
    texture_resource=str,
    texture=CompressedImage,
    uv_coordinates=sequence[UVCoordinate],
    text=str,
    mesh_resource=str,
    mesh_file=MeshFile,
    mesh_use_embedded_materials=bool,
)
MarkerArray = ros("visualization_msgs/msg/MarkerArray", markers=sequence[Marker])

KeyValue = ros("diagnostic_msgs/msg/KeyValue", key=str, value=str)
DiagnosticStatus = ros(
    "diagnostic_msgs/msg/DiagnosticStatus",
    # An octet: signed or not is the same on the wire.
    level=uint8,
    name=str,
    message=str,
    hardware_id=str,
    values=sequence[KeyValue],
)
DiagnosticArray = ros(
    "diagnostic_msgs/msg/DiagnosticArray", header=Header, status=sequence[DiagnosticStatus]
)

GeoPoint = ros(
    "geographic_msgs/msg/GeoPoint", latitude=float64, longitude=float64, altitude=float64
)
GeoPointStamped = ros("geographic_msgs/msg/GeoPointStamped", header=Header, position=GeoPoint)
LatticeInfo = ros(
    "lattice_msgs/msg/LatticeInfo",
    lattice=str,
    cell_volume_m3=float64,
    generator=array[float64, 9],
    map_from_lattice=Pose,
    origin=GeoPoint,
    has_origin=bool,
    epoch=uint64,
)
LatticeMap = ros(
    "lattice_msgs/msg/LatticeMap",
    header=Header,
    info=LatticeInfo,
    sequence=uint64,
    chunk=uint32,
    chunks=uint32,
    voxels_total=uint64,
    key_encoding=str,
    voxels=uint32,
    keys=sequence[uint8],
    counts=sequence[uint32],
    offset_unit_m=float64,
    mean_offsets=sequence[int16],
    labels=sequence[uint16],
    label_counts=sequence[uint32],
    history_checksum=uint64,
)

# rmw_cyclonedds puts who asks and the number of the request in front of both.
ASKED = {"client": uint64, "number": int64}
TriggerRequest = ros("std_srvs/srv/Trigger_Request", **ASKED, structure_needs_at_least_one_member=uint8)
TriggerResponse = ros("std_srvs/srv/Trigger_Response", **ASKED, success=bool, message=str)

Clock = ros("rosgraph_msgs/msg/Clock", clock=Time)


def service(name, request=None, response=None):
    """Both halves of a service; one without fields has a byte."""
    halves = {"Request": request, "Response": response}
    empty = {"structure_needs_at_least_one_member": uint8}
    return [ros(f"{name}_{half}", **ASKED, **(fields or empty)) for half, fields in halves.items()]


State = ros("lifecycle_msgs/msg/State", id=uint8, label=str)
Transition = ros("lifecycle_msgs/msg/Transition", id=uint8, label=str)
TransitionDescription = ros(
    "lifecycle_msgs/msg/TransitionDescription",
    transition=Transition,
    start_state=State,
    goal_state=State,
)
TransitionEvent = ros(
    "lifecycle_msgs/msg/TransitionEvent",
    timestamp=uint64,
    transition=Transition,
    start_state=State,
    goal_state=State,
)


String = ros("std_msgs/msg/String", data=str)
VisionClass = ros("vision_msgs/msg/VisionClass", class_id=uint16, class_name=str)
LabelInfo = ros(
    "vision_msgs/msg/LabelInfo", header=Header, class_map=sequence[VisionClass], threshold=float32
)
WeakDirection = ros("lattice_msgs/msg/WeakDirection", axis=Vector3, kind=uint8, sigma=float64)
ClassReliability = ros(
    "lattice_msgs/msg/ClassReliability", class_id=uint16, agreement=float64, weight=float64
)
CalibrationResult = ros(
    "lattice_msgs/msg/CalibrationResult",
    header=Header,
    child_frame_id=str,
    session=str,
    verdict=uint8,
    reason=str,
    transform=Transform,
    covariance=array[float64, 36],
    log_margin=float64,
    inlier_fraction=float64,
    rmse_m=float64,
    weak_directions=sequence[WeakDirection],
    class_reliability=sequence[ClassReliability],
    method=str,
    duration_s=float64,
    headset_scans=uint32,
    points=uint64,
)
HeadsetMesh = ros(
    "lattice_msgs/msg/HeadsetMesh",
    header=Header,
    session=str,
    surface=str,
    removed=bool,
    chunk=uint32,
    chunks=uint32,
    pose=Pose,
    vertices=sequence[float32],
    triangles=sequence[uint32],
    classes=sequence[uint16],
)
PoseStamped = ros("geometry_msgs/msg/PoseStamped", header=Header, pose=Pose)
Path = ros("nav_msgs/msg/Path", header=Header, poses=sequence[PoseStamped])
ASKS = {"has_guess": bool, "guess": Pose, "session": str}
ANSWERS = {"success": bool, "message": str, "result": CalibrationResult}
CalibrateRequest = ros("lattice_msgs/srv/Calibrate_Request", **ASKED, **ASKS)
CalibrateResponse = ros("lattice_msgs/srv/Calibrate_Response", **ASKED, **ANSWERS)

UUID = ros("unique_identifier_msgs/msg/UUID", uuid=array[uint8, 16])
GoalInfo = ros("action_msgs/msg/GoalInfo", goal_id=UUID, stamp=Time)
GoalStatus = ros("action_msgs/msg/GoalStatus", goal_info=GoalInfo, status=int8)
GoalStatusArray = ros("action_msgs/msg/GoalStatusArray", status_list=sequence[GoalStatus])
CancelGoalRequest = ros("action_msgs/srv/CancelGoal_Request", **ASKED, goal_info=GoalInfo)
CancelGoalResponse = ros(
    "action_msgs/srv/CancelGoal_Response",
    **ASKED,
    return_code=int8,
    goals_canceling=sequence[GoalInfo],
)
CALIBRATE = "lattice_msgs/action/Calibrate"
Goal = ros(f"{CALIBRATE}_Goal", **ASKS)
Result = ros(f"{CALIBRATE}_Result", **ANSWERS)
Feedback = ros(f"{CALIBRATE}_Feedback", stage=str, fraction=float32)
SendGoalRequest = ros(f"{CALIBRATE}_SendGoal_Request", **ASKED, goal_id=UUID, goal=Goal)
SendGoalResponse = ros(f"{CALIBRATE}_SendGoal_Response", **ASKED, accepted=bool, stamp=Time)
GetResultRequest = ros(f"{CALIBRATE}_GetResult_Request", **ASKED, goal_id=UUID)
GetResultResponse = ros(f"{CALIBRATE}_GetResult_Response", **ASKED, status=int8, result=Result)
FeedbackMessage = ros(f"{CALIBRATE}_FeedbackMessage", goal_id=UUID, feedback=Feedback)

PLAN = "nav2_msgs/action/ComputePathToPose"
PlanGoal = ros(
    f"{PLAN}_Goal", goal=PoseStamped, start=PoseStamped, planner_id=str, use_start=bool
)
PLANNED = {"path": Path, "planning_time": Duration, "error_code": uint16}
PLANNED_IN = {"jazzy": PLANNED, "kilted": {**PLANNED, "error_msg": str}}
PlanSendRequest = ros(f"{PLAN}_SendGoal_Request", **ASKED, goal_id=UUID, goal=PlanGoal)
PlanSendResponse = ros(f"{PLAN}_SendGoal_Response", **ASKED, accepted=bool, stamp=Time)
PlanResultRequest = ros(f"{PLAN}_GetResult_Request", **ASKED, goal_id=UUID)


def plan_result_response(distribution):
    result = ros(f"{PLAN}_Result", **PLANNED_IN[distribution])
    return ros(f"{PLAN}_GetResult_Response", **ASKED, status=int8, result=result)


RCL = "rcl_interfaces/msg"
ParameterValue = ros(
    f"{RCL}/ParameterValue",
    type=uint8,
    bool_value=bool,
    integer_value=int64,
    double_value=float64,
    string_value=str,
    byte_array_value=sequence[uint8],
    bool_array_value=sequence[bool],
    integer_array_value=sequence[int64],
    double_array_value=sequence[float64],
    string_array_value=sequence[str],
)
Parameter = ros(f"{RCL}/Parameter", name=str, value=ParameterValue)
FloatingPointRange = ros(
    f"{RCL}/FloatingPointRange", from_value=float64, to_value=float64, step=float64
)
IntegerRange = ros(f"{RCL}/IntegerRange", from_value=int64, to_value=int64, step=uint64)
ParameterDescriptor = ros(
    f"{RCL}/ParameterDescriptor",
    name=str,
    type=uint8,
    description=str,
    additional_constraints=str,
    read_only=bool,
    dynamic_typing=bool,
    floating_point_range=sequence[FloatingPointRange],
    integer_range=sequence[IntegerRange],
)
SetParametersResult = ros(f"{RCL}/SetParametersResult", successful=bool, reason=str)
ListParametersResult = ros(
    f"{RCL}/ListParametersResult", names=sequence[str], prefixes=sequence[str]
)
ParameterEvent = ros(
    f"{RCL}/ParameterEvent",
    stamp=Time,
    node=str,
    new_parameters=sequence[Parameter],
    changed_parameters=sequence[Parameter],
    deleted_parameters=sequence[Parameter],
)
LoggerLevel = ros(f"{RCL}/LoggerLevel", name=str, level=uint32)
SetLoggerLevelsResult = ros(f"{RCL}/SetLoggerLevelsResult", successful=bool, reason=str)

TYPES = "type_description_interfaces/msg"
FieldType = ros(
    f"{TYPES}/FieldType",
    type_id=uint8,
    capacity=uint64,
    string_capacity=uint64,
    nested_type_name=str,
)
Field = ros(f"{TYPES}/Field", name=str, type=FieldType, default_value=str)
IndividualTypeDescription = ros(
    f"{TYPES}/IndividualTypeDescription", type_name=str, fields=sequence[Field]
)
TypeDescription = ros(
    f"{TYPES}/TypeDescription",
    type_description=IndividualTypeDescription,
    referenced_type_descriptions=sequence[IndividualTypeDescription],
)
TypeKeyValue = ros(f"{TYPES}/KeyValue", key=str, value=str)
TypeSource = ros(f"{TYPES}/TypeSource", type_name=str, encoding=str, raw_file_contents=str)

NAMES = {"names": sequence[str]}
PARAMETERS = {"parameters": sequence[Parameter]}
LEVELS = {"levels": sequence[LoggerLevel]}
NODE_SERVICES = {
    "list_parameters": service(
        "rcl_interfaces/srv/ListParameters",
        {"prefixes": sequence[str], "depth": uint64},
        {"result": ListParametersResult},
    ),
    "get_parameters": service(
        "rcl_interfaces/srv/GetParameters", NAMES, {"values": sequence[ParameterValue]}
    ),
    "get_parameter_types": service(
        "rcl_interfaces/srv/GetParameterTypes", NAMES, {"types": sequence[uint8]}
    ),
    "describe_parameters": service(
        "rcl_interfaces/srv/DescribeParameters",
        NAMES,
        {"descriptors": sequence[ParameterDescriptor]},
    ),
    "set_parameters": service(
        "rcl_interfaces/srv/SetParameters",
        PARAMETERS,
        {"results": sequence[SetParametersResult]},
    ),
    "set_parameters_atomically": service(
        "rcl_interfaces/srv/SetParametersAtomically", PARAMETERS, {"result": SetParametersResult}
    ),
    "get_logger_levels": service("rcl_interfaces/srv/GetLoggerLevels", NAMES, LEVELS),
    "set_logger_levels": service(
        "rcl_interfaces/srv/SetLoggerLevels", LEVELS, {"results": sequence[SetLoggerLevelsResult]}
    ),
    "get_type_description": service(
        "type_description_interfaces/srv/GetTypeDescription",
        {"type_name": str, "type_hash": str, "include_type_sources": bool},
        {
            "successful": bool,
            "failure_reason": str,
            "type_description": TypeDescription,
            "type_sources": sequence[TypeSource],
            "extra_information": sequence[TypeKeyValue],
        },
    ),
}
