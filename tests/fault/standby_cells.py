"""Cells with a component that stands by: a heater's loop, and an axis in motion. For the test and for the benchmark."""
import csv
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

from modbus_witness import Witness

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
from cell_processes import children  # noqa: E402
from three_hosts import Hosts  # noqa: E402

SECURITY = "security: {{keys: keys, operators: [anna]}}\n"

HEAT = """invar_cell: 1
name: standby
domain: {domain}
profiles: profiles.yaml
hosts: {{pc: {{address: 127.0.0.1}}}}
processes:
  device: {{rate: 50, components: {{heater: {{type: simulated_heater, map: heater.yaml, port: {device}, noise: 0}}}}}}
  heat:
    rate: 10
    components:
      thermal:
        type: thermal
        modbus: {{port: {port}, map: heater.yaml, several_masters: true}}
        setpoint: 27
        power_limit: 100
        pid: {{kp: 10, ki: 2}}
  spare: {{rate: 20, components: {{thermal_spare: {{standby: {{of: thermal}}}}}}}}
  recorder: {{rate: 20, components: {{recorder: {{type: recorder}}}}}}
"""

MOTION = """invar_cell: 1
name: standby
domain: {domain}
profiles: profiles.yaml
hosts: {hosts}
processes:
  plant:
    host: {axis}
    realtime: {{rate: 1000, priority: 70}}
    components:
      world: {{type: simulated_stage, machine: machine.yaml, watchdog: 0.05, connect: {{motor_x: stage_x.motor}}}}
  servo:
    host: {axis}
    realtime: {{rate: 1000, priority: 60}}
    components:
      stage_x:
        type: stage
        travel: [0, 0.2]
        feedback_timeout: 0.1
        following_error: 0.01
        limits: {{velocity: 0.05, acceleration: 0.5, jerk: 50}}
        control: {{kp: 2500, ki: 1.2e4, kd: 75, velocity_filter: 80, limit: 10, feedforward_velocity: 1.5, feedforward_acceleration: 0.2667}}
        connect: {{feedback: world.feedback_x}}
  spare: {{host: {other}, realtime: {{rate: 1000, priority: 60}}, components: {{spare_x: {{standby: {{of: stage_x}}}}}}}}
  trials:
    host: {axis}
    rate: 100
    components:
      trial:
        type: axis_trial
        axis: 0
        motion: [{{name: move, from: 0.18, to: 0.02, velocities: [{strokes}]}}]
        connect: {{state: stage_x.state, command: stage_x.command}}
  recorder: {{host: {axis}, rate: 50, components: {{recorder: {{type: recorder}}}}}}
jobs: {{move: trial}}
"""


