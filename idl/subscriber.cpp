// SPDX-License-Identifier: Apache-2.0
#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <map>
#include <set>
#include <thread>
#include <utility>

#include "base/log.h"
#include "base/thread_name.h"
#include "base/time.h"
#include "codec/frame3d_codec.h"
#include "idl/cdr.h"
#include "idl/domain.h"
#include "idl/frame_link.h"
#include "idl/frame_order.h"
#include "idl/security.h"
#include "idl/topics.h"
#include "idl/transport.h"
#include "relievo.h"

namespace relievo {
namespace {

constexpr int kMostAtOnce = 64;
constexpr std::int64_t kDoubt_ns = 20'000'000;                  // between looks at a stream that may be gone
constexpr std::int64_t kMakeTime_ns = kNanosecondsPerSecond;    // for the first key frame of a lower rung
constexpr std::int64_t kStatusTime_ns = kNanosecondsPerSecond;  // for the status of a stream that has one
constexpr std::int64_t kDescriptionTime_ns = 3 * kNanosecondsPerSecond;  // for one that frames overtook
constexpr std::size_t kMaxEarly_bytes = 64 << 20;                        // of frames that wait for theirs
constexpr int kSilence = 3;               // times kMakeTime_ns, until a way here counts as blocked
constexpr std::size_t kMaxStreams = 256;  // what a hostile peer can make us remember

// A frame that came before its stream's description. DDS orders the samples of one topic only: who joins gets
// new ones straight, and what was written before by asking for it.
struct Early {
  Bytes cdr;
  dds_sample_info_t sample;
  std::int64_t since_ns;
};

// What is remembered of a stream. It is there while it writes to any topic: DDS marks a topic's instance as
// not alive when its writer leaves, dies or is silent for its lease, and as alive again only with the topic's
// next sample. A writer that was silent (a machine that stood still) and goes on does not send its
// description again: ours still holds.
struct Known {
  std::optional<StreamInfo> info;
  std::array<bool, kTopics.size()> alive{};
  std::array<std::uint64_t, kTopics.size()> writers{};  // of each topic's last sample; 0: none yet
  std::int64_t heard_ns = 0;                            // the last sample of any
  bool told = false;  // the info callback was called, and the gone callback not since

  bool live() const { return std::find(alive.begin(), alive.end(), true) != alive.end(); }
  FrameOrder order;
  std::vector<Early> early;
  bool undescribed = false;  // its frames have waited for a description long enough
};

class DdsSubscriber final : public Subscriber {
 public:
  static Result<std::unique_ptr<Subscriber>> open(const DomainOptions& options, const std::string& stream,
                                                  Callbacks callbacks, std::optional<Rung> rung) {
    if (stream.empty() && rung != Rung::kFull)
      return Error{"a rung of the ladder is one stream's: name the stream"};
    if (!stream.empty() && !valid_stream_name(stream)) {
      return Error{"'" + stream +
                   "' cannot name a stream: names are up to 64 letters, digits, '_', '-' and '.'"};
    }
    auto domain = Domain::open(options);
    if (!domain) return domain.error();
    auto subscriber = std::make_unique<DdsSubscriber>();
    if (auto status = subscriber->start(std::move(domain).value(), stream, std::move(callbacks), rung);
        !status) {
      return status.error();
    }
    return std::unique_ptr<Subscriber>(std::move(subscriber));
  }

  ~DdsSubscriber() override {
    if (!thread_.joinable()) return;
    dds_set_guardcondition(stop_.get(), true);
    thread_.join();
  }

  void set_rung(Rung rung) override {
    if (stream_.empty() || !wants_frames() || wanted_rung_.exchange(rung) == rung) return;
    dds_set_guardcondition(change_.get(), true);
  }

  void request_key_frame(const std::string& stream) override {
    relievo_KeyFrameRequest request{};
    request.stream = const_cast<char*>(stream.c_str());  // only read
    if (requests_.get() != 0) dds_write(requests_.get(), &request);
  }

