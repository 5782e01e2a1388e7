#include "fleet/fleet_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "base/json_text.h"
#include "base/output_folder.h"
#include "fleet/assets.h"
#include "fleet/catalogue.h"
#include "fleet/database.h"
#include "fleet/page_pictures.h"
#include "results/page/html.h"
#include "results/report/people.h"

namespace imuscope::fleet {
namespace {

using nlohmann::json;
using page::element;
using page::Html;
using page::text;

constexpr const char* kPage = "fleet.html";
/// Rows of what stands out that are shown before a fold.
constexpr std::size_t kFirstRows = 8;
constexpr std::size_t kFoldedRows = 500;
/// What is shown of units as pictures: quantity and its regimes, the first that there is.
constexpr std::array<const char*, 5> kPictured{"angle random walk", "velocity random walk",
                                               "bias instability", "gyro bias", "accelerometer bias"};
constexpr std::array<const char*, 3> kRegimes{"static", "all", ""};

/// A catalogue that is read; the first error ends it.
class Reader {
 public:
  explicit Reader(const Database& database) : database_(database) {}
  /// Calls `row` for each row of the answer.
  template <typename Row>
  void each(std::string_view sql, const Row& row) {
    if (error_) return;
    auto statement = database_.prepare(sql);
    if (!statement) {
      error_ = Error{ErrorKind::kWork, statement.error().what, "make it anew: imuscope fleet reduce"};
      return;
    }
    for (;;) {
      const auto more = statement->next();
      if (!more) {
        error_ = more.error();
        return;
      }
      if (!*more) return;
      row(*statement);
    }
  }
  [[nodiscard]] std::int64_t count(std::string_view sql) {
    std::int64_t n = 0;
    each(sql, [&](const Statement& row) { n = row.integer(0); });
    return n;
  }
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }

