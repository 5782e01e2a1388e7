#include <pybind11/functional.h>

#include "base/text.h"
#include "conversions.h"
#include "results/report/report.h"
#include "service/recording/recording.h"
#include "study/several_drives.h"
#include "study/study.h"

namespace imuscope::python {
namespace {

namespace py = pybind11;

using Progress = std::function<void(const std::string&, double)>;

/// Tells Python how far the work is, and lets Ctrl-C end it.
Progress interruptible(const Progress& progress) {
  return [&progress](const std::string& what, double share) {
    const py::gil_scoped_acquire locked;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (progress) progress(what, share);
  };
}

std::vector<Label> labels_in(const std::string& file) {
  if (file.empty()) return {};
  return take(
      parse_labels(take(read_text_file(file, "file of labels", "give the path of a CSV file")), file));
}

OpenedRecording open(const std::vector<std::string>& inputs,
                     const std::optional<std::filesystem::path>& configuration, const Progress& progress) {
  std::vector<check::Finding> findings;
  auto opened = take(open_recording(inputs, configuration, progress, &findings));
  opened.findings = std::move(findings);
  return opened;
}

/// What `imuscope process` does, but its words.
/// @return the folders of the drives
std::vector<std::string> process(const std::vector<std::string>& inputs, const std::string& out,
                                 const std::optional<std::string>& configuration, const std::string& labels,
                                 const Progress& progress) {
  const py::gil_scoped_release unlocked;
  const Progress tell = interruptible(progress);
  std::optional<std::filesystem::path> config;
  if (configuration) config = *configuration;
  std::vector<OpenedRecording> drives;
  for (const auto& of_drive : drives_of(inputs)) drives.push_back(open(of_drive, config, tell));
  StudyRunOptions run;
  run.out = out;
  run.version = IMUSCOPE_VERSION;
  run.progress = tell;
  run.labels = labels_in(labels);
  if (drives.size() == 1) {
    run.findings = drives.front().findings;
    take(run_study(drives.front().configuration, drives.front().recording, run));
    take(write_report(out));
    return {out};
  }
  if (!run.labels.empty())
    throw Failure({ErrorKind::kUsage, "labels are of one drive", "process the drives one by one"});
  (void)take(run_studies(drives, run));
  std::vector<std::string> folders;
  for (std::size_t i = 0; i < drives.size(); ++i) {
    folders.push_back(drive_folder(out, i).string());
    take(write_report(folders.back()));
  }
  return folders;
}

}  // namespace

void bind_studies(py::module_& module) { module.def("process", &process); }

}  // namespace imuscope::python
