#!/usr/bin/env python3
"""Writes the generated pages of docs/reference from the program and its sources, and compares them.

    tests/reference_pages.py build/bin/invar            # write the pages
    tests/reference_pages.py build/bin/invar --check    # exit status 1 where a page differs, with the command to run

commands.md comes from --help, components.md and topics.md from `invar types`, terms.md from core/physics/terms, types.md from idl/,
qos-profiles.md from deployment/profiles.yaml, the example of model-file.md from the program. The check also asks the pages written by hand for each key that the code reads or writes.
"""
import argparse
import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGES = ROOT / "docs" / "reference"
NOTE = "<!-- Made by tests/reference_pages.py; do not edit. -->\n"

# Pages written by hand, and the sources whose keys they must name: what a reader asks a file for, or a writer puts into it.
READS = re.compile(r'(?:\.|->)(?:number|integer|text|flag|choice|required|has)\(\s*"(\w+)"|[\w)]\["(\w+)"\]')
WRITES = re.compile(r'\["(\w+)"\]|\{"(\w+)",(?!\s*")')
BY_HAND = [
    ("cell-file.md", READS, ["core/config/cell.cpp"]),
    ("machine-file.md", READS, ["core/machine/machine_file.cpp"]),
    ("report-file.md", WRITES, ["core/diagnosis/report/report_json.cpp"]),
]


def run(invar, *arguments):
    return subprocess.run([str(invar), *arguments], check=True, capture_output=True, text=True, timeout=60).stdout


def table(head, rows):
    cells = [[str(cell).replace("|", "\\|").replace("\n", " ") for cell in row] for row in rows]
    return "\n".join("| " + " | ".join(row) + " |" for row in [head, ["---"] * len(head), *cells]) + "\n"


def code(text):
    return f"`{text}`" if text else ""


# ------------------------------------------------------------------ commands

def commands_of(text):
    """Names of the subcommands in a help text."""
    listed = re.search(r"^Subcommands:\n((?:  .*\n)*)", text, re.M)
    return re.findall(r"^  (\S+)", listed.group(1), re.M) if listed else []


def commands(invar):
    parts = ["# Commands\n", NOTE,
             "Each command prints the text below with `--help`. [Exit statuses](exit-status.md) are those of all commands.\n"]

    def add(words):
        text = run(invar, *words[1:], "--help")
        parts.append(f"{'#' * min(len(words) + 1, 4)} {' '.join(words)}\n\n```text\n{text.strip()}\n```\n")
        for name in commands_of(text):
            add([*words, name])

    add(["invar"])
    return "\n".join(parts)


# ------------------------------------------------------------------ components

def number(value):
    return "" if value is None else f"{value:g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value)


def default_of(value):
    if isinstance(value, bool):
        return "true" if value else "false"
    return json.dumps(value) if isinstance(value, (list, dict)) else number(value)


def bounds(lower, upper):
    if lower is None and upper is None:
        return ""
    return f"{number(lower) or '-inf'} .. {number(upper) or 'inf'}"


def with_ports(invar, component, cells):
    """The component as the first cell of deployment/ has it, where its ports follow from parameters without a default."""
    for cell in cells:
        if re.search(rf"type: {component['type']}\b", cell.read_text()):
            shown = json.loads(run(invar, "types", component["type"], "--cell", str(cell), "--json"))
            return shown, cell.relative_to(ROOT).as_posix()
    return component, ""


def component_page(component, source):
    out = [f"## {component['type']}\n", component["description"][0].upper() + component["description"][1:] + ".\n"]
    if component["ports"]:
        if source:
            out.append(f"Ports follow from parameters; these are the ports in `{source}`.\n")
        rows = [[code(p["name"]), p["direction"], f"[{p['data']}](types.md#{anchor(p['data'])})", p["profile"],
                 "optional" if p["optional"] else ""] for p in component["ports"]]
        out.append(table(["port", "direction", "type", "QoS profile", ""], rows))
    elif "ports_unknown" in component:
        out.append("Ports follow from parameters that have no default.\n")
    if component["parameters"]:
        rows = [[code(p["path"]), p["type"], p["unit"], bounds(p["lower"], p["upper"]), code(default_of(p["default"])),
                 "yes" if p["while_running"] else "", p["description"]] for p in component["parameters"]]
        out.append(table(["parameter", "type", "unit", "bounds", "default", "changes while running", "meaning"], rows))
    if component.get("registers"):
        rows = [[code(r["name"]), r["unit"], r["access"], r["need"], r["description"]] for r in component["registers"]]
        out.append(table(["register", "unit", "access", "need", "meaning"], rows))
    return "\n".join(out)


