#!/usr/bin/env python3
"""Names that steer a shell, gnuplot, a page or a terminal, through every command that makes a page or a script.

Usage: hostile_names_test.py INVAR SOURCE_FOLDER
Each name would make the file `made` if anything ran it. No command may: it takes the name as letters, or refuses it in one line.
"""
import html
import math
import pathlib
import random
import subprocess
import sys
import tempfile
import unittest

INVAR = sys.argv.pop(1)
SOURCE = pathlib.Path(sys.argv.pop(1))

# Printable ones are taken as they are; they may stand in tables, models and the names of files.
TAKEN = ["`touch made`", "$(touch made)", "'; system('touch made') #", "' . system('touch made') . '", "@HOME ^{x} {/Symbol b}",
         "<script>x</script>", "<svg onload=x>", "&amp;", "a|touch made;touch made&", "-o made", "../made", "µ °C Ω"]
# Those with control characters are refused where they are names of a table or a model.
REFUSED = ["a\x1b[2Jb", "a\x07", "a\u202eb", "a\u009b31m"]


def call(folder, *words, **more):
    return subprocess.run([INVAR, *words], cwd=folder, capture_output=True, check=False, timeout=280, **more)


class Hostile(unittest.TestCase):
    def setUp(self):
        kept = tempfile.TemporaryDirectory(prefix="invar-names-")
        self.addCleanup(kept.cleanup)
        self.folder = pathlib.Path(kept.name)

    def expect_inert(self, said=None):
        """Nothing ran, and nothing that was said steers a terminal."""
        made = [p for p in self.folder.rglob("made") if p.name == "made"]
        self.assertEqual(made, [])
        self.assertFalse((pathlib.Path.home() / "made").exists())
        for text in [] if said is None else [said.stdout, said.stderr]:
            self.assertNotRegex(text.decode(), "[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e]")

    def expect_page(self, file, name):
        """The page shows the name as letters, in tables as in drawings."""
        page = file.read_text()
        self.assertNotIn("<script", page)
        self.assertNotIn("<svg onload", page)
        self.assertIn(html.escape(name, quote=False).split("'")[0], page)
        self.assertNotRegex(page, "[\x00-\x08\x0b-\x1f\x7f-\x9f]")

    def expect_refused(self, said, *parts):
        self.assertEqual(said.returncode, 2, said.stderr)
        self.assertEqual(said.stderr.count(b"\n"), 1, said.stderr)
        for part in parts:
            self.assertIn(part.encode(), said.stderr)

    def write(self, name, text):
        file = self.folder / name
        file.write_text(text)
        return str(file)

    # --- what each command reads, with a name in it

    def lines(self, name):
        rows = [f'line,x [m],y [m],displacement [m]']
        for y in (0.0, 0.1, 0.2):
            rows += [f'"{name} {y}",{0.02 * i},{y},{0.02 * i + 1e-6 * i:.9f}' for i in range(11)]
        for x in (0.0, 0.1, 0.2):
            rows += [f'"{name} y{x}",{x},{0.02 * i},{0.02 * i - 1e-6 * i:.9f}' for i in range(11)]
        return "\n".join(rows) + "\n"

    def machine(self):
        return self.write("machine.yaml", "invar_machine: 1\nchain: [y, x]\ntravel: {x: [0, 0.2], y: [0, 0.2]}\n")

    def quoted(self, name):
        return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'

    def model(self, name):
        return ("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: heat}\nstates:\n"
                "  x: {derivative: \"u - k*x\", initial: {value: 1.0, unit: V, sigma: 0.5}}\noutputs:\n"
                f"  {self.quoted(name)}: {{column: {self.quoted(name)}, expression: x}}\n"
                "parameters: {k: {value: 0.3, unit: 1/s, sigma: 0.2}}\n"
                f"noise: {{{self.quoted(name)}: 0.01}}\nterms: []\n")

    def tank(self, name):
        draw, x, heat, rows = random.Random(3), 1.0, 1.0, [f't [s],heat [V/s],"{name} [V]"']
        for i in range(600):
            heat = draw.uniform(-1.5, 2.5) if i % 70 == 0 else heat
            rows.append(f"{0.05 * i},{heat},{x + draw.gauss(0, 0.01)}")
            for _ in range(20):
                x += 0.0025 * (heat - 0.3 * x - 0.12 * x ** 3)
        return "\n".join(rows) + "\n"

    # --- tests

    def test_lines_of_a_geometric_calibration(self):
        machine = self.machine()
        name = " ".join(t for t in TAKEN if '"' not in t)[:150]
        lines = self.write("l`touch made`$(touch made).csv", self.lines(name))
        said = call(self.folder, "calibrate", "geometric", "--machine", machine, "--lines", lines, "--out", "o`touch made`")
        self.assertEqual(said.returncode, 0, said.stderr)
        self.expect_inert(said)
        self.expect_page(self.folder / "o`touch made`" / "report.html", "`touch made`")
        for wrong in REFUSED:
            said = call(self.folder, "calibrate", "geometric", "--machine", machine, "--lines",
                        self.write("lines.csv", self.lines(wrong)), "--out", "out")
            self.expect_refused(said, "lines.csv:2: column `line`", "byte 2")
            self.expect_inert(said)
            self.assertFalse((self.folder / "out").exists())

    def test_columns_of_a_diagnosed_model(self):
        for i, name in enumerate(TAKEN[:6]):
            model = self.write("m'`touch made`.yaml", self.model(name))
            recording = self.write("r$(touch made).csv", self.tank(name))
            said = call(self.folder, "diagnose", "--model", model, "--recording", recording, "--out", f"d{i}")
            self.assertIn(said.returncode, (0, 1, 3), said.stderr)
            self.expect_inert(said)
            self.expect_page(self.folder / f"d{i}" / "report.html", name)
            said = call(self.folder, "simulate", "--model", model, "--inputs", recording, "--output", f"s{i}.csv")
            self.assertEqual(said.returncode, 0, said.stderr)
            self.expect_inert(said)
        for wrong in REFUSED:
            text = self.model("ok").replace("ok", "a" + "".join(f"\\u{ord(c):04x}" for c in wrong))
            said = call(self.folder, "diagnose", "--model", self.write("m.yaml", text), "--recording",
                        self.write("r.csv", self.tank("ok")), "--out", "d")
            self.expect_refused(said, "m.yaml:8: ", "has the control character")
            self.expect_inert(said)

    def test_files_of_the_other_calibrations(self):
        draw = random.Random(1)
        thermal = "x [m],temperature [degC],error [m],cycle,direction,t [s]\n" + "".join(
            f"{0.01 * (i % 21)},{20 + 0.01 * i},{1e-7 * (i % 21) * (0.01 * i) + draw.gauss(0, 1e-8):.10f},{1 + i // 42},"
            f"{1 if i % 42 < 21 else -1},{i}\n" for i in range(840))
        drops = "target_x [m],target_y [m],height [m],landed_x [m],landed_y [m],diameter [m]\n" + "".join(
            f"{0.001 * i},0.001,{h},{0.001 * i + 1e-5 + 5e-3 * h + draw.gauss(0, 1e-6)},{0.001 + draw.gauss(0, 1e-6)},6.2e-4\n"
            for h in (0.002, 0.02) for i in range(8))
        thermistor = "temperature [degC],resistance [ohm]\n" + "".join(
            f"{t},{10000 * math.exp(3950 * (1 / (t + 273.15) - 1 / 298.15)):.3f}\n" for t in range(10, 70, 4))
        fusion = "run,t [s],reference [m],position_a`touch made` [m],velocity_b$(touch made) [m/s],noise_level\n" + "".join(
            f"{r},{0.002 * i:.4f},{0.01 * math.sin(0.01 * i):.7f},{0.01 * math.sin(0.01 * i) + draw.gauss(0, 1e-4):.7f},"
            f"{0.05 * math.cos(0.01 * i) + draw.gauss(0, 0.01 * r):.6f},{r}\n" for r in (1, 2, 3) for i in range(700))
        for kind, option, text in (("thermal", "--recording", thermal), ("dispenser", "--droplets", drops),
                                   ("thermistor", "--readings", thermistor), ("fusion", "--recording", fusion)):
            with self.subTest(kind):
                file = self.write(f"{kind}`touch made`<script>.csv", text)
                said = call(self.folder, "calibrate", kind, option, file, "--out", kind)
                self.assertEqual(said.returncode, 0, said.stderr)
                self.expect_inert(said)
                page = (self.folder / kind / "report.html").read_text()
                self.assertNotIn("<script", page)

    def test_plan_and_pictures(self):
        plan = self.write("m`touch made`.yaml", pathlib.Path(self.machine()).read_text())
        said = call(self.folder, "calibrate", "plan", "--machine", plan, "--accuracy", "5e-6", "--noise", "1e-7",
                    "--output", "p`touch made`.csv", "--report", "plan.html")
        self.assertEqual(said.returncode, 0, said.stderr)
        self.expect_inert(said)
        self.expect_page(self.folder / "plan.html", "m`touch made`.yaml")
        picture = bytearray(b"P5 320 240 255\n" + bytes([200]) * 320 * 240)
        for y in range(240):
            for x in range(320):
                inside = 30 - math.hypot(x - 160, y - 120)
                picture[15 + 320 * y + x] = int(200 - 160 * min(1, max(0, inside + 0.5)))
        name = "i<script>`touch made`\x1b[2J.pgm"
        (self.folder / name).write_bytes(picture)
        said = call(self.folder, "measure", "droplets", "--image", name, "--output", "d.csv", "--report", "d.html")
        self.assertEqual(said.returncode, 0, said.stderr)
        self.expect_inert(said)
        self.expect_page(self.folder / "d.html", "`touch made`")

    def test_names_of_a_cell(self):
        cell = (SOURCE / "deployment" / "xy-table.yaml").read_text()
        folder = SOURCE / "deployment"
        for key, where in (("name: xy_table", "name: "), ("motion:", "  "), ("stage_x:", "      ")):
            self.assertIn(key, cell)
            for name in TAKEN[:4] + ["a b", "ä", "x" * 40]:
                word = key.split(": ")[1] if ": " in key else key[:-1]
                text = cell.replace(key, key.replace(word, self.quoted(name)), 1)
                text = text.replace("profiles: ", f"profiles: {folder}/", 1)
                said = call(self.folder, "check", self.write("c.yaml", text))
                self.assertEqual(said.returncode, 2)
                self.assertRegex(said.stderr.decode(), r"c.yaml:\d+: .*is no name: it has .*; use 1 to 31 letters")
                self.expect_inert(said)

    def test_lines_of_a_job_in_a_cell_that_runs(self):
        text = (SOURCE / "deployment" / "xy-table.yaml").read_text()
        for plain, name in (("name: steep", "`touch made`"), ("name: X at y=130", "$(touch made)<script>x</script>'")):
            self.assertIn(plain, text)
            text = text.replace(plain, f"name: {self.quoted(name)}", 1)
        folder = self.folder / "deployment"
        folder.mkdir()
        for beside in ("profiles.yaml", "machines", "maps"):
            (folder / beside).symlink_to(SOURCE / "deployment" / beside)
        (folder / "c.yaml").write_text(text)
        said = call(self.folder, "run", str(folder / "c.yaml"), "--job", "calibrate-geometry")
        self.assertEqual(said.returncode, 0, said.stderr)
        self.expect_inert(said)
        self.expect_page(self.folder / "out" / "xy-table" / "report.html", "`touch made`")

    def test_words_of_a_call(self):
        for word in TAKEN + [w for w in REFUSED]:
            for words in (["check", word], ["diagnose", "--model", word, "--recording", word, "--out", "x"], [word], ["run", word],
                          ["recording", "info", word], ["export", word, "--out", word], ["profiles", word]):
                said = call(self.folder, *words)
                self.assertNotEqual(said.returncode, 0)
                self.expect_inert(said)


unittest.main(argv=[sys.argv[0], "-v", *sys.argv[1:]])