 private:
  const Database& database_;
  std::optional<Error> error_;
};

Html tile(const char* css_class, const std::string& headline, const std::string& words) {
  return element("div", element("p", text(headline), "headline") + element("p", text(words), "quiet"),
                 std::string_view(css_class));
}

std::string of(std::int64_t n, const char* one, const char* many) {
  return fmt::format("{} {}", n, n == 1 ? one : many);
}

Html tiles(Reader& in) {
  const auto captures = in.count("SELECT count(*) FROM captures");
  const auto studied = in.count("SELECT count(*) FROM captures WHERE state = 'studied'");
  const auto units = in.count("SELECT count(*) FROM units");
  const auto out_units = in.count("SELECT count(DISTINCT unit) FROM outliers WHERE kind = 'unit'");
  const auto out_drives = in.count("SELECT count(DISTINCT capture) FROM outliers WHERE kind = 'drive'");
  const auto not_holding = in.count("SELECT count(DISTINCT unit) FROM not_holding");
  const auto drifting = in.count("SELECT count(DISTINCT unit) FROM drifting");
  const auto open = in.count("SELECT count(*) FROM captures WHERE state IN ('not yet', 'gave up')");
  const auto lost = in.count("SELECT ifnull(sum(samples_lost), 0) FROM health WHERE unit IS NOT NULL");
  const auto samples = in.count("SELECT ifnull(sum(samples), 0) FROM health WHERE unit IS NOT NULL");
  const auto usable = in.count("SELECT count(*) FROM calibrations WHERE usability = 'usable'");
  const auto calibrations = in.count("SELECT count(*) FROM calibrations");
  Html out;
  out += tile(open > 0             ? "tile no"
              : studied < captures ? "tile partly"
                                   : "tile yes",
              fmt::format("{} of {} captures studied", studied, captures),
              open > 0             ? fmt::format("{} are open: imuscope fleet run goes on with them", open)
              : studied < captures ? "the others have their reason below"
                                   : "all of them");
  out += tile(out_units > 0 ? "tile partly" : "tile yes", of(out_units, "unit stands out", "units stand out"),
              fmt::format("of {}, tests of all quantities together at 5 %", units));
  out += tile(out_drives > 0 ? "tile partly" : "tile yes",
              of(out_drives, "drive stands out", "drives stand out"), "from the other drives of its unit");
  out +=
      tile(not_holding > 0 ? "tile no" : "tile yes",
           not_holding > 0 ? of(not_holding, "unit is noisier than stated", "units are noisier than stated")
                           : "no unit is noisier than stated",
           "by certificate or data sheet, at rest");
  out += tile(drifting > 0 ? "tile partly" : "tile yes",
              drifting > 0 ? of(drifting, "unit drifts", "units drift") : "no unit drifts",
              "over months, tests of all units together");
  out += tile("tile", fmt::format("{} of {} mountings usable", usable, calibrations),
              fmt::format("{} of {} samples lost", lost, samples));
  return element("div", out, "tiles");
}

/// A link to a run's report, which lies beside the page.
Html run_link(const std::string& key, const std::string& words) {
  if (key.empty()) return text(words);
  return Html::markup("<a href=\"studies/") + text(key) + Html::markup("/run/report.html\">") + text(words) +
         Html::markup("</a>");
}

/// "gyro_x at rest" of axis and regime.
std::string place_of(const std::string& regime, const std::string& axis) {
  const std::string words = regime == "static" ? "at rest" : regime == "dynamic" ? "in motion" : "";
  return axis + (axis.empty() || words.empty() ? "" : " ") + words;
}

Html p_cell(double p) { return report::p_words(p); }

/// The first rows in the open, the rest behind a fold.
class FoldedTable {
 public:
  explicit FoldedTable(const std::vector<const char*>& headings)
      : first_(head(headings)), rest_(head(headings)) {}
  void add(std::vector<Html> row) {
    ++n_;
    if (n_ <= kFirstRows) {
      first_.add_row(std::move(row));
    } else if (n_ <= kFoldedRows) {
      rest_.add_row(std::move(row));
    }
  }
  [[nodiscard]] Html html() const {
    if (n_ == 0) return {};
    Html out = scroll(first_.html());
    if (n_ > kFirstRows) {
      const std::string words =
          n_ > kFoldedRows ? fmt::format("{} more; the catalogue has all {}", kFoldedRows - kFirstRows, n_)
                           : fmt::format("{} more", n_ - kFirstRows);
      out += page::fold(words, scroll(rest_.html()));
    }
    return out;
  }
  static Html scroll(const Html& table) { return element("div", table, "scroll"); }

