#!/usr/bin/env python3
"""Does a diagnosis stay the same where the recording is cut or thinned?

    tests/bench/resampled.py build/bin/invar MODEL RECORDING [MODEL RECORDING ...]

Each recording is diagnosed whole, at half its rate, at a tenth of it, and by its first and its second half. Prints for each the
verdict, the names, and how many of the names' numbers lie within three of their sigmas of the whole recording's. Exit status 1
where a verdict or the first name differs. Rows of a model with a controller are not thinned: its cycle is theirs.
Python standard library alone.
"""
import csv
import gzip
import json
import math
import pathlib
import subprocess
import sys
import tempfile

SIGMAS = 3.0


def rows_of(path):
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rt", newline="") as file:
        return list(csv.reader(file))


def thinned(rows, by):
    return rows[:1] + rows[1::by]


def part(rows, begin, end):
    body = rows[1:]
    return rows[:1] + body[int(begin * len(body)):int(end * len(body))]


def diagnosed(invar, model, rows, folder):
    recording = folder / "recording.csv"
    with open(recording, "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
    run = subprocess.run([invar, "diagnose", "--model", model, "--recording", recording, "--out", folder / "out",
                          "--budget", "600"],  # a busy PC must not change what is said
                         capture_output=True, text=True, check=False)
    if run.returncode != 0:
        return {"verdict": "refused: " + (run.stderr.strip().splitlines() or [""])[-1][:60], "findings": []}
    with open(folder / "out" / "report.json", encoding="utf-8") as file:
        return json.load(file)


def names_of(report):
    ordered = sorted(report["findings"], key=lambda f: -(f.get("share") or 0.0))
    return [f["term"] + "@" + f["site"] for f in ordered]


def numbers_agreeing(one, two):
    """Of two findings: how many numbers lie within three sigmas of each other, and how many both have."""
    pairs = [(a, two["parameters"][name]) for name, a in one["parameters"].items() if name in two["parameters"]]
    pairs = [(a, b) for a, b in pairs if a.get("sigma") and b.get("sigma")]
    within = sum(abs(a["value"] - b["value"]) <= SIGMAS * math.hypot(a["sigma"], b["sigma"]) for a, b in pairs)
    return within, len(pairs)


def agreeing(whole, other):
    """The same of all findings of two reports. Of several with one name (two waves) each is held against its nearest."""
    within = count = 0
    left = list(other["findings"])
    for one in whole["findings"]:
        same = [two for two in left if (two["term"], two["site"]) == (one["term"], one["site"])]
        if not same:
            continue
        nearest = max(same, key=lambda two: numbers_agreeing(one, two)[0])
        left.remove(nearest)
        agree, of = numbers_agreeing(one, nearest)
        within, count = within + agree, count + of
    return within, count


def main():
    if len(sys.argv) < 4 or len(sys.argv) % 2:
        sys.exit(__doc__)
    invar, differs, within, count = sys.argv[1], False, 0, 0
    for model, recording in zip(sys.argv[2::2], sys.argv[3::2]):
        rows = rows_of(pathlib.Path(recording))
        with open(model, encoding="utf-8") as file:
            has_controller = "\ncontroller:" in file.read()
        cuts = [("whole", rows), ("first half", part(rows, 0.0, 0.5)), ("second half", part(rows, 0.5, 1.0))]
        if not has_controller:
            cuts += [("half the rate", thinned(rows, 2)), ("a tenth of it", thinned(rows, 10))]
        print(recording)
        whole = None
        for name, some in cuts:
            with tempfile.TemporaryDirectory() as folder:
                report = diagnosed(invar, model, some, pathlib.Path(folder))
            whole = whole or report
            agree, of = agreeing(whole, report) if report is not whole else (0, 0)
            within, count = within + agree, count + of
            same = report["verdict"] == whole["verdict"] and names_of(report)[:1] == names_of(whole)[:1]
            differs = differs or not same
            print(f"  {name:14} {len(some) - 1:6} rows  {report['verdict']:16} {' '.join(names_of(report)):60} "
                  f"{agree}/{of} within {SIGMAS:g} sigma{'' if same else '  DIFFERS'}", flush=True)
    print(f"numbers within {SIGMAS:g} sigmas: {within} of {count}")
    return 1 if differs else 0


if __name__ == "__main__":
    sys.exit(main())
