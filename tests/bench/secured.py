#!/usr/bin/env python3
"""The cost of a secured cell beside the same cell unsecured, in turns: latency of a sample over UDP, the loop of an axis in motion,
and how long secured participants take to find one another.

Usage: secured.py INVAR SOURCE_FOLDER BENCH_SECURED [TURNS [DISCOVERIES]]    (root)
"""
import pathlib
import random
import re
import statistics
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "fault"))
from standby_cells import SECURITY, MotionCell  # noqa: E402

INVAR, SOURCE, BENCH = (pathlib.Path(word).resolve() for word in sys.argv[1:4])
TURNS, DISCOVERIES = (int(word) for word in (sys.argv[4:6] + ["7", "100"][len(sys.argv[4:6]):]))
CHANCE = random.SystemRandom()


def bench(folder, *words):
    """Its output in a network of its own; without a result where some never found one another."""
    done = subprocess.run(["unshare", "--net", "bash", "-c", 'ip link set lo up multicast on; exec "$0" "$@"', BENCH, *map(str, words)],
                          cwd=folder, capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else ""


def make_keys(folder):
    processes = "".join(f"  p{n}: {{rate: 10, components: {{s{n}: {{type: supervisor}}}}}}\n" for n in range(20))
    (folder / "profiles.yaml").write_text((SOURCE / "deployment/profiles.yaml").read_text())
    (folder / "cell.yaml").write_text(f"invar_cell: 1\nname: bench\ndomain: 88\nprofiles: profiles.yaml\nprocesses:\n{processes}")
    subprocess.run([INVAR, "keys", "cell.yaml"], cwd=folder, check=True, stdout=subprocess.DEVNULL)


def in_turns(measure):
    """Values of the open and of the secured one, whose order alternates."""
    values = {False: [], True: []}
    for turn in range(TURNS):
        for secured in (turn % 2 == 1, turn % 2 == 0):
            values[secured].append(measure(secured))
    return values[False], values[True]


def compare(what, opened, secured, target):
    ratios = [b / a for a, b in zip(opened, secured)]
    print(f"| {what} | {statistics.median(opened):.1f} | {statistics.median(secured):.1f} | {statistics.median(ratios):.2f} "
          f"({min(ratios):.2f} .. {max(ratios):.2f}) | {target} |", flush=True)


def latency(folder):
    def once(secured):
        text = bench(folder, "latency", "keys" if secured else "-", 5000)
        return [float(re.search(rf"{name} ([0-9.e+]+) us", text)[1]) for name in ("p50", "p99")]
    opened, secured = in_turns(once)
    for i, (name, target) in enumerate((("p50", "3.5"), ("p99", "-"))):
        compare(f"write to callback over UDP, {name} [us]", [one[i] for one in opened], [one[i] for one in secured], target)


def loop(secured):
    """Of the servo, in motion for some seconds: compute and wake-up [us]."""
    with tempfile.TemporaryDirectory(prefix="invar-secured-") as name:
        cell = MotionCell(INVAR, SOURCE, pathlib.Path(name), CHANCE.randrange(102, 199), head=SECURITY if secured else "")
        try:
            cell.wait_for_roles(stage_x="active", spare_x="standby")
            cell.call("job", "run", cell.file, "move", "--detach")
            cell.wait_for_motion()
            time.sleep(12.0)
            servo = next(p for p in cell.status()["processes"] if p["name"] == "servo")["recent"]
            return [1e-3 * servo[what][p] for what, p in (("compute", "p50_ns"), ("compute", "p99_ns"), ("wake_up", "p50_ns"), ("wake_up", "p99_ns"))]
        finally:
            cell.end()


def discovery(folder, participants, target):
    times, complete = [], 0
    for _ in range(DISCOVERIES):
        text = bench(folder, "discovery", "keys", participants)
        complete += bool(text)
        times += [max(float(seconds) for seconds in re.findall(r"in ([0-9.]+) s", text))] if text else []
    print(f"| {participants} | {complete} of {DISCOVERIES} | {statistics.median(times):.2f} | {max(times):.2f} | {target} |", flush=True)


def main():
    with tempfile.TemporaryDirectory(prefix="invar-secured-") as name:
        folder = pathlib.Path(name)
        make_keys(folder)
        print("| quantity | open | secured | secured over open (range) | target |\n| --- | --- | --- | --- | --- |")
        latency(folder)
        opened, secured = in_turns(loop)
        for i, what in enumerate(("compute, p50", "compute, p99", "wake-up, p50", "wake-up, p99")):
            compare(f"loop of an axis at 1 kHz: {what} [us]", [one[i] for one in opened], [one[i] for one in secured], "unchanged")
        print("\n| secured participants | each found each | median [s] | longest [s] | target [s] |\n| --- | --- | --- | --- | --- |")
        discovery(folder, 10, 2)
        discovery(folder, 20, 5)


main()