 private:
  static std::vector<Html> head(const std::vector<const char*>& headings) {
    std::vector<Html> out;
    for (const char* heading : headings) out.push_back(text(heading));
    return out;
  }
  page::Table first_;
  page::Table rest_;
  std::size_t n_ = 0;
};

Html standing_out(Reader& in) {
  FoldedTable outliers({"what", "unit", "quantity", "where", "is off by", "p"});
  in.each(
      "SELECT o.kind, o.unit, c.key, o.capture, q.quantity, q.regime, q.axis, o.deviation, o.p_corrected, "
      "q.is_log, q.unit_of_value "
      "FROM outliers o JOIN quantities q USING (quantity_id) LEFT JOIN captures c USING (capture) ORDER BY "
      "o.p_corrected, o.unit, "
      "q.quantity, q.regime, q.axis, o.capture",
      [&](const Statement& row) {
        const double d = row.number(7);
        const Html off = row.integer(9) != 0 ? text(fmt::format("{:+.1f} %", 100.0 * std::expm1(d)))
                                             : text(fmt::format("{:+.3g} {}", d, row.text(10)));
        const bool is_drive = row.text(0) == "drive";
        outliers.add({is_drive ? run_link(row.text(2), row.text(3)) : text("unit"), text(row.text(1)),
                      text(row.text(4)), text(place_of(row.text(5), row.text(6))), off,
                      p_cell(row.number(8))});
      });
  FoldedTable holding({"unit", "quantity", "where", "against", "now", "of what is stated"});
  in.each("SELECT unit, quantity, regime, axis, against, now_ratio, ratio_low, ratio_high FROM not_holding",
          [&](const Statement& row) {
            holding.add({text(row.text(0)), text(row.text(1)), text(place_of(row.text(2), row.text(3))),
                         text(row.text(4)), text(fmt::format("{:.3g} times", row.number(5))),
                         text(fmt::format("{:.3g} to {:.3g}", row.number(6), row.number(7)))});
          });
  FoldedTable drifts({"unit", "quantity", "where", "a year", "sd", "p"});
  in.each(
      "SELECT d.unit, q.quantity, q.regime, q.axis, d.per_year, d.sd, d.p_corrected, q.is_log, "
      "q.unit_of_value FROM drifts d JOIN "
      "quantities q USING (quantity_id) WHERE d.p_corrected < 0.05 ORDER BY d.p_corrected, d.unit",
      [&](const Statement& row) {
        const bool is_log = row.integer(7) != 0;
        const auto words = [&](double value) {
          return is_log ? fmt::format("{:+.3g} %", 100.0 * value)
                        : fmt::format("{:+.3g} {}", value, row.text(8));
        };
        drifts.add({text(row.text(0)), text(row.text(1)), text(place_of(row.text(2), row.text(3))),
                    text(words(row.number(4))), text(words(row.number(5)).substr(1)), p_cell(row.number(6))});
      });
  Html out = page::heading("out", "What stands out");
  const Html a = outliers.html();
  const Html b = holding.html();
  const Html c = drifts.html();
  if (a.empty() && b.empty() && c.empty()) return out + page::paragraph("Nothing does.");
  if (!a.empty()) out += element("h3", text("Units and drives unlike the others")) + a;
  if (!b.empty()) out += element("h3", text("Noisier than stated")) + b;
  if (!c.empty()) out += element("h3", text("Drifting")) + c;
  return out;
}

Html without_study(Reader& in) {
  FoldedTable table({"capture", "state", "reason"});
  in.each("SELECT capture, state, reason FROM without_study ORDER BY state, capture",
          [&](const Statement& row) {
            table.add({text(row.text(0)), text(row.text(1)), text(row.text(2))});
          });
  const Html rows = table.html();
  return rows.empty() ? Html() : page::heading("without", "Captures without a study") + rows;
}

Html map_section(Reader& in) {
  std::vector<MapTrack> tracks;
  std::string last;
  in.each(
      "SELECT t.capture, d.worst, t.lat_deg, t.lon_deg FROM tracks t JOIN drives d USING (capture) ORDER BY "
      "t.capture, t.point",
      [&](const Statement& row) {
        const std::string capture = row.text(0);
        if (tracks.empty() || capture != last) tracks.push_back({row.text(1), {}});
        last = capture;
        tracks.back().lat_lon_deg.emplace_back(row.number(2), row.number(3));
      });
  const Html map = map_of(tracks);
  if (map.empty()) return {};
  return page::heading("map", "Where they drove") +
         element("figure",
                 map + element("figcaption", text("Drives in which nothing was found wrong, in ") +
                                                 element("b", text("blue"), "x") + text("; with limits in ") +
                                                 element("b", text("amber"), "partly") +
                                                 text("; with something wrong in ") +
                                                 element("b", text("red"), "no") + text(".")));
}

Html distributions(Reader& in) {
  struct Of {
    std::string unit_of_value;
    bool is_log = false;
    AxisValues axis;
    std::optional<double> data_sheet;
  };
  std::map<std::tuple<std::string, std::string, std::string>, Of> all;
  // A mean of a unit's drives, weighted by their errors and by what drives differ by.
  in.each(
      "SELECT q.quantity, q.regime, q.axis, q.unit_of_value, q.is_log, p.tolerance_low, p.tolerance_high, "
      "p.data_sheet, m.unit, "
      "sum(m.value / (m.sd * m.sd + ifnull(p.drive_sd * p.drive_sd, 0))) / sum(1 / (m.sd * m.sd + "
      "ifnull(p.drive_sd * p.drive_sd, 0))), "
      "EXISTS (SELECT 1 FROM outliers o WHERE o.kind = 'unit' AND o.unit = m.unit AND o.quantity_id = "
      "q.quantity_id) "
      "FROM quantities q JOIN population p USING (quantity_id) JOIN measurements m USING (quantity_id) WHERE "
      "q.quantity IN "
      "('angle random walk', 'velocity random walk', 'bias instability', 'gyro bias', 'accelerometer bias') "
      "GROUP BY q.quantity_id, m.unit",
      [&](const Statement& row) {
        Of& it = all[{row.text(0), row.text(1), row.text(2)}];
        it.unit_of_value = row.text(3);
        it.is_log = row.integer(4) != 0;
        const auto natural = [&](double value) { return it.is_log ? std::exp(value) : value; };
        it.axis.axis = row.text(2);
        if (std::isfinite(row.number(5))) it.axis.tolerance_low = natural(row.number(5));
        if (std::isfinite(row.number(6))) it.axis.tolerance_high = natural(row.number(6));
        if (std::isfinite(row.number(7))) it.data_sheet = row.number(7);
        it.axis.values.push_back(natural(row.number(9)));
        it.axis.stands_out.push_back(row.integer(10) != 0);
      });
  Html pictures;
  for (const char* quantity : kPictured) {
    for (const char* regime : kRegimes) {
      // Gyros and accelerometers, whose units differ, are pictures of their own.
      std::map<std::string, std::vector<AxisValues>> by_unit;
      bool is_log = false;
      std::map<std::string, std::optional<double>> sheet;
      for (const auto& [name, it] : all) {
        if (std::get<0>(name) != quantity || std::get<1>(name) != regime) continue;
        by_unit[it.unit_of_value].push_back(it.axis);
        is_log = it.is_log;
        if (it.data_sheet) sheet[it.unit_of_value] = it.data_sheet;
      }
      for (const auto& [unit, axes] : by_unit) {
        std::string words =
            std::string(quantity) + (std::string(regime) == "static" ? ", at rest, " : ", ") + unit;
        pictures += element(
            "figure", element("figcaption", text(words)) + distribution_of(words, is_log, axes, sheet[unit]));
      }
      if (!by_unit.empty()) break;
    }
  }
  if (pictures.empty()) return {};
  return page::heading("distributions", "What the units are like") +
         page::paragraph(
             "A dot is what the drives of a unit showed, their errors included; where units are many, "
             "a bar says how many lie there. Red ones stand out. The band holds 95 % of all such units, "
             "at a confidence of 95 %, as they are without errors.",
             "quiet") +
         element("div", pictures, "pictures");
}

Html population(Reader& in) {
  FoldedTable table({"quantity", "where", "units", "drives", "mean", "95 % of units", "units differ by",
                     "drives differ by", "unit"});
  in.each(
      "SELECT q.quantity, q.regime, q.axis, p.units, p.drives, p.mean, p.mean_low, p.mean_high, "
      "p.tolerance_low, p.tolerance_high, "
      "p.unit_sd, p.drive_sd, q.is_log, q.unit_of_value FROM population p JOIN quantities q USING "
      "(quantity_id) WHERE p.units > 1 AND "
      "NOT (q.quantity GLOB '[A-Z][A-Z]*') ORDER BY p.mean IS NULL, q.quantity, q.regime = 'dynamic', "
      "q.regime, q.axis",
      [&](const Statement& row) {
        const bool is_log = row.integer(12) != 0;
        const auto natural = [&](int i) { return is_log ? std::exp(row.number(i)) : row.number(i); };
        const auto differ = [&](int i) {
          if (!std::isfinite(row.number(i))) return text(report::kUnknown);
          return is_log ? text(fmt::format("{:.2g} %", 100.0 * row.number(i)))
                        : report::number(row.number(i), 2);
        };
        const bool has_mean = std::isfinite(row.number(5));
        table.add(
            {text(row.text(0)), text(place_of(row.text(1), row.text(2))), text(row.text(3)),
             text(row.text(4)),
             has_mean ? report::with_interval(natural(5), natural(6), natural(7)) : text(report::kUnknown),
             has_mean ? report::number(natural(8), 3) + text(" to ") + report::number(natural(9), 3)
                      : text(report::kUnknown),
             differ(10), differ(11), text(row.text(13))});
      });
  const Html rows = table.html();
  if (rows.empty()) return {};
  return page::heading("population", "All units together") + rows;
}

/// Rows that page.js sorts, searches and turns.
json units_data(Reader& in) {
  json rows = json::array();
  in.each(
      "WITH noise AS (SELECT m.unit, q.quantity, avg(m.value) AS value FROM measurements m JOIN quantities q "
      "USING (quantity_id) WHERE "
      "q.quantity IN ('angle random walk', 'velocity random walk') AND q.regime = (SELECT min(regime) FROM "
      "quantities WHERE quantity = "
      "q.quantity AND regime IN ('static', 'all') ORDER BY regime DESC) GROUP BY m.unit, q.quantity), "
      "arw AS (SELECT unit, exp(value) AS value FROM noise WHERE quantity = 'angle random walk'), "
      "vrw AS (SELECT unit, exp(value) AS value FROM noise WHERE quantity = 'velocity random walk'), "
      "place AS (SELECT unit, group_concat(DISTINCT vehicle) AS vehicles FROM mountings GROUP BY unit), "
      "use AS (SELECT unit, count(*) AS drives, sum(usability = 'usable') AS usable FROM calibrations GROUP "
      "BY unit), "
      "off AS (SELECT unit, sum(kind = 'unit') AS units, sum(kind = 'drive') AS drives FROM outliers GROUP "
      "BY unit), "
      "bad AS (SELECT unit, count(*) AS n FROM not_holding GROUP BY unit), "
      "moves AS (SELECT unit, count(*) AS n FROM drifting GROUP BY unit) "
      "SELECT u.unit, place.vehicles, use.drives, use.usable, arw.value, vrw.value, losses.samples_lost, "
      "losses.bad_frames, "
      "ifnull(off.units, 0), ifnull(off.drives, 0), ifnull(bad.n, 0), ifnull(moves.n, 0) FROM units u LEFT "
      "JOIN place USING (unit) LEFT "
      "JOIN use USING (unit) LEFT JOIN arw USING (unit) LEFT JOIN vrw USING (unit) LEFT JOIN losses USING "
      "(unit) LEFT JOIN off USING "
      "(unit) LEFT JOIN bad USING (unit) LEFT JOIN moves USING (unit) ORDER BY (ifnull(off.units, 0) + "
      "ifnull(bad.n, 0) + "
      "ifnull(moves.n, 0)) DESC, u.unit",
      [&](const Statement& row) {
        const auto number = [&](int i) {
          return std::isfinite(row.number(i)) ? json(row.number(i)) : json(nullptr);
        };
        std::string remarks;
        const auto remark = [&](int column, const char* one, const char* many) {
          if (row.integer(column) > 0)
            remarks += (remarks.empty() ? "" : "; ") + of(row.integer(column), one, many);
        };
        remark(8, "quantity unlike other units", "quantities unlike other units");
        remark(10, "axis noisier than stated", "axes noisier than stated");
        remark(11, "quantity drifts", "quantities drift");
        remark(9, "number of a drive off", "numbers of drives off");
        rows.push_back({row.text(0), row.text(1), row.integer(2), row.integer(3), number(4), number(5),
                        number(6), number(7), remarks});
      });
  return rows;
}

json drives_data(Reader& in) {
  json rows = json::array();
  in.each(
      "SELECT c.capture, c.key, c.vehicle, c.mounting, d.begin_utc, d.duration_s, d.distance_m, d.worst, "
      "(SELECT count(*) FROM "
      "calibrations k WHERE k.capture = c.capture AND k.usability = 'usable'), d.gnss_used FROM captures c "
      "JOIN drives d USING (capture) "
      "ORDER BY d.worst = 'wrong' DESC, d.worst = 'limits' DESC, c.capture",
      [&](const Statement& row) {
        const auto number = [&](int i) {
          return std::isfinite(row.number(i)) ? json(row.number(i)) : json(nullptr);
        };
        const bool gnss = row.number(9) > 0.0;
        const std::string worst = row.text(7);
        rows.push_back({row.text(0), row.text(1), row.text(2), row.text(3), row.text(4).substr(0, 16),
                        number(5), number(6), row.integer(8),
                        (worst == "wrong"    ? "something is wrong"
                         : worst == "limits" ? "with limits"
                                             : "") +
                            std::string(gnss                                    ? ""
                                        : worst == "wrong" || worst == "limits" ? ", no GNSS"
                                                                                : "no GNSS")});
      });
  return rows;
}

/// A place for a table of page.js, and what it shows before.
Html live_table(const char* id, const char* words) {
  return page::heading(id, words) + Html::markup("<div class=\"live\" data-table=\"") + text(id) +
         Html::markup("\"></div>");
}

std::string page_of(Reader& in, const std::string& name) {
  std::string versions;
  in.each("SELECT program, studies FROM versions ORDER BY program", [&](const Statement& row) {
    versions += fmt::format("{}{} ({} studies)", versions.empty() ? "" : ", ", row.text(0), row.integer(1));
  });
  const auto vehicles = in.count("SELECT count(*) FROM vehicles");
  const auto units = in.count("SELECT count(*) FROM units");
  const auto drives = in.count("SELECT count(*) FROM drives");
  Html body = element("header", element("h1", text(name)) +
                                    page::paragraph(fmt::format("{} of {}, {}", of(units, "unit", "units"),
                                                                of(vehicles, "vehicle", "vehicles"),
                                                                of(drives, "drive", "drives")),
                                                    "quiet"));
  body += tiles(in);
  body += element("section", standing_out(in));
  body += element("section", map_section(in));
  body += element("section", distributions(in));
  body += element("section", live_table("units", "Units"));
  body += element("section", live_table("drives", "Drives"));
  body += element("section", without_study(in));
  body += element("section", population(in));
  body += page::paragraph(
      "Made by " + (versions.empty() ? std::string("imuscope") : "imuscope " + versions) +
          ". All of it, and more, is in the catalogue beside this page: imuscope fleet query.",
      "quiet");
  const json data{{"units", units_data(in)}, {"drives", drives_data(in)}};
  return page::page_with_script(name, body, page_style(), json_text(data, kJsonOneLine), page_script());
}

}  // namespace

Result<std::filesystem::path> write_fleet_page(const std::filesystem::path& out, const std::string& name) {
  const auto database = Database::open_to_read(out / kCatalogue);
  if (!database) return tl::unexpected<Error>(database.error());
  Reader reader(*database);
  const std::string whole = page_of(reader, name);
  if (reader.error()) return tl::unexpected<Error>(*reader.error());
  const auto folder = OutputFolder::open(out);
  if (!folder) return tl::unexpected<Error>(folder.error());
  if (auto written = folder->write_whole(kPage, whole); !written)
    return tl::unexpected<Error>(written.error());
  return out / kPage;
}

}  // namespace imuscope::fleet
