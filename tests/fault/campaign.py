#!/usr/bin/env python3
"""A cell on three PCs (network namespaces) is broken again and again at random moments: one of its processes is killed (-9), or
the cable of one PC is cut. After each: all that the file wants is active again by itself, or `status` ends with 1 and names the
command. At the end a job runs, and recordings say whether anything unsafe happened, and whether a notice of a kill was lost.

Usage: campaign.py INVAR SOURCE_FOLDER [--kills N] [--cuts N] [--seconds 0.5,3,10,60] [--seed S]
"""
import argparse
import collections
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
from three_hosts import Hosts  # noqa: E402

PATIENCE = 120.0  # s: pauses before a start are up to 30 s, and this PC is busy
TRAVEL, MARGIN = (0.0, 0.2), 1e-3  # m
FASTEST, AT_REST = 0.06, 0.01  # m/s: what the file allows and the servo's overshoot; of an axis that nobody moves
SHOWN = ("time", "cycle", "mode", "position", "velocity", "setpoint")  # columns that tell how it came to move so
HOTTEST = 45.0  # degC: of a slide that is held at 30

CELL = """invar_cell: 1
name: campaign
domain: 15
profiles: profiles.yaml
hosts: {stage-pc: {address: 10.81.0.11}, heat-pc: {address: 10.81.0.12}, office-pc: {address: 10.81.0.13}}
# The room is near the setpoint: a heater that begins anew must not seem to have a thermistor that leaps.
processes:
  motion:
    host: stage-pc
    realtime: {rate: 1000, priority: 60}
    components:
      world: {type: simulated_stage, machine: machine.yaml, connect: {motor_x: stage_x.motor}, x: {start: 0.1}}
      stage_x:
        type: stage
        travel: [0, 0.2]
        following_error: 0.05
        feedback_timeout: 0.1
        limits: {velocity: 0.05, acceleration: 0.5, jerk: 50}
        control: {kp: 400, ki: 0, kd: 40, velocity_filter: 50, feedforward_velocity: 1.5, feedforward_acceleration: 0.2667}
        connect: {feedback: world.feedback_x}
  device:
    host: heat-pc
    rate: 20
    components: {heater: {type: simulated_heater, map: heater.yaml, host: 10.81.0.12, port: 1502, ambient: 27}}
  heat:
    host: heat-pc
    rate: 10
    components:
      thermal:
        type: thermal
        modbus: {host: 10.81.0.12, port: 1502, map: heater.yaml, several_masters: true}
        setpoint: 30
        power_limit: 100
  spare: {host: office-pc, rate: 20, components: {thermal_spare: {standby: {of: thermal}}}}
  trials:
    host: stage-pc
    rate: 100
    components:
      trial:
        type: axis_trial
        axis: 0
        motion: [{name: move, from: 0.18, to: 0.02, velocities: [0.05, 0.05]}]
        connect: {state: stage_x.state, command: stage_x.command}
  recorder: {host: office-pc, rate: 20, components: {recorder: {type: recorder, out: out}}}
  supervisor: {host: office-pc, rate: 10, components: {supervisor: {type: supervisor}}}
jobs: {move: trial}
"""


def fail(text):
    raise SystemExit(f"FAILED: {text}")


