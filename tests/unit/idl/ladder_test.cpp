// SPDX-License-Identifier: Apache-2.0
// Proves: rungs of a stream travel to who reads them and nobody else, and a reader changes between them
// without a pause and without counting a loss. Real DDS on the loopback interface, frames of the real codec.
#include <gtest/gtest.h>

#include <mutex>

#include "codec/frame3d_codec.h"
#include "idl/transport.h"
#include "tests/support/make_grid.h"
#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/streams.h"

namespace relievo {
namespace {

using test::eventually;

const DomainOptions kDomain{test::own_domain(), "lo"};

/// What a reader got, in order.
struct Inbox {
  struct Got {
    Rung rung;
    std::uint64_t sequence;
    bool key;
  };
  mutable std::mutex mutex;
  std::vector<Got> got;
  std::uint64_t lost = 0;
  int infos = 0;
  std::vector<RungStatus> rungs;

  Subscriber::Callbacks callbacks() {
    Subscriber::Callbacks c;
    c.info = [this](const StreamInfo&) { set([&] { ++infos; }); };
    c.status = [this](const ServerStatus& s) { set([&] { rungs = s.rungs; }); };
    c.lost = [this](const std::string&, std::uint64_t n) { set([&] { lost += n; }); };
    c.frame = [this](const std::string&, const FrameMessage& f) {
      set([&] { got.push_back({f.rung, f.sequence, is_key_frame(*f.data)}); });
    };
    return c;
  }
  template <typename Set>
  void set(const Set& what) {
    const std::lock_guard lock(mutex);
    what();
  }
  std::size_t count(Rung rung) const {
    const std::lock_guard lock(mutex);
    return static_cast<std::size_t>(
        std::count_if(got.begin(), got.end(), [&](const Got& g) { return g.rung == rung; }));
  }
  std::vector<Got> all() const {
    const std::lock_guard lock(mutex);
    return got;
  }
};

/// A stream and one lower rung of it, whose frames build on each other.
class LadderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto made =
        Publisher::create(kDomain, test::example_info("ladder"), [this] { full_.request_key_frame(); });
    ASSERT_TRUE(made) << made.error().message;
    publisher_ = *std::move(made);
    auto rung =
        RungPublisher::create(kDomain, "ladder", Rung::kReduced, [this] { reduced_.request_key_frame(); });
    ASSERT_TRUE(rung) << rung.error().message;
    rung_ = *std::move(rung);
  }
  std::unique_ptr<Subscriber> read(Inbox& inbox, const std::string& stream,
                                   std::optional<Rung> rung = Rung::kFull) {
    auto made = Subscriber::create(kDomain, stream, inbox.callbacks(), rung);
    EXPECT_TRUE(made);
    return made ? *std::move(made) : nullptr;
  }
  /// The next frame of both.
  void publish() {
    const auto send = [&](FrameEncoder& encoder, auto& publisher, std::uint64_t& sequence) {
      const auto bytes = encoder.encode(test::grid_frame({.width = 320, .height = 240, .stripes = 20}),
                                        {.geometry = GeometryCodec::kGrid, .key_interval = 1000});
      ASSERT_TRUE(bytes);
      FrameMessage message;
      message.sequence = sequence++;
      message.data = std::make_shared<const Bytes>(*bytes);
      EXPECT_TRUE(publisher.publish(message));
    };
    send(full_, *publisher_, full_sequence_);
    if (rung_) send(reduced_, *rung_, reduced_sequence_);
  }
  bool publish_until(const std::function<bool()>& condition) {
    return eventually([&] {
      publish();
      return condition();
    });
  }

  const test::GridScene scene_{.width = 320, .height = 240, .stripes = 20};
  FrameEncoder full_{test::grid_rig(scene_), test::grid_pattern(scene_)};
  FrameEncoder reduced_{test::grid_rig(scene_), test::grid_pattern(scene_)};
  std::uint64_t full_sequence_ = 0, reduced_sequence_ = 1'000'000;
  std::unique_ptr<Publisher> publisher_;
  std::unique_ptr<RungPublisher> rung_;
};

TEST_F(LadderTest, EachReaderGetsItsRungAlone) {
  Inbox full, reduced, everything;
  const auto a = read(full, "ladder"), b = read(reduced, "ladder", Rung::kReduced), c = read(everything, "");
  ASSERT_TRUE(
      eventually([&] { return publisher_->matched_readers() >= 2 && rung_->matched_readers() >= 1; }));
  EXPECT_EQ(publisher_->matched_readers(), 2) << "of the full stream: that one, and who reads all";
  EXPECT_EQ(rung_->matched_readers(), 1);
  ASSERT_TRUE(publish_until([&] {
    return full.count(Rung::kFull) >= 5 && reduced.count(Rung::kReduced) >= 5 &&
           everything.count(Rung::kFull) >= 5;
  }));
  EXPECT_EQ(full.count(Rung::kReduced), 0U);
  EXPECT_EQ(reduced.count(Rung::kFull), 0U);
  EXPECT_EQ(everything.count(Rung::kReduced), 0U);
  for (const auto& g : reduced.all()) EXPECT_GE(g.sequence, 1'000'000U);
  EXPECT_TRUE(eventually([&] { return reduced.infos > 0; })) << "the description is the stream's";
}

