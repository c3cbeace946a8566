// SPDX-License-Identifier: Apache-2.0
// Recorders killed at random moments. RELIEVO_KILLS=200 in the environment: so many, and what is lost is
// judged by the clock too, for which the machine must be idle.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <sstream>

#include "base/time.h"
#include "codec/recording.h"
#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;
using test::program;

constexpr int kAtOnce = 4;
constexpr int kFewKills = 12;
constexpr int kKillsOfAStream = 40;  // a publisher ends itself after ten minutes
constexpr double kMostLost_s = 1;

/// Lines as of tests/e2e/mcap_js/list.mjs.
using Listing = std::multiset<std::string>;

std::uint32_t fnv1a(const Bytes& bytes) {
  std::uint32_t hash = 2166136261U;
  for (const std::uint8_t byte : bytes) hash = (hash ^ byte) * 16777619U;
  return hash;
}

struct Read {
  Listing listing;
  std::int64_t last_ns = 0;  // log time
};

Read read(const fs::path& file) {
  Read out;
  const auto reader = RecordingReader::open(file);
  EXPECT_TRUE(reader.ok()) << (reader ? "" : reader.error().message);
  while (reader) {
    const auto message = (*reader)->next();
    EXPECT_TRUE(message.ok()) << (message ? "" : message.error().message);
    if (!message || !*message) break;
    const RecordedMessage& m = **message;
    std::ostringstream line;
    line << (*reader)->summary().channels[m.channel].topic << ' ' << m.sequence << ' ' << m.log_time_ns << ' '
         << m.publish_time_ns << ' ' << m.data.size() << ' ' << fnv1a(m.data);
    out.listing.insert(line.str());
    out.last_ns = std::max(out.last_ns, m.log_time_ns);
  }
  return out;
}

/// By @mcap/core; nothing where node or its packages are not there.
std::optional<std::map<std::string, Listing>> list_by_node(const std::vector<fs::path>& files) {
  const fs::path folder = RELIEVO_MCAP_JS;
  if (!fs::exists(folder / "node_modules" / "@mcap" / "core")) return std::nullopt;
  std::vector<std::string> command{"/usr/bin/env", "node", folder / "list.mjs"};
  command.insert(command.end(), files.begin(), files.end());
  const auto done = test::run(command, test::kLongPatience);
  EXPECT_EQ(done.status, 0) << done.err;
  std::map<std::string, Listing> out;
  Listing* current = nullptr;
  std::istringstream lines(done.out);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("= ")) {
      current = &out[line.substr(2)];
    } else if (current != nullptr) {
      current->insert(line);
    }
  }
  return out;
}

struct Killed {
  fs::path file;
  std::int64_t killed_ns = 0;
};

/// Recorders of the same stream, each killed at its own moment after its file appeared.
std::vector<Killed> kill_some(const std::string& stream, const test::TempFolder& folder,
                              std::mt19937& random) {
  std::vector<std::unique_ptr<test::Process>> recorders;
  std::vector<Killed> killed;
  for (int i = 0; i < kAtOnce; ++i) {
    killed.push_back({folder / (std::to_string(i) + ".mcap"), 0});
    recorders.push_back(std::make_unique<test::Process>(
        std::vector<std::string>{program("relievo"), "record", stream, "--out", killed.back().file,
                                 "--domain", std::to_string(test::own_domain()), "--interface", "lo"}));
  }
  for (std::size_t i = 0; i < killed.size(); ++i) {
    EXPECT_TRUE(test::wait_for_size(killed[i].file, 1)) << recorders[i]->err();
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 1'000'000));
    killed[i].killed_ns = utc_now_ns();
    recorders[i]->signal(SIGKILL);
    EXPECT_EQ(recorders[i]->wait(), 128 + SIGKILL) << recorders[i]->err();
  }
  return killed;
}

TEST(RecordKill, AtAnyMomentEveryFileOpensAndReadersAgree) {
  const char* const wanted = std::getenv("RELIEVO_KILLS");
  const int kills = wanted == nullptr ? kFewKills : std::atoi(wanted);
  const test::TempFolder folder;
  std::unique_ptr<test::Process> server;
  std::mt19937 random(wanted == nullptr ? 1 : std::random_device{}());
  double most_lost_s = 0;
  std::size_t messages = 0;
  std::string stream;
  for (int done = 0; done < kills; done += kAtOnce) {
    if (done % kKillsOfAStream == 0) {
      stream = "face" + std::to_string(done);
      server = std::make_unique<test::Process>(std::vector<std::string>{
          program("test_publisher"), stream, std::to_string(test::own_domain()), "20000", "60", "1000000"});
    }
    const test::TempFolder copies;
    std::vector<fs::path> files;
    std::map<std::string, Listing> ours;
    for (const Killed& killed : kill_some(stream, folder, random)) {
      const Read found = read(killed.file);
      messages += found.listing.size();
      if (found.last_ns > 0) most_lost_s = std::max(most_lost_s, seconds(killed.killed_ns - found.last_ns));
      ours[killed.file] = found.listing;
      files.push_back(killed.file);
      if (found.listing.empty()) continue;
      const fs::path copy = copies / killed.file.filename();
      const auto recovered = test::run({program("relievo"), "recover", killed.file, "--out", copy});
      ASSERT_EQ(recovered.status, 0) << recovered.err;
      ours[copy] = found.listing;
      files.push_back(copy);
    }
    const auto theirs = list_by_node(files);
    EXPECT_EQ(theirs.value_or(ours), ours);
    for (const fs::path& file : files) fs::remove(file);
  }
  EXPECT_GT(messages, 0u);
  RecordProperty("most_lost_s", std::to_string(most_lost_s));
  std::printf("%d kills: %zu messages read alike, at most %.2f s lost\n", kills, messages, most_lost_s);
  EXPECT_TRUE(wanted == nullptr || most_lost_s <= kMostLost_s);
}

}  // namespace
}  // namespace relievo
