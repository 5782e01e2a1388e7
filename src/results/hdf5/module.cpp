#include "results/hdf5/module.h"

#include <algorithm>
#include <exception>
#include <string>

#include "results/hdf5/run_export.h"

namespace {

int failed(int status, const std::string& why, char* problem) {
  const std::size_t length = std::min(why.size(), imuscope::hdf5::kProblemMax - 1);
  std::copy_n(why.data(), length, problem);
  problem[length] = '\0';
  return status;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) int imuscope_export_hdf5(const char* run, const char* file,
                                                                           const char* version,
                                                                           char* problem) {
  try {
    const auto done = imuscope::hdf5::export_run(run, file, version);
    if (done) return 0;
    const bool is_usage = done.error().kind == imuscope::ErrorKind::kUsage;
    return failed(is_usage ? 2 : 1, done.error().text(), problem);
  } catch (const std::exception& why) {
    return failed(1, why.what(), problem);
  }
}
