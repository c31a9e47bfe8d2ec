#!/usr/bin/env python3
"""How long a cell takes from `invar run` until all its components are active, and from Ctrl-C until it is gone; and two commands.

Usage: start.py INVAR SOURCE_FOLDER [RUNS]
Runs deployment/xy-table.yaml by the wall clock on a random DDS domain. When a component became active is told by the stamp of
the first status that says so (UTC), not by when this program heard of it. Of `invar --help`, and of `invar status` on the running
cell, the time by the clock and that of the CPU, which a busy host lengthens less.
"""
import json
import pathlib
import random
import re
import resource
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time

INVAR, SOURCE = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
RUNS = int(sys.argv[3]) if len(sys.argv) > 3 else 10


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def cell_in(folder):
    shutil.copytree(SOURCE / "deployment", folder / "deployment")
    file = folder / "deployment" / "xy-table.yaml"
    text = re.sub(r"^domain: \d+", f"domain: {random.SystemRandom().randrange(100, 200)}", file.read_text(), flags=re.M)
    file.write_text(text.replace("15020", str(free_port())))
    return file


def components(file):
    """Names of all components: those that stand six blanks deep below `components`."""
    return set(re.findall(r"^      (\w+):", file.read_text(), flags=re.M))


def command(folder, *words):
    """Time by the clock and of the CPU [ms]."""
    def spent():
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime
    began, before = time.monotonic(), spent()
    subprocess.run([INVAR, *words], cwd=folder, check=False, stdout=subprocess.DEVNULL)
    return 1e3 * (time.monotonic() - began), 1e3 * (spent() - before)


def run(folder, file, wanted):
    hearer = subprocess.Popen([INVAR, "echo", file, "cell/xy_table/process/components", "--json", "--wait", "60"],
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=folder)
    time.sleep(1.0)  # it takes part in the domain by then
    began = time.time_ns()
    cell = subprocess.Popen([INVAR, "run", file, "--real-time"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                            cwd=folder)
    try:
        return figures_of(folder, file, wanted, hearer, cell, began)
    finally:
        for process in hearer, cell:
            if process.poll() is None:  # what has failed leaves nobody running
                process.send_signal(signal.SIGINT)


def figures_of(folder, file, wanted, hearer, cell, began):
    active = {}
    for line in hearer.stdout:
        status = json.loads(line)["value"]
        if status["state"] == "STATE_ACTIVE":
            active.setdefault(status["component_name"], (status["at"]["time_ns"] - began) * 1e-9)
        if wanted <= active.keys():
            break
    hearer.send_signal(signal.SIGINT)
    hearer.communicate(timeout=60)
    commands = command(folder, "--help") + command(folder, "status", file)
    stopping = time.monotonic()
    cell.send_signal(signal.SIGINT)
    if cell.wait(timeout=60) != 0:
        sys.exit("the cell did not end in order")
    if not wanted <= active.keys():
        sys.exit(f"never active: {wanted - active.keys()}")
    return max(active.values()), time.monotonic() - stopping, *commands


def main():
    with tempfile.TemporaryDirectory(prefix="invar-start-") as name:
        folder = pathlib.Path(name)
        file = cell_in(folder)
        wanted = components(file)
        runs = [run(folder, file, wanted) for _ in range(RUNS)]
    print(f"{RUNS} runs of {len(wanted)} components in xy-table.yaml")
    figures = ("all active after", "s"), ("gone after", "s"), ("--help", "ms"), ("  of the CPU", "ms"), ("status", "ms"), ("  of the CPU", "ms")
    for (what, unit), times in zip(figures, zip(*runs)):
        digits = 2 if unit == "s" else 0
        print(f"{what:17} median {statistics.median(times):.{digits}f} {unit}, {min(times):.{digits}f} to {max(times):.{digits}f} {unit}")


main()
