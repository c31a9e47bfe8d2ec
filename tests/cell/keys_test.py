"""`invar keys`: openssl, the independent truth, verifies every certificate, signature and revocation; rights follow from the deployment;
a second call keeps everything; wrong calls end with one line and status 2.

keys_test.py INVAR SOURCE_DIR"""
import hashlib
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

INVAR, SOURCE = (pathlib.Path(word).resolve() for word in sys.argv[1:3])
SECURITY = """security:
  keys: keys
  operators: [anna, ben]
  viewers: [wall]
  plant:
    mes: {reads: [stage_x.state, /plant/line/order], writes: [/plant/line/ready]}
"""


def fields(der: bytes):
    """The elements of one DER sequence: (tag, bytes with the head, content)."""
    found, at = [], 0
    while at < len(der):
        size, head = der[at + 1], 2
        if size & 0x80:
            head = 2 + (size & 0x7F)
            size = int.from_bytes(der[at + 2:at + head], "big")
        found.append((der[at], der[at:at + head + size], der[at + head:at + head + size]))
        at += head + size
    return found


def guid_octet(certificate: bytes) -> int:
    """First octet of the GUIDs of a participant with this certificate: DDS Security 1.1, 9.3.3."""
    to_be_signed = fields(fields(certificate)[0][2])[0][2]
    subject = fields(to_be_signed)[5][1]  # version, serial, algorithm, issuer, validity, subject
    return 0x80 | hashlib.sha256(subject).digest()[0] >> 1


