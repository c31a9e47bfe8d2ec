#!/usr/bin/env python3
"""Runs the command of a result and writes its figures with commit, date, machine and load to tests/bench/results/TOPIC.json.

    tests/bench/record_result.py loop
    tests/bench/record_result.py loop --from output.txt    # figures that the command printed elsewhere

Tables that the command prints in Markdown replace those of the result, in their order, where the number of columns is the same.
The whole output is kept where the command prints no such table. Then run tests/bench/figures.py.
"""
import argparse
import datetime
import json
import os
import pathlib
import platform
import re
import shlex
import subprocess
import sys

import result_tables


def tables_in(text):
    """Rows of each Markdown table of a text."""
    found, rows = [], []
    for line in [*text.split("\n"), ""]:
        if line.startswith("|"):
            rows.append([cell.strip() for cell in line.strip().strip("|").split("|")])
        elif rows:
            found.append([row for row in rows[1:] if not all(re.fullmatch(r":?-+:?", cell) for cell in row)])
            rows = []
    return found


def machine():
    names = re.findall(r"^model name\s*: (.*)$", pathlib.Path("/proc/cpuinfo").read_text(), re.M)
    return f"{names[0] if names else platform.machine()}, {os.cpu_count()} cores, kernel {platform.release()}"


def commit():
    git = lambda *words: subprocess.run(["git", *words], cwd=result_tables.ROOT, check=True, capture_output=True, text=True).stdout.strip()
    return git("rev-parse", "--short=7", "HEAD") + (" with changes" if git("status", "--porcelain", "--untracked-files=no") else "")


def output_of(command):
    """Of all commands of a result, which semicolons separate."""
    parts = []
    for words in command.split(";"):
        done = subprocess.run(shlex.split(words), cwd=result_tables.ROOT, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"{words.strip()}: status {done.returncode}; nothing was written\n{done.stderr}")
        parts.append(done.stdout)
    return "\n".join(parts)


def main():
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("topic")
    ask.add_argument("--from", dest="file", type=pathlib.Path, help="text that the command printed")
    given = ask.parse_args()
    path = result_tables.RESULTS / f"{given.topic}.json"
    if not path.exists():
        sys.exit(f"{path}: does not exist; write it first, with page, title, command, about and the columns of its tables")
    result = json.loads(path.read_text(encoding="utf-8"))
    before = os.getloadavg()[0]
    text = given.file.read_text() if given.file else output_of(result["command"])
    printed = tables_in(text)
    matching = [rows for rows in printed if rows]
    for one, rows in zip(result["tables"], matching):
        if len(rows[0]) != len(one["columns"]):
            sys.exit(f"{path}: the command prints a table of {len(rows[0])} columns, `{one['columns'][0]}` has {len(one['columns'])}; mend the columns")
        one["rows"] = rows
    if not matching:
        result["tables"], result["output"] = [], text
        result.pop("headline", None)
    result.update(commit=commit(), date=datetime.date.today().isoformat(), machine=machine(),
                  conditions=f"load {before:.1f} before, {os.getloadavg()[0]:.1f} after")
    path.write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
