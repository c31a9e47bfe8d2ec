#!/usr/bin/env python3
"""Measures the diagnosis on every set of machines and writes figures alone to tests/bench/results/SET.json.

    tests/bench/how_reliable_measure.py --bin build/bin [--only dev crowd second_crowd real fresh fresh_second fresh_third] [--fresh DIR] [--budget 300]

dev, crowd, real: the scorers of the folder INVAR_SHARED (else `shared` beside the checkout). second_crowd: bench_mismatch --crowd.
fresh: a folder with one folder a set: model.yaml and set.json (tests/bench/fresh), train*.csv, held*_inputs.csv, held*_outputs.csv. In set.json
the answer that the publication gives was written down before the first run. how_reliable.py makes the page from the results.
"""
import argparse
import csv
import datetime
import glob
import json
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SHARED = pathlib.Path(os.environ.get("INVAR_SHARED", ROOT.parent / "shared"))
RESULTS = ROOT / "tests" / "bench" / "results"
RIGHT = 0.9      # credit of a name from which on it counts as right: tests/support/mismatch/claims.hpp
PLAIN = 120.0    # gain from which on an effect is plain: tests/support/mismatch/marks.hpp
FALSE = 0.5      # a name with this probability or more is a claim
GAIN = 0.98      # a curve that takes less than this off the error on other runs is none
WORSE = 1.05     # a model handed over that errs more than this beside the retuned one on other runs is wrong, whatever was said
SETS = ("dev", "crowd", "second_crowd", "real", "fresh", "fresh_second", "fresh_third")
SECOND_CROWD = "--crowd --each 1 --seed 61 --size 2"


def items(value):
    return [v for v in value if isinstance(v, dict)] if isinstance(value, list) else []


def named(report):
    return [f for f in items(report.get("findings")) if f.get("term") != "unmodelled" and isinstance(f.get("probability"), (int, float))]


def claims_of(report, credits, neutral):
    """[[probability, is the name right]] of the names in a report; a neutral name is neither right nor wrong."""
    found = []
    for finding in named(report):
        credit = max([c.get(finding["term"], 0.0) for c in credits], default=0.0)
        if credit == 0.0 and finding["term"] in neutral:
            continue
        found.append([round(finding["probability"], 3), int(credit >= RIGHT)])
    return found


def claims_at(report, chief, neutral):
    """The same where the right name counts at the right place alone."""
    return [[round(f["probability"], 3), int(f["term"] in chief["terms"] and f.get("site") in chief["sites"])]
            for f in named(report) if f["term"] not in neutral]


