#!/usr/bin/env python3
"""A secured cell and its bridge to a plant, deployed to two PCs with systemd: each has the private keys of its own names and no other;
nobody without a certificate reads or commands it; the plant gets its topic; renewed and revoked keys take effect by `invar deploy`.
One of the PCs is reached as a user who may use sudo.

Usage: secured_deploy_test.py INVAR SOURCE_FOLDER
As root; tests/cell/pcs.py makes the PCs.
"""
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

INVAR = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE = pathlib.Path(sys.argv.pop(1)).resolve()
sys.path[:0] = [str(SOURCE / "tests"), str(SOURCE / "tests" / "cell")]
import pcs  # noqa: E402
import tutorials  # noqa: E402  (numbers that no other test holds)

CELL = """invar_cell: 1
name: guarded
domain: {domain}
profiles: profiles.yaml
security: {{keys: keys, operators: [anna], viewers: [wall]}}
hosts:
  pc-a: {{address: 10.81.0.11}}
  pc-b: {{address: 10.81.0.12, ssh: {{user: admin}}}}
processes:
  heat:
    host: pc-a
    rate: 20
    components:
      heater: {{type: simulated_heater, map: heater.yaml, port: 1502}}
      thermal: {{type: thermal, setpoint: 30, modbus: {{port: 1502, map: heater.yaml}}}}
  watch: {{host: pc-b, rate: 10, components: {{supervisor: {{type: supervisor, timeout: 10}}}}}}
bridge:
  domain: {plant}
  host: pc-b
  out: [{{port: thermal.state, topic: line1/heat, rate: 10}}]
"""
HOME, ELSEWHERE = "/opt/invar/guarded", "/srv/elsewhere"


