#pragma once

/// MCAP files for tests.

#include <gtest/gtest.h>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "logs/mcap/reader.h"
#include "logs/mcap/writer.h"
#include "tests/support/temporary_file.h"

namespace imuscope::mcap {

using test::TemporaryFile;

/// What a message was, kept.
struct Kept {
  std::string topic;
  std::uint64_t log_time = 0;
  std::string data;
  friend bool operator==(const Kept&, const Kept&) = default;
};

struct ReadFile {
  std::vector<Kept> messages;
  std::vector<std::string> losses;
};

inline ReadFile read_file(const std::string& content) {
  const TemporaryFile file(content);
  auto reader = Reader::open(file.path());
  ReadFile read;
  if (!reader) {
    read.losses.push_back(reader.error().text());
    return read;
  }
  while (const auto message = reader->next())
    read.messages.push_back({message->topic->name, message->log_time, std::string(text_of(message->data))});
  read.losses = reader->losses();
  return read;
}

inline std::string data_of(int i) {
  return "message " + std::to_string(i) + std::string(100, static_cast<char>('a' + i % 26));
}

/// Two topics in turn, `n` messages, chunks of about two kilobytes; with an attachment and metadata.
inline std::string written(Compression compression, int n) {
  std::string file;
  WriterOptions options{"ros2", "test", compression, 2048};
  Writer writer(options, [&file](std::string_view bytes) { file += bytes; });
  const auto schema = writer.add_schema("a/msg/Text", "ros2msg", "string text\n");
  const auto even = writer.add_channel("/even", schema, "cdr");
  const auto odd = writer.add_channel("/odd", 0, "json", {{"key", "value"}});
  for (int i = 0; i < n; ++i) {
    const std::string data = data_of(i);
    writer.write(i % 2 == 0 ? even : odd, 1000U + static_cast<unsigned>(i), 7, bytes_of(data));
  }
  writer.attach("note.txt", "text/plain", 5, "attached");
  writer.add_metadata("run", {{"name", "test"}});
  writer.finish();
  return file;
}

}  // namespace imuscope::mcap
