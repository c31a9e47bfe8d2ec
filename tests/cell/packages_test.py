#!/usr/bin/env python3
"""The Debian packages: what is in them, and their life on a PC with systemd: installed, run as a service, upgraded beside the running
cell, purged.

Usage: packages_test.py BUILD_FOLDER SOURCE_FOLDER
As root; the PC is a set of namespaces above this PC's files (tests/support/systemd_pc.sh). For a PC with nothing on it:
tests/fault/bare_packages.sh.
"""
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

BUILD = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE = pathlib.Path(sys.argv.pop(1)).resolve()
sys.path[:0] = [str(SOURCE / "tests" / "cell")]
import pcs  # noqa: E402

CELL = """invar_cell: 1
name: packed
domain: 7
profiles: /usr/share/invar/deployment/profiles.yaml
hosts: {pc-a: {address: 127.0.0.1}}
processes:
  device:
    host: pc-a
    rate: 20
    components: {heater: {type: simulated_heater, map: /usr/share/invar/deployment/maps/heater.yaml, port: 15020}}
  supervisor:
    host: pc-a
    rate: 20
    components: {supervisor: {type: supervisor}}
"""


def run(*words):
    return subprocess.run([str(word) for word in words], check=True, capture_output=True, text=True).stdout


class Packages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="invar-packages-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        run("cpack", "--config", BUILD / "CPackConfig.cmake", "-B", cls.folder)
        cls.file = {run("dpkg-deb", "-f", file, "Package").strip(): file for file in cls.folder.glob("*.deb")}

    def test_each_holds_its_part_and_names_what_it_needs(self):
        self.assertEqual(sorted(self.file), ["invar-dev", "invar-runtime", "invar-tools", "invar-vision"])
        holds = {name: {line.split(maxsplit=5)[5] for line in run("dpkg-deb", "-c", file).splitlines()} for name, file in self.file.items()}
        needs = {name: run("dpkg-deb", "-f", file, "Depends") for name, file in self.file.items()}
        for name, part in {"invar-runtime": "./usr/bin/invar", "invar-vision": "./usr/lib/invar/libinvar_vision.so",
                           "invar-dev": "./usr/lib/cmake/invar/invar-config.cmake", "invar-tools": "./usr/share/doc/invar/README.md"}.items():
            self.assertIn(part, holds[name])
            self.assertEqual([other for other in holds if part in holds[other]], [name])
        self.assertIn("./usr/share/invar/deployment/profiles.yaml", holds["invar-runtime"])
        self.assertIn("./usr/include/invar/core/component/component.hpp", holds["invar-dev"])
        self.assertRegex(needs["invar-runtime"], r"libfastrtps2\.9 \(>=")
        self.assertNotIn("opencv", needs["invar-runtime"])
        self.assertIn("libopencv-imgproc", needs["invar-vision"])
        for name in ("invar-vision", "invar-dev", "invar-tools"):
            self.assertIn("invar-runtime (= ", needs[name])
        out = self.folder / "out"
        run("dpkg-deb", "-x", self.file["invar-runtime"], out)
        self.assertRegex(run(out / "usr/bin/invar", "--version"), r"^invar [0-9.]+$")
        self.assertIn("sound", run(out / "usr/bin/invar", "check", out / "usr/share/invar/deployment/xy-table.yaml"))

    def newer(self, package):
        """The same package under the next version."""
        folder = self.folder / f"{package}-newer"
        run("dpkg-deb", "-R", self.file[package], folder)
        control = folder / "DEBIAN" / "control"
        version = run("dpkg-deb", "-f", self.file[package], "Version").strip()
        control.write_text(control.read_text().replace(version, version + "+next"))
        run("dpkg-deb", "-b", folder, self.folder / f"{package}-newer.deb")
        return self.folder / f"{package}-newer.deb"

    def test_installed_run_upgraded_beside_a_running_cell_and_purged(self):
        pc = pcs.Pcs(names=("pc-a",), keep_libraries=True)
        self.addCleanup(pc.end)
        on = lambda command: pc.on("pc-a", command).stdout  # noqa: E731
        names = ("invar-runtime", "invar-tools")
        for name in names:
            pc.put("pc-a", self.file[name], f"/tmp/{name}.deb")
            pc.put("pc-a", self.newer(name), f"/tmp/{name}-newer.deb")
        on("dpkg -i /tmp/invar-runtime.deb /tmp/invar-tools.deb")
        self.assertRegex(on("invar --version"), r"^invar [0-9.]+$")
        self.assertTrue(on("getent passwd invar").startswith("invar:"))
        (self.folder / "cell.yaml").write_text(CELL)
        on("mkdir /etc/invar /srv/cell && chown invar: /srv/cell")
        pc.put("pc-a", self.folder / "cell.yaml", "/etc/invar/cell.yaml")
        on("invar units /etc/invar/cell.yaml --host pc-a --data /srv/cell --out /etc/systemd/system")
        on("systemctl daemon-reload && systemctl enable --now invar-packed && cd /srv/cell && invar status /etc/invar/cell.yaml --wait 30")
        main = on("systemctl show -P MainPID invar-packed").strip()

        on("dpkg -i /tmp/invar-runtime-newer.deb /tmp/invar-tools-newer.deb")
        self.assertIn("+next", on("dpkg-query -W -f '${Version}' invar-runtime"))
        children = set(on(f"pgrep -P {main}").split())
        on(f"kill -9 {min(children)}")
        end = time.monotonic() + 30
        while len(set(on(f"pgrep -P {main} || true").split()) - {min(children)}) < len(children):
            self.assertLess(time.monotonic(), end)
            time.sleep(0.2)
        self.assertEqual(on("systemctl show -P MainPID invar-packed").strip(), main, "the cell goes on")
        on("systemctl restart invar-packed && cd /srv/cell && invar status /etc/invar/cell.yaml --wait 30")

        on("systemctl disable --now invar-packed && rm /etc/systemd/system/invar-packed.service")
        on("dpkg --purge invar-tools invar-runtime")
        self.assertEqual(on("find /usr /etc /var/lib/dpkg/info -name '*invar*' ! -name '*invariant*' ! -path '/usr/lib/debug/*'").split(), ["/etc/invar"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
