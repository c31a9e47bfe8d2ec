#!/usr/bin/env python3
"""`invar diagnose` as somebody at a terminal meets it: a tank made here loses heat by a law that its model lacks.

Usage: diagnose_test.py INVAR
"""
import csv
import json
import math
import os
import pathlib
import pty
import random
import signal
import subprocess
import sys
import tempfile
import time
import unittest

INVAR = sys.argv.pop(1)

MODEL = """invar_model: 1
plant: equations
columns: {time: t}
inputs: {u: heat}
states:
  x: {derivative: "u - k*x", initial: {value: 1.0, unit: V, sigma: 0.5}}
outputs: {warmth: {column: warmth, expression: "x"}}
parameters: {k: {value: 0.3, unit: 1/s, sigma: 0.2}}
noise: {warmth: 0.01}
terms: []
"""


def tank(file, rows, seed, start=1.0, step=0.05, split=None, cubic=0.12):
    """x' = u - 0.3 x - 0.12 x^3, by small steps; the heat jumps every now and then."""
    draw = random.Random(seed)
    x, heat, table = start, 1.0, []
    for i in range(rows):
        if i % 70 == 0:
            heat = draw.uniform(-1.5, 2.5)
        table.append([step * i, heat, x + draw.gauss(0.0, 0.01)])
        for _ in range(20):
            x += step / 20 * (heat - 0.3 * x - cubic * x ** 3)
    columns = ["t [s]", "heat [V/s]", "warmth [V]"]
    with open(file, "w", newline="") as out:
        write = csv.writer(out)
        write.writerow(columns)
        for i, row in enumerate(table):
            write.writerow(row if split is None or i == 0 else row[:2] + [""])
    if split is not None:
        with open(split, "w", newline="") as out:
            write = csv.writer(out)
            write.writerow(["t [s]", "warmth [V]"])
            write.writerows([row[0], row[2]] for row in table)
    return [row[2] for row in table]


def call(folder, *words):
    return subprocess.run([INVAR, *words], cwd=folder, capture_output=True, text=True, check=False)


