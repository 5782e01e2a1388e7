"""Noise models from Python: the numbers of the program, of formulas written out, and of truths that are known."""
import json
import threading
import time
import tracemalloc

import imuscope
import numpy as np
import pytest

RATE_HZ = 100.0
TRUTH = {"WN": {"sigma2": 1e-6}, "GM1": {"beta": 0.05, "sigma2": 1e-8}}


@pytest.fixture(scope="module")
def signal():
    return imuscope.simulate(TRUTH, 200_000, RATE_HZ, seed=11)


def test_wavelet_variance_is_its_definition(signal):
    x = signal[:4096]
    wv = imuscope.wavelet_variance(x, RATE_HZ)
    sums = np.concatenate([[0.0], np.cumsum(x)])
    for level, value, count in zip(wv.level, wv.value, wv.n_coefficients):
        n = 2 ** (level - 1)
        means = (sums[n:] - sums[:-n]) / n
        w = (means[n:] - means[:-n]) / 2
        assert count == w.size
        assert value == pytest.approx(np.mean(w**2), rel=1e-6)
    assert wv.tau_s[0] == 2 / RATE_HZ and wv.n == 4096


def test_allan_deviation_is_its_definition(signal):
    allan = imuscope.allan_deviation(signal, RATE_HZ)
    sums = np.concatenate([[0.0], np.cumsum(signal)])
    for tau_s, deviation in zip(allan.tau_s[::7], allan.deviation[::7]):
        n = round(tau_s * RATE_HZ)
        means = (sums[n:] - sums[:-n]) / n
        # Long means are compared at places 1/32 of their length apart.
        assert deviation == pytest.approx(np.sqrt(0.5 * np.mean((means[n:] - means[:-n]) ** 2)),
                                          rel=1e-6 if n < 64 else 1e-2)
    assert np.all(allan.ci_low < allan.deviation) and np.all(allan.deviation < allan.ci_high)


@pytest.mark.parametrize("options, flags", [({}, []), ({"robust": True}, ["--robust"]), ({"weights": "ci"}, ["-w", "ci"]),
                                            ({"keep_lines": True, "quick_intervals": True},
                                             ["--keep-lines", "--quick-intervals"])])
def test_a_fit_is_the_programs(signal, imuscope_program, tmp_path, options, flags):
    # With a line in it, which both find and take out.
    x = signal + 2e-4 * np.sin(2 * np.pi * 21.3 / RATE_HZ * np.arange(signal.size))
    x.tofile(tmp_path / "x.f64")
    status, printed, said = imuscope_program("fit", tmp_path / "x.f64", "-r", RATE_HZ, "-m", "WN+GM", "-u", "rad/s", "--json",
                                             *flags)
    assert status == 0, said
    expected = json.loads(printed)
    found = imuscope.fit(x, "WN+GM", RATE_HZ, unit="rad/s", **options)
    for key, value in expected.items():
        if key != "warnings":  # which name the options of the program
            assert found.document[key] == value, key
    assert len(found.warnings) == len(expected["warnings"])
    assert ("sinusoids" in found.document) == ("keep_lines" not in options)


def test_a_selection_is_the_programs(signal, imuscope_program, tmp_path):
    signal.tofile(tmp_path / "x.f64")
    status, printed, said = imuscope_program("fit", tmp_path / "x.f64", "-r", RATE_HZ, "-m", "WN+GM+RW", "--select", "--json")
    assert status == 0, said
    expected = json.loads(printed)
    fit, ranking = imuscope.select(signal, "WN+GM+RW", RATE_HZ)
    assert fit.document["parameters"] == expected["parameters"]
    assert [row.model for row in ranking] == [row["model"] for row in expected["ranking"]]
    assert fit.model == "WN+GM"


