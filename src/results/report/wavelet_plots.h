#pragma once

/// Wavelet variances with their models as pieces of a gnuplot script.

#include <vector>

#include "results/report/fits.h"
#include "results/report/gnuplot.h"

namespace imuscope::report {

/// A data block: observed, interval, total and every component of one fit.
GnuplotScript wavelet_block(const GnuplotScript& name, const Fit& fit);

/// What follows `plot` for that block: points with intervals, the model, its components dashed.
GnuplotScript wavelet_plots(const GnuplotScript& block, const Fit& fit, const GnuplotWord& colour);

/// `set yrange` between half the smallest and twice the largest of what was observed and fitted: a component
/// may leave it.
GnuplotScript wavelet_range(const std::vector<const Fit*>& fits);

}  // namespace imuscope::report
