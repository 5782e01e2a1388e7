import os
import pathlib
import subprocess
import sys
import tempfile
import time
import unittest

from campaigns import run


class Processes(unittest.TestCase):
    def test_memory_and_its_peak(self):
        block = bytearray(os.urandom(1)) * 60_000_000
        with_block = run.memory_mb(os.getpid())
        del block
        self.assertGreater(with_block - run.memory_mb(os.getpid()), 50.0)
        # The kernel counts pages in batches.
        self.assertAlmostEqual(run.memory_mb(os.getpid(), "VmHWM"), with_block, delta=2.0)

    def test_descriptors_are_those_that_are_open(self):
        before = run.descriptors(os.getpid())
        with open("/dev/null"), open("/dev/null"):
            self.assertEqual(run.descriptors(os.getpid()), before + 2)

    def test_processor_time_is_what_the_kernel_told_the_process(self):
        end = time.process_time() + 0.3
        while time.process_time() < end:
            pass
        self.assertAlmostEqual(run.processor_s(os.getpid()), time.process_time(), delta=0.05)
        threads = run.thread_times_s(os.getpid())
        self.assertEqual(threads[0][0], os.getpid())
        self.assertAlmostEqual(sum(spent for _, _, spent in threads), time.process_time(), delta=0.05)

    def test_of_a_process_that_is_gone_nothing_is_told(self):
        gone = subprocess.Popen(["true"])
        gone.wait()
        for tell in (run.memory_mb, run.descriptors, run.processor_s):
            self.assertIsNone(tell(gone.pid))

    def test_what_is_printed_and_what_is_said_go_apart(self):
        with tempfile.TemporaryDirectory() as folder:
            log, output = pathlib.Path(folder) / "log", pathlib.Path(folder) / "out"
            self.assertEqual(run.run_logged(["sh", "-c", "echo said >&2; echo printed; exit 3"], log, output=output), 3)
            self.assertEqual((log.read_text(), output.read_text()), ("said\n", "printed\n"))
            self.assertEqual(run.run_logged(["sh", "-c", "echo said >&2; echo printed"], log), 0)
            self.assertEqual(log.read_text(), "said\nprinted\n")

    def test_a_program_that_runs_is_stopped(self):
        with tempfile.TemporaryDirectory() as folder:
            process = run.start_logged(["sleep", 100], pathlib.Path(folder) / "log")
            run.stop(process)
            self.assertEqual(process.returncode, -15)

    def test_a_failure_is_told_in_a_sentence(self):
        self.assertEqual(run.ending("x", lambda: None), 0)
        self.assertEqual(run.ending("x", lambda: 2), 2)

        def fails():
            raise run.Failed("this went wrong")

        with self.subTest("on stderr"):
            done = subprocess.run([sys.executable, "-B", "-c", "import sys\nfrom campaigns import run\n\n"
                                   "def fails():\n    raise run.Failed('this went wrong')\n\n"
                                   "sys.exit(run.ending('soak', fails))"], capture_output=True, text=True)
            self.assertEqual((done.returncode, done.stderr), (1, "soak: this went wrong\n"))


if __name__ == "__main__":
    unittest.main()
