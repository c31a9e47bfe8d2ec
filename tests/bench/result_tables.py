"""Sections and bar charts of the results in tests/bench/results/*.json that hold tables; figures.py makes the pages.

A result: {page, order, headline, title, command, commit, date, machine, conditions, about: [sentences], tables: [{caption, columns, rows, plot}], notes}.
`machine` is null where it was not noted. `headline` quotes cells as {table:row:column}. `plot`: {label: [columns], value: [columns], unit, title, log}.
"""
import html
import json
import math
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
RESULTS = ROOT / "tests" / "bench" / "results"
STYLE = ('<style>.line{stroke:#d0d7de}.text{fill:#57606a}.bar0{fill:#0969da}.bar1{fill:#bf8700}'
         '@media (prefers-color-scheme:dark){.line{stroke:#444c56}.text{fill:#9198a1}.bar0{fill:#58a6ff}.bar1{fill:#d29922}}</style>')
LEFT, WIDTH, BAR, GAP, TOP = 300, 360, 12, 10, 52


def of_page(page):
    """(name, result) of all results of a page, in the order of `order`, then by title."""
    found = [(path.stem, json.loads(path.read_text(encoding="utf-8"))) for path in RESULTS.glob("*.json")]
    return sorted(((name, result) for name, result in found if result.get("page") == page), key=lambda item: (item[1].get("order", 99), item[0]))


def table(head, rows):
    return "\n".join("| " + " | ".join(row) + " |" for row in [head, ["---"] * len(head), *rows])


def summary(results):
    """One line a result: its headline, with the cells that it quotes, and a link to its section."""
    rows = []
    for name, result in results:
        def cell(found):
            try:
                return result["tables"][int(found[1])]["rows"][int(found[2])][int(found[3])]
            except IndexError:
                sys.exit(f"tests/bench/results/{name}.json: headline: no table has the cell {found[0]}; mend the headline")
        anchor = re.sub(r"[^\w\- ]", "", result["title"].lower()).replace(" ", "-")
        rows.append([f"[{result['title']}](#{anchor})", re.sub(r"\{(\d+):(\d+):(\d+)\}", cell, result.get("headline", ""))])
    return table(["subject", "in short"], rows)


def number_in(cell):
    found = re.search(r"-?\d[\d,]*\.?\d*(?:e-?\d+)?", cell)
    return float(found.group(0).replace(",", "")) if found else None


def chart(given):
    """SVG with one horizontal bar a value; reads on a light and on a dark page."""
    plot = given["plot"]
    rows = [(" ".join(row[k] for k in plot["label"]).replace("`", "").strip(), [number_in(row[k]) for k in plot["value"]]) for row in given["rows"]]
    rows = [(label, values) for label, values in rows if None not in values]
    most, least = max(max(v) for _, v in rows), min(min(v) for _, v in rows)
    if plot.get("log"):
        floor = 10 ** math.floor(math.log10(least))
        share = lambda v: math.log10(v / floor) / math.log10(most / floor)
        marks = [10 ** k for k in range(round(math.log10(floor)), math.floor(math.log10(most)) + 1)]
    else:
        step = 10 ** math.floor(math.log10(most))
        step = step if most / step >= 4 else step / 2 if most / step >= 2 else step / 5
        share = lambda v: max(0.0, v) / most
        marks = [k * step for k in range(int(most / step + 1e-9) + 1)]
    each = len(plot["value"]) * BAR + GAP
    bottom = TOP + each * len(rows)
    title = html.escape(plot["title"])
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {LEFT + WIDTH + 70} {bottom + 44}" width="{LEFT + WIDTH + 70}" role="img" '
             f'font-family="sans-serif" font-size="12"><title>{title}</title>', STYLE,
             f'<text class="text" x="8" y="18" font-weight="bold">{title}</text>']
    if len(plot["value"]) > 1:
        for k, column in enumerate(plot["value"]):
            x = LEFT + 180 * k
            parts.append(f'<rect class="bar{k}" x="{x}" y="27" width="10" height="10"/>'
                         f'<text class="text" x="{x + 16}" y="36">{html.escape(given["columns"][column])}</text>')
    for mark in marks:
        x = LEFT + WIDTH * share(mark)
        parts.append(f'<line class="line" x1="{x:.1f}" y1="{TOP - 6}" x2="{x:.1f}" y2="{bottom}"/>'
                     f'<text class="text" x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{mark:g}</text>')
    for i, (label, values) in enumerate(rows):
        y = TOP + i * each
        short = label if len(label) < 48 else label[:46] + "..."
        parts.append(f'<text class="text" x="{LEFT - 8}" y="{y + len(values) * BAR / 2 + 4:.0f}" text-anchor="end">{html.escape(short)}</text>')
        for k, value in enumerate(values):
            parts.append(f'<rect class="bar{k}" x="{LEFT}" y="{y + k * BAR}" width="{max(1.0, WIDTH * share(value)):.1f}" height="{BAR - 1}">'
                         f'<title>{html.escape(label)}: {value:g}</title></rect>')
    parts.append(f'<text class="text" x="{LEFT + WIDTH / 2:.0f}" y="{bottom + 36}" text-anchor="middle">{html.escape(plot["unit"])}</text></svg>')
    return "\n".join(parts) + "\n"


def section(name, result, level="##"):
    """The Markdown of one result, and its charts by file name."""
    where = ", ".join(part for part in [result["machine"], result["conditions"]] if part)
    parts = [f"{level} {result['title']}", "", *result["about"], "",
             f"- Command: `{result['command']}`", f"- Recorded by commit {result['commit']}, {result['date']}", f"- Conditions: {where}", ""]
    charts = {}
    for i, one in enumerate(result["tables"]):
        if one["caption"]:
            parts += [one["caption"] + ":", ""]
        if "plot" in one:
            picture = f"figures/{name}{i or ''}.svg"
            charts[picture] = chart(one)
            parts += [f"![{one['plot']['title']}]({picture})", ""]
        parts += [table(one["columns"], one["rows"]), ""]
    if result.get("output"):
        parts += ["```text", result["output"].rstrip(), "```", ""]
    parts += result["notes"] + ([""] if result["notes"] else [])
    return "\n".join(parts), charts
