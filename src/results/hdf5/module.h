#pragma once

/// The one function of the module imuscope_hdf5.so, which `imuscope export --to hdf5` loads.

#include <cstddef>

namespace imuscope::hdf5 {

/// Under this name the module has its function.
inline constexpr const char* kExportFunction = "imuscope_export_hdf5";

/// Longest sentence about what went wrong.
inline constexpr std::size_t kProblemMax = 8192;

/// @param run      folder of a run
/// @param file     to write
/// @param version  of imuscope
/// @param problem  kProblemMax bytes; a sentence with its remedy where the work failed
/// @return 0; 1 where the work failed, 2 for what was typed
using ExportFunction = int (*)(const char* run, const char* file, const char* version, char* problem);

}  // namespace imuscope::hdf5
