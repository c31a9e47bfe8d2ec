#!/usr/bin/env python3
"""How long a standby takes to go on where the process of the leader is killed (-9) at a random moment, or started anew with another
certificate, and how large the step is.

Usage: standby.py INVAR SOURCE_FOLDER [TIMES]    (root: two PCs are network namespaces)
The heater: its loop of 10 Hz, a standby in a process of 20 Hz; a witness between the masters and the device sees what both write.
The rival is the same cell without a standby, whose process `invar run` starts again. The axis: two loops of 1 kHz, in motion; a
recording has what both write. It is always the one that leads.
"""
import pathlib
import random
import socket
import statistics
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "fault"))
from standby_cells import HEAT, SECURITY, Cell, HeatCell, MotionCell, MotionOnTwoPcs  # noqa: E402

INVAR, SOURCE = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
TIMES = int(sys.argv[3]) if len(sys.argv) > 3 else 20
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


def come_back(cell, how):
    cell.wait("the cell", lambda: cell.status()["healthy"], 60)
    time.sleep(13.0 if how is Cell.kill else 3.0)  # ends that are frequent make pauses before a start


def heat(kind, how=Cell.kill, head=""):
    taken = []
    with tempfile.TemporaryDirectory(prefix="invar-standby-") as name:
        cell = kind(INVAR, SOURCE, pathlib.Path(name), domain(), free_port(), head)
        try:
            cell.wait("the cell", lambda: cell.status()["healthy"])
            time.sleep(5.0)
            for _ in range(TIMES):
                leader = "spare" if cell.roles().get("thermal_spare") == "took over" else "heat"
                time.sleep(CHANCE.uniform(0.0, 0.3))
                at = time.time()
                how(cell, leader)
                cell.wait("another one to write", lambda: cell.has_taken_over(at))
                taken.append(cell.takeover(at))
                come_back(cell, how)
        finally:
            cell.end()
    return [(1e3 * gap, step) for gap, step in taken]


def motion(kind=MotionCell, how=Cell.kill, head=""):
    ends = []
    with tempfile.TemporaryDirectory(prefix="invar-standby-") as name:
        cell = kind(INVAR, SOURCE, pathlib.Path(name), domain(), strokes=40, head=head)
        try:
            cell.wait_for_roles(stage_x="active", spare_x="standby")
            for number in range(TIMES):
                if number % 5 == 0:
                    cell.call("job", "cancel", cell.file, "move")
                    cell.call("job", "run", cell.file, "move", "--detach")
                leader = "spare" if cell.roles().get("spare_x") == "took over" else "servo"
                cell.wait_for_motion()
                time.sleep(CHANCE.uniform(0.0, 0.3))
                ends.append(time.time())
                how(cell, leader)
                come_back(cell, how)
        finally:
            cell.end()
        return [(gap, 10.0 * step, 1e6 * error) for gap, step, error, _ in cell.takeovers(ends, 4.0 if how is Cell.renew else 0.3)]


def row(what, taken, target):
    gaps, steps = [gap for gap, *_ in taken], [step for _, step, *_ in taken]
    errors = [more[0] for _, _, *more in taken if more]
    print(f"| {what} | {len(taken)} | {statistics.median(gaps):.0f} | {max(gaps):.0f} | {statistics.median(steps):.2g} | {max(steps):.2g} | "
          f"{f'{max(errors):.0f}' if errors else '-'} | {target} |", flush=True)


def main():
    print("| what | times | gap, median [ms] | gap, longest [ms] | step, median [% of range] | step, largest [% of range] | "
          "following error, largest [um] | target |\n| --- | --- | --- | --- | --- | --- | --- | --- |")
    row("heater: killed", heat(HeatCell), "200 ms, 1 %")
    row("heater: killed, secured cell", heat(HeatCell, head=SECURITY), "200 ms, 1 %")
    row("heater: certificate renewed", heat(HeatCell, Cell.renew, SECURITY), "2 periods")
    row("heater: killed, no standby (started again)", heat(Alone), "-")
    row("axis: killed", motion(), "20 ms")
    row("axis: killed, secured cell", motion(head=SECURITY), "20 ms")
    row("axis: certificate renewed", motion(how=Cell.renew, head=SECURITY), "2 periods")
    row("axis: killed, standby on another PC", motion(MotionOnTwoPcs), "20 ms")


main()
