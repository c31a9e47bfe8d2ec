#!/usr/bin/env python3
"""Runs `invar diagnose` over every case there is and checks what must hold of its answer, whatever the machine.

    tests/bench/invariants.py build/bin/invar [--only WORD ...] [--jobs 1] [--timeout 300] [--details FILE]

The cases: challenge/dev, challenge/crowd, real and cases of the folder INVAR_SHARED (else `shared` beside the checkout). Each is diagnosed with
its other recording as --check; then `invar simulate` runs the model given, retuned.yaml and patched.yaml over that recording.

    noise     an output is left above twice its noise, and the verdict is no_mismatch, parameters_only or explained
    said      "No mismatch" or "Only parameters" stands beside a number that says otherwise
    heldout   on stretches that a fit did not see, patched is worse than retuned, or retuned worse than the model given
    other     the same on the other recording, and `worse_on` does not name it (or the summary, the page, patched.yaml do not)
    nothing   a finding has a share of nothing, or each of its sizes is zero
    table     a term that was fitted is described as a table, or as an effect that no term describes
    diverged  the page draws a run that diverged
    report    no report was written

Prints a line for each violation and a table by case set. Exit status 1 where one was found. Python standard library alone.
"""
import argparse
import concurrent.futures
import csv
import gzip
import json
import math
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SHARED = pathlib.Path(os.environ.get("INVAR_SHARED", ROOT.parent / "shared"))
TIMES_NOISE = 2.0    # design: a residual above twice the noise is mismatch
BY_CHANCE = 1.1      # the RMS of fifty independent values is uncertain by a tenth
NOTHING = 1e-3       # a share of what the retuned model leaves
FEWEST = 8           # values of an output that are worth a comparison
ABSURD = 1e30        # in the unit of the axis of a plot: no machine goes there
KINDS = ("noise", "said", "heldout", "other", "nothing", "table", "diverged", "report")
CLEAN = ("no_mismatch", "parameters_only", "explained")

# Of shared/cases: folder, model, recordings, other recording, is its start a guess.
SMALL = [
    ("check-worse-unsaid", "beam.yaml", ["beam.csv"], "beam-held.csv", True),
    ("check-worse-unsaid", "heater.yaml", ["heater.csv"], "heater-held.csv", False),
    ("check-worse-unsaid", "motor.yaml", ["motor.csv"], "motor-held.csv", False),
    ("cogging-closed-loop-missed", "model.yaml", ["train.csv"], "held.csv", False),
    ("cogging-closed-loop-missed", "with-ripple.yaml", ["train.csv"], "held.csv", False),
    ("cogging-closed-loop-missed", "open-loop.yaml", ["open-loop.csv"], None, False),
    ("cogging-named-disturbance", "model.yaml", ["first-half-of-first.csv"], "second.csv", False),
    ("cogging-named-disturbance", "model.yaml", ["first.csv"], "second.csv", False),
    ("cogging-named-disturbance", "model.yaml", ["second.csv"], "first.csv", False),
    ("cogging-named-disturbance", "model.yaml", ["first.csv", "second.csv"], None, False),
    ("dry-friction-rejected", "model.yaml", ["train.csv"], "held.csv", False),
    ("dry-friction-rejected", "with-friction.yaml", ["train.csv"], "held.csv", False),
    ("friction-from-torque-speed", "model.yaml", ["train.csv"], "held.csv", False),
    ("hidden-state-of-nothing", "model.yaml", ["train.csv"], None, False),
    ("hotend-shrug-at-full-rate", "model.yaml", ["full.csv"], "held.csv", False),
    ("hotend-shrug-at-full-rate", "model.yaml", ["tenth.csv"], "held.csv", False),
    ("hotend-shrug-at-full-rate", "with-lag.yaml", ["full.csv"], "held.csv", False),
    ("null-sensor-claims-curve", "with-latency.yaml", ["train.csv"], "held.csv", False),
    ("null-sensor-claims-curve", "with-latency.yaml", ["short.csv"], "held.csv", False),
    ("null-sensor-claims-curve", "model.yaml", ["train.csv"], "held.csv", False),
    ("outliers-of-quantisation", "hotend.yaml", ["hotend.csv"], None, False),
    ("outliers-of-quantisation", "leak.yaml", ["leak.csv"], None, False),
    ("report-plots-1e97", "model.yaml", ["train.csv"], "held.csv", False),
]


