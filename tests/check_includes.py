#!/usr/bin/env python3
"""Dependencies point one way: checks every #include against the table of what a room may use, and that no modules (a header
with its source) include one another in a circle. Nothing else than the house stands at the top of the repository."""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent

TOP = set(""".ci .clang-format .clang-tidy .editorconfig .gitignore CHANGELOG.md CMakeLists.txt CMakePresets.json CONTRIBUTING.md
README.md SECURITY.md cmake components core deployment docs examples idl mkdocs.yml tests tools""".split())

# External libraries by the beginning of the path that is included.
LIBRARIES = {
    "yaml-cpp/": "yaml-cpp", "Eigen/": "Eigen", "opencv2/": "OpenCV", "modbus.h": "libmodbus",
    "modbus/": "libmodbus", "fastdds/": "Fast DDS", "fastrtps/": "Fast DDS", "fastcdr/": "Fast DDS", "zlib.h": "compression",
    "zstd.h": "compression", "lz4": "compression", "CLI/": "CLI11", "nlohmann/": "nlohmann-json", "muParser": "muParser",
    "spdlog/": "spdlog", "prometheus/": "prometheus-cpp", "openssl/": "OpenSSL", "gtest/": "tests", "gmock/": "tests", "benchmark/": "tests", "dds/dds.h": "Cyclone DDS",
}

# The rooms of core/metrology know nothing of one another.
METROLOGY = [f"core/metrology/{subject}" for subject in ("geometric", "thermal", "fusion", "droplet", "camera")]

# A room -> what it may use beside itself. "idl" is everything generated from idl/.
ROOMS = {
    "core/base": [],
    "core/config": ["core/base", "yaml-cpp"],
    "core/numerics": ["core/base", "Eigen"],
    "core/machine": ["core/base", "core/config", "core/numerics", *METROLOGY, "core/physics", "yaml-cpp", "Eigen"],
    "core/compensation": ["core/base", "core/config", "core/numerics", *METROLOGY, "core/physics", "Eigen", "compression"],
    "core/physics": ["core/base", "core/numerics", "Eigen", "muParser"],
    "core/vision": ["core/base", "core/config", "core/numerics", "core/metrology/droplet", "core/metrology/camera", "core/compensation", "Eigen", "OpenCV", "compression"],
    "core/model": ["core/base", "core/config", "core/physics", "core/recording", "yaml-cpp"],
    "core/component": ["core/base", "core/config", "idl"],
    "core/job": ["core/base", "core/config", "core/component", "idl", "Eigen"],
    "core/executor": ["core/base", "core/config", "core/component", "idl"],
    "core/dds": ["core/base", "core/config", "core/component", "core/executor", "idl", "Fast DDS", "OpenSSL"],
    "core/modbus": ["core/base", "core/config", "libmodbus"],
    "core/recording": ["core/base", "idl", "compression", "nlohmann-json"],
    "tools": None,  # everything
    "tools/commands": None,
    "tools/report": ["core/base", "nlohmann-json"],
    "tools/host": ["core/base", "core/config", "core/dds", "spdlog"],
    "tools/live": ["core/base", "core/config", "core/dds", "tools/host", "idl", "CLI11", "nlohmann-json"],
    "tools/metrics": ["core/base", "core/dds", "tools/live", "idl", "prometheus-cpp"],
    "tools/image": ["core/vision", "tools/report"],
    "tools/thermal": ["core/metrology/thermal", "tools/report", "nlohmann-json"],
    "tools/calibration": ["core/base", "core/compensation", "core/config", "core/recording", "tools/live", "tools/report", "Eigen", "nlohmann-json"],
    "tools/new": [],
}
CALIBRATED = ["core/base", "core/compensation", "core/config", "core/numerics", "core/recording", *METROLOGY, "tools/calibration", "tools/report", "Eigen",
              "nlohmann-json"]
DEPLOYED = ["core/base", "core/config", "core/dds", "core/job", "tools/cell", "tools/host", "OpenSSL"]
ROOMS |= {
    "tools/geometric": CALIBRATED,
    "tools/history": CALIBRATED,
    "tools/deploy": DEPLOYED,
    "tools/keys": [*DEPLOYED, "tools/report", "components/recorder", "components/supervisor"],
    # A cell is loaded, run and summed up: it knows all components, but no command and none of the engines behind these.
    "tools/cell": ["components", "components/calibration", "components/compensation", "components/recorder", "components/stage",
                   "components/supervisor", "core/base", "core/compensation", "core/component", "core/config", "core/dds", "core/executor",
                   "core/job", "core/metrology/droplet", "core/metrology/geometric", "core/recording", "tools/host", "tools/live",
                   "tools/report", "idl", "nlohmann-json", "spdlog"],
}
for subject in METROLOGY:
    ROOMS[subject] = ["core/base", "core/numerics", "Eigen"]
COMPONENT = ["core/base", "core/config", "core/component", "core/numerics", *METROLOGY, "core/machine", "core/compensation",
             "core/physics", "core/modbus", "core/job", "idl", "Eigen", "yaml-cpp"]
# The print job is no component: calibration runs it.
MORE_FOR = {"vision": ["core/vision"], "calibration": ["core/model", "core/recording", "components/printing"],
            "printing": ["core/recording"],
            "recorder": ["core/recording", "core/dds"], "dispenser": ["core/model", "core/recording"], "supervisor": ["core/dds"],
            "stage": ["core/model"], "compensation": ["core/model"], "watch": ["core/model"], "world": ["core/model"]}

