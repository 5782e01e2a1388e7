#pragma once

/// Pictures that gnuplot draws, as SVG and PDF, from a script that stays beside them.

#include <filesystem>
#include <string>

#include "base/output_folder.h"
#include "base/result.h"
#include "results/report/gnuplot.h"

namespace imuscope::report {

/// Told apart by the colour-blind (Okabe and Ito).
inline constexpr GnuplotWord kPictureColours[] = {"#d1600a", "#0b9a6e", "#3a86d8"};

/// A script under construction: panels of one picture.
struct Picture {
  std::string name;  ///< of its files: written in this program, or with the name of a device in it
  int rows = 1;
  int columns = 1;
  GnuplotScript body;
};

/// Writes NAME.gp, NAME.svg and NAME.pdf into `folder`. Drawn in a folder made for it, since gnuplot follows
/// links. Errors (kWork): gnuplot is not there, or refuses the script.
Result<void> draw_into(const OutputFolder& folder, const Picture& picture);

}  // namespace imuscope::report
