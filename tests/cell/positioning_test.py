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
