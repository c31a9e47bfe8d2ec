#!/usr/bin/env python3
"""What `invar record` takes through DDS: 200 topics at rising rates beside a running cell; lost samples, CPU.

Usage: record.py INVAR BENCH_FLOOD SOURCE_FOLDER [SECONDS [RATE_HZ:BYTES ...]]
Runs deployment/xy-table.yaml by the wall clock on a random DDS domain (shared memory and UDP on loopback), floods the same
domain from one more process, and compares what was written with what the recording's ledger and file hold.
"""
import json
import pathlib
import random
import re
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

INVAR, FLOOD, SOURCE = (pathlib.Path(word).resolve() for word in sys.argv[1:4])
SECONDS = float(sys.argv[4]) if len(sys.argv) > 4 else 30.0
LOADS = [tuple(map(int, word.split(":"))) for word in sys.argv[5:]] or [(100, 500), (200, 500), (400, 500), (1000, 500), (100, 5000)]
TOPICS = 200


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def record(folder, file, domain, rate, size):
    """Samples written, refused to the writer, in the file, lost by the recorder, missing before it; CPU shares, MB."""
    out = folder / "flood.mcap"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    recorder = subprocess.Popen([INVAR, "record", file, "--out", out, "--topic", "flood/", "--json"],
                                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=folder)
    flood = subprocess.run([FLOOD, "--domain", str(domain), "--rate", str(rate), "--seconds", str(SECONDS),
                            "--topics", str(TOPICS), "--bytes", str(size)], stdout=subprocess.PIPE, text=True, check=True)
    sent = json.loads(flood.stdout)
    time.sleep(1.0)
    recorder.send_signal(signal.SIGINT)
    ledger = json.loads(recorder.communicate(timeout=120)[0])
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    both = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    megabytes = out.stat().st_size * 1e-6
    out.unlink()
    return sent, ledger, (both - sent["cpu"]) / sent["wall"], megabytes


def main():
    with tempfile.TemporaryDirectory(prefix="invar-record-") as name:
        folder = pathlib.Path(name)
        shutil.copytree(SOURCE / "deployment", folder / "deployment")
        file = folder / "deployment" / "xy-table.yaml"
        domain = random.SystemRandom().randrange(100, 200)
        text = re.sub(r"^domain: \d+", f"domain: {domain}", file.read_text(), flags=re.M)
        file.write_text(text.replace("15020", str(free_port())))
        cell = subprocess.Popen([INVAR, "run", file, "--real-time"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                cwd=folder)
        time.sleep(4.0)
        print("asked Hz  bytes  written  refused  recorded     lost  missing   MB/s  file MB  record CPU %  writer CPU %")
        for rate, size in LOADS:
            sent, ledger, cpu, megabytes = record(folder, file, domain, rate, size)
            print(f"{rate:8d} {size:6d} {sent['written']:8d} {sent['refused']:8d} {ledger['written']:9d} {ledger['lost']:8d} "
                  f"{ledger['missing']:8d} {sent['written'] * size * 1e-6 / sent['wall']:6.1f} {megabytes:8.0f} "
                  f"{100 * cpu:13.0f} {100 * sent['cpu'] / sent['wall']:13.0f}", flush=True)
        cell.send_signal(signal.SIGINT)
        cell.wait(timeout=60)


main()
