// SPDX-License-Identifier: Apache-2.0
#include <dds/dds.h>

#include <mutex>
#include <utility>

#include "base/time.h"
#include "idl/asked_frames.h"
#include "idl/domain.h"
#include "idl/frame_writer.h"
#include "idl/security.h"
#include "idl/topics.h"
#include "idl/transport.h"
#include "relievo.h"

namespace relievo {
namespace {

class DdsRungPublisher final : public RungPublisher {
 public:
  static Result<std::unique_ptr<RungPublisher>> open(const DomainOptions& options, const std::string& stream,
                                                     Rung rung, std::function<void()> key_frame_wanted) {
    auto domain = Domain::open(options);
    if (!domain) return domain.error();
    auto self = std::make_unique<DdsRungPublisher>();
    self->stream_ = stream;
    self->rung_ = rung;
    self->wanted_ = std::move(key_frame_wanted);
    self->domain_ = *std::move(domain);
    const std::int32_t participant = self->domain_->participant();
    auto group = create_group(participant, Role::kServer, true, stream, rung);
    if (!group) return group.error();
    self->group_ = *std::move(group);
    // Of the slow rung a frame that did not arrive is of no use once there is another.
    auto writer = create_writer(participant, self->group_.get(), Topic::kFrame,
                                rung == Rung::kSlow ? std::optional(1) : std::nullopt);
    if (!writer) return writer.error();
    self->writer_ = *std::move(writer);
    if (const Status heard = self->listen(participant); !heard) return heard.error();
    return std::unique_ptr<RungPublisher>(std::move(self));
  }

  ~DdsRungPublisher() override {  // waits for calls in progress
    if (requests_.get() != 0) dds_set_listener(requests_.get(), nullptr);
    dds_set_listener(writer_.get(), nullptr);
  }

  Status publish(const FrameMessage& frame) override {
    {
      const std::lock_guard lock(mutex_);
      asked_.sent();
    }
    return write_frame(writer_.get(), stream_, frame);
  }
  int matched_readers() const override { return matched_readers_of(writer_.get()); }
  bool due() override {
    const std::lock_guard lock(mutex_);
    return rung_ != Rung::kSlow || asked_.due(steady_now_ns());
  }

 private:
  Status listen(std::int32_t participant) {
    const Listener joins(dds_create_listener(this));
    dds_lset_publication_matched(joins.get(),
                                 [](auto, const dds_publication_matched_status_t status, void* self) {
                                   if (status.current_count_change > 0)
                                     static_cast<DdsRungPublisher*>(self)->welcome();
                                 });
    dds_set_listener(writer_.get(), joins.get());
    if (rung_ != Rung::kSlow) return {};
    auto group = create_group(participant, Role::kServer, false, stream_, rung_);
    if (!group) return group.error();
    request_group_ = *std::move(group);
    auto reader = create_reader(participant, request_group_.get(), SideTopic::kKeyFrameRequest);
    if (!reader) return reader.error();
    requests_ = *std::move(reader);
    const Listener wishes(dds_create_listener(this));
    dds_lset_data_available(wishes.get(), [](const dds_entity_t, void* self) {
      static_cast<DdsRungPublisher*>(self)->take_requests();
    });
    dds_set_listener(requests_.get(), wishes.get());
    return {};
  }

  void welcome() {
    {
      const std::lock_guard lock(mutex_);
      asked_.joined();
    }
    wanted_();
  }

  void take_requests() {
    void* sample = nullptr;  // lent by Cyclone
    dds_sample_info_t info;
    while (dds_take(requests_.get(), &sample, &info, 1, 1) == 1) {
      if (info.valid_data && static_cast<const relievo_KeyFrameRequest*>(sample)->stream == stream_) {
        const std::lock_guard lock(mutex_);
        asked_.ask(info.publication_handle, steady_now_ns());
      }
      dds_return_loan(requests_.get(), &sample, 1);
    }
  }

  std::string stream_;
  Rung rung_ = Rung::kReduced;
  std::mutex mutex_;
  AskedFrames asked_;  // under the mutex; of kSlow alone
  std::function<void()> wanted_;
  std::shared_ptr<Domain> domain_;
  Entity group_;
  Entity writer_;
  Entity request_group_, requests_;
};

}  // namespace

Result<std::unique_ptr<RungPublisher>> RungPublisher::create(const DomainOptions& domain,
                                                             const std::string& stream, Rung rung,
                                                             std::function<void()> key_frame_wanted) {
  return DdsRungPublisher::open(domain, stream, rung, std::move(key_frame_wanted));
}

}  // namespace relievo
