// SPDX-License-Identifier: Apache-2.0
// What readers under Fast DDS share.
#pragma once

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <memory>

/// On the loopback alone, where tests are. By itself it names its other addresses there.
inline eprosima::fastdds::dds::DomainParticipantQos on_loopback() {
  auto qos = eprosima::fastdds::dds::PARTICIPANT_QOS_DEFAULT;
  const auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.push_back("127.0.0.1");
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  return qos;
}
