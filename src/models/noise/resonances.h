#pragma once

/// Resonances (of a sensing element, of a housing) and the end of the bandwidth, seen in the spectrum: bands
/// that are wider than a line.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "models/noise/spectrum.h"

namespace imuscope::noise {

/// A band that stands above the spectrum on both of its sides.
struct Resonance {
  double frequency_hz = 0.0;  ///< of the highest density
  double width_hz = 0.0;      ///< between the places of half its height above the floor
  double rms = 0.0;           ///< root of the power above the floor, signal unit
  double height = 0.0;        ///< density of the peak over that of the floor below it
  double p_value = 1.0;       ///< of noise without one reaching this height anywhere
};

/// Strongest first. Lines are to be taken out before (lines.h).
std::vector<Resonance> find_resonances(Spectra& spectra, double rate_hz, double false_alarm = 1e-3);

/// Frequency beyond which the density stays below half of the plateau before it: where a low-pass of the
/// sensor ends its band. Absent where it does not show below the highest tenth of the range.
std::optional<double> low_pass_hz(Spectra& spectra, double rate_hz);

/// "a resonance at 20.1 Hz, 3.2 Hz wide, 0.012 deg/s rms, 1.4 times the floor".
std::string in_words(const Resonance& resonance, std::string_view unit);

}  // namespace imuscope::noise
