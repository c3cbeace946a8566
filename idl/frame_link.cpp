// SPDX-License-Identifier: Apache-2.0
#include "idl/frame_link.h"

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>

#include <utility>

#include "idl/topics.h"

namespace relievo {

LentBytes::LentBytes(ddsi_serdata* sample) {
  ddsrt_iovec_t bytes{};
  reference_ = ddsi_serdata_to_ser_ref(sample, 0, ddsi_serdata_size(sample), &bytes);
  bytes_ = {static_cast<const std::uint8_t*>(bytes.iov_base), bytes.iov_len};
}

LentBytes::~LentBytes() {
  ddsrt_iovec_t bytes{};
  bytes.iov_base = const_cast<std::uint8_t*>(bytes_.data());  // as it was given
  bytes.iov_len = bytes_.size();
  ddsi_serdata_to_ser_unref(reference_, &bytes);
}

Result<FrameLink> FrameLink::open(std::int32_t participant, const std::string& stream, Rung rung) {
  FrameLink link;
  link.rung = rung;
  auto group = create_group(participant, Role::kWatcher, false, stream, rung);
  if (!group) return group.error();
  link.group = *std::move(group);
  auto reader = create_reader(participant, link.group.get(), Topic::kFrame);
  if (!reader) return reader.error();
  link.reader = *std::move(reader);
  auto condition = take_entity(dds_create_readcondition(link.reader.get(), DDS_ANY_STATE), "condition");
  if (!condition) return condition.error();
  link.condition = *std::move(condition);
  return link;
}

}  // namespace relievo
