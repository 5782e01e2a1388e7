"""The study of a recording."""
from __future__ import annotations

import os
from typing import Callable, Mapping, Optional, Sequence, Union

from . import _imuscope
from .runs import Run

Path = Union[str, os.PathLike[str]]


def process(recording: Union[Path, Mapping[str, Path], Sequence[Path]], out: Path, *, config: Optional[Path] = None,
            labels: Optional[Path] = None, progress: Optional[Callable[[str, float], None]] = None) -> Union[Run, list[Run]]:
    """The study of a recording: calibration, error process, noise models, report; what `imuscope process` does.

    recording: a capture; raw dumps or CSV files by device, {"reference": "ref.csv", "dot": "study.csv"}; or several
    captures, drives of one mounting. out: folder for the results. config: configuration (TOML); a capture holds its own.
    labels: regimes that a person named, CSV begin_s,end_s,regime. progress: called with what is being done and its share,
    0 to 1. Returns the run; of several captures one run a drive.
    """
    if isinstance(recording, Mapping):
        inputs = [f"{name}={os.fspath(file)}" for name, file in recording.items()]
    elif isinstance(recording, (str, os.PathLike)):
        inputs = [os.fspath(recording)]
    else:
        inputs = [os.fspath(file) for file in recording]
    folders = _imuscope.process(inputs, os.fspath(out), None if config is None else os.fspath(config),
                                "" if labels is None else os.fspath(labels), progress)
    return Run(folders[0]) if len(folders) == 1 else [Run(folder) for folder in folders]
