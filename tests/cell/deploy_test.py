#!/usr/bin/env python3
"""`invar deploy` to three PCs, each with Debian's systemd as PID 1, sshd and none of Invar's libraries: started, changed, rolled back,
aborted, damaged, refused.

Usage: deploy_test.py INVAR SOURCE_FOLDER
As root. Each PC is a set of namespaces above this PC's files (tests/support/systemd_pc.sh); what they write goes with them.
"""
import pathlib
import random
import re
import shutil
import signal
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

def setUpModule():
    global PCS
    PCS = pcs.Pcs()
    unittest.addModuleCleanup(PCS.end)


class Deployed(unittest.TestCase):
    PREFIX = "/opt/invar"

    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="invar-deploy-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.cell, cls.map = pcs.plant(cls.folder, SOURCE, tutorials.claim("domain", 101, 1, 99))
        cls.text = cls.cell.read_text()

    def words(self, *more):
        prefix = [] if "--prefix" in more else ["--prefix", self.PREFIX]
        return PCS.at_the_switch(INVAR, "deploy", self.cell, "--ssh-config", PCS.folder / "ssh_config", *prefix, *more)

    def deploy(self, *more, status=0):
        done = subprocess.run(self.words(*more), capture_output=True, text=True, timeout=200)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done

    def home(self):
        return f"{self.PREFIX}/plant"

    def releases(self):
        """What is current on each PC; each is whole, file by file."""
        current = {}
        for name in PCS.names:
            said = PCS.on(name, f"cd {self.home()}/current && sha256sum -c --quiet --strict MANIFEST && readlink ../../current && "
                                "sha256sum <MANIFEST && find . -type f ! -name MANIFEST | wc -l && wc -l <MANIFEST", check=False)
            self.assertEqual(said.returncode, 0, said.stdout + said.stderr)
            link, manifest, files, lines = said.stdout.split("\n")[:4]
            self.assertEqual(link, f"releases/{manifest[:16]}")
            self.assertEqual(files, lines)
            current[name] = manifest[:16]
        return current

    def change_the_map(self):
        self.map.write_text(self.map.read_text() + f"# {random.random()}\n")


