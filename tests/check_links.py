#!/usr/bin/env python3
"""Citations and links exist: each documentation file that a comment names (docs/PAGE.md#section), and each relative link of a
*.md file. An anchor is a heading in GitHub's spelling, or <a id="...">. `check_links.py --self-test` shows that faults are seen."""
import pathlib
import re
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
SOURCES = {".cpp", ".hpp", ".h", ".py", ".sh", ".cmake", ".idl", ".yaml", ".in", ".c", ".md", ".js", ".mjs"}
ROOMS = ["core", "components", "tools", "deployment", "examples", "idl", "cmake", "tests", "docs"]
# Folders of generated or foreign files, and files that hold faults on purpose.
LEFT_OUT = {"node_modules", "__pycache__"}
FAULTY = "tests/data/"

CITATION = re.compile(r"\b((?:docs|tests|tools|examples|core|components|deployment)/[\w./-]*\.md)(#[\w-]+)?")
# In a comment a page may also be named alone; in code and on pages such a name may be a program's own output.
NAMED_ALONE = re.compile(r"(?<![\w./-])([\w-]+\.md)(#[\w-]+)?")
COMMENT = re.compile(r"(?://|#|--) .*")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
FENCE = re.compile(r"^(```|~~~)")


def without_code(text):
    """The lines of a page outside fenced blocks, indented blocks and `spans`, for links; blank lines stand in for the rest."""
    kept, fenced = [], False
    for line in text.splitlines():
        if FENCE.match(line):
            fenced = not fenced
            kept.append("")
        else:
            kept.append("" if fenced or line.startswith("    ") else re.sub(r"`[^`]*`", "", line))
    return kept


def slug(heading):
    """GitHub's anchor of a heading: small letters, spaces as hyphens, other marks left out."""
    heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
    return re.sub(r"[^\w\- ]", "", heading).replace(" ", "-")


def anchors(page):
    """All anchors of a page; a heading that stands twice counts on (-1, -2)."""
    found, seen, fenced = set(), {}, False
    for line in page.read_text(encoding="utf-8").splitlines():
        if FENCE.match(line):
            fenced = not fenced
        heading = re.match(r"#{1,6} +(.*)", line)
        if heading and not fenced:
            name = slug(heading.group(1))
            found.add(name if name not in seen else f"{name}-{seen[name]}")
            seen[name] = seen.get(name, 0) + 1
        found.update(re.findall(r'<a id="([^"]+)">', line))
    return found


def files(root):
    for start in [root] + [root / room for room in ROOMS]:
        for path in sorted(start.glob("*") if start == root else start.rglob("*")):
            name = path.relative_to(root).as_posix()
            known = path.suffix in SOURCES or path.name == "CMakeLists.txt"
            if path.is_file() and known and not LEFT_OUT & set(path.parts) and not name.startswith(FAULTY):
                yield path


def check_target(target, anchor, where, root, known):
    if not target.exists():
        return [f"{where}: {target.relative_to(root) if target.is_relative_to(root) else target} does not exist"]
    if anchor and target.suffix == ".md":
        if target not in known:
            known[target] = anchors(target)
        if anchor not in known[target]:
            return [f"{where}: {target.relative_to(root)} has no section #{anchor}"]
    return []


def check(root):
    faults, known = [], {}
    for path in files(root):
        name = path.relative_to(root).as_posix()
        if name == "tests/check_links.py":
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        if path.suffix == ".md":
            for number, line in enumerate(without_code(text), 1):
                for link in LINK.findall(line):
                    if re.match(r"[a-z][a-z0-9+.-]*:", link):  # another server's
                        continue
                    file, _, anchor = link.partition("#")
                    target = (path.parent / file).resolve() if file else path
                    faults += check_target(target, anchor, f"{name}:{number}", root, known)
            text = re.sub(LINK, "", text)
        for number, line in enumerate(text.splitlines(), 1):
            for file, anchor in CITATION.findall(line):
                faults += check_target(root / file, anchor[1:], f"{name}:{number}", root, known)
            comment = COMMENT.search(line) if path.suffix != ".md" else None
            for file, anchor in NAMED_ALONE.findall(comment.group() if comment else ""):
                places = [path.parent / file, root / file, root / "docs" / file]  # beside the file, or of all
                target = next((place for place in places if place.exists()), places[1])
                faults += check_target(target, anchor[1:], f"{name}:{number}", root, known)
    return faults


def self_test():
    """Each kind of fault is found in a small tree, and nothing else."""
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder).resolve()
        for room in ROOMS:
            (root / room).mkdir()
        (root / "docs/page.md").write_text("# A page: here\n[well](other.md#so-it-is) [gone](none.md) [no](other.md#not)\n"
                                           "[far](https://example.org/x.md) `[code](none.md)`\n\n    [block](none.md)\n")
        (root / "docs/other.md").write_text("## So it is\n\n<a id=\"e1\"></a>\n[up](#so-it-is) [lost](#lost)\n")
        (root / "core/a.hpp").write_text("// docs/page.md#a-page-here docs/other.md#e1\n// docs/other.md#e2\n// metrology.md\n")
        expected = ["docs/page.md:2: docs/none.md does not exist", "docs/page.md:2: docs/other.md has no section #not",
                    "docs/other.md:4: docs/other.md has no section #lost", "core/a.hpp:2: docs/other.md has no section #e2",
                    "core/a.hpp:3: metrology.md does not exist"]
        found = check(root)
        if sorted(found) != sorted(expected):
            print("self-test: expected", *sorted(expected), "found", *sorted(found), sep="\n  ")
            return 1
    return 0


if __name__ == "__main__":
    if "--self-test" in sys.argv:
        sys.exit(self_test())
    faults = check(ROOT)
    print("\n".join(faults))
    sys.exit(1 if faults else 0)
