#!/usr/bin/env python3
"""A cell on several PCs (network namespaces): how soon all is active, a PC is back, an axis stops that lost its commander; what
lost packets cost a command; how well the clocks are known. The tests of tests/fault are run several times, and what they print is
gathered.

Usage: hosts.py INVAR SOURCE_FOLDER BENCH_SECURED [TIMES]    (root)
"""
import pathlib
import re
import statistics
import subprocess
import sys

INVAR, SOURCE, BENCH = (pathlib.Path(word).resolve() for word in sys.argv[1:4])
BEGUN = r"stop: slower [-0-9.]+ ms after the cut \((-?[0-9.]+) ms after it was ordered\)"  # two of a test: cut, killed
TIMES = int(sys.argv[4]) if len(sys.argv) > 4 else 5
LOSSY = """set -e
ip link set lo up multicast on
source "$1"
nft "$(loss lo 50)"
"$0" latency - 2000 command 100
nft list table inet loss | grep -E 'packets [1-9][0-9]*'"""


def output_of(*words):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, words))}: status {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def fault(name, *words):
    return output_of(SOURCE / "tests/fault" / name, INVAR, SOURCE, *words)


def numbers(pattern, text):
    return [float(found) for found in re.findall(pattern, text)]


def row(what, values, unit, target):
    print(f"| {what} | {len(values)} | {statistics.median(values):.3g} {unit} | {max(values):.3g} {unit} | {target} |", flush=True)


def main():
    print("| what | times | median | longest | target |\n| --- | --- | --- | --- | --- |")
    text = fault("hosts.sh", TIMES)
    for what, words, target in (
            ("three PCs: from `invar run` until all is active", "all active, with multicast", "3 s"),
            ("the same without multicast", "all active, without multicast", "3 s"),
            ("a PC that started without its cable: active after the cable is in", "active after the cable is in", "2 s"),
            ("a PC that was cut off for 4 s: all active after the cable is in", "all active after a cut of 4 s", "2 s")):
        row(what, [1e-3 * ms for ms in numbers(f"{words}: ([0-9]+) ms", text)], "s", target)
    text = "".join(fault("lost_commander.sh") for _ in range(TIMES))
    row("link to the commander cut: the axis begins to stop", numbers(BEGUN, text)[::2], "ms", "100 ms")
    row("its commander killed on the same PC: the axis begins to stop", numbers(BEGUN, text)[1::2], "ms", "100 ms")
    text = "".join(output_of("unshare", "--net", "bash", "-c", LOSSY, BENCH, SOURCE / "tests/support/loss.sh") for _ in range(TIMES))
    row("`command` at 100 Hz, 5 % of the packets lost: p99 of 2000", [1e-3 * us for us in numbers(r"p99 ([0-9.e+]+) us", text)], "ms", "20 ms")
    row("the same: the slowest of 2000", [1e-3 * us for us in numbers(r"max ([0-9.e+]+) us", text)], "ms", "100 ms")
    row("the same: commands lost", numbers("lost ([0-9]+)", text), "", "0")
    text = "".join(fault("host_clocks.sh") for _ in range(TIMES))
    ahead = numbers(r"clock of trial-pc: (-?[0-9.]+) ms ahead", text)
    row("offset of a clock 3 to 13 s off: its error", [min(abs(ms - set_to) for set_to in (3000, -7000, 13000)) for ms in ahead], "ms", "0.2 ms")


main()
