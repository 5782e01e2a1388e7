"""Usage, in tests/: python3 -m campaigns.demo_test BIN     with the folder of the programs"""
import datetime
import pathlib
import subprocess
import sys
import tempfile
import tomllib
import unittest

from campaigns.demo import ROOT, TURNS_DEG, demo, toml, write

BIN = pathlib.Path(sys.argv.pop(1))
BEGIN = datetime.datetime(2016, 12, 31, 23, tzinfo=datetime.timezone.utc)


class Demo(unittest.TestCase):
    def test_unchanged_it_reads_as_the_file_does(self):
        self.assertEqual(tomllib.loads(toml(demo())), tomllib.loads((ROOT / "config" / "demo.toml").read_text()))

    def test_changes_are_where_they_belong_and_nowhere_else(self):
        changed = demo(ports="/run/x", duration_s=30, start_utc=BEGIN, with_priors=True)
        read = tomllib.loads(toml(changed))
        self.assertEqual([device["transport"]["port"] for device in read["device"]],
                         [f"/run/x/{device['name']}" for device in demo()["device"]])
        self.assertEqual((read["simulation"]["duration_s"], read["simulation"]["start_utc"]), (30.0, BEGIN))
        priors = {device["name"]: device["prior"]["rotation_vector_b_s_deg"] for device in read["device"] if "prior" in device}
        self.assertEqual(priors, TURNS_DEG)
        for device in read["device"]:
            device.pop("prior", None)
            device["transport"]["port"] = f"/tmp/imuscope-demo/{device['name']}"
        read["simulation"] |= {"duration_s": 900.0}
        del read["simulation"]["start_utc"]
        self.assertEqual(read, demo())

    def test_the_priors_hold_the_demos_truth(self):
        for imu in demo()["simulation"]["imu"]:
            for truth, prior in zip(imu["rotation_vector_b_s_deg"], TURNS_DEG[imu["name"]], strict=True):
                self.assertLess(abs(truth - prior), 3.0, imu["name"])

    def test_some_of_its_sensors(self):
        self.assertEqual([device["name"] for device in demo(studies=["mtx2"])["device"]], ["airins", "mtx2", "gnss"])
        self.assertEqual([imu["name"] for imu in demo(studies=["mtx2"])["simulation"]["imu"]], ["mtx2"])
        with self.assertRaisesRegex(ValueError, "no S-IMU mtx9"):
            demo(studies=["mtx9"])

    def test_text_that_has_to_be_escaped_comes_back(self):
        tables = {"a": {"text": 'q"uote\\ and\ttab', "yes": True, "numbers": [1, 2.5, -1e-9], "empty": []},
                  "list": [{"x": 1, "below": {"y": 2}}, {"x": 3}]}
        self.assertEqual(tomllib.loads(toml(tables)), tables)

    def test_the_programs_take_it(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "demo.toml"
            write(demo(ports=folder, with_priors=True, start_utc=BEGIN), file)
            for words in (["imuscope", "config", file], ["imusim", "record", file, "--minutes", "0.05", "--out", f"{folder}/drive"]):
                done = subprocess.run([BIN / words[0], *words[1:]], capture_output=True, text=True)
                self.assertEqual(done.returncode, 0, done.stderr)


if __name__ == "__main__":
    unittest.main()
