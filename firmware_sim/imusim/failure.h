#pragma once

/// Why imusim gives up: one sentence for the terminal and the exit code of the program.

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace imusim {

struct Failure {
  int exit_code;
  std::string text;
};

template <typename T>
using Outcome = tl::expected<T, Failure>;

/// What the user typed or configured cannot be used.
inline tl::unexpected<Failure> wrong_usage(std::string text) {
  constexpr int kExitUsage = 2;
  return tl::unexpected(Failure{kExitUsage, std::move(text)});
}

/// The work itself failed.
inline tl::unexpected<Failure> failed_work(std::string text) {
  constexpr int kExitFailure = 1;
  return tl::unexpected(Failure{kExitFailure, std::move(text)});
}

}  // namespace imusim
