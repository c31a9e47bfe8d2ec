#!/usr/bin/env python3
"""The messages of docs/how-to/troubleshooting.md are those of the program: each part of a message in the first column of a table, between
its `...`, is a string in core, components or tools. `--self-test` shows that a message that went is seen."""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs/how-to/troubleshooting.md"


def strings_of_the_program():
    """All sources as one text, in which string literals that stand side by side are joined."""
    text = "\n".join(path.read_text(encoding="utf-8") for room in ("core", "components", "tools")
                     for path in sorted((ROOT / room).rglob("*.[ch]pp")))
    return re.sub(r'"\s*"', "", text)


def messages(page):
    """(line, message) of the first column of each table."""
    for number, line in enumerate(page.splitlines(), 1):
        cell = re.match(r"\| (`+) ?(.+?) ?\1 \|", line)  # `...`, or `` ... `` around a message that has ` in it
        if cell:
            yield number, cell.group(2)


def check(page, program):
    faults, seen = [], 0
    for number, message in messages(page):
        seen += 1
        for part in filter(None, (part.strip() for part in message.split("..."))):
            if part not in program:
                faults.append(f"docs/how-to/troubleshooting.md:{number}: the program does not say `{part}`; write what it says now")
    return faults if seen else ["docs/how-to/troubleshooting.md: has no table of messages"]


def self_test():
    program = 'text = "the loop does not " + name + " answer";'
    sound = check("| `the loop does not ... answer` | a | b |\n", program)
    gone = check("| `the loop stands still` | a | b |\n", program)
    return [] if not sound and len(gone) == 1 and check("no table", program) else [f"self-test: {sound} {gone}"]


if __name__ == "__main__":
    found = self_test() if "--self-test" in sys.argv else check(PAGE.read_text(encoding="utf-8"), strings_of_the_program())
    print("\n".join(found), end="\n" if found else "")
    sys.exit(1 if found else 0)
