"""Builds the programs and makes the inputs."""

import json
import pathlib
import subprocess

FLAGS = ["-std=c++17", "-O3", "-march=x86-64-v3", "-DNDEBUG"]
EIGEN = ["-isystem", "/usr/include/eigen3"]


def programs(root, build_all):
    """Paths of all programs, built where `build_all` and older than their source."""
    out = root / "target/peers"
    source = root / "test/peers"
    lattice = root / "target/release/lattice"
    if build_all:
        subprocess.run(["cargo", "build", "--release", "-p", "lattice", "--bin", "lattice"], cwd=root, check=True)
    pcl = pathlib.Path("/usr/include/pcl-1.13")
    pcl = pcl if pcl.exists() else out / "pcl/usr/include/pcl-1.13"
    recipes = {
        "octomap": ["-loctomap", "-loctomath"],
        "openvdb": ["-lopenvdb", "-ltbb", "-lImath", "-lpthread"],
        "small_gicp": [*EIGEN, "-isystem", out / "small_gicp/include", "-fopenmp"],
        "pcl": [*EIGEN, "-isystem", pcl, "-l:libpcl_filters.so.1.13", "-l:libpcl_common.so.1.13"],
    }
    built = {"lattice": lattice, "python": out / "python/bin/python", "python_peer": source / "python_peer.py"}
    (out / "bin").mkdir(parents=True, exist_ok=True)
    for name, recipe in recipes.items():
        program, code = out / "bin" / name, source / f"{name}_peer.cpp"
        newest = max(code.stat().st_mtime, (source / "peer.hpp").stat().st_mtime)
        if build_all and not (program.exists() and program.stat().st_mtime > newest):
            print(f"building {name}", flush=True)
            flags = [str(part) for part in recipe]
            compiled = [f for f in flags if not f.startswith("-l")]
            linked = [f for f in flags if f.startswith("-l")]
            subprocess.run(["g++", *FLAGS, *compiled, code, "-o", program, *linked], check=True)
        built[name] = program
    return built


def inputs(root, built, points):
    """The surveys by pattern: path, and what the simulator says of them. Made anew if the number differs."""
    folder = root / "target/peers/data"
    folder.mkdir(parents=True, exist_ok=True)
    made = {}
    for pattern in ("lms200", "os64"):
        path = folder / f"{pattern}-{points}.xyzi"
        command = [built["lattice"], "simulate", "site", "--pattern", pattern, "--points", str(points), "--out", path, "--json"]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        made[pattern] = {"path": path} | {k: v for k, v in json.loads(done.stdout).items() if k != "out"}
        print(f"{pattern}: {made[pattern]}", flush=True)
    return made
