#!/usr/bin/env python3
"""Runs clang-tidy (.clang-tidy: bugprone, performance, function size, easily swappable parameters) on the lines that changed against a
base, and fails where it has something to say. It needs clang-tidy 14 and a build folder with compile_commands.json.

    tests/check_tidy.py                        # against main; on main itself against the commit before
    tests/check_tidy.py --base HEAD~5          # against another commit
    tests/check_tidy.py --whole core/base      # all lines of the sources of a folder
    tests/check_tidy.py --most 8               # the eight sources with most changed lines, as the test does
    tests/check_tidy.py --self-test            # a fault is found, and only on a changed line

A changed header is checked through the source of its module; a header without one through a source that includes it.
"""
import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
ROOMS = ("core/", "components/", "tools/", "examples/")
# The compiler knows warnings that clang does not.
EXTRA = ["--quiet", "--extra-arg=-Wno-unknown-warning-option"]
FAULT = re.compile(r"^(\S+?):(\d+):\d+: (?:warning|error): (.*)$")


def git(*words):
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout


def default_base():
    """Where this branch left main; the commit before where it is main."""
    known = subprocess.run(["git", "merge-base", "HEAD", "main"], cwd=ROOT, capture_output=True, text=True)
    base, head = known.stdout.strip(), git("rev-parse", "HEAD").strip()
    return base if known.returncode == 0 and base != head else "HEAD~1"


def changed_lines(diff):
    """File -> [[first, last], ...] of the lines that a diff without context adds."""
    found, name = {}, None
    for line in diff.split("\n"):
        if line.startswith("+++ "):
            name = line[6:] if line.startswith("+++ b/") else None
        hunk = re.match(r"@@ -\S+ \+(\d+)(?:,(\d+))? @@", line)
        if hunk and name and name.startswith(ROOMS) and name.endswith((".cpp", ".hpp")):
            first, count = int(hunk.group(1)), int(hunk.group(2) or 1)
            if count > 0:
                found.setdefault(name, []).append([first, first + count - 1])
    return found


def sources_for(lines, compiled):
    """The sources to run on, so that each file of `lines` is looked at; those of the most changed lines first."""
    wanted = {}
    size = {name: sum(last - first + 1 for first, last in where) for name, where in lines.items()}
    for name in lines:
        own = name if name.endswith(".cpp") else name[:-4] + ".cpp"
        if own in compiled:
            wanted[own] = wanted.get(own, 0) + size[name]
        elif name.endswith(".hpp"):
            quoted = f'#include "{name}"'
            for user in sorted(c for c in compiled if c.startswith(ROOMS) and quoted in (ROOT / c).read_text(errors="replace"))[:1]:
                wanted[user] = wanted.get(user, 0) + size[name]
    return sorted(wanted, key=lambda source: (-wanted[source], source))


def run(build, source, lines):
    only = json.dumps([{"name": name, "lines": where} for name, where in lines.items()])
    done = subprocess.run(["clang-tidy", "-p", str(build), *EXTRA, f"--line-filter={only}", str(source)], cwd=ROOT, capture_output=True, text=True)
    return done.stdout + (done.stderr if done.returncode not in (0, 1) else "")


def without_precompiled(commands):
    """clang reads no precompiled header of GCC; each source names its includes all the same."""
    return re.sub(r" -fpch-preprocess| -Winvalid-pch| -include [^ ]*cmake_pch\.hxx", "", commands)


def one_by_one(entries):
    """The entries of compile_commands.json with a batch of CMake (Unity/unity_0_cxx.cxx) replaced by the sources that it includes."""
    for entry in entries:
        batch = pathlib.Path(entry["directory"], entry["file"])
        if batch.parent.name != "Unity" or not batch.exists():
            yield entry
            continue
        for source in re.findall(r'^#include "(.+)"$', batch.read_text(), re.MULTILINE):
            yield {**entry, "file": source, "command": entry["command"].replace(entry["file"], source)}


def faults_of(build, sources, lines, jobs):
    found = set()
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for text in pool.map(lambda source: run(build, source, lines), sources):
            for line in text.split("\n"):
                match = FAULT.match(line)
                if match:
                    name = os.path.relpath(match.group(1), ROOT) if os.path.isabs(match.group(1)) else match.group(1)
                    found.add(f"{name}:{match.group(2)}: {match.group(3)}")
    return sorted(found)


