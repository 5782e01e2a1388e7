#include "fleet/catalogue.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "base/json_text.h"
#include "base/output_folder.h"
#include "base/text.h"
#include "base/units.h"
#include "fleet/assets.h"
#include "fleet/attempts.h"
#include "fleet/database.h"
#include "fleet/measurement_row.h"
#include "fleet/mounting_change.h"
#include "fleet/population.h"
#include "fleet/study_task.h"
#include "fleet/unit_task.h"
#include "models/noise/holm.h"
#include "results/tables/json_fields.h"
#include "results/tables/json_file.h"

namespace imuscope::fleet {
namespace {

using nlohmann::json;
using tables::field;
using tables::number_at;
using tables::numbers_at;
using tables::text_at;
namespace fs = std::filesystem;

constexpr double kConfidenceInSd = 1.959964;
/// From the unit of a data sheet to that of filter_quantities().
constexpr double kRootHour_s = 60.0;

struct SheetTerm {
  const char* key;
  const char* quantity;
  const char* axis_stem;
  double factor;
};
constexpr std::array<SheetTerm, 4> kSheet{{
    {"gyro_density_degps_per_sqrt_hz", "angle random walk", "gyro_", kRootHour_s},
    {"gyro_bias_stability_deg_per_h", "bias instability", "gyro_", 1.0},
    {"accel_density_ug_per_sqrt_hz", "velocity random walk", "accel_", kRootHour_s* kMps2PerMicroG},
    {"accel_bias_stability_ug", "bias instability", "accel_", 1.0},
}};

Cell or_null(const json& object, const char* key) {
  const auto value = number_at(object, key);
  return value ? Cell(*value) : Cell();
}

Cell count_or_null(const json& object, const char* key) {
  const auto value = number_at(object, key);
  return value ? Cell(static_cast<std::int64_t>(*value)) : Cell();
}

Cell largest_of(const json& object, const char* key) {
  const auto values = numbers_at<3>(object, key);
  return values ? Cell(*std::max_element(values->begin(), values->end())) : Cell();
}

/// Days since 1970 of "2026-03-14T09:30:00.002800Z"; NaN of anything else.
double days_of(const std::string& utc) {
  std::tm tm{};
  if (::strptime(utc.c_str(), "%Y-%m-%dT%H:%M:%S", &tm) == nullptr) return std::nan("");
  return static_cast<double>(::timegm(&tm)) / kSecondsPerDay;
}

/// The worst that the look at the data found: "wrong", "limits", "note", "".
std::string worst_of(const json& findings) {
  for (const char* harm : {"wrong", "limits", "note"}) {
    for (const json& finding : findings)
      if (text_at(finding, "harm") == harm) return harm;
  }
  return "";
}

/// Results that are read at once; a page of them in memory each.
constexpr std::size_t kBatch = 64;

/// A table's rows on their way into the file.
class Insert {
 public:
  static Result<Insert> into(const Database& database, const std::string& table, std::size_t columns) {
    std::string marks;
    for (std::size_t i = 0; i < columns; ++i) marks += i == 0 ? "?" : ",?";
    auto statement = database.prepare(fmt::format("INSERT OR IGNORE INTO {} VALUES ({})", table, marks));
    if (!statement) return tl::unexpected<Error>(statement.error());
    return Insert(std::move(*statement));
  }
  /// The first error is kept; what follows it is passed over.
  void row(const std::vector<Cell>& cells) {
    if (error_) return;
    if (auto done = statement_.run(cells); !done) error_ = done.error();
  }
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }

 private:
  explicit Insert(Statement statement) : statement_(std::move(statement)) {}
  Statement statement_;
  std::optional<Error> error_;
};

/// Texts that come again and again, by numbers.
class Words {
 public:
  std::uint32_t operator()(const std::string& word) {
    const auto [found, is_new] = places_.emplace(word, static_cast<std::uint32_t>(words_.size()));
    if (is_new) words_.push_back(word);
    return found->second;
  }
  [[nodiscard]] std::vector<std::string> take() { return std::move(words_); }
  [[nodiscard]] const std::vector<std::string>& words() const { return words_; }

 private:
  std::map<std::string, std::uint32_t> places_;
  std::vector<std::string> words_;
};

class Reducer {
 public:
  Reducer(const FleetFile& fleet, const Plan& plan, const Database& database)
      : fleet_(fleet), plan_(plan), database_(database) {}

