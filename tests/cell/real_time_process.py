#!/usr/bin/env python3
"""What a real-time process holds in memory while the cell of the XY table runs by the wall clock, as /proc says.

Usage: real_time_process.py INVAR SOURCE_FOLDER DOMAIN PORT
"""
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
from cell_processes import children  # noqa: E402

INVAR, SOURCE, DOMAIN, PORT = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]), sys.argv[3], sys.argv[4]

MOST_MEMORY = 64 * 1024  # kB, resident, and locked
MOST_LIBRARIES = 45
MOST_THREADS = 30  # eight a participant of the middleware, of which there are two; the loop, its senders, loaders, services
HEAVY = ("opencv", "gdal", "jpeg", "png", "tiff", "avcodec", "ceres", "blas", "lapack", "mysql", "mariadb", "pq.so")
SETTLE = 5.0  # s until its components are active and its peers are known
LOOK = 5.0  # s without a page fault


def status_of(pid):
    text = pathlib.Path(f"/proc/{pid}/status").read_text()
    return {key: int(value) for key, value in re.findall(r"^(\w+):\s+(\d+)", text, flags=re.M)}


def libraries_of(pid):
    maps = pathlib.Path(f"/proc/{pid}/maps").read_text()
    return sorted(set(re.findall(r"(/\S+\.so\S*)", maps)))


def loop_of(pid, name):
    for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
        if (task / "comm").read_text().strip() == name:
            return task
    return None


def wait_for(look, what):
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        found = look()
        if found is not None:
            return found
        time.sleep(0.05)
    return sys.exit(f"FAILED: {what} does not come up")


def faults_of(task):
    words = (task / "stat").read_text().rsplit(")", 1)[1].split()
    return int(words[7]), int(words[9])  # minor, major


def fail(text):
    sys.exit(f"FAILED: {text}")


def look_at_motion(pid, task):
    before = faults_of(task)
    time.sleep(LOOK)
    after = faults_of(task)
    status, libraries = status_of(pid), libraries_of(pid)
    print(f"motion: {status['VmRSS']} kB resident, {status['VmLck']} kB locked, {status['VmSize']} kB of addresses, "
          f"{status['Threads']} threads, {len(libraries)} libraries; page faults of the loop in {LOOK} s: "
          f"{after[0] - before[0]} minor, {after[1] - before[1]} major")
    for key in ("VmRSS", "VmLck"):
        if status[key] > MOST_MEMORY:
            fail(f"{key} {status[key]} kB is above {MOST_MEMORY} kB")
    if os.geteuid() == 0 and status["VmLck"] < 8 * 1024:
        fail("the program and its heap are not locked")
    if len(libraries) > MOST_LIBRARIES:
        fail(f"{len(libraries)} libraries: {libraries}")
    heavy = [library for library in libraries if any(word in library for word in HEAVY)]
    if heavy:
        fail(f"libraries that the loop does not need: {heavy}")
    if status["Threads"] > MOST_THREADS:
        fail(f"{status['Threads']} threads")
    if after != before and os.geteuid() == 0:
        fail("the loop had page faults")


def main():
    linked = subprocess.run(["ldd", INVAR], capture_output=True, text=True, check=True).stdout.splitlines()
    print(f"the program names {len(linked)} libraries")
    if len(linked) > MOST_LIBRARIES:
        fail("the program names too many libraries")
    with tempfile.TemporaryDirectory(prefix="invar-lean-") as name:
        folder = pathlib.Path(name)
        shutil.copytree(SOURCE / "deployment", folder / "deployment")
        file = folder / "deployment" / "xy-table.yaml"
        text = re.sub(r"^domain: \d+", f"domain: {DOMAIN}", file.read_text(), flags=re.M)
        # By the usual scheduling: what a process holds is the same, and other tests get to run.
        text = text.replace("priority: 80, ", "").replace("15020", PORT)
        file.write_text(text)
        cell = subprocess.Popen([INVAR, "run", file, "--real-time", "--quiet"], cwd=folder)
        try:
            pid = wait_for(lambda: children(cell.pid).get("motion"), "its process")
            task = wait_for(lambda: loop_of(pid, "motion"), "its loop")
            time.sleep(SETTLE)
            look_at_motion(pid, task)
        finally:
            cell.send_signal(signal.SIGINT)
            try:
                cell.wait(timeout=60)
            except subprocess.TimeoutExpired:
                cell.kill()
    print("passed")


main()
