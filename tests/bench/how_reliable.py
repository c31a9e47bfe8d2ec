#!/usr/bin/env python3
"""Sections and diagram of docs/explanation/how-reliable.md from the sets of tests/bench/results/*.json that how_reliable_measure.py
writes; figures.py makes the pages, and called as a program this file does what figures.py does.
"""
import json
import math
import sys

from result_tables import RESULTS, table

BINS = 10
SETS = {"dev": "synthetic machines, one effect each",
        "crowd": "synthetic machines, a crowd of small effects beside the chief one",
        "second_crowd": "second crowd, drawn by `bench_mismatch`",
        "real": "recordings of real machines",
        "fresh": "fresh public recordings",
        "fresh_second": "fresh public recordings, second batch",
        "fresh_third": "fresh public recordings, third batch"}
WANTED = {"dev": {"verdict": 0.97, "located": 0.97, "named": 0.97, "fit": 0.97, "false_claims": 0},
          "crowd": {"verdict": 0.95, "located": 0.95, "named": 0.92, "fit": 0.92, "false_claims": 0},
          "second_crowd": {"verdict": 0.92, "located": 0.92, "named": 0.89, "fit": 0.89, "false_claims": 0}}
MARKS = ("verdict", "located", "named", "fit", "false_claims")
JUDGED = {"right": "right", "located": "right place and variable, no name", "honest": "honest abstention", "wrong": "wrong"}


def number(value, digits=3):
    if value is None:
        return ""
    if isinstance(value, int):
        return str(value)
    return f"{value:.{digits}f}".rstrip("0").rstrip(".") if abs(value) < 1 else f"{value:.4g}"


def made_by(result):
    return f"`{result['command']}`, {result['date']}, commit {result['commit']}, load {result['load'][0]:g} to {result['load'][1]:g}."


# ------------------------------------------------------------------ probabilities

def bins_of(claims):
    """[(mean said, share that holds, count)] of ten bins of equal width."""
    all_bins = [[] for _ in range(BINS)]
    for said, held in claims:
        all_bins[min(BINS - 1, int(BINS * said))].append((said, held))
    return [(sum(s for s, _ in b) / len(b), sum(h for _, h in b) / len(b), len(b)) for b in all_bins if b]


def calibration_error(claims):
    return sum(abs(said - held) * n for said, held, n in bins_of(claims)) / len(claims) if claims else None


def likely(held, n, z=1.96):
    """Wilson's interval of a share."""
    middle, half = (held + z * z / (2 * n)) / (1 + z * z / n), z / (1 + z * z / n) * math.sqrt(held * (1 - held) / n + z * z / (4 * n * n))
    return max(0.0, middle - half), min(1.0, middle + half)


def diagram(claims):
    """SVG that reads on a light and on a dark page."""
    left, top, size = 60, 20, 300
    at = lambda said, held: (left + size * said, top + size * (1.0 - held))
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {left + size + 20} {top + size + 56}" width="{left + size + 20}" role="img" '
             'font-family="sans-serif" font-size="12"><title>Stated probability of a name against the share of names that are right</title>',
             '<style>.line{stroke:#57606a}.text{fill:#57606a}.mark{fill:#0969da}.bar{stroke:#0969da}'
             '@media (prefers-color-scheme:dark){.line{stroke:#9198a1}.text{fill:#9198a1}.mark{fill:#58a6ff}.bar{stroke:#58a6ff}}</style>',
             f'<rect class="line" x="{left}" y="{top}" width="{size}" height="{size}" fill="none"/>',
             f'<line class="line" stroke-dasharray="4 4" x1="{left}" y1="{top + size}" x2="{left + size}" y2="{top}"/>']
    for step in range(0, 11, 2):
        x, y = at(step / 10, step / 10)
        parts.append(f'<text class="text" x="{x:.0f}" y="{top + size + 18}" text-anchor="middle">{step / 10:g}</text>')
        parts.append(f'<text class="text" x="{left - 8}" y="{y + 4:.0f}" text-anchor="end">{step / 10:g}</text>')
    for said, held, n in bins_of(claims):
        low, high = likely(held, n)
        x, y = at(said, held)
        parts.append(f'<line class="bar" x1="{x:.1f}" y1="{at(0, low)[1]:.1f}" x2="{x:.1f}" y2="{at(0, high)[1]:.1f}"/>')
        parts.append(f'<circle class="mark" cx="{x:.1f}" cy="{y:.1f}" r="{2 + math.sqrt(n) / 2:.1f}">'
                     f'<title>said {said:.2f}, right {held:.2f} of {n}</title></circle>')
    parts.append(f'<text class="text" x="{left + size / 2:.0f}" y="{top + size + 44}" text-anchor="middle">stated probability</text>')
    parts.append(f'<text class="text" transform="translate(16 {top + size / 2:.0f}) rotate(-90)" text-anchor="middle">share that is right</text></svg>')
    return "\n".join(parts) + "\n"


