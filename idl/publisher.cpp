// SPDX-License-Identifier: Apache-2.0
#include <dds/dds.h>
#include <dds/ddsc/dds_statistics.h>

#include <algorithm>
#include <array>
#include <functional>
#include <memory>
#include <utility>

#include "idl/clock.h"
#include "idl/domain.h"
#include "idl/frame_writer.h"
#include "idl/live_streams.h"
#include "idl/security.h"
#include "idl/topics.h"
#include "idl/transport.h"
#include "relievo.h"

namespace relievo {
namespace {

// dds_write reads these and keeps nothing, so samples borrow our memory; the generated C types are not const.
char* borrow(const std::string& text) {
  return const_cast<char*>(text.c_str());
}
dds_sequence_octet borrow(const Bytes& bytes) {
  const auto size = static_cast<std::uint32_t>(bytes.size());
  return {size, size, const_cast<std::uint8_t*>(bytes.data()), false};
}

relievo_PinholeModel to_dds(const PinholeModel& model) {
  relievo_PinholeModel out{};
  out.width = static_cast<std::uint32_t>(model.width);
  out.height = static_cast<std::uint32_t>(model.height);
  std::copy(model.matrix.begin(), model.matrix.end(), out.matrix);
  std::copy(model.distortion.begin(), model.distortion.end(), out.distortion);
  return out;
}

relievo_Rig to_dds(const Rig& rig) {
  relievo_Rig out{};
  out.scan = rig.scan == Scan::kInterlaced ? relievo_SCAN_INTERLACED : relievo_SCAN_PROGRESSIVE;
  out.frame_rate = rig.frame_rate;
  out.camera = to_dds(rig.camera);
  out.projector = to_dds(rig.projector);
  std::copy(rig.projector_from_camera_rotation.begin(), rig.projector_from_camera_rotation.end(),
            out.projector_from_camera_rotation);
  std::copy(rig.projector_from_camera_translation.begin(), rig.projector_from_camera_translation.end(),
            out.projector_from_camera_translation);
  std::copy(rig.colour_matrix.begin(), rig.colour_matrix.end(), out.colour_matrix);
  out.field_order =
      rig.field_order == FieldOrder::kTop ? relievo_FIELD_ORDER_TOP : relievo_FIELD_ORDER_BOTTOM;
  out.stereo_rms_px = rig.stereo_rms_px;
  out.scale_error = rig.scale_error;
  if (rig.world_from_camera) {
    const auto& [rotation, translation] = *rig.world_from_camera;
    std::copy(rotation.begin(), rotation.end(), out.world_from_camera_rotation);
    std::copy(translation.begin(), translation.end(), out.world_from_camera_translation);
  }
  out.camera_gamma = rig.camera_gamma;
  return out;
}

relievo_Scheme to_dds(Scheme scheme) {
  switch (scheme) {
    case Scheme::kComplementary:
      return relievo_SCHEME_COMPLEMENTARY;
    case Scheme::kWhiteField:
      return relievo_SCHEME_WHITE_FIELD;
    case Scheme::kWhiteFrame:
      return relievo_SCHEME_WHITE_FRAME;
    case Scheme::kOneSlide:
      return relievo_SCHEME_ONE_SLIDE;
  }
  return relievo_SCHEME_COMPLEMENTARY;
}

relievo_StreamState to_dds(StreamState state) {
  switch (state) {
    case StreamState::kStarting:
      return relievo_STATE_STARTING;
    case StreamState::kRunning:
      return relievo_STATE_RUNNING;
    case StreamState::kStalled:
      return relievo_STATE_STALLED;
    case StreamState::kEnded:
      return relievo_STATE_ENDED;
  }
  return relievo_STATE_ENDED;
}

Status written(dds_return_t code, Topic topic) {
  if (code < 0) return dds_error(code, "cannot publish on " + topic_type(topic).topic_name);
  return {};
}

class DdsPublisher final : public Publisher {
 public:
  static Result<std::unique_ptr<Publisher>> open(const DomainOptions& options, const StreamInfo& info,
                                                 std::function<void()> key_frame_wanted, Clock clock) {
    if (!valid_stream_name(info.stream)) {
      return Error{"'" + info.stream +
                   "' cannot name a stream: use up to 64 letters, digits, '_', '-' and '.', no dot first"};
    }
    auto domain = Domain::open(options);
    if (!domain) return domain.error();
    if (auto may = check_may_publish(**domain); !may) return may.error();
    if (auto free = check_name_is_free(**domain, info.stream, kDiscoveryWait); !free) return free.error();

    auto publisher = std::make_unique<DdsPublisher>();
    publisher->stream_ = info.stream;
    publisher->domain_ = std::move(domain).value();
    const std::int32_t participant = publisher->domain_->participant();
    auto group = create_group(participant, Role::kServer, true, info.stream);
    if (!group) return group.error();
    publisher->group_ = std::move(group).value();
    for (const Topic topic : kTopics) {
      auto writer = create_writer(participant, publisher->group_.get(), topic);
      if (!writer) return writer.error();
      publisher->writers_[static_cast<std::size_t>(topic)] = std::move(writer).value();
      auto cdr1 = create_cdr1_writer(participant, publisher->group_.get(), topic);
      if (!cdr1) return cdr1.error();
      publisher->cdr1_writers_[static_cast<std::size_t>(topic)] = std::move(cdr1).value();
    }
    if (auto status = publisher->publish(info); !status) return status.error();
    auto watch = NameWatch::create(*publisher->domain_, info.stream, publisher->writer(Topic::kInfo));
    if (!watch) return watch.error();
    publisher->watch_ = *std::move(watch);
    auto notice = SecuredNotice::create(*publisher->domain_, info.stream);
    if (!notice) return notice.error();
    publisher->notice_ = std::move(notice).value();
    publisher->clock_ = create_clock_service(*publisher->domain_, info.stream, std::move(clock));
    if (key_frame_wanted) {
      if (auto status = publisher->listen(std::move(key_frame_wanted)); !status) return status.error();
    }
    return std::unique_ptr<Publisher>(std::move(publisher));
  }

