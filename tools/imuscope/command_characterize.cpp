#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>

#include "base/json_text.h"
#include "base/output_folder.h"
#include "certificate_table.h"
#include "commands.h"
#include "long_pieces.h"
#include "models/certificate/data_sheet.h"
#include "models/certificate/joint_axes.h"
#include "models/certificate/json.h"
#include "models/certificate/units.h"
#include "models/noise/covariance_table.h"
#include "models/noise/holm.h"
#include "print.h"
#include "progress.h"
#include "record_files.h"
#include "results/page/printed_page.h"
#include "results/report/certificate_page.h"
#include "results/tables/json_file.h"

namespace imuscope::cli {
namespace {

constexpr const char* kPage = "certificate.html";
constexpr const char* kDocument = "certificate.json";

struct CharacterizeCommand {
  std::vector<std::filesystem::path> files;
  RecordChoice choice;
  std::vector<std::string> axes;  ///< as typed, "gyro_x=wx"
  certificate::AxisOptions how;
  std::string sensor;
  std::filesystem::path out = "certificate";
  std::filesystem::path data_sheet;  ///< empty: none
  std::string part;
  bool no_page = false;
  bool pdf = false;
  std::optional<TableFormat> table;
  bool force = false;
  bool json = false;
};

std::string now_utc() {
  const auto now = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(now));
}

Result<void> parse_axes(CharacterizeCommand& options) {
  for (const std::string& text : options.axes) {
    const std::size_t equals = text.find('=');
    const std::string axis = text.substr(0, equals);
    constexpr std::array<std::string_view, 6> kNames{"gyro_x",  "gyro_y",  "gyro_z",
                                                     "accel_x", "accel_y", "accel_z"};
    if (equals == std::string::npos || std::find(kNames.begin(), kNames.end(), axis) == kNames.end()) {
      return usage_error(fmt::format("--axis {} is not understood", text),
                         "write AXIS=COLUMN, AXIS one of gyro_x, gyro_y, gyro_z, accel_x, accel_y, accel_z");
    }
    options.choice.axes[axis] = text.substr(equals + 1);
  }
  return {};
}

/// A page of somebody else's is left alone.
Result<void> may_write(const CharacterizeCommand& options) {
  if (options.no_page || options.force || !std::filesystem::exists(options.out / kPage)) return {};
  const auto ours = tables::read_json_file(options.out / kDocument);
  if (ours.is_object() && ours.value("schema", "").starts_with("imuscope.certificate/")) return {};
  return usage_error(
      fmt::format("{} is there and was not written by this command", (options.out / kPage).string()),
      "name another folder with --out, or write over it with --force");
}

std::string shown_term(const certificate::TermValue& term) {
  if (term.knowledge == noise::Knowledge::kUnknown || !std::isfinite(term.value)) return "-";
  if (term.knowledge == noise::Knowledge::kBound) return fmt::format("below {:.3g}", term.value);
  if (!term.ci_low || !term.ci_high) return fmt::format("{:.4g}", term.value);
  return fmt::format("{:.4g} [{:.4g}, {:.4g}]", term.value, *term.ci_low, *term.ci_high);
}

void print_axis(const certificate::AxisCertificate& axis) {
  say("{}: {}", axis.name, axis.fit.spec.name());
  if (axis.largest_miss > 0.0)
    say(", which stays within {:.2g} % of the interval of every scale", 100.0 * axis.largest_miss);
  say("\n");
  for (const auto& term : axis.terms) {
    say("  {} {:<24} {:<28} {:<16} {}\n", symbol_of(term.term), name_of(term.term, is_gyro(axis.unit)),
        shown_term(term), term.unit, term.knowledge == noise::Knowledge::kFitted ? term.note : "");
  }
  for (const auto& line : axis.lines) say("  {}\n", in_words(line, unit_name(axis.unit)));
  for (const auto& r : axis.resonances) say("  {}\n", in_words(r, unit_name(axis.unit)));
  if (axis.low_pass_hz) say("  bandwidth ends at {:.3g} Hz\n", *axis.low_pass_hz);
  if (axis.temperature) {
    say("  bias {:.3g} +- {:.2g} {} per degC, {:.1f} to {:.1f} degC\n", axis.temperature->bias_per_c,
        axis.temperature->bias_per_c_sd, unit_name(axis.unit), axis.temperature->lowest_c,
        axis.temperature->highest_c);
  }
}

/// Samples a mean, so that a long record's axes lie in memory side by side. A power of two.
constexpr std::size_t kMostTogether = std::size_t{1} << 21U;

std::size_t samples_a_mean(std::size_t samples) {
  std::size_t together = 1;
  while (samples / together > kMostTogether) together *= 2;
  return together;
}

/// Means of so many samples, one after the other.
std::vector<double> means_of(const std::vector<double>& x, std::size_t together) {
  std::vector<double> means(x.size() / together);
  for (std::size_t i = 0; i < means.size(); ++i) {
    const auto begin = x.begin() + static_cast<std::ptrdiff_t>(i * together);
    means[i] = std::accumulate(begin, begin + static_cast<std::ptrdiff_t>(together), 0.0) /
               static_cast<double>(together);
  }
  return means;
}

/// What the axes of one record have in common.
struct Correlation {
  certificate::JointAxes joint;
  std::optional<double> of_means_s;  ///< looked at in means of so long; empty: in samples
};

/// Of the axes of one record with each other; nothing where they were not sampled together. Of axes that are
/// fetched, at the scales of means.
std::optional<Correlation> correlation_of(const SensorRecord& record,
                                          const certificate::AxisOptions& options) {
  std::vector<std::vector<double>> values;  // NaN where a sample is missing
  std::size_t together = 1;
  for (const auto& axis : record.axes) {
    if (axis.fetch) {
      const auto samples = axis.fetch();
      if (!samples) return std::nullopt;
      together = samples_a_mean(samples->size());
      values.push_back(means_of(*samples, together));
      continue;
    }
    values.push_back(axis.values);
    for (std::size_t i = 0; i < axis.mask.size(); ++i) {
      if (axis.mask[i] == 0) values.back()[i] = std::numeric_limits<double>::quiet_NaN();
    }
  }
  std::vector<certificate::JointSignal> signals;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i].size() != values.front().size() || record.axes[i].rate_hz != record.axes.front().rate_hz)
      return std::nullopt;
    signals.push_back({record.axes[i].name, values[i]});
  }
  certificate::JointOptions how;
  how.confidence = options.confidence;
  how.covariances = options.covariances;
  how.share_a_reference = false;
  if (signals.empty()) return std::nullopt;
  how.rate_hz = record.axes.front().rate_hz / static_cast<double>(together);
  auto joint = joint_axes(signals, how);
  if (!joint) return std::nullopt;  // a single axis, or one that is stuck
  Correlation out{std::move(*joint), std::nullopt};
  if (together > 1) out.of_means_s = 1.0 / how.rate_hz;
  return out;
}

