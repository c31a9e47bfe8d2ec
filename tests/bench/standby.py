#!/usr/bin/env python3
"""How long a standby takes to go on where the process of the leader is killed (-9) at a random moment, and how large the step is.

Usage: standby.py INVAR SOURCE_FOLDER [KILLS]
The heater: its loop of 10 Hz, a standby in a process of 20 Hz; a witness between the masters and the device sees what both write.
The rival is the same cell without a standby, whose process `invar run` starts again. The axis: two loops of 1 kHz, in motion; a
recording has what both write. Each kill is of the one that leads.
"""
import pathlib
import random
import socket
import statistics
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "fault"))
from standby_cells import HEAT, HeatCell, MotionCell  # noqa: E402

INVAR, SOURCE = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
KILLS = int(sys.argv[3]) if len(sys.argv) > 3 else 20
CHANCE = random.SystemRandom()


def free_port():
    """One with the next one free, too."""
    while True:
        with socket.socket() as first, socket.socket() as second:
            first.bind(("127.0.0.1", 0))
            port = first.getsockname()[1]
            try:
                second.bind(("127.0.0.1", port + 1))
                return port
            except OSError:
                continue


class Alone(HeatCell):
    """Without the standby."""
    TEXT = "\n".join(line for line in HEAT.splitlines() if not line.startswith("  spare:")) + "\n"


def domain():
    return CHANCE.randrange(102, 199)


def heat(kind):
    taken = []
    with tempfile.TemporaryDirectory(prefix="invar-standby-") as name:
        cell = kind(INVAR, SOURCE, pathlib.Path(name), domain(), free_port())
        try:
            cell.wait("the cell", lambda: cell.status()["healthy"])
            time.sleep(5.0)
            for _ in range(KILLS):
                leader = "spare" if cell.roles().get("thermal_spare") == "took over" else "heat"
                time.sleep(CHANCE.uniform(0.0, 0.3))
                at = time.time()
                cell.kill(leader)
                cell.wait("another one to write", lambda: cell.has_taken_over(at))
                taken.append(cell.takeover(at))
                cell.wait("the cell", lambda: cell.status()["healthy"], 60)
                time.sleep(13.0)  # ends that are frequent make pauses before a start
        finally:
            cell.end()
    return taken


def motion():
    kills = []
    with tempfile.TemporaryDirectory(prefix="invar-standby-") as name:
        cell = MotionCell(INVAR, SOURCE, pathlib.Path(name), domain(), strokes=40)
        try:
            cell.wait_for_roles(stage_x="active", spare_x="standby")
            for kill in range(KILLS):
                if kill % 5 == 0:
                    cell.call("job", "cancel", cell.file, "move")
                    cell.call("job", "run", cell.file, "move", "--detach")
                leader = "spare" if cell.roles().get("spare_x") == "took over" else "servo"
                cell.wait_for_motion()
                time.sleep(CHANCE.uniform(0.0, 0.3))
                kills.append(time.time())
                cell.kill(leader)
                cell.wait("the cell", lambda: cell.status()["healthy"], 60)
                time.sleep(13.0)
        finally:
            cell.end()
        return cell.takeovers(kills)


def row(what, gaps, steps, bar):
    print(f"| {what} | {len(gaps)} | {statistics.median(gaps):.0f} | {max(gaps):.0f} | {statistics.median(steps):.2g} | {max(steps):.2g} | {bar} |", flush=True)


def main():
    print("| what | kills | gap, median [ms] | gap, longest [ms] | step, median [% of range] | step, largest [% of range] | target |\n"
          "| --- | --- | --- | --- | --- | --- | --- |")
    beside = heat(HeatCell)
    row("heater, loop of 10 Hz, standby of 20 Hz", [1e3 * gap for gap, _ in beside], [step for _, step in beside], "200 ms, 1 %")
    alone = heat(Alone)
    row("heater, process started again (no standby)", [1e3 * gap for gap, _ in alone], [step for _, step in alone], "-")
    axis = motion()
    row("axis at 50 mm/s, loops of 1 kHz", [gap for gap, _, _, _ in axis], [10.0 * step for _, step, _, _ in axis], "20 ms")
    print(f"\nFollowing error of the axis in the 50 ms after: median {1e6 * statistics.median(error for _, _, error, _ in axis):.0f} um, "
          f"largest {1e6 * max(error for _, _, error, _ in axis):.0f} um.")


main()
