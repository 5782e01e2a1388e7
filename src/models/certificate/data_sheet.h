#pragma once

/// What a maker's data sheet says of a part, from a JSON file, and how a record compares with it. No value
/// without the document, its revision and the page that it stands on.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "models/certificate/axis_certificate.h"

namespace imuscope::certificate {

/// One number of a data sheet, in the unit in which a certificate shows the term.
struct StatedValue {
  std::string axes;  ///< "gyro", "accel", or one axis such as "accel_z"
  Term term = Term::kRandomWalk;
  double value = 0.0;
  bool is_maximum = false;  ///< else typical
  std::string document;
  std::string revision;
  std::string page;
};

struct DataSheet {
  std::string part;
  std::vector<StatedValue> values;
};

/// {"schema": "imuscope.data_sheets/1", "parts": [{"part", "values": [{"axes", "term": "N" ... "Q", "value",
/// "unit", "kind": "typical" or "maximum", "document", "revision", "page"}]}]}. Densities (per sqrt(Hz))
/// stand for N.
/// @param part  empty where the file holds one only
/// @param file  for errors
/// Errors (kWork): no such document, a value without document, revision or page, a unit that is none of its
/// term's, a value that is not positive; (kUsage) a part that the file does not hold, with those that it
/// holds.
Result<DataSheet> read_data_sheet(const nlohmann::json& document, const std::string& part,
                                  const std::string& file);

enum class Verdict : std::uint8_t { kBetter, kAgrees, kWorse, kNotTold };

/// "better", "agrees", "worse", "not told".
const char* name_of(Verdict verdict) noexcept;

/// A term of an axis beside what is stated of it.
struct StatedBeside {
  std::string axis;
  TermValue measured;
  StatedValue stated;
  double ratio = 0.0;  ///< measured, or its bound, over stated
  Verdict verdict = Verdict::kNotTold;
};

/// Better where the whole interval, or the bound, lies below what is stated; worse where it lies above it. A
/// value of one axis comes before that of its triad. What the sheet does not state is left out.
std::vector<StatedBeside> beside(const DataSheet& sheet, const std::vector<AxisCertificate>& axes);

/// {"part", "rows": [{"axis", "symbol", "name", "unit", "stated", "kind", "value", "ci_low", "ci_high",
/// "known", "ratio", "verdict", "document", "revision", "page"}]}
nlohmann::json to_json(const DataSheet& sheet, const std::vector<StatedBeside>& rows);

}  // namespace imuscope::certificate