class Job:
    def __init__(self, kind, name, model, recordings, others, fits_start=False):
        self.kind, self.name, self.model, self.recordings = kind, name, model, recordings
        self.others = others          # [(inputs, outputs or None)]
        self.fits_start = fits_start


def beside(inputs):
    return pathlib.Path(str(inputs).replace("_inputs", "_outputs"))


def challenge(which):
    for folder in sorted((SHARED / "challenge" / which).glob("*/")):
        if (folder / "model.yaml").exists():
            test = folder / "test_inputs.csv.gz"
            yield Job(which, folder.name, folder / "model.yaml", sorted(folder.glob("recording*.csv.gz")),
                      [(test, beside(test))] if test.exists() else [])


def real():
    for file in sorted((SHARED / "real").glob("*/case.json")):
        folder = file.parent
        for part in json.loads(file.read_text())["parts"]:
            tests = sorted(t for pattern in part["tests"] for t in folder.glob(pattern))
            yield Job("real", f"{folder.name}/{part['part']}", folder / part["model"], [folder / r for r in part["recordings"]],
                      [(t, beside(t)) for t in tests], "start_fit" in part)


def small():
    for folder, model, recordings, other, fits_start in SMALL:
        at = SHARED / "cases" / folder
        if at.exists():
            name = f"{folder}/{model.removesuffix('.yaml')}, {'+'.join(r.removesuffix('.csv') for r in recordings)}"
            yield Job("cases", name, at / model, [at / r for r in recordings], [(at / other, None)] if other else [], fits_start)


def run(command, limit):
    """Exit status (None: past the limit), both outputs, seconds."""
    begin = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        try:
            out, err = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return None, "", "", time.monotonic() - begin
    return process.returncode, out, err, time.monotonic() - begin


# ------------------------------------------------------------------ the page

def drawn_absurdly(page):
    """A number on a plot of the page that no machine reaches."""
    for svg in re.findall(r"<svg.*?</svg>", page, re.S):
        for text in re.findall(r">\s*(-?[0-9.]+e\+?[0-9]+)\s*<", svg):
            if abs(float(text)) > ABSURD:
                return text
    return None


# ------------------------------------------------------------------ another recording

def columns(path):
    opened = gzip.open(path, "rt") if str(path).endswith(".gz") else open(path, encoding="utf-8")
    with opened as text:
        rows = [r for r in csv.reader(text) if r]
    names = [c.split("[")[0].strip() for c in rows[0]]
    def number(cell):
        try:
            return float(cell)
        except ValueError:
            return math.nan
    return {n: [number(r[i]) if i < len(r) else math.nan for r in rows[1:]] for i, n in enumerate(names)}


def error(simulated, measured):
    """RMS of the difference, row by row; infinity where the simulation diverged; None where there is nothing to compare."""
    pairs = [(s, m) for s, m in zip(simulated, measured) if math.isfinite(m)]
    if len(pairs) < FEWEST:
        return None
    if not all(math.isfinite(s) and abs(s) < 1e150 for s, _ in pairs):
        return math.inf
    return math.sqrt(sum((s - m) ** 2 for s, m in pairs) / len(pairs))


def is_worse(one, than, noise):
    """By more than chance and the noise: differences far below what the instrument adds are none."""
    return one > BY_CHANCE * than and one * one - than * than > 0.25 * noise * noise