def all_components(invar):
    """Each component type, with the cell that its ports are taken from where they follow from parameters."""
    cells = sorted(path for path in (ROOT / "deployment").glob("*.yaml") if "invar_cell:" in path.read_text())
    return [with_ports(invar, component, cells) if "ports_unknown" in component else (component, "")
            for component in json.loads(run(invar, "types", "--json"))]


def components(listed):
    return "\n".join(["# Components\n", NOTE,
                      "Component types that a cell file can name. `invar types TYPE --cell CELL` shows the ports in a given cell.\n",
                      *(component_page(component, source) for component, source in listed)])


# ------------------------------------------------------------------ topics

# Topics that each cell has whatever its components are; Commands.Looking compares them, and those of components, with a running cell.
OF_EACH_CELL = [("process/status", "invar::lifecycle::ProcessStatus", "state", "rate, overruns and latencies of each process"),
                ("process/components", "invar::lifecycle::ComponentStatus", "state", "state and failure of each component"),
                ("process/notices", "invar::event::Notice", "event", "warnings and faults, also of components")]

RULES = """CELL is the `name` of the cell file, NAME that of the component there. Example: `deployment/xy-table.yaml` has `name: xy_table` and
a component `thermal` of type `thermal`, so the topic of its port `state` is `cell/xy_table/thermal/state`.

- *reads* and *writes* say what another program does with the topic: it reads outputs and writes inboxes.
- A port that `connect` joins to a port of another component has the topic of that port. Inputs have no topic of their own.
- `qos` of a component gives a port another profile, and `publish` a highest rate.
- A port with `_x` stands for one of each axis; where zones or axes follow from parameters, the ports are those of a cell of `deployment/`.

In a running cell `invar topics CELL` lists who writes and reads each topic, with the QoS. How to join: [other DDS programs](../how-to/other-dds-programs.md),
[connect to the plant](../how-to/connect-to-the-plant.md).
"""


def type_link(name):
    return f"[{name}](types.md#{anchor(name)})"


def profile_link(name):
    return f"[{name}](qos-profiles.md#{anchor(name)})"


def topics(listed):
    rows, unknown = [], []
    for component, _ in listed:
        if "ports_unknown" in component:
            unknown.append(code(component["type"]))
        for port in component["ports"]:
            if port["direction"] == "input" or port["data"] in ("invar::event::Notice", "invar::standby::WarmState"):
                continue  # the cell's own topics
            rows.append([component["type"], code(port["name"]), code(f"cell/CELL/NAME/{port['name']}"),
                         "reads" if port["direction"] == "output" else "writes", type_link(port["data"]), profile_link(port["profile"])])
    return "\n".join(["# Topics\n", NOTE, "Topic, type and QoS profile of each port that another DDS program can read or write.\n", RULES,
                      "## Topics of components\n",
                      table(["component type", "port", "topic", "another program", "IDL type", "QoS profile"], rows),
                      *([f"Ports of {', '.join(unknown)} follow from parameters; `invar types TYPE --cell CELL` shows those of a cell.\n"] if unknown else []),
                      "## Topics of each cell\n",
                      table(["topic", "another program", "IDL type", "QoS profile", "content"],
                            [[code(f"cell/CELL/{topic}"), "reads", type_link(data), profile_link(profile), words]
                             for topic, data, profile, words in OF_EACH_CELL])])


# ------------------------------------------------------------------ physics terms

def strings(text):
    """C++ string literals, joined."""
    return "".join(re.findall(r'"((?:[^"\\]|\\.)*)"', text)).replace('\\"', '"')