class Keys(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="invar-keys-"))
        self.addCleanup(shutil.rmtree, self.folder)
        shutil.copytree(SOURCE / "deployment", self.folder / "cell")
        self.cell = self.folder / "cell" / "xy-table.yaml"
        self.cell.write_text(self.cell.read_text() + SECURITY)
        self.keys = self.folder / "cell" / "keys"
        self.public = self.keys / "public"

    def run_it(self, *words, status=0):
        done = subprocess.run([str(word) for word in words], cwd=self.folder, capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, status, f"{words}: {done.stdout}{done.stderr}")
        return done

    def make(self, *words):
        states = json.loads(self.run_it(INVAR, "keys", self.cell, "--json", *words).stdout)["keys"]
        return {state["name"]: state for state in states}

    def refused(self, expected, *words):
        said = self.run_it(INVAR, "keys", *words, status=2)
        self.assertEqual((said.stdout, said.stderr.count("\n")), ("", 1), said.stderr)
        self.assertIn(expected, said.stderr)

    def document(self, path):
        """The document that the authority of permissions signed; fails where the signature is not its own."""
        return self.run_it("openssl", "smime", "-verify", "-text", "-in", path, "-CAfile", self.public / "permissions_ca.pem").stdout

    def topics(self, name, kind):
        text = self.document(self.keys / name / "permissions.p7s")
        return set(re.findall("<topic>(.*?)</topic>", "".join(re.findall(f"<{kind}>.*?</{kind}>", text, re.S))))

    def is_good(self, name):
        return subprocess.run(["openssl", "verify", "-crl_check", "-CAfile", self.public / "identity_ca.pem", "-CRLfile",
                               self.public / "revoked.pem", self.keys / name / "certificate.pem"], capture_output=True).returncode == 0

    def test_makes_what_openssl_verifies(self):
        states = self.make()
        names = {"motion", "heat", "calibration", "recorder", "supervisor", "launcher-stage-pc", "anna", "ben", "wall", "mes",
                 "recorder/second", "anna/second", "ben/second", "wall/second"}
        self.assertEqual(set(states), names)
        subjects = set()
        for name in names:
            self.assertTrue(self.is_good(name), name)
            certificate, key = self.keys / name / "certificate.pem", self.keys / name / "key.pem"
            self.assertEqual(key.stat().st_mode & 0o777, 0o600)
            self.assertEqual(self.run_it("openssl", "pkey", "-in", key, "-pubout").stdout,
                             self.run_it("openssl", "x509", "-in", certificate, "-noout", "-pubkey").stdout)
            subject = self.run_it("openssl", "x509", "-in", certificate, "-noout", "-subject", "-nameopt", "RFC2253").stdout
            subjects.add(subject)
            self.assertIn(f"<subject_name>{subject.removeprefix('subject=').strip()}</subject_name>",
                          self.document(self.keys / name / "permissions.p7s"))
            der = subprocess.run(["openssl", "x509", "-in", certificate, "-outform", "DER"], capture_output=True).stdout
            # A list of the revoked has serial numbers alone: each tells the subject, and so the GUIDs of its holder.
            to_be_signed = fields(fields(fields(der)[0][2])[0][2])
            self.assertEqual(to_be_signed[1][2], b"\x49" + hashlib.sha256(to_be_signed[5][1]).digest()[:16])
            octet = guid_octet(der)
            self.assertTrue(octet < 0xA0 if name == "mes" else octet == 0xFF, f"{name} {octet:x}")
        self.assertEqual(len(subjects), len(names))
        for key in ("identity_ca.key", "permissions_ca.key"):
            self.assertEqual((self.keys / "authority" / key).stat().st_mode & 0o777, 0o600)
        self.assertEqual((self.keys / "authority").stat().st_mode & 0o777, 0o700)
        rules = self.document(self.public / "governance.p7s")
        self.assertIn("<allow_unauthenticated_participants>false<", rules)
        self.assertIn("<id>71</id>", rules)
        # Each authority signs for itself alone.
        self.run_it("openssl", "smime", "-verify", "-in", self.public / "governance.p7s", "-CAfile", self.public / "identity_ca.pem", status=4)

    def test_rights_follow_from_the_deployment(self):
        self.make()
        own = {f"cell/xy_table/{port}" for port in ("stage_x/state", "world/tool", "laser/reading", "compensation/status")}
        motion = self.topics("motion", "publish")
        self.assertLessEqual(own, motion)
        self.assertFalse([topic for topic in motion if "thermal" in topic or "request" in topic or "*" in topic], motion)
        self.assertIn("cell/xy_table/thermal/state", self.topics("motion", "subscribe"))
        self.assertNotIn("cell/xy_table/stage_x/command", motion)
        self.assertIn("cell/xy_table/stage_x/command", self.topics("calibration", "publish"))
        self.assertIn("cell/xy_table/stage_x/command", self.topics("anna", "publish"))
        self.assertEqual(self.topics("wall", "publish"), set())
        self.assertIn("cell/xy_table/*", self.topics("wall", "subscribe"))
        self.assertEqual(self.topics("mes", "publish"), {"plant/line/ready"})
        self.assertEqual(self.topics("mes", "subscribe"), {"cell/xy_table/stage_x/state", "plant/line/order"})
        self.assertNotIn("cell/xy_table/process/lifecycle_request", self.topics("heat", "publish"))
        self.assertIn("cell/xy_table/process/lifecycle_request", self.topics("supervisor", "publish"))

    def test_keeps_renews_and_revokes(self):
        self.make()
        before = {path: path.read_bytes() for path in self.keys.rglob("*.pem")} | {
            path: path.read_bytes() for path in self.keys.rglob("*.key")}
        self.assertEqual({state["certificate"] for state in self.make().values()}, {"kept"})
        self.assertEqual(before, {path: path.read_bytes() for path in before})

        states = self.make("--renew", "motion", "--days", 30)
        self.assertEqual((states["motion"]["certificate"], states["heat"]["certificate"]), ("renewed", "kept"))
        changed = {path for path in before if path.read_bytes() != before[path]}
        self.assertEqual(changed, {self.keys / "motion" / "certificate.pem", self.keys / "motion" / "key.pem"})
        self.assertTrue(self.is_good("motion"))

        states = self.make("--revoke", "ben")
        self.assertEqual([states[name]["certificate"] for name in ("ben", "ben/second", "anna")], ["revoked", "revoked", "kept"])
        self.assertEqual([self.is_good(name) for name in ("ben", "ben/second", "anna", "motion")], [False, False, True, True])
        states = self.make("--renew", "ben")
        self.assertTrue(self.is_good("ben"))
        # Who left the file is kept out all the same.
        self.cell.write_text(self.cell.read_text().replace("[anna, ben]", "[anna]"))
        self.assertNotIn("ben", self.make("--revoke", "ben"))
        self.assertFalse(self.is_good("ben"))

    def test_rights_of_an_earlier_invar_are_said_all_at_once(self):
        self.make()
        for name in ("heat", "motion"):
            file = self.keys / name / "permissions.p7s"
            file.write_bytes(re.sub(rb" *<topic>cell/xy_table/(clock|process/notices)</topic>\r?\n", b"", file.read_bytes()))
        lines = self.run_it(INVAR, "run", self.cell, "--duration", "1", status=2).stderr.splitlines()
        self.assertEqual(len(lines), 2, lines)
        for name, line in zip(("motion", "heat"), lines):
            self.assertIn(f"keys/{name}/permissions.p7s: does not permit to write `cell/xy_table/clock`, `cell/xy_table/process/notices`, "
                          "and to read `cell/xy_table/clock`;", line)
            self.assertIn("`invar keys CELL` signs all anew", line)
        self.make()
        self.assertIn("cell/xy_table/clock", self.topics("heat", "publish"))

    def test_works_without_the_section(self):
        self.cell.write_text(self.cell.read_text().replace(SECURITY, ""))
        said = self.run_it(INVAR, "keys", self.cell).stdout
        self.assertIn("security: {keys: keys}", " ".join(said.split()))
        self.assertEqual(self.topics("viewer", "publish"), set())
        self.make("--out", self.folder / "elsewhere")
        self.assertTrue((self.folder / "elsewhere" / "operator" / "key.pem").exists())

    def test_refuses_in_one_line(self):
        self.refused("CELL is required", "--days", "3")
        self.refused("--days", self.cell, "--days", "0")
        self.refused("`motoin` is nobody of this cell; did you mean `motion`?", self.cell, "--renew", "motoin")
        self.refused("`anna` has no certificate in", self.cell, "--revoke", "anna")
        self.refused("cannot be read", self.folder / "no.yaml")
        (self.folder / "file").write_text("")
        self.refused("cannot be made", self.cell, "--out", self.folder / "file" / "keys")
        self.make()
        (self.public / "identity_ca.pem").rename(self.folder / "kept.pem")
        self.refused("identity_ca.pem: is not there, but its other half is", self.cell)
        (self.folder / "kept.pem").rename(self.public / "identity_ca.pem")
        (self.keys / "authority" / "permissions_ca.key").write_text("nothing")
        self.refused("permissions_ca.key: is no private key that can be read", self.cell)
        text = self.cell.read_text()
        for wrong, said in (("operators: [motion]", "`motion` is a process or a folder of the keys already"),
                            ("operators: [a, a]", "`a` stands here twice"),
                            ("viewers: ['a b']", "`a b` is no name"),
                            ("plant: {mes: {reads: ['/a/*']}}", "has a character that means many topics"),
                            ("plant: {mes: {reads: [stage_x.stat]}}", "`stage_x.stat` is no port of this cell"),
                            ("operator: [anna]", "operator")):
            self.cell.write_text(text.replace(SECURITY, f"security:\n  {wrong}\n"))
            self.refused(said, self.cell)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
