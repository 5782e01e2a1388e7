"""What docs/python.md and docs/live_data.md show, run as it stands there."""
import os
import re
import shutil
import signal
import subprocess
import sys
import time

import imuscope
import pytest
from conftest import BUILD, DATA, SOURCE, run_program


def blocks(document, language):
    """The code blocks of one language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```", (SOURCE / "docs" / document).read_text(), re.M | re.S)


def test_the_guide_to_python_runs(tmp_path, monkeypatch, capsys):
    shutil.copytree(DATA / "run", tmp_path / "run")
    (tmp_path / "drive").symlink_to(DATA / "drive")
    monkeypatch.chdir(tmp_path)
    programs = blocks("python.md", "python")
    assert len(programs) == 5
    names = {}
    for program in programs:
        if "h5py" in program:
            pytest.importorskip("h5py")
            if not (BUILD / "lib" / "imuscope" / "imuscope_hdf5.so").exists():
                continue
            assert run_program("imuscope", "export", "run", "--to", "hdf5")[0] == 0
        exec(compile(program, "python.md", "exec"), names)
    printed = capsys.readouterr().out
    assert "explains the data" in printed and "['mtx1', 'mtx2', 'mtx3']" in printed


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """What a replay writes of what it sends."""
    out = tmp_path_factory.mktemp("replay") / "run"
    assert run_program("imuscope", "replay", DATA / "drive" / "capture.lcm", "--out", out)[0] == 0
    return imuscope.read_run(out).calibrations


@pytest.fixture
def bus(tmp_path):
    """The drive, sent again and again as fast as it goes, until the test ends: its first calibration takes a minute."""
    send = 'while "$@" >/dev/null 2>&1; do :; done'
    command = [BUILD / "bin" / "imuscope", "replay", DATA / "drive" / "capture.lcm", "--out", tmp_path / "out", "--lcm",
               imuscope.DEFAULT_LCM_URL]
    runs = subprocess.Popen(["bash", "-c", send, "bash", *command], start_new_session=True)
    yield
    os.killpg(runs.pid, signal.SIGKILL)
    runs.wait()


def here(command):
    """A command of the page with the paths of this build in place of the installed ones."""
    jar = BUILD / "share" / "java" / "lcmtypes_imuscope.jar"
    return command.replace("/usr/share/java/lcmtypes_imuscope.jar", str(jar)).replace("/usr/share/imuscope/lcm",
                                                                                     str(SOURCE / "src" / "publish" / "lcm"))


def lines_of(command, folder, wanted):
    """The first lines that a listener prints, which then is ended."""
    listener = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
                                env=dict(os.environ))
    lines = []
    try:
        began = time.monotonic()
        for line in listener.stdout:
            lines.append(line.strip())
            if len(lines) == wanted or time.monotonic() - began > 60:
                break
    finally:
        listener.kill()
        listener.wait()
    return lines


def check(lines, expected):
    """Every line against the row of the replay's own file."""
    assert len(lines) == 30, lines
    assert {line.split()[2] for line in lines} == {"mtx1:", "mtx2:", "mtx3:"}
    for line in lines:
        time_s, name, psi, sd = re.fullmatch(r"(\S+) s (\w+): (\S+) deg, sd (\S+) deg", line).groups()
        table = expected[name]
        place = abs(table["time_s"] - float(time_s)).argmin()
        assert abs(table["time_s"][place] - float(time_s)) < 0.0051
        assert float(sd) == pytest.approx(table["sd_psi_x_deg"][place], abs=6e-5)
        if psi.lower() != "nan":  # the motion has shown it
            assert float(psi) == pytest.approx(table["psi_x_deg"][place], abs=6e-5)


def test_the_listener_in_python(bus, expected, tmp_path):
    program = blocks("live_data.md", "python")[0]
    assert len(program.strip().splitlines()) <= 10
    (tmp_path / "listener.py").write_text(program)
    check(lines_of([sys.executable, "listener.py"], tmp_path, 30), expected)


def test_the_listener_in_cpp(bus, expected, tmp_path):
    for program in ("g++", "lcm-gen"):
        if not shutil.which(program):
            pytest.skip(f"{program} is not installed")
    program = blocks("live_data.md", "cpp")[0]
    assert len(program.strip().splitlines()) <= 10
    (tmp_path / "listener.cpp").write_text(program)
    *build, run = here(blocks("live_data.md", "sh")[0]).strip().splitlines()
    for command in build:
        subprocess.run(["bash", "-c", command], cwd=tmp_path, check=True, timeout=120)
    check(lines_of([str(tmp_path / run)], tmp_path, 30), expected)


def test_the_listener_in_java(bus, expected, tmp_path):
    if not shutil.which("javac") or not os.path.exists("/usr/share/java/lcm.jar"):
        pytest.skip("default-jdk-headless or liblcm-java is not installed")
    program = blocks("live_data.md", "java")[0]
    assert len(program.strip().splitlines()) <= 10
    (tmp_path / "Listener.java").write_text(program)
    command = here(blocks("live_data.md", "sh")[1]).split()
    check(lines_of(command, tmp_path, 30), expected)


def test_units_of_the_page_are_those_of_the_library():
    page = (SOURCE / "docs" / "live_data.md").read_text()
    rows = re.findall(r"^\| `(\w+)` \| [\w\[\]]+ \| (\S*) \|", page, re.M)
    assert len(rows) > 300
    for name, unit in rows:
        if name.endswith("utime"):
            assert unit == "µs"
        else:
            assert unit.replace("²", "^2").replace("µ", "u") == imuscope._imuscope.unit_in_name(name), name
