#pragma once

/// Which regime of the vehicle holds when: stretches of time that do not overlap, each with the index of a
/// name. Between stretches no regime holds.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "base/time.h"

namespace imuscope {

/// [begin, end).
struct RegimeStretch {
  HostTime begin{};
  HostTime end{};
  std::size_t regime = 0;  ///< index of RegimeTrack::names()
};

class RegimeTrack {
 public:
  RegimeTrack() = default;
  /// Neighbours of one regime that touch become one; stretches without length are left out.
  /// Precondition: ordered by begin, no overlap, every regime < names.size().
  RegimeTrack(std::vector<std::string> names, const std::vector<RegimeStretch>& stretches);

  [[nodiscard]] const std::vector<std::string>& names() const noexcept { return names_; }
  [[nodiscard]] const std::vector<RegimeStretch>& stretches() const noexcept { return stretches_; }
  /// Absent where no regime holds.
  [[nodiscard]] std::optional<std::size_t> at(HostTime time) const noexcept;
  [[nodiscard]] std::optional<std::size_t> index_of(const std::string& name) const noexcept;

  /// Sum and longest of a regime's stretches.
  [[nodiscard]] double total_s(std::size_t regime) const noexcept;
  [[nodiscard]] double longest_s(std::size_t regime) const noexcept;

 private:
  std::vector<std::string> names_;
  std::vector<RegimeStretch> stretches_;
};

}  // namespace imuscope