# ------------------------------------------------------------------ sections

def summary(results):
    rows = []
    for which, title in SETS.items():
        if which not in results:
            continue
        totals, wanted = results[which]["totals"], WANTED.get(which, {})
        row = [f"[{title}](#{anchor(which)})", str(totals["cases"])]
        for mark in MARKS:
            got = totals.get(mark)
            missed = mark in wanted and got is not None and (got > wanted[mark] if mark == "false_claims" else got < wanted[mark])
            row.append(number(got) + (f" (wanted {wanted[mark]:g})" if missed else ""))
        rows.append(row + [number(totals.get("median_seconds"), 2)])
    return table(["set", "machines", "verdict", "located", "named", "fit", "false claims", "median s"], rows)


def anchor(which):
    return HEADS[which].lower().replace(" ", "-").replace(",", "")


HEADS = {"dev": "Synthetic machines", "crowd": "Crowd", "second_crowd": "Second crowd", "real": "Real machines", "fresh": "Fresh public recordings",
         "fresh_second": "Fresh public recordings, second batch", "fresh_third": "Fresh public recordings, third batch"}


def by_plant(result):
    rows = [[r["plant"].replace("_", " "), str(r["cases"])] + [number(r[m]) for m in MARKS] + [number(r["median_seconds"], 2)] for r in result["rows"]]
    text = table(["plant", "machines", "verdict", "located", "named", "fit", "false claims", "median s"], rows)
    return text + f"\n\n`no_mismatch` beside a chief effect: {result['totals']['no_mismatch_beside_chief']}."


def of_real(result):
    rows = []
    for r in result["rows"]:
        errors = "; ".join(f"{o} {number(e['given'])} to {number(e['patched'])} {e['unit']}" + (f" (bar {number(e['pass'])})" if e["pass"] is not None else "")
                           for o, e in r["rmse"].items())
        rows.append([r["set"], r["part"], number(r["located"], 2), number(r["named"], 2), str(r["false_claims"]), r["level"], errors,
                     ", ".join(r["says"]).replace("_", " "), number(r["seconds"])])
    return table(["set", "part", "located", "named", "false claims", "level", "error on a run that no fit saw, given to patched",
                  "said", "s"], rows)


def of_fresh(result):
    totals = result["totals"]
    lines = [f"{totals['cases']} recordings: " + ", ".join(f"{totals['judged'][k]} {name}" for k, name in JUDGED.items()) + ". "
             f"A false claim of 50 % or more stands in {totals['false_claims']}.", ""]
    rows = []
    for r in result["rows"]:
        errors = "; ".join(f"{o} {number(e['before'])}, {number(e['retuned'])}, {number(e['after'])}" + (f" {e['unit']}" if e["unit"] else "")
                           for o, e in r["rmse"].items())
        rows.append([r["set"], r["task"], r["expected"], r["said"].replace("_", " "), JUDGED[r["judged"]],
                     f"{100 * r['false']:.3g} %" if r["false"] else "none", errors, number(r["seconds"])])
    lines.append(table(["set", "model and machine", "expected before the run", "said (probability)", "judged", "highest false claim",
                        "held-out RMSE before, retuned, after", "s"], rows))
    lines += ["", "Sources:", ""]
    lines += [f"- {r['set']}: {r['source']}; licence: {r['licence']}; fitted and held out: {r['rows']}." for r in result["rows"]]
    return "\n".join(lines)


