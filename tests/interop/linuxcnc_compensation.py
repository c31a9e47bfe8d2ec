#!/usr/bin/env python3
# The real LinuxCNC, headless and not as root, loads the COMP files that `calibrate controller` writes: what it adds to the
# commanded position must be what `invar predict` says, on every axis, in both directions, with a reversal that varies; a
# rotary axis too, in degrees.
# usage: linuxcnc_compensation.py INVAR
import csv
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile

INVAR = os.path.abspath(sys.argv[1])
SEED = 61
TRAVEL = {"x": (0.0, 200.0), "y": (-60.0, 60.0), "z": (-80.0, 0.0)}  # mm
TARGETS = 5       # of each axis and direction
BOUND = 0.03e-3   # mm, between LinuxCNC and predict
LEAST = 2e-3      # mm, of the corrections: a table of zeros would agree too
TURN = (0.0, 360.0)      # deg, of the rotary axis C
BOUND_TURN = 0.02 / 3600  # deg
LEAST_TURN = 2.0 / 3600   # deg


def error(axis, q):  # um
    low, high = TRAVEL[axis]
    u = (q - low) / (high - low)
    return {"x": 8.0 * u + 2.0 * math.sin(5.0 * u), "y": 6.0 * u * u, "z": -5.0 * u}[axis]


def reversal(axis, q):  # um, forward minus backward
    low, high = TRAVEL[axis]
    u = (q - low) / (high - low)
    return {"x": 2.0 + 9.0 * u, "y": 4.0 * math.cos(4.0 * u), "z": 3.0}[axis]


def error_c(q):  # arcsec
    return 6.0 * math.sin(math.radians(q) + 0.3)


def reversal_c(q):  # arcsec
    return 5.0 + 2.0 * math.cos(math.radians(q))


def write_turns(file):
    noise = random.Random(SEED)
    with open(file, "w", encoding="utf-8") as out:
        out.write("c [deg],deviation [arcsec]\n")
        for go in range(6):
            way = 1 if go % 2 == 0 else -1
            places = [10.0 * i for i in range(37)]
            for q in places if way > 0 else reversed(places):
                out.write(f"{q},{error_c(q) + 0.5 * way * reversal_c(q) + noise.gauss(0.0, 0.05):.6f}\n")


def write_lines(file):
    noise = random.Random(SEED)
    print("seed", SEED)
    with open(file, "w", encoding="utf-8") as out:
        out.write("line,x [mm],y [mm],z [mm],displacement [mm],direction\n")
        for axis, (low, high) in TRAVEL.items():
            at = {other: max(lo, min(0.0, hi)) for other, (lo, hi) in TRAVEL.items()}
            places = [low + (high - low) * i / 40 for i in range(41)]
            first = None
            for go in range(6):
                way = 1 if go % 2 == 0 else -1
                for q in places if way > 0 else reversed(places):
                    at[axis] = q
                    value = q + 1e-3 * (error(axis, q) + 0.5 * way * reversal(axis, q) + noise.gauss(0.0, 0.1))
                    first = value if first is None else first
                    out.write(f"{axis},{at['x']:.6f},{at['y']:.6f},{at['z']:.6f},{value - first:.9f},{way}\n")


MACHINE = "invar_machine: 1\nchain: [y, x, z]\ntravel: {x: [0, 0.2], y: [-0.06, 0.06], z: [-0.08, 0]}\n"

ROTARY = "invar_machine: 1\nchain: [c]\ntravel: {c: {interval: [0, 360], unit: deg}}\n"

HAL = """loadrt [KINS]KINEMATICS
loadrt [EMCMOT]EMCMOT servo_period_nsec=[EMCMOT]SERVO_PERIOD num_joints=[KINS]JOINTS
addf motion-command-handler servo-thread
addf motion-controller servo-thread
net x joint.0.motor-pos-cmd => joint.0.motor-pos-fb
net y joint.1.motor-pos-cmd => joint.1.motor-pos-fb
net z joint.2.motor-pos-cmd => joint.2.motor-pos-fb
net c joint.3.motor-pos-cmd => joint.3.motor-pos-fb
net estop iocontrol.0.user-enable-out => iocontrol.0.emc-enable-in
net tool-prepare iocontrol.0.tool-prepare => iocontrol.0.tool-prepared
net tool-change iocontrol.0.tool-change => iocontrol.0.tool-changed
"""

