#pragma once

/// The study of several drives of one mounting: every drive is calibrated by itself, their mountings are
/// combined, and the error processes are made with the combined mounting.

#include <vector>

#include "base/result.h"
#include "service/recording/recording.h"
#include "study/combination.h"
#include "study/study.h"

namespace imuscope {

/// Below this probability the drives did not see one mounting; each then keeps its own.
inline constexpr double kOneMountingProbability = 0.01;

/// The inputs of a command line as those of single drives: every capture is a drive; of raw dumps NAME=FILE
/// the k-th file of every NAME belongs to drive k.
std::vector<std::vector<std::string>> drives_of(const std::vector<std::string>& inputs);

/// Folder of drive `index` (from 0) inside `out`.
std::filesystem::path drive_folder(const std::filesystem::path& out, std::size_t index);

/// Runs the study of every drive into its own folder inside options.out and writes options.out/combined.json.
/// Errors: what run_study() refuses; no S-IMU that two drives calibrated.
Result<Combination> run_studies(const std::vector<OpenedRecording>& drives, const StudyRunOptions& options);

}  // namespace imuscope