def test_an_export_is_the_programs(signal, imuscope_program, tmp_path):
    fit = imuscope.fit(signal, "WN+GM", RATE_HZ, unit="rad/s")
    names = ["gyro_x", "gyro_y", "gyro_z"]
    for name in names:
        (tmp_path / f"{name}.json").write_text(json.dumps(fit.document))
    files = [tmp_path / f"{name}.json" for name in names]
    for to in ("ros", "state-space"):
        status, printed, said = imuscope_program("export", *files, "--to", to)
        assert status == 0, said
        assert imuscope.export({name: fit for name in names}, to) == printed


VALUES = {
    "QN": ({"QN": {"q2": 1e-6}}, lambda v: 2 * v["q2"]),
    "WN": ({"WN": {"sigma2": 1e-6}}, lambda v: v["sigma2"]),
    "MA1": ({"MA1": {"theta": 0.4, "sigma2": 1e-6}}, lambda v: v["sigma2"] * (1 + v["theta"] ** 2)),
    "ARMA11": ({"ARMA11": {"phi": 0.7, "theta": 0.2, "sigma2": 1e-6}},
               lambda v: v["sigma2"] * (1 + (v["phi"] + v["theta"]) ** 2 / (1 - v["phi"] ** 2))),
    "SIN1": ({"SIN1": {"frequency": 3.1, "alpha": 2e-3}}, lambda v: v["alpha"] ** 2 / 2),
    "RES1": ({"RES1": {"damping": 8.0, "frequency": 12.0, "sigma2": 1e-6}}, lambda v: v["sigma2"]),
    "GM1": ({"GM1": {"beta": 5.0, "sigma2": 1e-6}}, lambda v: v["sigma2"]),
}


@pytest.mark.parametrize("process", VALUES)
def test_a_simulated_process_has_its_variance(process):
    model, variance = VALUES[process]
    x = imuscope.simulate(model, 400_000, RATE_HZ, seed=3)
    assert np.var(x) == pytest.approx(variance(model[process]), rel=0.03)
    assert np.array_equal(x, imuscope.simulate(model, 400_000, RATE_HZ, seed=3))
    assert not np.array_equal(x, imuscope.simulate(model, 400_000, RATE_HZ, seed=4))


def test_arma_has_its_autocorrelation():
    phi, theta = 0.7, 0.2
    x = imuscope.simulate({"ARMA11": {"phi": phi, "theta": theta, "sigma2": 1.0}}, 400_000, RATE_HZ)
    expected = (1 + phi * theta) * (phi + theta) / (1 + 2 * phi * theta + theta**2)
    assert np.mean(x[1:] * x[:-1]) / np.var(x) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("model", [{"RW": {"gamma2": 1e-8}}, {"DR": {"omega": 1e-6}}, {"FN": {"B": 1e-3}},
                                   {"PL": {"exponent": 1.3, "sigma2": 1e-6}}, TRUTH])
def test_a_fit_finds_what_was_simulated(model):
    names = "+".join(name.rstrip("1") for name in model)
    fit = imuscope.fit(imuscope.simulate(model, 2**18, RATE_HZ, seed=5), names, RATE_HZ, keep_lines=True)
    for parameter in fit.parameters:
        truth = model[parameter.process][parameter.name]
        if parameter.sd:
            assert abs(parameter.value - truth) < 5 * parameter.sd, parameter
        else:
            assert parameter.value == pytest.approx(truth, rel=0.2)
    # A fit is a model to simulate again.
    assert imuscope.simulate(fit, 1000, seed=1).size == 1000


def test_gaps(signal):
    mask = np.ones(signal.size, dtype=bool)
    mask[50_000:60_000] = False
    with_mask = imuscope.wavelet_variance(signal, RATE_HZ, mask=mask)
    x = signal.copy()
    x[~mask] = np.nan
    assert np.array_equal(with_mask.value, imuscope.wavelet_variance(x, RATE_HZ, nan_is_gap=True).value)
    assert with_mask.n == signal.size - 10_000


def test_a_wavelet_variance_is_good_for_several_models(signal):
    wv = imuscope.wavelet_variance(signal, RATE_HZ, unit="rad/s")
    fit = imuscope.fit(wv, "WN+GM")
    assert fit.unit == "rad/s" and fit.rate_hz == RATE_HZ
    assert imuscope.fit(wv, "WN").p_value < 0.01 < fit.p_value
    assert np.allclose(fit.levels["value"], wv.value)


