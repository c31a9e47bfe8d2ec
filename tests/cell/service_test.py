#!/usr/bin/env python3
"""`invar run` under a service manager: ready when all is up, a watchdog fed by the loops' cycles alone, a process whose loop hangs
ended and started again; and the unit that `invar units` writes, judged by systemd's own programs.

Usage: service_test.py INVAR SOURCE_FOLDER
The manager is this test, at the socket of sd_notify(3). One thread of a process is held by ptrace(2) while all others live on.
"""
import ctypes
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest

INVAR = sys.argv.pop(1)
SOURCE = pathlib.Path(sys.argv.pop(1))
sys.path.insert(0, str(SOURCE / "tests"))
import tutorials  # noqa: E402  (numbers that no other test holds)

CELL = """
invar_cell: 1
name: {name}
domain: {domain}
profiles: {source}/deployment/profiles.yaml
hosts: {{pc: {{address: 127.0.0.1}}, idle: {{address: 127.0.0.2}}}}
processes:
  device:
    host: pc
    rate: 20
    components:
      heater: {{type: simulated_heater, map: {source}/deployment/maps/heater.yaml, port: {port}}}
  heat:
    host: pc
    realtime: {{rate: 50, priority: 40, lock_memory: true}}
    components:
      thermal:
        type: thermal
        modbus: {{port: {port}, map: {source}/deployment/maps/heater.yaml}}
        setpoint: 30
        power_limit: 100
  supervisor:
    host: pc
    rate: 20
    components: {{supervisor: {{type: supervisor, timeout: 30}}}}
"""
PTRACE_SEIZE, PTRACE_INTERRUPT, WALL = 0x4206, 0x4207, 0x40000000


class Cell(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="invar-service-"))
        self.addCleanup(shutil.rmtree, self.folder)
        self.file = self.folder / "cell.yaml"
        self.write(self.file)

    def write(self, file, name="warm"):
        domain, port = tutorials.claim("domain", 101, 1, 99), tutorials.claim("port", 20000, 10, 1000)
        file.write_text(CELL.format(name=name, domain=domain, port=port, source=SOURCE))


class Notified(Cell):
    WATCHDOG = 4.0

    def setUp(self):
        super().setUp()
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.addCleanup(self.socket.close)
        self.socket.bind(str(self.folder / "notify"))
        self.socket.settimeout(0.1)
        self.heard = []  # (time, line)
        self.held = []  # threads; their end waits for us

    def start(self, *words, program=INVAR):
        environment = dict(os.environ, NOTIFY_SOCKET=str(self.folder / "notify"), WATCHDOG_USEC=str(int(1e6 * self.WATCHDOG)))
        environment.pop("WATCHDOG_PID", None)
        log = open(self.folder / "log", "ab")
        self.addCleanup(log.close)
        started = subprocess.Popen([program, "run", self.file, "--real-time", *words], env=environment, stdout=log, stderr=log,
                                   cwd=self.folder)
        self.addCleanup(self.end, started)
        return started

    def end(self, started):
        if started.poll() is None:
            started.send_signal(signal.SIGCONT)
            started.terminate()
        while started.poll() is None:
            self.listen(0.1)

    def reap(self):
        for thread in self.held:
            try:
                os.waitpid(thread, os.WNOHANG | WALL)
            except ChildProcessError:
                pass

    def listen(self, seconds, until=lambda line: False):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.reap()
            try:
                lines = self.socket.recv(4096).decode().split("\n")
            except TimeoutError:
                continue
            self.heard += [(time.monotonic(), line) for line in lines]
            if any(until(line) for line in lines):
                return True
        return False

    def wait_for(self, line, seconds=60):
        self.assertTrue(self.listen(seconds, lambda heard: heard == line), f"no {line}: {self.heard}\n{self.log()}")

    def log(self):
        return (self.folder / "log").read_text()

    def meals(self, since):
        return [at for at, line in self.heard if line == "WATCHDOG=1" and at > since]

    def child(self, launcher, process):
        found = [pid for pid in subprocess.run(["pgrep", "-P", str(launcher.pid)], capture_output=True, text=True).stdout.split()
                 if f"--process\0{process}\0" in pathlib.Path(f"/proc/{pid}/cmdline").read_text()]
        return int(found[0]) if found else None

    def hold_the_loop(self, pid, process):
        """Its loop alone stands from now on."""
        names = {int(task.name): (task / "comm").read_text().strip() for task in pathlib.Path(f"/proc/{pid}/task").iterdir()}
        loop = [tid for tid, name in names.items() if name == process]
        self.assertEqual(len(loop), 1, names)
        trace = ctypes.CDLL(None, use_errno=True).ptrace
        trace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
        for request in (PTRACE_SEIZE, PTRACE_INTERRUPT):
            self.assertEqual(trace(request, loop[0], None, None), 0, os.strerror(ctypes.get_errno()))
        self.held.append(loop[0])


