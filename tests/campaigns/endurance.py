"""What tools/soak judges: whether something grew, was lost or went wrong over hours."""
import csv
import dataclasses
import datetime
import math
import statistics

# Saturday, the last second of a GPS week, before a leap second (23:59:60 UTC), midnight and a new year.
LEAP_DAY_END = datetime.datetime(2017, 1, 1, tzinfo=datetime.timezone.utc)
# Steps of a row: a count of the S-IMU, and a hundredth of a second.
LONGEST_STEP_S = 0.011
TOLD_AT_MOST = 5
MEMORY_GROWS_MB = 1.0
# Lines are read at a beat of 10 ms, against which a device's clock drifts; a queue that grows does not stop there.
LATENCY_GROWS_MS = 10.0
COUNTS_LIVE = ("samples_lost", "samples_refused", "frames_dropped", "bad_checksums", "clock_resets")
COUNTS_REPLAY = ("samples_lost", "refused", "bad_checksums", "bad_contents", "bytes_skipped", "clock_resets")


@dataclasses.dataclass
class Verdict:
    """Sentences for a person: what was seen, and what of it is wrong."""
    seen: list = dataclasses.field(default_factory=list)
    wrong: list = dataclasses.field(default_factory=list)

    def add(self, other):
        self.seen += other.seen
        self.wrong += other.wrong


def begin_utc(seconds):
    """Begin of a drive of so many seconds in whose middle the year ends."""
    return LEAP_DAY_END - datetime.timedelta(seconds=seconds // 2)


def growth(what, unit, values, allowed):
    """Windows and queues fill at first: what still grows in the last third grows without end."""
    if not values:
        return Verdict(wrong=[f"{what} was never measured"])
    sixth = max(1, len(values) // 6)
    parts = [statistics.median(part) for part in (values[:sixth], values[len(values) // 2:][:sixth],
                                                  values[-2 * sixth:][:sixth], values[-sixth:])]
    verdict = Verdict([f"{what}, {unit}: {parts[0]:.1f} at first, {parts[1]:.1f} halfway, {parts[2]:.1f} in the fifth and "
                       f"{parts[3]:.1f} in the last sixth"])
    if parts[3] > parts[2] + allowed:
        verdict.wrong.append(f"{what} grew by {parts[3] - parts[2]:.1f} {unit} in the last third")
    return verdict


def grown(samples):
    """Of (memory in MB, open descriptors) beside a run."""
    verdict = growth("memory", "MB", [memory for memory, _ in samples], MEMORY_GROWS_MB)
    verdict.add(growth("descriptors", "open", [count for _, count in samples], 0))
    return verdict


def live_devices(statuses):
    """Nothing lost between the first status in which every device streams and the last: a device that has to be set up
    sends nothing meanwhile, and what its count misses until then is not lost."""
    verdict = Verdict()
    begun = next((s for s in statuses if all(d["state"] == "streaming" for d in s["devices"])), None)
    if begun is None:
        return Verdict(wrong=["there was no moment at which every device streamed"])
    last = statuses[-1]
    for device, before in zip(last["devices"], begun["devices"]):
        name = device["name"]
        told = [d["latency_ms"] for s in statuses for d in s["devices"] if d["name"] == name and d["latency_ms"]]
        if told:
            third = max(1, len(told) // 3)
            # The promptest tenth of the seconds: a simulator that gets no processor sends late in the others.
            first, newest = (sorted(part)[len(part) // 10] for part in (told[:third], told[-third:]))
            verdict.seen.append(f"{name}: {device['samples']} samples, latency {first:.2f} ms, then {newest:.2f} ms; "
                                f"{device['samples_late']} came too late to be used")
            if newest > first + LATENCY_GROWS_MS:
                verdict.wrong.append(f"{name}: latency grew from {first:.2f} to {newest:.2f} ms")
        for count in COUNTS_LIVE:
            if device[count] != before[count]:
                verdict.wrong.append(f"{name}: {count} {device[count] - before[count]}")
    if last["capture_lost"]:
        verdict.wrong.append(f"the recorder lost {last['capture_lost']} records")
    for thread in last["threads"]:
        if thread["ticks"]:
            late = thread["lateness_us"]
            verdict.seen.append(f"{thread['name']}: {thread['ticks']} ticks, {thread['skipped']} skipped, late by "
                                f"{late['p50']:.0f} us (p50), {late['p99']:.0f} us (p99), {late['max']:.0f} us (max)")
    return verdict


def live_rows(name, late, file):
    """Every count between the first row and the last is a row, or a sample that is told to have come too late."""
    counters = [int(row["counter"]) for row in csv.DictReader(file)]
    if not counters:
        return Verdict(wrong=[f"{name}: no row of the error process"])
    missing = counters[-1] - counters[0] + 1 - len(counters)
    verdict = Verdict([f"{name}: {len(counters)} rows of the error process, {missing} between them missing, "
                       f"{late} samples told to have come too late"])
    if missing > late:
        verdict.wrong.append(f"{name}: {missing - late} rows are missing that nobody tells of")
    if any(next_one <= one for one, next_one in zip(counters, counters[1:])):
        verdict.wrong.append(f"{name}: rows of the error process stand twice or in another order")
    return verdict


def replayed_devices(devices):
    verdict = Verdict()
    for device in devices:
        verdict.seen.append(f"{device['name']}: {device['samples']} samples")
        verdict.wrong += [f"{device['name']}: {count} {device[count]}" for count in COUNTS_REPLAY if device[count]]
    return verdict


def replayed_rows(name, file, seconds):
    """Rows follow each other by one count of the S-IMU and by a hundredth of a second, from the beginning to the end."""
    verdict, n, last = Verdict(), 0, None
    rows = csv.reader(file)
    column = {key: i for i, key in enumerate(next(rows))}
    errors = [i for key, i in column.items() if key.startswith("e_")]
    for row in rows:
        n += 1
        time_s, counter = float(row[column["time_s"]]), int(row[column["counter"]])
        if last and (counter != last[1] + 1 or not 0.0 < time_s - last[0] <= LONGEST_STEP_S):
            verdict.wrong.append(f"{name}: {time_s} s, counter {counter} follows {last[0]} s, counter {last[1]}")
        # A cell is empty where the sample was not valid.
        if not all(math.isfinite(float(row[i])) for i in errors if row[i]):
            verdict.wrong.append(f"{name}: not a number at {time_s} s")
        if len(verdict.wrong) >= TOLD_AT_MOST:
            return verdict
        last = time_s, counter
    # The first minutes stand still: without a mounting there is no error.
    least = math.floor(100 * (seconds - 300))
    verdict.seen.append(f"{name}: {n} rows of the error process")
    if n < least:
        verdict.wrong.append(f"{name} has {n} rows, at least {least} were to come")
    return verdict