MOVER = """#!/usr/bin/python3
import sys, time, hal, linuxcnc
own = hal.component("mover")
own.ready()
command, status = linuxcnc.command(), linuxcnc.stat()
def until(true, seconds=20.0):
    end = time.time() + seconds
    while time.time() < end:
        status.poll()
        if true():
            return
        time.sleep(0.005)
    sys.exit("LinuxCNC does not answer")
command.state(linuxcnc.STATE_ESTOP_RESET)
command.wait_complete()
command.state(linuxcnc.STATE_ON)
command.wait_complete()
command.mode(linuxcnc.MODE_MANUAL)
command.wait_complete()
command.home(-1)
until(lambda: status.homed[:4] == (1, 1, 1, 1))
command.mode(linuxcnc.MODE_MDI)
command.wait_complete()
with open("offsets.csv", "w") as out:
    for row in open("targets.txt"):
        way, *target = row.split()
        command.mdi("G53 G0 X%s Y%s Z%s C%s" % tuple(target))
        command.wait_complete(30)
        if way == "0":
            continue
        filtered = lambda: all(abs(hal.get_value("joint.%d.backlash-filt" % j) - hal.get_value("joint.%d.backlash-corr" % j))
                               < 1e-9 for j in range(4))
        until(filtered)
        at = [hal.get_value("joint.%d.pos-cmd" % j) for j in range(4)]
        added = [hal.get_value("joint.%d.motor-pos-cmd" % j) - at[j] - hal.get_value("joint.%d.motor-offset" % j)
                 for j in range(4)]
        out.write(" ".join([way] + ["%.9f" % v for v in at + added]) + "\\n")
"""


def ini():
    text = """[EMC]
MACHINE = compensation
VERSION = 1.1
[DISPLAY]
DISPLAY = ./mover.py
[TASK]
TASK = milltask
CYCLE_TIME = 0.001
[RS274NGC]
PARAMETER_FILE = machine.var
[EMCMOT]
EMCMOT = motmod
COMM_TIMEOUT = 1.0
SERVO_PERIOD = 1000000
[EMCIO]
EMCIO = io
CYCLE_TIME = 0.1
TOOL_TABLE = tool.tbl
[HAL]
HALFILE = machine.hal
[TRAJ]
COORDINATES = X Y Z C
LINEAR_UNITS = mm
ANGULAR_UNITS = degree
MAX_LINEAR_VELOCITY = 1000
DEFAULT_LINEAR_VELOCITY = 1000
MAX_LINEAR_ACCELERATION = 20000
[KINS]
KINEMATICS = trivkins coordinates=XYZC
JOINTS = 4
"""
    for number, (axis, (low, high)) in enumerate({**TRAVEL, "c": TURN}.items()):
        kind = "ANGULAR" if axis == "c" else "LINEAR"
        limits = f"MIN_LIMIT = {low - 1}\nMAX_LIMIT = {high + 1}\nMAX_VELOCITY = 1000\nMAX_ACCELERATION = 20000\n"
        text += f"[AXIS_{axis.upper()}]\n{limits}[JOINT_{number}]\nTYPE = {kind}\n{limits}"
        text += f"COMP_FILE = linuxcnc-{axis}.comp\nCOMP_FILE_TYPE = 0\n"
        text += f"HOME = 0\nHOME_SEARCH_VEL = 0\nHOME_LATCH_VEL = 0\nHOME_SEQUENCE = {number}\n"
    return text


def put(folder, name, text):
    with open(os.path.join(folder, name), "w", encoding="utf-8") as out:
        out.write(text)


def invar(*arguments):
    subprocess.run([INVAR, *arguments], check=True, stdout=subprocess.DEVNULL)


def run_linuxcnc(folder):
    for name in os.listdir(folder):
        os.chmod(os.path.join(folder, name), 0o755)
    os.chmod(folder, 0o777)
    command = ["linuxcnc", os.path.join(folder, "machine.ini")]
    environment = {k: v for k, v in os.environ.items() if k != "DISPLAY"}
    environment["HOME"] = folder
    if os.geteuid() == 0:  # a controller has no business as root
        command = ["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups", *command]
    done = subprocess.run(command, cwd=folder, env=environment, timeout=120, capture_output=True, text=True)
    file = os.path.join(folder, "offsets.csv")
    rows = open(file, encoding="utf-8").read().split("\n")[:-1] if os.path.exists(file) else []
    if len(rows) != 2 * TARGETS:
        for name in ("linuxcnc_print.txt", "linuxcnc_debug.txt"):
            log = os.path.join(folder, name)
            if os.path.exists(log):
                print(open(log, encoding="utf-8", errors="replace").read()[-2000:])
        sys.exit(f"LinuxCNC gave {len(rows)} of {2 * TARGETS} offsets; status {done.returncode}\n{done.stderr[-2000:]}")
    return [[float(v) for v in row.split()] for row in rows]


