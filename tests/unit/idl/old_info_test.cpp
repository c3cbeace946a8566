// SPDX-License-Identifier: Apache-2.0
// Proves: servers and readers of different versions understand each other's descriptions, over real DDS.
#include <dds/dds.h>
#include <gtest/gtest.h>

#include <mutex>
#include <utility>
#include <vector>

#include "base/rig.h"
#include "idl/domain.h"
#include "idl/topics.h"
#include "idl/transport.h"
#include "old_info.h"
#include "relievo.h"
#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/streams.h"
#include "tests/unit/idl/old_peer.h"

namespace relievo {
namespace {

const DomainOptions kDomain{test::own_domain(), "lo"};

test::OldPeer old_peer(const std::string& stream, Role role) {
  const bool writes = role == Role::kServer;
  Qos qos(dds_create_qos());
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos.get(), DDS_DURABILITY_TRANSIENT_LOCAL);
  if (writes) dds_qset_liveliness(qos.get(), DDS_LIVELINESS_AUTOMATIC, DDS_SECS(2));
  return {{.domain = kDomain, .stream = stream, .role = role, .writes = writes, .topic = "relievo/info"},
          relievo_old_StreamInfo_desc,
          relievo_StreamInfo_desc,
          std::move(qos)};
}

TEST(OldDescription, AnOldReaderUnderstandsOneOfACameraWithAGamma) {
  StreamInfo info = test::example_info("newer");
  info.rig.camera_gamma = 2.2;
  info.rig.scale_error = 5e-4;
  const auto publisher = Publisher::create(kDomain, info);
  ASSERT_TRUE(publisher) << publisher.error().message;
  const test::OldPeer reader = old_peer("newer", Role::kWatcher);
  bool read = false;
  EXPECT_TRUE(test::eventually([&] {
    take_all(reader.end(), [&](const void* sample) {
      const auto& got = *static_cast<const relievo_old_StreamInfo*>(sample);
      EXPECT_EQ(got.rig.scale_error, 5e-4);
      EXPECT_EQ(got.pattern.stripes._length, info.pattern.sequence.size()) << "what lies behind the rig";
      read = true;
    });
    return read;
  }));
}

TEST(OldDescription, OfAnOldServerIsOfACameraWithoutAGamma) {
  const test::OldPeer writer = old_peer("older", Role::kServer);
  char stream[] = "older", source[] = "sim:face";
  std::uint8_t palette[] = {1, 2};
  std::uint32_t stripes[] = {0, 3};
  relievo_old_StreamInfo old{.stream = stream, .source = source};
  old.rig.frame_rate = 29.97;
  for (auto* model : {&old.rig.camera, &old.rig.projector}) model->width = model->height = 64;
  old.pattern.colours = old.pattern.slides = 2;
  old.pattern.palette = {2, 2, palette, false};
  old.pattern.stripes = {2, 2, stripes, false};
  ASSERT_EQ(dds_write(writer.end(), &old), DDS_RETCODE_OK);

  std::mutex mutex;
  std::vector<StreamInfo> got;
  Subscriber::Callbacks callbacks;
  callbacks.info = [&](const StreamInfo& info) {
    const std::lock_guard lock(mutex);
    got.push_back(info);
  };
  const auto subscriber = Subscriber::create(kDomain, "older", std::move(callbacks));
  ASSERT_TRUE(subscriber) << subscriber.error().message;
  ASSERT_TRUE(test::eventually([&] {
    const std::lock_guard lock(mutex);
    return !got.empty();
  }));
  const std::lock_guard lock(mutex);
  EXPECT_EQ(got[0].rig.camera_gamma, 1);
  EXPECT_EQ(got[0].rig.frame_rate, 29.97);
  EXPECT_EQ(got[0].pattern.sequence, (std::vector<int>{0, 3}));
}

}  // namespace
}  // namespace relievo
