#include "base/grouped.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace imuscope {
namespace {

/// A sentence, and all whose it is.
struct Group {
  std::vector<std::string> names;
  std::string sentence;
};

std::vector<Group> groups_of(const std::vector<Named>& sentences) {
  std::vector<Group> groups;
  for (const Named& one : sentences) {
    const auto known = std::find_if(groups.begin(), groups.end(), [&](const Group& group) {
      return group.sentence == one.sentence && group.names.empty() == one.name.empty();
    });
    if (known == groups.end()) {
      groups.push_back({{}, one.sentence});
      if (!one.name.empty()) groups.back().names.push_back(one.name);
    } else if (std::find(known->names.begin(), known->names.end(), one.name) == known->names.end() &&
               !one.name.empty()) {
      known->names.push_back(one.name);
    }
  }
  return groups;
}

/// A sentence without the name that it begins with.
Named without_name(const std::string& sentence, const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    if (sentence.rfind(name, 0) != 0 || sentence.size() < name.size() + 2) continue;
    const std::string rest = sentence.substr(name.size());
    if (rest.rfind(": ", 0) == 0) return {name, rest};
    const std::size_t colon = rest.find(": ");
    if (rest.rfind(", ", 0) == 0 && colon != std::string::npos)
      return {name, fmt::format(" ({}){}", rest.substr(2, colon - 2), rest.substr(colon))};
  }
  return {"", sentence};
}

}  // namespace

std::vector<std::string> grouped(const std::vector<Named>& sentences) {
  std::vector<std::string> out;
  for (const Group& group : groups_of(sentences)) {
    out.push_back(group.names.empty() ? group.sentence
                                      : fmt::format("{}: {}", fmt::join(group.names, ", "), group.sentence));
  }
  return out;
}

std::vector<std::string> grouped_by_name(const std::vector<std::string>& sentences,
                                         const std::vector<std::string>& names) {
  std::vector<Named> taken_apart;
  for (const std::string& sentence : sentences) taken_apart.push_back(without_name(sentence, names));
  std::vector<std::string> out;
  for (const Group& group : groups_of(taken_apart))
    out.push_back(fmt::format("{}{}", fmt::join(group.names, ", "), group.sentence));
  return out;
}

}  // namespace imuscope
