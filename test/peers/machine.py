"""What the numbers were measured with."""

import os
import pathlib
import platform
import re
import subprocess


def output(*command):
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=60).stdout.strip()
    except (OSError, subprocess.TimeoutExpired):
        return ""


def peers_python(root):
    """The Python of test/peers/setup, with small_gicp and KISS-Matcher."""
    return os.environ.get("PEERS_PYTHON", str(root / "target/peers/python/bin/python"))


def versions(python, *names):
    """Packages of a Python whose names begin so, with their versions."""
    return ", ".join(line for line in output(python, "-m", "pip", "freeze").splitlines() if line.startswith(names))


def put(page, begin, end, text):
    """Replaces what stands between two lines of a page."""
    head, rest = page.read_text().split(begin)
    page.write_text(f"{head}{begin}\n\n{text}\n{end}{rest.split(end)[1]}")


def facts(root):
    """Machine, versions and commit as a flat dictionary of text."""
    cpu = re.search(r"Model name:\s*(.*)", output("lscpu"))
    packages = ["liboctomap-dev", "libopenvdb-dev", "libpcl-filters1.13", "libtbb-dev"]
    debian = output("dpkg-query", "-W", "-f", "${Package} ${Version}\\n", *packages).splitlines()
    python = root / "target/peers/python/bin/pip"
    wanted = ("open3d", "small-gicp", "numpy")
    pip = [line for line in output(str(python), "freeze").splitlines() if line.split("==")[0].replace("_", "-") in wanted]
    dirty = " and changes" if output("git", "-C", str(root), "status", "--porcelain", "--untracked-files=no") else ""
    return {
        "processor": cpu.group(1) if cpu else platform.processor(),
        "cores": os.cpu_count(),
        "kernel": platform.release(),
        "load before": f"{os.getloadavg()[2]:.2f} (15 min)",
        "memory": pathlib.Path("/proc/meminfo").read_text().splitlines()[0].split(":")[1].strip(),
        "rustc": output("rustc", "--version"),
        "g++": output("g++", "--version").splitlines()[0] if output("g++", "--version") else "",
        "Debian": ", ".join(debian),
        "PyPI": ", ".join(pip),
        "commit": output("git", "-C", str(root), "rev-parse", "--short=12", "HEAD") + dirty,
    }
