# Reads the IDL files as text and checks the rules that no generator checks: @final and stamp, units, bounds, keys.
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

FOLDER = pathlib.Path(sys.argv.pop(1))
SIZES = {"boolean": 1, "octet": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4, "int64": 8,
         "uint64": 8, "float": 4, "double": 8}
UNITS = {"1", "s", "m", "m/s", "m/s2", "m/s3", "A", "degC", "K/s", "W", "Hz", "Pa"}  # one spelling each (docs/explanation/architecture.md#units)
LOOP = {"stage", "sensing"}  # files whose types the loop writes: fixed size
LOOP_TYPES = {"AxisCorrection"}


class Member:
    def __init__(self, text):
        self.unit = (re.search(r'@unit\("([^"]*)"\)', text) or [None, None])[1]
        self.key = "@key" in text
        bare = re.sub(r'@\w+(\("[^"]*"\))?', "", text).strip()
        self.type, self.name, self.dimensions = re.fullmatch(r"(.+?)\s+(\w+)((?:\[\d+\])*)", bare).groups()


class Struct:
    def __init__(self, file, annotations, name, body):
        self.file, self.annotations, self.name = file, annotations, name
        self.members = [Member(" ".join(m.split())) for m in body.split(";") if m.strip()]


def read():
    structs, enums = [], []
    for file in sorted(FOLDER.glob("*.idl")):
        text = re.sub(r"//[^\n]*", "", file.read_text())
        for match in re.finditer(r"((?:@\w+\s+)*)struct\s+(\w+)\s*\{([^}]*)\}", text):
            structs.append(Struct(file.stem, match[1], match[2], match[3]))
        enums += re.findall(r"enum\s+(\w+)", text)
    return structs, enums


STRUCTS, ENUMS = read()


class Idl(unittest.TestCase):
    def every_member(self):
        for struct in STRUCTS:
            for member in struct.members:
                yield struct, member, f"{struct.file}.idl: {struct.name}.{member.name}"

    def test_there_is_something_to_check(self):
        self.assertGreater(len(STRUCTS), 20)

    def test_every_struct_is_final(self):
        for struct in STRUCTS:
            with self.subTest(struct=struct.name):
                self.assertIn("@final", struct.annotations)

    def test_every_real_member_has_a_unit_in_the_one_spelling_and_nothing_else_has(self):
        for _, member, place in self.every_member():
            if re.search(r"\b(double|float)\b", member.type):
                self.assertIn(member.unit, UNITS, place)
            else:
                self.assertIsNone(member.unit, place)

    def test_strings_and_sequences_are_bounded(self):
        for _, member, place in self.every_member():
            if "string" in member.type:
                self.assertRegex(member.type, r"string<\d+>", place)
            if "sequence" in member.type:
                self.assertRegex(member.type, r"sequence<\w+, \d+>", place)

    def test_types_of_the_loop_have_a_fixed_size(self):
        for struct, member, place in self.every_member():
            if struct.file in LOOP or struct.name in LOOP_TYPES:
                self.assertNotRegex(member.type, "string|sequence", place)

    def test_keys_are_numbers_of_at_most_16_bytes(self):
        for struct in STRUCTS:
            with self.subTest(struct=struct.name):
                keys = [m for m in struct.members if m.key]
                self.assertLessEqual(sum(SIZES[m.type] for m in keys), 16)
                self.assertTrue(all(m.dimensions == "" for m in keys))

    def test_every_type_with_a_key_is_stamped(self):
        for struct in STRUCTS:
            if any(m.key for m in struct.members) and struct.file != "lockstep":
                with self.subTest(struct=struct.name):
                    self.assertIn(("invar::base::Stamp", "at"), [(m.type, m.name) for m in struct.members])

    def test_no_member_is_named_like_a_type_in_another_case(self):
        types = {s.name.lower() for s in STRUCTS} | {e.lower() for e in ENUMS}
        for _, member, place in self.every_member():
            self.assertNotIn(member.name, types, place)
            self.assertRegex(member.name, r"^[a-z][a-z0-9_]*$", place)

    def test_what_cyclone_or_the_generators_cannot_read_is_absent(self):
        for file in FOLDER.glob("*.idl"):
            with self.subTest(file=file.name):
                text = re.sub(r"//[^\n]*", "", file.read_text())
                self.assertNotRegex(text, r"@mutable|@appendable|@optional|\bmap<|bitset|bitmask|wstring|struct \w+ :|\bconst\b")

    def test_cyclones_compiler_accepts_every_file(self):
        for file in FOLDER.glob("*.idl"):
            with self.subTest(file=file.name), tempfile.TemporaryDirectory() as output:
                run = subprocess.run(["idlc", "-o", output, "-I", FOLDER, file], capture_output=True, text=True)
                self.assertEqual(run.returncode, 0, run.stdout + run.stderr)


if __name__ == "__main__":
    unittest.main()
