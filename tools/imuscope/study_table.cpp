#include "study_table.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/calibration_levels.h"
#include "base/digits.h"
#include "base/grouped.h"
#include "base/json_text.h"
#include "base/units.h"
#include "print.h"
#include "results/tables/json_file.h"

namespace imuscope::cli {

namespace {

using nlohmann::json;

std::optional<json> read(const std::filesystem::path& file) {
  auto document = tables::read_json_file(file);
  if (document.is_discarded()) return std::nullopt;
  return document;
}

using Row = std::array<double, 9>;

Row matrix(const json& value) {
  Row m{};
  for (std::size_t i = 0; i < m.size(); ++i) m[i] = value.at(i).get<double>();
  return m;
}

/// Rotation vector in b that takes `from` to `to`: Log(from^T to), for small angles from its skew part.
std::array<double, 3> small_rotation_b(const Row& from, const Row& to) {
  Row d{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t k = 0; k < 3; ++k) d[3 * i + j] += from[3 * k + i] * to[3 * k + j];
    }
  }
  return {0.5 * (d[7] - d[5]), 0.5 * (d[2] - d[6]), 0.5 * (d[3] - d[1])};
}

/// zyx Euler angles of C_b_s, degrees: what a person can picture.
std::array<double, 3> euler_deg(const Row& C) {
  return {std::atan2(C[7], C[8]) * kDegPerRad, -std::asin(std::clamp(C[6], -1.0, 1.0)) * kDegPerRad,
          std::atan2(C[3], C[0]) * kDegPerRad};
}

const json* by_name(const json& document, const std::string& name) {
  for (const auto& imu : document.at("imus")) {
    if (imu.at("name") == name) return &imu;
  }
  return nullptr;
}

/// What the motion has not shown has no number: the words below the table say so.
bool is_observable(const json& imu, const std::string& state) {
  return !imu.contains("observable") || imu.at("observable").value(state, true);
}

/// @param quantity  "psi" or "r": components that are not observable are left out
std::string triple(const json& imu, const char* key, const std::string& quantity, double unit, int digits) {
  std::string text;
  for (std::size_t i = 0; i < 3; ++i) {
    const bool shown = is_observable(imu, quantity + "_" + "xyz"[i]);
    const double value = imu.at(key).at(i).get<double>() * unit;
    text +=
        (i == 0 ? "" : " ") + (shown ? fmt::format("{:9.{}f}", value, digits) : fmt::format("{:>9}", "-"));
  }
  return text;
}

void print_observability(const json& imu) {
  if (!imu.contains("observability") || !imu.at("observability").is_object()) return;
  const json& observability = imu.at("observability");
  std::vector<std::string> unseen;
  for (const auto& state : observability.at("states")) {
    if (!state.at("observable").get<bool>()) unseen.push_back(state.at("words"));
  }
  if (!unseen.empty()) say("  not observable yet: {}\n", fmt::join(unseen, ", "));
  say("  least is known of  {}\n", observability.at("weakest").at("words").get<std::string>());
  if (observability.contains("limited_by"))
    say("  limited            {}\n", observability.at("limited_by").get<std::string>());
  if (!observability.at("advice").is_null())
    say("  what would help    {}\n", observability.at("advice").get<std::string>());
}

void print_truth(const json& imu, const json& truth) {
  const auto error = small_rotation_b(matrix(truth.at("C_b_s")), matrix(imu.at("C_b_s")));
  say("    boresight error  {:9.1f} {:9.1f} {:9.1f}  mdeg  (found minus true)\n", error[0] * kMdegPerRad,
      error[1] * kMdegPerRad, error[2] * kMdegPerRad);
  const auto& r = imu.at("r_bs_b_m");
  const auto& t = truth.at("r_bs_b_m");
  say("    lever-arm error  {:9.2f} {:9.2f} {:9.2f}  mm    (found minus true)\n",
      (r.at(0).get<double>() - t.at(0).get<double>()) * 1e3,
      (r.at(1).get<double>() - t.at(1).get<double>()) * 1e3,
      (r.at(2).get<double>() - t.at(2).get<double>()) * 1e3);
  say("    time-offset error{:9.3f}                      ms    (found minus true, {:.3f} ms)\n",
      (imu.at("t_d_s").get<double>() - truth.at("t_d_s").get<double>()) * 1e3,
      truth.at("t_d_s").get<double>() * 1e3);
}

double largest(const json& imu, const char* key) {
  double most = 0.0;
  for (const auto& value : imu.at(key)) most = std::max(most, value.get<double>());
  return most;
}

/// "usable with limits: boresight 0.25 deg (0.1 wanted)".
std::string usability_words(const json& imu) {
  if (!has_estimate(imu.at("status").get<std::string>())) return "not usable: no mounting was found";
  const double boresight_rad = largest(imu, "boresight_sd_deg") * kRadPerDeg;
  const double lever_arm_m = largest(imu, "r_bs_b_sd_m");
  const double time_offset_s = imu.at("t_d_sd_s").get<double>();
  const Usability usability = usability_of(boresight_rad, lever_arm_m, time_offset_s);
  std::vector<std::string> limits;
  const auto limit = [&](const char* what, double sd, double wanted, double unit, const char* name) {
    if (!(sd <= wanted))
      limits.push_back(fmt::format("{} sd {} {} ({:g} wanted)", what, digits_beside(sd * unit, wanted * unit),
                                   name, wanted * unit));
  };
  limit("boresight", boresight_rad, kUsableBoresightSd_rad, kDegPerRad, "deg");
  limit("lever arm", lever_arm_m, kUsableLeverArmSd_m, kMmPerM, "mm");
  limit("time offset", time_offset_s, kUsableTimeOffsetSd_s, kMsPerS, "ms");
  if (limits.empty()) return std::string(words_of(usability));
  return fmt::format("{}: {}", words_of(usability), fmt::join(limits, ", "));
}