def worse_output(rows, one, than):
    """The first output of which a model errs more than another, where the other outputs do not make up for it."""
    rows = {s: r for s, r in rows.items() if r["before"] > 0.0}  # else no more than a start value was recorded
    worse = [s for s, r in rows.items() if is_worse(r[one], r[than], r["noise_floor"])]
    gain = sum(math.log(max(r[than], 1e-300) / max(r[one], 1e-300)) for r in rows.values() if max(r[one], r[than]) > 0.0)
    grossly = any(rows[s][one] > 1.5 * rows[s][than] for s in worse)
    return worse[0] if worse and (grossly or gain < 0.0) else None


# ------------------------------------------------------------------ a case

def faults_of_report(report, summary, page, patched):
    verdict, fit = report["verdict"], report["fit"]
    over = {s: r["after"] / r["noise_floor"] for s, r in fit["heldout"].items() if r["noise_floor"] > 0.0}
    top = max(over.values(), default=0.0)
    if verdict in CLEAN and top > TIMES_NOISE:
        yield "noise", f"{verdict} beside {top:.1f} times the noise"
    said = re.search(r"(?:explains the recording to|what remains is) ([0-9.e+]+) times", summary)
    if summary.startswith(("No mismatch", "Only parameters")) and (said and float(said[1]) > TIMES_NOISE or top > TIMES_NOISE):
        yield "said", f"`{summary.split(':')[0]}` beside {float(said[1]) if said else top:.1f} times the noise"
    for one, than in (("after", "retuned"), ("retuned", "before")):
        if at := worse_output(fit["heldout"], one, than):
            row = fit["heldout"][at]
            yield "heldout", f"{at}: {than} {row[than]:.3g}, {one} {row[one]:.3g} {row['unit']}"
    for finding in report["findings"]:
        sizes = [abs(p["value"]) for p in finding["parameters"].values()] + [abs(v) for v in finding.get("curve", {}).get("values", [])]
        # A place that has neither a name nor a curve (`unmodelled` alone) is said by itself.
        share = max(finding["share"], finding.get("share_of_rest", 0.0))
        if share < NOTHING and (sizes or "stand_in" in finding) or sizes and max(sizes) < 1e-12:
            yield "nothing", f"{finding['term']} {finding.get('stand_in', '')} share {share:.2g}"
        if "stand_in" in finding and "as a table" in finding["description"]:
            yield "table", f"{finding['stand_in']} is described as a table"
    if re.search(r"no known term describes it; patched.yaml has", summary):
        yield "table", "a fitted term is called what no term describes"
    if number := drawn_absurdly(page):
        yield "diverged", f"an axis of a plot reads {number}"


def faults_of_other(job, program, out, report, summary, page, patched, limit):
    """What the recordings that no fit saw say, by running `invar simulate` (a start that is a guess: by the report)."""
    named = set(report.get("worse_on", []))
    for inputs, outputs in job.others:
        rows = report["fit"].get("other_recordings", {}).get(inputs.name)
        if rows is None:
            continue
        worse = [f"{at}: {than} {rows[at][than]:.3g}, {one} {rows[at][one]:.3g} {rows[at]['unit']}"
                 for one, than in (("after", "retuned"), ("retuned", "before")) if (at := worse_output(rows, one, than))]
        is_told = inputs.name in named and inputs.name in patched.split("\ninvar_model")[0] and f"Worse on {inputs.name}" in summary and f"Worse on {inputs.name}" in page
        if worse and not is_told:
            yield "other", f"{inputs.name}: {worse[0]}"
        if job.fits_start or rows is None or report.get("data", {}).get("looked_at", "").find("windows") >= 0:
            continue
        errors = {}
        for what, model in (("before", job.model), ("retuned", out / "retuned.yaml"), ("after", out / "patched.yaml")):
            table = out / f"{what}.csv"
            status, _, _, _ = run([program, "simulate", "--model", str(model), "--inputs", str(inputs), "--output", str(table)], limit)
            if status == 0:
                simulated, measured = columns(table), columns(outputs or inputs)
                errors[what] = {n: error(v, measured[n]) for n, v in simulated.items() if n in measured}
        if {"before", "retuned", "after"} <= errors.keys() and not is_told:
            # The noise in the column's own unit is not known here: chance alone is allowed for.
            rows = {n: {what: errors[what][n] for what in errors} | {"noise_floor": 0.0} for n in errors["after"]
                    if n not in ("t", "time") and all(errors[what].get(n) is not None for what in errors)}
            for one, than in (("after", "retuned"), ("retuned", "before")):
                if at := worse_output(rows, one, than):
                    yield "other", f"{inputs.name}, simulated: {at}: {than} {rows[at][than]:.3g}, {one} {rows[at][one]:.3g}"


