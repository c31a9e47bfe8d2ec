"""`invar new`: what it writes under another name builds against the installed package, passes its own test, is sound and runs; a name
that cannot be, or a folder that exists, ends with one line, status 2, and nothing written.

new_test.py INSTALLED SOURCE_DIR"""
import pathlib
import resource
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
import tutorials  # noqa: E402  (numbers that no other test holds)

INSTALLED, SOURCE = (pathlib.Path(word).resolve() for word in sys.argv[1:3])
INVAR = INSTALLED / "bin" / "invar"
EXAMPLES = {"component": "low_pass", "cell": "one_axis", "map": "pad_heater"}


class New(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="invar-new-"))
        self.addCleanup(shutil.rmtree, self.folder)

    def run_in(self, folder, *words, status=0, **more):
        done = subprocess.run([str(word) for word in words], cwd=folder, capture_output=True, text=True, timeout=120, **more)
        self.assertEqual(done.returncode, status, f"{words}: {done.stdout}{done.stderr}")
        return done

    def new(self, *words, status=0, **more):
        return self.run_in(self.folder, INVAR, "new", *words, status=status, **more)

    def refused(self, expected, *words, **more):
        before = sorted(self.folder.rglob("*"))
        said = self.new(*words, status=2, **more)
        self.assertEqual(said.stdout, "")
        self.assertEqual(said.stderr.count("\n"), 1, said.stderr)
        self.assertIn(expected, said.stderr)
        self.assertEqual(sorted(self.folder.rglob("*")), before, "something was written")

    def test_component_builds_and_runs_under_any_name(self):
        for name, its_class in (("edge_filter2", "EdgeFilter2"), ("bench", "Bench"), ("Std", "Std")):
            with self.subTest(name):
                self.new("component", name, "--domain", tutorials.claim("domain", 101, 1, 99))
                made = self.folder / name
                text = "".join(file.read_text(encoding="utf-8") for file in made.iterdir())
                self.assertIn(f"class {its_class} final", text)
                self.assertNotRegex(text, "low_pass|LowPass")
                launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
                self.run_in(made, "cmake", "-S", ".", "-B", "build", "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={INSTALLED}", *launcher)
                self.run_in(made, "ninja", "-C", "build")
                self.run_in(made, "ctest", "--test-dir", "build")
                self.assertIn(": sound (4 components", self.run_in(made, INVAR, "check", "cell.yaml").stdout)
                self.run_in(made, INVAR, "run", "cell.yaml", "--simulated", "--duration", "0.5")
                rows = self.run_in(made, INVAR, "export", "out/recording.mcap", "--topic", "smooth.smooth", "--out", "tables").stdout
                self.assertRegex(rows, f"cell.{name}.smooth.smooth.csv: [45][0-9][0-9] rows")

    def test_cell_is_sound_and_runs_its_job(self):
        self.new("cell", "cell", "--out", "gantry", "--domain", tutorials.claim("domain", 101, 1, 99))
        made = self.folder / "gantry"
        said = self.run_in(made, INVAR, "check", "cell.yaml").stdout
        self.assertRegex(said, r"^cell.yaml: sound \(4 components in 3 processes\)\n$")
        said = self.run_in(made, INVAR, "run", "cell.yaml", "--simulated", "--job", "move").stdout
        self.assertIn("move: following error", said)

    def test_map_is_sound_and_its_simulated_device_warms(self):
        self.new("map", "hot_plate", "--out", "hot_plate/", "--domain", tutorials.claim("domain", 101, 1, 99))
        made = self.folder / "hot_plate"
        self.assertTrue((made / "hot_plate.yaml").exists())
        cell = made / "cell.yaml"
        cell.write_text(cell.read_text().replace("15045", str(tutorials.claim("port", 20000, 10, 1000))))
        self.assertIn(": sound (3 components in 1 process)\n", self.run_in(made, INVAR, "check", "cell.yaml").stdout)
        self.run_in(made, INVAR, "run", "cell.yaml", "--simulated", "--duration", "120")
        self.run_in(made, INVAR, "export", "out/recording.mcap", "--topic", "thermal.state", "--out", "tables")
        lines = next((made / "tables").glob("*.csv")).read_text().splitlines()
        column = next(k for k, name in enumerate(lines[0].split(",")) if name.startswith("temperature"))
        self.assertAlmostEqual(float(lines[-1].split(",")[column]), 30.0, delta=1.0)

    def test_a_given_domain_stands_in_cell_and_readme(self):
        for kind, example in EXAMPLES.items():
            self.new(kind, f"my_{kind}", "--domain", "199")
            self.assertRegex((self.folder / f"my_{kind}" / "cell.yaml").read_text(), "(?m)^domain: 199\\b")
            self.assertIn(f"invar new {kind} my_{kind} --domain 199\n", (self.folder / f"my_{kind}" / "README.md").read_text())
            self.assertNotIn(example, (self.folder / f"my_{kind}" / "README.md").read_text())

    def test_files_are_those_of_the_examples(self):
        for kind, example in EXAMPLES.items():
            self.new(kind, example)
            made = {file.name: file.read_text() for file in (self.folder / example).iterdir()}
            there = {file.name: file.read_text() for file in (SOURCE / "examples" / example).iterdir()}
            there["profiles.yaml"] = (SOURCE / "deployment" / "profiles.yaml").read_text()
            self.assertEqual(made, there)

    def test_names_that_cannot_be(self):
        for kind in EXAMPLES:
            self.refused("letters, digits", kind, "../x")
            self.refused("letters, digits", kind, "")
            self.refused("letters, digits", kind, "a b")
            self.refused("letters, digits", kind, "caf\u00e9\x1b[31m")
            self.refused("31", kind, "x" * 32)
            self.refused("begins with no letter", kind, "2x")
            self.refused("begins with no letter", kind, "_x")
        self.refused("is a component of Invar already", "component", "stage")
        self.refused("is taken by the build", "component", "test")
        self.refused("is taken by the build", "component", "parameters")
        self.refused("two files of the name cell.yaml", "map", "cell")
        self.refused("two files of the name profiles.yaml", "map", "profiles")
        self.refused("NAME", "component")
        self.refused("--domain", "cell", "a", "--domain", "4000")
        self.refused("", "motor", "a")

    def test_nothing_is_overwritten(self):
        (self.folder / "a").mkdir()
        (self.folder / "b").write_text("mine")
        (self.folder / "c").symlink_to("nowhere")
        for name in "abc":
            self.refused("exists already", "cell", name)
        self.assertEqual((self.folder / "b").read_text(), "mine")
        self.refused("folder that does not exist", "cell", "d", "--out", "none/d")
        self.refused("folder that does not exist", "cell", "d", "--out", "b/d")

    def test_a_full_disk_leaves_nothing(self):
        def limit():  # files above 1 kB cannot be written: the cell file is longer
            resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
            import signal
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        self.refused("cannot be written", "cell", "a", preexec_fn=limit)

    def test_help_has_an_example(self):
        for kind in EXAMPLES:
            self.assertRegex(self.new(kind, "--help").stdout, f"Example: invar new {kind} \\w+")


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