/// Of a document with "correlation".
void print_correlation(const nlohmann::json& document) {
  const auto& pairs = document["correlation"];
  if (const auto means = document.find("correlation_of_means_s"); means != document.end())
    say("  correlations: in means of {:.3g} s, faster ones were not looked for\n", means->get<double>());
  for (const auto& pair : pairs) {
    if (!pair["shows"].get<bool>()) continue;
    say("  {} and {} correlate: {:.2f} [{:.2f}, {:.2f}] at {:.3g} s (p = {:.2g}, corrected)\n",
        pair["signals"][0].get<std::string>(), pair["signals"][1].get<std::string>(),
        pair["coherence"].get<double>(), pair["ci_low"].get<double>(), pair["ci_high"].get<double>(),
        pair["tau_s"].get<double>(), pair["p_holm"].get<double>());
  }
}

void print_beside(const certificate::DataSheet& sheet, const std::vector<certificate::StatedBeside>& rows) {
  say("\nBeside the data sheet of {}\n", sheet.part);
  if (rows.empty()) say("  it states nothing of these axes\n");
  for (const auto& row : rows) {
    say("  {} {}: {}, stated {:.4g} {} ({}): {}; {}, {}, page {}\n", row.axis, symbol_of(row.measured.term),
        shown_term(row.measured), row.stated.value, row.measured.unit,
        row.stated.is_maximum ? "maximum" : "typical", name_of(row.verdict), row.stated.document,
        row.stated.revision, row.stated.page);
  }
}

