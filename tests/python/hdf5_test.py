"""A run as HDF5, read back by h5py and by Octave, which we did not write."""
import json
import os
import re
import shutil
import subprocess

import imuscope
import numpy as np
import pytest
from conftest import BUILD

h5py = pytest.importorskip("h5py", reason="python3-h5py is not installed (tools/setup --doors)")
MODULE = BUILD / "lib" / "imuscope" / "imuscope_hdf5.so"
if not MODULE.exists():
    pytest.skip("the export to HDF5 is not built here: libhdf5-dev is absent (tools/setup --doors)", allow_module_level=True)


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    from conftest import DATA, run_program
    file = tmp_path_factory.mktemp("hdf5") / "run.h5"
    status, printed, said = run_program("imuscope", "export", DATA / "run", "--to", "hdf5", "--out", file)
    assert status == 0, said
    assert printed.strip() == str(file)
    return file


def test_every_table_is_there_column_by_column(exported, run_folder):
    run = imuscope.read_run(run_folder)
    with h5py.File(exported) as h5:
        assert set(h5["tables"]) == set(run.tables)
        for name, table in ((name, run.tables[name]) for name in run.tables):
            assert set(h5["tables"][name]) == set(table)
            for column in table:
                data = h5["tables"][name][column]
                if column == "regime":
                    assert [word.decode() for word in data[:]] == list(table[column])
                else:
                    assert np.array_equal(data[:], table[column], equal_nan=True), (name, column)
                assert text(data.attrs["unit"]) == table.units[column]
                assert text(data.attrs["description"]) == table.descriptions[column]
                assert data.chunks and data.compression == "gzip" and data.shuffle and data.fletcher32


def text(value):
    return value.decode() if isinstance(value, bytes) else str(value)


def test_documents_are_there_as_they_are_and_taken_apart(exported, run_folder):
    calibration = json.loads((run_folder / "calibration.json").read_text())
    with h5py.File(exported) as h5:
        for file in run_folder.glob("*.json"):
            assert json.loads(text(h5["documents"][file.stem][()])) == json.loads(file.read_text())
        mtx2 = next(imu for imu in calibration["imus"] if imu["name"] == "mtx2")
        group = h5["results/calibration/imus/mtx2"]
        assert np.array_equal(group["C_b_s"][:].ravel(), np.ravel(mtx2["C_b_s"]))
        assert "unit" not in group["C_b_s"].attrs
        assert group["r_bs_b_m"].attrs["unit"] in ("m", b"m")
        assert group["t_d_s"][()] == mtx2["t_d_s"] and text(group["t_d_s"].attrs["unit"]) == "s"
        assert text(group["status"][()]) == mtx2["status"]
        models = json.loads((run_folder / "models.json").read_text())["models"]
        entry = models[0]
        of_axis = h5["results/models/models"][f"{entry['name']}_{entry['axis']}_{entry['regime']}"]
        assert np.array_equal(of_axis["wv/value"][:], [row["value"] for row in entry["wv"]])
        assert text(of_axis["wv/tau_s"].attrs["unit"]) == "s"
        assert [text(word) for word in of_axis["parameters/process"][:]] == [row["process"] for row in entry["parameters"]]


def test_what_is_left_out_is_said(exported, run_folder):
    with h5py.File(exported) as h5:
        assert text(h5.attrs["format"]) == "imuscope run"
        assert text(h5.attrs["left_out"]).split("\n") == sorted(
            file.name for file in run_folder.iterdir() if file.suffix not in (".csv", ".json") and not file.name.startswith("."))


def test_the_same_run_gives_the_same_file(exported, run_folder, imuscope_program, tmp_path):
    assert imuscope_program("export", run_folder, "--to", "hdf5", "--out", tmp_path / "again.h5")[0] == 0
    assert (tmp_path / "again.h5").read_bytes() == exported.read_bytes()


