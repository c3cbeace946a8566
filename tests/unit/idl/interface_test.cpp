// SPDX-License-Identifier: Apache-2.0
#include "idl/interface.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relievo {
namespace {

using testing::HasSubstr;
using testing::Not;

const NetworkInterface kLoopback{"lo", "127.0.0.1", 65536, true, false};
const NetworkInterface kEthernet{"eth0", "192.0.2.2", 1500, false, true};
const NetworkInterface kTunnel{"tun0", "10.0.0.1", 1400, false, false};
const NetworkInterface kJumbo{"eth1", "192.0.2.3", 9000, false, true};

TEST(Interface, ChoosesAMulticastOneBeforeOthersAndTheLoopbackLast) {
  EXPECT_EQ(choose_interface({kLoopback, kTunnel, kEthernet}, "")->name, "eth0");
  EXPECT_EQ(choose_interface({kLoopback, kTunnel}, "")->name, "tun0");
  EXPECT_EQ(choose_interface({kLoopback}, "")->name, "lo");
  EXPECT_FALSE(choose_interface({}, "").ok());
}

TEST(Interface, FindsTheOneNamedAndSaysWhichThereAre) {
  EXPECT_EQ(choose_interface({kLoopback, kEthernet}, "127.0.0.1")->name, "lo");
  EXPECT_EQ(choose_interface({kLoopback, kEthernet}, "lo")->name, "lo");
  const auto none = choose_interface({kLoopback, kEthernet}, "wlan0");
  ASSERT_FALSE(none.ok());
  EXPECT_THAT(none.error().message, HasSubstr("eth0 (192.0.2.2)"));
}

TEST(Interface, MessagesFitTheMtuWhereTheyCanBeLost) {
  EXPECT_THAT(domain_config(kEthernet), HasSubstr("<MaxMessageSize>1440B</MaxMessageSize>"));
  EXPECT_THAT(domain_config(kEthernet), HasSubstr("<FragmentSize>1300B</FragmentSize>"));
  EXPECT_THAT(domain_config(kTunnel), HasSubstr("<MaxMessageSize>1340B</MaxMessageSize>"));
  EXPECT_THAT(domain_config(kLoopback), HasSubstr("<MaxMessageSize>65500B</MaxMessageSize>"));
  EXPECT_THAT(domain_config(kJumbo), HasSubstr("<FragmentSize>64000B</FragmentSize>"));
}

TEST(Interface, DiscoversWithoutMulticastByAskingTheMachineItself) {
  EXPECT_THAT(domain_config(kLoopback), HasSubstr("<Peer address=\"127.0.0.1\"/>"));
  EXPECT_THAT(domain_config(kEthernet), Not(HasSubstr("<Peer ")));
  EXPECT_THAT(domain_config(kEthernet), HasSubstr("<AllowMulticast>spdp</AllowMulticast>"));
}

TEST(Interface, SaysOftenThatItIsThereWhereOnePacketTellsAll) {
  EXPECT_THAT(domain_config(kEthernet), HasSubstr("<SPDPInterval>2s</SPDPInterval>"));
  EXPECT_THAT(domain_config(kLoopback), Not(HasSubstr("SPDPInterval")));
}

}  // namespace
}  // namespace relievo
