# Writes types.hpp from the IDL files: INVAR_IDL_TYPES(X) calls X once for every keyed type, that is, for all that
# travel on topics of their own; within_bounds(x) says whether a received sample keeps the bounds of its IDL, which
# the generated code does not check (sequences, enumerations); not_finite(x) names the first real member that is no
# finite number, nullptr where there is none.
import pathlib
import re
import sys


# Where a number that is none says something, or the component that takes the sample answers to it in its own state.
NOT_ASKED = {
    "invar::sensing::AxisReading": "not a number where it does not measure that",
    "invar::stage::IndexPulse": "no pulse yet; homing asks whether it is a number",
    "invar::sensing::FusedPosition": "`valid` says whether it is one; the stage brakes on it",
    "invar::compensation::AxisCorrection": "nothing known is an infinite sigma; the stage brakes on a correction that is none",
    "invar::thermal::NodeTemperature.temperature": "not a number before the first reading",
    "invar::image::MeasuredDroplet.position_sigma": "infinite: nothing known",
    "invar::image::MeasuredDroplet.diameter_sigma": "infinite: nothing known",
    "invar::image::VisionStatus.scale_sigma": "infinite: nothing known",
    "invar::dispensing::PressureState.pressure": "not a number before the first reading, and `stale`",
    "invar::dispensing::PressureState.purge_pressure": "not a number before the first reading, and `stale`",
    "invar::stage::AxisCommand": "the stage refuses it in its state, and stops or lets go whatever its numbers",
    "invar::thermal::ThermalCommand": "thermal refuses the setpoint, and switches off all the same",
    "invar::dispensing::PressureCommand": "the dispenser refuses the setpoint, and switches off all the same",
    "invar::dispensing::PatternCommand": "the dispenser answers it with a refusal",
}


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

    def statements(self, struct):
        """The C++ statements that return the name of a real member that is not finite."""
        found = []
        if struct in NOT_ASKED:
            return found
        for member in self.structs[struct].split(";"):
            member = re.sub(r'@\w+(\("[^"]*"\))?', "", member).strip()
            if not member:
                continue
            kind, name, array = re.fullmatch(r"(.+?)\s+(\w+)((?:\[\d+\])*)", member, flags=re.S).groups()
            if f"{struct}.{name}" in NOT_ASKED:
                continue
            sequence = re.fullmatch(r"sequence<\s*([\w:]+)\s*,\s*(\d+)\s*>", kind)
            kind = sequence[1] if sequence else kind
            value = f"sample.{name}()"
            each = f"for (const auto& one : {value}) " if array or sequence else ""
            one = "one" if each else value
            scoped = self.find(kind, struct)
            if kind in ("double", "float"):
                found.append(f'{each}if (!std::isfinite({one})) return "{name}";')
            elif scoped in self.structs and self.statements(scoped):
                found.append(f"{each}if (const char* member = not_finite({one})) return member;")
        return found


def main(output, files):
    files = [pathlib.Path(file) for file in files]
    idl = Idl(files)
    lines = ["// Generated from the IDL files: every type that travels on a topic, its bounds and numbers.",
             "#pragma once", "", "#include <algorithm>", "#include <cmath>", ""]
    lines += [f'#include "idl/{file.stem}PubSubTypes.h"' for file in files]
    types = idl.topic_types()
    lines += ["", "#define INVAR_IDL_TYPES(X) \\"]
    lines += [f"  X({name}) \\" for name in types[:-1]] + [f"  X({types[-1]})", "", "namespace invar::idl {", ""]
    for name in idl.structs:
        conditions = idl.conditions(name)
        argument = "sample" if conditions else ""
        lines.append(f"inline bool within_bounds(const {name}& {argument}) {{ "
                     f"return {' && '.join(conditions) or 'true'}; }}")
    for name in idl.structs:
        statements = idl.statements(name)
        lines.append(f"inline const char* not_finite(const {name}& {'sample' if statements else ''}) {{")
        lines += [f"  {statement}" for statement in statements] + ["  return nullptr;", "}"]
    lines += ["", "}  // namespace invar::idl", ""]
    pathlib.Path(output).write_text("\n".join(lines))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
