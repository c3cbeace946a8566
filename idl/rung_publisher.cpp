// SPDX-License-Identifier: Apache-2.0
#include <dds/dds.h>

#include <utility>

#include "idl/domain.h"
#include "idl/frame_writer.h"
#include "idl/security.h"
#include "idl/topics.h"
#include "idl/transport.h"

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
    self->wanted_ = std::move(key_frame_wanted);
    self->domain_ = *std::move(domain);
    const std::int32_t participant = self->domain_->participant();
    auto group = create_group(participant, Role::kServer, true, stream, rung);
    if (!group) return group.error();
    self->group_ = *std::move(group);
    auto writer = create_writer(participant, self->group_.get(), Topic::kFrame);
    if (!writer) return writer.error();
    self->writer_ = *std::move(writer);
    const Listener listener(dds_create_listener(self.get()));
    dds_lset_publication_matched(listener.get(),
                                 [](auto, const dds_publication_matched_status_t status, void* publisher) {
                                   if (status.current_count_change > 0)
                                     static_cast<DdsRungPublisher*>(publisher)->wanted_();
                                 });
    dds_set_listener(self->writer_.get(), listener.get());
    return std::unique_ptr<RungPublisher>(std::move(self));
  }

  ~DdsRungPublisher() override { dds_set_listener(writer_.get(), nullptr); }  // waits for a call in progress

  Status publish(const FrameMessage& frame) override { return write_frame(writer_.get(), stream_, frame); }
  int matched_readers() const override { return matched_readers_of(writer_.get()); }

 private:
  std::string stream_;
  std::function<void()> wanted_;
  std::shared_ptr<Domain> domain_;
  Entity group_;
  Entity writer_;
};

}  // namespace

Result<std::unique_ptr<RungPublisher>> RungPublisher::create(const DomainOptions& domain,
                                                             const std::string& stream, Rung rung,
                                                             std::function<void()> key_frame_wanted) {
  return DdsRungPublisher::open(domain, stream, rung, std::move(key_frame_wanted));
}

}  // namespace relievo