def loaded(path):
    try:
        return json.loads(pathlib.Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


class Tool:
    """The binaries, with the budget that a busy machine needs."""

    def __init__(self, folder, budget, work):
        self.folder, self.budget = pathlib.Path(folder).resolve(), budget
        self.invar = pathlib.Path(work) / "invar"
        self.invar.write_text(f'#!/bin/sh\nif [ "$1" = diagnose ]; then shift; exec "{self.folder}/invar" diagnose --budget {budget} "$@"; fi\n'
                              f'exec "{self.folder}/invar" "$@"\n')
        self.invar.chmod(0o755)


# ------------------------------------------------------------------ made machines

def challenge(tool, which, work):
    keep, details = f"{work}/{which}", f"{work}/{which}.json"
    folder = SHARED / "challenge" / which
    subprocess.run([sys.executable, SHARED / "challenge" / "score", "--invar", tool.invar, "--cases", folder, "--answers", folder / "answers.json",
                    "--jobs", "1", "--timeout", str(tool.budget + 60), "--keep", keep, "--details", details], stdout=subprocess.DEVNULL, check=True)
    scored = loaded(details)
    claims, hidden = [], 0
    for name, answer in loaded(folder / "answers.json")["cases"].items():
        report = next((loaded(p) for p in glob.glob(f"{keep}/{name}/**/report.json", recursive=True)), {})
        credits = [{n: about["credit"] for n, about in term["names"].items()} for term in answer["terms"]]
        claims += claims_of(report, credits, answer.get("neutral", []))
        hidden += report.get("verdict") == "no_mismatch" and bool(answer["terms"]) and answer["verdict"].get("no_mismatch", 0.0) == 0.0
    marks = ("cases", "verdict", "located", "named", "false_claims", "fit", "median_seconds")
    rows = [{"plant": plant, **{k: about[k] for k in marks}} for plant, about in scored["totals"].items() if plant != "all"]
    return {"totals": {**{k: scored["totals"]["all"][k] for k in marks}, "no_mismatch_beside_chief": hidden}, "rows": rows, "claims": claims}


LINE = re.compile(r"(\w+)\s+(\S+)\s+seed\s+(\d+) size ([\d.]+).* win\s+([-\d.einf]+).*? v ([\d.]+) l ([\d.]+) n ([\d.]+) false (\d+) "
                  r"fit\s+(\S+)\s+([\d.]+) s\s+(\w+):")


def mean(values):
    values = [v for v in values if v is not None and math.isfinite(v)]
    return round(sum(values) / len(values), 3) if values else None


def median(values):
    values = sorted(values)
    return values[len(values) // 2] if values else None


def of_plant(machines):
    return {"cases": len(machines), "verdict": mean(m["verdict"] for m in machines), "located": mean(m["located"] for m in machines if m["lacks"]),
            "named": mean(m["named"] for m in machines if m["lacks"]), "false_claims": sum(m["false"] for m in machines),
            "fit": mean(m["fit"] for m in machines), "median_seconds": median(m["seconds"] for m in machines)}


def second_crowd(tool, work):
    claims = f"{work}/second.txt"
    out = subprocess.run([tool.folder / "bench_mismatch", *SECOND_CROWD.split(), "--claims", claims], capture_output=True, text=True, check=True).stdout
    return crowd_of(out, pathlib.Path(claims).read_text())


def crowd_of(out, claims):
    machines = []
    for line in out.splitlines():
        if found := LINE.match(line):
            plant, effect, _, _, win, verdict, located, name, false, fit, seconds, said = found.groups()
            machines.append({"plant": plant, "effect": effect, "win": float(win), "verdict": float(verdict), "located": float(located), "named": float(name),
                             "false": int(false), "fit": float(fit), "seconds": float(seconds), "said": said, "lacks": effect not in ("none", "parameter")})
    hidden = sum(m["said"] == "no_mismatch" and m["lacks"] and m["win"] >= PLAIN for m in machines)
    rows = [{"plant": p, **of_plant([m for m in machines if m["plant"] == p])} for p in sorted({m["plant"] for m in machines})]
    said = [line.split() for line in claims.splitlines()]
    return {"totals": {**of_plant(machines), "no_mismatch_beside_chief": hidden}, "rows": rows,
            "claims": [[round(float(c[2]), 3), int(float(c[6]) >= RIGHT)] for c in said]}


# ------------------------------------------------------------------ real machines

def real(tool, work):
    keep, details = f"{work}/real", f"{work}/real.json"
    subprocess.run([sys.executable, SHARED / "real" / "score", "--invar", tool.invar, "--jobs", "1", "--timeout", str(tool.budget + 60), "--keep", keep,
                    "--details", details], stdout=subprocess.DEVNULL, check=True)
    rows, claims = [], []
    for part in loaded(details)["parts"]:
        about = next(p for p in loaded(SHARED / "real" / part["case"] / "case.json")["parts"] if p["part"] == part["part"])
        for report in glob.glob(f"{keep}/{part['case']}-{part['part']}*/report.json"):
            claims += claims_of(loaded(report), [f["terms"] for f in about["findings"]], about.get("neutral", []))
        rows.append({"set": part["case"], "part": part["part"], "located": part["located"], "named": part["named"], "false_claims": len(part["refused"]),
                     "level": part["level"], "seconds": round(part["seconds"], 1), "says": sorted(set(part["verdicts"] + part["claims"])),
                     "rmse": {o: {k: v for k, v in (("unit", r["unit"]), ("given", rounded(r["given"])), ("patched", rounded(r["patched"])),
                                                    ("pass", about["rmse"][o].get("pass")))} for o, r in part["rmse"].items()}})
    return {"rows": rows, "claims": claims, "totals": {"cases": len(rows), "located": mean(r["located"] for r in rows), "named": mean(r["named"] for r in rows),
                                                       "false_claims": sum(r["false_claims"] for r in rows), "median_seconds": median(r["seconds"] for r in rows)}}


def rounded(value):
    return None if value is None or not math.isfinite(value) else float(f"{value:.4g}")


def column(path, name):
    with open(path, encoding="utf-8", newline="") as file:
        rows = [r for r in csv.reader(file) if r]
    at = [h.split("[")[0].strip() for h in rows[0]].index(name)
    return [float(r[at]) if at < len(r) and r[at] else math.nan for r in rows[1:]]


def held_out(tool, folder, model, output, work):
    """RMSE of a model over all held-out runs, each begun at its first row."""
    squares, n = 0.0, 0
    for inputs in sorted(glob.glob(f"{folder}/held*_inputs.csv")):
        out = f"{work}/simulated.csv"
        if subprocess.run([tool.invar, "simulate", "--model", model, "--inputs", inputs, "--output", out], capture_output=True).returncode:
            return None
        for was, is_ in zip(column(inputs.replace("_inputs", "_outputs"), output), column(out, output)):
            if math.isfinite(was):
                squares, n = squares + (is_ - was) ** 2, n + 1
    return rounded(math.sqrt(squares / n)) if n else None


def judged(about, report):
    """right, located, honest or wrong; and the highest probability of a false claim."""
    chief, also = about["chief"], about.get("also", [])
    places = items(report.get("location"))
    right, near, false = False, False, 0.0
    for at, finding in enumerate(items(report.get("findings"))):
        term, site, p = finding.get("term"), finding.get("site"), finding.get("probability") or 0.0
        over = places[at].get("depends_on", []) if at < len(places) else []
        here = site in chief["sites"]
        if term == "unmodelled":
            meets = here and (not chief["over"] or bool(set(over) & set(chief["over"])))
            if over and "history" not in over and not meets:
                false = max(false, p)
            near = near or meets
        elif term in chief["terms"] and here:
            right = right or at == 0
            near = True
        elif term not in also:
            false = max(false, p)
    if false >= FALSE:
        return "wrong", false
    if about.get("unknown"):
        return "honest", false
    if about.get("null"):
        return ("right" if not items(report.get("findings")) else "honest"), false
    if report.get("verdict") == "ambiguous":
        return "honest", false
    return "right" if right else "located" if near else "honest", false


def in_words(finding, place):
    what = (f"{finding['term']} at {finding['site']}" if finding["term"] != "unmodelled"
            else f"no name, {finding['site']} over {', '.join(place.get('depends_on') or ['nothing'])}")
    return f"{what} ({finding['probability']:.2f})"


def look(tool, folder, work):
    about, out = loaded(f"{folder}/set.json"), f"{work}/{folder.name}"
    command = [tool.invar, "diagnose", "--model", folder / "model.yaml", "--out", out]
    for recording in about["recordings"]:
        command += ["--recording", folder / recording]
    begin = time.monotonic()
    status = subprocess.run(command, capture_output=True, text=True)
    seconds = round(time.monotonic() - begin, 1)
    row = {"set": folder.name, **{k: about[k] for k in ("source", "licence", "rows", "task", "expected")}, "seconds": seconds}
    if status.returncode:
        return {**row, "judged": "wrong", "said": status.stderr.strip().splitlines()[-1], "false": 0.0, "rmse": {}}, []
    report = loaded(f"{out}/report.json")
    said = [in_words(f, p) for f, p in zip(items(report["findings"]), items(report["location"]) + [{}] * 9)]
    row["said"] = report["verdict"] + (": " + "; ".join(said) if said else "")
    row["judged"], row["false"] = judged(about, report)
    row["rmse"] = {o: {"unit": unit, **{k: held_out(tool, folder, m, o, work) for k, m in
                                        (("before", folder / "model.yaml"), ("retuned", f"{out}/retuned.yaml"), ("after", f"{out}/patched.yaml"))}}
                   for o, unit in about["outputs"].items()}
    if any(e["after"] is not None and e["retuned"] is not None and e["after"] > WORSE * e["retuned"] for e in row["rmse"].values()):
        row["judged"] = "wrong"
    if row["judged"] == "located" and not any(e["after"] is not None and e["after"] < GAIN * e["retuned"] for e in row["rmse"].values()):
        row["judged"] = "honest"            # a place alone, with nothing fitted there
    if not about.get("unknown"):
        return row, claims_at(report, about["chief"], about.get("also", []))
    return row, []


def fresh(tool, work, where):
    rows, claims = [], []
    for folder in sorted(p.parent for p in pathlib.Path(where).glob("*/set.json")):
        row, of_row = look(tool, folder, work)
        rows.append(row)
        claims += of_row
        print(f"{row['set']:18s} {row['judged']:8s} {row['said']}", flush=True)
    return {"rows": rows, "claims": claims, "totals": {"cases": len(rows), "false_claims": sum(r["false"] >= FALSE for r in rows),
                                                       "judged": {k: sum(r["judged"] == k for r in rows) for k in ("right", "located", "honest", "wrong")},
                                                       "median_seconds": median(r["seconds"] for r in rows)}}


# ------------------------------------------------------------------ all

def commit():
    return subprocess.run(["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], capture_output=True, text=True).stdout.strip()


def main():
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--bin", required=True, help="folder of invar and bench_mismatch")
    ask.add_argument("--only", nargs="+", choices=SETS, default=SETS[:4])
    ask.add_argument("--fresh", metavar="DIR", help="folder of the fresh sets")
    ask.add_argument("--budget", type=int, default=300, help="seconds of a diagnosis; beside other load the usual 60 cut it")
    given = ask.parse_args()
    RESULTS.mkdir(exist_ok=True)
    for which in given.only:
        if which.startswith("fresh") and not given.fresh:
            ask.error(f"--only {which} needs --fresh DIR")
        with tempfile.TemporaryDirectory() as work:
            tool = Tool(given.bin, given.budget, work)
            before = os.getloadavg()[0]
            measured = (challenge(tool, which, work) if which in ("dev", "crowd") else second_crowd(tool, work) if which == "second_crowd"
                        else real(tool, work) if which == "real" else fresh(tool, work, given.fresh))
        result = {"command": f"tests/bench/how_reliable_measure.py --bin build/bin --only {which}" + (" --fresh DIR" if which.startswith("fresh") else ""),
                  "date": datetime.date.today().isoformat(), "commit": commit(), "load": [round(before, 1), round(os.getloadavg()[0], 1)], **measured}
        (RESULTS / f"{which}.json").write_text(json.dumps(result, indent=1) + "\n")
        print(which, result["totals"], flush=True)


if __name__ == "__main__":
    main()
