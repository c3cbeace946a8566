// SPDX-License-Identifier: Apache-2.0
// A small recording of known messages, and how to read one back.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "codec/recording.h"
#include "tests/support/make_surface.h"

namespace relievo::test {

constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'000;
constexpr std::int64_t kStep_ns = 33'000'000;

inline Bytes payload(int i, std::size_t size) {
  Random random(static_cast<std::uint64_t>(i));
  Bytes bytes(size);
  for (auto& b : bytes) b = static_cast<std::uint8_t>(random.bits());
  return bytes;
}

inline RecordedMessage message(std::uint16_t channel, int i, std::size_t size) {
  RecordedMessage m;
  m.channel = channel;
  m.sequence = static_cast<std::uint32_t>(i);
  m.log_time_ns = kStart_ns + i * kStep_ns;
  m.publish_time_ns = m.log_time_ns - 1000;
  m.data = payload(i, size);
  return m;
}

inline RecordingSchema schema() {
  return {"test::Frame", "omgidl", "module test { struct Frame { long x; }; };"};
}
inline RecordingChannel channel(const std::string& topic) {
  return {topic, "cdr", "test::Frame", {{"stream", "face"}}};
}

inline std::unique_ptr<RecordingWriter> create(const std::filesystem::path& file,
                                               RecordingWriter::Options options = {}) {
  auto writer = RecordingWriter::create(file, options);
  EXPECT_TRUE(writer.ok()) << (writer ? "" : writer.error().message);
  return std::move(*writer);
}

/// `count` messages on two channels, five a chunk, and two attachments.
inline void write_sample(const std::filesystem::path& file, int count, std::size_t size = 40) {
  auto writer = create(file, {.chunk_ns = 5 * kStep_ns, .chunk_bytes = 1 << 20});
  ASSERT_EQ(*writer->add_channel(schema(), channel("relievo/frame")), 0);
  ASSERT_TRUE(writer->add_attachment({"rig.yaml", "application/yaml", kStart_ns, {'a', ':', ' ', '1'}}).ok());
  ASSERT_EQ(*writer->add_channel(schema(), channel("relievo/status")), 1);
  for (int i = 0; i < count; ++i) ASSERT_TRUE(writer->write(message(i % 4 == 3 ? 1 : 0, i, size)).ok());
  ASSERT_TRUE(writer->add_attachment({"pattern.yaml", "application/yaml", kStart_ns, payload(99, 300)}).ok());
  ASSERT_TRUE(writer->finish().ok());
}

inline Bytes read_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return Bytes(std::istreambuf_iterator<char>(in), {});
}
inline void write_file(const std::filesystem::path& file, std::span<const std::uint8_t> bytes) {
  std::filesystem::remove(file);  // ext4 waits for the disk where a file is cut to nothing and written again
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

struct ReadBack {
  std::vector<RecordedMessage> messages;
  std::vector<std::string> errors;
};
inline ReadBack read_all(RecordingReader& reader) {
  ReadBack back;
  while (back.errors.size() < 100) {
    auto next = reader.next();
    if (!next) {
      back.errors.push_back(next.error().message);
      continue;
    }
    if (!next->has_value()) break;
    back.messages.push_back(std::move(**next));
  }
  return back;
}

inline std::unique_ptr<RecordingReader> open(const std::filesystem::path& file) {
  auto reader = RecordingReader::open(file);
  EXPECT_TRUE(reader.ok()) << (reader ? "" : reader.error().message);
  return std::move(*reader);
}

}  // namespace relievo::test
