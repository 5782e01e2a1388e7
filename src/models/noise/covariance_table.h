#pragma once

/// Covariance matrices of the wavelet variance for many models of records of one length. What wv_covariance()
/// sums anew for every model is a quadratic form in the model's processes (G-42): its terms are summed once
/// for white noise, walk, quantization and Gauss-Markov processes of a grid of rates, and read off for models
/// between them. Hundreds of times quicker than wv_covariance(); an entry agrees with it within 1e-3 of the
/// standard deviations of its levels. Thread-safe.

#include <Eigen/Core>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "models/noise/cross_covariance.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

class CovarianceTable {
 public:
  /// For the first `levels` of records whose coefficients are counted as those of `wv`. Costs little before
  /// the first model.
  CovarianceTable(const WaveletVariance& wv, std::size_t levels);
  ~CovarianceTable();
  CovarianceTable(const CovarianceTable&) = delete;
  CovarianceTable& operator=(const CovarianceTable&) = delete;

  /// Whether a table can be made for `wv`: a classical wavelet variance of one run of samples.
  static bool serves(const WaveletVariance& wv);

  /// Whether this is the table of `wv`.
  [[nodiscard]] bool fits(const WaveletVariance& wv, std::size_t levels) const;

  /// The same as wv_covariance(), of which it asks what it does not hold: alternating processes, resonances
  /// that ring for very long.
  /// @param wv  one that the table fits
  [[nodiscard]] Eigen::MatrixXd of(const Model& model, const WaveletVariance& wv) const;

 private:
  struct PairOfLevels;
  class Nodes;
  using Ringing = std::pair<int, int>;

  struct Sums;

  /// What of() needs of the table, summed where it is not there yet. Values stay while the sums live.
  [[nodiscard]] Sums sums_of(const std::map<int, double>& weights, const Parts& parts) const;
  [[nodiscard]] const Eigen::VectorXd& product(int a, int b) const;
  [[nodiscard]] const Eigen::VectorXd& mean(int a) const;
  [[nodiscard]] Nodes& ringing(const Parts& parts) const;

  WaveletVariance record_;  ///< levels and their numbers of coefficients
  std::size_t levels_;
  std::unique_ptr<Nodes> nodes_;
  mutable std::mutex mutex_;  ///< held while the table is looked up or filled, not while it is used
  mutable std::map<std::pair<int, int>, Eigen::VectorXd> products_;  ///< of two processes, by pair of levels
  mutable std::map<int, Eigen::VectorXd> means_;
  mutable std::map<Ringing, std::unique_ptr<Nodes>> ringing_;
};

/// Tables that fits of several axes share: axes of one record have the same numbers of coefficients.
/// Thread-safe.
class CovarianceTables {
 public:
  /// The table of `wv`; nothing where none can be made.
  std::shared_ptr<const CovarianceTable> of(const WaveletVariance& wv, std::size_t levels);

 private:
  std::mutex mutex_;
  std::vector<std::shared_ptr<const CovarianceTable>> tables_;
};

}  // namespace imuscope::noise