  Status publish(const FrameMessage& frame) override {
    if (const std::int32_t cdr1 = cdr1_writer(Topic::kFrame); matched_readers_of(cdr1) > 0) {
      if (auto status = write_frame(cdr1, stream_, frame); !status) return status;
    }
    return write_frame(writer(Topic::kFrame), stream_, frame);
  }

  Status publish(const ServerStatus& status) override {
    relievo_ServerStatus sample{};
    sample.stream = borrow(stream_);
    sample.time_ns = status.time_ns;
    sample.state = to_dds(status.state);
    sample.message = borrow(status.message);
    sample.frame_rate = status.frame_rate;
    sample.frames_captured = status.frames_captured;
    sample.frames_published = status.frames_published;
    sample.drops_capture = status.drops_capture;
    sample.drops_reconstruct = status.drops_reconstruct;
    sample.drops_encode = status.drops_encode;
    sample.drops_publish = status.drops_publish;
    sample.reconstruct_ms = status.reconstruct_ms;
    sample.encode_ms = status.encode_ms;
    sample.latency_ms = status.latency_ms;
    sample.bit_rate = status.bit_rate;
    sample.rate_level = status.rate_level;
    std::array<std::uint64_t, kFilters.size()> filters{};
    for (std::size_t i = 0; i < kFilters.size(); ++i) filters[i] = status.filters.*kFilters[i].count;
    sample.filters._length = sample.filters._maximum = static_cast<std::uint32_t>(filters.size());
    sample.filters._buffer = filters.data();
    sample.mixed = status.step.mixed;
    sample.regrouped = status.step.regrouped;
    const auto none_or_one = [](auto& sequence, const std::optional<double>& value, double& memory) {
      memory = value.value_or(0);
      sequence._length = sequence._maximum = value ? 1 : 0;
      sequence._buffer = &memory;
    };
    double phase = 0;
    double drift = 0;
    none_or_one(sample.phase, status.step.phase, phase);
    none_or_one(sample.drift, status.step.drift_fields_s, drift);
    std::vector<std::uint8_t> rungs;
    std::vector<std::uint32_t> readers;
    std::vector<std::uint64_t> frames, drops;
    std::vector<double> encode_ms, bit_rates;
    for (const RungStatus& rung : status.rungs) {
      rungs.push_back(static_cast<std::uint8_t>(rung.rung));
      readers.push_back(rung.readers);
      frames.push_back(rung.frames);
      drops.push_back(rung.drops);
      encode_ms.push_back(rung.encode_ms);
      bit_rates.push_back(rung.bit_rate);
    }
    const auto lend = [](auto& sequence, auto& values) {
      sequence._length = sequence._maximum = static_cast<std::uint32_t>(values.size());
      sequence._buffer = values.data();
    };
    lend(sample.rungs, rungs);
    lend(sample.rung_readers, readers);
    lend(sample.rung_frames, frames);
    lend(sample.rung_drops, drops);
    lend(sample.rung_encode_ms, encode_ms);
    lend(sample.rung_bit_rates, bit_rates);
    return write(Topic::kStatus, &sample);
  }

