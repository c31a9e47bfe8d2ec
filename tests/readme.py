#!/usr/bin/env python3
"""The picture and the figures of README.md come from one run of a cell; a test runs the cell again and compares.

  tests/readme.py draw FOLDER               draws docs/pictures/*.svg from a run's folder: tools/run && tests/readme.py draw out/xy-table
  tests/readme.py figures SUMMARY FOLDER    compares the block of README.md and the pictures with what a run printed and wrote
  tests/readme.py check                     README.md has at most 90 lines, its pictures and its folders exist, each folder is named
  tests/readme.py self-test                 each kind of fault is seen

The numbers of two runs may differ by a tenth of the larger one, places in a picture by one pixel: another processor rounds otherwise."""
import csv
import html
import math
import pathlib
import re
import sys
import tempfile

import tutorials

ROOT = pathlib.Path(__file__).resolve().parent.parent
PICTURES = "docs/pictures"
MOST_LINES = 90
PIXEL = 1.0  # a place in the picture may differ by so much
COLOURS = {"light": {"ink": "#1f2328", "soft": "#57606a", "line": "#d0d7de", "box": "#f6f8fa", "before": "#bf8700", "after": "#0969da"},
           "dark": {"ink": "#e6edf3", "soft": "#9198a1", "line": "#444c56", "box": "#161b22", "before": "#d29922", "after": "#58a6ff"}}
# The cell, left in the picture: (title, words) of each process, joined by DDS.
PROCESSES = [("motion, 1 kHz", "stage, fusion, compensation"), ("heat, 10 Hz", "heater loop over Modbus TCP"),
             ("dispenser and camera", "droplets jetted and measured"), ("calibration, recorder", "jobs, models, MCAP files")]


def errors(file):
    """{line: [(way [mm], error [um])]} of displacement lines: displacement less the way from the line's first point."""
    found = {}
    with open(file, encoding="utf-8") as text:
        for row in csv.DictReader(text):
            place = [float(row[f"{axis} [m]"]) for axis in "xyz"]
            first = found.setdefault(row["line"], (place, []))[0]
            way = math.dist(place, first)
            found[row["line"]][1].append((1e3 * way, 1e6 * (float(row["displacement [m]"]) - way)))
    return {line: points for line, (_, points) in found.items()}


def cell(colours):
    """SVG of the cell: its processes as boxes on one bus."""
    parts = []
    for k, (title, words) in enumerate(PROCESSES):
        y = 44 + 62 * k
        parts += [f'<rect x="16" y="{y}" width="226" height="50" rx="6" fill="{colours["box"]}" stroke="{colours["line"]}"/>',
                  f'<text x="28" y="{y + 21}" fill="{colours["ink"]}" font-weight="bold">{html.escape(title)}</text>',
                  f'<text x="28" y="{y + 39}" fill="{colours["soft"]}">{html.escape(words)}</text>',
                  f'<line x1="242" y1="{y + 25}" x2="272" y2="{y + 25}" stroke="{colours["after"]}" stroke-width="2"/>']
    parts.append(f'<line x1="272" y1="40" x2="272" y2="284" stroke="{colours["after"]}" stroke-width="4"/>')
    parts.append(f'<text x="288" y="162" fill="{colours["after"]}" font-weight="bold" transform="rotate(90 288 162)" text-anchor="middle">DDS</text>')
    return parts


