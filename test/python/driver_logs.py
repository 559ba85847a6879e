"""Logs as drivers and estimators record them, all of the drive of driver_scene.

driver_logs.py FOLDER NAME:mcap|sqlite3|ros1[_bz2|_lz4][_split][_active]...

Writes the log of each name to FOLDER/NAME and prints, as JSON, the cells that each must give: under "maps"
rows of three indices and a count, under "logs" the number of its map for each name.
"""

import json
import sys
from pathlib import Path

# Imported for what they register in LOGS.
import driver_estimators  # noqa: F401
import driver_faults  # noqa: F401
import driver_lidars  # noqa: F401
import driver_oddities  # noqa: F401
import driver_positioning  # noqa: F401
import driver_scans  # noqa: F401
from driver_recording import Recording
from driver_robot import LOGS


def main(folder, *wanted):
    maps, logs = [], {}
    for name, storage in (item.split(":") for item in wanted):
        recording = Recording()
        LOGS[name](recording)
        recording.write(Path(folder) / name, storage)
        cells = recording.expected()
        if cells not in maps:
            maps.append(cells)
        logs[name] = maps.index(cells)
    json.dump({"maps": maps, "logs": logs}, sys.stdout)


if __name__ == "__main__":
    main(*sys.argv[1:])
