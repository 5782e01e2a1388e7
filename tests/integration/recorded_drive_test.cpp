/// Real drives with a real sensor, from CSV files to noise models, by the program and the committed
/// configuration. Known values come with the recordings: independent batch estimates over many drives.

#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>

#include "demo_vehicle.h"
#include "mounting_compare.h"
#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

const Matrix3d kFluToFrd = Vector3d(1.0, -1.0, -1.0).asDiagonal();
constexpr double kDeg = 180.0 / 3.14159265358979323846;

struct KnownDrive {
  const char* name;
  double t_d_s;  ///< to be added to the study clock
};

Matrix3d known_C_b_s() { return (kFluToFrd * from_zyx_deg(-1.93, 0.20, -93.63)).transpose(); }
Vector3d known_r_bs_b_m() { return kFluToFrd * Vector3d(0.002, 0.038, 0.154); }

int process(const std::filesystem::path& drive, const std::filesystem::path& study,
            const std::filesystem::path& out,
            const std::filesystem::path& config = source_path("config/csv_drive.toml")) {
  return run_program("imuscope",
                     {"process", "reference=" + (drive / "reference_imu.csv").string(),
                      "gnss=" + (drive / "gnss.csv").string(), "dot=" + study.string(), "--config",
                      config.string(), "--out", out.string()},
                     out.string() + ".log");
}

class RecordedDrive : public testing::TestWithParam<KnownDrive> {};

TEST_P(RecordedDrive, GivesTheKnownMountingLeverArmAndTimeOffsetWithoutAnyPrior) {
  IMUSCOPE_NEEDS_SHARED("data/car_drive");
  const auto drive = shared_path("data/car_drive") / GetParam().name;
  const auto out = scratch_folder() / "run";
  ASSERT_EQ(process(drive, drive / "study_imu.csv", out), 0) << read_text(out.string() + ".log");

  const auto calibration = read_json(out / "calibration.json");
  const auto& imu = calibration.at("imus").at(0);
  const Vector3d psi_deg = kDeg * rotation_between_b(known_C_b_s(), matrix_of(imu.at("C_b_s")));
  const Vector3d r_mm = 1e3 * (vector_of(imu.at("r_bs_b_m")) - known_r_bs_b_m());
  // Within three published sd and the known values' spread over drives (in b; the study's x lies along the
  // reference's y), with sd that are neither nothing nor everything.
  const Vector3d spread_deg(0.18, 0.05, 0.08);
  for (int i = 0; i < 3; ++i) {
    const double psi_sd_deg = vector_of(imu.at("boresight_sd_deg"))[i];
    const double r_sd_mm = 1e3 * vector_of(imu.at("r_bs_b_sd_m"))[i];
    EXPECT_LT(std::abs(psi_deg[i]), 3.0 * psi_sd_deg + spread_deg[i]) << "boresight axis " << i;
    EXPECT_LT(std::abs(r_mm[i]), 3.0 * r_sd_mm + 4.0) << "lever arm axis " << i;
    EXPECT_LT(psi_sd_deg, 0.5);
    EXPECT_LT(r_sd_mm, 20.0);
  }
  EXPECT_NEAR(imu.at("t_d_s").get<double>(), GetParam().t_d_s,
              3.0 * imu.at("t_d_sd_s").get<double>() + 0.001);
  EXPECT_GT(imu.at("t_d_sd_s").get<double>(), 0.0);

  // The error process and, for every axis over the whole drive, wavelet variance and model.
  EXPECT_GT(std::filesystem::file_size(out / "errors_dot.csv"), 1'000'000U);
  std::set<std::string> axes;
  const auto models = read_json(out / "models.json");
  for (const auto& model : models.at("models")) {
    if (model.at("regime") != "all") continue;
    axes.insert(model.at("axis").get<std::string>());
    EXPECT_EQ(model.at("model"), "QN+WN+GM") << "as config/csv_drive.toml has it";
    EXPECT_GE(model.at("wv").size(), 10U);
  }
  EXPECT_EQ(axes.size(), 6U);
  EXPECT_TRUE(std::filesystem::exists(out / "report.html"));
}

