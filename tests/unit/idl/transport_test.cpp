// SPDX-License-Identifier: Apache-2.0
// Real DDS on the loopback interface.
#include "idl/transport.h"
#include "idl/cdr.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <condition_variable>
#include <mutex>

#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/process.h"
#include "tests/support/streams.h"

namespace relievo {
namespace {

using testing::HasSubstr;

const DomainOptions kDomain{test::own_domain(), "lo"};

// Everything a subscriber was told, with bounded waits for more.
class Inbox {
 public:
  enum class Presence { kThere, kGone };
  struct Received {
    std::vector<StreamInfo> infos;
    std::vector<std::pair<std::string, FrameMessage>> frames;
    std::vector<ServerStatus> statuses;
    std::vector<RawSample> raw;
    std::vector<std::string> gone;
    std::vector<Presence> presence;  // info and gone callbacks, in their order

    bool there() const { return !presence.empty() && presence.back() == Presence::kThere; }
    bool was_there_and_is_gone() const { return !presence.empty() && presence.back() == Presence::kGone; }
    // However often a starved machine lets a stream lapse: it is gone only after it was there.
    bool plausible() const {
      Presence last = Presence::kGone;
      for (const Presence p : presence) {
        if (p == Presence::kGone && last == Presence::kGone) return false;
        last = p;
      }
      return true;
    }
    std::vector<std::pair<std::string, std::uint64_t>> lost;
  };

  Subscriber::Callbacks callbacks(bool raw_too = false) {
    Subscriber::Callbacks c;
    c.info = [this](const StreamInfo& i) {
      add([&] {
        received_.infos.push_back(i);
        received_.presence.push_back(Presence::kThere);
      });
    };
    c.frame = [this](const std::string& s, const FrameMessage& f) {
      add([&] { received_.frames.emplace_back(s, f); });
    };
    c.status = [this](const ServerStatus& s) { add([&] { received_.statuses.push_back(s); }); };
    c.gone = [this](const std::string& s) {
      add([&] {
        received_.gone.push_back(s);
        received_.presence.push_back(Presence::kGone);
      });
    };
    c.lost = [this](const std::string& s, std::uint64_t n) {
      add([&] { received_.lost.emplace_back(s, n); });
    };
    if (raw_too) c.raw = [this](const RawSample& s) { add([&] { received_.raw.push_back(s); }); };
    return c;
  }
  /// Until `condition(const Received&)`.
  template <typename Condition>
  bool wait(Condition condition) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, test::kPatience, [&] { return condition(std::as_const(received_)); });
  }
  /// A copy: more may come meanwhile.
  Received now() {
    std::lock_guard lock(mutex_);
    return received_;
  }

 private:
  template <typename Add>
  void add(Add add_one) {
    std::lock_guard lock(mutex_);
    add_one();
    changed_.notify_all();
  }
  std::mutex mutex_;
  std::condition_variable changed_;
  Received received_;
};

template <typename T>
std::unique_ptr<T> expect_made(Result<std::unique_ptr<T>> result) {
  if (!result) ADD_FAILURE() << result.error().message;
  return result ? std::move(result).value() : nullptr;
}

template <typename AnyPublisher>
bool wait_for_readers(const AnyPublisher& publisher, int count) {
  return test::eventually([&] { return publisher.matched_readers() >= count; });
}