def self_test():
    diff = "+++ b/core/base/unit.cpp\n@@ -3,0 +4,2 @@\n+++ b/other.md\n@@ -1 +1 @@\n+++ b/core/base/unit.hpp\n@@ -7 +7 @@\n@@ -9,2 +8,0 @@\n"
    assert changed_lines(diff) == {"core/base/unit.cpp": [[4, 5]], "core/base/unit.hpp": [[7, 7]]}, changed_lines(diff)
    assert sources_for({"core/base/unit.hpp": [[7, 7]]}, {"core/base/unit.cpp"}) == ["core/base/unit.cpp"]
    assert without_precompiled("c++ -Winvalid-pch -include /b/x.dir/cmake_pch.hxx -O2") == "c++ -O2"
    with tempfile.TemporaryDirectory() as folder:
        place = pathlib.Path(folder)
        source = place / "share.cpp"
        source.write_text("double f(int a, int b) { return a / b; }\ndouble g(int a, int b) { return a / b; }\n")
        shutil.copy(ROOT / ".clang-tidy", place)
        (place / "compile_commands.json").write_text(json.dumps(
            [{"directory": folder, "file": str(source), "command": f"c++ -std=c++20 -c {source}"}]))
        found = faults_of(place, [source], {"share.cpp": [[2, 2]]}, 1)
        batch = place / "Unity" / "unity_0_cxx.cxx"
        batch.parent.mkdir()
        batch.write_text(f'/* generated by CMake */\n\n#include "{source}"\n\n#include "/b.cpp"\n')
        parts = list(one_by_one([{"directory": folder, "file": str(batch), "command": f"c++ -c {batch}"}]))
    assert [(part["file"], part["command"]) for part in parts] == [(str(source), f"c++ -c {source}"), ("/b.cpp", "c++ -c /b.cpp")], parts
    assert len(found) == 1 and ":2: " in found[0] and "bugprone-integer-division" in found[0], found
    return 0


def main():
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--base", help="a commit")
    ask.add_argument("--build", type=pathlib.Path, default=ROOT / "build", help="folder with compile_commands.json")
    ask.add_argument("--whole", metavar="FOLDER")
    ask.add_argument("--most", type=int, default=1_000_000, help="sources at most")
    ask.add_argument("--jobs", type=int, default=os.cpu_count())
    ask.add_argument("--self-test", action="store_true")
    given = ask.parse_args()
    if shutil.which("clang-tidy") is None:
        sys.exit("clang-tidy: is not installed; run: apt-get install clang-tidy")
    if given.self_test:
        return self_test()
    commands = given.build / "compile_commands.json"
    if not commands.exists():
        sys.exit(f"{commands}: does not exist; configure with cmake -S . -B build")
    entries = list(one_by_one(json.loads(without_precompiled(commands.read_text()))))
    compiled = {os.path.relpath(entry["file"], ROOT) for entry in entries if pathlib.Path(entry["file"]).exists()}
    if given.whole:
        names = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / given.whole).rglob("*.[ch]pp"))
        lines = {name: [[1, 1_000_000]] for name in names}
    else:
        try:
            lines = changed_lines(git("diff", "-U0", "--no-color", given.base or default_base(), "--", "*.cpp", "*.hpp"))
        except (subprocess.CalledProcessError, FileNotFoundError):
            if given.base:
                sys.exit(f"--base: `{given.base}` is no commit here; name another")
            print("clang-tidy: no earlier commit to compare with, so no line changed", file=sys.stderr)
            return 0
    sources = sources_for(lines, compiled)
    if len(sources) > given.most:
        print(f"clang-tidy: {len(sources) - given.most} further changed sources are left to a run without --most", file=sys.stderr)
        sources = sources[:given.most]
    with tempfile.TemporaryDirectory() as folder:
        (pathlib.Path(folder) / "compile_commands.json").write_text(json.dumps(entries))
        found = faults_of(folder, sources, lines, given.jobs)
    for fault in found:
        print(fault)
    print(f"clang-tidy: {len(sources)} sources, {len(found)} faults", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