INTRO = """# How reliable a diagnosis is

Measured figures of `invar diagnose`. [Diagnosis](diagnosis.md) says how it decides.
This page is made from `tests/bench/results/*.json` by `tests/bench/figures.py`; a test compares them. Do not edit it by hand.

## Summary

Marks are means over machines from 0 to 1. `located` is the right place, `named` the right name, `fit` the share of the possible gain on a run that no fit saw.
False claims are counted. Seconds are wall time beside other load (see each section), with `--budget 300`.
"""
PROBABILITY = """## Probabilities

A name that is stated with 0.8 should be right eight times of ten. The diagram has all names of all sets; a bar is the 95 % interval of the share.
Curves without a name are no names. Relatives of effects that belong to a crowd are left out.
"""
NOTES = {
    "dev": "Forty-two machines of five plants, each with no effect, one or two; the truth models are no code of Invar.",
    "crowd": "Twenty machines. The chief effect has 80 to 95 % of the mismatch; four to six unlisted effects have 0.5 to 4 % each.",
    "second_crowd": """Machines of all six plants and all effects, each beside three to six unlisted effects of 0.5 to 4 %.
Noise of five colours; a third of the files have gaps and outliers. `explained` counts half unless the model foretells to the noise, `ambiguous` half unless the chief effect has a twin.""",
    "real": "Recordings with known answers that the engine was developed beside.",
    "fresh": """Recordings that nobody tuned on. The model is a plain first model.
The answer of the publication was written down before the run, and each set was looked at once.
`right place and variable, no name` means a curve over the right variable at the right place.
`honest abstention` means that no name of 50 % or more is false.
`wrong` means a false one, or a patched model that errs 5 % more than the retuned one on the other run.
`openarm-moving` was prepared after the first look at `openarm-joint`.""",
    "fresh_second": """Seven more, likewise looked at once, after the engine had been changed.
Diagnoses beside much load were cut by their budget (`cart-law`, `free-arm`, `ball-on-beam`).""",
    "fresh_third": """Nine more. At the first look three were right, two right place and variable, one an abstention, and three wrong, each with a false claim.
Those of `pneumatic-seal` (0.995) and `belt-drives` (0.9) showed two kinds of error: a curve over one of two inputs that run alike, and a place where nothing was fitted.
The table has the second look, after both were mended. The speed of `pneumatic-seal` has nearly two levels, so that viscous friction takes most of dry friction.
`tank-valve` counts as wrong: a curve over the pump's voltage stands first, which was expected beside the outflow. Its other run may have another valve setting.""",
}


def page(results):
    claims = [c for r in results.values() for c in r.get("claims", [])]
    parts = [INTRO, summary(results), "", PROBABILITY, "![Stated probability against the share that is right](how-reliable.svg)", ""]
    rows = [[f"{said:.2f}", f"{held:.2f}", "{:.2f} to {:.2f}".format(*likely(held, n)), str(n)] for said, held, n in bins_of(claims)]
    parts += [table(["said", "right", "95 % interval", "names"], rows), ""]
    rows = [[SETS[w], str(len(r["claims"])), number(calibration_error(r["claims"]))] for w, r in results.items() if r.get("claims")]
    parts += [table(["set", "names", "expected calibration error"], rows + [["all", str(len(claims)), number(calibration_error(claims))]]), ""]
    for which, result in results.items():
        section = of_real(result) if which == "real" else of_fresh(result) if which.startswith("fresh") else by_plant(result)
        parts += [f"## {HEADS[which]}", "", NOTES[which], made_by(result), "", section, ""]
    return "\n".join(parts).rstrip() + "\n", diagram(claims)


def results():
    """The results of the sets, by name."""
    return {which: json.loads(path.read_text(encoding="utf-8")) for which in SETS if (path := RESULTS / f"{which}.json").exists()}


if __name__ == "__main__":
    import figures
    sys.exit(figures.main())
