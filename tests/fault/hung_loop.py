#!/usr/bin/env python3
"""The loop of a process is held in a step (ptrace), all its other threads live: the status is not well and says why, a standby goes
on in its place, and all is well when the loop goes on.

Usage: hung_loop.py INVAR SOURCE_FOLDER DOMAIN PORT
"""
import ctypes
import os
import pathlib
import sys
import tempfile

from standby_cells import HeatCell

PTRACE_SEIZE, PTRACE_INTERRUPT, PTRACE_DETACH = 0x4206, 0x4207, 17
INVAR, SOURCE, DOMAIN, PORT = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]), sys.argv[3], int(sys.argv[4])
TRACE = ctypes.CDLL(None, use_errno=True).ptrace
TRACE.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]


def trace(request, thread):
    if TRACE(request, thread, None, None) != 0:
        sys.exit(f"FAILED: ptrace: {os.strerror(ctypes.get_errno())}")


def main():
    with tempfile.TemporaryDirectory(prefix="invar-hung-") as name:
        cell = HeatCell(INVAR, SOURCE, pathlib.Path(name), DOMAIN, PORT)
        try:
            cell.wait_for_roles(thermal="active", thermal_spare="standby")
            tasks = pathlib.Path(f"/proc/{cell.pids()['heat']}/task").iterdir()
            (loop,) = [int(task.name) for task in tasks if (task / "comm").read_text().strip() == "heat"]
            trace(PTRACE_SEIZE, loop)
            trace(PTRACE_INTERRUPT, loop)
            cell.wait("a status that says so", lambda: any(
                fault.startswith("thermal: its loop makes no cycle any more") for fault in cell.status()["faults"]), 20)
            cell.wait("the standby to take over", lambda: cell.roles().get("thermal_spare") == "took over", 20)
            if not cell.powers()[-1][2] > 0.0:
                sys.exit("FAILED: the heater is off under the standby")
            os.waitpid(loop, 0x40000000)  # __WALL: it has stopped by now
            trace(PTRACE_DETACH, loop)
            cell.wait_for_roles(thermal="standby", thermal_spare="took over")
        finally:
            cell.end()
    print("passed")


main()
