// Where each check begins to find something: what is planted grows from less than any limit to more, and the answers
// are written by the ranges in which they hold.
#include <gtest/gtest.h>
#include <algorithm>

#include "by_ranges.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::check {
namespace {

TEST(LimitsOfStamps, AreWhereTheyWere) {
  std::string text;
  for (const std::size_t device : {kReference, kGnss}) {
    text += by_ranges(fmt::format("rate of device {}, of that configured", device), ratios(5e-10, 20.0, 1000),
                      [&](double ratio) {
                        Empty empty;
                        empty.fill(device, 80, ratio * (device == kGnss ? 10.0 : 100.0));
                        return empty.stamps(device);
                      });
  }
  text += by_ranges("number of stamps", steps(40, 60, 20), [](double n) {
    Empty empty;
    empty.fill(kReference, static_cast<std::size_t>(n), 50.0);
    return empty.stamps();
  });
  text += by_ranges("every tenth step, in periods", steps(1.0, 4.0, 120), [](double periods) {
    Empty empty;
    double time_s = 0.0;
    for (int i = 0; i < 100; ++i) empty.add_imu(kReference, time_s += i % 10 == 9 ? 0.01 * periods : 0.01);
    return empty.stamps();
  });
  text += by_ranges("one gap in 1000 s, s", steps(0.1, 60.0, 599), [](double gap_s) {
    Empty empty;
    empty.configuration().devices[kReference].rate_hz = 2.0;
    for (int i = 0; i < 2000; ++i) empty.add_imu(kReference, 0.5 * i + (i > 700 ? gap_s : 0.0));
    return empty.stamps();
  });
  text += by_ranges("a receiver's gap, s", {1.0, 100.0}, [](double gap_s) {
    Empty empty;
    for (int i = 0; i < 100; ++i) empty.add_gnss(0.1 * i + (i > 50 ? gap_s : 0.0), i, i);
    return empty.stamps(kGnss);
  });
  text += by_ranges("samples of 1000 that are repeated", steps(0, 120, 120), [](double repeated) {
    Empty empty;
    empty.fill(kReference, 1001, 100.0);
    for (std::size_t i = 1; i < 2 * static_cast<std::size_t>(repeated); i += 2) {
      empty.imu().omega_radps[i] = empty.imu().omega_radps[i - 1];
      empty.imu().f_mps2[i] = empty.imu().f_mps2[i - 1];
    }
    return empty.stamps();
  });
  text += by_ranges("samples of 1000 with the time of another", steps(0, 120, 120), [](double same) {
    Empty empty;
    empty.fill(kReference, 1001, 100.0);
    for (std::size_t i = 1; i < 2 * static_cast<std::size_t>(same); i += 2)
      empty.imu().time_s[i] = empty.imu().time_s[i - 1];
    return empty.stamps();
  });
  text += by_ranges("samples of 1000 that the counter misses", steps(0, 60, 60), [](double lost) {
    Empty empty;
    empty.fill(kReference, 1000, 100.0);
    for (std::size_t i = 500; i < 1000; ++i) empty.imu().counter[i] += static_cast<std::int64_t>(lost);
    return empty.stamps();
  });
  test::expect_recorded("check/limits_of_stamps.txt", text);
}

TEST(LimitsOfStamps, NumbersOfStampsAreThoseOfTheSeries) {
  std::string text;
  const auto tell = [&](const std::string& title, Empty& empty, std::size_t device = kReference) {
    std::vector<Finding> findings;
    check_stamps(empty.drive(), device, findings);
    text += title + '\n' + findings_text(findings);
  };
  for (const double rate_hz : {7.77, 9.99, 12.4, 64.6, 85.0, 130.0, 0.1, 2e-4}) {
    Empty empty;
    empty.fill(kReference, 60, rate_hz);
    tell(fmt::format("{:g} Hz", rate_hz), empty);
  }
  {
    Empty empty;
    empty.fill(kGnss, 60, 10e-6);
    tell("a receiver in microseconds", empty, kGnss);
    text += fmt::format("  is then {:.6g} s long\n", empty.gnss().time_s.back());
  }
  {
    Empty empty;
    for (std::size_t i = 0; i < 400; ++i)
      empty.add_imu(kReference,
                    0.01 * static_cast<double>(i) + (i > 100 ? 0.3 : 0.0) + (i > 300 ? 0.2 : 0.0));
    tell("gaps of 0.31 and 0.21 s in 4.49 s", empty);
  }
  {
    Empty empty;
    for (std::size_t i = 0; i < 900; ++i) empty.add_imu(kReference, 0.01 * static_cast<double>(i / 3 * 3));
    tell("three of one time", empty);
  }
  {
    Empty empty;
    empty.fill(kReference, 800, 200.0);
    for (std::size_t i = 0; i < 800; ++i) {
      empty.imu().omega_radps[i] = empty.imu().omega_radps[i - i % 2];
      empty.imu().f_mps2[i] = empty.imu().f_mps2[i - i % 2];
    }
    tell("each twice, at twice the rate", empty);
    for (std::size_t i = 0; i < 800; ++i) empty.imu().f_mps2[i].x() += static_cast<float>(i);
    tell("of rates alone", empty);
  }
  {
    Empty empty;
    empty.fill(kReference, 200, 100.0);
    for (std::size_t i = 0; i < 200; ++i) empty.imu().counter[i] = static_cast<std::int64_t>(3 * i);
    tell("a counter of threes", empty);
    for (std::size_t i = 0; i < 200; ++i) empty.imu().counter[i] = -static_cast<std::int64_t>(i);
    tell("a counter that counts down", empty);
    for (std::size_t i = 0; i < 200; ++i) empty.imu().counter[i] = 5;
    tell("a counter that stands", empty);
  }
  {
    Empty empty;
    for (int i = 0; i < 60; ++i) empty.add_imu(kReference, 4.0);
    tell("one time", empty);
    empty.configuration().devices[kReference].protocol = Protocol::kMcap;
    tell("one time of messages", empty);
    for (std::size_t i = 0; i < 60; ++i) empty.imu().time_s[i] = 4.0 - 0.01 * static_cast<double>(i);
    tell("times that run backwards", empty);
  }
  test::expect_recorded("check/stamps.txt", text);
}

TEST(LimitsOfStamps, TwoFilesAreExchangedWhereEachHasTheOthersRate) {
  const auto answer = [](double reference_hz, double study_hz, std::size_t n = 60) {
    Empty empty;
    empty.fill(kReference, n, reference_hz);
    empty.fill(kStudy, n, study_hz);
    std::vector<Finding> findings;
    for (const std::size_t device : {kReference, kStudy, kGnss})
      check_stamps(empty.drive(), device, findings);
    findings.emplace_back();
    findings.back().check = "rate";
    findings.back().device = "other";
    const bool exchanged = check_files(empty.drive(), findings);
    return fmt::format("{}\n{}", exchanged, findings_text(findings));
  };
  std::string text;
  for (const auto& [a, b] : {std::pair(50.0, 100.0),
                             {54.0, 108.0},
                             {46.0, 93.0},
                             {56.0, 100.0},
                             {50.0, 112.0},
                             {50.0, 50.0},
                             {100.0, 100.0},
                             {100.0, 50.0}})
    text += fmt::format("{} and {} Hz: {}", a, b, answer(a, b));
  text += "49 stamps: " + answer(50.0, 100.0, 49) + "50 stamps: " + answer(50.0, 100.0, 50);
  test::expect_recorded("check/exchanged_files.txt", text);
}

std::string signals_of(Empty& empty) {
  std::vector<Finding> findings;
  check_signals(empty.drive(), kReference, findings);
  return words_of(findings);
}

TEST(LimitsOfSignals, AreWhereTheyWere) {
  std::string text;
  text += by_ranges("samples at the largest value, in threes", steps(3, 40, 37), [](double n) {
    Empty empty;
    empty.fill(kReference, 1000, 100.0);
    for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i)
      empty.imu().omega_radps[20 * (i / 3) + i % 3].x() = 0.5F;
    return signals_of(empty);
  });
  text += by_ranges("the same one by one, in pairs, in threes ...", steps(1, 6, 5), [](double together) {
    Empty empty;
    empty.fill(kReference, 1000, 100.0);
    const auto run = static_cast<std::size_t>(together);
    for (std::size_t i = 0; i < 30; ++i) empty.imu().f_mps2[30 * (i / run) + i % run].y() = -3.0F;
    return signals_of(empty);
  });
  text += by_ranges("samples just below, of 60 at the end", steps(0, 60, 60), [](double n) {
    Empty empty;
    empty.fill(kReference, 1000, 100.0);
    for (std::size_t i = 0; i < 60; ++i) empty.imu().omega_radps[i].z() = 1.0F;
    for (std::size_t i = 100; i < 100 + static_cast<std::size_t>(n); ++i)
      empty.imu().omega_radps[i].z() = 0.998F + 1e-6F * static_cast<float>(i);
    return signals_of(empty);
  });
  text += by_ranges("how far below 40 of 60 at the end are, of the range", ratios(1e-4, 0.02, 200),
                    [](double share) {
                      Empty empty;
                      empty.fill(kReference, 1000, 100.0);
                      for (std::size_t i = 0; i < 60; ++i) empty.imu().omega_radps[i].z() = 0.9F;
                      for (std::size_t i = 100; i < 140; ++i)
                        empty.imu().omega_radps[i].z() =
                            0.9F - static_cast<float>(share) - 1e-5F * static_cast<float>(i - 100);
                      return signals_of(empty);
                    });
  text += by_ranges("steps below the end that 40 of 60 are", ratios(0.5, 5.0, 100), [](double at) {
    Empty empty;
    empty.fill(kReference, 1000, 100.0);
    for (std::size_t i = 0; i < 1000; ++i)
      empty.imu().omega_radps[i].z() = 0.01F * std::round(empty.imu().omega_radps[i].z() / 0.01F);
    for (std::size_t i = 0; i < 60; ++i) empty.imu().omega_radps[i].z() = 0.2F;
    for (std::size_t i = 100; i < 140; ++i)
      empty.imu().omega_radps[i].z() = 0.2F - 0.01F * static_cast<float>(at);
    return signals_of(empty);
  });
  text += by_ranges("share of samples with the value before", steps(0.3, 0.8, 100), [](double share) {
    Empty empty;
    empty.fill(kReference, 1000, 100.0);
    double due = 0.0;
    for (std::size_t i = 1; i < 1000; ++i) {
      due += share;
      if (due < 1.0) continue;
      due -= 1.0;
      empty.imu().f_mps2[i].x() = empty.imu().f_mps2[i - 1].x();
    }
    return signals_of(empty);
  });
  text += by_ranges("samples held together", steps(150, 320, 170), [](double n) {
    Empty empty;
    empty.fill(kReference, 4000, 100.0);
    for (std::size_t i = 1000; i < 1000 + static_cast<std::size_t>(n); ++i) empty.imu().f_mps2[i].y() = 0.25F;
    return signals_of(empty);
  });
  text += by_ranges("samples of which 300 are held", steps(5000, 20000, 60), [](double n) {
    Empty empty;
    empty.fill(kReference, static_cast<std::size_t>(n), 100.0);
    for (std::size_t i = 4000; i < 4301; ++i) empty.imu().omega_radps[i].y() = 0.025F;
    return signals_of(empty);
  });
  text += by_ranges("samples", steps(490, 510, 20), [](double n) {
    Empty empty;
    empty.fill(kReference, static_cast<std::size_t>(n), 100.0);
    empty.imu().clipped = 10;
    return signals_of(empty);
  });
  text += by_ranges("samples that say they are clipped, of 10000", steps(0, 25, 25), [](double n) {
    Empty empty;
    empty.fill(kReference, 10000, 100.0);
    empty.imu().clipped = static_cast<std::size_t>(n);
    return signals_of(empty);
  });
  test::expect_recorded("check/limits_of_signals.txt", text);
}

