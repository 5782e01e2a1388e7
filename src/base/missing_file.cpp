#include "base/missing_file.h"

namespace imuscope {

Error explain_missing(const std::string& name, const std::error_code& why, const std::string& remedy) {
  if (!why || why == std::errc::no_such_file_or_directory || why == std::errc::not_a_directory)
    return {ErrorKind::kUsage, name + " does not exist", remedy};
  return {ErrorKind::kUsage, name + " cannot be reached: " + why.message(),
          why == std::errc::permission_denied ? "check the permissions of the folders on the way" : remedy};
}

}  // namespace imuscope
