// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/recording_route.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>

#include "web/gateway/byte_range.h"
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

}  // namespace

FilePart::~FilePart() {
  close(descriptor_);
}

std::size_t FilePart::read(std::uint64_t offset, std::span<std::uint8_t> into) const {
  const std::size_t wanted = static_cast<std::size_t>(std::min<std::uint64_t>(into.size(), length_ - offset));
  ssize_t n = 0;
  do n = pread(descriptor_, into.data(), wanted, static_cast<off_t>(at_ + offset));
  while (n < 0 && errno == EINTR);
  return n > 0 ? static_cast<std::size_t>(n) : 0;
}

HttpReply recording_reply(std::string_view name, const HttpRequest& request, const RouteContext& context) {
  if (!name.ends_with(kSuffix)) return text_reply(404, "no recording has such a name");
  auto file = context.hub.recording_of(std::string(name.substr(0, name.size() - kSuffix.size())));
  int follow = 0;
  if (!file && context.recordings != nullptr) {
    file = finished_recording(std::string(name), *context.recordings);
    follow = O_NOFOLLOW;  // what somebody links to from there is none of ours
  }
  if (!file) return text_reply(404, "there is no such recording");
  const int descriptor = open(file->c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | follow);
  struct stat status {};
  if (descriptor < 0 || fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    if (descriptor >= 0) close(descriptor);
    return text_reply(404, "the recording is gone");
  }
  const auto size = static_cast<std::uint64_t>(status.st_size);
  const std::string etag = etag_of(status);
  HttpReply reply;
  reply.content_type = "application/octet-stream";
  // A cache may keep it, and asks here whether it still is the same.
  reply.headers = {{"Accept-Ranges", "bytes"}, {"Cache-Control", "no-cache"}, {"ETag", etag}};
  ByteRange range{0, size};
  RangeKind kind = RangeKind::kWhole;
  if (request.if_range.empty() || request.if_range == etag) kind = parse_range(request.range, size, range);
  const std::string of = "/" + std::to_string(size);
  if (request.if_none_match == etag || kind == RangeKind::kUnsatisfiable) {
    close(descriptor);
    reply.status = kind == RangeKind::kUnsatisfiable ? 416 : 304;
    if (reply.status == 416) reply.headers.emplace_back("Content-Range", "bytes *" + of);
    return reply;
  }
  if (kind == RangeKind::kPart) {
    reply.status = 206;
    reply.headers.emplace_back("Content-Range", "bytes " + std::to_string(range.at) + "-" +
                                                    std::to_string(range.at + range.length - 1) + of);
  }
  reply.file = std::make_shared<const FilePart>(descriptor, range.at, range.length);
  return reply;
}

}  // namespace relievo
