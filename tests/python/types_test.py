"""Type hints, checked by mypy: of the package, and of a program that uses it rightly and wrongly."""
import os
import subprocess
import sys

import imuscope
import pytest

pytest.importorskip("mypy", reason="mypy is not installed (tools/setup --doors)")

RIGHT = """
import numpy as np
import imuscope
x = imuscope.simulate({"WN": {"sigma2": 1e-6}}, 1000, 100.0)
fit = imuscope.fit(x, "WN", 100.0, unit="rad/s")
sd: float | None = fit.parameters[0].sd
run = imuscope.read_run("run")
speed = np.hypot(run.navigation["v_n_mps"], run.navigation["v_e_mps"])
for channel, message, age_s in imuscope.subscribe(channel="IMUSCOPE_STATUS", timeout_s=1.0):
    print(channel, message.state, age_s)
"""
WRONG = """
import imuscope
imuscope.fit([1.0], 5, 100.0)
imuscope.simulate({"WN": {"sigma2": "much"}}, 10, 100.0)
imuscope.read_capture("a").samples(3)
imuscope.messages.status_t().stat
"""


def mypy(tmp_path, text, *more):
    (tmp_path / "program.py").write_text(text)
    environment = dict(os.environ, MYPYPATH=os.path.dirname(os.path.dirname(imuscope.__file__)))
    return subprocess.run([sys.executable, "-m", "mypy", "--cache-dir", str(tmp_path / "cache"), *more,
                           str(tmp_path / "program.py")], capture_output=True, text=True, env=environment)


def test_the_package_is_strictly_typed(tmp_path):
    package = os.path.dirname(imuscope.__file__)
    done = subprocess.run([sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path / "cache"), "-p", "imuscope"],
                          capture_output=True, text=True, cwd=os.path.dirname(package))
    assert done.returncode == 0, done.stdout


def test_right_use_passes(tmp_path):
    done = mypy(tmp_path, RIGHT, "--strict")
    assert done.returncode == 0, done.stdout


def test_wrong_use_does_not(tmp_path):
    done = mypy(tmp_path, WRONG)
    assert done.returncode == 1
    for line in (3, 4, 5, 6):
        assert f"program.py:{line}: error" in done.stdout, done.stdout
