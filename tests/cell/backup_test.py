#!/usr/bin/env python3
"""`invar backup` and `invar restore`: a calibration comes back byte for byte, tar(1) and sha256sum(1) read the file, and a backup that is
damaged, of another cell, or for a cell that runs changes nothing.

Usage: backup_test.py INVAR SOURCE_FOLDER
"""
import io
import pathlib
import shutil
import signal
import subprocess
import sys
import tarfile
import tempfile
import time
import unittest

INVAR = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE = pathlib.Path(sys.argv.pop(1)).resolve()
sys.path.insert(0, str(SOURCE / "tests"))
import tutorials  # noqa: E402  (numbers that no other test holds)


class Backup(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="invar-backup-"))
        self.addCleanup(shutil.rmtree, self.folder)
        shutil.copytree(SOURCE / "deployment", self.folder / "deployment")
        self.cell = self.folder / "deployment" / "xy-table.yaml"
        text = self.cell.read_text().replace("domain: 71", f"domain: {tutorials.claim('domain', 101, 1, 99)}")
        self.cell.write_text(text.replace("15020", str(tutorials.claim("port", 20000, 10, 1000))))
        self.state = self.folder / "out" / "xy-table" / "state"
        self.state.mkdir(parents=True)
        (self.state / "models.yaml").write_text("list\n")
        (self.state / "deep").mkdir()
        (self.state / "deep" / "binary").write_bytes(bytes(range(256)) * 7)
        (self.state / "empty").write_text("")
        self.file = self.folder / "backup.tar"

    def invar(self, *words, status=0, **more):
        done = subprocess.run([INVAR, *map(str, words)], cwd=self.folder, capture_output=True, timeout=60, **more)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done

    def content(self):
        return {str(path.relative_to(self.folder)): path.read_bytes() for path in sorted((self.folder / "out").rglob("*")) if path.is_file()}

    def test_a_calibration_comes_back_and_what_was_there_stays_beside(self):
        before = self.content()
        self.invar("backup", self.cell, "--out", self.file)
        self.assertEqual(self.file.stat().st_mode & 0o777, 0o640)
        self.assertEqual(self.invar("backup", self.cell, "--out", "-").stdout, self.file.read_bytes())
        out = self.folder / "by tar"
        out.mkdir()
        subprocess.run(["tar", "-xf", self.file, "-C", out], check=True)
        subprocess.run(["sha256sum", "-c", "--quiet", "--strict", "SHA256SUMS"], cwd=out, check=True)
        self.assertEqual((out / "data/out/xy-table/state/deep/binary").read_bytes(), bytes(range(256)) * 7)
        self.assertEqual((out / "cell" / "xy-table.yaml").read_text(), self.cell.read_text())
        self.assertTrue((out / "cell" / "machines" / "xy-table-nominal.yaml").exists())

        shutil.rmtree(self.state / "deep")
        (self.state / "models.yaml").write_text("other\n")
        self.invar("restore", self.cell, self.file)
        now = self.content()
        self.assertEqual({name: text for name, text in now.items() if ".before" not in name}, before)
        self.assertEqual(now["out/xy-table/state.before/models.yaml"], b"other\n")
        shutil.rmtree(self.folder / "out")
        self.invar("restore", self.cell, "-", input=self.file.read_bytes())
        self.assertEqual(self.content(), before)
        self.assertFalse(list(self.folder.rglob("*.restored")))

    def test_whatever_is_not_this_cells_backup_changes_nothing(self):
        self.invar("backup", self.cell, "--out", self.file)
        good = self.file.read_bytes()
        before = self.content()
        (self.state / "models.yaml").write_text("newer\n")
        after = self.content()

        def archive(members, **changes):
            out = io.BytesIO()
            with tarfile.open(fileobj=out, mode="w", format=tarfile.USTAR_FORMAT) as tar:
                for name, text in members:
                    info = tarfile.TarInfo(name)
                    info.size = len(text)
                    for key, value in changes.items():
                        setattr(info, key, value)
                    tar.addfile(info, io.BytesIO(text))
            return out.getvalue()
        cuts = {f"cut at {at}": good[:at] for at in (0, 1, 511, 512, 700, 5000, len(good) - 1024)}
        flips = {f"flipped at {at}": good[:at] + bytes([good[at] ^ 1]) + good[at + 1:] for at in range(0, len(good), len(good) // 40)}
        odd = {"out of the archive": archive([("SHA256SUMS", b""), ("../../etc/x", b"")]),
               "a link": archive([("SHA256SUMS", b"")], type=tarfile.SYMTYPE, linkname="/etc/passwd"),
               "no sums": archive([("BACKUP", b"invar_backup: 1\n")]), "text": b"invar\n" * 400}
        for what, data in {**cuts, **flips, **odd}.items():
            with self.subTest(what):
                self.file.write_bytes(data)
                said = self.invar("restore", self.cell, self.file, status=2).stderr.decode()
                self.assertIn("backup", said)
                self.assertEqual(said.count("\n"), 1)
                self.assertEqual(self.content(), after)
        self.file.write_bytes(good)
        other = self.folder / "deployment" / "other.yaml"
        other.write_text(self.cell.read_text().replace("name: xy_table", "name: other"))
        self.assertIn(b"is a backup of another cell", self.invar("restore", other, self.file, status=2).stderr)
        moved = self.folder / "deployment" / "moved.yaml"
        moved.write_text(self.cell.read_text().replace("state: out/xy-table/state", "state: elsewhere"))
        self.assertIn(b"this cell keeps nothing there", self.invar("restore", moved, self.file, status=2).stderr)
        self.assertIn(b"is no folder", self.invar("restore", self.cell, self.file, "--data", "nowhere", status=2).stderr)
        self.assertEqual(self.content(), after)
        self.assertNotEqual(before, after)

    def test_a_cell_that_runs_is_left_alone_but_backed_up(self):
        shutil.rmtree(self.state)
        running = subprocess.Popen([INVAR, "run", self.cell, "--real-time", "--quiet"], cwd=self.folder, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        try:
            self.assertEqual(self.invar("status", self.cell, "--wait", "40").returncode, 0)
            self.invar("backup", self.cell, "--out", self.file)
            self.assertIn(b"runs already on this PC", self.invar("restore", self.cell, self.file, status=2).stderr)
        finally:
            running.send_signal(signal.SIGINT)
            running.wait(60)

    def test_a_restore_that_is_killed_leaves_the_old_folder_or_the_new(self):
        self.invar("backup", self.cell, "--out", self.file)
        old, new = b"older\n", (self.state / "models.yaml").read_bytes()
        began = time.monotonic()
        self.invar("restore", self.cell, self.file)
        takes = time.monotonic() - began
        for i in range(12):
            shutil.rmtree(self.state)
            self.state.mkdir()
            (self.state / "models.yaml").write_bytes(old)
            running = subprocess.Popen([INVAR, "restore", self.cell, self.file], cwd=self.folder, stdout=subprocess.DEVNULL)
            time.sleep(takes * (0.3 + i / 12))
            running.kill()
            running.wait()
            seen = {path.name: path.read_bytes() for path in self.state.rglob("*") if path.is_file()}
            if seen != {"models.yaml": old}:
                self.assertEqual((sorted(seen), seen["models.yaml"]), (["binary", "empty", "models.yaml"], new))


if __name__ == "__main__":
    unittest.main(verbosity=2)