  Result<void> reduce() {
    if (auto begun = database_.execute(std::string(schema()) + "BEGIN;"); !begun) return begun;
    for (const auto& [table, columns] : kTables) {
      auto insert = Insert::into(database_, table, columns);
      if (!insert) return tl::unexpected<Error>(insert.error());
      inserts_.emplace(table, std::move(*insert));
    }
    // Reading takes longer than writing: a batch at once on all cores, then row by row.
    std::vector<json> results(kBatch);
    for (std::size_t first = 0; first < plan_.captures.size(); first += kBatch) {
      const std::size_t n = std::min(kBatch, plan_.captures.size() - first);
      tbb::parallel_for(std::size_t{0}, n,
                        [&](std::size_t i) { results[i] = result_of(plan_.captures[first + i]); });
      for (std::size_t i = 0; i < n; ++i) {
        if (auto added = add_capture(plan_.captures[first + i], results[i]); !added) return added;
      }
    }
    change_.add_to([this](const std::string& name, const std::string& axis, const char* unit_of_value,
                          const MountingChange::Place& place, double value, double sd) {
      measure({name, "", axis, unit_of_value, false, value, sd}, place.unit, place.capture, place.device,
              true);
    });
    state_certificates();
    add_population();
    for (const UnitTask& task : plan_.units) add_unit(task);
    add_units();
    if (auto added = add_attempts(); !added) return added;
    for (auto& [table, insert] : inserts_)
      if (insert.error()) return tl::unexpected<Error>(*insert.error());
    return database_.execute("COMMIT; ANALYZE;");
  }

 private:
  static constexpr std::array<std::pair<const char*, std::size_t>, 22> kTables{{
      {"versions", 3},    {"vehicles", 1},      {"units", 2},        {"mountings", 4},
      {"captures", 8},    {"drives", 13},       {"tracks", 4},       {"findings", 6},
      {"health", 10},     {"calibrations", 13}, {"models", 10},      {"parameters", 11},
      {"quantities", 6},  {"measurements", 6},  {"unit_results", 9}, {"unit_mountings", 11},
      {"population", 19}, {"outliers", 10},     {"drifts", 7},       {"certificates", 8},
      {"attempts", 13},   {"other_results", 4},
  }};

  void row(const char* table, const std::vector<Cell>& cells) { inserts_.at(table).row(cells); }

  /// Null where there is none yet.
  [[nodiscard]] json result_of(const Capture& capture) const {
    const fs::path file = fleet_.out / "studies" / capture.key / "result.json";
    std::error_code error;
    return !capture.key.empty() && fs::exists(file, error) ? tables::read_json_file(file) : json();
  }

  Result<void> add_capture(const Capture& capture, const json& result) {
    const std::uint32_t place = captures_(capture.name);
    days_.resize(captures_.words().size(), std::nan(""));
    temperatures_.resize(captures_.words().size());
    std::string state = "not studied";
    std::string reason = capture.not_studied;
    if (!capture.key.empty()) {
      state = result.is_object() ? text_at(result, "state") : key_of(TaskState::kNotYet);
      reason = text_at(result, "reason");
      if (result.is_object()) ++studies_of_program_[text_at(result, "program")];
      planned_.insert(capture.key);
    }
    const MountingCampaign* mounting = capture.mounting ? &fleet_.mountings[*capture.mounting] : nullptr;
    if (mounting != nullptr) row("vehicles", {mounting->vehicle});
    row("captures", {capture.name, capture.sha256, static_cast<std::int64_t>(capture.bytes),
                     mounting != nullptr ? Cell(mounting->vehicle) : Cell(),
                     mounting != nullptr ? Cell(mounting->name) : Cell(), capture.key, state, reason});
    const json& summary = field(result, "summary");
    if (mounting == nullptr || !summary.is_object()) return {};
    return tables::with_documents_of(fleet_.out, [&]() -> Result<void> {
      add_drive(capture.name, place, *mounting, summary);
      return {};
    });
  }

