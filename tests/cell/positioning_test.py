#!/usr/bin/env python3
# One axis from readings to figures, model and controller table, as a user calls it; linear, rotary, and error motions one by one.
# usage: positioning_test.py INVAR
import csv
import json
import math
import os
import random
import subprocess
import sys
import tempfile
import unittest

INVAR = os.path.abspath(sys.argv.pop(1))
SEED = 230


def invar(*arguments):
    return subprocess.run([INVAR, *arguments], capture_output=True, text=True, timeout=60, check=False)


class Positioning(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        os.chdir(self.folder.name)
        self.addCleanup(os.chdir, "/")
        self.random = random.Random(SEED)

    def write(self, name, text):
        with open(name, "w", encoding="utf-8") as out:
            out.write(text)

    def predicted(self, model, rows):
        self.write("points.csv", "\n".join(rows) + "\n")
        done = invar("predict", "--model", model, "--inputs", "points.csv", "--output", "predicted.csv")
        self.assertEqual(done.returncode, 0, done.stderr)
        with open("predicted.csv", encoding="utf-8") as table:
            return list(csv.DictReader(table))

    def test_a_linear_axis_has_figures_a_model_and_its_reversal(self):
        self.write("machine.yaml", "invar_machine: 1\nchain: [x]\ntravel: {x: [0, 0.1]}\n")
        rows = ["line,x [mm],deviation [um]"]
        rows += ["still,50,%.3f" % (0.2 * i) for i in range(4)]  # at one point: it drifts by 0.6 um
        for go in range(6):
            places = [5 * i for i in range(21)]
            for x in places if go % 2 == 0 else reversed(places):
                way = 1 if go % 2 == 0 else -1
                rows.append("X,%g,%.4f" % (x, 0.08 * x + way * (1 + 0.02 * x) + self.random.gauss(0, 0.1)))
        self.write("lines.csv", "\n".join(rows) + "\n")
        done = invar("calibrate", "geometric", "--machine", "machine.yaml", "--lines", "lines.csv", "--out", "out",
                     "--tolerance", "A=30 um", "--tolerance", "B=2 um")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("pass, within 30 um", done.stdout)
        self.assertIn("fail, beyond 2 um", done.stdout)
        with open("out/report.json", encoding="utf-8") as file:
            report = json.load(file)
        test = report["positioning"][0]
        self.assertEqual((test["standard"], test["axis"], len(test["targets"])), ("ISO 230-2", "X", 21))
        self.assertAlmostEqual(test["M"], 8e-6, delta=0.3e-6)
        self.assertAlmostEqual(test["B"], 6e-6, delta=0.4e-6)
        self.assertEqual([t["verdict"] for t in test["tolerances"]], ["pass", "fail"])
        self.assertAlmostEqual(report["drift_at_one_point"][0]["range"], 0.6e-6, delta=1e-9)
        self.assertAlmostEqual(report["noise"]["value"], 0.1e-6, delta=0.02e-6)
        answers = self.predicted("out/compensation.yaml",
                                 ["x [mm],direction", "80,1", "80,-1", "80,0", "20,1", "20,-1"])
        error = [float(answer["error_x [m]"]) for answer in answers]
        self.assertAlmostEqual(error[0] - error[1], 5.2e-6, delta=0.2e-6)
        self.assertAlmostEqual(error[3] - error[4], 2.8e-6, delta=0.2e-6)
        self.assertAlmostEqual(error[2], 0.5 * (error[0] + error[1]), delta=1e-12)
        self.assertAlmostEqual(error[2], 6.4e-6, delta=0.2e-6)
        done = invar("predict", "--model", "out/compensation.yaml", "--inputs", "points.csv", "--output", "p.csv")
        self.write("points.csv", "x [mm],direction\n80,2\n")
        done = invar("predict", "--model", "out/compensation.yaml", "--inputs", "points.csv", "--output", "p2.csv")
        self.assertEqual(done.returncode, 2)
        self.assertIn("column `direction`, row 1", done.stderr)
        self.assertFalse(os.path.exists("p2.csv"))

    def test_a_tolerance_that_is_none_is_one_line(self):
        self.write("machine.yaml", "invar_machine: 1\nchain: [x]\ntravel: {x: [0, 0.1]}\n")
        self.write("lines.csv", "line,x [mm],deviation [um]\nX,0,0\nX,50,1\nX,100,2\n")
        done = invar("calibrate", "geometric", "--machine", "machine.yaml", "--lines", "lines.csv", "--out", "out",
                     "--tolerance", "Q=3 um")
        self.assertEqual(done.returncode, 2)
        self.assertEqual(done.stderr.count("\n"), 1)
        self.assertIn("names no figure of ISO 230-2", done.stderr)
        self.assertFalse(os.path.exists("out"))

    def test_a_rotary_axis_has_figures_in_angles(self):
        self.write("machine.yaml", "invar_machine: 1\nchain: [c]\ntravel: {c: [0, 6.2832]}\n")
        rows = ["c [deg];deviation [arcsec]"]
        for go in range(4):
            places = [30 * i for i in range(13)]
            for c in places if go % 2 == 0 else reversed(places):
                value = 3 * math.sin(math.radians(c)) + (2 if go % 2 == 0 else -2)
                rows.append(("%d;%.3f" % (c, value)).replace(".", ","))
        self.write("lines.csv", "\n".join(rows) + "\n")
        done = invar("calibrate", "geometric", "--machine", "machine.yaml", "--lines", "lines.csv", "--out", "out",
                     "--tolerance", "E=12 arcsec")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("pass, within 12 arcsec", done.stdout)
        with open("out/report.json", encoding="utf-8") as file:
            test = json.load(file)["positioning"][0]
        arcsec = math.radians(1 / 3600)
        self.assertEqual(test["unit"], "rad")
        self.assertAlmostEqual(test["B"], 4 * arcsec, delta=0.01 * arcsec)
        self.assertAlmostEqual(test["E"], 10 * arcsec, delta=0.01 * arcsec)
        self.assertTrue(os.path.exists("out/deviations.csv"))
        self.write("wrong.csv", "c [deg];deviation [deg]\n0;0\n30;2\n60;0\n")
        done = invar("calibrate", "geometric", "--machine", "machine.yaml", "--lines", "wrong.csv", "--out", "bad")
        self.assertEqual(done.returncode, 2)
        self.assertIn("wrong.csv: column `deviation`, row 2", done.stderr)

    def turned(self, last=360, ways=(1, -1), cycles=2, noise=0.0, step=15):
        rows = ["c [deg],deviation [arcsec]"]
        for way in ways * cycles:
            places = list(range(0, last + 1, step))
            for c in places if way > 0 else reversed(places):
                rows.append("%d,%.4f" % (c, self.arcsec(c, way) + self.random.gauss(0, noise)))
        self.write("lines.csv", "\n".join(rows) + "\n")

    @staticmethod
    def arcsec(c, way):
        return 3 * math.sin(math.radians(c) + 0.2) + way * (2 + 0.5 * math.cos(math.radians(c)))

    def calibrated_turn(self, *more, out="out"):
        return invar("calibrate", "geometric", "--machine", "machine.yaml", "--lines", "lines.csv", "--out", out, *more)

    def test_a_rotary_axis_has_a_model_that_is_its_closed_form(self):
        self.write("machine.yaml", "invar_machine: 1\nchain: [c]\ntravel: {c: {interval: [0, 360], unit: deg}}\n")
        self.turned(noise=0.05)
        done = self.calibrated_turn()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("whole turns are one place", done.stdout)
        with open("out/report.json", encoding="utf-8") as file:
            report = json.load(file)
        self.assertEqual((report["unidentified"], report["model"]["comes_round"]), ([], True))
        self.assertEqual((report["rows"]["given"], report["rows"]["used"]), (100, 100))
        asked = [(c, way) for c in range(-350, 720, 7) for way in (1, -1, 0)]
        answers = self.predicted("out/compensation.yaml", ["c [deg],direction_c"] + ["%d,%d" % one for one in asked])
        worst = max(abs(math.degrees(float(answer["error_c [rad]"])) * 3600 - self.arcsec(*one))
                    for one, answer in zip(asked, answers))
        self.assertLess(worst, 0.12)
        self.assertLess(max(math.degrees(float(answer["sigma_c [rad]"])) * 3600 for answer in answers), 0.06)
        done = invar("calibrate", "controller", "--model", "out/compensation.yaml", "--out", "controller")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(os.listdir("controller"), ["linuxcnc-c.comp"])
        with open("controller/linuxcnc-c.comp", encoding="utf-8") as file:
            table = [[float(v) for v in line.split()] for line in file if line[0] != "#"]
        self.assertEqual((len(table), table[0][0], table[-1][0]), (256, 0.0, 360.0))
        for nominal, forward, backward in table:
            self.assertAlmostEqual(3600 * (forward - nominal), self.arcsec(nominal, 1), delta=0.12)
            self.assertAlmostEqual(3600 * (backward - nominal), self.arcsec(nominal, -1), delta=0.12)

    def test_part_of_a_turn_is_held_at_its_ends_and_one_direction_tells_no_reversal(self):
        self.write("machine.yaml", "invar_machine: 1\nchain: [c]\ntravel: {c: [0, 1.6]}\n")
        self.turned(last=90, ways=(1,), step=10)
        done = self.calibrated_turn()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("no reversal is known", done.stdout)
        self.assertIn("(ISO 230-2): A_forward 2.", done.stdout)
        answers = self.predicted("out/compensation.yaml", ["c [deg],direction", "90,0", "135,0", "45,1"])
        self.assertAlmostEqual(float(answers[0]["error_c [rad]"]), float(answers[1]["error_c [rad]"]), delta=1e-9)
        self.assertEqual(answers[2]["sigma_c [rad]"], "inf")

    def test_what_few_readings_of_a_rotary_axis_do_not_give_is_said(self):
        self.write("machine.yaml", "invar_machine: 1\nchain: [c]\n")
        self.write("lines.csv", "c [deg],deviation [arcsec],direction\n0,0,1\n90,1,1\n0,0.1,1\n90,1.1,1\n")
        done = self.calibrated_turn()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("note: No compensation.yaml", done.stdout)
        self.assertFalse(os.path.exists("out/compensation.yaml"))
        with open("out/report.json", encoding="utf-8") as file:
            self.assertEqual(json.load(file)["unidentified"], ["ECC"])
        self.turned(ways=(1,), cycles=1)
        done = self.calibrated_turn(out="once")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("note: No figures of ISO 230-2", done.stdout)
        self.assertTrue(os.path.exists("once/compensation.yaml"))
        self.write("lines.csv", "c [deg],deviation [arcsec]\n0,0\n90,1\n")
        self.write("degrees.yaml", "invar_machine: 1\nchain: [c]\ntravel: {c: [0, 360]}\n")
        for machine, words in (("machine.yaml", "read twice"), ("degrees.yaml", "degrees.yaml:3: travel.c")):
            done = invar("calibrate", "geometric", "--machine", machine, "--lines", "lines.csv", "--out", "bad")
            self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
            self.assertIn(words, done.stderr)
            self.assertFalse(os.path.exists("bad"))

    def test_the_history_of_a_rotary_axis_tells_what_moved(self):
        self.write("machine.yaml", "invar_machine: 1\nchain: [c]\ntravel: {c: {interval: [0, 360], unit: deg}}\n")
        for month, grown in ((1, 1.0), (4, 1.5)):
            rows = ["c [deg],deviation [arcsec],direction"]
            for way in (1, -1, 1, -1):
                for c in range(0, 361, 15):
                    value = 3 * grown * math.sin(math.radians(c)) + 2 * way + self.random.gauss(0, 0.05)
                    rows.append("%d,%.4f,%d" % (c, value, way))
            self.write("lines.csv", "\n".join(rows) + "\n")
            self.assertEqual(self.calibrated_turn(out="machine/2026-0%d-01" % month).returncode, 0)
        done = invar("calibrate", "history", "machine", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        kind, = json.loads(done.stdout)["kinds"]
        names = {name["name"]: name for name in kind["names"]}
        self.assertEqual(kind["kind"], "rotary of c")
        self.assertTrue(names["ECC"]["has_moved"])
        self.assertAlmostEqual(abs(names["ECC"]["moved"]) * 3600 * 180 / math.pi, 1.5, delta=0.15)
        self.assertFalse(names["reversal of c"]["has_moved"])

    def test_error_motions_have_the_figures_of_iso_230(self):
        self.write("machine.yaml", "invar_machine: 1\nchain: [y, x]\ntravel: {x: [0, 0.2], y: [0, 0.2]}\n")
        rows = ["component,position [mm],translation [um],rotation [arcsec],direction"]
        for cycle in range(3):
            for way in (1, -1):
                for i in range(21):
                    x, u = 10 * i, i / 20
                    # Cycles 1 um apart: s = 1 um at every target, R_forward 4 um.
                    rows.append("EXX,%d,%.4f,,%d" % (x, 8 * u + 1.5 * way + cycle, way))
                    rows.append("EYX,%d,%.4f,,%d" % (x, 4 * 6 * u * (1 - u) + 20 * u + 0.01 * cycle, way))
                    rows.append("ECX,%d,,%.4f,%d" % (x, 5 * u + 0.25 * way + 0.01 * cycle, way))
        rows += ["EC0Y,,,%.2f," % angle for angle in (9.9, 10.1, 10.0)]
        self.write("components.csv", "\n".join(rows) + "\n")
        done = invar("calibrate", "components", "--machine", "machine.yaml", "--readings", "components.csv", "--out", "out",
                     "--tolerance", "A=20 um", "--tolerance", "EXX:B=2 um", "--tolerance", "EYX=7 um", "--tolerance",
                     "ECX=4 arcsec", "--tolerance", "EC0Y=12 arcsec", "--tolerance", "EZX=1 um")
        self.assertEqual(done.returncode, 0, done.stderr)
        with open("out/report.json", encoding="utf-8") as file:
            report = json.load(file)
        tests = {test["motion"]: test for test in report["positioning"]}
        exx, eyx, ecx = tests["EXX"], tests["EYX"], tests["ECX"]
        for figure, value in (("B", 3), ("R_forward", 4), ("R_backward", 4), ("R", 7), ("E", 11), ("M", 8), ("A", 15)):
            self.assertAlmostEqual(exx[figure], 1e-6 * value, delta=2e-9, msg=figure)
            self.assertGreater(exx["expanded_uncertainty"][figure], 0 if figure[0] == "R" else -1)
        self.assertIsNone(eyx["A"])  # an alignment of the straightedge would change it
        self.assertAlmostEqual(eyx["R"], 0.04e-6, delta=2e-9)
        arcsec = math.radians(1 / 3600)
        self.assertAlmostEqual(ecx["B"], 0.5 * arcsec, delta=0.001 * arcsec)
        self.assertAlmostEqual(ecx["M"], 5 * arcsec, delta=0.001 * arcsec)
        motions = {motion["motion"]: motion for motion in report["motions"]}
        straight = {value["reference"]: value["value"] for value in motions["EYX"]["values"]}
        for reference in ("least-squares line", "line through the ends", "minimum zone"):
            self.assertAlmostEqual(straight[reference], 6e-6, delta=1e-9, msg=reference)
        self.assertAlmostEqual(motions["ECX"]["values"][0]["value"], 5 * arcsec, delta=0.001 * arcsec)
        self.assertAlmostEqual(motions["EC0Y"]["values"][0]["value"], 10 * arcsec, delta=0.001 * arcsec)
        verdicts = [tests["EXX"]["tolerances"][0], tests["EXX"]["tolerances"][1], *(
            motions[name]["tolerances"][0] for name in ("EYX", "ECX", "EC0Y"))]
        self.assertEqual([v["verdict"] for v in verdicts], ["pass", "fail", "pass", "fail", "pass"])
        self.assertIn("The tolerance EZX=1 um is not judged", done.stdout)
        with open("out/report.html", encoding="utf-8") as file:
            page = file.read()
        for words in ("Straightness, angles and squareness", "EYX straightness = 6", "EXX (ISO 230-2)"):
            self.assertIn(words, page)
        for bad, words in (("EXX=3 um", "several figures"), ("ECX=3 um", "is no limit"), ("EQQ=3 um", "names no figure"),
                           ("EXX:Q=3 um", "names no figure"), ("A=-3 um", "is no limit")):
            done = invar("calibrate", "components", "--machine", "machine.yaml", "--readings", "components.csv", "--out",
                         "bad", "--tolerance", bad)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
            self.assertIn(words, done.stderr)
            self.assertFalse(os.path.exists("bad"))

    def test_a_motion_that_follows_the_temperature_has_no_figures(self):
        self.write("machine.yaml", "invar_machine: 1\nchain: [y, x]\ntravel: {x: [0, 0.2], y: [0, 0.2]}\n")
        rows = ["component,position [mm],translation [um],direction,temperature [degC]"]
        for warm in (0, 0, 4, 4):
            for i in range(21):
                rows.append("EXX,%d,%.4f,1,%g" % (10 * i, 0.12 * i * warm + self.random.gauss(0, 0.05), 20 + warm))
        self.write("components.csv", "\n".join(rows) + "\n")
        done = invar("calibrate", "components", "--machine", "machine.yaml", "--readings", "components.csv", "--out", "out",
                     "--tolerance", "R_forward=2 um")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("EXX depends on temperature: no figures of ISO 230", done.stdout)
        self.assertIn("R_forward=2 um is not judged", done.stdout)
        with open("out/report.json", encoding="utf-8") as file:
            report = json.load(file)
        self.assertEqual((report["positioning"], report["motions"], len(report["not_judged"])), ([], [], 1))

    def test_lines_of_a_table_have_straightness_squareness_and_diagonals(self):
        """EXY = 4 um of a parabola, Y turned by -20 urad; seven lines of an XY table, read both ways with reversal in x."""
        self.write("machine.yaml", "invar_machine: 1\nchain: [y, x]\ntravel: {x: [0, 0.2], y: [0, 0.2]}\n")
        lines = {"X": ((0, 0), (200, 0)), "Y": ((0, 0), (0, 200)), "Y far": ((200, 0), (200, 200)),
                 "D": ((0, 0), (200, 200)), "A": ((200, 0), (0, 200)), "H": ((0, 0), (200, 100)), "S": ((0, 0), (100, 200))}
        rows = ["line,x [mm],y [mm],deviation [um],direction"]
        for name, ((x0, y0), (x1, y1)) in lines.items():
            length = math.hypot(x1 - x0, y1 - y0)
            along = ((x1 - x0) / length, (y1 - y0) / length)
            for way in (1, -1, 1, -1):
                order = range(21) if way > 0 else range(20, -1, -1)
                for i in order:
                    x, y = x0 + (x1 - x0) * i / 20, y0 + (y1 - y0) * i / 20
                    ex = 16 * (y / 200) * (1 - y / 200) + 0.02 * y  # Y leans to +x by 20 urad
                    lost = 1.5 * way * abs(along[0])
                    value = along[0] * ex + lost + self.random.gauss(0, 0.1)
                    rows.append("%s,%g,%g,%.4f,%d" % (name, x, y, value, way))
        self.write("lines.csv", "\n".join(rows) + "\n")
        done = invar("calibrate", "geometric", "--machine", "machine.yaml", "--lines", "lines.csv", "--out", "out",
                     "--tolerance", "EXY=6 um", "--tolerance", "EC0Y=2 arcsec")
        self.assertEqual(done.returncode, 0, done.stderr)
        with open("out/report.json", encoding="utf-8") as file:
            report = json.load(file)
        motions = {motion["motion"]: motion for motion in report["motions"]}
        for value in motions["EXY"]["values"]:
            self.assertAlmostEqual(value["value"], 4e-6, delta=max(0.6e-6, value["expanded_uncertainty"]), msg=str(value))
            self.assertLess(value["expanded_uncertainty"], 1.2e-6)
        for value in motions["EC0Y"]["values"]:
            self.assertAlmostEqual(value["value"], -20e-6, delta=max(3e-6, value["expanded_uncertainty"]), msg=str(value))
        self.assertEqual(motions["EXY"]["tolerances"][0]["verdict"], "pass")
        self.assertEqual(motions["EC0Y"]["tolerances"][0]["verdict"], "fail")
        face, = report["diagonals"]
        self.assertEqual((face["plane"], face["there_are"]), ("XY", 2))
        self.assertEqual({one["name"]: one["line"] for one in face["diagonals"]}, {"PP0": "D", "NP0": "A"})
        self.assertAlmostEqual(face["B"], 3e-6 / math.sqrt(2), delta=0.4e-6)
        self.assertAlmostEqual(face["E"], max(one["E"] for one in face["diagonals"]))
        self.assertIn("face diagonals XY (ISO 230-6)", done.stdout)

    def test_error_motions_one_by_one_keep_their_direction(self):
        self.write("machine.yaml", "invar_machine: 1\nchain: [y, x]\ntravel: {x: [0, 0.2], y: [0, 0.2]}\n")
        rows = ["component,position [mm],translation [um],direction"]
        for go in range(4):
            way = 1 if go % 2 == 0 else -1
            for i in range(21):
                x = 10 * i
                rows.append("EXX,%d,%.4f,%d" % (x, 0.05 * x + way * (1 + 0.01 * x) + self.random.gauss(0, 0.05), way))
        self.write("components.csv", "\n".join(rows) + "\n")
        done = invar("calibrate", "components", "--machine", "machine.yaml", "--readings", "components.csv", "--out",
                     "out")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("reversal of x", done.stdout)
        answers = self.predicted("out/compensation.yaml", ["x [mm],y [mm],direction_x", "150,0,1", "150,0,-1", "50,0,1",
                                                           "50,0,-1"])
        error = [float(answer["error_x [m]"]) for answer in answers]
        self.assertAlmostEqual(error[0] - error[1], 5.0e-6, delta=0.15e-6)
        self.assertAlmostEqual(error[2] - error[3], 3.0e-6, delta=0.15e-6)
        self.assertAlmostEqual(0.5 * (error[0] + error[1]), 7.5e-6, delta=0.15e-6)


if __name__ == "__main__":
    print("seed", SEED)
    unittest.main()
