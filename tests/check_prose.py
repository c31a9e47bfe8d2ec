#!/usr/bin/env python3
"""Sentences of pages, of comments in headers and of messages: none has more than 30 words, none begins with What, Who or Of, and
none uses a word of the table "Words that went" in docs/glossary.md.

    tests/check_prose.py                # exit status 1 where a file has more faults than tests/prose_baseline.txt allows it
    tests/check_prose.py --list PATH    # the faults of a file or folder
    tests/check_prose.py --count        # faults by room
    tests/check_prose.py --update       # lower the baseline to the faults of today; no number is ever raised
    tests/check_prose.py --self-test    # faults are seen, and right sentences are not
"""
import argparse
import collections
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
BASELINE = ROOT / "tests" / "prose_baseline.txt"
GLOSSARY = ROOT / "docs" / "glossary.md"
MOST_WORDS = 30
SOURCES = ("core", "components", "tools")
# Pages that a program makes: their sentences stand in its sources.
MADE = re.compile(r"<!-- Made by")
LEFT_OUT = ("build", "node_modules", "tests/data", ".git")

ABBREVIATIONS = re.compile(r"\b(e\.g|i\.e|etc|vs|eq|fig|sect|ch|no|approx|al|cf)\.", re.I)
BEGINS = re.compile(r"^(What|Who|Of)\b")
FRAGMENT_BEGINS = re.compile(r"^(what|who|of)\b", re.I)  # a message or a table cell stands alone: a small letter counts too
LITERAL = re.compile(r'"((?:[^"\\\n]|\\.)*)"')


def sentences(text):
    """Sentences of running text; a code span or a formula in it counts as one word."""
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"`[^`]*`", "Code", text)
    text = ABBREVIATIONS.sub(lambda m: m.group(1), text)
    return [part.strip() for part in re.split(r"(?<=[.!?])[\"')]*\s+(?=[A-Z(\"'`])|\n\n", text) if part.strip()]


def words(sentence):
    return re.findall(r"[A-Za-z][\w'/-]*", sentence)


# ------------------------------------------------------------------ where text stands: (line, text)

def of_page(text):
    """Paragraphs, list items and table cells outside code."""
    block, begin, fenced, out = [], 1, False, []

    def end():
        if block:
            out.append((begin, " ".join(block)))
            block.clear()

    for number, line in enumerate(text.split("\n"), 1):
        if re.match(r"^(```|~~~)", line.strip()):
            fenced = not fenced
            end()
            continue
        if fenced or (line.startswith("    ") and not block) or line.startswith("<"):
            end()
            continue
        line = line.strip()
        if not line or line.startswith("|") or line.startswith("#") or re.match(r"^([-*]|\d+\.) ", line):
            end()
        if line.startswith("|"):
            out.extend((number, cell.strip()) for cell in line.strip("|").split("|"))
        elif line:
            if not block:
                begin = number
            block.append(re.sub(r"^(#+|[-*]|\d+\.) ", "", line))
            if line.startswith("#"):
                end()
    end()
    return out


def of_comments(text):
    """Comments, neighbouring whole-line ones joined."""
    block, begin, out = [], 1, []
    for number, line in enumerate(text.split("\n"), 1):
        whole = re.match(r"^\s*//[/!<]*\s?(.*)$", line)
        if whole and whole.group(1).strip():
            if block and re.match(r"([-*]|\d+\.) |  ", whole.group(1)):  # an item of a list, or a line laid out by hand
                out.append((begin, " ".join(block)))
                block = []
            if not block:
                begin = number
            block.append(whole.group(1).strip())
            continue
        if block:
            out.append((begin, " ".join(block)))
            block = []
        behind = re.match(r'^[^"/]*(?:"(?:[^"\\]|\\.)*"[^"/]*)*//[/!<]*\s*(.*)$', line)
        if behind and behind.group(1) and not whole:
            out.append((number, behind.group(1)))
    if block:
        out.append((begin, " ".join(block)))
    return out


def of_messages(text):
    """String literals of four words or more, neighbouring ones joined as the compiler joins them."""
    out, joined, begin, last = [], "", 1, None
    plain = re.sub(r"(?m)^(\s*)//.*$", r"\1", text)
    for found in LITERAL.finditer(plain):
        between = plain[last:found.start()] if last is not None else None
        if between is not None and not between.strip():
            joined += found.group(1)
        else:
            if joined:
                out.append((begin, joined))
            joined, begin = found.group(1), plain.count("\n", 0, found.start()) + 1
        last = found.end()
    if joined:
        out.append((begin, joined))
    # A line of a help text that is laid out by hand is a paragraph of its own where it ends a sentence.
    return [(number, part.replace('\\"', '"')) for number, whole in out for part in re.split(r"\\n(?:\\n|\s{2,}|(?=[A-Z]))", whole)
            if len(words(part)) >= 4]


# ------------------------------------------------------------------ faults

