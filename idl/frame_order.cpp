// SPDX-License-Identifier: Apache-2.0
#include "idl/frame_order.h"

#include <dds/dds.h>

#include <algorithm>
#include <iterator>
#include <utility>

namespace relievo {
namespace {

constexpr int kOfParticipant = 12;  // bytes that all of a participant's guids begin with

bool same_server(const auto& a, const auto& b) {
  return std::equal(a.begin(), a.begin() + kOfParticipant, b.begin());
}

}  // namespace

std::uint64_t FrameOrder::add(std::int32_t reader, std::uint64_t writer, std::uint64_t sequence) {
  const bool follows = is_of_same(reader, writer) && sequence > last_sequence_;
  const std::uint64_t last = std::exchange(last_sequence_, sequence);
  return follows ? sequence - last - 1 : 0;
}

/// Whether a frame's writer is that of the frame before, and remembers it.
bool FrameOrder::is_of_same(std::int32_t reader, std::uint64_t handle) {
  if (handle_ == handle) return true;
  const bool first = handle_ == 0;
  handle_ = handle;
  const Guid before = std::exchange(writer_, {});
  auto* const endpoint = dds_get_matched_publication_data(reader, handle);
  if (endpoint == nullptr) return false;  // it has left already
  std::copy(std::begin(endpoint->key.v), std::end(endpoint->key.v), writer_.begin());
  dds_builtintopic_free_endpoint(endpoint);
  if (first) return false;
  if (before != Guid{} && !same_server(before, writer_)) {
    mixed_ = mixed_ || same_server(other_, writer_);
    other_ = before;
  }
  return before == writer_;
}

}  // namespace relievo
