// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/recording_route.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <optional>
#include <string>

#include "web/gateway/byte_range.h"
#include "web/gateway/cut_recordings.h"
#include "web/gateway/entity_tag.h"
#include "web/gateway/recording_api.h"

namespace relievo {
namespace {

constexpr std::string_view kSuffix = ".mcap";

/// Another one where the file is another, or was written to.
std::string etag_of(const struct stat& file) {
  char text[80];
  std::snprintf(text, sizeof text, "\"%llx-%llx-%llx%09lx\"", static_cast<unsigned long long>(file.st_ino),
                static_cast<unsigned long long>(file.st_size),
                static_cast<unsigned long long>(file.st_mtim.tv_sec),
                static_cast<unsigned long>(file.st_mtim.tv_nsec));
  return text;
}

constexpr const char* kGrowing = "growing";
constexpr const char* kCut = "cut";  // short, and read with an index that is not in it

/// Of what is whole of a file, or was when it was `bytes` long.
std::string whole_etag(const char* kind, const struct stat& file, std::uint64_t bytes) {
  char text[48];
  std::snprintf(text, sizeof text, "\"%s-%llx-%llx\"", kind, static_cast<unsigned long long>(file.st_ino),
                static_cast<unsigned long long>(bytes));
  return text;
}

/// The `bytes` of whole_etag(); 0 where it is another file's, or none.
std::uint64_t growing_bytes(std::string_view etag, const struct stat& file) {
  const std::size_t dash = etag.rfind('-');
  if (dash == std::string_view::npos) return 0;
  std::uint64_t bytes = 0;
  std::from_chars(etag.data() + dash + 1, etag.data() + etag.size(), bytes, 16);
  return whole_etag(kGrowing, file, bytes) == etag ? bytes : 0;
}

/// What a request says of a recording, and what holds for it.
struct Asked {
  OfferedRecording recording;
  CutRecordings& cuts;
  bool of_folder = false;
  bool needs_token = false;
  std::string range, if_range, if_match, if_none_match;
};

struct Version {
  FilePart::Whole whole;
  std::string etag;
  bool finished = false;  // nobody changes it any more
};

/// What is to be read of a recording; nothing where it has only just been begun.
std::optional<Version> version_of(const Asked& asked, const struct stat& file) {
  const OfferedRecording& recording = asked.recording;
  const auto as_of = [&](const std::shared_ptr<const GrowingRecording>& growing,
                         std::uint64_t bytes) -> std::optional<Version> {
    auto end = growing && bytes > 0 ? growing->end_at(bytes) : nullptr;
    if (!end) return std::nullopt;
    return Version{{bytes, std::move(end)}, whole_etag(kGrowing, file, bytes)};
  };
  const std::uint64_t begun_at = growing_bytes(asked.if_range, file);
  if (auto version = as_of(recording.growing, begun_at)) return version;
  if (!recording.has_index)
    return as_of(recording.growing, recording.growing ? recording.growing->bytes() : 0);
  // Of a program that ended since, this one's before it was started again, say.
  if (begun_at > 0)
    if (auto version = as_of(asked.cuts.growth_of(recording.file, file), begun_at)) return version;
  const bool ended = has_end(recording.file);
  if (const auto index = ended ? nullptr : asked.cuts.index_of(recording.file, file)) {
    const std::uint64_t bytes = index->bytes();
    return Version{{bytes, index->end_at(bytes)}, whole_etag(kCut, file, bytes)};
  }
  if (!ended && growing_bytes(asked.if_none_match, file) > 0) {
    // Not left for long enough to be cut: to who followed it, it is what it was.
    const auto growth = asked.cuts.growth_of(recording.file, file);
    if (auto version = as_of(growth, growth->bytes())) return version;
  }
  const bool finished = recording.whole && (ended || !asked.of_folder);
  return Version{{static_cast<std::uint64_t>(file.st_size)}, etag_of(file), finished};
}

/// A cache may keep it and asks here each time whether it still is the same. One that many share need not,
/// for five minutes, where anybody may have what it keeps.
std::string_view cache_control(bool finished, bool needs_token) {
  return needs_token ? "private, no-cache" : finished ? "max-age=0, s-maxage=300" : "no-cache";
}

std::optional<OfferedRecording> recording_of_folder(const std::string& name,
                                                    const RecordingControl& control) {
  const auto file = recording_file(name, control);
  if (!file) return std::nullopt;
  return OfferedRecording{
      .file = *file, .growing = control.growing(name), .has_index = !control.is_open(name)};
}

}  // namespace

FilePart::~FilePart() {
  close(descriptor_);
}

std::size_t FilePart::read(std::uint64_t offset, std::span<std::uint8_t> into) const {
  const std::uint64_t at = part_.at + offset;
  const std::uint64_t wanted = std::min<std::uint64_t>(into.size(), part_.length - offset);
  if (at >= whole_.file_bytes) {
    const auto from = static_cast<std::ptrdiff_t>(at - whole_.file_bytes);
    if (wanted > 0) std::copy_n(whole_.end->begin() + from, wanted, into.begin());
    return static_cast<std::size_t>(wanted);
  }
  const auto of_file = static_cast<std::size_t>(std::min(wanted, whole_.file_bytes - at));
  ssize_t n = 0;
  do n = pread(descriptor_, into.data(), of_file, static_cast<off_t>(at));
  while (n < 0 && errno == EINTR);
  return n > 0 ? static_cast<std::size_t>(n) : 0;
}

namespace {

HttpReply reply_to(const Asked& asked) {
  const int follow = asked.of_folder ? O_NOFOLLOW : 0;  // what somebody links to from there is none of ours
  const int descriptor = open(asked.recording.file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | follow);
  struct stat status {};
  if (descriptor < 0 || fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    if (descriptor >= 0) close(descriptor);
    return text_reply(404, "the recording is gone");
  }
  const auto version = version_of(asked, status);
  if (!version) {
    close(descriptor);
    return text_reply(404, "the recording has only just begun: ask again in a second");
  }
  const std::uint64_t size = version->whole.size();
  const std::string& etag = version->etag;
  HttpReply reply;
  reply.content_type = "application/octet-stream";
  ByteRange range{0, size};
  RangeKind kind = RangeKind::kWhole;
  if (asked.if_range.empty() || asked.if_range == etag) kind = parse_range(asked.range, size, range);
  const std::string of = "/" + std::to_string(size);
  const bool finished = version->finished && kind != RangeKind::kUnsatisfiable;
  reply.headers = {{"Accept-Ranges", "bytes"},
                   {"Cache-Control", std::string(cache_control(finished, asked.needs_token))},
                   {"ETag", etag}};
  const auto failed = failed_condition(asked.if_match, asked.if_none_match, etag);
  if (failed || kind == RangeKind::kUnsatisfiable) {
    close(descriptor);
    reply.status = failed.value_or(416);
    if (reply.status == 416) reply.headers.emplace_back("Content-Range", "bytes *" + of);
    return reply;
  }
  if (kind == RangeKind::kPart) {
    reply.status = 206;
    reply.headers.emplace_back("Content-Range", "bytes " + std::to_string(range.at) + "-" +
                                                    std::to_string(range.at + range.length - 1) + of);
  }
  reply.file = std::make_shared<const FilePart>(descriptor, version->whole, range);
  return reply;
}

}  // namespace

HttpReply recording_reply(std::string_view name, const HttpRequest& request, const RouteContext& context) {
  if (!name.ends_with(kSuffix)) return text_reply(404, "no recording has such a name");
  auto recording = context.hub.recording_of(std::string(name.substr(0, name.size() - kSuffix.size())));
  const bool of_folder = !recording && context.recordings != nullptr;
  if (of_folder) recording = recording_of_folder(std::string(name), *context.recordings);
  if (!recording) return text_reply(404, "there is no such recording");
  return reply_from_disk(
      [asked = Asked{.recording = *std::move(recording),
                     .cuts = context.cuts,
                     .of_folder = of_folder,
                     .needs_token = context.tokens.needed(),
                     .range = std::string(request.method == "GET" ? request.range : ""),  // RFC 9110, 14.2
                     .if_range = std::string(request.if_range),
                     .if_match = std::string(request.if_match),
                     .if_none_match = std::string(request.if_none_match)}] { return reply_to(asked); });
}

}  // namespace relievo