  void add_drive(const std::string& name, std::uint32_t place, const MountingCampaign& mounting,
                 const json& summary) {
    days_[place] = days_of(text_at(summary, "t0_utc"));
    const json& track = field(summary, "track");
    const json first = track.empty() ? json() : track.front();
    const json& findings = field(summary, "findings");
    row("drives",
        {name, text_at(summary, "t0_utc"), days_[place], or_null(summary, "duration_s"),
         or_null(summary, "static_s"), or_null(summary, "dynamic_s"), count_or_null(summary, "gnss_used"),
         or_null(summary, "distance_m"), first.is_array() ? Cell(first[0].get<double>()) : Cell(),
         first.is_array() ? Cell(first[1].get<double>()) : Cell(), worst_of(findings),
         static_cast<std::int64_t>(findings.size()),
         static_cast<std::int64_t>(number_at(summary, "warnings").value_or(0.0))});
    std::int64_t number = 0;
    for (const json& point : track)
      row("tracks", {name, number++, point[0].get<double>(), point[1].get<double>()});
    number = 0;
    for (const json& finding : findings)
      row("findings", {name, number++, text_at(finding, "device"), text_at(finding, "harm"),
                       text_at(finding, "check"), text_at(finding, "text")});
    for (const json& device : field(summary, "devices")) {
      const bool is_unit = text_at(device, "role") == "study";
      const std::string unit = unit_of(mounting, text_at(device, "device"));
      row("health", {name, text_at(device, "device"), is_unit ? Cell(unit) : Cell(), text_at(device, "role"),
                     text_at(device, "protocol"), count_or_null(device, "samples"),
                     count_or_null(device, "samples_lost"), count_or_null(device, "bad_frames"),
                     count_or_null(device, "late"), text_at(device, "problem")});
    }
    for (const json& imu : field(summary, "imus")) add_imu(name, place, mounting, imu);
  }

  void add_imu(const std::string& name, std::uint32_t place, const MountingCampaign& mounting,
               const json& imu) {
    const std::string device = text_at(imu, "device");
    const std::string unit = unit_of(mounting, device);
    const std::uint32_t u = units_(unit);
    const std::uint32_t d = devices_(device);
    row("mountings", {mounting.vehicle, mounting.name, device, unit});
    auto& temperatures = temperatures_[place];
    if (temperatures.size() <= d) temperatures.resize(d + 1, std::nan(""));
    temperatures[d] = number_at(imu, "temperature_degC").value_or(std::nan(""));
    const auto r = numbers_at<3>(imu, "r_bs_b_m");
    const auto axis = [&](std::size_t i) { return r ? Cell((*r)[i]) : Cell(); };
    row("calibrations",
        {name, device, unit, text_at(imu, "status"), text_at(imu, "usability"),
         or_null(imu, "temperature_degC"), largest_of(imu, "boresight_sd_deg"), axis(0), axis(1), axis(2),
         largest_of(imu, "r_bs_b_sd_m"), or_null(imu, "t_d_s"), or_null(imu, "t_d_sd_s")});
    for (const auto& measured : measurements_of(imu)) measure(measured, u, place, d, false);
    for (const json& model : field(imu, "models")) add_model(name, device, unit, model);
    change_.take(mounting.vehicle + "/" + mounting.name + "/" + device, {u, place, d}, days_[place], imu);
    if (const json& sheet = field(imu, "data_sheet"); sheet.is_object()) sheets_[u] = sheet;
  }

  void add_model(const std::string& name, const std::string& device, const std::string& unit,
                 const json& model) {
    const std::string regime = text_at(model, "regime");
    const std::string axis = text_at(model, "axis");
    row("models", {name, device, regime, axis, unit, text_at(model, "model"), or_null(model, "p_value"),
                   static_cast<std::int64_t>(text_at(model, "identifiable") == "true"),
                   text_at(model, "simpler_model"), or_null(model, "seconds")});
    for (const json& p : field(model, "parameters")) {
      const auto number = [&](std::size_t i) { return p[i].is_number() ? Cell(p[i].get<double>()) : Cell(); };
      row("parameters", {name, device, regime, axis, p[0].get<std::string>(), p[1].get<std::string>(),
                         p[2].get<std::string>(), number(3), number(4), number(5), number(6)});
    }
  }

  Quantity& quantity_of(const MeasurementRow& m) {
    const auto [found, is_new] =
        quantity_places_.emplace(std::make_tuple(m.quantity, m.regime, m.axis), quantities_.size());
    if (is_new) quantities_.push_back({m.quantity, m.regime, m.axis, m.unit, m.is_log, false, {}, {}});
    return quantities_[found->second];
  }

