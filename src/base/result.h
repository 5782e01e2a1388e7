#pragma once

/// Expected failures are values. An Error says what happened and where, and what to do about it, in words for
/// the person who started the program.

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace imuscope {

/// Decides the exit code of a program: 2 for wrong usage or configuration, 1 for work that failed.
enum class ErrorKind { kUsage, kWork };

/// An expected failure, worded for a person.
struct Error {
  ErrorKind kind = ErrorKind::kWork;
  std::string what;    ///< what happened, with the file, line, key or device it concerns
  std::string remedy;  ///< what to do; may be empty where `what` says it already

  /// One sentence for a log or a terminal.
  [[nodiscard]] std::string text() const { return remedy.empty() ? what : what + "; " + remedy; }
};

template <typename T>
using Result = tl::expected<T, Error>;

inline tl::unexpected<Error> usage_error(std::string what, std::string remedy = {}) {
  return tl::unexpected<Error>(Error{ErrorKind::kUsage, std::move(what), std::move(remedy)});
}
inline tl::unexpected<Error> work_error(std::string what, std::string remedy = {}) {
  return tl::unexpected<Error>(Error{ErrorKind::kWork, std::move(what), std::move(remedy)});
}

}  // namespace imuscope