def test_octave_reads_the_same(exported, run_folder):
    if not shutil.which("octave-cli") and not shutil.which("octave"):
        pytest.skip("octave is not installed (tools/setup --doors)")
    program = f"""
      run = load('{exported}');
      e = run.tables.errors_mtx1;
      printf('%.17g %.17g %d\\n', sum(e.e_gyro_x_radps), e.time_s(end), numel(e.time_s));
      printf('%s|\\n', e.regime(1, :));
      imu = run.results.calibration.imus.mtx1;
      printf('%.17g ', imu.C_b_s); printf('\\n');
      document = run.documents.run;
      printf('%d\\n', numel(document));
    """
    done = subprocess.run(["octave-cli", "--no-gui", "--norc", "--eval", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.strip().splitlines()
    run = imuscope.read_run(run_folder)
    errors = run.errors["mtx1"]
    total, end, count = map(float, lines[0].split())
    assert total == pytest.approx(errors["e_gyro_x_radps"].sum(), rel=1e-9)
    assert end == errors["time_s"][-1] and count == len(errors["time_s"])
    assert lines[1].rstrip("|").rstrip("\0 ") == errors["regime"][0]
    assert np.allclose(sorted(map(float, lines[2].split())), sorted(np.ravel(run.mountings["mtx1"]["C_b_s"])), atol=0)


def test_nothing_of_the_users_is_replaced_unasked(exported, run_folder, imuscope_program, tmp_path):
    file = tmp_path / "mine.h5"
    file.write_text("mine")
    status, _, said = imuscope_program("export", run_folder, "--to", "hdf5", "--out", file)
    assert status == 2 and "--force" in said and file.read_text() == "mine"
    assert imuscope_program("export", run_folder, "--to", "hdf5", "--out", file, "--force")[0] == 0
    assert file.read_bytes() == exported.read_bytes()
    # A link is replaced, not followed.
    link = tmp_path / "link.h5"
    link.symlink_to(tmp_path / "elsewhere.h5")
    assert imuscope_program("export", run_folder, "--to", "hdf5", "--out", link, "--force")[0] == 0
    assert not link.is_symlink() and not (tmp_path / "elsewhere.h5").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link.h5", "mine.h5"]


def test_a_folder_of_anybody(imuscope_program, tmp_path):
    for folder, words in ((tmp_path / "nowhere", "no folder"), (tmp_path, "nothing of a run")):
        status, _, said = imuscope_program("export", folder, "--to", "hdf5")
        assert status == 2 and words in said
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "navigation.csv").write_text("time_s,height_m\n1,2\n3,x\n")
    status, _, said = imuscope_program("export", folder, "--to", "hdf5", "--out", tmp_path / "out.h5")
    assert status == 1 and "navigation.csv, line 3: height_m" in said
    assert not (tmp_path / "out.h5").exists() and [path.name for path in tmp_path.iterdir()] == ["run"]
    # Keys that a group cannot have, nesting without end, more values than a file should hold.
    (folder / "navigation.csv").write_text("time_s,height_m\n1,2\n3,4\n5,")
    (folder / "a.json").write_text(json.dumps({"a/b": 1, "a_b": 2, "": 3, "..": 4, "list": [[1, 2], [3]], "mixed": [1, "x", None],
                                               "rows": [{"x": 1, "y": "t"}, {"x": None}], "deep": [{"name": "n", "z": [1]}] * 2}))
    (folder / "b.json").write_text("[" * 5000 + "]" * 5000)
    (folder / "c.json").write_text(json.dumps(list(range(300_000))))
    (folder / "capture.lcm").write_bytes(b"x")
    status, _, said = imuscope_program("export", folder, "--to", "hdf5", "--out", tmp_path / "out.h5")
    assert status == 0, said
    with h5py.File(tmp_path / "out.h5") as h5:
        assert list(h5["tables/navigation/height_m"]) == [2.0, 4.0]
        values = {float(h5["results/a"][key][()]) for key in h5["results/a"] if isinstance(h5["results/a"][key], h5py.Dataset)}
        assert {1.0, 2.0, 3.0, 4.0} <= values
        assert np.array_equal(h5["results/a/rows/x"], [1, np.nan], equal_nan=True)
        assert set(h5["results/a/deep"]) == {"n", "n_0002"}
        assert "c" in h5["documents"] and "c" not in h5["results"]
        assert text(h5.attrs["left_out"]).split("\n") == ["b.json", "capture.lcm"]


def test_without_the_module_the_program_says_what_brings_it(run_folder, tmp_path):
    program = tmp_path / "bin" / "imuscope"
    program.parent.mkdir()
    shutil.copy(BUILD / "bin" / "imuscope", program)
    done = subprocess.run([program, "export", run_folder, "--to", "hdf5", "--out", tmp_path / "x.h5"], capture_output=True, text=True)
    assert done.returncode == 2
    assert re.search(r"imuscope-hdf5.*sudo apt install ./imuscope-hdf5_\*\.deb.*tools/setup --doors", done.stderr)


def test_a_full_disk_is_an_error_and_leaves_nothing(run_folder, tmp_path):
    done = subprocess.run(["bash", "-c", 'ulimit -f 2000; trap "" XFSZ; "$@"', "bash", BUILD / "bin" / "imuscope", "export",
                           run_folder, "--to", "hdf5", "--out", tmp_path / "x.h5"], capture_output=True, text=True)
    assert done.returncode == 1 and "free space" in done.stderr, done
    assert os.listdir(tmp_path) == []


def test_the_service_carries_none_of_it():
    libraries = subprocess.run(["ldd", BUILD / "bin" / "imuscope"], capture_output=True, text=True).stdout
    assert "hdf5" not in libraries and "curl" not in libraries
