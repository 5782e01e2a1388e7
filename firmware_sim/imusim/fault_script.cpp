#include "firmware_sim/imusim/fault_script.h"

#include <fmt/format.h>
#include <algorithm>
#include <fstream>
#include <sstream>

#include "firmware_sim/imusim/table_reader.h"
#include "firmware_sim/motion/degrees.h"

namespace imusim {
namespace {

constexpr double kLongest_s = 86400.0;

/// In the order of FaultKind.
const std::vector<std::string_view> kKinds = {
    "flip",       "drop",    "duplicate", "cut",     "garbage", "stall",      "burst",    "clock_skew",
    "clock_jump", "restart", "unplug",    "missing", "stuck",   "saturation", "rtk_jump", "solution"};

/// The texts of a key that is one text or a list of them.
std::vector<std::string> read_texts(TableReader& in, std::string_view key) {
  std::vector<std::string> texts;
  const toml::node* node = in.node(key);
  if (node == nullptr) return texts;
  if (const auto one = node->value_exact<std::string>()) return {*one};
  if (const toml::array* list = node->as_array()) {
    for (const toml::node& entry : *list) {
      if (const auto one = entry.value_exact<std::string>())
        texts.push_back(*one);
      else
        in.fail(key, "must be a text or a list of texts");
    }
    return texts;
  }
  in.fail(key, "must be a text or a list of texts");
  return texts;
}

bool is_for(const PlayedDevice& device, FaultKind kind) {
  const bool gnss = device.role == Role::kGnss;
  switch (kind) {
    case FaultKind::kStuck:
    case FaultKind::kSaturation:
      return !gnss;
    case FaultKind::kRtkJump:
    case FaultKind::kSolution:
      return gnss;
    default:
      return true;
  }
}

/// The keys that only some kinds have.
void read_specific(TableReader& in, Fault& fault) {
  switch (fault.kind) {
    case FaultKind::kFlip:
    case FaultKind::kDrop:
    case FaultKind::kDuplicate:
    case FaultKind::kCut:
    case FaultKind::kGarbage:
      in.number("share", fault.share, 1.0, 0.0, 1.0);
      if (!in.has("share")) in.fail("share", "needs a share: the probability for each byte or message");
      break;
    case FaultKind::kBurst:
      in.number("every_s", fault.every_s, 1.0, 1e-3, 60.0);
      break;
    case FaultKind::kClockSkew:
      in.number("ppm", fault.ppm, 1.0, -1e4, 1e4);
      break;
    case FaultKind::kClockJump:
      in.number("by_s", fault.by_s, 1.0, -kLongest_s, kLongest_s);
      break;
    case FaultKind::kMissing:
      fault.blocks = read_texts(in, "blocks");
      if (fault.blocks.empty()) in.fail("blocks", "needs blocks: the names of what is left out");
      break;
    case FaultKind::kStuck: {
      const std::size_t which = in.choice("sensors", {"both", "gyro", "accel"}, 0);
      fault.gyro = which != 2;
      fault.accel = which != 1;
      break;
    }
    case FaultKind::kSaturation:
      in.number("gyro_range_deg_per_s", fault.gyro_range_radps, kRadPerDeg, 0.0, 1e6);
      in.number("accel_range_mps2", fault.accel_range_mps2, 1.0, 0.0, 1e6);
      break;
    case FaultKind::kRtkJump:
      in.vector("by_n_m", fault.by_n_m, 1.0);
      break;
    case FaultKind::kSolution:
      fault.solution_type =
          static_cast<int>(in.choice("type", {"none", "single", "differential", "float", "fixed"}, 0));
      break;
    default:
      break;
  }
}

void read_fault(TableReader& in, Configuration& configuration) {
  Fault fault;
  if (!in.has("kind")) in.fail("kind", "needs a kind");
  fault.kind = static_cast<FaultKind>(in.choice("kind", kKinds, 0));
  const std::vector<std::string> names = read_texts(in, "device");
  if (!in.has("at_s")) in.fail("at_s", "needs at_s: when it begins");
  in.number("at_s", fault.begin_s, 1.0, 0.0, kLongest_s);
  double lasts_s = kLongest_s;
  in.number("for_s", lasts_s, 1.0, 0.0, kLongest_s);
  fault.end_s = fault.begin_s + lasts_s;
  read_specific(in, fault);
  in.refuse_unknown_keys();
  for (const std::string& name : names) {
    const bool known = std::any_of(configuration.devices.begin(), configuration.devices.end(),
                                   [&](const PlayedDevice& device) { return device.name == name; });
    if (!known) in.fail("device", fmt::format("names '{}', which the configuration does not have", name));
  }
  for (const PlayedDevice& device : configuration.devices) {
    const bool named = std::find(names.begin(), names.end(), device.name) != names.end();
    if (named && !is_for(device, fault.kind))
      in.fail("kind", fmt::format("cannot befall '{}': it is no such device", device.name));
    if (!is_for(device, fault.kind) || (!names.empty() && !named)) continue;
    fault.device = device.name;
    fault.tally = std::make_shared<FaultTally>();  // its own: each device may run on a thread
    configuration.faults.push_back(fault);
  }
}

}  // namespace

std::string_view name_of(FaultKind kind) { return kKinds[static_cast<std::size_t>(kind)]; }

Outcome<void> parse_faults(const std::string& text, const std::filesystem::path& file,
                           Configuration& configuration) {
  toml::table root;
  try {
    root = toml::parse(text, file.string());
  } catch (const toml::parse_error& error) {
    return wrong_usage(
        fmt::format("{}:{}: not TOML: {}", file.string(), error.source().begin.line, error.description()));
  }
  Problem problem{file.string(), {}};
  TableReader in(&root, "", problem);
  for (TableReader& fault : in.tables("fault")) read_fault(fault, configuration);
  in.refuse_unknown_keys();
  if (!problem.text.empty()) return wrong_usage(problem.text);
  if (configuration.faults.empty())
    return wrong_usage(fmt::format("{} holds no [[fault]] table", file.string()));
  configuration.fault_text = text;
  return {};
}

Outcome<void> load_faults(const std::filesystem::path& file, Configuration& configuration) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error))
    return wrong_usage(fmt::format("fault script {} does not exist or is not a file", file.string()));
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in)
    return wrong_usage(fmt::format("fault script {} cannot be read; check its permissions", file.string()));
  return parse_faults(text.str(), file, configuration);
}

}  // namespace imusim
