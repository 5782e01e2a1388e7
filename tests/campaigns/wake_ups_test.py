import unittest

from campaigns import wake_ups

# As cyclictest 2.x prints it: two threads, 1,000 wake-ups.
CYCLICTEST = """# /dev/cpu_dma_latency set to 0us
# Histogram
000000 000000 000000
000004 000251 000250
000005 000240 000240
000060 000005 000004
010000 000003 000002
010001 000001 000001
020000 000001 000001
# Total: 000000499 000000499
# Min Latencies: 00004 00004
# Avg Latencies: 00004 00004
# Max Latencies: 50007 20000
# Histogram Overflows: 00001 00000
# Histogram Overflow at cycle number:
# Thread 0: 00017
"""
THREAD = {"ticks": 6000, "skipped": 1, "overruns": 0, "lateness_us": {"p50": 8.0, "p99": 90.0, "p99.9": 200.4, "max": 900.0},
          "done_us": {"p50": 300.0, "p99": 500.0, "p99.9": None, "max": 800.0}}
STATUS = {"threads": [{"name": "imuscope-est", **THREAD}, {"name": "imuscope-io", **THREAD}], "uptime_s": 60.0}
LOG = """12:00:00.100 [info] airins: serial:/x is open
12:00:01.600 [info] gnss: serial:/y is open
12:00:04.600 [info] navigation started from the R-IMU's own attitude
12:00:05.000 [info] mtx1: mounting found, residual 0.30 deg
12:00:05.600 [info] mtx1: converging
12:00:07.600 [info] mtx2: converging
12:00:09.000 [info] gnss: serial:/y is open
12:00:09.600 [info] mtx1: converging
"""


class Cyclictest(unittest.TestCase):
    def test_quantiles_over_both_threads(self):
        read = wake_ups.read_cyclictest(CYCLICTEST)
        self.assertEqual(read.samples, 1000)
        self.assertEqual(read.quantiles_us, {"p50": 4, "p99": 60, "p99.9": 20000})
        self.assertEqual(read.max_us, 50007)
        # 10 ms is not later than 10 ms; one beyond the histogram is.
        self.assertEqual(read.beyond, 2 + 2 + 1)

    def test_a_quantile_beyond_the_histogram_is_the_longest(self):
        read = wake_ups.read_cyclictest("000004 000001\n# Max Latencies: 70000\n# Histogram Overflows: 9\n")
        self.assertEqual(read.quantiles_us, {"p50": 70000, "p99": 70000, "p99.9": 70000})

    def test_no_wake_ups_are_an_error(self):
        with self.assertRaises(ValueError):
            wake_ups.read_cyclictest("# Histogram\n")


class Tables(unittest.TestCase):
    def setUp(self):
        self.cyclic = wake_ups.read_cyclictest(CYCLICTEST)

    def test_wake_ups(self):
        self.assertEqual(wake_ups.wake_up_table(self.cyclic, STATUS, 70)[2:],
                         ["| cyclictest, FIFO 70 | 4 | 60 | 20000 | 50007 |", "| estimator, FIFO 70 | 8 | 90 | 200 | 900 |",
                          "| I/O poll, FIFO 80 | 8 | 90 | 200 | 900 |",
                          "| from the tick's cut to the estimate in the ring | 300 | 500 | - | 800 |"])

    def test_ticks(self):
        self.assertEqual(wake_ups.ticks_table(self.cyclic, STATUS)[2], "| 6000 | 1 | 0 | 13 |")

    def test_costs(self):
        table = wake_ups.cost_table([(1, "imuscope", 0.6), (2, "imuscope-io", 1.2)], 60.0, 0.001)
        self.assertEqual(table[2:], ["| imuscope | 1.00 % |", "| imuscope-io | 2.00 % |", "| all | 3.00 % |",
                                     "| a thread of cyclictest, 100 wake-ups a second and nothing else | 0.10 % |"])

    def test_rows_for_the_bench(self):
        rows = wake_ups.bench_rows(self.cyclic, STATUS, "no load", 120.0)
        self.assertEqual(len(rows), 6)
        self.assertEqual((rows[1]["what"], rows[1]["ratio"], rows[1]["reference"]), ("estimator wakes, p99; no load", 1.5, 60))

    def test_a_thread_that_is_not_told_of_is_an_error(self):
        with self.assertRaisesRegex(ValueError, "imuscope-xyz"):
            wake_ups.thread_of(STATUS, "imuscope-xyz")


class Start(unittest.TestCase):
    def test_from_the_last_line_opened_before_navigation(self):
        navigation, estimated = wake_ups.starting_times(LOG, 2)
        self.assertAlmostEqual(navigation, 3.0)
        self.assertAlmostEqual(estimated, 6.0)

    def test_what_the_log_does_not_tell_is_not_told(self):
        self.assertEqual(wake_ups.starting_times(LOG, 3)[1], None)
        self.assertEqual(wake_ups.starting_times("", 1), (None, None))
        self.assertEqual(wake_ups.told(None), "not told")

    def test_past_midnight(self):
        log = "23:59:59.000 [info] a: x is open\n00:00:01.000 [info] navigation started from y\n"
        self.assertAlmostEqual(wake_ups.starting_times(log, 1)[0], 2.0)


if __name__ == "__main__":
    unittest.main()
