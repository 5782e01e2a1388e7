"""Usage, in tests/: python3 -m campaigns.vehicle_test BIN     with the folder of the programs"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

from campaigns.vehicle import KINDS, configuration

BIN = pathlib.Path(sys.argv.pop(1))


def checked(text):
    """The devices that imuscope reads out of a configuration: name to role and protocol."""
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "vehicle.toml"
        file.write_text(text)
        said = subprocess.run([BIN / "imuscope", "config", file], capture_output=True, text=True)
    if said.returncode != 0:
        raise AssertionError(said.stderr)
    return {words[0]: (words[1], words[2]) for words in map(str.split, said.stdout.splitlines()[1:])}


class Vehicle(unittest.TestCase):
    def test_every_kind_has_its_role_in_a_configuration_that_is_taken(self):
        for kind in KINDS:
            if kind.name == "wheels":  # its DBC is written by imusim beside the recording
                continue
            with self.subTest(kind.name):
                devices = checked(configuration([kind], "/dev/none", 30.0))
                self.assertEqual(devices[kind.key][0], kind.role)
                self.assertEqual(devices["by"][0], "study")
                self.assertEqual([role for role, _ in devices.values()].count("reference"), 1)
                self.assertEqual([role for role, _ in devices.values()].count("gnss"), 1)

    def test_kinds_go_together_and_the_bystander_may_stay_away(self):
        pair = [kind for kind in KINDS if kind.name in ("mti", "mtx")]
        devices = checked(configuration(pair, "/dev/none", 30.0, with_bystander=False))
        self.assertEqual(set(devices), {"airins", "mtx", "mti", "gnss"})

    def test_names_are_told_apart(self):
        self.assertEqual(len({kind.name for kind in KINDS}), len(KINDS))

    def test_what_a_message_costs_is_known_of_every_kind(self):
        for kind in KINDS:
            self.assertGreater(kind.rate, 0.0, kind.name)
            self.assertGreaterEqual(kind.group, 1, kind.name)
            self.assertEqual(kind.can, "can0" in kind.tables, kind.name)


if __name__ == "__main__":
    unittest.main()
