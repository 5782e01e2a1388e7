#include "service/live/reload.h"

#include <set>

#include "careful_toml.h"

namespace imuscope {

namespace {

/// Tables that Tunables cover.
const std::set<std::string> kTunableTables{"lcm", "noise"};

/// Names of top-level tables in which two valid documents differ.
std::set<std::string> differing_tables(const std::string& before, const std::string& after) {
  const toml::table a = toml::parse(before);
  const toml::table b = toml::parse(after);
  std::set<std::string> names;
  const auto compare = [&](const toml::table& from, const toml::table& to) {
    for (const auto& [key, node] : from) {
      const auto* const other = to.get(key);
      const bool same = other != nullptr && node.visit([&](const auto& value) {
        const auto* const as_same_type = other->as<std::remove_cvref_t<decltype(value)>>();
        return as_same_type != nullptr && value == *as_same_type;
      });
      if (!same) names.emplace(key.str());
    }
  };
  compare(a, b);
  compare(b, a);
  return names;
}

}  // namespace

Result<Reload> reload_configuration(const Configuration& running) {
  const auto read = load_configuration(running.file);
  if (!read) return tl::unexpected<Error>(read.error());
  auto model = noise::parse_model(read->noise.model);
  if (!model) return tl::unexpected<Error>(model.error());
  Reload reload{{read->lcm, read->noise, std::move(*model)}, {}};
  for (const auto& name : differing_tables(running.text, read->text)) {
    if (!kTunableTables.contains(name)) reload.at_next_start.push_back(name);
  }
  return reload;
}

}  // namespace imuscope
