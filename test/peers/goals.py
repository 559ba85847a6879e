"""The acceptance goals as tables: ratio of medians within rounds, and whether a goal is met."""

import statistics

import tasks as task_list

# Ours: the lattices that a goal may be met with, each judged by itself.
JUDGED = ("cubic", "bcc", "fcc")


def number(value):
    """Three significant digits without an exponent."""
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}" if value >= 0.1 else f"{value:.3f}"


class Ratio:
    """How much faster one system is than another: per round, then the median of the rounds."""

    def __init__(self, ours, peer, key=None):
        each = [
            (p[key or clock(peer)] / p["n"]) / max(o[key or clock(ours)] / o["n"], 1e-15)
            for o, p in zip(ours.runs, peer.runs)
        ]
        self.middle, self.least, self.most = statistics.median(each), min(each), max(each)

    def __str__(self):
        return f"{number(self.middle)} ({number(self.least)} .. {number(self.most)})"


def clock(task):
    return "cpu_s" if task.threads == 1 else "wall_s"


class Found:
    """Good tasks by group, input and label."""

    def __init__(self, tasks):
        self.tasks = {(t.group, t.pattern, t.cell, t.label): t for t in tasks if t.good()}

    def __call__(self, group, pattern, cell, label):
        return self.tasks.get((group, pattern, cell, label))


def verdict(met):
    return "met" if met else "**not met**"


def tables(tasks):
    """Markdown lines of goals 2 to 5."""
    found = Found(tasks)
    inputs = {group: list(dict.fromkeys((t.pattern, t.cell) for t in tasks if t.group == group)) for group in GROUPS}
    lines = []
    for group, (title, rows_of) in GROUPS.items():
        lines += [f"## {title}", ""]
        rows = [row for pattern, cell in inputs[group] for row in rows_of(found, pattern, cell)]
        if not rows:
            lines += ["Not measured.", ""]
            continue
        lines += ["| input | what | measured | goal | |", "|---|---|---|---|---|"]
        lines += [f"| {pattern_cell} | {what} | {value} | {goal} | {verdict(met)} |" for pattern_cell, what, value, goal, met in rows]
        lines.append("")
    return lines


def ratio_row(place, what, ours, peer, least, key=None):
    """A row that asks for a ratio of at least `least`; nothing if a side is missing."""
    if not ours or not peer:
        return []
    ratio = Ratio(ours, peer, key)
    return [(place, what, f"{ratio}x", f">= {least:g}x", ratio.middle >= least)]


def quantize(found, pattern, cell):
    place, rows = f"{pattern} {cell} m", []
    at = lambda label: found("quantize", pattern, cell, label)  # noqa: E731
    for lattice in ("fcc", "bcc", "mcc"):
        batch = at(f"batch {lattice}")
        rows += ratio_row(place, f"{lattice} against the paper's 27 candidates", batch, at(f"paper27 {lattice}"), 20)
        rows += ratio_row(place, f"{lattice} against cubic", batch, at("batch cubic"), 0.5)
        others = [at(f"{method} {lattice}") for method in ("portable", "scalar")]
        if batch and all(others):
            hashes = [t.runs[-1]["hash"] for t in (batch, *others)]
            same = len(set(hashes)) == 1
            rows.append((place, f"{lattice}: key stream with and without AVX2", hashes[0] if same else hashes, "one digest", same))
    return rows


def insert(found, pattern, cell):
    place, rows = f"{pattern} {cell} m", []
    at = lambda label: found("insert", pattern, cell, label)  # noqa: E731
    mask, octomap = at("OpenVDB MaskGrid"), at("octomap updateNode")
    # Stands for Bonxai, of which there is no package.
    counting = at("OpenVDB FloatGrid")
    for lattice in JUDGED:
        occupancy, payload = at(f"occupancy {lattice}"), at(f"list {lattice}")
        rows += ratio_row(place, f"occupancy {lattice} against MaskGrid", occupancy, mask, 1.2)
        rows += ratio_row(place, f"occupancy {lattice} against octomap", occupancy, octomap, 12)
        if occupancy:
            size = occupancy.bytes_per_voxel()
            rows.append((place, f"occupancy {lattice}, memory", f"{size:.2f} B/voxel", "<= 8 B/voxel", size <= 8))
            if size <= 8:
                rows += ratio_row(place, f"store of at most 8 B/voxel, {lattice}, against MaskGrid", occupancy, mask, 1.1)
                rows += ratio_row(place, f"store of at most 8 B/voxel, {lattice}, against octomap", occupancy, octomap, 9)
        name = counting.label if counting else ""
        rows += ratio_row(place, f"count and centroid {lattice} against {name}", payload, counting, 1.1)
        same = at("OpenVDB centroid grid")
        rows += ratio_row(place, f"count and centroid {lattice} against an OpenVDB grid of counts and sums", payload, same, 1.1)
        rows += ratio_row(place, f"count and centroid {lattice} against small_gicp", payload, at("small_gicp voxelgrid"), 4)
        if lattice != "bcc":
            for store, one in (("occupancy", occupancy), ("list", payload)):
                two = at(f"{store} {lattice}, 2 threads")
                rows += ratio_row(place, f"{store} {lattice}: two threads against one (wall time)", two, one, 1.5, key="wall_s")
    return rows


def neighbors(found, pattern, cell):
    place, rows = f"{pattern} {cell} m", []
    for lattice in task_list.LATTICES:
        probes = found("neighbors", pattern, cell, "26 hash probes cubic")
        for method in task_list.NEIGHBOR_METHODS:
            ours = found("neighbors", pattern, cell, f"{method} {lattice}")
            rows += ratio_row(place, f"{method} {lattice} against 26 hash probes, for each voxel", ours, probes, 3)
    return rows


def raycast(found, pattern, cell):
    place, rows = f"{pattern} {cell} m", []
    at = lambda label: found("raycast", pattern, cell, label)  # noqa: E731
    for lattice in JUDGED:
        ours = at(f"free space {lattice}")
        for mode in ("insertPointCloud", "insertPointCloud discretized"):
            rows += ratio_row(place, f"free space {lattice} against octomap {mode}", ours, at(f"octomap {mode}"), 10)
    return rows


def file(found, pattern, cell):
    place, rows = f"{pattern} {cell} m", []
    for lattice in task_list.LATTICES:
        for method in ("save", "load"):
            ours = found("file", pattern, cell, f"{method} {lattice}")
            if not ours:
                continue
            rate = ours.runs[-1]["n"] / max(ours.median(), 1e-9) / 1e6
            if method == "save":
                size = ours.bytes_per_voxel()
                rows.append((place, f"{lattice}: file", f"{size:.2f} B/voxel", "<= 1.5 B/voxel", size <= 1.5))
            rows.append((place, f"{lattice}: {method} without zstd", f"{number(rate)} Mvoxels/s", ">= 20 Mvoxels/s", rate >= 20))
    return rows


GROUPS = {
    "quantize": ("Goal 2: quantize and make keys", quantize),
    "insert": ("Goal 3: insert", insert),
    "neighbors": ("Goal 4: touching neighbours of all voxels", neighbors),
    "raycast": ("Goal 4: free space along rays", raycast),
    "file": ("Goal 5: map file", file),
}
