"""Noise models of a signal: wavelet variance, Allan deviation, GMWM fits, exports, simulations."""
from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from typing import Any, Mapping, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _imuscope
from ._imuscope import Error, WaveletVariance

Floats = NDArray[np.float64]
Signal = Union[ArrayLike, WaveletVariance]


@dataclass(frozen=True)
class Parameter:
    """One value of a fitted process, with its interval; an end that the data do not tell is None."""

    process: str
    """"WN", "GM1", ..."""
    name: str
    """"sigma2", "beta", ..."""
    unit: str
    value: float
    sd: Optional[float] = None
    ci_low: Optional[float] = None
    ci_high: Optional[float] = None


@dataclass(frozen=True)
class Fit:
    """A fitted model. `document` is what `imuscope fit --json` prints of it, whole."""

    document: dict[str, Any] = field(repr=False)
    model: str = ""
    """Such as "WN+2*GM"."""
    rate_hz: float = 0.0
    unit: str = ""
    """Of the signal."""
    n: int = 0
    """Samples that it was fitted to."""
    parameters: tuple[Parameter, ...] = ()
    identifiable: bool = False
    p_value: Optional[float] = None
    """Of the test that the model explains the wavelet variance; None where there are too few levels for one."""
    warnings: tuple[str, ...] = ()

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Fit:
        """From a fit as JSON has it: an entry of models.json, what `imuscope fit --json` printed."""
        try:
            names = ("process", "name", "unit", "value", "sd", "ci_low", "ci_high")
            parameters = tuple(Parameter(**{name: row.get(name) for name in names}) for row in document["parameters"])
            test = document.get("j_test")
            return cls(dict(document), document["model"], document["rate_hz"], document.get("unit", ""), document["n"],
                       parameters, document["identifiable"], test["p_value"] if test else None,
                       tuple(document["warnings"]))
        except (AttributeError, KeyError, TypeError) as missing:
            raise Error(f"this is not a fit as `imuscope fit --json` writes it: {missing}") from None

    def value(self, process: str, name: str) -> float:
        """The value of one parameter: fit.value("GM1", "beta")."""
        for parameter in self.parameters:
            if (parameter.process, parameter.name) == (process, name):
                return parameter.value
        known = ", ".join(f"{parameter.process} {parameter.name}" for parameter in self.parameters)
        raise Error(f"the model has no {process} {name}; it has {known}")

    @property
    def levels(self) -> dict[str, Floats]:
        """Observed and fitted wavelet variance: arrays tau_s (s), value, ci_low, ci_high, fitted (unit squared), and
        level, n_coefficients."""
        rows = self.document["wv"]
        names = ("level", "tau_s", "value", "ci_low", "ci_high", "fitted", "n_coefficients")
        return {name: np.array([np.nan if row[name] is None else row[name] for row in rows]) for name in names}


@dataclass(frozen=True)
class Ranked:
    """A model of a ranking, and why it stands where it stands."""

    model: str
    criterion: float
    """Smaller is better: -2 log likelihood plus a price for each parameter."""
    identifiable: bool
    p_value: Optional[float]
    reason: str


@dataclass(frozen=True)
class Allan:
    """Overlapping Allan deviation."""

    tau_s: Floats
    """Averaging times, s."""
    deviation: Floats
    """Unit of the signal."""
    ci_low: Floats
    ci_high: Floats
    degrees_of_freedom: Floats
    """Equivalent, of the variance."""
    n_differences: Floats


def _chosen(x: ArrayLike, rate_hz: float, mask: Optional[ArrayLike], unit: str, levels: int, robust: bool,
            efficiency: float, nan_is_gap: bool, confidence: float) -> _imuscope.Signal:
    if np.iscomplexobj(x):
        raise Error("the signal is no series of real numbers; give an array of one dimension")
    try:
        values = np.ascontiguousarray(x, dtype=np.float64)
        used = None if mask is None else np.ascontiguousarray(mask, dtype=np.bool_)
    except (TypeError, ValueError) as why:
        raise Error(f"the signal is no series of numbers: {why}") from None
    if values.ndim != 1 or (used is not None and used.ndim != 1):
        raise Error("the signal is no series of real numbers; give an array of one dimension")
    if not 0.5 < confidence < 1.0:
        raise Error(f"a confidence of {confidence} is no share; give 0.95 for 95 %")
    if robust and not 0.2 <= efficiency <= 0.99:
        raise Error(f"an efficiency of {efficiency} is not between 0.2 and 0.99")
    if levels < 0:
        raise Error("levels is below zero; 0 is as many as the length allows")
    return _imuscope.Signal(values, used, float(rate_hz), unit, levels, efficiency if robust else None, nan_is_gap,
                            confidence)


def wavelet_variance(x: ArrayLike, rate_hz: float, *, mask: Optional[ArrayLike] = None, unit: str = "", levels: int = 0,
                     robust: bool = False, efficiency: float = 0.6, nan_is_gap: bool = False,
                     confidence: float = 0.95) -> WaveletVariance:
    """Haar wavelet variance of a signal.

    x: samples, in `unit`. rate_hz: samples per second. mask: True where a sample counts; False is a gap. unit: "rad/s",
    "deg/s", "m/s^2", "g" or "". levels: so many; 0: all that the length allows. robust: resist outliers, with this
    efficiency on clean data. nan_is_gap: NaN and infinity are gaps; otherwise an Error names their place.
    """
    return _imuscope.wavelet_variance(
        _chosen(x, rate_hz, mask, unit, levels, robust, efficiency, nan_is_gap, confidence))


