#!/usr/bin/env python3
"""How long `invar deploy` takes to three PCs without Invar, after one file has changed, and back; and what is left where it is killed.

Usage: deploy.py INVAR SOURCE_FOLDER [ROUNDS [KILLS]]
As root. The PCs are those of tests/cell/pcs.py: Debian's systemd and sshd in namespaces of this PC, joined by a bridge. A time runs
from the call to its end: sent, checked, started, all components active on all PCs. Beside it the same files by tar through ssh to
the three PCs at once, which checks and starts nothing. Kills are -9 for the call and its ssh, at random, without services.
"""
import pathlib
import random
import statistics
import subprocess
import sys
import tempfile
import time

INVAR, SOURCE = (pathlib.Path(word).resolve() for word in sys.argv[1:3])
ROUNDS, KILLS = (int(word) for word in (sys.argv[3:] + ["5", "30"][len(sys.argv) - 3:]))
sys.path[:0] = [str(SOURCE / "tests"), str(SOURCE / "tests" / "cell")]
import pcs  # noqa: E402
import tutorials  # noqa: E402

BARS = {"first deployment, bare PCs": 60, "one changed file": 10, "roll-back": 15}


def timed(*words):
    began = time.monotonic()
    subprocess.run([str(word) for word in words], check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - began


def change(file):
    file.write_text(file.read_text() + f"# {random.random()}\n")


class Bench:
    def __init__(self, machines, folder):
        self.machines, self.folder = machines, folder
        self.cell, self.map = pcs.plant(folder, SOURCE, tutorials.claim("domain", 101, 1, 99))

    def words(self, *more):
        return self.machines.at_the_switch(INVAR, "deploy", self.cell, "--ssh-config", self.machines.folder / "ssh_config", *more)

    def forget(self):
        for name in self.machines.names:
            self.machines.on(name, "systemctl stop invar-plant; rm -rf /opt/invar /etc/systemd/system/*invar*; systemctl daemon-reload")

    def by_tar(self):
        """The release of the first PC, as files, to all three."""
        release = self.folder / "release"
        if not release.exists():
            release.mkdir()
            with subprocess.Popen(self.machines.at_the_switch("ssh", "-F", self.machines.folder / "ssh_config", "10.81.0.11",
                                                              "tar -C /opt/invar/plant/current/ -cf - ."), stdout=subprocess.PIPE) as out:
                subprocess.run(["tar", "-xf", "-", "-C", release], stdin=out.stdout, check=True)
        one = "; ".join(f"tar -C {release} -cf - . | ssh -F {self.machines.folder}/ssh_config {address} "
                        "'mkdir -p /opt/copy && tar -C /opt/copy -xf - && sync -f /opt/copy' & copies=\"$copies $!\""
                        for address in self.machines.address.values())
        took = timed(*self.machines.at_the_switch("bash", "-ec", f"copies=; {one}; for c in $copies; do wait $c; done"))
        for name in self.machines.names:
            self.machines.on(name, "rm -rf /opt/copy")
        return took

    def times(self):
        seconds = {what: [] for what in (*BARS, "the same files by tar and ssh")}
        for _ in range(ROUNDS):
            self.forget()
            seconds["first deployment, bare PCs"].append(timed(*self.words()))
            seconds["the same files by tar and ssh"].append(self.by_tar())
            change(self.map)
            seconds["one changed file"].append(timed(*self.words()))
            seconds["roll-back"].append(timed(*self.words("--roll-back")))
        print("| three PCs | bar [s] | median [s] | longest [s] |\n| --- | --- | --- | --- |")
        for what, all_of_it in seconds.items():
            print(f"| {what} | {BARS.get(what, '-')} | {statistics.median(all_of_it):.1f} | {max(all_of_it):.1f} |")

    def releases(self):
        """The current one of each PC; None where it is not whole."""
        def one(name):
            said = self.machines.on(name, "cd /opt/killed/plant/current/ && sha256sum -c --quiet --strict MANIFEST && sha256sum <MANIFEST", check=False)
            return said.stdout[:16] if said.returncode == 0 else None
        return [one(name) for name in self.machines.names]

    def kills(self):
        files_only = ("--service", "none", "--prefix", "/opt/killed")
        subprocess.run(self.words(*files_only), check=True, stdout=subprocess.DEVNULL)
        change(self.map)
        takes = timed(*self.words(*files_only))
        count = dict.fromkeys(("old on all", "new on all", "whole, but not the same on all", "not whole", "not mended by the next call"), 0)
        for _ in range(KILLS):
            old = self.releases()
            change(self.map)
            call = subprocess.Popen(self.words(*files_only), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
            time.sleep(random.uniform(0.0, 1.1 * takes))
            subprocess.run(["kill", "-9", "--", f"-{call.pid}"], capture_output=True)
            call.wait()
            time.sleep(0.3)
            now = self.releases()
            count["not whole" if None in now else "old on all" if now == old else "new on all" if len(set(now)) == 1
                  else "whole, but not the same on all"] += 1
        subprocess.run(self.words(*files_only), check=True, stdout=subprocess.DEVNULL)
        now = self.releases()
        count["not mended by the next call"] += None in now or len(set(now)) != 1
        print("\n| killed at random | calls |\n| --- | --- |")
        for what, calls in count.items():
            print(f"| {what} | {calls} of {KILLS} |" if "mended" not in what else f"| {what} | {calls} of 1 |")


def main():
    machines = pcs.Pcs()
    try:
        with tempfile.TemporaryDirectory(prefix="invar-deploy-") as folder:
            bench = Bench(machines, pathlib.Path(folder))
            bench.times()
            bench.kills()
    finally:
        machines.end()


if __name__ == "__main__":
    main()