TEST(LimitsOfSignals, EveryAxisIsNamedWithTheWorst) {
  std::string text;
  const auto tell = [&](const std::string& title,
                        const std::function<void(Eigen::Vector3f&, Eigen::Vector3f&, std::size_t)>& change) {
    Empty empty;
    empty.fill(kReference, 1200, 100.0);
    for (std::size_t i = 0; i < 1200; ++i) change(empty.imu().omega_radps[i], empty.imu().f_mps2[i], i);
    empty.imu().clipped = 7;
    std::vector<Finding> findings;
    check_signals(empty.drive(), kReference, findings);
    text += title + '\n' + findings_text(findings);
  };
  tell("cut off", [](auto& w, auto& f, std::size_t) {
    w = w.cwiseMin(0.05F);
    f.x() = std::clamp(f.x(), -0.7F, 2.0F);
    f.z() = std::max(f.z(), -9.83F);
  });
  tell("in steps", [](auto& w, auto& f, std::size_t i) {
    w.y() = 0.07F * static_cast<float>(i / 3 % 5);
    w.z() = 0.08F * static_cast<float>(i / 4 % 7);
    f.y() = 0.5F * static_cast<float>(i / 5 % 9);
  });
  tell("held", [](auto& w, auto& f, std::size_t i) {
    if (i > 100 && i < 350) w.x() = 0.01F;
    if (i > 500 && i < 800) w.z() = 0.02F;
    if (i > 300 && i < 700) f = Eigen::Vector3f(1.0F, 2.0F, 3.0F);
  });
  tell("an axis that is nothing", [](auto& w, auto&, std::size_t) { w.x() = 0.0F; });
  test::expect_recorded("check/signals.txt", text);
}