TEST(Transport, DescriptionAndStatusReachALateJoiner) {
  StreamInfo info = test::example_info("late");
  info.rig.field_order = FieldOrder::kBottom;
  info.rig.stereo_rms_px = 0.25;
  info.rig.scale_error = 5e-4;
  info.rig.camera_gamma = 2.2;
  info.rig.world_from_camera = {.rotation = {0, -1, 0, 1, 0, 0, 0, 0, 1}, .translation = {1.5, -0.25, 2}};
  info.pattern.scheme = Scheme::kWhiteFrame;
  auto publisher = expect_made(Publisher::create(kDomain, info));
  ASSERT_TRUE(publisher);
  ServerStatus status;
  status.stream = "late";
  status.state = StreamState::kStalled;
  status.message = "no camera";
  status.drops_encode = 7;
  status.latency_ms = 12.5;
  status.bit_rate = 3.5e6;
  status.rate_level = 4;
  status.rungs = {{.rung = Rung::kReduced,
                   .readers = 3,
                   .frames = 5'000'000'000,
                   .drops = 2,
                   .encode_ms = 1.5,
                   .bit_rate = 2e6},
                  {.rung = Rung::kTexture, .frames = 7}};
  status.step = {.mixed = 7, .regrouped = 5'000'000'000, .phase = 1.25, .drift_fields_s = -0.06};
  status.filters.unsupported = 3;
  status.filters.small_component = 5'000'000'000;
  ASSERT_TRUE(publisher->publish(status).ok());

  Inbox inbox;
  auto subscriber = expect_made(Subscriber::create(kDomain, "late", inbox.callbacks()));
  ASSERT_TRUE(inbox.wait([&](auto& r) { return !r.infos.empty() && !r.statuses.empty(); }));
  const StreamInfo got = inbox.now().infos[0];
  EXPECT_EQ(got.stream, "late");
  EXPECT_EQ(got.source, info.source);
  EXPECT_EQ(got.started_ns, info.started_ns);
  EXPECT_EQ(to_yaml(got.rig), to_yaml(info.rig));
  EXPECT_EQ(to_yaml(got.pattern), to_yaml(info.pattern));
  EXPECT_EQ(inbox.now().statuses[0].state, StreamState::kStalled);
  EXPECT_EQ(inbox.now().statuses[0].message, "no camera");
  EXPECT_EQ(inbox.now().statuses[0].rungs, status.rungs);
  EXPECT_EQ(inbox.now().statuses[0].drops_encode, 7u);
  EXPECT_EQ(inbox.now().statuses[0].latency_ms, 12.5);
  EXPECT_EQ(inbox.now().statuses[0].bit_rate, 3.5e6);
  EXPECT_EQ(inbox.now().statuses[0].rate_level, 4u);
  EXPECT_EQ(inbox.now().statuses[0].filters, status.filters);
  EXPECT_EQ(inbox.now().statuses[0].step, status.step);
}

void expect_frames_arrive(std::size_t size, int count) {
  auto publisher = expect_made(Publisher::create(kDomain, test::example_info("frames")));
  Inbox inbox;
  auto subscriber = expect_made(Subscriber::create(kDomain, "frames", inbox.callbacks()));
  ASSERT_TRUE(publisher && subscriber && wait_for_readers(*publisher, 1));
  for (int i = 0; i < count; ++i) {
    const auto sent = test::example_frame(static_cast<std::uint64_t>(i), size);
    ASSERT_TRUE(publisher->publish(sent).ok());
    // One at a time: what is proved is order and bytes, not what the machine can carry.
    ASSERT_TRUE(inbox.wait([&](auto& r) { return static_cast<int>(r.frames.size()) > i; })) << "frame " << i;
    const auto [stream, frame] = inbox.now().frames.back();
    EXPECT_EQ(stream, "frames");
    EXPECT_EQ(frame.sequence, sent.sequence);
    EXPECT_EQ(frame.number, sent.number);
    EXPECT_EQ(frame.capture_time_ns, sent.capture_time_ns);
    EXPECT_EQ(frame.publish_time_ns, sent.publish_time_ns);
    EXPECT_EQ(*frame.data, *sent.data);
  }
  EXPECT_TRUE(inbox.now().lost.empty());
}

TEST(Transport, SmallFramesArriveInOrderWithEqualBytes) {
  expect_frames_arrive(1000, 50);
}

TEST(Transport, LargeFramesArriveInOrderWithEqualBytes) {
  expect_frames_arrive(3'000'000, 8);
}

TEST(Transport, EmptyFrameArrives) {
  expect_frames_arrive(0, 2);
}

TEST(Transport, GapInTheSequenceIsReportedOnce) {
  auto publisher = expect_made(Publisher::create(kDomain, test::example_info("gap")));
  Inbox inbox;
  auto subscriber = expect_made(Subscriber::create(kDomain, "gap", inbox.callbacks()));
  ASSERT_TRUE(publisher && subscriber && wait_for_readers(*publisher, 1));
  for (const std::uint64_t sequence :
       {5u, 6u, 10u, 11u, 0u, 1u}) {  // joined late; lost 7 to 9; started again
    ASSERT_TRUE(publisher->publish(test::example_frame(sequence, 100)).ok());
  }
  ASSERT_TRUE(inbox.wait([&](auto& r) { return r.frames.size() == 6; }));
  EXPECT_THAT(inbox.now().lost, testing::ElementsAre(testing::Pair("gap", 3u)));
}

TEST(Transport, AKeyFrameIsWantedByWhoJoinsAndByWhoAsks) {
  std::atomic<int> wanted = 0;
  std::atomic<int> wanted_of_other = 0;
  auto publisher = expect_made(Publisher::create(kDomain, test::example_info("keys"), [&] { ++wanted; }));
  auto other =
      expect_made(Publisher::create(kDomain, test::example_info("other"), [&] { ++wanted_of_other; }));
  Inbox inbox;
  auto one = expect_made(Subscriber::create(kDomain, "keys", inbox.callbacks()));
  ASSERT_TRUE(publisher && other && one);
  EXPECT_TRUE(test::eventually([&] { return wanted == 1; })) << "nobody told that a reader joined";

  // Asked until heard: the first requests are lost while DDS matches their writer.
  EXPECT_TRUE(test::eventually([&] {
    one->request_key_frame("keys");
    return wanted >= 2;
  }));
  EXPECT_EQ(wanted_of_other, 0);
  auto all = expect_made(Subscriber::create(kDomain, "", inbox.callbacks()));
  ASSERT_TRUE(all && test::eventually([&] { return wanted_of_other == 1; }));
  EXPECT_TRUE(test::eventually([&] {
    all->request_key_frame("other");
    return wanted_of_other >= 2;
  }));
}

TEST(Transport, StreamsAreToldApart) {
  auto one = expect_made(Publisher::create(kDomain, test::example_info("one")));
  auto two = expect_made(Publisher::create(kDomain, test::example_info("two")));
  Inbox of_one, of_all;
  auto subscriber = expect_made(Subscriber::create(kDomain, "one", of_one.callbacks()));
  auto everything = expect_made(Subscriber::create(kDomain, "", of_all.callbacks()));
  ASSERT_TRUE(one && two && subscriber && everything);
  ASSERT_TRUE(wait_for_readers(*one, 2) && wait_for_readers(*two, 1));
  EXPECT_EQ(two->matched_readers(), 1) << "a reader of one stream must not be sent another's frames";
  ASSERT_TRUE(two->publish(test::example_frame(0, 10)).ok());
  ASSERT_TRUE(one->publish(test::example_frame(1, 10)).ok());
  ASSERT_TRUE(of_one.wait([&](auto& r) { return r.frames.size() == 1; }));
  ASSERT_TRUE(of_all.wait([&](auto& r) { return r.frames.size() == 2 && r.infos.size() == 2; }));
  EXPECT_EQ(of_one.now().frames[0].first, "one");
  EXPECT_EQ(of_one.now().frames[0].second.sequence, 1u);
  EXPECT_EQ(of_one.now().infos.size(), 1u);
}

TEST(Transport, NameAlreadyLiveIsRefused) {
  auto first = expect_made(Publisher::create(kDomain, test::example_info("taken")));
  ASSERT_TRUE(first);
  const auto second = Publisher::create(kDomain, test::example_info("taken"));
  ASSERT_FALSE(second.ok());
  EXPECT_THAT(second.error().message,
              HasSubstr("'taken' is already live in this domain: give another --domain"));
  EXPECT_FALSE(RawPublisher::create(kDomain, "taken").ok());
  first.reset();
  EXPECT_TRUE(Publisher::create(kDomain, test::example_info("taken")).ok());
}

TEST(Transport, BadOptionsAreRefused) {
  EXPECT_FALSE(Publisher::create(kDomain, test::example_info("no spaces")).ok());
  EXPECT_FALSE(Publisher::create({-1, "lo"}, test::example_info("a")).ok());
  EXPECT_FALSE(Subscriber::create({231, "lo"}, "a", {}).ok());
  EXPECT_FALSE(Subscriber::create({kDomain.domain, "no-such-if0"}, "a", {}).ok());
}

TEST(Transport, WriterThatLeavesIsGoneAndMayComeBack) {
  Inbox inbox;
  auto subscriber = expect_made(Subscriber::create(kDomain, "", inbox.callbacks()));
  auto publisher = expect_made(Publisher::create(kDomain, test::example_info("back")));
  ASSERT_TRUE(inbox.wait([&](auto& r) { return r.there(); }));
  publisher.reset();
  ASSERT_TRUE(inbox.wait([&](auto& r) { return r.was_there_and_is_gone(); }));
  EXPECT_EQ(inbox.now().gone[0], "back");
  publisher = expect_made(Publisher::create(kDomain, test::example_info("back")));
  EXPECT_TRUE(inbox.wait([&](auto& r) { return r.there(); }));
  EXPECT_TRUE(inbox.now().plausible());
}

test::Process start_publisher(const std::string& stream, const std::vector<std::string>& more) {
  std::vector<std::string> command = {test::program("test_publisher"), stream,
                                      std::to_string(kDomain.domain)};
  command.insert(command.end(), more.begin(), more.end());
  return test::Process(command);
}

TEST(Transport, FramesOfAnotherProcessAllArrive) {
  Inbox inbox;
  auto subscriber = expect_made(Subscriber::create(kDomain, "other", inbox.callbacks()));
  // As many as a writer keeps for readers that lag: fewer than that are never lost.
  constexpr std::uint64_t kFrames = 8;
  const auto process = start_publisher("other", {"500000", "20", std::to_string(kFrames), "1"});
  ASSERT_TRUE(inbox.wait([&](auto& r) { return r.frames.size() == kFrames; })) << process.err();
  for (std::uint64_t i = 0; i < kFrames; ++i) {
    EXPECT_EQ(*inbox.now().frames[i].second.data, *test::example_frame(i, 500'000).data);
  }
  EXPECT_TRUE(inbox.now().lost.empty());
}

TEST(Transport, KilledWriterIsGone) {
  Inbox inbox;
  auto subscriber = expect_made(Subscriber::create(kDomain, "victim", inbox.callbacks()));
  auto process = start_publisher("victim", {"1000", "100", "5", "1"});
  ASSERT_TRUE(inbox.wait([&](auto& r) { return r.frames.size() == 5 && r.there(); })) << process.err();
  process.signal(SIGKILL);
  ASSERT_TRUE(process.wait());
  ASSERT_TRUE(inbox.wait([&](auto& r) { return r.was_there_and_is_gone(); }));
  EXPECT_EQ(inbox.now().gone[0], "victim");
  EXPECT_TRUE(inbox.now().plausible());
}

// How often a frame has another size than the one before: from one server to the other.
std::ptrdiff_t changes(const std::vector<std::pair<std::string, FrameMessage>>& frames) {
  std::ptrdiff_t times = 0;
  for (std::size_t i = 1; i < frames.size(); ++i)
    times += frames[i].second.data->size() != frames[i - 1].second.data->size();
  return times;
}

// As where their networks were apart: neither could hear of the other before it was live.
TEST(Transport, TwoOfOneNameAreToldOfEachOther) {
  Inbox inbox;
  auto subscriber = expect_made(Subscriber::create(kDomain, "both", inbox.callbacks()));
  auto first = start_publisher("both", {"1000", "100", "100000"});
  ASSERT_TRUE(inbox.wait([&](auto& r) { return r.there(); })) << first.err();
  first.signal(SIGSTOP);
  ASSERT_TRUE(inbox.wait([&](auto& r) { return r.was_there_and_is_gone(); }));
  auto second = start_publisher("both", {"2000", "100", "100000"});
  ASSERT_TRUE(second.wait_for_text("live")) << second.err();
  EXPECT_THAT(second.err(), testing::Not(HasSubstr("another server")));
  testing::internal::CaptureStderr();
  first.signal(SIGCONT);
  for (test::Process* one : {&first, &second})
    EXPECT_TRUE(one->wait_for_text("another server in this domain has a stream named 'both', too"))
        << one->err();
  EXPECT_TRUE(inbox.wait([](auto& r) { return changes(r.frames) >= 3; }));
  const std::string told = testing::internal::GetCapturedStderr();
  EXPECT_THAT(told, HasSubstr("two servers in this domain have a stream named 'both'"));
}

// A writer that stood still for longer than its lease, and then died for good.
void expect_lapse_return_and_end(test::Process& process, Inbox& inbox) {
  ASSERT_TRUE(inbox.wait([&](auto& r) { return r.there(); })) << process.err();
  process.signal(SIGSTOP);
  ASSERT_TRUE(inbox.wait([&](auto& r) { return r.was_there_and_is_gone(); }));
  process.signal(SIGCONT);
  ASSERT_TRUE(inbox.wait([&](auto& r) { return r.there(); }));
  EXPECT_EQ(to_yaml(inbox.now().infos.back().pattern), to_yaml(inbox.now().infos[0].pattern));
  process.signal(SIGKILL);
  ASSERT_TRUE(process.wait());
  EXPECT_TRUE(inbox.wait([&](auto& r) { return r.was_there_and_is_gone(); })) << "dead, and still there";
  EXPECT_TRUE(inbox.now().plausible());
}

TEST(Transport, PausedWriterComesBackWithItsDescriptionAndIsGoneAgainWhenKilled) {
  Inbox inbox;
  auto subscriber = expect_made(Subscriber::create(kDomain, "paused", inbox.callbacks()));
  auto process = start_publisher("paused", {"1000", "20", "100000", "1"});
  ASSERT_TRUE(inbox.wait([&](auto& r) { return r.frames.size() >= 5; })) << process.err();
  expect_lapse_return_and_end(process, inbox);
}

TEST(Transport, PausedWriterComesBackForAReaderOfNoFrames) {
  Inbox inbox;
  Subscriber::Callbacks callbacks = inbox.callbacks();
  callbacks.frame = nullptr;
  callbacks.lost = nullptr;
  auto subscriber = expect_made(Subscriber::create(kDomain, "listed", callbacks));
  auto process = start_publisher("listed", {"1000", "20", "100000"});
  ASSERT_TRUE(inbox.wait([&](auto& r) { return !r.statuses.empty(); })) << process.err();
  expect_lapse_return_and_end(process, inbox);
}

// A description, a status and three frames, as a reader gets them.
std::vector<RawSample> samples_of(const std::string& stream) {
  auto publisher = expect_made(Publisher::create(kDomain, test::example_info(stream)));
  Inbox inbox;
  auto subscriber = expect_made(Subscriber::create(kDomain, stream, inbox.callbacks(true)));
  if (!publisher || !subscriber) return {};
  EXPECT_TRUE(wait_for_readers(*publisher, 1));
  ServerStatus status;
  status.stream = stream;
  EXPECT_TRUE(publisher->publish(status).ok());
  for (std::uint64_t i = 0; i < 3; ++i)
    EXPECT_TRUE(publisher->publish(test::example_frame(i, 100'001 + i)).ok());
  EXPECT_TRUE(inbox.wait([&](auto& r) { return r.raw.size() == 5; }));
  return inbox.now().raw;
}

TEST(Transport, RawSamplesAreReplayedByteForByte) {
  const std::vector<RawSample> recorded = samples_of("tape");
  ASSERT_EQ(recorded.size(), 5U);
  for (const RawSample& sample : recorded) {
    if (sample.topic != Topic::kFrame) continue;
    EXPECT_EQ(write_frame_cdr(*read_frame_cdr(sample.cdr)), sample.cdr) << "as DDS itself writes it";
  }
  EXPECT_EQ(recorded[0].stream, "tape");
  EXPECT_GT(recorded[0].source_time_ns, 0);
  auto player = expect_made(RawPublisher::create(kDomain, "tape"));
  Inbox inbox;
  auto subscriber = expect_made(Subscriber::create(kDomain, "tape", inbox.callbacks(true)));
  ASSERT_TRUE(player && subscriber && wait_for_readers(*player, 1));
  for (const RawSample& sample : recorded) {
    const auto status = player->publish(sample);
    ASSERT_TRUE(status.ok()) << status.error().message;
  }
  ASSERT_TRUE(inbox.wait([&](auto& r) { return r.raw.size() == recorded.size(); }));
  const std::vector<RawSample> replayed = inbox.now().raw;
  for (const RawSample& sample : recorded) {
    EXPECT_TRUE(
        std::any_of(replayed.begin(), replayed.end(),
                    [&](const RawSample& got) { return got.topic == sample.topic && got.cdr == sample.cdr; }))
        << "topic " << static_cast<int>(sample.topic);
  }
  // A sample's raw callback comes before its typed one.
  EXPECT_TRUE(inbox.wait([&](auto& r) { return r.frames.size() == 3; }));

  RawSample bad = recorded[0];
  bad.cdr.resize(bad.cdr.size() / 2);
  EXPECT_FALSE(player->publish(bad).ok());
  RawSample other = recorded[0];
  other.cdr[12] = 'T';  // the key: "Tape"
  EXPECT_FALSE(player->publish(other).ok());
}

std::vector<Topic> topics_of(const std::vector<RawSample>& samples) {
  std::vector<Topic> topics;
  for (const RawSample& sample : samples) topics.push_back(sample.topic);
  return topics;
}

// Its frames come long before its description, as to who joins by a way that loses the latter's first
// sending.
void publish_late_described(RawPublisher& player, const std::vector<RawSample>& samples) {
  std::vector<RawSample> late;
  for (const RawSample& sample : samples) {
    if (sample.topic == Topic::kInfo) late.push_back(sample);
    if (sample.topic == Topic::kFrame) {
      EXPECT_TRUE(player.publish(sample).ok());
    }
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  for (const RawSample& sample : late) EXPECT_TRUE(player.publish(sample).ok());
}

TEST(Transport, FramesThatOvertookTheDescriptionWaitForIt) {
  const std::vector<RawSample> samples = samples_of("overtaken");
  const std::vector<Topic> in_order = {Topic::kInfo, Topic::kFrame, Topic::kFrame, Topic::kFrame};
  Inbox inbox;
  auto subscriber = expect_made(Subscriber::create(kDomain, "overtaken", inbox.callbacks(true)));
  ASSERT_TRUE(subscriber);
  for (int server = 1; server <= 2; ++server) {  // the second one is not described by the first
    auto player = expect_made(RawPublisher::create(kDomain, "overtaken"));
    ASSERT_TRUE(player && wait_for_readers(*player, 1));
    publish_late_described(*player, samples);
    ASSERT_TRUE(inbox.wait([&](auto& r) { return r.frames.size() == 3U * server; }));
    const std::vector<RawSample> got = inbox.now().raw;
    EXPECT_EQ(topics_of({got.end() - 4, got.end()}), in_order) << "of server " << server;
    player.reset();
    ASSERT_TRUE(inbox.wait([&](auto& r) { return r.gone.size() == std::size_t(server); }));
  }
  EXPECT_TRUE(inbox.now().lost.empty());
}

TEST(Transport, FramesOfAStreamWithoutADescriptionComeYet) {
  const std::vector<RawSample> samples = samples_of("unknown");
  Inbox inbox;
  auto subscriber = expect_made(Subscriber::create(kDomain, "unknown", inbox.callbacks()));
  auto player = expect_made(RawPublisher::create(kDomain, "unknown"));
  ASSERT_TRUE(subscriber && player && wait_for_readers(*player, 1));
  for (const RawSample& sample : samples) {
    if (sample.topic == Topic::kFrame) {
      EXPECT_TRUE(player->publish(sample).ok());
    }
  }
  EXPECT_TRUE(inbox.wait([](auto& r) { return r.frames.size() == 3; }));
  EXPECT_TRUE(inbox.now().infos.empty());
}

}  // namespace
}  // namespace relievo
