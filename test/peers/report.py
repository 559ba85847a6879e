"""Writes docs/dev/benchmarks.md between its markers, and appends every run as JSON beside it."""

import json
import shutil
import pathlib

import goals
import tasks as task_list

BEGIN, END = "<!-- results: begin (written by test/peers/run) -->", "<!-- results: end -->"
TEXT = pathlib.Path(__file__).resolve().parents[2] / "docs/dev/benchmarks.md"

# Systems of the table of rates; all others are in runs.jsonl.
SHOWN = (
    "occupancy cubic",
    "occupancy fcc",
    "list cubic",
    "list fcc",
    "OpenVDB MaskGrid",
    "OpenVDB FloatGrid",
    "OpenVDB centroid grid",
    "octomap updateNode",
    "small_gicp voxelgrid",
    "PCL VoxelGrid",
    "open3d-downsample (Python)",
    "small_gicp-python (Python)",
)


def write(folder, facts, inputs, tasks, problems, fresh):
    """Puts the results into `folder`/benchmarks.md (a copy of the text if `fresh`), the runs into benchmarks/runs.jsonl."""
    folder.mkdir(parents=True, exist_ok=True)
    page = folder / "benchmarks.md"
    if fresh and page != TEXT:
        shutil.copy(TEXT, page)
    put(page, facts, inputs, tasks, problems)
    raw = folder / "benchmarks"
    raw.mkdir(exist_ok=True)
    lines = [json.dumps({"machine": facts, "inputs": {k: summary(v) for k, v in inputs.items()}})]
    for t in tasks:
        row = {"group": t.group, "pattern": t.pattern, "cell": t.cell, "label": t.label, "threads": t.threads}
        lines.append(json.dumps(row | {"runs": [compact(run) for run in t.runs]}))
    with (raw / "runs.jsonl").open("w" if fresh else "a") as file:
        file.write("\n".join(lines) + "\n")


def put(page, facts, inputs, tasks, problems):
    """Replaces the results in a page."""
    before, _, rest = page.read_text().partition(BEGIN)
    _, _, after = rest.partition(END)
    parts = [BEGIN, "", *machine(facts, inputs), *goals.tables(tasks), *systems(tasks), *notes(problems), END]
    page.write_text(before + "\n".join(parts) + after)


def newest(path):
    """Machine, inputs and tasks of the last run in a file of runs."""
    head, tasks = None, []
    for line in path.read_text().splitlines():
        row = json.loads(line)
        if "machine" in row:
            head, tasks = row, []
        else:
            tasks.append(task_list.Task(command=[], **row))
    return head["machine"], head["inputs"], tasks


def summary(made):
    return {k: v for k, v in made.items() if k != "path"}


def compact(run):
    """A run without what its task says already; times to the microsecond."""
    kept = {k: v for k, v in run.items() if k not in ("res", "threads", "lattice")}
    return {k: round(v, 6) if isinstance(v, float) else v for k, v in kept.items()}


def machine(facts, inputs):
    """The command, the machine and the versions."""
    lines = [f"- command: `{facts['command']}`"]
    names = ("processor", "cores", "load before", "rustc", "g++", "Debian", "PyPI", "commit", "rounds", "points")
    lines += [f"- {name}: {facts[name]}" for name in names if facts.get(name)]
    for pattern, made in inputs.items():
        lines.append(
            f"- input {pattern}: {made['scans']} scans over {made['duration_s']:.0f} s, mean range {made['mean_range_m']:.2f} m"
        )
    return [*lines, ""]


def systems(tasks):
    """Rates of inserting; the medians of the runs."""
    good = {(t.pattern, t.cell, t.label): t for t in tasks if t.group == "insert" and t.good()}
    places = list(dict.fromkeys((pattern, cell) for pattern, cell, _ in good))
    if not places:
        return []
    at = places[min(1, len(places) - 1)]
    head = f"{goals.head('system', places)} B/voxel, {at[0]} {at[1]} m |"
    lines = ["### Insert: million points a second", "", head, "|---" * (2 + len(places)) + "|"]
    for label in SHOWN:
        found = [good.get((*place, label)) for place in places]
        rates = [goals.number(t.runs[-1]["n"] / max(t.median(), 1e-9) / 1e6) if t else "-" for t in found]
        held = good.get((*at, label))
        size = f"{held.bytes_per_voxel():.1f}" if held and held.runs[-1]["bytes"] else "-"
        lines.append(f"| {label} | {' | '.join(rates)} | {size} |")
    lines.append("")
    return lines


def notes(problems):
    if not problems:
        return ["All exact cubic systems agree on the voxels, and all key streams on their digests.", ""]
    return ["### Problems", "", *[f"- {problem}" for problem in problems], ""]
