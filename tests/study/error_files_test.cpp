#include "study/error_files.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <fstream>
#include <sstream>
#include <thread>
#include <utility>

#include "study/ends_beside.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

constexpr double kErrorRate_hz = 100.0;
/// Two blocks and a part of one; two whole ones; a few rows; none.
constexpr std::array<std::int64_t, 4> kErrorRows{5000, 4096, 7, 0};
/// Rest, then nothing that has a name, then motion.
constexpr double kRestEnds_s = 20.0;
constexpr double kMotionBegins_s = 30.0;

HostTime error_time(double t_s) { return HostTime{} + from_seconds(t_s); }

ErrorRow numbered_row(std::size_t study, std::int64_t k) {
  ErrorRow row{};
  row.counter = k;
  row.time = error_time(static_cast<double>(k) / kErrorRate_hz);
  row.gyro_valid = row.accel_valid = true;
  row.e_gyro_radps = {1e-3 * static_cast<double>(k), 1.0 + static_cast<double>(study), 3.0};
  row.predicted_omega_s_radps = {2.0, 0.5 * static_cast<double>(k % 11), 0.0};
  return row;
}

std::string regime_at(double t_s) {
  return t_s < kRestEnds_s ? "static" : t_s < kMotionBegins_s ? "" : "dynamic";
}

std::vector<RowSpool> error_spools(const std::filesystem::path& folder) {
  std::vector<RowSpool> spools;
  for (std::size_t i = 0; i < kErrorRows.size(); ++i)
    spools.push_back(RowSpool::create(*OutputFolder::open(folder)).value());
  return spools;
}

class WrittenErrors : public ::testing::Test {
 protected:
  void SetUp() override {
    std::vector<SImuFileInfo> infos;
    for (std::size_t i = 0; i < kErrorRows.size(); ++i) infos.push_back({"mtx" + std::to_string(i), 0.0});
    auto folder = RunFolder::create(folder_, infos, true);
    ASSERT_TRUE(folder);
    const RegimeTrack chosen({"static", "dynamic"}, {{error_time(0.0), error_time(kRestEnds_s), 0},
                                                     {error_time(kMotionBegins_s), error_time(60.0), 1}});
    auto rows = error_spools(folder_);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      for (std::int64_t k = 0; k < kErrorRows[i]; ++k) rows[i].add(numbered_row(i, k));
    }
    write_errors(HostTime{}, RunRegimes{chosen, chosen, RegimesBy::kMotion, {}}, scales_, rows, **folder,
                 studied_);
  }

  std::filesystem::path folder_ = test::scratch_folder();
  std::vector<ScaleError> scales_{{{0.1, 0.2, 0.0}, {}}, {}, {}, {}};
  StudiedRows studied_{error_spools(folder_), {}};
};

TEST_F(WrittenErrors, HaveEveryRowInOrderUnderTheNameOfItsRegimeWithTheScaleError) {
  for (std::size_t i = 0; i < kErrorRows.size(); ++i) {
    std::ifstream file(folder_ / ("errors_mtx" + std::to_string(i) + ".csv"));
    std::string line;
    ASSERT_TRUE(std::getline(file, line));
    ASSERT_TRUE(line.starts_with("time_s,utc_s,counter,e_gyro_x_radps,") && line.ends_with(",regime"))
        << line;
    std::int64_t k = 0;
    for (; std::getline(file, line); ++k) {
      std::istringstream cells(line);
      std::vector<std::string> row;
      for (std::string cell; std::getline(cells, cell, ',');) row.push_back(cell);
      ASSERT_EQ(std::stoll(row.at(2)), k) << i;
      ASSERT_EQ(std::stod(row.at(3)), 1e-3 * static_cast<double>(k));
      // An empty last cell is none to getline.
      ASSERT_EQ(row.size() > 9 ? row[9] : "", regime_at(static_cast<double>(k) / kErrorRate_hz)) << line;
    }
    EXPECT_EQ(k, kErrorRows[i]);
  }
}

TEST_F(WrittenErrors, GoOnAsSeriesAndRowsWithoutTheScaleError) {
  for (std::size_t i = 0; i < kErrorRows.size(); ++i) {
    ASSERT_EQ(studied_.rows[i].size(), static_cast<std::size_t>(kErrorRows[i]));
    ASSERT_EQ(studied_.series[i].size(), static_cast<std::size_t>(kErrorRows[i]));
    const auto in_motion = studied_.series[i].mask(0, 1);
    studied_.rows[i].rewind();
    std::int64_t k = 0;
    for (ErrorRow row{}; studied_.rows[i].next(row); ++k) {
      const auto at = static_cast<std::size_t>(k);
      const ErrorRow whole = numbered_row(i, k);
      ASSERT_EQ(row.counter, k);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double without =
            whole.e_gyro_radps[axis] - scales_[i].gyro[axis] * whole.predicted_omega_s_radps[axis];
        ASSERT_DOUBLE_EQ(row.e_gyro_radps[axis], without);
        ASSERT_EQ(studied_.series[i].values(axis)[at], row.e_gyro_radps[axis]);
      }
      ASSERT_EQ(in_motion[at] != 0, regime_at(static_cast<double>(k) / kErrorRate_hz) == "dynamic") << k;
    }
    EXPECT_EQ(k, kErrorRows[i]);
  }
}

/// Counts its end, once it was not moved from.
class EndCounter {
 public:
  explicit EndCounter(std::atomic<int>& ends) : ends_(&ends) {}
  EndCounter(EndCounter&& other) noexcept : ends_(std::exchange(other.ends_, nullptr)) {}
  EndCounter& operator=(EndCounter&&) = delete;
  ~EndCounter() {
    if (ends_ != nullptr) ++*ends_;
  }

 private:
  std::atomic<int>* ends_;
};

TEST(EndsBeside, HasEndedEverythingWhenItIsGone) {
  std::atomic<int> ends{0};
  {
    EndsBeside beside;
    for (int i = 0; i < 3; ++i) beside.end(EndCounter(ends));
  }
  EXPECT_EQ(ends, 3);
}

TEST(EndsBeside, EndsWithItsThreadAndNotOnlyWithTheOthers) {
  std::atomic<int> ends{0};
  EndsBeside beside;
  beside.end(EndCounter(ends));
  const auto patience = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (ends == 0 && std::chrono::steady_clock::now() < patience) std::this_thread::yield();
  EXPECT_EQ(ends, 1);
}

}  // namespace
}  // namespace imuscope