  void measure(const MeasurementRow& m, std::uint32_t unit, std::uint32_t capture, std::uint32_t device,
               bool from_first) {
    Quantity& quantity = quantity_of(m);
    quantity.from_first_drive = from_first;
    quantity.values.push_back({unit, capture, device, m.value, m.sd});
  }

  /// What certificates and data sheets say of quantities that were measured at rest, which is what they are
  /// about.
  void state_certificates() {
    const auto state = [&](const std::string& quantity, const std::string& axis, Stated stated) {
      const auto found = quantity_places_.find({quantity, "static", axis});
      if (found != quantity_places_.end() && quantities_[found->second].is_log)
        quantities_[found->second].stated.push_back(std::move(stated));
    };
    for (const auto& [unit, sheet] : sheets_) {
      for (const SheetTerm& term : kSheet) {
        const auto value = number_at(sheet, term.key);
        for (const char axis : {'x', 'y', 'z'}) {
          if (value && *value > 0.0)
            state(term.quantity, term.axis_stem + std::string(1, axis),
                  {unit, "data sheet", std::log(*value * term.factor), 0.0});
        }
      }
    }
    for (const auto& [serial, file] : fleet_.certificates) {
      const json certificate = tables::read_json_file(file);
      for (const json& axis : field(certificate, "axes")) {
        const bool gyro = text_at(axis, "name").starts_with("gyro");
        for (const json& term : field(axis, "terms")) {
          const auto value = number_at(term, "value");
          const auto low = number_at(term, "ci_low");
          const auto high = number_at(term, "ci_high");
          if (!value || !low || !high || !(*low > 0.0)) continue;
          const std::string symbol = text_at(term, "symbol");
          const char* quantity =
              symbol == "N" ? (gyro ? "angle random walk" : "velocity random walk") : "bias instability";
          if (symbol == "N" || symbol == "B")
            state(quantity, text_at(axis, "name"),
                  {units_(serial), "certificate", std::log(*value),
                   std::log(*high / *low) / (2.0 * kConfidenceInSd)});
        }
      }
    }
  }

  void add_population() {
    Fleet fleet;
    fleet.units = units_.words();
    fleet.captures = captures_.words();
    fleet.devices = devices_.words();
    fleet.days = days_;
    for (auto& temperatures : temperatures_) temperatures.resize(fleet.devices.size(), std::nan(""));
    fleet.temperatures_degC = std::move(temperatures_);
    fleet.quantities = std::move(quantities_);
    fleet.certificate_factor = fleet_.certificate_factor;
    // In the order of their names, so that their numbers do not hang on which capture came first.
    std::sort(fleet.quantities.begin(), fleet.quantities.end(), [](const Quantity& a, const Quantity& b) {
      return std::tie(a.name, a.regime, a.axis) < std::tie(b.name, b.regime, b.axis);
    });
    for (std::size_t i = 0; i < fleet.quantities.size(); ++i) {
      const Quantity& q = fleet.quantities[i];
      quantity_ids_[{q.name, q.regime, q.axis}] = static_cast<std::int64_t>(i) + 1;
    }
    const auto results = population_of(fleet);
    for (std::size_t i = 0; i < results.size(); ++i)
      add_quantity(fleet, fleet.quantities[i], static_cast<std::int64_t>(i) + 1, results[i]);
  }

  void add_quantity(const Fleet& fleet, const Quantity& quantity, std::int64_t id,
                    const QuantityResult& result) {
    row("quantities", {id, quantity.name, quantity.regime, quantity.axis, quantity.unit_of_value,
                       static_cast<std::int64_t>(quantity.is_log)});
    for (const Measured& m : quantity.values)
      row("measurements",
          {id, fleet.units[m.unit], fleet.captures[m.capture], fleet.devices[m.device], m.value, m.sd});
    if (result.effects) add_effects(quantity, id, result);
    const auto add = [&](const char* kind, const Tested& test) {
      row("outliers",
          {kind, fleet.units[test.unit], test.capture ? fleet.captures[*test.capture] : std::string(),
           test.device ? fleet.devices[*test.device] : std::string(), id, test.test.deviation, test.test.t,
           test.test.dof, test.test.p_value, test.p_corrected});
    };
    for (const Tested& test : result.outlying_units)
      if (test.p_corrected < noise::kSignificance) add("unit", test);
    for (const Tested& test : result.outlying_drives)
      if (test.p_corrected < noise::kSignificance) add("drive", test);
    for (const Tested& test : result.drifts)
      row("drifts", {fleet.units[test.unit], id, test.test.deviation,
                     test.test.t != 0.0 ? Cell(test.test.deviation / test.test.t) : Cell(), test.test.dof,
                     test.test.p_value, test.p_corrected});
    for (const Holding& holding : result.holdings)
      row("certificates",
          {fleet.units[holding.unit], id, holding.against, holding.stated, holding.ratio, holding.ratio_low,
           holding.ratio_high, std::string(words_of(holding, fleet_.certificate_factor))});
  }

