"""What tools/latency reads and prints: cyclictest's histograms, what the service says of its threads, their costs."""
import dataclasses
import math
import re

FAR_TOO_LATE_US = 10000
QUANTILES = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999}


@dataclasses.dataclass(frozen=True)
class Cyclictest:
    """Wake-ups of all threads together, in whole microseconds."""
    quantiles_us: dict
    max_us: int
    beyond: int  # later than FAR_TOO_LATE_US
    samples: int


def read_cyclictest(text):
    """The output of `cyclictest -q -h N`: a line a microsecond with a count a thread, then comments."""
    counts, overflows, longest = {}, 0, 0
    for line in text.splitlines():
        if re.match(r"\d", line):
            late_us, *of_threads = map(int, line.split())
            counts[late_us] = sum(of_threads)
        elif line.startswith("# Histogram Overflows:"):
            overflows = sum(map(int, line.partition(":")[2].split()))
        elif line.startswith("# Max Latencies:"):
            longest = max(map(int, line.partition(":")[2].split()))
    total = sum(counts.values()) + overflows
    if total == 0:
        raise ValueError("cyclictest counted no wake-ups")
    quantiles = {}
    for name, share in QUANTILES.items():
        seen = 0
        for late_us in sorted(counts):
            seen += counts[late_us]
            if seen >= share * total:
                quantiles[name] = late_us
                break
        else:
            quantiles[name] = longest  # among those beyond the histogram
    beyond = overflows + sum(n for late_us, n in counts.items() if late_us > FAR_TOO_LATE_US)
    return Cyclictest(quantiles, longest, beyond, total)


def thread_of(status, name):
    found = [thread for thread in status["threads"] if thread["name"] == name]
    if not found:
        raise ValueError(f"the service tells of no thread {name}")
    return found[0]


def clock_s(line):
    """The time of day of a line of the service's log, s; None where none stands in front."""
    found = re.match(r"(\d\d):(\d\d):(\d\d\.\d+) ", line)
    return int(found[1]) * 3600 + int(found[2]) * 60 + float(found[3]) if found else None


def starting_times(log, n_studies):
    """From the last line that was opened: (until navigation started, until every S-IMU was estimated), s; None where
    the log does not tell."""
    opened = navigation = None
    estimated = {}
    for line in log.splitlines():
        at_s = clock_s(line)
        if at_s is None:
            continue
        text = line.split(None, 2)[2] if len(line.split(None, 2)) == 3 else ""
        if text.endswith(" is open") and navigation is None:
            opened = at_s
        elif text.startswith("navigation started") and navigation is None:
            navigation = at_s
        elif found := re.fullmatch(r"(\S+): converging", text):
            estimated.setdefault(found[1], at_s)

    def since_opened(at_s):
        return None if at_s is None or opened is None else (at_s - opened) % 86400.0

    return since_opened(navigation), since_opened(max(estimated.values()) if len(estimated) == n_studies else None)


def told(seconds):
    return "not told" if seconds is None else f"{seconds:.2f} s"


def wake_up_table(cyclic, status, priority):
    lines = ["| wake-up, us | p50 | p99 | p99.9 | max |", "|---|---|---|---|---|"]
    rows = [(f"cyclictest, FIFO {priority}", {**cyclic.quantiles_us, "max": cyclic.max_us})]
    rows += [("estimator, FIFO 70", thread_of(status, "imuscope-est")["lateness_us"]),
             ("I/O poll, FIFO 80", thread_of(status, "imuscope-io")["lateness_us"]),
             ("from the tick's cut to the estimate in the ring", thread_of(status, "imuscope-est")["done_us"])]
    for name, values in rows:
        cells = ("-" if values[key] is None else f"{values[key]:.0f}" for key in (*QUANTILES, "max"))
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return lines


def ticks_table(cyclic, status):
    estimator = thread_of(status, "imuscope-est")
    return [f"| ticks | missed | overruns | allowed: 3 + 2 x {cyclic.beyond} cyclictest latencies over 10 ms |", "|---|---|---|---|",
            f"| {estimator['ticks']} | {estimator['skipped']} | {estimator['overruns']} | {3 + 2 * cyclic.beyond} |"]


def cost_table(threads, uptime_s, idle_share):
    """threads: (id, name, processor time in s). idle_share: of a thread that only wakes up."""
    lines = ["| thread | share of a core, whole run |", "|---|---|"]
    shares = [(name, spent_s / uptime_s) for _, name, spent_s in threads]
    for name, share in [*shares, ("all", sum(share for _, share in shares)),
                        ("a thread of cyclictest, 100 wake-ups a second and nothing else", idle_share)]:
        lines.append(f"| {name} | {100.0 * share:.2f} % |")
    return lines


def bench_rows(cyclic, status, load, resident_mb):
    """Rows of tools/bench (tools/benchmarks/bench_report.h): lateness beside cyclictest's in the same seconds."""
    rows = []
    for short, name in (("estimator", "imuscope-est"), ("io", "imuscope-io")):
        for quantile, theirs in cyclic.quantiles_us.items():
            ours = thread_of(status, name)["lateness_us"][quantile]
            ratio = ours / theirs if ours is not None and theirs > 0 else None
            rows.append({"group": "lateness", "what": f"{short} wakes, {quantile}; {load}",
                         "ratio": ratio if ratio is None or math.isfinite(ratio) else None, "against": "x cyclictest",
                         "goal": None, "value": ours, "unit": "us", "reference": theirs, "memory_mb": resident_mb})
    return rows