class Campaign:
    def __init__(self, given, folder):
        self.invar, self.folder, self.chance = given.invar.resolve(), folder, random.Random(given.seed)
        self.file = folder / "cell.yaml"
        self.file.write_text(CELL)
        for name in ("deployment/profiles.yaml", "deployment/maps/heater.yaml"):
            shutil.copy(given.source / name, folder)
        shutil.copy(given.source / "deployment/machines/xy-table-nominal.yaml", folder / "machine.yaml")
        self.hosts = Hosts(("stage-pc", "heat-pc", "office-pc"))
        self.runs, self.kills, self.took = {}, collections.Counter(), collections.defaultdict(list)
        self.by_hand, self.jobs = [], 0

    def start(self):
        for name in self.hosts.names:
            folder = self.folder / name
            folder.mkdir()
            log = open(folder / "log", "w")
            self.runs[name] = self.hosts.start(name, self.invar, "run", self.file, "--host", name, cwd=folder, stdout=log, stderr=log)
        self.wait("the cell", self.is_well)
        self.witness = self.hosts.start("stage-pc", self.invar, "record", self.file, "--out", self.folder / "witness.mcap", "--topic",
                                        "stage_x.state", "--topic", "thermal.state", cwd=self.folder,
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(1.0)

    def pids(self):
        found = {}
        for run in self.runs.values():
            found.update(children(run.pid))
        return found

    def call(self, host, *words):
        return subprocess.run(self.hosts.words(host, self.invar, *words), cwd=self.folder, capture_output=True, text=True)

    def status(self, host):
        answer = self.call(host, "status", self.file, "--json", "--wait", "1")
        try:
            return json.loads(answer.stdout)
        except ValueError:
            return {"healthy": False, "faults": ["no status"], "processes": [], "components": []}

    def is_well(self, host="office-pc"):
        """Healthy, and by the processes that live now; a status that names a command has it carried out, once."""
        status = self.status(host)
        for fault in status["faults"]:
            if command := re.search(r"`invar lifecycle CELL (\w+) (\w+)`", fault):
                self.told[command.groups()] = self.told.get(command.groups(), time.monotonic())
                if time.monotonic() - self.told[command.groups()] > 5.0:  # it does not come by itself
                    self.by_hand.append(fault)
                    self.call(host, "lifecycle", self.file, *command.groups())
                    del self.told[command.groups()]
        return status["healthy"] and {p["pid"] for p in status["processes"]} == set(self.pids().values())

    def wait(self, what, condition):
        self.told, end = {}, time.monotonic() + PATIENCE
        while time.monotonic() < end:
            if condition():
                return
            time.sleep(0.05)
        for name in self.hosts.names:
            print(f"--- {name}\n" + (self.folder / name / "log").read_text()[-3000:])
        fail(f"waited in vain for {what}: {self.status('office-pc')['faults']}")

    def set_in_motion(self):
        self.call("stage-pc", "job", "run", self.file, "move", "--detach", "--wait", "5")
        self.jobs += 1
        time.sleep(self.chance.uniform(0.0, 2.0))

    def work(self):
        """After all of it the cell does what it is for."""
        self.wait("the whole cell", self.is_well)
        for _ in range(12):  # one that was set in motion before may still run
            answer = self.call("stage-pc", "job", "run", self.file, "move", "--wait", "10")
            if answer.returncode == 0:
                return
            time.sleep(5.0)
        fail(f"the job does not run any more: {answer.stdout}{answer.stderr}")

    def kill(self):
        name, pid = self.chance.choice(sorted(self.pids().items()))
        os.kill(pid, signal.SIGKILL)
        self.kills[name] += 1
        begin = time.monotonic()
        self.wait(f"another {name}", lambda: self.pids().get(name, pid) != pid)
        self.wait(f"all active after a kill of {name}", self.is_well)
        self.took[f"kill of {name}"].append(time.monotonic() - begin)

    def cut(self, seconds):
        host = self.chance.choice(self.hosts.names)
        self.hosts.cut(host)
        time.sleep(seconds)
        self.hosts.mend(host)
        begin = time.monotonic()
        self.wait(f"all active after a cut of {host} for {seconds} s", self.is_well)
        self.took[f"cut of {seconds:g} s"].append(time.monotonic() - begin)

    def stop(self):
        self.witness.send_signal(signal.SIGINT)
        self.witness.wait(timeout=60)
        for run in self.runs.values():
            run.send_signal(signal.SIGINT)
        for run in self.runs.values():
            run.wait(timeout=60)

    def table(self, recording, words):
        out = self.folder / ("tables-" + recording.stem)
        if not out.exists():
            self.call("office-pc", "export", recording, "--out", out)
        return [row for file in out.glob("*.csv") if words in file.name for row in csv.DictReader(open(file))]

    def look_at_safety(self):
        rows = self.table(self.folder / "witness.mcap", "stage_x.state")
        places = [column(row, "position") for row in rows]
        speeds = [abs(column(row, "velocity")) for row in rows]
        unordered = [speed for row, speed in zip(rows, speeds)
                     if row["mode"].removeprefix("AXIS_MODE_") in ("DISABLED", "HOLDING", "FAULT")]
        heat = [column(row, "temperature") for row in self.table(self.folder / "witness.mcap", "thermal.state")]
        hottest = max(t for t in heat if not math.isnan(t))
        print(f"axis from {min(places) * 1e3:.1f} to {max(places) * 1e3:.1f} mm, at most {max(speeds) * 1e3:.0f} mm/s, while nobody moved it "
              f"{max(unordered) * 1e3:.1f} mm/s ({len(rows)} samples); slide at most {hottest:.1f} degC ({len(heat)} samples)")
        if max(speeds) < 0.04:
            fail("the axis never moved")
        if min(places) < TRAVEL[0] - MARGIN or max(places) > TRAVEL[1] + MARGIN or max(speeds) > FASTEST or max(unordered) > AT_REST:
            fastest = speeds.index(max(speeds))
            for row in rows[max(0, fastest - 300):fastest + 100:10]:
                print(*(f"{name}={value[:20]}" for name, value in row.items() if name.startswith(SHOWN)))
            fail("unsafe motion; the samples about the fastest one stand above")
        if not hottest < HOTTEST:
            fail("the slide is too hot")

    def look_at_records(self):
        """Each end of a process is a notice, which is reliable and kept for those who come later."""
        told, recordings = collections.Counter(), sorted((self.folder / "office-pc" / "out").glob("*.mcap"))
        seen = set()
        for recording in recordings:
            info = self.call("office-pc", "recording", "info", recording)
            if info.returncode not in (0, 1):
                fail(f"{recording.name} is not readable: {info.stderr}")
            for row in self.table(recording, "notices"):
                if end := re.match(r"ended with .*\(restart ([0-9]+)\)", row["text"]):
                    seen.add((row["source"], int(end[1])))
        told.update(source for source, _ in seen)
        print(f"{len(recordings)} recordings, all readable; notices of {sum(told.values())} ends for {sum(self.kills.values())} kills")
        missing = {name: count - told[name] for name, count in self.kills.items() if told[name] < count}
        if missing:
            fail(f"notices of kills that no recording has: {missing}")

    def tell(self):
        print("| what | times | all active again, median [s] | longest [s] |\n| --- | --- | --- | --- |")
        by_size = lambda what: re.sub(r"[0-9.]+", lambda number: f"{float(number[0]):06.1f}", what)
        for what, times in sorted(self.took.items(), key=lambda item: by_size(item[0])):
            print(f"| {what} | {len(times)} | {sorted(times)[len(times) // 2]:.2f} | {max(times):.2f} |")
        print(f"\n{self.jobs} jobs; by hand, as the status said: {len(self.by_hand)}", *self.by_hand, sep="\n  ")

    def run(self, order):
        self.start()
        self.chance.shuffle(order)
        for number, what in enumerate(order):
            if number % 2 == 0:
                self.set_in_motion()
            self.kill() if what == "kill" else self.cut(what)
            if number % 20 == 19:
                print(f"{number + 1} of {len(order)}", flush=True)
        self.work()
        self.tell()
        self.stop()
        self.look_at_safety()
        self.look_at_records()

    def end(self):
        for run in (*self.runs.values(), getattr(self, "witness", None)):
            if run is not None and run.poll() is None:
                run.send_signal(signal.SIGTERM)
                try:
                    run.wait(timeout=30)
                except subprocess.TimeoutExpired:
                    run.kill()
        self.hosts.end()


def column(row, begin):
    return float(next(value for name, value in row.items() if name.startswith(begin)) or "nan")


def main():
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("invar", type=pathlib.Path)
    ask.add_argument("source", type=pathlib.Path)
    ask.add_argument("--kills", type=int, default=100)
    ask.add_argument("--cuts", type=int, default=60)
    ask.add_argument("--seconds", type=lambda text: [float(word) for word in text.split(",")], default=[0.5, 3.0, 10.0, 60.0])
    ask.add_argument("--seed", type=int, default=random.SystemRandom().randrange(1 << 31))
    given = ask.parse_args()
    if os.geteuid() != 0:
        os.execvp("unshare", ["unshare", "--map-root-user", "--net", "--mount", "bash", "-c",
                              'mount -t tmpfs tmpfs /run && exec "$0" "$@"', sys.executable, *sys.argv])
    print(f"seed {given.seed}", flush=True)
    order = ["kill"] * given.kills + [given.seconds[i % len(given.seconds)] for i in range(given.cuts)]
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # its hosts and processes end with it
    folder = pathlib.Path(tempfile.mkdtemp(prefix="invar-campaign-"))
    campaign = Campaign(given, folder)
    try:
        campaign.run(order)
    except BaseException:
        print(f"logs and recordings stay in {folder}")
        raise
    finally:
        campaign.end()
    shutil.rmtree(folder)
    print("passed")


main()
