#!/usr/bin/env python3
"""Makes the pages of measured figures and their diagrams from tests/bench/results/*.json. It measures nothing.

    tests/bench/figures.py            # write docs/explanation/{how-fast,how-accurate,how-reliable}.md and the diagrams
    tests/bench/figures.py --check    # exit status 1 where they differ from what the results give
"""
import argparse
import pathlib
import sys

import how_reliable
import result_tables

ROOT = result_tables.ROOT
FOLDER = ROOT / "docs" / "explanation"
MADE = """This page is made from `tests/bench/results/*.json` by `tests/bench/figures.py`; a test compares them. Do not edit the page by hand.
Each figure holds for the commit and the date that stand with it. How to measure: `tests/bench/README.md`.
"""
INTROS = {
    "how-fast": """# How fast Invar is

""" + MADE + """
The machine of most figures is a virtual one that loses its cores for milliseconds now and then.
Compare ratios to the rival of the same run, never maxima.
""",
    "how-accurate": """# How accurate Invar is

""" + MADE + """
The truth of each figure comes from formulas outside of the code that is measured, or from recordings of real machines.
""",
}


def pages():
    """Path to text, of all pages and diagrams."""
    made = {}
    for name, intro in INTROS.items():
        results = result_tables.of_page(name)
        parts = [intro, result_tables.summary(results), ""]
        for topic, result in results:
            text, charts = result_tables.section(topic, result)
            parts.append(text)
            made.update({FOLDER / file: picture for file, picture in charts.items()})
        made[FOLDER / f"{name}.md"] = "\n".join(parts).rstrip() + "\n"
    text, diagram = how_reliable.page(how_reliable.results())
    for topic, result in result_tables.of_page("how-reliable"):
        more, charts = result_tables.section(topic, result)
        text += "\n" + more
        made.update({FOLDER / file: picture for file, picture in charts.items()})
    made[FOLDER / "how-reliable.md"] = text.rstrip() + "\n"
    made[FOLDER / "how-reliable.svg"] = diagram
    return made


def main():
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--check", action="store_true")
    given = ask.parse_args()
    made = pages()
    status = 0
    for path, text in made.items():
        if given.check and (not path.exists() or path.read_text(encoding="utf-8") != text):
            print(f"{path.relative_to(ROOT)}: differs from tests/bench/results; run: tests/bench/figures.py")
            status = 1
        elif not given.check:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
    old = set((FOLDER / "figures").glob("*.svg")) - set(made)
    for path in old:
        if given.check:
            print(f"{path.relative_to(ROOT)}: no result has this diagram; run: tests/bench/figures.py")
            status = 1
        else:
            path.unlink()
    return status


if __name__ == "__main__":
    sys.exit(main())
