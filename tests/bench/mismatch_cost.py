#!/usr/bin/env python3
"""What a diagnosis costs: against the length of the recording, and against the names in the library.

    tests/bench/mismatch_cost.py build/bin [--lengths 10 30 60 300 900 3600] [--cases 5] [--names 1 2 5 10 20] [--gzip] [--mcap FILE MODEL]

Axes at 1 kHz made by `bench_mismatch --write`, each effect another machine; `invar diagnose` is a process of its own, whose
wall-clock time, CPU time and largest memory (getrusage) are the rows. The names: `bench_mismatch --keep`, the right one and
others drawn at random, on axes of about 10,000 rows. Says the load before and after. With --mcap a row of that recording.
"""
import argparse
import gzip
import os
import pathlib
import re
import shutil
import statistics
import subprocess
import tempfile
import time

EFFECTS = ["none", "coulomb_friction", "force_ripple", "dead_zone", "encoder_periodic_error", "position_stiffness", "flexible_mode",
           "magnetic_saturation", "backlash", "periodic_disturbance", "quadratic_drag", "unknown:dent"]


def measured(command):
    """Wall-clock time [s], CPU time of all threads [s] and largest resident memory [MiB] of a command."""
    begin = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}: ended with {process.returncode}")
    return time.monotonic() - begin, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def made(bench, folder, effect, seconds, seed):
    """The model and the recordings of a made axis."""
    subprocess.run([bench, "--plants", "axis", "--effects", effect, "--size", "1", "--seed", str(seed), "--rows", str(1000 * seconds),
                    "--write", folder], check=True, stdout=subprocess.DEVNULL)
    case = next(pathlib.Path(folder).iterdir())
    return case / "model.yaml", sorted(case.glob("recording-*.csv"))


def packed(file):
    with open(file, "rb") as plain, gzip.open(f"{file}.gz", "wb", compresslevel=1) as out:
        shutil.copyfileobj(plain, out)
    file.unlink()
    return pathlib.Path(f"{file}.gz")


def row(cells):
    print("| " + " | ".join(str(c) for c in cells) + " |", flush=True)


def of(values, form):
    middle = form % statistics.median(values)
    return middle if len(values) == 1 else f"{middle} ({form % min(values)} .. {form % max(values)})"


def lengths(arguments, bench, invar):
    print("\n| recording | rows | file MB | diagnoses | wall clock s, median (range) | CPU s | largest memory MiB |\n"
          "| --- | --- | --- | --- | --- | --- | --- |")
    for seconds in arguments.lengths:
        walls, cpus, memories, sizes = [], [], [], []
        for effect in EFFECTS[:arguments.cases]:
            with tempfile.TemporaryDirectory() as folder:
                model, recordings = made(bench, folder, effect, seconds, 31 + seconds % 7)
                if arguments.gzip:
                    recordings = [packed(file) for file in recordings]
                sizes.append(sum(file.stat().st_size for file in recordings) / 1e6)
                words = [w for file in recordings for w in ("--recording", file)]
                wall, cpu, memory = measured([invar, "diagnose", "--model", model, *words, "--out", f"{folder}/out"])
                walls.append(wall), cpus.append(cpu), memories.append(memory)
        name = f"{seconds} s" if seconds < 60 else f"{seconds // 60} min" if seconds < 3600 else f"{seconds // 3600} h"
        row([name, f"{1000 * seconds:,}", "%.0f" % statistics.median(sizes) if sizes[0] > 2 else "%.1f" % statistics.median(sizes),
             len(walls), of(walls, "%.1f"), of(cpus, "%.1f"), of(memories, "%.0f")])


def names(arguments, bench):
    print("\n| names in the library | CPU s, median (range) | named |\n| --- | --- | --- |")
    for count in arguments.names:
        seconds, right = [], []
        for effect in [e for e in EFFECTS if e != "none" and not e.startswith("unknown")][:arguments.cases]:
            said = subprocess.run([bench, "--plants", "axis", "--effects", effect, "--size", "1", "--seed", "41", "--keep", str(count)],
                                  check=True, capture_output=True, text=True).stdout
            line = re.search(r" n (\S+) false.* (\d+\.\d+) s  ", said)
            right.append(float(line[1])), seconds.append(float(line[2]))
        row([count, of(seconds, "%.1f"), f"{sum(right):g} of {len(right)}"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("--lengths", type=int, nargs="*", default=[10, 30, 60, 300, 900, 3600], help="s")
    parser.add_argument("--cases", type=int, default=5, help="effects of each length and number of names")
    parser.add_argument("--names", type=int, nargs="*", default=[1, 2, 5, 10, 20])
    parser.add_argument("--gzip", action="store_true", help="recordings packed")
    parser.add_argument("--mcap", nargs=2, metavar=("FILE", "MODEL"))
    arguments = parser.parse_args()
    bench, invar = arguments.bin / "bench_mismatch", arguments.bin / "invar"
    print("load", *os.getloadavg(), "on", os.cpu_count(), "cores")
    if arguments.lengths:
        lengths(arguments, bench, invar)
    if arguments.mcap:
        with tempfile.TemporaryDirectory() as folder:
            file, model = arguments.mcap
            wall, cpu, memory = measured([invar, "diagnose", "--model", model, "--recording", file, "--out", f"{folder}/out"])
            row([pathlib.Path(file).name, "", "%.0f" % (os.path.getsize(file) / 1e6), 1, "%.1f" % wall, "%.1f" % cpu, "%.0f" % memory])
    if arguments.names:
        names(arguments, bench)
    print("load", *os.getloadavg())


if __name__ == "__main__":
    main()
