"""The acceptance goals as tables: ratio of medians within rounds, and whether a goal is met."""

import statistics

import tasks as task_list

# The lattices of the tables; runs.jsonl has all five.
JUDGED = ("cubic", "fcc")


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


def head(first, places):
    """The first line of a table with a column for each input."""
    return f"| {first} | {' | '.join(f'{pattern} {cell} m' for pattern, cell in places)} |"


def tables(tasks):
    """Markdown lines of goals 2 to 5: a row for each goal, a column for each input."""
    found = Found(tasks)
    inputs = {group: list(dict.fromkeys((t.pattern, t.cell) for t in tasks if t.group == group)) for group in GROUPS}
    lines = []
    for group, (title, rows_of) in GROUPS.items():
        places, rows = inputs[group], {}
        for pattern, cell in places:
            for what, value, goal, met in rows_of(found, pattern, cell):
                rows.setdefault((what, goal), {})[pattern, cell] = value if met else f"**{value}**"
        lines += [f"### {title}", ""]
        if not rows:
            lines += ["Not measured.", ""]
            continue
        lines += [head("goal", places), "|---" * (1 + len(places)) + "|"]
        for (what, goal), values in rows.items():
            lines.append(f"| {what} {goal} | {' | '.join(values.get(place, '-') for place in places)} |")
        lines.append("")
    return lines


def ratio_row(what, ours, peer, least, key=None):
    """A row that asks for a ratio of at least `least`; nothing if a side is missing."""
    if not ours or not peer:
        return []
    ratio = Ratio(ours, peer, key)
    return [(what, number(ratio.middle), f">= {least:g}", ratio.middle >= least)]


def quantize(found, pattern, cell):
    rows = []
    at = lambda label: found("quantize", pattern, cell, label)  # noqa: E731
    for lattice in ("fcc", "bcc", "mcc"):
        batch = at(f"batch {lattice}")
        rows += ratio_row(f"{lattice} / 27 candidates", batch, at(f"paper27 {lattice}"), 20)
        rows += ratio_row(f"{lattice} / cubic", batch, at("batch cubic"), 0.5)
    return rows


def insert(found, pattern, cell):
    rows = []
    at = lambda label: found("insert", pattern, cell, label)  # noqa: E731
    for lattice in JUDGED:
        occupancy, payload = at(f"occupancy {lattice}"), at(f"list {lattice}")
        rows += ratio_row(f"occupancy {lattice} / MaskGrid", occupancy, at("OpenVDB MaskGrid"), 1.2)
        rows += ratio_row(f"occupancy {lattice} / octomap", occupancy, at("octomap updateNode"), 12)
        if occupancy:
            size = occupancy.bytes_per_voxel()
            rows.append((f"occupancy {lattice}, B/voxel", f"{size:.2f}", "<= 8", size <= 8))
        # The constant FloatGrid stands for Bonxai, of which there is no package.
        rows += ratio_row(f"list {lattice} / FloatGrid", payload, at("OpenVDB FloatGrid"), 1.1)
        rows += ratio_row(f"list {lattice} / centroid grid", payload, at("OpenVDB centroid grid"), 1.1)
        rows += ratio_row(f"list {lattice} / small_gicp", payload, at("small_gicp voxelgrid"), 4)
        for store, one in (("occupancy", occupancy), ("list", payload)):
            two = at(f"{store} {lattice}, 2 threads")
            rows += ratio_row(f"{store} {lattice}, 2 / 1 threads", two, one, 1.5, key="wall_s")
    return rows


def neighbors(found, pattern, cell):
    rows = []
    for lattice in task_list.LATTICES:
        probes = found("neighbors", pattern, cell, "26 hash probes cubic")
        for method in task_list.NEIGHBOR_METHODS:
            ours = found("neighbors", pattern, cell, f"{method} {lattice}")
            rows += ratio_row(f"{lattice} / 26 hash probes", ours, probes, 3)
    return rows


def raycast(found, pattern, cell):
    rows = []
    at = lambda label: found("raycast", pattern, cell, label)  # noqa: E731
    for lattice in JUDGED:
        ours = at(f"free space {lattice}")
        for mode in ("insertPointCloud", "insertPointCloud discretized"):
            name = "octomap" if mode == "insertPointCloud" else "discretized"
            rows += ratio_row(f"{lattice} / {name}", ours, at(f"octomap {mode}"), 10)
    return rows


def file(found, pattern, cell):
    rows = []
    for lattice in JUDGED:
        for method in ("save", "load"):
            ours = found("file", pattern, cell, f"{method} {lattice}")
            if not ours:
                continue
            rate = ours.runs[-1]["n"] / max(ours.median(), 1e-9) / 1e6
            if method == "save":
                size = ours.bytes_per_voxel()
                rows.append((f"{lattice}, B/voxel", f"{size:.2f}", "<= 1.5", size <= 1.5))
            rows.append((f"{method} {lattice}, Mvoxels/s", number(rate), ">= 20", rate >= 20))
    return rows


GROUPS = {
    "quantize": ("Quantize and make keys", quantize),
    "insert": ("Insert: ratios", insert),
    "neighbors": ("Touching neighbours of all voxels", neighbors),
    "raycast": ("Free space along rays", raycast),
    "file": ("Map file", file),
}