INSTANTIATE_TEST_SUITE_P(Car, RecordedDrive,
                         testing::Values(KnownDrive{"02", 0.253}, KnownDrive{"07", 0.035},
                                         KnownDrive{"08", -0.075}),
                         [](const auto& drive) { return std::string("Drive") + drive.param.name; });

/// The study file with its axes named anew: x' = y, y' = z, z' = x.
void write_permuted(const std::filesystem::path& from, const std::filesystem::path& to) {
  std::ifstream in(from);
  std::ofstream out(to);
  std::string line;
  std::getline(in, line);
  out << line << '\n';
  while (std::getline(in, line)) {
    std::vector<std::string> f;
    std::istringstream fields(line);
    for (std::string field; std::getline(fields, field, ',');) f.push_back(field);
    out << f[0] << ',' << f[1] << ',' << f[3] << ',' << f[4] << ',' << f[2] << ',' << f[6] << ',' << f[7]
        << ',' << f[5] << '\n';
  }
}

TEST(PermutedDrive, WithTheStudyAxesPermutedGivesTheCorrespondinglyRotatedAnswer) {
  IMUSCOPE_NEEDS_SHARED("data/car_drive");
  const auto drive = shared_path("data/car_drive/08");
  const auto folder = scratch_folder();
  const auto permuted = folder / "permuted.csv";
  write_permuted(drive / "study_imu.csv", permuted);
  // The filter's C_b_s goes with the order of axes that may be crooked, too: it is held to straight ones
  // here.
  const auto config = folder / "rigid.toml";
  std::ofstream(config) << read_text(source_path("config/csv_drive.toml"))
                        << "\n[estimator]\nstates = \"rigid\"\n";
  ASSERT_EQ(process(drive, drive / "study_imu.csv", folder / "as_is", config), 0);
  ASSERT_EQ(process(drive, permuted, folder / "permuted", config), 0) << read_text((folder / "permuted.log"));

  Matrix3d P = Matrix3d::Zero();  // takes the old components to the new ones
  P(0, 1) = P(1, 2) = P(2, 0) = 1.0;
  const auto as_is = read_json(folder / "as_is" / "calibration.json").at("imus").at(0);
  const auto turned = read_json(folder / "permuted" / "calibration.json").at("imus").at(0);
  const auto& filtered = as_is.at("filter");
  const auto& turned_filtered = turned.at("filter");
  const Vector3d difference_deg =
      kDeg * rotation_between_b(P * matrix_of(filtered.at("C_b_s")), matrix_of(turned_filtered.at("C_b_s")));
  // Same data, same information: what differs is the order of rounding.
  EXPECT_LT(difference_deg.norm(), 1e-3);
  EXPECT_LT((vector_of(filtered.at("r_bs_b_m")) - vector_of(turned_filtered.at("r_bs_b_m"))).norm(), 1e-4);
  EXPECT_NEAR(filtered.at("t_d_s").get<double>(), turned_filtered.at("t_d_s").get<double>(), 1e-5);
  // The frame of a crooked triad goes with the order of its axes; where the gyros point does not. The priors'
  // own frame goes with it in the second order: a degree of crookedness by a degree.
  const auto axes_of = [](const nlohmann::json& imu) {
    return Matrix3d(matrix_of(imu.at("batch").at("gyro_matrix")) * matrix_of(imu.at("C_b_s")));
  };
  EXPECT_LT(kDeg * (P * axes_of(as_is) - axes_of(turned)).cwiseAbs().maxCoeff(), 0.03);
  EXPECT_LT((vector_of(as_is.at("r_bs_b_m")) - vector_of(turned.at("r_bs_b_m"))).norm(), 1e-3);
}

