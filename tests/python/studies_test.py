"""A study from Python is the program's study."""
import json
import re

import imuscope
import pytest


def test_a_study_is_the_programs(drive, run_folder, tmp_path):
    told = []
    run = imuscope.process(drive / "capture.lcm", tmp_path / "run", progress=lambda what, share: told.append((what, share)))
    assert run.documents["calibration"] == json.loads((run_folder / "calibration.json").read_text())
    assert run.documents["models"] == json.loads((run_folder / "models.json").read_text())
    for name in ("navigation", "errors_mtx1"):
        assert (tmp_path / "run" / f"{name}.csv").read_bytes() == (run_folder / f"{name}.csv").read_bytes()
    assert (tmp_path / "run" / "report.html").exists()
    assert told and all(0 <= share <= 1.0001 for _, share in told)


def sentence_of(program, *arguments):
    status, _, said = program(*arguments)
    assert status != 0
    return re.sub(r"^imuscope: ", "", said.strip().splitlines()[-1])


def test_errors_are_the_programs_sentences(drive, imuscope_program, tmp_path):
    (tmp_path / "text.lcm").write_text("hello\n" * 50)
    (tmp_path / "wrong.toml").write_text("[run\n")
    for recording, inputs, options, more in (
            (tmp_path / "nowhere.lcm", [tmp_path / "nowhere.lcm"], {}, []),
            (tmp_path / "text.lcm", [tmp_path / "text.lcm"], {}, []),
            ({"mtx1": drive / "mtx1.bin"}, [f"mtx1={drive}/mtx1.bin"], {}, []),
            (drive / "capture.lcm", [drive / "capture.lcm"], {"config": tmp_path / "wrong.toml"},
             ["--config", tmp_path / "wrong.toml"]),
            (drive / "capture.lcm", [drive / "capture.lcm"], {"labels": tmp_path / "none.csv"},
             ["--labels", tmp_path / "none.csv"])):
        with pytest.raises(imuscope.Error) as raised:
            imuscope.process(recording, tmp_path / "out", **options)
        assert str(raised.value) == sentence_of(imuscope_program, "process", *inputs, "--out", tmp_path / "out2", *more)


def test_an_exception_of_the_callers_ends_the_study(drive, tmp_path):
    class Enough(Exception):
        pass

    def stop(what, share):
        raise Enough

    with pytest.raises(Enough):
        imuscope.process(drive / "capture.lcm", tmp_path / "run", progress=stop)