def check_turn(folder, turned, rows):
    """The same of the rotary axis, the fourth joint."""
    points, predicted = os.path.join(folder, "points.csv"), os.path.join(folder, "predicted.csv")
    with open(points, "w", encoding="utf-8") as out:
        out.write("c [deg],direction\n" + "".join(f"{row[4]!r},{int(row[0])}\n" for row in rows))
    invar("predict", "--model", os.path.join(turned, "compensation.yaml"), "--inputs", points, "--output", predicted)
    with open(predicted, encoding="utf-8") as table:
        errors = [math.degrees(float(line["error_c [rad]"])) for line in csv.DictReader(table)]
    worst = max(abs(row[8] + expected) for row, expected in zip(rows, errors))
    for row, expected in zip(rows, errors):
        truth = (error_c(row[4]) + 0.5 * row[0] * reversal_c(row[4])) / 3600
        if abs(expected - truth) > 0.2 / 3600:
            sys.exit(f"c = {row[4]:.3f} deg, way {row[0]:.0f}: predicted {expected:.7f}, true {truth:.7f} deg")
    largest = max(map(abs, errors))
    print(f"of the rotary axis by {3600 * worst:.4f} arcsec at most; corrections up to {3600 * largest:.1f} arcsec")
    if worst > BOUND_TURN or largest < LEAST_TURN:
        sys.exit("LinuxCNC corrects the rotary axis otherwise than `invar predict` says")


def main():
    folder = tempfile.mkdtemp(prefix="invar_linuxcnc_")
    try:
        put(folder, "machine.yaml", MACHINE)
        write_lines(os.path.join(folder, "lines.csv"))
        result = os.path.join(folder, "result")
        invar("calibrate", "geometric", "--machine", os.path.join(folder, "machine.yaml"), "--lines",
              os.path.join(folder, "lines.csv"), "--out", result)
        invar("calibrate", "controller", "--model", os.path.join(result, "compensation.yaml"), "--out",
              os.path.join(folder, "controller"))
        put(folder, "rotary.yaml", ROTARY)
        write_turns(os.path.join(folder, "turns.csv"))
        turned = os.path.join(folder, "turned")
        invar("calibrate", "geometric", "--machine", os.path.join(folder, "rotary.yaml"), "--lines",
              os.path.join(folder, "turns.csv"), "--out", turned)
        invar("calibrate", "controller", "--model", os.path.join(turned, "compensation.yaml"), "--out",
              os.path.join(folder, "controller"))
        cell = os.path.join(folder, "linuxcnc")
        os.mkdir(cell)
        for axis in [*TRAVEL, "c"]:
            shutil.copy(os.path.join(folder, "controller", f"linuxcnc-{axis}.comp"), cell)
        put(cell, "machine.ini", ini())
        put(cell, "machine.hal", HAL)
        put(cell, "mover.py", MOVER)
        put(cell, "tool.tbl", "T1 P1 D1\n")
        travels = [*TRAVEL.values(), TURN]
        ends = [(low - 0.9, high + 0.9) for low, high in travels]
        targets = "0 " + " ".join(str(low) for low, _ in ends) + "\n"
        for way in (1, -1):
            order = range(TARGETS) if way > 0 else reversed(range(TARGETS))
            for i in order:
                at = [low + (high - low) * (i + 0.37) / TARGETS for low, high in travels]
                targets += f"{way} " + " ".join(f"{v:.4f}" for v in at) + "\n"
            targets += "0 " + " ".join(str(high if way > 0 else low) for low, high in ends) + "\n"
        put(cell, "targets.txt", targets)
        os.chmod(folder, 0o755)
        rows = run_linuxcnc(cell)

        worst, largest = 0.0, 0.0
        for number, axis in enumerate(TRAVEL):
            points = os.path.join(folder, "points.csv")
            with open(points, "w", encoding="utf-8") as out:
                out.write("x [mm],y [mm],z [mm],direction\n")
                for row in rows:
                    # A table of one axis holds at the origin of the others.
                    at = [row[1 + k] if k == number else 0.0 for k in range(3)]
                    out.write(",".join(repr(v) for v in at) + f",{int(row[0])}\n")
            predicted = os.path.join(folder, "predicted.csv")
            invar("predict", "--model", os.path.join(result, "compensation.yaml"), "--inputs", points, "--output",
                  predicted)
            with open(predicted, encoding="utf-8") as table:
                errors = [1e3 * float(line[f"error_{axis} [m]"]) for line in csv.DictReader(table)]
            for row, expected in zip(rows, errors):
                added = row[5 + number]
                worst = max(worst, abs(added + expected))
                largest = max(largest, abs(expected))
                way, q = int(row[0]), row[1 + number]
                truth = 1e-3 * (0.5 * way * reversal(axis, q))
                mean = 1e-3 * (error(axis, q) - error(axis, max(TRAVEL[axis][0], min(0.0, TRAVEL[axis][1]))))
                if abs(expected - mean - truth) > 0.4e-3:
                    sys.exit(f"{axis} = {q:.3f} mm, way {way}: predicted {expected:.6f}, true {mean + truth:.6f} mm")
        check_turn(folder, turned, rows)
        print(f"LinuxCNC and predict differ by {1e3 * worst:.4f} um at most; corrections up to {1e3 * largest:.1f} um")
        if worst > BOUND:
            sys.exit("LinuxCNC corrects otherwise than `invar predict` says")
        if largest < LEAST:
            sys.exit("the corrections are too small to tell")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


main()
