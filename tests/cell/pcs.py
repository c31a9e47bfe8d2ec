"""Three PCs of their own on this one for tests: Debian's systemd as PID 1 of each, sshd, a bridge between them (systemd_pc.sh)."""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
from three_hosts import Cables, run  # noqa: E402

BOOT = pathlib.Path(__file__).resolve().parent.parent / "support" / "systemd_pc.sh"

# A cell of three PCs whose parts need one another little.
PLANT = """invar_cell: 1
name: plant
domain: {domain}
profiles: profiles.yaml
hosts:
  pc-a: {{address: 10.81.0.11}}
  pc-b: {{address: 10.81.0.12, ssh: {{user: root, port: 22}}}}
  pc-c: {{address: 10.81.0.13, ssh: {{address: 10.81.0.13}}}}
  spare: {{address: 10.81.0.14}}
processes:
  device:
    host: pc-a
    realtime: {{rate: 20, priority: 10, lock_memory: true}}
    components: {{heater: {{type: simulated_heater, map: ../maps/heater.yaml, port: {port}}}}}
  recorder:
    host: pc-b
    rate: 20
    components: {{recorder: {{type: recorder, out: out}}}}
  supervisor:
    host: pc-c
    rate: 20
    components: {{supervisor: {{type: supervisor, timeout: 10}}}}
"""


def plant(folder, source, domain):
    """Writes the cell and what it names into a folder: the cell file, and a file that changes without a meaning."""
    for part in ("cells", "maps"):
        (folder / part).mkdir()
    shutil.copy(source / "deployment" / "profiles.yaml", folder / "cells")
    shutil.copy(source / "deployment" / "maps" / "heater.yaml", folder / "maps")
    cell = folder / "cells" / "plant cell.yaml"
    cell.write_text(PLANT.format(domain=domain, port=15020))
    return cell, folder / "maps" / "heater.yaml"


class Pcs(Cables):
    NAMES = ("pc-a", "pc-b", "pc-c")

    def __init__(self, names=NAMES, keep_libraries=False):
        super().__init__(names)
        self.environment = dict(os.environ, KEEP_LIBRARIES="1" if keep_libraries else "")
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="invar-pcs-"))
        self.started = {}
        self.gone = []
        try:
            self.lay("10.81.0.1/24")  # this program's own calls stand at the switch, too
            self.keys()
            self.boot()
        except BaseException:
            self.end()
            raise

    def keys(self):
        keys = self.folder / "keys"
        keys.mkdir()
        for name in ("host_key", "key"):
            run("ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", keys / name)
        known = (keys / "host_key.pub").read_text()
        (self.folder / "known").write_text("".join(f"{address} {known}" for address in self.address.values()))
        (self.folder / "ssh_config").write_text(
            f"User root\nIdentityFile {keys}/key\nIdentitiesOnly yes\nUserKnownHostsFile {self.folder}/known\n")

    def boot(self):
        for name in self.names:
            (self.folder / name).mkdir()
            shutil.copytree(self.folder / "keys", self.folder / name / "keys")
            self.start(name)
        for name in self.names:
            self.wait_for(name)

    def start(self, name):
        with open(self.folder / name / "log", "wb") as log:
            self.started[name] = subprocess.Popen([BOOT, self.folder / name, self.space[name], self.address[name]], stdout=log, stderr=log,
                                                  stdin=subprocess.DEVNULL, env=self.environment)

    def wait_for(self, name):
        end = time.monotonic() + 60
        while self.on(name, "systemctl is-active pc.target", check=False).stdout.strip() != "active":
            if time.monotonic() > end:
                raise SystemExit(f"{name} does not boot: {(self.folder / name / 'log').read_text()}")
            time.sleep(0.2)

    def replace(self, name):
        """Another PC at the same address: it has nothing of the old one, and another host key, which nobody knows before `trust`."""
        old = self.started.pop(name)
        self.gone.append(old)
        old.kill()
        old.wait()
        key = self.folder / name / "keys" / "host_key"
        key.unlink()
        key.with_suffix(".pub").unlink()
        run("ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", key)
        self.start(name)

    def wait_until_it_answers(self, name):
        """Its sshd listens, whether or not its key is known."""
        end = time.monotonic() + 60
        while not subprocess.run(self.at_the_switch("ssh-keyscan", "-T", "2", self.address[name]), capture_output=True).stdout:
            if time.monotonic() > end:
                raise SystemExit(f"{name} does not boot: {(self.folder / name / 'log').read_text()}")
            time.sleep(0.2)

    def trust(self, name):
        """As a person does who has compared the new host key."""
        known = self.folder / "known"
        run("ssh-keygen", "-R", self.address[name], "-f", known)
        with open(known, "a", encoding="utf-8") as file:
            file.write(f"{self.address[name]} {(self.folder / name / 'keys' / 'host_key.pub').read_text()}")
        self.wait_for(name)

    def at_the_switch(self, *words):
        return ["ip", "netns", "exec", self.switch, *[str(word) for word in words]]

    def on(self, name, command, check=True):
        return subprocess.run(self.at_the_switch("ssh", "-F", self.folder / "ssh_config", "-o", "BatchMode=yes", "-o", "ConnectTimeout=3",
                                                 self.address[name], command), check=check, capture_output=True, text=True,
                              stdin=subprocess.DEVNULL)

    def put(self, name, file, path):
        with open(file, "rb") as content:
            subprocess.run(self.at_the_switch("ssh", "-F", self.folder / "ssh_config", "-o", "BatchMode=yes", self.address[name], f"cat >'{path}'"),
                           check=True, stdin=content)

    def cable(self, name, state):
        run("ip", "-n", self.switch, "link", "set", name, state)

    def end(self):
        pcs = [*self.started.values(), *self.gone]
        for pc in pcs:
            pc.kill()
        for pc in pcs:
            pc.wait()
        self.take_away()
        groups = pathlib.Path(next(line.split()[1] for line in pathlib.Path("/proc/mounts").read_text().splitlines()
                                   if line.split()[2] == "cgroup2"))
        for pc in pcs:
            group = groups / f"invar-pc-{pc.pid}"
            for _ in range(50):  # until the kernel is done with the last process
                for folder, _, _ in os.walk(group, topdown=False):
                    try:
                        os.rmdir(folder)
                    except OSError:
                        pass
                if not group.exists():
                    break
                time.sleep(0.1)
        shutil.rmtree(self.folder, ignore_errors=True)
