/// A run folder one of whose files is not as a run wrote it. The first byte of the input says which file, the
/// next two where, the fourth how much is missing there, and the rest is what stands there instead.

#include <array>
#include <string_view>

#include "results/report/report.h"
#include "tests/fuzz/folder_in_memory.h"

namespace imuscope::fuzz {
namespace {

std::span<const std::uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

struct File {
  const char* name;
  std::string_view content;
};

/// The files of a run with one S-IMU, with little in them.
constexpr std::array kFiles{
    File{"calibration.json",
         R"({"schema":"imuscope.calibration/1","imus":[{"name":"m","status":"calibrated","t_d_s":0.001,)"
         R"("C_b_s":[1,0,0,0,1,0,0,0,1],"boresight_sd_deg":[0.1,0.1,0.1],"r_bs_b_m":[1,2,3],)"
         R"("r_bs_b_sd_m":[0.1,0.1,0.1],"t_d_sd_s":1e-5,"observability":null}]})"},
    File{"run.json",
         R"({"schema":"imuscope.run/1","duration_s":10,"t0_utc":"2026-01-01T00:00:00Z","devices":)"
         R"([{"name":"m","bytes":9,"samples":3,"bytes_skipped":1,"samples_lost":0}],"warnings":["w"]})"},
    File{"models.json",
         R"({"models":[{"name":"m","axis":"gyro_x","regime":"static","unit":"rad/s","n":9,"rate_hz":100,)"
         R"("model":"WN","weights":"w","wv":[{"level":1,"tau_s":0.02,"value":1e-6,"ci_low":1e-7,)"
         R"("ci_high":1e-5,"n_coefficients":4,"fitted":1e-6,"model_ci_low":null,"model_ci_high":null}],)"
         R"("parameters":[{"process":"WN","name":"sigma2","unit":"(rad/s)^2","value":1e-6,"sd":1e-7,)"
         R"("ci_low":1e-7,"ci_high":1e-5}],"covariance":[1],"objective":1,"model_error":0,"j_test":null,)"
         R"("criterion":1,"identifiable":true,"simpler_model":"","warnings":[]}]})"},
    File{"regression.json",
         R"({"regressions":[{"name":"m","axis":"gyro_x","method":"ols","projected":false}]})"},
    File{"regimes.json", R"({"regimes":[{"name":"static","total_s":5,"longest_s":5}],"remarks":[]})"},
    File{"comparison.json", R"({"comparisons":[]})"},
    File{"dependence.json", R"({"dependence":[]})"},
    File{"vibration.json", R"({"vibration":[]})"},
    File{"evaluation.json", R"({"evaluations":[],"absent":[]})"},
    File{"truth.json", R"({"imus":[{"name":"m","C_b_s":[1,0,0,0,1,0,0,0,1],"r_bs_b_m":[1,2,3],"t_d_s":0}]})"},
    File{"navigation.csv",
         "time_s,lat_deg,lon_deg,height_m,v_n_mps,v_e_mps,sd_n_m,sd_e_m,sd_d_m\n"
         "0,46,6,400,1,0,0.1,0.1,0.1\n1,46,6,400,1,0,0.1,0.1,0.1\n"},
    File{"odometry.csv",
         "time_s,speed_mps,standing,zero_velocity,scale_percent,sd_scale_percent\n0,1,0,0,0,1\n"},
    File{"calibration_m.csv",
         "time_s,psi_x_deg,psi_y_deg,psi_z_deg,r_x_m,r_y_m,r_z_m,t_d_ms,sd_psi_x_deg,sd_psi_y_deg,"
         "sd_psi_z_deg,sd_r_x_m,sd_r_y_m,sd_r_z_m,sd_t_d_ms\n0,1,2,3,4,5,6,7,1,2,3,4,5,6,7\n"},
    File{"errors_m.csv",
         "time_s,e_gyro_x_radps,e_gyro_y_radps,e_gyro_z_radps,e_accel_x_mps2,e_accel_y_mps2,"
         "e_accel_z_mps2,regime\n0,1,2,3,4,5,6,static\n0.1,1,2,3,4,5,6,dynamic\n"},
    File{"scatter_m.csv", ""},
};

void put(const FolderInMemory& folder, const File& file) {
  if (!file.content.empty()) folder.put(file.name, bytes_of(file.content));
}

constexpr std::size_t kChoices = 4;  ///< bytes before what is put in

std::string damaged_content(const File& file, std::span<const std::uint8_t> input) {
  const std::size_t at = (input[1] | std::size_t{input[2]} << 8U) % (file.content.size() + 1);
  std::string content(file.content.substr(0, at));
  content.append(reinterpret_cast<const char*>(input.data()) + kChoices, input.size() - kChoices);
  content.append(file.content.substr(std::min(at + input[3], file.content.size())));
  return content;
}

}  // namespace
}  // namespace imuscope::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  using namespace imuscope::fuzz;
  static const FolderInMemory folder;
  static const bool whole = [] {
    for (const File& file : kFiles) put(folder, file);
    const auto report = write_report(folder.path());
    if (!report) std::fprintf(stderr, "%s\n", report.error().text().c_str());
    return report.has_value();
  }();
  require(whole, "the run that the inputs damage makes a report");
  if (size < kChoices) return 0;
  const File& damaged = kFiles[data[0] % kFiles.size()];
  folder.put(damaged.name, bytes_of(damaged_content(damaged, {data, size})));
  const auto report = write_report(folder.path());
  require(report.has_value() || !report.error().what.empty(), "an error says what is wrong");
  std::filesystem::remove(folder.path() / damaged.name);
  put(folder, damaged);
  return 0;
}
