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

#include "models/noise/covariance_memory.h"
#include "models/noise/covariance_places.h"
#include "models/noise/cross_covariance.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

class CovarianceTable {
 public:
  /// For the first `levels` of records whose coefficients are counted as those of `wv`. Costs little before
  /// the first model.
  /// @param memory  for what models ask for again and again, shared with other tables
  CovarianceTable(const WaveletVariance& wv, std::size_t levels,
                  std::shared_ptr<CovarianceMemory> memory = std::make_shared<CovarianceMemory>());
  ~CovarianceTable();
  CovarianceTable(const CovarianceTable&) = delete;
  CovarianceTable& operator=(const CovarianceTable&) = delete;

  /// Whether a table can be made for `wv`: a classical wavelet variance, of one run of samples or of several.
  static bool serves(const WaveletVariance& wv);

  /// Whether this is the table of `wv`.
  [[nodiscard]] bool fits(const WaveletVariance& wv, std::size_t levels) const;

  /// The same as wv_covariance(), of which it asks what it does not hold: alternating processes, resonances
  /// that ring for very long.
  /// @param wv  one that the table fits
  [[nodiscard]] Eigen::MatrixXd of(const Model& model, const WaveletVariance& wv) const;

 private:
  struct Sums;

  /// What products of processes tell, summed where it is not there yet.
  [[nodiscard]] Sums sums_of(const std::map<int, double>& weights, bool has_ramp) const;
  /// The sums over lags of a model without what rings, pair by pair.
  /// @param weights  of the table's processes
  /// @param white    noise that is white on each pair alone
  [[nodiscard]] Eigen::VectorXd from_products(const std::map<int, double>& weights, double ramp,
                                              const Eigen::VectorXd& white,
                                              const std::vector<PairOfLevels>& pairs) const;
  /// Sets the sums of pairs on which the model rings.
  void sum_what_rings(const std::map<int, double>& weights, const Parts& parts, const Eigen::VectorXd& white,
                      Eigen::VectorXd& squares) const;
  [[nodiscard]] const Eigen::VectorXd& product(int a, int b) const;
  [[nodiscard]] const Eigen::VectorXd& mean(int a) const;
  [[nodiscard]] std::shared_ptr<const CovariancePlaces> places(const Lags& lags) const;
  /// Of a process of amplitude 1 at these places.
  [[nodiscard]] std::shared_ptr<const Eigen::VectorXd> values(const Lags& lags, int process) const;

  WaveletVariance record_;  ///< levels, their numbers of coefficients and where these lie
  std::size_t levels_;
  bool has_holes_;
  std::shared_ptr<CovarianceMemory> memory_;
  std::size_t number_;        ///< of this table in the memory
  mutable std::mutex mutex_;  ///< of the two below, while they are looked up or filled
  mutable std::map<std::pair<int, int>, Eigen::VectorXd> products_;  ///< of two processes, by pair of levels
  mutable std::map<int, Eigen::VectorXd> means_;
};

/// Tables that fits of several axes share: axes of one record have the same numbers of coefficients.
/// Thread-safe.
class CovarianceTables {
 public:
  explicit CovarianceTables(std::shared_ptr<CovarianceMemory> memory = std::make_shared<CovarianceMemory>())
      : memory_(std::move(memory)) {}

  /// The table of `wv`; nothing where none can be made.
  std::shared_ptr<const CovarianceTable> of(const WaveletVariance& wv, std::size_t levels);

 private:
  std::shared_ptr<CovarianceMemory> memory_;
  std::mutex mutex_;
  std::vector<std::shared_ptr<const CovarianceTable>> tables_;
};

}  // namespace imuscope::noise
