# Writes types.hpp from the IDL files: INVAR_IDL_TYPES(X) calls X once for every keyed type, that is, for all that
# travel on topics of their own.
import pathlib
import re
import sys


def topic_types(text):
    """Scoped names of the structs with a @key member, in file order."""
    text = re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.S)
    modules, depth_of, depth, found = [], [], 0, []
    tokens = re.finditer(r"\bmodule\s+(\w+)\s*\{|\bstruct\s+(\w+)\s*\{([^}]*)\}|[{}]", text)
    for token in tokens:
        if token[1]:
            modules.append(token[1])
            depth_of.append(depth)
            depth += 1
        elif token[2]:
            if "@key" in token[3]:
                found.append("::".join(modules + [token[2]]))
        elif token[0] == "{":
            depth += 1
        else:
            depth -= 1
            if depth_of and depth_of[-1] == depth:
                depth_of.pop()
                modules.pop()
    return found


def main(output, files):
    lines = ["// Generated from the IDL files: every type that travels on a topic.", "#pragma once", ""]
    types = []
    for file in map(pathlib.Path, files):
        types += topic_types(file.read_text())
        lines.append(f'#include "idl/{file.stem}PubSubTypes.h"')
    lines += ["", "#define INVAR_IDL_TYPES(X) \\"]
    lines += [f"  X({name}) \\" for name in types[:-1]] + [f"  X({types[-1]})", ""]
    pathlib.Path(output).write_text("\n".join(lines))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