 private:
  Status start(std::shared_ptr<Domain> domain, const std::string& stream, Callbacks callbacks,
               std::optional<Rung> rung) {
    domain_ = std::move(domain);
    stream_ = stream;
    callbacks_ = std::move(callbacks);
    const std::int32_t participant = domain_->participant();
    const auto keep = [](Result<Entity> made, Entity& entity) -> Status {
      if (!made) return made.error();
      entity = std::move(made).value();
      return {};
    };
    if (auto s = keep(create_group(participant, Role::kWatcher, false, stream), group_); !s) return s;
    if (auto s = keep(take_entity(dds_create_waitset(participant), "waitset"), waitset_); !s) return s;
    if (auto s = keep(take_entity(dds_create_guardcondition(participant), "condition"), stop_); !s) return s;
    dds_waitset_attach(waitset_.get(), stop_.get(), 0);
    if (auto s = keep(take_entity(dds_create_guardcondition(participant), "condition"), change_); !s)
      return s;
    dds_waitset_attach(waitset_.get(), change_.get(), 0);
    for (const Topic topic : kTopics) {
      if (topic == Topic::kFrame) continue;
      const auto i = static_cast<std::size_t>(topic);
      if (auto s = keep(create_reader(participant, group_.get(), topic), readers_[i]); !s) return s;
      if (auto s = keep(take_entity(dds_create_readcondition(readers_[i].get(), DDS_ANY_STATE), "condition"),
                        conditions_[i]);
          !s) {
        return s;
      }
      dds_waitset_attach(waitset_.get(), conditions_[i].get(), 0);
    }
    if (wants_frames()) {
      wanted_rung_ = rung.value_or(Rung::kFull);
      if (rung) {
        if (auto s = open_frames(); !s) return s;
      }
      if (auto s = keep(create_group(participant, Role::kWatcher, true, stream), request_group_); !s)
        return s;
      if (auto s =
              keep(create_writer(participant, request_group_.get(), SideTopic::kKeyFrameRequest), requests_);
          !s)
        return s;
    }
    auto notices = SecuredNoticeListener::create(*domain_, stream);
    if (!notices) return notices.error();
    notices_ = std::move(notices).value();
    thread_ = std::thread([this] { run(); });
    return {};
  }

  void run() {
    name_this_thread("subscriber");
    for (;;) {
      dds_attach_t triggered[4];
      const bool in_time = next_ || waits_with_frames() || frames_.asker || early_bytes_ > 0;
      const auto count = dds_waitset_wait(waitset_.get(), triggered, 4,
                                          !ended_.empty() ? kDoubt_ns
                                          : in_time       ? kMakeTime_ns
                                                          : DDS_INFINITY);
      bool stopping = false;
      if (count < 0 || dds_read_guardcondition(stop_.get(), &stopping) < 0 || stopping) return;
      take_change();
      for (const Topic topic : kTopics) take(topic);
      if (waits_with_frames()) begin_with_frames();
      if (next_) take_next();
      if (next_) break_before_make();
      for (FrameLink* const link : {&frames_, next_ ? &*next_ : nullptr})
        if (link != nullptr && link->asker) link->asker->tick(steady_now_ns());
      end_waiting();
      // Only now, so that a stream's last frames come before its end.
      std::erase_if(ended_, [&](const std::string& stream) { return !in_doubt(stream); });
    }
  }

  bool waits_with_frames() const { return wants_frames() && frames_.reader.get() == 0; }

  Status open_frames() {
    auto frames = FrameLink::open(domain_->participant(), stream_, wanted_rung_);
    if (!frames) return frames.error();
    frames_ = *std::move(frames);
    dds_waitset_attach(waitset_.get(), frames_.condition.get(), 0);
    return {};
  }

  // Once it is known what there is to choose from: behind frames that fill the way here it might never be.
  void begin_with_frames() {
    const bool without_status = described_ns_ > 0 && steady_now_ns() - described_ns_ > kStatusTime_ns;
    if (!has_status_ && !without_status) return;
    if (const Status opened = open_frames(); !opened) log_warning("no frames: " + opened.error().message);
  }

  // A rung that is to be read is read beside the one before until that can be let go.
  void take_change() {
    bool changed = false;
    if (dds_take_guardcondition(change_.get(), &changed) < 0 || !changed) return;
    const Rung wanted = wanted_rung_;
    if (waits_with_frames()) return;  // it will begin with that
    if (next_ && next_->rung == wanted) return;
    next_.reset();
    if (wanted == frames_.rung) return;
    auto link = FrameLink::open(domain_->participant(), stream_, wanted);
    if (!link)
      return log_warning("cannot go to quality " + std::string(to_string(wanted)) + ": " +
                         link.error().message);
    next_ = *std::move(link);
    next_since_ns_ = steady_now_ns();
    dds_waitset_attach(waitset_.get(), next_->condition.get(), 0);
  }