def plot(runs, colours):
    """SVG of the error along the lines that no fit used, before and after the correction."""
    left, right, top, bottom = 380, 850, 44, 268
    points = [point for lines in runs.values() for line in lines.values() for point in line]
    longest = 50 * math.ceil(max(x for x, _ in points) / 50)
    low, high = (5 * rounded(edge(y for _, y in points) / 5) for rounded, edge in ((math.floor, min), (math.ceil, max)))
    at = lambda x, y: (left + (right - left) * x / longest, bottom - (bottom - top) * (y - low) / (high - low))
    parts = []
    for mark in range(low, high + 1, 5):
        y = at(0, mark)[1]
        parts += [f'<line x1="{left}" y1="{y:.1f}" x2="{right}" y2="{y:.1f}" stroke="{colours["line"]}"/>',
                  f'<text x="{left - 8}" y="{y + 4:.1f}" fill="{colours["soft"]}" text-anchor="end">{mark}</text>']
    for mark in range(0, longest + 1, 50):
        parts.append(f'<text x="{at(mark, 0)[0]:.1f}" y="{bottom + 18}" fill="{colours["soft"]}" text-anchor="middle">{mark}</text>')
    parts += [f'<text x="{(left + right) / 2}" y="{bottom + 38}" fill="{colours["soft"]}" text-anchor="middle">way along the line [mm]</text>',
              f'<text x="{left - 36}" y="{(top + bottom) / 2}" fill="{colours["soft"]}" text-anchor="middle" '
              f'transform="rotate(-90 {left - 36} {(top + bottom) / 2})">displacement error [um]</text>']
    for k, (name, lines) in enumerate(runs.items()):
        for line in lines.values():
            for sweep in sweeps(line):
                way = " ".join("{:.1f},{:.1f}".format(*at(*point)) for point in sweep)
                parts.append(f'<polyline points="{way}" fill="none" stroke="{colours[name]}" stroke-width="2"/>')
        words = f"{name} correction: rms {shown(rms(lines))}"
        parts += [f'<line x1="{left + 250 * k}" y1="26" x2="{left + 24 + 250 * k}" y2="26" stroke="{colours[name]}" stroke-width="3"/>',
                  f'<text x="{left + 32 + 250 * k}" y="30" fill="{colours["ink"]}">{words}</text>']
    return parts


def sweeps(line):
    """The line's points in runs of one direction: out, then back."""
    runs = [[line[0]]]
    for before, point in zip(line, line[1:]):
        if len(runs[-1]) > 1 and (point[0] - before[0]) * (runs[-1][1][0] - runs[-1][0][0]) <= 0:
            runs.append([])
        runs[-1].append(point)
    return runs


def rms(lines):
    """[um], of all points of all lines."""
    values = [y for line in lines.values() for _, y in line]
    return math.sqrt(sum(y * y for y in values) / len(values))


def shown(um):
    return f"{um:.3g} um" if um >= 1 else f"{1e3 * um:.3g} nm"


def pictures(folder):
    """{path: text} of both pictures, from the folder of a run."""
    runs = {name: errors(folder / f"verify_{name}.csv") for name in ("before", "after")}
    made = {}
    for name, colours in COLOURS.items():
        title = f"A cell on DDS, and the error of its XY table: {shown(rms(runs['before']))} rms before, {shown(rms(runs['after']))} after"
        made[f"{PICTURES}/xy-table-{name}.svg"] = "\n".join(
            ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 870 320" width="870" role="img" font-family="sans-serif" font-size="13">',
             f"<title>{html.escape(title)}</title>",
             f'<text x="16" y="30" fill="{colours["soft"]}">a cell: processes on one PC or several</text>',
             *cell(colours), *plot(runs, colours), "</svg>"]) + "\n"
    return made


NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def same_picture(one, other):
    """Whether two pictures agree: the same text, and numbers that differ by at most a pixel or a tenth of the larger one."""
    if NUMBER.sub("0", one) != NUMBER.sub("0", other):
        return False
    pairs = zip(map(float, NUMBER.findall(one)), map(float, NUMBER.findall(other)))
    return all(abs(a - b) <= max(PIXEL, tutorials.NUMBERS_MAY_DIFFER * max(abs(a), abs(b))) for a, b in pairs)


def figures(root, summary, folder):
    """Faults: lines of README.md that the run did not print, and pictures that the run would not give."""
    faults = []
    shown_blocks = [block for block in tutorials.blocks(root / "README.md") if block.language == "text"]
    printed = summary.read_text(encoding="utf-8").splitlines()
    for block in shown_blocks:
        for number, line in enumerate(block.text.splitlines(), block.line + 1):
            if not any(tutorials.same_line(line, other) for other in printed):
                faults.append(f"README.md:{number}: the run did not print: {line}")
    if not shown_blocks:
        faults.append("README.md: has no ```text block with the figures of a run")
    for name, text in pictures(folder).items():
        file = root / name
        if not file.exists() or not same_picture(file.read_text(encoding="utf-8"), text):
            faults.append(f"{name}: the run gives another picture; run: tests/readme.py draw {folder}")
    return faults


