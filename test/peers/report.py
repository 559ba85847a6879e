"""Writes docs/benchmarks.md between its markers, and every run as JSON beside it."""

import json
import shutil
import pathlib

import goals
import tasks as task_list

BEGIN, END = "<!-- results: begin (written by test/peers/run) -->", "<!-- results: end -->"
TEXT = pathlib.Path(__file__).resolve().parents[2] / "docs/benchmarks.md"


def write(folder, facts, inputs, tasks, problems, fresh):
    """Puts the results into `folder`/benchmarks.md (a copy of the text if `fresh`) and benchmarks/runs.json."""
    folder.mkdir(parents=True, exist_ok=True)
    page = folder / "benchmarks.md"
    if fresh and page != TEXT:
        shutil.copy(TEXT, page)
    before, _, rest = page.read_text().partition(BEGIN)
    _, _, after = rest.partition(END)
    parts = [BEGIN, "", *machine(facts, inputs), *goals.tables(tasks), *systems(tasks), *notes(problems), END]
    page.write_text(before + "\n".join(parts) + after)
    raw = folder / "benchmarks"
    raw.mkdir(exist_ok=True)
    lines = [json.dumps({"machine": facts, "inputs": {k: summary(v) for k, v in inputs.items()}})]
    for t in tasks:
        row = {"group": t.group, "pattern": t.pattern, "cell": t.cell, "label": t.label, "threads": t.threads}
        lines.append(json.dumps(row | {"runs": [compact(run) for run in t.runs]}))
    (raw / "runs.jsonl").write_text("\n".join(lines) + "\n")


def summary(made):
    return {k: v for k, v in made.items() if k != "path"}


def compact(run):
    """A run without what its task says already; times to the microsecond."""
    kept = {k: v for k, v in run.items() if k not in ("res", "threads", "lattice")}
    return {k: round(v, 6) if isinstance(v, float) else v for k, v in kept.items()}


def machine(facts, inputs):
    lines = [f"- {name}: {value}" for name, value in facts.items() if name != "command"]
    lines.append(f"- command: `{facts['command']}`")
    for pattern, made in inputs.items():
        lines.append(
            f"- input {pattern}: {made['points']} points in {made['scans']} scans over {made['duration_s']:.0f} s, "
            f"mean range {made['mean_range_m']:.2f} m"
        )
    return [*lines, ""]


def systems(tasks):
    """Every system on every input."""
    lines = ["## All systems", ""]
    for block in task_list.blocks([t for t in tasks if t.good()]):
        first = block[0]
        unit = "voxels" if first.group in ("neighbors", "file") else "points"
        lines += [f"### {first.group}, {first.pattern}, {first.cell} m", ""]
        lines += [f"| system | runs | M{unit}/s (least .. most) | voxels | B/voxel |", "|---|---|---|---|---|"]
        for t in block:
            rates = sorted(run["n"] / max(t.seconds(run), 1e-9) / 1e6 for run in t.runs)
            middle = t.runs[-1]["n"] / max(t.median(), 1e-9) / 1e6
            bytes_text = f"{t.bytes_per_voxel():.1f}" if t.runs[-1]["bytes"] else "-"
            voxels = t.voxels() or "-"
            spread = f"({goals.number(rates[0])} .. {goals.number(rates[-1])})"
            lines.append(f"| {t.label} | {len(t.runs)} | {goals.number(middle)} {spread} | {voxels} | {bytes_text} |")
        lines.append("")
    return lines


def notes(problems):
    if not problems:
        return ["All exact cubic systems agree on the voxels, and all key streams on their digests.", ""]
    return ["## Problems", "", *[f"- {problem}" for problem in problems], ""]