Result<std::optional<certificate::DataSheet>> sheet_of(const CharacterizeCommand& options) {
  if (options.data_sheet.empty()) {
    if (options.part.empty()) return std::nullopt;
    return usage_error("--part names a part, and there is no data sheet", "give --data-sheet FILE, too");
  }
  std::ifstream in(options.data_sheet, std::ios::binary);
  const auto document = nlohmann::json::parse(in, nullptr, false);
  auto sheet = certificate::read_data_sheet(document, options.part, options.data_sheet.string());
  if (!sheet) return tl::unexpected<Error>(sheet.error());
  return *sheet;
}

void print_population(const std::vector<certificate::Population>& populations,
                      const std::vector<SensorRecord>& records) {
  if (populations.empty()) return;
  say("\nAll {} records\n", records.size());
  for (const auto& p : populations) {
    const bool gyro = p.axis.starts_with("gyro");
    say("  {} {}: ", p.axis, name_of(p.term, gyro));
    if (p.effects) {
      say("{:.4g} [{:.4g}, {:.4g}] {}, records differ by {:.2g} %", std::exp(p.effects->mean),
          std::exp(p.effects->ci_low), std::exp(p.effects->ci_high), p.unit, 100.0 * p.effects->spread);
    }
    if (p.tolerance_upper) say("; 95 % are below {:.4g} (95 % confidence)", *p.tolerance_upper);
    say("\n");
    for (std::size_t i = 0; i < p.p_values.size(); ++i) {
      if (p.p_values[i] && *p.p_values[i] < noise::kSignificance)
        say("    {} stands out: {:.4g} {} (p = {:.2g}, corrected)\n", records[i].name, *p.values[i], p.unit,
            *p.p_values[i]);
    }
  }
}

nlohmann::json population_json(const std::vector<certificate::Population>& populations) {
  auto out = nlohmann::json::array();
  const auto number = [](const std::optional<double>& v) {
    return v && std::isfinite(*v) ? nlohmann::json(*v) : nlohmann::json(nullptr);
  };
  for (const auto& p : populations) {
    nlohmann::json row{{"axis", p.axis}, {"symbol", symbol_of(p.term)}, {"unit", p.unit}};
    row["values"] = nlohmann::json::array();
    row["p_holm"] = nlohmann::json::array();
    for (const auto& v : p.values) row["values"].push_back(number(v));
    for (const auto& v : p.p_values) row["p_holm"].push_back(number(v));
    if (p.effects) {
      row["mean"] = std::exp(p.effects->mean);
      row["mean_ci"] = {std::exp(p.effects->ci_low), std::exp(p.effects->ci_high)};
      row["spread_log"] = p.effects->spread;
      row["spread_log_ci"] = {p.effects->spread_low, p.effects->spread_high};
    }
    row["tolerance_upper_95_95"] = number(p.tolerance_upper);
    out.push_back(std::move(row));
  }
  return out;
}

