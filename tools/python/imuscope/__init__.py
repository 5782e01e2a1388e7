"""imuscope for Python: noise models, runs, captures, studies and live data.

Arrays are NumPy's, in SI units unless a name or a docstring says otherwise. A contiguous float64 array is read where it
is; anything else is converted first. Long work lets other threads of Python run. What goes wrong is an `Error`, with the
sentence that the program would print.
"""
from ._imuscope import Error, WaveletVariance, default_lcm_url as DEFAULT_LCM_URL, version as __version__
from .captures import Capture, Samples, read_capture
from .live import Heard, decode, subscribe
from .noise import Allan, Fit, Parameter, Ranked, allan_deviation, export, fit, select, simulate, wavelet_variance
from .runs import Run, Table, read_run
from .studies import process

__all__ = [
    "Allan", "Capture", "DEFAULT_LCM_URL", "Error", "Fit", "Heard", "Parameter", "Ranked", "Run", "Samples", "Table",
    "WaveletVariance", "allan_deviation", "decode", "export", "fit", "process", "read_capture", "read_run", "select",
    "simulate", "subscribe", "wavelet_variance", "__version__",
]
