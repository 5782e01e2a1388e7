#pragma once

/// Text from outside: files, messages of a network, names that devices report.

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "base/result.h"

namespace imuscope {

/// Whether the text is UTF-8 (Unicode 15, table 3-7).
[[nodiscard]] bool is_utf8(std::string_view text);

/// The text with '?' for every character that a terminal would act upon (C0 and C1 control characters,
/// delete) and for every byte that belongs to no UTF-8 character: what is printed moves no cursor, changes no
/// colour and begins no line.
[[nodiscard]] std::string printable(std::string_view text);

/// Longest text that is shown or written as one line: a remark, a problem, a message of a person.
inline constexpr std::size_t kLineMax = 4096;

/// Text of any origin as one line: printable(), and cut before the character that does not fit.
/// @param longest  in bytes
[[nodiscard]] std::string one_line(std::string_view text, std::size_t longest = kLineMax);

inline constexpr std::size_t kDeviceNameMax = 32;

/// Whether the text is 1 to kDeviceNameMax letters of ASCII, digits, '_' or '-': names of devices become
/// parts of file names.
[[nodiscard]] bool is_device_name(std::string_view text);

/// "STEM_NAMEsuffix": a file of one device of a run.
/// @param stem, suffix  written in this program
/// @param name          of the device: is_device_name()
[[nodiscard]] std::string device_file_name(std::string_view stem, std::string_view name,
                                           std::string_view suffix);

/// No text file that a person writes, a vehicle's DBC file included, is this large.
inline constexpr std::size_t kTextFileMax = std::size_t{64} << 20U;

/// The content of a regular file, at most kTextFileMax bytes.
/// @param what    the kind of file, for the error: "configuration", "DBC file"
/// @param remedy  of a wrong path: "give the path of ..."
/// @return a usage error that names the file where it is missing, a folder, a device or a pipe, unreadable,
///         or larger
[[nodiscard]] Result<std::string> read_text_file(const std::filesystem::path& file, std::string_view what,
                                                 const std::string& remedy);

}  // namespace imuscope