def test_big_arrays_are_not_copied():
    x = np.zeros(4_000_000)
    x[::2] = 1e-3
    x.flags.writeable = False
    tracemalloc.start()
    imuscope.wavelet_variance(x, RATE_HZ)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < x.nbytes / 20  # NumPy's own memory is traced, too


def test_other_threads_run_meanwhile(signal):
    x = imuscope.simulate(TRUTH, 1_000_000, RATE_HZ)
    worker = threading.Thread(target=imuscope.fit, args=(x, "WN+2*GM+RW", RATE_HZ))
    longest = 0.0
    worker.start()
    last = time.perf_counter()
    turns = 0
    while worker.is_alive():
        time.sleep(0.001)
        now = time.perf_counter()
        longest, last, turns = max(longest, now - last), now, turns + 1
    # A fit that kept the lock would let this thread have one turn.
    assert turns > 20, longest


@pytest.mark.parametrize("x, model, rate_hz, options, words", [
    ([1.0], "WN", 100.0, {}, "sample"),
    (np.arange(9.0), "WN+WX", 100.0, {}, "WX"),
    (np.arange(999.0), "WN", 0.0, {}, "samples per second"),
    (np.arange(999.0), "WN", float("nan"), {}, "samples per second"),
    (np.arange(999.0), "WN", None, {}, "rate_hz"),
    ([1.0, np.nan] * 500, "WN", 100.0, {}, "gap"),
    ([["a", "b"]], "WN", 100.0, {}, "numbers"),
    (np.ones((30, 30)), "WN", 100.0, {}, "one dimension"),
    (np.ones(900) * 1j, "WN", 100.0, {}, "real"),
    (np.random.default_rng(1).normal(size=999), "WN", 100.0, {"unit": "furlong"}, "rad/s"),
    (np.random.default_rng(1).normal(size=999), "WN", 100.0, {"weights": "heavy"}, "optimal"),
    (np.random.default_rng(1).normal(size=999), "WN", 100.0, {"mask": [True]}, "mask"),
    (np.random.default_rng(1).normal(size=999), "WN", 100.0, {"robust": True, "efficiency": 3}, "efficiency"),
    (np.random.default_rng(1).normal(size=999), "WN", 100.0, {"levels": 40}, "level"),
    (np.random.default_rng(1).normal(size=999), "WN", 100.0, {"levels": -1}, "level"),
])
def test_what_cannot_be_is_an_error_with_a_sentence(x, model, rate_hz, options, words):
    with pytest.raises(imuscope.Error, match=words) as raised:
        imuscope.fit(x, model, rate_hz, **options)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("model, words", [
    ({"WN": {}}, "sigma2 of WN is missing"), ({"WN": {"sigma": 1.0}}, "WN has no value sigma"),
    ({"WN": {"sigma2": -1.0}}, "range"), ({"GM1": {"beta": -1.0, "sigma2": 1.0}}, "range"),
    ({"WN": {"sigma2": float("inf")}}, "finite"), ({"XX": {"sigma2": 1.0}}, "unknown term"), ({}, "model"),
    ({"GM7": {"beta": 1.0, "sigma2": 1.0}}, "GM7"),
])
def test_no_model_is_simulated_that_is_none(model, words):
    with pytest.raises(imuscope.Error, match=words):
        imuscope.simulate(model, 10, RATE_HZ)


def test_a_fit_of_anybody_is_checked():
    with pytest.raises(imuscope.Error, match="not a fit"):
        imuscope.Fit.from_document({"model": "WN"})
    fit = imuscope.Fit.from_document({"model": "WN", "rate_hz": 1e300, "n": 1, "parameters": [], "identifiable": True,
                                      "warnings": []})
    with pytest.raises(imuscope.Error):
        imuscope.export({"gyro_x": fit}, "ros")