  // Where the way here is too narrow for the rung before, nothing of a lower one may come through beside it:
  // that is let go then.
  void break_before_make() {
    if (next_->rung < frames_.rung || steady_now_ns() - next_since_ns_ < kMakeTime_ns) return;
    dds_subscription_matched_status_t matched{};
    dds_get_subscription_matched_status(next_->reader.get(), &matched);
    if (matched.current_count == 0 && !hidden(next_->rung)) return;  // there is no such rung
    frames_ = *std::move(next_);
    next_.reset();
    known_[stream_].alive[static_cast<std::size_t>(Topic::kFrame)] = false;  // until its first sample
    request_key_frame(stream_);
  }

  // Whether the server has the rung, but nothing comes through, not even where its writer is to be found.
  bool hidden(Rung rung) const {
    const bool offered =
        std::any_of(rungs_.begin(), rungs_.end(), [&](const RungStatus& r) { return r.rung == rung; });
    const std::int64_t since_ns = std::max(next_since_ns_, last_frame_ns_);
    return offered && steady_now_ns() - since_ns > kSilence * kMakeTime_ns;
  }

  // Up to its first key frame, from which on it is what is read.
  void take_next() {
    ddsi_serdata* sample = nullptr;
    dds_sample_info_t info;
    while (dds_takecdr(next_->reader.get(), &sample, 1, &info, DDS_ANY_STATE) == 1) {
      const LentBytes bytes(sample);
      const auto frame = info.valid_data ? read_frame_cdr(bytes.span()) : Error{};
      const bool is_key = frame && frame->stream == stream_ && is_key_frame(frame->data);
      if (is_key) {
        frames_ = *std::move(next_);
        next_.reset();
        if (auto status = deliver(Topic::kFrame, bytes.span(), info); !status)
          refuse(Topic::kFrame, status.error());
      }
      ddsi_serdata_unref(sample);
      if (is_key) return take(Topic::kFrame);
    }
  }

  std::int32_t reader(Topic topic) const {
    return topic == Topic::kFrame ? frames_.reader.get() : readers_[static_cast<std::size_t>(topic)].get();
  }

  // Everything there is, but bounded, so that no topic starves the others; nor do a slow client's frames a
  // change of rung, which is to make them fewer.
  void take(Topic topic) {
    if (reader(topic) == 0) return;
    for (int i = 0; i < kMostAtOnce && take_one(topic); ++i) {
      if (topic == Topic::kFrame && (next_ || wanted_rung_ != frames_.rung)) return;
    }
  }

  bool take_one(Topic topic) {
    ddsi_serdata* sample = nullptr;
    dds_sample_info_t info;
    if (dds_takecdr(reader(topic), &sample, 1, &info, DDS_ANY_STATE) != 1) return false;
    if (info.valid_data) {
      const LentBytes bytes(sample);
      if (auto status = deliver(topic, bytes.span(), info); !status) refuse(topic, status.error());
    }
    if (info.instance_state != DDS_IST_ALIVE) end(topic, info.instance_handle);
    ddsi_serdata_unref(sample);
    return true;
  }

