"""Three PCs, each a network namespace at a switch, with addresses 10.81.0.11 to .13 and a /dev/shm of its own. Needs root."""
import os
import subprocess
import time


def run(*words):
    subprocess.run([str(word) for word in words], check=True, capture_output=True)


class Cables:
    """A network namespace for each name, at one switch, with addresses from 10.81.0.11 on."""

    def __init__(self, names):
        self.names = list(names)
        self.space = {name: f"invar-{name}-{os.getpid()}" for name in self.names}
        self.switch = f"invar-switch-{os.getpid()}"
        self.address = {name: f"10.81.0.{11 + i}" for i, name in enumerate(self.names)}

    def lay(self, own_address=None):
        """`own_address`: of the switch itself, for calls of the test from there."""
        run("ip", "netns", "add", self.switch)
        run("ip", "-n", self.switch, "link", "add", "name", "bridge", "type", "bridge", "mcast_snooping", "0")
        if own_address:
            run("ip", "-n", self.switch, "address", "add", own_address, "dev", "bridge")
        run("ip", "-n", self.switch, "link", "set", "bridge", "up")
        for name, space in self.space.items():
            run("ip", "netns", "add", space)
            run("ip", "-n", space, "link", "add", "cable", "type", "veth", "peer", "name", name, "netns", self.switch)
            run("ip", "-n", self.switch, "link", "set", name, "master", "bridge", "up")
            run("ip", "-n", space, "address", "add", f"{self.address[name]}/24", "dev", "cable")
            run("ip", "-n", space, "link", "set", "cable", "up")
            run("ip", "-n", space, "link", "set", "lo", "up")

    def take_away(self):
        for space in (*self.space.values(), self.switch):
            subprocess.run(["ip", "netns", "del", space], capture_output=True)


class Hosts(Cables):
    def __init__(self, names):
        super().__init__(names)
        self.is_cut = set()
        self.lay()
        time.sleep(2.0)  # the kernel says "up" before the first packets pass

    def words(self, name, *words):
        """The call of a program on that PC."""
        return ["ip", "netns", "exec", self.space[name], *[str(word) for word in words]]

    def start(self, name, *words, **more):
        """Starts a program with a /dev/shm of its own; it is the leader of a group."""
        shell = 'mount -t tmpfs tmpfs /dev/shm && exec "$@"'
        return subprocess.Popen(self.words(name, "unshare", "--mount", "bash", "-c", shell, "pc", *words), **more)

    def cut(self, name):
        """The switch passes nothing of it, which the PC itself does not see."""
        rule = (f"table bridge cut_{self.names.index(name)} {{ chain c {{ type filter hook forward priority 0; "
                f'iifname "{name}" drop; oifname "{name}" drop; }}; }}')
        run("ip", "netns", "exec", self.switch, "nft", rule)
        self.is_cut.add(name)

    def mend(self, name):
        run("ip", "netns", "exec", self.switch, "nft", "delete", "table", "bridge", f"cut_{self.names.index(name)}")
        self.is_cut.discard(name)

    def end(self):
        self.take_away()
