#!/usr/bin/env python3
"""How long 10, 50 and 100 participants, each a process, take to find one another, with plain Fast DDS in the same run as the anchor.

Usage: discovery.py BENCH_DISCOVERY [RUNS [PARTICIPANTS...]]
As root: two network namespaces joined by a cable, so that 200 participants have ports (110 a PC). Up to 100 stand in one of them. On two cores 200 do not
find one another within a minute, plain Fast DDS neither: 40 000 pairs want more CPU time than there is.
Time counts from the moment at which all begin, the making of processes left out, until the last reader knows all writers.
"""
import math
import os
import resource
import statistics
import subprocess
import sys
import time

PROGRAM = os.path.abspath(sys.argv[1])
RUNS = int(sys.argv[2]) if len(sys.argv) > 2 else 5
TOTALS = [int(word) for word in sys.argv[3:]] or [10, 50, 100]
SPACES = [f"invar-bench-{end}-{os.getpid()}" for end in "ab"]
ADDRESSES = ["10.83.0.11", "10.83.0.12"]


def ip(*words):
    subprocess.run(["ip", *words], check=True)


def cables():
    for space in SPACES:
        ip("netns", "add", space)
    ip("-n", SPACES[0], "link", "add", "cable", "type", "veth", "peer", "name", "cable", "netns", SPACES[1])
    for space, address in zip(SPACES, ADDRESSES):
        ip("-n", space, "address", "add", f"{address}/24", "dev", "cable")
        ip("-n", space, "link", "set", "cable", "up")
        ip("-n", space, "link", "set", "lo", "up")
    time.sleep(3)  # the kernel says "up" before the first packets pass


def cpu():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def once(kind, total):
    """Seconds until the last one has found all, pairs that are missing, and seconds of the CPU."""
    before = cpu()
    parts = [total] if total <= 100 else [total // 2, total - total // 2]
    at = time.monotonic_ns() + (1_000_000_000 if total <= 100 else 3_000_000_000)
    running = [subprocess.Popen(["ip", "netns", "exec", space, PROGRAM, kind, address, str(sum(parts[:i])), str(part), str(total), str(at)],
                                stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
               for i, (space, address, part) in enumerate(zip(SPACES, ADDRESSES, parts))]
    lines = [one.stdout.readline().split() for one, part in zip(running, parts) for _ in range(part)]
    for one in running:
        one.stdin.close()
    for one in running:
        one.wait()
    missing = sum(int(line[1]) for line in lines if line and line[0] == "missing")
    times = [float(line[0]) for line in lines if line and line[0] != "missing"]
    return (max(times) if times else float("nan")), missing, cpu() - before


def spread(seconds):
    if any(math.isnan(one) for one in seconds):
        return "not in 60"
    return f"{statistics.median(seconds):.2f} ({min(seconds):.2f} .. {max(seconds):.2f})"


def main():
    cables()
    try:
        print("| participants | plain Fast DDS, s | Invar, s | pairs missing, plain / Invar | CPU, plain / Invar, s |")
        print("| --- | --- | --- | --- | --- |")
        for total in TOTALS:
            found = {"plain": [], "invar": []}
            for turn in range(RUNS if total < 100 else max(1, RUNS // 2)):
                for kind in ("plain", "invar") if turn % 2 == 0 else ("invar", "plain"):
                    found[kind].append(once(kind, total))
                    print(total, kind, *(f"{number:.2f}" for number in found[kind][-1]), file=sys.stderr)
                    time.sleep(1)
            text = {kind: spread([r[0] for r in rows]) for kind, rows in found.items()}
            missing = {kind: sum(r[1] for r in rows) for kind, rows in found.items()}
            used = {kind: statistics.median(r[2] for r in rows) for kind, rows in found.items()}
            print(f"| {total} | {text['plain']} | {text['invar']} | {missing['plain']} / {missing['invar']} | "
                  f"{used['plain']:.1f} / {used['invar']:.1f} |", flush=True)
    finally:
        for space in SPACES:
            subprocess.run(["ip", "netns", "del", space], check=False)


main()
