// SPDX-License-Identifier: Apache-2.0
#include "idl/live_streams.h"

#include <dds/dds.h>

#include <algorithm>

#include "base/time.h"
#include "idl/topics.h"
#include "relievo.h"

namespace relievo {
namespace {

Result<bool> take_live_info(std::int32_t reader, const std::string& stream) {
  void* sample = nullptr;  // lent by Cyclone
  dds_sample_info_t info;
  for (;;) {
    const auto count = dds_take(reader, &sample, &info, 1, 1);
    if (count < 0) return dds_error(count, "cannot look for the stream's name");
    if (count == 0) return false;
    const auto* description = static_cast<const relievo_StreamInfo*>(sample);
    const bool live =
        info.valid_data && info.instance_state == DDS_IST_ALIVE && description->stream == stream;
    dds_return_loan(reader, &sample, 1);
    if (live) return true;
  }
}

}  // namespace

Status check_name_is_free(const Domain& domain, const std::string& stream, std::chrono::milliseconds wait) {
  auto group = create_group(domain.participant(), Role::kWatcher, false, stream);
  if (!group) return group.error();
  auto reader = create_reader(domain.participant(), group->get(), Topic::kInfo);
  if (!reader) return reader.error();
  auto condition = take_entity(dds_create_readcondition(reader->get(), DDS_ANY_STATE), "condition");
  if (!condition) return condition.error();
  auto waitset = take_entity(dds_create_waitset(domain.participant()), "waitset");
  if (!waitset) return waitset.error();
  dds_waitset_attach(waitset->get(), condition->get(), 0);

  const std::int64_t end_ns =
      steady_now_ns() + std::chrono::duration_cast<std::chrono::nanoseconds>(wait).count();
  for (bool last = false; !last;) {  // once at least, however long it took to come here
    const std::int64_t left_ns = end_ns - steady_now_ns();
    last = left_ns <= 0;
    dds_attach_t triggered = 0;
    dds_waitset_wait(waitset->get(), &triggered, 1, std::max<std::int64_t>(0, left_ns));
    auto live = take_live_info(reader->get(), stream);
    if (!live) return live.error();
    if (*live) {
      return Error{"a stream named '" + stream + "' is already live in this domain: choose another name"};
    }
  }
  return {};
}

}  // namespace relievo
