#include "service/pipeline/validity.h"

#include <algorithm>
#include <limits>

namespace imuscope {

namespace {

constexpr double kNever = std::numeric_limits<double>::quiet_NaN();

double largest(const Vector3& v) { return *std::max_element(v.begin(), v.end()); }

}  // namespace

DataAges data_ages(const NavigationOutput& navigation, bool has_reference, HostTime cut) noexcept {
  return {has_reference ? to_seconds(cut - navigation.time) : kNever,
          navigation.has_gnss ? to_seconds(cut - navigation.gnss_time) : kNever};
}

// An age that is NaN is below no limit.
Validity validity_of(const NavigationOutput& navigation, const DataAges& ages) noexcept {
  if (!(ages.reference_s <= kStaleReference_s)) return Validity::kStale;
  if (navigation.gnss_contradicts) return Validity::kContradicted;
  return ages.gnss_s <= kCoasting_s ? Validity::kUsable : Validity::kCoasting;
}

Validity validity_of(const SImuOutput& study, const DataAges& ages) noexcept {
  if (!(ages.reference_s <= kStaleReference_s)) return Validity::kStale;
  if (study.contradicts) return Validity::kContradicted;
  const bool usable = has_estimate(study.status) &&
                      is_usable(largest(study.sd_psi_rad), largest(study.sd_r_bs_b_m), study.sd_t_d_s);
  return usable ? Validity::kUsable : Validity::kConverging;
}

}  // namespace imuscope