class UnderAManager(Notified):
    def test_ready_means_active_and_a_process_whose_loop_hangs_is_started_again(self):
        launcher = self.start()
        self.wait_for("READY=1")
        states = subprocess.run([INVAR, "status", self.file], capture_output=True, text=True)
        self.assertEqual(states.returncode, 0, states.stdout + states.stderr)
        self.assertIn("STATUS=3 of 3 processes up", [line for _, line in self.heard])
        self.assertTrue(any(re.fullmatch(r"STATUS=[0-2] of 3 processes up; not up: .*heat.*", line) for _, line in self.heard))
        began = time.monotonic()
        self.listen(3)
        meals = self.meals(began)
        self.assertGreaterEqual(len(meals), 3, "a watchdog of 4 s wants food each 0.5 s")
        self.assertLess(max(b - a for a, b in zip(meals, meals[1:])), self.WATCHDOG / 2)

        old = self.child(launcher, "heat")
        held = time.monotonic()
        self.hold_the_loop(old, "heat")
        self.assertTrue(self.listen(20, lambda line: line == "STATUS=2 of 3 processes up; not up: heat"), self.log())
        self.assertGreater(time.monotonic() - held, self.WATCHDOG / 4)
        self.assertTrue(self.listen(30, lambda line: line == "STATUS=3 of 3 processes up"), self.log())
        self.assertNotEqual(self.child(launcher, "heat"), old)
        self.assertIn("process `heat` made no cycle for", self.log())
        meals = [held, *self.meals(held)]
        self.assertLess(max(b - a for a, b in zip(meals, meals[1:])), self.WATCHDOG, "systemd would have ended all")

        stopped = time.monotonic()
        launcher.terminate()
        self.wait_for("STOPPING=1")
        launcher.wait(60)
        self.assertEqual(self.meals(stopped + 1.0), [])

    def test_a_launcher_that_hangs_starves_the_manager(self):
        launcher = self.start()
        self.wait_for("READY=1")
        launcher.send_signal(signal.SIGSTOP)
        self.listen(0.3)
        began = time.monotonic()
        self.listen(self.WATCHDOG)
        self.assertEqual(self.meals(began), [])
        launcher.send_signal(signal.SIGCONT)
        self.wait_for("WATCHDOG=1")

    def test_one_process_alone_tells_of_its_own_loop(self):
        process = self.start("--process", "device")
        self.wait_for("READY=1")
        self.wait_for("WATCHDOG=1")
        self.wait_for("WATCHDOG=1")
        self.hold_the_loop(process.pid, "device")
        self.listen(0.6)
        began = time.monotonic()
        self.listen(self.WATCHDOG / 2)
        self.assertEqual(self.meals(began), [], "the thread that feeds lives, and its loop stands")
        process.kill()

    def test_a_program_in_whose_place_another_is_installed_goes_on(self):
        (self.folder / "bin").mkdir()
        program = self.folder / "bin" / "invar"
        shutil.copy(INVAR, program)
        launcher = self.start(program=program)
        self.wait_for("READY=1")
        (self.folder / "new").write_text("#!/bin/sh\nexit 1\n")
        (self.folder / "new").chmod(0o755)
        os.replace(self.folder / "new", program)
        old = self.child(launcher, "device")
        os.kill(old, signal.SIGKILL)
        self.assertTrue(self.listen(20, lambda line: line == "STATUS=2 of 3 processes up; not up: device"), self.log())
        self.assertTrue(self.listen(30, lambda line: line == "STATUS=3 of 3 processes up"), self.log())
        self.assertNotIn(self.child(launcher, "device"), (None, old))

    def test_without_a_manager_or_with_another_ones_watchdog_nothing_is_told(self):
        environment = dict(os.environ, NOTIFY_SOCKET="relative/no/socket", WATCHDOG_USEC="1000", WATCHDOG_PID="1")
        done = subprocess.run([INVAR, "run", self.file, "--real-time", "--duration", "2", "--quiet"], env=environment,
                              capture_output=True, text=True, cwd=self.folder, timeout=60)
        self.assertNotIn("made no cycle", done.stderr)


