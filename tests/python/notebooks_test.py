"""The notebooks, executed from the beginning, with data that they make themselves."""
import json
import os
import shutil
import subprocess
import sys

import imuscope
import pytest
from conftest import BUILD, SOURCE

pytest.importorskip("nbconvert", reason="python3-nbconvert is not installed (tools/setup --doors)")
pytest.importorskip("ipykernel", reason="python3-ipykernel is not installed (tools/setup --doors)")
pytest.importorskip("matplotlib", reason="python3-matplotlib is not installed (tools/setup --doors)")

NOTEBOOKS = sorted((SOURCE / "tools" / "python" / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_what_it_printed(notebook):
    for cell in json.loads(notebook.read_text())["cells"]:
        assert not cell.get("outputs") and cell.get("execution_count") is None


@pytest.mark.parametrize("notebook, figures, words", [("static_log", 2, ["explains the data", "WN"]),
                                                      ("drive", 3, ["boresight sd", "predicted"])])
def test_a_notebook_runs(notebook, figures, words, tmp_path):
    source = SOURCE / "tools" / "python" / "notebooks" / f"{notebook}.ipynb"
    environment = dict(os.environ, PATH=f"{BUILD / 'bin'}:{os.environ['PATH']}", IMUSCOPE_EXAMPLES=str(SOURCE / "config"),
                       IMUSCOPE_NOTEBOOK_DATA=str(tmp_path / "data"), HOME=str(tmp_path), JUPYTER_PLATFORM_DIRS="1",
                       PYTHONPATH=os.path.dirname(os.path.dirname(imuscope.__file__)))
    done = subprocess.run([sys.executable, "-m", "nbconvert", "--to", "notebook", "--execute", source, "--output-dir", tmp_path,
                           "--ExecutePreprocessor.kernel_name=python3"], capture_output=True, text=True, env=environment,
                          timeout=280)
    shutil.rmtree(tmp_path / "data", ignore_errors=True)
    assert done.returncode == 0, done.stderr[-4000:]
    cells = json.loads((tmp_path / source.name).read_text())["cells"]
    outputs = [output for cell in cells for output in cell.get("outputs", [])]
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(pictures) == figures
    printed = "".join("".join(output.get("text", "")) for output in outputs)
    for word in words:
        assert word in printed
    if keep := os.environ.get("IMUSCOPE_KEEP_NOTEBOOKS"):
        shutil.copy(tmp_path / source.name, keep)


def test_every_notebook_is_run():
    assert [notebook.stem for notebook in NOTEBOOKS] == ["drive", "static_log"]
