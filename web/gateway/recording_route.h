// SPDX-License-Identifier: Apache-2.0
// Recordings as files that clients read in parts.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "web/gateway/routes.h"

namespace relievo {

/// A part of an open file.
class FilePart {
 public:
  /// Takes over the descriptor.
  FilePart(int descriptor, std::uint64_t at, std::uint64_t length)
      : descriptor_(descriptor), at_(at), length_(length) {}
  FilePart(const FilePart&) = delete;
  FilePart& operator=(const FilePart&) = delete;
  ~FilePart();

  std::uint64_t length() const { return length_; }
  /// Bytes from `offset` of the part on, as many as `into` takes; none at its end, or where the file has
  /// become shorter. May wait for the disk.
  std::size_t read(std::uint64_t offset, std::span<std::uint8_t> into) const;

 private:
  const int descriptor_;
  const std::uint64_t at_, length_;
};

/// GET /recordings/NAME: "STREAM.mcap" of a stream whose recording is offered, or a finished file of the
/// folder that streams are recorded to; any other is not found, so no name leads to another file.
HttpReply recording_reply(std::string_view name, const HttpRequest& request, const RouteContext& context);

}  // namespace relievo