def member(text, name):
    found = re.search(rf"\.{name} =\s*((?:\"(?:[^\"\\]|\\.)*\"\s*)+)", text)
    return strings(found.group(1)) if found else ""


PARAMETER = re.compile(r'\{\s*"(\w+)",\s*"([^"]*)",\s*\{([^{}]*)\},\s*Role::(\w+),\s*\{[^{}]*\},\s*((?:"(?:[^"\\]|\\.)*"\s*)+)\}')


def term(path):
    text = path.read_text()
    equation = re.search(r"^// Equation: (.*)$", text, re.M)
    info = text[text.index("TermInfo info{"):text.index("static constexpr", text.index("TermInfo info{"))]
    parameters = [(name, unit, [b.strip() for b in limits.split(",")] if limits.strip() else [], role, strings(words))
                  for name, unit, limits, role, words in PARAMETER.findall(info)]
    named = info.count("Role::")
    if not equation or len(parameters) != named or not member(info, "source"):
        sys.exit(f"{path.relative_to(ROOT)}: a term needs a comment `// Equation: ...`, parameters in the usual order and a source")
    return {"name": member(info, "name"), "site": member(info, "site"), "description": member(info, "description"),
            "source": member(info, "source"), "equation": equation.group(1), "parameters": parameters}


def terms():
    parts = ["# Physics terms\n", NOTE,
             "Terms that a model can hold and a diagnosis can find, by plant. The unit `*` follows from the user's equations.\n",
             "SI throughout; temperatures in degC. A term without its amplitude has no effect. "
             "In `equations`, s is the state, w the variable of the term.\n"]
    for plant in ["axis", "thermal", "error_map", "droplet", "sensor", "equations"]:
        parts.append(f"## Plant {plant}\n")
        for one in (term(path) for path in sorted((ROOT / "core/physics/terms" / plant).glob("*.hpp"))):
            parts.append(f"### {plant}: {one['name']}\n\n{one['description']}\n\n- Site: `{one['site']}`\n"
                         f"- Equation: `{one['equation']}`\n- Source: {one['source']}\n")
            parts.append(table(["parameter", "unit", "bounds", "role", "meaning"],
                               [[code(name), unit, " .. ".join(limits), role, words]
                                for name, unit, limits, role, words in one["parameters"]]))
    return "\n".join(parts)


# ------------------------------------------------------------------ types of samples

DECLARATION = re.compile(r"(@final\s+)?(struct|enum)\s+(\w+)\s*\{(.*?)\n?\};", re.S)


def anchor(name):
    return re.sub(r"[^\w\- ]", "", name.lower()).replace(" ", "-")


def comment_before(text):
    """The /// lines that end right before a declaration, as one text."""
    lines = text.rstrip().split("\n")
    kept = []
    while lines and lines[-1].strip().startswith("///"):
        kept.insert(0, lines.pop().strip()[3:].strip())
    return " ".join(kept)


def field_rows(body):
    rows, words = [], []
    for line in body.split("\n"):
        line = line.strip()
        if line.startswith("///"):
            words.append(line[3:].strip())
        found = re.match(r'(@key\s+)?(?:@unit\("([^"]*)"\)\s+)?([\w:<>, ]+?)\s+(\w+)((?:\[\d+\])?);\s*(?:///?<?\s*(.*))?$', line)
        if found:
            key, unit, kind, name, size, behind = found.groups()
            rows.append([code(name), code(kind + size), unit or "", "key" if key else "", " ".join(words) or behind or ""])
            words = []
    return rows


def idl_page(path):
    text = path.read_text()
    head = re.match(r"// (\w+): (.*)", text)
    scope = "::".join(re.findall(r"\bmodule (\w+) \{", text))
    out = [f"## {path.stem}\n", (head.group(2)[0].upper() + head.group(2)[1:] if head else "") + "\n"]
    for found in DECLARATION.finditer(text):
        out.append(f"### {scope}::{found.group(3)}\n")
        words = comment_before(text[:found.start()])
        if words:
            out.append(words + "\n")
        if found.group(2) == "enum":
            names = re.findall(r"\b[A-Z]\w+", re.sub(r"//.*", "", found.group(4)))
            out.append("Values: " + ", ".join(f"`{name}` ({i})" for i, name in enumerate(names)) + ".\n")
        else:
            out.append(table(["field", "type", "unit", "", "meaning"], field_rows(found.group(4))))
    return "\n".join(out)


