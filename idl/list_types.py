# Writes types.hpp from the IDL files: INVAR_IDL_TYPES(X) calls X once for every keyed type, that is, for all that
# travel on topics of their own; within_bounds(x) says whether a received sample keeps the bounds of its IDL, which
# the generated code does not check (sequences, enumerations).
import pathlib
import re
import sys


class Idl:
    """The structs and enumerations of all files, in file order, by scoped name."""

    def __init__(self, files):
        self.structs, self.enums = {}, {}
        for file in files:
            self.read(file.read_text())

    def read(self, text):
        text = re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.S)
        modules, levels, level = [], [], 0
        for token in re.finditer(r"\bmodule\s+(\w+)\s*\{|\b(struct|enum)\s+(\w+)\s*\{([^}]*)\}|[{}]", text):
            if token[1]:
                modules.append(token[1])
                levels.append(level)
                level += 1
            elif token[2]:
                kind = self.structs if token[2] == "struct" else self.enums
                kind["::".join(modules + [token[3]])] = token[4]
            elif token[0] == "{":
                level += 1
            else:
                level -= 1
                if levels and levels[-1] == level:
                    levels.pop()
                    modules.pop()

    def topic_types(self):
        return [name for name, body in self.structs.items() if "@key" in body]

    def find(self, name, inside):
        """The scoped name of a type named from within the type `inside`; None: a basic type."""
        scope = inside.split("::")[:-1]
        while True:
            scoped = "::".join(scope + [name])
            if scoped in self.structs or scoped in self.enums:
                return scoped
            if not scope:
                return None
            scope.pop()

    def condition(self, name, inside, value):
        """The C++ condition that `value` of type `name` keeps its bounds; None: it cannot break them."""
        scoped = self.find(name, inside)
        if scoped in self.enums:
            last = self.enums[scoped].split(",")[-1].strip()
            return f"{value} <= {scoped.rsplit('::', 1)[0]}::{last}"
        if scoped in self.structs and self.conditions(scoped):
            return f"within_bounds({value})"
        return None

    def conditions(self, struct):
        found = []
        for member in self.structs[struct].split(";"):
            member = re.sub(r'@\w+(\("[^"]*"\))?', "", member).strip()
            if not member:
                continue
            kind, name = re.fullmatch(r"(.+?)\s+(\w+)(?:\[\d+\])*", member, flags=re.S).groups()
            if sequence := re.fullmatch(r"sequence<\s*([\w:]+)\s*,\s*(\d+)\s*>", kind):
                found.append(f"sample.{name}().size() <= {sequence[2]}")
                if each := self.condition(sequence[1], struct, "one"):
                    found.append(f"std::all_of(sample.{name}().begin(), sample.{name}().end(), "
                                 f"[](const auto& one) {{ return {each}; }})")
            elif condition := self.condition(kind, struct, f"sample.{name}()"):
                found.append(condition)
        return found


def main(output, files):
    files = [pathlib.Path(file) for file in files]
    idl = Idl(files)
    lines = ["// Generated from the IDL files: every type that travels on a topic, and the bounds of each.",
             "#pragma once", "", "#include <algorithm>", ""]
    lines += [f'#include "idl/{file.stem}PubSubTypes.h"' for file in files]
    types = idl.topic_types()
    lines += ["", "#define INVAR_IDL_TYPES(X) \\"]
    lines += [f"  X({name}) \\" for name in types[:-1]] + [f"  X({types[-1]})", "", "namespace invar::idl {", ""]
    for name in idl.structs:
        conditions = idl.conditions(name)
        argument = "sample" if conditions else ""
        lines.append(f"inline bool within_bounds(const {name}& {argument}) {{ "
                     f"return {' && '.join(conditions) or 'true'}; }}")
    lines += ["", "}  // namespace invar::idl", ""]
    pathlib.Path(output).write_text("\n".join(lines))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