def old_words():
    """[(pattern, old word, standard term)] of the glossary's table."""
    section = GLOSSARY.read_text().split("## Words that went", 1)[1].split("\n## ", 1)[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in section.split("\n") if line.startswith("| ")][2:]
    return [(re.compile(rf"(?<![\w-]){re.escape(old)}(?![\w-])", re.I), old, term) for old, term in (row[:2] for row in rows)]


def faults_of(path, text, gone):
    """(line, fault) of one file."""
    found = []
    places = [(FRAGMENT_BEGINS, place) for place in (of_page(text) if path.suffix == ".md" else of_messages(text))]
    if path.suffix == ".hpp":
        places += [(BEGINS, place) for place in of_comments(text)]
    for begins, (number, block) in places:
        for sentence in sentences(block):
            count = len(words(sentence))
            shown = sentence if len(sentence) < 100 else sentence[:97] + "..."
            if count > MOST_WORDS:
                found.append((number, f"{count} words, split it: {shown}"))
            if begins.match(sentence) and count > 1:
                found.append((number, f"begins with `{words(sentence)[0]}`, name the thing: {shown}"))
            for pattern, old, term in gone if path != GLOSSARY else []:
                if pattern.search(sentence):
                    found.append((number, f"`{old}` went, write `{term}`: {shown}"))
    return sorted(found)


def files():
    for path in sorted(ROOT.rglob("*.md")):
        name = path.relative_to(ROOT).as_posix()
        if not name.startswith(LEFT_OUT) and "node_modules" not in name and not MADE.search(path.read_text()[:600]):
            yield path
    for folder in SOURCES:
        for path in sorted((ROOT / folder).rglob("*.[ch]pp")):
            yield path


def all_faults():
    gone = old_words()
    found = {path.relative_to(ROOT).as_posix(): faults_of(path, path.read_text(), gone) for path in files()}
    return {name: faults for name, faults in found.items() if faults}


def baseline():
    lines = [line.split() for line in BASELINE.read_text().splitlines() if line and not line.startswith("#")] if BASELINE.exists() else []
    return {name: int(count) for count, name in lines}


def room_of(name):
    parts = name.split("/")
    return "/".join(parts[:3]) if parts[:2] == ["core", "diagnosis"] and len(parts) > 3 else "/".join(parts[:2]) if len(parts) > 2 else parts[0]


def self_test():
    gone = [(re.compile(r"\bmade machine\b"), "made machine", "synthetic machine")]
    long = "word " * 31 + "end."
    page = pathlib.Path("a.md")
    source, header = pathlib.Path("a.cpp"), pathlib.Path("a.hpp")
    expected = [
        (page, long, 1), (page, "Short. What is late is lost.", 1), (page, "```\n" + long + "\n```\n", 0), (page, "| Of a row | b |", 1),
        (page, "The word `what is it` stands here. Whatever.", 0), (page, "A made machine.", 1), (page, "See e.g. Of mice.", 0),
        (header, f"int a;  // {long}", 1), (header, "/// Who waits\n/// here.\nint a;", 1), (header, "/// The one who waits.\nint a;  // of the row", 0),
        (source, f"// {long}\n", 0), (source, 'f("of what is late here");', 1), (source, 'f("what");', 0),
        (source, 'f("word word word word word word word word word word word word word word word word "\n"' + long + '");', 1),
    ]
    wrong = [(path.name, text, count) for path, text, count in expected if len(faults_of(path, text, gone)) != count]
    for path, text, count in wrong:
        print(f"{path}: {count} faults expected in: {text[:80]}")
    return 1 if wrong else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", metavar="PATH")
    for option in ("count", "update", "self-test"):
        parser.add_argument(f"--{option}", action="store_true")
    options = parser.parse_args()
    if options.self_test:
        return self_test()
    found, allowed = all_faults(), baseline()
    if options.list is not None:
        for name, faults in found.items():
            if name.startswith(options.list):
                for number, fault in faults:
                    print(f"{name}:{number}: {fault}")
        return 0
    if options.count:
        rooms = collections.Counter()
        for name, faults in found.items():
            rooms[room_of(name)] += len(faults)
        for room, count in rooms.most_common():
            print(f"{count:5} {room}")
        print(f"{sum(rooms.values()):5} in all")
        return 0
    if options.update:
        kept = {name: min(len(faults), allowed.get(name, len(faults) if not allowed else 0)) for name, faults in found.items()}
        BASELINE.write_text("# Faults that tests/check_prose.py allows each file; numbers only fall.\n" +
                            "".join(f"{count} {name}\n" for name, count in sorted(kept.items()) if count))
        return 0
    status = 0
    for name, faults in found.items():
        if len(faults) > allowed.get(name, 0):
            status = 1
            print(f"{name}: {len(faults)} faults of prose, {allowed.get(name, 0)} allowed:")
            for number, fault in faults:
                print(f"  {name}:{number}: {fault}")
    return status


if __name__ == "__main__":
    sys.exit(main())
