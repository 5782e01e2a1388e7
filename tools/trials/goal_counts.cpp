#include "goal_counts.h"

#include <fmt/format.h>

#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iomanip>
#include <sstream>

#include "own_sd.h"

namespace imuscope {

void count(Counts& counts, const std::string& name, bool hit) {
  Count& c = counts[name];
  c.hits += hit ? 1 : 0;
  ++c.of;
}

Results::Results(const std::string& file) : file_(file) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string cell;
    int first = 0;
    int end = 0;
    if (!(words >> std::quoted(cell) >> first >> end) || first != done_[cell]) continue;
    Counts read;
    std::string name;
    for (Count c; words >> std::quoted(name) >> c.hits >> c.of;) read[name] = c;
    add(cell, end, read);
  }
}

int Results::done(const std::string& cell) const {
  const auto found = done_.find(cell);
  return found == done_.end() ? 0 : found->second;
}

void Results::keep(const std::string& cell, int end, const Counts& counts) {
  if (!file_.empty()) {
    std::ostringstream line;  // names may have blanks
    line << std::quoted(cell) << ' ' << done(cell) << ' ' << end;
    for (const auto& [name, c] : counts) line << ' ' << std::quoted(name) << ' ' << c.hits << ' ' << c.of;
    std::ofstream(file_, std::ios::app) << line.str() << '\n';
  }
  add(cell, end, counts);
}

void Results::add(const std::string& cell, int end, const Counts& counts) {
  for (const auto& [name, c] : counts) {
    counts_[cell][name].hits += c.hits;
    counts_[cell][name].of += c.of;
  }
  done_[cell] = end;
}

namespace {

/// Whether so few, or so many, hits come by chance where the share is an edge of the band: no less often than a normal
/// value comes kOwnSd beyond its mean. Of few counts the binomial's tail is far from the normal's.
bool is_within(const Band& band, const Count& count) {
  const double rare = boost::math::cdf(boost::math::complement(boost::math::normal(), kOwnSd));
  const auto at = [&](double percent) {
    return boost::math::binomial(static_cast<double>(count.of), percent / 100.0);
  };
  const auto hits = static_cast<double>(count.hits);
  const bool has_enough = boost::math::cdf(at(band.low), hits) >= rare;
  const bool has_too_many =
      count.hits > 0 && boost::math::cdf(boost::math::complement(at(band.high), hits - 1.0)) < rare;
  return has_enough && !has_too_many;
}

}  // namespace

bool judge(const std::string& cell, const std::vector<Band>& bands, const Counts& counts) {
  bool good = true;
  fmt::print("{}\n", cell);
  for (const auto& count : counts) {
    const auto& [name, c] = count;
    const Band* band = nullptr;
    for (const Band& b : bands) {
      if (band == nullptr && (b.name == name || b.name.empty())) band = &b;
    }
    const double share = 100.0 * c.hits / c.of;
    const auto sd_at = [of = c.of](double percent) { return std::sqrt(percent * (100.0 - percent) / of); };
    const bool holds_here = band == nullptr || is_within(*band, c);
    good = good && holds_here;
    fmt::print("  {:<18} {:>6} of {:>6}  {:>6.2f} % (sd {:.2f})  {}\n", name, c.hits, c.of, share,
               sd_at(share),
               band == nullptr
                   ? ""
                   : fmt::format("{:g} to {:g}: {}", band->low, band->high, holds_here ? "ok" : "MISSED"));
  }
  (void)std::fflush(stdout);
  return good;
}

}  // namespace imuscope