class WithSystemd(Deployed):
    def pids(self):
        return [PCS.on(name, "systemctl show -P MainPID invar-plant").stdout.strip() for name in PCS.names]

    def assert_well(self):
        for name in PCS.names:
            shown = PCS.on(name, "systemctl show -p ActiveState,SubState,User,Type,StatusText,WatchdogUSec invar-plant").stdout
            for line in ("ActiveState=active", "SubState=running", "User=invar", "StatusText=1 of 1 processes up", "WatchdogUSec=10s"):
                self.assertIn(line, shown, name)

    def test_three_bare_pcs_are_started_changed_rolled_back_and_restarted(self):
        self.a_first_release_that_cannot_start_leaves_nothing_behind()
        began = time.monotonic()
        said = self.deploy().stdout
        print(f"first deployment: {time.monotonic() - began:.1f} s", file=sys.stderr)
        first = self.releases()
        self.assertEqual(len(set(first.values())), 1, said)
        self.assert_well()
        owners = PCS.on("pc-b", f"stat -c %U {self.home()}/data/out/recording.mcap && ps -o user= -C invar").stdout.split()
        self.assertEqual(set(owners), {"invar"})
        self.assertIn("cell `plant` runs device", PCS.on("pc-a", "journalctl -u invar-plant -o cat").stdout)
        limits = PCS.on("pc-a", "systemctl show -p LimitRTPRIO,LimitMEMLOCK invar-plant").stdout
        self.assertEqual(sorted(limits.split()), ["LimitMEMLOCK=infinity", "LimitRTPRIO=10"])
        self.assertEqual(PCS.on("pc-c", "systemctl is-enabled invar-plant", check=False).stdout.strip(), "enabled")
        self.assertIn("invar-plant.service", PCS.on("pc-c", "systemctl list-dependencies --plain multi-user.target").stdout)

        pids = self.pids()
        self.assertIn("current on all of them already", self.deploy().stdout)
        self.assertEqual(self.pids(), pids, "what has not changed goes on")

        self.change_the_map()
        began = time.monotonic()
        said = self.deploy().stdout
        print(f"one changed file: {time.monotonic() - began:.1f} s", file=sys.stderr)
        self.assertEqual(len(re.findall(": 1 files to send", said)), 3, said)
        second = self.releases()
        self.assertNotEqual(second, first)
        self.assert_well()
        self.assertTrue(all(old != new for old, new in zip(pids, self.pids())))

        began = time.monotonic()
        self.deploy("--roll-back")
        print(f"roll-back: {time.monotonic() - began:.1f} s", file=sys.stderr)
        self.assertEqual(self.releases(), first)
        self.assert_well()
        self.assertIn(f"pc-b: current {first['pc-b']}, before {second['pc-b']}", self.deploy("--show").stdout)

        self.calibrations_come_back()
        self.a_release_that_cannot_start_is_taken_back(first)
        self.a_process_that_hangs_is_restarted()
        self.a_pc_is_replaced()

    def a_first_release_that_cannot_start_leaves_nothing_behind(self):
        self.cell.write_text(self.text.replace("port: 15020", "port: 80"))
        self.deploy("--patience", "4", status=1)
        self.cell.write_text(self.text)
        self.assertEqual(self.deploy("--show").stdout.count(": current -, before -\n"), 3)
        for name in PCS.names:
            self.assertEqual(PCS.on(name, f"ls {self.home()}/current /etc/systemd/system/invar-plant.service; pgrep invar", check=False).stdout, "")

    def deployed(self, *words, status=0):
        remote = ("--deployed", "--ssh-config", PCS.folder / "ssh_config")
        done = subprocess.run(PCS.at_the_switch(INVAR, *words, *remote), capture_output=True, text=True, timeout=200)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done.stderr

    def calibrations_come_back(self):
        models = f"{self.home()}/data/out/models"
        PCS.on("pc-a", f"mkdir -p {models} && echo good >{models}/x.yaml && chown -R invar: {models}")
        file = self.folder / "backup.tar"
        self.deployed("backup", self.cell, "--out", file)
        PCS.on("pc-a", f"echo bad >{models}/x.yaml")
        pid = self.pids()[0]
        damaged = self.folder / "damaged.tar"
        damaged.write_bytes(file.read_bytes().replace(b"good", b"evil"))
        self.assertIn("is no backup of Invar, or was cut or changed", self.deployed("restore", self.cell, damaged, status=2))
        self.assertEqual(self.pids()[0], pid, "it goes on")
        self.deployed("restore", self.cell, file)
        self.assertEqual(PCS.on("pc-a", f"cat {models}/x.yaml; stat -c %U {models} {models}/x.yaml").stdout.split(), ["good", "invar", "invar"])
        current = f"{self.home()}/current"
        PCS.on("pc-a", f"LD_LIBRARY_PATH={current}/lib {current}/bin/invar status {current}/\"$(cat {current}/CELL)\" --wait 30")
        self.assert_well()

    def a_release_that_cannot_start_is_taken_back(self, first):
        self.cell.write_text(self.text.replace("port: 15020", "port: 80"))  # the check finds no fault; the user may not
        said = self.deploy("--patience", "8", status=1)
        self.assertIn("pc-a (10.81.0.11): ", said.stderr)
        self.assertIn("each PC gets back what it had", said.stdout)
        self.assertEqual(self.releases(), first)
        self.assert_well()
        self.cell.write_text(self.text)

    def a_process_that_hangs_is_restarted(self):
        launcher = self.pids()[0]
        child = PCS.on("pc-a", f"pgrep -P {launcher}").stdout.strip()
        PCS.on("pc-a", f"kill -STOP {child}")
        end = time.monotonic() + 30
        while PCS.on("pc-a", f"pgrep -P {launcher}", check=False).stdout.strip() in ("", child):
            self.assertLess(time.monotonic(), end)
            time.sleep(0.3)
        self.assertEqual(self.pids()[0], launcher, "only that process ended")
        PCS.on("pc-a", f"kill -STOP {launcher}")
        end = time.monotonic() + 40
        while self.pids()[0] in ("0", launcher):
            self.assertLess(time.monotonic(), end, "systemd ends an `invar run` that hangs")
            time.sleep(0.5)

    def a_pc_is_replaced(self):
        """As docs/how-to/deploy-a-cell.md#replace-a-pc says it."""
        models, file = f"{self.home()}/data/out/models", self.folder / "before.tar"
        self.deploy()
        release = self.releases()
        self.deployed("backup", self.cell, "--out", file)
        PCS.on("pc-b", f"mkdir -p {models} && echo since >{models}/y.yaml && chown -R invar: {models}")
        PCS.on("pc-c", f"cd {self.home()} && now=$(readlink current) && ln -sfn $(readlink previous) current && "
                       "systemctl restart invar-plant && ln -sfn $now current")  # as a call leaves it that was cut off
        program = "readlink /proc/$(systemctl show -P MainPID invar-plant)/exe"
        self.assertNotIn(release["pc-c"], PCS.on("pc-c", program).stdout)
        PCS.replace("pc-a")
        current = f"readlink {self.home()}/current; systemctl show -P MainPID invar-plant"
        others = [PCS.on(name, current).stdout for name in ("pc-b", "pc-c")]
        PCS.wait_until_it_answers("pc-a")
        self.assertRegex(self.deploy(status=1).stderr, r"pc-a \(10.81.0.11\): ssh: Host key verification failed")
        self.assertEqual([PCS.on(name, current).stdout for name in ("pc-b", "pc-c")], others, "they go on")

        PCS.trust("pc-a")
        said = self.deploy().stdout
        self.assertRegex(said, r"pc-a: [1-9]\d* files to send, .*; current -")
        for name in ("pc-b", "pc-c"):
            self.assertIn(f"{name}: 0 files to send", said)
        self.assertEqual(self.releases(), release)
        self.assertEqual(PCS.on("pc-b", current).stdout, others[0], "it went on")
        self.assertEqual(PCS.on("pc-c", program).stdout.strip(), f"{self.home()}/releases/{release['pc-c']}/bin/invar")
        self.assert_well()
        self.assertIn("pc-a: the release before is -: there is none to go back to", self.deploy("--roll-back", status=1).stderr)

        self.assertIn("is no host of", self.deployed("restore", self.cell, file, "--host", "pc-d", status=2))
        self.deployed("restore", self.cell, file, "--host", "pc-a")
        pcs.run("ip", "-n", PCS.switch, "link", "set", "lo", "up")  # a DDS program stands at the switch
        subprocess.run(PCS.at_the_switch(INVAR, "status", self.cell, "--wait", "30"), check=True, stdout=subprocess.DEVNULL)
        self.assertEqual(PCS.on("pc-a", f"cat {models}/x.yaml; stat -c %U {models} {models}/x.yaml").stdout.split(), ["good", "invar", "invar"])
        self.assertEqual(PCS.on("pc-b", f"cat {models}/y.yaml").stdout, "since\n", "what the others calibrated since stays")
        self.assert_well()


