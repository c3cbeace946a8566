// SPDX-License-Identifier: Apache-2.0
// What a suite measured, and its two ways out: a table for people, JSON for programs.
#pragma once

#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace relievo::bench {

/// A measured quantity: never one value alone.
struct Spread {
  std::size_t n = 0;  // measurements; all else is 0 where it is 0
  double median = 0, p10 = 0, p90 = 0, p99 = 0, min = 0, max = 0;
};
Spread spread_of(std::vector<double> values);

/// std::monostate: does not apply, JSON null.
using Value = std::variant<std::monostate, bool, double, std::string, Spread>;

struct Figure {
  std::string key;  // of JSON, unit at its end; "a.b" becomes an object a with the key b
  Value value;
};

/// A line of the table of codecs, say. All rows of a report have the same keys.
struct Row {
  std::string name;
  std::vector<Figure> figures;
};

struct Report {
  std::string suite;
  std::vector<Figure> settings;  // what was asked for
  std::vector<Figure> figures;   // what was measured, the reference among it
  std::vector<Row> rows;
  std::vector<std::string> notes;  // how to read it
};

/// On stdout. Adds the machine: processor, cores, load when the report is printed.
void print(const Report& report, bool as_json);

}  // namespace relievo::bench
