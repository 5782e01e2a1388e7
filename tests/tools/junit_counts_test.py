"""tools/support/junit_counts on what GoogleTest and CTest write."""
import pathlib
import subprocess
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "tools" / "support" / "junit_counts"

CTEST = """<?xml version="1.0" encoding="UTF-8"?>
<testsuite name="Linux" tests="5" failures="1" disabled="1" skipped="1">
  <testcase name="a" status="run"><system-out>fine</system-out></testcase>
  <testcase name="b" status="fail"><failure message=""/><system-out>x.cpp:3: Skipped
no reason of a skip</system-out></testcase>
  <testcase name="c" status="notrun"><skipped message=""/><system-out>x.cpp:9: Skipped
 promtool is missing
</system-out></testcase>
  <testcase name="d" status="disabled"/>
  <testcase name="e" status="run"/>
</testsuite>
"""
GOOGLE_TEST = """<?xml version="1.0" encoding="UTF-8"?>
<testsuites tests="3" failures="1"><testsuite name="S" tests="3" failures="1">
  <testcase name="A" status="run" result="completed"/>
  <testcase name="B" status="run" result="completed"><failure message="m"/><failure message="n"/></testcase>
  <testcase name="C" status="run" result="skipped"><skipped message="y.cpp:1&#x0A;beside"/></testcase>
</testsuite></testsuites>
"""


def run(text, *options):
    with tempfile.NamedTemporaryFile("w", suffix=".xml") as file:
        file.write(text)
        file.flush()
        return subprocess.run([SCRIPT, *options, file.name], capture_output=True, text=True)


class JunitCounts(unittest.TestCase):
    def test_counts_what_passed_failed_and_was_skipped(self):
        self.assertEqual(run(CTEST).stdout, "2 1 2\n")
        self.assertEqual(run(GOOGLE_TEST).stdout, "1 1 1\n")

    def test_names_each_reason_once_and_only_of_skipped_tests(self):
        self.assertEqual(run(CTEST, "--reasons").stdout.split("\n")[:2],
                         ["      1 promtool is missing", "      1 without a reason"])

    def test_says_what_it_cannot_read(self):
        done = run("<testsuite")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("junit_counts: ", done.stderr)


if __name__ == "__main__":
    unittest.main()