class FilesOnly(Deployed):
    PREFIX = "/opt/files"

    def deploy(self, *more, status=0):
        return super().deploy("--service", "none", *more, status=status)

    def test_aborted_anywhere_each_pc_has_one_whole_release_and_the_next_call_mends(self):
        self.deploy()
        known = set(self.releases().values())
        changed = 0
        self.change_the_map()
        began = time.monotonic()
        self.deploy()
        known |= set(self.releases().values())
        takes = time.monotonic() - began
        for _ in range(6):
            self.change_the_map()
            before = self.releases()
            started = subprocess.Popen(self.words("--service", "none"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                       start_new_session=True)
            time.sleep(random.uniform(0.1 * takes, 1.1 * takes))
            subprocess.run(["kill", "-9", "--", f"-{started.pid}"], capture_output=True)
            started.wait()
            time.sleep(0.3)  # what was told to go goes
            after = self.releases()
            for name in PCS.names:
                if after[name] not in known:
                    changed += 1
            known |= set(after.values())
            self.assertTrue(len(set(after.values())) == 1, f"before {before}, after {after}")
        print(f"{changed // 3} of 6 aborted deployments were through", file=sys.stderr)
        self.deploy()
        self.assertEqual(len(set(self.releases().values())), 1)

    def test_a_pc_that_cannot_be_reached_leaves_all_as_they_are(self):
        self.deploy()
        before = self.releases()
        self.change_the_map()
        PCS.cable("pc-c", "down")
        said = self.deploy(status=1)
        PCS.cable("pc-c", "up")
        self.assertRegex(said.stderr, r"invar deploy: pc-c \(10.81.0.13\): ssh: .*timed out|No route to host")
        self.assertEqual(self.releases(), before)

    def test_what_was_damaged_on_a_pc_is_mended(self):
        self.deploy()
        whole = self.releases()
        for damage in ("cells/profiles.yaml", "maps/heater.yaml"):
            PCS.on("pc-b", f"echo '#' >>{self.home()}/current/cell/{damage}")
        PCS.on("pc-c", f"rm {self.home()}/current/cell/maps/heater.yaml {self.home()}/store/*.x")
        self.deploy()
        self.assertEqual(self.releases(), whole)

    def test_two_at_once_end_with_one_release(self):
        self.deploy()
        self.change_the_map()
        both = [subprocess.Popen(self.words("--service", "none"), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for _ in "ab"]
        said = [each.communicate(timeout=100) for each in both]
        self.assertEqual(len(set(self.releases().values())), 1, said)
        self.deploy()
        self.assertEqual(len(set(self.releases().values())), 1)

    def test_roll_back_needs_the_same_release_on_all(self):
        self.PREFIX = "/opt/fresh"
        self.deploy()
        self.assertIn("there is none to go back to", self.deploy("--roll-back", status=1).stderr)
        self.change_the_map()
        self.deploy()
        PCS.on("pc-b", f"ln -sfn releases/0123456789abcdef {self.home()}/previous")
        self.assertIn("pc-b: the release before is 0123456789abcdef, on pc-a ", self.deploy("--roll-back", status=1).stderr)

    def test_what_cannot_be_is_refused_before_any_pc_is_asked(self):
        odd = {
            "is no absolute path of letters": ["--prefix", "opt"],
            "is no absolute path": ["--prefix", "/opt/$(reboot)"],
            "is no user": ["--user", "a;b"],
        }
        for expected, words in odd.items():
            with self.subTest(expected):
                said = self.deploy(*words, status=2)
                self.assertIn(expected, said.stderr)
        for expected, old, new in (("is no name", "user: root", "user: -oProxyCommand=touch"),
                                   ("has `;` at byte 11", "{address: 10.81.0.13}}", "{address: '10.81.0.13; reboot'}}"),
                                   ("which other PCs do not have", "../maps/heater.yaml", str(self.map)),
                                   ("has no address by which ssh reaches it", "pc-a: {address: 10.81.0.11}", "pc-a: {interface: lo}")):
            with self.subTest(expected):
                self.cell.write_text(self.text.replace(old, new))
                said = self.deploy(status=2)
                self.assertIn(expected, said.stderr)
        self.cell.write_text(self.text)

    def test_keys_of_a_secured_cell_stay_on_their_pc(self):
        self.PREFIX = "/opt/secured"
        self.cell.write_text(self.text + "security: {keys: secrets}\n")
        subprocess.run([INVAR, "keys", self.cell], check=True, stdout=subprocess.DEVNULL)
        self.deploy()
        for name in PCS.names:
            self.assertEqual(PCS.on(name, f"readlink {self.home()}/current/cell/cells/secrets").stdout.strip(), f"{self.home()}/keys")
            found = PCS.on(name, f"ls {self.home()}/current/cell/cells; grep -rlI 'PRIVATE KEY' {self.home()}/store", check=False)
            self.assertEqual(found.stdout.split("\n"), ["plant cell.yaml", "profiles.yaml", "secrets", ""])
        self.cell.write_text(self.text.replace("profiles: ", "security: {keys: ../../../keys}\nprofiles: "))
        self.assertIn("lies outside of the folders of the cell's files", self.deploy(status=2).stderr)
        self.cell.write_text(self.text)

    def test_names_of_files_are_letters_to_every_shell(self):
        maps = self.folder / "maps" / "a'b $(touch PWNED) `touch PWNED` %n \"c\" ;d.yaml"
        shutil.copy(self.map, maps)
        text = self.text.replace("../maps/heater.yaml", '"' + f"../maps/{maps.name}".replace('"', '\\"') + '"')
        self.cell.write_text(text)
        self.deploy()
        self.releases()
        found = PCS.on("pc-a", f"find / -xdev -name PWNED; ls {self.home()}/current/cell/maps").stdout
        self.assertEqual(found.strip(), maps.name)
        self.cell.write_text(self.text)


if __name__ == "__main__":
    unittest.main(verbosity=2)
