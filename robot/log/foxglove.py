"""Our messages as Foxglove's, for people: topics, frames and colours follow REP-103 and REP-105.

Nothing here is read back; the lossless channels are.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CylinderPrimitive_pb2 import CylinderPrimitive
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Grid_pb2 import Grid as FoxgloveGrid
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector2_pb2 import Vector2
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from robot.geometry.se2 import SE2
from robot.geometry.stereo import StereoCamera
from robot.messages import Grid, MapReport, Path, Scan

MAP, ODOM, BASE = "map", "odom", "base_link"
CAMERA = "camera_left"  # optical frame of the left eye; as in ROS, a rectified pair shares it
ELLIPSE_SIGMAS = 2.0
NS = 1_000_000_000

_FREE = (236, 239, 241, 255)
_OCCUPIED = (38, 50, 56, 255)
_UNKNOWN = (0, 0, 0, 0)
_SWEPT = (128, 203, 196, 255)
_LANDMARK = Color(r=0.9, g=0.32, b=0.0, a=0.6)


def stamp(t_ns: int) -> Timestamp:
    """Our time as a protobuf timestamp (of our own epoch: the log holds no wall time)."""
    return Timestamp(seconds=t_ns // NS, nanos=t_ns % NS)


def planar_pose(pose: SE2) -> Pose:
    """A pose in the plane z = 0."""
    return Pose(position=Vector3(x=pose.x_m, y=pose.y_m), orientation=_about_z(pose.yaw_rad))


def pose_in_frame(t_ns: int, pose: SE2, frame: str = MAP) -> PoseInFrame:
    return PoseInFrame(timestamp=stamp(t_ns), frame_id=frame, pose=planar_pose(pose))


def planar_transform(t_ns: int, parent: str, child: str, pose: SE2) -> FrameTransform:
    return FrameTransform(
        timestamp=stamp(t_ns),
        parent_frame_id=parent,
        child_frame_id=child,
        translation=Vector3(x=pose.x_m, y=pose.y_m),
        rotation=_about_z(pose.yaw_rad),
    )


def camera_transform(t_ns: int, base_from_cam: np.ndarray) -> FrameTransform:
    """Mounting of the left eye, (4, 4)."""
    x, y, z, w = _quaternion(base_from_cam[:3, :3])
    tx, ty, tz = (float(v) for v in base_from_cam[:3, 3])
    return FrameTransform(
        timestamp=stamp(t_ns),
        parent_frame_id=BASE,
        child_frame_id=CAMERA,
        translation=Vector3(x=tx, y=ty, z=tz),
        rotation=Quaternion(x=x, y=y, z=z, w=w),
    )


def laser_scan(t_ns: int, scan: Scan) -> LaserScan:
    """Ranges on a uniform fan: the nearest of our bearings; nothing seen is +inf (REP-117)."""
    message = LaserScan(timestamp=stamp(t_ns), frame_id=BASE, pose=planar_pose(SE2()))
    bearings = scan.bearing_rad
    if bearings.size == 0:
        return message
    fan = np.linspace(bearings[0], bearings[-1], bearings.size)
    right = np.searchsorted(bearings, fan).clip(1, max(1, bearings.size - 1))
    right = np.minimum(right, bearings.size - 1)
    left = np.maximum(right - 1, 0)
    nearest = np.where(fan - bearings[left] <= bearings[right] - fan, left, right)
    ranges = scan.range_m[nearest].astype(float)
    message.start_angle, message.end_angle = float(bearings[0]), float(bearings[-1])
    message.ranges.extend(np.where(np.isnan(ranges), math.inf, ranges).tolist())
    return message


def map_grid(t_ns: int, grid: Grid, covered: np.ndarray) -> FoxgloveGrid:
    """Occupancy in colours: free, occupied, swept; unknown is transparent."""
    cells = grid.cells
    colours = np.empty((*cells.shape, 4), np.uint8)
    colours[...] = _UNKNOWN
    colours[(cells >= 0) & (cells < 50)] = _FREE
    if covered.shape == cells.shape:
        colours[covered & (cells < 50)] = _SWEPT
    colours[cells >= 50] = _OCCUPIED
    message = FoxgloveGrid(
        timestamp=stamp(t_ns),
        frame_id=MAP,
        pose=planar_pose(SE2(grid.origin_x_m, grid.origin_y_m)),
        column_count=cells.shape[1],
        cell_size=Vector2(x=grid.resolution_m, y=grid.resolution_m),
        row_stride=4 * cells.shape[1],
        cell_stride=4,
        data=colours.tobytes(),
    )
    for offset, name in enumerate(("red", "green", "blue", "alpha")):
        message.fields.add(name=name, offset=offset, type=PackedElementField.UINT8)
    return message


def landmark_scene(t_ns: int, report: MapReport) -> SceneUpdate:
    """Flat discs: the 2-sigma ellipse of every landmark."""
    entity = SceneEntity(timestamp=stamp(t_ns), frame_id=MAP, id="landmarks")
    if len(report.landmarks_m):
        values, vectors = np.linalg.eigh(report.landmark_cov)
        axes = 2.0 * ELLIPSE_SIGMAS * np.sqrt(np.maximum(values, 1e-6))
        yaw = np.arctan2(vectors[:, 1, 1], vectors[:, 0, 1])  # of the longer axis
        flat = np.column_stack([report.landmarks_m, axes[:, 1], axes[:, 0], yaw])
        flat = flat[np.isfinite(flat).all(axis=1)]
        entity.cylinders.extend(_disc(*row) for row in flat.tolist())
    return SceneUpdate(entities=[entity])


def path_poses(t_ns: int, path: Path) -> PosesInFrame:
    """Waypoints, each looking at the next one."""
    message = PosesInFrame(timestamp=stamp(t_ns), frame_id=MAP)
    points = path.points_m
    if len(points):
        steps = np.diff(points, axis=0, append=points[-1:])
        yaw = np.arctan2(steps[:, 1], steps[:, 0])
        if len(points) > 1:
            yaw[-1] = yaw[-2]
        rows = np.column_stack([points, yaw]).tolist()
        message.poses.extend(planar_pose(SE2(x, y, a)) for x, y, a in rows)
    return message


def log_line(t_ns: int, text: str, *, warning: bool = False) -> Log:
    return Log(
        timestamp=stamp(t_ns),
        level=Log.WARNING if warning else Log.INFO,
        message=text,
        name="sweeper",
    )


def png_image(t_ns: int, png: bytes) -> CompressedImage:
    return CompressedImage(timestamp=stamp(t_ns), frame_id=CAMERA, data=png, format="png")


def calibration(t_ns: int, camera: StereoCamera, *, right: bool) -> CameraCalibration:
    """The rectified camera: no distortion; the right eye's P carries -f b (ROS camera_info)."""
    f, cx, cy = camera.focal_px, camera.cx_px, camera.cy_px
    shift = -f * camera.baseline_m if right else 0.0
    return CameraCalibration(
        timestamp=stamp(t_ns),
        frame_id=CAMERA,
        width=camera.width_px,
        height=camera.height_px,
        K=[f, 0, cx, 0, f, cy, 0, 0, 1],
        R=[1, 0, 0, 0, 1, 0, 0, 0, 1],
        P=[f, 0, cx, shift, 0, f, cy, 0, 0, 0, 1, 0],
    )


def _disc(x_m: float, y_m: float, long_m: float, short_m: float, yaw_rad: float) -> Any:
    return CylinderPrimitive(
        pose=planar_pose(SE2(x_m, y_m, yaw_rad)),
        size=Vector3(x=long_m, y=short_m, z=0.01),
        bottom_scale=1.0,
        top_scale=1.0,
        color=_LANDMARK,
    )


def _about_z(yaw_rad: float) -> Quaternion:
    return Quaternion(z=math.sin(0.5 * yaw_rad), w=math.cos(0.5 * yaw_rad))


def _quaternion(rotation: np.ndarray) -> tuple[float, float, float, float]:
    """(x, y, z, w) of a (3, 3) rotation: eigenvector of Bar-Itzhack's K (J. Guidance 2000)."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    k = np.array(
        [
            [a - e - i, d + b, g + c, h - f],
            [d + b, e - a - i, h + f, c - g],
            [g + c, h + f, i - a - e, d - b],
            [h - f, c - g, d - b, a + e + i],
        ]
    )
    x, y, z, w = (float(v) for v in np.linalg.eigh(k)[1][:, -1])
    return (x, y, z, w) if w >= 0 else (-x, -y, -z, -w)
