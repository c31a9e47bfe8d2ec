#!/usr/bin/env python3
"""What `invar calibrate` says of files: what it left out, what that costs, and what it does not claim.

Usage: calibrations_test.py INVAR [TEST]
Each test makes its own file, of a machine whose truth it knows.
"""
import json
import math
import os
import pathlib
import random
import subprocess
import sys
import tempfile
import unittest

INVAR = pathlib.Path(sys.argv.pop(1)).resolve()


class Calibrations(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory(prefix="invar-calibrations-")
        self.addCleanup(self.folder.cleanup)
        self.here = pathlib.Path(self.folder.name)

    def call(self, *arguments, status=0):
        done = subprocess.run([INVAR, *map(str, arguments)], cwd=self.here, capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done.stdout if status == 0 else done.stderr

    def write(self, name, header, rows):
        text = header + "\n" + "".join(",".join(str(value) for value in row) + "\n" for row in rows)
        (self.here / name).write_text(text)

    def report(self, folder="out"):
        return json.loads((self.here / folder / "report.json").read_text())

    def page(self, folder="out"):
        return (self.here / folder / "report.html").read_text()

    def predicted(self, header, rows):
        self.write("inputs.csv", header, rows)
        self.call("predict", "--model", "out/compensation.yaml", "--inputs", "inputs.csv", "--output", "predicted.csv")
        lines = (self.here / "predicted.csv").read_text().splitlines()
        names = [name.split(" [")[0] for name in lines[0].split(",")]
        return [dict(zip(names, map(float, line.split(",")))) for line in lines[1:]]


class Thermal(Calibrations):
    HEADER = "t [s],x [mm],temperature [degC],error [um]"

    def heated(self, error, noise=0.4, places=(0, 100), rounds=120):
        draw = random.Random(5)
        rows = []
        for k in range(rounds):
            temperature = 22 + 9 * k / (rounds - 1)
            for x in places:
                rows.append([60 * k, x, f"{temperature:.3f}", f"{error(x, temperature) + draw.gauss(0, noise):.3f}"])
        return rows

    def test_an_error_that_is_equal_everywhere_is_so_between_the_places(self):
        self.write("t.csv", self.HEADER, self.heated(lambda x, t: -25 * (t - 22)))
        self.call("calibrate", "thermal", "--recording", "t.csv", "--out", "out")
        for row in self.predicted("x [mm],temperature [degC]", [[x, 31] for x in range(0, 101, 10)]):
            self.assertLess(abs(row["error"] + 225e-6), 0.4e-6)

    def test_what_was_left_out_is_shown_with_the_error_over_all(self):
        rows = self.heated(lambda x, t: 0.01 * x * (t - 22), places=(0, 50, 100))
        rows[100][3], rows[200][3] = 400, ""
        self.write("t.csv", self.HEADER, rows)
        said = self.call("calibrate", "thermal", "--recording", "t.csv", "--out", "out")
        self.assertIn("360 readings, 358 used (left out: 1 with an empty cell, 1 that stand alone more than 4.5", said)
        counts = self.report()["rows"]
        self.assertEqual((counts["given"], counts["used"]), (360, 358))
        self.assertAlmostEqual(counts["rms_used"], 0.4e-6, delta=0.06e-6)
        self.assertGreater(counts["rms_all"], 19e-6)  # 390 um / sqrt(359)
        page = self.page()
        self.assertIn("Rows left out, and the cost of that", page)
        self.assertIn("400 um", page)

    def test_a_stretch_is_fitted_and_said(self):
        rows = self.heated(lambda x, t: 0.01 * x * (t - 22), places=(0, 50, 100))
        for i in range(90, 180):
            rows[i][3] = float(rows[i][3]) + 30 * math.sin(math.pi * (i - 90) / 90)
        self.write("t.csv", self.HEADER, rows)
        said = self.call("calibrate", "thermal", "--recording", "t.csv", "--out", "out")
        self.assertIn("360 readings, all used", said)
        self.assertIn("not explained: ", said)
        self.assertNotIn('class="callout good"', self.page())

    def test_two_temperatures_make_a_report(self):
        for noise in (0, 0.3):
            draw = random.Random(1)
            self.write("t.csv", "x [mm],temperature [degC],error [um]",
                       [[x, t, f"{0.01 * x * (t - 20) + noise * draw.gauss(0, 1):.5f}"]
                        for _ in range(3) for t in (20, 30) for x in (0, 20, 40, 60)])
            self.call("calibrate", "thermal", "--recording", "t.csv", "--out", "out")
            row, = self.predicted("x [mm],temperature [degC]", [[60, 30]])
            self.assertLess(abs(row["error"] - 6e-6), 0.5e-6)


    def test_distortion_over_time_is_the_closed_form_at_the_two_outer_places(self):
        """The slide warms by 5 K (1 - exp(-t / 30 min)); its reference point moves by 1 um/K, its scale by 12 um/(m K)."""
        draw = random.Random(12)
        warmed = lambda minutes: 5 * (1 - math.exp(-minutes / 30))
        for minutes, hour in ((150, True), (50, False)):
            rows = [[60 * k, x, f"{20 + warmed(k):.4f}", f"{(1 + 0.012 * x) * warmed(k) + draw.gauss(0, 0.02):.4f}", way]
                    for k in range(minutes + 1) for x, way in ((0, 1), (100, 1), (200, 1), (200, -1), (0, -1))]
            self.write("t.csv", self.HEADER + ",direction", rows)
            said = self.call("calibrate", "thermal", "--recording", "t.csv", "--out", "out")
            found = self.report()["distortion"]
            self.assertAlmostEqual(found["duration_s"], 60 * minutes)
            self.assertEqual([(one["x_m"], one["direction"]) for one in found["places"]],
                             [(0, -1), (0, 1), (0.2, -1), (0.2, 1)])
            for one in found["places"]:
                grows = 1e-6 * (1 + 12 * one["x_m"])
                self.assertAlmostEqual(one["range_m"], grows * warmed(minutes), delta=0.15e-6)
                self.assertAlmostEqual(one["end_minus_start_m"], grows * warmed(minutes), delta=0.15e-6)
                if hour:
                    self.assertAlmostEqual(one["range_60min_m"], grows * warmed(60), delta=0.15e-6)
                else:
                    self.assertIsNone(one["range_60min_m"])
            self.assertAlmostEqual(found["growth_between_places_m"], 2.4e-6 * warmed(minutes), delta=0.2e-6)
            self.assertIn("distortion over time (form of ISO 230-3)", said)
            self.assertIn("The recording does not say what warmed the machine", self.page())
            self.assertEqual("shorter than 60 min" in self.page(), not hour)
        self.write("t.csv", "x [mm],temperature [degC],error [um]", [[row[1], *row[2:4]] for row in rows])
        self.call("calibrate", "thermal", "--recording", "t.csv", "--out", "out")
        self.assertNotIn("distortion", self.report())

    def test_a_report_is_written_where_gnuplot_fails_or_is_absent(self):
        self.write("t.csv", "x [mm],temperature [degC],error [um]",
                   [[x, t, f"{0.01 * x * (t - 20):.5f}"] for _ in range(3) for t in (20, 30) for x in (0, 20, 40, 60)])
        fake = self.here / "bin" / "gnuplot"
        fake.parent.mkdir()
        for lines, words in (("echo cannot open terminal >&2; exit 1", "gnuplot says: cannot open terminal"),
                             ("kill -9 $$", "gnuplot failed without a word"), (None, "gnuplot is not there")):
            fake.unlink(missing_ok=True)
            if lines is not None:
                fake.write_text("#!/bin/sh\n" + lines + "\n")
                fake.chmod(0o755)
            path = str(fake.parent) + (os.pathsep + os.environ["PATH"] if lines is not None else "")
            done = subprocess.run([INVAR, "calibrate", "thermal", "--recording", "t.csv", "--out", "out"], cwd=self.here,
                                  capture_output=True, text=True, timeout=120, env={**os.environ, "PATH": path})
            self.assertEqual(done.returncode, 0, done.stderr)
            page = self.page()
            self.assertIn("is not drawn: " + words, page)
            self.assertNotIn("<svg", page)
            self.assertEqual(self.report()["readings"], 24)
            (self.here / "out" / "report.html").unlink()


class Dispenser(Calibrations):
    HEADER = "target_x [mm],target_y [mm],height [mm],landed_x [mm],landed_y [mm]"

    def plate(self, curved=0.0):
        draw = random.Random(8)
        rows = []
        for i in range(70):
            x, y = 20 * (i % 10), 20 * (i // 10)
            rows.append([x, y, 3, f"{x + 0.04 - 0.0007 * y + draw.gauss(0, 0.006):.5f}",
                         f"{y - 0.07 + 0.0007 * x + curved * (x / 90 - 1) ** 2 + draw.gauss(0, 0.006):.5f}"])
        return rows

    def test_a_turned_field_is_found(self):
        self.write("d.csv", self.HEADER, self.plate())
        said = self.call("calibrate", "dispenser", "--droplets", "d.csv", "--out", "out")
        self.assertIn("field turned by 0.040", said)  # 0.7 mrad
        self.assertIn("find scatter alone", said)
        row, = self.predicted("target_x [mm],target_y [mm],height [mm]", [[180, 120, 3]])
        x, y = 1e3 * row["command_x"], 1e3 * row["command_y"]
        self.assertAlmostEqual(x + 0.04 - 0.0007 * y, 180, delta=0.004)
        self.assertAlmostEqual(y - 0.07 + 0.0007 * x, 120, delta=0.004)
        self.assertLess(row["sigma"], 3e-6)

    def test_a_curved_field_is_not_called_scatter(self):
        self.write("d.csv", self.HEADER, self.plate(curved=0.05))
        said = self.call("calibrate", "dispenser", "--droplets", "d.csv", "--out", "out")
        self.assertIn("the residual is more than scatter", said)
        self.assertNotIn('class="callout good"', self.page())
        self.assertEqual(len(self.report()["rows"]["unexplained"]), 1)


class Thermistor(Calibrations):
    @staticmethod
    def resistance(temperature):
        """An NTC by Steinhart-Hart (100 kOhm at 25 degC), solved by bisection."""
        low, high = 0.0, 20.0
        for _ in range(80):
            x = (low + high) / 2
            warm = 1 / (7.203283552e-4 + 2.171656865e-4 * x + 0.8706070062e-7 * x ** 3) - 273.15 > temperature
            low, high = (x, high) if warm else (low, x)
        return math.exp(x)

    def test_the_equation_is_chosen_by_readings_left_out_and_residuals_are_shown(self):
        draw = random.Random(4)
        self.write("n.csv", "temperature [degC],resistance [ohm]",
                   [[t, f"{self.resistance(t + draw.gauss(0, 0.05)):.3f}"] for t in range(-10, 131, 10)])
        said = self.call("calibrate", "thermistor", "--readings", "n.csv", "--out", "out")
        self.assertIn("Steinhart-Hart", said)
        self.assertGreater(self.report()["held_out_b_law_K"], 0.5)
        self.assertLess(self.report()["held_out_steinhart_hart_K"], 0.15)
        self.assertIn("by the equation", self.page())
        inside, outside = self.predicted("resistance [ohm]", [[self.resistance(t)] for t in (45, 200)])
        self.assertLess(abs(inside["temperature"] - 45), 0.1)
        self.assertLess(abs(outside["temperature"] - 200), 2 * outside["sigma"])
        self.assertGreater(outside["sigma"], 5 * inside["sigma"])

    def test_residuals_that_go_on_are_no_noise(self):
        self.write("n.csv", "temperature [degC],resistance [ohm]",
                   [[t, f"{self.resistance(t + 0.5 * math.sin(t / 12)):.3f}"] for t in range(-10, 131, 4)])
        self.call("calibrate", "thermistor", "--readings", "n.csv", "--out", "out")
        self.assertIn("goes on from one temperature to the next", self.report()["rows"]["unexplained"][0])


class Ripple(Calibrations):
    MODEL = """invar_model: 1
plant: axis
parameters:
  mass: {value: 0.002, unit: kg m2, sigma: 0.0001}
  motor_constant: {value: 0.3, unit: N m/A, sigma: 0.01}
  viscous_damping: {value: 0.02, unit: N m s/rad, sigma: 0.002}
columns:
  time: t
  reference: reference
  position: position
  current: current
"""

    def test_every_family_of_a_rotary_axis_in_its_own_units(self):
        """Cogging of 24 poles, a gear of 67 teeth, friction; two turns forth and back at half a radian a second."""
        draw = random.Random(3)
        (self.here / "model.yaml").write_text(self.MODEL)
        rows, at, t = [], 0.0, 0.0
        for run in range(4):
            way = 0.5 if run % 2 == 0 else -0.5
            for k in range(2600):
                moving = 0 if k < 50 or k >= 2563 else way
                at, t = at + 0.01 * moving, t + 0.01
                torque = 0.05 * math.sin(24 * at + 0.4) + 0.02 * math.sin(67 * at - 1.1)
                current = (0.02 * moving + 0.1 * (moving > 0) - 0.1 * (moving < 0) - torque) / 0.3
                deg = math.degrees(at)
                rows.append([f"{t:.3f}", f"{deg:.6f}", f"{deg:.6f}", f"{current + draw.gauss(0, 0.01):.5f}"])
        self.write("runs.csv", "t [s],reference [deg],position [deg],current [A]", rows)
        said = self.call("calibrate", "ripple", "--model", "model.yaml", "--recording", "runs.csv", "--out", "out")
        self.assertIn("24 a turn", said)
        families = self.report()["families"]
        self.assertEqual(len(families), 2)
        for family, teeth, amplitude in zip(families, (24, 67), (0.05, 0.02)):
            self.assertEqual(family["pitch"]["unit"], "rad")
            self.assertAlmostEqual(2 * math.pi / family["pitch"]["value"], teeth, delta=0.02)
            self.assertAlmostEqual(family["harmonics"][0]["amplitude_Nm"], amplitude, delta=0.002)
        self.assertIn("not at a constant velocity", said)
        patched = (self.here / "out" / "patched.yaml").read_text()
        self.assertEqual(patched.count("force_ripple"), 2)
        self.call("simulate", "--model", "out/patched.yaml", "--inputs", "runs.csv", "--output", "simulated.csv")


class Fusion(Calibrations):
    def run_at(self, speed, seed):
        draw = random.Random(seed)
        rows = []
        for k in range(800):
            t = k / 1000
            x = min(speed * t, 0.2)
            velocity = (speed if x < 0.2 else 0.0) + 0.05 * speed * draw.uniform(-1, 1)
            rows.append([seed, f"{t:.4f}", f"{x:.7f}", f"{0.002 * math.floor(x / 0.002):.4f}", f"{velocity:.5f}"])
        return rows

    def test_one_run_never_claims_to_have_held_one_out(self):
        header = "run,t [s],reference [m],position_encoder [m],velocity_tacho [m/s]"
        self.write("one.csv", header, self.run_at(0.1, 1))
        said = self.call("calibrate", "fusion", "--recording", "one.csv", "--noise", "estimated", "--out", "out")
        self.assertNotIn("held out:", said)
        self.assertIn("RMS on the one run, to which it was fitted", said)
        self.assertNotIn("held_out_rms_m", self.report())
        self.assertGreater(self.report()["fitted_rms_m"]["observer"], 0)
        self.assertNotIn("callout good", self.page())
        self.write("two.csv", header, self.run_at(0.1, 1) + self.run_at(0.2, 2))
        said = self.call("calibrate", "fusion", "--recording", "two.csv", "--noise", "estimated", "--out", "out")
        self.assertIn("RMS on runs held out", said)
        self.assertGreater(self.report()["held_out_rms_m"]["observer"], 0)


class Camera(Calibrations):
    """A pinhole camera of 900 px focal length that sees a flat target of 7 x 6 points, 12 mm apart."""
    FOCAL, CENTRE = 900.0, (320.0, 240.0)

    def see(self, turn, foot, point):
        a, b = turn
        x, y = point
        x, z = x * math.cos(b), -x * math.sin(b)
        y, z = y * math.cos(a) - z * math.sin(a), y * math.sin(a) + z * math.cos(a)
        x, y, z = x + foot[0], y + foot[1], z + foot[2]
        return self.CENTRE[0] + self.FOCAL * x / z, self.CENTRE[1] + self.FOCAL * y / z

    def setUp(self):
        super().setUp()
        draw = random.Random(2)
        target = [(0.012 * (i % 7) - 0.036, 0.012 * (i // 7) - 0.03) for i in range(42)]
        self.write("target.csv", "x [m],y [m]", target)
        self.views = []
        for k, turn in enumerate([(0.4, 0.1), (-0.3, 0.4), (0.1, -0.5), (-0.5, -0.2), (0.3, 0.5), (0.05, -0.03),
                                  (0.5, -0.4), (-0.2, -0.4)]):
            points = [self.see(turn, (0.002 * k - 0.008, 0.003, 0.16), point) for point in target]
            points = [(u + draw.gauss(0, 0.05), v + draw.gauss(0, 0.05)) for u, v in points]
            self.write(f"view{k}.csv", "u [px],v [px]", [(f"{u:.4f}", f"{v:.4f}") for u, v in points])
            self.views += ["--view", f"view{k}.csv"]

    def test_a_view_with_a_doubled_corner_is_named_and_left_out(self):
        lines = (self.here / "view3.csv").read_text().splitlines()
        lines[20] = lines[19]
        (self.here / "view3.csv").write_text("\n".join(lines) + "\n")
        said = self.call("calibrate", "camera", "--target", "target.csv", *self.views, "--out", "out")
        self.assertIn("left out: view3.csv: point 20 lies where point 19 should", said)
        report = self.report()
        self.assertLess(abs(report["camera"]["fx"] - self.FOCAL), 3 * report["sigma"]["fx"])
        self.assertEqual((report["rows"]["given"], report["rows"]["used"]), (8, 7))
        self.assertGreater(report["rows"]["rms_all"], 5 * report["rows"]["rms_used"])
        self.assertIn("view3.csv", self.page())

    def test_droplets_are_measured_in_the_plane_of_the_target(self):
        """The target lies on the substrate in view 5; five drops of 3 mm, 20 mm apart."""
        self.call("calibrate", "camera", "--target", "target.csv", *self.views, "--plane", "view5.csv", "--out", "out")
        width, height = 640, 480
        turn, foot = (0.05, -0.03), (0.002, 0.003, 0.16)
        drops = [(0.0, 0.0), (0.02, 0.0), (-0.02, 0.0), (0.0, 0.02), (0.0, -0.02)]
        image = [230.0] * (width * height)
        for at in drops:
            edge = [self.see(turn, foot, (at[0] + 1.5e-3 * math.cos(0.1 * k), at[1] + 1.5e-3 * math.sin(0.1 * k)))
                    for k in range(63)]
            cu, cv = self.see(turn, foot, at)
            for v in range(int(cv) - 14, int(cv) + 15):
                for u in range(int(cu) - 14, int(cu) + 15):
                    share = sum(self.inside(edge, u + du / 8 - 0.4375, v + dv / 8 - 0.4375)
                                for du in range(8) for dv in range(8)) / 64
                    image[v * width + u] = 230 - 190 * share
        for step in (1, width):  # a lens blurs: [1 2 1] along rows, then along columns
            image = [(image[i - step] + 2 * image[i] + image[(i + step) % len(image)]) / 4 for i in range(len(image))]
        image = [round(value) for value in image]
        (self.here / "drops.pgm").write_bytes(b"P5 640 480 255\n" + bytes(image))
        self.call("measure", "droplets", "--image", "drops.pgm", "--camera", "out/camera.yaml", "--output", "d.csv")
        lines = (self.here / "d.csv").read_text().splitlines()
        names = lines[0].split(",")
        rows = [dict(zip(names, line.split(","))) for line in lines[1:]]
        self.assertEqual(len(rows), 5)
        found = [(float(row["x [m]"]), float(row["y [m]"])) for row in rows]
        for row in rows:
            self.assertAlmostEqual(float(row["diameter [m]"]), 3e-3, delta=3e-5)
        middle = min(found, key=lambda p: sum(math.dist(p, q) for q in found))
        for point in found:
            if point != middle:
                self.assertAlmostEqual(math.dist(point, middle), 0.02, delta=2e-5)

    def test_a_pinhole_camera_without_a_plane_asks_for_one(self):
        self.call("calibrate", "camera", "--target", "target.csv", *self.views, "--out", "out")
        (self.here / "grey.pgm").write_bytes(b"P5 64 64 255\n" + bytes([200] * 4096))
        for more, status in (([], 2), (["--distance", "0.16"], 0)):
            said = self.call("measure", "droplets", "--image", "grey.pgm", "--camera", "out/camera.yaml", *more,
                             "--output", "d.csv", status=status)
            if status == 2:
                self.assertEqual(said.count("\n"), 1)
                self.assertIn("plane", said)

    @staticmethod
    def inside(edge, u, v):
        odd = False
        for (u0, v0), (u1, v1) in zip(edge, edge[1:] + edge[:1]):
            if (v0 > v) != (v1 > v) and u < u0 + (v - v0) * (u1 - u0) / (v1 - v0):
                odd = not odd
        return odd


class Geometric(Calibrations):
    LINES = (("X", (0, 0), (200, 0)), ("Y", (0, 0), (0, 200)), ("Y far", (200, 0), (200, 200)), ("D", (0, 0), (200, 200)),
             ("A", (0, 200), (200, 0)), ("H", (0, 0), (200, 100)))

    def rows(self, lines, spoil=()):
        """Two passes each way; a scale error of 20 ppm along x, noise 0.2 um, one reading in `spoil` 20 um off."""
        draw, rows = random.Random(9), []
        for name, (x0, y0), (x1, y1) in lines:
            length = math.hypot(x1 - x0, y1 - y0)
            for cycle in (1, 2):
                for way, order in ((1, range(21)), (-1, range(20, -1, -1))):
                    for i in order:
                        x, y = x0 + (x1 - x0) * i / 20, y0 + (y1 - y0) * i / 20
                        along = math.hypot(x - x0, y - y0) + 2e-5 * (x - x0) * (x1 - x0) / length + draw.gauss(0, 2e-4)
                        rows.append([name, x, y, f"{along:.6f}", cycle, way])
        for row in spoil:
            rows[row][3] = f"{float(rows[row][3]) + 0.02:.6f}"
        self.write("lines.csv", "line,x [mm],y [mm],displacement [mm],cycle,direction", rows)
        (self.here / "machine.yaml").write_text("invar_machine: 1\nchain: [y, x]\ntravel: {x: [0, 0.2], y: [0, 0.2]}\n")

    def test_outliers_are_counted_and_the_error_over_all_is_said(self):
        self.rows(self.LINES, spoil=(30, 100, 250))
        said = self.call("calibrate", "geometric", "--machine", "machine.yaml", "--lines", "lines.csv", "--out", "out")
        self.assertIn("504 readings, 501 used (left out: 3 outliers)", said)
        rows = self.report()["rows"]
        self.assertAlmostEqual(rows["rms_used"], 0.2e-6, delta=0.04e-6)
        self.assertAlmostEqual(rows["rms_all"], 20e-6 * math.sqrt(3 / 504), delta=0.2e-6)
        self.assertIn("Rows left out, and the cost of that", self.page())

    def test_an_export_has_no_zeros_for_what_no_line_told(self):
        self.rows(self.LINES[:1])
        self.call("calibrate", "geometric", "--machine", "machine.yaml", "--lines", "lines.csv", "--out", "out")
        said = self.call("calibrate", "controller", "--model", "out/compensation.yaml", "--out", "controller")
        self.assertIn("linuxcnc-y.comp is not written: no line told the positioning of y", said)
        self.assertFalse((self.here / "controller/linuxcnc-y.comp").exists())
        self.assertIn("EC0Y was not measured", (self.here / "controller/skew.txt").read_text())
        self.assertNotIn("EYY \n", (self.here / "controller/volcomp-isg.csv").read_text())


class Components(Calibrations):
    def test_readings_left_out_are_shown_with_their_cost(self):
        draw = random.Random(2)
        rows = [["EYX", x, f"{2e-3 * math.sin(x / 40) + draw.gauss(0, 1e-4):.6f}"] for x in range(0, 201, 5)]
        rows[17][2] = "0.05"
        self.write("c.csv", "component,position [mm],translation [mm]", rows)
        (self.here / "machine.yaml").write_text("invar_machine: 1\nchain: [y, x]\ntravel: {x: [0, 0.2], y: [0, 0.2]}\n")
        said = self.call("calibrate", "components", "--machine", "machine.yaml", "--readings", "c.csv", "--out", "out")
        self.assertIn("over all", said)
        one, = self.report()["components"]
        self.assertEqual(one["rejected"], 1)
        self.assertGreater(one["rms_all"], 5e-6)
        self.assertLess(one["rms_used"], 0.2e-6)
        self.assertIn("Rows left out, and the cost of that", self.page())


    def test_a_prediction_says_what_is_not_in_it(self):
        draw = random.Random(3)
        self.write("c.csv", "component,position [mm],translation [mm]",
                   [["EXX", x, f"{1e-5 * x + draw.gauss(0, 1e-4):.6f}"] for x in range(0, 201, 10)])
        (self.here / "machine.yaml").write_text("invar_machine: 1\nchain: [y, x]\ntravel: {x: [0, 0.2], y: [0, 0.2]}\n")
        self.call("calibrate", "components", "--machine", "machine.yaml", "--readings", "c.csv", "--out", "out")
        self.write("points.csv", "x [m],y [m]", [[0.1, 0.1]])
        done = subprocess.run([INVAR, "predict", "--model", "out/compensation.yaml", "--inputs", "points.csv",
                               "--output", "p.csv"], cwd=self.here, capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("taken as zero and not in sigma: EYX", done.stderr)
        self.assertNotIn("EXX", done.stderr)


class History(Calibrations):
    def thermal(self, name, warm, draw):
        rows = [[60 * k, x, f"{22 + 9 * k / 59:.3f}",
                 f"{(0.011 + warm) * x * (9 * k / 59) + draw.gauss(0, 0.3):.4f}"] for k in range(60) for x in (0, 50, 100)]
        self.write("t.csv", Thermal.HEADER, rows)
        self.call("calibrate", "thermal", "--recording", "t.csv", "--out", f"machine/{name}/thermal")

    def thermistor(self, name, warmer, draw):
        self.write("n.csv", "temperature [degC],resistance [ohm]",
                   [[t, f"{Thermistor.resistance(t + warmer + draw.gauss(0, 0.02)):.3f}"] for t in range(0, 101, 10)])
        self.call("calibrate", "thermistor", "--readings", "n.csv", "--out", f"machine/{name}/thermistor")

    def make(self):
        """An axis whose expansion at 31 degC grows by 0.9 um a month at x = 100 mm; a thermistor that stays."""
        draw = random.Random(6)
        for month in range(5):
            self.thermal(f"2026-0{month + 1}-15", 0.001 * month, draw)
            self.thermistor(f"2026-0{month + 1}-15", 0.0, draw)

    def test_what_moved_and_when_the_next_is_due(self):
        self.make()
        said = self.call("calibrate", "history", "machine", "--accuracy", "2e-6", "--out", "history")
        self.assertIn("thermal: 5 calibrations, 2026-01-15 00:00 to 2026-05-15 00:00", said)
        kinds = {kind["kind"]: kind for kind in self.report("history")["kinds"]}
        names = {name["name"]: name for name in kinds["thermal"]["names"]}
        hot = names["error at 31 degC"]
        self.assertTrue(hot["has_moved"])
        x = float(hot["where"].split()[2])  # "x = 87.5 mm"
        self.assertAlmostEqual(hot["moved"], 0.036e-6 * x, delta=0.3e-6)
        self.assertAlmostEqual(hot["rate_per_day"], 0.0003e-6 * x, delta=0.003e-6)
        self.assertFalse(names["error at 22 degC"]["has_moved"])
        # RMS over x of 0.9 um x / 100 mm a month is 0.55 um; two sigma of it reach 2 um after 55 days.
        self.assertAlmostEqual(kinds["thermal"]["due"]["days_after_last"], 55, delta=8)
        self.assertFalse(any(name["has_moved"] for name in kinds["thermistor"]["names"]))
        page = self.page("history")
        for words in ("Due 2026-07-", "moved", "Rows left out, and the cost of that", "<svg"):
            self.assertIn(words, page)

    def test_json_and_what_was_left_out(self):
        self.make()
        broken = self.here / "machine/2026-02-15/thermal/compensation.yaml"
        broken.write_text(broken.read_text().replace("lag: 0", "lag: 1", 1))
        report = json.loads(self.call("calibrate", "history", "machine", "--json"))
        self.assertEqual((report["rows"]["given"], report["rows"]["used"]), (10, 9))
        said = self.call("calibrate", "history", "machine")
        self.assertIn("left out: machine/2026-02-15/thermal/compensation.yaml", said)
        self.assertIn("checksum", said)

    def test_a_folder_without_calibrations_is_said_in_one_line(self):
        (self.here / "empty").mkdir()
        for folder in ("empty", "none"):
            said = self.call("calibrate", "history", folder, "--out", "history", status=2)
            self.assertEqual(said.count("\n"), 1)
            self.assertIn(folder, said)
            self.assertFalse((self.here / "history").exists())

    def test_one_calibration_tells_no_movement(self):
        self.thermistor("2026-01-15", 0.0, random.Random(1))
        self.assertIn("what moves cannot be told", self.call("calibrate", "history", "machine", "--accuracy", "0.1"))

    def test_a_geometric_machine_that_warped(self):
        (self.here / "machine.yaml").write_text("invar_machine: 1\nchain: [y, x]\ntravel: {x: [0, 0.2], y: [0, 0.2]}\n")
        for month, scale in ((1, 0.0), (4, 15e-6)):
            draw = random.Random(month)
            rows = []
            for name, (x0, y0), (x1, y1) in (("X", (0, 0), (200, 0)), ("Y", (0, 0), (0, 200)), ("Y far", (200, 0), (200, 200)),
                                             ("D", (0, 0), (200, 200)), ("A", (0, 200), (200, 0)), ("H", (0, 0), (200, 100))):
                for i in range(21):
                    x, y = x0 + (x1 - x0) * i / 20, y0 + (y1 - y0) * i / 20
                    way = math.hypot(x - x0, y - y0)
                    along = (x1 - x0) / math.hypot(x1 - x0, y1 - y0)
                    rows.append([name, x, y, f"{way + scale * (x - x0) * along + draw.gauss(0, 1e-4):.6f}"])
            self.write("lines.csv", "line,x [mm],y [mm],displacement [mm]", rows)
            self.call("calibrate", "geometric", "--machine", "machine.yaml", "--lines", "lines.csv", "--out",
                      f"machine/2026-0{month}-01")
        report = json.loads(self.call("calibrate", "history", "machine", "--accuracy", "2e-6", "--json"))
        names = {name["name"]: name for name in report["kinds"][0]["names"]}
        self.assertTrue(names["EXX"]["has_moved"])
        self.assertAlmostEqual(names["EXX"]["moved"], 3e-6, delta=0.5e-6)  # 15 ppm of 200 mm
        self.assertFalse(names["EYY"]["has_moved"])
        self.assertTrue(report["kinds"][0]["due"]["known"])

    def test_a_reversal_that_grew_is_told_and_one_that_stayed_is_not(self):
        """Four passes of x and y; from January to April the reversal of x grows from 2 to 5 um at the far end."""
        (self.here / "machine.yaml").write_text("invar_machine: 1\nchain: [y, x]\ntravel: {x: [0, 0.2], y: [0, 0.2]}\n")
        for month, worn in ((1, 0.0), (4, 3e-3)):
            draw = random.Random(10 + month)
            rows, motions = [], []
            for axis in ("x", "y"):
                for way, order in ((1, range(21)), (-1, range(20, -1, -1))) * 2:
                    for i in order:
                        q = 10 * i
                        lost = 2e-3 + (worn * q / 200 if axis == "x" else 0.0)
                        off = way * lost / 2 + draw.gauss(0, 1e-4)
                        rows.append([axis, q if axis == "x" else 0, q if axis == "y" else 0, f"{1000 * off:.4f}", way])
                        motions.append([f"E{2 * axis.upper()}", q, f"{1000 * (off + 1e-5 * q):.4f}", way])
            self.write("lines.csv", "line,x [mm],y [mm],deviation [um],direction", rows)
            self.write("c.csv", "component,position [mm],translation [um],direction", motions)
            for command, argument, file in (("geometric", "--lines", "lines.csv"), ("components", "--readings", "c.csv")):
                self.call("calibrate", command, "--machine", "machine.yaml", argument, file, "--out",
                          f"{command}/2026-0{month}-01")
        for command in ("geometric", "components"):
            report = json.loads(self.call("calibrate", "history", command, "--json"))
            names = {name["name"]: name for name in report["kinds"][0]["names"]}
            self.assertTrue(names["reversal of x"]["has_moved"])
            worst = names["reversal of x"]  # that many times its sigma: the far end, or a place beside it
            at = float(worst["where"].split()[2])
            self.assertGreater(at, 100)
            self.assertAlmostEqual(worst["moved"], 0.015e-6 * at, delta=0.3e-6)
            self.assertFalse(names["reversal of y"]["has_moved"])
            self.assertIn("reversal of x at x = ", self.call("calibrate", "history", command))


if __name__ == "__main__":
    unittest.main()
