#pragma once

/// The sections of the page, in their order. Each draws only what the run folder holds and
/// says what it has not.

#include "results/report/figures.h"
#include "results/report/fits.h"
#include "results/report/page_parts.h"
#include "results/report/run_files.h"

namespace imuscope::report {

/// Verdicts, the mounting as a drawing, the noise beside its data sheet, whether the predictions hold, what
/// to do next.
Html summary_section(const RunFiles& run, const std::vector<Fit>& fits);
/// Map, speed and height.
Html drive_section(const RunFiles& run, FigureSheet& figures);
/// Mounting tables with sd and, where known, the truth; Figure 1.
Html calibration_section(const RunFiles& run, FigureSheet& figures);
/// Error signals: Figure 2 and their size.
Html errors_section(const RunFiles& run, FigureSheet& figures);
/// Dependence of the errors on the motion: Figure 3 and Table I.
Html dynamics_section(const RunFiles& run, FigureSheet& figures);
/// Noise models: Figure 4 and Table II.
Html models_section(const RunFiles& run, const std::vector<Fit>& fits, FigureSheet& figures);
/// Parameters against the motion, and vibration lines.
Html dependence_section(const RunFiles& run, FigureSheet& figures);
/// What the models are worth in GNSS outages.
Html outages_section(const RunFiles& run);
/// What came from each device, and what went wrong with it.
Html device_table(const RunFiles& run);
/// Health of the devices.
Html health_section(const RunFiles& run);
/// Configuration, versions, inputs, warnings, absent files.
Html making_section(const RunFiles& run);
/// The models in data-sheet terms and as the configuration of other tools.
Html take_away_section(const RunFiles& run, const std::vector<Fit>& fits);

}  // namespace imuscope::report
