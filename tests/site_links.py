#!/usr/bin/env python3
"""Links of a site of HTML files lead to a file and a section of the site, and nothing is loaded from another server.

    tests/site_links.py FOLDER         # exit status 1 with one line a fault; tools/docs calls it
    tests/site_links.py --self-test    # faults are seen
"""
import html.parser
import pathlib
import sys
import tempfile
import urllib.parse

LOADED = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "srcset"}


class Page(html.parser.HTMLParser):
    """Sections of a page, and (line, link, is loaded) of what it names."""

    def __init__(self, text):
        super().__init__()
        self.sections, self.links = set(), []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.sections.update(given[name] for name in ("id", "name") if given.get(name))
        if tag in LOADED and given.get(LOADED[tag]):
            self.links.append((self.getpos()[0], given[LOADED[tag]], True))
        elif tag == "a" and given.get("href"):
            self.links.append((self.getpos()[0], given["href"], False))


def check(site):
    pages = {path: Page(path.read_text(encoding="utf-8", errors="replace")) for path in sorted(site.rglob("*.html"))}
    faults = [] if pages else [f"{site}: has no page"]
    for path, page in pages.items():
        if path.name == "404.html":  # its links count from the root of a server
            continue
        where = path.relative_to(site).as_posix()
        for line, link, loaded in page.links:
            parts = urllib.parse.urlsplit(link)
            if parts.scheme or parts.netloc:
                if loaded and parts.scheme != "data":
                    faults.append(f"{where}:{line}: loads {link} from another server")
                continue
            target = (path.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else path
            section = urllib.parse.unquote(parts.fragment)
            if not target.is_file():
                faults.append(f"{where}:{line}: {link} is no file of the site")
            elif section and target in pages and section not in pages[target].sections:
                faults.append(f"{where}:{line}: {target.relative_to(site).as_posix()} has no section #{section}")
    return faults


def self_test():
    with tempfile.TemporaryDirectory() as folder:
        site = pathlib.Path(folder).resolve()
        (site / "a.html").write_text('<h1 id="top">x</h1><a href="b.html#here">1</a>\n<a href="b.html#gone">2</a>\n<a href="c.html">3</a>\n'
                                     '<a href="#top">4</a><a href="https://example.org/x">5</a>\n<script src="https://example.org/x.js"></script>')
        (site / "b.html").write_text('<a name="here"></a><img src="d.svg">')
        expected = ["a.html:2: b.html has no section #gone", "a.html:3: c.html is no file of the site",
                    "a.html:5: loads https://example.org/x.js from another server", "b.html:1: d.svg is no file of the site"]
        found = check(site)
        if found != expected:
            print("self-test: expected", *expected, "found", *found, sep="\n  ")
            return 1
    return 0


if __name__ == "__main__":
    if sys.argv[1:] == ["--self-test"]:
        sys.exit(self_test())
    if len(sys.argv) != 2:
        print(__doc__)
        sys.exit(2)
    found = check(pathlib.Path(sys.argv[1]).resolve())
    print("\n".join(found), end="\n" if found else "")
    sys.exit(1 if found else 0)
