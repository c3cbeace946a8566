// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/recording_route.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string>
#include <system_error>

#include "codec/mcap_records.h"
#include "web/gateway/access.h"
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

std::string tag_start(const char* kind, const struct stat& file) {
  char text[48];
  std::snprintf(text, sizeof text, "\"%s-%llx-", kind, static_cast<unsigned long long>(file.st_ino));
  return text;
}

/// Of what is whole of a file, or was when it was `bytes` long, with the CRC of its index: where another
/// recording was written over it, times and places differ, also where as many bytes are whole of that.
std::string whole_etag(const char* kind, const struct stat& file, const FilePart::Whole& whole) {
  constexpr std::size_t kBehindCrc = mcap::kMagic.size(), kCrc = 4;
  char text[48];
  std::uint32_t crc = 0;
  if (whole.end->size() >= kCrc + kBehindCrc)
    std::memcpy(&crc, whole.end->data() + whole.end->size() - kBehindCrc - kCrc, sizeof crc);
  std::snprintf(text, sizeof text, "%llx-%08x\"", static_cast<unsigned long long>(whole.file_bytes), crc);
  return tag_start(kind, file) + text;
}

/// The bytes of whole_etag(); 0 where it is another file's, or none. Whether it was ever so long, and the
/// same one, is yet to be seen.
std::uint64_t growing_bytes(std::string_view etag, const struct stat& file) {
  const std::string start = tag_start(kGrowing, file);
  if (!etag.starts_with(start)) return 0;
  etag.remove_prefix(start.size());
  std::uint64_t bytes = 0;
  std::from_chars(etag.data(), etag.data() + etag.size(), bytes, 16);
  return bytes;
}

/// What a request says of a recording, and what holds for it.
struct Asked {
  OfferedRecording recording;
  CutRecordings& cuts;
  Walk walk{};  // through its file
  bool of_folder = false;
  bool needs_token = false;
  std::string range, if_range, if_match, if_none_match;
};

struct Version {
  FilePart::Whole whole;
  std::string etag;
  bool finished = false;  // nobody changes it any more
};

Version growing_version(const struct stat& file, std::uint64_t bytes, std::shared_ptr<const Bytes> end) {
  Version out{.whole = {bytes, std::move(end)}, .etag = {}};
  out.etag = whole_etag(kGrowing, file, out.whole);
  return out;
}

/// The file as it was when it had this ETag; nothing where it never had.
std::optional<Version> version_with(const std::string& etag, const struct stat& file,
                                    const GrowingRecording* growing) {
  const std::uint64_t bytes = growing_bytes(etag, file);
  auto end = growing && bytes > 0 ? growing->end_at(bytes) : nullptr;
  if (!end) return std::nullopt;
  auto version = growing_version(file, bytes, std::move(end));
  return version.etag == etag ? std::optional(std::move(version)) : std::nullopt;
}
std::optional<Version> version_now(const struct stat& file, const GrowingRecording* growing) {
  const std::uint64_t bytes = growing ? growing->bytes() : 0;
  auto end = bytes > 0 ? growing->end_at(bytes) : nullptr;
  return end ? std::optional(growing_version(file, bytes, std::move(end))) : std::nullopt;
}

/// As version_with(), also of a file that is written no more. How that grew is read from itself: it may be
/// another by now than its writer, which is done with it, remembers.
std::optional<Version> version_with(const std::string& etag, const struct stat& file, Asked& asked) {
  const OfferedRecording& recording = asked.recording;
  if (!recording.has_index) return version_with(etag, file, recording.growing.get());
  if (growing_bytes(etag, file) == 0) return std::nullopt;
  return version_with(etag, file, asked.cuts.growth_of(recording.file, file, asked.walk).get());
}

/// What is to be read of a recording; nothing where it has only just been begun.
std::optional<Version> version_of(Asked& asked, const struct stat& file) {
  const OfferedRecording& recording = asked.recording;
  if (auto version = version_with(asked.if_range, file, asked)) return version;
  if (!recording.has_index) return version_now(file, recording.growing.get());
  const bool ended = has_end(recording.file);
  if (const auto index = ended ? nullptr : asked.cuts.index_of(recording.file, file, asked.walk)) {
    Version version{.whole = {index->bytes(), index->end_at(index->bytes())}, .etag = {}};
    version.etag = whole_etag(kCut, file, version.whole);
    return version;
  }
  // Not left for long enough to be cut: to who followed it, it is what it was.
  if (!ended && growing_bytes(asked.if_none_match, file) > 0)
    if (auto version = version_now(file, asked.cuts.growth_of(recording.file, file, asked.walk).get()))
      return version;
  const bool finished = recording.whole && (ended || !asked.of_folder);
  return Version{{static_cast<std::uint64_t>(file.st_size)}, etag_of(file), finished};
}

/// Whether who asks for what was added to a file that grew has the begin of another one, to which no part of
/// this one belongs.
bool has_another(Asked& asked, const struct stat& file) {
  return asked.if_none_match.starts_with('"' + std::string(kGrowing) + '-') &&
         !version_with(asked.if_none_match, file, asked);
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

HttpReply not_opened(int error, bool of_folder) {
  if (error == ENOENT || error == ENOTDIR || (of_folder && error == ELOOP))
    return text_reply(404, "the recording is gone");
  return text_reply(503, "the recording cannot be read: " + std::generic_category().message(error));
}

/// By one after the other where a walk is needed, so that it is done once, and holds nobody else up.
HttpReply reply_to(Asked asked) {
  const int follow = asked.of_folder ? O_NOFOLLOW : 0;  // what somebody links to from there is none of ours
  const int descriptor = open(asked.recording.file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | follow);
  struct stat status {};
  if (descriptor < 0) return not_opened(errno, asked.of_folder);
  if (fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    close(descriptor);
    return text_reply(404, "the recording is gone");
  }
  // Its tag is made of its time.
  if (asked.recording.has_index && let_settle(mark_of(status))) static_cast<void>(fstat(descriptor, &status));
  const auto version = version_of(asked, status);
  const bool of_another = asked.if_range.empty() && has_another(asked, status);
  if (asked.walk.needed) {
    close(descriptor);
    asked.walk = {.allowed = true};
    HttpReply reply = reply_from_disk([asked = std::move(asked)] { return reply_to(asked); });
    reply.takes_long = true;
    return reply;
  }
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
  const bool of_this = asked.if_range.empty() ? !of_another : asked.if_range == etag;
  if (of_this) kind = parse_range(asked.range, size, range);
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