TEST_F(LadderTest, AReaderGoesDownAndUpWithoutAPauseOrALoss) {
  Inbox inbox;
  const auto reader = read(inbox, "ladder");
  ASSERT_TRUE(publish_until([&] { return inbox.count(Rung::kFull) >= 3; }));
  reader->set_rung(Rung::kReduced);
  ASSERT_TRUE(publish_until([&] { return inbox.count(Rung::kReduced) >= 3; }));
  EXPECT_TRUE(eventually([&] { return publisher_->matched_readers() == 0; })) << "the rung before is let go";
  const std::size_t before = inbox.count(Rung::kFull);
  reader->set_rung(Rung::kFull);
  ASSERT_TRUE(publish_until([&] { return inbox.count(Rung::kFull) >= before + 3; }));
  EXPECT_TRUE(eventually([&] { return rung_->matched_readers() == 0; }));
  const auto got = inbox.all();
  int changes = 0;
  for (std::size_t i = 1; i < got.size(); ++i) {
    if (got[i].rung == got[i - 1].rung) {
      EXPECT_EQ(got[i].sequence, got[i - 1].sequence + 1);
      continue;
    }
    ++changes;
    EXPECT_TRUE(got[i].key) << "what comes first of a rung must decode alone";
  }
  EXPECT_EQ(changes, 2);
  EXPECT_EQ(inbox.lost, 0U);
}

TEST_F(LadderTest, WhereThereIsNoSuchRungTheOneBeforeGoesOn) {
  Inbox inbox;
  const auto reader = read(inbox, "ladder");
  ASSERT_TRUE(publish_until([&] { return inbox.count(Rung::kFull) >= 1; }));
  reader->set_rung(Rung::kTexture);
  const std::size_t before = inbox.count(Rung::kFull);
  ASSERT_TRUE(publish_until([&] { return inbox.count(Rung::kFull) >= before + 20; }));
  reader->set_rung(Rung::kFull);  // and changes its mind
  reader->set_rung(Rung::kReduced);
  ASSERT_TRUE(publish_until([&] { return inbox.count(Rung::kReduced) >= 1; }));
}

// Frames of the full rung before that would fill a narrow way, and what there is to choose from be late.
TEST_F(LadderTest, WhoLeavesItOpenHearsFirstWhatThereIs) {
  ServerStatus status;
  status.stream = "ladder";
  status.rungs = {{.rung = Rung::kReduced}};
  Inbox inbox;
  Subscriber* made = nullptr;
  std::mutex made_first;
  auto callbacks = inbox.callbacks();
  callbacks.status = [&](const ServerStatus& s) {
    const std::lock_guard lock(made_first);
    if (!s.rungs.empty()) made->set_rung(Rung::kReduced);
  };
  std::unique_ptr<Subscriber> reader;
  {
    const std::lock_guard lock(made_first);
    auto subscriber = Subscriber::create(kDomain, "ladder", callbacks, std::nullopt);
    ASSERT_TRUE(subscriber);
    reader = *std::move(subscriber);
    made = reader.get();
  }
  ASSERT_TRUE(publisher_->publish(status));
  ASSERT_TRUE(publish_until([&] { return inbox.count(Rung::kReduced) >= 3; }));
  EXPECT_EQ(inbox.count(Rung::kFull), 0U);
}

TEST_F(LadderTest, WhoLeavesItOpenGetsAStreamThatHasNoStatus) {
  Inbox inbox;
  const auto reader = read(inbox, "ladder", std::nullopt);
  EXPECT_TRUE(publish_until([&] { return inbox.count(Rung::kFull) >= 3; }));
}

TEST_F(LadderTest, TheSlowRungHasAFrameForEachThatItsReaderAskedFor) {
  auto made = RungPublisher::create(kDomain, "ladder", Rung::kSlow, [this] { reduced_.request_key_frame(); });
  ASSERT_TRUE(made) << made.error().message;
  rung_ = *std::move(made);
  EXPECT_FALSE(rung_->due());
  Inbox inbox;
  auto reader = read(inbox, "ladder", Rung::kSlow);
  std::size_t sent = 0;
  ASSERT_TRUE(eventually([&] {
    if (rung_->due()) {
      publish();
      ++sent;
    }
    return inbox.count(Rung::kSlow) >= 5;
  }));
  EXPECT_LE(sent, inbox.count(Rung::kSlow) + 1) << "one is under way at most";
  EXPECT_EQ(inbox.lost, 0U);
  reader.reset();
  EXPECT_TRUE(eventually([&] {
    if (rung_->due()) publish();  // what it asked for before it left
    return rung_->matched_readers() == 0 && !rung_->due();
  }));
}

TEST_F(LadderTest, TheEndOfTheServerIsNoticedOnALowerRungToo) {
  Inbox inbox;
  std::atomic<bool> gone{false};
  auto callbacks = inbox.callbacks();
  callbacks.gone = [&](const std::string&) { gone = true; };
  auto reader = Subscriber::create(kDomain, "ladder", callbacks);
  ASSERT_TRUE(reader);
  ASSERT_TRUE(publish_until([&] { return inbox.count(Rung::kFull) >= 1; }));
  (*reader)->set_rung(Rung::kReduced);
  ASSERT_TRUE(publish_until([&] { return inbox.count(Rung::kReduced) >= 1; }));
  rung_.reset();
  publisher_.reset();
  EXPECT_TRUE(eventually([&] { return gone.load(); }));
}

TEST(Ladder, ARungIsOfOneStream) {
  EXPECT_FALSE(Subscriber::create(kDomain, "", {}, Rung::kReduced));
}

}  // namespace
}  // namespace relievo
