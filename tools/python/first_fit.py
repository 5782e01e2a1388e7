"""The first thing that somebody does with the package: simulated white noise, and a fit that finds it."""
import imuscope

SIGMA2 = 1e-6
x = imuscope.simulate({"WN": {"sigma2": SIGMA2}}, 100000, rate_hz=100.0)
fit = imuscope.fit(x, "WN", 100.0, unit="rad/s")
assert abs(fit.value("WN", "sigma2") / SIGMA2 - 1) < 0.05, fit
print("import imuscope", imuscope.__version__, "and a fit: sigma2", fit.value("WN", "sigma2"))
