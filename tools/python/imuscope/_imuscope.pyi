"""What imuscope's package for Python does in C++. The functions of the package call it; programs call those."""
from typing import Any, Callable, Mapping, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]

version: str
default_lcm_url: str

class Error(Exception):
    """What cannot be done, and what to do about it, in one sentence."""

class WaveletVariance:
    """Haar wavelet variance (maximal overlap) of a signal, level by level."""

    @property
    def n(self) -> int:
        """Samples that were used."""
    @property
    def rate_hz(self) -> float:
        """Samples per second."""
    @property
    def unit(self) -> str:
        """Of the signal: "rad/s", "deg/s", "m/s^2", "g" or ""."""
    @property
    def efficiency(self) -> float:
        """Of the estimator, relative to the classical one; 1: that one."""
    @property
    def level(self) -> Counts:
        """1, 2, ..."""
    @property
    def tau_s(self) -> Floats:
        """Scale: 2**level / rate_hz, s."""
    @property
    def value(self) -> Floats:
        """Wavelet variance, unit squared: half the Allan variance at tau / 2."""
    @property
    def ci_low(self) -> Floats:
        """Lower end of its interval, unit squared."""
    @property
    def ci_high(self) -> Floats:
        """Upper end of its interval, unit squared."""
    @property
    def n_coefficients(self) -> Counts:
        """Wavelet coefficients of the level."""

class Signal:
    def __init__(self, x: Floats, mask: Optional[NDArray[np.bool_]], rate_hz: float, unit: str, levels: int,
                 efficiency: Optional[float], nan_is_gap: bool, confidence: float) -> None: ...

class Listener:
    def __init__(self, url: str, prefix: str) -> None: ...
    def subscribe(self, kind: str) -> None: ...
    def wait(self, timeout_ms: int) -> list[tuple[str, bytes, float]]: ...

class CapturedMessages:
    def __init__(self, file: str) -> None: ...
    def next(self) -> list[tuple[str, int, bytes]]: ...

class CapturedReads:
    def __init__(self, file: str, device: str) -> None: ...
    def next(self) -> list[tuple[str, int, bool, bytes]]: ...

def wavelet_variance(signal: Signal) -> WaveletVariance: ...
def look_at(signal: Signal, takes_lines_out: bool) -> WaveletVariance: ...
def fit(wv: WaveletVariance, model: str, weights: str, confidence: float, quick: bool, lines_were_taken_out: bool) -> str: ...
def select(wv: WaveletVariance, model: str, weights: str, confidence: float, quick: bool, lines_were_taken_out: bool) -> str: ...
def allan_deviation(signal: Signal, points_per_octave: int, fit_document: str) -> dict[str, Floats]: ...
def export_models(axes: Sequence[tuple[str, str]], to: str, conservative: bool, force: bool) -> str: ...
def simulate(model: str, values: Mapping[str, Mapping[str, float]], n: int, rate_hz: float, seed: int) -> Floats: ...
def read_table(file: str) -> list[tuple[str, str, str, Floats, Optional[list[str]]]]: ...
def read_document(file: str) -> str: ...
def is_table(name: str) -> bool: ...
def unit_in_name(name: str) -> str: ...
def summarise(file: str) -> dict[str, Any]: ...
def samples(inputs: Sequence[str], configuration: Optional[str], device: str) -> dict[str, dict[str, NDArray[Any]]]: ...
def process(inputs: Sequence[str], out: str, configuration: Optional[str], labels: str,
            progress: Optional[Callable[[str, float], None]]) -> list[str]: ...
def protocol_messages(file: str, device: str) -> list[tuple[int, str, str]]: ...