def allan_deviation(x: ArrayLike, rate_hz: float, *, mask: Optional[ArrayLike] = None, points_per_octave: int = 4,
                    model: Optional[Fit] = None, nan_is_gap: bool = False, confidence: float = 0.95) -> Allan:
    """Overlapping Allan deviation, in the unit of x, dense in the averaging time (s).

    model: a fit of the same signal, from which the intervals follow; without one they are those of white noise.
    """
    signal = _chosen(x, rate_hz, mask, "", 0, False, 0.6, nan_is_gap, confidence)
    document = "" if model is None else json.dumps(model.document)
    return Allan(**_imuscope.allan_deviation(signal, points_per_octave, document))


def _look(x: Signal, rate_hz: Optional[float], model: str, keep_lines: bool, unit: str, mask: Optional[ArrayLike],
          robust: bool, efficiency: float, nan_is_gap: bool, levels: int) -> tuple[WaveletVariance, bool]:
    """The wavelet variance that a model is fitted to, and whether sinusoids were looked for and taken out."""
    if isinstance(x, WaveletVariance):
        return x, False
    if rate_hz is None:
        raise Error("the rate of the signal is not known; give rate_hz, the samples per second")
    takes_lines_out = not keep_lines and "SIN" not in model
    signal = _chosen(x, rate_hz, mask, unit, levels, robust, efficiency, nan_is_gap, 0.95)
    return _imuscope.look_at(signal, takes_lines_out), takes_lines_out


def fit(x: Signal, model: str, rate_hz: Optional[float] = None, *, unit: str = "", mask: Optional[ArrayLike] = None,
        weights: str = "optimal", confidence: float = 0.95, quick_intervals: bool = False, keep_lines: bool = False,
        robust: bool = False, efficiency: float = 0.6, nan_is_gap: bool = False, levels: int = 0) -> Fit:
    """Noise model of a signal (generalized method of wavelet moments): what `imuscope fit` does.

    x: samples in `unit`, at rate_hz; or a wavelet variance. model: terms of QN, WN, MA1, ARMA11, SIN, RES, GM, FN, PL, RW,
    DR: "WN+2*GM". weights: "optimal" or "ci". quick_intervals: from the estimate's own covariance. keep_lines: sinusoids
    (an engine, a fan) are left in the signal instead of taken out before.
    """
    wv, taken_out = _look(x, rate_hz, model, keep_lines, unit, mask, robust, efficiency, nan_is_gap, levels)
    return Fit.from_document(json.loads(_imuscope.fit(wv, model, weights, confidence, quick_intervals, taken_out)))


def select(x: Signal, model: str, rate_hz: Optional[float] = None, *, unit: str = "", mask: Optional[ArrayLike] = None,
           weights: str = "optimal", confidence: float = 0.95, quick_intervals: bool = False, keep_lines: bool = False,
           robust: bool = False, efficiency: float = 0.6, nan_is_gap: bool = False,
           levels: int = 0) -> tuple[Fit, list[Ranked]]:
    """The sub-models of `model`, best first, and the fit of the best: what `imuscope fit --select` does."""
    wv, taken_out = _look(x, rate_hz, model, keep_lines, unit, mask, robust, efficiency, nan_is_gap, levels)
    document = json.loads(_imuscope.select(wv, model, weights, confidence, quick_intervals, taken_out))
    return Fit.from_document(document), [Ranked(**row) for row in document["ranking"]]


def export(fits: Mapping[str, Fit], to: str, *, conservative: bool = False, force: bool = False) -> str:
    """Noise models as another tool's configuration.

    fits: by axis, {"gyro_x": fit, ...}. to: kalibr, openvins, vins-fusion, lio-sam, gtsam, ros, px4, kf-gins or
    state-space. conservative: upper ends of the intervals. force: also what does not hold; the text then says why.
    """
    axes = [(axis, json.dumps(fitted.document)) for axis, fitted in fits.items()]
    return _imuscope.export_models(axes, to, conservative, force)


def _kind(process: str) -> str:
    """ "GM" of "GM2"; names of processes that end in a digit stay."""
    return process if process in ("MA1", "ARMA11") else re.sub(r"\d+$", "", process)


def simulate(model: Union[Fit, Mapping[str, Mapping[str, float]]], n: int, rate_hz: Optional[float] = None, *,
             seed: int = 1) -> Floats:
    """A series of n samples of a noise model, at rate_hz (samples per second).

    model: a fit, whose rate is its own; or values of processes in the terms of a fit's parameters:
    {"WN": {"sigma2": 1e-6}, "GM1": {"beta": 0.01, "sigma2": 1e-8}} (beta in 1/s, variances in the signal's unit squared).
    The same seed gives the same series.
    """
    values: dict[str, dict[str, float]] = {}
    if isinstance(model, Fit):
        rate_hz = model.rate_hz if rate_hz is None else rate_hz
        for parameter in model.parameters:
            values.setdefault(parameter.process, {})[parameter.name] = parameter.value
    else:
        values = {process: {name: float(value) for name, value in of.items()} for process, of in model.items()}
    if rate_hz is None:
        raise Error("the rate of the series is not known; give rate_hz, the samples per second")
    if not 0 <= seed < 2**64:
        raise Error("seed is not between 0 and 2**64 - 1")
    spec = "+".join(_kind(process) for process in values)
    return _imuscope.simulate(spec, values, n, float(rate_hz), seed)