  void add_effects(const Quantity& quantity, std::int64_t id, const QuantityResult& result) {
    const auto& e = *result.effects;
    const bool has_units = !quantity.from_first_drive;
    const auto if_units = [&](double value) { return has_units ? Cell(value) : Cell(); };
    const auto drive = [&](double noise::Spread95::*member) {
      return e.drive_sd ? Cell((*e.drive_sd).*member) : Cell();
    };
    const auto slope = [](const std::optional<noise::Slope>& s, double noise::Slope::*member) {
      return s ? Cell((*s).*member) : Cell();
    };
    std::optional<double> sheet;
    for (const Stated& stated : quantity.stated)
      if (stated.against == "data sheet") sheet = std::exp(stated.value);
    row("population",
        {id, static_cast<std::int64_t>(e.units), static_cast<std::int64_t>(e.drives), if_units(e.mean.value),
         if_units(e.mean.low), if_units(e.mean.high), if_units(e.unit_sd.value), if_units(e.unit_sd.low),
         if_units(e.unit_sd.high), drive(&noise::Spread95::value), drive(&noise::Spread95::low),
         drive(&noise::Spread95::high), if_units(e.tolerance_low), if_units(e.tolerance_high),
         slope(result.per_degC, &noise::Slope::value), slope(result.per_degC, &noise::Slope::sd),
         slope(result.per_year, &noise::Slope::value), slope(result.per_year, &noise::Slope::sd),
         sheet ? Cell(*sheet) : Cell()});
  }

  void add_unit(const UnitTask& task) {
    const json result = tables::read_json_file(task.out / "units" / (task.key + ".json"));
    units_(task.unit);
    for (const json& q : field(result, "quantities")) {
      const auto id = quantity_ids_.find({text_at(q, "quantity"), text_at(q, "regime"), text_at(q, "axis")});
      if (id == quantity_ids_.end()) continue;
      row("unit_results", {task.unit, id->second, count_or_null(q, "drives"), or_null(q, "mean"),
                           or_null(q, "mean_low"), or_null(q, "mean_high"), or_null(q, "drive_sd"),
                           or_null(q, "drive_sd_low"), or_null(q, "drive_sd_high")});
    }
    for (const json& m : field(result, "mountings")) {
      const json& combined = field(m, "combined");
      const auto r = numbers_at<3>(combined, "r_bs_b_m");
      const auto axis = [&](std::size_t i) { return r ? Cell((*r)[i]) : Cell(); };
      row("unit_mountings", {task.unit, text_at(m, "mounting"), text_at(m, "device"),
                             count_or_null(m, "drives"), largest_of(combined, "boresight_sd_deg"), axis(0),
                             axis(1), axis(2), largest_of(combined, "r_bs_b_sd_m"),
                             or_null(field(combined, "homogeneity"), "p_value"), text_at(m, "why_not")});
    }
  }

  void add_units() {
    for (const auto& mounting : fleet_.mountings)
      for (const auto& [device, unit] : mounting.units) units_(unit);
    for (const std::string& unit : units_.words()) {
      const auto certificate = fleet_.certificates.find(unit);
      row("units",
          {unit, certificate == fleet_.certificates.end() ? Cell()
                                                          : Cell(certificate->second.filename().string())});
    }
    for (const auto& [program, studies] : studies_of_program_)
      row("versions",
          {program, static_cast<std::int64_t>(studies), static_cast<std::int64_t>(program == plan_.program)});
  }

