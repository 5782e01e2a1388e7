"""The files of a run folder as arrays and objects."""
from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Callable, Iterator, Mapping, TypeVar, Union

import numpy as np
from numpy.typing import NDArray

from . import _imuscope
from ._imuscope import Error

Value = TypeVar("Value")


class Table(Mapping[str, NDArray[Any]]):
    """One table of a run: a column by its name. NaN: an empty cell; of a column of text the empty word."""

    def __init__(self, file: Path) -> None:
        self._columns: dict[str, NDArray[Any]] = {}
        self.units: dict[str, str] = {}
        """By column: "m/s^2", "deg", ...; "1" without a dimension, empty for text."""
        self.descriptions: dict[str, str] = {}
        for name, unit, description, numbers, words in _imuscope.read_table(str(file)):
            self.units[name], self.descriptions[name] = unit, description
            if words is None:
                self._columns[name] = numbers
            else:
                self._columns[name] = np.array(words + [""], dtype=object)[numbers.astype(np.int64)]

    def __getitem__(self, column: str) -> NDArray[Any]:
        return self._columns[column]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def axes(self, pattern: str) -> NDArray[np.float64]:
        """Three columns as one array, n x 3: axes("e_gyro_{}_radps")."""
        return np.column_stack([self[pattern.format(axis)] for axis in "xyz"])


class _Files(Mapping[str, Value]):
    """Files by name, each read when it is asked for first."""

    def __init__(self, files: Mapping[str, Path], read: Callable[[Path], Value]) -> None:
        self._files, self._read, self._known = dict(files), read, dict[str, Value]()

    def __getitem__(self, name: str) -> Value:
        if name not in self._known:
            if name not in self._files:
                raise Error(f"the run has no {name}; it has {', '.join(self._files) or 'none'}")
            self._known[name] = self._read(self._files[name])
        return self._known[name]

    def __contains__(self, name: object) -> bool:
        return name in self._files

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __len__(self) -> int:
        return len(self._files)


class Run:
    """A run folder. Tables and documents are read when they are asked for."""

    def __init__(self, folder: Union[str, os.PathLike[str]]) -> None:
        self.folder = Path(folder)
        if not self.folder.is_dir():
            raise Error(f"{self.folder} is no folder; give the folder of a run")
        names = sorted(path.name for path in self.folder.iterdir() if path.is_file())
        tables = {name[:-4]: self.folder / name for name in names if _imuscope.is_table(name)}
        documents = {name[:-5]: self.folder / name for name in names if name.endswith(".json")}
        if not tables and not documents:
            raise Error(f"{self.folder} holds nothing of a run; give the folder of a run")
        self.tables: Mapping[str, Table] = _Files(tables, Table)
        """Every CSV file by its name without ".csv": "navigation", "errors_mtx1", ..."""
        self.documents: Mapping[str, Any] = _Files(documents, lambda file: json.loads(_imuscope.read_document(str(file))))
        """Every JSON file by its name without ".json": "calibration", "models", "run", ..."""

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r}): tables {', '.join(self.tables)}; documents {', '.join(self.documents)}"

    def _tables_of(self, stem: str) -> Mapping[str, Table]:
        prefix = stem + "_"
        files = {name[len(prefix):]: self.folder / f"{name}.csv" for name in self.tables
                 if name.startswith(prefix) and name != "smoothed_navigation"}
        return _Files(files, lambda file: self.tables[file.stem])

    @property
    def navigation(self) -> Table:
        """Position, velocity and attitude of the R-IMU, 10 Hz; deg, m, m/s."""
        return self.tables["navigation"]

    @property
    def errors(self) -> Mapping[str, Table]:
        """The error process by S-IMU: rad/s and m/s^2 in the sensor's axes, one row a sample."""
        return self._tables_of("errors")

    @property
    def calibrations(self) -> Mapping[str, Table]:
        """How each S-IMU sits and errs, over the run, 10 Hz."""
        return self._tables_of("calibration")

    @property
    def mountings(self) -> dict[str, Any]:
        """The mounting found, by S-IMU: an entry of calibration.json."""
        return {imu["name"]: imu for imu in self.documents["calibration"]["imus"]}

    @property
    def models(self) -> list[dict[str, Any]]:
        """Noise models per S-IMU, axis and regime: entries of models.json, each good for Fit.from_document()."""
        return list(self.documents["models"]["models"])


def read_run(folder: Union[str, os.PathLike[str]]) -> Run:
    """The folder that `imuscope run`, `replay` or `process` left, or process() of this package."""
    return Run(folder)
