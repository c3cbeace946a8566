// SPDX-License-Identifier: Apache-2.0
// Samples from the network, of each type.
#include "idl/cdr.h"

#include "fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace relievo;
  const std::span<const std::uint8_t> cdr(data, size);
  static_cast<void>(holds_key_frame(cdr));
  if (const auto frame = read_frame_cdr(cdr)) {
    FUZZ_CHECK(valid_stream_name(frame->stream));
    FUZZ_CHECK(frame->data.empty() || (frame->data.data() >= data && frame->data.size() <= size));
    const Bytes again = write_frame_cdr(*frame);
    const auto same = read_frame_cdr(again);
    FUZZ_CHECK(same.ok() && same->sequence == frame->sequence && same->data.size() == frame->data.size());
  }
  if (const auto info = read_info_cdr(cdr)) {
    FUZZ_CHECK(valid_stream_name(info->stream));
    FUZZ_CHECK(info->rig.camera.width > 0 && info->rig.camera.height > 0);
    static_cast<void>(to_yaml(info->rig));
    static_cast<void>(to_yaml(info->pattern));
  }
  if (const auto status = read_status_cdr(cdr)) FUZZ_CHECK(to_string(status->state) != "unknown");
  return 0;
}
