#pragma once

/// A JSON document as groups and data sets: what MATLAB reads without a parser.

#include <nlohmann/json_fwd.hpp>
#include <string_view>

#include "base/result.h"
#include "results/hdf5/h5_file.h"

namespace imuscope::hdf5 {

/// A document with more values than this is not taken apart: each costs a kilobyte of the file.
inline constexpr std::size_t kValuesMax = 100'000;

/// Objects become groups. Numbers, truths (0 and 1) and null (NaN) become data sets with the attribute
/// `unit`, where the key names one; arrays of them, whatever their shape, one data set; texts likewise. An
/// array of objects of single values becomes a group of columns, any other a group of groups that have the
/// elements' names.
/// @return whether the document was small enough
Result<bool> write_json_tree(const Handle& parent, std::string_view name, const nlohmann::json& document);

}  // namespace imuscope::hdf5
