#pragma once

/// What the bits of the status words mean, for people. Bits without a name are reserved, or not known. The list is
/// complete where a public decoder's is not: there USBL "waiting" is missing, so that from bit 18 of the first
/// algorithm word on every name is one bit too low.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace imuscope::ixblue_stdbin {

using StatusNames = std::array<std::string_view, 32>;

inline constexpr StatusNames kAlgorithmStatus1{
    "navigation",         "alignment",        "fine_alignment",      "dead_reckoning",
    "altitude_gps",       "altitude_depth",   "altitude_zero",       "altitude_hydro",
    "log_received",       "log_valid",        "log_waiting",         "log_rejected",
    "gps_received",       "gps_valid",        "gps_waiting",         "gps_rejected",
    "usbl_received",      "usbl_valid",       "usbl_waiting",        "usbl_rejected",
    "depth_received",     "depth_valid",      "depth_waiting",       "depth_rejected",
    "lbl_received",       "lbl_valid",        "lbl_waiting",         "lbl_rejected",
    "altitude_saturated", "speed_saturated",  "interpolation_missed", "heave_initialising"};

inline constexpr StatusNames kAlgorithmStatus2{
    "water_track_received", "water_track_valid",  "water_track_waiting", "water_track_rejected",
    "gps2_received",        "gps2_valid",         "gps2_waiting",        "gps2_rejected",
    "",                     "",                   "",                    "",
    "altitude_received",    "altitude_valid",     "altitude_waiting",    "altitude_rejected",
    "zupt_active",          "zupt_valid",         "static_bench_zupt",   "static_bench_zupt_valid",
    "static_convergence",   "go_to_navigation",   "fast_alignment",      "emulation",
    "em_log_received",      "em_log_valid",       "em_log_waiting",      "em_log_rejected",
    "manual_gps_received",  "manual_gps_valid",   "manual_gps_waiting",  "manual_gps_rejected"};

inline constexpr StatusNames kAlgorithmStatus3{
    "svl_received",     "svl_valid",         "svl_waiting",     "svl_rejected",
    "em_log2_received", "em_log2_valid",     "em_log2_waiting", "em_log2_rejected",
    "usbl2_received",   "usbl2_valid",       "usbl2_waiting",   "usbl2_rejected",
    "usbl3_received",   "usbl3_valid",       "usbl3_waiting",   "usbl3_rejected",
    "",                 "calibration_check", "restore_attitude_failed", "relative_speed_zupt",
    "relative_speed_zupt_valid", "sensor_outdated", "used_before_calibration", "restore_rejected",
    "",                 "",                  "",                "polar",
    "firmware_mismatch", "",                 "",                ""};

inline constexpr StatusNames kAlgorithmStatus4{
    "log2_received",         "log2_valid",          "log2_waiting",        "log2_rejected",
    "water_track2_received", "water_track2_valid",  "water_track2_waiting", "water_track2_rejected",
    "dvl_distance_valid",    "dvl_uncalibrated",    "dvl_calibration_rough", "dvl_calibration_fine",
    "dvl_calibration_check", "manual_attitude_received", "manual_attitude_valid", "manual_attitude_waiting",
    "manual_attitude_rejected", "fixed_heading",    "degraded",            "vtg_received",
    "vtg_valid",             "vtg_waiting",         "vtg_rejected",        "vtg2_received",
    "vtg2_valid",            "vtg2_waiting",        "vtg2_rejected",       "",
    "",                      "",                    "odometer_calibrated", "sensor_data_inconsistent"};

inline constexpr StatusNames kSystemStatus1{
    "input_r_error",  "input_a_error",  "input_b_error",  "input_c_error",
    "input_d_error",  "input_e_error",  "input_f_error",  "input_g_error",
    "input_r_active", "input_a_active", "input_b_active", "input_c_active",
    "input_d_active", "input_e_active", "input_f_active", "input_g_active",
    "output_r_full",  "output_a_full",  "output_b_full",  "output_c_full",
    "output_d_full",  "output_e_full",  "ethernet_full",  "",
    "internal_time",  "",               "ethernet_active", "pulse_a",
    "pulse_b",        "pulse_c",        "pulse_d",        ""};

