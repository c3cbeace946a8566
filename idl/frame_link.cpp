// SPDX-License-Identifier: Apache-2.0
#include "idl/frame_link.h"

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>

#include <algorithm>
#include <utility>

#include "base/time.h"
#include "idl/topics.h"
#include "relievo.h"

namespace relievo {

namespace {
constexpr std::int64_t kAskAgain_ns = 3 * kNanosecondsPerSecond;
constexpr std::int64_t kMostWait_ns = 30 * kNanosecondsPerSecond;
}  // namespace

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

Result<FrameAsker> FrameAsker::open(std::int32_t participant, const std::string& stream) {
  FrameAsker asker;
  asker.stream_ = stream;
  asker.asked_ns_ = steady_now_ns();  // who joins gets the first frame unasked
  asker.wait_ns_ = kAskAgain_ns;
  auto group = create_group(participant, Role::kWatcher, true, stream, Rung::kSlow);
  if (!group) return group.error();
  asker.group_ = *std::move(group);
  auto writer = create_writer(participant, asker.group_.get(), SideTopic::kKeyFrameRequest);
  if (!writer) return writer.error();
  asker.writer_ = *std::move(writer);
  return asker;
}

void FrameAsker::got(std::int64_t now_ns) {
  wait_ns_ = std::clamp(3 * (now_ns - asked_ns_), kAskAgain_ns, kMostWait_ns);
  ask(now_ns);
}

void FrameAsker::tick(std::int64_t now_ns) {
  if (now_ns - asked_ns_ < wait_ns_) return;
  wait_ns_ = std::min(2 * wait_ns_, kMostWait_ns);
  ask(now_ns);
}

void FrameAsker::ask(std::int64_t now_ns) {
  asked_ns_ = now_ns;
  relievo_KeyFrameRequest request{};
  request.stream = stream_.data();  // only read
  dds_write(writer_.get(), &request);
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
  if (rung == Rung::kSlow) {
    auto asker = FrameAsker::open(participant, stream);
    if (!asker) return asker.error();
    link.asker = *std::move(asker);
  }
  return link;
}

}  // namespace relievo
