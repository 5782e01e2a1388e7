#include "results/report/comparison_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/units.h"
#include "results/report/assets.h"
#include "results/report/data_sheet_table.h"
#include "results/report/mounting.h"
#include "results/report/people.h"
#include "results/report/run_files.h"
#include "results/report/sections.h"
#include "results/report/verdict.h"
#include "results/tables/json_fields.h"

namespace imuscope {
namespace report {
namespace {

using tables::number_at;
using tables::numbers_at;
using tables::text_at;

using Three = std::array<double, 3>;

std::string name_of(const RunFiles& run) {
  const std::string folder = std::filesystem::absolute(run.folder).lexically_normal().filename().string();
  const std::string vehicle = text_at(run.run, "name");
  return vehicle.empty() ? folder : fmt::format("{} ({})", folder, vehicle);
}

/// What both runs answer to the same questions.
Html answers(const RunFiles& first, const RunFiles& second) {
  Table table({text("question"), text(name_of(first)), text(name_of(second))});
  const auto add = [&](const char* question, const Verdict& a, const Verdict& b) {
    table.add_row({text(question), element("strong", text(a.headline), css_class_of(a.answer)),
                   element("strong", text(b.headline), css_class_of(b.answer))});
  };
  add("Is the calibration usable?", calibration_verdict(first), calibration_verdict(second));
  add("Are the data sound?", data_verdict(first), data_verdict(second));
  add("Is the noise model adequate?", model_verdict(read_fits(first.models)),
      model_verdict(read_fits(second.models)));
  add("Do rest and motion differ?", difference_verdict(first), difference_verdict(second));
  add("Does the model matter in outages?", outage_verdict(first), outage_verdict(second));
  return element("div", table.html(), "words");
}

/// Beyond this many combined sd two numbers are not the same by chance; of seven numbers of a mounting one in
/// two hundred mountings has one.
constexpr double kApart = 3.2;

/// Difference of two estimates and what it is in combined sd.
Html difference_cell(double difference, std::optional<double> sd_a, std::optional<double> sd_b) {
  if (!sd_a || !sd_b || !(*sd_a > 0.0) || !(*sd_b > 0.0)) return number(difference, 2);
  const double sd = std::hypot(*sd_a, *sd_b);
  const Html words = with_sd(difference, sd) + element("span", text(in_sd(difference, sd)), "aside");
  return std::abs(difference) > kApart * sd ? element("strong", words, "no") : words;
}

std::optional<double> at(const std::optional<Three>& three, std::size_t i, double unit) {
  return three ? std::optional(unit * (*three)[i]) : std::nullopt;
}

Html value_cell(std::optional<double> value, std::optional<double> sd) {
  return value ? with_sd(*value, sd) : text(kUnknown);
}

void add_row(Table& table, const char* name, std::optional<double> a, std::optional<double> sd_a,
             std::optional<double> b, std::optional<double> sd_b) {
  table.add_row({text(name), value_cell(a, sd_a), value_cell(b, sd_b),
                 a && b ? difference_cell(*b - *a, sd_a, sd_b) : text(kUnknown)});
}

/// The mounting of one S-IMU in both runs. Boresights are shown from the first run's nearest square mounting.
void add_mounting(Table& table, const SImuFiles& first, const SImuFiles& second) {
  constexpr std::array<const char*, 3> kBoresight{"boresight about forward, deg", "about right, deg",
                                                  "about down, deg"};
  constexpr std::array<const char*, 3> kLeverArm{"lever arm forward, mm", "right, mm", "down, mm"};
  const auto C_a = numbers_at<9>(first.calibration, "C_b_s");
  const auto C_b = numbers_at<9>(second.calibration, "C_b_s");
  std::optional<Three> psi_a;
  std::optional<Three> psi_b;
  if (C_a) psi_a = boresight_deg(nearest_square_mounting(*C_a), *C_a);
  if (C_a && C_b) {
    // The difference is the rotation between both, whatever the square mounting is.
    const Angles apart = boresight_deg(*C_a, *C_b);
    psi_b = *psi_a;
    for (std::size_t i = 0; i < apart.size(); ++i) (*psi_b)[i] += apart[i];
  }
  const auto sd_psi_a = numbers_at<3>(first.calibration, "boresight_sd_deg");
  const auto sd_psi_b = numbers_at<3>(second.calibration, "boresight_sd_deg");
  const auto r_a = numbers_at<3>(first.calibration, "r_bs_b_m");
  const auto r_b = numbers_at<3>(second.calibration, "r_bs_b_m");
  const auto sd_r_a = numbers_at<3>(first.calibration, "r_bs_b_sd_m");
  const auto sd_r_b = numbers_at<3>(second.calibration, "r_bs_b_sd_m");
  for (std::size_t i = 0; i < 3; ++i)
    add_row(table, kBoresight[i], at(psi_a, i, 1.0), at(sd_psi_a, i, 1.0), at(psi_b, i, 1.0),
            at(sd_psi_b, i, 1.0));
  for (std::size_t i = 0; i < 3; ++i) {
    add_row(table, kLeverArm[i], at(r_a, i, kMmPerM), at(sd_r_a, i, kMmPerM), at(r_b, i, kMmPerM),
            at(sd_r_b, i, kMmPerM));
  }
  const auto in_ms = [](std::optional<double> seconds) {
    return seconds ? std::optional(kMsPerS * *seconds) : seconds;
  };
  add_row(table, "time offset, ms", in_ms(number_at(first.calibration, "t_d_s")),
          in_ms(number_at(first.calibration, "t_d_sd_s")), in_ms(number_at(second.calibration, "t_d_s")),
          in_ms(number_at(second.calibration, "t_d_sd_s")));
}

const SImuFiles* find_study(const RunFiles& run, const std::string& name) {
  const auto found = std::find_if(run.studies.begin(), run.studies.end(),
                                  [&](const SImuFiles& study) { return study.name == name; });
  return found == run.studies.end() ? nullptr : &*found;
}

Html mountings(const RunFiles& first, const RunFiles& second) {
  Table table({text("± one sd"), text(name_of(first)), text(name_of(second)), text("second minus first")});
  std::vector<std::string> alone;
  for (const SImuFiles& study : first.studies) {
    const SImuFiles* other = find_study(second, study.name);
    if (other == nullptr) {
      alone.push_back(fmt::format("{} is in {} only.", study.name, name_of(first)));
      continue;
    }
    table.add_group(text(study.name));
    add_mounting(table, study, *other);
  }
  for (const SImuFiles& study : second.studies) {
    if (find_study(first, study.name) == nullptr)
      alone.push_back(fmt::format("{} is in {} only.", study.name, name_of(second)));
  }
  return (table.empty() ? paragraph("No S-IMU is in both runs.") : table.html()) + list_of(alone);
}

/// Random walks of every axis of an S-IMU that is in both.
Html noises(const RunFiles& first, const RunFiles& second) {
  const auto regimes = particular_regimes(regimes_of(read_fits(first.models)));
  Table table({text("random walk"), text(name_of(first)), text(name_of(second))});
  for (const SImuFiles& study : first.studies) {
    if (find_study(second, study.name) == nullptr) continue;
    for (const std::string& regime : regimes) {
      const auto a = axis_fits(first, study.name, regime);
      const auto b = axis_fits(second, study.name, regime);
      if (a.empty() || b.empty()) continue;
      table.add_group(text(study.name + ", " + (regime.empty() ? "all" : regime)));
      for (const char* axis : kAxes)
        table.add_row({text(axis_words(axis)), random_walk_cell(a, axis), random_walk_cell(b, axis)});
    }
  }
  return table.empty() ? paragraph("No noise model of the same S-IMU and regime is in both runs.")
                       : table.html();
}

std::string page_of(const RunFiles& first, const RunFiles& second) {
  const std::string title = name_of(first) + " beside " + name_of(second);
  Html body = element("header", element("h1", text(title)) + paragraph("imuscope: two runs compared"));
  body += element("section", heading("in-short", "In short") + answers(first, second));
  body += element("section",
                  heading("mounting", "Mountings") +
                      paragraph("Differences beyond 3.2 of their combined sd are marked: the mounting moved, "
                                "or one of the runs is wrong about it.") +
                      mountings(first, second));
  body += element("section", heading("noise", "Noise") + noises(first, second));
  body += element("section", heading("health", "Devices") + element("h3", text(name_of(first))) +
                                 device_table(first) + element("h3", text(name_of(second))) +
                                 device_table(second));
  return page_without_script(title, body);
}

}  // namespace
}  // namespace report

Result<std::string> comparison_page(const std::filesystem::path& first, const std::filesystem::path& second) {
  const auto a = report::read_run_files(first);
  if (!a) return tl::unexpected<Error>(a.error());
  const auto b = report::read_run_files(second);
  if (!b) return tl::unexpected<Error>(b.error());
  return report::page_of(*a, *b);
}

}  // namespace imuscope
