#pragma once

/// Programming errors stop the program where they are made, in every build. What can happen in the field (a
/// bad byte, a late sample, a missing file) is never a contract: it is a value (Result, a count, an enum).

namespace imuscope::detail {
[[noreturn]] void contract_violation(const char* kind, const char* condition, const char* file,
                                     int line) noexcept;
}  // namespace imuscope::detail

// NOLINTBEGIN(cppcoreguidelines-macro-usage): the condition's own text and place are the message.
#define IMUSCOPE_CONTRACT_(kind, condition) \
  ((condition) ? (void)0 : ::imuscope::detail::contract_violation(kind, #condition, __FILE__, __LINE__))
/// What the caller promised.
#define IMUSCOPE_EXPECTS(condition) IMUSCOPE_CONTRACT_("precondition", condition)
/// What this code promises.
#define IMUSCOPE_ENSURES(condition) IMUSCOPE_CONTRACT_("postcondition", condition)
// NOLINTEND(cppcoreguidelines-macro-usage)