  Status deliver(Topic topic, std::span<const std::uint8_t> cdr, const dds_sample_info_t& sample) {
    switch (topic) {
      case Topic::kInfo: {
        auto info = read_info_cdr(cdr);
        if (!info) return info.error();
        if (!wanted(info->stream)) return {};
        Known* known = remember(info->stream, topic, sample);
        if (known == nullptr) return Error{"more streams than can be followed"};
        if (described_ns_ == 0) described_ns_ = steady_now_ns();
        raw(topic, info->stream, cdr, sample);
        known->info = std::move(*info);
        known->told = true;
        if (callbacks_.info) callbacks_.info(*known->info);
        give_early(*known);
        known->undescribed = false;
        return {};
      }
      case Topic::kFrame: {
        auto frame = read_frame_cdr(cdr);
        if (!frame) return frame.error();
        if (!wanted(frame->stream)) return {};
        Known* known = remember(frame->stream, topic, sample);
        if (known == nullptr) return Error{"more streams than can be followed"};
        last_frame_ns_ = steady_now_ns();
        if (frames_.asker) frames_.asker->got(last_frame_ns_);
        if (described(*known) || known->undescribed) {
          give(*known, *frame, cdr, sample);
        } else {
          known->early.push_back({Bytes(cdr.begin(), cdr.end()), sample, last_frame_ns_});
          early_bytes_ += cdr.size();
        }
        return {};
      }
      case Topic::kStatus: {
        auto status = read_status_cdr(cdr);
        if (!status) return status.error();
        if (!wanted(status->stream)) return {};
        Known* known = remember(status->stream, topic, sample);
        if (known == nullptr) return Error{"more streams than can be followed"};
        tell_there(*known);
        has_status_ = true;
        rungs_ = status->rungs;
        raw(topic, status->stream, cdr, sample);
        if (callbacks_.status) callbacks_.status(*status);
        return {};
      }
    }
    return {};
  }

  void give(Known& known, const FrameView& frame, std::span<const std::uint8_t> cdr,
            const dds_sample_info_t& sample) {
    tell_there(known);
    look_at_order(known, frame, sample.publication_handle);
    raw(Topic::kFrame, frame.stream, cdr, sample);
    if (!callbacks_.frame) return;
    FrameMessage message;
    message.sequence = frame.sequence;
    message.number = frame.number;
    message.capture_time_ns = frame.capture_time_ns;
    message.publish_time_ns = frame.publish_time_ns;
    message.data = std::make_shared<const Bytes>(frame.data.begin(), frame.data.end());
    message.rung = frames_.rung;
    callbacks_.frame(frame.stream, message);
  }

  // By who is still there, or was only silent.
  bool described(const Known& known) const {
    return known.info &&
           (known.alive[static_cast<std::size_t>(Topic::kInfo)] || has_writer(known, Topic::kInfo));
  }

  void give_early(Known& known) {
    for (const Early& early : std::exchange(known.early, {})) {
      early_bytes_ -= early.cdr.size();
      if (const auto frame = read_frame_cdr(early.cdr)) give(known, *frame, early.cdr, early.sample);
    }
  }

  // A stream may have no description: its frames do not wait for ever.
  void end_waiting() {
    if (early_bytes_ == 0) return;
    const bool too_many = early_bytes_ > kMaxEarly_bytes;
    for (auto& [stream, known] : known_) {
      if (known.early.empty()) continue;
      known.undescribed = too_many || steady_now_ns() - known.early.front().since_ns > kDescriptionTime_ns;
      if (known.undescribed) give_early(known);
    }
  }

  bool wants_frames() const { return callbacks_.frame || callbacks_.raw || callbacks_.lost; }
  bool wanted(const std::string& stream) const { return stream_.empty() || stream == stream_; }

  // The stream of a sample, which shows whether it is there.
  Known* remember(const std::string& stream, Topic topic, const dds_sample_info_t& sample) {
    if (known_.count(stream) == 0) {
      if (known_.size() >= kMaxStreams) {
        std::erase_if(known_,
                      [](const auto& entry) { return !entry.second.live() && entry.second.early.empty(); });
        std::erase_if(stream_of_, [&](const auto& entry) { return known_.count(entry.second) == 0; });
      }
      if (known_.size() >= kMaxStreams) return nullptr;
    }
    Known& known = known_[stream];
    known.alive[static_cast<std::size_t>(topic)] = sample.instance_state == DDS_IST_ALIVE;
    known.writers[static_cast<std::size_t>(topic)] = sample.publication_handle;
    known.heard_ns = steady_now_ns();
    stream_of_[{topic, sample.instance_handle}] = stream;
    return &known;
  }

  void tell_there(Known& known) {
    if (known.told || !known.info || !known.live()) return;
    known.told = true;
    if (callbacks_.info) callbacks_.info(*known.info);
  }

