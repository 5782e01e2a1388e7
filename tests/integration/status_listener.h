#pragma once

/// What tests of a live run share: a network of their own, and the service's statuses as they came.

#include <gtest/gtest.h>
#include <sched.h>
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <imuscope/status_t.hpp>
#include <iterator>
#include <lcm/lcm-cpp.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "guard_report.h"
#include "programs.h"

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

/// Runs the service with `folder`/live.toml into `folder`/live for a while, beside a driving vehicle of
/// `folder`/`vehicle` with the faults of `folder`/faults.toml, and keeps what the service says of itself.
/// @param guard_report  of the core guard around the service; empty: none
inline void run_beside(const std::filesystem::path& folder, const std::string& vehicle,
                       std::chrono::seconds length, Listener& listener,
                       const std::filesystem::path& guard_report = {}) {
  lcm::LCM bus("udpm://239.255.76.67:7667?ttl=0");
  ASSERT_TRUE(bus.good());
  bus.subscribe("IMUSCOPE_STATUS", &Listener::on_status, &listener);
  BackgroundProgram simulator(
      "imusim",
      {"live", (folder / vehicle).string(), "--skip-static", "--faults", (folder / "faults.toml").string()},
      folder / "imusim.log");
  std::optional<ScopedGuard> guard;
  if (!guard_report.empty()) guard.emplace(guard_report);
  BackgroundProgram service("imuscope",
                            {"run", (folder / "live.toml").string(), "--out", (folder / "live").string()},
                            folder / "imuscope.log");
  guard.reset();
  // The drive begins when the lines are open, which a sanitized simulator takes seconds for; statuses of
  // before wait.
  constexpr std::chrono::seconds kOpens{30};
  const auto launched = std::chrono::steady_clock::now();
  while (read_text(folder / "imusim.log").empty()) {
    ASSERT_LT(std::chrono::steady_clock::now() - launched, kOpens) << "the simulator opens no line";
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  listener.started = std::chrono::steady_clock::now();
  while (std::chrono::steady_clock::now() - listener.started < length) bus.handleTimeout(100);
  service.interrupt();
  ASSERT_EQ(service.wait(), 0) << read_text(folder / "imuscope.log");
  simulator.interrupt();
  simulator.wait();
}

}  // namespace imuscope::test
