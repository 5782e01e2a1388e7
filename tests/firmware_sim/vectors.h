#pragma once

/// The protocols' golden vectors: NAME.hex holds bytes, NAME.json what they mean.

#include <cstdint>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/shared_data.h"

namespace imusim::test {

struct Vector {
  std::vector<std::uint8_t> bytes;
  nlohmann::json meaning;
};

/// All vectors of a protocol, by name.
inline std::map<std::string, Vector> load_vectors(const std::string& protocol) {
  std::map<std::string, Vector> vectors;
  std::ifstream hex(imuscope::test::source_path("tests/vectors/" + protocol + ".hex"));
  for (std::string line; std::getline(hex, line);) {
    const std::size_t colon = line.find(": ");
    if (line.empty() || line[0] == '#' || colon == std::string::npos) continue;
    std::vector<std::uint8_t>& bytes = vectors[line.substr(0, colon)].bytes;
    for (std::size_t i = colon + 2; i + 1 < line.size(); i += 2)
      bytes.push_back(static_cast<std::uint8_t>(std::stoul(line.substr(i, 2), nullptr, 16)));
  }
  std::ifstream meanings(imuscope::test::source_path("tests/vectors/" + protocol + ".json"));
  const nlohmann::json all = nlohmann::json::parse(meanings);
  for (const nlohmann::json& vector : all["vectors"])
    vectors[vector["name"].get<std::string>()].meaning = vector;
  return vectors;
}

}  // namespace imusim::test
