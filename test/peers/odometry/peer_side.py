"""Runs one peer over the clouds of a log, writes its poses as TUM, and prints its errors and times as a line of JSON.

    peer_side.py PEER CELL_M LOG POSES.tum

Errors are those at the beginnings, middles or ends of the scans, whichever are least: peers differ in the time that a
pose is of. Processor time is that of the calls that register a scan.
"""

import json
import pathlib
import sys
import time

sys.dont_write_bytecode = True

import numpy as np  # noqa: E402
from rosbags.highlevel import AnyReader  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

import metrics  # noqa: E402


def scans(log):
    """Points (n x 3, m) and times (ns) of each cloud."""
    with AnyReader([log], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        topics = [c for c in reader.connections if c.topic == "/points"]
        for connection, _, raw in reader.messages(connections=topics):
            cloud = reader.deserialize(raw, connection.msgtype)
            stamp = cloud.header.stamp.sec * 10**9 + cloud.header.stamp.nanosec
            layout = np.dtype([("xyz", "<f4", 3), ("t", "<u4")])
            points = np.frombuffer(cloud.data, layout)
            yield points["xyz"].astype(float), stamp + points["t"].astype(np.int64)


class Kiss:
    def __init__(self, cell, _):
        from kiss_icp.config.parser import KISSConfig
        from kiss_icp.kiss_icp import KissICP

        config = KISSConfig()
        config.mapping.voxel_size = cell
        config.registration.max_num_threads = 1
        self.odometry = KissICP(config)

    def register(self, points, times):
        self.odometry.register_frame(points, share(times))
        return self.odometry.last_pose


class Genz:
    def __init__(self, cell, _):
        from genz_icp.config import GenZConfig
        from genz_icp.genz_icp import GenZICP

        config = GenZConfig()
        config.mapping.voxel_size = cell
        config.data.deskew = True
        self.odometry = GenZICP(config)

    def register(self, points, times):
        self.odometry.register_frame(points, share(times))
        return self.odometry.last_pose


class RkoLio:
    """Without an IMU it assumes constant velocity."""

    def __init__(self, cell, _):
        from rko_lio.config import LIOConfig
        from rko_lio.lio import LIO

        self.odometry = LIO(LIOConfig(voxel_size=cell, max_num_threads=1))

    def register(self, points, times):
        self.odometry.register_scan(points, times)
        return self.odometry.pose()


class RkoLioImu(RkoLio):
    """With an IMU of 100 Hz at the lidar, without bias and noise: derivatives of the true poses."""

    def __init__(self, cell, truth):
        super().__init__(cell, truth)
        times, poses = truth
        step_s = (times[2:] - times[:-2]) / 2e9
        before, middle, after = poses[:-2], poses[1:-1], poses[2:]
        turns = [metrics.log(turn)[3:] for turn in np.linalg.inv(before) @ after]
        rates = np.array(turns) / (2 * step_s[:, None])
        forces = (after - 2 * middle + before)[:, :3, 3] / step_s[:, None] ** 2 + [0, 0, 9.81]
        forces = (middle[:, :3, :3].transpose(0, 2, 1) @ forces[:, :, None])[:, :, 0]
        self.samples = list(zip(forces, rates, times[1:-1].tolist()))

    def prepare(self, points, times):
        while self.samples and self.samples[0][2] <= times.max():
            self.odometry.add_imu_measurement(*self.samples.pop(0))
        return points


class SmallGicp:
    """VGICP to a map of Gaussian voxels, as in small_gicp's example; scans are deskewed by the motion of the one before."""

    def __init__(self, cell, _):
        import small_gicp

        self.api = small_gicp
        self.map = small_gicp.GaussianVoxelMap(cell)
        self.map.set_lru(horizon=100, clear_cycle=10)
        self.pose = np.eye(4)
        self.step = np.eye(4)

    def prepare(self, points, times):
        parts, place = np.unique(times, return_inverse=True)
        back = metrics.exp((share(parts) - 1)[:, None] * metrics.log(self.step))[place]
        return (back[:, :3, :3] @ points[:, :, None])[:, :, 0] + back[:, :3, 3]

    def register(self, points, _):
        cloud, _ = self.api.preprocess_points(points, 0.25, num_threads=1)
        if self.map.size() > 0:
            found = self.api.align(self.map, cloud, self.pose @ self.step, num_threads=1).T_target_source
            self.step = np.linalg.inv(self.pose) @ found
            self.pose = found
        self.map.insert(cloud, self.pose)
        return self.pose


PEERS = {"kiss-icp": Kiss, "genz-icp": Genz, "rko_lio": RkoLio, "rko_lio with an ideal IMU": RkoLioImu, "small_gicp": SmallGicp}


def share(times):
    """Times from 0 to 1 within a scan."""
    return (times - times.min()) / max(times.max() - times.min(), 1)


def main():
    name, cell, log, out = sys.argv[1], float(sys.argv[2]), pathlib.Path(sys.argv[3]), pathlib.Path(sys.argv[4])
    truth = metrics.read_tum(log / "truth.tum")
    peer = PEERS[name](cell, truth)
    spans, poses, cpu_s = [], [], 0.0
    for points, times in scans(log):
        if hasattr(peer, "prepare"):
            points = peer.prepare(points, times)
        begin = time.process_time()
        pose = peer.register(points, times)
        cpu_s += time.process_time() - begin
        spans.append((times.min(), times.max()))
        poses.append(np.array(pose))
    poses, spans = np.array(poses), np.array(spans)
    instants = {"begin": spans[:, 0], "middle": spans.sum(axis=1) // 2, "end": spans[:, 1]}
    measured = {name: metrics.errors(poses, metrics.at(*truth, times)) for name, times in instants.items()}
    of = min(measured, key=lambda name: measured[name]["ate_m"])
    metrics.write_tum(out, instants[of].tolist(), poses)
    print(json.dumps({"pose_at": of, "scans": len(poses), "cpu_ms": 1e3 * cpu_s / len(poses)} | measured[of]))


if __name__ == "__main__":
    main()
