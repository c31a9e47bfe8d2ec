#!/usr/bin/env python3
"""Figures of a result over its history in git, oldest first: one line for each row at each recording.

    tests/bench/history.py                  # the results, and how often each was recorded
    tests/bench/history.py loop             # every row of the topic
    tests/bench/history.py loop "1000.*Invar wake-up"   # rows that match
"""
import json
import re
import subprocess
import sys

import result_tables


def git(*words):
    return subprocess.run(["git", *words], cwd=result_tables.ROOT, check=True, capture_output=True, text=True).stdout


def recordings(name):
    """The contents of a result at each commit that changed it; once for each commit that it names."""
    seen = set()
    for line in git("log", "--reverse", "--format=%H", "--", name).split():
        try:
            result = json.loads(git("show", f"{line}:{name}"))
        except (subprocess.CalledProcessError, json.JSONDecodeError):
            continue
        key = (result.get("commit"), result.get("date"))
        if key not in seen:
            seen.add(key)
            yield result


def rows_of(result):
    """Label and figures of each row, of results with tables and of sets of machines."""
    for one in result.get("tables", []):
        for row in one["rows"]:
            yield " ".join(row[:2]), dict(zip(one["columns"], row))
    for key, value in result.get("totals", {}).items():
        yield key, {"": str(value)}


def main():
    names = {path.stem: path.relative_to(result_tables.ROOT).as_posix() for path in sorted(result_tables.RESULTS.glob("*.json"))}
    if len(sys.argv) < 2:
        for topic, name in names.items():
            print(f"{topic}: {sum(1 for _ in recordings(name))}")
        return 0
    if sys.argv[1] not in names:
        print(__doc__ if sys.argv[1].startswith("-") else f"{sys.argv[1]}: is no result; these are: {', '.join(names)}",
              file=sys.stdout if sys.argv[1] in ("-h", "--help") else sys.stderr)
        return 0 if sys.argv[1] in ("-h", "--help") else 2
    wanted = re.compile(sys.argv[2] if len(sys.argv) > 2 else "")
    for result in recordings(names[sys.argv[1]]):
        for label, figures in rows_of(result):
            if wanted.search(label):
                print(result["date"], result["commit"], "; ".join(f"{name} {value}".strip() for name, value in figures.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