Result<std::vector<certificate::AxisCertificate>> characterize(const SensorRecord& record,
                                                               const certificate::AxisOptions& how) {
  std::vector<certificate::AxisCertificate> axes;
  std::optional<Error> first;
  ProgressBar bar;
  const auto n = static_cast<double>(record.axes.size());
  bar.show(record.name, 0.0);
  auto looked_at = characterize_axes(
      record.axes, how, [&](std::size_t done) { bar.show(record.name, static_cast<double>(done) / n); });
  bar.clear();
  for (auto& axis : looked_at) {
    if (axis) {
      axes.push_back(std::move(*axis));
      continue;
    }
    say_aside("warning: {}\n", axis.error().text());
    if (!first) first = axis.error();
  }
  if (axes.empty()) return tl::unexpected(*first);
  return axes;
}

Result<void> run_characterize(CharacterizeCommand& options) {
  give_long_pieces_back();
  if (auto parsed = parse_axes(options); !parsed) return parsed;
  if (auto may = may_write(options); !may) return may;
  const auto sheet = sheet_of(options);
  if (!sheet) return tl::unexpected<Error>(sheet.error());
  ProgressBar bar;
  bar.show("reading");
  auto records = read_records(options.files, options.choice);
  bar.clear();
  if (!records) return tl::unexpected(records.error());
  std::vector<std::vector<certificate::AxisCertificate>> all;
  noise::CovarianceTables covariances;
  options.how.covariances = &covariances;
  auto documents = nlohmann::json::array();
  for (const SensorRecord& record : *records) {
    for (const auto& warning : record.warnings) say_aside("warning: {}\n", warning);
    auto axes = characterize(record, options.how);
    if (!axes) return tl::unexpected(axes.error());
    const std::string name = options.sensor.empty() || records->size() > 1 ? record.name : options.sensor;
    documents.push_back(
        certificate::to_json({name, record.files, record.selection, now_utc(), IMUSCOPE_VERSION}, *axes));
    if (const auto found = correlation_of(record, options.how)) {
      std::vector<std::string> names;
      for (const auto& axis : record.axes) names.push_back(axis.name);
      documents.back()["correlation"] = certificate::pairs_json(found->joint, names);
      if (found->of_means_s) documents.back()["correlation_of_means_s"] = *found->of_means_s;
    }
    if (*sheet) documents.back()["comparison"] = to_json(**sheet, beside(**sheet, *axes));
    all.push_back(std::move(*axes));
  }
  const auto populations = certificate::population_of(all, options.how.confidence);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (records->size() > 1) documents[i]["units"] = population_json(populations);
    if (options.json || options.table) continue;
    if (records->size() > 1) say("{}{}\n", i > 0 ? "\n" : "", (*records)[i].name);
    for (const auto& axis : all[i]) {
      for (const auto& warning : axis.warnings) say("warning: {}: {}\n", axis.name, warning);
    }
    for (const auto& axis : all[i]) print_axis(axis);
    for (const auto& axis : all[i]) {
      for (const auto& limit : axis.limits) say("  {}: {}\n", axis.name, limit);
    }
    if (documents[i].contains("correlation")) print_correlation(documents[i]);
    if (*sheet) print_beside(**sheet, beside(**sheet, all[i]));
  }
  if (options.table) {
    for (const auto& document : documents) say("{}", certificate_table(document, *options.table));
  } else if (options.json)
    say("{}\n", json_text(documents.size() == 1 ? documents.front() : documents));
  else
    print_population(populations, *records);
  if (options.no_page) return {};
  const bool quiet = options.json || options.table;
  const auto out = OutputFolder::open(options.out);
  if (!out) return tl::unexpected<Error>(out.error());
  for (std::size_t i = 0; i < documents.size(); ++i) {
    // Several sensors have a folder each.
    auto folder = documents.size() > 1 ? out->sub_folder(fmt::format("{}", i + 1)) : *out;
    if (!folder) return tl::unexpected<Error>(folder.error());
    if (auto written = folder->write_whole(kDocument, json_text(documents[i])); !written) return written;
    if (auto written = folder->write_whole("allan.csv", allan_csv(documents[i])); !written) return written;
    const auto files = write_certificate_page(folder->path(), documents[i]);
    if (!files) return tl::unexpected<Error>(files.error());
    if (!quiet) say("{}\n", files->front().string());
    if (!options.pdf) continue;
    bar.show("printing");
    const auto printed = page::print_page(*folder, files->front().filename().string());
    bar.clear();
    if (!printed) return tl::unexpected<Error>(printed.error());
    if (!quiet) say("{}\n", printed->string());
  }
  return {};
}

}  // namespace