TEST(SeveralDrives, OfOneMountingGiveOneAnswerThatIsBetterThanEachAndARunFolderEach) {
  IMUSCOPE_NEEDS_SHARED("data/car_drive");
  const auto out = scratch_folder() / "run";
  std::vector<std::string> arguments{"process"};
  for (const char* name : {"02", "07", "08"}) {
    const auto drive = shared_path("data/car_drive") / name;
    arguments.push_back("reference=" + (drive / "reference_imu.csv").string());
    arguments.push_back("gnss=" + (drive / "gnss.csv").string());
    arguments.push_back("dot=" + (drive / "study_imu.csv").string());
  }
  for (const auto& word : {std::string("--config"), source_path("config/csv_drive.toml").string(),
                           std::string("--out"), out.string()})
    arguments.push_back(word);
  ASSERT_EQ(run_program("imuscope", arguments, out.string() + ".log"), 0) << read_text(out.string() + ".log");

  const auto combined = read_json(out / "combined.json");
  EXPECT_EQ(combined.at("method"), "inverse variance");
  const auto& imu = combined.at("imus").at(0);
  EXPECT_EQ(imu.at("drives").size(), 3U);
  EXPECT_EQ(imu.at("homogeneity").at("dof"), 12);
  EXPECT_GT(imu.at("homogeneity").at("p_value").get<double>(), 0.01) << "one car, one mounting";
  const Vector3d psi_deg = kDeg * rotation_between_b(known_C_b_s(), matrix_of(imu.at("C_b_s")));
  const Vector3d r_m = vector_of(imu.at("r_bs_b_m")) - known_r_bs_b_m();
  const Vector3d psi_sd_deg = vector_of(imu.at("boresight_sd_deg"));
  const Vector3d r_sd_m = vector_of(imu.at("r_bs_b_sd_m"));
  // The known values' spread over drives, in b; the study's x lies along the reference's y.
  const Vector3d spread_deg(0.18, 0.05, 0.08);
  for (int i = 0; i < 3; ++i) {
    EXPECT_LT(std::abs(psi_deg[i]), 3.0 * psi_sd_deg[i] + spread_deg[i]) << "boresight axis " << i;
    EXPECT_LT(std::abs(r_m[i]), 3.0 * r_sd_m[i] + 0.004) << "lever arm axis " << i;
  }
  for (const char* folder : {"drive1", "drive2", "drive3"}) {
    const auto of_drive = read_json(out / folder / "calibration.json").at("imus").at(0);
    EXPECT_LT(psi_sd_deg.norm(), vector_of(of_drive.at("boresight_sd_deg")).norm());
    EXPECT_LT(r_sd_m.norm(), vector_of(of_drive.at("r_bs_b_sd_m")).norm());
    EXPECT_EQ(read_json(out / folder / "run.json").at("error_process_mounting"), "of all drives combined");
    EXPECT_TRUE(std::filesystem::exists(out / folder / "report.html"));
    EXPECT_GT(std::filesystem::file_size(out / folder / "smoothed_dot.csv"), 100'000U);
  }
}

/// Value of column `column` at time_s (column 0), by the polynomial through the twelve rows around it: the
/// truth has 10 rows a second, and a straight line between two of them is millimetres per second off on a
/// rough road.
double interpolated(const std::vector<std::vector<double>>& rows, std::size_t column, double time_s) {
  constexpr std::ptrdiff_t kPoints = 12;
  const auto after = std::upper_bound(rows.begin(), rows.end(), time_s,
                                      [](double time, const auto& row) { return time < row[0]; });
  const auto first = std::clamp(after - rows.begin() - kPoints / 2, std::ptrdiff_t{0},
                                static_cast<std::ptrdiff_t>(rows.size()) - kPoints);
  double value = 0.0;
  for (auto i = first; i < first + kPoints; ++i) {
    const auto& row = rows[static_cast<std::size_t>(i)];
    double weight = 1.0;
    for (auto j = first; j < first + kPoints; ++j) {
      const double other_s = rows[static_cast<std::size_t>(j)][0];
      if (j != i) weight *= (time_s - other_s) / (row[0] - other_s);
    }
    value += weight * row[column];
  }
  return value;
}

/// A table of numbers, by the names of its columns; an empty cell is 0.
struct NumberTable {
  std::vector<std::string> names;
  std::vector<std::vector<double>> rows;

  [[nodiscard]] std::size_t column(const std::string& name) const {
    const auto found = std::find(names.begin(), names.end(), name);
    EXPECT_NE(found, names.end()) << name;
    return static_cast<std::size_t>(found - names.begin());
  }
};
NumberTable table_of(const std::filesystem::path& path) {
  NumberTable table;
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);
  std::istringstream header(line);
  for (std::string name; std::getline(header, name, ',');) table.names.push_back(name);
  while (std::getline(in, line)) {
    std::vector<double>& row = table.rows.emplace_back();
    std::istringstream fields(line);
    for (std::string field; std::getline(fields, field, ',');)
      row.push_back(std::strtod(field.c_str(), nullptr));
  }
  return table;
}

