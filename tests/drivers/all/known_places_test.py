"""Usage: known_places_test.py

drivers/README.md says in which files a driver is made known. Held against the drivers that are there: whoever knows one
of them by name, outside of what is its own, is named there; and the number that it gives is that of those it names.
"""
import pathlib
import re
import subprocess
import sys
import unittest

TREE = pathlib.Path(__file__).resolve().parent.parent.parent.parent
README = TREE / "drivers" / "README.md"
# Drivers of a stream that the simulator plays; with their enumerators.
DRIVERS = {"greis": "Greis", "nmea": "Nmea", "rtklib_pos": "RtklibPos", "ubx": "Ubx"}
# The product, its tests' lists, fuzzing and the far end; texts, campaigns and tests of something else may name a driver.
PLACES = re.compile(r"^(drivers/|src/|tools/CMakeLists\.txt$|tools/imuscope/|tests/drivers/(CMakeLists\.txt$|all/)|tests/fuzz/|"
                    r"firmware_sim/imusim/)")


def files_of_git():
    return subprocess.run(["git", "-C", TREE, "ls-files"], check=True, capture_output=True, text=True).stdout.splitlines()


def is_own(file, driver):
    return file.startswith(f"drivers/{driver}/") or pathlib.PurePosixPath(file).stem in (driver, f"{driver}_fuzz")


def known_places():
    """The files that know every driver by name: as a library, a word of the configuration or an enumerator."""
    places = set()
    for file in files_of_git():
        path = TREE / file
        if not PLACES.match(file) or file.endswith(".md") or path == pathlib.Path(__file__).resolve() or not path.exists():
            continue
        text = path.read_text(errors="replace")
        if all(is_own(file, driver) or re.search(rf"\b{driver}\b|\bk{enumerator}\b", text) for driver, enumerator in DRIVERS.items()):
            places.add(file)
    return places


class KnownPlaces(unittest.TestCase):
    def setUp(self):
        text = README.read_text()
        self.listed = re.search(r"files that know\s+a driver by name:\n\n(.*?)\n\n", text, re.S)
        self.assertIsNotNone(self.listed, "drivers/README.md lists no files that know a driver by name")
        self.named = set(re.findall(r"^- `([^`]+)`", self.listed[1], re.M))
        self.number = int(re.search(r"(\d+) files that know", text)[1])

    def test_whoever_knows_every_driver_is_named(self):
        places = known_places()
        self.assertTrue(places, "no file knows the drivers by name")
        self.assertEqual(sorted(places - self.named), [])

    def test_what_is_named_is_there_and_counted(self):
        self.assertEqual(self.number, len(self.named))
        for file in self.named:
            self.assertTrue((TREE / file).is_file(), file)


if __name__ == "__main__":
    unittest.main()
