#pragma once

/// Messages of the bus as the JSON of the page. Pure functions; a number that nobody knows is null, and a
/// text is one line of bounded length, whoever sent it.

#include <imuscope/calibration_t.hpp>
#include <imuscope/navigation_t.hpp>
#include <imuscope/noise_model_t.hpp>
#include <imuscope/odometry_t.hpp>
#include <imuscope/status_t.hpp>
#include <imuscope/wavelet_variance_t.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace imuscope::view {

/// Longest text of a message that the page shows.
inline constexpr std::size_t kShownTextMax = 300;

[[nodiscard]] nlohmann::json to_json(const status_t& status);
[[nodiscard]] nlohmann::json to_json(const calibration_t& calibration);
[[nodiscard]] nlohmann::json to_json(const navigation_t& navigation);
[[nodiscard]] nlohmann::json to_json(const odometry_t& odometry);
[[nodiscard]] nlohmann::json to_json(const wavelet_variance_t& variances);
[[nodiscard]] nlohmann::json to_json(const noise_model_t& models);

/// Text of a stranger as the page may have it.
[[nodiscard]] std::string shown(std::string_view text);

/// Appends a number with as many digits as a figure shows, or null.
void append_number(std::string& out, double value);

}  // namespace imuscope::view
