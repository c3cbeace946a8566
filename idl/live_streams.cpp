// SPDX-License-Identifier: Apache-2.0
#include "idl/live_streams.h"

#include <dds/dds.h>

#include <algorithm>
#include <mutex>
#include <set>
#include <utility>

#include "base/log.h"
#include "base/time.h"
#include "idl/topics.h"
#include "relievo.h"

namespace relievo {
namespace {

constexpr std::size_t kMostTold = 20;  // others of one name: none fills the log

/// The writer of the next description of that name that is live; 0: no other has come.
Result<dds_instance_handle_t> take_live_writer(std::int32_t reader, const std::string& stream) {
  void* sample = nullptr;  // lent by Cyclone
  dds_sample_info_t info;
  for (;;) {
    const auto count = dds_take(reader, &sample, &info, 1, 1);
    if (count < 0) return dds_error(count, "cannot look for the stream's name");
    if (count == 0) return dds_instance_handle_t{0};
    const auto* description = static_cast<const relievo_StreamInfo*>(sample);
    const bool live =
        info.valid_data && info.instance_state == DDS_IST_ALIVE && description->stream == stream;
    dds_return_loan(reader, &sample, 1);
    if (live) return info.publication_handle;
  }
}

class DescriptionWatch final : public NameWatch {
 public:
  static Result<std::unique_ptr<NameWatch>> open(const Domain& domain, const std::string& stream,
                                                 std::int32_t own) {
    auto watch = std::make_unique<DescriptionWatch>();
    watch->stream_ = stream;
    if (const auto code = dds_get_instance_handle(own, &watch->own_); code < 0)
      return dds_error(code, "cannot watch over the stream's name");
    auto group = create_group(domain.participant(), Role::kWatcher, false, stream);
    if (!group) return group.error();
    watch->group_ = *std::move(group);
    auto reader = create_reader(domain.participant(), watch->group_.get(), Topic::kInfo);
    if (!reader) return reader.error();
    watch->reader_ = *std::move(reader);
    const Listener listener(dds_create_listener(watch.get()));
    dds_lset_data_available(
        listener.get(), [](const dds_entity_t, void* self) { static_cast<DescriptionWatch*>(self)->look(); });
    dds_set_listener(watch->reader_.get(), listener.get());
    watch->look();  // what came before there was a listener
    return std::unique_ptr<NameWatch>(std::move(watch));
  }
  // Waits for a call in progress.
  ~DescriptionWatch() override { dds_set_listener(reader_.get(), nullptr); }

 private:
  /// Any thread.
  void look() {
    const std::lock_guard lock(mutex_);
    for (;;) {
      const auto writer = take_live_writer(reader_.get(), stream_);
      if (!writer || *writer == 0) return;
      if (*writer != own_ && told_.size() < kMostTold && told_.insert(*writer).second)
        log_warning("another server in this domain has a stream named '" + stream_ +
                    "', too: who watches or records it gets both mixed. Give one of them another name");
    }
  }

  std::string stream_;
  dds_instance_handle_t own_ = 0;
  std::mutex mutex_;
  std::set<dds_instance_handle_t> told_;
  Entity group_;
  Entity reader_;
};

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
    const auto live = take_live_writer(reader->get(), stream);
    if (!live) return live.error();
    if (*live != 0) {
      return Error{"a stream named '" + stream +
                   "' is already live in this domain: give another --domain, or " +
                   "a server another --stream"};
    }
  }
  return {};
}

Result<std::unique_ptr<NameWatch>> NameWatch::create(const Domain& domain, const std::string& stream,
                                                     std::int32_t own) {
  return DescriptionWatch::open(domain, stream, own);
}

}  // namespace relievo