# The rooms of core/diagnosis by stage: each may use those before it.
STAGES = ["dataset", "estimate", "segments", "locate", "checks", "candidates", "evidence", "search", "report"]
DIAGNOSIS = ["core/base", "core/config", "core/numerics", "core/physics", "core/model", "core/recording", "Eigen"]
ROOMS["core/diagnosis"] = []  # thresholds.hpp
for at, stage in enumerate(STAGES):
    ROOMS[f"core/diagnosis/{stage}"] = DIAGNOSIS + ["core/diagnosis"] + [f"core/diagnosis/{earlier}" for earlier in STAGES[:at]]
ROOMS["core/diagnosis/report"].append("nlohmann-json")
ROOMS["tools/diagnose"] = ["core/base", "core/physics", "core/diagnosis", *(f"core/diagnosis/{stage}" for stage in STAGES), "tools/report"]

# Modules that still include one another; no further ones may, and a set that is cut leaves the list.
CIRCLES = [
    {"core/component/component", "core/component/port"},
    {"core/config/yaml", "core/config/yaml_document"},
    {"core/physics/simulation", "core/physics/simulate_plants"},
    {"core/metrology/thermal/thermal_identification", "core/metrology/thermal/thermal_regression"},
    {"core/metrology/geometric/displacement_line", "core/metrology/geometric/line_fit"},
    {"core/metrology/droplet/droplet_trajectory", "core/metrology/droplet/droplet_fit"},
    {"core/modbus/map", "core/modbus/codec"},
    {"core/vision/outline", "core/vision/outline_curve"},
    {"core/dds/rtps_message", "core/dds/rtps_parameters", "core/dds/sequence_guard"},
    {"core/dds/node", "core/dds/connection", "core/dds/participant"},
    {"core/recording/recording_reader", "core/recording/mcap_scan"},
    {"tools/geometric/components_file", "tools/geometric/components_page"},
]

INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]')


def room_of(path: str):
    parts = path.split("/")
    if parts[:2] in (["core", "diagnosis"], ["core", "metrology"]) and len(parts) > 3:
        return "/".join(parts[:3])
    if parts[0] == "core" and len(parts) > 2:
        return "core/" + parts[1]
    if parts[0] in ("components", "tools") and len(parts) > 2:
        return parts[0] + "/" + parts[1]
    return parts[0]


def used_room(include: str):
    for prefix, library in LIBRARIES.items():
        if include.startswith(prefix):
            return library
    if include.startswith(("core/", "components/", "tools/")):
        return room_of(include)
    if include.startswith("idl/"):
        return "idl"
    return None  # the standard library, the system, a generated type


def allowed(room: str):
    if room.startswith("components/"):
        return COMPONENT + MORE_FOR.get(room.split("/")[1], [])
    return ROOMS.get(room, "unknown")


def module_of(path: str):
    return path.rsplit(".", 1)[0]


def circles(uses: dict):
    """Sets of modules that reach one another; `uses`: module -> modules that it includes (Tarjan 1972)."""
    found, number, low, stack = [], {}, {}, []

    def visit(module):
        number[module] = low[module] = len(number)
        stack.append(module)
        for other in sorted(uses.get(module, ())):
            if other not in number:
                visit(other)
            if other in stack:
                low[module] = min(low[module], low[other])
        if low[module] == number[module]:
            circle = stack[stack.index(module):]
            del stack[stack.index(module):]
            if len(circle) > 1:
                found.append(circle)

    sys.setrecursionlimit(10000)
    for module in sorted(uses):
        if module not in number:
            visit(module)
    return found


def strangers() -> list:
    """What git keeps at the top beside the house, as the log of a run; nothing in a copy without git."""
    kept = subprocess.run(["git", "-C", str(ROOT), "ls-files", "-z"], capture_output=True, text=True).stdout.split("\0")
    return sorted({name.split("/")[0] for name in kept if name} - TOP)


def main() -> int:
    faults = 0
    uses = {}
    for name in strangers():
        print(f"{name}: stands at the top of the repository; take it out, or add it to TOP in tests/check_includes.py")
        faults += 1
    for folder in ("core", "components", "tools"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix not in (".hpp", ".cpp", ".h"):
                continue
            name = path.relative_to(ROOT).as_posix()
            room = room_of(name)
            if room == "components":  # components/all.cpp lists them all
                continue
            may = allowed(room)
            if may == "unknown":
                print(f"{name}: room {room} is not in the table of tests/check_includes.py")
                faults += 1
                continue
            for number, line in enumerate(path.read_text().splitlines(), 1):
                match = INCLUDE.match(line)
                used = used_room(match.group(1)) if match else None
                if match and (ROOT / match.group(1)).exists() and module_of(match.group(1)) != module_of(name):
                    uses.setdefault(module_of(name), set()).add(module_of(match.group(1)))
                if used is None or used == room or may is None or used in may:
                    continue
                print(f"{name}:{number}: {room} may not use {used}; it may use: {', '.join(may) or 'nothing'}")
                faults += 1
    found = circles(uses)
    for circle in CIRCLES:
        if not any(circle == set(one) for one in found):
            print(f"tests/check_includes.py: strike {sorted(circle)} from CIRCLES: nothing includes in this circle any more")
            faults += 1
    for circle in (one for one in found if set(one) not in CIRCLES):
        print("these modules include one another in a circle: " + ", ".join(circle))
        faults += 1
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
