"""Run folders from Python, beside NumPy's and Python's own readers; and folders that anybody made."""
import json
import shutil

import imuscope
import numpy as np
import pytest


def test_tables_are_what_the_files_say(run_folder):
    run = imuscope.read_run(run_folder)
    files = sorted(file.stem for file in run_folder.glob("*.csv"))
    assert sorted(run.tables) == files and len(files) > 10
    for name in files:
        file = run_folder / f"{name}.csv"
        header = file.open().readline().strip().split(",")
        table = run.tables[name]
        assert list(table) == header
        texts = [column for column in header if table[column].dtype == object]
        assert texts == (["regime"] if name.startswith("errors_") else [])
        numbers = [i for i, column in enumerate(header) if column not in texts]
        expected = np.genfromtxt(file, delimiter=",", skip_header=1, usecols=numbers)
        for i, place in enumerate(numbers):
            assert np.array_equal(table[header[place]], expected[:, i], equal_nan=True), header[place]


def test_text_is_text(run_folder):
    table = imuscope.read_run(run_folder).errors["mtx1"]
    with (run_folder / "errors_mtx1.csv").open() as file:
        expected = [line.rstrip("\n").rsplit(",", 1)[1] for line in file][1:]
    assert list(table["regime"]) == expected
    assert {"static", "dynamic"} <= set(expected)


def test_every_column_has_its_unit_and_meaning(run_folder):
    run = imuscope.read_run(run_folder)
    for name in run.tables:
        table = run.tables[name]
        for column in table:
            assert table.descriptions[column], column
            assert bool(table.units[column]) == (column != "regime")
    assert run.navigation.units["v_n_mps"] == "m/s"
    assert run.calibrations["mtx1"].units["sd_t_d_ms"] == "ms"
    assert run.errors["mtx1"].axes("e_accel_{}_mps2").shape == (len(run.errors["mtx1"]["time_s"]), 3)


def test_documents_are_objects(run_folder):
    run = imuscope.read_run(run_folder)
    for file in run_folder.glob("*.json"):
        assert run.documents[file.stem] == json.loads(file.read_text()), file
    assert set(run.mountings) == {"mtx1", "mtx2", "mtx3"}
    fit = imuscope.Fit.from_document(run.models[0])
    assert fit.unit in ("rad/s", "m/s^2")


def test_names_that_are_not_there(run_folder, tmp_path):
    run = imuscope.read_run(run_folder)
    assert "odometry" not in run.tables
    with pytest.raises(imuscope.Error, match="no odometry; it has .*navigation"):
        run.tables["odometry"]
    for folder in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(imuscope.Error, match="give the folder of a run"):
            imuscope.read_run(folder)


def folder_with(tmp_path, name, content):
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / name).write_bytes(content)
    return imuscope.read_run(folder)


def test_a_run_that_was_killed_ends_with_its_last_whole_row(tmp_path):
    run = folder_with(tmp_path, "navigation.csv", b"time_s,height_m\n1,2\n2,3\n3,")
    assert list(run.navigation["height_m"]) == [2.0, 3.0]


def test_other_columns_of_other_versions_are_read(tmp_path):
    run = folder_with(tmp_path, "navigation.csv", b"height_m,new,time_s\r\n5,,1\r\n6,7,2\r\n")
    assert list(run.navigation["time_s"]) == [1.0, 2.0]
    assert np.isnan(run.navigation["new"][0]) and run.navigation.units["new"] == ""


@pytest.mark.parametrize("content, words", [
    (b"", "no header"), (b"\n", "no header"), (b"time_s,time_s\n", "twice"), (b"time_s,\n1,2\n", "no name"),
    (b",".join(b"c%d" % i for i in range(300)) + b"\n", "more than 256 columns"),
    (b"time_s,height_m\n1,2\n1,high\n", "line 3: height_m is \"high\""),
    (b"time_s,height_m\n1\n", "line 2: there are 1 cells"), (b"time_s\n1,2\n", "line 2: there are 2 cells"),
    (b"time_s\n" + b"1" * 70_000 + b"\n", "line 2: it has more than"),
    (b"time_s\n\x1b[31m1\n", "no number"), (b"x" * 70_000, "no header"),
])
def test_a_table_of_anybody_is_an_error_with_its_place(tmp_path, content, words):
    run = folder_with(tmp_path, "navigation.csv", content)
    with pytest.raises(imuscope.Error, match=words) as raised:
        run.navigation
    assert "navigation.csv" in str(raised.value) and "\x1b" not in str(raised.value)


def test_words_are_few(tmp_path):
    rows = b"".join(b"%d\n" % i for i in range(2000))
    run = folder_with(tmp_path, "errors_a.csv", b"regime\n" + rows)
    with pytest.raises(imuscope.Error, match="more than 1024 different words"):
        run.errors["a"]


@pytest.mark.parametrize("content", [b"", b"{", b"[" * 1000 + b"]" * 1000, b"\xff\xfe", b'{"a": 1} 2'])
def test_a_document_of_anybody_is_an_error(tmp_path, content):
    run = folder_with(tmp_path, "models.json", content)
    with pytest.raises(imuscope.Error, match="models.json"):
        run.documents["models"]


def test_nothing_is_read_that_is_no_file(tmp_path, run_folder):
    folder = tmp_path / "run"
    folder.mkdir()
    shutil.copy(run_folder / "run.json", folder)
    (folder / "navigation.csv").symlink_to("/dev/zero")
    (folder / "models.json").symlink_to("/dev/zero")
    run = imuscope.read_run(folder)
    assert "navigation" not in run.tables and "models" not in run.documents