class Cell:
    """A running cell; with a recording where it has a recorder."""

    def __init__(self, invar, source, folder, text):
        self.invar, self.folder, self.file = invar, folder, folder / "cell.yaml"
        for name in ("deployment/profiles.yaml", "deployment/maps/heater.yaml"):
            shutil.copy(source / name, folder)
        shutil.copy(source / "deployment/machines/xy-table-nominal.yaml", folder / "machine.yaml")
        self.file.write_text(text)
        self.person = ("--as", "anna") if "security:" in text else ()
        if self.person:
            subprocess.run([invar, "keys", self.file], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        self.log = open(folder / "log", "w")
        self.runs = self.start()

    def start(self):
        return [subprocess.Popen([self.invar, "run", self.file], cwd=self.folder, stdout=self.log, stderr=self.log)]

    def pids(self):
        """Process name in the cell -> process id."""
        return {name: pid for run in self.runs for name, pid in children(run.pid).items()}

    def words(self, *words):
        """The call of a program where the cell's commands are given."""
        return [str(word) for word in words]

    def call(self, *words):
        person = () if words[0] == "keys" else self.person
        return subprocess.run(self.words(self.invar, *words, *person), cwd=self.folder, capture_output=True, text=True)

    def status(self):
        answer = self.call("status", self.file, "--json", "--wait", "2")
        return json.loads(answer.stdout) if answer.stdout else {"components": [], "healthy": False}

    def roles(self):
        return {c["name"]: c["role"] for c in self.status()["components"] if c["role"]}

    def wait(self, what, condition, patience=40.0):
        end = time.monotonic() + patience
        while time.monotonic() < end:
            if condition():
                return
            time.sleep(0.02)
        print((self.folder / "log").read_text())
        raise SystemExit(f"FAILED: waited in vain for {what}: {self.roles()}, {self.status().get('faults')}")

    def wait_for_roles(self, **roles):
        self.wait(f"the roles {roles}, all well", lambda: self.status()["healthy"] and self.roles() == roles)

    def kill(self, process, with_signal=signal.SIGKILL):
        os.kill(self.pids()[process], with_signal)

    def renew(self, *processes):
        """Other certificates; the processes that have them are started anew, one after the other."""
        time.sleep(1.1)  # files tell by their times what is newer than a process
        for process in processes:
            renewed = self.call("keys", self.file, "--renew", process)
            if renewed.returncode != 0:
                raise SystemExit("FAILED: " + renewed.stderr)
        for run in self.runs:
            run.send_signal(signal.SIGUSR2)

    def end(self):
        for run in self.runs:
            if run.poll() is None:
                run.send_signal(signal.SIGINT)
        for run in self.runs:
            run.wait(timeout=60)

    def table(self, words):
        """Rows of the recording of a topic whose name has these words."""
        out = self.folder / "tables"
        if not out.exists():
            answer = subprocess.run([self.invar, "export", "out/recording.mcap", "--out", out], cwd=self.folder,
                                    capture_output=True, text=True)
            if answer.returncode != 0:
                raise SystemExit("FAILED: " + answer.stderr)
        (file,) = [name for name in out.glob("*.csv") if words in name.name]
        return list(csv.DictReader(open(file)))


def column(row, begin):
    return float(next(value for name, value in row.items() if name.startswith(begin)) or "nan")


class HeatCell(Cell):
    POWER, TEXT = ("holding", 0), HEAT

    def __init__(self, invar, source, folder, domain, port, head=""):
        self.witness = Witness(port, port + 1)
        super().__init__(invar, source, folder, (head + self.TEXT).format(domain=domain, port=port, device=port + 1))

    def powers(self, since=0.0):
        """(time, connection, W) of each write of the power."""
        return [(at, who, value * 0.01) for at, who, kind, address, value in list(self.witness.writes)
                if at >= since and (kind, address) == self.POWER]

    def has_taken_over(self, at):
        """Of a kill at `at`: whether another connection has written a power since."""
        last = [write for write in self.powers() if write[0] <= at][-1]
        return any(write[1] != last[1] for write in self.powers(at))

    def takeover(self, at):
        """Of a kill at `at`: seconds from the last power of the one to the first of the other, and the step [W]."""
        before = [write for write in self.powers() if write[0] <= at]
        last = before[-1]
        first = next(write for write in self.powers(at) if write[1] != last[1])
        last = [write for write in self.powers() if write[1] == last[1] and write[0] < first[0]][-1]
        return first[0] - last[0], abs(first[2] - last[2])

    def masters(self, begin, end):
        return {who for at, who, _, _, _ in list(self.witness.writes) if begin <= at <= end}


class MotionCell(Cell):
    HOSTS = {"hosts": "{pc: {address: 127.0.0.1}}", "axis": "pc", "other": "pc"}

    def __init__(self, invar, source, folder, domain, strokes=20, head=""):
        text = (head + MOTION).format(domain=domain, strokes=", ".join(["0.05"] * strokes), **self.HOSTS)
        super().__init__(invar, source, folder, text)

    def sample(self):
        answer = self.call("echo", self.file, "stage_x.state", "--count", "1", "--json", "--wait", "5")
        if not answer.stdout:
            return {}
        sample = json.loads(answer.stdout.splitlines()[0])
        return sample.get("value", sample)

    def wait_for_motion(self):
        self.wait("the axis to move", lambda: abs(self.sample().get("setpoint_velocity", 0.0)) > 0.045)

    def takeovers(self, kills, within=0.3):
        """Of each kill or renewal [s], after which the other leads within so many seconds: milliseconds from the last state of the
        one to the first of the other. Then the cost: the step of the current [A], and the largest following error [m] and the mode
        in the 50 ms after."""
        rows = sorted((column(row, "at.time_ns") * 1e-9, column(row, "current"), column(row, "following_error"), row["mode"],
                       int(row["sequence"])) for row in self.table("stage_x.state"))
        found = []
        for kill in kills:
            near = [row for row in rows if kill - 0.02 < row[0] < kill + within]
            at = max(range(len(near) - 1), key=lambda i: abs(near[i + 1][4] - near[i][4] - 1))  # another writer, another count
            found.append(((near[at + 1][0] - near[at][0]) * 1e3, abs(near[at + 1][1] - near[at][1]),
                          max(abs(row[2]) for row in near[at + 1:at + 50]), near[at + 1][3]))
        return found


class MotionOnTwoPcs(MotionCell):
    """The standby runs on another PC than the axis and its loop (network namespaces). Needs root."""
    HOSTS = {"hosts": "{axis: {address: 10.81.0.11}, other: {address: 10.81.0.12}}", "axis": "axis", "other": "other"}

    def __init__(self, *given, **more):
        self.hosts = Hosts(("axis", "other"))
        super().__init__(*given, **more)

    def start(self):
        return [self.hosts.start(host, self.invar, "run", self.file, "--host", host, cwd=self.folder, stdout=self.log, stderr=self.log)
                for host in self.hosts.names]

    def words(self, *words):
        return self.hosts.words("axis", *words)

    def end(self):
        super().end()
        self.hosts.end()
