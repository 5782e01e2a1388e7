#pragma once

/// A composite noise model: which processes (ModelSpec), and with which values (Model).

#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "models/noise/process.h"

namespace imuscope::noise {

/// The processes of a model, in the order QN, WN, MA1, ARMA11, SIN..., RES..., GM..., FN, PL, RW, DR.
struct ModelSpec {
  std::vector<ProcessKind> processes;

  [[nodiscard]] std::string name() const;  ///< canonical, such as "WN+2*GM+RW"
  [[nodiscard]] int parameter_count() const;
  [[nodiscard]] int count(ProcessKind kind) const;
  friend bool operator==(const ModelSpec&, const ModelSpec&) = default;
};

/// Reads "WN+2*GM", "WN + GM + GM", "QN+WN+RW". At most one each of WN, QN, RW, DR, MA1, ARMA11, FN,
/// PL; up to kMaxRepeated GM, SIN and RES. Errors (kUsage): an unknown or repeated term, named, with the
/// terms that exist.
Result<ModelSpec> parse_model(std::string_view text);

inline constexpr int kMaxRepeated = 8;

/// A process with values, in sample terms; see process.h for what amplitude and shape mean.
struct Component {
  ProcessKind kind = ProcessKind::kWhiteNoise;
  double amplitude = 0.0;
  Shape shape{};
};

/// GM components in order of falling rate.
struct Model {
  std::vector<Component> components;
};

/// "GM2", "WN": name of each component, numbered where its kind may be repeated.
std::vector<std::string> component_names(const Model& model);

/// Wavelet variance of the model at `level`.
double model_wv(const Model& model, int level) noexcept;

}  // namespace imuscope::noise
