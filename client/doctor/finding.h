// SPDX-License-Identifier: Apache-2.0
// What `relievo doctor` finds, one thing looked at each.
#pragma once

#include <string>
#include <string_view>

namespace relievo {

struct Finding {
  enum class Grade {
    kGood,
    kAdvice,   // works; better otherwise
    kTrouble,  // something that Relievo does will fail
  };
  Grade grade = Grade::kGood;
  std::string check;  // what was looked at: "receive buffer"
  std::string found;  // one line, with units
  std::string mend;   // what to do; empty where all is good
};

constexpr std::string_view to_string(Finding::Grade grade) {
  switch (grade) {
    case Finding::Grade::kGood:
      return "good";
    case Finding::Grade::kAdvice:
      return "advice";
    case Finding::Grade::kTrouble:
      return "trouble";
  }
  return "";
}

}  // namespace relievo
