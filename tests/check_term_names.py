#!/usr/bin/env python3
"""core/diagnosis asks terms for properties (core/physics/term.hpp), never for names: a new term is one file. Finds every string
there that equals the name of a term, and comparisons with a part of a name. A name may be given where a term is made."""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
TERMS, ROOM = ROOT / "core/physics/terms", ROOT / "core/diagnosis"

# Before the name: a term is made of it, or a parameter of that name is looked up.
MADE = re.compile(r'(find_term\([\w:]+, |\b(started|add|has|is|index_of)\(|\blaw\(at, |Bend\{)(\w+ \? ("\w+" : )?)?$')
# A part of a name compared: `info->name.ends_with("_limit")`.
PARTS = re.compile(r'info(->|\.)name\s*(==|!=|\.(starts_with|ends_with|find|rfind|substr|contains)\()')

# File -> (number of places, why they may stay). The numbers may only fall.
EXCEPTIONS = {
    "report/report_json.cpp": (1, "the word that the format of report.json has for an effect without a name"),
    "search/assumed.cpp": (1, "leaves all terms out but the one that the user names"),
    "search/restarts.cpp": (1, "looks up whether a rejected term, kept by its name, was found after all"),
    "search/verdict.cpp": (1, "looks up whether a rejected term, kept by its name, was found after all"),
}


def term_names():
    names = {"unmodelled"}
    for path in TERMS.rglob("*.hpp"):
        names |= set(re.findall(r'TermInfo info\{\s*\.name = "(\w+)"', path.read_text()))
    return names


def without_comment(line):
    return re.sub(r"//.*", "", line)


def faults_of(text, names):
    """(line, what) of each use of a term's name that is no making of a term."""
    found = []
    for number, line in enumerate(text.splitlines(), 1):
        line = without_comment(line)
        if line.lstrip().startswith("#include"):
            continue
        for literal in re.finditer(r'"(\w+)"', line):
            if literal.group(1) in names and not MADE.search(line[:literal.start()]):
                found.append((number, f'"{literal.group(1)}"'))
        for part in PARTS.finditer(line):
            found.append((number, part.group(0)))
    return found


def self_test(names):
    bad = ['if (term.info->name == "lag") return 1;', 'for (const char* law : {"lag", "delay"})',
           'if (info.name.ends_with("_limit"))', 'case_of(name != "dead_zone")']
    good = ['physics::find_term(Plant::axis, "dead_zone")', 'info.has("delay")', 'add("lag", on, "", 0.1);',
            '// "lag" or "delay"', 'if (variable == "time")']
    wrong = [text for text in bad if not faults_of(text, names)] + [text for text in good if faults_of(text, names)]
    for text in wrong:
        print(f"check_term_names: judges wrongly: {text}")
    return 1 if wrong else 0


def main():
    names = term_names()
    if len(names) < 50:
        print(f"check_term_names: only {len(names)} names of terms found in {TERMS.relative_to(ROOT)}; mend the pattern")
        return 1
    if self_test(names):
        return 1
    bad = 0
    for path in sorted([*ROOM.rglob("*.cpp"), *ROOM.rglob("*.hpp")]):
        found = faults_of(path.read_text(), names)
        allowed = EXCEPTIONS.get(str(path.relative_to(ROOM)), (0, ""))[0]
        if len(found) > allowed:
            for number, what in found:
                print(f"{path.relative_to(ROOT)}:{number}: {what}: ask the term for a property (core/physics/term.hpp) in place of "
                      "its name")
            bad += 1
        elif len(found) < allowed:
            print(f"{path.relative_to(ROOT)}: {len(found)} names stand here and {allowed} are allowed: lower the exception")
            bad += 1
    for name in EXCEPTIONS:
        if not (ROOM / name).exists():
            print(f"core/diagnosis/{name} is gone: take its exception out")
            bad += 1
    return 1 if bad else 0


sys.exit(main())