TEST(LimitsOfSignals, AnAxisWithOneValueStandsAndIsNotCutOff) {
  Empty empty;
  empty.fill(kReference, 600, 100.0);
  for (Eigen::Vector3f& omega : empty.imu().omega_radps) omega.x() = 0.0F;
  std::vector<Finding> findings;
  check_signals(empty.drive(), kReference, findings);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].check, "stuck axis");
}

std::string gravity_of(Empty& empty) {
  std::vector<Finding> findings;
  check_gravity_norm(empty.drive(), kReference, findings);
  return findings_text(findings);
}

void still(Empty& empty, std::size_t n, const Eigen::Vector3f& omega_radps, const Eigen::Vector3f& f_mps2) {
  for (std::size_t i = 0; i < n; ++i) {
    empty.add_imu(kReference, 0.1 * static_cast<double>(i) + 0.05);
    empty.imu().omega_radps.back() = omega_radps;
    empty.imu().f_mps2.back() = f_mps2;
  }
}

TEST(LimitsOfGravity, AreWhereTheyWere) {
  std::string text = by_ranges("size of gravity, m/s2", ratios(1e-3, 2e4, 1500), [](double f_mps2) {
    Empty empty;
    still(empty, 70, Eigen::Vector3f::Zero(), Eigen::Vector3f(0.0F, static_cast<float>(f_mps2), 0.0F));
    std::vector<Finding> findings;
    check_gravity_norm(empty.drive(), kReference, findings);
    std::string answer = words_of(findings);
    for (const Finding& finding : findings) answer += finding.remedy;
    return answer;
  });
  text += by_ranges("size of the rates, rad/s", ratios(0.3, 20.0, 400), [](double rate_radps) {
    Empty empty;
    still(empty, 70, Eigen::Vector3f(0.0F, static_cast<float>(rate_radps), 0.0F), Eigen::Vector3f::Ones());
    std::vector<Finding> findings;
    check_gravity_norm(empty.drive(), kReference, findings);
    return words_of(findings);
  });
  text += by_ranges("forces beside rates of gravity's size, m/s2", ratios(0.3, 20.0, 400), [](double f_mps2) {
    Empty empty;
    still(empty, 70, Eigen::Vector3f(0.0F, 9.8F, 0.0F),
          Eigen::Vector3f(static_cast<float>(f_mps2), 0.0F, 0.0F));
    std::vector<Finding> findings;
    check_gravity_norm(empty.drive(), kReference, findings);
    return words_of(findings);
  });
  text += by_ranges("tenths of a second", steps(50, 70, 20), [](double n) {
    Empty empty;
    still(empty, static_cast<std::size_t>(n), Eigen::Vector3f::Zero(), Eigen::Vector3f::Ones());
    std::vector<Finding> findings;
    check_gravity_norm(empty.drive(), kReference, findings);
    return words_of(findings);
  });
  test::expect_recorded("check/limits_of_gravity.txt", text);
}

