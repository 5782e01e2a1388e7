#include "service/pipeline/observability.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "base/manoeuvres.h"
#include "base/units.h"

namespace imuscope {

namespace {

using Eigen::Vector3d;

/// Frame b is forward-right-down.
constexpr std::array<const char*, 3> kAxisWords{"forward", "right", "down"};
constexpr std::array<const char*, 3> kOppositeWords{"backward", "left", "up"};
constexpr std::array<const char*, 3> kAxisLetters{"x", "y", "z"};
constexpr std::size_t kTimeOffsetState = 6;
/// An axis within this angle of a direction names it.
constexpr double kOneAxis_deg = 15.0;
/// A part of the weakest direction with less than this share of its square is not mentioned.
constexpr double kMentioned = 0.2;
/// More than this of the assumed sd is left: the direction has not been shown.
constexpr double kUnseen = 0.5;
/// Advice that has not changed is repeated after this time.
constexpr Duration kAdviceEvery = std::chrono::seconds{60};
/// One that has changed not before this time.
constexpr Duration kChangedAdviceAfter = std::chrono::seconds{10};

/// What excites a state on a vehicle (each is confounded with something else without it).
const char* manoeuvre_for(std::size_t state) {
  switch (state) {
    case 0:
    case 1:
      return kTurnBothWays;
    case 2:
      return kBrakeFirmly;
    case 3:
    case 4:
      return kTurnTightly;
    case 5:
      return kRoughRoad;
    default:
      return kChangeQuickly;
  }
}

std::string words_of(std::size_t state) {
  if (state == kTimeOffsetState) return "time offset";
  return state < 3 ? fmt::format("boresight about {}", kAxisWords[state])
                   : fmt::format("lever arm along {}", kAxisWords[state - 3]);
}

std::string name_of_state(std::size_t state) {
  if (state == kTimeOffsetState) return "t_d";
  return fmt::format("{}_{}", state < 3 ? "psi" : "r", kAxisLetters[state % 3]);
}

/// "forward", or "an axis 30 deg from forward towards down".
std::string direction_words(const Vector3d& direction) {
  const Vector3d d = direction.normalized();
  std::array<Eigen::Index, 3> order{0, 1, 2};
  std::sort(order.begin(), order.end(),
            [&](Eigen::Index a, Eigen::Index b) { return std::abs(d(a)) > std::abs(d(b)); });
  const auto first = static_cast<std::size_t>(order[0]);
  const auto second = static_cast<std::size_t>(order[1]);
  const double off_deg = std::acos(std::min(1.0, std::abs(d(order[0])))) * kDegPerRad;
  if (off_deg <= kOneAxis_deg) return kAxisWords[first];
  const bool along = d(order[0]) * d(order[1]) > 0.0;
  return fmt::format("an axis {:.0f} deg from {} towards {}", off_deg, kAxisWords[first],
                     along ? kAxisWords[second] : kOppositeWords[second]);
}

std::string weakest_words(const std::array<double, 6>& direction) {
  const Vector3d psi(direction[0], direction[1], direction[2]);
  const Vector3d r(direction[3], direction[4], direction[5]);
  std::string about = "boresight about " + direction_words(psi);
  std::string along = "lever arm along " + direction_words(r);
  const double share = psi.squaredNorm() / (psi.squaredNorm() + r.squaredNorm());
  if (share > 1.0 - kMentioned) return about;
  if (share < kMentioned) return along;
  return share >= 0.5 ? about + " together with " + along : along + " together with " + about;
}

/// The state that is furthest from what it should be: not observable before observable, then by sd over goal.
std::size_t neediest(const std::array<StateObservability, kObservedStates>& states) {
  const auto need = [](const StateObservability& state) {
    return std::pair(!state.observable, state.sd / state.goal);
  };
  return static_cast<std::size_t>(
      std::max_element(states.begin(), states.end(),
                       [&](const auto& a, const auto& b) { return need(a) < need(b); }) -
      states.begin());
}

std::string value_text(const StateObservability& state) {
  if (!state.observable) return kNotObservable;
  return fmt::format("sd {:.3g} {}, {} {:.3g}", state.sd, state.unit,
                     state.reached() ? "within the goal of" : "goal", state.goal);
}

}  // namespace

Observability observability_of(const SImuOutput& study) {
  Observability out;
  for (std::size_t i = 0; i < kObservedStates; ++i) {
    StateObservability& state = out.states[i];
    state.name = name_of_state(i);
    state.words = words_of(i);
    if (i < 3) {
      state.unit = "deg";
      state.sd = study.sd_psi_rad[i] * kDegPerRad;
      state.goal = study.goal.boresight_sd_rad * kDegPerRad;
      state.observable = study.observable[i];
    } else if (i < kTimeOffsetState) {
      state.unit = "m";
      state.sd = study.sd_r_bs_b_m[i - 3];
      state.goal = study.goal.lever_arm_sd_m;
      state.observable = study.observable[i];
    } else {
      state.unit = "s";
      state.sd = study.sd_t_d_s;
      state.goal = study.goal.time_offset_sd_s;
      state.observable = study.t_d_observable;
    }
  }
  out.weakest = weakest_words(study.weakest_direction);
  out.weakest_relative_sd = study.weakest_relative_sd;
  const std::size_t needs = neediest(out.states);
  if (!out.states[needs].reached()) out.advice = manoeuvre_for(needs);
  return out;
}

nlohmann::json observability_json(const Observability& observability) {
  nlohmann::json states = nlohmann::json::array();
  for (const auto& state : observability.states) {
    states.push_back({{"name", state.name},
                      {"words", state.words},
                      {"sd", state.sd},
                      {"goal", state.goal},
                      {"unit", state.unit},
                      {"observable", state.observable},
                      {"goal_reached", state.reached()},
                      {"text", value_text(state)}});
  }
  return {{"states", states},
          {"weakest",
           {{"words", observability.weakest},
            {"relative_sd", observability.weakest_relative_sd},
            {"observable", observability.weakest_relative_sd < kUnseen}}},
          {"advice",
           observability.advice.empty() ? nlohmann::json(nullptr) : nlohmann::json(observability.advice)}};
}

std::vector<std::string> ObservabilityWatch::update(const SImuOutput& study) {
  std::vector<std::string> sentences;
  if (!has_estimate(study.status)) {
    started_ = false;
    observable_.fill(false);
    return sentences;
  }
  const Observability now = observability_of(study);
  std::vector<std::string> unseen;
  std::vector<std::string> seen;
  for (std::size_t i = 0; i < kObservedStates; ++i) {
    const StateObservability& state = now.states[i];
    if (state.observable && !observable_[i])
      seen.push_back(fmt::format("{} ({})", state.words, value_text(state)));
    observable_[i] = state.observable;
    if (!state.observable) unseen.push_back(state.words);
  }
  if (!seen.empty()) sentences.push_back(fmt::format("observable now: {}", fmt::join(seen, ", ")));
  // A changed advice is told soon, but not each time that two manoeuvres are about as good.
  const bool changed =
      now.advice != advice_ && study.time >= next_advice_ - kAdviceEvery + kChangedAdviceAfter;
  const bool due = !started_ || changed || study.time >= next_advice_;
  if (!unseen.empty() && due) {
    const std::string which =
        unseen.size() == kObservedStates ? "all of it" : fmt::format("{}", fmt::join(unseen, ", "));
    sentences.push_back(
        fmt::format("{}: {}; least is known of the {}; {}", kNotObservable, which, now.weakest, now.advice));
    next_advice_ = study.time + kAdviceEvery;
    advice_ = now.advice;
  }
  started_ = true;
  return sentences;
}

}  // namespace imuscope
