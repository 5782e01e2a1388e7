#pragma once

/// The one way to write files. A folder may come from elsewhere and hold links that lead out of it: it is
/// opened once, every file in it is fresh and takes its name by a rename, and nothing follows a link.

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"

namespace imuscope {

/// A file descriptor, closed at the end of its life.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int fd) noexcept : fd_(fd) {}
  Descriptor(Descriptor&& other) noexcept;
  Descriptor& operator=(Descriptor&& other) noexcept;
  ~Descriptor();
  [[nodiscard]] int get() const noexcept { return fd_; }
  [[nodiscard]] bool is_open() const noexcept { return fd_ >= 0; }
  /// The descriptor, for whoever closes it now.
  [[nodiscard]] int release() noexcept;

 private:
  int fd_ = -1;
};

/// A file of lines that is being written. Whole lines are collected and written in blocks. A block that the
/// disk refuses is lost as a whole, so that no line is torn, and the file goes on where there is room again.
/// Thread: one, non-real-time.
class OutputFile {
 public:
  /// @param lines  whole ones
  void write(std::string_view lines);
  /// What is wrong with the disk now, if anything.
  [[nodiscard]] std::optional<Error> problem() const;
  /// Writes what was collected. An error where any line was lost.
  [[nodiscard]] Result<void> close();
  [[nodiscard]] bool is_open() const noexcept { return file_.is_open(); }

  OutputFile() = default;
  OutputFile(OutputFile&&) noexcept = default;
  OutputFile& operator=(OutputFile&&) noexcept = default;
  /// Writes what was collected; close() tells whether that worked.
  ~OutputFile();

 private:
  friend class OutputFolder;
  OutputFile(Descriptor file, std::filesystem::path path) : file_(std::move(file)), path_(std::move(path)) {}
  void flush();

  Descriptor file_;
  std::filesystem::path path_;  ///< for messages
  std::string collected_;
  std::size_t whole_ = 0;  ///< bytes of the file
  std::size_t lines_lost_ = 0;
  int error_ = 0;          ///< errno of the first refused write
  int present_error_ = 0;  ///< of the last one
};

/// A folder that was opened once: a name in it is a name there, whatever becomes of the path that led to it.
/// Copies are the same folder. Names are single components, written in this program or device_file_name().
/// Errors are of kind kWork and name the file.
class OutputFolder {
 public:
  /// Makes the folder and those above it where they are absent. A link that was given as the folder is
  /// followed: whoever gave it meant it.
  static Result<OutputFolder> open(const std::filesystem::path& folder);

  /// A folder in it, made where absent. A link there is an error.
  [[nodiscard]] Result<OutputFolder> sub_folder(const std::string& name) const;

  /// A new file that has its name from the beginning, in place of whatever had it.
  [[nodiscard]] Result<OutputFile> begin(const std::string& name) const;

  /// A file that has its name when it is whole, in place of whatever had it.
  [[nodiscard]] Result<void> write_whole(const std::string& name, std::string_view content) const;

  /// A new file; where the name is taken, by whatever, it fails with EEXIST.
  /// @return nothing where it fails, and errno tells why
  [[nodiscard]] Descriptor create_new(const std::string& name) const noexcept;

  /// A file for reading and writing that has no name and is gone when it is closed.
  [[nodiscard]] Result<Descriptor> scratch_file() const;

  /// A folder in it with a name of its own; whoever asks for it removes it.
  [[nodiscard]] Result<OutputFolder> scratch_folder() const;

  /// Takes a file over from another folder, in place of whatever had its name here.
  [[nodiscard]] Result<void> take(const OutputFolder& from, const std::string& name) const;

  /// Takes a name away, also that of an empty folder. What is absent is no error.
  void remove(const std::string& name) const noexcept;

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  /// For what wants a descriptor of its own, such as the working folder of a program that is started.
  [[nodiscard]] int descriptor() const noexcept { return folder_->get(); }

 private:
  OutputFolder(Descriptor folder, std::filesystem::path path)
      : folder_(std::make_shared<Descriptor>(std::move(folder))), path_(std::move(path)) {}
  [[nodiscard]] Descriptor begin_unfinished(std::string& name) const;
  [[nodiscard]] Result<void> rename(const std::string& from, const std::string& to) const;

  std::shared_ptr<const Descriptor> folder_;
  std::filesystem::path path_;
};

}  // namespace imuscope