TEST(LimitsOfGravity, WhatIsFoundIsPutRightInTheDrive) {
  std::string text;
  for (const Protocol protocol : {Protocol::kCsvImu, Protocol::kXsensMt}) {
    for (const auto& [w, f] : {std::pair(0.1F, 1.0F),
                               {0.1F, 96.2F},
                               {0.1F, 1000.0F},
                               {0.1F, 9806.0F},
                               {0.1F, 0.098F},
                               {9.8F, 0.2F},
                               {1.0F, 0.2F},
                               {0.1F, 2.0F},
                               {0.1F, 30.0F}}) {
      Empty empty;
      empty.configuration().devices[kReference].protocol = protocol;
      still(empty, 65, Eigen::Vector3f(0.0F, 0.6F * w, 0.8F * w),
            Eigen::Vector3f(0.36F * f, -0.48F * f, 0.8F * f));
      text += fmt::format("{} {}\n{}", w, f, gravity_of(empty));
      text += fmt::format("  then {:.5g} {:.5g} {:.5g} {:.5g}\n", empty.imu().omega_radps[7].y(),
                          empty.imu().f_mps2[7].x(), empty.imu().f_mps2[7].y(), empty.imu().f_mps2[64].z());
    }
  }
  test::expect_recorded("check/gravity.txt", text);
}

TEST(LimitsOfGravity, DownIsAgainstTheMeanForce) {
  Empty empty;
  EXPECT_EQ(reference_down(empty.drive()).down, Eigen::Vector3d::UnitZ());
  still(empty, 2, Eigen::Vector3f::Zero(), Eigen::Vector3f(0.0F, 3.0F, -8.0F));
  still(empty, 1, Eigen::Vector3f::Zero(), Eigen::Vector3f(0.0F, -6.0F, 4.0F));
  EXPECT_TRUE(reference_down(empty.drive()).down.isApprox(Eigen::Vector3d(0.0, 0.0, 1.0)));
  still(empty, 4, Eigen::Vector3f::Zero(), Eigen::Vector3f(-4.0F, 0.0F, 0.0F));
  EXPECT_TRUE(reference_down(empty.drive()).down.isApprox(Eigen::Vector3d(0.8, 0.0, 0.6)));
}

}  // namespace
}  // namespace imuscope::check
