// SPDX-License-Identifier: Apache-2.0
// A gateway of which recordings are asked for, and who records.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "codec/recording.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/web/gateway_fixture.h"

namespace relievo::test {

using Json = nlohmann::json;

constexpr const char* kFace = "/api/recording/face";
constexpr const char* kStart = R"({"action":"start"})";
constexpr const char* kStop = R"({"action":"stop"})";

/// Where the chunks end in a recording that has its index: the index, and what says that the data ends, is
/// behind.
inline std::size_t end_of_data(const std::string& recording) {
  constexpr std::size_t kFooter = 8 + 8 + 4, kMagic = 8, kDataEnd = 9 + 4;
  return u64_at(recording, recording.size() - kMagic - kFooter) - kDataEnd;
}

/// Asks for what came behind the chunks of `recording`, where it is no longer the one with this ETag.
inline std::string new_since(const std::string& recording, const std::string& etag) {
  return "Range: bytes=" + std::to_string(end_of_data(recording)) + "-\r\nIf-None-Match: " + etag + "\r\n";
}

/// Who records: a stream that is called face is all there is, and its file holds one chunk at once. Any
/// thread.
class OneStream final : public RecordingControl {
 public:
  explicit OneStream(std::filesystem::path folder) : folder_(std::move(folder)) {}

  std::optional<RecordingState> state(const std::string& stream) const override {
    if (stream != "face") return std::nullopt;
    const std::lock_guard lock(mutex_);
    RecordingState state = state_;
    state.whole_bytes = growing_ ? growing_->bytes() : 0;
    return state;
  }
  Status start(const std::string&) override {
    const std::lock_guard lock(mutex_);
    if (state_.activity == RecordingActivity::kRecording) return Error{"is recorded already"};
    state_ = {.activity = RecordingActivity::kRecording,
              .file = "face-1.mcap",
              .frames = 3,
              .bytes = 7,
              .room_bytes = 11};
    auto writer = RecordingWriter::create(folder_ / state_.file, {.chunk_ns = 0});
    if (!writer) return writer.error();
    writer_ = std::move(*writer);
    growing_ = writer_->growing();
    if (auto added = writer_->add_channel({"T", "omgidl", "struct T {};"}, {"t", "cdr", "T", {}}); !added)
      return added.error();
    return grow();
  }
  /// By a chunk of one message, the time of which is its number.
  Status grow() {
    const std::lock_guard lock(mutex_);
    ++messages_;
    if (auto status = writer_->write({0, messages_, messages_, messages_, Bytes(1000, 7)}); !status)
      return status;
    return writer_->flush_if_due(messages_);
  }
  Status stop(const std::string&) override {
    const std::lock_guard lock(mutex_);
    if (state_.activity != RecordingActivity::kRecording) return Error{"is not recorded"};
    state_.activity = RecordingActivity::kOff;
    return writer_->finish();
  }
  void starts_at(std::uint32_t time) { messages_ = time; }
  /// As if nothing of it were on the disk.
  void has_just_begun() {
    const std::lock_guard lock(mutex_);
    growing_.reset();
  }
  std::filesystem::path folder() const override { return folder_; }
  /// As if its writer ended it at the very moment at which it is asked for next.
  void ends_when_asked() {
    const std::lock_guard lock(mutex_);
    ends_when_asked_ = true;
  }
  bool is_open(const std::string& file) const override {
    std::this_thread::sleep_for(answers_after);
    const std::lock_guard lock(mutex_);
    if (std::exchange(ends_when_asked_, false)) {
      EXPECT_TRUE(const_cast<OneStream*>(this)->stop("face"));
    }
    return state_.activity == RecordingActivity::kRecording && state_.file == file;
  }
  std::shared_ptr<const GrowingRecording> growing(const std::string& file) const override {
    const std::lock_guard lock(mutex_);
    return state_.file == file ? growing_ : nullptr;
  }

  std::chrono::milliseconds answers_after{0};  // set before it is asked whether a file is open

 private:
  const std::filesystem::path folder_;
  mutable std::recursive_mutex mutex_;  // of what follows
  RecordingState state_;
  mutable bool ends_when_asked_ = false;
  std::unique_ptr<RecordingWriter> writer_;
  std::shared_ptr<const GrowingRecording> growing_;
  std::uint32_t messages_ = 0;
};

class RecordingApi : public GatewayTest {
 protected:
  void SetUp() override { start({.port = 0, .recordings = &control}); }
  void TearDown() override { gateway.reset(); }
  Json list() const { return Json::parse(request(port, "GET", "/api/recordings").body); }
  std::vector<std::string> listed() const {
    std::vector<std::string> out;
    const Json answer = list();
    for (const auto& one : answer["recordings"]) out.push_back(one["file"]);
    return out;
  }
  Response get(const std::string& headers = {}) const {
    return request(port, "GET", "/recordings/face-1.mcap", headers);
  }
  static std::string content_of(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  /// Of a recording that has its index.
  std::uint64_t messages_in(const std::string& content) const {
    const TempFolder there;
    std::ofstream(there / "got.mcap", std::ios::binary) << content;
    auto reader = RecordingReader::open(there / "got.mcap");
    if (!reader) ADD_FAILURE() << reader.error().message;
    if (!reader) return 0;
    EXPECT_FALSE((*reader)->summary().recovered);
    std::uint64_t read = 0;
    for (auto message = (*reader)->next(); message && *message; message = (*reader)->next())
      EXPECT_EQ((**message).log_time_ns, static_cast<std::int64_t>(++read));
    EXPECT_EQ((*reader)->summary().messages, read);
    EXPECT_EQ((*reader)->summary().channel_messages, std::vector<std::uint64_t>{read});
    EXPECT_EQ((*reader)->summary().end_ns, static_cast<std::int64_t>(read));
    return read;
  }

  TempFolder folder;
  OneStream control{folder.path()};
};

}  // namespace relievo::test
