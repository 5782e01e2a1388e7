"""What the tests share: where things are, and programs."""
import os
import subprocess
from pathlib import Path

import pytest

SOURCE = Path(os.environ["IMUSCOPE_SOURCE"])
BUILD = Path(os.environ["IMUSCOPE_BUILD"])
DATA = Path(os.environ["IMUSCOPE_DATA"])


def run_program(name, *arguments, **options):
    """A program of ours: its exit code, what it printed, what it complained of."""
    done = subprocess.run([str(BUILD / "bin" / name), *map(str, arguments)], capture_output=True, text=True,
                          timeout=240, **options)
    return done.returncode, done.stdout, done.stderr


@pytest.fixture
def imuscope_program():
    return lambda *arguments, **options: run_program("imuscope", *arguments, **options)


@pytest.fixture
def drive():
    return DATA / "drive"


@pytest.fixture
def run_folder():
    return DATA / "run"
