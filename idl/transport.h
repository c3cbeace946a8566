// SPDX-License-Identifier: Apache-2.0
// The stream's topics over Cyclone DDS: publisher, subscriber, raw samples for recording and replay. Types:
// idl/relievo.idl; names and QoS: idl/topics.h.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/client_report.h"
#include "base/clock_offset.h"
#include "base/refused_peers.h"
#include "base/result.h"
#include "base/stream.h"

namespace relievo {

struct DomainOptions {
  int domain = 0;
  std::string interface;  // IP address or name; empty: Cyclone's own choice
  // Folder of the keys with which all is authenticated and encrypted (idl/keys.h); empty: where find_keys()
  // finds some; "none": in plain.
  std::string keys;
};

/// Which of a stream's topics a sample belongs to.
enum class Topic : std::uint8_t { kInfo, kFrame, kStatus };

/// A sample exactly as on the wire: CDR with its 4-byte encapsulation header.
struct RawSample {
  Topic topic{};
  std::string stream;               // the key
  std::int64_t source_time_ns = 0;  // the writer's time stamp
  std::int64_t receive_time_ns = 0;
  Bytes cdr;
  std::int64_t steady_time_ns = 0;  // when it was received, by the monotonic clock; 0: not known

  /// By a clock that nobody sets while a program runs, where that is known.
  std::int64_t even_time_ns() const { return steady_time_ns > 0 ? steady_time_ns : receive_time_ns; }
};

/// The self-contained OMG IDL of a topic's type, its name and its DDS topic name ("relievo/frame").
struct TopicType {
  std::string type_name;
  std::string topic_name;
  std::string idl;
};
const TopicType& topic_type(Topic topic);

/// By all that this process does over DDS. Any thread.
RefusedPeers refused_peers();

/// Writes one stream. Any thread, one call at a time.
class Publisher {
 public:
  /// Publishes `info` for late joiners at once. Fails where another live writer in the domain has that stream
  /// name. `key_frame_wanted`, where given, is called when a reader of the frames joined or asked for one: on
  /// a thread of DDS, so it must return at once and not call back; never after the destructor has returned.
  /// `clock` says what time it is to clients that compare theirs (ClockProbe), on such a thread too; empty:
  /// the system's UTC.
  static Result<std::unique_ptr<Publisher>> create(const DomainOptions& domain, const StreamInfo& info,
                                                   std::function<void()> key_frame_wanted = {},
                                                   std::function<std::int64_t()> clock = {});
  virtual ~Publisher() = default;

  /// Serialises and sends on the caller's thread and keeps nothing of the argument. Never waits for a reader;
  /// fails where the socket takes nothing for 0.1 s.
  virtual Status publish(const FrameMessage& frame) = 0;
  virtual Status publish(const ServerStatus& status) = 0;
  /// Readers of the frames, in all processes.
  virtual int matched_readers() const = 0;
  /// Of frames, to readers that asked for them again. Any thread.
  virtual std::uint64_t sent_again_bytes() const = 0;
  /// What clients say that they decode of it. Any thread.
  virtual ClientReports client_reports() const = 0;
};

/// Writes a lower rung of a stream's quality ladder, beside the Publisher of the stream itself; its readers
/// have the description and status from there. Any thread, one call at a time.
class RungPublisher {
 public:
  /// `key_frame_wanted` as of Publisher::create(), when a reader joined.
  static Result<std::unique_ptr<RungPublisher>> create(const DomainOptions& domain, const std::string& stream,
                                                       Rung rung, std::function<void()> key_frame_wanted);
  virtual ~RungPublisher() = default;
  /// As Publisher::publish().
  virtual Status publish(const FrameMessage& frame) = 0;
  virtual int matched_readers() const = 0;
  /// Whether a frame is to be published now. False of kSlow until its readers have asked for one, which must
  /// decode alone.
  virtual bool due() = 0;
};

/// Writes recorded samples unchanged: the bytes readers get are the recorded ones. But a server's status
/// comes without the qualities that it offered then. Any thread, one call at a time.
class RawPublisher {
 public:
  /// Fails as Publisher::create() does.
  static Result<std::unique_ptr<RawPublisher>> create(const DomainOptions& domain, const std::string& stream);
  virtual ~RawPublisher() = default;
  /// Fails on bytes that are no sample of the topic, or of another stream.
  virtual Status publish(const RawSample& sample) = 0;
  virtual int matched_readers() const = 0;
};

/// Reads one stream, or every stream where the name is empty. Callbacks run on the subscriber's own thread,
/// one at a time, and never after the destructor has returned. Frames that overtook their stream's
/// description wait for it, three seconds at most: a stream may have none. Samples that are malformed,
/// or of a stream with an impossible name, are refused and logged once. Without a frame, raw or lost callback
/// no frame travels.
class Subscriber {
 public:
  struct Callbacks {
    std::function<void(const StreamInfo&)>
        info;  // again when it changes and when a stream that was gone is back
    std::function<void(const std::string& stream, const FrameMessage&)> frame;
    std::function<void(const ServerStatus&)> status;
    std::function<void(const RawSample&)> raw;            // each sample besides, before the typed callback
    std::function<void(const std::string& stream)> gone;  // the stream's writer left or died
    std::function<void(const std::string& stream, std::uint64_t count)> lost;  // gap in the frame sequence
  };
  /// `rung`: the one of the ladder whose frames come; another than kFull needs a name. Description and
  /// status are the stream's own. Nothing: the rung that set_rung() was called with when the stream's first
  /// status has come, or else kFull; so that who joins by a narrow way hears what there is before frames
  /// fill it. (A stream that has no status is waited for a second.)
  static Result<std::unique_ptr<Subscriber>> create(const DomainOptions& domain, const std::string& stream,
                                                    Callbacks callbacks,
                                                    std::optional<Rung> rung = Rung::kFull);
  virtual ~Subscriber() = default;

  /// Frames are of this rung soon: those of the one before come until its first key frame is here (of a
  /// lower rung for a second at most, if there is one), so that nothing stands still. Any thread; callbacks
  /// may call it. Does nothing to who reads every stream, or asks for a rung that there is not.
  virtual void set_rung(Rung rung) = 0;

  /// Asks the server of `stream`, which must be one that this reads, for a frame that decodes alone: for who
  /// lost one that others build on. (Who joins gets one unasked.) Any thread; callbacks may call it.
  virtual void request_key_frame(const std::string& stream) = 0;
};

/// Compares this machine's clock with that of a stream's server, and tells that server what is decoded here.
/// Any thread.
class ClockProbe {
 public:
  static Result<std::unique_ptr<ClockProbe>> create(const DomainOptions& domain, const std::string& stream);
  virtual ~ClockProbe() = default;

  /// Once a second or so; the answer comes by itself, or never.
  virtual void ask() = 0;
  /// The same, telling of a client that decodes; its name and id are the probe's to say.
  virtual void ask(const ClientReport& report) = 0;
  /// What the last answers say; nothing where there was none: a server of an older version, or none.
  virtual std::optional<ClockOffset> offset() const = 0;
};

}  // namespace relievo
