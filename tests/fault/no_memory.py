#!/usr/bin/env python3
"""A recording that is larger than the memory that a program gets: one line that names the file, status 2, and no report.

Usage: no_memory.py INVAR SOURCE_FOLDER
"""
import pathlib
import resource
import subprocess
import sys
import tempfile

INVAR, SOURCE = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
ROWS, LIMIT = 1_000_000, 96 << 20  # bytes: the program alone takes some 50 MB

with tempfile.TemporaryDirectory(prefix="invar-memory-") as name:
    folder = pathlib.Path(name)
    recording = folder / "long.csv"
    with open(recording, "w") as file:
        file.write("stage_x.state.at [s]," + ",".join(f"stage_x.state.{name}" for name in (
            "setpoint_position + correction [m]", "correction [m]", "position [m]", "current [A]")) + "\n")
        file.writelines(f"{i / 1000},0.1,0,0.1,0.25\n" for i in range(ROWS))
    answer = subprocess.run([INVAR, "diagnose", "--recording", recording, "--model", SOURCE / "deployment/machines/linear-axis-believed.yaml",
                             "--out", folder / "report"], capture_output=True, text=True,
                            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (LIMIT, LIMIT)))
    print(answer.returncode, answer.stderr)
    wanted = f"{recording}: needs more memory than this PC gives; name a smaller file, or part of it\n"
    if answer.returncode != 2 or answer.stderr != wanted or answer.stdout or (folder / "report").exists():
        sys.exit(f"FAILED: wanted status 2 and `{wanted}`; it printed {answer.stdout}")
print("passed")
