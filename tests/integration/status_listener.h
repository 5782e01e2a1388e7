#pragma once

/// What tests of a live run share: a network of their own, and the service's statuses as they came.

#include <gtest/gtest.h>
#include <sched.h>
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <imuscope/status_t.hpp>
#include <iterator>
#include <lcm/lcm-cpp.hpp>
#include <string>
#include <vector>

namespace imuscope::test {

/// The drive begins at 60 s with --skip-static.
inline constexpr double kBegin_s = 60.0;

/// A network namespace with nothing but a loopback that carries multicast. False where that is not permitted.
inline bool enter_private_network() {
  return unshare(CLONE_NEWNET) == 0 &&
         std::system("ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo") == 0;
}

struct Heard {
  double t_s;  ///< scenario time, to some tenths of a second
  status_t status;
};

struct Listener {
  void on_status(const lcm::ReceiveBuffer* /*buffer*/, const std::string& /*channel*/,
                 const status_t* status) {
    const std::chrono::duration<double> since = std::chrono::steady_clock::now() - started;
    heard.push_back({kBegin_s + since.count(), *status});
  }

  /// The last status at or before a time.
  [[nodiscard]] const status_t& status_at(double t_s) const {
    const auto after =
        std::find_if(heard.begin(), heard.end(), [&](const Heard& one) { return one.t_s > t_s; });
    EXPECT_NE(after, heard.begin()) << "no status by " << t_s;
    return std::prev(after)->status;
  }
  [[nodiscard]] const device_status_t& device_at(double t_s, const std::string& name) const {
    return named(status_at(t_s).devices, name);
  }
  [[nodiscard]] const study_status_t& study_at(double t_s, const std::string& name) const {
    return named(status_at(t_s).studies, name);
  }

  /// Whether a device was ever seen so.
  template <typename Condition>
  [[nodiscard]] bool any_status(const std::string& name, Condition&& condition) const {
    return std::any_of(heard.begin(), heard.end(),
                       [&](const Heard& one) { return condition(named(one.status.devices, name)); });
  }

  std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();
  std::vector<Heard> heard;

 private:
  template <typename Named>
  [[nodiscard]] static const Named& named(const std::vector<Named>& list, const std::string& name) {
    const auto found =
        std::find_if(list.begin(), list.end(), [&](const Named& one) { return one.name == name; });
    EXPECT_NE(found, list.end()) << name;
    return *found;
  }
};

}  // namespace imuscope::test