  void look_at_order(Known& known, const FrameView& frame, std::uint64_t writer) {
    const bool was_mixed = known.order.is_mixed();
    const std::uint64_t lost = known.order.add(reader(Topic::kFrame), writer, frame.sequence);
    if (lost > 0 && callbacks_.lost) callbacks_.lost(frame.stream, lost);
    if (known.order.is_mixed() && !was_mixed)
      log_warning("two servers in this domain have a stream named '" + std::string(frame.stream) +
                  "': what is received is of both by turns. Give one of them another name");
  }

  void raw(Topic topic, const std::string& stream, std::span<const std::uint8_t> cdr,
           const dds_sample_info_t& sample) {
    if (!callbacks_.raw) return;
    callbacks_.raw({topic, stream, sample.source_timestamp, utc_now_ns(), Bytes(cdr.begin(), cdr.end()),
                    steady_now_ns()});
  }

  void end(Topic topic, std::uint64_t instance) {
    const auto stream = stream_of_.find({topic, instance});
    if (stream == stream_of_.end()) return;
    ended_.insert(stream->second);
    const auto known = known_.find(stream->second);
    if (known != known_.end()) known->second.alive[static_cast<std::size_t>(topic)] = false;
  }

  // Tells where it is gone. True: not known yet. When a participant deletes the writer with its shortest
  // lease, Cyclone (0.10) lets the next one's end at once, and so on through all: each other stream of that
  // server seems to be gone until its next sample. A lease that did run out had no sample for as long.
  bool in_doubt(const std::string& stream) {
    const auto found = known_.find(stream);
    if (found == known_.end() || found->second.live() || !found->second.told) return false;
    if (steady_now_ns() - found->second.heard_ns < kLiveliness_ns && has_writer(found->second)) return true;
    give_early(found->second);
    found->second.told = false;
    if (callbacks_.gone) callbacks_.gone(stream);
    return false;
  }

  // Whether one is there, alive or silent.
  bool has_writer(const Known& known) const {
    return std::any_of(kTopics.begin(), kTopics.end(), [&](Topic topic) { return has_writer(known, topic); });
  }

  bool has_writer(const Known& known, Topic topic) const {
    const std::uint64_t writer = known.writers[static_cast<std::size_t>(topic)];
    if (writer == 0 || reader(topic) == 0) return false;
    auto* const endpoint = dds_get_matched_publication_data(reader(topic), writer);
    if (endpoint != nullptr) dds_builtintopic_free_endpoint(endpoint);
    return endpoint != nullptr;
  }

  void refuse(Topic topic, const Error& error) {
    ++refused_;
    const std::string line = "refused a sample on " + topic_type(topic).topic_name + ": " + error.message;
    if (refused_ == 1) {
      log_warning(line + " (further ones are logged with -v only)");
    } else {
      log_debug(line + " (" + std::to_string(refused_) + " so far)");
    }
  }

  std::string stream_;
  Callbacks callbacks_;
  std::shared_ptr<Domain> domain_;
  Entity group_;
  std::array<Entity, kTopics.size()> readers_;  // but of frames
  std::array<Entity, kTopics.size()> conditions_;
  std::atomic<Rung> wanted_rung_{Rung::kFull};
  std::unique_ptr<SecuredNoticeListener> notices_;
  Entity request_group_;
  Entity requests_;
  Entity stop_, change_;
  Entity waitset_;
  std::thread thread_;
  // Of the thread alone, once it runs:
  FrameLink frames_;
  std::optional<FrameLink> next_;  // that it is to be
  std::int64_t next_since_ns_ = 0;
  std::int64_t last_frame_ns_ = 0;
  std::int64_t described_ns_ = 0;  // 0: not yet
  bool has_status_ = false;
  std::vector<RungStatus> rungs_;  // that the last one told of
  std::map<std::string, Known> known_;
  std::map<std::pair<Topic, std::uint64_t>, std::string> stream_of_;  // by a topic's instance
  std::set<std::string> ended_;                                       // streams that may be gone
  std::size_t early_bytes_ = 0;                                       // of all streams
  std::uint64_t refused_ = 0;
};

}  // namespace

Result<std::unique_ptr<Subscriber>> Subscriber::create(const DomainOptions& domain, const std::string& stream,
                                                       Callbacks callbacks, std::optional<Rung> rung) {
  return DdsSubscriber::open(domain, stream, std::move(callbacks), rung);
}

}  // namespace relievo
