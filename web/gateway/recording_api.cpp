// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/recording_api.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>
#include <vector>

#include "base/json_text.h"
#include "codec/cut_recording.h"
#include "codec/mcap_records.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMostListed = 1000;
constexpr std::size_t kLongestName = 128;

HttpReply json(const Json& value) {
  return json_reply(json_line(value));
}

HttpReply no_folder() {
  return text_reply(404, "nothing is recorded here: start relievo-server serve with --record-dir DIR");
}

HttpReply state_of(const std::string& stream, const RecordingControl& control) {
  const auto state = control.state(stream);
  if (!state) return text_reply(404, "there is no such stream here");
  return json_reply(recording_message(*state));
}

bool is_recording_name(const std::string& name) {
  const auto is_plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  };
  return name.ends_with(".mcap") && name.front() != '.' && name.size() <= kLongestName &&
         std::all_of(name.begin(), name.end(), is_plain);
}

std::int64_t utc_ns(fs::file_time_type time) {
  using namespace std::chrono;
  return duration_cast<nanoseconds>(file_clock::to_sys(time).time_since_epoch()).count();
}

}  // namespace

HttpReply recording_state(std::string_view stream, const RecordingControl* control) {
  return control == nullptr ? no_folder() : state_of(std::string(stream), *control);
}

HttpReply order_recording(std::string_view stream, const HttpRequest& request, RecordingControl* control) {
  if (control == nullptr) return no_folder();
  if (!is_json(request)) return text_reply(415, "send application/json");
  const auto order = nlohmann::json::parse(request.body, nullptr, false);
  const auto action = order.is_object() ? order.value("action", nlohmann::json()) : nlohmann::json();
  if (action != "start" && action != "stop")
    return text_reply(400, R"(send {"action":"start"} or {"action":"stop"})");
  const std::string name(stream);
  if (!control->state(name)) return text_reply(404, "there is no such stream here");
  const Status done = action == "start" ? control->start(name) : control->stop(name);
  return done ? state_of(name, *control) : text_reply(409, done.error().message);
}

namespace {

HttpReply list(const RecordingControl& control) {
  struct Found {
    std::int64_t modified_ns;
    std::string name;
    std::uint64_t bytes;
    bool recording;
  };
  std::vector<Found> found;
  std::error_code unread;
  for (fs::directory_iterator at(control.folder(), unread), end; at != end; at.increment(unread)) {
    std::error_code error;  // of this file alone
    const fs::directory_entry& entry = *at;
    const std::string name = entry.path().filename().string();
    if (entry.symlink_status(error).type() != fs::file_type::regular || !recording_file(name, control))
      continue;
    // Asked before the file is: what is finished in between has its whole size.
    const bool recording = control.is_open(name);
    std::uint64_t bytes = entry.file_size(error);
    if (recording) {
      const auto growing = control.growing(name);
      const std::uint64_t whole = growing ? growing->bytes() : 0;
      if (whole == 0) continue;  // there is nothing to see yet
      bytes = whole + growing->end_at(whole)->size();
    }
    const std::int64_t modified_ns = error ? 0 : utc_ns(entry.last_write_time(error));
    if (!error) found.push_back({modified_ns, name, bytes, recording});  // else it has just gone
  }
  if (unread) return text_reply(503, "the folder of recordings cannot be read: " + unread.message());
  std::sort(found.begin(), found.end(), [](const Found& a, const Found& b) {
    return std::tie(b.modified_ns, b.name) < std::tie(a.modified_ns, a.name);
  });
  if (found.size() > kMostListed) found.resize(kMostListed);
  Json list = Json::array();
  for (const Found& f : found) {
    const fs::path file = control.folder() / f.name;
    const bool cut = !f.recording && !has_end(file);
    if (cut && !may_hold_chunk(file)) continue;  // nothing to see
    list.push_back({{"file", f.name},
                    {"bytes", f.bytes},
                    {"modified_ns", f.modified_ns},
                    {"recording", f.recording},
                    {"cut", cut}});
  }
  return json({{"recordings", std::move(list)}});
}

}  // namespace

HttpReply list_recordings(const RecordingControl* control) {
  if (control == nullptr) return no_folder();
  return reply_from_disk([control] { return list(*control); });
}

bool has_end(const fs::path& file) {
  std::array<char, mcap::kMagic.size()> end{};
  std::ifstream in(file, std::ios::binary);
  // At least one more before it, which the file begins with.
  return in.seekg(-static_cast<std::streamoff>(end.size()), std::ios::end) && in.tellg() > 0 &&
         in.read(end.data(), end.size()) &&
         std::equal(end.begin(), end.end(), mcap::kMagic.begin(),
                    [](char c, std::uint8_t magic) { return static_cast<std::uint8_t>(c) == magic; });
}

std::optional<fs::path> recording_file(const std::string& name, const RecordingControl& control) {
  return is_recording_name(name) ? std::optional(control.folder() / name) : std::nullopt;
}

}  // namespace relievo
