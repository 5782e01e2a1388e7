#include "service/run/new_folder.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <cerrno>
#include <system_error>

#include "base/text.h"

namespace imuscope {

namespace {

constexpr std::size_t kLongestName = 100;
constexpr int kMostOfOneSecond = 10'000;

bool can_name_a_folder(const std::string& name) {
  return !name.empty() && name.size() <= kLongestName && name != "." && name != ".." &&
         name.find('/') == std::string::npos && printable(name) == name;
}

}  // namespace

Result<std::filesystem::path> make_new_folder(const std::filesystem::path& parent, const std::string& name,
                                              std::chrono::system_clock::time_point now) {
  if (!can_name_a_folder(name)) {
    return usage_error(
        fmt::format("[run] name = '{}' cannot name a folder", printable(name.substr(0, kLongestName))),
        fmt::format("use at most {} characters without '/', or give --out", kLongestName));
  }
  const auto refused = [&](const std::filesystem::path& folder, const std::error_code& why) {
    return work_error(fmt::format("{} cannot be made ({})", folder.string(), why.message()),
                      "name another folder with --out, or in [record] of the configuration");
  };
  std::error_code error;
  std::filesystem::create_directories(parent, error);
  if (error) return refused(parent, error);
  const auto stem =
      fmt::format("{}-{:%Y%m%d-%H%M%S}", name, fmt::localtime(std::chrono::system_clock::to_time_t(now)));
  for (int i = 1; i <= kMostOfOneSecond; ++i) {
    const auto folder = parent / (i == 1 ? stem : fmt::format("{}-{}", stem, i));
    // Made, not only looked for: of two that start at once each gets its own.
    constexpr mode_t kAsTheUmaskSays = 0777;
    if (::mkdir(folder.c_str(), kAsTheUmaskSays) == 0) return folder;
    if (errno != EEXIST) return refused(folder, {errno, std::generic_category()});
  }
  return refused(parent / stem, std::make_error_code(std::errc::file_exists));
}

}  // namespace imuscope
