#include "models/noise/model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>

namespace imuscope::noise {
namespace {

constexpr std::array kKinds{ProcessKind::kQuantization, ProcessKind::kWhiteNoise, ProcessKind::kMa1,
                            ProcessKind::kArma11,       ProcessKind::kSinusoid,   ProcessKind::kResonance,
                            ProcessKind::kGaussMarkov,  ProcessKind::kFlicker,    ProcessKind::kPowerLaw,
                            ProcessKind::kRandomWalk,   ProcessKind::kRamp};
constexpr const char* kTermsThatExist =
    "terms are QN, WN, MA1, ARMA11, SIN, RES, GM, FN, PL, RW, DR, joined by +, such as WN+2*GM";

bool repeatable(ProcessKind kind) {
  return kind == ProcessKind::kGaussMarkov || kind == ProcessKind::kSinusoid ||
         kind == ProcessKind::kResonance;
}

std::string without_spaces_upper(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const auto u = static_cast<unsigned char>(c);
    if (std::isspace(u) == 0) out.push_back(static_cast<char>(std::toupper(u)));
  }
  return out;
}

struct Term {
  int count = 1;
  ProcessKind kind = ProcessKind::kWhiteNoise;
};

Result<Term> parse_term(std::string_view term, std::string_view whole) {
  const auto wrong = [&](std::string_view why) {
    return usage_error(fmt::format("the model '{}' {} '{}'", whole, why, term), kTermsThatExist);
  };
  if (term.empty()) return wrong("has an empty term");
  Term result;
  std::string_view name = term;
  if (std::isdigit(static_cast<unsigned char>(name.front())) != 0) {
    result.count = name.front() - '0';
    name.remove_prefix(1);
    if (!name.empty() && name.front() == '*') name.remove_prefix(1);
  }
  const auto* const kind =
      std::find_if(kKinds.begin(), kKinds.end(), [&](ProcessKind k) { return short_name(k) == name; });
  if (kind == kKinds.end()) return wrong("has an unknown term");
  if (result.count < 1 || result.count > kMaxRepeated) return wrong("repeats too often or not at all");
  result.kind = *kind;
  return result;
}

}  // namespace

std::string ModelSpec::name() const {
  std::string text;
  for (const ProcessKind kind : kKinds) {
    const int n = count(kind);
    if (n == 0) continue;
    if (!text.empty()) text += '+';
    if (n > 1) text += fmt::format("{}*", n);
    text += short_name(kind);
  }
  return text;
}

int ModelSpec::parameter_count() const {
  int n = 0;
  for (const ProcessKind kind : processes) n += 1 + shape_count(kind);
  return n;
}

int ModelSpec::count(ProcessKind kind) const {
  return static_cast<int>(std::count(processes.begin(), processes.end(), kind));
}

Result<ModelSpec> parse_model(std::string_view text) {
  const std::string compact = without_spaces_upper(text);
  ModelSpec spec;
  std::string_view rest = compact;
  while (true) {
    const std::size_t plus = rest.find('+');
    const auto term = parse_term(rest.substr(0, plus), text);
    if (!term) return tl::unexpected(term.error());
    spec.processes.insert(spec.processes.end(), static_cast<std::size_t>(term->count), term->kind);
    if (plus == std::string_view::npos) break;
    rest.remove_prefix(plus + 1);
  }
  for (const ProcessKind kind : kKinds) {
    const int limit = repeatable(kind) ? kMaxRepeated : 1;
    if (spec.count(kind) > limit) {
      return usage_error(fmt::format("the model '{}' has {} {} terms and at most {} can be told apart", text,
                                     spec.count(kind), short_name(kind), limit),
                         kTermsThatExist);
    }
  }
  std::sort(spec.processes.begin(), spec.processes.end());
  return spec;
}

std::vector<std::string> component_names(const Model& model) {
  std::array<int, kKinds.size()> seen{};
  std::vector<std::string> names;
  for (const Component& c : model.components) {
    std::string name(short_name(c.kind));
    if (repeatable(c.kind)) name += std::to_string(++seen[static_cast<std::size_t>(c.kind)]);
    names.push_back(std::move(name));
  }
  return names;
}

double model_wv(const Model& model, int level) noexcept {
  double sum = 0.0;
  for (const Component& c : model.components) {
    if (c.amplitude > 0.0) sum += c.amplitude * unit_wv(c.kind, c.shape, level).value;
  }
  return sum;
}

}  // namespace imuscope::noise
