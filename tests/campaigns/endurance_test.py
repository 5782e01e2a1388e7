import datetime
import io
import unittest

from campaigns import endurance

COUNTS = {"samples_lost": 0, "samples_refused": 0, "frames_dropped": 0, "bad_checksums": 0, "clock_resets": 0,
          "samples": 1000, "samples_late": 0}


def status(latency_ms=4.0, state="streaming", capture_lost=0, **counts):
    return {"devices": [{"name": "mtx1", "state": state, "latency_ms": latency_ms, **COUNTS, **counts}],
            "capture_lost": capture_lost, "threads": []}


def rows(lines, header="time_s,utc_s,counter,e_gyro_x_radps,regime"):
    return io.StringIO("\n".join([header, *lines]) + "\n")


def row(i, count=None, error="1e-3"):
    return f"{0.01 * i:.9f},{1.7e9 + 0.01 * i:.6f},{count if count is not None else 500 + i},{error},static"


class Times(unittest.TestCase):
    def test_the_year_ends_in_the_middle(self):
        self.assertEqual(endurance.begin_utc(7200), datetime.datetime(2016, 12, 31, 23, tzinfo=datetime.timezone.utc))


class Growth(unittest.TestCase):
    def test_what_fills_at_first_and_then_stands_is_fine(self):
        self.assertEqual(endurance.growth("memory", "MB", [10.0 * i for i in range(20)] + [200.0] * 40, 1.0).wrong, [])

    def test_what_grows_to_the_end_is_told(self):
        wrong = endurance.growth("memory", "MB", [100.0 + 0.2 * i for i in range(60)], 1.0).wrong
        self.assertEqual(wrong, ["memory grew by 2.0 MB in the last third"])

    def test_one_descriptor_more_is_one_too_many(self):
        self.assertEqual(endurance.grown([(100.0, 20)] * 50 + [(100.0, 21)] * 10).wrong,
                         ["descriptors grew by 1.0 open in the last third"])

    def test_nothing_measured_is_no_pass(self):
        self.assertEqual(len(endurance.grown([]).wrong), 2)


class Live(unittest.TestCase):
    def test_a_quiet_run_passes(self):
        self.assertEqual(endurance.live_devices([status()] * 30).wrong, [])

    def test_what_was_lost_while_a_device_was_set_up_does_not_count_what_followed_does(self):
        statuses = [status(state="configuring"), status(samples_lost=7), status(samples_lost=7)]
        self.assertEqual(endurance.live_devices(statuses).wrong, [])
        for count in endurance.COUNTS_LIVE:
            wrong = endurance.live_devices([status(), status(**{count: 2})]).wrong
            self.assertEqual(wrong, [f"mtx1: {count} 2"])

    def test_devices_that_never_stream_are_told(self):
        self.assertEqual(len(endurance.live_devices([status(state="opening")] * 3).wrong), 1)

    def test_a_queue_that_grows_is_told_a_drifting_beat_is_not(self):
        self.assertEqual(endurance.live_devices([status(2.0 + 9.0 * i / 30) for i in range(31)]).wrong, [])
        self.assertIn("latency grew", endurance.live_devices([status(2.0 + i) for i in range(31)]).wrong[0])

    def test_records_that_the_recorder_lost_are_told(self):
        self.assertEqual(endurance.live_devices([status(), status(capture_lost=3)]).wrong, ["the recorder lost 3 records"])

    def test_missing_rows_must_have_been_told(self):
        holed = [row(i) for i in range(20) if i not in (5, 6)]
        self.assertEqual(endurance.live_rows("mtx1", 2, rows(holed)).wrong, [])
        self.assertEqual(endurance.live_rows("mtx1", 1, rows(holed)).wrong, ["mtx1: 1 rows are missing that nobody tells of"])

    def test_rows_twice_are_told_even_where_as_many_are_missing(self):
        twice = [row(0), row(1), row(1), row(3)]
        self.assertEqual(len(endurance.live_rows("mtx1", 0, rows(twice)).wrong), 1)
        self.assertEqual(len(endurance.live_rows("mtx1", 0, rows([])).wrong), 1)


class Replay(unittest.TestCase):
    def wrong(self, lines, seconds=300.0):
        return endurance.replayed_rows("mtx1", rows(lines), seconds).wrong

    def test_rows_one_after_the_other_pass(self):
        self.assertEqual(self.wrong([row(i) for i in range(100)]), [])
        self.assertEqual(self.wrong([row(0, error=""), row(1)]), [])

    def test_a_count_left_out_is_told(self):
        self.assertEqual(len(self.wrong([row(0), row(1), row(3, count=502)])), 1)  # in time
        self.assertEqual(len(self.wrong([row(0), row(1), row(2, count=503)])), 1)  # in count
        self.assertEqual(len(self.wrong([row(0), row(1), row(1, count=502)])), 1)  # the same time twice

    def test_not_a_number_is_told(self):
        for text in ("nan", "inf", "-inf"):
            self.assertEqual(self.wrong([row(0), row(1, error=text)]), ["mtx1: not a number at 0.01 s"])

    def test_five_are_enough(self):
        self.assertEqual(len(self.wrong([row(i, error="nan") for i in range(50)])), endurance.TOLD_AT_MOST)

    def test_rows_that_end_early_are_told(self):
        self.assertEqual(self.wrong([row(i) for i in range(100)], seconds=301.0), [])
        self.assertEqual(self.wrong([row(i) for i in range(99)], seconds=301.0), ["mtx1 has 99 rows, at least 100 were to come"])

    def test_every_count_of_a_device_is_held(self):
        device = {"name": "gnss", "samples": 5, **dict.fromkeys(endurance.COUNTS_REPLAY, 0)}
        self.assertEqual(endurance.replayed_devices([device]).wrong, [])
        for count in endurance.COUNTS_REPLAY:
            self.assertEqual(endurance.replayed_devices([{**device, count: 4}]).wrong, [f"gnss: {count} 4"])


if __name__ == "__main__":
    unittest.main()
