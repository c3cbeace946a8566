// SPDX-License-Identifier: Apache-2.0
// Recordings as files that clients read in parts.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <utility>

#include "base/stream.h"
#include "web/gateway/byte_range.h"
#include "web/gateway/routes.h"

namespace relievo {

/// A part of an open file, or of its first bytes and others in place of the rest.
class FilePart {
 public:
  struct Whole {
    std::uint64_t file_bytes = 0;
    std::shared_ptr<const Bytes> end{};  // behind them; null: nothing
    std::uint64_t size() const { return file_bytes + (end ? end->size() : 0); }
  };
  /// Takes over the descriptor. The part lies within the whole.
  FilePart(int descriptor, Whole whole, const ByteRange& part)
      : descriptor_(descriptor), whole_(std::move(whole)), part_(part) {}
  FilePart(const FilePart&) = delete;
  FilePart& operator=(const FilePart&) = delete;
  ~FilePart();

  std::uint64_t length() const { return part_.length; }
  /// Bytes from `offset` of the part on, as many as `into` takes; none at its end, or where the file has
  /// become shorter. May wait for the disk.
  std::size_t read(std::uint64_t offset, std::span<std::uint8_t> into) const;

 private:
  const int descriptor_;
  const Whole whole_;
  const ByteRange part_;
};

/// GET /recordings/NAME: "STREAM.mcap" of a stream whose recording is offered, or a file of the folder that
/// streams are recorded to; any other is not found, so no name leads to another file. One that is being
/// written is what is whole of it, with an index; who began to read it so goes on with it so, by If-Range,
/// however much longer it is meanwhile.
HttpReply recording_reply(std::string_view name, const HttpRequest& request, const RouteContext& context);

}  // namespace relievo
