#include "models/noise/continuous_form.h"

#include <fmt/format.h>

#include "models/noise/power_law.h"

namespace imuscope::noise {

std::vector<std::string> state_names(const Model& any) {
  const Model model = without_power_laws(any);
  const std::vector<std::string> of_components = component_names(model);
  std::vector<std::string> names;
  const auto add = [&](std::string first, std::string second) {
    names.push_back(std::move(first));
    names.push_back(std::move(second));
  };
  for (std::size_t i = 0; i < of_components.size(); ++i) {
    const Component& c = model.components[i];
    const std::string& name = of_components[i];
    if (c.amplitude <= 0.0) continue;
    switch (c.kind) {
      case ProcessKind::kWhiteNoise:
        break;
      case ProcessKind::kGaussMarkov:
      case ProcessKind::kRandomWalk:
        names.push_back(name);
        break;
      case ProcessKind::kRamp:
        add(name, name + " slope");
        break;
      case ProcessKind::kSinusoid:
        add(name + " sin", name + " cos");
        break;
      case ProcessKind::kResonance:
        add(name, name + " slope");
        break;
      case ProcessKind::kFlicker:
      case ProcessKind::kPowerLaw:
        break;  // written as its sum before
      case ProcessKind::kArma11:
        add(name, name + " moving average");
        break;
      case ProcessKind::kQuantization:
      case ProcessKind::kMa1:
        add(name + " now", name + " before");
        break;
    }
  }
  return names;
}

Result<ContinuousForm> continuous_form(const Model& any, double rate_hz) {
  const Model model = without_power_laws(any);
  const auto size = static_cast<Eigen::Index>(state_names(model).size());
  ContinuousForm out{Eigen::MatrixXd::Zero(size, size), Eigen::MatrixXd::Zero(size, size)};
  Eigen::Index at = 0;
  for (const Component& c : model.components) {
    if (c.amplitude <= 0.0) continue;
    switch (c.kind) {
      case ProcessKind::kWhiteNoise:
        break;
      case ProcessKind::kGaussMarkov:
        out.a(at, at) = -c.shape[0] * rate_hz;
        out.qc(at, at) = 2.0 * c.shape[0] * rate_hz * c.amplitude;
        at += 1;
        break;
      case ProcessKind::kRandomWalk:
        out.qc(at, at) = c.amplitude * rate_hz;
        at += 1;
        break;
      case ProcessKind::kRamp:
        out.a(at, at + 1) = rate_hz;  // the slope is one of a sample
        at += 2;
        break;
      case ProcessKind::kResonance: {
        const double stiffness = c.shape[0] * c.shape[0] + c.shape[1] * c.shape[1];
        out.a(at, at + 1) = rate_hz;  // the second state is a slope a sample
        out.a(at + 1, at) = -stiffness * rate_hz;
        out.a(at + 1, at + 1) = -2.0 * c.shape[0] * rate_hz;
        out.qc(at + 1, at + 1) = 4.0 * c.shape[0] * stiffness * c.amplitude * rate_hz;
        at += 2;
        break;
      }
      case ProcessKind::kSinusoid:
        out.a(at, at + 1) = c.shape[0] * rate_hz;
        out.a(at + 1, at) = -c.shape[0] * rate_hz;
        at += 2;
        break;
      default:
        return work_error(
            fmt::format("{} remembers whole samples and has no continuous form", short_name(c.kind)));
    }
  }
  return out;
}

}  // namespace imuscope::noise
