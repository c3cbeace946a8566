// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "base/counted.h"
#include "base/json_text.h"
#include "base/log.h"
#include "cli/checks.h"
#include "client/commands.h"
#include "client/input.h"
#include "client/latest_frame.h"
#include "client/options.h"
#include "client/ros/messages.h"
#include "idl/keys.h"
#include "idl/ros_publisher.h"

namespace relievo {
namespace {

constexpr std::chrono::seconds kPatience{5};  // until it is said that nothing comes

struct Options {
  std::shared_ptr<DomainOptions> domain;
  std::string stream;
  std::optional<int> ros_domain;
  std::uint64_t frames = 0;  // 0: no limit
  bool in_plain = false;
  bool json = false;
};

/// Nodes of ROS have no keys of ours: whoever encrypts a stream is to say that it may go on without.
Status check_may_be_plain(const Options& options) {
  const auto keys = find_keys(options.domain->keys);
  if (!keys) return keys.error();
  if (!*keys || options.in_plain) return {};
  return Error{"the stream is read with the keys in " + (*keys)->string() +
               ", and what ROS hears is not encrypted: give --in-plain if all on the network may have it"};
}

Result<std::unique_ptr<RosPublisher>> open_publisher(const Options& options, const std::string& name) {
  std::vector<RosPublication> publications;
  for (const RosTopicType& type : ros_topic_types())
    publications.push_back({ros_topic_name(type, name), type.type});
  DomainOptions domain = *options.domain;
  if (options.ros_domain && *options.ros_domain != domain.domain) {
    domain.domain = *options.ros_domain;
    domain.keys = "none";
  }
  auto publisher = RosPublisher::open(domain, publications);
  if (publisher)
    for (const RosPublication& publication : publications)
      log_info(publication.topic + ": " + publication.type + ", ROS domain " + std::to_string(domain.domain));
  return publisher;
}

/// What nobody reads is not made.
Status publish(const LatestFrame::Taken& taken, const std::string& name, RosPublisher& publisher,
               std::array<std::uint64_t, 4>& sent) {
  for (std::size_t i = 0; i < sent.size(); ++i) {
    if (!publisher.has_readers(i)) continue;
    auto message = ros_message(ros_topic_types()[i].topic, taken.frame, name, &taken.rig);
    if (!message) return message.error();
    if (!*message) continue;
    if (auto status = publisher.publish(i, **message); !status) return status;
    ++sent[i];
  }
  return {};
}

void report(const Options& options, const std::string& name, std::uint64_t frames,
            const std::array<std::uint64_t, 4>& sent) {
  if (!options.json) {
    std::printf("%s, of which ROS read %llu as points\n", counted(frames, "frame").c_str(),
                static_cast<unsigned long long>(sent[0]));
    return;
  }
  nlohmann::json messages;
  for (std::size_t i = 0; i < sent.size(); ++i)
    messages[ros_topic_name(ros_topic_types()[i], name)] = sent[i];
  const nlohmann::json j = {{"stream", options.stream}, {"frames", frames}, {"messages", messages}};
  std::puts(json_text(j).c_str());
}

Status run(const Options& options, StopSignal& stop) {
  if (auto may = check_may_be_plain(options); !may) return may;
  LatestFrame latest;
  auto subscriber = Subscriber::create(*options.domain, options.stream, latest.callbacks());
  if (!subscriber) return subscriber.error();
  const std::string name = ros_name(options.stream);
  auto publisher = open_publisher(options, name);
  if (!publisher) return publisher.error();
  std::uint64_t frames = 0;
  std::array<std::uint64_t, 4> sent{};
  bool came = true;  // a frame, of late
  while (!stop.stopped() && (options.frames == 0 || frames < options.frames)) {
    const auto taken = latest.take(kPatience, stop);
    if (!taken) {
      if (came && !stop.stopped()) log_info("no frame of '" + options.stream + "' comes: waiting for it");
      came = false;
      continue;
    }
    came = true;
    if (auto status = publish(*taken, name, **publisher, sent); !status) return status;
    ++frames;
  }
  report(options, name, frames, sent);
  return {};
}

}  // namespace

Command ros2_command() {
  return {
      "ros2", "Give a live stream to ROS 2: points, picture and camera as its nodes read them",
      [](CLI::App& app) {
        auto options = std::make_shared<Options>();
        options->domain = add_domain_options(app);
        app.add_option("stream", options->stream, "Name of the stream; waited for where it is not there")
            ->type_name("NAME")
            ->required();
        app.add_option("--ros-domain", options->ros_domain, "ROS_DOMAIN_ID of the nodes (default: --domain)")
            ->check(CLI::Range(0, 230));
        app.add_option("--frames", options->frames, "Stop after this many frames")->check(number(1, 1e15));
        app.add_flag(
            "--in-plain", options->in_plain,
            "Of a stream that is encrypted: ROS has no keys of ours, and all may hear what it hears");
        app.add_flag("--json", options->json, "At the end, what was sent as JSON");
        app.final_callback([options] { check_stream(options->stream); });
        app.footer(
            "Examples:\n"
            "  relievo ros2 face\n"
            "  relievo ros2 face --domain 5 --ros-domain 0\n"
            "  rviz2: add /face/points, fixed frame `face`");
        return [options](StopSignal& stop) { return run(*options, stop); };
      }};
}

}  // namespace relievo