inline constexpr StatusNames kSystemStatus2{
    "dvl_bottom", "dvl_water",       "gps",           "gps2",
    "usbl",       "lbl",             "depth",         "em_log",
    "odometer",   "utc",             "altitude",      "pps",
    "zupt",       "",                "manual_gps",    "ctd",
    "simulation", "",                "dsp_mismatch",  "heading_alert",
    "position_alert", "wait_for_position", "",        "polar",
    "internal_log", "",              "dov",           "cpu_overload",
    "power_failure", "development",  "configuration_saved", ""};

inline constexpr StatusNames kSystemStatus3{
    "utc2", "pps2", "",     "ntp_syncing", "ntp_received", "ntp_synchronised", "ntp_failed", "",
    "dvl2_bottom", "dvl2_water", "em_log2", "", "", "vtg", "", "manual_attitude",
    "can_error", "can_active", "", "", "", "", "", "",
    "", "", "", "", "", "", "", ""};

inline constexpr StatusNames kUserStatus{
    "dvl_valid",       "gps_valid",       "depth_valid",      "usbl_valid",
    "lbl_valid",       "gps2_valid",      "em_log_valid",     "manual_gps_valid",
    "time_valid",      "fog_anomaly",     "accelerometer_anomaly", "temperature_anomaly",
    "cpu_overload",    "dynamic_exceeded", "speed_saturated", "altitude_saturated",
    "input_a_error",   "input_b_error",   "input_c_error",    "input_d_error",
    "input_e_error",   "output_a_error",  "output_b_error",   "output_c_error",
    "output_d_error",  "output_e_error",  "hrp_invalid",      "alignment",
    "fine_alignment",  "navigation",      "degraded",         "failure"};

inline constexpr StatusNames kSensorStatus1{
    "data_ready",      "source_1",        "source_2",        "source_3",
    "accel_1_saturated", "accel_2_saturated", "accel_3_saturated", "accel_1_acquisition",
    "accel_2_acquisition", "accel_3_acquisition", "fog_1_saturated", "fog_2_saturated",
    "fog_3_saturated", "fog_1_vpi",       "fog_2_vpi",       "fog_3_vpi",
    "fog_1_low_power", "fog_2_low_power", "fog_3_low_power", "fog_1_acquisition",
    "fog_2_acquisition", "fog_3_acquisition", "fog_1_crc",   "fog_2_crc",
    "fog_3_crc",       "temperature_1",   "temperature_2",   "temperature_3",
    "fifo_warning",    "fifo_error",      "source_power",    "source_reset"};

inline constexpr StatusNames kSensorStatus2{
    "fog_1",           "fog_2",           "fog_3",           "source",
    "accel_1",         "accel_2",         "accel_3",         "temperature",
    "dsp_overload",    "can_init_accel_1", "can_init_accel_2", "can_init_accel_3",
    "model",           "",                "",                "",
    "",                "",                "",                "",
    "",                "",                "",                "",
    "",                "",                "",                "",
    "",                "",                "degraded",        "failure"};

/// The words of one status block, in order.
struct StatusBlock {
  std::string_view block;  ///< as in kNavBlocks
  std::array<const StatusNames*, 4> words;
};
inline constexpr std::array<StatusBlock, 7> kStatusBlocks{{
    {"sensor_status", {&kSensorStatus1, &kSensorStatus2, nullptr, nullptr}},
    {"ins_algo_status", {&kAlgorithmStatus1, &kAlgorithmStatus2, &kAlgorithmStatus3, &kAlgorithmStatus4}},
    {"ins_system_status", {&kSystemStatus1, &kSystemStatus2, &kSystemStatus3, nullptr}},
    {"ins_user_status", {&kUserStatus, nullptr, nullptr, nullptr}},
    {"ahrs_algo_status", {&kAlgorithmStatus1, nullptr, nullptr, nullptr}},
    {"ahrs_system_status", {&kSystemStatus1, &kSystemStatus2, &kSystemStatus3, nullptr}},
    {"ahrs_user_status", {&kUserStatus, nullptr, nullptr, nullptr}},
}};

/// Calls visit(std::string_view) for each set bit that has a name.
template <typename Visit>
void for_each_set_bit(const StatusNames& names, std::uint32_t word, Visit&& visit) {
  for (std::size_t bit = 0; bit < names.size(); ++bit) {
    if ((word >> bit & 1U) != 0 && !names[bit].empty()) visit(names[bit]);
  }
}

}  // namespace imuscope::ixblue_stdbin