void add_characterize(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand(
      "characterize",
      "The noise of a sensor at rest as a page: data-sheet terms with intervals, Allan deviation, model");
  auto options = std::make_shared<CharacterizeCommand>();
  command
      ->add_option("FILE", options->files,
                   "A log at rest: CSV in any columns; raw float64 named after its axis (gyro_x_degps.f64), "
                   "one file an axis; a capture (each of its IMUs); or the folder of a study. Several logs: "
                   "several units of one sensor, or several days")
      ->required();
  command->add_option("--rate,-r", options->choice.signal.rate_hz,
                      "Samples per second (default: by the time stamps)");
  command->add_option("--time", options->choice.signal.time,
                      "Column with time stamps: seconds, ISO 8601, or WEEK,SECONDS of GPS "
                      "(default: by its name; none: no times)");
  command->add_option("--topic", options->choice.signal.topic,
                      "Topic of an MCAP file, bag or flight log that holds several IMUs");
  command->add_option("--counter", options->choice.signal.counter, "Column that counts the samples");
  command->add_option("--where", options->choice.signal.where,
                      "COLUMN=VALUE: rows with another value count as gaps");
  command->add_option("--axis", options->axes,
                      "AXIS=COLUMN, as gyro_x=wx, where names do not tell; once an axis");
  command->add_option("--gyro-unit", options->choice.gyro_unit, "rad/s or deg/s, where names do not tell");
  command->add_option("--accel-unit", options->choice.accel_unit,
                      "m/s^2 or g, where neither names nor the size of gravity tell");
  command->add_option("--temperature", options->choice.temperature,
                      "Column with the sensor's temperature, degC (default: by its name; none: none)");
  command->add_option("--name,-n", options->choice.imu,
                      "The IMU, where a capture or the folder of a study holds several");
  command->add_option("--regime", options->choice.regime, "Of the folder of a study: a regime, or all")
      ->capture_default_str();
  command->add_option("--sensor", options->sensor, "Name of the sensor on the page (default: the file's)");
  command->add_option("--model,-m", options->how.model,
                      "Noise model of every axis, as for `fit` (default: selected)");
  command->add_option("--confidence", options->how.confidence, "Of every interval, as a share")
      ->check(CLI::Range(0.51, 0.9999))
      ->capture_default_str();
  command->add_option("--out,-o", options->out, "Folder for certificate.html, certificate.json and figures")
      ->capture_default_str();
  command->add_option("--data-sheet", options->data_sheet,
                      "Compare with the values of a data sheet, from a JSON file (docs/noise.md)");
  command->add_option("--part", options->part, "Part of that file, where it holds several");
  command->add_flag("--no-page", options->no_page, "Print alone");
  const std::map<std::string, TableFormat> formats{
      {"latex", TableFormat::kLatex}, {"markdown", TableFormat::kMarkdown}, {"csv", TableFormat::kCsv}};
  command
      ->add_option("--table", options->table,
                   "Print N, B, K, R and Q as a table for a paper: latex, markdown or csv")
      ->transform(CLI::CheckedTransformer(formats, CLI::ignore_case));
  command->add_flag("--pdf", options->pdf, "Print the page as certificate.pdf, too, by Chromium");
  command->add_flag("--force", options->force, "Write over a page that this command did not write");
  command->add_flag("--json", options->json, "Print JSON");
  on_chosen(*command, chosen, [options] { return run_characterize(*options); });
}

}  // namespace imuscope::cli
