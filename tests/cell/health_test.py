#!/usr/bin/env python3
"""A cell that is not well says so: in its log, by its exit status, in `invar status`; processes that end are started again.

Usage: health_test.py INVAR SOURCE_FOLDER
Real processes in real time over loopback, a Modbus device and a heater loop in processes of their own.
"""
import json
import os
import pathlib
import re
import signal
import socket
import stat
import subprocess
import sys
import time
import unittest

INVAR = sys.argv.pop(1)
SOURCE = pathlib.Path(sys.argv.pop(1))

sys.path.insert(0, str(SOURCE / "tests" / "support"))
import warm_cell  # noqa: E402


class Warm(warm_cell.InFolder):
    INVAR, SOURCE = INVAR, SOURCE

    def run_cell(self, *words):
        return self.start("run", self.file, *words)

    def status(self):
        end = subprocess.run([INVAR, "status", self.file, "--json", "--wait", "5"], cwd=self.folder, capture_output=True,
                             text=True)
        return end.returncode, json.loads(end.stdout)

    def wait_for(self, what, condition, patience=90):
        end = time.monotonic() + patience
        while time.monotonic() < end:
            seen = condition()
            if seen:
                return seen
            time.sleep(0.1)
        self.fail(f"waited in vain for {what}:\n{self.log()}")

    def end(self, run, signal_number=signal.SIGINT):
        run.send_signal(signal_number)
        return run.wait(timeout=60)

    def process(self, name):
        return next(p for p in self.status()[1]["processes"] if p["name"] == name)

    def test_a_device_that_does_not_answer_is_said_everywhere_until_it_does(self):
        run = self.run_cell("--process", "heat")
        self.wait_for("the device's silence to count", lambda: self.status()[1]["faults"] and "thermal: no temperature comes" in
                      " ".join(self.status()[1]["faults"]))
        code, answer = self.status()
        self.assertEqual((code, answer["healthy"]), (1, False))
        self.assertIn("no temperature comes", next(c for c in answer["components"] if c["name"] == "thermal")["fault"])
        log = self.log()
        self.assertRegex(log, r"invar \d+\.\d+\.\d+: process `heat` of cell `warm` .* starts in real time, pid \d+")
        self.assertRegex(log, r"\[error\] thermal: ", "its notices are in the log")
        self.assertEqual(self.end(run, signal.SIGTERM), 1)
        self.assertIn("at the end: thermal: no temperature comes", self.log())

        device, run = self.run_cell("--process", "device"), self.run_cell("--process", "heat")
        self.wait_for("a cell that is well", lambda: self.status() and self.status()[1]["healthy"])
        self.assertEqual(self.end(run, signal.SIGTERM), 0)
        self.assertEqual(self.end(device, signal.SIGTERM), 0)

    def test_a_heater_that_latched_is_the_exit_status_of_the_run(self):
        text = self.file.read_text().replace("setpoint: 30", "setpoint: 26\n        over_temperature: 26.5")
        self.file.write_text(text.replace("rate: 20", "rate: 10"))
        # The plant warms beyond the limit: what the simulated heater takes is a warm room.
        self.file.write_text(self.file.read_text().replace("port: %d}" % self.device_port, "port: %d, ambient: 40}" % self.device_port, 1))
        run = subprocess.run([INVAR, "run", self.file, "--simulated", "--duration", "30", "--json"], cwd=self.folder,
                             capture_output=True, text=True, timeout=120)
        ended = json.loads(run.stdout)
        self.assertEqual((run.returncode, ended["healthy"], ended["failure"]), (1, False, ""), run.stderr)
        self.assertRegex(" ".join(ended["faults"]), "thermal: the heater is latched off")
        self.assertRegex(run.stderr, r"\[critical\] at [0-9.]+ s: thermal: .*over_temperature")

    def poll(self, reference, *values):
        subprocess.run(["mbpoll", "-m", "tcp", "-p", str(self.device_port), "-t", "4", "-r", str(reference), "-1", "127.0.0.1",
                        *[str(value) for value in values]], check=True, capture_output=True)

    def test_a_latch_holds_until_a_person_resets_it(self):
        run = self.run_cell("--real-time")
        self.wait_for("a cell that is well", lambda: self.status() and self.status()[1]["healthy"])
        self.poll(4, 100)  # the device's own limit: 10 degC, which the pad is above
        self.wait_for("the latch", lambda: "latched off" in " ".join(self.status()[1]["faults"]))
        self.poll(4, 800)
        time.sleep(1.0)
        self.assertIn("`invar lifecycle CELL COMPONENT reset`", " ".join(self.status()[1]["faults"]))
        reset = subprocess.run([INVAR, "lifecycle", self.file, "thermal", "reset"], cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(reset.returncode, 0, reset.stdout + reset.stderr)
        self.wait_for("a cell that is well again", lambda: self.status()[1]["healthy"], 10)
        other = subprocess.run([INVAR, "lifecycle", self.file, "heater", "reset"], cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(other.returncode, 1, "a component without a latch that is active has nothing to reset")
        self.assertEqual(self.end(run), 0)

    def test_one_that_cannot_live_is_started_again_after_pauses_and_the_rest_goes_on(self):
        taken = socket.socket()
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        taken.bind(("127.0.0.1", self.device_port))
        taken.listen()
        run = self.run_cell("--real-time")
        self.wait_for("pauses that grow", lambda: "starting it again in 2 s" in self.log())
        log = self.log()
        ends = re.findall(r"process `device` ended with status 1; starting it again( in \d+ s)?", log)
        self.assertEqual(ends[:7], [""] * 5 + [" in 1 s", " in 2 s"], log)
        ended = self.wait_for("the pause to be seen", lambda: (lambda p: p if p["pid"] == 0 else None)(self.process("device")))
        self.assertRegex(ended["last_end"], r"status 1; starting it again in \d+ s")
        self.assertGreaterEqual(ended["restarts"], 7)
        self.assertEqual(self.status()[0], 1)
        before = self.process("heat")["cycles"]
        self.wait_for("the other process to go on", lambda: self.process("heat")["cycles"] > before)
        self.assertEqual(self.process("heat")["restarts"], 0)

        taken.close()
        alive = self.wait_for("it to live", lambda: (lambda p: p if p["pid"] else None)(self.process("device")))
        # As many as in the pause, where the port was free before its end.
        self.assertGreaterEqual(alive["restarts"], ended["restarts"])
        self.assertEqual(alive["last_end"], "status 1")
        self.wait_for("a cell that is well", lambda: self.status()[1]["healthy"])
        self.assertEqual(self.end(run), 0, self.log())

    def test_one_that_is_killed_again_and_again_comes_back_each_time(self):
        run = self.run_cell("--real-time")
        pid = 0
        for _ in range(7):
            alive = self.wait_for("another life", lambda: (lambda p: p if p and p["pid"] not in (0, pid) else None)(
                next((p for p in self.status()[1]["processes"] if p["name"] == "heat"), None)))
            pid = alive["pid"]
            os.kill(pid, signal.SIGKILL)
        alive = self.wait_for("the last life", lambda: (lambda p: p if p["pid"] not in (0, pid) else None)(self.process("heat")))
        self.assertEqual((alive["restarts"], alive["last_end"]), (7, "status 137"))
        self.assertEqual(self.process("device")["restarts"], 0)
        self.wait_for("a cell that is well", lambda: self.status()[1]["healthy"])
        self.assertEqual(self.end(run), 0, self.log())

    def test_an_earlier_recording_is_kept_and_files_are_for_owner_and_group(self):
        run = self.run_cell("--real-time")
        self.wait_for("the cell", lambda: self.status()[1]["healthy"])
        for _ in range(3):
            end = subprocess.run([INVAR, "record", self.file, "--out", "run.mcap", "--duration", "1", "--wait", "20"],
                                 cwd=self.folder, capture_output=True, text=True, preexec_fn=lambda: os.umask(0))
            self.assertIn(end.returncode, (0, 1), end.stderr)  # on a starved PC nothing may come within a second
        for name in ("run.mcap", "run-1.mcap", "run-2.mcap"):
            file = self.folder / name
            self.assertEqual(stat.S_IMODE(file.stat().st_mode), 0o640, name)
            subprocess.run([INVAR, "recording", "info", file], check=True, capture_output=True)
        self.assertEqual(self.end(run), 0, self.log())


if __name__ == "__main__":
    unittest.main(verbosity=2)