/// Mean square of (value - truth) and of the published sd, over the rows of `file` that the truth has, of
/// column `name` and its sd.
struct Scatter {
  double square = 0.0;
  double claimed = 0.0;
  int n = 0;
};
Scatter scatter_against(const std::filesystem::path& file, const std::filesystem::path& truth,
                        const std::string& name) {
  const NumberTable known = table_of(truth);
  const NumberTable found = table_of(file);
  const std::size_t known_column = known.column(name);
  const std::size_t column = found.column(name);
  const std::size_t sd_column = found.column("sd_" + name);
  Scatter scatter;
  for (const auto& row : found.rows) {
    if (row[0] > known.rows.back()[0]) break;
    scatter.square += std::pow(row[column] - interpolated(known.rows, known_column, row[0]), 2);
    scatter.claimed += std::pow(row[sd_column], 2);
    ++scatter.n;
  }
  return scatter;
}

TEST(SimulatedDrive, FromRawBytesFindsTheTruthWithinItsStandardDeviations) {
  const auto folder = scratch_folder();
  const auto recording = folder / "recording";
  ASSERT_EQ(run_program("imusim",
                        {"record", source_path("config/demo.toml").string(), "--minutes", "8", "--seed", "11",
                         "--out", recording.string()},
                        folder / "imusim.log"),
            0)
      << read_text(folder / "imusim.log");
  const auto process_with = [&](const std::filesystem::path& config, const std::string& run) {
    std::vector<std::string> arguments{"process"};
    for (const char* name : {"airins", "mtx1", "mtx2", "mtx3", "gnss"})
      arguments.push_back(std::string(name) + "=" + (recording / (std::string(name) + ".bin")).string());
    arguments.insert(arguments.end(), {"--config", config.string(), "--out", (folder / run).string()});
    const auto log = folder / (run + ".log");
    EXPECT_EQ(run_program("imuscope", arguments, log), 0) << read_text(log);
  };
  process_with(recording / "config.toml", "run");
  // These sensors are as straight as the filter of 19 states takes them to be: it has the goals of before.
  process_with(DemoVehicle().set("estimator.states", "rigid").write(recording / "rigid.toml"), "rigid");

  const auto found = read_json(folder / "run" / "calibration.json").at("imus");
  const auto straight = read_json(folder / "rigid" / "calibration.json").at("imus");
  const auto truth = read_json(recording / "truth.json").at("imus");
  ASSERT_EQ(found.size(), 3U);
  ASSERT_EQ(straight.size(), 3U);
  // 21 numbers of one seed: 4 sd is exceeded by chance once in a thousand such runs.
  constexpr double kSds = 4.0;
  const auto expect_truth = [](const nlohmann::json& one, const nlohmann::json& truth_of_it) {
    const Vector3d psi_deg =
        kDeg * rotation_between_b(matrix_of(truth_of_it.at("C_b_s")), matrix_of(one.at("C_b_s")));
    const Vector3d r_m = vector_of(one.at("r_bs_b_m")) - vector_of(truth_of_it.at("r_bs_b_m"));
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_LT(std::abs(psi_deg[axis]), kSds * vector_of(one.at("boresight_sd_deg"))[axis]);
      EXPECT_LT(std::abs(r_m[axis]), kSds * vector_of(one.at("r_bs_b_sd_m"))[axis]);
    }
  };
  for (std::size_t i = 0; i < 3; ++i) {
    ASSERT_EQ(found[i].at("name"), truth[i].at("name"));
    expect_truth(found[i], truth[i]);
    const auto& filtered = found[i].at("filter");
    expect_truth(filtered, truth[i]);
    // The sensor's axes may be crooked by 0.1 deg, and the drive does not show everything of it.
    for (const nlohmann::json* one : {&found[i], &filtered}) {
      for (const double sd_deg : vector_of(one->at("boresight_sd_deg"))) EXPECT_LT(sd_deg, 0.12);
      EXPECT_NEAR(one->at("t_d_s").get<double>(), truth[i].at("t_d_s").get<double>(),
                  kSds * one->at("t_d_sd_s").get<double>());
      EXPECT_LT(one->at("t_d_sd_s").get<double>(), 1e-3);
    }

    const auto& of_straight = straight[i].at("filter");
    expect_truth(of_straight, truth[i]);
    for (const double sd_deg : vector_of(of_straight.at("boresight_sd_deg")))
      EXPECT_LT(sd_deg, 0.020) << "the drive shows more than that";
    // Clock maps of both devices wander by up to 0.1 ms beside the estimate's own sd.
    EXPECT_NEAR(of_straight.at("t_d_s").get<double>(), truth[i].at("t_d_s").get<double>(), 2e-4);

    // The paper's mean of smoothed values is the end value again, with an sd that is far too small.
    const auto& mean = found[i].at("weighted_mean");
    const Vector3d apart_deg =
        kDeg * rotation_between_b(matrix_of(mean.at("C_b_s")), matrix_of(filtered.at("C_b_s")));
    EXPECT_GT(mean.at("n").get<int>(), 2000);
    for (int axis = 0; axis < 3; ++axis) {
      const double sd_deg = vector_of(filtered.at("boresight_sd_deg"))[axis];
      EXPECT_LT(std::abs(apart_deg[axis]), sd_deg);
      EXPECT_LT(vector_of(mean.at("claimed_boresight_sd_deg"))[axis], 0.1 * sd_deg);
    }
    EXPECT_EQ(found[i].at("observability").at("states").size(), 7U);
    EXPECT_FALSE(found[i].at("observability").at("weakest").at("words").get<std::string>().empty());
  }
  // Velocity smoothed over the drive: better than the filter's, and as good as claimed.
  for (const char* velocity : {"v_n_mps", "v_e_mps", "v_d_mps"}) {
    const auto filtered =
        scatter_against(folder / "run" / "navigation.csv", recording / "truth.csv", velocity);
    const auto smoothed =
        scatter_against(folder / "run" / "smoothed_navigation.csv", recording / "truth.csv", velocity);
    ASSERT_GT(smoothed.n, 2000);
    EXPECT_LT(smoothed.square / smoothed.n, 0.7 * filtered.square / filtered.n) << velocity;
    EXPECT_LT(smoothed.square, 4.0 * smoothed.claimed) << velocity;
    EXPECT_GT(smoothed.square, 0.1 * smoothed.claimed) << velocity;
  }
}

}  // namespace
}  // namespace imuscope::test
