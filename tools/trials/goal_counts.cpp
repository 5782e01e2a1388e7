#include "goal_counts.h"

#include <fmt/format.h>

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
    const bool holds_here = band == nullptr || (share >= band->low - kOwnSd * sd_at(band->low) &&
                                                share <= band->high + kOwnSd * sd_at(band->high));
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