def types():
    return "\n".join(["# Types of samples\n", NOTE,
                      "Each type is an OMG IDL type with final extensibility. Numbers are SI. Times are whole nanoseconds; the field's name ends in `_ns`.\n",
                      *(idl_page(path) for path in sorted((ROOT / "idl").glob("*.idl")))])


# ------------------------------------------------------------------ QoS profiles

POLICIES = {"reliability": "RELIABILITY", "keep_last": "HISTORY, KEEP_LAST depth", "keep_all": "HISTORY, KEEP_ALL; RESOURCE_LIMITS per instance",
            "durability": "DURABILITY", "deadline": "DEADLINE period", "lifespan": "LIFESPAN duration", "lease": "LIVELINESS lease_duration",
            "liveliness": "LIVELINESS kind", "ownership": "OWNERSHIP", "strength": "OWNERSHIP_STRENGTH", "max_instances": "RESOURCE_LIMITS max_instances",
            "traffic": "participant of the process", "flow_bytes_per_second": "flow controller of the writer"}


def profiles():
    text = (ROOT / "deployment/profiles.yaml").read_text()
    parts = ["# QoS profiles\n", NOTE,
             "Profiles of `deployment/profiles.yaml`, which a cell file names under `profiles`. Plain times are seconds.\n",
             "`invar profiles --xml fastdds` or `cyclone` writes them for other DDS programs.\n"]
    for name, body in re.findall(r"^  (\w+):\n((?:    .*\n|\s*\n)+)", text, re.M):
        entries = re.findall(r"^    (\w+): *(\{[^}]*\}|[^#\n]*?) *(?:# *(.*))?$", body, re.M)
        purpose = dict((key, value) for key, value, _ in entries)["for"]
        parts.append(f"## {name}\n\n{purpose[0].upper() + purpose[1:]}.\n")
        parts.append(table(["key", "value", "DDS policy", "reason"],
                           [[code(key), value, POLICIES[key], why] for key, value, why in entries if key != "for"]))
    return "\n".join(parts)


# ------------------------------------------------------------------ pages written by hand

# A block that a program prints: the call stands in a comment on the line before it.
PRINTED = re.compile(r"(<!-- invar (.+) -->\n```yaml\n)(.*?)(```\n)", re.S)


def with_printed_blocks(invar, text):
    text, count = PRINTED.subn(lambda found: found.group(1) + run(invar, *found.group(2).split()) + found.group(4), text)
    return text if count else sys.exit("docs/reference/model-file.md: its printed example is gone: `<!-- invar diagnose --example axis -->`")


def missing_keys():
    for page, pattern, sources in BY_HAND:
        text = (PAGES / page).read_text()
        for source in sources:
            for key in sorted({a or b for a, b in (m for m in pattern.findall((ROOT / source).read_text()))}):
                if not re.search(rf"(?<!\w){re.escape(key)}(?!\w)", text):
                    yield f"docs/reference/{page}: the key `{key}` of {source} is missing; describe it"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("invar", type=pathlib.Path, help="the program, build/bin/invar")
    parser.add_argument("--check", action="store_true", help="compare only")
    options = parser.parse_args()
    listed = all_components(options.invar)
    made = {"commands.md": commands(options.invar), "components.md": components(listed), "topics.md": topics(listed),
            "terms.md": terms(), "types.md": types(),
            "qos-profiles.md": profiles(),
            "model-file.md": with_printed_blocks(options.invar, (PAGES / "model-file.md").read_text())}
    faults = []
    for name, text in made.items():
        path = PAGES / name
        if options.check and (not path.exists() or path.read_text() != text):
            faults.append(f"docs/reference/{name} is old; run: tests/reference_pages.py build/bin/invar")
        elif not options.check:
            path.write_text(text)
    faults += missing_keys()
    print("\n".join(faults), end="\n" if faults else "")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
