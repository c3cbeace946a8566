// SPDX-License-Identifier: Apache-2.0
// Recorded samples back onto the network, byte for byte but for a server's qualities: through Cyclone's
// serialised-data interface instead of its C types.
#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>

#include <utility>

#include "idl/cdr.h"
#include "idl/clock.h"
#include "idl/domain.h"
#include "idl/frame_writer.h"
#include "idl/live_streams.h"
#include "idl/raw_type.h"
#include "idl/security.h"
#include "idl/topics.h"
#include "idl/transport.h"
#include "relievo.h"

namespace relievo {
namespace {

Result<RawType> raw_type_of(std::int32_t participant, Topic topic) {
  // All topic types begin with the key, and Cyclone writes null strings as empty ones.
  static char name[] = "probe";
  relievo_StreamInfo info{};
  relievo_Frame frame{};
  relievo_ServerStatus status{};
  info.stream = frame.stream = status.stream = name;
  const void* samples[] = {&info, &frame, &status};
  return RawType::find(
      participant, [&](std::int32_t group) { return create_reader(participant, group, topic); },
      [&](std::int32_t group) { return create_writer(participant, group, topic); },
      samples[static_cast<std::size_t>(topic)]);
}

Result<std::string> stream_of(const RawSample& sample) {
  switch (sample.topic) {
    case Topic::kInfo: {
      auto info = read_info_cdr(sample.cdr);
      return info ? Result<std::string>(info->stream) : info.error();
    }
    case Topic::kFrame: {
      auto frame = read_frame_cdr(sample.cdr);
      return frame ? Result<std::string>(frame->stream) : frame.error();
    }
    case Topic::kStatus: {
      auto status = read_status_cdr(sample.cdr);
      return status ? Result<std::string>(status->stream) : status.error();
    }
  }
  return Error{"a sample of no known topic"};
}

class DdsRawPublisher final : public RawPublisher {
 public:
  static Result<std::unique_ptr<RawPublisher>> open(const DomainOptions& options, const std::string& stream) {
    if (!valid_stream_name(stream)) return Error{"'" + stream + "' cannot name a stream"};
    auto domain = Domain::open(options);
    if (!domain) return domain.error();
    if (auto may = check_may_publish(**domain); !may) return may.error();
    if (auto free = check_name_is_free(**domain, stream, kDiscoveryWait); !free) return free.error();

    auto publisher = std::make_unique<DdsRawPublisher>();
    publisher->stream_ = stream;
    publisher->domain_ = std::move(domain).value();
    const std::int32_t participant = publisher->domain_->participant();
    auto group = create_group(participant, Role::kServer, true, stream);
    if (!group) return group.error();
    publisher->group_ = std::move(group).value();
    auto notice = SecuredNotice::create(*publisher->domain_, stream);
    if (!notice) return notice.error();
    publisher->notice_ = std::move(notice).value();
    publisher->clock_ = create_clock_service(*publisher->domain_, stream);
    for (const Topic topic : kTopics) {
      const auto index = static_cast<std::size_t>(topic);
      auto type = raw_type_of(participant, topic);
      if (!type) return type.error();
      publisher->types_[index] = *std::move(type);
      auto writer = create_writer(participant, publisher->group_.get(), topic);
      if (!writer) return writer.error();
      publisher->writers_[index] = std::move(writer).value();
    }
    auto watch = NameWatch::create(*publisher->domain_, stream,
                                   publisher->writers_[static_cast<std::size_t>(Topic::kInfo)].get());
    if (!watch) return watch.error();
    publisher->watch_ = *std::move(watch);
    return std::unique_ptr<RawPublisher>(std::move(publisher));
  }

  Status publish(const RawSample& sample) override {
    auto stream = stream_of(sample);
    if (!stream) return stream.error().in("cannot publish a recorded sample");
    if (*stream != stream_) {
      return Error{"cannot publish a recorded sample of stream '" + *stream + "' as '" + stream_ + "'"};
    }
    const auto index = static_cast<std::size_t>(sample.topic);
    ddsi_serdata* const data = types_[index].make(sample.cdr);
    if (data == nullptr) {
      return Error{"cannot publish a recorded sample: it is not a valid " +
                   topic_type(sample.topic).type_name};
    }
    const auto code =
        sample.topic == Topic::kStatus ? write_status(data) : dds_writecdr(writers_[index].get(), data);
    if (code < 0) return dds_error(code, "cannot publish on " + topic_type(sample.topic).topic_name);
    return {};
  }

  int matched_readers() const override {
    return matched_readers_of(writers_[static_cast<std::size_t>(Topic::kFrame)].get());
  }

 private:
  // Without the rungs that its server had then: nobody makes them now, and readers would wait for them. As
  // dds_writecdr(), takes the reference.
  dds_return_t write_status(ddsi_serdata* data) {
    relievo_ServerStatus status{};
    const bool read = ddsi_serdata_to_sample(data, &status, nullptr, nullptr);
    ddsi_serdata_unref(data);
    if (!read) return DDS_RETCODE_BAD_PARAMETER;
    status.rungs._length = status.rung_readers._length = status.rung_frames._length = 0;
    status.rung_drops._length = status.rung_encode_ms._length = status.rung_bit_rates._length = 0;
    const auto code = dds_write(writers_[static_cast<std::size_t>(Topic::kStatus)].get(), &status);
    dds_sample_free(&status, &relievo_ServerStatus_desc, DDS_FREE_CONTENTS);
    return code;
  }

  std::string stream_;
  std::shared_ptr<Domain> domain_;
  SecuredNotice notice_;
  std::unique_ptr<ClockService> clock_;  // of times that are restamped
  Entity group_;
  std::array<Entity, kTopics.size()> writers_;
  std::array<RawType, kTopics.size()> types_;
  std::unique_ptr<NameWatch> watch_;
};

}  // namespace

Result<std::unique_ptr<RawPublisher>> RawPublisher::create(const DomainOptions& domain,
                                                           const std::string& stream) {
  return DdsRawPublisher::open(domain, stream);
}

}  // namespace relievo
