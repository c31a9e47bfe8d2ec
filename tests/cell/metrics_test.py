#!/usr/bin/env python3
"""`invar metrics`: promtool takes what it gives; its numbers are those of the running cell; a device, a process and the cell that go
away and come back are seen; clients that misuse HTTP keep nobody else out for long and do the cell no harm.

Usage: metrics_test.py INVAR SOURCE_FOLDER PROMTOOL
"""
import json
import os
import pathlib
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import unittest
import urllib.request

INVAR, SOURCE, PROMTOOL = sys.argv.pop(1), pathlib.Path(sys.argv.pop(1)), sys.argv.pop(1)

sys.path.insert(0, str(SOURCE / "tests" / "support"))
from warm_cell import InFolder, free_port  # noqa: E402

SERIES = re.compile(r'^(\w+)(?:\{(.*)\})? (\S+)$')


class Metrics(InFolder):
    INVAR, SOURCE = INVAR, SOURCE
    MORE = "  tape: {rate: 10, components: {recorder: {type: recorder, out: out}}}\n"

    def setUp(self):
        super().setUp()
        self.port = free_port()  # of the page of metrics

    def export(self, *words):
        return self.start("metrics", self.file, "--listen", f"127.0.0.1:{self.port}", *words)

    def page(self, timeout=5):
        return urllib.request.urlopen(f"http://127.0.0.1:{self.port}/metrics", timeout=timeout).read().decode()

    def series(self):
        """{(name, (label="value", ...)): number}; {} where nobody answers."""
        try:
            page = self.page()
        except OSError:
            return {}
        found = (SERIES.match(line) for line in page.splitlines() if line and not line.startswith("#"))
        return {(m[1], tuple(sorted(re.findall(r'(\w+="[^"]*")', m[2] or "")))): float(m[3]) for m in found}

    def value(self, name, *labels):
        return [number for (found, has), number in self.series().items() if found == name and set(labels) <= set(has)]

    def wait_for(self, wanted, name, *labels, patience=30):
        end = time.monotonic() + patience
        while time.monotonic() < end:
            if self.value(name, *labels) == wanted:
                return
            time.sleep(0.2)
        self.fail(f"{name}{labels} is {self.value(name, *labels)}, not {wanted}\n{(self.folder / 'log').read_text()}")

    def end(self, one, status=0):
        one.send_signal(signal.SIGINT)
        self.assertEqual(one.wait(timeout=30), status)

    def test_a_cell_that_goes_and_comes_is_seen_and_promtool_takes_the_page(self):
        exporter = self.export()
        self.wait_for([0.0] * 3, "invar_process_up")
        run = self.start("run", self.file)
        self.wait_for([1.0], "invar_cell_healthy", 'cell="warm"')
        for component, process in (("heater", "device"), ("thermal", "heat"), ("recorder", "tape")):
            self.assertEqual(self.value("invar_component_state", f'component="{component}"', f'process="{process}"', 'state="active"'), [1.0])
            self.assertEqual(self.value("invar_component_state", f'component="{component}"', 'state="error"'), [0.0])
        self.wait_for([0.05], "invar_loop_period_seconds", 'process="heat"')
        self.wait_for([64e6], "invar_recorder_disk_reserve_bytes")
        before, begin = self.series(), time.monotonic()
        time.sleep(5)
        after, passed = self.series(), time.monotonic() - begin
        topic = 'topic="cell/warm/thermal/state"'

        def grown(name, *labels):
            return sum(number - before[key] for key, number in after.items() if key[0] == name and set(labels) <= set(key[1]))

        self.assertAlmostEqual(grown("invar_loop_cycles_total", 'process="heat"') / passed, 20.0, delta=8.0)
        self.assertAlmostEqual(grown("invar_topic_samples_total", topic) / passed, 20.0, delta=8.0)
        self.assertGreater(grown("invar_recorder_samples_total"), 50)
        self.assertEqual(grown("invar_topic_lost_samples_total", topic), 0)
        self.assertEqual(self.value("invar_heater_device_up", topic), [1.0])
        self.assertEqual(self.value("invar_heater_setpoint_celsius", topic), [30.0])
        free = shutil.disk_usage(self.folder).free
        self.assertAlmostEqual(self.value("invar_recorder_disk_free_bytes")[0] / free, 1.0, delta=0.2)
        self.assertEqual(self.value("invar_recorder_disk_reserve_bytes"), [64e6])
        documented = set(re.findall(r"`(invar_\w+)`", (SOURCE / "docs/reference/metrics.md").read_text()))
        self.assertLessEqual({name for name, _ in after if name.startswith("invar_")}, documented)
        checked = subprocess.run([PROMTOOL, "check", "metrics"], input=self.page(), text=True, capture_output=True)
        self.assertEqual((checked.returncode, checked.stdout + checked.stderr), (0, ""))

        status = json.loads(subprocess.run([INVAR, "status", self.file, "--json"], cwd=self.folder, capture_output=True).stdout)
        device = next(p["pid"] for p in status["processes"] if p["name"] == "device")
        os.kill(device, signal.SIGSTOP)
        self.wait_for([0.0], "invar_heater_device_up", topic)
        self.wait_for([0.0], "invar_process_up", 'process="device"')
        self.assertEqual(self.value("invar_component_state", 'component="heater"'), [], "what it said last is not how it is")
        self.wait_for([1.0], "invar_component_fault", 'component="thermal"')
        self.assertEqual(self.value("invar_cell_healthy"), [0.0])
        os.kill(device, signal.SIGKILL)
        self.wait_for([1.0], "invar_process_restarts_total", 'process="device"')
        self.wait_for([1.0], "invar_cell_healthy")
        self.end(run)
        self.wait_for([0.0] * 3, "invar_process_up")
        self.end(exporter)

    def test_clients_that_misuse_http_keep_nobody_out(self):
        run = self.start("run", self.file)
        exporter = self.export("--no-topics")
        self.wait_for([1.0], "invar_cell_healthy")
        self.wait_for([1.0], "invar_heater_device_up", 'topic="cell/warm/thermal/state"')
        self.assertEqual(self.value("invar_topic_samples_total"), [], "no topics are counted")
        generator = random.Random(7)
        wrong = [b"GET /../../etc/passwd HTTP/1.1\r\nHost: a\r\n\r\n", b"PUT /metrics HTTP/1.1\r\nContent-Length: 5\r\n\r\nhallo",
                 b"GET /metrics HTTP/1.1\r\nContent-Length: 99999999999999999999\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"\0" * 5000,
                 b"DELETE /metrics HTTP/1.1\r\n\r\n", b"GET /x.cgi?a=$(id) HTTP/1.1\r\n\r\n", b"GET /metrics HTTP/1.1\r\n" + b"X: " + b"a" * 1_000_000,
                 b"GET /metrics HTTP/1.1\r\n" + b"A: b\r\n" * 20_000 + b"\r\n", b"POST /metrics HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nfffffffff\r\n"]
        wrong += [generator.randbytes(generator.randrange(1, 3000)) for _ in range(300)]
        for request in wrong:
            with socket.create_connection(("127.0.0.1", self.port), timeout=10) as client:
                client.settimeout(3)
                try:
                    client.sendall(request)
                    client.shutdown(socket.SHUT_WR)
                    answer = client.recv(200)
                except OSError:
                    continue
                self.assertFalse(b"root:" in answer or (answer.startswith(b"HTTP/1.1 200") and b"/metrics" not in request), (request[:60], answer))
        # Clients that never end their request: the next scrape waits for a few of them, not for all their life.
        idle = [socket.create_connection(("127.0.0.1", self.port)) for _ in range(40)]
        for client in idle:
            client.sendall(b"GET /metrics HTTP/1.1\r\nX: ")
        begin = time.monotonic()
        self.assertIn("invar_cell_healthy", self.page(timeout=30))
        waited = time.monotonic() - begin
        print(f"a scrape behind 40 idle clients took {waited:.2f} s", file=sys.stderr)
        self.assertLess(waited, 10.0, "the usual timeout of a scrape")
        for client in idle:
            client.close()
        peak = int(re.search(r"VmHWM:\s+(\d+)", pathlib.Path(f"/proc/{exporter.pid}/status").read_text())[1])
        self.assertLess(peak, 300_000, "kB")
        self.assertIsNone(exporter.poll())
        self.assertEqual(self.value("invar_cell_healthy"), [1.0])
        self.assertEqual(self.value("invar_process_restarts_total", 'process="heat"'), [0.0])
        self.end(exporter)
        self.end(run)

    def test_refuses_in_words(self):
        taken = socket.socket()
        taken.bind(("127.0.0.1", self.port))
        taken.listen()
        for listen, said in (("9464", "is no address with a port"), ("127.0.0.1:80r", "is no address with a port"),
                             ("127.0.0.1:0", "is no address with a port"), ("127.0.0.1:9464,+80s", "is no address with a port"),
                             ("pc:9464", "is no address with a port"), ("192.0.2.1:9464", "does not listen on 192.0.2.1:9464"),
                             (f"127.0.0.1:{self.port}", "a port that no other program has")):
            done = subprocess.run([INVAR, "metrics", self.file, "--listen", listen], capture_output=True, text=True, timeout=60)
            self.assertEqual((done.returncode, done.stdout, done.stderr.count("\n")), (2, "", 1), done.stderr)
            self.assertIn(said, done.stderr)
        taken.close()
        none = subprocess.run([INVAR, "metrics", "--domain", "231", "--wait", "0.5"], capture_output=True, text=True, timeout=60)
        self.assertEqual(none.returncode, 1)
        self.assertIn("no cell answers", none.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