class Diagnose(unittest.TestCase):
    def setUp(self):
        self.kept = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.kept.name)
        (self.folder / "model.yaml").write_text(MODEL)
        tank(self.folder / "run.csv", 1500, 1)

    def tearDown(self):
        self.kept.cleanup()

    def test_another_recording_proves_it_and_anybody_can_check(self):
        measured = tank(self.folder / "other.csv", 900, 2, start=0.4)
        done = call(self.folder, "diagnose", "--model", "model.yaml", "--recording", "run.csv", "--check", "other.csv", "--out", "d")
        self.assertEqual(done.returncode, 0, done.stderr)
        for words in ("missing", "cubic", "state x", "error held out", "in other.csv", "next: ", "d/report.html"):
            self.assertIn(words, done.stdout)
        report = json.loads((self.folder / "d/report.json").read_text())
        fit = report["fit"]["other_recordings"]["other.csv"]["warmth"]
        self.assertLess(fit["after"], 0.012)
        self.assertGreater(fit["retuned"], 3 * fit["after"])
        page = (self.folder / "d/report.html").read_text()
        for words in ("missing<", "how sure", "next step", "Another recording, not used here: other.csv"):
            self.assertIn(words, page)
        for model, said in (("model.yaml", "before"), ("d/retuned.yaml", "retuned"), ("d/patched.yaml", "after")):
            done = call(self.folder, "simulate", "--model", model, "--inputs", "other.csv", "--output", "s.csv")
            self.assertEqual(done.returncode, 0, done.stderr)
            with open(self.folder / "s.csv") as text:
                simulated = [float(row[1]) for row in list(csv.reader(text))[1:]]
            error = math.sqrt(sum((a - b) ** 2 for a, b in zip(measured, simulated)) / len(measured))
            self.assertAlmostEqual(error, fit[said], delta=0.01 * fit[said])

    def test_a_start_that_is_a_guess_is_moved(self):
        tank(self.folder / "other.csv", 60, 3, start=2.0, split=self.folder / "outputs.csv")
        text = (self.folder / "other.csv").read_text().splitlines()
        text[1] = ",".join(text[1].split(",")[:2] + ["0.7"])
        (self.folder / "other.csv").write_text("\n".join(text) + "\n")
        words = ["diagnose", "--model", "model.yaml", "--recording", "run.csv", "--check", "other.csv", "--check-outputs", "outputs.csv"]
        error = []
        for more in ([], ["--check-fits-start"]):
            done = call(self.folder, *words, *more, "--out", "d")
            self.assertEqual(done.returncode, 0, done.stderr)
            report = json.loads((self.folder / "d/report.json").read_text())
            error.append(report["fit"]["other_recordings"]["other.csv"]["warmth"]["after"])
        self.assertGreater(error[0], 0.1)
        self.assertLess(error[1], 0.013)

    def test_a_budget_that_ends_leaves_a_report_that_says_so(self):
        tank(self.folder / "long.csv", 6000, 5)
        began = time.monotonic()
        done = call(self.folder, "diagnose", "--model", "model.yaml", "--recording", "long.csv", "--out", "d", "--budget", "0.2")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertLess(time.monotonic() - began, 20.0)
        report = json.loads((self.folder / "d/report.json").read_text())
        self.assertTrue(report["partial"])
        self.assertIn("further terms of the library", report["not_tried"])
        self.assertNotIn(report["verdict"], ("no_mismatch", "parameters_only", "explained"))
        self.assertTrue(report["fit"]["heldout"])
        page = (self.folder / "d/report.html").read_text()
        for words in ("The budget of 0.2 s ended before all was tried", "not tried: ", "further terms of the library"):
            self.assertIn(words, done.stdout)
            self.assertIn(words, page)
        self.assertIn("a longer --budget", done.stdout)
        self.assertTrue((self.folder / "d/patched.yaml").exists())

    def test_a_whole_search_leaves_nothing_untried_and_a_budget_of_nothing_is_refused(self):
        done = call(self.folder, "diagnose", "--model", "model.yaml", "--recording", "run.csv", "--out", "d", "--budget", "600")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads((self.folder / "d/report.json").read_text())["not_tried"], [])
        self.assertNotIn("not tried", done.stdout)
        for none in ("0", "-1", "nan"):
            done = call(self.folder, "diagnose", "--model", "model.yaml", "--recording", "run.csv", "--budget", none)
            self.assertEqual(done.returncode, 2)
            self.assertIn("--budget", done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1)

    def test_where_another_recording_says_otherwise_it_is_said_in_red_and_in_every_file(self):
        tank(self.folder / "other.csv", 900, 4, start=0.4, cubic=0.0)
        words = ["diagnose", "--model", "model.yaml", "--recording", "run.csv", "--check", "other.csv", "--out", "d"]
        terminal, inside = pty.openpty()
        done = subprocess.run([INVAR, *words], cwd=self.folder, stdout=inside, stderr=subprocess.DEVNULL, check=False)
        os.close(inside)
        text = b""
        try:
            while more := os.read(terminal, 65536):
                text += more
        except OSError:  # the other side is closed
            pass
        os.close(terminal)
        self.assertEqual(done.returncode, 0)
        worse = "Worse on other.csv, do not take it over: warmth "
        self.assertIn("\x1b[31m" + worse, text.decode())
        self.assertIn(f'<div class="callout bad">{worse}', (self.folder / "d/report.html").read_text())
        self.assertEqual(json.loads((self.folder / "d/report.json").read_text())["worse_on"], ["other.csv"])
        self.assertIn("# " + worse, (self.folder / "d/patched.yaml").read_text().split("invar_model")[0])
        plain = call(self.folder, *words).stdout
        self.assertIn("\n" + worse, plain)
        self.assertNotIn("\x1b", plain)

    def test_no_file_that_is_read_is_written_over(self):
        before = (self.folder / "run.csv").read_bytes()
        (self.folder / "d").mkdir()
        (self.folder / "d/patched.yaml").write_bytes((self.folder / "model.yaml").read_bytes())
        for words, said in ((["simulate", "--model", "model.yaml", "--inputs", "run.csv", "--output", "./run.csv"], "--output: ./run.csv is a file that is read here"),
                            (["diagnose", "--model", "d/patched.yaml", "--recording", "run.csv", "--out", "d"], "--out: d/patched.yaml is a file that is read here")):
            done = call(self.folder, *words)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
            self.assertIn(said, done.stderr)
        self.assertEqual((self.folder / "run.csv").read_bytes(), before)
        self.assertEqual([f.name for f in (self.folder / "d").iterdir()], ["patched.yaml"])

    def test_what_nobody_can_read_is_no_success(self):
        with open("/dev/full", "wb") as full:
            done = subprocess.run([INVAR, "diagnose", "--example", "thermal"], cwd=self.folder, stdout=full, stderr=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("standard output cannot be written", done.stderr)

    def test_a_check_that_cannot_be_used_is_said_in_one_line_before_the_search(self):
        tank(self.folder / "other.csv", 60, 3, split=self.folder / "outputs.csv")
        (self.folder / "short.csv").write_text("t [s],warmth [V]\n0,1\n1,2\n")
        (self.folder / "back.csv").write_text("t [s],heat [V/s],warmth [V]\n0,1,2\n1,1,2\n0.5,1,2\n")
        (self.folder / "empty.csv").write_text("t [s],heat [V/s],warmth [V]\n" + "".join(f"{i},1,\n" for i in range(60)))
        for words, said in ((["--check", "nowhere.csv"], "nowhere.csv"),
                            (["--check", "other.csv", "--check-outputs", "short.csv"], "short.csv: has 2 rows, other.csv has 60"),
                            (["--check", "./run.csv"], "--check: ./run.csv is a --recording too"),
                            (["--check", "back.csv"], "back.csv:4: time goes back"),
                            (["--check", "empty.csv"], "empty.csv: has fewer than 8 values of each output"),
                            (["--check-outputs", "outputs.csv"], "--check-outputs: are 1, but --check are 0")):
            done = call(self.folder, "diagnose", "--model", "model.yaml", "--recording", "run.csv", "--out", "d", *words)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
            self.assertIn(said, done.stderr)
            self.assertFalse((self.folder / "d").exists())

    def test_ctrl_c_ends_the_search_with_what_is_known(self):
        tank(self.folder / "long.csv", 25000, 4, step=0.02)
        mine, its = pty.openpty()
        process = subprocess.Popen([INVAR, "diagnose", "--model", "model.yaml", "--recording", "long.csv", "--out", "d"],
                                   cwd=self.folder, stdout=subprocess.PIPE, stderr=its, text=True)
        os.close(its)
        shown, until = "", time.monotonic() + 120
        while "screening" not in shown and time.monotonic() < until:
            shown += os.read(mine, 4096).decode()
        self.assertRegex(shown, r"\[#+-+\] +\d+ %")
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=120)
        os.close(mine)
        self.assertEqual(process.returncode, 130)
        self.assertIn("Stopped before all was tried", said)
        self.assertTrue(json.loads((self.folder / "d/report.json").read_text())["partial"])
        self.assertIn("Stopped before all was tried", (self.folder / "d/report.html").read_text())
        done = call(self.folder, "simulate", "--model", "d/patched.yaml", "--inputs", "long.csv", "--output", "s.csv")
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_a_model_that_runs_away_is_said_and_writes_nothing(self):
        (self.folder / "away.yaml").write_text(MODEL.replace("u - k*x", "u + k*x^2"))
        done = call(self.folder, "simulate", "--model", "away.yaml", "--inputs", "run.csv", "--output", "s.csv")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertRegex(done.stderr, r"^away.yaml: simulated on run.csv, output `warmth` runs away from t = [0-9.]+ s on; .*\n$")
        self.assertEqual([file.name for file in self.folder.glob("s.csv*")], [])

    def test_the_output_of_a_controller_that_the_model_has_needs_no_column(self):
        model = MODEL.replace("inputs: {u: heat}", "inputs: {r: wish, u: heat}").replace(
            "terms: []", 'controller: {output: u, expression: "2*(r-x)"}\nterms: []')
        (self.folder / "loop.yaml").write_text(model)
        tables = []
        for columns in ("t [s],wish [V],heat [V/s]", "t [s],wish [V]"):
            rows = "".join(f"{0.05 * i},{1 + i % 2}{',' if 'heat' in columns else ''}\n" for i in range(50))
            (self.folder / "in.csv").write_text(columns + "\n" + rows)
            done = call(self.folder, "simulate", "--model", "loop.yaml", "--inputs", "in.csv", "--output", "s.csv")
            self.assertEqual(done.returncode, 0, done.stderr)
            tables.append((self.folder / "s.csv").read_text())
        self.assertEqual(tables[0], tables[1])
        (self.folder / "in.csv").write_text("t [s],want [V]\n0,1\n1,2\n")
        done = call(self.folder, "simulate", "--model", "loop.yaml", "--inputs", "in.csv", "--output", "s.csv")
        self.assertEqual(done.returncode, 2)
        self.assertIn("in.csv: has no column `wish` for `r`; add it, or name the right one in the model (there are: t, want)", done.stderr)
        self.assertEqual((self.folder / "s.csv").read_text(), tables[0])

    def test_all_files_appear_or_none_and_it_is_said_before_the_search(self):
        (self.folder / "d/report.html").mkdir(parents=True)
        (self.folder / "d/patched.yaml").write_text("of before")
        (self.folder / "file").write_text("mine")
        for out, said in (("d", "d/report.html: is a folder"), ("file", "file: cannot be made"), ("file/sub", "file/sub: cannot be made")):
            done = call(self.folder, "diagnose", "--model", "model.yaml", "--recording", "run.csv", "--out", out)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
            self.assertIn(said, done.stderr)
        self.assertEqual(sorted(file.name for file in (self.folder / "d").iterdir()), ["patched.yaml", "report.html"])
        self.assertEqual((self.folder / "d/patched.yaml").read_text(), "of before")
        self.assertEqual((self.folder / "file").read_text(), "mine")

    def test_the_same_call_writes_the_same_bytes_and_prints_them(self):
        tank(self.folder / "run.csv", 400, 1)
        texts = []
        for out in ("one", "two"):
            done = call(self.folder, "diagnose", "--model", "model.yaml", "--recording", "run.csv", "--out", out, "--seed", "7", "--json")
            self.assertEqual(done.returncode, 0, done.stderr)
            texts += [done.stdout, (self.folder / out / "report.json").read_text()]
        self.assertEqual(len(set(texts)), 1)
        for file in ("patched.yaml", "retuned.yaml", "report.html"):
            self.assertEqual((self.folder / "one" / file).read_bytes(), (self.folder / "two" / file).read_bytes())


if __name__ == "__main__":
    unittest.main()