class SecuredAndDeployed(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.pcs = pcs.Pcs(("pc-a", "pc-b"))
        cls.addClassCleanup(cls.pcs.end)
        pcs.run("ip", "-n", cls.pcs.switch, "link", "set", "lo", "up")  # programs of people stand at the switch
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="invar-secured-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        for file in ("profiles.yaml", "maps/heater.yaml"):
            shutil.copy(SOURCE / "deployment" / file, cls.folder)
        cls.domain = tutorials.claim("domain", 101, 1, 49)
        cls.plant = cls.domain + 50
        cls.cell = cls.folder / "cell.yaml"
        cls.cell.write_text(CELL.format(domain=cls.domain, plant=cls.plant))

    def invar(self, *words, status=0, timeout=200):
        """At the switch, where a program of the plant stands, too."""
        done = subprocess.run(self.pcs.at_the_switch(INVAR, *words), capture_output=True, text=True, timeout=timeout)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done.stdout

    def deploy(self):
        return self.invar("deploy", self.cell, "--ssh-config", self.pcs.folder / "ssh_config")

    def pid(self, process):
        host = "pc-a" if process == "heat" else "pc-b"
        return self.pcs.on(host, f"pgrep -f -- '[-]-process {process}'", check=False).stdout.strip()

    def main(self, host):
        return self.pcs.on(host, "systemctl show -P MainPID invar-guarded").stdout.strip()

    def files(self, host):
        return set(self.pcs.on(host, f"cd {HOME}/keys && find . -name key.pem").stdout.split())

    def test_from_bare_pcs_to_a_renewed_and_a_revoked_key(self):
        self.invar("keys", self.cell)
        began = time.monotonic()
        self.assertIn("pc-a: has other keys now", self.deploy())
        print(f"first deployment: {time.monotonic() - began:.1f} s", file=sys.stderr)
        self.keys_lie_where_they_belong()
        self.the_plant_gets_its_topic_and_nobody_else_anything()

        owners = self.pcs.on("pc-b", f"stat -c %U {HOME} {HOME}/current {HOME}/data {HOME}/keys").stdout.split()
        self.assertEqual(owners, ["admin", "admin", "invar", "root"])

        heat, main = self.pid("heat"), self.main("pc-a")
        said = self.deploy()
        self.assertIn("pc-a: has its keys", said)
        self.assertIn("current on all of them already", said)
        self.assertEqual((self.pid("heat"), self.main("pc-a")), (heat, main), "nothing has changed")

        self.invar("keys", self.cell, "--renew", "heat")
        self.a_folder_that_leads_elsewhere_is_refused()
        self.plant_links_and_rights_of_another()
        said = self.deploy()
        self.assertIn("pc-a: has other keys now", said)
        self.assertEqual(self.pcs.on("pc-a", f"ls -A {ELSEWHERE}").stdout, "", "a link leads no key elsewhere")
        self.keys_lie_where_they_belong()
        end = time.monotonic() + 20
        while self.pid("heat") in ("", heat) and time.monotonic() < end:
            time.sleep(0.3)
        self.assertNotIn(self.pid("heat"), ("", heat))
        self.assertEqual(self.main("pc-a"), main, "`invar run` goes on")

        shutil.copytree(self.folder / "keys", self.folder / "thief-keys")
        thief = self.folder / "thief.yaml"
        thief.write_text(self.cell.read_text().replace("keys: keys", "keys: thief-keys"))
        self.invar("status", thief, "--as", "anna", "--wait", "20")
        self.invar("keys", self.cell, "--revoke", "anna", "--renew", "anna")
        self.deploy()
        time.sleep(2)
        self.invar("param", "set", thief, "thermal", "setpoint", "77", "--as", "anna", "--wait", "3", status=1)
        self.assertIn("30", self.invar("param", "get", self.cell, "thermal", "setpoint", "--as", "anna", "--wait", "20"))

    def a_folder_that_leads_elsewhere_is_refused(self):
        """And nothing is written there."""
        folder, moved = f"{HOME}/keys/heat", "/srv/heat"
        self.pcs.on("pc-a", f"mv {folder} {moved} && ln -s {moved} {folder}")
        files = lambda: self.pcs.on("pc-a", f"stat -c '%U %Y' {moved} {moved}/*").stdout
        before = files()
        refused = subprocess.run(self.pcs.at_the_switch(INVAR, "deploy", self.cell, "--ssh-config", self.pcs.folder / "ssh_config"),
                                 capture_output=True, text=True, timeout=200)
        said = refused.stderr + refused.stdout
        self.assertNotEqual(refused.returncode, 0)
        self.assertIn("keys/heat is a link: remove it there", said)
        self.assertNotIn("pc-a: has", said)
        self.assertEqual(files(), before)
        self.pcs.on("pc-a", f"rm {folder} && mv {moved} {folder}")

    def plant_links_and_rights_of_another(self):
        self.pcs.on("pc-a", f"mkdir {ELSEWHERE} && cd {HOME}/keys/heat && ln -s {ELSEWHERE} key.pem.new && ln -sfn {ELSEWHERE} permissions.p7s"
                            " && chmod 666 ../public/revoked.pem && chown invar ../public/revoked.pem")

    def keys_lie_where_they_belong(self):
        viewer = {"./wall/key.pem", "./wall/second/key.pem"}
        self.assertEqual(self.files("pc-a"), viewer | {"./heat/key.pem", "./launcher-pc-a/key.pem"})
        self.assertEqual(self.files("pc-b"), viewer | {"./watch/key.pem", "./launcher-pc-b/key.pem", "./bridge/key.pem"})
        for host in ("pc-a", "pc-b"):
            modes = self.pcs.on(host, f"find {HOME}/keys -name key.pem -exec stat -c '%a %U' {{}} +").stdout.splitlines()
            self.assertEqual(set(modes), {"600 invar"})
            files = self.pcs.on(host, f"find {HOME}/keys ! -type d -exec stat -c '%A %U %h %n' {{}} +").stdout.splitlines()
            for line in files:
                self.assertRegex(line, r"^-rw-r--r-- root 1 .*/public/|^-rw------- invar 1 ")
            folders = self.pcs.on(host, f"find {HOME}/keys -type d -exec stat -c '%A %U' {{}} +").stdout.splitlines()
            self.assertEqual(set(folders), {"drwxr-xr-x root", "drwxr-x--- root"}, "the service cannot lead root elsewhere")
            self.assertEqual(self.pcs.on(host, f"ls {HOME}/keys/authority; grep -rlI 'PRIVATE KEY' {HOME}/store {HOME}/releases --exclude-dir=keys",
                                         check=False).stdout, "", "no authority, and no key in a release")

    def the_plant_gets_its_topic_and_nobody_else_anything(self):
        self.assertEqual(self.pcs.on("pc-b", "systemctl is-active invar-guarded-bridge").stdout.strip(), "active")
        self.assertEqual(self.pcs.on("pc-a", "systemctl is-active invar-guarded-bridge", check=False).stdout.strip(), "inactive")
        shown = self.invar("echo", "--domain", self.plant, "--address", "10.81.0.1", "line1/heat", "--count", "1", "--wait", "20")
        self.assertIn("temperature", shown)
        self.invar("status", "--domain", self.domain, "--address", "10.81.0.1", "--wait", "3", status=1)
        self.invar("echo", "--domain", self.domain, "--address", "10.81.0.1", "cell/guarded/thermal/state", "--count", "1", "--wait", "3", status=1)


if __name__ == "__main__":
    unittest.main(verbosity=2)