def judge(job, program, limit):
    got = {"kind": job.kind, "name": job.name, "verdict": "", "seconds": 0.0, "faults": []}
    with tempfile.TemporaryDirectory(prefix="invariants-") as folder:
        out = pathlib.Path(folder)
        command = [program, "diagnose", "--model", str(job.model), "--out", str(out)]
        for recording in job.recordings:
            command += ["--recording", str(recording)]
        for inputs, outputs in job.others:
            command += ["--check", str(inputs)]
            if outputs:
                command += ["--check-outputs", str(outputs)]
        if job.fits_start and job.others:
            command += ["--check-fits-start"]
        status, summary, err, got["seconds"] = run(command, limit)
        if status != 0:
            got["faults"].append(("report", "no answer in time" if status is None else err.strip().splitlines()[-1] if err.strip() else f"exit {status}"))
            return got
        report = json.loads((out / "report.json").read_text())
        page, patched = (out / "report.html").read_text(), (out / "patched.yaml").read_text()
        got["verdict"] = report["verdict"] + "".join(f" {f['term']}{'/' + f['stand_in'] if 'stand_in' in f else ''}" for f in report["findings"])
        got["faults"] += faults_of_report(report, summary, page, patched)
        others = list(faults_of_other(job, program, out, report, summary, page, patched, limit))
        got["faults"] += others[:1]  # one other recording of many is enough to be told
    return got


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("invar")
    parser.add_argument("--only", nargs="*", default=[], help="words, one of which stands in `set/case`")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--timeout", type=float, default=300.0)
    parser.add_argument("--details")
    options = parser.parse_args()
    jobs = [j for j in [*small(), *real(), *challenge("crowd"), *challenge("dev")]
            if not options.only or any(word in f"{j.kind}/{j.name}" for word in options.only)]
    if not jobs:
        sys.exit(f"{SHARED} holds no case of these names; INVAR_SHARED names the folder")
    results = []
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for got in pool.map(lambda j: judge(j, options.invar, options.timeout), jobs):
            results.append(got)
            print(f"{got['kind']}/{got['name']}: {got['verdict']} ({got['seconds']:.1f} s)", flush=True)
            for kind, text in got["faults"]:
                print(f"    {kind}: {text}", flush=True)
    print(f"\n| {'set':8} | cases | " + " | ".join(KINDS) + " |\n| --- | --- |" + " --- |" * len(KINDS))
    for which in ("cases", "real", "crowd", "dev"):
        mine = [r for r in results if r["kind"] == which]
        if mine:
            counts = [sum(any(k == kind for k, _ in r["faults"]) for r in mine) for kind in KINDS]
            print(f"| {which:8} | {len(mine):5} | " + " | ".join(f"{c:{len(k)}}" for c, k in zip(counts, KINDS)) + " |")
    if options.details:
        pathlib.Path(options.details).write_text(json.dumps(results, indent=1))
    sys.exit(1 if any(r["faults"] for r in results) else 0)


if __name__ == "__main__":
    main()
