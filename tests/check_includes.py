#!/usr/bin/env python3
"""Dependencies point one way: checks every #include against the table of what a room may use."""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent

# External libraries by the beginning of the path that is included.
LIBRARIES = {
    "yaml-cpp/": "yaml-cpp", "Eigen/": "Eigen", "opencv2/": "OpenCV", "modbus.h": "libmodbus",
    "modbus/": "libmodbus", "fastdds/": "Fast DDS", "fastrtps/": "Fast DDS", "fastcdr/": "Fast DDS", "zlib.h": "compression",
    "zstd.h": "compression", "lz4": "compression", "CLI/": "CLI11", "nlohmann/": "nlohmann-json", "muParser": "muParser",
    "spdlog/": "spdlog", "gtest/": "tests", "gmock/": "tests", "benchmark/": "tests", "dds/dds.h": "Cyclone DDS",
}

# A room -> what it may use beside itself. "idl" is everything generated from idl/.
ROOMS = {
    "core/base": [],
    "core/config": ["core/base", "yaml-cpp"],
    "core/numerics": ["core/base", "Eigen"],
    "core/metrology": ["core/base", "core/numerics", "Eigen"],
    "core/machine": ["core/base", "core/config", "core/numerics", "core/metrology", "core/physics", "yaml-cpp", "Eigen"],
    "core/compensation": ["core/base", "core/config", "core/numerics", "core/metrology", "core/physics", "Eigen", "compression"],
    "core/physics": ["core/base", "core/numerics", "Eigen", "muParser"],
    "core/model": ["core/base", "core/config", "core/physics", "core/recording", "yaml-cpp"],
    "core/component": ["core/base", "core/config", "idl"],
    "core/executor": ["core/base", "core/config", "core/component", "idl"],
    "core/dds": ["core/base", "core/config", "core/component", "core/executor", "idl", "Fast DDS"],
    "core/modbus": ["core/base", "core/config", "libmodbus"],
    "core/recording": ["core/base", "idl", "compression", "nlohmann-json"],
    "tools": None,  # everything
}
COMPONENT = ["core/base", "core/config", "core/component", "core/numerics", "core/metrology", "core/machine", "core/compensation",
             "core/physics", "core/modbus", "idl", "Eigen", "yaml-cpp"]
MORE_FOR = {"vision": ["OpenCV", "compression"], "calibration": ["core/model", "core/recording"],
            "recorder": ["core/recording", "core/dds"], "dispenser": ["core/model", "core/recording"], "supervisor": ["core/dds"],
            "stage": ["core/model"], "compensation": ["core/model"], "watch": ["core/model"], "world": ["core/model"]}

INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]')


def room_of(path: str):
    parts = path.split("/")
    if parts[0] == "core" and len(parts) > 2:
        return "core/" + parts[1]
    if parts[0] == "components" and len(parts) > 2:
        return "components/" + parts[1]
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


def main() -> int:
    faults = 0
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
                if used is None or used == room or may is None or used in may:
                    continue
                print(f"{name}:{number}: {room} may not use {used}; it may use: {', '.join(may) or 'nothing'}")
                faults += 1
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
