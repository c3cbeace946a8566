// SPDX-License-Identifier: Apache-2.0
// Proves: a stream's server hears what its clients decode, over real DDS, also beside clients and servers
// that know nothing of it; what peers say is bounded, and their sums are right through restarts of either.
#include "idl/client_reports.h"

#include <dds/dds.h>
#include <gtest/gtest.h>

#include "base/time.h"
#include "idl/domain.h"
#include "idl/topics.h"
#include "idl/transport.h"
#include "old_clock.h"
#include "relievo.h"
#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/streams.h"
#include "tests/unit/idl/old_peer.h"

namespace relievo {
namespace {

const DomainOptions kDomain{test::own_domain(), "lo"};

ClientReport report(std::uint64_t id, int frames) {
  ClientReport out{.client = "here:1", .id = id, .lost = 3, .skipped = 4};
  for (int i = 0; i < frames; ++i) out.decode.add(0.004);
  for (int i = 0; i < frames; ++i) out.decoded_after.add(0.025);
  return out;
}
std::uint64_t count(const Histogram& h) {
  std::uint64_t sum = 0;
  for (const std::uint64_t n : h.counts) sum += n;
  return sum;
}

TEST(ClientReportBook, SumsWhatClientsDidSinceTheyWereFirstHeard) {
  ClientReportBook book;
  book.add(report(1, 100), 0);  // 100 at a server before this one
  book.add(report(2, 0), 0);
  book.add(report(1, 130), 1);
  book.add(report(2, 7), 1);
  ClientReports all = book.reports(1);
  ASSERT_EQ(all.clients.size(), 2U);
  EXPECT_EQ(count(all.clients[0].decode), 130U);
  EXPECT_EQ(count(all.decode), 37U);
  EXPECT_EQ(count(all.decoded_after), 37U);
  EXPECT_NEAR(all.decode.sum_s, 37 * 0.004, 1e-9);

  const std::int64_t later_ns = ClientReportBook::kForget_ns + 2;
  all = book.reports(later_ns);
  EXPECT_TRUE(all.clients.empty());
  EXPECT_EQ(count(all.decode), 37U) << "what was decoded was";
  book.add(report(2, 9), later_ns);
  EXPECT_EQ(count(book.reports(later_ns).decode), 37U);
  book.add(report(2, 4), later_ns);  // impossible: the same client has begun once
  book.add(report(2, 6), later_ns);
  EXPECT_EQ(count(book.reports(later_ns).decode), 39U);
}

TEST(ClientReportBook, IsBounded) {
  ClientReportBook book;
  for (std::uint64_t id = 0; id < 2 * ClientReportBook::kMaxClients; ++id) book.add(report(id, 1), 0);
  EXPECT_EQ(book.reports(0).clients.size(), ClientReportBook::kMaxClients);
  ClientReport hostile = report(1, 2);
  hostile.client = "\n\x01" + std::string(100000, '\xff');
  book.add(hostile, 1);
  const ClientReports all = book.reports(1);
  EXPECT_EQ(all.clients[1].client, std::string(ClientReportBook::kMaxName, '?'));
  book.add(report(99999, 1), ClientReportBook::kForget_ns + 1);
  EXPECT_EQ(book.reports(ClientReportBook::kForget_ns + 1).clients.size(), 2U) << "room comes back";
}

TEST(ClientReports, TheServerHearsWhatItsClientsDecode) {
  const auto publisher = Publisher::create(kDomain, test::example_info("told"));
  const auto one = ClockProbe::create(kDomain, "told");
  const auto other = ClockProbe::create(kDomain, "told");
  const auto asks_only = ClockProbe::create(kDomain, "told");
  ASSERT_TRUE(publisher && one && other && asks_only);
  int frames = 0;
  EXPECT_TRUE(test::eventually([&] {
    (*asks_only)->ask();
    (*one)->ask(report(0, ++frames));
    (*other)->ask(report(0, 2 * frames));
    const ClientReports heard = (*publisher)->client_reports();
    return heard.clients.size() == 2 && count(heard.decode) >= 3;
  }));
  ClientReports heard = (*publisher)->client_reports();
  for (const ClientReport& client : heard.clients) {
    EXPECT_NE(client.client.find(":" + std::to_string(getpid())), std::string::npos) << client.client;
    EXPECT_EQ(client.lost, 3U);
    EXPECT_EQ(client.skipped, 4U);
    EXPECT_NEAR(client.decode.sum_s, 0.004 * static_cast<double>(count(client.decode)), 1e-9);
    EXPECT_EQ(client.decoded_after.counts[5], count(client.decode)) << "25 ms each";
  }
  EXPECT_NE(heard.clients[0].id, heard.clients[1].id);
}

test::OldPeer old_peer(const std::string& stream, Role role) {
  return {{.domain = kDomain,
           .stream = stream,
           .role = role,
           .writes = role == Role::kWatcher,
           .topic = "relievo/clock_question"},
          relievo_old_ClockQuestion_desc,
          relievo_ClockQuestion_desc,
          Qos(dds_create_qos())};
}

TEST(ClientReports, AnOldClientIsAnsweredByANewServer) {
  const auto publisher = Publisher::create(kDomain, test::example_info("newer"));
  ASSERT_TRUE(publisher);
  const test::OldPeer client = old_peer("newer", Role::kWatcher);
  const auto domain = Domain::open(kDomain);
  const auto group = create_group((*domain)->participant(), Role::kWatcher, false, "newer");
  const auto answers = create_reader((*domain)->participant(), group->get(), SideTopic::kClockAnswer);
  ASSERT_TRUE(answers);
  char stream[] = "newer";
  const relievo_old_ClockQuestion question{.stream = stream, .asker = 77, .asked_ns = 5};
  bool answered = false;
  EXPECT_TRUE(test::eventually([&] {
    dds_write(client.end(), &question);
    take_all(answers->get(), [&](const void* sample) {
      const auto& answer = *static_cast<const relievo_ClockAnswer*>(sample);
      if (answer.asker == 77 && answer.asked_ns == 5) answered = true;
    });
    return answered;
  }));
  EXPECT_TRUE((*publisher)->client_reports().clients.empty());
}

TEST(ClientReports, AnOldServerUnderstandsANewClient) {
  const test::OldPeer server = old_peer("older", Role::kServer);
  const auto probe = ClockProbe::create(kDomain, "older");
  ASSERT_TRUE(probe);
  bool asked = false, told = false;
  int asks = 0;
  EXPECT_TRUE(test::eventually([&] {
    if (++asks % 2 == 0)
      (*probe)->ask();
    else
      (*probe)->ask(report(0, 5));
    take_all(server.end(), [&](const void* sample) {
      const auto& question = *static_cast<const relievo_old_ClockQuestion*>(sample);
      if (question.stream == std::string("older") && question.asked_ns > 0)
        (asks % 2 == 0 ? asked : told) = true;
    });
    return asked && told;
  }));
}

}  // namespace
}  // namespace relievo
