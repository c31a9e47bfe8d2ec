#!/usr/bin/env python3
"""Functions of the diagnosis fit on a screen: none in core/diagnosis has more than 60 lines. Another limit may be given."""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
MOST_LINES = 60
NO_FUNCTION = ("namespace", "using", "constexpr", "struct", "class", "enum")


def functions(text: str, indent: str):
    """Begin and length of each function at this indentation, as clang-format lays it out: its last line is a lone brace."""
    begin = None
    for number, line in enumerate(text.split("\n"), 1):
        code = re.sub(r"\s*//.*", "", line)
        is_whole = "{" in code and code.count("{") == code.count("}")
        if code == indent + "}" and begin:
            yield begin, number - begin + 1
        if not code.startswith(indent) or code in (indent + "}", indent + "};") or code == "}":
            begin = None if code else begin  # a blank line ends nothing
        elif (begin is None and re.match(indent + r"[A-Za-z\[~]", code) and not code.endswith(";") and not is_whole
              and not code.lstrip().startswith(NO_FUNCTION)):
            begin = number


def main() -> int:
    most = int(sys.argv[1]) if len(sys.argv) > 1 else MOST_LINES
    faults = set()
    for path in sorted((ROOT / "core/diagnosis").rglob("*.[ch]pp")):
        for indent in ("", "  "):  # of a namespace, and of a class
            for begin, lines in functions(path.read_text(), indent):
                if lines > most:
                    faults.add(f"{path.relative_to(ROOT)}:{begin}: a function of {lines} lines; split it, the limit is {most}")
    for fault in sorted(faults):
        print(fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