def check(root):
    """Faults of README.md that need no run."""
    lines = (root / "README.md").read_text(encoding="utf-8").splitlines()
    faults = [] if len(lines) <= MOST_LINES else [f"README.md: has {len(lines)} lines, more than {MOST_LINES}; move details to docs/"]
    text = "\n".join(lines)
    named = re.findall(r'(?:src|srcset)="([^"]+)"', text)
    for picture in (f"{PICTURES}/xy-table-{name}.svg" for name in COLOURS):
        if picture not in named:
            faults.append(f"README.md: does not show {picture}")
    faults += [f"README.md: {picture} does not exist" for picture in named if not (root / picture).exists()]
    folders = set(re.findall(r"^\| `([\w.-]+)/` \|", text, re.M))
    there = {path.name for path in root.iterdir() if path.is_dir() and not path.name.startswith((".", "build")) and path.name not in ("out", "cmake")}
    faults += [f"README.md: names no folder {folder}/" for folder in sorted(there - folders)]
    faults += [f"README.md: the folder {folder}/ does not exist" for folder in sorted(folders - there)]
    return faults


def self_test():
    bad = []
    with tempfile.TemporaryDirectory() as place:
        root = pathlib.Path(place)
        (root / "core").mkdir()
        (root / PICTURES).mkdir(parents=True)
        head = "line,x [m],y [m],z [m],displacement [m],cycle,direction\n"
        rows = lambda k: head + "".join(f"a,{x / 10},0,0,{x / 10 + k * 1e-6 * x},1,1\n" for x in range(3))
        (root / "verify_before.csv").write_text(rows(3.0))
        (root / "verify_after.csv").write_text(rows(0.1))
        for name, text in pictures(root).items():
            (root / name).write_text(text)
        readme = ('<img srcset="docs/pictures/xy-table-dark.svg" src="docs/pictures/xy-table-light.svg">\n| `core/` | x |\n| `docs/` | x |\n'
                  "```text\nrms 3.00 um\n```\n")
        (root / "README.md").write_text(readme)
        (root / "summary").write_text("rms   3.1 um\n")
        run = lambda: check(root) + figures(root, root / "summary", root)
        if run():
            bad.append(f"self-test: a sound README has faults: {run()}")
        for words, change in {
                "more than 90": lambda: (root / "README.md").write_text(readme + "\n" * 90),
                "does not show": lambda: (root / "README.md").write_text(readme.replace("dark", "grey")),
                "grey.svg does not exist": lambda: None,
                "names no folder core/": lambda: (root / "README.md").write_text(readme.replace("core", "cores")),
                "cores/ does not exist": lambda: None,
                "did not print: rms 3.00 um": lambda: ((root / "README.md").write_text(readme), (root / "summary").write_text("rms 4 um\n")),
                "no ```text block": lambda: (root / "README.md").write_text(readme.replace("```text", "```sh")),
                "gives another picture": lambda: ((root / "README.md").write_text(readme), (root / "verify_before.csv").write_text(rows(6.0)))}.items():
            change()
            if not any(words in fault for fault in run()):
                bad.append(f"self-test: `{words}` is not among {run()}")
    return bad


def main(words):
    if words == ["self-test"]:
        faults = self_test()
    elif words == ["check"]:
        faults = check(ROOT)
    elif words[:1] == ["draw"] and len(words) == 2:
        for name, text in pictures(pathlib.Path(words[1])).items():
            (ROOT / name).parent.mkdir(exist_ok=True)
            (ROOT / name).write_text(text, encoding="utf-8")
        faults = []
    elif words[:1] == ["figures"] and len(words) == 3:
        faults = figures(ROOT, pathlib.Path(words[1]), pathlib.Path(words[2]))
    else:
        print(__doc__)
        return 2
    print("\n".join(faults), end="\n" if faults else "")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
