#pragma once

/// Where tests find recordings, oracle files, the source tree and the built programs.

#include <gtest/gtest.h>
#include <filesystem>
#include <string_view>

namespace imuscope::test {

/// Folder of the recordings and oracle results that are kept beside the checkout. They are not part of the
/// project and may be absent.
std::filesystem::path shared_path(std::string_view relative);

/// Root of the source tree.
std::filesystem::path source_path(std::string_view relative);

/// A built program, such as "imuscope".
std::filesystem::path program_path(std::string_view name);

/// A fresh folder for the running test, empty, under the build folder; it stays for inspection.
std::filesystem::path scratch_folder();

}  // namespace imuscope::test

/// Skips the running test, with the reason, where a recording or oracle file is absent.
#define IMUSCOPE_NEEDS_SHARED(relative)                                            \
  do {                                                                             \
    if (!std::filesystem::exists(::imuscope::test::shared_path(relative)))         \
      GTEST_SKIP() << "needs " << ::imuscope::test::shared_path(relative).string() \
                   << ", which is kept beside the checkout and is absent here";    \
  } while (false)
