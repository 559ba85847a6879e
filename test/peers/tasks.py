"""Which systems are measured on which input."""

import dataclasses
import statistics
import subprocess

CELLS = (0.1, 0.2, 0.5)
LATTICES = ("cubic", "bcc", "fcc", "mcc", "hex")
# How `lattice bench neighbors` is asked to count; `hash26` is the measure.
NEIGHBOR_METHODS = ("pass", "probe")
# The first points only: rays are long.
RAY_POINTS = {"lms200": 300_000, "os64": 165_000}


@dataclasses.dataclass
class Task:
    """One system on one input, with its runs."""

    group: str
    pattern: str
    cell: float
    label: str
    command: list
    lattice: str = "cubic"
    threads: int = 1
    most_rounds: int = 1_000
    exact_cubes: bool = False
    exact_keys: bool = False
    runs: list = dataclasses.field(default_factory=list)

    def good(self):
        return bool(self.runs) and not any("failed" in run for run in self.runs)

    def seconds(self, run, key=None):
        """Processor time of one thread; wall time of several. `key` picks another clock of the run."""
        return run[key or ("cpu_s" if self.threads == 1 else "wall_s")]

    def median(self, key=None):
        return statistics.median(self.seconds(run, key) for run in self.runs)

    def voxels(self):
        return self.runs[-1]["voxels"]

    def known(self):
        """Occupied neighbours or known cells, 0 where the system does not count them."""
        return self.runs[-1].get("count") or 0

    def bytes_per_voxel(self):
        last = self.runs[-1]
        return last["bytes"] / max(last["voxels"], 1)


def blocks(tasks):
    """Tasks of one group and input together, in the order of their first."""
    by_input = {}
    for task in tasks:
        by_input.setdefault((task.group, task.pattern, task.cell), []).append(task)
    return list(by_input.values())


def all_tasks(programs, inputs, quick):
    """Every measurement; a quick run has one cell size."""
    cells = (0.2,) if quick else CELLS
    tasks = []
    for pattern, made in inputs.items():
        maker = Maker(programs, pattern, made["path"], tasks)
        maker.quantize(0.2, 50_000 if quick else 1_000_000)
        for cell in cells:
            maker.insert(cell)
        for cell in cells:
            maker.neighbors(cell)
        for cell in cells:
            maker.raycast(cell, RAY_POINTS[pattern] // (20 if quick else 1))
        maker.file(0.2 if quick else 0.1)
    return tasks


class Maker:
    """Adds the tasks of one point file."""

    def __init__(self, programs, pattern, path, tasks):
        self.programs, self.pattern, self.path, self.tasks = programs, pattern, path, tasks

    def lattice(self, group, cell, label, lattice, threads=1, options=(), **kinds):
        command = [self.programs["lattice"], "bench", group, "--points", self.path, "--cell", str(cell)]
        command += ["--lattice", lattice, "--threads", str(threads), "--json", *options]
        label = f"{label} {lattice}" + (f", {threads} threads" if threads > 1 else "")
        self.add(group, cell, label, command, lattice=lattice, threads=threads, **kinds)

    def peer(self, group, cell, label, program, mode=None, threads=1, options=(), **kinds):
        command = [self.programs[program]]
        command += [self.programs["python_peer"]] if program == "python" else []
        command += ["--points", self.path, "--cell", str(cell), "--threads", str(threads), *options]
        command += ["--mode", mode] if mode else []
        label += f", {threads} threads" if threads > 1 else ""
        self.add(group, cell, label, command, threads=threads, **kinds)

    def offers(self, word, *command):
        """Whether the help of `lattice bench` (or of one of its commands) lists a command or method."""
        command = (str(self.programs["lattice"]), "bench", *command, "--help")
        done = subprocess.run(command, capture_output=True, text=True)
        return any(line.strip().startswith((word + " ", f"- {word}:")) for line in done.stdout.splitlines())

    def add(self, group, cell, label, command, **kinds):
        command = [str(part) for part in command]
        self.tasks.append(Task(group, self.pattern, cell, label, command, **kinds))

    def quantize(self, cell, slow_points):
        for lattice in LATTICES:
            for method in ("batch", "portable", "scalar"):
                self.lattice("quantize", cell, method, lattice, options=("--method", method), exact_keys=True)
            if lattice != "cubic" and self.offers("paper27", "quantize"):
                few = ("--method", "paper27", "--max-points", str(slow_points))
                self.lattice("quantize", cell, "paper27", lattice, options=few)

    def insert(self, cell):
        for store in ("occupancy", "list"):
            for lattice in LATTICES:
                cubes = lattice == "cubic"
                self.lattice("insert", cell, store, lattice, options=("--store", store), exact_cubes=cubes)
            for lattice in ("cubic", "fcc"):
                cubes = lattice == "cubic"
                self.lattice("insert", cell, store, lattice, threads=2, options=("--store", store), exact_cubes=cubes)
        scans = ("--store", "occupancy", "--scans")
        self.lattice("insert", cell, "occupancy scan by scan", "fcc", options=scans)
        exact = {"exact_cubes": True}
        self.peer("insert", cell, "OpenVDB MaskGrid", "openvdb", "mask", **exact)
        self.peer("insert", cell, "OpenVDB MaskGrid", "openvdb", "mask", threads=2, **exact)
        self.peer("insert", cell, "OpenVDB FloatGrid", "openvdb", "float", **exact)
        self.peer("insert", cell, "OpenVDB FloatGrid counting", "openvdb", "count", **exact)
        self.peer("insert", cell, "OpenVDB centroid grid", "openvdb", "centroid", **exact)
        self.peer("insert", cell, "octomap updateNode", "octomap", "insert", **exact)
        self.peer("insert", cell, "small_gicp voxelgrid", "small_gicp", **exact)
        self.peer("insert", cell, "small_gicp voxelgrid", "small_gicp", threads=2)
        self.peer("insert", cell, "PCL VoxelGrid", "pcl", **exact)
        for mode in ("open3d-downsample", "open3d-voxelgrid", "small_gicp-python"):
            self.peer("insert", cell, f"{mode} (Python)", "python", mode, most_rounds=2)

    def neighbors(self, cell):
        for lattice in LATTICES:
            method = next((m for m in NEIGHBOR_METHODS if self.offers(m, "neighbors")), "probe")
            options = ("--store", "occupancy", "--method", method)
            self.lattice("neighbors", cell, method, lattice, options=options, exact_cubes=lattice == "cubic")
        hash26 = ("--store", "occupancy", "--method", "hash26")
        self.lattice("neighbors", cell, "26 hash probes", "cubic", options=hash26, exact_cubes=True)

    def raycast(self, cell, points):
        few = ("--max-points", str(points))
        for lattice in LATTICES:
            self.lattice("raycast", cell, "free space", lattice, options=few, exact_cubes=lattice == "cubic")
        self.peer("raycast", cell, "octomap insertPointCloud", "octomap", "rays", options=few, most_rounds=3)
        self.peer("raycast", cell, "octomap insertPointCloud discretized", "octomap", "rays-discrete", options=few, most_rounds=3,
                  exact_cubes=True)

    def file(self, cell):
        if not self.offers("file"):
            return
        for lattice in LATTICES:
            for method in ("save", "load"):
                self.lattice("file", cell, method, lattice, options=("--method", method))