  Result<void> add_attempts() {
    const auto attempts = Attempts::open(fleet_.out);
    if (!attempts) return tl::unexpected<Error>(attempts.error());
    for (const Attempt& a : attempts->all())
      row("attempts",
          {a.key, static_cast<std::int64_t>(a.number), a.task, a.program, a.host, a.began_utc, a.ended_utc,
           key_of(a.end), a.reason, a.wall_s, a.cpu_s, a.peak_mb, static_cast<std::int64_t>(a.counts)});
    // Of captures that changed, or of another program: whatever else has a result.
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(fleet_.out / "studies", error)) {
      const std::string key = entry.path().filename().string();
      if (planned_.count(key) > 0) continue;
      const json result = tables::read_json_file(entry.path() / "result.json");
      row("other_results",
          {key, text_at(result, "program"), text_at(result, "state"), text_at(result, "reason")});
    }
    return {};
  }

  const FleetFile& fleet_;
  const Plan& plan_;
  const Database& database_;
  std::map<std::string, Insert> inserts_;
  Words units_, captures_, devices_;
  std::vector<double> days_;
  std::vector<std::vector<double>> temperatures_;
  std::map<std::tuple<std::string, std::string, std::string>, std::size_t> quantity_places_;
  std::map<std::tuple<std::string, std::string, std::string>, std::int64_t> quantity_ids_;
  std::vector<Quantity> quantities_;
  MountingChange change_;
  std::map<std::uint32_t, json> sheets_;
  std::map<std::string, std::size_t> studies_of_program_;
  std::set<std::string> planned_;
};

/// A cell of a CSV file: in quotes where it has to be (RFC 4180).
std::string csv_cell(const Cell& cell) {
  if (const auto* number = std::get_if<double>(&cell)) return fmt::format("{:.17g}", *number);
  if (const auto* whole = std::get_if<std::int64_t>(&cell)) return std::to_string(*whole);
  const auto* text = std::get_if<std::string>(&cell);
  if (text == nullptr) return {};
  if (text->find_first_of(",\"\r\n") == std::string::npos) return *text;
  std::string out = "\"";
  for (const char c : *text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

Result<void> export_table(const Database& database, const std::string& table, const OutputFolder& folder) {
  // Tables without a row number come in the order of their key.
  auto rows = database.prepare(fmt::format("SELECT * FROM {}", table));
  if (!rows) return tl::unexpected<Error>(rows.error());
  auto file = folder.begin(table + ".csv");
  if (!file) return tl::unexpected<Error>(file.error());
  std::string line;
  const auto names = rows->columns();
  for (const auto& name : names) line += (line.empty() ? "" : ",") + name;
  file->write(line + "\n");
  for (;;) {
    const auto more = rows->next();
    if (!more) return tl::unexpected<Error>(more.error());
    if (!*more) return file->close();
    line.clear();
    for (std::size_t i = 0; i < names.size(); ++i)
      line += (i == 0 ? "" : ",") + csv_cell(rows->cell(static_cast<int>(i)));
    file->write(line + "\n");
  }
}

}  // namespace

Result<void> write_catalogue(const FleetFile& fleet, const Plan& plan) {
  const auto out = OutputFolder::open(fleet.out);
  if (!out) return tl::unexpected<Error>(out.error());
  const auto scratch = out->scratch_folder();
  if (!scratch) return tl::unexpected<Error>(scratch.error());
  const auto written = [&]() -> Result<void> {
    const auto database = Database::create(scratch->path() / kCatalogue);
    if (!database) return tl::unexpected<Error>(database.error());
    return Reducer(fleet, plan, *database).reduce();
  }();
  auto taken = written ? out->take(*scratch, kCatalogue) : written;
  scratch->remove(kCatalogue);
  out->remove(scratch->path().filename().string());
  return taken;
}

Result<void> export_csv(const fs::path& catalogue, const fs::path& folder) {
  const auto database = Database::open_to_read(catalogue);
  if (!database) return tl::unexpected<Error>(database.error());
  const auto out = OutputFolder::open(folder);
  if (!out) return tl::unexpected<Error>(out.error());
  auto tables = database->prepare(
      "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%' ORDER BY name");
  if (!tables) return tl::unexpected<Error>(tables.error());
  for (;;) {
    const auto more = tables->next();
    if (!more) return tl::unexpected<Error>(more.error());
    if (!*more) return {};
    if (auto written = export_table(*database, tables->text(0), *out); !written) return written;
  }
}

}  // namespace imuscope::fleet
