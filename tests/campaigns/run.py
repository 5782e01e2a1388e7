"""Running the programs: where they are, a network of their own, what the kernel tells of a process."""
import os
import pathlib
import signal
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
BIN = ROOT / "build" / "release" / "bin"
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


class Failed(Exception):
    """What went wrong, for a person: a campaign ends with it."""


def ending(name, work):
    """The exit code of work(), which may raise Failed."""
    try:
        return work() or 0
    except Failed as error:
        print(f"{name}: {error}", file=sys.stderr)
        return 1


def require_programs():
    for program in ("imuscope", "imusim"):
        if not os.access(BIN / program, os.X_OK):
            raise Failed("no release build; tools/test or tools/demo makes one")


def fresh_folder(tool, folder):
    """New, or emptied of what an earlier run left; ends the program where something else is in it."""
    code = subprocess.run([ROOT / "tools" / "support" / "fresh_folders", tool, folder]).returncode
    if code != 0:
        sys.exit(code)


def again_in_own_network(script, arguments):
    """Starts this program anew where nobody else's messages are heard. Needs root."""
    if os.geteuid() != 0:
        raise Failed("it needs a network of its own: run it as root")
    os.execvp("unshare", ["unshare", "-n", sys.executable, str(script), *map(str, arguments)])


def prepare_own_network():
    for words in ("link set lo up multicast on", "route add 224.0.0.0/4 dev lo"):
        subprocess.run(["ip", *words.split()], check=True)


def run_logged(words, log, *, output=None, cwd=None):
    """The exit code of a command whose messages go to a file; what it prints, too, or to another one."""
    with open(log, "w") as said, open(output or os.devnull, "w") as printed:
        return subprocess.run([str(word) for word in words], stdin=subprocess.DEVNULL, stderr=said,
                              stdout=printed if output else said, cwd=cwd).returncode


def start_logged(words, log, *, output=None):
    """Starts a command; its messages go to a file."""
    with open(log, "w") as said, open(output or os.devnull, "w") as printed:
        return subprocess.Popen([str(word) for word in words], stdin=subprocess.DEVNULL, stderr=said,
                                stdout=printed if output else said)


def stop(process):
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


# A process that is gone tells nothing: these return None then.

def memory_mb(pid, key="VmRSS"):
    """Memory of a process, MB of 10^6 bytes; of VmHWM the most that it had so far."""
    try:
        for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith(f"{key}:"):
                return int(line.split()[1]) * 1024e-6
    except (FileNotFoundError, ProcessLookupError):
        pass
    return None


def descriptors(pid):
    try:
        return len(os.listdir(f"/proc/{pid}/fd")) or None
    except (FileNotFoundError, ProcessLookupError, PermissionError):
        return None


def processor_s(pid):
    """Processor time so far, s."""
    try:
        # The second field is a name in parentheses, which may hold anything.
        fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return None
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S


def thread_times_s(pid):
    """(thread id, name, processor time so far in s) of every thread."""
    times = []
    for task in sorted(pathlib.Path(f"/proc/{pid}/task").iterdir(), key=lambda path: int(path.name)):
        try:
            times.append((int(task.name), (task / "comm").read_text().strip(), int((task / "schedstat").read_text().split()[0]) * 1e-9))
        except (FileNotFoundError, ProcessLookupError):
            continue
    return times
