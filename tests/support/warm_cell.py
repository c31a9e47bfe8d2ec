"""The cell `warm` of tests: a heater on Modbus TCP and its loop, in processes of their own, over loopback; and the folder in which a
test runs it."""
import pathlib
import random
import shutil
import socket
import subprocess
import sys
import tempfile
import unittest

CELL = """
invar_cell: 1
name: warm
domain: {domain}
profiles: {source}/deployment/profiles.yaml
hosts: {{pc: {{address: 127.0.0.1}}}}
processes:
  device:
    host: pc
    rate: 20
    components:
      heater: {{type: simulated_heater, map: {source}/deployment/maps/heater.yaml, port: {port}}}
  heat:
    host: pc
    rate: 20
    components:
      thermal:
        type: thermal
        modbus: {{port: {port}, map: {source}/deployment/maps/heater.yaml}}
        setpoint: 30
        power_limit: 100
"""


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class InFolder(unittest.TestCase):
    """Each test has a folder with the cell file `file`; the programs that it starts there end with it."""

    INVAR = SOURCE = None  # set by the test
    MORE = ""  # lines of further processes

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="invar-warm-"))
        self.started = []
        self.device_port = free_port()
        self.domain = random.SystemRandom().randrange(100, 200)
        print("domain", self.domain, file=sys.stderr)
        self.file = self.folder / "cell.yaml"
        self.file.write_text(CELL.format(domain=self.domain, source=self.SOURCE, port=self.device_port) + self.MORE)

    def tearDown(self):
        for one in self.started:
            if one.poll() is None:
                one.kill()
            one.wait()
        shutil.rmtree(self.folder)

    def start(self, *words):
        """`invar WORDS`, its output in the file `log`."""
        with open(self.folder / "log", "a") as log:
            self.started.append(subprocess.Popen([self.INVAR, *map(str, words)], cwd=self.folder, stdout=log, stderr=log))
        return self.started[-1]

    def log(self):
        return (self.folder / "log").read_text()
