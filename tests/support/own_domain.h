// SPDX-License-Identifier: Apache-2.0
// DDS domains of tests that run side by side.
#pragma once

namespace relievo::test {

/// A DDS domain that no other test of this machine has: this process's, and its children's, for as long as
/// any of them lives; streams there are plain unless a test says otherwise. Throws where all are taken.
int own_domain();

}  // namespace relievo::test