void print_imu(const json& imu, const std::optional<json>& truth) {
  const std::string name = imu.at("name");
  say("\n{}  ({})\n", name, usability_words(imu));
  const auto angles = euler_deg(matrix(imu.at("C_b_s")));
  say("  C_b_s, zyx Euler x y z {:9.3f} {:9.3f} {:9.3f}  deg\n", angles[0], angles[1], angles[2]);
  say("    sd               {}  mdeg\n", triple(imu, "boresight_sd_deg", "psi", 1e3, 1));
  say("  lever arm b, x y z {}  mm\n", triple(imu, "r_bs_b_m", "r", 1e3, 2));
  say("    sd               {}  mm\n", triple(imu, "r_bs_b_sd_m", "r", 1e3, 2));
  if (is_observable(imu, "t_d")) {
    say("  time offset        {:9.3f}  sd {:.3f}  ms\n", imu.at("t_d_s").get<double>() * 1e3,
        imu.at("t_d_sd_s").get<double>() * 1e3);
  }
  print_observability(imu);
  if (!truth) return;
  if (const auto* true_imu = by_name(*truth, name)) print_truth(imu, *true_imu);
}

std::string number(const json& value) {
  return value.is_null() ? "-" : fmt::format("{:.4g}", value.get<double>());
}

void print_model(const json& models) {
  if (models.at("models").empty()) return;
  const auto& all = models.at("models");
  const auto dynamic =
      std::find_if(all.begin(), all.end(), [](const json& m) { return m.at("regime") == "dynamic"; });
  const json& model = dynamic != all.end() ? *dynamic : all.front();
  say("\nNoise model of {} {}, {} ({}{}):\n", model.at("name").get<std::string>(),
      model.at("axis").get<std::string>(), model.at("regime").get<std::string>(),
      model.at("model").get<std::string>(), model.at("identifiable").get<bool>() ? "" : ", not identifiable");
  for (const auto& p : model.at("parameters")) {
    say("  {:<4} {:<7} {:>11}  [{}, {}]  {}\n", p.at("process").get<std::string>(),
        p.at("name").get<std::string>(), number(p.at("value")), number(p.at("ci_low")),
        number(p.at("ci_high")), p.at("unit").get<std::string>());
  }
}

/// What was read of each device: a recording that ends early or holds foreign bytes shows here.
void print_devices(const json& devices) {
  say("\n");
  for (const auto& device : devices) {
    const auto count = [&](const char* key) { return device.at(key).get<std::int64_t>(); };
    if (count("bytes") == 0) continue;
    say("{:<10} {} samples in {} bytes", device.at("name").get<std::string>(), count("samples"),
        count("bytes"));
    if (count("bytes_skipped") > 0) say(", {} of them in no valid message", count("bytes_skipped"));
    if (count("samples_lost") > 0) say("; {} samples are missing", count("samples_lost"));
    say("\n");
  }
}

/// The first of them; a short record can have one for every axis and regime, all of them in the report.
void print_sentences(const char* word, const json& all, const std::vector<std::string>& names) {
  constexpr std::size_t kPrintedMax = 8;
  const auto sentences = grouped_by_name(all.get<std::vector<std::string>>(), names);
  const std::size_t printed = std::min(sentences.size(), kPrintedMax);
  if (printed > 0) say("\n");
  for (std::size_t i = 0; i < printed; ++i) say("{}: {}\n", word, sentences[i]);
  if (printed < sentences.size())
    say("{}: {} more, in run.json and the report\n", word, sentences.size() - printed);
}

Result<void> print_documents(const std::filesystem::path& run_folder, bool as_json) {
  const auto calibration = read(run_folder / "calibration.json");
  const auto models = read(run_folder / "models.json");
  const auto run = read(run_folder / "run.json");
  const auto truth = read(run_folder / "truth.json");
  if (!calibration || !run) {
    return work_error(fmt::format("{} does not hold a finished run", run_folder.string()), "run it again");
  }
  if (as_json) {
    json all{{"schema", "imuscope.summary/1"}, {"run", *run}, {"calibration", *calibration}};
    all["models"] = models.value_or(json(nullptr));
    say("{}\n", json_text(all));
    return {};
  }
  print_devices(run->at("devices"));
  for (const auto& imu : calibration->at("imus")) print_imu(imu, truth);
  if (models) print_model(*models);
  std::vector<std::string> names;
  for (const auto& imu : calibration->at("imus")) names.push_back(imu.at("name"));
  print_sentences("Warning", run->at("warnings"), names);
  print_sentences("Note", run->value("notes", json::array()), names);
  const auto report = run_folder / "report.html";
  say("\nResults: {}\n", run_folder.string());
  if (std::filesystem::exists(report)) say("Report:  {}\n", report.string());
  return {};
}

}  // namespace

Result<void> print_study(const std::filesystem::path& run_folder, bool as_json) {
  return tables::with_documents_of(run_folder, [&] { return print_documents(run_folder, as_json); });
}

}  // namespace imuscope::cli
