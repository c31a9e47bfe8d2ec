#!/usr/bin/env python3
"""Citations and links exist: each documentation file that a comment names (docs/PAGE.md#section), and each relative link of a
*.md file. An anchor is a heading in GitHub's spelling, or <a id="...">. `check_links.py --self-test` shows that faults are seen.

A page of docs/ is read in three places: in the tree, as share/doc/invar, and in the site of tools/docs. It therefore links to pages of
docs/ alone, a README of examples/ to its own folder. Other files of the tree stand in a code span (`core/base`), and exist too.
mkdocs.yml has each page of docs/ in `nav` once, and a linked section has the same anchor in the site as on GitHub."""
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
SPAN = re.compile(r"`((?:core|components|deployment|docs|examples|idl|tests|tools)/[\w./-]*)`")
NAV = re.compile(r"^ +- (?:[^:]+: )?([\w./-]+\.md)$|^  - [^:]+: ([\w./-]+\.md)$", re.M)


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


def site_slug(heading):
    """mkdocs's anchor of the heading: as GitHub's, but blanks and hyphens in a row give one hyphen."""
    return re.sub(r"[-\s]+", "-", slug(heading))


def home_of(name):
    """The folder that a page's links must not leave; nothing for a page that stands in the tree alone."""
    if name.startswith("docs/"):
        return "docs"
    return "/".join(name.split("/")[:2]) if re.match(r"examples/[^/]+/", name) else ""


def check_nav(root):
    """Each page of docs/ stands in the navigation of the site once."""
    if not (root / "mkdocs.yml").exists():
        return ["mkdocs.yml does not exist"]
    listed = [one or other for one, other in NAV.findall((root / "mkdocs.yml").read_text(encoding="utf-8"))]
    there = {path.relative_to(root / "docs").as_posix() for path in (root / "docs").rglob("*.md")}
    return ([f"mkdocs.yml: nav lacks {page}" for page in sorted(there - set(listed))] +
            [f"mkdocs.yml: nav has {page}, which docs/ has not" for page in sorted(set(listed) - there)] +
            [f"mkdocs.yml: nav has {page} more than once" for page in sorted({page for page in listed if listed.count(page) > 1})])


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
            if name not in seen and site_slug(heading.group(1)) != name:
                found.add("\0" + name)  # spelled otherwise in the site
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
        if "\0" + anchor in known[target] and target.is_relative_to(root / "docs"):
            return [f"{where}: #{anchor} of {target.relative_to(root)} is spelled otherwise in the site; write the heading without marks between blanks"]
    return []


def check(root):
    faults, known = check_nav(root), {}
    for path in files(root):
        name = path.relative_to(root).as_posix()
        if name == "tests/check_links.py":
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        if path.suffix == ".md":
            home = home_of(name)
            for number, line in enumerate(text.splitlines() if home else [], 1):
                faults += [f"{name}:{number}: {file} does not exist" for file in SPAN.findall(line) if not (root / file).exists()]
            for number, line in enumerate(without_code(text), 1):
                for link in LINK.findall(line):
                    if re.match(r"[a-z][a-z0-9+.-]*:", link):  # another server's
                        continue
                    file, _, anchor = link.partition("#")
                    target = (path.parent / file).resolve() if file else path
                    if home and not target.is_relative_to(root / home):
                        faults.append(f"{name}:{number}: the link {link} leaves {home}/, and would break where the page is installed; "
                                      "name the file in a code span")
                        continue
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
        (root / "examples/one").mkdir()
        (root / "examples/one/README.md").write_text("[up](../../docs/page.md) [own](README.md) `core/a.hpp` `core/b.hpp`\n")
        (root / "docs/far.md").write_text("# A - b\n[tree](../core/a.hpp) [page](page.md)\n[here](#a---b)\n")
        (root / "mkdocs.yml").write_text("nav:\n  - P: page.md\n  - T:\n      - O: other.md\n      - O: other.md\n      - G: gone.md\n")
        leaves = "and would break where the page is installed; name the file in a code span"
        expected = ["mkdocs.yml: nav lacks far.md", "mkdocs.yml: nav has gone.md, which docs/ has not", "mkdocs.yml: nav has other.md more than once",
                    f"examples/one/README.md:1: the link ../../docs/page.md leaves examples/one/, {leaves}",
                    "examples/one/README.md:1: core/b.hpp does not exist", f"docs/far.md:2: the link ../core/a.hpp leaves docs/, {leaves}",
                    "docs/far.md:3: #a---b of docs/far.md is spelled otherwise in the site; write the heading without marks between blanks",
                    "docs/page.md:2: docs/none.md does not exist", "docs/page.md:2: docs/other.md has no section #not",
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