class Units(Cell):
    def units(self, *words, status=0):
        done = subprocess.run([INVAR, "units", *map(str, words)], capture_output=True, text=True, cwd=self.folder)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done

    def verify(self, unit):
        """systemd's own reader: a misspelt key is a line of it, with status 0."""
        return subprocess.run(["systemd-analyze", "verify", "--man=no", unit], capture_output=True, text=True,
                              env=dict(os.environ, SYSTEMD_COLORS="0"))

    def test_systemd_finds_no_fault_and_the_service_confined(self):
        written = self.units(self.file, "--host", "pc", "--user", "daemon", "--out", "units", "--data", "data").stdout.strip()
        self.assertEqual(written, "units/invar-warm.service")
        unit = self.folder / written
        text = unit.read_text()
        self.assertIn(f"ExecStart={INVAR} run {self.file} --host pc --real-time\n", text)
        for line in ("Type=notify", "LimitRTPRIO=40", "LimitMEMLOCK=infinity", "WatchdogSec=10000ms", "KillMode=mixed", "User=daemon",
                     f"ReadWritePaths={self.folder}/data"):
            self.assertIn(line + "\n", text)
        seen = self.verify(unit)
        self.assertEqual((seen.returncode, seen.stdout + seen.stderr), (0, ""))
        unit.write_text(text.replace("ProtectSystem=", "ProtectSytem="))
        self.assertIn("ProtectSytem", self.verify(unit).stderr, "a test that cannot fail")
        unit.write_text(text)
        judged = subprocess.run(["systemd-analyze", "security", "--offline=true", "--no-pager", unit], capture_output=True, text=True)
        score = re.search(r"Overall exposure level for \S+: ([0-9.]+)", judged.stdout)
        self.assertIsNotNone(score, judged.stdout + judged.stderr)
        self.assertLessEqual(float(score[1]), 3.0, judged.stdout)

    def test_letters_of_a_path_stay_letters(self):
        """systemd reads back the words that were written, whatever they are."""
        odd = self.folder / 'a%n $HOME "b" \'c\' \\d ;e'
        odd.mkdir()
        self.write(odd / "cell.yaml", name="odd")
        unit = self.folder / "invar-odd.service"
        unit.write_text(self.units(odd / "cell.yaml", "--host", "pc", "--user", "daemon", "--data", self.folder).stdout)
        seen = self.verify(unit)
        self.assertEqual((seen.returncode, seen.stdout + seen.stderr), (0, ""))
        line = next(line for line in unit.read_text().splitlines() if line.startswith("ExecStart="))
        word = re.search(r'"((?:[^"\\]|\\.)*)"', line)[1]
        self.assertEqual(re.sub(r"\\(.)", r"\1", word).replace("%%", "%").replace("$$", "$"), str(odd / "cell.yaml"))

    def test_what_cannot_be_is_refused(self):
        for expected, words in {
            "`pd` is no host of this cell; did you mean `pc`?": ["--host", "pd"],
            "none runs on the host `idle`": ["--host", "idle"],
            "`root\\x0aExecStart=/bin/sh` is no user": ["--host", "pc", "--user", "root\nExecStart=/bin/sh"],
            "has a blank, quote or backslash": ["--host", "pc", "--data", "a b"],
            "has the control character U+000a": ["--host", "pc", "--data", "a\nb"],
            "is no absolute path": ["--host", "pc", "--program", "invar"],
        }.items():
            with self.subTest(expected):
                said = self.units(self.file, *words, "--out", "nowhere", status=2)
                self.assertIn(expected, said.stderr)
                self.assertEqual(said.stderr.count("\n"), 1, said.stderr)
                self.assertFalse((self.folder / "nowhere").exists())


if __name__ == "__main__":
    unittest.main(verbosity=2)
