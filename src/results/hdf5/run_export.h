#pragma once

/// A run folder as one HDF5 file, for MATLAB, h5py, Julia, R, Octave.
///
/// /tables/NAME/COLUMN    the CSV files, a data set a column, with attributes `unit` and `description`;
///                        chunked, deflated, checksummed; text as strings of one length; empty cells NaN
/// /results/NAME/...      the JSON documents, key by key: objects are groups, arrays of numbers data sets,
///                        arrays of flat objects groups of columns; null is NaN
/// /documents/NAME        the JSON documents as they are
///
/// Text is UTF-8. What stays a file of its own (capture, report, figures) is named in the root's attribute
/// `left_out`.

#include <filesystem>
#include <string_view>

#include "base/result.h"

namespace imuscope::hdf5 {

/// The file takes its name when it is whole, in place of whatever had it. Memory does not grow with the
/// tables. Errors: a folder that is none or holds nothing of a run (kUsage); a table that cannot be read, a
/// disk that is full (kWork).
Result<void> export_run(const std::filesystem::path& run_folder, const std::filesystem::path& file,
                        std::string_view version);

}  // namespace imuscope::hdf5
