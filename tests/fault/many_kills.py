#!/usr/bin/env python3
"""Random processes of a running cell are killed (-9), mostly in a job: each comes back, all components are active again, and
nothing unsafe happens meanwhile: no axis leaves its travel or is faster than a move may be, and the slide stays below its limit.

Usage: many_kills.py INVAR SOURCE_FOLDER DOMAIN PORT [SEED]; INVAR_KILLS: how many, 6 without
"""
import csv
import json
import math
import os
import pathlib
import random
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
KILLS = int(os.environ.get("INVAR_KILLS", "6"))
SEED = int(sys.argv[5]) if len(sys.argv) > 5 else random.SystemRandom().randrange(1 << 31)

PATIENCE = 90.0  # s until a killed process must be back, on a busy PC too: a pause is up to 30 s
TRAVEL, MARGIN = (0.0, 0.2), 1e-3  # m
FASTEST = 0.25  # m/s: the default velocity of an axis and the servo's overshoot
HOTTEST = 45.0  # degC: of a slide that is held at 30

SHORT = (SOURCE / "tests" / "support" / "short_job.yaml").read_text()


def fail(text):
    sys.exit(f"FAILED (seed {SEED}): {text}")


class Cell:
    def __init__(self, folder):
        shutil.copytree(SOURCE / "deployment", folder / "deployment")
        self.folder, self.file = folder, folder / "deployment" / "xy-table.yaml"
        text = re.sub(r"(?m)^domain: .*", f"domain: {DOMAIN}", self.file.read_text()).replace("15020", PORT)
        text = text.replace("        jobs:\n", "        settle_timeout: 60\n        jobs:\n" + SHORT, 1)
        # A calibration that is gone holds the compensation no longer than needed here.
        text = text.replace("type: compensation\n", "type: compensation\n        transaction_timeout: 5\n")
        # What a supervisor that gave up took down would stay so.
        text = text.replace("type: supervisor", "type: supervisor\n        timeout: 30")
        text = text.replace("jobs: {", "jobs: {short: calibration, ")
        self.file.write_text(text)
        self.log = open(folder / "log", "w")
        self.run = subprocess.Popen([INVAR, "run", self.file, "--real-time"], cwd=folder, stdout=self.log, stderr=self.log)

    def children(self):
        """Process name in the cell -> process id."""
        return children(self.run.pid)

    def call(self, *words):
        return subprocess.run([INVAR, *words], cwd=self.folder, capture_output=True, text=True)

    def pause(self, name):
        """Seconds that `invar run` said it waits before it starts this process again."""
        said = re.findall(f"process `{name}` ended with .*; starting it again(?: in ([0-9]+) s)?", (self.folder / "log").read_text())
        return float(said[-1] or 0) if said else 0.0

    def is_well(self):
        """Whether all components are active, in the processes that live now."""
        answer = self.call("status", self.file, "--json", "--wait", "5")
        try:
            status = json.loads(answer.stdout)
        except ValueError:
            return False
        return ([c["state"] for c in status["components"]] == ["active"] * 10 and
                {p["pid"] for p in status["processes"]} == set(self.children().values()))

    def wait(self, what, condition):
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            if condition():
                return
            time.sleep(0.02)
        print((self.folder / "log").read_text())
        fail(f"waited in vain for {what}")


def rows(folder, words):
    files = [name for name in folder.glob("*.csv") if words in name.name]
    if not files:
        fail(f"nothing recorded of {words}")
    with open(files[0]) as file:
        yield from csv.DictReader(file)


def column(row, begin):
    """The number, or NaN where there was none: as of a thermistor that was not read yet."""
    return float(next(value for name, value in row.items() if name.startswith(begin)) or "nan")


def look_at_safety(cell, recording):
    answer = cell.call("export", recording, "--out", "tables")
    if answer.returncode != 0:
        fail(answer.stderr)
    tables, seen = cell.folder / "tables", []
    for axis in "xy":
        fastest, low, high, count = 0.0, 1.0, -1.0, 0
        for row in rows(tables, f"stage_{axis}.state"):
            fastest = max(fastest, abs(column(row, "velocity")))
            low, high = min(low, column(row, "position")), max(high, column(row, "position"))
            count += 1
        seen.append(f"{axis} {low * 1e3:.1f} to {high * 1e3:.1f} mm, at most {fastest * 1e3:.0f} mm/s ({count} samples)")
        if fastest < 0.01:
            fail("the axis never moved: " + seen[-1])
        if fastest > FASTEST or low < TRAVEL[0] - MARGIN or high > TRAVEL[1] + MARGIN:
            fail(f"unsafe motion: {seen[-1]}")
    hottest = max((t for t in (column(row, "temperature") for row in rows(tables, "thermal.state")) if not math.isnan(t)),
                  default=math.nan)
    seen.append(f"slide at most {hottest:.1f} degC")
    if not hottest < HOTTEST:
        fail(seen[-1])
    print("; ".join(seen))


def main():
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    with tempfile.TemporaryDirectory(prefix="invar-kills-") as name:
        cell = Cell(pathlib.Path(name))
        witness = None
        try:
            cell.wait("the cell", cell.is_well)
            witness = subprocess.Popen([INVAR, "record", cell.file, "--out", "witness.mcap", "--topic", "stage_x.state", "--topic",
                                        "stage_y.state", "--topic", "thermal.state"], cwd=cell.folder, stdout=cell.log, stderr=cell.log)
            took, pauses = {}, []
            for kill in range(KILLS):
                if kill % 2 == 0:
                    cell.call("job", "run", cell.file, "short", "--detach", "--wait", "20")
                    time.sleep(chance.uniform(0.0, 1.5))
                victim = chance.choice(sorted(cell.children()))
                pid = cell.children()[victim]
                os.kill(pid, signal.SIGKILL)
                begin = time.monotonic()
                cell.wait(f"another {victim}", lambda: cell.children().get(victim, pid) != pid)
                cell.wait(f"an active {victim} (kill {kill + 1})", cell.is_well)
                pauses.append(cell.pause(victim))
                took.setdefault(victim, []).append(time.monotonic() - begin - pauses[-1])
            for victim, times in sorted(took.items()):
                print(f"{victim}: killed {len(times)} times, all active again after {sorted(times)[len(times) // 2]:.2f} s "
                      f"at the median, {max(times):.2f} s at most")
            print(f"{KILLS} kills; the pauses before a start, which are left out above, were {max(pauses):.0f} s at most")
            begin = time.monotonic()
            cell.wait("a job that runs to its end", lambda: cell.call("job", "run", cell.file, "short", "--wait", "20").returncode == 0)
            print(f"a job has run to its end {time.monotonic() - begin:.1f} s after the last return")
            witness.send_signal(signal.SIGINT)
            witness.wait(timeout=60)
            look_at_safety(cell, "witness.mcap")
            cell.run.send_signal(signal.SIGINT)
            if cell.run.wait(timeout=60) != 0:
                print((cell.folder / "log").read_text()[-4000:])
                fail("the cell did not end in order")
        finally:
            for process in (witness, cell.run):
                if process is not None and process.poll() is None:
                    process.send_signal(signal.SIGTERM)
                    process.wait(timeout=60)
    print("passed")


main()
