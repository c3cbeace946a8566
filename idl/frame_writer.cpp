// SPDX-License-Identifier: Apache-2.0
#include "idl/frame_writer.h"

#include <dds/dds.h>

#include <limits>

#include "idl/entity.h"
#include "idl/transport.h"
#include "relievo.h"

namespace relievo {

Status write_frame(std::int32_t writer, const std::string& stream, const FrameMessage& frame) {
  if (frame.data->size() > std::numeric_limits<std::uint32_t>::max() / 2)
    return Error{"a frame of " + std::to_string(frame.data->size()) + " bytes is too large to publish"};
  // dds_write only reads, so the sample borrows our memory; the generated C types are not const.
  const auto size = static_cast<std::uint32_t>(frame.data->size());
  relievo_Frame sample{};
  sample.stream = const_cast<char*>(stream.c_str());
  sample.sequence_number = frame.sequence;
  sample.frame_number = frame.number;
  sample.capture_time_ns = frame.capture_time_ns;
  sample.publish_time_ns = frame.publish_time_ns;
  sample.data = {size, size, const_cast<std::uint8_t*>(frame.data->data()), false};
  if (const auto code = dds_write(writer, &sample); code < 0)
    return dds_error(code, "cannot publish on " + topic_type(Topic::kFrame).topic_name);
  return {};
}

int matched_readers_of(std::int32_t writer) {
  dds_publication_matched_status_t status{};
  dds_get_publication_matched_status(writer, &status);
  return static_cast<int>(status.current_count);
}

}  // namespace relievo