  int matched_readers() const override {
    return matched_readers_of(writer(Topic::kFrame)) + matched_readers_of(cdr1_writer(Topic::kFrame));
  }

  std::uint64_t sent_again_bytes() const override {
    dds_statistics* const statistics = dds_create_statistics(writer(Topic::kFrame));
    if (statistics == nullptr) return 0;
    const dds_stat_keyvalue* const found = dds_lookup_statistic(statistics, "rexmit_bytes");
    const std::uint64_t bytes = found == nullptr ? 0 : found->u.u64;
    dds_delete_statistics(statistics);
    return bytes;
  }

  ClientReports client_reports() const override {
    return clock_ ? clock_->client_reports() : ClientReports{};
  }

  ~DdsPublisher() override {
    // Waits for a call in progress; `wanted_` outlives it.
    dds_set_listener(requests_.get(), nullptr);
    dds_set_listener(writer(Topic::kFrame), nullptr);
    dds_set_listener(cdr1_writer(Topic::kFrame), nullptr);
  }

 private:
  Status listen(std::function<void()> key_frame_wanted) {
    wanted_ = std::move(key_frame_wanted);
    const std::int32_t participant = domain_->participant();
    auto group = create_group(participant, Role::kServer, false, stream_);
    if (!group) return group.error();
    request_group_ = std::move(group).value();
    auto reader = create_reader(participant, request_group_.get(), SideTopic::kKeyFrameRequest);
    if (!reader) return reader.error();
    requests_ = std::move(reader).value();
    const Listener listener(dds_create_listener(this));
    dds_lset_publication_matched(listener.get(),
                                 [](auto, const dds_publication_matched_status_t status, void* self) {
                                   if (status.current_count_change > 0)
                                     static_cast<DdsPublisher*>(self)->wanted_();
                                 });
    dds_lset_data_available(listener.get(), [](const dds_entity_t, void* self) {
      static_cast<DdsPublisher*>(self)->take_requests();
    });
    dds_set_listener(requests_.get(), listener.get());
    dds_set_listener(writer(Topic::kFrame), listener.get());
    dds_set_listener(cdr1_writer(Topic::kFrame), listener.get());
    return {};
  }

  void take_requests() const {
    take_all(requests_.get(), [this](const void* sample) {
      if (static_cast<const relievo_KeyFrameRequest*>(sample)->stream == stream_) wanted_();
    });
  }

  Status publish(const StreamInfo& info) {
    std::vector<std::uint32_t> stripes(info.pattern.sequence.begin(), info.pattern.sequence.end());
    relievo_StreamInfo sample{};
    sample.stream = borrow(stream_);
    sample.source = borrow(info.source);
    sample.started_ns = info.started_ns;
    sample.rig = to_dds(info.rig);
    sample.pattern.colours = static_cast<std::uint32_t>(info.pattern.base);
    sample.pattern.slides = static_cast<std::uint32_t>(info.pattern.slides);
    sample.pattern.palette = borrow(info.pattern.palette);
    sample.pattern.stripes._maximum = sample.pattern.stripes._length =
        static_cast<std::uint32_t>(stripes.size());
    sample.pattern.stripes._buffer = stripes.data();
    sample.pattern.scheme = to_dds(info.pattern.scheme);
    return write(Topic::kInfo, &sample);
  }

  Status write(Topic topic, const void* sample) {
    if (auto status = written(dds_write(cdr1_writer(topic), sample), topic); !status) return status;
    return written(dds_write(writer(topic), sample), topic);
  }

  std::int32_t writer(Topic topic) const { return writers_[static_cast<std::size_t>(topic)].get(); }
  std::int32_t cdr1_writer(Topic topic) const { return cdr1_writers_[static_cast<std::size_t>(topic)].get(); }

  std::string stream_;
  std::shared_ptr<Domain> domain_;
  Entity group_;
  std::array<Entity, kTopics.size()> writers_, cdr1_writers_;
  std::unique_ptr<NameWatch> watch_;
  SecuredNotice notice_;
  std::unique_ptr<ClockService> clock_;
  Entity request_group_;
  Entity requests_;
  std::function<void()> wanted_;
};

}  // namespace

Result<std::unique_ptr<Publisher>> Publisher::create(const DomainOptions& domain, const StreamInfo& info,
                                                     std::function<void()> key_frame_wanted,
                                                     std::function<std::int64_t()> clock) {
  return DdsPublisher::open(domain, info, std::move(key_frame_wanted), std::move(clock));
}

}  // namespace relievo
